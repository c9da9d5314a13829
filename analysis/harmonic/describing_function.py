"""Limit cycles as predicted by harmonic balance: an approximation, to be compared with the exact ones.

The input y = c . x of the nonlinear terms is assumed to be a sine, y = mean + A sin(omega t), and every
phi_i(y) is replaced by its mean and first harmonic N_i(A) (y - mean). The result is linear, x' = (A0 + N(A)
c) x, and a cycle is predicted where this matrix has an eigenvalue j omega. There is no bound on the error;
`PredictedCycle.distortion` says how far the input would be from a sine.

Sources: Gelb & Vander Velde 1968; Khalil 2002; for friction, where the method fails,
Armstrong-Helouvry & Amin 1996 and Olsson 1995.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from filippov import System, UsageError
from filippov.analysis.algebra import linalg
from filippov.analysis.harmonic.quasi_linear import ComplexArray, Lure, lure, shared_input, width_unit
from filippov.base.arrays import Array
from filippov.base.escape import figure_text
from filippov.base.given import Interval
from filippov.base.keywords import keywords
from filippov.base.shown import Shown
from filippov.plot.style import axis_label, time_unit

LEVELS, EDGE = 160, 1e-9
# Real part of an eigenvalue, in units of its size, that the integrals of harmonics leave of 0.
ON_AXIS = 1e-11


@dataclass(frozen=True)
class PredictedCycle:
    """A limit cycle that harmonic balance predicts.

    amplitude    of the input y; amplitudes: of every state; mean: of the input
    frequency    omega [rad/s]; period: 2 pi/omega
    stable       whether the quasi-linear growth rate falls with the amplitude (Loeb's criterion)
    distortion   size of the third harmonic that the loop would feed back to the input, divided by A: small
                 means that the assumption of a sine is consistent
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

    cycles     predicted limit cycles by growing amplitude; () where none is predicted
    amplitude  grid of A; growth, frequency: the largest real part among the oscillating eigenvalues of the
               quasi-linear matrix there, and its frequency; NaN where none oscillates
    gain       N(A) of each equation, shape (n, k)
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
        rows = [
            f"  A = {c.amplitude:.9g}, omega = {c.frequency:.9g} (period {c.period:.9g}), "
            f"{'stable' if c.stable else 'unstable'}, third harmonic {100 * c.distortion:.2g} % of A"
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

    Raises ModelError where the system has no form x' = A x + phi(y), UsageError for a bad range.
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
    # A relay with hysteresis switches where the input goes through all of its band.
    least = float(np.max(np.abs(split.widths / split.slopes), initial=0.0, where=split.widths > 0))
    grid = np.geomspace(max(low, least * (1 + EDGE)), high, LEVELS)
    balance = _Balance(split)
    spectra = [balance.spectrum(amplitude) for amplitude in grid]
    gain: ComplexArray = np.array([balance.gain(amplitude) / unit for amplitude in grid]).T
    cycles = []
    for k, values in enumerate(spectra):
        for value in values[_sides(values) != 0]:
            passed, side = _next_side(value, spectra[k + 1 : k + 3])
            cycle = balance.cycle(grid[k], grid[k + passed], value) if side * value.real < 0 else None
            if cycle is not None:
                cycles.append(cycle)
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


def _next_side(value: complex, spectra: Sequence[ComplexArray]) -> tuple[int, int]:
    """How many levels on the eigenvalue that follows is off the axis, and its side; 0 where none is."""
    for passed, values in enumerate(spectra, 1):
        if not values.size:
            break
        value = values[np.argmin(np.abs(values - value))]
        if side := int(_sides(np.array(value))):
            return passed, side
    return 1, 0


def _runs(grid: Array, on: Sequence[bool], least: int = 2) -> tuple[tuple[float, float], ...]:
    """The ends of neighbours that are on, of `least` and more."""
    marks = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    pairs = zip(marks[::2], marks[1::2] - 1, strict=True)
    return tuple((float(grid[a]), float(grid[b])) for a, b in pairs if b > a + least - 2)


class _Balance:
    """The quasi-linear matrix of one loop; the mean is followed from amplitude to amplitude."""

    def __init__(self, split: Lure) -> None:
        self.split = split
        # The mean of the input by amplitude; nan where none is found.
        self.means: dict[float, float] = {}
        # Rows w with w [A; c] = 0: the states go, and w [phi_0(m); offset - m] = 0 is left for the mean m.
        whole = np.vstack([split.matrix, split.row])
        rows = np.max(np.abs(whole), axis=1)
        rows = np.where(rows > 0, rows, 1.0)
        columns = np.max(np.abs(whole / rows[:, None]), axis=0, initial=0.0)
        scaled = whole / rows[:, None] / np.where(columns > 0, columns, 1.0)
        self.left = linalg.null_space(scaled.T).T / rows

    def mean(self, amplitude: float) -> float:
        """Mean of the input for which the constant terms balance; nan where none is found."""
        if amplitude not in self.means:
            self.means[amplitude] = self._mean(amplitude)
        return self.means[amplitude]

    def _terms(self, mean: float, amplitude: float) -> Array:
        """What balances, a row for each condition."""
        constant = self.split.harmonic(mean, amplitude, 0).real
        return np.asarray(self.left * np.append(constant, self.split.offset - mean))

    def _balanced(self, mean: float, amplitude: float, part: float) -> bool:
        """Whether the terms cancel, next to what the constant terms, the wave and the amplitude bring."""
        terms, wave = self._terms(mean, amplitude), self.split.harmonic(mean, amplitude)
        sizes = np.abs(terms) + np.abs(self.left * np.append(wave, amplitude))
        return bool(np.all(np.abs(np.sum(terms, axis=1)) <= part * np.sum(sizes, axis=1)))

    def _mean(self, amplitude: float) -> float:
        """The mean next to that of the nearest amplitude, as it is and in proportion to it."""
        guesses = [self.split.offset]
        known = {size: m for size, m in self.means.items() if np.isfinite(m)}
        if known:
            near = min(known, key=lambda size: abs(np.log(size / amplitude)))
            guesses = [known[near], known[near] * amplitude / near]

        def condition(mean: float) -> float:
            return float(np.sum(self._terms(mean, amplitude)[0]))

        for guess in guesses:
            if self._balanced(guess, amplitude, 1e-12):
                return guess
        away = amplitude * np.concatenate([np.linspace(0.0, 1.0, 11), np.geomspace(1.2, 1e6, 13)])
        points = np.unique(np.concatenate([guess + side * away for guess in guesses for side in (-1, 1)]))
        values = np.array([condition(point) for point in points])
        found = [
            float(brentq(condition, points[k], points[k + 1], xtol=1e-15 * amplitude, rtol=1e-14))
            for k in np.flatnonzero(np.sign(values[:-1]) != np.sign(values[1:]))
        ]
        there = [mean for mean in found if self._balanced(mean, amplitude, 1e-8)]
        return min(there, key=lambda mean: abs(mean - guesses[-1]), default=float("nan"))

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

    def cycle(self, low: float, high: float, near: complex) -> PredictedCycle | None:
        """The amplitude between two at which the eigenvalue followed from `near` is on the axis."""
        followed = {"last": near}

        def rate(amplitude: float) -> float:
            values = self.spectrum(amplitude)
            if not values.size:
                return float("nan")
            followed["last"] = values[np.argmin(np.abs(values - followed["last"]))]
            return float(followed["last"].real)

        at_low, at_high = rate(low), rate(high)
        if not at_low * at_high <= 0:
            return None
        amplitude = low if at_low == 0.0 else float(brentq(rate, low, high, xtol=1e-13 * high, rtol=1e-14))
        values, vectors = linalg.eig(self.matrix(amplitude))
        k = int(np.argmin(np.abs(values - followed["last"])))
        omega = float(values[k].imag)
        vector = vectors[:, k] / (self.split.row @ vectors[:, k])
        return PredictedCycle(
            amplitude,
            omega,
            at_low > at_high,
            self.mean(amplitude),
            tuple(float(v) for v in amplitude * np.abs(vector)),
            self._distortion(amplitude, omega),
        )

    def _distortion(self, amplitude: float, omega: float) -> float:
        third = self.split.harmonic(self.mean(amplitude), amplitude, 3)
        size = len(self.split.states)
        back = linalg.solve(3j * omega * np.eye(size) - self.split.matrix, third)
        return float(abs(self.split.row @ back) / amplitude)
