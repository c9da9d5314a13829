"""Integer codes shared by the compiled loop and the Python side that drives it.

Where numbers stand say the records of `loop.state`. The file is part of
every compiled unit, so it holds nothing but integer constants.
"""

# What `advance` returns.
REACHED, RECORDS_FULL, EVENTS_FULL, CHUNK_DONE, STOPPED = 0, 1, 2, 3, 4
GENERAL, ZENO, NOT_FINITE, MIN_STEP, USER_ERROR, NO_SLIDING = 5, 6, 7, 8, 9, 10
# What `time_slice` returns besides: events accumulate, at a limit that is told.
LIMIT = 11
# What its parts return besides: on to the next part, to another step, to the event that was reached.
GO_ON, AGAIN, ARRIVED = -1, -2, -3

# Roles of a surface.
SWITCHING, KINK, OBSERVER, RESETTING = 0, 1, 2, 3

# Kinds of event; also the columns of `stop`, which counts down to a terminal event and has two more: those of
# crossings and exits in either direction.
NONE, CROSSING_UP, CROSSING_DOWN, ENTRY, EXIT_UP, EXIT_DOWN, GRAZING, RESET = 0, 1, 2, 3, 4, 5, 6, 7
KINDS = 8
CROSSING_EITHER, EXIT_EITHER = 8, 9
STOPS = 10
# Kinds that only marks of events have: a time event without and with a reset, a surface jumped over.
TIME, TIME_RESET, OVER_UP, OVER_DOWN = 10, 11, 12, 13
# What `kind_of` says of an event that changes the signs of two surfaces.
CORNER = 14

# What `locate` found: the guard itself, the upper or lower bound of a multiplier, a tangency of the surface.
# A step that is too long to tell: for its guards, or as multipliers have no value in it.
NOTHING, ROOT, UPPER, LOWER, TOUCH = 0, 1, 2, 3, 4
UNRESOLVED, LOST = -3, -2
