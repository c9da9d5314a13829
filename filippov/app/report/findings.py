"""What a study found beyond its cases: plain data for figures, tables and the summary."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from filippov.analysis.bifurcations.branch import Branch, BranchPoint
from filippov.analysis.diagrams.regions import Regions
from filippov.analysis.estimation.identification import Identified
from filippov.analysis.gains.gain_map import GainMap as RatioMap
from filippov.analysis.gains.tuning import Tuning
from filippov.analysis.harmonic.describing_function import DescribingFunction
from filippov.analysis.harmonic.static_cycle import StaticCycle
from filippov.analysis.orbits.orbit import Orbit
from filippov.models.questions import Law, Tuned

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class CaseCycles:
    """The cycles of one case.

    orbits    at its own parameters, by growing coordinate
    branches  over the study's parameter
    at        (value, points on the branches there) for every value of the study
    spread    largest relative difference of all these coordinates, and of the values of the special points,
              from those at a tighter tolerance; count: of these numbers
    """

    key: str
    orbits: tuple[Orbit, ...]
    branches: tuple[Branch, ...]
    at: tuple[tuple[float, tuple[BranchPoint, ...]], ...]
    spread: float
    count: int

    @property
    def special(self) -> list[BranchPoint]:
        """Special points of all branches."""
        return [point for branch in self.branches for point in branch.special]


@dataclass(frozen=True)
class Settings:
    """Settings without cycles: the search for each law, and the contraction ratio over two settings."""

    tunings: tuple[tuple[Tuned, Tuning], ...]
    ratio_map: RatioMap


@dataclass(frozen=True)
class Prediction:
    """Harmonic balance and algebra for one law, and the exact cycles beside them.

    harmonic  its cycles; exact: (coordinate, period, stable) of the cycles of the event map, coordinate first
    inputs    (amplitude of the input, frequency) of these
    ratio     of successive stick positions by the algebra, and by the event map; None where not asked
    algebraic cycles by the algebra
    """

    law: Law
    harmonic: DescribingFunction
    exact: tuple[tuple[float, float, bool], ...]
    inputs: tuple[tuple[float, float], ...]
    ratio: tuple[float, float] | None
    algebraic: tuple[StaticCycle, ...]


@dataclass(frozen=True)
class Measured:
    """An experiment: the estimate from its record, and the values it was made with.

    limit   value of the study's parameter above which there are no cycles, for the estimate; safe: for every
            end of its confidence intervals as well. None where none was found
    """

    found: Identified
    truth: Mapping[str, float]
    limit: float | None
    safe: float | None


@dataclass(frozen=True)
class RelativeCase:
    """One case of the smoother model.

    branch   over the study's parameter, with the coordinate `amplitude`; beyond: further on, where it was
             followed
    small    (start, comes to rest, ratio |P(d)/d| of the exact map there) of starts near rest
    """

    key: str
    branch: Branch
    beyond: Branch | None
    small: tuple[tuple[float, bool, float], ...]

    @property
    def fold(self) -> BranchPoint | None:
        """The first fold, beyond the study's range where it is there."""
        found = [*self.branch.folds, *(self.beyond.folds if self.beyond else [])]
        return found[0] if found else None


@dataclass(frozen=True)
class Findings:
    """Everything; None or empty where it was not asked."""

    cycles: tuple[CaseCycles, ...] = ()
    ending: Branch | None = None
    regions: Regions | None = None
    settings: Settings | None = None
    predictions: tuple[Prediction, ...] = ()
    measured: Measured | None = None
    relative: tuple[RelativeCase, ...] = ()

    def of(self, key: str) -> CaseCycles | None:
        """The cycles of a case."""
        return next((c for c in self.cycles if c.key == key), None)
