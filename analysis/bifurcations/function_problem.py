"""Zeros of a function (u, value) -> residual, as a continuation follows them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from filippov.analysis.algebra import linalg
from filippov.analysis.algebra.growth import by_eigenvalues
from filippov.analysis.bifurcations.branch import BranchPoint
from filippov.analysis.orbits.shooting import NoConvergenceError
from filippov.base.arrays import Array


class FunctionProblem:
    """Zeros of a function (u, value) -> residual, as many as unknowns; derivatives by differences."""

    kind = "function"

    def __init__(self, function: Callable[[Array, float], Any], start: Any) -> None:
        self.function = function
        self.start = np.atleast_1d(np.asarray(start, dtype=float))
        self.scale = np.maximum(np.abs(self.start), 1.0)

    def residual(self, u: Array, value: float) -> Array:
        """The function's value, checked."""
        left = np.atleast_1d(np.asarray(self.function(u, value), dtype=float))
        if left.shape != u.shape:
            raise NoConvergenceError(f"the function returned {left.shape}, expected {u.shape} numbers.")
        if not np.all(np.isfinite(left)):
            raise NoConvergenceError(f"the function is not finite at {u.tolist()}, {value:.6g}.")
        return left

    def evaluate(self, u: Array, value: float) -> tuple[Array, Array]:
        """See `BranchProblem`."""
        z = np.append(u, value)
        columns = []
        for j in range(z.size):
            reach = 6e-6 * max(abs(z[j]), 1e-2)
            sides = []
            for side in (1.0, -1.0):
                moved = z.copy()
                moved[j] += side * reach
                sides.append(self.residual(moved[:-1], float(moved[-1])))
            columns.append((sides[0] - sides[1]) / (2 * reach))
        return self.residual(u, value), np.array(columns).T

    def point(self, u: Array, value: float) -> BranchPoint:
        """See `BranchProblem`; stability is that of u' = F(u, value)."""
        left, matrix = self.evaluate(u, value)
        values = linalg.eigvals(matrix[:, :-1])
        data = {f"u{j}": float(v) for j, v in enumerate(u)}
        return BranchPoint(
            value, tuple(u.tolist()), data, tuple(complex(v) for v in values), by_eigenvalues(values),
            residual=float(np.max(np.abs(left))),
        )  # fmt: skip

    def moved(self, u: Array, value: float) -> FunctionProblem:
        """See `BranchProblem`."""
        return self
