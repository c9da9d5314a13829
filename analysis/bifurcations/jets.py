"""Second and third derivatives of a map or field from its exact matrices A(x) along straight lines.

A polynomial through A(x0 + s u) at Chebyshev nodes |s| <= r gives B(u, .) = dA/ds and C(u, u, .) = d^2A/ds^2.
With q = a + i b: B(q, v) = B(a, v) + i B(b, v) and C(q, q', .) = C(a, a, .) + C(b, b, .), ' the conjugate.

Coefficients (Kuznetsov 2004, Elements of Applied Bifurcation Theory), with <p, q> = 1:

    cubic_flip    c = <p, C(q, q, q)>/6 - <p, B(q, (A - 1)^-1 B(q, q))>/2
    cubic_neimark_sacker    Re e^(-i th) [<p, C(q, q, q')> + 2 <p, B(q, (1 - A)^-1 B(q, q'))>
                                + <p, B(q', (e^(2 i th) - A)^-1 B(q, q))>]/2
    cubic_hopf    Re [<p, C(q, q, q')> - 2 <p, B(q, A^-1 B(q, q'))>
                      + <p, B(q', (2 i w - A)^-1 B(q, q))>]/2

in xi -> -(1 + beta) xi + c xi^3, |z| -> (1 + beta) |z| + cubic |z|^3 and |z|' = mu |z| + cubic |z|^3.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from filippov.analysis.algebra import linalg
from filippov.base.arrays import Array, Complex

_NODES = np.cos(np.pi * (np.arange(6) + 0.5) / 6)


_REACHES = (0.02, 0.005, 0.001)


class OutsideError(ArithmeticError):
    """A is evaluated where it is another function, as beyond a change of the sequence of modes."""


class Jets:
    """Derivatives of A at 0: matrix(x) gives A (n, n) for x (n,) in units of the size of the solution.

    matrix may raise OutsideError; it is then evaluated nearer to 0.
    """

    def __init__(self, matrix: Callable[[Array], Array], n: int) -> None:
        self.matrix = matrix
        self.A = matrix(np.zeros(n))

    def along(self, u: Array) -> tuple[Array, Array]:
        """B(u, .) and C(u, u, .) for a real u: (n, n) each. Raises OutsideError."""
        size = float(np.linalg.norm(u))
        if size == 0:
            return np.zeros_like(self.A), np.zeros_like(self.A)
        for reach in _REACHES:
            try:
                rows = np.array([self.matrix(reach * s * u / size) for s in _NODES])
            except OutsideError:
                continue
            found = chebyshev.chebfit(_NODES, rows.reshape(len(_NODES), -1), len(_NODES) - 1)
            first, second = (
                np.asarray(chebyshev.chebval(0.0, chebyshev.chebder(found, k))).reshape(self.A.shape)
                for k in (1, 2)
            )
            return first * size / reach, second * (size / reach) ** 2
        raise OutsideError("neighbouring solutions meet other events: the return has no higher derivatives.")

    def pair(self, value: complex) -> tuple[Complex, Complex]:
        """q and p to the eigenvalue nearest to a value, |q| = 1, <p, q> = 1."""
        values, left, right = linalg.eig_both(self.A)
        k = int(np.argmin(np.abs(values - value)))
        q = right[:, k] / np.linalg.norm(right[:, k])
        # q is real where possible, with its largest entry positive.
        lead = q[int(np.argmax(np.abs(q)))]
        q = q * (np.conj(lead) / abs(lead))
        p = left[:, k] / np.conj(np.vdot(left[:, k], q))
        return q, p

    def cubic_flip(self) -> tuple[float, Array]:
        """(c, q) at an eigenvalue -1."""
        q, p = (v.real for v in self.pair(-1.0))
        B, C = self.along(q)
        inner = linalg.solve(self.A - np.eye(len(q)), B @ q)
        c = p @ (C @ q) / 6 - p @ (B @ inner) / 2
        return float(c), q

    def _forms(self, value: complex) -> Any:
        q, p = self.pair(value)
        (Ba, Ca), (Bb, Cb) = self.along(q.real), self.along(q.imag)
        B = Ba + 1j * Bb
        return q, p, B, B @ q, B @ q.conj(), np.vdot(p, (Ca + Cb) @ q)

    def cubic_neimark_sacker(self, angle: float) -> float:
        """At a pair e^(+- i angle)."""
        q, p, B, qq, qc, third = self._forms(np.exp(1j * angle))
        one = np.eye(len(q))
        total = third + 2 * np.vdot(p, B @ linalg.solve(one - self.A, qc))
        total += np.vdot(p, B.conj() @ linalg.solve(np.exp(2j * angle) * one - self.A, qq))
        return float((np.exp(-1j * angle) * total).real / 2)

    def cubic_hopf(self, frequency: float) -> tuple[float, Complex]:
        """(cubic, q) at a pair +- i frequency."""
        q, p, B, qq, qc, third = self._forms(1j * frequency)
        total = third - 2 * np.vdot(p, B @ linalg.solve(self.A, qc))
        turned = 2j * frequency * np.eye(len(q)) - self.A
        total += np.vdot(p, B.conj() @ linalg.solve(turned, qq))
        return float(total.real / 2), q
