"""Equilibria of systems that depend on time or are reset by a clock: Floquet's theorem.

Near an equilibrium that is constant in time, y' = A(t) y between the clocks and y+ = R y at them. With both
of period T the product M of the flows and the R decides: all eigenvalues of M inside the unit circle, or one
outside. The eigenvalues of A at an instant decide nothing (Markus & Yamabe 1960, Osaka Math. J. 12, 305).
Source: Hale 1980, Ordinary Differential Equations; with resets Bainov & Simeonov 1993.
"""

from __future__ import annotations

from dataclasses import replace

import sympy

from filippov.analysis.local_stability.floquet import common_period, floquet
from filippov.analysis.local_stability.kink_stability import surfaces_at
from filippov.analysis.local_stability.periodic_kinks import on_kinks, on_line
from filippov.analysis.local_stability.periodic_sliding import periodic_sliding
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.local_stability.stability_result import Answer, EquilibriumStability, Statement
from filippov.analysis.steady.clocks import after, branch_points, resetting
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet
from filippov.analysis.steady.forcing import depends_on_time
from filippov.analysis.steady.linearisation import Linearisation
from filippov.model.symbols import t as time

FLOQUET = "Floquet's theorem, Hale 1980"
FROZEN = "Markus & Yamabe 1960, Osaka Math. J. 12, 305"


def with_time(context: Context, item: EquilibriumStability, frozen: float | None) -> EquilibriumStability:
    """The analysis of an equilibrium, its verdict replaced where time or clocks take part in it."""
    linear = item.linearisation
    slides = "0" in item.equilibrium.mode and isinstance(item.equilibrium, EquilibriumPoint)
    moves = frozen is None and (_has_time(linear) if linear is not None else _moves(item) and slides)
    if frozen is not None and depends_on_time(context.system):
        text = f"frozen at t = {frozen:g}: of the system as it moves with time this says nothing"
        return replace(item, statements=(*item.statements, Statement(text, FROZEN)))
    kinked = surfaces_at(context, item.equilibrium)
    moves = moves or (bool(kinked) and frozen is None and depends_on_time(context.system))
    if not moves and not resetting(context.system):
        return item
    answer: Answer = "undecided"
    source = FLOQUET
    if kinked:
        answer, text = on_kinks(context, item.equilibrium, kinked, moves)
    elif slides and isinstance(item.equilibrium, EquilibriumPoint):
        parts = periodic_sliding(context, item.equilibrium)
        if isinstance(parts, str):
            why = "the linear part depends on time" if moves else "a clock resets the state"
            text = f"{why}, which is not decided on a surface: {parts}"
        else:
            moves = moves or parts.matrix.has(time) or parts.onto.has(time)
            mode, x = item.equilibrium.mode, item.equilibrium.x
            answer, text = floquet(context, mode, parts.matrix, x, moves, parts)
            source = f"{FLOQUET}; Filippov 1988"
    elif linear is None or linear.smooth is None or item.equilibrium.dimension:
        why = "the linear part depends on time" if moves else "a clock resets the state"
        text = f"{why}, which is not decided on a surface or along a set"
    else:
        answer, text = _smooth(context, item.equilibrium, linear.smooth, moves)
    return replace(
        item, polynomial=None, routh=None, solved=None, answer=answer, interior=answer,
        statements=(Statement(text, source),),
    )  # fmt: skip


def _smooth(
    context: Context, found: EquilibriumPoint | EquilibriumSet, matrix: sympy.Matrix, moves: bool
) -> tuple[Answer, str]:
    """The verdict in a smooth mode; one state may lie where a reset changes its branch."""
    put = dict(zip(context.form.x, found.x, strict=True))
    rows = [after(context.system, k, found.mode) for k in resetting(context.system)]
    if len(put) == 1 and any(branch_points(row, put, context.values) for row in rows):
        clocks = common_period(context, moves)
        if isinstance(found, EquilibriumPoint) and not isinstance(clocks, str):
            return on_line(context, found, [], clocks)
    return floquet(context, found.mode, matrix, found.x, moves)


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
