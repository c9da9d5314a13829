"""Integer codes shared by the compiled loop and the Python side that drives it.

The records of `loop.state` say where numbers are stored. The file is part of every compiled unit, so it holds
only integer constants.
"""

# Returned by `advance`.
REACHED, RECORDS_FULL, EVENTS_FULL, CHUNK_DONE, STOPPED = 0, 1, 2, 3, 4
GENERAL, ZENO, NOT_FINITE, MIN_STEP, USER_ERROR, NO_SLIDING = 5, 6, 7, 8, 9, 10
# Also returned by `time_slice`: events accumulate, at a known limit.
LIMIT = 11
# Also returned by its parts: go on to the next part, to another step, to the event that was reached.
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
# Returned by `kind_of` for an event that changes the signs of two surfaces.
CORNER = 14

# The order of a guard that stays 0 along a solution that others hold there, off which it does not slide.
ALONG = -4

# Found by `locate`: the guard itself, the upper or lower bound of a multiplier, a tangency of the surface.
# A step that is too long to be resolved: for its guards, or as multipliers have no value in it.
NOTHING, ROOT, UPPER, LOWER, TOUCH = 0, 1, 2, 3, 4
UNRESOLVED, LOST = -3, -2
