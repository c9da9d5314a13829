"""Boundary problems over several arcs by Gauss collocation on adapted meshes.

Unknowns are the states at the mesh points of each arc, the times between arcs and at the end, and free
parameters. Equations are the steps of collocation (`filippov.analysis.orbits.gauss_step`), at the end of an
arc its condition and the state handed over (`filippov.analysis.orbits.arcs`), and the boundary conditions.
Newton's method is damped by the natural monotonicity test; the matrix is sparse. The mesh is adapted so that
dt |u' - f(u)| is equally large on all steps. Source: Ascher, Mattheij & Russell 1988;
Deuflhard 2011, for the damping; Doedel, Keller & Kernevez 1991 for periodic and homoclinic
orbits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse
from scipy.sparse.linalg import splu

from filippov import ModelError, SolveError, System, UsageError
from filippov.analysis.orbits.arcs import Arc, Ending
from filippov.analysis.orbits.gauss_step import Steps, gauss_steps
from filippov.analysis.orbits.shooting import NoConvergenceError
from filippov.analysis.sensitivity.variation import mode_field
from filippov.base.arrays import Array
from filippov.solving.state.events import Mode
from filippov.solving.state.machine import Machine

# What dt |u' - f(u)| is to be on each step; ends of steps, of order 8, are much more accurate.
DEFECT = 1e-7
_FEWEST, _MOST, _REFINEMENTS = 3, 300, 9
# Of the distance from an equilibrium, in units of the size of the orbit, only so much counts.
_NEAREST = 1e-6
_ITERATIONS, _HALVINGS, _DONE, _BACKWARDS = 60, 14, 1e-11, 0.5
_ROUNDING = 1e-8
FAILURES = (SolveError, ModelError, ArithmeticError, np.linalg.LinAlgError)


@dataclass(frozen=True)
class Boundary:
    """Conditions on the first and last state, the last time and the free parameters, with their derivatives.

    left (r,); by_first, by_last (r, n); by_time (r,); by_free (r, free)
    """

    left: Array
    by_first: Array
    by_last: Array
    by_time: Array
    by_free: Array


@dataclass(frozen=True)
class Mesh:
    """An approximate solution: grids in [0, 1] and states (N + 1, n) of each arc, times (arcs + 1,), free
    parameters."""

    grids: tuple[Array, ...]
    states: tuple[Array, ...]
    times: Array
    free: Array

    @classmethod
    def from_arcs(cls, arcs: Sequence[Arc], counts: Sequence[int], free: Sequence[float] = ()) -> Mesh:
        """Meshes laid along arcs, equal in the length of the solution as well as in time."""
        grids, states = [], []
        for arc, count in zip(arcs, counts, strict=True):
            width = float(arc.t[-1] - arc.t[0])
            part = (arc.t - arc.t[0]) / width if width > 0 else np.linspace(0, 1, len(arc.t))
            size = np.maximum(np.ptp(arc.x, axis=0), 1e-300)
            far = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(arc.x, axis=0) / size, axis=1)))
            mixed = 0.5 * part + 0.5 * far / max(far[-1], 1e-300)
            keep = np.append(True, np.diff(mixed) > 0)
            grid = np.interp(np.linspace(0, 1, count + 1), mixed[keep] / mixed[-1], part[keep])
            grid[0], grid[-1] = 0.0, 1.0
            grids.append(grid)
            states.append(np.column_stack([np.interp(grid, part, row) for row in arc.x.T]))
        times = np.array([arcs[0].t[0], *(arc.t[-1] for arc in arcs)])
        return cls(tuple(grids), tuple(states), times, np.array(free, dtype=float))


class BoundaryProblem:
    """Equations of one sequence of arcs.

    modes, endings  of the arcs (one ending fewer)
    values, names   parameter values (all of them), and which of them are free
    boundary        (first state, last state, last time, parameter values) -> Boundary, with
                    n + 1 + number of free parameters conditions
    size            of each state, (n,)
    origin          a state near which errors are measured by the distance from it: an equilibrium that the
                    solution leaves or comes to
    """

    def __init__(
        self, system: System, modes: Sequence[Mode], endings: Sequence[Ending], values: Array,
        boundary: Callable[[Array, Array, float, Array], Boundary], size: Array, *,
        names: tuple[str, ...] = (), jacobian: Any = None, origin: Array | None = None,
    ) -> None:  # fmt: skip
        if system.inputs:
            raise UsageError(
                "collocation takes the field of an arc for smooth, and inputs have knots. Use the method "
                "'shooting', whose solutions meet the knots."
            )
        self.origin = origin
        self.system, self.modes, self.endings, self.values = system, tuple(modes), tuple(endings), values
        self.boundary, self.size, self.names, self.jacobian = boundary, size, names, jacobian
        self.n = system.dimension
        self.places = [system.parameters.index(name) for name in names]

    def sizes(self, steps: Steps) -> Array:
        """What defects are measured by on each step: (N, 1, n)."""
        out = np.broadcast_to(self.size, (len(steps.start), 1, self.n))
        if self.origin is None:
            return out
        ends = np.abs(steps.start - self.origin), np.abs(steps.end - self.origin)
        away = np.linalg.norm(np.minimum(*ends), axis=1)
        part = np.clip(away / np.linalg.norm(self.size), _NEAREST, 1.0)
        return np.asarray(out * part[:, None, None])

    def p(self, free: Array) -> Array:
        """All parameter values."""
        out = self.values.copy()
        out[self.places] = free
        return out

    def steps(self, mesh: Mesh) -> list[Steps]:
        """The steps of each arc."""
        p = self.p(mesh.free)
        return [
            gauss_steps(mode_field(self.system, mode, self.names, self.jacobian), x, t0, t1, grid, p)
            for mode, grid, x, (t0, t1) in zip(
                self.modes, mesh.grids, mesh.states, pairwise(mesh.times.tolist()), strict=True
            )
        ]

    def equations(self, mesh: Mesh) -> tuple[Array, scipy.sparse.csc_array]:
        """Residual and matrix by (states, times after the first, free parameters)."""
        n, free, p = self.n, len(self.places), self.p(mesh.free)
        machine = Machine(self.system, "DOP853", p)
        offsets = np.cumsum([0, *(len(x) * n for x in mesh.states)])
        time0, total = int(offsets[-1]), int(offsets[-1]) + len(mesh.times) - 1 + free
        left: list[Array] = []
        rows: list[npt.NDArray[np.int64]] = []
        columns: list[npt.NDArray[np.int64]] = []
        entries: list[Array] = []
        row = 0

        def put(at: int, column: int, block: Array) -> None:
            i, j = np.indices(block.shape, dtype=np.int64)
            rows.append((at + i).ravel())
            columns.append((column + j).ravel())
            entries.append(np.asarray(block, dtype=float).ravel())

        def by_times(at: int, k: int, block: Array) -> None:
            """Derivatives by times k and so on; the first time is known."""
            for j, column in enumerate(block.T):
                if k + j > 0:
                    put(at, time0 + k + j - 1, column[:, None])

        for k, steps in enumerate(self.steps(mesh)):
            x, begin = mesh.states[k], int(offsets[k])
            for j in range(len(x) - 1):
                put(row, begin + j * n, -steps.by_state[j])
                put(row, begin + (j + 1) * n, np.eye(n))
                by_times(row, k, -steps.by_times[j])
                put(row, total - free, -steps.by_parameters[j])
                row += n
            left.append((x[1:] - steps.end).ravel())
            if k < len(self.endings):
                ending, t, last = self.endings[k], float(mesh.times[k + 1]), int(offsets[k + 1]) - n
                value, slope = ending.condition(self.system, self.names, self.jacobian, t, x[-1], p)
                after, by = ending.follow(self.system, self.names, machine, t, x[-1], p)
                left += [np.array([value]), mesh.states[k + 1][0] - after]
                both = np.vstack([slope, -by])
                put(row, last, both[:, :n])
                put(row, total - free, both[:, n:-1])
                by_times(row, k + 1, both[:, -1:])
                put(row + 1, int(offsets[k + 1]), np.eye(n))
                row += n + 1
        ends = self.boundary(mesh.states[0][0], mesh.states[-1][-1], float(mesh.times[-1]), p)
        put(row, 0, ends.by_first)
        put(row, time0 - n, ends.by_last)
        put(row, total - free - 1, ends.by_time[:, None])
        put(row, total - free, ends.by_free)
        left.append(ends.left)
        matrix = scipy.sparse.coo_array(
            (np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns))), shape=(total, total)
        )
        return np.concatenate(left), matrix.tocsc()

    def scale(self, mesh: Mesh) -> Array:
        """Size of each unknown."""
        sizes = [np.tile(self.size, len(x)) for x in mesh.states]
        length = float(mesh.times[-1] - mesh.times[0])
        return np.concatenate(
            [*sizes, np.full(len(mesh.times) - 1, length), np.maximum(np.abs(mesh.free), 1e-3)]
        )

    def moved(self, mesh: Mesh, change: Array) -> Mesh:
        """The mesh with changed unknowns."""
        states, k = [], 0
        for x in mesh.states:
            states.append(x + change[k : k + x.size].reshape(x.shape))
            k += x.size
        count = len(mesh.times) - 1
        times = mesh.times + np.append(0.0, change[k : k + count])
        return Mesh(mesh.grids, tuple(states), times, mesh.free + change[k + count :])


def newton(problem: BoundaryProblem, mesh: Mesh) -> Mesh:
    """Solve the equations on a mesh. Raises NoConvergenceError."""
    scale = problem.scale(mesh)
    try:
        with np.errstate(all="ignore"):
            left, matrix = problem.equations(mesh)
            factors = _factors(matrix, scale)
            change = factors(left)
            damping, last = 1.0, np.inf
            for _ in range(_ITERATIONS):
                size = float(np.linalg.norm(change)) / np.sqrt(len(change))
                if not np.isfinite(size):
                    break
                if size < _DONE or (size < 1e-8 and size > 0.3 * last):
                    return problem.moved(mesh, change * scale)
                if np.min(np.diff(mesh.times)) < -_BACKWARDS * (mesh.times[-1] - mesh.times[0]):
                    raise NoConvergenceError("an arc shrinks to nothing: the modes follow in another order.")
                damping = min(1.0, 4.0 * damping, _longest(mesh, change * scale))
                for _ in range(_HALVINGS):
                    trial = problem.moved(mesh, damping * change * scale)
                    try:
                        rest, following = problem.equations(trial)
                        simplified = factors(rest)
                        shrunk = float(np.linalg.norm(simplified)) / np.sqrt(len(change))
                    except FAILURES:
                        shrunk = np.inf
                    if shrunk <= (1.0 - 0.25 * damping) * size:
                        break
                    damping *= 0.5
                else:
                    if size < _ROUNDING:
                        # Rounding of the equations is what is left; who asked confirms the solution.
                        return mesh
                    break
                last = size
                mesh, left, matrix = trial, rest, following
                factors = _factors(matrix, scale)
                change = factors(left)
    except NoConvergenceError:
        raise
    except FAILURES as error:
        raise NoConvergenceError(f"collocation: {error}") from None
    raise NoConvergenceError("Newton's method on the equations of collocation does not converge.")


def _factors(matrix: scipy.sparse.csc_array, scale: Array) -> Callable[[Array], Array]:
    """The solution of -matrix (scale z) = left, as a function of left."""
    scaled = matrix @ scipy.sparse.diags_array(scale)
    weights = np.asarray(abs(scaled).max(axis=1).todense()).ravel()
    if not np.all(np.isfinite(weights)) or np.any(weights == 0):
        raise NoConvergenceError("an equation depends on no unknown.")
    rows = 1.0 / weights
    try:
        lu = splu((scipy.sparse.diags_array(rows) @ scaled).tocsc())
    except RuntimeError as error:
        raise NoConvergenceError(f"the equations are singular ({error}).") from None
    return lambda left: np.asarray(lu.solve(-rows * left))


def _longest(mesh: Mesh, change: Array) -> float:
    """The part of a step that changes no duration by more than half of the whole.

    Durations may be negative on the way: solutions go back in time then, which is as smooth.
    """
    states = sum(x.size for x in mesh.states)
    moves = np.append(0.0, change[states : states + len(mesh.times) - 1])
    largest = float(np.max(np.abs(np.diff(moves))))
    return 0.5 * float(mesh.times[-1] - mesh.times[0]) / max(largest, 1e-300)


def solved(problem: BoundaryProblem, mesh: Mesh, defect: float = DEFECT) -> tuple[Mesh, list[Steps]]:
    """The solution on a mesh on which every step has at most this defect. Raises NoConvergenceError."""
    for _ in range(_REFINEMENTS):
        mesh = newton(problem, mesh)
        p = problem.p(mesh.free)
        steps = problem.steps(mesh)
        grids, states, largest = [], [], 0.0
        for mode, step in zip(problem.modes, steps, strict=True):
            field = mode_field(problem.system, mode, problem.names, problem.jacobian)
            defects = step.defects(field, p, problem.sizes(step))
            largest = max(largest, float(np.max(defects)))
            grid = _equidistributed(step.grid, defects, defect)
            grids.append(grid)
            states.append(step.at(grid))
        if largest <= defect:
            return mesh, steps
        mesh = Mesh(tuple(grids), tuple(states), mesh.times, mesh.free)
    raise NoConvergenceError(
        f"collocation: the mesh of {sum(map(len, grids))} points leaves a defect of {largest:.3g}, more than "
        f"{defect:g}. The orbit may touch a surface or a singular point of the field."
    )


def _equidistributed(grid: Array, defects: Array, goal: float) -> Array:
    """A grid on which all steps have about the same defect, half of the goal where that is possible."""
    ratio = np.clip(defects / (0.3 * goal), 1e-4, 1e8) ** 0.2
    ratio = np.maximum(ratio, 0.05 * np.max(ratio))
    total = np.append(0.0, np.cumsum(ratio))
    count = int(np.clip(np.ceil(total[-1]), _FEWEST, _MOST))
    out = np.interp(np.linspace(0, total[-1], count + 1), total, grid)
    out[0], out[-1] = 0.0, 1.0
    return np.asarray(out)
