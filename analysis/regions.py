"""How many cycles there are, and which are stable, over two parameters.

Every cell is one pair of values: the sign changes of P(d) - d over a grid of coordinates, each refined until
its slope is known, and the local extrema that come close to 0, where a pair of cycles may hide. The borders
between regions are not read off the cells: they are curves of their own (see `filippov.analysis.curve`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.analysis.map_rows import MapRows, coordinates
from filippov.analysis.section import Section
from filippov.errors import UsageError
from filippov.names import unknown
from filippov.system import System

Array = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]
CLOSEST, REFINEMENTS, SLOPE, JUMP = 1e-5, 7, 1e-4, 0.05
NEAR, FINER = 0.2, 7


@dataclass(frozen=True)
class Regions:
    """Cells over two parameters; arrays have shape (len(y), len(x)).

    names          of the parameters; x, y: their values
    cycles, stable number of cycles in the interval, and how many of them are stable; -1 where not computed
    set_stable     whether small excursions shrink: the set of equilibria attracts
    amplitude      d of the largest stable cycle, NaN without one
    lost           share of the coordinates whose motion does not come back within t_max
    borders        (name, points (k, 2)) of curves that bound the regions
    complete       False where the computation was interrupted
    """

    names: tuple[str, str]
    x: Array
    y: Array
    cycles: Whole
    stable: Whole
    set_stable: npt.NDArray[np.bool_]
    amplitude: Array
    lost: Array
    borders: tuple[tuple[str, Array], ...] = ()
    complete: bool = True
    parameters: Mapping[str, float] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """The map as plain data."""
        return {
            "names": list(self.names), "x": self.x.tolist(), "y": self.y.tolist(),
            "cycles": self.cycles.tolist(), "stable": self.stable.tolist(),
            "set_stable": self.set_stable.tolist(), "amplitude": self.amplitude.tolist(),
            "lost": self.lost.tolist(), "complete": self.complete, "parameters": dict(self.parameters),
            "borders": [{"name": name, "points": points.tolist()} for name, points in self.borders],
        }  # fmt: skip

    def text(self, i: int, j: int) -> str:
        """What the cell in row i and column j holds."""
        if self.cycles[i, j] < 0:
            return "not computed"
        word = "stable" if self.set_stable[i, j] else "unstable"
        return f"{self.cycles[i, j]} cycles, {self.stable[i, j]} stable; set of equilibria {word}"


def regions(
    system: System,
    section: Section,
    x: tuple[str, Sequence[float]],
    y: tuple[str, Sequence[float]],
    interval: tuple[float, float],
    *,
    parameters: Mapping[str, float] | None = None,
    order: int = 2,
    points: int = 40,
    rtol: float = 1e-8,
    borders: Sequence[tuple[str, Array]] = (),
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Regions:
    """Number and stability of the cycles over two parameters.

    x, y       (name, values) of the parameters
    interval   (0, hi) of the section's coordinate
    order      turns of the map after which a cycle closes (2 for symmetric hunting)
    points     coordinates in a cell; borders: curves to be kept with the map
    progress   called with (rows done, rows)

    Ctrl-C returns the rows that are done. Raises UsageError.
    """
    lo, hi = interval
    for name in (x[0], y[0]):
        if name not in system.parameters:
            raise UsageError(unknown("parameter", name, system.parameters))
    if x[0] == y[0] or lo != 0.0 or not hi > 0 or points < 8:
        raise UsageError(
            f"axes {x[0]!r} and {y[0]!r}, interval {interval}, points {points}: expected two parameters, "
            "(0, hi) and at least 8 points."
        )
    across, up = np.asarray(x[1], dtype=float), np.asarray(y[1], dtype=float)
    shape = (up.size, across.size)
    cycles, stable = np.full(shape, -1), np.full(shape, -1)
    calm, lost = np.zeros(shape, dtype=bool), np.full(shape, np.nan)
    amplitude = np.full(shape, np.nan)
    rows_of_map = MapRows(
        system, section, order=order, rtol=rtol, atol=1e-3 * rtol * CLOSEST * hi, threads=threads
    )
    complete = True
    try:
        for i, value in enumerate(up):
            values = {x[0]: across, y[0]: np.full(across.size, value)}
            row = cells(rows_of_map, rows_of_map.rows(values, parameters), hi, points)
            cycles[i], stable[i], calm[i], amplitude[i], lost[i] = row
            if progress is not None:
                progress(i + 1, up.size)
    except KeyboardInterrupt:
        complete = False
    return Regions(
        (x[0], y[0]), across, up, cycles, stable, calm, amplitude, lost, tuple(borders), complete,
        dict(parameters or {}),
    )  # fmt: skip


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
