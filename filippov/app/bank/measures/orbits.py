"""Periodic solutions: period, multipliers, stability; predictions of harmonic balance."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from filippov.analysis.algebra.growth import ACCURACY, by_multipliers
from filippov.analysis.harmonic.describing_function import describing_function
from filippov.analysis.orbits.orbit import Orbit
from filippov.analysis.sensitivity.saltation import NotDifferentiableError, flow_derivative
from filippov.analysis.steady.forcing import depends_on_time
from filippov.app.bank.case_runs import CaseRuns, slides
from filippov.app.bank.measures.measure import Measure, Number, one_of
from filippov.app.bank.notation import number
from filippov.app.bank.outcome import MissingError
from filippov.app.bank.recurrence import Cycle
from filippov.base.errors import ModelError, UsageError
from filippov.solving.state.options import Options

SYMMETRIC = 1e-6


class PeriodicOrbit(Measure, quantity="orbit"):
    """The periodic solution that the run settles on, or the periodic orbit near the start, stable or not.

    take    period; multipliers (real, by growing modulus); moduli (of all of them); multiplier (that of the
            largest modulus, real); modulus (the same without sign); exponent (its logarithm over the period);
            stability ("stable", "unstable", or "undecided" where the largest modulus is 1 to its accuracy)
    find    "settled", or "near_start", found by Newton's method; default: the first where the run settles,
            else the second
    period  a guess of the period, for near_start
    half    multipliers of the half map x(0) -> -x(T/2), for solutions that are symmetric under x -> -x
    trivial whether lists contain the multiplier 1 of an autonomous system, which single values omit
    """

    take: Literal["period", "multipliers", "moduli", "multiplier", "modulus", "exponent", "stability"]
    find: Literal["settled", "near_start"] | None = None
    period: Number | None = None
    half: bool = False
    trivial: bool = False

    def __call__(self, subject: CaseRuns) -> Any:
        """The property. Raises MissingError."""
        if self.take == "period":
            cycle = self._cycle(subject)
            return self._orbit(subject).period if cycle is None else cycle.period
        values = self._multipliers(subject)
        if self.take in ("multipliers", "moduli"):
            moduli = sorted(abs(v) for v in values)
            return moduli if self.take == "moduli" else [_real(v) for v in sorted(values, key=abs)]
        if self.take == "stability":
            return by_multipliers(values, ACCURACY * subject.options.get("rtol", Options.rtol))
        if not values:
            raise MissingError("the solution has no multiplier besides 1")
        largest = max(values, key=abs)
        if self.take == "exponent":
            period = PeriodicOrbit("period", self.find, self.period)(subject)
            with np.errstate(divide="ignore"):
                return float(np.log(abs(largest))) / period
        return abs(largest) if self.take == "modulus" else _real(largest)

    def _cycle(self, runs: CaseRuns) -> Cycle | None:
        try:
            return runs.cycle if self.find != "near_start" else None
        except MissingError:
            if self.find == "settled":
                raise
            return None

    def _orbit(self, runs: CaseRuns) -> Orbit:
        return runs.orbit(None if self.period is None else number(self.period, runs.names))

    def _multipliers(self, runs: CaseRuns) -> list[complex]:
        cycle = self._cycle(runs)
        wanted = self.trivial and self.take in ("multipliers", "moduli")
        if cycle is not None:
            values = _eigenvalues(runs, cycle, self.half)
            if not wanted and not depends_on_time(runs.built.system):
                values.remove(min(values, key=lambda v: abs(v - 1)))
            return values
        orbit = self._orbit(runs)
        found = orbit.half_multipliers if self.half else orbit.multipliers
        if found is None:
            raise MissingError("the periodic solution is not symmetric under x -> -x")
        return [*map(complex, found), *([1.0 + 0j] if wanted and orbit.trivial is not None else [])]


def _real(value: complex) -> float:
    if abs(value.imag) > 1e-9 * (1 + abs(value)):
        raise MissingError(f"the multiplier {value:.6g} is complex: take moduli, or the modulus")
    return value.real


def _eigenvalues(runs: CaseRuns, cycle: Cycle, half: bool) -> list[complex]:
    """Eigenvalues of the flow's derivative over a period, from the middle of its longest part in a mode."""
    (low, high), tiny = cycle.span, 1e-9 * cycle.period
    parts = [s for s in cycle.run.segments if s.t0 >= low - tiny and s.t1 <= high + tiny]
    parts = [s for s in parts if not slides(s.mode)] or parts
    if not parts:
        raise MissingError("the cycle has no part to start from")
    longest = max(parts, key=lambda s: s.dwell)
    t0 = 0.5 * (longest.t0 + longest.t1)
    assert cycle.run.sol is not None
    x0 = np.asarray(cycle.run.sol(t0))
    length = cycle.period / (2 if half else 1)
    run = runs.solve(x0=tuple(float(v) for v in x0), t0=t0, t_end=t0 + length)
    if not run.status.ok:
        raise MissingError(run.message)
    if half and np.max(np.abs(run.x_end + x0)) > SYMMETRIC * (1 + np.max(np.abs(x0))):
        raise MissingError("the periodic solution is not symmetric under x -> -x")
    try:
        matrix = flow_derivative(run)
    except NotDifferentiableError as error:
        raise MissingError(str(error)) from None
    return [complex(v) for v in np.linalg.eigvals(-matrix if half else matrix)]


class HarmonicBalance(Measure, quantity="harmonic_balance"):
    """A prediction of harmonic balance for a limit cycle: the `number`-th by growing amplitude."""

    take: Literal["period", "frequency", "amplitude"]
    number: int = 1

    def __call__(self, subject: CaseRuns) -> Any:
        try:
            cycles = describing_function(subject.built.system).cycles
        except (ModelError, UsageError) as error:
            raise MissingError(str(error)) from None
        return getattr(one_of(cycles, self.number, "predicted cycles"), self.take)
