"""Stability of what lies in a smooth mode: the Jacobian, and what lies beyond the kinks that it touches."""

from __future__ import annotations

import sympy

from filippov.analysis.algebra.polynomial import Verdict
from filippov.analysis.local_stability.kink_stability import (
    end_stability,
    kink_stability,
    set_ends,
    surfaces_at,
)
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.local_stability.stability_result import Answer, EquilibriumStability, Statement
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet
from filippov.analysis.steady.linearisation import characteristic_polynomial, linearise

ANSWERS: dict[str, Answer] = {
    "asymptotically stable": "asymptotically stable",
    "marginally stable": "undecided",
    "unstable": "unstable",
}


def smooth_stability(context: Context, found: EquilibriumPoint | EquilibriumSet) -> EquilibriumStability:
    """Jacobian and Routh-Hurwitz of the mode; along a set, without the zero roots that belong to it."""
    linear = linearise(context.system, found, values=context.put)
    assert linear.smooth is not None
    polynomial, zeros = context.without_zeros(characteristic_polynomial(linear.smooth), found.dimension)
    statements = []
    free = {}
    if isinstance(found, EquilibriumSet):
        statements.append(Statement(f"the set has dimension {found.dimension}: as many roots are 0"))
        free = {q: sympy.Rational(str(c)) for q, c in zip(found.free, found.inner, strict=True)}
    interior: Answer = "undecided"
    hurwitz = context.verdict(polynomial, free)
    if zeros < found.dimension or hurwitz is None:
        statements.append(Statement("the linear part does not decide"))
    else:
        interior, statement = _interior(context, found, linear.smooth, hurwitz)
        statements.append(statement)
    answer, more = _beyond(context, found, interior)
    routh = context.routh(polynomial)
    solved = context.solved(routh) if routh is not None else None
    return EquilibriumStability(
        found, linear, polynomial, routh, False, interior, (), answer, (*statements, *more), solved
    )


def _interior(
    context: Context, found: EquilibriumPoint | EquilibriumSet, matrix: sympy.Matrix, hurwitz: Verdict
) -> tuple[Answer, Statement]:
    """What the roots of the mode's own linear part say."""
    answer = ANSWERS[hurwitz.value]
    method = "Lyapunov's first method"
    affine = not context.form.jacobian(found.mode).has(*context.form.x)
    if answer == "undecided" and not found.dimension and affine:
        bounded = context.bounded(matrix)
        if bounded is not None:
            answer, method = ("stable" if bounded else "unstable"), "the mode's field is linear"
    if answer == "stable":
        text = "roots on the imaginary axis, with as many eigenvectors: solutions stay near"
    elif answer == "unstable" and hurwitz is not Verdict.UNSTABLE:
        text = "a repeated root on the imaginary axis with too few eigenvectors: solutions grow like t"
    elif surfaces_at(context, found):
        where = "in the left half plane" if answer == "asymptotically stable" else "not all on the left"
        text = f"the roots of the linear part on this side lie {where}"
    elif answer == "undecided":
        text = "the linear part has roots on the imaginary axis, so higher terms decide"
    elif answer == "unstable":
        text = "the linear part is unstable, and so is the equilibrium"
    else:
        text = f"all roots lie in the left half plane: the equilibrium is {hurwitz.value}"
    return answer, Statement(text, method)


def _beyond(
    context: Context, found: EquilibriumPoint | EquilibriumSet, interior: Answer
) -> tuple[Answer, list[Statement]]:
    """The verdict with what lies on the other sides of the kinks that a point lies on, or a set ends at."""
    if surfaces_at(context, found):
        answer, statement = kink_stability(context, found)
        ended = isinstance(found, EquilibriumSet) and _bordered(context, found)
        if ended and answer == "asymptotically stable":
            return "undecided", [statement, Statement("what happens beyond its ends is not decided")]
        return answer, [statement]
    if isinstance(found, EquilibriumPoint):
        return interior, []
    if interior not in {"asymptotically stable", "stable"}:
        return interior, []
    if found.dimension > 1 and _bordered(context, found):
        return "undecided", [Statement("what happens beyond the borders of the set is not decided")]
    ends = set_ends(context, found)
    if not ends:
        return interior, []
    said = [end_stability(context, found, end) for end in ends]
    answers = {answer for answer, _ in said}
    statements = [statement for _, statement in said]
    if "unstable" in answers:
        return "unstable", statements
    return ("undecided" if "undecided" in answers else interior), statements


def _bordered(context: Context, found: EquilibriumSet) -> bool:
    """Whether a surface cuts a set off, or may where that is not told."""
    if found.dimension == 1:
        return bool(set_ends(context, found))
    put = dict(zip(context.form.x, found.x, strict=True))
    return any(h.subs(put).has(*found.free) for h in context.form.h_at_mode(found.mode))
