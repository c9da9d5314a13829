"""Polynomials: where their roots lie, and for which parameters all lie left of the imaginary axis."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import field
from typing import Any, Literal

import sympy

from filippov.app.bank.notation import Number, formula, number
from filippov.app.bank.outcome import MissingError
from filippov.app.bank.polynomial import Polynomial
from filippov.app.bank.quantities.quantity import PolynomialQuantity, one_of
from filippov.base.errors import ModelError
from filippov.base.names import check_known
from filippov.model.expression import parse_condition

NEAR_AXIS = 1e-9


def assigned(polynomial: Polynomial, at: dict[str, Number]) -> Polynomial:
    """The polynomial with numbers, as exact fractions, substituted for parameters. Raises ModelError."""
    check_known("parameter", at, [symbol.name for symbol in polynomial.symbols])
    values = {polynomial.names[k]: sympy.Rational(str(formula(value, {}))) for k, value in at.items()}
    return polynomial.at(values) if at else polynomial


class RootCounts(PolynomialQuantity, quantity="root_counts"):
    """The numbers of roots [right of, on, left of] the imaginary axis, exact, or one of them.

    at  values of parameters
    """

    take: Literal["all", "right", "axis", "left"] = "all"
    at: dict[str, Number] = field(default_factory=dict)

    def __call__(self, subject: Polynomial) -> Any:
        routh = assigned(subject, self.at).routh
        if routh.counts is None:
            raise MissingError(routh.message or "the polynomial has parameters that are not given")
        row = [routh.counts.rhp, routh.counts.axis, routh.counts.lhp]
        return row if self.take == "all" else row[("right", "axis", "left").index(self.take)]


class Roots(PolynomialQuantity, quantity="roots"):
    """All roots as [real, imaginary]."""

    at: dict[str, Number] = field(default_factory=dict)

    def __call__(self, subject: Polynomial) -> Any:
        return [[root.real, root.imag] for root in assigned(subject, self.at).roots()]


class RootDistance(PolynomialQuantity, quantity="root_distance"):
    """The distance of the nearest root from [real, imaginary]."""

    root: tuple[Number, Number]
    at: dict[str, Number] = field(default_factory=dict)

    def __call__(self, subject: Polynomial) -> Any:
        wanted = complex(*(number(part, subject.names) for part in self.root))
        return min(abs(root - wanted) for root in assigned(subject, self.at).roots())


class StabilityVerdict(PolynomialQuantity, quantity="verdict"):
    """The text "asymptotically stable", "marginally stable" or "unstable"."""

    at: dict[str, Number] = field(default_factory=dict)

    def __call__(self, subject: Polynomial) -> Any:
        verdict = assigned(subject, self.at).routh.verdict
        if verdict is None:
            raise MissingError("the polynomial has parameters that are not given")
        return verdict.value


class StabilityCondition(PolynomialQuantity, quantity="stability_condition"):
    """The number of sample points of the parameters at which a condition differs from stability.

    The points are random rationals of several sizes, and points just beside the boundaries of the condition;
    at each the roots are counted exactly. Inequalities are joined by and, or, not.
    """

    condition: str

    def __call__(self, subject: Polynomial) -> Any:
        condition, found = parse_condition(self.condition, subject.names), subject.routh
        if found.status != "complete":
            raise MissingError(found.message)
        wrong, tried, when = 0, 0, found.stable_when
        for point in subject.points(condition):
            try:
                expected = condition.subs(point)
                got = when if isinstance(when, bool) else when.subs(point)
            except (TypeError, ZeroDivisionError):
                continue
            if expected in (sympy.true, sympy.false) and got in (sympy.true, sympy.false):
                tried += 1
                wrong += not expected == got == subject.stable_at(point)
        if tried < 20:
            raise MissingError("the condition could be tried at too few points")
        return float(wrong)


class StableRange(PolynomialQuantity, quantity="stable_range"):
    """The values of the one parameter for which all roots are left of the axis.

    take  interval ([least, largest] of the only one), least, largest; boundaries: all finite ends, in order
    """

    parameter: str
    take: Literal["interval", "least", "largest", "boundaries"] = "interval"
    number: int | None = None

    def __call__(self, subject: Polynomial) -> Any:
        k, intervals = subject.stable_intervals()
        check_known("parameter", [self.parameter], [k.name])
        if self.take == "boundaries":
            ends = [float(end) for pair in intervals for end in pair if end.is_finite]
            return ends if self.number is None else one_of(ends, self.number, "boundaries")
        if len(intervals) != 1:
            raise MissingError(f"{k} has {len(intervals)} intervals of stability")
        found = {"interval": intervals[0], "least": intervals[0][:1], "largest": intervals[0][1:]}[self.take]
        if any(not value.is_finite for value in found):
            raise MissingError(f"the polynomial is stable for {intervals[0][0]} < {k} < {intervals[0][1]}")
        return [float(value) for value in found] if self.take == "interval" else float(found[0])


class AxisFrequencies(PolynomialQuantity, quantity="axis_frequencies"):
    """Frequencies of the roots on the axis, in order: at the ends of a parameter's stable range if any."""

    number: int | None = None

    def __call__(self, subject: Polynomial) -> Any:
        given = [subject]
        if subject.free:
            k, intervals = subject.stable_intervals()
            ends = sorted({end for pair in intervals for end in pair if end.is_finite})
            given = [subject.at({k: sympy.Rational(str(end))}) for end in ends]
        roots = [root for polynomial in given for root in polynomial.roots()]
        found = sorted({r.imag for r in roots if r.imag > 0 and abs(r.real) <= NEAR_AXIS * (1 + abs(r))})
        if not found:
            raise MissingError("no roots are on the axis")
        return found if self.number is None else one_of(found, self.number, "frequencies")


class AxisPair(PolynomialQuantity, quantity="axis_pair"):
    """How far the roots are from +-j frequency where an equation holds, two of them being on the axis.

    equation   left = right, linear in a parameter, which is solved for; the others take some values
    frequency  a formula in the parameters
    """

    equation: str
    frequency: str

    def __call__(self, subject: Polynomial) -> Any:
        left, equals, right = self.equation.partition("=")
        if not equals:
            raise ModelError(f"{self.equation!r:.60} is no equation.")
        gap = formula(left, subject.names) - formula(right, subject.names)
        frequency = formula(self.frequency, subject.names)
        x = next((s for s in subject.symbols if sympy.degree(gap, s) == 1), None)
        if x is None:
            raise ModelError(f"the equation {self.equation!r:.60} is not linear in a parameter.")
        value, worst = sympy.solve(gap, x)[0], 0.0
        for point in _grid([s for s in subject.symbols if s != x]):
            at = {**point, x: value.subs(point)}
            polynomial, wanted = subject.at(at), float(frequency.subs(at))
            if polynomial.routh.counts is None or polynomial.routh.counts.axis < 2:
                raise MissingError(f"no roots are on the axis at {at}")
            near = min(abs(root - 1j * wanted) for root in polynomial.roots())
            worst = max(worst, float(near) / (1 + abs(wanted)))
        return worst


def _grid(symbols: Sequence[sympy.Symbol]) -> list[dict[sympy.Symbol, sympy.Expr]]:
    values = (sympy.Rational(1, 3), sympy.Integer(2), sympy.Rational(7, 2))
    return [dict(zip(symbols, row, strict=True)) for row in itertools.product(values, repeat=len(symbols))]
