"""Surfaces that depend on the time alone: a square wave is no place that a state lies on.

Their signs are functions of t, sign(h(t)), and what balances the field rests only if it does so for every
sign. The system without these surfaces, their signs in its expressions, has the same solutions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import sympy
from sympy import Expr, Symbol

from filippov import System
from filippov import t as time
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet
from filippov.model.symbolic import Contact, SymbolicForm, convex

SOON = sympy.Rational(7313, 10000)


def time_surfaces(system: System) -> tuple[int, ...]:
    """The numbers of the surfaces without reset or hysteresis whose h holds t and no state."""
    form = system.symbolic
    if form is None:
        return ()
    states = {*form.x, *form.s}
    return tuple(
        i
        for i, (surface, h) in enumerate(zip(system.surfaces, form.plain_h(), strict=True))
        if surface.kind in {"switching", "kink"} and not surface.width
        and h.has(time) and not h.free_symbols & states
    )  # fmt: skip


@lru_cache(maxsize=64)
def without_time_surfaces(system: System) -> System:
    """The system with sign(h(t)) in place of the signs of these surfaces; itself where it has none."""
    gone, form = time_surfaces(system), system.symbolic
    if not gone or form is None:
        return system
    h = form.plain_h()
    signs = {form.s[i]: sympy.sign(h[i]) for i in gone}
    put = {**signs, **{form.a[i]: sympy.Abs(h[i]) for i in gone}}

    def written(e: Expr) -> Expr:
        return convex(sympy.S(e), set(signs)).xreplace(put)

    kept = [i for i in range(len(system.surfaces)) if i not in gone]

    def rows(given: tuple[tuple[Expr, ...] | None, ...]) -> tuple[tuple[Expr, ...] | None, ...]:
        return tuple(None if row is None else tuple(map(written, row)) for row in given)

    def pushed(contact: Contact | None) -> Contact | None:
        if contact is None:
            return None
        return replace(contact, rate=written(contact.rate), direction=tuple(map(written, contact.direction)))

    moved = SymbolicForm(
        form.x, form.p, tuple(form.s[i] for i in kept), tuple(form.a[i] for i in kept),
        tuple(map(written, form.field)), tuple(written(form.h[i]) for i in kept),
        tuple((written(form.radius[i][0]), written(form.radius[i][1])) for i in kept),
        rows(tuple(form.reset[i] for i in kept)) if form.reset else (),
        tuple(pushed(form.contact[i]) for i in kept) if form.contact else (), rows(form.time_reset),
        tuple(form.widths[i] for i in kept) if form.widths else (),
        tuple(form.held[i] for i in kept) if form.held else (),
    )  # fmt: skip
    return system.with_form(moved, tuple(system.surfaces[i] for i in kept))


def modes_without(system: System, modes: Sequence[str] | None) -> list[str] | None:
    """Modes of the system without the characters of these surfaces."""
    gone = time_surfaces(system)
    if modes is None:
        return None
    return list(dict.fromkeys("".join(c for i, c in enumerate(mode) if i not in gone) for mode in modes))


def with_time_surfaces(
    system: System, found: EquilibriumPoint | EquilibriumSet, values: Mapping[Symbol, Expr]
) -> EquilibriumPoint | EquilibriumSet:
    """What was found without them as one of the system, with their signs shortly after t = 0."""
    gone, form = time_surfaces(system), system.symbolic
    assert form is not None
    text = list(found.mode)
    for i in gone:
        now = form.plain_h()[i].subs(values).subs(time, SOON)
        text.insert(i, "+" if float(now) >= 0 else "-")
    mode = "".join(text)
    if isinstance(found, EquilibriumPoint):
        return replace(found, mode=mode)
    return replace(found, mode=mode, ends=tuple(replace(e, mode=mode) for e in found.ends))
