"""Cells of a region map and values of a bifurcation diagram as work for the engine of sweeps."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from filippov import SolveError, Status, System
from filippov.analysis.algebra.growth import GROWTHS
from filippov.analysis.diagrams.cells import CLOSEST, COLUMNS, cells
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.fixed_points import FixedPoint
from filippov.analysis.maps.map_rows import MapRows
from filippov.analysis.maps.section import Section
from filippov.base.arrays import Array, Whole
from filippov.base.version import package_version
from filippov.sweep.dependence import Dependence, dependence, plain_system
from filippov.sweep.rows import Limits, Rows, in_blocks
from filippov.sweep.table import SweepTable
from filippov.sweep.toolchain import own_sources, toolchain

MOST = 64  # fixed points of one value
KINDS = ("limit cycle", "equilibrium set")
_NUMBERS = ("d", "slope", "residual", "period")


def _fields(system: System, section: Section, **others: Any) -> dict[str, str]:
    given = section.parametrisation
    at = _depends(given).digest if callable(given) else str(dict(given or {}))
    said = {
        "filippov": f"{package_version()} {own_sources()}", **toolchain(),
        "model": system.digest or _model(system).digest,
        "section": f"{section.stop!r} {section.coordinate} {at} {section.t_max!r} {section.after}".rstrip(),
    }  # fmt: skip
    return said | {name: json.dumps(value) for name, value in others.items()}


def _model(system: System) -> Dependence:
    return Dependence("") if system.field is None else dependence(*plain_system(system))


def _depends(parametrisation: Any) -> Dependence:
    return dependence(parametrisation) if callable(parametrisation) else Dependence("")


def _unseen(system: System, section: Section) -> tuple[str, ...]:
    return (*_model(system).unseen, *_depends(section.parametrisation).unseen)


@dataclass(frozen=True)
class CellWork:
    """Cells of `filippov.analysis.diagrams.regions` over two parameters; the arguments as there.

    tries  coordinates in a cell; grain: cells in a row of the picture
    """

    system: System
    section: Section
    names: tuple[str, ...]
    points: Array
    hi: float
    tries: int
    order: int
    rtol: float
    parameters: Mapping[str, float]
    units: Mapping[str, str]
    grain: int
    columns = COLUMNS

    @property
    def first(self) -> int:
        """Cells to begin with."""
        return self.grain

    @cached_property
    def fields(self) -> dict[str, str]:
        """All that decides the results."""
        return _fields(
            self.system, self.section, names=self.names, hi=self.hi,
            tries=self.tries, order=self.order, rtol=self.rtol, parameters=dict(self.parameters),
        )  # fmt: skip

    @cached_property
    def unseen(self) -> tuple[str, ...]:
        """What decides them as well and cannot be seen beforehand."""
        return _unseen(self.system, self.section)

    def compute(self, index: Whole, limits: Limits) -> Rows:
        """The cells with these numbers."""
        return in_blocks(index, self.grain, len(self.points), limits, self._block)

    @cached_property
    def _maps(self) -> MapRows:
        event_maps = MapRows(self.system, self.section, order=self.order, rtol=self.rtol, threads=1)
        columns = {name: self.points[:, k] for k, name in enumerate(self.names)}
        return event_maps.suited(event_maps.rows(columns, self.parameters), self.hi, CLOSEST)

    def __getstate__(self) -> dict[str, Any]:
        """Machine code stays in its process."""
        return {name: value for name, value in vars(self).items() if name != "_maps"}

    def _block(self, index: Whole) -> Rows:
        event_maps = self._maps
        columns = {name: self.points[index, k] for k, name in enumerate(self.names)}
        found = cells(event_maps, event_maps.rows(columns, self.parameters), self.hi, self.tries)
        return Rows(index, np.column_stack(found).astype(float), (Status.SUCCESS.value,) * len(index))


@dataclass(frozen=True)
class DiagramWork:
    """Fixed points of a map over a parameter; `tries`: points of the search; `options` of EventMap."""

    system: System
    section: Section
    names: tuple[str, ...]
    points: Array
    interval: tuple[float, float]
    tries: int
    options: Mapping[str, Any]
    parameters: Mapping[str, float]
    units: Mapping[str, str]
    first = grain = 1

    @property
    def columns(self) -> tuple[str, ...]:
        """d, slope, residual, period, kind and verdict of up to MOST points, one after the other."""
        return tuple(f"{name}{k}" for k in range(MOST) for name in (*_NUMBERS, "kind", "verdict"))

    @cached_property
    def fields(self) -> dict[str, str]:
        """All that decides the results."""
        return _fields(
            self.system, self.section, names=self.names, interval=self.interval,
            tries=self.tries, parameters=dict(self.parameters), **self.options,
        )  # fmt: skip

    @cached_property
    def unseen(self) -> tuple[str, ...]:
        """What decides them as well and cannot be seen beforehand."""
        return _unseen(self.system, self.section)

    def compute(self, index: Whole, limits: Limits) -> Rows:
        """The values with these numbers."""
        base = EventMap(self.system, self.section, parameters=self.parameters, **self.options)
        values = np.full((len(index), len(self.columns)), np.nan)
        notes: dict[int, str] = {}
        for row, point in enumerate(index.tolist()):
            given = {self.names[0]: float(self.points[point, 0])}
            found = base.remake(parameters=given).fixed_points(*self.interval, self.tries)
            if len(found) > MOST:
                raise SolveError(f"{self.names[0]} = {self.points[point, 0]}: more than {MOST} fixed points.")
            numbers = [
                x for q in found for x in (
                    *(getattr(q, name) for name in _NUMBERS), KINDS.index(q.kind), GROWTHS.index(q.verdict),
                )
            ]  # fmt: skip
            values[row, : len(numbers)] = numbers
            notes[point] = json.dumps([q.note for q in found])
        return Rows(index, values, (Status.SUCCESS.value,) * len(index), notes)


def fixed_points_of(table: SweepTable) -> list[tuple[FixedPoint, ...]]:
    """The fixed points of each value of a DiagramWork that is done, as far as all before it are done too."""
    out: list[tuple[FixedPoint, ...]] = []
    for point in range(int(np.argmin(np.append(table.known, False)))):
        rows = table.values[point].reshape(MOST, -1)
        found = []
        for row, note in zip(rows.tolist(), json.loads(table.message[point]), strict=False):
            d, slope, residual, period, kind, verdict = row
            told = KINDS[int(kind)], slope, GROWTHS[int(verdict)]
            found.append(FixedPoint(d, *told, residual, period, note))
        out.append(tuple(found))
    return out
