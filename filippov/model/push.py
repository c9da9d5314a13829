"""The push of a contact as the limit of ever smaller impacts, with the friction that such impacts have.

A reset chooses: |v|, Min and Max are told by the state just before the impact. At rest the rate L = dh/dt is
0, and what is chosen there is the limit along the direction in which impacts come, L = -side e with e -> 0. A
choice by what is not 0 at rest, as by the slip u in u - Min(Max(u, -mu N), mu N), is a switching surface of
the solution at rest: on it the push is any convex combination of those on its two sides, which is Coulomb's
law. Sources: Brogliato 2016, section 5; Leine, van de Wouw 2008, section 5.3.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias, Union

import sympy
from sympy import Expr, Symbol

from filippov.model.size import cancelled, expanded
from filippov.model.symbolic import Select
from filippov.model.table import SurfaceTable, dynamic

DIGITS = 30
CLOSE = sympy.Float("1e-18")
# Of the terms of an expression with numbers in it.
ROUNDING = sympy.Float("1e-14")
# How far from rest choices are compared with their limit.
BESIDE = sympy.Float("1e-9")
MOST_CASES = 64


class UndecidedError(Exception):
    """A choice of the reset has no limit that can be told, or there are too many of them."""


@dataclass(frozen=True)
class Choice:
    """One push where g > 0, another where g < 0."""

    g: Expr
    plus: Tree
    minus: Tree


Row: TypeAlias = tuple[Expr, ...]
Tree: TypeAlias = Union[Row, "Choice"]


def has_choices(row: Sequence[Expr]) -> bool:
    """Whether expressions hold a choice by the state."""
    return any(e.has(Select) for e in row)


def rounding(e: Expr, at: Mapping[Symbol, Expr]) -> Expr:
    """What the numbers in e, which are known to their rounding, may leave of it where it vanishes: as in
    (1 + r) w cos(t) - r v - w cos(t) at v = w cos(t), with r and w given as numbers."""
    return ROUNDING * _size(e, at) if e.has(sympy.Float) else sympy.S.Zero


def _size(e: Expr, at: Mapping[Symbol, Expr]) -> Expr:
    """The sum of the absolute values of its terms at a point."""
    return sum(abs(term.xreplace(at).evalf(DIGITS)) for term in sympy.Add.make_args(expanded(e)))


@dataclass(frozen=True)
class Approach:
    """How ever smaller impacts come to rest.

    steps    direction of the states along which the rate leaves 0 towards where impacts come from
    rate     dh/dt, 0 at rest
    inputs   symbols for inputs at the points
    points   a few states at rest
    """

    steps: Mapping[Symbol, Expr]
    rate: Expr
    inputs: Mapping[Symbol, Expr]
    points: tuple[Mapping[Symbol, Expr], ...]

    def function(self, c: Expr) -> Expr:
        """A function at rest that has the sign which c has shortly before it. Raises UndecidedError."""
        g = self._at_rest(c)
        if g == 0:
            g = self._at_rest(sum((c.diff(q) * step for q, step in self.steps.items()), sympy.S.Zero))
        return sympy.factor(g)

    def _at_rest(self, c: Expr) -> Expr:
        """c with the rate at 0, by a state in which the rate is linear, without what is rounding."""
        linear = ((q, self.rate.diff(q)) for q in self.steps)
        found = next(((q, slope) for q, slope in linear if slope != 0 and q not in slope.free_symbols), None)
        if found is None or not self.points:
            raise UndecidedError
        g = cancelled(c.xreplace({found[0]: found[0] - self.rate / found[1]}))
        sizes = [_size(c.xreplace(self.inputs), at) for at in self.points]
        if not all(size.is_number and size.is_finite for size in sizes):
            raise UndecidedError
        parts = [part for part in sympy.Add.make_args(expanded(g)) if not self._vanishes(part, sizes)]
        if self._vanishes(g, sizes):
            return sympy.S.Zero
        return sympy.Add(*parts) if g.has(sympy.Float) else g

    def chooses(self, row: Row, tree: Tree) -> bool:
        """Whether the tree leads to what the choices give shortly before rest, at the points."""
        for at in self.points:
            ahead = {q: BESIDE * step.xreplace(self.inputs).xreplace(at) for q, step in self.steps.items()}
            near = {**at, **{q: at[q] + e for q, e in ahead.items()}}
            taken = tree
            while isinstance(taken, Choice):
                g = taken.g.xreplace(self.inputs).xreplace(near).evalf(DIGITS)
                taken = taken.plus if g > 0 else taken.minus
            for e, f in zip(row, taken, strict=True):
                given, found = (q.xreplace(self.inputs).xreplace(near).evalf(DIGITS) for q in (e, f))
                if not abs(given - found) <= ROUNDING * (abs(given) + BESIDE):
                    return False
        return True

    def _vanishes(self, e: Expr, sizes: Sequence[Expr]) -> bool:
        """Whether it is nothing but rounding of terms of these sizes, one per point."""
        share = ROUNDING if e.has(sympy.Float) else sympy.S.Zero
        values = (abs(e.xreplace(self.inputs).xreplace(at).evalf(DIGITS)) for at in self.points)
        return all(value <= share * size + CLOSE for value, size in zip(values, sizes, strict=True))


def limit(row: Row, approach: Approach) -> Tree:
    """Expressions without their choices, by cases of what does not vanish at rest. Raises UndecidedError.

    Signs are known of numbers, and of what is positive whatever the parameters are.
    """
    left = MOST_CASES

    def cases(row: Row, known: tuple[tuple[Expr, int], ...]) -> Tree:
        nonlocal left
        inner = [q for q in set().union(*(e.atoms(Select) for e in row)) if not q.args[0].has(Select)]
        if not inner:
            return row
        c = min((q.args[0] for q in inner), key=sympy.default_sort_key)
        side = 1
        for g in _factors(approach.function(c)):
            one = _known(g, known)
            if not one:
                left -= 1
                if left < 0:
                    raise UndecidedError
                return Choice(g, *(cases(row, (*known, (g, m))) for m in (1, -1)))
            side *= one
        taken = {q: q.args[1 if side > 0 else 2] for q in inner if q.args[0] == c}
        return cases(tuple(e.xreplace(taken) for e in row), known)

    tree = cases(row, ())
    if not approach.chooses(row, tree):
        raise UndecidedError
    return tree


def _factors(g: Expr) -> list[Expr]:
    """What is constant in a product, and what varies."""
    fixed, moving = g.as_independent(*(q for q in g.free_symbols if dynamic(q)), as_Add=False)
    return [part for part in (fixed, moving) if part != 1] or [sympy.S.One]


def _known(g: Expr, known: Iterable[tuple[Expr, int]]) -> int:
    """The sign of g where it is a number or that of a multiple is known, else 0; -1 for 0."""
    if g.is_positive or (dynamic(g) and g.is_nonnegative):
        return 1
    if g.is_nonpositive:
        return -1
    for other, sign in known:
        factor = sympy.cancel(g / other) if g.free_symbols == other.free_symbols else sympy.nan
        if factor.is_number and factor.is_real:
            return sign if factor > 0 else -sign
    return 0


def each(tree: Tree, function: Callable[[Row], Row]) -> Tree:
    """The tree with a function applied to all its rows."""
    if isinstance(tree, Choice):
        return Choice(tree.g, each(tree.plus, function), each(tree.minus, function))
    return function(tree)


def rows(tree: Tree) -> Iterator[Row]:
    """What stands in the branches."""
    if isinstance(tree, Choice):
        yield from rows(tree.plus)
        yield from rows(tree.minus)
    else:
        yield tree


def slips(tree: Tree) -> Iterator[Expr]:
    """The functions whose signs the tree tells apart, save those of parameters alone."""
    if isinstance(tree, Choice):
        if dynamic(tree.g):
            yield tree.g
        yield from slips(tree.plus)
        yield from slips(tree.minus)


def joined(tree: Tree, sign: Callable[[Expr], Expr | None]) -> Row:
    """One row, affine in the sign of each function. Raises UndecidedError where `sign` knows none."""
    if not isinstance(tree, Choice):
        return tree
    plus, minus = joined(tree.plus, sign), joined(tree.minus, sign)
    if not dynamic(tree.g):
        return tuple(Select(tree.g, a, b) for a, b in zip(plus, minus, strict=True))
    s = sign(tree.g)
    if s is None:
        raise UndecidedError
    halves = ((cancelled((a + b) / 2), cancelled((a - b) / 2)) for a, b in zip(plus, minus, strict=True))
    return tuple(mean if half == 0 else mean + s * half for mean, half in halves)


def place(h: Sequence[Expr], g: Expr) -> tuple[int, Expr] | None:
    """The number of the function that is g up to a constant factor, and g over it."""
    for i, other in enumerate(h):
        factor = SurfaceTable.ratio(g, other)
        if factor is not None:
            return i, factor
    return None
