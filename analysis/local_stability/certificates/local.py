"""The field beside one equilibrium, in exact numbers: one smooth field on each side of the surfaces there."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import sympy
from sympy import Expr, Symbol

from filippov.analysis.algebra.polynomial import exact
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.steady.equilibrium import EquilibriumPoint
from filippov.model.symbols import t as time

MOST_SIDES = 64
# A place as near to a surface as this and not on it is not told from one on it.
NEAR = 1e-12
# A place found numerically is tried as a fraction of this denominator.
ROUND = 5040
Signs = tuple[int, ...]


@dataclass(frozen=True)
class Local:
    """x' = fields[signs](x) where the surfaces through x = 0 have these signs; x is measured from the point.

    x        states, shape (n,)
    h        switching functions of the surfaces through the point: 0 at x = 0, shape (k,)
    index    their places among the surfaces of the system
    names    their names
    kinds    "switching", "kink" or "reset"
    fields   {signs: field (n,)}; sizes |h_i| are written as sign times h_i
    s        the multipliers at the point where they are numbers, else None
    resets   {place in h: state after the reset (n,)}
    sides    {place in h: "+", "-" or "both"}
    pushes   {place in h: direction (n,) of the push at the point} where a reset allows resting contact
    """

    x: tuple[Symbol, ...]
    h: tuple[Expr, ...]
    index: tuple[int, ...]
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    fields: Mapping[Signs, tuple[Expr, ...]]
    s: tuple[Expr, ...] | None
    resets: Mapping[int, tuple[Expr, ...]]
    sides: Mapping[int, str]
    pushes: Mapping[int, tuple[Expr, ...]]

    @property
    def filippov(self) -> bool:
        """Whether no surface here has a reset: then the sides say all."""
        return not self.resets

    def smooth(self) -> tuple[Expr, ...] | None:
        """The field where all sides have the same, else None."""
        first, *others = self.fields.values()
        same = all(sympy.expand(a - b) == 0 for other in others for a, b in zip(first, other, strict=True))
        return first if same else None


def local(context: Context, point: EquilibriumPoint) -> Local | None:
    """The field beside a point; None for a field that moves with time, and where numbers are not exact."""
    form, system = context.form, context.system
    values = {**context.values, **context.put}
    at = [exact(sympy.S(e).subs(values)) for e in point.x]
    rounded = None if point.exact else _rounded(context, point)
    if rounded is not None:
        at = rounded
    if not (point.exact or rounded) or any(not e.is_number or not e.is_finite for e in at):
        return None
    shift = {x: x + e for x, e in zip(form.x, at, strict=True)}
    place = dict(zip(form.x, at, strict=True))
    on: list[int] = []
    signs: list[int] = []
    sizes: dict[Symbol, Expr] = {}
    for i, (a, h) in enumerate(zip(form.a, form.h, strict=True)):
        if system.surfaces[i].width:
            return None
        g = h.xreplace(sizes)
        value = sympy.simplify(exact(g.subs(values)).subs(place))
        if not value.is_number or (value != 0 and abs(value.evalf(20)) < NEAR):
            return None
        if value == 0:
            on.append(i)
        signs.append(0 if value == 0 else (1 if value > 0 else -1))
        sizes[a] = signs[-1] * g
    if 2 ** len(on) > MOST_SIDES:
        return None
    kinds = tuple(system.surfaces[i].kind for i in on)
    if any(not _unit(form.radius[i]) for i in on if system.surfaces[i].kind == "switching"):
        return None
    fields: dict[Signs, tuple[Expr, ...]] = {}
    for choice in itertools.product((1, -1), repeat=len(on)):
        beside = dict(zip(on, choice, strict=True))
        mode = [beside.get(i, m) for i, m in enumerate(signs)]
        field = tuple(exact(f.subs(values)).xreplace(shift) for f in form.at_mode(mode))
        if any(f.has(time) or f.free_symbols - set(form.x) for f in field):
            return None
        fields[choice] = field
    if any(form.h[i].free_symbols & {form.a[j] for j in on} for i in on):
        return None
    places = [sympy.expand(exact(form.h[i].xreplace(sizes).subs(values)).xreplace(shift)) for i in on]
    if any(g.has(time) for g in places):
        return None
    given = {name: exact(sympy.S(e).subs(values)) for name, e in point.multipliers}
    names = tuple(system.surfaces[i].name for i in on)
    s = tuple(given.get(name, sympy.nan) for name in names)
    resets = {
        k: tuple(exact(e.subs(values)).xreplace(shift) - at[j] for j, e in enumerate(form.reset[i] or ()))
        for k, i in enumerate(on)
        if form.reset and form.reset[i] is not None
    }
    return Local(
        form.x,
        tuple(places),
        tuple(on),
        names,
        kinds,
        fields,
        s if all(e.is_number and e is not sympy.nan for e in s) else None,
        resets,
        {k: system.surfaces[on[k]].side for k in resets},
        {
            k: tuple(exact(sympy.S(d).subs(values)).subs(place) for d in contact.direction)
            for k in resets
            if form.contact and (contact := form.contact[on[k]]) is not None
        },
    )


def _rounded(context: Context, point: EquilibriumPoint) -> list[Expr] | None:
    """Simple fractions beside numbers found numerically at which the field is 0; None where it is not."""
    values = {**context.values, **context.put}
    at = [sympy.Rational(round(v * ROUND), ROUND) for v in point.value]
    if any(abs(float(a) - v) > 1e-6 for a, v in zip(at, point.value, strict=True)) or "0" in point.mode:
        return None
    place = dict(zip(context.form.x, at, strict=True))
    field = [exact(f.subs(values)).subs(place) for f in context.form.at_mode(point.mode)]
    return at if all(sympy.simplify(f) == 0 for f in field) else None


def _unit(radius: tuple[Expr, Expr]) -> bool:
    """Whether the set at the surface is the hull of the limits from its sides."""
    return bool(radius[0] == -1 and radius[1] == 1)
