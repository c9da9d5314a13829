"""Special points between two points of a branch: changes of sign located by root-finding, of the word by
bisection, and the continuation of the branch across them."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

from filippov.analysis.bifurcations.branch import BOUNDARY, BranchPoint
from filippov.analysis.bifurcations.branch_point import locate
from filippov.analysis.bifurcations.branch_problem import OrbitProblem
from filippov.analysis.bifurcations.codim2 import PREFIX, title
from filippov.analysis.bifurcations.corrector import FAILURES, Along, Corrector
from filippov.analysis.bifurcations.equilibrium_branch import EquilibriumProblem, is_kink
from filippov.analysis.bifurcations.other_side import GRAZES, ended, off_border, other_sides
from filippov.analysis.bifurcations.special_points import confirmed, name_of_change
from filippov.analysis.orbits.margin import nearest_pass
from filippov.analysis.orbits.shooting import NoConvergenceError
from filippov.base.arrays import Array
from filippov.base.status import EventKind, mode_text

_BISECTIONS = 44
_AWAY = 1e-5
_SAME = 1e-4
# Of so many kinks at one point all sides are tried.
_MOST_KINKS, _INSIDE = 6, 1e-12
# Where a field ends at a kink a branch is followed to this distance from it, and then this part of the rest.
_NEAR, _REST = 1e-6, 1.0 - 1e-6
# Solutions beside a change of the word are no farther apart than this: at a grazing, with the square root of
# the rest of the bisection.
_APART = 1e-2
# Ends of two words that are one solution to rounding are the same branch. Between its steps a solution, and
# so how near it passes a surface, is known less well than at its ends, by an implicit method much less.
_SAME_SOLUTION, _GRAZES_INSIDE = 1e-10, 1e-4
# An orbit this near to the border, in parts of its extent, is on it.
_EXACT = 1e-9
# Ends of two branches that meet are no farther apart.
_MEETS = 1e-5
# The end of a branch is looked for up to so many times the distance to the other one's.
_PAST = 4.0
# The branch beyond comes from the change: the cosine of the angle between it and the way there.
_LEADS = 0.5
# What is told by the multipliers of an orbit: passed within steps longer than so many of the least.
MULTIPLIERS, _SHORT = ("period doubling", "symmetry breaking", "Neimark-Sacker"), 10.0
_CUSP = PREFIX + "cusp"
_BORDER = "border collision"


class EndOfWordError(NoConvergenceError):
    """A branch ends at the border of its word; `last` is its last point."""

    def __init__(self, message: str, last: Along) -> None:
        super().__init__(message)
        self.last = last


class Crossings:
    """Location of special points."""

    def __init__(self, width: float, min_step: float) -> None:
        self.width, self.min_step = width, min_step

    def between(self, a: Along, b: Along, step: float) -> tuple[list[BranchPoint], Along]:
        """The special points after a up to b, and the point to go on from (b, or one beyond a change)."""
        if a.point.word != b.point.word and a.point.word:
            return self._word(a, b)
        found: list[tuple[float, BranchPoint, str, Along]] = []
        length = float(a.tangent @ (b.z - a.z))
        changed = [name for name in a.point.tests if name in b.point.tests and _changes(a, b, name)]
        bent = abs(a.point.tests["fold"] - b.point.tests["fold"]) if "fold" in changed else 0.0
        if "fold" in changed and bent < getattr(a.corrector.problem, "straight", 0.0) * abs(length):
            changed.remove("fold")
        if "branch point" in changed and {"symmetry breaking", "period doubling"} & set(changed):
            changed.remove("branch point")
        for name in changed:
            located = self._meeting(a, b) if name == "branch point" else self._locate(a, b, name, length)
            if located is None:
                if name in MULTIPLIERS and step > _SHORT * self.min_step:
                    raise NoConvergenceError(f"a {name} was passed and not found; shorter steps may find it.")
                continue
            if not confirmed(name, located[1].point, a.corrector.problem.kind):
                if name == "fold":
                    raise NoConvergenceError("no multiplier is 1 where the equations turn back.")
                continue
            share, at = located
            if _vanishes(name, a, b, at):
                found.append((share, _titled(at.point, name, a.corrector.problem.kind), name, at))
        meetings = [at.z for _, _, name, at in found if name in ("branch point", _CUSP)]
        # A branch that turns back where it meets another one has no fold there, nor has a curve at its cusp.
        found = [
            item for item in found
            if item[2] != "fold" or not any(np.linalg.norm(item[3].z - z) < _SAME for z in meetings)
        ]  # fmt: skip
        found.sort(key=lambda item: item[0])
        points: list[BranchPoint] = []
        for _, point, name, at in found:
            if name.startswith(BOUNDARY):
                if _kink_of(a, name) < 0:
                    if at.corrector.problem.ending(at.u, at.point.value) is not None:
                        return points, at
                    special, onwards = self._boundary(a, at, name)
                    return [*points, special], onwards
                special, beyond = self._kink(a, at, name)
                if beyond is not None:
                    return [*points, special], beyond
                points.append(special)
                continue
            points.append(point)
        return points, b

    def _locate(self, a: Along, b: Along, name: str, length: float) -> tuple[float, Along] | None:
        """Where a test function vanishes between two points, by Brent's method along the tangent of a."""
        if _begins_on(a, name):
            return 0.0, a
        corrector = a.corrector
        # The branch may bend so much that the last point is not found again from the tangent.
        last: dict[float, Along] = {0.0: a, 1.0: b}
        known: dict[float, Array] = {0.0: a.z, 1.0: b.z}

        def test(share: float) -> float:
            if share in last:
                return last[share].point.tests[name]
            known[share], _ = corrector.correct(_between(a, length, known, share), a.tangent)
            last[share] = corrector.along(known[share], a.tangent)
            return last[share].point.tests[name]

        try:
            # Where rounding of the test ends the search, its last place is the root as well as it is known.
            share, _ = brentq(
                test, 0.0, 1.0, xtol=1e-13, rtol=1e-12, maxiter=60, full_output=True, disp=False
            )
            test(share)
        except (*FAILURES, ValueError, KeyError):
            # A test that an orbit lacks, or that does not change its sign: nothing was found.
            return None
        return share, last[share]

    def _meeting(self, a: Along, b: Along) -> tuple[float, Along] | None:
        """The branch point between two points, where the corrector's matrix is singular."""
        corrector = a.corrector
        # The determinant is linear there, the test its root.
        left, right = (abs(q.point.tests["branch point"]) ** len(a.z) for q in (a, b))
        try:
            z = locate(corrector.equations, a.z + left / (left + right) * (b.z - a.z))
            share = float(a.tangent @ (z - a.z)) / float(a.tangent @ (b.z - a.z))
            point = corrector.problem.point(*corrector.plain(z))
        except FAILURES:
            return None
        if not -_SAME < share < 1 + _SAME or np.linalg.norm(z - a.z) > 2 * np.linalg.norm(b.z - a.z):
            return None
        return share, Along(corrector, z, a.tangent, replace(point, tangent=tuple(a.tangent.tolist())))

    # -- change of the word --------------------------------------------------------------------------------

    def _word(self, a: Along, b: Along) -> tuple[list[BranchPoint], Along]:
        """The change of the word between a and b, and the point to go on from.

        Raises EndOfWordError where the branch of a ends at a border and does not lead to b, and
        NoConvergenceError where b is on another branch: a non-smooth fold has two on one side, and a step may
        end on the other.
        """
        corrector, length = a.corrector, float(a.tangent @ (b.z - a.z))
        low, high = 0.0, 1.0
        known = {0.0: a.z, 1.0: b.z}
        before: list[Array] = []
        after: list[Array] = []
        away: list[Array] = []
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            if (high - low) * abs(length) < 1e-12:
                break
            found = self._middle(a, length, known, middle)
            if found is None:
                # No solution in this plane: beyond the change.
                high = middle
                continue
            z, word = found
            known[middle] = z
            if word == a.point.word:
                low = middle
                before.append(z)
            else:
                high = middle
                after.append(z)
                # Close to grazing solutions depend on the square root of the distance: go on from farther
                # away.
                if (high - low) * abs(length) > _AWAY:
                    away.append(z)
        first, last = _last_along(before, a, a), _last_along(after, a, b)
        onwards = _last_along(away, a, b)
        apart = np.linalg.norm(last.z - first.z)
        if apart < _APART and self._leads(first, onwards):
            special = self._located(first, last, GRAZES if apart > _SAME_SOLUTION else _GRAZES_INSIDE)
            if special is not None:
                same = (onwards.z - first.z)[-1] * first.tangent[-1] >= 0
                told = _noted(special, same) if not same or special.special == _BORDER else special
                return [told], onwards
        text = f"the nearest solution with the word {last.point.word!r} is on another branch."
        if off_border(corrector.problem, self._named(first, last)) < GRAZES:
            raise EndOfWordError(text, first)
        raise NoConvergenceError(text)

    @staticmethod
    def _leads(first: Along, onwards: Along) -> bool:
        """Whether the branch through a point comes from the end of another word, as far as rounding tells."""
        try:
            farther, _ = onwards.corrector.step(onwards, _AWAY)
        except FAILURES:
            return False
        reach = farther.z - first.z
        straight = bool(farther.tangent @ reach > _LEADS * np.linalg.norm(reach))
        return straight and farther.point.word == onwards.point.word

    @staticmethod
    def _middle(a: Along, length: float, known: dict[float, Array], share: float) -> tuple[Array, str] | None:
        """A solution at a share of the length and its word, that of a where there is one; None for none."""
        corrector, found = a.corrector, None
        low = max(q for q in known if q <= share)
        for guess in (_between(a, length, known, share), known[low] + (share - low) * length * a.tangent):
            try:
                z, _ = corrector.correct(guess, a.tangent)
                word = corrector.word(z)
            except FAILURES:
                continue
            if word == a.point.word:
                return z, word
            found = found or (z, word)
        return found

    def _located(self, before: Along, after: Along, least: float) -> BranchPoint | None:
        """The special point between two words, at the end of one branch or of the other, whichever is nearer
        to the border: where impacts begin, their side is known only to the square root of what is computed.

        None where neither is as near as `least`, or the ends of the branches are apart.
        """
        special = self._named(before, after)
        problem = before.corrector.problem
        rest = off_border(problem, special)
        if rest > _EXACT:
            reach = _PAST * float(np.linalg.norm(after.z - before.z))
            back = ended(replace(after, tangent=-after.tangent), reach)
            other = replace(
                back.point, special=special.special, note=special.note, surface=special.surface
            )  # fmt: skip
            gap = off_border(problem, other)
            if gap < rest and np.linalg.norm(back.z - before.z) < _MEETS:
                special, rest = other, gap
        return special if rest < least else None

    def _named(self, before: Along, after: Along) -> BranchPoint:
        name, surface = "change of the mode word", ""
        note = f"{before.point.word} -> {after.point.word}"
        if isinstance(before.corrector.problem, OrbitProblem):
            first = before.corrector.problem.orbit(*before.corrector.plain(before.z))
            second = after.corrector.problem.orbit(*after.corrector.plain(after.z))
            if first.signature == second.signature:
                name = _BORDER
            else:
                name, surface, note = name_of_change(first, second)
        note = f"surface {surface!r}: {note}" if surface else note
        return replace(before.point, special=name, note=note, surface=surface)

    def end_of_word(self, a: Along, step: float) -> Along | None:
        """The last point of the branch within a step that failed, where solutions at its end have another
        word; None where they have not, or the branch goes no farther."""
        if not isinstance(a.corrector.problem, OrbitProblem):
            return None
        try:
            changes = a.corrector.word(a.z + step * a.tangent) != a.point.word
        except FAILURES:
            return None
        last = ended(a, step) if changes else a
        return last if np.linalg.norm(last.z - a.z) > self.min_step else None

    def jump(self, a: Along) -> tuple[BranchPoint, Along] | None:
        """Across a change of the word where no solution lies ahead: back in the parameter (a non-smooth
        fold), or on with another tangent. None where there is none."""
        if not isinstance(a.corrector.problem, OrbitProblem):
            return None
        last = ended(a, self.min_step)
        for at in other_sides(last):
            special = self._located(last, at, max(GRAZES, self.min_step))
            if special is not None:
                return _noted(special, at.tangent[-1] * a.tangent[-1] >= 0), at
        return None

    def blocked(self, a: Along) -> BranchPoint | None:
        """The point with the name of what stops a branch of orbits: grazing, where its derivative has no
        bound; None where it is something else.

        A surface that is reached with hardly any speed, and slid on, is at the fold at which sliding ends.
        """
        problem = a.corrector.problem
        if not isinstance(problem, OrbitProblem):
            return None
        try:
            last = ended(a, self.min_step)
            orbit = problem.orbit(*last.corrector.plain(last.z), margins=True)
        except FAILURES:
            return None
        edge = orbit.margin
        share, distance, surface = nearest_pass(orbit.pieces, problem.shooting.jacobian)
        if share < max(GRAZES, self.min_step):
            note = f"surface {surface!r} passed at a distance of {distance:.3g}"
            return replace(a.point, special="C-bifurcation", note=note, surface=surface)
        # The height that is left goes as the square of the speed.
        if edge.transversality**2 < max(GRAZES, self.min_step):
            event = min(orbit.events, key=lambda e: abs(e.t - edge.transversal_t))
            name = "grazing-sliding" if event.kind == EventKind.ENTRY else "C-bifurcation"
            note = f"surface {event.surface!r} reached with relative speed {edge.transversality:.3g}"
            return replace(a.point, special=name, note=note, surface=event.surface)
        return None

    # -- boundary equilibria -------------------------------------------------------------------------------

    def _boundary(self, a: Along, at: Along, name: str) -> tuple[BranchPoint, Along]:
        """The boundary equilibrium, and the first point of the branch of the other kind."""
        problem = at.corrector.problem
        assert isinstance(problem, EquilibriumProblem)
        new, test = problem.across(name, at.u)
        corrector = Corrector(new, self.width)
        z = corrector.scaled(new.start, at.point.value)
        tangent = corrector.tangent(z, None)
        forth = new.point(*corrector.plain(z + 1e-4 * tangent)).tests[test]
        if forth < 0:
            tangent = -tangent
        onwards = corrector.along(z, tangent)
        onwards = replace(onwards, tangent=tangent, point=_leaving(onwards.point, test))
        return _boundary_point(at, name, tangent[-1] * a.tangent[-1] > 0, [new]), onwards

    def _kink(self, a: Along, at: Along, name: str) -> tuple[BranchPoint, Along | None]:
        """The boundary equilibrium on a kink, and the first point of the branch on its other side; None where
        the branch comes from beyond the kink and goes on on its own side."""
        problem = at.corrector.problem
        assert isinstance(problem, EquilibriumProblem)
        i = _kink_of(a, name)
        place = at.u, at.point.value, self.width
        kinks = [i, *(k for k in range(len(problem.mode)) if k != i and problem.lies_on(k, *place))]
        ways = self._ways(problem, kinks, at)
        onwards = ways[0]
        virtual = a.point.tests[name] < 0 and not _begins_on(a, name)
        same = (onwards.tangent[-1] * at.tangent[-1] > 0) != virtual
        found = _boundary_point(at, name, same, [way.corrector.problem for way in ways])
        return found, None if virtual else onwards

    def reached(self, a: Along) -> tuple[BranchPoint, Along] | None:
        """Across a kink at which the field of the mode ends, as that of Max(x, 0)**1.5 does: its points are
        found only on one side. None where none is near."""
        corrector = a.corrector
        for name in a.point.tests:
            i = _kink_of(a, name)
            if i < 0:
                continue
            h, slope = corrector.problem.inwards(i, a.u, a.point.value)
            rate = float(slope @ (a.tangent * corrector.sizes))
            if not (rate < 0 < h < -rate * _NEAR):
                continue
            try:
                z, _ = corrector.correct(a.z - _REST * h / rate * a.tangent, a.tangent)
                point, onwards = self._kink(a, corrector.along(z, a.tangent), name)
            except FAILURES:
                return None
            return None if onwards is None else (point, onwards)
        return None

    def _ways(self, problem: EquilibriumProblem, kinks: list[int], at: Along) -> list[Along]:
        """The branches of other modes that begin at a point on kinks, one where it lies on one.

        A branch of a mode is there where it goes to the inside of all kinks.
        """
        out = []
        sizes: list[int] = list(range(len(kinks), 0, -1)) if len(kinks) <= _MOST_KINKS else [len(kinks)]
        for chosen in itertools.chain(*(itertools.combinations(kinks, size) for size in sizes)):
            new = problem.beyond(chosen, at.u)
            corrector = Corrector(new, self.width)
            z = corrector.scaled(new.start, at.point.value)
            try:
                tangent = corrector.tangent(z, None)
                rates = [new.inwards(k, at.u, at.point.value)[1] @ (tangent * corrector.sizes) for k in kinks]
                tangent = -tangent if rates[0] < 0 else tangent
                if len(kinks) > 1 and not (min(rates) > 0 or max(rates) < 0):
                    continue
                found = corrector.along(z, tangent)
            except FAILURES:
                continue
            point = found.point
            for k in kinks:
                point = _leaving(point, f"boundary {new.system.surface_names[k]}")
            if all(number > -_INSIDE for key, number in point.tests.items() if key.startswith(BOUNDARY)):
                point = replace(point, note="")
            out.append(replace(found, tangent=tangent, point=replace(point, tangent=tuple(tangent.tolist()))))
        if not out:
            names = ", ".join(repr(problem.system.surface_names[k]) for k in kinks)
            raise NoConvergenceError(f"beyond the kink {names} the equations have no derivatives.")
        return out


def _boundary_point(at: Along, test: str, same: bool, others: list[Any]) -> BranchPoint:
    """The boundary equilibrium at which a test vanishes; same: whether the branch goes on, not back."""
    problem, onto = at.corrector.problem, tuple(mode_text(other.mode) for other in others)
    note = f"{_way(same)}; {test}: {problem.mode} -> {others[0].mode}"
    note += "".join(f"; another branch leaves in mode {mode}" for mode in onto[1:])
    named = at.point.named("boundary equilibrium", problem.kind)
    return replace(named, note=note, test=test, onto=onto)


def _leaving(point: BranchPoint, test: str) -> BranchPoint:
    """The start of the other kind: the test that is 0 to rounding there counts as left."""
    return replace(point, tests={**point.tests, test: abs(point.tests[test])})


def _kink_of(a: Along, name: str) -> int:
    """The number of the kink whose side a test of an equilibrium's branch is; -1 for any other test."""
    problem = a.corrector.problem
    end, _, surface = name.partition(" ")
    if not isinstance(problem, EquilibriumProblem) or end != "boundary":
        return -1
    i = problem.system.surface_index(surface)
    return i if is_kink(problem.system, i) else -1


def _begins_on(a: Along, name: str) -> bool:
    """Whether a test is that of a kink on which the point lies: its sign there is rounding."""
    i = _kink_of(a, name)
    return i >= 0 and bool(a.corrector.problem.lies_on(i, a.u, a.point.value, a.corrector.width))


def _changes(a: Along, b: Along, name: str) -> bool:
    """Whether a test changes its sign between two points; from a kink a branch may go to its own side."""
    before, after = a.point.tests[name], b.point.tests[name]
    return after < 0 if _begins_on(a, name) else before * after < 0


def _titled(point: BranchPoint, name: str, kind: str) -> BranchPoint:
    """The point with its name; kind: of the branch."""
    if name.startswith(PREFIX):
        special, test = title(name)
        return replace(point, special=special, note="; ".join(filter(None, (point.note, test))), test=test)
    return point.named("boundary equilibrium" if name.startswith(BOUNDARY) else name, kind)


def _vanishes(name: str, a: Along, b: Along, at: Along) -> bool:
    """Whether a test of a codimension-2 point is 0 there and does not jump."""
    if not name.startswith(PREFIX):
        return True
    size = max(abs(q.point.tests[name]) for q in (a, b))
    return abs(at.point.tests.get(name, np.inf)) < 1e-3 * size


def _way(same: bool) -> str:
    return "persistence" if same else "non-smooth fold"


def _noted(special: BranchPoint, same: bool) -> BranchPoint:
    """The point with a note of whether the parameter goes on beyond the border, or turns back."""
    return replace(special, note=f"{_way(same)}; {special.note}")


def _last_along(found: list[Array], a: Along, otherwise: Along) -> Along:
    """The last of the solutions that can be described: at grazing their derivative has no bound."""
    for z in reversed(found):
        try:
            return a.corrector.along(z, a.tangent)
        except FAILURES:
            continue
    return otherwise


def _between(a: Along, length: float, known: dict[float, Array], share: float) -> Array:
    """A guess at a share of the length, in the plane across the tangent: between the nearest solutions."""
    low = max((q for q in known if q <= share), default=None)
    high = min((q for q in known if q > share), default=None)
    if low is None or high is None:
        return np.asarray(a.z + share * length * a.tangent)
    part = (share - low) / (high - low)
    return np.asarray(known[low] + part * (known[high] - known[low]))
