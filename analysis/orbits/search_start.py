"""Where on a motion a search for an orbit starts: off the surfaces, early, not at rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from filippov.solving.solution import Solution

# An orbit that repels is left soon: only so many segments are looked at for a start.
_FIRST = 4


def extent(motions: Sequence[Solution]) -> float:
    """The largest distance between the values of a state."""
    return max(float(np.max(np.ptp(motion.y, axis=1))) for motion in motions)


def anchor(motion: Solution, length: float, begin: float = 0.0) -> float:
    """The middle of the longest segment with fewest sliding surfaces, within `length` after `begin` and
    among the first ones."""
    first = motion.problem.t_span[0] + begin
    last = first + length
    best: tuple[int, float, float] | None = None
    seen = 0
    for segment in motion.segments:
        low, high = max(segment.t0, first), min(segment.t1, last)
        if high - low <= 1e-6 * length:
            continue
        seen += 1
        if seen > _FIRST:
            break
        key = (sum(sign == 0 for sign in segment.mode), -(high - low), 0.5 * (low + high))
        best = key if best is None or key < best else best
    return best[2] if best is not None else first


def rests(motion: Solution) -> bool:
    """Whether the motion ends in a long segment without any change."""
    sol, last = motion.sol, motion.segments[-1]
    if sol is None or last.dwell < 0.05 * (motion.t_end - motion.problem.t_span[0]):
        return False
    t = np.linspace(last.t0 + 0.5 * last.dwell, last.t1, 9)
    x = sol(t)
    return bool(np.max(np.ptp(x, axis=1)) <= 1e-12 * (1.0 + np.max(np.abs(x))))
