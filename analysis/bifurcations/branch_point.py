"""Branch points: where a branch F(z) = 0, z = (u, parameter), meets another one.

There the matrix F_z (m, m + 1) has rank m - 1, and Newton's method in a plane across the branch is singular.
The larger equations

    F(z) + b e = 0,   F_z(z)^T e = 0,   e^T e = 1

for (z, b, e) are regular at simple branch points, with b = 0 (Govaerts 2000; Seydel 2010).
With a second parameter they give a curve; b = 0 on it where the branch point persists.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from filippov.analysis.algebra import linalg
from filippov.analysis.bifurcations.branch import BranchPoint
from filippov.analysis.orbits.shooting import NoConvergenceError
from filippov.base.arrays import Array
from filippov.base.changed import changed

_REACH, _ITERATIONS, _TOLERANCE, _NOISE, _UNFOLDED = 1e-5, 20, 1e-11, 1e-7, 1e-6


def start(matrix: Array) -> Array:
    """e to begin with: the left singular vector of the least singular value."""
    left, _, _ = linalg.svd(matrix)
    return np.asarray(left[:, -1], dtype=np.float64)


def extended(equations: Callable[[Array], tuple[Array, Array]], w: Array) -> tuple[Array, Array]:
    """Residual and matrix at w = (z, b, e): (2 m + 2,) and (2 m + 2, 2 m + 2).

    equations: z -> F (m,) and F_z (m, m + 1), z of size 1; F_zz by differences of F_z.
    """
    m = len(w) // 2 - 1
    z, b, e = w[: m + 1], float(w[m + 1]), w[m + 2 :]
    value, matrix = equations(z)
    residual = np.concatenate((value + b * e, matrix.T @ e, [e @ e - 1.0]))
    out = np.zeros((2 * m + 2, 2 * m + 2))
    out[:m, : m + 1], out[:m, m + 1], out[:m, m + 2 :] = matrix, e, b * np.eye(m)
    for j in range(m + 1):
        step = _REACH * np.eye(m + 1)[j]
        change = equations(z + step)[1] - equations(z - step)[1]
        out[m : 2 * m + 1, j] = change.T @ e / (2 * _REACH)
    out[m : 2 * m + 1, m + 2 :] = matrix.T
    out[-1, m + 2 :] = 2 * e
    return residual, out


def locate(equations: Callable[[Array], tuple[Array, Array]], z: Array) -> Array:
    """The branch point near z. Raises NoConvergenceError where there is none."""
    matrix = equations(z)[1]
    w, last = np.concatenate((z, [0.0], start(matrix))), np.inf
    for _ in range(_ITERATIONS):
        residual, slopes = extended(equations, w)
        change = linalg.solve(slopes, -residual)
        size = float(np.linalg.norm(change))
        if not size < 1.0:
            break
        w = w + change
        # Changes that no longer shrink are rounding of the solutions.
        if size < _TOLERANCE or (size < _NOISE and size > 0.1 * last):
            if abs(w[len(z)]) > _UNFOLDED:
                raise NoConvergenceError("two branches pass each other without meeting.")
            return np.asarray(w[: len(z)])
        last = size
    raise NoConvergenceError("no branch point was found.")


def apart(value: float, width: float) -> float:
    """How far neighbours are in a parameter whose bounds have a width: for differences."""
    return _REACH * min(max(abs(value), 1e-2), width)


class BranchPointCurve:
    """Branch points over a second parameter; unknowns (u, value, b, e). wide: the width of its bounds."""

    kind, wide = "branch point curve", float("inf")

    def __init__(self, inner: Any, parameter: str, u: Array, value: float, at: float, width: float) -> None:
        self.inner, self.parameter = inner, parameter
        self.sizes = np.append(inner.scale, width)
        z = np.append(u, value) / self.sizes
        e = start(self._equations(at)(z)[1])
        self.start = np.concatenate((np.append(u, value), [0.0], e))
        self.scale = np.concatenate((self.sizes, np.ones(1 + len(e))))

    def _equations(self, second: float) -> Callable[[Array], tuple[Array, Array]]:
        problem = self.inner.with_parameter(self.parameter, second)

        def equations(z: Array) -> tuple[Array, Array]:
            full = z * self.sizes
            residual, matrix = problem.evaluate(full[:-1], float(full[-1]))
            return residual, matrix * self.sizes

        return equations

    def evaluate(self, u: Array, value: float) -> tuple[Array, Array]:
        """See `filippov.analysis.bifurcations.branch_problem.BranchProblem`."""
        w = u / self.scale
        residual, matrix = extended(self._equations(value), w)
        reach = apart(value, self.wide)
        sides = [self._value(w, value + side * reach) for side in (1.0, -1.0)]
        return residual, np.column_stack((matrix / self.scale, (sides[0] - sides[1]) / (2 * reach)))

    def _value(self, w: Array, second: float) -> Array:
        m = len(w) // 2 - 1
        value, matrix = self._equations(second)(w[: m + 1])
        return np.concatenate((value + w[m + 1] * w[m + 2 :], matrix.T @ w[m + 2 :], [0.0]))

    def point(self, u: Array, value: float) -> BranchPoint:
        """See `filippov.analysis.bifurcations.branch_problem.BranchProblem`; "unfolding" is b."""
        k = len(self.sizes)
        problem = self.inner.with_parameter(self.parameter, value)
        found: BranchPoint = problem.point(u[: k - 1], float(u[k - 1])).named("branch point", problem.kind)
        data = {self.inner.parameter: float(u[k - 1]), "unfolding": float(u[k]), **found.coordinates}
        return replace(found, value=value, u=tuple(u.tolist()), coordinates=data, tests={}, word="",
                       special="")  # fmt: skip

    def moved(self, u: Array, value: float) -> BranchPointCurve:
        """See `filippov.analysis.bifurcations.branch_problem.BranchProblem`."""
        k = len(self.sizes)
        inner = self.inner.with_parameter(self.parameter, value).moved(u[: k - 1], float(u[k - 1]))
        return changed(self, inner=inner)
