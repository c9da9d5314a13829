"""Solutions that leave points of equilibria on surfaces with a speed, whatever the sliding field is.

The rates beside the point are those of `filippov.analysis.algebra.attraction`; where one surface is slid on
they need not be affine in its sign: the fields of both sides count.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import sympy
from sympy import Expr, Symbol

from filippov.analysis.algebra import linalg
from filippov.analysis.algebra.attraction import CLEAR, MOST, attraction, leaving
from filippov.analysis.local_stability.set_parts import spots
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.local_stability.stability_result import Statement
from filippov.analysis.steady.equilibrium import EquilibriumSet
from filippov.analysis.steady.existence import at_rest
from filippov.base.arrays import Array

SOURCE = "Leine & Nijmeijer 2004"


def departure(context: Context, mode: str, x: Sequence[Expr], free: Mapping[Symbol, Expr]) -> str:
    """The sides on which solutions leave a point in a sliding mode, in words; "" where none is known.

    free    values of the symbols that are free in x, of a set of equilibria
    """
    found = _rates(context, mode, x, free) if mode.count("0") <= MOST else None
    way = None if found is None else leaving(*found)
    if way is None:
        return ""
    signs = iter(way)
    beside = "".join(mode_sign if mode_sign != "0" else "0+-"[next(signs)] for mode_sign in mode)
    return f"of mode {beside}"


def diagonally_stable(context: Context, mode: str, x: Sequence[Expr], free: Mapping[Symbol, Expr]) -> bool:
    """Whether all solutions nearby come to several surfaces, by a weighted sum of their distances."""
    found = _rates(context, mode, x, free)
    if found is None or not all(np.all(np.isfinite(part)) for part in found[:2]):
        return False
    c, G, bounds = found
    if not abs(np.linalg.det(G)) > CLEAR * np.prod(np.linalg.norm(G, axis=1)):
        return False
    return attraction(c, G, -linalg.solve(G, c), bounds) == "stable"


def still(context: Context, mode: str, x: Sequence[Expr], free: Mapping[Symbol, Expr]) -> str:
    """The side of a surface wider than [-1, 1] on which the field leads neither to it nor away, or "".

    Its multiplier is then 1 or -1, inside the set: the field of that side decides as well.
    """
    found = _rates(context, mode, x, free)
    if found is None or len(found[0]) > 1:
        return ""
    (c,), ((g,),), _ = found
    at = [sigma for sigma in (1, -1) if abs(c + g * sigma) <= CLEAR * (abs(c) + abs(g))]
    return f"of mode {mode.replace('0', '+' if at[0] > 0 else '-')}" if at else ""


def left_from(context: Context, found: EquilibriumSet) -> Statement | None:
    """That solutions leave some points of a set with a speed, if they do."""
    if all(ends == (-1, 1) for ends in context.form.radius):
        return None
    away = (departure(context, found.mode, found.x, at) for at in spots(context, found))
    text = next(filter(None, away), "")
    return Statement(f"at some of its points the field {text} leads away", SOURCE) if text else None


def _rates(
    context: Context, mode: str, x: Sequence[Expr], free: Mapping[Symbol, Expr]
) -> tuple[Array, Array, Array] | None:
    """c, G and bounds of dh/dt = c + G s; None where the rates have no such form, and of one surface whose
    set is no wider than [-1, 1]: there G decides."""
    form, surfaces = context.form, context.system.surfaces
    on = [i for i, m in enumerate(form.signs(mode)) if m == 0]
    if (len(on) == 1 and form.radius[on[0]] == (-1, 1)) or any(
        surfaces[i].kind != "switching" or surfaces[i].reset is not None or surfaces[i].width for i in on
    ):
        return None
    put = {q: sympy.S(e).xreplace(dict(free)) for q, e in zip(form.x, x, strict=True)}

    sizes, all_rates = form.sizes_at_mode(mode), form.rates(mode)

    def at(expression: Expr) -> Expr:
        return at_rest(sympy.S(expression).xreplace(sizes).subs(context.put).subs(put))

    s, rates = [form.s[i] for i in on], [at(all_rates[i]) for i in on]
    if len(on) == 1:
        above, below = (context.number(rates[0].subs(s[0], sympy.Integer(sigma))) for sigma in (1, -1))
        rows = np.array([[0.5 * (above - below), 0.5 * (above + below)]])
    elif all(e.is_polynomial(*s) and sympy.Poly(e, *s).total_degree() <= 1 for e in rates):
        table = [sympy.Poly(e, *s) for e in rates]
        rows = np.array([[context.number(p.coeff_monomial(q)) for q in (*s, 1)] for p in table])
    else:
        return None
    ends = [[float(e) if e.is_infinite else context.number(e) for e in map(at, form.radius[i])] for i in on]
    return rows[:, -1], rows[:, :-1], np.array(ends)
