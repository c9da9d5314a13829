"""The branch on the other side of a change of the mode word, where it does not lie ahead: a non-smooth fold.

At the border the equations F(z) = 0 have two sets of derivatives. Those of the other word are read at states
beside the end of the branch whose solutions have that word, though they are no orbits; their null vector is
the direction in which its branch leaves. At a grazing of impacts, where F grows as the root of the depth, the
null vector of a state nearby tends to that direction too. The branch is taken only where it begins at the
border, and where the orbit on it closes also when it is begun elsewhere.
Source: di Bernardo et al. 2008, ch. 3 (border collisions); Leine & Nijmeijer 2004 for folds with two slopes.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from filippov import UsageError
from filippov.analysis.bifurcations.border_normal_form import TOUCHED, grazed_surface
from filippov.analysis.bifurcations.branch import BranchPoint
from filippov.analysis.bifurcations.branch_problem import OrbitProblem
from filippov.analysis.bifurcations.corrector import FAILURES, Along
from filippov.analysis.bifurcations.sliding_border import ADDING, ARRIVALS, contacts
from filippov.analysis.bifurcations.tangency import nearest, tangencies
from filippov.analysis.orbits.time_limit import time_left
from filippov.analysis.sensitivity.variation import signs_at
from filippov.base.arrays import Array
from filippov.solving.uncut import solve

# Distances from the end of a branch at which the other one is looked for, and those at which its derivatives
# are read: the depth of an impact goes as the square of the distance. A point found is no farther than this.
_LENGTHS = (
    (1e-6, 1e-6), (1e-5, 1e-5), (1e-4, 1e-8), (1e-3, 1e-6), (1e-3, 1e-8), (1e-2, 1e-4), (1e-2, 1e-6),
)  # fmt: skip
_FARTHEST = 3.0
# The end of a branch is followed this near to the border, in steps that grow by this where one is found.
_NEAREST, _GROWS = 1e-11, 1.3
# An orbit grazes where it passes a surface at this part of its largest distance from it; one begun elsewhere
# closes to this part of its extent times its largest multiplier.
GRAZES, _CLOSES, _ELSEWHERE = 1e-7, 1e-6, 0.37


def ended(a: Along, step: float) -> Along:
    """The last point of the branch of one word within a step, as near to its end as solutions tell."""
    left, step = step, 0.5 * step
    while step > _NEAREST:
        try:
            found, _ = a.corrector.step(a, step)
            goes = found.point.word == a.point.word and np.linalg.norm(found.z - a.z) < _FARTHEST * step
        except FAILURES:
            goes = False
        if goes:
            a, left, step = found, left - step, min(_GROWS * step, left - step)
        else:
            step *= 0.5
    return a


def other_sides(a: Along) -> Iterator[Along]:
    """Points of branches with another word that begin at the end a of one, with the tangents away from it."""
    corrector = a.corrector
    for length, depth in _LENGTHS:
        for word, beside in _words_beside(a, depth).items():
            try:
                tangent = corrector.tangent(beside, None)
            except FAILURES:
                continue
            ways = [_follows(a, word, length * side * tangent) for side in (1.0, -1.0)]
            found = [at for at in ways if at is not None]
            # A branch with points on both sides does not begin here.
            if len(found) == 1 and closes_elsewhere(found[0]):
                yield found[0]


def _words_beside(a: Along, length: float) -> dict[str, Array]:
    """The words, other than that of a, of solutions at a distance from a, each with the unknowns of one."""
    units = np.vstack([np.eye(len(a.z)), a.tangent])
    out: dict[str, Array] = {}
    for direction in (*units, *-units):
        z = a.z + length * direction
        try:
            word = a.corrector.word(z)
        except FAILURES:
            continue
        if word != a.point.word:
            out.setdefault(word, z)
    return out


def _follows(a: Along, word: str, step: Array) -> Along | None:
    """The solution with a word near a + step; None where there is none so near."""
    corrector, length = a.corrector, float(np.linalg.norm(step))
    try:
        z, _ = corrector.correct(a.z + step, step / length)
        if corrector.word(z) != word or np.linalg.norm(z - a.z) > _FARTHEST * length:
            return None
        return corrector.along(z, step)
    except FAILURES:
        return None


def closes_elsewhere(at: Along) -> bool:
    """Whether the orbit closes where its solution is begun at another of its states."""
    problem = at.corrector.problem
    if not isinstance(problem, OrbitProblem) or len(problem.shooting.shares) != 1:
        return True
    value, shooting = at.point.value, problem.shooting
    try:
        first = problem.doubled() if shooting.symmetry_order == 2 else problem
        solution = first.solutions(at.u, value)[0]
        low, high = solution.problem.t_span
        share = next((q for q in (_ELSEWHERE, 0.59, 0.16, 0.83) if 0 not in solution.mode_at(
            low + q * (high - low), "+")), None)  # fmt: skip
        if share is None:
            return True
        t = low + share * (high - low)
        start = np.asarray(solution.sol(t, side="+"))
        again = solve(
            shooting.system, start, (t, t + high - low), parameters=solution.problem.parameters,
            rtol=shooting.rtol, atol=shooting.atol, method=shooting.method, max_time=time_left(),
            zeno="continue", nonunique="stick",
        )  # fmt: skip
    except FAILURES:
        return False
    growth = 1.0 + max((abs(v) for v in at.point.multipliers), default=0.0)
    extent = problem.scale[: shooting.n]
    return again.success and bool(np.all(np.abs(again.x_end - start) < _CLOSES * growth * extent))


def off_border(problem: object, point: BranchPoint) -> float:
    """How far an orbit is from the border that its special point is named after, as a part of the largest
    distance from the surface or of the sliding set: 0 on it. Also 0 where the name is that of no border."""
    if not isinstance(problem, OrbitProblem) or point.special not in (*TOUCHED, *ARRIVALS, ADDING):
        return 0.0
    problem = problem.at_phase(point.phase) if point.phase else problem
    if problem.shooting.symmetry_order == 2:
        if len(problem.shooting.shares) > 1:
            return 0.0
        problem = problem.doubled()
    try:
        i, side = grazed_surface(problem, point)
    except UsageError:
        return float("inf")
    solutions = problem.solutions(np.array(point.u), point.value)
    if point.special not in TOUCHED:
        return min((abs(contact.gap) for contact in contacts(point.special, solutions, i)), default=np.inf)
    found = tangencies(solutions, i, side)
    if not found:
        return float("inf")
    height = nearest(found).height
    system, p = problem.shooting.system, problem.p(point.value)
    heights = [signs_at(system, one.t, one.y.T, p, problem.shooting.jacobian)[0][:, i] for one in solutions]
    share = abs(height) / (float(np.max(np.abs(np.concatenate(heights)))) or 1.0)
    # What begins with the root of the depth is as near as its speed is small.
    return float(np.sqrt(share)) if height < 0 and point.special == "C-bifurcation" else share
