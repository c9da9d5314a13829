"""Stops: surfaces that no solution passes, as their resets send it back from one side.

At a surface h = 0 that is reached from h > 0, with L = dh/dt: after the reset h > 0, or h = 0 and L+ = -e L-
with e >= 0, so that the solution stays in h >= 0. Only solutions that begin in h < 0 come to what lies there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from sympy import Expr, Symbol

from filippov.analysis.algebra.exact_form import exact_form
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet
from filippov.model.size import cancelled
from filippov.model.symbolic import SymbolicForm, rate_along
from filippov.model.system import System

Found = EquilibriumPoint | EquilibriumSet


def with_stops(system: System, found: list[Found], values: Mapping[Symbol, Expr]) -> list[Found]:
    """The equilibria with the names of the stops that they lie behind."""
    form = exact_form(system)
    if form is None or not form.reset:
        return found
    for i, surface in enumerate(system.surfaces):
        beyond = {"+": "-", "-": "+"}.get(surface.side, "") if surface.reset is not None else ""
        there = [k for k, e in enumerate(found) if e.mode[i] == beyond]
        if there and _stops(system, form, i, values):
            for k in there:
                found[k] = replace(found[k], behind=(*found[k].behind, surface.name))
    return found


def _stops(system: System, form: SymbolicForm, i: int, values: Mapping[Symbol, Expr]) -> bool:
    """Whether the reset of surface i keeps its side and no other reset moves the state across it."""
    h, after = form.plain_h()[i], form.reset[i]
    assert after is not None
    others = [*(row for k, row in enumerate(form.reset) if k != i), *form.time_reset]
    if any(e != x and h.has(x) for row in others if row for x, e in zip(form.x, row, strict=True)):
        return False
    signs = {*form.s, *form.a}
    moved = {x: e for x, e in zip(form.x, after, strict=True) if e != x}
    side = 1 if system.surfaces[i].side == "+" else -1
    landed = cancelled(side * h.subs(moved, simultaneous=True)).subs(values)
    if landed.is_number and landed.is_positive:
        return True
    rate = rate_along(h, form.field, form.x)
    if cancelled(h.subs(moved, simultaneous=True) - h) != 0 or rate == 0 or rate.free_symbols & signs:
        return False
    ratio = cancelled(rate.subs(moved, simultaneous=True) / rate).subs(values)
    return bool(ratio.is_number and ratio.is_nonpositive)
