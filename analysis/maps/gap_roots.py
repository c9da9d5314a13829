"""Roots of R(d) - d, the gap of a map, of one map or of many side by side: where a grid brackets them, and
which are fixed points.

A cell of the grid is split as long as its ends and the slopes there do not exclude further roots. A pair
that is left between two points is found at the extremum of the gap there. A change of sign
across a jump of the map is no fixed point; the gap that is left there shows it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.optimize import elementwise

from filippov.base.arrays import Array, Whole

# R(d) - d at coordinates (k,) of the maps with these numbers (k,); NaN where the map does not return.
Gap = Callable[[Array, Whole], Array]
# A cell that is not settled is split into PARTS, at most LEVELS times, to MOST samples for each at first.
PARTS, LEVELS, MOST = 4, 10, 16
# Cells are separated down to this share of d.
RESOLVED = 1e-8
# Share of a cell by which tangents reach 0 apart from each other where the gap is but bent.
APART = 0.02
# Of a gap, in units of the tolerance of its map.
NOISE = 10.0


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


@dataclass(frozen=True)
class Samples:
    """Gaps of maps at coordinates, flat arrays (k,) in the order of the map, then of d."""

    map: Whole
    d: Array
    gap: Array

    @classmethod
    def of(cls, d: Array, values: Array) -> Samples:
        """Those on a grid d (q,), values (maps, q)."""
        which = np.repeat(np.arange(len(values)), d.size)
        return cls(which, np.tile(d, len(values)), values.ravel())

    def with_more(self, at: Array, which: Whole, gap: Array) -> Samples:
        """These and others."""
        maps, d = np.append(self.map, which), np.append(self.d, at)
        order = np.lexsort((d, maps))
        return Samples(maps[order], d[order], np.append(self.gap, gap)[order])


def split(gap: Gap, samples: Samples, noise: float) -> Samples:
    """Samples with those that tell apart the roots between two neighbours, where the ends of that cell and
    the slopes there do not exclude more than its signs show.

    noise  share of d below which gaps are not told from 0

    Where the gap changes its sign both slopes must have that of the chord, and the tangent of the first end
    must not reach 0 before that of the last; where it does not, none may reach 0 within the cell. Slopes are
    those of the cubic through four neighbours, and of the chords beside the cell. What leaves no trace at the
    neighbours is missed.
    """
    most = MOST * samples.d.size  # a map that folds everywhere is not resolved
    for _ in range(LEVELS):
        k = np.flatnonzero(_unsettled(samples, noise))
        if not k.size or samples.d.size + (PARTS - 1) * k.size > most:
            break
        share = np.arange(1, PARTS) / PARTS
        at = (samples.d[k, None] + share * (samples.d[k + 1] - samples.d[k])[:, None]).ravel()
        which = np.repeat(samples.map[k], PARTS - 1)
        samples = samples.with_more(at, which, gap(at, which))
    return samples


def _unsettled(samples: Samples, noise: float) -> npt.NDArray[np.bool_]:
    """Whether the cell after each sample may have more roots than its signs show."""
    d, g, which = samples.d, samples.gap, samples.map
    out = np.zeros(d.size, dtype=bool)
    if d.size < 4:
        return out
    h, joined = np.diff(d), which[:-1] == which[1:]
    with np.errstate(invalid="ignore", divide="ignore"):
        chord = np.where(joined, np.diff(g) / h, np.nan)
        size = np.maximum(np.abs(g[:-1]), np.abs(g[1:]))
        reach = np.maximum(np.abs(d[:-1]), np.abs(d[1:]))
        # Of cells beside the end of a map what is there counts twice.
        before, after = np.append(np.nan, chord[:-1]), np.append(chord[1:], np.nan)
        before, after = np.where(np.isnan(before), chord, before), np.where(np.isnan(after), chord, after)
        left, right = np.append(h[0], h[:-1]), np.append(h[1:], h[-1])
        first, second = (chord - before) / (left + h), (after - chord) / (h + right)
        third = (second - first) / (left + h + right)
        starts = before, chord - h * first - third * h * left
        ends = after, chord + h * first + third * h * (left + h)
        through = np.sign(g[:-1]) * np.sign(g[1:]) < 0
        for start, end in itertools.product(starts, ends):
            first, last = -g[:-1] / start / h, 1.0 - g[1:] / end / h
            turns = (start * chord < 0) | (end * chord < 0) | (last - first > APART)
            reached = ((first > 0) & (first < 1)) | ((last > 0) & (last < 1))
            out[:-1] |= np.where(through, turns, reached)
    out[:-1] &= joined & np.isfinite(chord) & (size > noise * reach) & (h > RESOLVED * reach)
    return out


def brackets(gap: Gap, samples: Samples, *, near: float = np.inf, steps: int = 40) -> Brackets:
    """Between neighbours, from the gaps there.

    near   extrema of the gap farther from 0 than this share of d are taken to hide no pair
    steps  of the search for each extremum
    """
    d, values, which = samples.d, samples.gap, samples.map
    sign, size = np.sign(values), np.abs(values)
    joined = which[:-1] == which[1:]
    k = np.flatnonzero(joined & ((sign[:-1] * sign[1:] < 0) | (sign[:-1] == 0)))
    over = np.where(values[k] == 0.0, k, k + 1)
    found = [(which[k], d[k], d[over], values[k], values[over])]
    same = (sign[:-2] * sign[1:-1] > 0) & (sign[1:-1] * sign[2:] > 0) & joined[:-1] & joined[1:]
    inner = size[1:-1]
    close = inner < near * np.abs(d[1:-1]) if np.isfinite(near) else np.isfinite(inner)
    k = np.flatnonzero(same & (inner <= size[:-2]) & (inner <= size[2:]) & close)
    if k.size:
        side, most, rows = sign[k], np.maximum(size[k], size[k + 2]), which[k]

        def distance(at: Array, which: Whole, side: Array, most: Array) -> Array:
            value = side * gap(at, which.astype(np.int64))
            return np.where(np.isnan(value), most, value)

        lowest = elementwise.find_minimum(
            distance, (d[k], d[k + 1], d[k + 2]), args=(rows, side, most), maxiter=steps,
            tolerances={"xatol": 0.0, "xrtol": 1e-9, "fatol": 0.0, "frtol": 0.0},
        )  # fmt: skip
        through = lowest.f_x < 0
        rows, k, at, value = rows[through], k[through], lowest.x[through], (side * lowest.f_x)[through]
        found.append((rows, d[k], at, values[k], value))
        found.append((rows, at, d[k + 2], value, values[k + 2]))
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
