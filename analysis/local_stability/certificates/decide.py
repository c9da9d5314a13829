"""The certificates in the order in which they are tried, where the linear part does not decide."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

from filippov.analysis.local_stability.certificates.absolute import absolute
from filippov.analysis.local_stability.certificates.centre import centre
from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.clocked import clocked
from filippov.analysis.local_stability.certificates.cones import cones
from filippov.analysis.local_stability.certificates.energy import energy
from filippov.analysis.local_stability.certificates.even_terms import even_terms
from filippov.analysis.local_stability.certificates.feedbacks import feedbacks
from filippov.analysis.local_stability.certificates.half_returns import half_returns
from filippov.analysis.local_stability.certificates.held_sets import held_sets
from filippov.analysis.local_stability.certificates.impacts import locally
from filippov.analysis.local_stability.certificates.line import line
from filippov.analysis.local_stability.certificates.local import Local, local
from filippov.analysis.local_stability.certificates.masses import masses
from filippov.analysis.local_stability.certificates.matrix_inequality import INSTALL, available
from filippov.analysis.local_stability.certificates.planar import planar
from filippov.analysis.local_stability.certificates.quadratic import linear_cones, quadratic
from filippov.analysis.local_stability.certificates.relay_order import relay_order
from filippov.analysis.local_stability.certificates.relays import relays
from filippov.analysis.local_stability.certificates.resets import resets
from filippov.analysis.local_stability.certificates.stopping import stopping
from filippov.analysis.local_stability.certificates.timed import timed
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.local_stability.stability_result import EquilibriumStability, Statement
from filippov.analysis.steady.equilibrium import EquilibriumPoint
from filippov.analysis.steady.forcing import depends_on_time

POINTS: Sequence[Callable[[Local], Certificate | None]] = (
    line, planar, half_returns, energy, even_terms, centre, relay_order, relays, cones, quadratic, resets,
)  # fmt: skip


def decided(
    context: Context, without_time: EquilibriumStability, item: EquilibriumStability
) -> EquilibriumStability:
    """The analysis of an equilibrium with the verdict of the first certificate that has one.

    without_time  the analysis that leaves clocks and the solution of the field with time aside
    """
    if item.answer != "undecided":
        return item
    context.clock.check()
    found = first(context, without_time)
    if found is None:
        return _unasked(context, item)
    return replace(item, answer=found.answer, statements=(*found.statements(), *item.statements))


def _unasked(context: Context, item: EquilibriumStability) -> EquilibriumStability:
    """The analysis with a note where only the solver of matrix inequalities is missing."""
    if available() or not isinstance(item.equilibrium, EquilibriumPoint) or context.system.time_events:
        return item
    beside = None if depends_on_time(context.system) else local(context, item.equilibrium)
    if beside is None or (linear_cones(beside) is None and not beside.resets):
        return item
    text = f"not asked for quadratic Lyapunov functions: that needs cvxpy and Clarabel, {INSTALL}"
    return replace(item, statements=(*item.statements, Statement(text)))


def first(context: Context, item: EquilibriumStability, *, wide: bool = False) -> Certificate | None:
    """The first certificate for an equilibrium, or None.

    wide   try what holds for all solutions before what holds near the equilibrium, even at a higher cost
    """
    system, found = context.system, item.equilibrium
    if depends_on_time(system):
        return timed(context, found) if isinstance(found, EquilibriumPoint) else None
    if any(e.reset is not None for e in system.time_events):
        return clocked(context, item)
    beside = local(context, found) if isinstance(found, EquilibriumPoint) else None
    near = [] if beside is None else [partial(ask, beside) for ask in POINTS]
    # Those made from the field alone, where resets leave something of them.
    fields = [partial(whole, context, found) for whole in (stopping, absolute, feedbacks, held_sets)]
    fields = [partial(locally, context, found, ask) for ask in fields]
    cheap, costly = [partial(masses, context, found), *fields[:2]], fields[2:]
    for ask in (*cheap, *costly, *near) if wide else (*cheap, *near, *costly):
        certificate = ask()
        if certificate is not None:
            return certificate
        context.clock.check()
    return None
