"""Roots of R(d) - d, the gap of a map, of one map or of many side by side: where a grid brackets them, and
which are fixed points.

A pair of roots between two points of a grid is found at the extremum of the gap there. A change of sign
across a jump of the map is no fixed point, and is told apart by what is left of the gap.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import elementwise

Array = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]
# R(d) - d at coordinates (k,) of the maps with these numbers (k,); NaN where the map does not return.
Gap = Callable[[Array, Whole], Array]


@dataclass(frozen=True)
class Brackets:
    """Intervals (k,) in which the gap of a map changes its sign, and the gap at their ends."""

    map: Whole
    low: Array
    high: Array
    at_low: Array
    at_high: Array


@dataclass(frozen=True)
class Roots:
    """A root in each bracket (k,), NaN where there is none: `left` of the gap there, and whether it is a
    fixed point, which the two sides of a jump are not."""

    d: Array
    left: Array
    fixed: npt.NDArray[np.bool_]


def coordinates(lo: float, hi: float, points: int, closest: float) -> Array:
    """Half of the points evenly over [lo, hi], half evenly in log |d| from 0 on where 0 lies in it, down to
    `closest` of its ends; 0 itself is left out."""
    half = points // 2
    parts = [np.linspace(lo, hi, half + 1)]
    parts += [end * np.geomspace(closest, 1.0, points - half) for end in (lo, hi) if lo <= 0.0 <= hi and end]
    merged = np.unique(np.concatenate(parts))
    return np.asarray(merged[merged != 0.0])


def brackets(gap: Gap, d: Array, values: Array, *, near: float = np.inf, steps: int = 40) -> Brackets:
    """Between neighbours on a grid d (q,), from the gaps there, values (maps, q).

    near   extrema of the gap farther from 0 than this share of d are taken to hide no pair
    steps  of the search for each extremum
    """
    sign, size = np.sign(values), np.abs(values)
    rows, k = np.nonzero((sign[:, :-1] * sign[:, 1:] < 0) | (sign[:, :-1] == 0))
    over = np.where(values[rows, k] == 0.0, k, k + 1)
    found = [(rows, d[k], d[over], values[rows, k], values[rows, over])]
    same = (sign[:, :-2] * sign[:, 1:-1] > 0) & (sign[:, 1:-1] * sign[:, 2:] > 0)
    inner = size[:, 1:-1]
    least = (inner <= size[:, :-2]) & (inner <= size[:, 2:]) & (inner < near * np.abs(d[1:-1]))
    rows, k = np.nonzero(same & least)
    if rows.size:
        side, most = sign[rows, k], np.maximum(size[rows, k], size[rows, k + 2])

        def distance(at: Array, which: Whole, side: Array, most: Array) -> Array:
            value = side * gap(at, which.astype(np.int64))
            return np.where(np.isnan(value), most, value)

        lowest = elementwise.find_minimum(
            distance, (d[k], d[k + 1], d[k + 2]), args=(rows, side, most), maxiter=steps,
            tolerances={"xatol": 0.0, "xrtol": 1e-9, "fatol": 0.0, "frtol": 0.0},
        )  # fmt: skip
        through = lowest.f_x < 0
        rows, k, at, value = rows[through], k[through], lowest.x[through], (side * lowest.f_x)[through]
        found.append((rows, d[k], at, values[rows, k], value))
        found.append((rows, at, d[k + 2], value, values[rows, k + 2]))
    return Brackets(*(np.concatenate(part) for part in zip(*found, strict=True)))


def roots(
    gap: Gap, between: Brackets, *, rtol: float, jump: float, floor: float | Array, steps: int = 100
) -> Roots:
    """The roots, each to the share rtol of it, by Chandrupatla's method.

    jump, floor   what is left of the gap at a fixed point is below the share `jump` of the gap at the ends
                  of its bracket, or below `floor`
    """
    if not between.map.size:
        return Roots(np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool))
    found = elementwise.find_root(
        lambda d, which: gap(d, which.astype(np.int64)), (between.low, between.high), args=(between.map,),
        maxiter=steps, tolerances={"xatol": 0.0, "xrtol": rtol, "fatol": 0.0, "frtol": 0.0},
    )  # fmt: skip
    left = np.abs(found.f_x)
    before = np.maximum(np.abs(between.at_low), np.abs(between.at_high))
    return Roots(found.x, left, (left <= jump * before) | (left <= floor))


def fixed_point_near(
    image: Callable[[float], float], d: float, reach: float, limit: float = 0.0, *, rtol: float = 1e-15
) -> float | None:
    """The fixed point of a map next to d, of which one is known to be there: bracketed by d - reach and d +
    reach, tripled up to `limit`. None where the gap has the same sign at both or the map does not return."""

    def gap(at: Array, _: Whole) -> Array:
        return np.array([image(float(q)) - q for q in at])

    while True:
        ends = np.array([d - reach, d + reach])
        low, high = gap(ends, np.zeros(2, dtype=np.int64))
        if low * high <= 0:
            one = Brackets(np.zeros(1, dtype=np.int64), *(np.array([q]) for q in (*ends, low, high)))
            found = roots(gap, one, rtol=rtol, jump=np.inf, floor=0.0)
            return float(found.d[0]) if found.fixed[0] else None
        reach *= 3.0
        if not reach <= limit or not np.isfinite(low * high):
            return None
