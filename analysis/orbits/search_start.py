"""Where on a solution a search for an orbit starts: off the surfaces, early, not at rest."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from filippov import EventKind, Solution
from filippov.base.arrays import Array

# A return is a candidate if it comes back to within this part of the solution's extent.
_NEAR_EXTENT = 0.3
# An orbit that repels is left soon: only so many segments are looked at for a start.
_FIRST = 4
# What counts as a forced solution that goes to a subharmonic orbit: a return as near as this of its extent,
# better by this factor than all earlier ones, and at most so much worse after twice the time.
_NEAR, _BETTER, _AGAIN = 0.03, 0.1, 3.0

_GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


def extent(solutions: Sequence[Solution]) -> float:
    """The largest distance between the values of a state."""
    return max(float(np.max(np.ptp(solution.y, axis=1))) for solution in solutions)


def anchor(solution: Solution, length: float, begin: float = 0.0, whole: bool = False) -> float:
    """The middle of the longest segment with fewest sliding surfaces, within `length` after `begin` and
    among the first ones; no clock resets the state in it, nor, unless it is `whole`, anything else."""
    first = solution.problem.t_span[0] + begin
    last = first + length
    best: tuple[int, float, float] | None = None
    seen = 0
    for segment in solution.segments:
        cuts = [segment.t0, *_jumps(solution, segment.t0, segment.t1, whole), segment.t1]
        parts = [(max(a, first), min(b, last)) for a, b in pairwise(cuts)]
        parts = [(low, high) for low, high in parts if high - low > 1e-6 * length]
        for low, high in parts[: _FIRST - seen]:
            key = (sum(sign == 0 for sign in segment.mode), -(high - low), 0.5 * (low + high))
            best = key if best is None or key < best else best
        seen += len(parts)
        if seen >= _FIRST:
            break
    return best[2] if best is not None else first


def _jumps(solution: Solution, begin: float, end: float, whole: bool) -> list[float]:
    """Times in a segment of one mode at which the state has two values and a start has to keep off: all, or
    of a `whole` segment those of clocks, which whole periods hit, and all where one is in the middle."""
    inside = [e for e in solution.events if e.x_after is not None and begin < e.t < end]
    middle, near = 0.5 * (begin + end), 1e-3 * (end - begin)
    all_of_them = not whole or any(abs(e.t - middle) <= near for e in inside)
    return [e.t for e in inside if all_of_them or e.kind is EventKind.TIME]


def rests(solution: Solution) -> bool:
    """Whether the solution ends in a long segment without any change."""
    sol, last = solution.sol, solution.segments[-1]
    if sol is None or last.dwell < 0.05 * (solution.t_end - solution.problem.t_span[0]):
        return False
    # Not at equal distances: what comes back after each of them would seem to rest.
    t = last.t0 + last.dwell * (0.5 + 0.5 * np.append(np.modf(_GOLDEN * np.arange(9))[0], 1.0))
    # The last one may lie beyond the end by rounding.
    x = sol(np.clip(t, last.t0, last.t1))
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


def settled(states: Sequence[Array], most: int) -> int:
    """The same, of at most so many periods, by the states that a solution has had at the ends of periods."""
    size = np.ptp(states, axis=0)
    moves = size > 0
    first, *later = states[-1 - 2 * most :]
    return settling([float(np.max(np.abs(x - first)[moves] / size[moves], initial=0.0)) for x in later])


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
