"""The band of a Switch or Karnopp model around a sliding surface: its surfaces, and the field within it.

    L(s) = dh/dt at the sign s with |h| = 0,   [lo, hi] the set of the surface
    within the band:   L(lo) >= 0 >= L(hi)     the sign s* at which dh/dt = -alpha h
                       L(lo), L(hi) < 0        lo        (driven down)
                       L(lo), L(hi) > 0        hi        (driven up)
                       L(lo) < 0 < L(hi)       h/width   (the surface repels)

The tests of L take it at h = 0 where h holds one state, linearly, unless Switch asks for the balance in
motion: that one changes with h alone, and its zeros may be slid on. |h| is measured from the edges beyond
the band, where the field is smooth, and 0 within it. In Karnopp's model everything within the band is taken
at the velocity of h = 0, and only its own state has the h that it has; a relative velocity of two bodies is
brought to 0 along what its sign does, as the impulse of a stick would. Bands that share a rate are in
`filippov.model.comparators.coupled_bands`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import sympy
from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.base.symbolic_value import is_expression
from filippov.model.comparator import BALANCES, Karnopp, Switch
from filippov.model.parameter_symbol import ParameterSymbol
from filippov.model.surface import Surface
from filippov.model.symbolic import Select, SymbolicForm, convex
from filippov.model.symbols import t

OTHERS = "Choose Band or Smooth for it."
UNIT = (sympy.S.NegativeOne, sympy.S.One)


@dataclass
class NewSurfaces:
    """The surfaces of a new form, numbered as they are added."""

    s: list[Symbol] = field(default_factory=list)
    a: list[Symbol] = field(default_factory=list)
    h: list[Expr] = field(default_factory=list)
    radius: list[tuple[Expr, Expr]] = field(default_factory=list)
    widths: list[Expr | None] = field(default_factory=list)
    surfaces: list[Surface] = field(default_factory=list)
    sizes: dict[Symbol, Expr] = field(default_factory=dict)

    def add(
        self, surface: Surface, h: Expr, radius: tuple[Expr, Expr], width: Expr | None = None
    ) -> tuple[Symbol, Symbol]:
        """Add a surface; return the symbols of its sign and size."""
        number = len(self.s)
        # Under names of their own while the old symbols stand beside them.
        self.s.append(Symbol(f"_new_s{number}", real=True))
        self.a.append(Symbol(f"_new_a{number}", nonnegative=True))
        self.h.append(h)
        # As it is: sympy looks long for a better form of a long expression.
        self.sizes[self.a[-1]] = sympy.Abs(self.plain(h), evaluate=False)
        self.radius.append(radius)
        self.widths.append(width)
        self.surfaces.append(surface)
        return self.s[-1], self.a[-1]

    def final(self) -> dict[Symbol, Symbol]:
        """From the symbols given here to those of a form."""
        names = {s: Symbol(f"_s{k}", real=True) for k, s in enumerate(self.s)}
        return names | {a: Symbol(f"_a{k}", nonnegative=True) for k, a in enumerate(self.a)}

    def plain(self, h: Expr) -> Expr:
        """An expression with |h| of the surfaces written out."""
        return h.xreplace(self.sizes)


def kink(surface: Surface, name: str, h: Any) -> Surface:
    """A kink of the field beside a surface."""
    return replace(surface, name=name, h=h, radius=1.0, kind="kink", width=0.0)


class StickBand:
    """The band of one surface, number i of `form`. Raises ModelError where the model does not fit it."""

    def __init__(
        self, form: SymbolicForm, i: int, surface: Surface, own: Switch | Karnopp, h: Expr, new: NewSurfaces
    ) -> None:
        self.form, self.i, self.surface, self.own = form, i, surface, own
        self.s, self.a = form.s[i], form.a[i]
        # Behind the equations a form may hold an expression that is to be read under this comparator.
        self.equations = form.field[: len(form.x)]
        self.name = f"{type(own).__name__} of surface {surface.name!r}"
        width, alpha = (own.DV if isinstance(own, Karnopp) else own.eta), own.alpha
        self.width, self.alpha = self._number(width, True), self._number(alpha, False)
        unit = form.widths[i] if form.widths else None
        self.h = form.h[i] if unit is None else form.h[i] * unit
        if self.h.free_symbols & set(form.a):
            raise ModelError(f"{self.name}: h holds the kink of another surface. {OTHERS}")
        held = [j for j, x in enumerate(form.x) if self.h.has(x)]
        linear = len(held) == 1 and not self.h.diff(form.x[held[0]]).free_symbols - set(form.p)
        self.state = held[0] if linear else None
        self.at: dict[Symbol, Expr] = {self.a: sympy.S.Zero}  # where the field is taken within the band
        own_state = [] if self.state is None else [form.x[self.state]]
        on = {x: x - self.h / self.h.diff(x) for x in own_state}
        if isinstance(own, Karnopp):
            on = self._velocity(held)
            self.at |= on
        self.rate = self._rate()
        at_rest = isinstance(own, Karnopp) or own.balance == BALANCES[0]
        self.tested = self.rate.xreplace(on) if at_rest else self.rate
        self.slope = self.rate.diff(self.s)
        if self.slope == 0 or sympy.expand(self.slope.diff(self.s)) != 0:
            what = "does not depend on its sign" if self.slope == 0 else "is not affine in its sign"
            raise ModelError(f"{self.name}: dh/dt {what}, so nothing slides as these models do. {OTHERS}")
        self.upper, self.above = new.add(self._edge("upper", -1), h - self.width, UNIT)
        self.lower, self.below = new.add(self._edge("lower", 1), h + self.width, UNIT)
        self.down = self.up = sympy.S.Zero

    def _number(self, value: Any, positive: bool) -> Expr:
        if not is_expression(value):
            return sympy.Float(value)
        mine = all(isinstance(q, ParameterSymbol) for q in value.free_symbols)
        if not mine or not (value.is_positive if positive else value.is_nonnegative):
            raise ModelError(
                f"{self.name}: {value} was given, expected a number {'> 0' if positive else '>= 0'} or an "
                "expression of parameters that their bounds keep so: Parameter(0.01, lower=1e-12)."
            )
        return value

    def _edge(self, name: str, side: int) -> Surface:
        return Surface(f"{self.surface.name}:{name}", self.surface.h + side * self.width)

    def _rate(self) -> Expr:
        """L(s), dh/dt within the band."""
        rate = self.h.diff(t)
        for x, f in zip(self.form.x, self.equations, strict=True):
            slope = self.h.diff(x)
            if slope != 0:
                rate += slope * convex(f, {self.s}).xreplace(self.at)
        return rate

    def _velocity(self, held: list[int]) -> dict[Symbol, Expr]:
        """The states at h = 0; ModelError where h is no velocity of a body, or of one against another."""
        # Through a mass matrix a force acts on the velocities of other bodies as well, as its impulse does.
        moved = [
            x for k, (x, f) in enumerate(zip(self.form.x, self.equations, strict=True))
            if k not in held and f.has(self.s)
        ]  # fmt: skip
        if any(x not in self.equations for x in moved):
            names = " or ".join(self.form.x[k].name for k in held)
            raise ModelError(
                f"{self.name}: its sign acts on other equations than that of {names}, so there is no balance "
                f"of forces to take. {OTHERS}"
            )
        effect = [convex(f, {self.s}).xreplace(self.at).diff(self.s) for f in self.equations]
        gradient = [self.h.diff(x) for x in self.form.x]
        lost = moved_onto([self.h], [gradient], [effect], self.form.x, self.form.p)
        others = [f for k, f in enumerate(self.equations) if k not in held or effect[k] == 0]
        # y - x/2 with x' = v and a sign on y alone is a relay of a place, whatever y is; v cos(x) is not.
        still = self.h.xreplace({x: sympy.S.Zero for x, e in zip(self.form.x, effect, strict=True) if e != 0})
        places = [k for k in held if self.equations[k] in self.form.x and still.has(self.form.x[k])]
        if not lost or places:
            raise ModelError(
                f"{self.name}: h = {self.surface.h} holds {len(held)} states, expected the velocity of a "
                "body or of one against another: linear in the states, and its sign divided between their "
                f"equations in a ratio that none of these changes. {OTHERS}"
            )
        for x, less in zip(self.form.x, lost, strict=True):
            if less != 0 and not any(f.has(x) for f in others):
                raise ModelError(f"{self.name}: no other equation holds {x}, so it is no velocity. {OTHERS}")
        return {x: x - less for x, less in zip(self.form.x, lost, strict=True) if less != 0}

    def add_rates(self, new: NewSurfaces, even: Callable[[Expr], Expr]) -> None:
        """Add the surfaces on which the static levels are reached; `even` puts in the other signs."""
        ends = []
        for bound, name in zip(self.form.radius[self.i], ("down", "up"), strict=True):
            h = even(-self.tested.xreplace({self.s: bound}))
            left = [q for q in (*self.form.s, *self.form.a) if h.has(q)]
            if left:
                place = next(k for k, q in enumerate((*self.form.s, *self.form.a)) if q == left[0])
                other = self.form.plain_h()[place % len(self.form.s)]
                raise ModelError(
                    f"{self.name}: dh/dt depends on the sign of {other}, which is no function of the state. "
                    "Choose Band or Smooth for one of the two."
                )
            ends.append(new.add(Surface(f"{self.surface.name}:{name}", new.plain(h)), h, UNIT)[0])
        self.down, self.up = ends

    def put_into(self, equations: Sequence[Expr]) -> list[Expr]:
        """The equations, divided by the band where the surface acts on them."""
        return [self._divided(j, convex(f, {self.s})) for j, f in enumerate(equations)]

    def _divided(self, j: int, f: Expr) -> Expr:
        within = f.xreplace(self.at)
        if j != self.state and not f.has(self.s, *self.at):
            return f
        low, high = (within.xreplace({self.s: bound}) for bound in self.form.radius[self.i])
        repelled = low if self.slope.is_nonpositive else within.xreplace({self.s: self.h / self.width})
        inside = Select(
            self.down, Select(self.up, low, repelled), Select(self.up, self._sliding(j, within), high)
        )
        above, below = (
            f.xreplace({self.s: sympy.Integer(side), self.a: self.width + size})
            for side, size in ((1, self.above), (-1, self.below))
        )
        return Select(self.upper, above, Select(self.lower, inside, below))

    def _sliding(self, j: int, within: Expr) -> Expr:
        """An equation at the sign s* with L(s*) = -alpha h."""
        if j == self.state:
            return (-self.alpha * self.h - self.h.diff(t)) / self.h.diff(self.form.x[j])
        if not within.has(self.s):
            return within
        rest = self.rate.xreplace({self.s: sympy.S.Zero}) + self.alpha * self.h
        effect = within.diff(self.s)
        if effect.has(self.s):
            return within.xreplace({self.s: -rest / self.slope})
        return within.xreplace({self.s: sympy.S.Zero}) - effect / self.slope * rest


def moved_onto(
    h: Sequence[Expr], gradients: Sequence[Sequence[Expr]], effects: Sequence[Sequence[Expr]],
    x: Sequence[Symbol], p: Sequence[Symbol],
) -> list[Expr]:  # fmt: skip
    """What each state loses on the way to h = 0 along the effects; [] where that way bends.

    x: the states. It may depend on those that stay, as a mass matrix does on the places.
    """
    rows, columns = sympy.Matrix(gradients), sympy.Matrix(effects).T
    moved = [k for k in range(columns.rows) if any(e != 0 for e in columns.row(k))]
    if len(moved) < len(h) or rows[:, moved].free_symbols & {x[k] for k in moved}:
        return []
    if len(moved) == len(h):  # as many states as surfaces: h = 0 gives them, in whatever ratio they go there
        part = rows[:, moved]
        if sympy.simplify(part.det()) == 0:
            return []
        solved = part.inv()
        share = sympy.zeros(columns.rows, len(h))
        for at, k in enumerate(moved):
            share[k, :] = solved[at, :]
    else:
        # In units of one of them each effect has no common factor, which sympy would be long to find.
        first = [next(e for e in columns.col(j) if e != 0) for j in range(len(h))]
        ratio = sympy.Matrix(columns.rows, len(h), lambda k, j: columns[k, j] / first[j])
        slope = rows * ratio
        if _vanishes(slope.det()):
            return []
        share = ratio * slope.adjugate() / slope.det()
    lost = list(share * sympy.Matrix(h))
    stay = {q for q, less in zip(x, lost, strict=True) if less == 0}
    for tidy in (lambda e: e, sympy.cancel):
        share = share.applyfunc(tidy)
        if not share.free_symbols - {*p, *stay}:
            return list(share * sympy.Matrix(h))
    return []


def _vanishes(e: Expr) -> bool:
    """Whether an expression is 0 everywhere: most are not, which a number shows in no time."""
    rng = np.random.default_rng(1)
    number = sympy.N(e.xreplace({q: sympy.Float(rng.uniform(0.5, 1.5)) for q in e.free_symbols}))
    return not (number.is_Float and abs(number) > 1e-6) and sympy.simplify(e) == 0
