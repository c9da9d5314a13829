"""What surfaces that reset the state leave of a certificate that was made from the field alone.

Where no such surface comes near the equilibria, solutions that start near enough meet none: the certificate
holds, near them. A reset that keeps the places q of masses and does not raise v.Mv/2 raises no energy around
any equilibrium; one that a contact holds with the load L on h >= 0 has the term L h besides, which resets on
h = 0 keep. Source: Leine & van de Wouw 2008, ch. 6 and 7.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import sympy
from sympy import Expr

from filippov.analysis.algebra.polynomial import exact
from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.stability_context import SMALL, Context
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet


def resetting(context: Context) -> list[int]:
    """The surfaces that reset the state."""
    return [i for i, s in enumerate(context.system.surfaces) if s.kind == "reset"]


def locally(
    context: Context, found: EquilibriumPoint | EquilibriumSet, ask: Callable[[], Certificate | None]
) -> Certificate | None:
    """What resets leave of a certificate made from the field alone: all, what it says nearby, or None.

    ask   makes it, where something would be left
    """
    walls = resetting(context)
    if any(meets(context, found, i) for i in walls):
        return None
    certificate = ask()
    if certificate is None or not walls:
        return certificate
    names = ", ".join(context.system.surfaces[i].name for i in walls)
    checked = (*certificate.checked, f"no state is reset near it: it is off {names}")
    return replace(certificate, reach="local", checked=checked)


def meets(context: Context, found: EquilibriumPoint | EquilibriumSet, i: int) -> bool:
    """Whether a surface comes arbitrarily near equilibria; True as well where that is not seen."""
    if found.mode[i] == "0":
        return True
    put = {**context.values, **context.put}
    h = sympy.expand(
        exact(context.form.h[i].xreplace(dict(zip(context.form.x, found.x, strict=True))).subs(put))
    )
    if isinstance(found, EquilibriumPoint):
        return not (h.is_number and abs(context.number(h)) > SMALL)
    slopes = [h.diff(c) for c in found.free]
    if any(not slope.is_number for slope in slopes):
        return True
    middle = h.subs(dict.fromkeys(found.free, 0))
    low = high = context.number(middle)
    for slope, (first, last) in zip(slopes, found.bounds, strict=True):
        c = context.number(slope)
        if c:
            low, high = low + min(c * first, c * last), high + max(c * first, c * last)
    return not (low > SMALL or high < -SMALL)


def keep_energy(context: Context, M: sympy.Matrix, q: Sequence[Expr], v: Sequence[Expr]) -> bool:
    """Whether no reset raises the energy of masses: each keeps q, and is linear in v with R' M R <= M."""
    form, put = context.form, {**context.values, **context.put}
    for i in resetting(context):
        after = [sympy.expand(exact(e.subs(put))) for e in form.reset[i] or ()]
        by_state = dict(zip(form.x, after, strict=True))
        if any(sympy.expand(by_state[e] - e) != 0 for e in q):
            return False
        R = sympy.Matrix([by_state[e] for e in v]).jacobian(v)
        rest = sympy.Matrix([by_state[e] for e in v]) - R * sympy.Matrix(v)
        if R.free_symbols or not rest.expand().is_zero_matrix:
            return False
        if not (M - R.T * M * R).is_positive_semidefinite:
            return False
    return True
