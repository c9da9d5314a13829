"""Sizes: trajectories side by side, halvings of a step, signs that are enumerated; rounding of numbers."""

from typing import Any

SPLITS, CHECKS = 10, 2
# From 1 to the next number.
EPS = 2.220446049250313e-16
MOST_ENUMERATED = 6
# Trajectories side by side in a lane kernel: two vectors keep a processor busier whose vectors hold 8.
LANES, MOST_LANES = 8, 16
# Of a step of a series: the points inside that are checked, one per lane, spaced by the golden section.
LOOKS: Any = [(0.5 * (5.0**0.5 - 1.0) * (q + 1)) % 1.0 for q in range(LANES)]
MOST_LOOKS = LANES
# Rules of sliding by name, in the order of their numbers in `rules`.
RULES = ("filippov", "moments", "utkin")
