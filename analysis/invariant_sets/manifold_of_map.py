"""The manifold of a fixed point of a map, grown as a curve by arclength.

    M(k + s) = R^k(x + e q^s v),   0 <= s <= 1, k = 0, 1, ...

with multiplier q, eigenvector v and a small e: a piece that the map stretches, mapped again and again. Points
are added in s where neighbours are far apart or the curve bends, as far as the length goes; where they do not
draw near however close in s they are, the map jumps and the curve is broken. A negative q takes the map
twice.
Source: Hobson 1993, J. Comput. Phys. 104, 14; Krauskopf & Osinga 1998, J. Comput. Phys. 146, 404.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from filippov.analysis.invariant_sets.return_map import ReturnMap
from filippov.analysis.orbits.saddle import Side
from filippov.base.arrays import Array
from filippov.base.status import Status

LEVELS, ROUNDS, FIRST = 400, 80, 9
# Sharpest bend between neighbours [rad]; below this part of the spacing bends are not looked at.
BEND, SHORT = 0.2, 0.02
# Closest places of points on the first piece: at a jump, and at the edge of where solutions come back.
CLOSEST, EDGE = 1e-11, 1e-6


@dataclass(frozen=True, eq=False)
class Growth:
    """Points (k, n) with a row of NaN at breaks, arclength without them, and why it ended."""

    x: Array
    length: float
    ended: str


def grow(
    returns: ReturnMap, side: Side, x: Array, vector: Array, value: float, *, length: float, spacing: float,
    offset: float, most: int,
) -> Growth:  # fmt: skip
    """One side of the manifold of the fixed point x, to a length or to where it ends."""
    once = returns.map_of(side)
    rate = value if side == "unstable" else 1.0 / value
    image: Callable[[Array], Array] = (lambda y: once(once(y))) if rate < 0 else once
    rate = rate**2 if rate < 0 else rate
    returns.reasons.clear()

    def start(s: Array) -> Array:
        return returns.onto(x + offset * rate ** s[:, None] * vector)

    s = np.linspace(0.0, 1.0, FIRST)
    here = start(s)
    curve: list[Array] = [x[None, :], here]
    total, before = float(np.linalg.norm(here[-1] - x)), 0.0
    for level in range(1, LEVELS):
        here = image(here)
        s, here, full = _refined(
            image, start, s, here, level, length - total, spacing, most - sum(map(len, curve))
        )
        piece, gained, last = _cut(s, here, spacing, length - total)
        curve.append(piece[1:] if len(piece) and np.all(np.isfinite(piece[0])) else piece)
        total += gained
        if last is not None:
            end = start(np.array([last]))
            for _ in range(level):
                end = image(end)
            return Growth(_joined([*curve, end]), length, "")
        if full:
            return Growth(_joined(curve), total, f"the budget of {most} points is used up")
        if not np.any(np.all(np.isfinite(here), axis=1)):
            return Growth(_joined(curve), total, _why(returns, side))
        if gained < 0.9 * before and gained < 1e-5 * length:
            return Growth(_joined(curve), total, "it draws together at an attractor")
        before = gained
    return Growth(_joined(curve), total, f"{LEVELS} returns are used up")


def _refined(
    image: Callable[[Array], Array], start: Callable[[Array], Array], s: Array, here: Array, level: int,
    left: float, spacing: float, most: int,
) -> tuple[Array, Array, bool]:  # fmt: skip
    """The piece of a level with points added up to the length left; whether their number is used up."""
    for _ in range(ROUNDS):
        good = np.all(np.isfinite(here), axis=1)
        steps = np.diff(here, axis=0)
        gap = np.linalg.norm(steps, axis=1)
        both, one = good[1:] & good[:-1], good[1:] != good[:-1]
        within = np.concatenate([[0.0], np.cumsum(np.where(both, gap, 0.0))[:-1]]) <= left
        wide = both & (gap > spacing)
        unit = steps / np.maximum(gap, 1e-300)[:, None]
        turn = np.arccos(np.clip(np.sum(unit[1:] * unit[:-1], axis=1), -1.0, 1.0))
        sharp = both[1:] & both[:-1] & (turn > BEND)
        large = gap > SHORT * spacing
        bent = np.zeros(len(gap), dtype=bool)
        bent[1:] |= sharp & large[1:]
        bent[:-1] |= sharp & large[:-1]
        apart = np.diff(s)
        more = np.flatnonzero(within & (((wide | bent) & (apart > CLOSEST)) | (one & (apart > EDGE))))
        if not more.size:
            return s, here, False
        if len(s) + more.size > most:
            return s, here, True
        added = 0.5 * (s[more] + s[more + 1])
        x = start(added)
        for _ in range(level):
            x = image(x)
        s, here = np.insert(s, more + 1, added), np.insert(here, more + 1, x, axis=0)
    return s, here, False


def _cut(s: Array, here: Array, spacing: float, left: float) -> tuple[Array, float, float | None]:
    """The piece up to the length left, NaN at breaks; its length; where in s it was cut, if it was."""
    out: list[Array] = [here[0]]
    total = 0.0
    nothing = np.full(here.shape[1], np.nan)
    for k in range(1, len(here)):
        a, b = here[k - 1], here[k]
        if not np.all(np.isfinite(b)):
            if np.all(np.isfinite(out[-1])):
                out.append(nothing)
            continue
        gap = float(np.linalg.norm(b - a)) if np.all(np.isfinite(a)) else 0.0
        if gap > spacing and s[k] - s[k - 1] <= CLOSEST:
            out.append(nothing)
        elif total + gap >= left:
            share = (left - total) / max(gap, 1e-300)
            return np.array(out), left, float(s[k - 1] + share * (s[k] - s[k - 1]))
        else:
            total += gap
        out.append(b)
    return np.array(out), total, None


def _joined(curve: list[Array]) -> Array:
    x = np.vstack(curve)
    while len(x) and not np.all(np.isfinite(x[-1])):
        x = x[:-1]
    broken = ~np.all(np.isfinite(x), axis=1)
    return np.asarray(x[~(broken & np.append(False, broken[:-1]))])


def _why(returns: ReturnMap, side: Side) -> str:
    said = ", ".join(f"{name} ({n})" for name, n in sorted(returns.reasons.items()))
    if side == "stable" and Status.NON_UNIQUE.value in returns.reasons:
        return f"backwards in time solutions are not unique where they meet sliding: {said}"
    return f"solutions do not come back: {said}"
