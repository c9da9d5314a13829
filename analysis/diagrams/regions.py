"""How many cycles there are, and which are stable, over two parameters.

Every cell is one pair of values: the sign changes of R(d) - d over a grid of coordinates, each refined until
its slope is known, and the local extrema that come close to 0, where a pair of cycles may hide. The borders
between regions are not read off the cells but computed as curves (see
`filippov.analysis.bifurcations.curve`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov import System, UsageError
from filippov.analysis.algebra.growth import GROWTHS
from filippov.analysis.diagrams.borders import exact_borders
from filippov.analysis.diagrams.cell_work import CellWork
from filippov.analysis.diagrams.cells import CLOSEST, cells
from filippov.analysis.maps.map_rows import MapRows
from filippov.analysis.maps.section import Section
from filippov.base.arrays import Array, Whole
from filippov.base.given import Axis, Count, Edge, Interval, Positive
from filippov.base.keywords import keywords
from filippov.base.names import unknown
from filippov.base.shown import Told
from filippov.plot.style import axis_labels
from filippov.sweep.rows import ERROR
from filippov.sweep.run import run

# Cells that are computed side by side: whole rows, as many as have so many cells. An interrupt loses no more.
_SIDE_BY_SIDE = 250
# By their place, from the end for -1: "undecided" is the last.
_VERDICTS = np.array(GROWTHS)


@dataclass(frozen=True)
class Regions(Told):
    """Cells over two parameters; arrays have shape (len(y), len(x)).

    names          of the parameters; x, y: their values
    cycles, stable, undecided   number of cycles in the interval, how many of them are stable, and of how many
                   the slope is 1 within its error; -1 where not computed
    set_verdict    "stable" where small excursions shrink: the set of equilibria attracts; "unstable" where
                   they grow, "undecided" where they do neither within their error, are lost or not computed
    amplitude      d of the largest stable cycle, NaN without one
    lost           share of the coordinates whose solution does not return within t_max
    borders        (name, points (k, 2)) of curves that bound the regions
    complete       False where the computation was interrupted
    parameters     the values of all others; labels: of the axes, with units
    """

    _also = ("set_stable",)

    names: tuple[str, str]
    x: Array
    y: Array
    cycles: Whole
    stable: Whole
    undecided: Whole
    set_verdict: npt.NDArray[np.str_]
    amplitude: Array
    lost: Array
    borders: tuple[tuple[str, Array], ...] = ()
    complete: bool = True
    parameters: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)

    @property
    def set_stable(self) -> npt.NDArray[np.bool_]:
        """Where the set of equilibria attracts."""
        return np.asarray(self.set_verdict == "stable")

    def to_dict(self) -> dict[str, Any]:
        """The map as plain data."""
        borders = [{"name": name, "points": points.tolist()} for name, points in self.borders]
        return super().to_dict() | {"borders": borders}

    def __str__(self) -> str:
        x, y = self.names
        lines = [f"{int(np.sum(self.cycles > 0))} of {self.cycles.size} cells have a cycle"]
        for name, points in self.borders:
            (x0, y0), (x1, y1) = points[0], points[-1]
            lines.append(f"{name}: from {x} {x0:.6g}, {y} {y0:.6g} to {x} {x1:.6g}, {y} {y1:.6g}")
        return "\n".join(lines)

    def text(self, i: int, j: int) -> str:
        """What the cell in row i and column j holds."""
        if self.cycles[i, j] < 0:
            return "not computed"
        left = f", {self.undecided[i, j]} undecided" if self.undecided[i, j] else ""
        told = f"{self.cycles[i, j]} cycles, {self.stable[i, j]} stable{left}"
        return f"{told}; set of equilibria {self.set_verdict[i, j]}"


@keywords()
def regions(
    system: System,
    section: Section,
    x: Axis,
    y: Axis,
    interval: Interval,
    *,
    parameters: Mapping[str, float] | None = None,
    order: Count = 2,
    points: Edge = 40,
    rtol: Positive = 1e-8,
    borders: Sequence[tuple[str, Array]] | str = (),
    threads: Count | None = None,
    engine: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Regions:
    """Number and stability of the cycles over two parameters.

    x, y       (name, values) of the parameters
    interval   (0, hi) of the section's coordinate
    order      returns of the map after which a cycle closes (2 for symmetric cycles)
    points     coordinates in a cell
    borders    "exact": the fold of cycles and the change of stability of the set are computed as curves
               (see `filippov.analysis.diagrams.borders`) and kept with the map; or curves (name, points (k,
               2))
    engine     keywords of `filippov.sweep.run.run`, such as {"folder": ..., "jobs": 8, "resume": True}: the
               cells are computed by worker processes and kept in the folder; None: here, by threads
    progress   called with (rows done, rows), with an engine with (cells done, cells)

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
    if isinstance(borders, str) and borders != "exact":
        raise UsageError(f"borders is {borders!r}, expected 'exact' or curves (name, points (k, 2)).")
    across, up = np.asarray(x[1], dtype=float), np.asarray(y[1], dtype=float)
    others = system.parameters.others(parameters, (x[0], y[0]))

    def curves(amplitude: Array) -> tuple[tuple[str, Array], ...]:
        if not isinstance(borders, str):
            return tuple(borders)
        return exact_borders(system, section, x, y, amplitude, hi, parameters=parameters, order=order)

    shape, named = (up.size, across.size), axis_labels(system, x[0], y[0])
    if engine is not None:
        pairs = np.column_stack([axis.ravel() for axis in np.meshgrid(across, up)])
        units = {name: system.parameters[name].unit for name in (x[0], y[0])}
        work = CellWork(
            system, section, (x[0], y[0]), pairs, hi, points, order, rtol, dict(parameters or {}),
            {name: unit for name, unit in units.items() if unit}, across.size,
        )  # fmt: skip
        table = run(work, **engine, progress=progress)
        table.raise_errors(ERROR)
        found = [table[name].reshape(shape) for name in work.columns]
        count = [np.where(np.isnan(part), -1, part).astype(np.int64) for part in found[:4]]
        return Regions(
            (x[0], y[0]), across, up, count[0], count[1], count[2], _VERDICTS[count[3]], found[4], found[5],
            curves(found[4]) if table.complete else (), table.complete, others, named,
        )  # fmt: skip
    cycles, stable, undecided, beside = (np.full(shape, -1) for _ in range(4))
    amplitude, lost = np.full(shape, np.nan), np.full(shape, np.nan)
    rows_of_map = MapRows(system, section, order=order, rtol=rtol, threads=threads)
    every = {x[0]: np.tile(across, up.size), y[0]: np.repeat(up, across.size)}
    rows_of_map.suited(rows_of_map.rows(every, parameters), hi, CLOSEST)
    complete = True
    try:
        each = max(1, _SIDE_BY_SIDE // across.size)
        for first in range(0, up.size, each):
            block = up[first : first + each]
            values = {x[0]: np.tile(across, block.size), y[0]: np.repeat(block, across.size)}
            flat = cells(rows_of_map, rows_of_map.rows(values, parameters), hi, points)
            lines = zip(*(column.reshape(block.size, across.size) for column in flat), strict=True)
            for i, row in enumerate(lines, first):
                cycles[i], stable[i], undecided[i], beside[i], amplitude[i], lost[i] = row
                if progress is not None:
                    progress(i + 1, up.size)
    except KeyboardInterrupt:
        complete = False
    return Regions(
        (x[0], y[0]), across, up, cycles, stable, undecided, _VERDICTS[beside], amplitude, lost,
        curves(amplitude) if complete else (), complete, others, named,
    )  # fmt: skip
