"""The applied force between its samples: held, linear, or smooth with kinks, and how well it is known.

A smooth force is a smoothing spline; its mean is what is taken, its covariance what the samples leave open:
both the noise and what lies between samples. Kinks come in two ways:

    u = G g + rest    G the fitted trajectory, which a controller feeds back: its kinks are the force's
    u = rest          on segments that have nothing in common, with a kink where their two sides meet

The gains g, the noise s and the roughness q (in the second form one at rest, one in motion) maximise the
restricted likelihood.
Sources: Wahba 1978 (splines as conditional means); Wood 2017 (restricted likelihood).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.linalg import solve_triangular
from scipy.optimize import minimize

from filippov.analysis.algebra import linalg
from filippov.analysis.estimation.driven_run import Pieces
from filippov.analysis.estimation.feedback import Feedback
from filippov.analysis.estimation.force_segment import ForceSegment
from filippov.base.arrays import Array

# Samples of the shortest segment (a cubic and something over), and of the longest, whose matrices are dense.
SHORTEST, LONGEST = 6, 240
# Samples on either side that say where a kink is.
NEAR = 24
# Least log q that is used, at rest and in motion: some 18 and some 6 samples smooth one. What is left of a
# force beside the trajectory bends as little as a force at rest.
LEAST, LEAST_FED = (-8.0, 0.0), (-8.0, -8.0)
# Smallest noise of the force in parts of its size: digits of a file.
DIGITS = 1e-7


class SmoothForce:
    """The smooth force of a record on segments that end in the intervals `cuts`; moving: of each interval.

    fed    trajectories of the windows, where the force follows them
    s      standard deviation of the noise on the samples [N]
    cost   minus the log of the evidence for this form
    """

    def __init__(
        self, t: Array, force: Array, cuts: Sequence[int], moving: npt.NDArray[np.bool_],
        fed: Sequence[Feedback] = (),
    ) -> None:  # fmt: skip
        self.t = t
        self.offset = float(np.mean(force))
        own = force - self.offset
        self.size = float(np.max(np.abs(own))) or 1.0
        self.columns = own[:, None]
        if fed:
            trajectory = np.concatenate([q.samples for q in fed])
            self.units = np.max(np.abs(trajectory), axis=0) / self.size
            self.columns = np.column_stack((own, trajectory / self.units))
        self.fed = fed
        self.moving = moving
        self.cuts = self._kept(cuts)
        self.segments = self._segments(self.cuts)
        self.log_q, self.least = np.zeros(2), np.array(LEAST_FED if fed else LEAST)
        self.s = DIGITS * self.size
        self._known: dict[tuple[int, int], tuple[Array, Array]] = {}
        self.cost = self._estimate()
        for _ in range(0 if fed else 2):
            placed = self._placed()
            if placed == self.cuts:
                break
            self.cuts = placed
            self.segments = self._segments(placed)
            self.cost = self._estimate()

    def pieces(self, first: int, last: int) -> Pieces:
        """The force on the window of the samples first ... last - 1."""
        inside = [q for q in self.segments if q.last > first and q.first < last]
        fits = [self._posterior(q) for q in inside]
        shared = self.loose.shape[1]
        ends = np.cumsum([0, *(root.shape[1] - shared for _, root in fits)])
        starts: list[Array] = []
        terms, roots, lengths = [], [], []
        fed = self._fed(first)
        meet = [self.t[first]]
        for q, (left, right) in enumerate(itertools.pairwise(inside)):
            near = self._meeting(left, right, fits[q][0], fits[q + 1][0])
            meet.append(near if fed is None else float(self.t[right.first]))
        meet.append(self.t[last - 1])
        samples = self.t[first:last] if fed is None else fed.edges
        for q, segment in enumerate(inside):
            low, high = meet[q : q + 2]
            edges = np.unique(np.concatenate((meet[q : q + 2], samples[(samples > low) & (samples < high)])))
            c, root = fits[q]
            rows = segment.taylor(edges[:-1], np.diff(edges))
            spread = np.zeros((len(rows), 4, ends[-1] + shared))
            full = rows @ root
            spread[:, :, ends[q] : ends[q + 1]] = full[:, :, shared:]
            value = rows @ c
            if fed is not None:
                at = np.searchsorted(fed.edges, edges[:-1])
                trajectory = fed.terms[at] / self.units
                value += trajectory @ self.gains
                spread[:, :, ends[-1] :] = full[:, :, :shared] + trajectory @ self.loose
            value[:, 0] += self.offset
            starts.append(edges[:-1])
            lengths.append(np.diff(edges))
            terms.append(value)
            roots.append(spread)
        sample = np.searchsorted(self.t[first:last], np.concatenate(starts), side="right") - 1
        return Pieces(np.concatenate(lengths), np.concatenate(terms), sample, np.concatenate(roots))

    def _fed(self, first: int) -> Feedback | None:
        """The trajectory of the window that begins with a sample."""
        return next((q for q in self.fed if q.edges[0] == self.t[first]), None)

    def _meeting(self, left: ForceSegment, right: ForceSegment, c_left: Array, c_right: Array) -> float:
        """Where in the interval between two segments their two sides meet, or come nearest."""
        k = left.last - 1
        tau = np.linspace(0.02, 0.98, 193)
        at = self.t[k] + tau * (self.t[k + 1] - self.t[k])
        gap = np.asarray(left.basis(at)) @ c_left - np.asarray(right.basis(at)) @ c_right
        return float(at[np.argmin(np.abs(gap))])

    def _posterior(self, segment: ForceSegment) -> tuple[Array, Array]:
        """Coefficients of the rest, and the root of their covariance: columns of the gains, then its own."""
        # Smoothing as strong as the likelihood asks for has a bias as large as its spread, where the force
        # bends most; averages over the samples lose nothing by less of it.
        key = segment.first, segment.last
        if key not in self._known:
            c, root = segment.fit(np.exp(np.maximum(self.log_q, self.least)[int(segment.moving)]))
            own = self.s * solve_triangular(root.T, np.eye(len(c)), lower=False)
            self._known[key] = c[:, 0] - c[:, 1:] @ self.gains, np.column_stack((-c[:, 1:] @ self.loose, own))
        return self._known[key]

    def _kept(self, cuts: Sequence[int]) -> list[int]:
        """Cuts that leave segments long enough, and further ones where segments are too long."""
        kept: list[int] = []
        for k in sorted(set(cuts)):
            if k + 1 - (kept[-1] + 1 if kept else 0) >= SHORTEST and len(self.t) - (k + 1) >= SHORTEST:
                kept.append(k)
        edges = [0, *(k + 1 for k in kept), len(self.t)]
        for a, b in itertools.pairwise(edges):
            parts = -(-(b - a) // LONGEST)
            kept.extend(a + (b - a) * q // parts - 1 for q in range(1, parts))
        return sorted(kept)

    def _segments(self, cuts: Sequence[int]) -> list[ForceSegment]:
        edges = [0, *(k + 1 for k in cuts), len(self.t)]
        return [self._segment(a, b) for a, b in itertools.pairwise(edges)]

    def _segment(self, first: int, last: int) -> ForceSegment:
        inside = self.moving[first : last - 1]
        return ForceSegment(self.t, self.columns, first, last, bool(self.fed) or bool(np.mean(inside) > 0.5))

    def _estimate(self) -> float:
        """s, q and the gains by the restricted likelihood; its cost, with that of all that is free."""
        kinds = sorted({q.moving for q in self.segments})
        shared = self.columns.shape[1] - 1
        free = 4 * len(self.segments) + shared
        count = len(self.t) - free
        least = (DIGITS * self.size) ** 2

        def misfit(log_q: Array) -> float:
            full = self.log_q.copy()
            full[[int(kind) for kind in kinds]] = log_q
            squares, log, *_ = self._solved(full)
            variance = max(squares / count, least)
            return float(0.5 * (count * np.log(variance) + squares / variance + log))

        best = min((misfit(np.full(len(kinds), g)), g) for g in (-8.0, 0.0, 8.0, 16.0))[1]
        found = minimize(
            misfit, np.full(len(kinds), best), method="Nelder-Mead", bounds=[(-16.0, 25.0)] * len(kinds),
            options={"xatol": 0.05, "fatol": 0.02, "initial_simplex": _simplex(len(kinds), best)},
        )  # fmt: skip
        self.log_q[[int(kind) for kind in kinds]] = found.x
        squares = self._solved(self.log_q)[0]
        self.s = float(np.sqrt(max(squares / count, least)))
        _, _, self.gains, root = self._solved(np.maximum(self.log_q, self.least))
        self.loose = self.s * root
        # What is free is taken to be of the force's size, so that forms with more and less of it compare.
        return float(found.fun + free * np.log(self.size * np.sqrt(len(self.t))))

    def _solved(self, log_q: Array) -> tuple[float, float, Array, Array]:
        """Sum of squares and log determinant for s = 1; the gains, and a root of their covariance."""
        products, log = np.zeros((self.columns.shape[1],) * 2), 0.0
        for segment in self.segments:
            own, size = segment.likelihood(np.exp(log_q[int(segment.moving)]))
            products, log = products + own, log + size
        sizes = np.sqrt(np.maximum(np.diag(products)[1:], 1e-300))
        values, axes = linalg.eigh(products[1:, 1:] / np.outer(sizes, sizes))
        told = values > 1e-10
        root = axes[:, told] / np.sqrt(values[told]) / sizes[:, None]
        along = root.T @ products[1:, 0]
        log += float(np.sum(np.log(values[told])) + 2 * np.sum(np.log(sizes)))
        return max(float(products[0, 0] - along @ along), 0.0), log, root @ along, root

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
                for segment, own in ((self._segment(low, at + 1), i), (self._segment(at + 1, high), i + 1)):
                    q = np.exp(self.log_q[int(self.segments[own].moving)])
                    squares, log = segment.likelihood(q)
                    total += float(squares[0, 0]) / self.s**2 + log
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
