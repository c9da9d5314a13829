"""How a solution ends: at rest, in a cycle, or otherwise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from filippov.base.arrays import Array
from filippov.solving.solution import Solution

Places = npt.NDArray[np.int64]
SAMPLES = 4001
# Of the extents: what rests moves by no more in the last twentieth of the span; a cycle by more in the last
# quarter, and as much as in the one before but for a share CHANGES of it.
RESTS, SMALLEST, CHANGES = 1e-9, 1e-6, 0.05
# The way of what goes back and forth over the width that it takes.
TO_AND_FRO = 1.5
# Of half the width of a cycle: by how much, at least, it goes through its middle, unlike chattering.
THROUGH = 0.2


@dataclass(frozen=True)
class Ending:
    """How a solution ends.

    kind               "rest", "cycle" or "motion"
    amplitude, period  of a cycle, else None
    state              the place of the state that moves most
    moved, speed       over the last twentieth of the span, over the extents: largest way, net speed
    chatter            half of `moved` where it is back and forth, else None
    decays             whether the second half of that time has less than half of the way of the first
    change             of the amplitude from the last but one quarter to the last, over the larger; inf of
                       what does not go up and down; NaN where a quarter is shorter than a period
    low, high          each state's least and largest value in the last quarter
    follows            the place of the state whose cycle it is
    """

    kind: str
    amplitude: float | None
    period: float | None
    state: int
    moved: float
    speed: float
    chatter: float | None
    decays: bool
    change: float
    low: Array
    high: Array
    follows: int


def ending(solution: Solution, count: int, extent: Array, follows: int | None = None) -> Ending:
    """How a solution ends; count, extent: states of the exact system and how far each moves.

    A cycle: over each of the last two quarters of the span the state that moves most, or the one that
    `follows` names, has the same amplitude (to 5 %) and goes up through its middle twice at least, a period
    within a quarter of the span. Rest: the last twentieth moves by no more than 1e-9 of `extent`.
    """
    sol, (t0, t1) = solution.sol, (solution.problem.t_span[0], solution.t_end)
    assert sol is not None
    t = np.linspace(t0, t1, SAMPLES)
    x = sol(t)[:count]
    parts = x[:, -200:], x[:, -1000:], x[:, -2000:-1000]
    last, now, before = (np.ptp(part, axis=1) / extent for part in parts)
    moved, state = float(np.max(last)), int(np.argmax(last))
    net = abs(float(x[state, -1] - x[state, -200])) / float(extent[state])
    path = float(np.sum(np.abs(np.diff(x[state, -200:])))) / float(extent[state])
    first, second = (float(np.max(np.ptp(part, axis=1) / extent)) for part in (x[:, -200:-100], x[:, -100:]))
    k = int(np.argmax(now)) if follows is None else follows
    size, earlier = float(now[k]), float(before[k])
    tail = x[k, -2000:]
    middle = 0.5 * (float(np.max(tail)) + float(np.min(tail)))
    ups, downs = _through(tail, middle)
    cyclic = ups.size >= 2 and size >= SMALLEST
    change = abs(size - earlier) / max(size, earlier) if cyclic else np.inf
    short = ups[-1] - ups[0] > 1000 * (ups.size - 1) if cyclic else ups.size == 1 and downs.size > 0
    change = np.nan if short else change
    kind = "rest" if moved <= RESTS else "cycle" if change <= CHANGES else "motion"
    amplitude = period = None
    if kind == "cycle":
        begun, final = (
            float(brentq(lambda q: float(sol(q)[k]) - middle, t[i - 2000], t[i - 1999], xtol=1e-14))
            for i in (ups[0], ups[-1])
        )
        amplitude, period = 0.5 * size * float(extent[k]), (final - begun) / (ups.size - 1)
    return Ending(
        kind, amplitude, period, k if kind == "cycle" else state, moved, net / (0.05 * abs(t1 - t0)),
        0.5 * moved if path > TO_AND_FRO * moved else None, second < 0.5 * first, change,
        np.min(x[:, -1000:], axis=1), np.max(x[:, -1000:], axis=1), k,
    )  # fmt: skip


def _through(x: Array, middle: float) -> tuple[Places, Places]:
    """Where samples last were on the other side of the middle, on the ways up and down through all of it."""
    least = THROUGH * 0.5 * float(np.ptp(x))
    side = np.where(x > middle + least, 1, np.where(x < middle - least, -1, 0))
    clear = np.flatnonzero(side)
    turned = np.flatnonzero(np.diff(side[clear]))
    ways: dict[int, list[int]] = {1: [], -1: []}
    for i in turned.tolist():
        low, high = int(clear[i]), int(clear[i + 1])
        sign = int(side[high])
        ways[sign].append(low + int(np.flatnonzero(sign * (x[low:high] - middle) <= 0)[-1]))
    return np.array(ways[1], dtype=np.int64), np.array(ways[-1], dtype=np.int64)
