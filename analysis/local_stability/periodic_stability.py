"""Equilibria of systems that depend on time or are reset by a clock: Floquet's theorem.

Near an equilibrium that stays where it is, y' = A(t) y between the clocks and y+ = R y at them. With both of
period T the product M of the flows and the R decides: all eigenvalues of M inside the unit circle, or one
outside. The eigenvalues of A at an instant decide nothing (Markus & Yamabe 1960, Osaka Math. J. 12, 305).
Source: Hale 1980, Ordinary Differential Equations; with resets Bainov & Simeonov 1993.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import sympy

from filippov.analysis.algebra import linalg
from filippov.analysis.local_stability.periodic_sliding import PeriodicSliding, periodic_sliding
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.local_stability.stability_result import Answer, EquilibriumStability, Statement
from filippov.analysis.steady.clocks import Phases, after, phases, resetting
from filippov.analysis.steady.equilibrium import EquilibriumPoint
from filippov.analysis.steady.forcing import depends_on_time, forcing_period
from filippov.analysis.steady.linearisation import Linearisation
from filippov.model.symbols import t as time

Array = npt.NDArray[np.float64]
FLOQUET = "Floquet's theorem, Hale 1980"
FROZEN = "Markus & Yamabe 1960, Osaka Math. J. 12, 305"
CLEAR = 1e-6
SAME_PERIOD = 1e-10


def with_time(context: Context, item: EquilibriumStability, frozen: float | None) -> EquilibriumStability:
    """The analysis of an equilibrium, its verdict replaced where time or clocks take part in it."""
    linear = item.linearisation
    slides = "0" in item.equilibrium.mode and isinstance(item.equilibrium, EquilibriumPoint)
    moves = frozen is None and (_has_time(linear) if linear is not None else _moves(item) and slides)
    if frozen is not None and depends_on_time(context.system):
        text = f"frozen at t = {frozen:g}: of the system as it moves with time this says nothing"
        return replace(item, statements=(*item.statements, Statement(text, FROZEN)))
    if not moves and not resetting(context.system):
        return item
    answer: Answer = "undecided"
    source = FLOQUET
    if slides and isinstance(item.equilibrium, EquilibriumPoint):
        parts = periodic_sliding(context, item.equilibrium)
        if isinstance(parts, str):
            why = "the linear part depends on time" if moves else "a clock resets the state"
            text = f"{why}, which is not decided on a surface: {parts}"
        else:
            moves = moves or parts.matrix.has(time) or parts.onto.has(time)
            mode, x = item.equilibrium.mode, item.equilibrium.x
            answer, text = _floquet(context, mode, parts.matrix, x, moves, parts)
            source = f"{FLOQUET}; Filippov 1988"
    elif linear is None or linear.smooth is None or item.equilibrium.dimension:
        why = "the linear part depends on time" if moves else "a clock resets the state"
        text = f"{why}, which is not decided on a surface or along a set"
    else:
        answer, text = _floquet(context, item.equilibrium.mode, linear.smooth, item.equilibrium.x, moves)
    return replace(
        item, polynomial=None, routh=None, solved=None, answer=answer, interior=answer,
        statements=(Statement(text, source),),
    )  # fmt: skip


def _has_time(linear: Linearisation) -> bool:
    parts = [linear.smooth]
    if linear.sliding is not None:
        parts += [linear.sliding.matrix, linear.sliding.normal]
    for side in linear.slip:
        parts += [side.matrix, sympy.Matrix([list(side.jump)])]
    return any(part is not None and part.has(time) for part in parts)


def _moves(item: EquilibriumStability) -> bool:
    """Whether multipliers of a point move with time."""
    found = item.equilibrium
    return isinstance(found, EquilibriumPoint) and any(e.has(time) for _, e in found.multipliers)


def _floquet(
    context: Context, mode: str, matrix: sympy.Matrix, x: tuple[sympy.Expr, ...], moves: bool,
    sliding: PeriodicSliding | None = None,
) -> tuple[Answer, str]:  # fmt: skip
    values = np.array([float(context.values[q]) for q in context.form.p])
    clocks = phases(context.system, values) if resetting(context.system) else Phases(0.0, ())
    if clocks is None:
        return "undecided", "the periods of the clocks have no common multiple that is short"
    period = clocks.period
    if moves:
        found = forcing_period(context.system)
        if found is None:
            text = "the linear part depends on time, with no period that is seen"
            return "undecided", f"{text}; its eigenvalues at an instant decide nothing"
        forced = context.number(found)
        turns = period / forced if period else 1.0
        if turns < 0.5 or abs(turns - round(turns)) > SAME_PERIOD * turns:
            return "undecided", "the period of the clocks is no multiple of that of the field"
        period = period or forced
    onto = None if sliding is None else sliding.onto
    monodromy = _monodromy(context, mode, matrix, x, Phases(period, clocks.instants), onto)
    if monodromy is None:
        return "undecided", "a reset has no derivative at the equilibrium, or changes with time"
    multipliers = linalg.eigvals(monodromy)
    largest = float(np.max(np.abs(multipliers)))
    head = f"the multipliers over the period {period:.6g} have moduli up to {largest:.6g}"
    if sliding is not None:
        met = "the surface attracts" if sliding.surfaces == 1 else f"the {sliding.surfaces} surfaces attract"
        head = f"{met} at all times, |h| falls at {sliding.approach:.6g} at least; {head}"
    if largest < 1.0 - CLEAR:
        return "asymptotically stable", f"{head} < 1"
    if largest > 1.0 + CLEAR:
        return "unstable", f"{head} > 1"
    return "undecided", f"{head}: the linear part does not decide"


def _monodromy(
    context: Context, mode: str, matrix: sympy.Matrix, x: tuple[sympy.Expr, ...], clocks: Phases,
    onto: sympy.Matrix | None,
) -> Array | None:  # fmt: skip
    """The product of flows and resets over one period, from just after the phase 0.

    onto   where the state is brought before it flows on
    """
    from scipy.integrate import solve_ivp

    form, n = context.form, matrix.rows
    put = dict(zip(form.x, x, strict=True))
    field = sympy.lambdify(time, matrix.subs(context.values), "numpy")
    slopes: dict[int, Array] = {}
    for k in {k for _, k in clocks.instants}:
        slope = sympy.Matrix(after(context.system, k, mode)).jacobian(form.x).subs(put)
        slopes[k] = context.numbers(slope)
        if slope.has(time) or not np.all(np.isfinite(slopes[k])):
            return None

    def rate(t: float, y: Array) -> Array:
        return (np.array(field(t), dtype=float).reshape(n, n) @ y.reshape(n, n)).ravel()

    back = None if onto is None else sympy.lambdify(time, onto.subs(context.values), "numpy")

    def brought(product: Array, t: float) -> Array:
        return product if back is None else np.array(back(t), dtype=float).reshape(n, n) @ product

    product, now = brought(np.eye(n), 0.0), 0.0
    # Instants at phase 0 come at the end of the period that they close.
    order = sorted((phase or clocks.period, k) for phase, k in clocks.instants)
    for phase, k in [*order, (clocks.period, -1)]:
        if phase > now:
            product = brought(product, now)
            found = solve_ivp(rate, (now, phase), product.ravel(), method="DOP853", rtol=1e-11, atol=1e-13)
            if not found.success:
                return None
            product, now = found.y[:, -1].reshape(n, n), phase
        if k >= 0:
            product = slopes[k] @ product
    return brought(product, clocks.period)
