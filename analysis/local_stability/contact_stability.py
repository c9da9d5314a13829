"""Stability of a body at rest on a surface with impacts: pressed onto it, and stable on the surface.

With L = dh/dt, solutions beside the contact bounce: L' = -a with the acceleration a > 0 by which the surface
is pressed, L+ = -e L- at each impact. For 0 <= e < 1 the bounces end after a time of order |L|, after which
the linear part of the field on h = L = 0 decides. Source: Leine & van de Wouw 2008, Stability and Convergence
of Mechanical Systems with Unilateral Constraints; the bounces: Brogliato 2016.
"""

from __future__ import annotations

import numpy as np
import sympy

from filippov.analysis.algebra.polynomial import Verdict
from filippov.analysis.local_stability.kink_stability import surfaces_at
from filippov.analysis.local_stability.stability_context import SMALL, Context
from filippov.analysis.local_stability.stability_result import Answer, EquilibriumStability, Statement
from filippov.analysis.steady.clocks import branch_points
from filippov.analysis.steady.equilibrium import EquilibriumPoint
from filippov.analysis.steady.linearisation import Linearisation, characteristic_polynomial, linearise

SOURCE = "Leine & van de Wouw 2008"
BOUNCES = "Brogliato 2016"
# How far before an impact without speed the slope of a reset with a kink there is taken.
BESIDE = 1e-8


def in_contact(context: Context, mode: str) -> list[int]:
    """The surfaces with impacts on which a mode rests."""
    return [i for i, c in enumerate(context.form.contact) if c is not None and mode[i] == "0"]


def contact_stability(context: Context, point: EquilibriumPoint) -> EquilibriumStability:
    """Stability of a point in resting contact on one surface; undecided on several."""
    linear = linearise(context.system, point, values=context.put, sides=[])
    assert linear.sliding is not None
    on = in_contact(context, point.mode)
    kinked = surfaces_at(context, point) or any(_kinked(context, point, i) for i in on)
    if linear.sliding.matrix is None or point.mode.count("0") > 1 or kinked:
        text = "it rests on several surfaces at once: impacts on one move the others, which is not decided"
        if linear.sliding.matrix is None:
            text = "the field on the surface is not determined by first derivatives"
        elif kinked:
            text = "it rests on a surface and lies on a kink or another reset, whose sides differ"
        return _undecided(point, linear, text)
    (i,) = on
    contact = context.form.contact[i]
    assert contact is not None
    side = 1 if contact.side > 0 else -1
    # h and dh/dt are constant on the surface: two roots that are 0.
    polynomial = characteristic_polynomial(linear.sliding.matrix)[:-2]
    push = (1 - side * context.number(point.multipliers[0][1])) / 2
    e = _restitution(context, point, i)
    if not push > SMALL:
        return _undecided(point, linear, "it is not pressed onto the surface: higher terms decide")
    statements = [
        Statement(f"it is pressed onto the surface: s = {point.s_value[0]:.6g}, clear of its end {side}"),
        Statement(f"restitution at the surface: {e:.6g}"),
    ]
    verdict = context.verdict(polynomial)
    answer: Answer = "undecided"
    if e < -SMALL:
        answer = "unstable"
        statements.append(Statement("an impact passes the surface, and the field beyond leads away from it"))
    elif e > 1 + SMALL:
        answer = "unstable"
        statements.append(Statement("bounces grow from impact to impact", BOUNCES))
    elif verdict is Verdict.UNSTABLE:
        answer = "unstable"
        statements.append(Statement("a root of the field on the surface lies on the right", SOURCE))
    elif not e < 1 - SMALL:
        statements.append(Statement("bounces neither end nor grow in the first order: higher terms decide"))
    elif verdict is Verdict.ASYMPTOTICALLY_STABLE:
        answer = "asymptotically stable"
        after = "; all roots of the field on the surface lie on the left" if len(polynomial) > 1 else ""
        statements.append(Statement(f"bounces end in finite time{after}", SOURCE))
    elif _stays(context, point, linear.sliding.matrix):
        answer = "stable"
        text = "bounces end in finite time; the field on the surface is linear and its solutions stay near"
        statements.append(Statement(text, SOURCE))
    else:
        statements.append(Statement("the linear part of the field on the surface does not decide", SOURCE))
    routh = context.routh(polynomial)
    solved = context.solved(routh) if routh is not None else None
    return EquilibriumStability(
        point, linear, polynomial, routh, False, answer, (), answer, tuple(statements), solved
    )


def _stays(context: Context, point: EquilibriumPoint, matrix: sympy.Matrix) -> bool:
    """Whether the field is affine and its solutions on h = dh/dt = 0 stay bounded."""
    form = context.form
    (i,) = in_contact(context, point.mode)
    contact = form.contact[i]
    if contact is None or form.jacobian(point.mode).has(*form.x) or point.mode.count("0") != 1:
        return False
    rows = sympy.Matrix([form.h[i], contact.rate]).jacobian(form.x)
    if rows.has(*form.x) or rows.rank() < 2:
        return False
    along = rows.nullspace()
    if not along:
        return True
    basis = sympy.Matrix.hstack(*along)
    inner = (basis.T * basis).inv() * basis.T * matrix * basis
    return bool(context.bounded(inner))


def _undecided(point: EquilibriumPoint, linear: Linearisation, text: str) -> EquilibriumStability:
    return EquilibriumStability(
        point, linear, None, None, False, "undecided", (), "undecided", (Statement(text),)
    )


def _kinked(context: Context, point: EquilibriumPoint, i: int) -> bool:
    """Whether the reset has kinks that more than the speed of approach decides, as one with friction."""
    form, contact = context.form, context.form.contact[i]
    assert contact is not None
    put = dict(zip(form.x, point.x, strict=True))
    kinks = branch_points(form.reset[i] or (), put, context.values)
    slopes = context.numbers(sympy.Matrix([contact.rate, *kinks]).jacobian(form.x).subs(put))
    return not np.all(np.isfinite(slopes)) or np.linalg.matrix_rank(slopes) > 1


def _restitution(context: Context, point: EquilibriumPoint, i: int) -> float:
    """e = -dL+/dL- at the point, in the direction in which the surface pushes, seen before the impact."""
    form = context.form
    contact, reset = form.contact[i], form.reset[i]
    assert contact is not None
    assert reset is not None
    put = dict(zip(form.x, point.x, strict=True))
    rate, push = sympy.Matrix([contact.rate]).jacobian(form.x), sympy.Matrix(contact.direction)
    change = sympy.Matrix(reset).jacobian(form.x) * push
    raised = context.number((rate * push)[0].subs(context.put).subs(put))
    back = -BESIDE * (1 if contact.side > 0 else -1) * (1 if raised > 0 else -1)
    at_impact = {q: e + back * d.subs(put) for (q, e), d in zip(put.items(), push, strict=True)}
    at = at_impact if branch_points(reset, put, context.values) else put
    return -context.number((rate * change)[0].subs(context.put).subs(at))
