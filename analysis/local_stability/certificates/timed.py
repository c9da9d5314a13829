"""Equilibria of fields that move with time, by bounds that hold at all times.

Linear part A(t): with the logarithmic norm mu(A) = max_i (a_ii + sum |a_ij|), |x| falls if mu <= -c < 0
at all t. One state beside a surface: |x| falls if the field beside it points back by c > 0 at all t. One
state, x' = a(t) x with a of mean 0 over a period: |x| is periodic. Bounds over t are those of interval
arithmetic.
Source: Coppel 1965, Stability and Asymptotic Behavior of Differential Equations; Filippov
1988.
"""

from __future__ import annotations

import itertools

import sympy
from sympy import Expr

from filippov.analysis.algebra.polynomial import exact
from filippov.analysis.algebra.time_bounds import bounds
from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.kink_stability import modes_beside, surfaces_at
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.steady.equilibrium import EquilibriumPoint
from filippov.analysis.steady.forcing import forcing_period
from filippov.model.symbols import t as time

COPPEL = "Coppel 1965"
FILIPPOV = "Filippov 1988"


def timed(context: Context, point: EquilibriumPoint) -> Certificate | None:
    """The verdict on a point of a system whose field moves with time and has no clocks; None for others."""
    system, form = context.system, context.form
    if any(e.reset is not None for e in system.time_events) or not point.exact:
        return None
    values = {**context.values, **context.put}
    at = {x: exact(sympy.S(e).subs(values)) for x, e in zip(form.x, point.x, strict=True)}
    if any(not e.is_number for e in at.values()):
        return None
    on = surfaces_at(context, point)
    if "0" not in point.mode and all(system.surfaces[i].kind == "kink" for i in on):
        modes = modes_beside(context, point.mode, on).values()
        sides = [form.jacobian(mode).subs(values).subs(at).applyfunc(exact) for mode in modes]
        return _linear(context, point, sides)
    if len(form.x) == 1 and len(system.surfaces) == 1 and point.mode == "0":
        return _relay(context, at, values)
    return None


def _linear(context: Context, point: EquilibriumPoint, sides: list[sympy.Matrix]) -> Certificate | None:
    largest: Expr | None = None
    for A, i in itertools.product(sides, range(sides[0].rows)):
        parts = [bounds(A[i, i])] + [bounds(A[i, j]) for j in range(A.rows) if j != i]
        if any(p is None for p in parts):
            return _mean(context, point, sides[0]) if len(sides) == 1 else None
        first, *others = [p for p in parts if p is not None]
        row = first[1] + sum((max(abs(a), abs(b)) for a, b in others), sympy.S.Zero)
        largest = row if largest is None or row > largest else largest
    if largest is not None and bool(largest < 0):
        text = "the largest modulus of the states falls at all times"
        told = f"logarithmic norm of the linear part <= {float(largest):.6g} at all t (interval arithmetic)"
        return Certificate("asymptotically stable", text, COPPEL, (told,))
    return _mean(context, point, sides[0]) if len(sides) == 1 else None


def _mean(context: Context, point: EquilibriumPoint, A: sympy.Matrix) -> Certificate | None:
    """One state and a linear field: the mean of its rate over the period, in exact numbers."""
    period = forcing_period(context.system)
    if A.rows != 1 or period is None or context.form.jacobian(point.mode).has(*context.form.x):
        return None
    period = sympy.S(period).subs(context.values)
    total = sympy.simplify(sympy.integrate(A[0, 0], (time, 0, period)))
    if total != 0:
        return None
    told = f"the rate has the mean 0 over the period {float(period):.6g} (integrated in exact numbers)"
    return Certificate(
        "stable", "x is multiplied by a periodic function", "Hale 1980", (told,)
    )


def _relay(
    context: Context, at: dict[sympy.Symbol, Expr], values: dict[sympy.Symbol, Expr]
) -> Certificate | None:
    form = context.form
    slope = sympy.S(form.h[0].diff(form.x[0])).subs(values).subs(at)
    place = sympy.simplify(form.h[0].subs(values).subs(at))
    if not slope.is_number or slope == 0 or place != 0:
        return None
    told = []
    for side in (1, -1):
        rate = bounds(exact((slope * form.at_mode([side])[0]).subs(values)).subs(at))
        if rate is None or not (rate[1] < 0 if side > 0 else rate[0] > 0):
            return None
        bound = rate[1] if side > 0 else rate[0]
        told.append(f"for h {'>' if side > 0 else '<'} 0 beside it dh/dt {'<=' if side > 0 else '>='} "
                    f"{float(bound):.6g} at all t (interval arithmetic)")  # fmt: skip
    text = "the surface is reached in finite time from both sides at all times"
    return Certificate("asymptotically stable", text, FILIPPOV, tuple(told))
