"""Sets wider than [-1, 1] of a sign in which the field is not affine: static friction whose load it changes.

Where an acceleration changes the normal force, x'' = (F - mu N s)/(1 + mu k s). At rest s is in [lo, hi], and
what breaks away is told by that field at lo and at hi. Sliding fields blend those at s = +-1, with a
multiplier of their own; the ends of its set are those at which the blend is the field at lo and at hi.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import sympy
from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.model.parameter_symbol import ParameterSymbol
from filippov.model.surface import Surface
from filippov.model.symbolic import Select, SymbolicForm


def levelled(form: SymbolicForm, surfaces: Sequence[Surface]) -> tuple[SymbolicForm, list[Surface]]:
    """The form with its field as such a blend, the ends of the sets as its multipliers, and its surfaces.

    A choice by the sign is blended as it is. Raises ModelError where no multiplier of the blend gives the
    field at an end, or the field has a pole in the set.
    """
    out = list(surfaces)
    for i, surface in enumerate(surfaces):
        if surface.wide and any(_bends(form.s[i], f) for f in form.field):
            form = _levelled(form, i, surface.name)
            out[i] = replace(surface, radius=form.radius[i])
    return form, out


def _bends(s: Symbol, f: Expr) -> bool:
    """Whether an expression is not affine in a sign, nor chosen by it."""
    if s not in f.free_symbols or any(s in q.args[0].free_symbols for q in f.atoms(Select)):
        return False
    slope = f.diff(s)
    return s in slope.free_symbols and s in sympy.cancel(slope).free_symbols


def _levelled(form: SymbolicForm, i: int, name: str) -> SymbolicForm:
    s, at_rest = form.s[i], {form.a[i]: sympy.S.Zero}
    moved = {k: f for k, f in enumerate(form.field) if s in f.free_symbols}
    field, radius, ends = list(form.field), list(form.radius), []
    for k, f in moved.items():
        plus, minus = f.xreplace({s: sympy.S.One}), f.xreplace({s: sympy.S.NegativeOne})
        field[k] = (plus + minus) / 2 + s * (plus - minus) / 2
    for side, end in zip((sympy.S.NegativeOne, sympy.S.One), form.radius[i], strict=True):
        found = []
        for k, f in moved.items():
            _check_pole(f, s, side, end, name)
            blend = field[k].xreplace(at_rest)
            slope = blend.diff(s)
            there = f.xreplace({s: end} | at_rest)
            found.append(sympy.cancel((there - blend.xreplace({s: sympy.S.Zero})) / slope))
        strange = found[0].free_symbols & {*form.s, *form.a}
        if strange or any(sympy.cancel(q - found[0]) != 0 for q in found[1:]):
            raise ModelError(
                f"surface {name!r}: its set ends at {end}, where the field is no mixture of those at the "
                "signs -1 and +1, and sliding fields are: the equations are not affine in this sign. Write "
                "them so that they are, or leave its radius out."
            )
        ends.append(found[0])
    radius[i] = (ends[0], ends[1])
    return replace(form, field=tuple(field), radius=tuple(radius))


def _check_pole(f: Expr, s: Symbol, side: Expr, end: Expr, name: str) -> None:
    """Refuse a denominator that changes its sign between the sign of a side and the end of the set."""
    below = sympy.fraction(sympy.together(f))[1]
    ratio = below.xreplace({s: end}) / below.xreplace({s: side})
    defaults = {q: sympy.Float(q.parameter.default, 30) for q in ratio.atoms(ParameterSymbol)}
    value = ratio.xreplace(defaults).evalf(20)
    if value.is_number and not value > 0:
        raise ModelError(
            f"surface {name!r}: its set ends at {end}, and the field has a pole between the sign {side} and "
            "there at the default parameters: the contact jams. Expected a field that is finite in the set; "
            "give a smaller radius."
        )
