"""Stability of a body at rest on a surface with impacts: pressed onto it, and stable on the surface.

With L = dh/dt, solutions beside the contact bounce: L' = -a with the acceleration a > 0 by which the surface
is pressed, L+ = -e L- at each impact. For 0 <= e < 1 the bounces end after a time of order |L|, after which
the linear part of the field on h = L = 0 decides. What an impact does beside L, it does infinitely often in
that time: with w+ = M w + O(|L|) on the surface, w comes to lim M^k w + O(|L|), for the impacts' L and the
times between them fall like e^k. Where M is no identity it must have that limit; one eigenvalue outside the
unit circle leads away, as does a repeated 1 with too few eigenvectors. Source: Leine & van de Wouw 2008,
Stability and Convergence of Mechanical Systems with Unilateral Constraints; the bounces: Brogliato 2016; the
impacts as a map: Goebel, Sanfelice, Teel 2012.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import sympy
from sympy import Expr, Symbol

from filippov.analysis.algebra import linalg
from filippov.analysis.algebra.polynomial import Verdict
from filippov.analysis.local_stability.kink_stability import surfaces_at
from filippov.analysis.local_stability.stability_context import SMALL, Context
from filippov.analysis.local_stability.stability_result import Answer, EquilibriumStability, Statement
from filippov.analysis.steady.clocks import branch_points
from filippov.analysis.steady.equilibrium import EquilibriumPoint
from filippov.analysis.steady.linearisation import Linearisation, characteristic_polynomial, linearise
from filippov.base.arrays import Array
from filippov.model.symbols import t as time

SOURCE = "Leine & van de Wouw 2008"
BOUNCES = "Brogliato 2016"
REPEATED = "Goebel, Sanfelice, Teel 2012"
# How far before an impact without speed the slope of a reset with a kink there is taken.
BESIDE = 1e-8
# Of an eigenvalue of M; where impacts are tried, how often, and what is 0 there.
CLEAR, TRIED, TRIALS, ROUNDED = 1e-7, 0.02, 6, 1e-12


def in_contact(context: Context, mode: str) -> list[int]:
    """The surfaces with impacts on which a mode rests."""
    return [i for i, c in enumerate(context.form.contact) if c is not None and mode[i] == "0"]


def contact_stability(context: Context, point: EquilibriumPoint) -> EquilibriumStability:
    """Stability of a point in resting contact on one surface; undecided on several."""
    linear = linearise(context.system, point, values=context.put, sides=[])
    assert linear.sliding is not None
    on = in_contact(context, point.mode)
    kinked = surfaces_at(context, point) or any(_kinked(context, point, i) for i in on)
    if linear.sliding.matrix is None or point.mode.count("0") > 1 or kinked:
        text = "it rests on several surfaces at once: impacts on one move the others, which is not decided"
        if linear.sliding.matrix is None:
            text = "the field on the surface is not determined by first derivatives"
        elif kinked:
            text = "it rests on a surface and lies on a kink or another reset, whose sides differ"
        return _undecided(point, linear, text)
    (i,) = on
    contact = context.form.contact[i]
    assert contact is not None
    side = 1 if contact.side > 0 else -1
    # h and dh/dt are constant on the surface: two roots that are 0.
    polynomial = characteristic_polynomial(linear.sliding.matrix)[:-2]
    push = (1 - side * context.number(point.multipliers[0][1])) / 2
    e = _restitution(context, point, i)
    if not push > SMALL:
        return _undecided(point, linear, "it is not pressed onto the surface: higher terms decide")
    statements = [
        Statement(f"it is pressed onto the surface: s = {point.s_value[0]:.6g}, clear of its end {side}"),
        Statement(f"restitution at the surface: {e:.6g}"),
    ]
    verdict = context.verdict(polynomial)
    repeated, text = _repeated(context, point, i)
    answer: Answer = "undecided"
    if e < -SMALL:
        answer = "unstable"
        statements.append(Statement("an impact passes the surface, and the field beyond leads away from it"))
    elif e > 1 + SMALL:
        answer = "unstable"
        statements.append(Statement("bounces grow from impact to impact", BOUNCES))
    elif verdict is Verdict.UNSTABLE:
        answer = "unstable"
        statements.append(Statement("a root of the field on the surface lies on the right", SOURCE))
    elif repeated == "unstable":
        answer = "unstable"
        statements.append(Statement(text, REPEATED))
    elif not e < 1 - SMALL:
        statements.append(Statement("bounces neither end nor grow in the first order: higher terms decide"))
    elif repeated == "undecided":
        statements.append(Statement(text))
    elif verdict is Verdict.ASYMPTOTICALLY_STABLE:
        answer = "asymptotically stable"
        after = "; all roots of the field on the surface lie on the left" if len(polynomial) > 1 else ""
        statements.append(Statement(f"bounces end in finite time{after}", SOURCE))
    elif _stays(context, point, linear.sliding.matrix):
        answer = "stable"
        stays = "bounces end in finite time; the field on the surface is linear and its solutions stay near"
        statements.append(Statement(stays, SOURCE))
    else:
        statements.append(Statement("the linear part of the field on the surface does not decide", SOURCE))
    if text and answer in {"asymptotically stable", "stable"}:
        statements.append(Statement(text, REPEATED))
    routh = context.routh(polynomial)
    solved = context.solved(routh) if routh is not None else None
    return EquilibriumStability(
        point, linear, polynomial, routh, False, answer, (), answer, tuple(statements), solved
    )


def _stays(context: Context, point: EquilibriumPoint, matrix: sympy.Matrix) -> bool:
    """Whether the field is affine and its solutions on h = dh/dt = 0 stay bounded."""
    form = context.form
    (i,) = in_contact(context, point.mode)
    contact = form.contact[i]
    if contact is None or form.jacobian(point.mode).has(*form.x) or point.mode.count("0") != 1:
        return False
    rows = sympy.Matrix([form.h[i], contact.rate]).jacobian(form.x)
    if rows.has(*form.x) or rows.rank() < 2:
        return False
    along = rows.nullspace()
    if not along:
        return True
    basis = sympy.Matrix.hstack(*along)
    inner = (basis.T * basis).inv() * basis.T * matrix * basis
    return bool(context.bounded(inner))


def _undecided(point: EquilibriumPoint, linear: Linearisation, text: str) -> EquilibriumStability:
    return EquilibriumStability(
        point, linear, None, None, False, "undecided", (), "undecided", (Statement(text),)
    )


def _kinked(context: Context, point: EquilibriumPoint, i: int) -> bool:
    """Whether the reset has kinks that more than the speed of approach decides, as one with friction."""
    form, contact = context.form, context.form.contact[i]
    assert contact is not None
    put = dict(zip(form.x, point.x, strict=True))
    kinks = branch_points(form.reset[i] or (), put, context.values)
    slopes = context.numbers(sympy.Matrix([contact.rate, *kinks]).jacobian(form.x).subs(put))
    return not np.all(np.isfinite(slopes)) or np.linalg.matrix_rank(slopes) > 1


def _restitution(context: Context, point: EquilibriumPoint, i: int) -> float:
    """e = -dL+/dL- at the point, in the direction in which the surface pushes, seen before the impact."""
    form = context.form
    contact, reset = form.contact[i], form.reset[i]
    assert contact is not None
    assert reset is not None
    rate, push = sympy.Matrix([contact.rate]).jacobian(form.x), sympy.Matrix(contact.direction)
    change = sympy.Matrix(reset).jacobian(form.x) * push
    at = _before(context, point, i)
    return -context.number((rate * change)[0].subs(context.put).subs(at))


def _before(context: Context, point: EquilibriumPoint, i: int) -> dict[Symbol, Expr]:
    """The point, or a place just before an impact where the reset has a kink at the point."""
    form = context.form
    contact, reset = form.contact[i], form.reset[i]
    assert contact is not None
    put = dict(zip(form.x, point.x, strict=True))
    if not branch_points(reset or (), put, context.values):
        return put
    rate, push = sympy.Matrix([contact.rate]).jacobian(form.x), sympy.Matrix(contact.direction)
    raised = context.number((rate * push)[0].subs(context.put).subs(put))
    back = -BESIDE * (1 if contact.side > 0 else -1) * (1 if raised > 0 else -1)
    return {q: e + back * d.subs(put) for (q, e), d in zip(put.items(), push, strict=True)}


def _repeated(context: Context, point: EquilibriumPoint, i: int) -> tuple[Answer, str]:
    """What impact after impact does to the other states: "stable" where it has a limit near them, with the
    text "" where an impact without speed changes nothing."""
    form = context.form
    contact, reset = form.contact[i], form.reset[i]
    assert contact is not None
    assert reset is not None
    at = _before(context, point, i)
    after = sympy.Matrix(reset)
    rows = sympy.Matrix([form.h[i], contact.rate]).jacobian(form.x)
    tried = _Impacts(context, point, i, at)
    if tried.moved():
        return "unstable", "an impact moves other states by a finite distance, however slow it is"
    if tried.end_the_bounces():
        return "stable", ""
    J, normal = (context.numbers(part.subs(context.put).subs(at)) for part in (after.jacobian(form.x), rows))
    if not (np.all(np.isfinite(J)) and np.all(np.isfinite(normal))):
        if tried.change_nothing():
            return "stable", ""
        return "undecided", "what infinitely many impacts do to the other states is not determined"
    along = linalg.null_space(normal)
    roots = linalg.eigvals(along.T @ J @ along)
    largest = float(np.max(np.abs(roots), initial=0.0))
    if largest > 1 + CLEAR:
        text = (
            f"an impact multiplies other states by {largest:.6g}, and infinitely many follow in finite time"
        )
        return "unstable", text
    if tried.change_nothing():
        return "stable", ""
    if largest < 1 - CLEAR:
        text = f"the bounces take other states to their rest: each impact multiplies them by {largest:.6g}"
        return "stable", text
    return _on_the_circle(after.jacobian(form.x).subs(context.put), rows.subs(context.put), context)


def _on_the_circle(J: sympy.Matrix, rows: sympy.Matrix, context: Context) -> tuple[Answer, str]:
    """The same where eigenvalues of M have modulus 1, for an affine reset: M^k has a limit or not."""
    left = "what infinitely many impacts do to the other states is not decided by their linear part"
    J, rows = J.subs(context.values), rows.subs(context.values)
    if any(not e.is_Rational for part in (J, rows) for e in part):
        return "undecided", left
    along = sympy.Matrix.hstack(*rows.nullspace())
    M = (along.T * along).inv() * along.T * J * along
    change = M - sympy.eye(M.rows)
    kept = M.rows - change.rank()
    roots = linalg.eigvals(np.array(M.tolist(), dtype=float))
    others = sorted(roots, key=lambda q: abs(q - 1))[M.rows - (change**M.rows).rank() :]
    if any(abs(q) > 1 - CLEAR for q in others):
        return "undecided", "other states have no limit at the end of the bounces: solutions end there"
    if M.rows - len(others) > kept:
        return "unstable", "each impact adds to other states, and infinitely many follow in finite time"
    return (
        "stable",
        "what the impacts change beside the speed has a limit: the rest decays from bounce to bounce",
    )


class _Impacts:
    """Impacts tried at states beside a point."""

    def __init__(self, context: Context, point: EquilibriumPoint, i: int, at: dict[Symbol, Expr]) -> None:
        form = context.form
        contact, reset = form.contact[i], form.reset[i]
        assert contact is not None
        assert reset is not None
        self.point, rng = np.array(point.value), np.random.default_rng(7)
        put = {**context.values, **context.put}

        def function(rows: Sequence[Expr]) -> Callable[[Array, float], Array]:
            raw = sympy.lambdify((form.x, time), [sympy.S(e).subs(put) for e in rows], "numpy")
            return lambda x, t: np.array(raw(x, t), dtype=float)

        self.zero, self.after = function([form.h[i], contact.rate]), function(reset)
        self.slopes = function(list(sympy.Matrix([form.h[i], contact.rate]).jacobian(form.x)))
        self.before = np.array([context.number(at[q]) for q in form.x]) - self.point
        self.sign = 1 if contact.side > 0 else -1
        size = TRIED * (1 + np.abs(self.point))
        self.starts = [self.point + size * rng.uniform(-1, 1, len(self.point)) for _ in range(TRIALS)]
        self.times = rng.uniform(0, 1, TRIALS)

    def moved(self) -> bool:
        """Whether an impact without speed takes the state from the point."""
        far = np.abs(self._change(self.point, 0.0))
        return bool(np.any(far > 1e-5 * (1 + np.abs(self.point)) + 100 * np.abs(self.before).max()))

    def change_nothing(self) -> bool:
        """Whether an impact without speed leaves all states as they are."""
        # What it does to the speed just before the point is no change of the others.
        at_point = self._change(self.point, 0.0) if np.any(self.before) else 0.0
        most = 1e3 * ROUNDED if np.any(self.before) else ROUNDED
        return self._all(0.0, lambda x, t: np.abs(self._change(x, t) - at_point), most)

    def end_the_bounces(self) -> bool:
        """Whether after one impact no speed towards or from the surface is left."""
        return self._all(TRIED, lambda x, t: np.abs(self.zero(self.after(x + self.before, t), t)), ROUNDED)

    def _change(self, x: Array, t: float) -> Array:
        before = x + self.before
        return np.asarray(self.after(before, t) - before)

    def _all(self, speed: float, of: Callable[[Array, float], Array], most: float) -> bool:
        """Whether a function is below a bound at states on the surface that approach it with a speed."""
        try:
            with np.errstate(all="ignore"):
                for x, t in zip(self.starts, self.times, strict=True):
                    at = self._placed(x, t, -self.sign * speed)
                    if at is None or not np.all(of(at, t) <= most * (1 + np.abs(at).max())):
                        return False
        except (TypeError, NameError, ValueError, ArithmeticError, np.linalg.LinAlgError):
            return False
        return True

    def _placed(self, x: Array, t: float, rate: float) -> Array | None:
        """The state moved to where h = 0 and dh/dt is the rate."""
        for _ in range(20):
            left = self.zero(x, t) - np.array([0.0, rate])
            if np.max(np.abs(left)) <= 1e-15:
                return x
            x = x - linalg.lstsq(self.slopes(x, t).reshape(2, -1), left)[0]
        return x if np.max(np.abs(left)) <= 1e-13 else None
