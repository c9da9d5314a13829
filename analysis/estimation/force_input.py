"""The applied force between its samples: held, linear, or smooth with kinks, and how well it is known.

A smooth force is a cubic spline on each stretch between kinks, its third derivative a random walk, with
noise on the samples:

    f_k = u(t_k) + e_k,  e ~ N(0, s^2),   u'''(k + 1) - u'''(k) ~ N(0, s^2 q h)

s and q (one at rest, one in motion) maximise the restricted likelihood. Its mean is the smoothing spline, its
covariance what the samples leave open: both the noise and what lies between samples. Stretches have nothing
in common, so the force may have a kink where the mass stops (a controller that feeds velocity back makes
one), at the time where the two sides meet.
Sources: Wahba 1978 (splines as conditional means); Wood 2017 (restricted likelihood).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from filippov.analysis.algebra import linalg
from filippov.analysis.estimation.driven_run import Pieces

Array = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]
# Samples of the shortest stretch (a cubic and something over), and of the longest, whose matrices are dense.
SHORTEST, LONGEST = 6, 240
# Samples on either side that say where a kink is.
NEAR = 24
# Least log q that is used, at rest and in motion: some 18 and some 6 samples smooth one.
LEAST = (-8.0, 0.0)
# Smallest noise of the force in parts of its size: digits of a file.
DIGITS = 1e-7


@dataclass(frozen=True)
class Stretch:
    """Samples first ... last - 1 of a force without a kink; reaches over the interval before and after.

    t, force   all samples of the record; moving: whether the mass moves here
    """

    t: Array
    force: Array
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
    def rotated(self) -> tuple[Array, Array, float]:
        """Singular values of the random part beside the cubics, the samples along them, squares of the rest.

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
        return sizes, along, max(float(y @ y - along @ along), 0.0)

    def likelihood(self, q: float) -> tuple[float, float]:
        """Sum of squares for s = 1 and log determinant of the restricted likelihood."""
        sizes, along, rest = self.rotated
        variance = 1 + q * sizes**2
        return float(np.sum(along**2 / variance)) + rest, float(np.sum(np.log(variance)))

    @property
    def values(self) -> Array:
        """The force at its samples."""
        return self.force[self.first : self.last]

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
        root = linalg.cholesky(b.T @ b + d.T @ d / q)
        right = solve_triangular(root, b.T @ self.values, lower=True)
        return np.asarray(solve_triangular(root.T, right, lower=False)), np.asarray(root)


class SmoothForce:
    """The smooth force of a record with kinks in the intervals `cuts`; moving: of each interval."""

    def __init__(self, t: Array, force: Array, cuts: Sequence[int], moving: npt.NDArray[np.bool_]) -> None:
        self.t, self.force = t, force
        self.offset = float(np.mean(force))
        self.size = float(np.max(np.abs(force - self.offset))) or 1.0
        self.moving = moving
        self.cuts = self._kept(cuts)
        self.stretches = self._stretches(self.cuts)
        self.log_q = np.zeros(2)
        self.s = DIGITS * self.size
        self._known: dict[tuple[int, int], tuple[Array, Array]] = {}
        self._estimate()
        for _ in range(2):
            placed = self._placed()
            if placed == self.cuts:
                break
            self.cuts = placed
            self.stretches = self._stretches(placed)
            self._estimate()

    def pieces(self, first: int, last: int) -> Pieces:
        """The force on the window of the samples first ... last - 1."""
        inside = [q for q in self.stretches if q.last > first and q.first < last]
        fits = [self._posterior(q) for q in inside]
        ends = np.cumsum([0, *(root.shape[1] for _, root in fits)])
        starts: list[Array] = []
        terms, roots, lengths = [], [], []
        meet = [self.t[first]]
        for q, (left, right) in enumerate(itertools.pairwise(inside)):
            meet.append(self._meeting(left, right, fits[q][0], fits[q + 1][0]))
        meet.append(self.t[last - 1])
        for q, stretch in enumerate(inside):
            own = self.t[max(stretch.first, first) : min(stretch.last, last)]
            edges = np.unique(np.clip(np.concatenate((meet[q : q + 2], own)), meet[q], meet[q + 1]))
            c, root = fits[q]
            rows = stretch.taylor(edges[:-1], np.diff(edges))
            spread = np.zeros((len(rows), 4, ends[-1]))
            spread[:, :, ends[q] : ends[q + 1]] = rows @ root
            value = rows @ c
            value[:, 0] += self.offset
            starts.append(edges[:-1])
            lengths.append(np.diff(edges))
            terms.append(value)
            roots.append(spread)
        sample = np.searchsorted(self.t[first:last], np.concatenate(starts), side="right") - 1
        return Pieces(np.concatenate(lengths), np.concatenate(terms), sample, np.concatenate(roots))

    def _meeting(self, left: Stretch, right: Stretch, c_left: Array, c_right: Array) -> float:
        """Where in the interval between two stretches their two sides meet, or come nearest."""
        k = left.last - 1
        tau = np.linspace(0.02, 0.98, 193)
        at = self.t[k] + tau * (self.t[k + 1] - self.t[k])
        gap = np.asarray(left.basis(at)) @ c_left - np.asarray(right.basis(at)) @ c_right
        return float(at[np.argmin(np.abs(gap))])

    def _posterior(self, stretch: Stretch) -> tuple[Array, Array]:
        # Smoothing as strong as the likelihood asks for has a bias as large as its spread, where the force
        # bends most; averages over the samples lose nothing by less of it.
        key = stretch.first, stretch.last
        if key not in self._known:
            log_q = self.log_q[int(stretch.moving)]
            c, root = stretch.fit(np.exp(max(log_q, LEAST[int(stretch.moving)])))
            self._known[key] = c, self.s * solve_triangular(root.T, np.eye(len(c)), lower=False)
        return self._known[key]

    def _kept(self, cuts: Sequence[int]) -> list[int]:
        """Cuts that leave stretches long enough, and further ones where stretches are too long."""
        kept: list[int] = []
        for k in sorted(set(cuts)):
            if k + 1 - (kept[-1] + 1 if kept else 0) >= SHORTEST and len(self.t) - (k + 1) >= SHORTEST:
                kept.append(k)
        edges = [0, *(k + 1 for k in kept), len(self.t)]
        for a, b in itertools.pairwise(edges):
            parts = -(-(b - a) // LONGEST)
            kept.extend(a + (b - a) * q // parts - 1 for q in range(1, parts))
        return sorted(kept)

    def _stretches(self, cuts: Sequence[int]) -> list[Stretch]:
        edges = [0, *(k + 1 for k in cuts), len(self.t)]
        return [self._stretch(a, b) for a, b in itertools.pairwise(edges)]

    def _stretch(self, first: int, last: int) -> Stretch:
        inside = self.moving[first : last - 1]
        return Stretch(self.t, self.force - self.offset, first, last, bool(np.mean(inside) > 0.5))

    def _estimate(self) -> None:
        """s and q by the restricted likelihood."""
        kinds = sorted({q.moving for q in self.stretches})
        count = sum(q.last - q.first - 4 for q in self.stretches)
        least = (DIGITS * self.size) ** 2

        def misfit(log_q: Array) -> float:
            full = self.log_q.copy()
            full[[int(kind) for kind in kinds]] = log_q
            squares, log = 0.0, 0.0
            for stretch in self.stretches:
                own, size = stretch.likelihood(np.exp(full[int(stretch.moving)]))
                squares, log = squares + own, log + size
            variance = max(squares / count, least)
            return float(0.5 * (count * np.log(variance) + squares / variance + log))

        best = min((misfit(np.full(len(kinds), g)), g) for g in (-8.0, 0.0, 8.0, 16.0))[1]
        found = minimize(
            misfit, np.full(len(kinds), best), method="Nelder-Mead", bounds=[(-16.0, 25.0)] * len(kinds),
            options={"xatol": 0.05, "fatol": 0.02, "initial_simplex": _simplex(len(kinds), best)},
        )  # fmt: skip
        self.log_q[[int(kind) for kind in kinds]] = found.x
        squares = sum(q.likelihood(np.exp(self.log_q[int(q.moving)]))[0] for q in self.stretches)
        self.s = float(np.sqrt(max(squares / count, least)))

    def _placed(self) -> list[int]:
        """Each cut moved by up to two intervals to where the samples are likeliest."""
        cuts = list(self.cuts)
        for i, k in enumerate(cuts):
            low = max(cuts[i - 1] + 1 if i else 0, k - NEAR)
            high = min(cuts[i + 1] + 1 if i + 1 < len(cuts) else len(self.t), k + NEAR)
            best = None
            for at in range(k - 2, k + 3):
                if at + 1 - low < SHORTEST or high - at - 1 < SHORTEST:
                    continue
                total = 0.0
                for stretch, own in ((self._stretch(low, at + 1), i), (self._stretch(at + 1, high), i + 1)):
                    q = np.exp(self.log_q[int(self.stretches[own].moving)])
                    squares, log = stretch.likelihood(q)
                    total += squares / self.s**2 + log
                if best is None or total < best[0]:
                    best = (total, at)
            if best is not None:
                cuts[i] = best[1]
        return cuts


def _simplex(n: int, at: float) -> Array:
    return np.vstack([np.full(n, at), *(np.full(n, at) + 3.0 * np.eye(n))])


def plain_pieces(t: Array, force: Array, hold: str, first: int, last: int) -> Pieces:
    """The force held from each sample to the next ("zero") or linear ("first"); spread: of unit noise."""
    count = last - first - 1
    spread = np.zeros((count, 4, count + 1))
    k = np.arange(count)
    spread[k, 0, k] = 1.0
    terms = np.zeros((count, 4))
    terms[:, 0] = force[first : last - 1]
    if hold == "first":
        terms[:, 1] = np.diff(force[first:last])
        spread[k, 1, k], spread[k, 1, k + 1] = -1.0, 1.0
    return Pieces(np.diff(t[first:last]), terms, k, spread, known=False)
