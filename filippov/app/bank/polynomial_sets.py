"""Parameters of a polynomial: points to try a condition at, and the values for which it is stable."""

from __future__ import annotations

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


def stable_intervals(polynomial: Polynomial) -> tuple[Symbol, list[tuple[Any, Any]]]:
    """The one parameter, and the intervals of its values for which all roots are left of the axis."""
    symbols = sorted(set().union(*(c.free_symbols for c in polynomial.coefficients)), key=str)
    if len(symbols) != 1:
        raise ModelError(f"the polynomial has {len(symbols)} parameters, not one.")
    found = polynomial.routh.solve_for(symbols[0], as_set=True)
    pieces = found.args if isinstance(found, sympy.Union) else [found]
    out = [(piece.start, piece.end) for piece in pieces if isinstance(piece, sympy.Interval)]
    if not out:
        raise MissingError(f"the polynomial is stable for no {symbols[0]}")
    return symbols[0], out
