"""One set-valued feedback around a linear plant: the circle, Popov and Zames-Falb criteria.

    x' in A x + f - b psi(y),   y = c . x,   G(s) = c (s - A)^-1 b

Around an equilibrium let psi lie in the sector [k, K], that is be psi~ + k y with psi~ in [0, K - k], and G~
= G/(1 + k G) = N/D with D of degree n and no factor in common with N. If H = 1/(K - k) + (1 + a s) G~ is
positive real for one a >= 0 (a = 0: circle criterion, else Popov), there is P > 0 (positive real lemma) with

    V = z . P z + 2 a (integral of psi~),   V' <= -2 psi~ (y - psi~/(K - k)) < 0 for y != 0

along every solution of the inclusion: at almost all times on a jump of psi y' = 0. If psi(0) = {0}, nothing
but z = 0 stays on y = 0; if psi(0) is an interval, the solutions on it are those of the zeros of G, and come
to the equilibria if these lie on the left, but for one at 0 along a set. Where psi is continuous with slopes
in [k, K] and D is Hurwitz, a multiplier of Zames and Falb bounds z in L2, so that z -> 0.
Source: Khalil 2002; Yakubovich, Leonov, Gelig 2004, Stability of Stationary Sets
in Control Systems with Discontinuous Nonlinearities; Brogliato 2004, Systems Control Lett. 51,
343; Zames & Falb 1968, SIAM J. Control 6, 89.
"""

from __future__ import annotations

import sympy
from sympy import Poly, Rational

from filippov.analysis.local_stability.certificates.certificate import Certificate, Reach
from filippov.analysis.local_stability.certificates.characteristic import Characteristic
from filippov.analysis.local_stability.certificates.lure_form import LureForm, lure_form
from filippov.analysis.local_stability.certificates.positive_real import S, hurwitz, popov, zames_falb
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet

CIRCLE = "Khalil 2002 (circle criterion, positive real lemma)"
POPOV = "Khalil 2002 (Popov criterion, positive real lemma)"
JUMPS = "; with jumps Yakubovich, Leonov, Gelig 2004"
ZAMES = (
    "Zames & Falb 1968, SIAM J. Control 6, 89; Megretski & Rantzer 1997, IEEE Trans. Automat. Contr. 42, 819"
)


def absolute(context: Context, found: EquilibriumPoint | EquilibriumSet) -> Certificate | None:
    """The verdict on a point or a segment on one surface, for all solutions or for those near; or None."""
    if isinstance(found, EquilibriumSet) and (found.dimension > 1 or found.mode.count("0") != 1):
        return None
    form = lure_form(context)
    psi = None if form is None else form.around(context, found)
    if form is None or psi is None:
        return None
    near = psi.beside()
    return _decided(form, psi, found.dimension, "global") or (
        None if near is None or near == psi else _decided(form, near, found.dimension, "local")
    )


def _decided(form: LureForm, psi: Characteristic, dimension: int, reach: Reach) -> Certificate | None:
    n = form.A.rows
    below = Poly(form.A.charpoly(S).as_expr(), S, domain="QQ")
    above = Poly(sympy.expand((form.c * (S * sympy.eye(n) - form.A).adjugate() * form.b)[0]), S, domain="QQ")
    if above.is_zero or above.gcd(below).degree() > 0:
        return None
    sector = psi.sector()
    if sector is not None and _zeros(above, psi, dimension):
        found = _by_sector(above, below, sector, psi, dimension, reach)
        if found is not None:
            return found
    slopes = psi.slopes()
    if slopes is None or slopes[0] == slopes[1] or dimension:
        return None
    low, high = slopes
    multiplier = zames_falb(above, below + low * above, high - low, psi.odd)
    if multiplier is None:
        return None
    kind = "odd, " if psi.odd else ""
    return Certificate(
        "asymptotically stable", "a multiplier of Zames and Falb: all deviations are bounded in L2 and fade",
        ZAMES,
        (
            f"the field is linear but for one function of one input: {kind}slopes from {low} to {high}",
            f"A - ({low}) b c is Hurwitz (in exact numbers)",
            f"Re M (1/{high - low} + G) > 0 for all w, M = {multiplier} (Sturm's count)",
        ),
        reach,
    )  # fmt: skip


def _zeros(above: Poly, psi: Characteristic, dimension: int) -> bool:
    """Whether solutions on y = 0 come to the equilibria."""
    if psi.at_zero == (0, 0):
        return dimension == 0
    at_zero = 0
    while above.eval(0) == 0:
        above, at_zero = above.quo(Poly(S, S)), at_zero + 1
    return at_zero <= 1 and at_zero == dimension and hurwitz(above)


def _by_sector(
    above: Poly, below: Poly, sector: tuple[Rational, Rational | None], psi: Characteristic, dimension: int,
    reach: Reach,
) -> Certificate | None:  # fmt: skip
    low, high = sector
    width = None if high is None else high - low
    if width is not None and width <= 0:
        return None
    loops = [
        (above, below + low * above, f"sector [{_number(low)}, {'oo' if high is None else _number(high)}]")
    ]
    if high is not None:
        # The same feedback seen from its upper bound: K y - psi, which turns the sign of a.
        loops.append((-above, below + high * above, f"K y - psi for the {loops[0][2]}"))
    for p, q, told in loops:
        a = popov(p, q, width)
        if a is None:
            continue
        jumps = bool(psi.jumps)
        share = "" if width is None else f"1/({_number(width)}) + "
        factor = "" if a == 0 else f"(1 + {a} s) "
        checked = [
            f"the field is linear but for one function of one input: {told}, at no other place on its bounds",
            f"H = {share}{factor}G is positive real and minimal (in exact numbers, Sturm's count)",
        ]
        if psi.at_zero != (0, 0):
            checked.append(
                "the zeros of G lie on the left" + (", but for one at 0 along the set" if dimension else "")
            )
        name = "circle criterion" if a == 0 else "Popov criterion"
        where = "all solutions come" if reach == "global" else "solutions beside it come"
        text = f"{name}: {where} to the {'equilibria' if dimension else 'equilibrium'}"
        return Certificate(
            "asymptotically stable", text, (CIRCLE if a == 0 else POPOV) + (JUMPS if jumps else ""),
            tuple(checked), reach,
        )  # fmt: skip
    return None


def _number(value: Rational) -> str:
    return str(value) if value.q < 10**5 else f"{float(value):.7g}"
