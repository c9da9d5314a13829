"""How much room there is: trajectories side by side, halvings of a step, signs that are enumerated."""

SPLITS, CHECKS = 10, 2
MOST_ENUMERATED = 6
# Of a step of a series: points inside of it that are looked at, their spacing.
LOOKS, GOLDEN = 8, 0.6180339887498949
# Trajectories side by side in a lane kernel: two vectors keep a processor busier whose vectors hold 8.
LANES, MOST_LANES = 8, 16
# Rules of sliding by name, in the order of their numbers in `rules`.
RULES = ("filippov", "moments", "utkin")
