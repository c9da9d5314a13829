"""The expressions of a system with every decimal as the fraction that it stands for: 0.2 is 1/5.

In an exponent 0.3333333333333333 stands for 1/3, and what is no such fraction stays a float.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache

import sympy
from sympy import Expr, Symbol

from filippov.analysis.algebra.polynomial import plain_exponents
from filippov.model.symbolic import Select, SymbolicForm
from filippov.model.system import System


@lru_cache(maxsize=64)
def exact_form(system: System) -> SymbolicForm | None:
    """The form of a system without floats but in exponents; None for plain functions, itself without any."""
    form = system.symbolic
    if form is None or not any(e.has(sympy.Float) for e in form.expressions()):
        return form
    return _each(form, fraction)


def _each(form: SymbolicForm, put: Callable[[Expr], Expr]) -> SymbolicForm:
    """The form with another expression in the place of each."""
    contact = tuple(
        None if c is None else replace(c, rate=put(c.rate), direction=tuple(map(put, c.direction)))
        for c in form.contact
    )
    return replace(
        form,
        field=tuple(map(put, form.field)),
        h=tuple(map(put, form.h)),
        radius=tuple((put(low), put(high)) for low, high in form.radius),
        reset=tuple(None if row is None else tuple(map(put, row)) for row in form.reset),
        contact=contact,
        time_reset=tuple(None if row is None else tuple(map(put, row)) for row in form.time_reset),
    )


def with_signs(system: System, signs: Mapping[Symbol, int]) -> System:
    """The system without the branches of Select that parameters of these signs (1 or -1) exclude."""
    form = system.symbolic
    nodes = {q for e in form.expressions() for q in e.atoms(Select)} if form is not None else set()
    if form is None or not any(_choice(q, signs) for q in nodes):
        return system

    def known(q: Expr) -> bool:
        return _choice(q, signs) != 0

    def put(e: Expr) -> Expr:
        return e.replace(known, lambda q: q.args[1 if _choice(q, signs) > 0 else 2])

    return system.with_form(_each(form, put), system.surfaces)


def _choice(e: Expr, signs: Mapping[Symbol, int]) -> int:
    """Which branch of a Select it is: 1 or -1, 0 where the signs do not say."""
    if not isinstance(e, Select) or not e.args[0].free_symbols or not e.args[0].free_symbols <= signs.keys():
        return 0
    signed = {q: sympy.Dummy(positive=True) if signs[q] > 0 else sympy.Dummy(negative=True) for q in signs}
    condition = e.args[0].xreplace(signed)
    return 1 if condition.is_positive else -1 if condition.is_nonpositive else 0


def fraction(expression: Expr) -> Expr:
    """An expression with each finite float as the shortest decimal that rounds to it."""
    return plain_exponents(expression, lambda q: sympy.Rational(repr(float(q))) if q.is_finite else q)
