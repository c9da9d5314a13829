"""What a stability analysis found, as plain data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import sympy
from sympy import Expr, Symbol

from filippov.analysis.algebra.routh_hurwitz import RouthHurwitz
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet, Missing
from filippov.analysis.steady.linearisation import Linearisation, SlipLinearisation
from filippov.analysis.steady.rest_map import RestMap
from filippov.base.names import Answering
from filippov.model.system import System

Answer = Literal["asymptotically stable", "stable", "unstable", "undecided"]
Criterion = Literal["necessary and sufficient", "sufficient", "none"]


@dataclass(frozen=True)
class Statement:
    """A sentence and where it comes from: "computed", "proved" (with where), or a source."""

    text: str
    source: str = "computed"


@dataclass(frozen=True)
class SetEvidence:
    """Evidence of an event map about a set: the slope of its second iterate there, the method, the error."""

    slope: float
    method: str
    error: float = 1e-6


# A hook for stability_report: (system, set, parameter values) -> evidence, or None where it has none.
SetStability = Callable[[System, EquilibriumSet, Mapping[str, float]], SetEvidence | None]


@dataclass(frozen=True)
class Solved:
    """The Routh-Hurwitz conditions solved for one parameter.

    formula     in the other parameters
    numeric     with the others at their values
    threshold   where the set itself changes stability, from the return map; () where it was not computed
    """

    symbol: Symbol
    formula: Any
    numeric: Any
    threshold: tuple[float, ...] = ()


@dataclass(frozen=True)
class SlipCase:
    """The slip dynamics beside a set, in one case of the exponents, on the sides that share it.

    applies      whether the case holds at the parameter values
    polynomial   det(s - A), highest coefficient first; None where no linear part exists
    criterion    the role of the Routh-Hurwitz conditions for the stability of the set
    hurwitz      whether they hold at the parameter values (with the case's exponent)
    answer       for the set, at the parameter values (with the case's exponent)
    """

    sides: tuple[str, ...]
    condition: Any
    applies: bool
    linearisation: SlipLinearisation
    polynomial: tuple[Expr, ...] | None
    routh: RouthHurwitz | None
    criterion: Criterion
    hurwitz: bool | None
    maps: tuple[RestMap, ...]
    solved: Solved | None
    answer: Answer
    statements: tuple[Statement, ...]


@dataclass(frozen=True)
class EquilibriumStability:
    """The analysis of one equilibrium or set.

    polynomial   of the mode: Jacobian of a smooth mode, or of the sliding field without its k normal roots
    routh        its Routh-Hurwitz analysis; the zero roots along a set are taken out
    drift        sliding moves along the set (a zero root with a Jordan chain)
    interior     stability of the inner points of a set within their mode
    together     modes of the sets that it touches: the verdict is that of their union, not of it alone
    """

    equilibrium: EquilibriumPoint | EquilibriumSet
    linearisation: Linearisation | None
    polynomial: tuple[Expr, ...] | None
    routh: RouthHurwitz | None
    drift: bool
    interior: Answer
    cases: tuple[SlipCase, ...]
    answer: Answer
    statements: tuple[Statement, ...]
    solved: Solved | None = None
    together: tuple[str, ...] = ()


# Of characteristic polynomials: s is a multiplier. No state or parameter can have the name.
EIGENVALUE = sympy.Symbol("lambda")


@dataclass(frozen=True)
class StabilityResult(Answering):
    """All equilibria of a system with their stability, at parameter values and in formulas.

    decimals   whether the model is written with decimals: then its numbers are printed so
    """

    states: tuple[str, ...]
    surfaces: tuple[str, ...]
    parameters: tuple[tuple[str, float], ...]
    assume: tuple[Any, ...]
    items: tuple[EquilibriumStability, ...]
    notes: tuple[str, ...]
    decimals: bool = False

    @property
    def complete(self) -> bool:
        """Whether no other equilibrium can exist: all modes were searched to their end, in formulas."""
        return not any(isinstance(note, Missing) for note in self.notes)
