"""Stability of a set of equilibria in a sliding mode: its inner points, then break-away at its ends.

What is decided, and by what:
- inner points, by attraction of the surface, the sliding field on it, and fields beside it that lead away;
- ends where slip starts with a jump of the field or an infinite slope that points away: the set is unstable,
  for h' >= C h**e with e < 1 leaves h = 0 in a time that does not depend on how near the solution starts;
- ends with a linear slip field, in dimension 2 and 3: the return map of filippov.analysis.steady.rest_map.
  Routh-Hurwitz on the slip polynomial is sufficient there and not necessary;
- in higher dimensions the slip polynomial says nothing by itself: where every slide drifts along the segment,
  the return map is followed numerically (filippov.analysis.steady.drift_map); else undecided, unless a hook
  knows.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import sympy
from sympy import Expr, Rational, Symbol

from filippov.analysis.algebra.growth import by_excess
from filippov.analysis.algebra.polynomial import Verdict
from filippov.analysis.local_stability.departure import left_from
from filippov.analysis.local_stability.kink_stability import kink_stability, surfaces_at
from filippov.analysis.local_stability.set_parts import spots
from filippov.analysis.local_stability.sliding_stability import attraction
from filippov.analysis.local_stability.stability_context import SMALL, Context
from filippov.analysis.local_stability.stability_result import (
    Answer,
    Criterion,
    EquilibriumStability,
    SlipCase,
    Solved,
    Statement,
)
from filippov.analysis.steady import edges
from filippov.analysis.steady.branches import short
from filippov.analysis.steady.drift_map import drift_map
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet
from filippov.analysis.steady.existence import at_rest
from filippov.analysis.steady.linearisation import (
    SlidingLinearisation,
    SlipLinearisation,
    characteristic_polynomial,
    linearise,
)
from filippov.analysis.steady.rest_map import RestMap, growth, rest_map, threshold

PAPER = "Hensen & van de Molengraft 2002, section 3"
PROOF = "proved in filippov.analysis.steady.rest_map"
FOLLOWED = "computed, see filippov.analysis.steady.drift_map"
# Slip at some of the ends, by their numbers.
Sides = list[tuple[int, SlipLinearisation]]
# The error of a slope of the return map at an end.
SAME = 1e-9
NARROW = 1e-6


def set_stability(
    context: Context, found: EquilibriumSet, ends: Sequence[EquilibriumPoint] | None = None
) -> EquilibriumStability:
    """Return the analysis of a set that lies in a sliding mode.

    ends   of the segment of which the set is a part, cut off by kinks; its own where it is no part
    """
    linear = linearise(context.system, found, values=context.put, sides=[])
    sliding = linear.sliding
    assert sliding is not None
    inner = _inner_point(found)
    statements, attracts = attraction(context, sliding, found.mode, found.x, inner)
    statements = [*_degenerate(found), *statements]
    if sliding.matrix is None:
        told = (*statements, Statement("the sliding field is not determined by first derivatives"))
        return EquilibriumStability(found, linear, None, None, False, "undecided", (), attracts, told)
    if found.dimension > 1 and not _uniform(context, found, sliding, attracts):
        part = left_from(context, found)
        left: Answer = "unstable" if part else "undecided"
        told = (*statements, part or Statement("the sliding mode is not alike at all of its points"))
        return EquilibriumStability(found, linear, None, None, False, left, (), left, told)
    if attracts != "unstable" and surfaces_at(context, found):
        # Slip at its ends is that of one side of the kink too: what the set does as a whole is left open.
        beside, statement = kink_stability(context, found)
        left = "unstable" if beside == "unstable" else "undecided"
        told = (*statements, statement)
        return EquilibriumStability(found, linear, None, None, False, left, (), left, told)
    k = sliding.normal.rows
    polynomial = characteristic_polynomial(sliding.matrix)[: -k or None]
    rest, zeros = context.without_zeros(polynomial, len(polynomial))
    drift = not context.semisimple(sliding, zeros, inner)
    interior, said = _interior(context, found, rest, zeros, drift, attracts, inner)
    statements += said
    cases: tuple[SlipCase, ...] = ()
    if k == 1 and found.dimension == 1 and attracts != "unstable":
        outer = found.ends if ends is None else tuple(ends)
        if ends is not None:
            text = "part of one segment, cut by kinks at which nothing breaks away: the outer ends decide"
            statements.append(Statement(text))
        cases = _Ends(context, found, outer, drift and zeros == 2, attracts == "stable").cases()
    elif attracts != "unstable":
        statements.append(Statement(f"break-away from {k} surfaces at once is not decided by a linear part"))
    answer: Answer = "unstable" if "unstable" in {attracts, interior} else "undecided"
    if answer == "undecided" and interior == "stable" and _endless(context, found):
        answer = "asymptotically stable"
        statements.append(Statement("nothing breaks away: its multiplier is within its bounds everywhere"))
    elif answer == "undecided":
        answer = _worst([c.answer for c in cases if c.applies])
    if answer != "unstable" and (part := left_from(context, found)):
        answer, statements = "unstable", [*statements, part]
    routh = context.routh(rest)
    if context.hook is not None:
        answer, more = _asked(context, found, answer)
        statements += more
    return EquilibriumStability(
        found, linear, polynomial, routh, drift, interior, cases, answer, tuple(statements)
    )


def _uniform(
    context: Context, found: EquilibriumSet, sliding: SlidingLinearisation, attracts: Answer
) -> bool:
    """Whether all over a set its surfaces attract alike, and the sliding field has roots on the same side."""
    assert sliding.matrix is not None
    polynomial = characteristic_polynomial(sliding.matrix)[: -sliding.normal.rows or None]
    rest, _ = context.without_zeros(polynomial, len(polynomial))
    places = spots(context, found)
    if any(attraction(context, sliding, found.mode, found.x, at)[1] != attracts for at in places):
        return False
    return len({context.verdict(rest, at) for at in places}) == 1


def _endless(context: Context, found: EquilibriumSet) -> bool:
    """Whether a line of equilibria has no end, and its multiplier is nowhere at a bound."""
    if found.dimension != 1 or any(abs(b) < math.inf for b in found.bounds[0]):
        return False
    return not _at_bound(context, found, found.multipliers[0][1].subs(_inner_point(found)))


def _at_bound(context: Context, found: EquilibriumPoint | EquilibriumSet, s: Expr) -> str:
    """The side of the surface at which a multiplier is at its bound: "+", "-", or "" for inside."""
    place = found.mode.index("0")
    at = found.x if isinstance(found, EquilibriumPoint) else found.at(*_inner_point(found).values())
    put = dict(zip(context.form.x, at, strict=True))
    for side, limit in zip("-+", context.form.radius[place], strict=True):
        if limit.is_infinite:
            continue
        if edges.side(s - at_rest(limit.subs(put)), {}, context.values) in (0, None):
            return side
    return ""


def _worst(answers: Sequence[Answer]) -> Answer:
    """Of the sides of a set: unstable where one is, undecided where one is and none is unstable."""
    order: tuple[Answer, ...] = ("unstable", "undecided", "stable", "asymptotically stable")
    return next((a for a in order if a in answers), "undecided")


def _inner_point(found: EquilibriumSet) -> dict[Symbol, Expr]:
    return {q: Rational(str(c)) for q, c in zip(found.free, found.inner, strict=True)}


def _degenerate(found: EquilibriumSet) -> list[Statement]:
    statements = [Statement(f"degenerate: {text}") for text in found.degenerate]
    if not found.bounded:
        names = ", ".join(str(q) for q in found.free)
        statements.append(Statement(f"degenerate: the set is unbounded, {names} is free"))
    return statements


def _interior(
    context: Context,
    found: EquilibriumSet,
    rest: Sequence[Expr],
    zeros: int,
    drift: bool,
    attracts: Answer,
    inner: dict[Symbol, Expr],
) -> tuple[Answer, list[Statement]]:
    if attracts == "unstable":
        return "unstable", []
    verdict = context.verdict(rest, inner)
    if verdict is Verdict.UNSTABLE:
        return "unstable", [Statement("a root of the sliding field lies in the right half plane")]
    if drift:
        text = "sliding beside the set moves along it (to first order at constant distance)"
        ends = (
            " until a multiplier reaches its bound, so the ends decide"
            if found.bounded
            else " and meets no end"
        )
        return "undecided", [Statement(text + ends)]
    if zeros == found.dimension and verdict is Verdict.ASYMPTOTICALLY_STABLE and attracts == "stable":
        text = "each inner point is stable, solutions near it come to rest at a point of the set"
        return "stable", [Statement(text)]
    return "undecided", [Statement("the linear part of the sliding field does not decide for inner points")]


def _asked(context: Context, found: EquilibriumSet, answer: Answer) -> tuple[Answer, list[Statement]]:
    assert context.hook is not None
    evidence = context.hook(context.system, found, {q.name: float(v) for q, v in context.values.items()})
    if evidence is None:
        return answer, []
    verdict = by_excess(abs(evidence.slope) - 1.0, evidence.error)
    told: Answer = "asymptotically stable" if verdict == "stable" else verdict
    statement = Statement(
        f"slope of the second iterate at the set: {evidence.slope:.10g}, {told}", evidence.method
    )
    if told == "undecided":
        return answer, [statement]
    if answer not in {"undecided", told}:
        return answer, [statement, Statement(f"this contradicts the verdict {answer!r} of the linear part")]
    return told, [statement]


def _slope_text(m: RestMap) -> str:
    if m.outcome == "leaves":
        return "slip never ends"
    if m.outcome == "undecided":
        return "a root of the slip polynomial is 0 to rounding"
    if m.outcome == "converges":
        return "slip converges to the end"
    told = {"stable": "attracts", "unstable": "repels", "undecided": "1 to rounding"}
    return f"slope {m.kappa:.9g}, {told[by_excess(abs(m.kappa) - 1.0, SAME)]}"


class _Ends:
    """Break-away at the ends of a segment on one surface, or at the end of a half line."""

    def __init__(
        self,
        context: Context,
        found: EquilibriumSet,
        ends: Sequence[EquilibriumPoint],
        drifts: bool,
        attracts: bool,
    ) -> None:
        self.context = context
        self.found = found
        self.ends = ends
        self.n = len(found.x)
        self.place = found.mode.index("0")
        self.places = self._places()
        # Where slip is expanded: at these ends, or, if there are none, at any point on both sides.
        self.slips: list[tuple[str, EquilibriumPoint | EquilibriumSet]] = [*self.places]
        if not self.places:
            self.slips = [("+", found), ("-", found)]
        # The return map needs all ends, dimension 2 or 3, and the drift along the set that it describes.
        # Above dimension 2 it leads from one end to the other.
        whole = attracts and len(self.places) == len(ends) and bool(ends)
        opposite = {side for side, _ in self.places} == {"+", "-"}
        self.mapped = whole and (self.n == 2 or (self.n == 3 and drifts and opposite))
        self.followed = whole and self.n > 3 and drifts and opposite

    def _places(self) -> list[tuple[str, EquilibriumPoint]]:
        """The ends, each with the side to which slip starts; [] if one is missing or is none of slip."""
        ends = sorted(self.ends, key=lambda e: -e.s_value[0])
        places = [(_at_bound(self.context, e, e.multipliers[0][1]), e) for e in ends]
        infinite = sum(abs(b) == math.inf for b in self.found.bounds[0])
        missing = len(ends) + infinite != 2 and self.ends is self.found.ends
        return [] if missing or any(not side for side, _ in places) else places

    def cases(self) -> tuple[SlipCase, ...]:
        """One case of the exponents after the other, sides with the same polynomial together."""
        linear = [self._linear(*place) for place in self.slips]
        out = []
        for slips in zip(*linear, strict=True):
            self.context.clock.check()
            every = list(enumerate(slips))
            first, *others = (self._polynomial(slip) for slip in slips)
            same = all(other == first for other in others)
            out += [self._case(group, every) for group in ([every] if same else [[one] for one in every])]
        return tuple(out)

    def _linear(self, side: str, end: EquilibriumPoint | EquilibriumSet) -> tuple[SlipLinearisation, ...]:
        mode = end.mode[: self.place] + side + end.mode[self.place + 1 :]
        return linearise(self.context.system, end, values=self.context.put, sides=[mode]).slip

    def _polynomial(self, slip: SlipLinearisation) -> tuple[Expr, ...] | None:
        if slip.matrix is None or (slip.singular is not None and not self._vanishes(slip)):
            return None
        return characteristic_polynomial(slip.matrix)

    def _vanishes(self, slip: SlipLinearisation) -> bool:
        """Whether the part with the infinite slope has the coefficient 0 at the parameter values."""
        return slip.singular is not None and all(
            abs(self.context.number(b)) < SMALL for b in slip.singular[1]
        )

    def _outward(self, k: int, vector: Sequence[Expr], slip: SlipLinearisation) -> float:
        """sigma grad h . vector at an end: positive where it points away from the surface."""
        return self.context.number(self._normal(k, vector), dict(slip.case.put))

    def _gradient(self, k: int) -> Any:
        sliding = linearise(self.context.system, self.slips[k][1], values=self.context.put, sides=[]).sliding
        assert sliding is not None
        return sliding.gradient

    def _known(self, k: int, slip: SlipLinearisation) -> float:
        """What dh/dt beside an end is known to."""
        (side, end), form = self.slips[k], self.context.form
        at = {**dict(zip(form.x, end.x, strict=True)), **dict(slip.case.put)}
        field = form.at_mode(end.mode.replace("0", side, 1))
        return edges.known_to(self._gradient(k), field, at, self.context.values)

    def _normal(self, k: int, vector: Sequence[Expr]) -> Expr:
        total = sum((c * v for c, v in zip(self._gradient(k), vector, strict=True)), sympy.S.Zero)
        return short(total if self.slips[k][0] == "+" else -total)

    def _case(self, group: Sides, both: Sides) -> SlipCase:
        context, slip = self.context, group[0][1]
        put = dict(slip.case.put)
        polynomial = self._polynomial(slip)
        routh = context.routh(polynomial)
        verdict = None if polynomial is None else context.verdict(polynomial, put)
        hurwitz = None if verdict is None else verdict is Verdict.ASYMPTOTICALLY_STABLE
        maps: tuple[RestMap, ...] = ()
        solved = context.solved(routh, put) if routh is not None else None
        criterion: Criterion = "none"
        answer: Answer = "undecided"
        statements = self._leaves(group)
        if statements:
            answer = "unstable"
        elif polynomial is None:
            statements = [Statement(f"no linear part: {slip.validity}")]
        elif self.mapped:
            polynomials = [self._polynomial(s) for _, s in both]
            maps = tuple(self._map(p, put) for p in polynomials if p is not None)
            criterion = "sufficient"
            answer, statements = self._decide(maps, hurwitz)
            if solved is not None:
                solved = self._threshold(solved, lambda symbol: self._mapper(polynomials, symbol, put))
        elif self.followed and (drifting := self._follower(both, None, put)(0.0)):
            maps = drifting
            answer, statements = self._decide(maps, None)
            if solved is not None:
                solved = self._threshold(solved, lambda symbol: self._follower(both, symbol, put))
        else:
            text = (
                "the slip polynomial alone does not decide for the set here; the event map at its ends does"
            )
            if not self.places:
                text = (
                    "the set has no end at which slip starts, so the slip polynomial does not decide for it"
                )
            statements = [Statement(text)]
            if polynomial[-1].is_zero or abs(context.number(polynomial[-1], put)) < SMALL:
                statements.append(Statement("degenerate: the slip polynomial has a root that is 0"))
        if slip.case.holds(context.values):
            statements += self._narrow(slip)
        return SlipCase(
            tuple(dict.fromkeys(self.slips[k][0] for k, _ in group)),
            slip.condition,
            slip.case.holds(context.values),
            slip,
            polynomial,
            routh,
            criterion,
            hurwitz,
            maps,
            solved,
            answer,
            tuple(statements),
        )

    def _narrow(self, slip: SlipLinearisation) -> list[Statement]:
        """How near to the surface the linear part is one, where that is very near."""
        out = []
        for exponent, scale in slip.neglected:
            e, c = self.context.number(exponent), self.context.number(scale)
            tenth = c * 0.1 ** (1 / (e - 1)) if e > 1 else 0.0
            if tenth < NARROW * c:
                text = (
                    f"the exponent {e:g} is near 1: the neglected slope falls to a tenth of its value at "
                    f"|h| = {c:g} only below |h| = {tenth:.3g}; above it exponent 1 describes the solution"
                )
                out.append(Statement(text))
        return out

    def _leaves(self, group: Sides) -> list[Statement]:
        """Why solutions leave the set from arbitrarily near, or [] where this is not so."""
        if not self.places:
            return []
        for k, slip in group:
            side = self.slips[k][0]
            if slip.jump and (jump := self._outward(k, slip.jump, slip)) > self._known(k, slip):
                text = (
                    "the set at h = 0 is wider than the one-sided limits: at break-away dh/dt jumps from 0 "
                    f"to {jump:.6g} (side {side}): solutions from arbitrarily near leave by a finite distance"
                )
                return [Statement(text)]
            if slip.singular is not None and not self._vanishes(slip):
                slope = self._outward(k, slip.singular[1], slip)
                if slope > 0:
                    e, formula = slip.singular[0], self._normal(k, slip.singular[1])
                    text = (
                        f"d|h|/dt contains C |h|**{e if e.is_Symbol else f'({e})'} with C = {formula} > 0 "
                        "and an exponent below 1: no linear part, and solutions that break away leave by a "
                        "finite distance in a time that does not depend on how near to the set they were"
                    )
                    return [Statement(text, "proved: h' >= C h**e gives h >= (C (1 - e) t)**(1/(1 - e))")]
        return []

    def _map(self, polynomial: Sequence[Expr], put: dict[Symbol, Expr]) -> RestMap:
        return rest_map([self.context.number(c, put) for c in polynomial])

    def _decide(self, maps: tuple[RestMap, ...], hurwitz: bool | None) -> tuple[Answer, list[Statement]]:
        factor = growth(maps)
        kappa = " and ".join(_slope_text(m) for m in dict.fromkeys(maps))
        statements = [] if self.followed else [
            Statement(
                "Routh-Hurwitz on the slip polynomial is sufficient for the set to be stable, not necessary, "
                "for slip lasts a finite time; the return map at the ends decides",
                f"{PAPER}; {PROOF}",
            )
        ]
        if math.isnan(factor):
            return "undecided", [*statements, Statement(kappa, PROOF)]
        if self.n == 2:
            statements.append(Statement(f"beyond an end, slip {self._told(maps)}", PROOF))
            return ("asymptotically stable" if factor < 1 or self._returns(maps) else "unstable"), statements
        text = f"return map from one rest position to the next, linearised at an end: {kappa}"
        statements.append(Statement(text, FOLLOWED if self.followed else PROOF))
        if abs(factor - 1) < SAME:
            return "undecided", statements
        answer: Answer = "asymptotically stable" if factor < 1 else "unstable"
        if hurwitz is False and answer == "asymptotically stable":
            statements.append(Statement("Routh-Hurwitz fails here and yet the set is stable"))
        return answer, statements

    @staticmethod
    def _returns(maps: Sequence[RestMap]) -> bool:
        return all(m.outcome != "leaves" for m in maps)

    def _told(self, maps: Sequence[RestMap]) -> str:
        if not self._returns(maps):
            return "leaves: a real root lies in the right half plane"
        turning = any(m.outcome == "returns" for m in maps)
        return "comes to rest inside the set after half a turn" if turning else "converges to the end"

    def _mapper(
        self, polynomials: Sequence[tuple[Expr, ...] | None], symbol: Symbol, put: dict[Symbol, Expr]
    ) -> Callable[[float], tuple[RestMap, ...]]:
        """The return maps of the ends as functions of one parameter."""
        fixed = self._others(symbol, put)
        known = [p for p in polynomials if p is not None]
        rows = [[sympy.lambdify(symbol, c.subs(fixed), "math") for c in p] for p in known]
        return lambda value: tuple(rest_map([float(c(value)) for c in row]) for row in rows)

    def _follower(
        self, both: Sides, symbol: Symbol | None, put: dict[Symbol, Expr]
    ) -> Callable[[float], tuple[RestMap, ...]]:
        """The same in dimension 4 and up; () where one of them is not decided."""
        fixed, free, rows = self._others(symbol, put), symbol or sympy.Dummy(), []
        for k, slip in both:
            side, place = self.slips[k]
            end = linearise(self.context.system, place, values=self.context.put, sides=[]).sliding
            if slip.matrix is None or end is None or end.matrix is None:
                return lambda _: ()
            normal = sympy.Matrix(end.gradient).T * (1 if side == "+" else -1)
            parts = (slip.matrix, end.matrix, normal)
            rows.append([sympy.lambdify(free, sympy.Matrix(part).subs(fixed), "numpy") for part in parts])

        def maps(value: float) -> tuple[RestMap, ...]:
            ends = [[np.array(part(value), dtype=float) for part in row] for row in rows]
            if not all(np.all(np.isfinite(part)) for end in ends for part in end):
                return ()
            first = ends[0]
            # The other end is often this one mirrored.
            mirrored = all(np.array_equal(a, b) for a, b in zip(first[:2], ends[-1][:2], strict=True))
            found = [drift_map(A, J, c.ravel()) for A, J, c in (ends[:1] if mirrored else ends)]
            return tuple(m for m in found if m is not None) * (len(ends) // len(found)) if all(found) else ()

        return maps

    def _others(self, symbol: Symbol | None, put: dict[Symbol, Expr]) -> dict[Symbol, Expr]:
        """The values of all parameters but one."""
        return {q: v for q, v in {**self.context.values, **put}.items() if q != symbol}

    def _threshold(
        self, solved: Solved, maps_of: Callable[[Symbol], Callable[[float], tuple[RestMap, ...]]]
    ) -> Solved:
        """Where the set changes stability in the parameter, by the return map."""
        symbol, maps_at = solved.symbol, maps_of(solved.symbol)

        def measure(value: float) -> float:
            self.context.clock.check()
            maps = maps_at(value)
            if self.n == 2:
                return 0.0 if self._returns(maps) else 2.0
            return growth(maps) if maps else float("nan")

        marks = [float(v) for v in solved.numeric.atoms(sympy.Number) if v > 0]
        value = self.context.number(symbol)
        marks += [value] if value > 0 else []
        if not marks:
            return solved
        return replace(solved, threshold=threshold(measure, min(marks) / 8, max(marks) * 8))
