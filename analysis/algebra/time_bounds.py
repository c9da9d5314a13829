"""Bounds of an expression in the time t over all real t, by interval arithmetic on exact numbers.

Each t is taken to vary by itself, so the bounds hold and need not be the closest. Source: Moore 1966.
"""

from __future__ import annotations

import itertools

import sympy
from sympy import Expr

from filippov.model.symbols import t as time

Interval = tuple[Expr, Expr]
WHOLE: Interval = (-sympy.oo, sympy.oo)


def bounds(expression: Expr) -> Interval | None:
    """(lower, upper), which may be infinite; None for functions that are not known here, or other symbols."""
    e = sympy.S(expression)
    if not e.has(time):
        return (e, e) if e.is_number and e.is_real else None
    if e == time:
        return WHOLE
    if isinstance(e, (sympy.sin, sympy.cos)):
        return (sympy.S.NegativeOne, sympy.S.One)
    if e.is_Pow and e.exp == 2 and isinstance(e.base, (sympy.sin, sympy.cos)):
        return (sympy.S.Zero, sympy.S.One)
    parts = [bounds(arg) for arg in e.args]
    known = [p for p in parts if p is not None]
    if len(known) < len(parts):
        return None
    if e.is_Add:
        lows, highs = zip(*known, strict=True)
        return sympy.Add(*lows), sympy.Add(*highs)
    if e.is_Mul:
        total = known[0]
        for part in known[1:]:
            total = _product(total, part)
        return total
    if isinstance(e, sympy.sign):
        return sympy.sign(known[0][0]), sympy.sign(known[0][1])
    if isinstance(e, sympy.Abs):
        low, high = known[0]
        return (sympy.S.Zero if bool(low <= 0 <= high) else min(abs(low), abs(high))), max(
            abs(low), abs(high)
        )
    if isinstance(e, sympy.exp):
        return sympy.exp(known[0][0]), sympy.exp(known[0][1])
    if e.is_Pow:
        return _power(known[0], e.exp)
    return None


def _product(a: Interval, b: Interval) -> Interval:
    corners = [_times(p, q) for p, q in itertools.product(a, b)]
    return min(corners), max(corners)


def _times(p: Expr, q: Expr) -> Expr:
    # The ends of an unbounded interval are not taken on, so 0 times one of them is 0.
    return sympy.S.Zero if p == 0 or q == 0 else p * q


def _power(base: Interval, exponent: Expr) -> Interval | None:
    low, high = base
    if not exponent.is_Rational:
        return None
    if exponent < 0:
        found = _power(base, -exponent)
        if found is None or not bool(found[0] > 0):
            return None
        return (sympy.S.Zero if found[1] == sympy.oo else 1 / found[1]), 1 / found[0]
    if exponent.is_Integer and exponent % 2 == 0:
        sizes = max(abs(low), abs(high)) ** exponent
        least = sympy.S.Zero if bool(low <= 0) and bool(high >= 0) else min(abs(low), abs(high)) ** exponent
        return least, sizes
    if exponent.is_Integer:
        return _odd(low, exponent), _odd(high, exponent)
    return (low**exponent, high**exponent) if bool(low >= 0) else None


def _odd(value: Expr, exponent: Expr) -> Expr:
    return value if value.is_infinite else value**exponent
