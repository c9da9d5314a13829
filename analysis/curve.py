"""Curves of special points in two parameters: fold, branch point, period doubling, Neimark-Sacker, symmetry
breaking, Hopf, pseudo-Hopf, boundary equilibrium, grazing, and the changes of sliding: crossing-sliding,
switching-sliding, adding-sliding.

Unknowns are those of the solution and the first parameter; the equations are those of the solution and the
vanishing test function, whose derivatives are taken by differences of exact quantities. A fold is where the
bordered matrix has g = 0 in [J b; c 0] (v, g) = (0, 1) (Govaerts 2000, section 4.1). Grazing is
the least value of h along the motion that goes on as if the surface were not there; the changes of sliding
are in `filippov.analysis.sliding_border`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize_scalar

from filippov.analysis.branch import Branch, BranchPoint
from filippov.analysis.branch_point import BranchPointCurve
from filippov.analysis.branch_problem import MapProblem, OrbitProblem
from filippov.analysis.continuation import Continuation
from filippov.analysis.equilibrium_branch import EquilibriumProblem
from filippov.analysis.held_surface import without_surface
from filippov.analysis.shooting import NoConvergenceError
from filippov.analysis.sliding_border import ADDING, ARRIVALS, Contact, contacts
from filippov.analysis.special_points import stretches
from filippov.analysis.variation import mode_field
from filippov.errors import UsageError
from filippov.names import unknown
from filippov.solution import Solution

Array = npt.NDArray[np.float64]
_REACH, _SMALLEST = 1e-5, 1e-7
GRAZING = ("grazing-sliding", "C-bifurcation", "grazing")
BORDERS = (*ARRIVALS, ADDING)
# On the border itself an orbit enters and leaves sliding at one instant, which no location of events
# resolves: it is kept this far inside.
_ASIDE = 1e-9


def curve(
    run: Continuation,
    special: BranchPoint,
    *,
    parameter: str,
    bounds: tuple[float, float],
    direction: int = 0,
    step: float = 0.02,
    min_step: float = 1e-6,
    max_step: float = 0.1,
    max_points: int = 200,
    max_time: float = float("inf"),
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
    system = problem.event_map.system if isinstance(problem, MapProblem) else _system(problem)
    if parameter not in system.parameters or parameter == problem.parameter:
        raise UsageError(unknown("second parameter", parameter, run.branch.parameters))
    names = {name: name for name in special.tests}
    kind = "grazing" if special.special in GRAZING else names.get(special.special, special.special)
    if kind == "boundary equilibrium":
        kind = special.note.split("; ")[1].split(":")[0]
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
    system = problem.shooting.system
    i = next(k for k, surface in enumerate(system.surfaces) if f"surface {surface.name!r}" in special.note)
    orbit = problem.orbit(np.array(special.u), special.value)
    time = {1: 0.0, -1: 0.0, 0: 0.0}
    for mode, duration in stretches(orbit):
        time[mode[i]] += duration
    return i, 1 if time[1] > time[-1] else -1


def _least(motions: Sequence[Solution], i: int, side: int) -> float:
    """The least value of side h_i along the motions."""
    return min(_least_of(motion, i, side) for motion in motions)


def _least_of(motion: Solution, i: int, side: int) -> float:
    system, p, sol = motion.problem.system, motion.problem.p, motion.sol
    assert sol is not None
    part = mode_field(system, tuple(1 for _ in system.surfaces))

    def height(t: Array) -> Array:
        x = np.ascontiguousarray(np.atleast_2d(sol(t).T))
        return side * part.part("h", t, x, np.ones((t.size, len(system.surfaces))), p)[:, i, 0]

    ends = np.append(sol.start, motion.t_end)
    grid = np.append((ends[:-1, None] + np.diff(ends)[:, None] * np.arange(8) / 8).ravel(), ends[-1])
    values = height(grid)
    k = int(np.argmin(values))
    if not 0 < k < len(grid) - 1:
        return float(values[k])
    found = minimize_scalar(
        lambda t: float(height(np.array([t]))[0]), bounds=(float(grid[k - 1]), float(grid[k + 1])),
        method="bounded", options={"xatol": 1e-9 * abs(float(grid[k + 1] - grid[k - 1]))},
    )  # fmt: skip
    return min(float(values[k]), float(found.fun))


class CurveProblem:
    """A solution with a vanishing test function; the second parameter is the one that is followed."""

    def __init__(
        self, inner: Any, test: str, parameter: str, u: Array, value: float, at: float, width: float,
        grazed: tuple[int, int] = (0, 1),
    ) -> None:  # fmt: skip
        self.inner, self.test, self.parameter = inner, test, parameter
        self.kind = f"{test} curve"
        self.start = np.append(u, value)
        self.scale = np.append(inner.scale, width)
        if test == "fold":
            matrix = self._inner(at).evaluate(u, value)[1][:, :-1] * inner.scale
            left, _, right = np.linalg.svd(matrix)
            self.border = left[:, -1], right[-1]
        if isinstance(inner, OrbitProblem) and test == "grazing":
            self.grazed, self.side = grazed
            self.inner = inner.with_system(without_surface(inner.shooting.system, self.grazed, self.side))
        if test in BORDERS:
            # The contact is kept away from the ends of the motion, which it would leave by otherwise.
            self.grazed = grazed[0]
            contact = self._nearest(self._inner(at), u, value)
            self.inner, u = self._inner(at).phased(u, value, contact.t)
            self.start = np.append(u, value)
            self.contact = self._nearest(self.inner, u, value)

    def _inner(self, second: float) -> Any:
        return self.inner.with_parameter(self.parameter, second)

    def function(self, problem: Any, u: Array, value: float, matrix: Array) -> float:
        """The test function."""
        if self.test == "fold":
            b, c = self.border
            block = np.block([[matrix[:, :-1] * problem.scale, b[:, None]], [c[None, :], np.zeros((1, 1))]])
            return float(np.linalg.solve(block, np.append(np.zeros(len(u)), 1.0))[-1])
        if self.test == "grazing":
            return _least(problem.motions(u, value), self.grazed, self.side)
        if self.test in BORDERS:
            return self._contact(problem, u, value).gap - _ASIDE
        return float(problem.point(u, value).tests[self.test])

    def _found(self, problem: OrbitProblem, u: Array, value: float) -> list[Contact]:
        found = contacts(self.test, problem.motions(u, value), self.grazed)
        if not found:
            raise NoConvergenceError(f"the orbit has no contact with the border of sliding: {self.test}.")
        return found

    def _nearest(self, problem: OrbitProblem, u: Array, value: float) -> Contact:
        """The contact nearest to the border."""
        return min(self._found(problem, u, value), key=lambda contact: abs(contact.gap))

    def _contact(self, problem: OrbitProblem, u: Array, value: float) -> Contact:
        """The contact next to the last one."""
        shooting = problem.shooting
        scale = problem.scale[: shooting.n]
        period = 0.0 if shooting.period is None else float(shooting.period(problem.p(value)))
        found = self._found(problem, u, value)
        return min(found, key=lambda contact: contact.distance(self.contact, scale, period))

    def _both(self, z: Array) -> tuple[Array, Array, float]:
        """Residual and matrix of the solution, and the test, at (u, value, second)."""
        problem = self._inner(float(z[-1]))
        residual, matrix = problem.evaluate(z[:-2], float(z[-2]))
        return residual, matrix, self.function(problem, z[:-2], float(z[-2]), matrix)

    def evaluate(self, u: Array, value: float) -> tuple[Array, Array]:
        """See `filippov.analysis.branch_problem.BranchProblem`."""
        z = np.append(u, value)
        residual, matrix, test = self._both(z)
        m = len(residual)
        out = np.zeros((m + 1, m + 2))
        out[:m, : m + 1] = matrix
        reaches = _REACH * np.append(self.scale, max(abs(value), 1e-2))
        for j, reach in enumerate(reaches):
            moved = [self._both(z + side * reach * np.eye(m + 2)[j]) for side in (1.0, -1.0)]
            out[m, j] = (moved[0][2] - moved[1][2]) / (2 * reach)
            if j == m + 1:
                out[:m, j] = (moved[0][0] - moved[1][0]) / (2 * reach)
        return np.append(residual, test), out

    def point(self, u: Array, value: float) -> BranchPoint:
        """See `filippov.analysis.branch_problem.BranchProblem`."""
        found: BranchPoint = self._inner(value).point(u[:-1], float(u[-1]))
        data = {self.inner.parameter: float(u[-1]), **found.coordinates}
        # The word at a grazing changes with rounding.
        return replace(found, value=value, u=tuple(u.tolist()), coordinates=data, tests={}, word="")

    def moved(self, u: Array, value: float) -> CurveProblem:
        """See `filippov.analysis.branch_problem.BranchProblem`."""
        other = object.__new__(CurveProblem)
        other.__dict__.update(self.__dict__)
        inner = self._inner(value)
        if self.test in BORDERS:
            other.contact = self._contact(inner, u[:-1], float(u[-1]))
        other.inner = inner.moved(u[:-1], float(u[-1]))
        return other

    def ending(self, u: Array, value: float, bounds: tuple[float, float]) -> BranchPoint | None:
        """The end of a fold curve of a map whose cycle shrinks into the equilibrium set; None before that."""
        inner = self.inner
        if not isinstance(inner, MapProblem) or not inner.rests or np.exp(u[0]) > _SMALLEST:
            return None
        return replace(self.point(u, value), special="cycle shrinks into the equilibrium set")
