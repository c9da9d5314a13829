"""On which side of a bound a place lies: exactly where its numbers are exact, else to a part of the terms.

A number without floats is compared with 0 as it is, at any size: a force of 1e-12 still leads away from a
wall. One that holds floats is known to a part of the terms that it is the sum of.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import sympy
from sympy import Expr, Symbol

# What a float is known to, in units of its terms, and where these are 0 too.
TOLERANCE, LEAST = 1e-9, 1e-15
# An exact number whose digits cancel down to this is 0: sympy takes 100 digits before it gives up.
ZERO, DIGITS = 1e-60, 25


def real_number(expression: Expr) -> Expr | None:
    """A number with 25 digits, None where it is not finite or not real."""
    value = expression.evalf(DIGITS)
    if not value.is_number or value.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo):
        return None
    real, imaginary = value.as_real_imag()
    if imaginary == 0 or abs(imaginary) < ZERO:
        return real
    # In cubic formulas of real roots imaginary parts cancel; the root of -1e-20 is not real.
    size = 1.0 if expression.has(sympy.Float) else abs(real)
    return real if abs(imaginary) < TOLERANCE * size else None


def side(g: Expr, at: Mapping[Symbol, Expr], values: Mapping[Symbol, Expr]) -> int | None:
    """The sign of g at a place and parameter values, 0 on the edge; None where it is no real number."""
    number = g.subs(at).subs(values)
    value = real_number(number)
    if value is None:
        return None
    if number.has(sympy.Float):
        known = TOLERANCE * terms(g, at, values) + LEAST
    else:
        known = 0.0 if number.is_Rational else ZERO
    return 0 if abs(value) <= known else int(sympy.sign(value))


def known_to(
    gradient: Sequence[Expr], field: Sequence[Expr], at: Mapping[Symbol, Expr], values: Mapping[Symbol, Expr]
) -> float:
    """What gradient . field is known to at a place: a part of its terms."""
    pairs = zip(gradient, field, strict=True)
    return TOLERANCE * float(sum(terms(c, at, values) * terms(f, at, values) for c, f in pairs if c != 0))


def terms(g: Expr, at: Mapping[Symbol, Expr], values: Mapping[Symbol, Expr]) -> float:
    """The sum of the absolute values of the terms of g."""
    if g.is_Add:
        return sum(terms(e, at, values) for e in g.args)
    if g.is_Mul:
        product = 1.0
        for e in g.args:
            product *= terms(e, at, values)
        return product
    if g.is_Pow and g.exp.is_Integer and g.exp > 0:
        return float(terms(g.base, at, values) ** int(g.exp))
    value = real_number(sympy.S(g.subs(at).subs(values)))
    return 1.0 if value is None else abs(float(value))
