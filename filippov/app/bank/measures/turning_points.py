"""Turning points of a state, and the zeros of a formula."""

from __future__ import annotations

from dataclasses import field
from typing import Any, Literal

import numpy as np

from filippov.app.bank.case_runs import CaseRuns
from filippov.app.bank.measures.measure import Measure, expression, one_of
from filippov.app.bank.outcome import MissingError
from filippov.solving.solution import Solution


class LevelTimes(Measure, quantity="level_times"):
    """Times at which a formula in t and the states vanishes along the run.

    directions  "+" rising, "-" falling: the first time of the first of these, then the next time of the
                second, and so on
    number      only that one, from 1 or from the end with -1; first: only so many
    """

    formula: str
    directions: tuple[Literal["+", "-"], ...] | None = None
    number: int | None = None
    first: int | None = None
    where: dict[str, Measure] = field(default_factory=dict)

    def __call__(self, subject: CaseRuns) -> Any:
        found = subject.zeros(subject.main, expression(subject, self.formula, self.where))
        ways = [1 if way == "+" else -1 for way in self.directions or ()]
        if self.number is not None:
            return one_of([t for t, way in found if not ways or way in ways], self.number, "zeros")
        if not ways:
            return [t for t, _ in found][: self.first]
        times, rest = [], iter(found)
        for way in ways:
            times += [next((t for t, direction in rest if direction == way), np.nan)]
        if np.isnan(times[-1]):
            raise MissingError("the run does not reach this value so often")
        return times


class TurningPoints(Measure, quantity="turning_points"):
    """Turning points of a state: times at which its derivative changes sign, or its values there.

    component  its name
    kind       "max" or "min"; default: both
    start      whether the start of the run counts where the derivative vanishes there
    number     only that one, from 1 or from the end with -1; first: only so many
    take       "t", "value", or the name of another state
    """

    component: str
    kind: Literal["max", "min"] | None = None
    start: bool = False
    number: int | None = None
    first: int | None = None
    take: str = "value"

    def __call__(self, subject: CaseRuns) -> Any:
        run, k = subject.main, subject.component(self.component)
        assert run.sol is not None
        begin = run.problem.t_span[0]
        rows: list[tuple[float, Any, int]] = []
        for t, way in turning(subject, run, k):
            x = np.asarray(run.sol(t))
            # The end of a time of rest is not a turning point.
            if (not rows or abs(x[k] - rows[-1][1][k]) > 1e-12) and (self.start or t > begin + 1e-12):
                rows.append((t, x, way))
        rows = [row for row in rows if self.kind is None or row[2] == (-1 if self.kind == "max" else 1)]
        if self.number is not None:
            rows = [one_of(rows, self.number, "turning points")]
        name = self.component if self.take == "value" else self.take
        found = [t if name == "t" else x[subject.component(name)] for t, x, _ in rows][: self.first]
        return found if self.number is None else found[0]


def turning(runs: CaseRuns, run: Solution, k: int) -> list[tuple[float, int]]:
    """Times at which the derivative of a state vanishes, with the direction in which it does."""
    rows = {row[k] for row in runs.built.fields.values()}
    if len(rows) == 1:
        return _merged(runs.zeros(run, next(iter(rows))))
    assert run.sol is not None
    times = np.unique(np.concatenate([runs.times(run), _stationary(runs, run, k)]))
    values = run.sol(times)[k]
    inner = np.flatnonzero((values[1:-1] - values[:-2]) * (values[2:] - values[1:-1]) <= 0) + 1
    return [(float(times[i]), int(np.sign(values[i + 1] - values[i]))) for i in inner]


def _stationary(runs: CaseRuns, run: Solution, k: int) -> list[float]:
    """Times inside the segments off the surfaces at which the field of a state vanishes."""
    fields = runs.built.fields
    count = len(next(iter(fields)))
    found = []
    for segment in run.segments:
        row = fields.get("".join({1: "+", -1: "-"}.get(sign, "0") for sign in segment.mode[:count]))
        if row is not None and segment.t1 > segment.t0:
            found += [t for t, _ in runs.zeros(run, row[k], segment.t0, segment.t1)]
    return found


def _merged(found: list[tuple[float, int]]) -> list[tuple[float, int]]:
    """Zeros that stay (sticking) count once."""
    out: list[tuple[float, int]] = []
    for t, direction in found:
        if not out or t - out[-1][0] > 1e-7 * (1 + abs(t)):
            out.append((t, direction))
    return out
