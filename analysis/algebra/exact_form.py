"""The expressions of a system with every decimal as the fraction that it stands for: 0.2 is 1/5."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import sympy
from sympy import Expr

from filippov.model.symbolic import SymbolicForm
from filippov.model.system import System


@lru_cache(maxsize=64)
def exact_form(system: System) -> SymbolicForm | None:
    """The form of a system without floats; None for plain functions, itself where it has no floats."""
    form = system.symbolic
    if form is None or not any(e.has(sympy.Float) for e in form.expressions()):
        return form
    contact = tuple(
        None if c is None else replace(c, rate=fraction(c.rate), direction=tuple(map(fraction, c.direction)))
        for c in form.contact
    )
    return replace(
        form,
        field=tuple(map(fraction, form.field)),
        h=tuple(map(fraction, form.h)),
        radius=tuple((fraction(low), fraction(high)) for low, high in form.radius),
        reset=tuple(None if row is None else tuple(map(fraction, row)) for row in form.reset),
        contact=contact,
        time_reset=tuple(None if row is None else tuple(map(fraction, row)) for row in form.time_reset),
    )


def fraction(expression: Expr) -> Expr:
    """An expression with each finite float as the shortest decimal that rounds to it."""
    floats = {q: sympy.Rational(repr(float(q))) for q in expression.atoms(sympy.Float) if q.is_finite}
    return expression.xreplace(floats) if floats else expression
