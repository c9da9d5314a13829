"""A part of a force without a kink: the smoothing spline through its samples, and what it leaves open.

    f_k = u(t_k) + e_k,  e ~ N(0, s^2),   u'''(k + 1) - u'''(k) ~ N(0, s^2 q h)

u is a cubic between two samples, its third derivative a random walk.
Sources: Wahba 1978 (splines as conditional means); Wood 2017 (restricted likelihood).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline
from scipy.linalg import solve_triangular

from filippov.analysis.algebra import linalg
from filippov.analysis.estimation.residual_noise import triangle
from filippov.base.arrays import Array


@dataclass(frozen=True)
class ForceSegment:
    """Samples first ... last - 1 of a force without a kink; reaches over the interval before and after.

    t, columns   all samples of the record: the force and the trajectory that is fed back, (n, 1 + c)
    moving       whether the mass moves here
    """

    t: Array
    columns: Array
    first: int
    last: int
    moving: bool

    @cached_property
    def knots(self) -> Array:
        """Times at which the third derivative changes: the samples and the neighbours beyond them."""
        return self.t[max(self.first - 1, 0) : self.last + 1]

    @cached_property
    def basis(self) -> BSpline:
        """Every cubic B-spline over the knots."""
        knots = np.concatenate((np.repeat(self.knots[0], 3), self.knots, np.repeat(self.knots[-1], 3)))
        return BSpline(knots, np.eye(len(knots) - 4), 3)

    @cached_property
    def design(self) -> Array:
        """Values at the samples by the coefficients."""
        return np.asarray(self.basis(self.t[self.first : self.last]))

    @cached_property
    def roughness(self) -> Array:
        """Steps of the third derivative over the root of the interval, by the coefficients."""
        h = np.diff(self.knots)
        third = np.asarray(self.basis.derivative(3)(self.knots[:-1] + 0.5 * h))
        size = float(np.mean(h))  # the unit of time: it keeps numbers near 1
        return np.diff(third, axis=0) * size**3 / np.sqrt(0.5 * (h[1:] + h[:-1]) / size)[:, None]

    @cached_property
    def rotated(self) -> tuple[Array, Array, Array]:
        """Singular values of the random part beside the cubics, the columns along them, products of the rest.

        With c = N a + D+ w, N the cubics: f = B N a + B D+ w + e, w ~ N(0, s^2 q).
        """
        b = self.design
        tau = self.t[self.first : self.last]
        tau = 2 * (tau - tau[0]) / (tau[-1] - tau[0]) - 1
        x = np.linalg.qr(np.vander(tau, 4))[0]
        z = b @ linalg.pinv(self.roughness)
        u, sizes, _ = linalg.svd(z - x @ (x.T @ z), full_matrices=False)
        y = self.values - x @ (x.T @ self.values)
        along = u.T @ y
        rest = y - u @ along
        return sizes, along, rest.T @ rest

    def likelihood(self, q: float) -> tuple[Array, float]:
        """Products of the columns for s = 1, (1 + c, 1 + c), log determinant of the restricted likelihood."""
        sizes, along, rest = self.rotated
        variance = 1 + q * sizes**2
        return (along.T / variance) @ along + rest, float(np.sum(np.log(variance)))

    @property
    def values(self) -> Array:
        """The columns at its samples."""
        return self.columns[self.first : self.last]

    def taylor(self, start: Array, h: Array) -> Array:
        """Coefficients in tau of the cubics on [start, start + h] by the spline's, (k, 4, c)."""
        # From inside the piece: at its ends the third derivative belongs to two.
        d = -0.5 * h[:, None]
        at = [np.asarray((self.basis.derivative(j) if j else self.basis)(start + 0.5 * h)) for j in range(4)]
        c1 = at[1] + d * (at[2] + d * at[3] / 2)
        c0 = at[0] + d * (at[1] + d * (at[2] / 2 + d * at[3] / 6))
        h = h[:, None]
        return np.stack((c0, c1 * h, (at[2] + d * at[3]) / 2 * h**2, at[3] / 6 * h**3), axis=1)

    def fit(self, q: float) -> tuple[Array, Array]:
        """Coefficients, and the root of their precision for s = 1."""
        b, d = self.design, self.roughness
        # The root of b'b + d'd/q without that sum: beside the larger part the other is below rounding.
        root = triangle(np.vstack((d / np.sqrt(q), b))).T
        right = solve_triangular(root, b.T @ self.values, lower=True)
        return np.asarray(solve_triangular(root.T, right, lower=False)), np.asarray(root)
