"""Values of a parameter: where the solution begins to reach a surface, where a branch has a fold."""

from __future__ import annotations

from typing import Any

from filippov.analysis.bifurcations.continuation import continuation
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.analysis.sensitivity.saltation import NotDifferentiableError
from filippov.app.bank.build import build
from filippov.app.bank.case_runs import CaseRuns, in_time
from filippov.app.bank.measures.measure import Measure, Number, one_of
from filippov.app.bank.notation import number
from filippov.app.bank.outcome import MissingError
from filippov.base.errors import SolveError, UsageError
from filippov.base.names import check_known
from filippov.base.status import EventKind

SETTLED = 0.75  # the fraction of a doubled span that counts as settled


class Threshold(Measure, quantity="threshold"):
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
        low, high = sorted(number(value, subject.names) for value in self.between)
        built = build(subject.built.raw, free=self.parameter)
        runs = CaseRuns(built, subject.settings, subject.deadline)
        width = high - low if self.width is None else number(self.width, subject.names)
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


class Fold(Measure, quantity="fold"):
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
        low, high = (number(end, subject.names) for end in self.between)
        start: Any = built.x0
        options: dict[str, Any] = {"value": value, "mode": self.mode}
        if self.mode is None:
            start, options = find_orbit(built.system, built.x0, t0=built.t_span[0]), {}
        run = continuation(built.system, start, parameter=self.parameter, bounds=(low, high), **options)
        return [point.value for point in run.run().folds]
