"""The mean of the input of nonlinear terms at which the constant terms of a loop balance, over the amplitude.

Under y = mean + A sin(theta) the mean of phi(y) is balanced by the linear part at rest. There may be several
such means at one amplitude, as about each equilibrium of a bistable loop; every one belongs to a branch.

Source: Gelb & Vander Velde 1968, chapter 6; Genesio & Tesi 1992 for cycles about several equilibria.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from filippov.analysis.algebra import linalg
from filippov.analysis.harmonic.quasi_linear import Lure
from filippov.base.arrays import Array

# Parts of the sizes of the terms that are rounding, and that a root leaves.
ROUNDING, LEFT = 1e-12, 1e-8
# Means that are one, in parts of the amplitude.
SAME = 1e-6
# Angles at which a mean is looked for, to be solved for afterwards; distances of means, in amplitudes.
ANGLES, REACH = 96, np.concatenate([np.linspace(0.0, 1.0, 11), np.geomspace(1.2, 1e6, 13)])
# Halvings of the amplitude where two means meet, and distances of levels to it in parts of the grid's.
HALVINGS, CLOSE = 30, (0.5, 0.2, 0.1, 0.03, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8)
# How often the first step from a neighbour's mean is doubled.
DOUBLINGS = 7


class Means:
    """One branch of means over the amplitude.

    ends    the least and the largest amplitude
    known   an amplitude and its mean, from which the branch is followed; else from the offset of the input
    """

    def __init__(
        self, split: Lure, ends: tuple[float, float], known: tuple[float, float] | None = None
    ) -> None:
        self.ends = ends
        self.split, self.whole, self.last = split, known is None, np.inf
        # The mean of the input by amplitude; nan where none is found.
        self.found: dict[float, float] = {} if known is None else dict([known])
        self._changes: dict[float, list[tuple[float, float]]] = {}
        # Rows w with w [A; c] = 0: the states go, and w [phi_0(m); offset - m] = 0 is left for the mean m.
        whole = np.vstack([split.matrix, split.row])
        rows = np.max(np.abs(whole), axis=1)
        rows = np.where(rows > 0, rows, 1.0)
        columns = np.max(np.abs(whole / rows[:, None]), axis=0, initial=0.0)
        scaled = whole / rows[:, None] / np.where(columns > 0, columns, 1.0)
        self.left = linalg.null_space(scaled.T).T / rows

    def at(self, amplitude: float) -> float:
        """Mean of the input for which the constant terms balance; nan where none is found."""
        if amplitude > self.last:
            return float("nan")
        if amplitude not in self.found:
            self.found[amplitude] = self._solved(amplitude)
        return self.found[amplitude]

    def levels(self, grid: Array) -> Array:
        """Amplitudes close to those where two means meet and end, between those of the grid."""
        counts = [len(self._brackets(amplitude)) for amplitude in grid.tolist()]
        near: list[float] = []
        for k in np.flatnonzero(np.diff(counts)):
            low, high = float(grid[k]), float(grid[k + 1])
            length = high - low
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                same = len(self._brackets(middle)) == counts[k]
                low, high = (middle, high) if same else (low, middle)
            near += [low + side * part * length for part in CLOSE for side in (-1, 1)]
        return np.array([size for size in near if grid[0] < size < grid[-1]])

    def others(self, grid: Array) -> list[Means]:
        """The branches with further means at these amplitudes."""
        branches = [self]
        for amplitude in grid.tolist():
            taken: list[float] = []
            for branch in branches:
                mean = branch.at(amplitude)
                if any(abs(mean - other) <= SAME * amplitude for other in taken):
                    branch.last = amplitude  # from here on it is an earlier one
                taken.append(mean)
            for low, high in self._brackets(amplitude):
                slack = SAME * (amplitude + high - low)
                if any(low - slack <= mean <= high + slack for mean in taken):
                    continue
                mean = self._root(low, high, amplitude)
                if self._balanced(mean, amplitude, LEFT):
                    taken.append(mean)
                    branches.append(Means(self.split, self.ends, (amplitude, mean)))
        return branches[1:]

    def _brackets(self, amplitude: float) -> list[tuple[float, float]]:
        """Intervals of means in which the condition changes its sign."""
        if amplitude not in self._changes:
            self._changes[amplitude] = self._changing(amplitude)
        return self._changes[amplitude]

    def _changing(self, amplitude: float) -> list[tuple[float, float]]:
        """These intervals, by a sum over equal steps in time."""
        scale = np.geomspace(*self.ends, 64)
        away = np.unique(np.concatenate([amplitude * REACH, scale]))
        centres = [self.split.offset, *self.split.cuts]
        sides = (0.0, -1.0, -0.5, 0.5, 1.0)
        near = [cut + part * amplitude for cut in centres for part in sides]
        means = np.unique(np.concatenate([self.split.offset + away, self.split.offset - away, near]))
        # With hysteresis two periods, the first of which sets the signs.
        periods = 2 if np.any(self.split.widths) else 1
        theta = 2 * np.pi * (np.arange(periods * ANGLES) + 0.5) / ANGLES
        y = means[:, None] + amplitude * np.sin(theta)
        values = self.split.phi(y.ravel(), self.split.signs(y.ravel())).reshape(-1, *y.shape)
        constant = np.mean(values[:, :, -ANGLES:], axis=2)
        terms = self.left[0, :, None] * np.vstack([constant, self.split.offset - means])
        total, sizes = np.sum(terms, axis=0), np.sum(np.abs(terms), axis=0)
        sign = np.where(np.abs(total) > ROUNDING * sizes, np.sign(total), 0.0)
        change = np.flatnonzero(sign[:-1] * sign[1:] < 0)
        return [(float(means[k]), float(means[k + 1])) for k in change]

    def _terms(self, mean: float, amplitude: float) -> Array:
        """What balances, a row for each condition."""
        constant = self.split.harmonic(mean, amplitude, 0).real
        return np.asarray(self.left * np.append(constant, self.split.offset - mean))

    def _condition(self, mean: float, amplitude: float) -> float:
        return float(np.sum(self._terms(mean, amplitude)[0]))

    def _balanced(self, mean: float, amplitude: float, part: float) -> bool:
        """Whether the terms cancel, next to what the constant terms, the wave and the amplitude bring."""
        terms, wave = self._terms(mean, amplitude), self.split.harmonic(mean, amplitude)
        sizes = np.abs(terms) + np.abs(self.left * np.append(wave, amplitude))
        return bool(np.all(np.abs(np.sum(terms, axis=1)) <= part * np.sum(sizes, axis=1)))

    def _root(self, low: float, high: float, amplitude: float) -> float:
        """The mean between two at which the condition changes its sign; nan where it does not."""
        ends = [self._condition(mean, amplitude) for mean in (low, high)]
        if not np.all(np.isfinite(ends)) or ends[0] * ends[1] > 0:
            return float("nan")
        return float(
            brentq(self._condition, low, high, args=(amplitude,), xtol=1e-15 * amplitude, rtol=1e-14)
        )

    def _solved(self, amplitude: float) -> float:
        """The mean next to that of the nearest amplitude, as it is and in proportion to it."""
        guesses, near = [self.split.offset], amplitude
        known = {size: m for size, m in self.found.items() if np.isfinite(m)}
        if known:
            near = min(known, key=lambda size: abs(np.log(size / amplitude)))
            guesses = [known[near], known[near] * amplitude / near]
        for guess in guesses:
            if self._balanced(guess, amplitude, ROUNDING):
                return guess
        mean = self._beside(near, amplitude) if known else float("nan")
        # A further branch ends where it has no neighbour; what is elsewhere belongs to another one.
        return self._anywhere(guesses, amplitude) if self.whole and not np.isfinite(mean) else mean

    def _beside(self, near: float, amplitude: float) -> float:
        """The mean next to that of a near amplitude, by steps to both sides; nan where there is none.

        Where two means meet they part with the root of the distance in amplitudes.
        """
        guess = self.found[near]
        ends, step = [guess, guess], 2 * float(np.sqrt(abs(amplitude - near) * amplitude)) / 2**DOUBLINGS
        values = [self._condition(guess, amplitude)] * 2
        for _ in range(DOUBLINGS + 1):
            found = []
            for k, side in enumerate((-1, 1)):
                end = guess + side * step
                value = self._condition(end, amplitude)
                if values[k] * value < 0:
                    found.append(self._root(min(ends[k], end), max(ends[k], end), amplitude))
                ends[k], values[k] = end, value
            there = [mean for mean in found if self._balanced(mean, amplitude, LEFT)]
            if there:
                return min(there, key=lambda mean: abs(mean - guess))
            step *= 2
        return float("nan")

    def _anywhere(self, guesses: list[float], amplitude: float) -> float:
        away = amplitude * REACH
        points = np.unique(np.concatenate([guess + side * away for guess in guesses for side in (-1, 1)]))
        values = np.array([self._condition(point, amplitude) for point in points])
        points, values = points[np.isfinite(values)], values[np.isfinite(values)]
        found = [
            self._root(points[k], points[k + 1], amplitude)
            for k in np.flatnonzero(np.sign(values[:-1]) != np.sign(values[1:]))
        ]
        there = [mean for mean in found if self._balanced(mean, amplitude, LEFT)]
        return min(there, key=lambda mean: abs(mean - guesses[-1]), default=float("nan"))
