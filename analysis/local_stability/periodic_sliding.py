"""Equilibria on attracting surfaces, where the field depends on time or clocks reset: data for Floquet.

On the intersection of k surfaces with C = dh/dx, G(t) = df/ds the solution beside the point is y' = J(t) y,
J = Q df/dx, Q = 1 - G (C G)^-1 C. A reset may move the state off the surfaces, to y. There every field is
G (s - s0) to first order, so the surfaces are reached after a time of order |y| at Q y: the flow over a
period is the product of flows of J, resets and Q after them. It decides where the surfaces attract at all
times. Source: Filippov 1988; Hale 1980.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import sympy
from sympy import Expr

from filippov.analysis.algebra.polynomial import exact
from filippov.analysis.algebra.time_bounds import bounds
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.steady.clocks import resetting
from filippov.analysis.steady.equilibrium import EquilibriumPoint
from filippov.analysis.steady.linearisation import linearise
from filippov.model.symbols import t as time

MOST = 5


@dataclass(frozen=True)
class PeriodicSliding:
    """J and Q in t at the parameter values, the number of surfaces, and the least rate of approach."""

    matrix: sympy.Matrix
    onto: sympy.Matrix
    surfaces: int
    approach: float


def periodic_sliding(context: Context, point: EquilibriumPoint) -> PeriodicSliding | str:
    """The parts, or the reason why they do not decide."""
    form, system = context.form, context.system
    values = {**context.values, **context.put}
    on = [i for i, m in enumerate(point.mode) if m == "0"]
    if len(on) > MOST or any(system.surfaces[i].kind != "switching" or system.surfaces[i].width for i in on):
        return "it lies on a kink, on a surface with resets or hysteresis, or on many surfaces"
    if any(form.radius[i] != (-1, 1) for i in on):
        return "the set at a surface is wider than the hull of the sides"
    if any(e.has(time) for e in form.h) or not point.exact:
        return "a surface moves with time, or the point is not known exactly"
    s = [form.s[i] for i in on]
    if any(e.has(*s, *(form.a[i] for i in on)) for k in resetting(system) for e in form.time_reset[k] or ()):
        return "a reset is another one on every side"
    place = {q: exact(sympy.S(e).subs(values)) for q, e in zip(form.x, point.x, strict=True)}
    given = dict(point.multipliers)
    held = {form.s[i]: exact(sympy.S(given[system.surfaces[i].name]).subs(values)) for i in on}
    if any(not e.is_number for e in place.values()) or any(e.free_symbols - {time} for e in held.values()):
        return "its place or its multipliers are no numbers"
    if any(not _within(e) for e in held.values()):
        return "a multiplier is not seen to stay off the ends of its set at all times"
    field = sympy.Matrix(form.at_mode(point.mode)).subs(values).applyfunc(exact)
    if any(f.diff(a, b) != 0 for f in field for a, b in itertools.combinations_with_replacement(s, 2)):
        return "the field is not affine in the signs"
    linear = linearise(system, point, values=context.put, sides=[]).sliding
    if linear is None or linear.matrix is None:
        return "the field on the surfaces is not determined by first derivatives"
    G = field.jacobian(s).subs(place)
    C = linear.gradient.subs(values).subs(place).applyfunc(exact)
    J = linear.matrix.subs(values).subs(place).applyfunc(exact)
    normal = C * G
    if any(e.free_symbols - {time} for part in (C, G, J) for e in part) or C.rows != len(on):
        return "the field on the surfaces is not determined by first derivatives"
    approach = _approach(normal, [held[q] for q in s])
    if approach is None:
        return "not all fields are seen to point towards the surfaces at all times"
    onto = sympy.eye(C.cols) - G * normal.inv() * C
    return PeriodicSliding(J, onto, len(on), approach)


def _within(s: Expr) -> bool:
    found = bounds(s)
    return found is not None and bool(found[0] > -1) and bool(found[1] < 1)


def _approach(normal: sympy.Matrix, held: list[Expr]) -> float | None:
    """A rate above 0 at which |h_i| falls on all sides at all times; None where it is not seen."""
    least: Expr = sympy.oo
    for signs in itertools.product((1, -1), repeat=len(held)):
        rate = normal * sympy.Matrix([a - b for a, b in zip(signs, held, strict=True)])
        for i, sign in enumerate(signs):
            found = bounds(sympy.expand(-sign * rate[i]))
            if found is None or not bool(found[0] > 0):
                return None
            least = min(least, found[0])
    return float(least)
