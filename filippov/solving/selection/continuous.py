"""The mode that follows at a corner across which the field is continuous: the solution itself tells it.

Kinks, and levels at which one expression takes over from another, may meet in numbers: each mode then has a
region that may be empty, and the rates of one mode say nothing beside it. Where the field has one value in
all regions around the point the solution is unique (Picard-Lindelof), and is followed for short steps until
two agree: the signs of what it has left are the mode, h = c tau^k gives the order k.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from filippov.base.arrays import Array
from filippov.solving.state.events import Mode
from filippov.solving.state.point import Point

# States drawn around the point, at this part of the size of each; fields that differ by rounding, in terms.
DRAWN, NEAR, SAME = 64, 1e-6, 1e-10
PARTS, SHORTER, LENGTHS = 16, 4.0, 14


def continuous_mode(point: Point, base: Mode, reached: Sequence[int]) -> tuple[Array, list[int]] | None:
    """The mode that follows, and how often each guard reached vanishes along it.

    None where the field may jump, or no two steps agree.

    Formulas only: plain functions need have no values beside the point. Several solutions may follow where
    the field is not Lipschitz.
    """
    machine = point.machine
    plain = machine.callbacks is not None or bool(machine.constants["NON_LIPSCHITZ"])
    if plain or any(machine.contacts[i] for i in reached):
        return None
    start = np.array(base, dtype=float)
    start[list(reached)] = np.where(start[list(reached)] == 0.0, 1.0, start[list(reached)])
    if np.any(start == 0.0):
        return None
    field = point.rhs(start, start)
    small = SAME * point.field_terms(tuple(start))
    rng = np.random.default_rng(0)
    size = NEAR * (1.0 + np.abs(point.x))
    around = (_signs(point, start, reached, point.t, point.x + size * rng.normal(size=len(point.x)))
              for _ in range(DRAWN))  # fmt: skip
    with np.errstate(all="ignore"):
        if not all(np.all(np.abs(point.rhs(mode, mode) - field) <= small) for mode in around):
            return None
    seen: list[tuple[Array, Array] | None] = [None]
    for length in range(LENGTHS):
        seen.append(_followed(point, start, reached, point.step / SHORTER**length))
        if (long := seen[-2]) is None or (short := seen[-1]) is None:
            continue
        with np.errstate(all="ignore"):
            order = np.log(np.abs(long[1] / short[1])) / np.log(SHORTER)
            clear = np.abs(order - np.round(order)) < 0.2
        if np.array_equal(long[0], short[0]) and np.all(clear[list(reached)]):
            return short[0], [
                max(round(float(order[i])), 1) if i in reached else 0 for i in range(len(start))
            ]
    return None


def _signs(point: Point, start: Array, reached: Sequence[int], t: float, x: Array) -> Array:
    """The mode of a state beside the point; a surface that it lies on keeps its sign."""
    h = point.machine.guards(t, x, start)
    mode = start.copy()
    for i in reached:
        if h[i] != 0.0:
            mode[i] = np.sign(h[i])
    return mode


def _followed(
    point: Point, start: Array, reached: Sequence[int], length: float
) -> tuple[Array, Array] | None:
    """The mode of the solution over the second half of a step, if it is one, and h there; Heun's rule."""
    t, x, mode = point.t, point.x, start
    seen: list[Array] = []
    step = length / PARTS
    for _ in range(PARTS):
        first = point.machine.rhs(t, x, mode, mode)
        ahead = x + step * first
        there = _signs(point, start, reached, t + step, ahead)
        x = x + 0.5 * step * (first + point.machine.rhs(t + step, ahead, there, there))
        t += step
        mode = _signs(point, start, reached, t, x)
        seen.append(mode)
    half = seen[PARTS // 2 :]
    same = all(np.array_equal(other, mode) for other in half)
    return (mode, point.machine.guards(t, x, mode)) if same else None
