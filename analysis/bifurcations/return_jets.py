"""The return map of a fixed point or orbit as a function, for its higher derivatives.

A forced orbit returns after its period; an autonomous one to the plane normal to its velocity at the initial
state of its equations. A map that rests at 0 is taken in the logarithm of its coordinate.
"""

from __future__ import annotations

import numpy as np

from filippov import Solution, UsageError
from filippov.analysis.algebra import linalg
from filippov.analysis.bifurcations.branch_problem import MapProblem, OrbitProblem
from filippov.analysis.bifurcations.jets import Jets, OutsideError
from filippov.analysis.orbits.shooting import NoConvergenceError, velocity_at
from filippov.analysis.sensitivity.saltation import derivative_by_all
from filippov.base.arrays import Array

_RETURNS = 8


def return_jets(problem: MapProblem | OrbitProblem, u: Array, value: float) -> tuple[Jets, Array]:
    """Jets of the return map at a solution, and the states (n, k) along its k coordinates.

    Raises UsageError where the state lies on a sliding surface or the orbit has several nodes, and what the
    solutions raise; the jets raise OutsideError where neighbouring solutions meet other events.
    """
    if isinstance(problem, MapProblem):
        return _map_jets(problem, u, value)
    shooting = problem.shooting
    if len(shooting.shares) != 1:
        raise UsageError("the orbit has several nodes; find it with one (nodes=1) for its coefficients.")
    if shooting.sliding[0]:
        raise UsageError("the state that the orbit begins with slides; coefficients need one that does not.")
    made = _Return(problem, u, value)
    return Jets(made.matrix, made.directions.shape[1]), made.directions


def _map_jets(problem: MapProblem, u: Array, value: float) -> tuple[Jets, Array]:
    scale = problem.scale[0] if not problem.rests else 1.0

    def matrix(z: Array) -> Array:
        jet = problem.jet(u + scale * z, value)
        slope = jet[1] * problem.d(u + scale * z) / jet[0] if problem.rests else jet[1]
        return np.array([[slope]])

    moves = scale * (problem.d(u) if problem.rests else 1.0)
    return Jets(matrix, 1), np.array([[moves]])


class _Return:
    """x -> G^-1 Phi(x), on the plane normal to the velocity where the system is autonomous."""

    def __init__(self, problem: OrbitProblem, u: Array, value: float) -> None:
        shooting = problem.shooting
        self.shooting, self.p = shooting, problem.p(value)
        self.u, self.x, self.gate = u, u[: shooting.n], linalg.inv(shooting.gate)
        scale = problem.scale[: shooting.n]
        if shooting.period is None:
            solution = problem.solutions(u, value)[0]
            f = velocity_at(shooting.system, solution.start_mode, solution.problem.t_span[0], self.x, self.p)
            # Orthonormal in scaled states: the plane is normal to the velocity there.
            self.normal = f / scale**2
            self.directions = scale[:, None] * linalg.null_space((f / scale)[None, :])
        else:
            self.directions = np.diag(scale)
        self.back = linalg.pinv(self.directions)
        self.word = [segment.mode for segment in problem.solutions(u, value)[0].segments]

    def matrix(self, z: Array) -> Array:
        """dR/dz at x + directions z."""
        x = self.x + self.directions @ z
        shooting, n = self.shooting, self.shooting.n
        u = np.append(x, self.u[n:])
        if shooting.period is not None:
            solution = shooting.solutions(u, self.p)[0]
            by = derivative_by_all(solution, False, (), shooting.jacobian)[:n, :n]
            self._same(solution)
            return np.asarray(self.back @ self.gate @ by @ self.directions)
        for _ in range(_RETURNS):
            solution = shooting.solutions(u, self.p)[0]
            end = solution.end_mode, solution.t_end, solution.x_end
            f = self.gate @ velocity_at(shooting.system, *end, self.p)
            gap = float(self.normal @ (self.gate @ solution.x_end - self.x))
            late = gap / float(self.normal @ f)
            if abs(late) < 1e-11 * u[-1]:
                break
            u[-1] -= late * shooting.symmetry_order
        else:
            raise NoConvergenceError("the solution does not come back to the plane across the orbit.")
        self._same(solution)
        by = derivative_by_all(solution, False, (), shooting.jacobian)[:n, :n]
        on = np.eye(n) - np.outer(f, self.normal) / float(self.normal @ f)
        return np.asarray(self.back @ on @ self.gate @ by @ self.directions)

    def _same(self, solution: Solution) -> None:
        modes = [segment.mode for segment in solution.segments]
        if modes != self.word:
            raise OutsideError("another sequence of modes.")
