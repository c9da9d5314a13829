"""Random two-folds of affine fields in R^3, and where sliding near them ends: nothing of the package.

The sliding field times b - a (a, b the rates of h on both sides) is smooth at a two-fold, a = b = 0, and has
an equilibrium there (Filippov 1988). Its solutions are computed by scipy; those that converge to
the equilibrium are drawn into the two-fold, the others reach a = 0 or b = 0 and leave the surface there.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp

Array = npt.NDArray[np.float64]
# Of the rates at the start: what is so small has converged.
CONVERGED = 1e-8
FARTHEST, LONGEST = 20.0, 20.0


@dataclass(frozen=True)
class Folds:
    """x' = d + A (x - c) above and below z = c_2, d_2 = 0: d is (2, 3), A (2, 3, 3)."""

    c: Array
    d: Array
    A: Array

    @property
    def flow(self) -> Array:
        """The linear flow of (a, b) under the sliding field times b - a."""
        L = np.array([[self.A[r, 2] @ self.d[q] for q in (0, 1)] for r in (0, 1)])
        return np.array([[-L[0, 1], L[0, 0]], [-L[1, 1], L[1, 0]]])

    @property
    def kind(self) -> str:
        """Its name by the second derivatives of h along the field of either side."""
        above, below = self.A[0, 2] @ self.d[0] > 0, self.A[1, 2] @ self.d[1] < 0
        return "visible" if above and below else "visible-invisible" if above or below else "invisible"

    def rates(self, xi: Array) -> tuple[Array, Array]:
        """The fields of both sides at c + (xi, 0)."""
        z = np.append(xi, 0.0)
        return self.d[0] + self.A[0] @ z, self.d[1] + self.A[1] @ z

    def start(self, rates: Array) -> Array | None:
        """xi with these rates; None where that is far away."""
        M = self.A[:, 2, :2]
        if np.linalg.cond(M) > 30:
            return None
        xi = np.asarray(np.linalg.solve(M, rates))
        return xi if np.linalg.norm(xi) < 2 else None


@dataclass(frozen=True)
class End:
    """Where sliding ends: "in" the two-fold, or off the surface "above" or "below"; with time and xi."""

    how: str
    t: float
    xi: Array


def draw(rng: np.random.Generator, kind: str, straight: bool = False) -> Folds:
    """Folds of a kind, anywhere; straight: the motion along the surface does not depend on the place."""
    while True:
        A = rng.normal(size=(2, 3, 3))
        if straight:
            A[:, :2] = 0.0
        d = np.append(rng.normal(size=(2, 2)), np.zeros((2, 1)), axis=1)
        folds = Folds(rng.normal(size=3) * rng.choice([0, 1, 10]), d, A)
        if folds.kind == kind:
            return folds


def slide(folds: Folds, xi: Array) -> End | None:
    """The end of sliding from c + (xi, 0); None where it takes long or goes far."""
    a0, b0 = (field[2] for field in folds.rates(xi))

    def velocity(_: float, q: Array) -> list[float]:
        plus, minus = folds.rates(q[:2])
        along = minus[2] * plus - plus[2] * minus
        return [along[0], along[1], minus[2] - plus[2]]

    def leaves_above(_: float, q: Array) -> float:
        return float(folds.rates(q[:2])[0][2])

    def leaves_below(_: float, q: Array) -> float:
        return float(folds.rates(q[:2])[1][2])

    def converged(_: float, q: Array) -> float:
        plus, minus = folds.rates(q[:2])
        return float(abs(plus[2]) + abs(minus[2]) - CONVERGED * (b0 - a0))

    def lost(_: float, q: Array) -> float:
        return float(max(q[2] / LONGEST, np.max(np.abs(q[:2])) / FARTHEST) - 1.0)

    ends = (leaves_above, leaves_below, converged, lost)
    for function in ends:
        function.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(
        velocity, (0, 1e4), [*xi, 0.0], method="DOP853", rtol=1e-12, atol=1e-14, events=ends, max_step=50
    )
    found = [k for k in range(4) if len(run.t_events[k])]
    if not found or found[0] == 3:
        return None
    xi, t = run.y[:2, -1], float(run.y[2, -1])
    if found[0] < 2:
        return End(("above", "below")[found[0]], t, xi)
    if np.iscomplexobj(np.linalg.eigvals(folds.flow)):
        # It turns on and leaves, so close to the two-fold that no solver may be asked where.
        return None
    a, b = (field[2] for field in folds.rates(xi))
    # What is left of the way: times along both fields after which both rates vanish.
    L = np.array([[folds.A[r, 2] @ folds.d[q] for q in (0, 1)] for r in (0, 1)])
    above, below = -np.linalg.solve(L, [a, b])
    return End("in", t + above + below, np.zeros(2))
