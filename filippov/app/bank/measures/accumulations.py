"""Accumulations of events (Zeno): their time, their ratios, the state afterwards."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from filippov.app.bank.case_runs import CaseRuns
from filippov.app.bank.measures.measure import Measure
from filippov.app.bank.outcome import MissingError
from filippov.base.status import Status
from filippov.solving.solution import Solution
from filippov.solving.state.events import Event
from filippov.solving.state.machine import Machine

LONGER = (1.0, 2.0, 8.0, 32.0)
# The least distance that is compared, and the most events.
NEAREST, MOST = 1e-9, 24


def accumulation(runs: CaseRuns) -> Solution:
    """The run up to the limit of its events, from increasingly long spans. Raises MissingError."""
    start, end = runs.built.t_span
    for factor in LONGER:
        run = runs.solve(t_end=start + factor * (end - start), zeno="stop")
        if run.status is Status.ZENO:
            return run
        if not run.status.ok:
            raise MissingError(run.message)
    raise MissingError(f"no events accumulate within {LONGER[-1]:g} times the span")


class Accumulation(Measure, quantity="accumulation"):
    """The limit of accumulating events.

    take  t; or state_after: the state half as long again after it
    """

    take: Literal["t", "state_after"] = "t"

    def __call__(self, subject: CaseRuns) -> Any:
        run = accumulation(subject)
        if self.take == "t":
            return run.t_end if run.zeno is None else run.zeno.t
        end = run.t_end + 0.5 * abs(run.t_end - subject.built.t_span[0])
        after = subject.solve(t_end=end, zeno="continue")
        if not after.status.ok:
            raise MissingError(after.message)
        return after.x_end


class Ratios(Measure, quantity="ratios"):
    """Ratios of successive quantities at the events of an accumulation, a list.

    between  intervals (of time), distances (|h_1| + |h_2| + ...), or the name of a state: its magnitude
    surface  only the events of one surface, by number or name
    """

    between: str
    surface: int | str | None = None

    def __call__(self, subject: CaseRuns) -> Any:
        events = _tail(subject)
        if self.surface is not None:
            place = subject.place(self.surface)
            events = [e for e in events if subject.place(e.surface) == place]
        sizes = self._sizes(subject, events)
        if len(sizes) < 3 or not np.all(sizes[:-1] > 0):
            raise MissingError("the run has too few such events for ratios")
        return sizes[1:] / sizes[:-1]

    def _sizes(self, runs: CaseRuns, events: list[Event]) -> Any:
        if self.between == "intervals":
            return np.diff([e.t for e in events])
        if self.between == "distances":
            machine = Machine(runs.main.problem.system, runs.method, runs.main.problem.p)
            rows = [(e.t, np.ascontiguousarray(e.x), np.array(e.before, dtype=float)) for e in events]
            sizes = np.array([np.sum(np.abs(machine.guards(*row))) for row in rows])
            if not np.all(sizes[:-1] > NEAREST):
                raise MissingError("the events are too near to their limit for ratios")
            return sizes
        k = runs.component(self.between)
        return np.abs([e.x[k] for e in events])


def _tail(runs: CaseRuns) -> list[Event]:
    """Events of the accumulating solution that are far enough from its limit to be accurate."""
    events = runs.events()
    if len(events) < 6:
        events = runs.events(accumulation(runs))
    if len(events) < 4:
        raise MissingError("the run has too few events")
    return events[:MOST]
