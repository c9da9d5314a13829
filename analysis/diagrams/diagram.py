"""A bifurcation diagram: branches of fixed points over a parameter, and the places where they change."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov import System, UsageError
from filippov.analysis.maps.fixed_points import FixedPoint
from filippov.analysis.maps.section import Section
from filippov.analysis.maps.stroboscope import Stroboscope
from filippov.base.arrays import Array
from filippov.base.shown import Shown
from filippov.plot.style import axis_label, coordinate_labels

# Values of the parameter that differ by less than this part of the largest are one.
_ROUNDING = 1e-12


@dataclass(frozen=True)
class Special:
    """A place where the diagram changes.

    kind   "fold", "set stability change" or "period doubling"
    value  of the parameter; d: coordinate; residual: of the equations that define it
    """

    kind: str
    value: float
    d: float
    residual: float
    note: str = ""


@dataclass(frozen=True)
class DiagramBranch:
    """Fixed points that belong together: parameter values and points, in order."""

    values: tuple[float, ...]
    points: tuple[FixedPoint, ...]

    @property
    def d(self) -> Array:
        """Coordinates along the branch."""
        return np.array([point.d for point in self.points])

    @property
    def stable(self) -> npt.NDArray[np.bool_]:
        """Stability along the branch."""
        return np.array([point.stable for point in self.points])

    @property
    def kind(self) -> str:
        """What its points are."""
        return self.points[0].kind


def diagram_labels(system: System, section: Section | Stroboscope, parameter: str) -> dict[str, str]:
    """The labels of a diagram's axes: of the "parameter", and of the coordinate "d"."""
    return {"parameter": axis_label(system, parameter), "d": coordinate_labels(system, section)["d"]}


@dataclass(frozen=True)
class Diagram(Shown):
    """A bifurcation diagram.

    parameter, values  what was varied
    points             fixed points of each value
    branches           the same, joined; special: folds and changes of stability
    parameters         the values of all others
    interval           of the coordinate that was searched; None where orbits were followed
    section            where the coordinates are read; labels: of the axes, "parameter" and "d"
    """

    parameter: str
    values: tuple[float, ...]
    points: tuple[tuple[FixedPoint, ...], ...]
    branches: tuple[DiagramBranch, ...]
    special: tuple[Special, ...] = field(default=())
    parameters: Mapping[str, float] = field(default_factory=dict)
    interval: tuple[float, float] | None = None
    section: Section | Stroboscope | None = None
    labels: Mapping[str, str] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Plain data, without the branches."""
        return {
            "parameter": self.parameter, "parameters": dict(self.parameters),
            "interval": None if self.interval is None else list(self.interval),
            "section": None if self.section is None else self.section.to_dict(),
            "values": [
                {"value": float(value), "fixed_points": [point.to_dict() for point in found]}
                for value, found in zip(self.values, self.points, strict=True)
            ],
            "folds": [{self.parameter: value, "d": d} for value, d in self.folds],
            "stability_changes": [{self.parameter: value} for value in self.stability_changes],
            "special": [
                {"kind": q.kind, "value": float(q.value), "d": float(q.d), "residual": float(q.residual),
                 "note": q.note} for q in self.special
            ],
        }  # fmt: skip

    @property
    def folds(self) -> list[tuple[float, float]]:
        """(value, d) of every fold."""
        return [(s.value, s.d) for s in self.special if s.kind == "fold"]

    @property
    def stability_changes(self) -> list[float]:
        """Values at which the equilibrium set changes stability."""
        return [s.value for s in self.special if s.kind == "set stability change"]

    def __str__(self) -> str:
        found = f"{sum(map(len, self.points))} fixed points at {len(self.values)} values of {self.parameter}"
        return "\n".join([*self._told(), found])

    def _told(self) -> list[str]:
        """A line for each special point."""
        name, lines = self.parameter, []
        for place in self.special:
            of_set = place.kind == "set stability change"
            head = "the equilibrium set changes stability" if of_set else place.kind
            where = "" if of_set else f", d = {place.d:.12g}"
            note = f" ({place.note})" if place.note else ""
            lines.append(f"{head} at {name} = {place.value:.12g}{where}{note}")
        return lines

    def cycles(self, value: float) -> list[FixedPoint]:
        """Limit cycles at one of the values, which may differ by rounding."""
        nearest = min(self.values, key=lambda known: abs(known - value))
        if not abs(nearest - value) <= _ROUNDING * max(map(abs, self.values)):
            raise UsageError(
                f"the diagram has no value {value}: take one of its {len(self.values)} values; the nearest "
                f"is {nearest}."
            )
        return [point for point in self.points[self.values.index(nearest)] if point.kind == "limit cycle"]
