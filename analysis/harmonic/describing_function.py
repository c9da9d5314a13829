"""Limit cycles as predicted by harmonic balance: an approximation, to be compared with the exact ones.

The input y = c . x of the nonlinear terms is assumed to be a sine, y = mean + A sin(omega t), and every
phi_i(y) is replaced by its mean and first harmonic N_i(A) (y - mean). The result is linear, x' = (A0 + N(A)
c) x, and a cycle is predicted where this matrix has an eigenvalue j omega. There is no bound on the error;
`PredictedCycle.distortion` says how far the input would be from a sine.

Sources: Gelb & Vander Velde 1968; Khalil 2002; for friction, where the method fails,
Armstrong-Helouvry & Amin 1996 and Olsson 1995.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq, minimize_scalar

from filippov import System, UsageError
from filippov.analysis.algebra import linalg
from filippov.analysis.harmonic.means import Means
from filippov.analysis.harmonic.quasi_linear import ComplexArray, Lure, lure, shared_input, width_unit
from filippov.base.arrays import Array
from filippov.base.escape import figure_text
from filippov.base.given import Interval
from filippov.base.keywords import keywords
from filippov.base.shown import Shown
from filippov.plot.style import axis_label, time_unit

LEVELS, EDGE = 160, 1e-9
# Cycles of two branches of means that are one, in parts of their amplitude and frequency.
SAME = 1e-6
# Real part of an eigenvalue, in units of its size, that the integrals of harmonics leave of 0.
ON_AXIS = 1e-11


@dataclass(frozen=True)
class PredictedCycle:
    """A limit cycle that harmonic balance predicts.

    amplitude    of the input y; amplitudes: of every state; mean: of the input
    frequency    omega [rad/s]; period: 2 pi/omega
    stable       whether the quasi-linear growth rate falls with the amplitude (Loeb's criterion), and no
                 other eigenvalue lies to the right of the axis
    distortion   size of the second and third harmonics that the loop would feed back to the input, divided
                 by A: small means that the assumption of a sine is consistent
    """

    amplitude: float
    frequency: float
    stable: bool
    mean: float
    amplitudes: tuple[float, ...]
    distortion: float

    @property
    def period(self) -> float:
        """2 pi/omega."""
        return float(2 * np.pi / self.frequency)


@dataclass(frozen=True)
class DescribingFunction(Shown):
    """The prediction of harmonic balance for a loop.

    cycles     predicted limit cycles by growing amplitude, about every mean of the input that balances the
               constant terms (of a bistable loop several); () where none is predicted
    amplitude  grid of A; growth, frequency: the largest real part among the oscillating eigenvalues of the
               quasi-linear matrix there, about the mean that is followed from the offset of h, and its
               frequency; NaN where none oscillates
    gain       N(A) of each equation about this mean, shape (n, k)
    neutral    (low, high) of amplitudes at all of which an oscillating eigenvalue lies on the axis to
               rounding: closed orbits beside each other, or none, which harmonic balance does not decide
    parameters values by name; labels: of the axes, "amplitude", "growth" and "frequency"
    """

    states: tuple[str, ...]
    surface: str
    cycles: tuple[PredictedCycle, ...]
    amplitude: Array
    growth: Array
    frequency: Array
    gain: ComplexArray
    neutral: tuple[tuple[float, float], ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    labels: Mapping[str, str] = field(default_factory=dict)

    @property
    def unbalanced(self) -> tuple[tuple[float, float], ...]:
        """(low, high) of amplitudes for which no mean of the input was found that balances constant terms."""
        return _runs(self.amplitude, [bool(q) for q in np.isnan(self.gain[0])], 1)

    def to_dict(self) -> dict[str, Any]:
        """The prediction as plain data."""
        return {
            "parameters": dict(self.parameters), "surface": self.surface,
            "cycles": [asdict(cycle) | {"period": cycle.period} for cycle in self.cycles],
            "neutral": [list(pair) for pair in self.neutral],
            "unbalanced": [list(pair) for pair in self.unbalanced],
            "searched": [float(self.amplitude[0]), float(self.amplitude[-1])],
        }

    def __str__(self) -> str:
        left = "".join(
            f"\n  from A = {a:.6g} to {b:.6g} it does not decide: the growth rate is 0 to rounding"
            for a, b in self.neutral
        ) + "".join(
            f"\n  from A = {a:.6g} to {b:.6g} no mean of the input was found that balances the constant terms"
            for a, b in self.unbalanced
        )
        if not self.cycles:
            within = f"with A from {self.amplitude[0]:.6g} to {self.amplitude[-1]:.6g}"
            return f"input '{self.surface}': harmonic balance predicts no limit cycle {within}.{left}"
        scale = max(abs(c.mean) + c.amplitude for c in self.cycles)
        apart = any(abs(c.mean - self.cycles[0].mean) > SAME * scale for c in self.cycles)
        rows = [
            f"  A = {c.amplitude:.9g}{f' about {c.mean:.9g}' if apart else ''}, omega = {c.frequency:.9g} "
            f"(period {c.period:.9g}), {'stable' if c.stable else 'unstable'}, "
            f"harmonics 2 and 3: {100 * c.distortion:.2g} % of A"
            for c in self.cycles
        ]
        return "\n".join([f"input '{self.surface}': harmonic balance predicts", *rows]) + left


@keywords()
def describing_function(
    system: System,
    surface: str | None = None,
    parameters: Mapping[str, float] | None = None,
    *,
    amplitudes: Interval = (1e-4, 1e3),
) -> DescribingFunction:
    """Limit cycles predicted from the first harmonic of the nonlinear terms.

    surface     the surface whose h is their input y; may be left out where all
                have the same h up to its sign and a constant, as those of a dead zone: the first then
    amplitudes  range of A that is searched, in the units of h

    Raises ModelError where the system has no form x' = A x + phi(y) or its state jumps, UsageError for a bad
    range.
    """
    low, high = amplitudes
    if not 0 < low < high < np.inf:
        raise UsageError(f"amplitudes are {amplitudes}, expected 0 < low < high.")
    if surface is None:
        surface = shared_input(system, parameters)
    split = lure(system, surface, parameters)
    # The h of a width that depends on parameters is held in units of that width.
    unit = width_unit(system, surface, parameters)
    low, high = low / unit, high / unit
    # Before it the sign of a relay with hysteresis is that of the past.
    grid = np.geomspace(max(low, split.least() * (1 + EDGE)), high, LEVELS)
    means = Means(split, (float(grid[0]), float(grid[-1])))
    balance = _Balance(split, means)
    spectra = [balance.spectrum(amplitude) for amplitude in grid]
    gain: ComplexArray = np.array([balance.gain(amplitude) / unit for amplitude in grid]).T
    fine = np.union1d(grid, means.levels(grid))
    cycles = _distinct(
        cycle
        for every in (balance, *(_Balance(split, branch) for branch in means.others(fine)))
        for cycle in every.cycles(fine)
    )
    growth = np.full(grid.size, np.nan)
    frequency = np.full(grid.size, np.nan)
    for k, values in enumerate(spectra):
        if values.size:
            top = values[np.argmax(values.real)]
            growth[k], frequency[k] = top.real, top.imag
    neutral = _runs(grid, [bool(np.any(_sides(values) == 0)) for values in spectra])
    told = [
        replace(c, amplitude=float(unit * c.amplitude), mean=float(unit * c.mean)) for c in cycles
    ]  # fmt: skip
    between = tuple((unit * a, unit * b) for a, b in neutral)
    return DescribingFunction(
        system.states, surface, tuple(told), unit * grid, growth, frequency, gain, between,
        system.parameters.others(parameters), _labels(system, surface),
    )  # fmt: skip


def _distinct(cycles: Iterable[PredictedCycle]) -> list[PredictedCycle]:
    """By growing amplitude, one of those that two branches of means have in common."""
    out: list[PredictedCycle] = []
    for one in cycles:
        own = np.array([one.amplitude, one.mean, one.frequency])
        scale = SAME * np.array([one.amplitude, one.amplitude, one.frequency])
        if not any(np.all(np.abs(own - (q.amplitude, q.mean, q.frequency)) <= scale) for q in out):
            out.append(one)
    return sorted(out, key=lambda cycle: (cycle.amplitude, cycle.mean))


def _labels(system: System, surface: str) -> dict[str, str]:
    """Labels of the axes; the amplitude has the unit of h where h is a state."""
    h = next((str(item.h) for item in system.surfaces if item.name == surface), "")
    read = axis_label(system, h) if h in system.states else figure_text(f"the input '{surface}'")
    rate = time_unit(system, "1/") or " [1/time]"
    return {"amplitude": f"amplitude of {read}", "growth": f"growth rate{rate}",
            "frequency": f"frequency{rate.replace('1/', 'rad/')}"}  # fmt: skip


def _sides(values: ComplexArray) -> npt.NDArray[np.int64]:
    """The signs of the real parts, 0 where these are rounding."""
    return np.where(np.abs(values.real) > ON_AXIS * np.abs(values), np.sign(values.real), 0).astype(np.int64)


def _runs(grid: Array, on: Sequence[bool], least: int = 2) -> tuple[tuple[float, float], ...]:
    """The ends of neighbours that are on, of `least` and more."""
    marks = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    pairs = zip(marks[::2], marks[1::2] - 1, strict=True)
    return tuple((float(grid[a]), float(grid[b])) for a, b in pairs if b > a + least - 2)


class _Balance:
    """The quasi-linear matrix of one loop along one branch of means."""

    def __init__(self, split: Lure, means: Means) -> None:
        self.split, self.means = split, means

    def mean(self, amplitude: float) -> float:
        """Mean of the input for which the constant terms balance; nan where none is found."""
        return self.means.at(amplitude)

    def gain(self, amplitude: float) -> ComplexArray:
        """N(A), shape (n,); nan without a mean."""
        mean = self.mean(amplitude)
        if not np.isfinite(mean):
            return np.full(len(self.split.states), np.nan, dtype=complex)
        return self.split.harmonic(mean, amplitude) / amplitude

    def matrix(self, amplitude: float) -> ComplexArray:
        """A0 + N(A) c."""
        return self.split.matrix + np.outer(self.gain(amplitude), self.split.row)

    def spectrum(self, amplitude: float) -> ComplexArray:
        """The eigenvalues that oscillate: imaginary part > 0; none without a mean."""
        if not np.isfinite(self.mean(amplitude)):
            return np.zeros(0, dtype=complex)
        values = linalg.eigvals(self.matrix(amplitude))
        size = np.max(np.abs(values), initial=0.0)
        return np.asarray(values[values.imag > 1e-9 * size])

    def side(self, amplitude: float) -> tuple[float, int]:
        """What changes its sign where a pair passes the axis, and how many pairs are on it to rounding.

        It is the sign of the product of all sums of two eigenvalues (real, as those of conjugates are), times
        |Re|/|lambda| of the oscillating eigenvalue next to the axis; nan without a mean.
        """
        if not np.isfinite(self.mean(amplitude)):
            return float("nan"), 0
        # Of a complex gain, as under hysteresis, the eigenvalues in the upper half belong to real solutions.
        swings = self.spectrum(amplitude)
        values = linalg.eigvals(self.matrix(amplitude))
        real = values[np.abs(values.imag) <= 1e-9 * np.max(np.abs(values), initial=0.0)].real
        values = np.concatenate([swings, np.conj(swings), real])
        first, second = np.triu_indices(values.size, 1)
        sums, sizes = values[first] + values[second], np.abs(values[first]) + np.abs(values[second])
        away = np.abs(sums) > ON_AXIS * sizes
        turn = float(np.prod(sums[away] / np.abs(sums[away])).real)
        on = _sides(swings) == 0
        parts = np.abs(swings.real) / np.abs(swings)
        return float(np.sign(turn) * np.min(parts[~on], initial=1.0)), int(np.sum(on))

    def brackets(self, grid: Array) -> list[tuple[float, float]]:
        """Intervals of amplitudes in which a pair may pass the axis once.

        The grid is refined where the input reaches a cut, since the gain has a kink there, and where a pair
        comes near the axis and goes back, since two cycles may lie there between neighbours.
        """
        levels = set(grid.tolist())
        means = np.array([self.mean(size) for size in grid])
        for cut in self.split.cuts:
            past = grid - np.abs(cut - means)
            for k in np.flatnonzero(past[:-1] * past[1:] < 0):
                part = past[k] / (past[k] - past[k + 1])
                reached = float(grid[k] + part * (grid[k + 1] - grid[k]))
                levels |= {reached * (1 + step) for step in (-EDGE, EDGE, 1e-4, 1e-2)}
        tried = sorted(size for size in levels if size <= grid[-1])
        sides, on = zip(*map(self.side, tried), strict=True)
        # A level that happens to be that of a cycle.
        hit = [0 < k < len(on) - 1 and on[k] > max(on[k - 1], on[k + 1]) for k in range(len(on))]
        at, side = np.array(tried)[~np.array(hit)], np.array(sides)[~np.array(hit)]
        found = [(at[k], at[k + 1]) for k in np.flatnonzero(side[:-1] * side[1:] < 0)]
        for j in range(1, at.size - 1):
            near, sign = np.abs(side[j - 1 : j + 2]), float(np.sign(side[j]))
            if np.all(np.sign(side[j - 1 : j + 2]) == sign) and near[1] <= min(near[0], near[2]) < 1:
                ends = np.log(at[[j - 1, j + 1]])
                least = minimize_scalar(
                    lambda q, sign=sign: sign * self.side(float(np.exp(q)))[0], bounds=ends, method="bounded",
                    options={"xatol": 1e-9},
                )  # fmt: skip
                middle = float(np.exp(least.x))
                found += [(at[j - 1], middle), (middle, at[j + 1])] if least.fun < 0 else []
        return [(float(a), float(b)) for a, b in found]

    def cycles(self, grid: Array) -> list[PredictedCycle]:
        """The predicted cycles with the means of this branch."""
        found = (self.cycle(low, high) for low, high in self.brackets(grid))
        return [cycle for cycle in found if cycle is not None]

    def cycle(self, low: float, high: float) -> PredictedCycle | None:
        """The amplitude between two at which one pair passes the axis; None where it does not."""

        def side(amplitude: float) -> float:
            # No mean counts as a root: nothing oscillates there.
            return float(np.nan_to_num(self.side(amplitude)[0]))

        near = float(brentq(side, low, high, xtol=1e-9 * low, rtol=1e-9))
        swings = self.spectrum(near)
        if not swings.size:
            return None
        pair = swings[np.argmin(np.abs(swings.real) / np.abs(swings))]

        def followed(amplitude: float) -> complex:
            values = linalg.eigvals(self.matrix(amplitude))
            return complex(values[np.argmin(np.abs(values - pair))])

        def rate(amplitude: float) -> float:
            return followed(amplitude).real

        low, high = near + 0.1 * (low - near), near + 0.1 * (high - near)
        if abs(pair.real) > 1e-6 * abs(pair) or not all(np.isfinite([self.mean(low), self.mean(high)])):
            return None
        sides = _sides(np.array([followed(low), followed(high)]))
        if sides[0] * sides[1] >= 0:
            return None
        amplitude = float(brentq(rate, low, high, xtol=1e-13 * high, rtol=1e-14))
        values, vectors = linalg.eig(self.matrix(amplitude))
        k = int(np.argmin(np.abs(values - followed(amplitude))))
        omega = float(values[k].imag)
        vector = vectors[:, k] / (self.split.row @ vectors[:, k])
        others = _sides(np.delete(values, [k, int(np.argmin(np.abs(values - np.conj(values[k]))))]))
        return PredictedCycle(
            amplitude,
            omega,
            bool(sides[0] > sides[1] and np.all(others <= 0)),
            self.mean(amplitude),
            tuple(float(v) for v in amplitude * np.abs(vector)),
            self._distortion(amplitude, omega),
        )

    def _distortion(self, amplitude: float, omega: float) -> float:
        parts = []
        for order in (2, 3):
            wave = self.split.harmonic(self.mean(amplitude), amplitude, order)
            inverse = order * 1j * omega * np.eye(len(self.split.states)) - self.split.matrix
            parts.append(abs(self.split.row @ linalg.solve(inverse, wave)) / amplitude)
        return float(np.hypot(*parts))
