"""Parameters of a polynomial: points to try a condition at, and the values for which it is stable."""

from __future__ import annotations

import itertools
import random
from collections.abc import Mapping
from typing import Any

import sympy
from sympy import Expr, Symbol

from filippov.analysis.algebra.polynomial import Verdict, count_roots
from filippov.app.bank.polynomial import Polynomial
from filippov.app.bank.reason import MissingError
from filippov.base.errors import ModelError, UsageError

SAMPLES = 96
_DIGITS = 30


def stable_at(polynomial: Polynomial, point: Mapping[Symbol, Expr]) -> Any:
    """Whether all roots are left of the axis at a point of the parameters; None where all vanish."""
    numbers = [c.subs(point) for c in polynomial.coefficients]
    try:
        return sympy.true if count_roots(numbers).verdict is Verdict.ASYMPTOTICALLY_STABLE else sympy.false
    except UsageError:
        return None


def points(polynomial: Polynomial, condition: Any) -> list[dict[Symbol, Expr]]:
    """Rational points: at random of several sizes, and just beside the boundaries of the condition."""
    symbols = sorted(polynomial.symbols, key=str)
    draw = random.Random(20)  # noqa: S311
    numbers = {abs(int(n)) for n in condition.atoms(sympy.Integer)} | {1, 10}
    points = []
    for k in range(SAMPLES):
        size = sorted(numbers)[k % len(numbers)] or 1
        point = {x: sympy.Rational(draw.randint(-300, 600), 300) * size for x in symbols}
        points.append(point)
        x = symbols[k % len(symbols)] if symbols else None
        for relation in condition.atoms(sympy.core.relational.Relational) if x is not None and k < 16 else ():
            points += _beside(relation, point, x)
    return points


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


def critical_values(polynomial: Polynomial, k: Symbol) -> list[Expr]:
    """Real values of a parameter at which a root is on the imaginary axis or at infinity, in order.

    With P(j w) = A(w) + j w B(w), roots j w, w != 0, belong to zeros of the resultant of A and B by w.
    """
    w = Symbol("w", real=True)
    degree = len(polynomial.coefficients) - 1
    real, imaginary = sympy.Integer(0), sympy.Integer(0)
    for place, c in enumerate(polynomial.coefficients):
        power = degree - place
        turned = sympy.nsimplify(c, rational=True) * (-1) ** (power // 2)
        if power % 2:
            imaginary += turned * w ** (power - 1)
        else:
            real += turned * w**power
    ends = polynomial.coefficients[0], polynomial.coefficients[-1]
    found: list[Expr] = []
    for condition in (sympy.resultant(real, imaginary, w), *ends):
        numerator = sympy.numer(sympy.together(sympy.nsimplify(condition, rational=True)))
        if numerator.has(k):
            for factor, _ in sympy.factor_list(numerator, k)[1]:
                roots = sympy.Poly(factor, k).nroots(n=_DIGITS, maxsteps=500)
                found += [root for root in roots if root.is_real]
    return sorted(set(found))


def stable_intervals(polynomial: Polynomial) -> tuple[Symbol, list[tuple[Any, Any]]]:
    """The one parameter, and the open intervals of its values for which all roots are left of the axis."""
    symbols = sorted(set().union(*(c.free_symbols for c in polynomial.coefficients)), key=str)
    if len(symbols) != 1:
        raise ModelError(f"the polynomial has {len(symbols)} parameters, not one.")
    k = symbols[0]
    edges = [-sympy.oo, *critical_values(polynomial, k), sympy.oo]
    out: list[tuple[Any, Any]] = []
    for low, high in itertools.pairwise(edges):
        if stable_at(polynomial, {k: _between(low, high)}) is sympy.true:
            joined = bool(out) and out[-1][1] == low and stable_at(polynomial, {k: low}) is sympy.true
            out[-1:] = [(out[-1][0], high)] if joined else [*out[-1:], (low, high)]
    if not out:
        raise MissingError(f"the polynomial is stable for no {k}")
    return k, out


def _between(low: Any, high: Any) -> Expr:
    if low == -sympy.oo:
        middle = (high if high != sympy.oo else sympy.Integer(1)) - 1
    else:
        middle = low + 1 if high == sympy.oo else (low + high) / 2
    return sympy.Rational(str(middle)) if middle.is_Float else middle
