"""What happens to an orbit at a tangency of a surface: from the discontinuity map and the multipliers.

With M the derivative of the return at the tangency, H_x the gradient and D(x) = x + c z^q the discontinuity
map (`filippov.analysis.bifurcations.discontinuity_map`), z = -H at the tangency:

    q = 1/2   e_n = H_x M^n c, n = 1, 2, ...: how the n-th return after a tangency clears the surface, per
              sqrt(z). All e_n > 0: the attractor grows from the grazing orbit, with a largest multiplier m in
              (2/3, 1) chaotic at once, in (1/4, 2/3) with windows of period adding, in (0, 1/4) by
              period adding alone. Any e_n < 0: no attractor is near. The orbit with one tangency per return,
              sqrt(z) = -H_free/sum(e_n), is unstable; it is there beyond the tangency where the sum is
              positive, before it where it is negative (a non-smooth fold).
    q = 1     the return beyond has the derivative M (1 - c H_x). Real multipliers above 1 on both sides,
              counted: an even sum is persistence, an odd one a non-smooth fold; an odd sum of those below -1
              a branch of twice the period.
    q > 1     the multipliers go on continuously: persistence.

Source: Nordmark 1991; Chin, Ott, Nusse & Grebogi 1994 for the limits of m; Fredriksson & Nordmark 1997
for the signs; di Bernardo et al. 2008, for the counts (Feigin's).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from filippov import Solution, SolveError, UsageError
from filippov.analysis.algebra import linalg
from filippov.analysis.algebra.growth import by_multipliers
from filippov.analysis.bifurcations.branch import LOCATED, BranchPoint
from filippov.analysis.bifurcations.branch_problem import OrbitProblem
from filippov.analysis.bifurcations.corrector import FAILURES, Corrector
from filippov.analysis.bifurcations.discontinuity_map import GRAZING, DiscontinuityMap, discontinuity_map
from filippov.analysis.bifurcations.held_surface import without_surface
from filippov.analysis.bifurcations.sliding_border import ADDING, ARRIVALS, contacts
from filippov.analysis.bifurcations.smooth_normal_form import number
from filippov.analysis.bifurcations.tangency import Tangency, nearest, tangencies
from filippov.analysis.sensitivity.saltation import derivative_by_all
from filippov.analysis.sensitivity.variation import mode_field
from filippov.base.arrays import Array, Complex
from filippov.solving.uncut import solve

Form = tuple[dict[str, float], str]
TOUCHED = ("grazing-sliding", "C-bifurcation", "grazing")
_RETURNS, _LOST, _ASIDE = 200, 1e-9, 1e-4
_CHAOS, _WINDOWS = 2 / 3, 1 / 4


def border_form(problem: OrbitProblem, point: BranchPoint, width: float, name: str) -> Form:
    """Coefficients of a grazing, crossing-, switching- or adding-sliding of an orbit, and what they predict.

    Raises UsageError where they are not known, by name, and what `solve` raises.
    """
    u, value = np.array(point.u), point.value
    if problem.shooting.symmetry_order > 1:
        # The tangency may be in any part of a symmetric orbit.
        problem = problem.doubled()
    i, side = grazed_surface(problem, point)
    solutions = problem.solutions(u, value)
    p = problem.p(value)
    if point.special in (*ARRIVALS, ADDING):
        found = contacts(point.special, solutions, i)
        if not found:
            raise UsageError("the orbit has no contact with the border of sliding.")
        contact = min(found, key=lambda contact: abs(contact.gap))
        away = -contact.side if point.special == ADDING else contact.side
        at = discontinuity_map(
            problem.shooting.system, point.special, contact.x, contact.t, p, _mode(solutions, contact.t), i,
            away,
        )  # fmt: skip
        return _coefficients(problem, at), "persistence: multipliers go on continuously"
    touch = nearest(tangencies(solutions, i, side))
    at = discontinuity_map(
        problem.shooting.system, GRAZING, touch.x, touch.t, p, _mode(solutions, touch.t), i, side
    )
    out = _coefficients(problem, at)
    if at.exponent > 1:
        return out, "persistence: multipliers go on continuously"
    try:
        free = _Free(problem, u, value, i, side, touch)
    except (*FAILURES, UsageError) as error:
        return out, f"not predicted: {error}"
    if at.exponent == 1:
        return out, _counted(out, free, at, name, value, width)
    return out, _square_root(out, free, at, name, value, width)


def grazed_surface(problem: Any, point: BranchPoint) -> tuple[int, int]:
    """The surface that a point names, and the side from which it is grazed; at a change that is no
    grazing the side the orbit is on most of the time."""
    system = problem.shooting.system
    if point.surface not in system.surface_names:
        raise UsageError("the point does not say which surface is grazed.")
    i = system.surface_index(point.surface)
    solutions = problem.solutions(np.array(point.u), point.value)
    if point.special in TOUCHED:
        heights = {
            side: min((abs(touch.height) for touch in tangencies(solutions, i, side)), default=np.inf)
            for side in (1, -1)
        }
        if min(heights.values()) < np.inf:
            return i, min(heights, key=lambda side: heights[side])
    time = {1: 0.0, -1: 0.0, 0: 0.0}
    for solution in solutions:
        for segment in solution.segments:
            time[segment.mode[i]] += segment.dwell
    return i, 1 if time[1] > time[-1] else -1


def _mode(solutions: Sequence[Solution], t: float) -> tuple[int, ...]:
    inside = [m for m in solutions if min(m.problem.t_span) <= t <= max(m.problem.t_span)]
    if not inside:
        raise UsageError("the grazing lies beyond the solutions of the orbit.")
    return tuple(inside[0].mode_at(t, "-"))


def _coefficients(problem: OrbitProblem, at: DiscontinuityMap) -> dict[str, float]:
    names = problem.shooting.system.states
    return {"exponent": at.exponent, "bend": at.bend} | {
        f"vector {name}": float(v) for name, v in zip(names, at.vector, strict=True)
    }


class _Free:
    """The orbit continued as if the surface were absent, from one tangency to the next."""

    def __init__(
        self, problem: OrbitProblem, u: Array, value: float, i: int, side: int, touch: Tangency
    ) -> None:
        shooting = problem.shooting
        others = [e for m in problem.solutions(u, value) for e in m.events if e.index == i]
        if any(abs(_apart(e.t - touch.t, problem, u, value)) > 1e-2 for e in others):
            raise UsageError("the orbit meets the surface elsewhere too")
        self.system = without_surface(shooting.system, i, side)
        self.problem, self.u, self.value, self.i, self.side = (
            problem.with_system(self.system), u, value, i, side
        )  # fmt: skip
        p, n = problem.p(value), shooting.n
        _, period = shooting.split(u, p)
        self.autonomous = shooting.period is None
        solution = solve(
            self.system, touch.x, (touch.t, touch.t + period), parameters=dict(
                zip(shooting.system.parameters.names, p.tolist(), strict=True)
            ), rtol=shooting.rtol, atol=shooting.atol, method=shooting.method,
        )  # fmt: skip
        if not solution.success:
            raise SolveError(f"the solution on beyond the grazing ended early: {solution.message}", solution)
        self.M = derivative_by_all(solution)[:n, :n]
        self.reduced = self.M
        if self.autonomous:
            part = mode_field(self.system, solution.start_mode)
            t, x = np.array([touch.t]), touch.x[None, :]
            f = part.part("f", t, x, part.multipliers(t, x, p), p)[0, :, 0]
            values, left = linalg.eig(self.M.T)
            k = int(np.argmin(np.abs(values - 1.0)))
            row = left[:, k].real
            self.reduced = self.M - np.outer(f, row) / float(row @ f)

    def multipliers(self, matrix: Array) -> Complex:
        """Multipliers of a return, without the trivial one of an autonomous orbit."""
        values = linalg.eigvals(matrix).astype(complex)
        return np.delete(values, int(np.argmin(np.abs(values - 1.0)))) if self.autonomous else values

    def rate(self, width: float) -> float:
        """d(least H)/d(value) of the orbit continued as if the surface were absent."""
        corrector, step = Corrector(self.problem, width), _ASIDE * width
        heights = []
        for way in (1.0, -1.0):
            point = corrector.fixed(self.u, self.value + way * step)
            solutions = self.problem.solutions(np.array(point.u), point.value)
            heights.append(nearest(tangencies(solutions, self.i, self.side)).height)
        return (heights[0] - heights[1]) / (2 * step)


def _apart(t: float, problem: OrbitProblem, u: Array, value: float) -> float:
    """A time between two events in periods, -1/2 to 1/2."""
    share = t / problem.shooting.split(u, problem.p(value))[1]
    return float(share - round(share))


def _sides(rate: float, name: str, value: float, width: float) -> tuple[str, str]:
    beyond, before = (">", "<") if rate < 0 else ("<", ">")
    return f"{name} {beyond} {number(value, width)}", f"{name} {before} {number(value, width)}"


def _counted(
    out: dict[str, float], free: _Free, at: DiscontinuityMap, name: str, value: float, width: float
) -> str:
    """The case q = 1."""
    rate = out["dH/dvalue"] = free.rate(width)
    beyond, before = _sides(rate, name, value, width)
    other = free.M @ (np.eye(len(at.vector)) - np.outer(at.vector, at.slope))
    first, second = free.multipliers(free.M), free.multipliers(other)
    out["multiplier"], out["multiplier beyond"] = (float(np.max(np.abs(v))) for v in (first, second))
    above = sum(_real(v, 1.0) for v in (first, second))
    below = sum(_real(-v, 1.0) for v in (first, second))
    kinds = [by_multipliers(v, LOCATED) for v in (first, second)]
    text = f"persistence: {kinds[0]} orbit for {before}, {kinds[1]} sliding one for {beyond}"
    if above % 2:
        both = f"{kinds[0]} orbit and {kinds[1]} sliding one"
        text = f"non-smooth fold: {both} for {before}, neither for {beyond}"
    return text + ("; a branch of twice the period leaves" if below % 2 else "")


def _real(values: Complex, least: float) -> int:
    return int(np.sum((np.abs(values.imag) < 1e-9) & (values.real > least)))


def _square_root(
    out: dict[str, float], free: _Free, at: DiscontinuityMap, name: str, value: float, width: float
) -> str:
    """The case q = 1/2."""
    rate = out["dH/dvalue"] = free.rate(width)
    beyond, before = _sides(rate, name, value, width)
    rows, column = [], at.vector
    for _ in range(_RETURNS):
        column = free.reduced @ column
        rows.append(float(at.slope @ column))
        if np.linalg.norm(column) < _LOST * np.linalg.norm(at.vector):
            break
    values = free.multipliers(free.M)
    largest = values[int(np.argmax(np.abs(values)))]
    total = float(at.slope @ linalg.solve(np.eye(len(column)) - free.reduced, free.reduced @ at.vector))
    out |= {"e1": rows[0], "sum e": total, "multiplier": float(np.abs(largest))}
    # sqrt(z) = -H_free/sum per unit of the parameter.
    out["root per value"] = abs(rate / total) if total else float("inf")
    one = f"an unstable orbit with one contact for {beyond if total > 0 else before}"
    verdict = by_multipliers(values, LOCATED)
    if verdict != "stable":
        return f"the grazing orbit is {verdict}; {one}"
    size = max(abs(v) for v in rows)
    if any(v < -1e-6 * size for v in rows):
        return f"no attractor near for {beyond} (e_n < 0); {one}"
    m = float(largest.real)
    how = "period adding with chaos between" if m > _WINDOWS else "period adding"
    return f"for {beyond} {'chaos at once' if m > _CHAOS else how} (largest multiplier {m:.4g}); {one}"
