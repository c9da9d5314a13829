"""Where on a solution a search for an orbit starts: off the surfaces, early, not at rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from filippov.solving.solution import Solution

Array = npt.NDArray[np.float64]
# A return is a candidate if it comes back to within this part of the solution's extent.
_NEAR_EXTENT = 0.3
# An orbit that repels is left soon: only so many segments are looked at for a start.
_FIRST = 4
# What counts as a forced solution that goes to a subharmonic orbit: a return as near as this of its extent,
# better by this factor than all earlier ones, and at most so much worse after twice the time.
_NEAR, _BETTER, _AGAIN = 0.03, 0.1, 3.0


def extent(solutions: Sequence[Solution]) -> float:
    """The largest distance between the values of a state."""
    return max(float(np.max(np.ptp(solution.y, axis=1))) for solution in solutions)


def anchor(solution: Solution, length: float, begin: float = 0.0) -> float:
    """The middle of the longest segment with fewest sliding surfaces, within `length` after `begin` and
    among the first ones."""
    first = solution.problem.t_span[0] + begin
    last = first + length
    best: tuple[int, float, float] | None = None
    seen = 0
    for segment in solution.segments:
        low, high = max(segment.t0, first), min(segment.t1, last)
        if high - low <= 1e-6 * length:
            continue
        seen += 1
        if seen > _FIRST:
            break
        key = (sum(sign == 0 for sign in segment.mode), -(high - low), 0.5 * (low + high))
        best = key if best is None or key < best else best
    return best[2] if best is not None else first


def rests(solution: Solution) -> bool:
    """Whether the solution ends in a long segment without any change."""
    sol, last = solution.sol, solution.segments[-1]
    if sol is None or last.dwell < 0.05 * (solution.t_end - solution.problem.t_span[0]):
        return False
    t = np.linspace(last.t0 + 0.5 * last.dwell, last.t1, 9)
    x = sol(t)
    return bool(np.max(np.ptp(x, axis=1)) <= 1e-12 * (1.0 + np.max(np.abs(x))))


def settling(gaps: Sequence[float]) -> int:
    """The number of periods of the subharmonic orbit to which a solution goes; 1 where none is seen.

    gaps   how far it is from its start after 1, 2, ... periods, as part of its extent
    """
    for count in range(2, len(gaps) // 2 + 1):
        gap = gaps[count - 1]
        near = gap <= min(_NEAR, _BETTER * min(gaps[: count - 1]))
        if near and gaps[2 * count - 1] <= _AGAIN * gap:
            return count
    return 1


def return_time(solution: Solution, start: float, goal: Array, speed: Array, leaves: bool) -> float | None:
    """When a solution comes back through the plane across `speed` at the state `goal`, first of the returns
    that are about as near to it as any; None where none is within 0.3 of its extent.

    leaves   only after it has left the state by so much
    """
    sol = solution.sol
    assert sol is not None
    knots = np.concatenate([[start], sol.start[sol.start > start], [solution.t_end]])
    if len(knots) < 3:
        return None
    inner = (knots[:-1, None] + np.diff(knots)[:, None] * np.arange(8) / 8).ravel()
    t = np.append(inner, knots[-1])
    x = sol(t, side="+")
    size = np.maximum(np.ptp(x, axis=1), 1e-9 * (1 + np.max(np.abs(x))))
    # One after the other: the square of a size near the largest number is infinite.
    height = (speed / size / size) @ (x - goal[:, None])
    away = np.linalg.norm((x - goal[:, None]) / size[:, None], axis=0)
    up = np.flatnonzero((height[:-1] < 0) & (height[1:] >= 0))
    if leaves:
        up = up[[bool(np.max(away[: k + 1]) > _NEAR_EXTENT) for k in up]] if up.size else up
    if not up.size:
        return None
    part = height[up] / (height[up] - height[up + 1])
    times = t[up] + part * (t[up + 1] - t[up])
    gaps = np.linalg.norm((sol(times) - goal[:, None]) / size[:, None], axis=0)
    if np.min(gaps) > _NEAR_EXTENT:
        return None
    return float(times[np.flatnonzero(gaps <= max(3.0 * float(np.min(gaps)), 1e-6))[0]])
