"""Directions written as quotients: g/|g| and |g|/g are the sign of g, g |g|**e is sign(g) |g|**(e + 1)."""

from __future__ import annotations

import sympy
from sympy import Abs, Expr, Mul, Pow, S, sign

from filippov.model.table import dynamic


def with_signs(expr: Expr) -> Expr:
    """A product without a power of abs(g) beside a whole power of g or a multiple, one of them below 0.

    On g = 0 such factors have no value, 0/0 or 0 times infinity, while the product has one on either side.
    """
    factors = list(expr.args)
    sizes = [q for q in factors if isinstance(q.as_base_exp()[0], Abs)]
    if not sizes or not any(q.as_base_exp()[1].is_negative for q in factors):
        return expr
    for size in sizes:
        (g,), exponent = size.as_base_exp()[0].args, size.as_base_exp()[1]
        for q in factors:
            base, power = q.as_base_exp()
            if q in sizes or not (power.is_integer and power.is_number and dynamic(base) and dynamic(g)):
                continue
            if not (power.is_negative or exponent.is_negative):
                continue
            ratio = sympy.cancel(base / g)
            if dynamic(ratio) or ratio.has(sympy.nan, sympy.zoo):
                continue
            factors.remove(q)
            factors.remove(size)
            turn = sign(g) if power.is_odd else S.One
            factors += [ratio**power, turn, Pow(Abs(g), power + exponent)]
            break
    return Mul(*factors)
