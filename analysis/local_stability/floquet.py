"""Floquet's theorem with resets: the multipliers of a linear part over the common period of field and clocks.

y' = A(t) y between the clocks and y+ = R y at them, both of period T: the product of the flows and the R.
Source: Hale 1980, Ordinary Differential Equations; with resets Bainov & Simeonov 1993.
"""

from __future__ import annotations

import numpy as np
import sympy

from filippov.analysis.algebra import linalg
from filippov.analysis.local_stability.periodic_sliding import PeriodicSliding
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.local_stability.stability_result import Answer
from filippov.analysis.steady.clocks import Phases, after, branch_points, phases, resetting
from filippov.analysis.steady.forcing import forcing_period
from filippov.base.arrays import Array
from filippov.model.symbols import t as time

CLEAR = 1e-6
SAME_PERIOD, MOST_TURNS = 1e-10, 256
PULSES = 512


def floquet(
    context: Context, mode: str, matrix: sympy.Matrix, x: tuple[sympy.Expr, ...], moves: bool,
    sliding: PeriodicSliding | None = None,
) -> tuple[Answer, str]:  # fmt: skip
    """The verdict of the multipliers of a mode's linear part over the common period, and a sentence.

    matrix   A(t), shape (n, n), of a point x of the mode; moves: whether it depends on time
    sliding  what returns the state to the surfaces on which it slides, if it slides
    """
    clocks = common_period(context, moves)
    if isinstance(clocks, str):
        return "undecided", clocks
    onto = None if sliding is None else sliding.onto
    product = monodromy(context, mode, matrix, x, clocks, onto)
    if product is None:
        return "undecided", "a reset has no derivative at the equilibrium, or changes with time"
    multipliers = linalg.eigvals(product)
    largest = float(np.max(np.abs(multipliers)))
    head = f"the multipliers over the period {clocks.period:.6g} have moduli up to {largest:.6g}"
    if sliding is not None:
        met = "the surface attracts" if sliding.surfaces == 1 else f"the {sliding.surfaces} surfaces attract"
        head = f"{met} at all times, |h| falls at {sliding.approach:.6g} at least; {head}"
    return by_modulus(largest, head)


def by_modulus(largest: float, head: str) -> tuple[Answer, str]:
    """The verdict by the largest modulus of a multiplier; head: what the reason begins with."""
    if largest < 1.0 - CLEAR:
        return "asymptotically stable", f"{head} < 1"
    if largest > 1.0 + CLEAR:
        return "unstable", f"{head} > 1"
    return "undecided", f"{head}: the linear part does not decide"


def common_period(context: Context, moves: bool) -> Phases | str:
    """The common period of the field, where it moves, and of the clocks; or why there is none."""
    values = np.array([float(context.values[q]) for q in context.form.p])
    clocks = phases(context.system, values) if resetting(context.system) else Phases(0.0, ())
    if clocks is None:
        return "the periods of the clocks have no common multiple that is short"
    period = clocks.period
    if moves:
        found = forcing_period(context.system)
        if found is None:
            text = "the linear part depends on time, with no period that is seen"
            return f"{text}; its eigenvalues at an instant decide nothing"
        # The period of field and clocks together, which holds those of the clocks several times.
        whole = context.number(found)
        turns = round(whole / period) if period else 1
        if not 1 <= turns <= MOST_TURNS or (period and abs(whole / period - turns) > SAME_PERIOD * turns):
            return "the periods of the field and of the clocks have no common multiple that is short"
        again = [(phase + k * period, which) for k in range(turns) for phase, which in clocks.instants]
        return Phases(whole, tuple(again))
    return Phases(period, clocks.instants)


def monodromy(
    context: Context, mode: str, matrix: sympy.Matrix, x: tuple[sympy.Expr, ...], clocks: Phases,
    onto: sympy.Matrix | None, beside: float = 0.0,
) -> Array | None:  # fmt: skip
    """The product of flows and resets over one period, from just after the phase 0.

    onto    where the state is moved before the flow continues
    beside  for one state: the distance from x at which the resets are differentiated, so that they have a
            derivative
    """
    from scipy.integrate import solve_ivp

    form, n = context.form, matrix.rows
    put = dict(zip(form.x, x, strict=True))
    field = sympy.lambdify(time, matrix.subs(context.values), "numpy")
    slopes: dict[int, Array] = {}
    for k in {k for _, k in clocks.instants}:
        row = after(context.system, k, mode)
        kinked = branch_points(row, put, context.values)
        if kinked and not beside:
            return None
        near = {q: e + beside for q, e in put.items()} if kinked else put
        slope = sympy.Matrix(row).jacobian(form.x).subs(near)
        slopes[k] = context.numbers(slope)
        if slope.has(time) or not np.all(np.isfinite(slopes[k])):
            return None

    def rate(t: float, y: Array) -> Array:
        return (np.array(field(t), dtype=float).reshape(n, n) @ y.reshape(n, n)).ravel()

    back = None if onto is None else sympy.lambdify(time, onto.subs(context.values), "numpy")

    def brought(product: Array, t: float) -> Array:
        return product if back is None else np.array(back(t), dtype=float).reshape(n, n) @ product

    # A square wave jumps within a step: none may pass over one of its pulses.
    longest = clocks.period / PULSES if matrix.has(sympy.sign, sympy.Abs) else np.inf
    product, now = brought(np.eye(n), 0.0), 0.0
    # Instants at phase 0 come at the end of the period that they close.
    order = sorted((phase or clocks.period, k) for phase, k in clocks.instants)
    for phase, k in [*order, (clocks.period, -1)]:
        if phase > now:
            product = brought(product, now)
            found = solve_ivp(
                rate, (now, phase), product.ravel(), method="DOP853", rtol=1e-11, atol=1e-13,
                max_step=longest,
            )  # fmt: skip
            if not found.success:
                return None
            product, now = found.y[:, -1].reshape(n, n), phase
        if k >= 0:
            product = slopes[k] @ product
    return brought(product, clocks.period)
