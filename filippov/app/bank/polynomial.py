"""A case that is a polynomial, its coefficients from text, and the values for which it is stable."""

from __future__ import annotations

import itertools
import random
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import sympy
from sympy import Expr, Symbol

from filippov.analysis.algebra.polynomial import Verdict, count_roots
from filippov.analysis.algebra.routh_hurwitz import RouthHurwitz, routh_hurwitz
from filippov.app.bank.notation import formula, words
from filippov.app.bank.outcome import MissingError
from filippov.base.errors import ModelError, UsageError
from filippov.base.names import check_name
from filippov.model.expression import FUNCTIONS

# Points of the parameters that a condition is tried at.
SAMPLES = 96


@dataclass(frozen=True)
class Polynomial:
    """a_0 s^n + ... + a_n with real parameters.

    names   what stands for the parameters: their symbols
    budget  seconds for its analysis
    """

    coefficients: tuple[Expr, ...]
    names: Mapping[str, Any]
    budget: float

    @cached_property
    def routh(self) -> RouthHurwitz:
        """Its Routh-Hurwitz analysis."""
        return routh_hurwitz(list(self.coefficients), budget=self.budget)

    @property
    def symbols(self) -> tuple[Symbol, ...]:
        """The parameters, by name."""
        return tuple(self.names[name] for name in sorted(self.names) if isinstance(self.names[name], Symbol))

    def at(self, values: Mapping[Symbol, Expr]) -> Polynomial:
        """The polynomial with numbers in place of parameters."""
        return Polynomial(tuple(c.subs(values) for c in self.coefficients), {}, self.budget)

    def roots(self) -> list[complex]:
        """All roots with their multiplicity, to double precision. Raises ModelError with parameters left."""
        s = Symbol("s")
        if self.free:
            raise ModelError("the polynomial has parameters that are not given")
        whole = sympy.Poly(
            [sympy.nsimplify(c, rational=True) if c.is_Float else c for c in self.coefficients], s
        )
        # Repeated roots are found one by one: numerically they are worth a fraction of the digits.
        found: list[complex] = []
        for factor, multiplicity in whole.sqf_list()[1]:
            for root in sympy.Poly(factor, s).nroots(n=30, maxsteps=500):
                found += [complex(root)] * multiplicity
        return found

    def stable_at(self, point: Mapping[Symbol, Expr]) -> Any:
        """Whether all roots are left of the axis at a point of the parameters; None where all vanish."""
        try:
            verdict = count_roots(list(self.at(point).coefficients)).verdict
        except UsageError:
            return None
        return sympy.true if verdict is Verdict.ASYMPTOTICALLY_STABLE else sympy.false

    @property
    def free(self) -> list[Symbol]:
        """The parameters in the coefficients, by name."""
        return sorted(set().union(*(c.free_symbols for c in self.coefficients)), key=str)

    def stable_intervals(self) -> tuple[Symbol, list[tuple[Any, Any]]]:
        """The one parameter, and the intervals of its values for which all roots are left of the axis."""
        if len(self.free) != 1:
            raise ModelError(f"the polynomial has {len(self.free)} parameters, not one.")
        k = self.free[0]
        found = self.routh.solve_for(k, as_set=True)
        pieces = found.args if isinstance(found, sympy.Union) else [found]
        out = [(piece.start, piece.end) for piece in pieces if isinstance(piece, sympy.Interval)]
        if not out:
            raise MissingError(f"the polynomial is stable for no {k}")
        return k, out

    def points(self, condition: Any) -> list[dict[Symbol, Expr]]:
        """Rational points: at random of several sizes, and just beside the boundaries of the condition."""
        symbols, draw = self.symbols, random.Random(20)  # noqa: S311
        numbers = {abs(int(n)) for n in condition.atoms(sympy.Integer)} | {1, 10}
        points = []
        for k in range(SAMPLES):
            size = sorted(numbers)[k % len(numbers)] or 1
            point = {x: sympy.Rational(draw.randint(-300, 600), 300) * size for x in symbols}
            points.append(point)
            bounds = condition.atoms(sympy.core.relational.Relational) if symbols and k < 16 else ()
            for relation in bounds:
                points += _beside(relation, point, symbols[k % len(symbols)])
        return points


def read_polynomial(raw: Mapping[str, Any], budget: float) -> Polynomial:
    """The polynomial of a case: `polynomial` is the list of its coefficients. Raises ModelError."""
    given = raw["polynomial"]
    if isinstance(given, str) or not isinstance(given, Sequence) or not given:
        raise ModelError(f"polynomial is {given!r:.60}, expected the list of its coefficients.")
    names: dict[str, Any] = {}
    for word in itertools.chain.from_iterable(map(words, given)):
        if word not in FUNCTIONS and word not in ("pi", "t", "e", "E") and not re.fullmatch(r"[eE]\d*", word):
            names[check_name(word, "parameter")] = Symbol(word, real=True)
    for key, value in (raw.get("params") or {}).items():
        names[check_name(key, "parameter")] = formula(value, names)
    return Polynomial(tuple(formula(value, names) for value in given), names, budget)


def _beside(relation: Any, point: dict[Symbol, Expr], x: Symbol) -> list[dict[Symbol, Expr]]:
    """Points 1e-6 to either side of where a relation turns over, along one parameter."""
    rest = {key: value for key, value in point.items() if key != x}
    gap = sympy.together((relation.lhs - relation.rhs).subs(rest))
    if not gap.free_symbols:
        return []
    top = sympy.Poly(sympy.numer(gap), x) if sympy.numer(gap).is_polynomial(x) else None
    if top is None or top.degree() not in (1, 2):
        return []
    out = []
    for root in top.nroots(n=20):
        if root.is_real:
            value = sympy.Rational(str(root))
            out += [
                {**rest, x: value + shift * (1 + abs(value))}
                for shift in (sympy.Rational(1, 10**6), -sympy.Rational(1, 10**6))
            ]
    return out
