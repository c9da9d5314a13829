"""Orbits that are known before the system is: piecewise linear ones, from matrix exponentials.

Random matrices A1, A2, durations and two points on the surface are chosen first; the constant parts b of
x' = A x + b on either side are then solved for, so that the orbit goes through the points. Nothing of the
package is used.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm

Array = npt.NDArray[np.float64]


def affine(A: Array, b: Array, t: float) -> tuple[Array, Array]:
    """exp(A t) and what b adds in the time t."""
    n = len(b)
    M = np.zeros((n + 1, n + 1))
    M[:n, :n], M[:n, n] = A * t, b * t
    E = expm(M)
    return E[:n, :n], E[:n, n]


@dataclass(frozen=True)
class Member:
    """x' = A x + b: the first pair for c x > 0, the second for c x < 0; durations and starts of both arcs."""

    A: tuple[Array, Array]
    b: tuple[Array, Array]
    c: Array
    durations: tuple[float, float]
    starts: tuple[Array, Array]

    @property
    def period(self) -> float:
        return sum(self.durations)

    def state(self, t: float) -> Array:
        """The state a time after the first crossing."""
        t = t % self.period
        k = 0 if t < self.durations[0] else 1
        t -= k * self.durations[0]
        E, e = affine(self.A[k], self.b[k], t)
        return E @ self.starts[k] + e


    def through(self, starts: tuple[Array, Array], durations: tuple[float, float]) -> tuple[float, Array]:
        """Of an orbit that crosses at `starts`: the largest gap at the next crossing, relative, and its
        multipliers, largest first, without the trivial one."""
        n, gap = len(self.c), 0.0
        total = np.eye(n)
        for k in range(2):
            E, e = affine(self.A[k], self.b[k], durations[k])
            end = starts[1 - k]
            size = max(np.max(np.abs(end)), np.linalg.norm(E, 2) * np.max(np.abs(starts[k])))
            gap = max(gap, float(np.max(np.abs(E @ starts[k] + e - end)) / size), abs(float(self.c @ end)))
            before, after = self.A[k] @ end + self.b[k], self.A[1 - k] @ end + self.b[1 - k]
            total = (np.eye(n) + np.outer(after - before, self.c) / (self.c @ before)) @ E @ total
        values = np.linalg.eigvals(total)
        values = np.delete(values, np.argmin(np.abs(values - 1.0)))
        return gap, values[np.lexsort((-values.imag, -np.abs(values)))]


def member(seed: int, largest: float, n: int = 3) -> Member | None:
    """A random member whose largest multiplier is near `largest`; None where the draw is not admissible."""
    random = np.random.default_rng(seed)
    c = random.normal(size=n)
    c /= np.linalg.norm(c)
    A = [random.normal(size=(n, n)) for _ in range(2)]
    durations = random.uniform(0.5, 1.5, 2)
    for k in range(2):
        # One direction grows, the others decay.
        grow = np.log(largest) / np.sum(durations)
        _, vectors = np.linalg.eigh(A[k] + A[k].T)
        rates = np.append(-random.uniform(0.3, 1.5, n - 1), grow * random.uniform(0.7, 1.3))
        A[k] = vectors @ np.diag(rates) @ vectors.T + 0.5 * (A[k] - A[k].T)
    starts = random.normal(size=(2, n))
    starts -= np.outer(starts @ c, c)
    b = []
    for k in range(2):
        E, _ = affine(A[k], np.zeros(n), durations[k])
        gamma = np.column_stack([affine(A[k], row, durations[k])[1] for row in np.eye(n)])
        b.append(np.linalg.solve(gamma, starts[1 - k] - E @ starts[k]))
    for k, sign in ((0, 1.0), (1, -1.0)):
        path = [affine(A[k], b[k], t) for t in durations[k] * np.arange(1, 200) / 200]
        h = np.array([c @ (F @ starts[k] + f) for F, f in path])
        before = A[k] @ starts[1 - k] + b[k]
        after = A[1 - k] @ starts[1 - k] + b[1 - k]
        if np.min(sign * h) <= 0.003 * np.max(np.abs(h)):
            return None
        if min(-sign * (c @ before), -sign * (c @ after)) < 0.02 * np.linalg.norm(before):
            return None
    return Member(
        (A[0], A[1]), (b[0], b[1]), c, (float(durations[0]), float(durations[1])), (starts[0], starts[1])
    )
