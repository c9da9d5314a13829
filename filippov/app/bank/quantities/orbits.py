"""Periodic solutions, predictions of harmonic balance, values of parameters at which solutions change."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from filippov import EventKind, ModelError, SolveError, UsageError
from filippov.analysis import Orbit, continuation, describing_function, find_orbit
from filippov.analysis.algebra.growth import ACCURACY, by_multipliers
from filippov.analysis.sensitivity.saltation import NotDifferentiableError, flow_derivative
from filippov.analysis.steady.forcing import depends_on_time
from filippov.app.bank.build import build
from filippov.app.bank.case_runs import CaseRuns, in_time, slides
from filippov.app.bank.notation import Number
from filippov.app.bank.outcome import MissingError
from filippov.app.bank.quantities.quantity import Quantity, one_of
from filippov.app.bank.recurrence import Cycle
from filippov.base.names import check_known
from filippov.solving.state.options import Options

SYMMETRIC = 1e-6
SETTLED = 0.75  # the fraction of a doubled span that counts as settled


class PeriodicOrbit(Quantity, quantity="orbit"):
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
        return runs.orbit(None if self.period is None else runs.number(self.period))

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
    parts = [s for s in cycle.segments if not slides(s.mode)] or cycle.segments
    if not parts:
        raise MissingError("the cycle has no part to start from")
    longest = max(parts, key=lambda s: s.dwell)
    t0 = 0.5 * (longest.t0 + longest.t1)
    assert cycle.run.sol is not None
    x0 = np.asarray(cycle.run.sol(t0))
    length = cycle.period / (2 if half else 1)
    run = runs.finished(x0=tuple(float(v) for v in x0), t0=t0, t_end=t0 + length)
    if half and np.max(np.abs(run.x_end + x0)) > SYMMETRIC * (1 + np.max(np.abs(x0))):
        raise MissingError("the periodic solution is not symmetric under x -> -x")
    try:
        matrix = flow_derivative(run)
    except NotDifferentiableError as error:
        raise MissingError(str(error)) from None
    return [complex(v) for v in np.linalg.eigvals(-matrix if half else matrix)]


class HarmonicBalance(Quantity, quantity="harmonic_balance"):
    """A prediction of harmonic balance for a limit cycle: the `number`-th by growing amplitude."""

    take: Literal["period", "frequency", "amplitude"]
    number: int = 1

    def __call__(self, subject: CaseRuns) -> Any:
        try:
            cycles = describing_function(subject.built.system).cycles
        except (ModelError, UsageError) as error:
            raise MissingError(str(error)) from None
        return getattr(one_of(cycles, self.number, "predicted cycles"), self.take)


class Threshold(Quantity, quantity="threshold"):
    """The value of a parameter between settled solutions that reach a surface and those that do not.

    By bisection of `between`, where one end has such events and the other has none, down to `width`; the
    middle of the last interval. Settled is the last quarter of a run over twice the span.
    """

    parameter: str
    between: tuple[Number, Number]
    width: Number | None = None

    def __call__(self, subject: CaseRuns) -> Any:
        """The value. Raises MissingError where both ends are alike."""
        check_known("parameter", [self.parameter], subject.built.raw.get("params") or {})
        low, high = sorted(map(subject.number, self.between))
        built = build(subject.built.raw, free=self.parameter)
        runs = CaseRuns(built, subject.settings, subject.deadline)
        width = high - low if self.width is None else subject.number(self.width)
        first = self._contact(runs, low)
        if first == self._contact(runs, high):
            said = "contact" if first else "no contact"
            raise MissingError(f"{said} on both sides, {self.parameter} = {low:.9g} and {high:.9g}")
        while high - low > width * (1 + 1e-9) and low < (middle := 0.5 * (low + high)) < high:
            low, high = (middle, high) if self._contact(runs, middle) == first else (low, middle)
        subject.field_calls += runs.field_calls
        return 0.5 * (low + high)

    def _contact(self, runs: CaseRuns, value: float) -> bool:
        x0, (start, end) = runs.built.start(self.parameter, value)
        last = start + 2 * (end - start)
        run = runs.solve(x0=x0, t0=start, t_end=last, parameters={self.parameter: value})
        after = start + SETTLED * (last - start)
        return any(e.t > after and e.kind is not EventKind.GRAZING for e in runs.events(run))


class Fold(Quantity, quantity="fold"):
    """The value of a parameter at which a branch of periodic orbits, or of equilibria, turns back.

    The branch begins at the orbit near the start of the case, or at the equilibrium near it.

    between  the values that the branch is followed through
    mode     of an equilibrium, such as "+0" (0: slides); left out: the branch is one of orbits
    number   of the folds in the order along the branch, from 1
    """

    parameter: str
    between: tuple[Number, Number]
    mode: str | None = None
    number: int = 1

    def __call__(self, subject: CaseRuns) -> Any:
        """The value. Raises MissingError where no branch is found, or it has no such fold."""
        try:
            found = in_time(subject.deadline, lambda: self._folds(subject))
        except (SolveError, NotDifferentiableError, UsageError) as error:
            raise MissingError(f"no branch was found: {error}") from None
        return one_of(found, self.number, "folds")

    def _folds(self, subject: CaseRuns) -> list[float]:
        built = build(subject.built.raw, free=self.parameter)
        value = float(built.names[self.parameter])
        low, high = map(subject.number, self.between)
        start: Any = built.x0
        options: dict[str, Any] = {"value": value, "mode": self.mode}
        if self.mode is None:
            start, options = find_orbit(built.system, built.x0, t0=built.t_span[0]), {}
        run = continuation(built.system, start, parameter=self.parameter, bounds=(low, high), **options)
        return [point.value for point in run.run().folds]
