"""Equilibria that a clock resets: where they are reached before it, or where it takes energy away.

Without the clock, a point reached in a time of order |x| is at rest before the next reset if the solution
starts near enough, and a reset with a derivative carries near states to near ones. For masses with dry
friction a reset that multiplies speeds by factors of modulus at most 1 does not raise the energy around
any equilibrium.
Source: Goebel, Sanfelice, Teel 2012, Hybrid Dynamical Systems.
"""

from __future__ import annotations

from dataclasses import replace

import sympy

from filippov.analysis.algebra.polynomial import exact
from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.masses import masses
from filippov.analysis.local_stability.sliding_stability import attraction
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.local_stability.stability_result import EquilibriumStability
from filippov.analysis.steady.clocks import after
from filippov.analysis.steady.equilibrium import EquilibriumPoint

SOURCE = "Goebel, Sanfelice, Teel 2012"


def clocked(context: Context, item: EquilibriumStability) -> Certificate | None:
    """The verdict with clocks on what is decided without them; None where they may spoil it."""
    resets = [k for k, e in enumerate(context.system.time_events) if e.reset is not None]
    form, found = context.form, item.equilibrium
    values = {**context.values, **context.put}
    rows = [[exact(e.subs(values)) for e in after(context.system, k, found.mode)] for k in resets]
    n = len(form.x)
    linear = item.linearisation
    if (
        isinstance(found, EquilibriumPoint)
        and found.mode.count("0") == n
        and linear is not None
        and linear.sliding is not None
        and found.kind != "boundary equilibrium"
    ):
        place = dict(zip(form.x, (exact(sympy.S(e).subs(values)) for e in found.x), strict=True))
        _, attracts = attraction(context, linear.sliding, found.mode, found.x, {})
        # A reset that depends on signs is another one on every side.
        plain = all(not e.has(*form.s, *form.a) for k in resets for e in form.time_reset[k] or ())
        slopes = [sympy.Matrix(row).jacobian(form.x).subs(place) for row in rows]
        if attracts == "stable" and plain and all(not s.has(sympy.nan, sympy.zoo) for s in slopes):
            text = "it is reached in finite time, before the next reset of a clock from near enough"
            return Certificate(
                "asymptotically stable", text, SOURCE,
                (f"{n} surfaces fix all states and attract", "resets keep the point and have derivatives"),
            )  # fmt: skip
    without = masses(context, found)
    if without is None or without.answer == "unstable":
        return None
    fields = [sympy.expand(exact(f.subs(values))) for f in form.field]
    speeds = {form.x.index(f) for f in fields if f in form.x}
    for row in rows:
        for j, (x, e) in enumerate(zip(form.x, row, strict=True)):
            factor = sympy.expand(e).coeff(x)
            kept = sympy.expand(e - factor * x) == 0 and factor.is_number
            if not kept or not (bool(abs(factor) <= 1) if j in speeds else factor == 1):
                return None
    if without.answer == "stable":
        return None
    told = (*without.checked, "every clock multiplies speeds by factors of modulus at most 1, positions stay")
    return replace(without, checked=told)
