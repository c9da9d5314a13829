"""Sets of one mass: where friction outdoes all forces, and where a potential with a flat bottom keeps it.

q' = c v, v' = F, with a number c that is 1 in the units of v. If at v = 0 the field beside it points back for
every sign of the other surfaces, by a rate that does not depend on q, the mass stops after a time of order
|v|: every q at v = 0 is a stable equilibrium. If F does no work beside the potential and leads back beyond
the ends of the set, the energy is kept and v stays small.
Source: Filippov 1988.
"""

from __future__ import annotations

from typing import Any

import sympy
from sympy import Expr

from filippov.analysis.algebra.polynomial import exact
from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.homogeneous import EPSILON, lowest
from filippov.analysis.local_stability.certificates.local import local
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet

SOURCE = "Filippov 1988"


def stopping(context: Context, found: EquilibriumPoint | EquilibriumSet) -> Certificate | None:
    """The verdict on the line v = 0, or on a segment of it; None for other systems."""
    form = context.form
    if len(form.x) != 2 or not isinstance(found, EquilibriumSet) or context.system.time_events:
        return None
    values = {**context.values, **context.put}
    for i, j in ((0, 1), (1, 0)):
        c = _times(form.field[i], form.x[j], values)
        if c is not None:
            return _stops(context, i, j, values) or _kept(context, found, i, j, c)
    return None


def _times(e: Expr, v: Expr, values: dict[Any, Expr]) -> Expr | None:
    """The number c != 0 of e = c v, or None."""
    c = sympy.cancel(exact(e.subs(values)) / v)
    return c if c.is_number and c != 0 else None


def _stops(context: Context, i: int, j: int, values: dict[Any, Expr]) -> Certificate | None:
    form = context.form
    v = form.x[j]
    speeds = {k: c for k, h in enumerate(form.h) if (c := _times(h, v, values)) is not None}
    if len(speeds) != 1 or any(s.kind == "reset" or s.width for s in context.system.surfaces):
        return None
    ((k, turned),) = speeds.items()
    others = [m for m in range(len(form.h)) if m != k]
    if any(form.h[m].has(v) for m in others) or len(others) > 5:
        return None
    rates = []
    for number in range(2 ** len(others)):
        for way in (1, -1):
            mode = [0] * len(form.h)
            mode[k] = way if bool(turned > 0) else -way
            for place, m in enumerate(others):
                mode[m] = 1 if number >> place & 1 else -1
            rate = sympy.expand(way * exact(form.at_mode(mode)[j].subs(values)).subs(v, 0))
            if not rate.is_number or not bool(rate < 0):
                return None
            rates.append(rate)
    told = f"d|v|/dt <= {float(max(rates)):.6g} beside v = 0, for all other signs and every {form.x[i].name}"
    text = "friction outdoes all other forces: the mass stops in finite time and holds wherever it is"
    return Certificate("asymptotically stable", text, SOURCE, (told,))


def _kept(context: Context, found: EquilibriumSet, i: int, j: int, c: Expr) -> Certificate | None:
    form = context.form
    q, v = form.x[i], form.x[j]
    if "0" in found.mode or found.free != (q,) or len(found.ends) != 2:
        return None
    for end in found.ends:
        beside = local(context, end)
        if beside is None or set(beside.kinds) != {"kink"} or any(h.has(v) for h in beside.h):
            return None
        inside = 1 if end.value[i] == min(e.value[i] for e in found.ends) else -1
        for side in (1, -1):
            signs = []
            for h in beside.h:
                part = lowest(h.xreplace({q: side * EPSILON}))
                if part is None or part[1] == 0:
                    return None
                signs.append(1 if part[1] > 0 else -1)
            force = sympy.expand(c * beside.fields[tuple(signs)][j])
            if force.has(v):
                return None
            part = lowest(force.xreplace({q: side * EPSILON}))
            if part is None or (part[1] != 0 if side == inside else not side * part[1] < 0):
                return None
    text = "the energy is kept and its potential is least on the set"
    told = ("the force does not depend on the speed", "it leads back beyond both ends")
    return Certificate("stable", text, SOURCE, told)
