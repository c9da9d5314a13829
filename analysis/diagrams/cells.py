"""Cycles of a map for many parameter sets at once: sign changes of P(d) - d over a grid, each refined."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from filippov.analysis.maps.map_rows import MapRows, coordinates

Array = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]
CLOSEST, REFINEMENTS, SLOPE, JUMP = 1e-5, 7, 1e-4, 0.05
NEAR, FINER = 0.2, 7


def cells(
    turns: MapRows, rows: Array, hi: float, points: int
) -> tuple[Whole, Whole, npt.NDArray[np.bool_], Array, Array]:
    """cycles, stable, set_stable, amplitude and lost of parameter rows (k, P), each of shape (k,)."""
    d = coordinates(hi, points, CLOSEST)
    grid = np.broadcast_to(d, (len(rows), d.size))
    image = turns(rows, grid)
    gap = image - grid
    cell, low, high = _brackets(turns, rows, d, gap)
    root, slope, real = _roots(turns, rows[cell], low, high)
    cell, root, slope = cell[real], root[real], slope[real]
    count = np.bincount(cell, minlength=len(rows))
    firm = np.abs(slope) < 1
    held = np.bincount(cell[firm], minlength=len(rows))
    amplitude = np.full(len(rows), np.nan)
    for where, place in zip(cell[firm], root[firm], strict=True):
        amplitude[where] = np.nanmax([amplitude[where], place])
    calm = np.abs(image[:, 0]) < d[0]
    return count, held, calm, amplitude, np.mean(np.isnan(image), axis=1)


def _brackets(turns: MapRows, rows: Array, d: Array, gap: Array) -> tuple[Whole, Array, Array]:
    """Cells and intervals in which P(d) - d changes its sign."""
    cell, k = np.nonzero(gap[:, :-1] * gap[:, 1:] < 0)
    found = [(cell, d[k], d[k + 1])]
    # An extremum close to 0 of the same sign as its neighbours: a pair of cycles may stand between.
    size = np.abs(gap)
    inner = size[:, 1:-1]
    tip = (
        (gap[:, :-2] * gap[:, 1:-1] > 0) & (gap[:, 1:-1] * gap[:, 2:] > 0)
        & (inner <= size[:, :-2]) & (inner <= size[:, 2:]) & (inner < NEAR * d[1:-1])
    )  # fmt: skip
    where, k = np.nonzero(tip)
    if where.size:
        low, high = d[k], d[k + 2]
        side = np.sign(gap[where, k + 1])
        for _ in range(2):
            finer = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, FINER)
            again = (turns(rows[where], finer) - finer) * side[:, None]
            again = np.where(np.isnan(again), np.inf, again)
            best = np.argmin(again, axis=1)
            line = np.arange(where.size)
            least, at = again[line, best], finer[line, best]
            low = finer[line, np.maximum(best - 1, 0)]
            high = finer[line, np.minimum(best + 1, FINER - 1)]
        through = least < 0
        found.append((where[through], d[k][through], at[through]))
        found.append((where[through], at[through], d[k + 2][through]))
    return tuple(np.concatenate(part) for part in zip(*found, strict=True))  # type: ignore[return-value]


def _roots(
    turns: MapRows, rows: Array, low: Array, high: Array
) -> tuple[Array, Array, npt.NDArray[np.bool_]]:
    """Roots of P(d) - d in their brackets with the slope of P there, and which of them are no jumps."""
    if not low.size:
        return low, low, np.zeros(0, dtype=bool)

    def gap(d: Array) -> Array:
        return turns(rows, d[:, None])[:, 0] - d

    a, b, first, second = low.copy(), high.copy(), gap(low), gap(high)
    before = np.maximum(np.abs(first), np.abs(second))
    last = np.zeros(low.size)
    for _ in range(REFINEMENTS):
        middle = np.where(first != second, (a * second - b * first) / (second - first), 0.5 * (a + b))
        middle = np.clip(middle, np.minimum(a, b), np.maximum(a, b))
        value = gap(middle)
        right = first * value < 0
        # Illinois: an end that stays twice has its value halved, so that both ends move.
        first = np.where(right, np.where(last > 0, 0.5 * first, first), value)
        second = np.where(right, value, np.where(last < 0, 0.5 * second, second))
        a, b = np.where(right, a, middle), np.where(right, middle, b)
        last = np.where(right, 1.0, -1.0)
    left = np.abs(value)
    reach = SLOPE * middle
    slope = 1.0 + (gap(middle + reach) - gap(middle - reach)) / (2 * reach)
    real = np.isfinite(slope) & ((left < JUMP * before) | (left < 1e-6 * np.abs(middle)))
    # One step of Newton's method with the slope that is known anyway.
    root = np.where(real & (slope != 1.0), middle - value / np.where(slope != 1.0, slope - 1.0, 1.0), middle)
    inside = (root > np.minimum(low, high)) & (root < np.maximum(low, high))
    return np.where(inside, root, middle), slope, real
