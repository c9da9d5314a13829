"""The error of a solution along the exact one, also where the state jumps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from filippov import EventKind, Solution
from filippov.base.arrays import Array

# An impact without a counterpart that jumps by so much of the error, and of the extents, is noted.
MAKES, SEEN = 0.5, 0.01


class Jump(NamedTuple):
    """A jump of the state on a surface, or its step where time stepping has one; size: over the extents."""

    surface: str
    begin: float
    end: float
    size: float


class Gap(NamedTuple):
    """The largest error of the states over the extents, of the times of impacts (none: None), and a note."""

    states: float
    times: float | None
    note: str


def largest_gap(exact: Solution, other: Solution, times: Array, extent: Array) -> Gap:
    """The largest |x - exact| over the extents at `times` and on both sides of every jump.

    A jump of the one and a jump of the other on the same surface belong together where each is the nearest to
    the other. The time between them does not count: how far they are apart is an error of time, and the state
    is off by the whole jump meanwhile. The note tells where jumps without a counterpart make the error.
    """
    mine, theirs = jumps(exact, extent), jumps(other, extent)
    pairs = _pairs(mine, theirs)
    spans = np.array([
        (min(mine[i].begin, theirs[j].begin), max(mine[i].end, theirs[j].end)) for i, j in pairs
    ]).reshape(-1, 2)  # fmt: skip
    low, high = spans.T
    at = np.unique([t for jump in (*mine, *theirs) for t in (jump.begin, jump.end)])
    worst = 0.0
    for side, t in (("-", np.union1d(times, at)), ("+", at)):
        # At its first instant a span still counts before the jump, at its last one after it.
        from_left, from_right = (np.greater, np.less_equal) if side == "-" else (np.greater_equal, np.less)
        inside = from_left(t[:, None], low) & from_right(t[:, None], high)
        counted = t[~np.any(inside, axis=1)]
        if counted.size:
            worst = max(worst, _gap(exact, other, counted, side, extent))
    alone = [jump for i, jump in enumerate(mine) if all(i != k for k, _ in pairs)]
    alone += [jump for j, jump in enumerate(theirs) if all(j != k for _, k in pairs)]
    made = sum(jump.size >= max(MAKES * worst, SEEN) for jump in alone)
    late = max((abs(mine[i].end - theirs[j].end) for i, j in pairs), default=None)
    return Gap(worst, late, f"err state holds {made} impacts of one solution alone" if made else "")


def jumps(solution: Solution, extent: Array) -> list[Jump]:
    """The jumps of the first states, in order of time."""
    count, out = len(extent), []
    for e in solution.events:
        if e.kind not in (EventKind.RESET, EventKind.TIME):
            continue  # crossings that a jump makes have its states too
        if e.x_after is not None:
            begin, moved = e.t, e.x_after[:count] - e.x[:count]
        elif e.kind is EventKind.RESET:
            k = int(np.searchsorted(solution.t, e.t))
            begin, moved = float(solution.t[max(k - 1, 0)]), solution.y[:count, k] - solution.y[:count, k - 1]
        else:
            continue
        size = float(np.max(np.abs(moved) / extent))
        if size > 0:
            first, last = sorted((float(begin), float(e.t)))
            out.append(Jump(e.surface, first, last, size))
    return sorted(out, key=lambda jump: jump.begin)


def _pairs(mine: Sequence[Jump], theirs: Sequence[Jump]) -> list[tuple[int, int]]:
    """Places of the jumps that belong together."""
    out = []
    for surface in {jump.surface for jump in mine}:
        these, those = ([k for k, q in enumerate(row) if q.surface == surface] for row in (mine, theirs))
        if those:
            a, b = np.array([mine[k].end for k in these]), np.array([theirs[k].end for k in those])
            there, back = (np.argmin(np.abs(p[:, None] - q), axis=1) for p, q in ((a, b), (b, a)))
            out += [(these[i], those[j]) for i, j in enumerate(there) if back[j] == i]
    return out


def _gap(exact: Solution, other: Solution, t: Array, side: str, extent: Array) -> float:
    assert exact.sol is not None
    assert other.sol is not None
    count = len(extent)
    gap = np.abs(other.sol(t, side=side)[:count] - exact.sol(t, side=side)[:count])
    return float(np.max(gap / extent[:, None]))
