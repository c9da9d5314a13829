"""Solutions that leave an equilibrium along an eigenvector inside one mode, whatever the field is elsewhere.

An equilibrium on the border of a mode, at h = 0 of one of its surfaces or with a multiplier at an end of
its set, is unstable where an eigenvector v to an eigenvalue > 0 of the mode's own linear part points into
the mode: there is a solution in it that leaves along v. An unstable eigenvalue alone decides nothing, since
other solutions may leave the mode and be brought back. Source: Hartman 1964, Ordinary Differential Equations.
"""

from __future__ import annotations

import numpy as np
import sympy

from filippov.analysis.algebra import linalg
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.steady.edges import side
from filippov.analysis.steady.equilibrium import EquilibriumPoint
from filippov.base.arrays import Array

SOURCE = "Hartman 1964, Ordinary Differential Equations"
TEXT = "a solution leads straight away from it inside its mode"
ON, CLEAR = 1e-9, 1e-9


def leads_away(context: Context, point: EquilibriumPoint) -> bool:
    """Whether such a solution leaves in the mode of the point, or in one into which it stops sliding."""
    modes = {point.mode}
    for k, i in enumerate(_sliding(point.mode)):
        side = end_of_set(context, point, i, point.s_value[k])
        modes |= {m[:i] + "-+"[side > 0] + m[i + 1 :] for m in modes} if side else set()
    return any(_in_mode(context, mode, point) for mode in sorted(modes))


def _in_mode(context: Context, mode: str, point: EquilibriumPoint) -> bool:
    form, on = context.form, _sliding(mode)
    sliding = [form.s[i] for i in _sliding(point.mode)]
    held = dict(zip(sliding, (e for _, e in point.multipliers), strict=True))
    place = {**dict(zip(form.x, point.x, strict=True)), **held}

    def at(part: sympy.Matrix) -> Array:
        return context.numbers(part.subs(context.put).subs(place))

    def row(gradient: Array) -> Array:
        length = float(np.linalg.norm(gradient))
        # What does not change to first order leads to neither side.
        return np.asarray(gradient / length if length > ON else 0.0 * gradient)

    field, signs = sympy.Matrix(form.at_mode(mode)), form.signs(mode)
    h = [side(e.subs(context.put), place, context.values) for e in form.h_at_mode(mode)]
    slopes = at(form.gradients(mode))
    A, G = at(form.jacobian(mode)), at(field.jacobian([form.s[i] for i in on]) if on else sympy.zeros(0, 0))
    if None in h or not all(np.all(np.isfinite(part)) for part in (slopes, A, G)):
        return False
    if not np.max(np.abs(at(field))) <= ON:
        return False
    inwards = [m * row(slopes[i]) for i, m in enumerate(signs) if m and h[i] == 0]
    if on:
        normal = slopes[on] @ G
        if abs(np.linalg.det(normal)) < ON:
            return False
        of_s = -linalg.solve(normal, slopes[on] @ A)
        A = A + G @ of_s
        held_at = [context.number(place[form.s[i]].subs(context.put)) for i in on]
        sides = [end_of_set(context, point, i, s) for i, s in zip(on, held_at, strict=True)]
        if None in sides:
            return False
        inwards += [-side * row(of_s[k]) for k, side in enumerate(sides) if side]
    values, vectors = linalg.eig(A)
    size = max(1.0, float(np.max(np.abs(values))))
    for value, vector in zip(values, vectors.T, strict=True):
        if abs(value.imag) <= CLEAR * size < value.real:
            where = np.array(inwards) @ vector.real
            if np.all(where > CLEAR) or np.all(where < -CLEAR):
                return True
    return False


def _sliding(mode: str) -> list[int]:
    return [i for i, m in enumerate(mode) if m == "0"]


def at_bound(context: Context, point: EquilibriumPoint) -> bool:
    """Whether a multiplier of the point is at an end of its set."""
    held = zip(_sliding(point.mode), point.s_value, strict=True)
    return any(end_of_set(context, point, i, s) != 0 for i, s in held)


def end_of_set(context: Context, point: EquilibriumPoint, i: int, s: float) -> int | None:
    """The end of its set, 1 or -1, at which a multiplier is; 0 inside, None where that end moves with x."""
    form = context.form
    ends = [e.xreplace(form.sizes_at_mode(point.mode)).subs(context.put) for e in form.radius[i]]
    put = dict(zip(form.x, point.x, strict=True))
    low, high = (context.number(e.subs(put)) for e in ends)
    reached = 1 if s >= high - ON else -1 if s <= low + ON else 0
    return None if reached and any(e.has(*form.x) for e in ends) else reached
