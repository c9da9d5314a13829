"""Strict inequalities between expressions in parameters: known signs, simplified, solved for a symbol."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from typing import Any

import sympy
from sympy.core.relational import GreaterThan, LessThan, StrictGreaterThan, StrictLessThan, Unequality

from filippov.analysis.algebra.budget import Clock
from filippov.analysis.algebra.generators import Generators, factor_list
from filippov.analysis.algebra.polynomial import exact, sign_of_number
from filippov.base.errors import UsageError
from filippov.base.names import unknown

MOST_TERMS_FACTORED = 60


class KnownSigns:
    """Signs of expressions, from the symbols' own assumptions and from inequalities taken to hold."""

    def __init__(self, assume: Iterable[Any] = ()) -> None:
        self.symbols: dict[sympy.Symbol, sympy.Dummy] = {}
        self.factors: dict[sympy.Expr, int] = {}
        for relation in assume:
            self.learn(relation)

    def copy(self) -> KnownSigns:
        """Return one that can learn more and leaves this as it is."""
        other = KnownSigns()
        other.symbols, other.factors = dict(self.symbols), dict(self.factors)
        return other

    def learn(self, relation: Any) -> None:
        """Take an inequality as true: m > 0, b >= 0, K < 3, b*m - 1 > 0, Ne(m, 0)."""
        if relation is True or relation == sympy.true:
            return
        if isinstance(relation, sympy.And):
            for part in relation.args:
                self.learn(part)
            return
        if isinstance(relation, Unequality):
            self._narrow(exact(relation.lhs - relation.rhs), nonzero=True)
            return
        if not isinstance(relation, StrictGreaterThan | StrictLessThan | GreaterThan | LessThan):
            raise UsageError(f"assumption {relation!r}: expected an inequality such as m > 0")
        strict = isinstance(relation, StrictGreaterThan | StrictLessThan)
        difference = exact(relation.gts - relation.lts)
        if _terms(difference) > 200:
            return
        difference = difference.expand()
        if strict:
            self.factors[difference] = 1
            self.factors[(-difference).expand()] = -1
        symbols = difference.free_symbols
        if len(symbols) != 1:
            return
        (x,) = symbols
        # c1 x + c0 > 0 tells the sign of x where c0 does not work against it.
        if difference.is_polynomial(x) and sympy.degree(difference, x) == 1:
            c1, c0 = (sign_of_number(c) for c in sympy.Poly(difference, x).all_coeffs())
            if c0 < 0 or (strict and c0 == 0):
                self._narrow(x, **{"positive" if c1 > 0 else "negative": True})
            elif c0 == 0:
                self._narrow(x, **{"nonnegative" if c1 > 0 else "nonpositive": True})

    def _narrow(self, x: sympy.Expr, **assumptions: bool) -> None:
        if x.is_Symbol:
            held = self.symbols.get(x, x)
            own = {k: v for k, v in held.assumptions0.items() if v is not None and k in _INDEPENDENT}
            self.symbols[x] = sympy.Dummy(x.name, **{**own, "real": True, **assumptions})

    def sign(self, expression: sympy.Expr) -> int | None:
        """-1, 0 or 1 where it is known, else None."""
        if expression in self.factors:
            return self.factors[expression]
        if expression.is_Add and len(expression.args) > 200:
            return None
        told = expression.xreplace(self.symbols)
        if isinstance(told, sympy.exp):
            return 1  # sympy leaves open whether a quotient in its exponent is real
        if told.is_positive or told.is_negative or told.is_zero:
            return 0 if told.is_zero else (1 if told.is_positive else -1)
        return None

    def nonzero(self, expression: sympy.Expr) -> bool:
        """Whether the expression is known not to vanish."""
        return self.sign(expression) in {-1, 1} or bool(expression.xreplace(self.symbols).is_nonzero)


_INDEPENDENT = {"positive", "negative", "nonnegative", "nonpositive", "nonzero", "integer"}


def positive_when(
    expression: sympy.Expr, known: KnownSigns, denominators: frozenset[Any], clock: Clock
) -> Any:
    """Return the simplest condition found for expression > 0: true, false, an inequality or an And of them.

    Factors of known sign are left out; even powers become Ne(factor, 0). Those in `denominators` are not 0.
    """
    clock.check()
    coefficient, factors = _factors(expression)
    sign = sign_of_number(coefficient)
    rest: list[tuple[sympy.Expr, int]] = []
    conditions: list[Any] = []
    for factor, power in factors:
        told = known.sign(factor)
        if told == 0:
            return sympy.false
        if power % 2 and told is None:
            rest.append((factor, -1 if factor in denominators else 1))
        elif power % 2:
            sign *= told or 1
        elif told is None and factor not in denominators and not known.nonzero(factor):
            conditions.append(sympy.Ne(factor, 0))
    if rest or sign <= 0:
        if all(power < 0 for _, power in rest):  # 1/f > 0 iff f > 0
            rest = [(factor, 1) for factor, _ in rest]
        product = sympy.Mul(*(factor**power for factor, power in rest))
        shortest = sign * product
        if math.prod(_terms(factor) for factor, _ in rest) <= MOST_TERMS_FACTORED:
            shortest = min(shortest, shortest.expand(), key=lambda e: (e.count_ops(), str(e)))
        conditions.insert(0, _above_zero(shortest))
    return sympy.And(*conditions)


def _terms(expression: sympy.Expr) -> int:
    """Number of terms that the expression has when it is multiplied out, for a product of sums."""
    return math.prod(len(sympy.Add.make_args(factor)) for factor in sympy.Mul.make_args(expression))


def _above_zero(expression: sympy.Expr) -> Any:
    """expression > 0, with a lone negative sign turned into the other direction (x < 3, not 3 - x > 0)."""
    symbols = expression.free_symbols
    if len(symbols) == 1 and expression.is_polynomial(*symbols):
        (x,) = symbols
        p = sympy.Poly(expression, x)
        if p.degree() == 1:
            c1, c0 = p.all_coeffs()
            return x > -c0 / c1 if sign_of_number(c1) > 0 else x < -c0 / c1
    # The sign of what is no number has been asked for, factor by factor; sympy would ask once more.
    return expression > 0 if expression.is_number else sympy.StrictGreaterThan(expression, 0, evaluate=False)


def _factors(expression: sympy.Expr) -> tuple[sympy.Expr, list[tuple[sympy.Expr, int]]]:
    """Constant and factors; a long sum is taken as one factor, for its factorisation may not end."""
    constant, parts = sympy.S.One, []
    for argument in sympy.Mul.make_args(expression):
        base, power = argument.as_base_exp()
        if not power.is_Integer:
            base, power = argument, sympy.S.One
        if base.is_number:
            constant *= base**power
        elif base.is_Add and len(base.args) <= MOST_TERMS_FACTORED:
            number, inner = factor_list(base)
            constant *= number**power
            parts += [(f, abs(m * int(power))) for f, m in inner]
        else:
            parts.append((base, abs(int(power))))
    merged: dict[sympy.Expr, int] = {}
    for factor, power in parts:
        merged[factor] = merged.get(factor, 0) + power
    return constant, list(merged.items())


def without_redundant(conditions: list[Any], known: KnownSigns) -> list[Any]:
    """Leave out f > 0 where f = g + something positive and g > 0 is among the conditions."""
    kept = list(conditions)
    for condition in conditions:
        f = _positive_side(condition)
        if f is None or f.is_Symbol or (-f).is_Symbol:
            continue
        others = [c for c in kept if c is not condition]
        signs = known.copy()
        for other in others:
            if len(other.free_symbols) == 1:
                signs.learn(other)
        sides = [g for c in others if (g := _positive_side(c)) is not None and _terms(f) + _terms(g) < 200]
        if any(signs.sign((f - g).expand()) in {0, 1} for g in sides):
            kept.remove(condition)
    return kept


def _positive_side(condition: Any) -> sympy.Expr | None:
    if isinstance(condition, StrictGreaterThan | StrictLessThan):
        return condition.gts - condition.lts
    return None


def substitution(
    values: Mapping[Any, Any] | None, symbols: Sequence[sympy.Symbol]
) -> dict[sympy.Symbol, Any]:
    """{symbol: exact value} from a mapping by name or symbol; an unknown name raises UsageError."""
    by_name = {x.name: x for x in symbols}
    own = set(symbols)
    result = {}
    for key, value in (values or {}).items():
        if key in own:
            result[key] = exact(value)
            continue
        name = key.name if isinstance(key, sympy.Symbol) else key
        if name not in by_name:
            raise UsageError(unknown("parameter", name, sorted(by_name)))
        result[by_name[name]] = exact(value)
    return result


def solve_univariate(conditions: Iterable[Any], x: sympy.Symbol, clock: Clock) -> sympy.Set | None:
    """The set of real x where all strict inequalities hold, or None where they are not rational in x over Q.

    Between two neighbouring real roots of all numerators and denominators nothing changes sign, so one
    rational point in each interval decides it.
    """
    numerators, product = [], sympy.Poly(1, x, domain=sympy.QQ)
    for condition in conditions:
        if condition == sympy.false:
            return sympy.EmptySet
        if condition == sympy.true:
            continue
        unequal = isinstance(condition, Unequality)
        difference = condition.lhs - condition.rhs if unequal else condition.gts - condition.lts
        numerator, denominator = sympy.fraction(sympy.together(difference))
        try:
            p = sympy.Poly(numerator * denominator, x, domain=sympy.QQ)
        except (sympy.PolynomialError, sympy.CoercionFailed):
            return None
        if p.is_zero:
            return sympy.EmptySet
        numerators.append((p, unequal))
        product = product.lcm(p)
        clock.check()
    product = product.sqf_part()
    roots = product.real_roots() if product.degree() > 0 else []
    ends = [-sympy.oo, *roots, sympy.oo]
    pieces = []
    for low, high in pairwise(ends):
        clock.check()
        point = _between(low, high)
        if all(unequal or p.eval(point) > 0 for p, unequal in numerators):
            pieces.append(sympy.Interval.open(low, high))
    return sympy.Union(*pieces).intersect(_own_domain(x))


def _own_domain(x: sympy.Symbol) -> sympy.Set:
    """The reals that the symbol's own assumptions allow."""
    if x.is_nonnegative:
        return sympy.Interval(0, sympy.oo, left_open=bool(x.is_positive))
    if x.is_nonpositive:
        return sympy.Interval(-sympy.oo, 0, right_open=bool(x.is_negative))
    return sympy.S.Reals


def _between(low: sympy.Expr, high: sympy.Expr) -> sympy.Rational:
    if low == -sympy.oo:
        return sympy.S.Zero if high == sympy.oo else sympy.floor(high) - 1
    if high == sympy.oo:
        return sympy.ceiling(low) + 1
    digits = 20
    while True:
        middle = sympy.Rational(str(((low + high) / 2).evalf(digits)))
        if low < middle < high:
            return middle
        digits *= 2


def solve_simple(condition: Any, x: sympy.Symbol, known: KnownSigns) -> Any:
    """An inequality solved for x, linear in x or in one exponential of it, where the signs of the factors are
    known; else unchanged.
    """
    side = _positive_side(condition)
    if side is None or not side.has(x):
        return condition
    generators = Generators([side])
    with_x = [dummy for dummy, e in generators.back.items() if e.has(x)]
    if not with_x:
        linear = _linear(side, x, known)
        return condition if linear is None else _bounded(x, *linear)
    exponential = generators.back[with_x[0]]
    rest = generators.plain[0]
    if len(with_x) > 1 or rest.has(x) or not isinstance(exponential, sympy.exp):
        return condition
    linear = _linear(rest, with_x[0], known, generators.back)
    if linear is None:
        return condition
    bound, above = sympy.together(linear[0]), linear[1]
    sign = known.sign(bound)
    if sign in {-1, 0}:  # below every exponential
        return sympy.true if above else sympy.false
    beyond = _linear(exponential.exp - sympy.log(bound), x, known)
    if beyond is None:
        return condition
    solved = _bounded(x, beyond[0], beyond[1] == above)
    if sign == 1:
        return solved
    # A bound that is not positive has no logarithm.
    numerator, denominator = sympy.fraction(bound)
    side = numerator * (known.sign(denominator) or denominator)
    inside = sympy.StrictGreaterThan(side, 0, evaluate=False)
    solved = sympy.And(inside, solved, evaluate=False)
    return sympy.Or(sympy.LessThan(side, 0, evaluate=False), solved, evaluate=False) if above else solved


def _bounded(x: sympy.Symbol, bound: sympy.Expr, above: bool) -> Any:
    return x > bound if above else x < bound


def _linear(
    side: sympy.Expr,
    x: sympy.Symbol,
    known: KnownSigns,
    back: Mapping[sympy.Symbol, sympy.Expr] | None = None,
) -> tuple[sympy.Expr, bool] | None:
    """(bound, above) where side > 0 iff x > bound, or x < bound; None where it is not linear in x."""
    numerator, denominator = sympy.fraction(sympy.together(side))
    sign = known.sign(denominator.xreplace(back or {}))
    if sign is None or not numerator.is_polynomial(x) or sympy.Poly(numerator, x).degree() != 1:
        return None
    c1, c0 = (c.xreplace(back or {}) for c in sympy.Poly(numerator, x).all_coeffs())
    slope = known.sign(c1)
    return (sympy.expand(-c0 / c1), slope * sign > 0) if slope else None
