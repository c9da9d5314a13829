"""Integer codes and array positions shared by the compiled loop and the Python side that drives it.

The loop talks to Python through flat arrays only; these names say what stands where. The file is part of
every compiled unit, so it holds nothing but integer constants.
"""

# Positions in `clock` (float64): what the loop reads and leaves behind about time.
T, T_END, STEP, RTOL, MAX_STEP, T_START, RELATIVE = 0, 1, 2, 3, 4, 5, 6
ROUGH_FROM, ROUGH_SPAN, ROUGH_NOISE, GROW, TREND, SAME_INSTANT = 7, 8, 9, 10, 11, 12
# The square of its error where the next step stands in the scratch already, taken in a lane; else 0.
TAKEN = 13
CLOCK_SIZE = 14

# Positions in `count` (int64): work done, room left in the buffers, and what stopped the loop.
FIELD_CALLS, STEPS, REJECTED, EVENTS, RECORDS, STEP_BUDGET, EVENT_BUDGET = 0, 1, 2, 3, 4, 5, 6
SURFACE, CAUSE, STORE, EVENT_ROOM, RECORD_ROOM = 7, 8, 9, 10, 11
COUNT_SIZE = 12

# Columns of `zeno`, one row a surface: time of its last event, the last three intervals, and for lags of 1, 2
# and 3 events how many intervals in a row were shorter than the one so many events before. Behind them the
# largest difference of the rates on both sides since sliding on the surface began.
WIDEST, ZENO_ROOM = 7, 8

# What `advance` returns.
REACHED, RECORDS_FULL, EVENTS_FULL, CHUNK_DONE, STOPPED = 0, 1, 2, 3, 4
GENERAL, ZENO, NOT_FINITE, MIN_STEP, USER_ERROR, NO_SLIDING = 5, 6, 7, 8, 9, 10

# Roles of a surface.
SWITCHING, KINK, OBSERVER, RESETTING = 0, 1, 2, 3

# Kinds of event; also the columns of `stop`, which counts down to a terminal event and has two more: those of
# crossings and exits in either direction.
NONE, CROSSING_UP, CROSSING_DOWN, ENTRY, EXIT_UP, EXIT_DOWN, GRAZING, RESET = 0, 1, 2, 3, 4, 5, 6, 7
KINDS = 8
CROSSING_EITHER, EXIT_EITHER = 8, 9
STOPS = 10

# What `locate` found: the guard itself, the upper or lower bound of a multiplier, a touching of the surface.
# A step that is too long to tell: for its guards, or as multipliers have no value in it.
NOTHING, ROOT, UPPER, LOWER, TOUCH = 0, 1, 2, 3, 4
UNRESOLVED, LOST = -3, -2
