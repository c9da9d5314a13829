"""What a study has computed: plain data for figures, tables and the summary."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import networkx as nx
import numpy as np
import numpy.typing as npt

from filippov.analysis.comparisons.comparison_result import Comparison
from filippov.analysis.diagrams.bifurcation import Diagram
from filippov.analysis.local_stability.stability import StabilityReport
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.fixed_points import Basin, FixedPoint, Jump
from filippov.app.report.findings import Findings
from filippov.model.system import System
from filippov.models.registry import Model
from filippov.models.studies import Curve, Study, StudyCase
from filippov.solving.solution import Solution

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Samples:
    """The map and its iterate at coordinates d."""

    d: Array
    once: Array
    power: Array


@dataclass(frozen=True)
class Agreement:
    """One cycle by several methods: values by name of the method, and the digits on which they agree."""

    case: str
    values: Mapping[str, float]
    reference: str

    def digits(self, *names: str) -> float:
        """Decimal digits on which the named methods agree, relative to the value."""
        chosen = [self.values[n] for n in names if n in self.values]
        spread = max(chosen) - min(chosen)
        return float(-np.log10(max(spread / abs(chosen[0]), 2.0**-53)))


@dataclass(frozen=True)
class Exactness:
    """How exact the response is.

    height    largest |h| while sliding on the section's surface; spreads: of the model's invariants there
    iterates  largest distance of its `count` rest positions from the iterates of the map
    """

    height: float
    spreads: Mapping[str, float]
    iterates: float
    count: int


@dataclass(frozen=True)
class CaseResult:
    """Everything computed for one case."""

    case: StudyCase
    parameters: Mapping[str, float]
    curve: Curve
    solution: Solution
    exactness: Exactness
    orbit: Array
    event_map: EventMap
    power: EventMap
    wide: Samples
    small: Samples
    fixed: tuple[FixedPoint, ...]
    basins: tuple[Basin, ...]
    jumps: tuple[Jump, ...]
    diagram: Diagram
    beyond: Diagram
    stability: StabilityReport
    agreements: tuple[Agreement, ...]
    graph: nx.MultiDiGraph
    word: str

    @property
    def cycles(self) -> tuple[FixedPoint, ...]:
        """The limit cycles among the fixed points."""
        return tuple(q for q in self.fixed if q.kind == "limit cycle")

    @property
    def bound(self) -> float | None:
        """The value of the parameter above which the Routh-Hurwitz conditions hold; None without one."""
        return next((_start(s.numeric) for s in self._solved()), None)

    @property
    def thresholds(self) -> tuple[float, ...]:
        """Values at which the linearised return map says that the set changes stability."""
        return next((tuple(s.threshold) for s in self._solved()), ())

    def _solved(self) -> list[Any]:
        cases = [c for item in self.stability.items for c in item.cases if c.applies]
        return [c.solved for c in cases if c.solved is not None and c.polynomial is not None]


def _start(condition: Any) -> float | None:
    """The lower end of the set that a condition on one symbol describes."""
    try:
        return float(condition.as_set().start)
    except (AttributeError, NotImplementedError, TypeError, ValueError):
        return None


@dataclass(frozen=True)
class Results:
    """A computed study.

    comparison  with the variants, None without any; timing: seconds by stage; machine: what it ran on
    findings    answers to the study's questions
    """

    study: Study
    model: Model
    system: System
    cases: tuple[CaseResult, ...]
    possible: nx.MultiDiGraph
    comparison: Comparison | None
    timing: dict[str, float] = field(default_factory=dict)
    machine: Mapping[str, str] = field(default_factory=dict)
    findings: Findings = field(default_factory=Findings)

    @property
    def main(self) -> CaseResult:
        """The case that is shown in most detail."""
        return self.cases[0]

    def case(self, key: str) -> CaseResult:
        """The results of a case."""
        return next(c for c in self.cases if c.case.key == key)
