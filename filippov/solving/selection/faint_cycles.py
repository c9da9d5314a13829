"""What the speeds of cycles tell that are no deeper than the tolerance: rounding, or a slide that goes on."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from filippov.solving.state.run import Run

# Of the faint cycles in a row, those that are passed before it is asked again whether they have settled.
PASSED = 1 / 16
# Cycles in a row, how far from alike where they are noise, and how many slow down where they fade.
NOISY_LAPS, ALIKE, FADING_LAPS = 6, 1e-2, 48


def fades(speeds: Sequence[float]) -> bool:
    """Whether each of many cycles was slower than the one before, by whatever law."""
    return len(speeds) >= FADING_LAPS and all(b < a for a, b in pairwise(speeds))


def noise(speeds: Sequence[float]) -> bool:
    """Whether speeds neither grow nor shrink by a law, compared with those 1, 2 and 3 cycles before."""
    if len(speeds) <= NOISY_LAPS:
        return False
    values = np.array(speeds[-NOISY_LAPS - 1 :]) + 1e-300
    ratios = [values[lag:] / values[:-lag] for lag in (1, 2, 3)]
    lawless = all(np.min(r) < 1.0 - ALIKE and np.max(r) > 1.0 + ALIKE for r in ratios)
    return bool(lawless and values[-1] <= np.max(values[:-1]))


def go_on(run: Run, i: int) -> None:
    """Follow a part as many cycles of surface i again before it is asked whether they have settled."""
    cycles = run.zeno[i]
    cycles.ask = cycles.faint + 1.0 + np.floor(PASSED * cycles.faint)
