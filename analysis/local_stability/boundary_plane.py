"""Equilibria of one side of a surface in the plane that lie on the surface, the other field leading onto it.

Beside the point the surface attracts on one half line, along which solutions slide, and is crossed on the
other into the side S where the field f vanishes. Where f turns, every solution in S meets the sliding half
line within half a turn, no farther away than a constant times where it began; where both eigenvalues of f
are real and negative, it comes to the point or does the same. So the point attracts if the sliding field
does, whatever the growth of the turns. Source: Filippov 1988, section 19; Hogan, Homer, Jeffrey & Szalai
2016.
"""

from __future__ import annotations

import numpy as np
import sympy

from filippov.analysis.local_stability.kink_stability import surfaces_at
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.local_stability.straight_lines import end_of_set
from filippov.analysis.steady.equilibrium import EquilibriumPoint
from filippov.model.symbols import t as time

SOURCE = "Filippov 1988, section 19; Hogan, Homer, Jeffrey & Szalai 2016"
ZERO, CLEAR = 1e-9, 1e-9


def settles(context: Context, point: EquilibriumPoint) -> str | None:
    """Why solutions beside such a point come to the half line that slides, or to it; None where not known.

    The surface attracts at the point, and the sliding field along it (both are the caller's to check).
    """
    form, system = context.form, context.system
    on = [i for i, m in enumerate(point.mode) if m == "0"]
    if len(form.x) != 2 or len(on) != 1 or system.time_events or surfaces_at(context, point):
        return None
    (i,) = on
    surface, end = system.surfaces[i], end_of_set(context, point, i, point.s_value[0])
    if surface.kind != "switching" or surface.wide or surface.width or not end:
        return None
    place = dict(zip(form.x, point.x, strict=True))
    if any(j != i and context.vanishes(h.subs(context.put), place) for j, h in enumerate(form.h)):
        return None
    field = sympy.Matrix(form.at_mode(point.mode))
    affine = all(entry.diff(form.s[i], 2) == 0 for entry in field)
    if not affine or field.has(time, *form.a) or form.h[i].has(time, *form.a):
        return None
    mode = point.mode[:i] + "-+"[end > 0] + point.mode[i + 1 :]
    parts = (sympy.Matrix(form.at_mode(mode)), form.jacobian(mode), form.gradients(mode))
    still, linear, slopes = (context.numbers(part.subs(context.put).subs(place)) for part in parts)
    if not all(np.all(np.isfinite(part)) for part in (still, linear, slopes)) or np.max(np.abs(still)) > ZERO:
        return None
    normal = slopes[i]
    terms = linear * np.outer(normal, [-normal[1], normal[0]])
    trace, determinant = float(np.trace(linear)), float(np.linalg.det(linear))
    # Compared with their own terms, whatever the units of the states are.
    of_trace, products = np.abs(np.diag(linear)).sum(), np.abs(linear[0] * linear[1, ::-1]).sum()
    if not abs(terms.sum()) > CLEAR * np.abs(terms).sum():
        return None
    if trace**2 - 4 * determinant < -CLEAR * (of_trace**2 + products):
        return f"the field of mode {mode} turns solutions onto the half of the surface that slides"
    if trace < -CLEAR * of_trace and determinant > CLEAR * products:
        return f"the roots of mode {mode} are real and on the left: solutions come to it, or slide to it"
    return None
