"""Event cycles whose ratio comes nearer and nearer to 1: they shrink by a power of their number.

Where cycles are marginal to first order, the n-th is as long as n**-k. A few of them in a row look like any
that shrink by a ratio 1 - k/n, and would end at a finite time that only moves on with them: for k <= 1 there
is none.
"""

from __future__ import annotations

from math import log

import numpy as np

from filippov.base.arrays import Array
from filippov.solving.state.run import Run

# Cycles of a smaller ratio are steady over a halving of their length, which some of them in a row show.
LEAST_RATIO = 0.9
# Cycles that tell a power, and how far back they are looked at: to where they were so much longer.
LEAST_CYCLES, LONGER = 12, 2.0
# 1 - ratio grows as length**(1/k): the least 1/k that counts, beyond what higher orders make of a ratio.
LEAST_POWER = 0.15
# Rounding of times in the rates of two halves of a history, in spacings of the time.
ROUNDING = 16.0
# The law is looked at again after so many more events, as a part of all.
AGAIN = 1.1


def of_a_power(run: Run, cycle: int, ratio: float) -> bool:
    """Whether the cycles of the surface reached last, of so many of its events, shrink by no steady ratio."""
    if ratio <= LEAST_RATIO:
        return False
    total = run.events.total
    found, until = run.of_a_power
    surface = run.events[-1].index
    if total >= until:
        past = run.events.past(len(run.events))
        times = past.t[(past.surface == surface) & ~past.grazing]
        lengths = np.abs(times[cycle:] - times[:-cycle])[::-1][::cycle]
        found = _power(lengths, abs(run.t)) > LEAST_POWER
        run.of_a_power = found, int(AGAIN * total)
    run.zeno[surface].slow = float(found)
    return found


def _power(lengths: Array, t: float) -> float:
    """1/k, less what rounding makes of it, of lengths that grow back in time; 0 where too few are told."""
    rising = np.flatnonzero(np.diff(lengths) <= 0.0)
    lengths = lengths[: rising[0] + 1] if len(rising) else lengths
    last = min(int(np.searchsorted(lengths, LONGER * lengths[0])), len(lengths) - 1)
    if last < LEAST_CYCLES:
        return 0.0
    middle = last // 2
    near = log(lengths[middle] / lengths[0]) / middle
    far = log(lengths[last] / lengths[middle]) / (last - middle)
    span = 0.5 * log(lengths[last] / lengths[0])
    rounding = ROUNDING * float(np.spacing(t)) / (float(lengths[0]) * middle * near)
    return (log(far / near) - rounding) / span
