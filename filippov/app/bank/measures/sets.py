"""Sets of solutions, and rest."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from filippov.app.bank.case_runs import CaseRuns
from filippov.app.bank.measures.measure import Measure, Number, When, moment
from filippov.app.bank.notation import number
from filippov.app.bank.outcome import MissingError
from filippov.base.status import EventKind


class Reachable(Measure, quantity="reachable"):
    """The states that all solutions reach at a time.

    component  [least, largest] value of one state; default: the ends of all branches, a list of points
    releases   departures that are sampled along sliding that can be left at any time
    """

    t: When = None
    component: str | None = None
    releases: int = 0

    def __call__(self, subject: CaseRuns) -> Any:
        """The interval, or the points. Raises MissingError where the solution is unique."""
        time = moment(subject, self.t)
        tree = subject.tree(time, self.releases)
        if tree.unique:
            raise MissingError("the solution is unique")
        found = tree.reachable(time)
        if not found.complete:
            raise MissingError(f"not every solution was followed to t = {time:.9g}: {tree.message}")
        if self.component is None:
            return found.x
        values = found.x[:, subject.component(self.component)]
        return [float(np.min(values)), float(np.max(values))]


class Rest(Measure, quantity="rest"):
    """A solution that is started at a point, for the span of the case but at most a time of 1.

    take  drift: how far it moves, with its velocity at the end; rests: the text yes or no
    """

    point: tuple[Number, ...]
    take: Literal["drift", "rests"] = "drift"

    def __call__(self, subject: CaseRuns) -> Any:
        start, end = subject.built.t_span
        point = np.array([number(value, subject.names) for value in self.point])
        if point.shape != (len(subject.states),):
            raise MissingError(f"the case has {len(subject.states)} states")
        last = start + min(abs(end - start), 1.0)
        run = subject.solve(x0=tuple(point), t_end=last, nonunique="stick")
        if self.take == "rests":
            return "yes" if run.status.ok and bool(np.all(run.x_end == point)) else "no"
        if not run.status.ok:
            raise MissingError(run.message)
        velocity, _ = subject.velocity(run)
        return float(np.max(np.abs(run.x_end - point)) + np.max(np.abs(velocity)))


class Stop(Measure, quantity="stop"):
    """The time at which the solution comes to permanent rest within the span, or the state.

    take   t, state, or the name of a state
    still  largest rate that counts as rest
    """

    take: str = "t"
    still: Number = 1e-9

    def __call__(self, subject: CaseRuns) -> Any:
        run = subject.main
        entries = [e for e in subject.events() if e.kind is EventKind.ENTRY]
        velocity, _ = subject.velocity(run)
        moves = np.max(np.abs(velocity)) > number(self.still, subject.names)
        if not entries or run.end_mode != entries[-1].after or moves:
            raise MissingError("the solution does not rest at the end of the span")
        if self.take == "t":
            return entries[-1].t
        return run.x_end if self.take == "state" else run.x_end[subject.component(self.take)]
