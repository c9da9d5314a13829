"""Stability of what lies in a sliding mode: attraction of the surfaces, then the sliding field on them."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

import sympy
from sympy import Expr, Symbol

from filippov.analysis.algebra.polynomial import Verdict
from filippov.analysis.local_stability import boundary_plane, departure, straight_lines
from filippov.analysis.local_stability.kink_stability import kink_stability, surfaces_at
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.local_stability.stability_result import Answer, EquilibriumStability, Statement
from filippov.analysis.steady.equilibrium import EquilibriumPoint
from filippov.analysis.steady.existence import at_rest
from filippov.analysis.steady.linearisation import SlidingLinearisation, characteristic_polynomial, linearise
from filippov.model.symbols import t as time

PSEUDO = "Filippov 1988"


def sliding_stability(context: Context, point: EquilibriumPoint) -> EquilibriumStability:
    """Stability of a pseudo-equilibrium: its surface attracts, and it is stable on it."""
    if any(e.has(*context.form.s) or e.free_symbols - set(context.values) for _, e in point.multipliers):
        moves = all(e.has(time) for _, e in point.multipliers)
        text = "its multipliers are not unique: the sliding field is not determined by first derivatives"
        text = "its multipliers move with time" if moves else text
        return EquilibriumStability(
            point, None, None, None, False, "undecided", (), "undecided", (Statement(text),)
        )
    linear = linearise(context.system, point, values=context.put, sides=[])
    sliding = linear.sliding
    assert sliding is not None
    statements, attracts = attraction(context, sliding, point.mode, point.x, {})
    if sliding.matrix is None:
        return EquilibriumStability(
            point, linear, None, None, False, "undecided", (), "undecided", tuple(statements)
        )
    k = sliding.normal.rows
    polynomial = characteristic_polynomial(sliding.matrix)[: -k or None]
    routh = context.routh(polynomial)
    answer: Answer = "undecided"
    verdict = context.verdict(polynomial)
    if attracts == "unstable":
        answer = "unstable"
    elif straight_lines.at_bound(context, point):
        text = "a multiplier is at its bound: the fields beside the surface decide as well"
        statements.append(Statement(text))
        if straight_lines.leads_away(context, point):
            answer = "unstable"
            statements.append(Statement(straight_lines.TEXT, straight_lines.SOURCE))
        elif verdict is Verdict.ASYMPTOTICALLY_STABLE and attracts == "stable":
            why = boundary_plane.settles(context, point)
            if why is not None:
                answer = "asymptotically stable"
                statements.append(Statement(why, boundary_plane.SOURCE))
    elif surfaces_at(context, point):
        # The roots are those of one side.
        answer, statement = kink_stability(context, point)
        statements.append(statement)
        answer = answer if attracts == "stable" or answer == "unstable" else "undecided"
    elif verdict is Verdict.UNSTABLE:
        answer = "unstable"
        statements.append(Statement("a root of the sliding field lies in the right half plane", PSEUDO))
    elif verdict is Verdict.ASYMPTOTICALLY_STABLE and attracts == "stable":
        answer = "asymptotically stable"
        text = "the surface is reached in finite time and all roots of the sliding field lie on the left"
        statements.append(
            Statement(text if len(polynomial) > 1 else "the surface is reached in finite time", PSEUDO)
        )
    elif attracts == "stable":
        answer, statement = _linear(context, point.mode, sliding)
        statements.append(statement)
    solved = context.solved(routh) if routh is not None else None
    return EquilibriumStability(
        point, linear, polynomial, routh, False, answer, (), answer, tuple(statements), solved
    )


def _linear(context: Context, mode: str, sliding: SlidingLinearisation) -> tuple[Answer, Statement]:
    """The verdict with roots on the axis where the sliding field is linear: whether solutions stay near."""
    form = context.form
    s = [q for q, m in zip(form.s, mode, strict=True) if m == "0"]
    parts = (form.jacobian(mode), sympy.Matrix(form.at_mode(mode)).jacobian(s), form.gradients(mode))
    affine = not any(part.has(*form.x, *form.s) for part in parts)
    bounded = None
    if affine and sliding.matrix is not None:
        basis = sliding.tangent
        bounded = context.bounded((basis.T * basis).inv() * basis.T * sliding.matrix * basis)
    if bounded is None:
        return "undecided", Statement("the linear part of the sliding field does not decide", PSEUDO)
    if bounded:
        text = "roots on the imaginary axis, with as many eigenvectors: solutions stay near"
    else:
        text = "a repeated root on the imaginary axis with too few eigenvectors: solutions grow like t"
    answer: Answer = "stable" if bounded else "unstable"
    return answer, Statement(f"the sliding field is linear, {text}", PSEUDO)


def attraction(
    context: Context,
    sliding: SlidingLinearisation,
    mode: str,
    x: Sequence[Expr],
    free: Mapping[Symbol, Expr],
) -> tuple[list[Statement], Answer]:
    """Whether the surfaces attract: "stable", "unstable" or "undecided", with the reasons."""
    context.clock.check()
    away = departure.departure(context, mode, x, free)
    if away:
        text = f"the field {away} leads away: solutions leave at once, however near they start"
        return [Statement(text, departure.SOURCE)], "unstable"
    if sliding.normal.shape == (1, 1):
        rate = sliding.normal[0, 0]
        normal = context.number(rate, free)
        head = f"d(dh/dt)/ds = {rate} = {normal:.6g}"
        at = departure.still(context, mode, x, free) if normal < 0 else ""
        if at:
            return [Statement(f"{head} < 0, but the field vanishes {at}", departure.SOURCE)], "undecided"
        if normal < 0:
            return [Statement(f"{head} < 0: the surface attracts from both sides", PSEUDO)], "stable"
        if normal > 0:
            text = f"{head} > 0: the surface repels, solutions leave it at once on either side"
            return [Statement(text, PSEUDO)], "unstable"
        return [Statement(f"{head}: attraction is not decided by first derivatives")], "undecided"
    if _nodal(context, mode, [sympy.S(e).xreplace(dict(free)) for e in x]):
        text = "every field beside the surfaces points towards all of them: their intersection attracts"
        return [Statement(text, PSEUDO)], "stable"
    if departure.diagonally_stable(context, mode, x, free):
        text = "a weighted sum of the distances from the surfaces falls to 0: their intersection attracts"
        return [Statement(text, "Kaszkurewicz & Bhaya 2000")], "stable"
    k = sliding.normal.rows
    text = f"{k} surfaces meet, not all fields point towards all of them: attraction is not decided"
    return [Statement(text, "the intersection may attract by spirals: Dieci & Lopez 2012")], "undecided"


def _largest(
    context: Context, mode: str, on: Sequence[int], place: Mapping[Symbol, Expr]
) -> list[float] | None:
    """The largest sigma_i dh_i/dt beside a point, where the rates are affine in the signs; else None.

    c_i + sum b_ij sigma_j times sigma_i is at most |c_i| + b_ii + the sum of the other |b_ij|.
    """
    form, s = context.form, [context.form.s[i] for i in on]
    if any(context.system.surfaces[i].kind != "switching" or form.h[i].has(*form.a) for i in on):
        return None
    out, rates = [], form.rates(mode)
    for i, own in zip(on, s, strict=True):
        rate = at_rest(sympy.S(rates[i]).subs(context.put).xreplace(place))
        if not rate.is_polynomial(*s) or (affine := sympy.Poly(rate, *s)).total_degree() > 1:
            return None
        terms = {m: context.number(c) for m, c in affine.terms()}
        (alone,) = sympy.Poly(own, *s).monoms()
        out.append(terms.pop(alone, 0.0) + sum(map(abs, terms.values())))
    return out


def _nodal(context: Context, mode: str, x: Sequence[Expr]) -> bool:
    """sigma_i dh_i/dt < 0 for all i, in each of the 2^k modes beside the point."""
    form = context.form
    signs = form.signs(mode)
    on = [i for i, m in enumerate(signs) if m == 0]
    place = dict(zip(form.x, x, strict=True))
    largest = _largest(context, mode, on, place)
    if largest is not None:
        return all(rate < -1e-12 for rate in largest)
    for choice in itertools.product((1, -1), repeat=len(on)):
        context.clock.check()
        beside = dict(zip(on, choice, strict=True))
        rates = form.rates([beside.get(i, m) for i, m in enumerate(signs)])
        for i in on:
            rate = context.number(at_rest(sympy.S(rates[i]).subs(context.put).subs(place)))
            if not beside[i] * rate < -1e-12:
                return False
    return True
