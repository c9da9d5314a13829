"""Powers |h|**e at h = 0: slope 0 for e > 1, finite for e = 1, infinite for 0 < e < 1, for symbolic e too."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import sympy
from sympy import Expr, Symbol

Slope = Literal["zero", "finite", "infinite"]
MOST_CASES = 27


@dataclass(frozen=True)
class SizePower:
    """(c a^k + ...)**e with a = |h|: of order a**exponent, exponent = k e; 1 at a = scale."""

    power: Expr
    size: Symbol
    exponent: Expr
    scale: Expr


@dataclass(frozen=True)
class ExponentCase:
    """One case of the exponents: where it holds, what it puts for symbols, the slope of each power at 0."""

    condition: Any
    put: tuple[tuple[Symbol, Expr], ...]
    slopes: tuple[Slope, ...]

    def holds(self, values: Mapping[Symbol, Expr]) -> bool:
        """Whether it is the case at these values."""
        return bool(sympy.S(self.condition).subs(values) == sympy.true)


class UndeterminedSlopeError(Exception):
    """A power of |h| whose behaviour at 0 is not read off."""


def size_powers(expressions: Iterable[Expr], sizes: Sequence[Symbol]) -> list[SizePower]:
    """The powers in the expressions that are not smooth where a size is 0, in a fixed order."""
    found: dict[Expr, SizePower] = {}
    for expression in expressions:
        for power in sorted(expression.atoms(sympy.Pow), key=sympy.default_sort_key):
            base, exponent = power.as_base_exp()
            own = [a for a in sizes if base.has(a)]
            if not own or power in found or (exponent.is_Integer and exponent >= 0):
                continue
            at_zero = base.subs(dict.fromkeys(own, 0))
            if not at_zero.is_zero:
                continue  # smooth: the base is not 0 at h = 0
            if len(own) > 1 or not base.is_polynomial(own[0]) or exponent.has(*sizes):
                raise UndeterminedSlopeError(f"the power {power}")
            (k,), c = sympy.Poly(base, own[0]).terms()[-1]
            found[power] = SizePower(power, own[0], sympy.expand(k * exponent), c ** sympy.Rational(-1, k))
    return list(found.values())


def exponent_cases(powers: Sequence[SizePower]) -> list[ExponentCase]:
    """The cases in which every exponent is above, at or below 1; one case where all exponents are numbers."""
    symbolic = list(dict.fromkeys(p.exponent for p in powers if p.exponent.free_symbols))
    for p in powers:
        if p.exponent.is_number and not p.exponent > 0:
            raise UndeterminedSlopeError(f"the power {p.power}, which grows without bound at h = 0,")
    symbols = sorted(set().union(*(e.free_symbols for e in symbolic)), key=lambda q: q.name)
    if len(symbols) == 1 and all(_rises(e, symbols[0]) for e in symbolic):
        ranges = _one_symbol(symbolic, symbols[0])
    else:
        ranges = _products(symbolic)
    cases = []
    for condition, put, slope_of in ranges[:MOST_CASES]:
        slopes = tuple(slope_of[p.exponent] if p.exponent in slope_of else _slope(p.exponent) for p in powers)
        cases.append(ExponentCase(condition, put, slopes))
    return cases


_Range = tuple[Any, tuple[tuple[Symbol, Expr], ...], dict[Expr, Slope]]


def _slope(exponent: Expr) -> Slope:
    return "finite" if exponent == 1 else "zero" if exponent > 1 else "infinite"


def _rises(exponent: Expr, symbol: Symbol) -> bool:
    slope = exponent.diff(symbol)
    return bool(slope.is_number and slope > 0)


def _one_symbol(exponents: Sequence[Expr], e: Symbol) -> list[_Range]:
    """Cut the line of the one symbol where an exponent is 1; all exponents are positive on it."""
    if not exponents:
        return [(sympy.true, (), {})]
    least = max(_where(x, e, 0) for x in exponents)
    marks = sorted({_where(x, e, 1) for x in exponents} - {least}, reverse=True)
    marks = [m for m in marks if m > least]
    ranges: list[_Range] = []
    above: Expr = sympy.oo
    for mark in marks:
        inside = mark + 1 if above == sympy.oo else (mark + above) / 2
        upper = sympy.true if above == sympy.oo else e < above
        ranges.append((sympy.And(e > mark, upper), (), {x: _slope(x.subs(e, inside)) for x in exponents}))
        ranges.append((sympy.Eq(e, mark), ((e, mark),), {x: _slope(x.subs(e, mark)) for x in exponents}))
        above = mark
    inside = (least + above) / 2
    # e > least may be among the symbol's own assumptions; it is written out.
    lower = sympy.And(sympy.StrictLessThan(least, e, evaluate=False), e < above, evaluate=False)
    ranges.append((lower, (), {x: _slope(x.subs(e, inside)) for x in exponents}))
    return ranges


def _where(exponent: Expr, e: Symbol, value: int) -> Expr:
    return (value - exponent.subs(e, 0)) / exponent.diff(e)


def _products(exponents: Sequence[Expr]) -> list[_Range]:
    ranges: list[_Range] = []
    for choice in itertools.product((1, 0, -1), repeat=len(exponents)):
        put: dict[Symbol, Expr] = {}
        condition: Any = sympy.true
        slopes: dict[Expr, Slope] = {}
        for x, side in zip(exponents, choice, strict=True):
            if side == 0:
                symbol = min(x.free_symbols, key=lambda q: q.name)
                solved = sympy.solve(sympy.Eq(x, 1), symbol)
                put |= {symbol: solved[0]} if solved else {}
                condition = sympy.And(condition, sympy.Eq(x, 1))
            else:
                condition = sympy.And(condition, x > 1 if side > 0 else sympy.And(x > 0, x < 1))
            slopes[x] = ("finite", "zero", "infinite")[side]
        if condition != sympy.false:
            ranges.append((condition, tuple(put.items()), slopes))
    return ranges
