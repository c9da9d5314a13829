"""Curves of special points in two parameters: fold, branch point, period doubling, Neimark-Sacker, symmetry
breaking, Hopf, pseudo-Hopf, boundary equilibrium, grazing, and the changes of sliding: crossing-sliding,
switching-sliding, adding-sliding.

Unknowns are those of the solution and the first parameter; the equations are those of the solution and the
vanishing test function, whose derivatives are taken by differences of exact quantities. A fold is where the
bordered matrix has g = 0 in [J b; c 0] (v, g) = (0, 1) (Govaerts 2000). Grazing is
the least value of h along the solution that goes on as if the surface were not there; the changes of sliding
are in `filippov.analysis.bifurcations.sliding_border`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from filippov.analysis.algebra import linalg
from filippov.analysis.bifurcations.border_normal_form import grazed_surface
from filippov.analysis.bifurcations.branch import Branch, BranchPoint
from filippov.analysis.bifurcations.branch_point import BranchPointCurve, apart
from filippov.analysis.bifurcations.branch_problem import MapProblem, OrbitProblem
from filippov.analysis.bifurcations.codim2 import border_tests, critical_pair, orbit_multipliers, smooth_tests
from filippov.analysis.bifurcations.continuation import Continuation
from filippov.analysis.bifurcations.discontinuity_map import second_rate
from filippov.analysis.bifurcations.equilibrium_branch import EquilibriumProblem
from filippov.analysis.bifurcations.held_surface import without_surface
from filippov.analysis.bifurcations.sliding_border import ADDING, ARRIVALS, Contact, contacts
from filippov.analysis.bifurcations.tangency import Tangency, tangencies
from filippov.analysis.orbits.shooting import NoConvergenceError
from filippov.base.arrays import Array
from filippov.base.changed import changed
from filippov.base.errors import UsageError
from filippov.base.given import Count, Interval, Positive
from filippov.base.keywords import keywords
from filippov.base.names import unknown

_REACH, _SMALLEST = 1e-5, 1e-7
GRAZING = ("grazing-sliding", "C-bifurcation", "grazing")
BORDERS = (*ARRIVALS, ADDING)
CONTACTS = ("grazing", *BORDERS)
# On the border itself an orbit enters and leaves sliding at one instant, which event location does not
# resolve: it is kept this far inside.
_ASIDE = 1e-9


@keywords()
def curve(
    run: Continuation,
    special: BranchPoint,
    *,
    parameter: str,
    bounds: Interval,
    direction: int = 0,
    step: Positive = 0.02,
    min_step: Positive = 1e-6,
    max_step: Positive = 0.1,
    max_points: Count = 200,
    max_time: Positive = float("inf"),
) -> Continuation:
    """The curve of a special point over a second parameter, not begun: iterate over it, or `run()` it.

    run        the continuation that found it (its problem is used); special: the point
    parameter  the second parameter, from its value in `run` within `bounds`

    Points have the first parameter among their coordinates. Raises UsageError, NoConvergenceError.
    """
    problem: Any = run.problem
    if not isinstance(problem, MapProblem | OrbitProblem | EquilibriumProblem):
        raise UsageError("curves are for maps, orbits and equilibria, not for a plain function.")
    if isinstance(problem, OrbitProblem) and special.phase:
        problem = problem.at_phase(special.phase)
    if isinstance(problem, EquilibriumProblem):
        # The branch may have gone on in another mode.
        problem = problem.in_mode(special.modes[0], np.array(special.u))
    system = problem.event_map.system if isinstance(problem, MapProblem) else _system(problem)
    if parameter not in system.parameters or parameter == problem.parameter:
        raise UsageError(unknown("second parameter", parameter, run.branch.parameters))
    names = {name: name for name in special.tests}
    kind = "grazing" if special.special in GRAZING else names.get(special.special, special.special)
    if kind == "boundary equilibrium":
        kind = special.test
    if kind not in (*special.tests, "grazing", "branch point", *BORDERS):
        known = ", ".join(dict.fromkeys((*special.tests, "branch point", "grazing", *BORDERS)))
        raise UsageError(f"no curve is known for {special.special!r}; known: {known}.")
    at = run.branch.parameters[parameter]
    grazed = _grazed(problem, special) if kind in ("grazing", *BORDERS) else (0, 1)
    u = np.array(special.u)
    made: Any
    if kind == "branch point":
        made = BranchPointCurve(problem, parameter, u, special.value, at, run.width)
    else:
        made = CurveProblem(problem, kind, parameter, u, special.value, at, run.width, grazed)
    made.wide = float(bounds[1]) - float(bounds[0])
    others = {name: number for name, number in run.branch.parameters.items() if name != parameter}
    branch = Branch(parameter, f"{kind} curve", others)
    out = Continuation(made, at, (float(bounds[0]), float(bounds[1])), branch, direction, step)
    out.min_step, out.max_step, out.max_points, out.max_time = min_step, max_step, max_points, max_time
    out.prepare()
    return out


def _system(problem: OrbitProblem | EquilibriumProblem) -> Any:
    return problem.shooting.system if isinstance(problem, OrbitProblem) else problem.system


def _grazed(problem: Any, special: BranchPoint) -> tuple[int, int]:
    """The surface that is grazed, and the side the orbit is on."""
    return grazed_surface(problem.doubled() if problem.shooting.symmetry_order > 1 else problem, special)


class CurveProblem:
    """A solution with a vanishing test function; the second parameter is the one that is followed.

    straight   a curve whose direction changes by less than this per length is straight, to the accuracy of
               its tangents
    wide       the width of the bounds of the second parameter
    """

    straight, wide = 1e-3, float("inf")

    def __init__(
        self, inner: Any, test: str, parameter: str, u: Array, value: float, at: float, width: float,
        grazed: tuple[int, int] = (0, 1), avoid: Tangency | None = None,
    ) -> None:  # fmt: skip
        if test == "grazing" and isinstance(inner, OrbitProblem) and inner.shooting.symmetry_order > 1:
            # The tangency may be in any part of a symmetric orbit.
            inner = inner.doubled()
        self.inner, self.test, self.parameter = inner, test, parameter
        self.kind = f"{test} curve"
        self.start = np.append(u, value)
        self.scale = np.append(inner.scale, width)
        if test == "fold":
            matrix = self._inner(at).evaluate(u, value)[1][:, :-1] * inner.scale
            left, _, right = linalg.svd(matrix)
            self.border = left[:, -1], right[-1]
        if test in CONTACTS:
            self.grazed, self.side = grazed
            if test == "grazing" and inner.shooting.system.surfaces[self.grazed].kind != "observer":
                self.inner = inner.with_system(
                    without_surface(inner.shooting.system, self.grazed, self.side)
                )
            # The contact is kept away from the ends of the solution, which it might cross otherwise.
            contact = self._nearest(self._inner(at), u, value, avoid)
            self.inner, u = self._inner(at).phased(u, value, contact.t)
            self.start = np.append(u, value)
            self.contact = self._nearest(self.inner, u, value, avoid)

    @property
    def of_units(self) -> bool:
        """Whether the equations have the units of the states and of the time."""
        return getattr(self.inner, "of_units", False)

    def _inner(self, second: float) -> Any:
        return self.inner.with_parameter(self.parameter, second)

    def function(self, problem: Any, u: Array, value: float, matrix: Array | None = None) -> float:
        """The test function; matrix: of the solution, which that of a fold needs."""
        if self.test == "fold":
            assert matrix is not None
            b, c = self.border
            block = np.block([[matrix[:, :-1] * problem.scale, b[:, None]], [c[None, :], np.zeros((1, 1))]])
            return float(linalg.solve(block, np.append(np.zeros(len(u)), 1.0))[-1])
        if self.test in CONTACTS:
            gap = self._contact(problem, u, value).gap
            return gap if self.test == "grazing" else gap - _ASIDE
        return float(problem.point(u, value).tests[self.test])

    def _found(self, problem: OrbitProblem, u: Array, value: float) -> Sequence[Contact | Tangency]:
        solutions = problem.solutions(u, value)
        found: Sequence[Contact | Tangency] = (
            tangencies(solutions, self.grazed, self.side)
            if self.test == "grazing"
            else contacts(self.test, solutions, self.grazed)
        )
        if not found:
            raise NoConvergenceError(f"the orbit has no contact with the border of sliding: {self.test}.")
        return found

    def _nearest(
        self, problem: OrbitProblem, u: Array, value: float, avoid: Tangency | None = None
    ) -> Contact | Tangency:
        """The contact nearest to the border, other than one that is to be avoided."""
        found = list(self._found(problem, u, value))
        if avoid is not None:
            found.remove(self._next(problem, value, found, avoid))
        if not found:
            raise NoConvergenceError("the orbit has no other contact with the surface.")
        return min(found, key=lambda contact: abs(contact.gap))

    def _next(
        self, problem: OrbitProblem, value: float, found: Sequence[Contact | Tangency], to: Any
    ) -> Contact | Tangency:
        """The contact next to another one."""
        shooting = problem.shooting
        scale = problem.scale[: shooting.n]
        period = 0.0 if shooting.period is None else float(shooting.period(problem.p(value)))
        return min(found, key=lambda contact: contact.distance(to, scale, period))

    def _contact(self, problem: OrbitProblem, u: Array, value: float) -> Contact | Tangency:
        """The contact next to the last one."""
        return self._next(problem, value, self._found(problem, u, value), self.contact)

    def tests(self, u: Array, value: float, point: BranchPoint) -> dict[str, float]:
        """Test functions of codimension-2 points (see `filippov.analysis.bifurcations.codim2`)."""
        inner, u, first = self._inner(value), u[:-1], float(u[-1])
        if self.test not in CONTACTS:
            null = self._null(inner.evaluate(u, first)[1], inner) if self.test == "fold" else None
            return smooth_tests(self.test, inner, u, first, point, null)
        values, near = orbit_multipliers(inner, u, first, point), self._found(inner, u, first)
        contact = self._next(inner, first, near, self.contact)
        others: list[float] = []
        bend = None
        if self.test == "grazing":
            others = [q.gap for q in near if q is not contact]
        elif self.test in ARRIVALS:
            bend = self._bend(inner, first, contact)
        return border_tests(self.test, values, others, bend)

    def _null(self, matrix: Array, inner: Any) -> tuple[Array, Array]:
        """Left and right null vectors of a fold, in the sense of the border."""
        b, c = self.border
        block = np.block([
            [matrix[:, :-1] * inner.scale, b[:, None]], [c[None, :], np.zeros((1, 1))]
        ])  # fmt: skip
        last = np.append(np.zeros(len(c)), 1.0)
        p, q = linalg.solve(block.T, last)[:-1], linalg.solve(block, last)[:-1]
        return p / np.linalg.norm(p), q / np.linalg.norm(q)

    def _bend(self, inner: OrbitProblem, value: float, contact: Any) -> float | None:
        """L_F2^2 H at an arrival; None where it is not known."""
        system, side = inner.shooting.system, contact.side
        mode = tuple(side if k == self.grazed else 1 for k in range(len(system.surfaces)))
        if len(system.surfaces) > 1:
            return None
        try:
            return second_rate(system, contact.x, contact.t, inner.p(value), mode, self.grazed, side)
        except UsageError:
            return None

    def _left(self, z: Array, matrix: bool = False) -> tuple[Array, Array | None]:
        """The residual of the equations at (u, value, second), and the matrix of the solution where it is
        requested, or needed for the test."""
        problem, u, value = self._inner(float(z[-1])), z[:-2], float(z[-2])
        if self.test in CONTACTS and not matrix:
            return np.append(problem.residual(u, value), self.function(problem, u, value)), None
        residual, slopes = problem.evaluate(u, value)
        return np.append(residual, self.function(problem, u, value, slopes)), slopes

    def residual(self, u: Array, value: float) -> Array:
        """The residual of the equations."""
        return self._left(np.append(u, value))[0]

    def room(self, u: Array, tangent: Array) -> float:
        """See `filippov.analysis.bifurcations.branch_problem.MapProblem.room`."""
        return self.inner.room(u[:-1], tangent) if isinstance(self.inner, MapProblem) else 0.0

    def evaluate(self, u: Array, value: float) -> tuple[Array, Array]:
        """See `filippov.analysis.bifurcations.branch_problem.BranchProblem`."""
        return self._evaluated(np.append(u, value), (1.0, -1.0))

    def roughly(self, u: Array, value: float) -> tuple[Array, Array]:
        """The same with differences to one side, good enough for a corrector: half as many neighbours."""
        return self._evaluated(np.append(u, value), (1.0, 0.0))

    def _evaluated(self, z: Array, sides: tuple[float, float]) -> tuple[Array, Array]:
        here, matrix = self._left(z, True)
        m = len(here) - 1
        out = np.zeros((m + 1, m + 2))
        out[:m, : m + 1] = matrix
        reaches = np.append(_REACH * self.scale, apart(z[-1], self.wide))
        for j, reach in enumerate(reaches):
            step = reach * np.eye(m + 2)[j]
            one, other = (self._left(z + side * step)[0] if side else here for side in sides)
            slope = (one - other) / ((sides[0] - sides[1]) * reach)
            out[m, j] = slope[m]
            if j == m + 1:
                out[:m, j] = slope[:m]
        return here, out

    def point(self, u: Array, value: float) -> BranchPoint:
        """See `filippov.analysis.bifurcations.branch_problem.BranchProblem`."""
        found: BranchPoint = self._inner(value).point(u[:-1], float(u[-1]))
        data = {self.inner.parameter: float(u[-1]), **found.coordinates}
        note = found.note
        if self._is_neutral(found):
            note = "; ".join(filter(None, (note, "neutral saddle")))
        else:
            found = replace(found.named(self.test, self.inner.kind), special=found.special)
        # The word at a grazing changes with rounding.
        return replace(
            found, value=value, u=tuple(u.tolist()), coordinates=data, word="",
            tests=self.tests(u, value, found), note=note,
        )  # fmt: skip

    def _is_neutral(self, point: BranchPoint) -> bool:
        """Whether the pair of a Hopf or Neimark-Sacker curve is real."""
        hopf, values = self.test == "Hopf", np.array(point.multipliers, dtype=complex)
        if (not hopf and self.test != "Neimark-Sacker") or len(values) < 2:
            return False
        pair, _ = critical_pair(values, hopf)
        return bool(np.max(np.abs(pair.imag)) < 1e-9)

    def moved(self, u: Array, value: float) -> CurveProblem:
        """See `filippov.analysis.bifurcations.branch_problem.BranchProblem`."""
        inner = self._inner(value)
        other = changed(self, inner=inner.moved(u[:-1], float(u[-1])))
        if self.test == "fold":
            other.border = self._null(inner.evaluate(u[:-1], float(u[-1]))[1], inner)
        if self.test in CONTACTS:
            other.contact = self._contact(inner, u[:-1], float(u[-1]))
        return other

    def ending(self, u: Array, value: float, bounds: tuple[float, float]) -> BranchPoint | None:
        """The end of a fold curve of a map whose cycle shrinks into the equilibrium set; None before that."""
        inner = self.inner
        if not isinstance(inner, MapProblem) or not inner.rests:
            return None
        if u[0] > inner.start[0] + np.log(_SMALLEST):
            return None
        return replace(self.point(u, value), special="cycle shrinks into the equilibrium set")
