"""A set of equilibria, cut where the linear part across it changes its stability.

Roots cross the axis where the last coefficient of the characteristic polynomial across the set vanishes (a
root 0) or the last Hurwitz determinant but one does (an imaginary pair; Orlando's formula).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import sympy
from sympy import Expr

from filippov.analysis.local_stability.kink_stability import modes_beside, surfaces_at
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.steady.branches import short
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet
from filippov.analysis.steady.interior import inner_point
from filippov.analysis.steady.linearisation import characteristic_polynomial, linearise

NEAR = 1e-9
# Of expressions whose signs tell parts of a set of more dimensions.
MOST_CUTS = 4
# Lines from the inside of a set on which it is looked at, and how far on those without end.
MOST_WAYS, FARTHEST = 26, 50.0


def parts(context: Context, found: EquilibriumSet) -> tuple[EquilibriumSet, ...]:
    """The set cut at the borders of stability; itself where there are none inside."""
    borders: list[Expr] = []
    # A set on a kink has the linear parts of all sides.
    for mode in modes_beside(context, found.mode, surfaces_at(context, found)).values():
        matrix = context.form.jacobian(mode).subs(context.put)
        at = matrix.subs(dict(zip(context.form.x, found.x, strict=True))).applyfunc(short)
        polynomial, zeros = context.without_zeros(characteristic_polynomial(at), found.dimension)
        if zeros < found.dimension or len(polynomial) < 2:
            return (found,)
        borders += [g for g in _borders(polynomial) if g not in borders]
    return _cut(context, found, borders) if found.dimension == 1 else _regions(context, found, borders)


def sliding_parts(context: Context, found: EquilibriumSet) -> tuple[EquilibriumSet, ...]:
    """The same of a segment on one surface: also where the surface goes over from attracting to repelling."""
    if found.dimension != 1 or found.mode.count("0") != 1 or surfaces_at(context, found):
        return (found,)
    sliding = linearise(context.system, found, values=context.put, sides=[]).sliding
    if sliding is None or sliding.matrix is None:
        return (found,)
    polynomial = characteristic_polynomial(sliding.matrix)[:-1]
    rest, _ = context.without_zeros(polynomial, len(polynomial))
    return _cut(context, found, [sliding.normal[0, 0], *(_borders(rest) if len(rest) > 1 else ())])


def _cut(context: Context, found: EquilibriumSet, borders: Sequence[Expr]) -> tuple[EquilibriumSet, ...]:
    """A segment cut at the zeros of expressions in its coordinate."""
    (c,) = found.free
    ((low, high),), ((first, last),) = found.bounds, found.domain
    marks: list[tuple[float, Expr]] = []
    for g in borders:
        for formula in _roots(context, g, c):
            number = context.number(formula)
            if low + NEAR < number < high - NEAR and not any(abs(number - m) <= NEAR for m, _ in marks):
                marks.append((number, formula))
    marks.sort(key=lambda mark: mark[0])
    if not marks:
        return (found,)
    edges = [(low, first), *marks, (high, last)]
    return tuple(
        replace(
            found, domain=((left, right),), bounds=((a, b),),
            ends=tuple(e for e in found.ends if any(_at(e.value, found, context, c) for c in (a, b))),
        )
        for (a, left), (b, right) in itertools.pairwise(edges)
    )  # fmt: skip


def _regions(context: Context, found: EquilibriumSet, borders: Sequence[Expr]) -> tuple[EquilibriumSet, ...]:
    """A set of more dimensions in the regions of one sign of each expression."""
    held = [c.gts - c.lts for c in found.conditions]
    values = {**context.values, **context.put}
    cuts = [g for g in map(short, borders) if g.subs(values).has(*found.free)][:MOST_CUTS]
    pieces = []
    for signs in itertools.product((1, -1), repeat=len(cuts)):
        beside = [sign * g for sign, g in zip(signs, cuts, strict=True)]
        inside = inner_point(found.free, [*held, *beside], values)
        if inside is not None:
            pieces.append((beside, inside))
    if len(pieces) < 2:
        return (found,)
    return tuple(
        replace(
            found, conditions=(*found.conditions, *(g > 0 for g in beside)), inside=inside,
            ends=tuple(end for end in found.ends if _in_all(context, found, end, beside)),
        )
        for beside, inside in pieces
    )  # fmt: skip


def spots(context: Context, found: EquilibriumSet) -> list[dict[sympy.Symbol, Expr]]:
    """Places all over a set, by its free symbols: one inside, and on the lines from it to the borders."""
    values = {**context.values, **context.put}
    held = [sympy.lambdify(list(found.free), (c.gts - c.lts).subs(values)) for c in found.conditions]
    middle = np.array(found.inner)
    every = itertools.product((-1.0, 0.0, 1.0), repeat=found.dimension)
    out = [middle]
    for way in itertools.islice((way for way in every if any(way)), MOST_WAYS):
        reach = FARTHEST
        while reach > NEAR and not all(g(*(middle + reach * np.array(way))) >= 0 for g in held):
            reach *= 0.8
        out += [middle + share * reach * np.array(way) for share in (0.3, 0.99)]
    return [{q: sympy.Rational(repr(float(c))) for q, c in zip(found.free, at, strict=True)} for at in out]


def _in_all(
    context: Context, found: EquilibriumSet, end: EquilibriumPoint, positive: Sequence[Expr]
) -> bool:
    """Whether a corner of a set lies in a part of it."""
    pairs = [*zip(found.x, end.value, strict=True)]
    pairs += [(s, value) for (_, s), value in zip(found.multipliers, end.s_value, strict=True)]
    put = {q: sympy.Float(value, 20) for q, value in pairs if q in found.free}
    return all(context.number(g, put) >= -NEAR for g in positive)


def _at(value: tuple[float, ...], found: EquilibriumSet, context: Context, c: float) -> bool:
    """Whether a state is that of the set at c."""
    if abs(c) == float("inf"):
        return False
    place = [context.number(e, {found.free[0]: sympy.Float(c, 20)}) for e in found.x]
    return all(abs(p - v) <= NEAR * max(1.0, abs(v)) for p, v in zip(place, value, strict=True))


def _borders(polynomial: Sequence[Expr]) -> list[Expr]:
    """The last coefficient, and the Hurwitz determinant of order n - 1."""
    n = len(polynomial) - 1
    borders = [polynomial[-1]]
    if n >= 2:
        entry = dict(enumerate(polynomial))
        hurwitz = sympy.Matrix(n - 1, n - 1, lambda i, j: entry.get(2 * j - i + 1, sympy.S.Zero))
        borders.append(hurwitz.det(method="berkowitz"))
    return borders


def _roots(context: Context, g: Expr, c: sympy.Symbol) -> list[Expr]:
    """Real zeros of g(c): formulas where g is linear or quadratic in c, else numbers."""
    g = sympy.fraction(sympy.together(g))[0]
    if not g.has(c):
        return []
    if g.is_polynomial(c) and sympy.degree(g, c) <= 2:
        return [short(r) for r in sympy.roots(sympy.Poly(g, c))]
    numeric = g.subs(context.values)
    if numeric.is_polynomial(c):
        return [sympy.S(r) for r in sympy.Poly(numeric, c).nroots(n=20) if abs(sympy.im(r)) < NEAR]
    try:
        solved = sympy.solveset(numeric, c, sympy.Interval(-1e6, 1e6))
    except (TypeError, NotImplementedError, ValueError):
        return []
    return list(solved) if isinstance(solved, sympy.FiniteSet) else []
