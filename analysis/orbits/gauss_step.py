"""Steps of Gauss collocation in one mode, many at once, with their derivatives.

On a step from t to t + dt the polynomial u with u(t) = x satisfies u' = f(u) at m = 4 Gauss nodes,

    K_i = f(t + c_i dt, x + dt sum_k a_ik K_k),   u(t + dt) = x + dt sum_i b_i K_i,

of order 8 at the ends of the steps and of order 5 between them. Source: Ascher,
Mattheij & Russell 1988; Hairer, Norsett & Wanner 1993.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filippov.analysis.algebra import linalg
from filippov.analysis.sensitivity.variation import ModeField, gauss
from filippov.base.arrays import Array
from filippov.base.errors import SolveError

STAGES = 4
_C, _B, _A = gauss(STAGES)
_ITERATIONS = 15
# Where u' is compared with f: at the ends (not on them: a field may have an infinite slope there) and midway.
_CHECKS = np.array([0.01, 0.5, 0.99])


def _lagrange() -> tuple[Array, Array]:
    """Coefficients, lowest first, of the Lagrange polynomials of the nodes and of their integrals."""
    values, integrals = [], []
    for j in range(STAGES):
        others = np.delete(_C, j)
        basis = np.polynomial.Polynomial.fromroots(others) / np.prod(_C[j] - others)
        values.append(basis.coef)
        integrals.append(basis.integ().coef)
    return np.array(values), np.array(integrals)


_VALUES, _INTEGRALS = _lagrange()


@dataclass(frozen=True)
class Steps:
    """N steps of one segment, t = t0 + grid (t1 - t0).

    start, end        states at the beginning of each step, and where it leads: (N, n)
    slopes            K: (N, m, n)
    by_state          d end/d start: (N, n, n)
    by_times          d end/d (t0, t1): (N, n, 2)
    by_parameters     d end/d (named parameters): (N, n, names)
    t0, t1, grid      times, and the places of the steps in [0, 1]: (N + 1,)
    """

    start: Array
    end: Array
    slopes: Array
    by_state: Array
    by_times: Array
    by_parameters: Array
    t0: float
    t1: float
    grid: Array

    def between(self, part: Array) -> Array:
        """The polynomials at a part in [0, 1] of each step: (N, parts, n)."""
        dt = np.diff(self.grid) * (self.t1 - self.t0)
        weights = np.polynomial.polynomial.polyval(part, _INTEGRALS.T, tensor=True)
        return np.asarray(
            self.start[:, None, :] + dt[:, None, None] * np.einsum("mc,jmn->jcn", weights, self.slopes)
        )

    def at(self, places: Array) -> Array:
        """States at places in [0, 1] of the whole segment: (places, n)."""
        j = np.clip(np.searchsorted(self.grid, places, side="right") - 1, 0, len(self.start) - 1)
        width = np.diff(self.grid)[j]
        weights = np.polynomial.polynomial.polyval((places - self.grid[j]) / width, _INTEGRALS.T)
        dt = width * (self.t1 - self.t0)
        return np.asarray(self.start[j] + dt[:, None] * np.einsum("mq,qmn->qn", weights, self.slopes[j]))

    def defects(self, field: ModeField, p: Array, size: Array) -> Array:
        """dt |u' - f(u)| in units of the size of each state, largest of each step: (N,)."""
        dt = np.diff(self.grid) * (self.t1 - self.t0)
        x = self.between(_CHECKS)
        rates = np.einsum("mc,jmn->jcn", np.polynomial.polynomial.polyval(_CHECKS, _VALUES.T), self.slopes)
        t = (self.t0 + self.grid[:-1] * (self.t1 - self.t0))[:, None] + dt[:, None] * _CHECKS
        flat = x.reshape(-1, x.shape[2])
        s = field.multipliers(t.ravel(), flat, p)
        f = field.velocity(t.ravel(), flat, s, p)[:, : x.shape[2]].reshape(x.shape)
        return np.asarray(np.max(np.abs(dt[:, None, None] * (rates - f)) / size, axis=(1, 2)))


def gauss_steps(field: ModeField, states: Array, t0: float, t1: float, grid: Array, p: Array) -> Steps:
    """The steps from the states (N + 1, n) at the places of the grid; the last one only guides the first
    guess.

    Raises SolveError where the equations of a step have no solution near by, or the field is not finite.
    """
    count, n = len(grid) - 1, states.shape[1]
    shares = np.diff(grid)
    dt = shares * (t1 - t0)
    places = grid[:-1, None] + shares[:, None] * _C
    t = (t0 + places * (t1 - t0)).ravel()
    first = states[:-1]
    y = first[:, None, :] + _C[:, None] * (states[1:] - first)[:, None, :]
    scaled = dt[:, None, None] * _A
    identity = np.eye(STAGES * n)
    # A state that is 0 all along, as on a surface that is slid on, has the rounding of the others.
    size = np.max(np.abs(states), axis=0)
    size = np.maximum(size, 1e-6 * float(np.max(size)) + 1e-300)
    last = np.inf
    for _ in range(_ITERATIONS):
        flat = y.reshape(-1, n)
        s = field.multipliers(t, flat, p)
        f = field.velocity(t, flat, s, p)[:, :n].reshape(count, STAGES, n)
        a = field.matrix(t, flat, s, p)[:, :n].reshape(count, STAGES, n, -1)
        if not (np.all(np.isfinite(f)) and np.all(np.isfinite(a))):
            raise SolveError("the field is not finite on the mesh.")
        left = y - first[:, None, :] - scaled @ f
        blocks = identity - np.einsum("jik,jkab->jiakb", scaled, a[..., :n]).reshape(
            count, STAGES * n, STAGES * n
        )
        change = linalg.solve(blocks, -left.reshape(count, -1, 1)).reshape(y.shape)
        y = y + change
        moved = float(np.max(np.abs(change) / size))
        if moved < 1e-15 or (moved < 1e-11 and moved > 0.1 * last):
            break
        last = moved
    if not moved < 1e-9:
        raise SolveError("the equations of a collocation step were not solved: the mesh is too coarse there.")
    # dK_i = A_i (dx + dt sum_k a_ik dK_k + d(dt) sum_k a_ik K_k) + f_t dt_i + f_q dq.
    inner = np.einsum("ik,jkn->jin", _A, f) * shares[:, None, None]
    by_state = np.einsum("jiab,jib->jia", a[..., :n], inner)
    by_t = a[..., -1]
    right = np.concatenate(
        [
            a[..., :n],
            (by_t * (1 - places)[..., None] - by_state)[..., None],
            (by_t * places[..., None] + by_state)[..., None],
            a[..., n:-1],
        ],
        axis=3,
    )
    columns = right.shape[3]
    # In the unknowns K the matrix is 1 - dt A_i a_ik.
    own = identity - np.einsum("jik,jiab->jiakb", scaled, a[..., :n]).reshape(
        count, STAGES * n, STAGES * n
    )
    slopes = linalg.solve(own, right.reshape(count, -1, columns)).reshape(count, STAGES, n, columns)
    total = dt[:, None, None] * np.einsum("i,jinc->jnc", _B, slopes)
    drift = np.einsum("i,jin->jn", _B, f) * shares[:, None]
    by_state = np.eye(n) + total[..., :n]
    by_times = total[..., n : n + 2] + np.stack([-drift, drift], axis=2)
    end = first + dt[:, None] * np.einsum("i,jin->jn", _B, f)
    return Steps(first, end, f, by_state, by_times, total[..., n + 2 :], t0, t1, grid)
