"""The state and its mode at a time and at the end of the run, and the steady state."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from filippov.app.bank.case_runs import CaseRuns
from filippov.app.bank.measures.measure import Measure, Number, When, moment
from filippov.app.bank.notation import number
from filippov.app.bank.outcome import MissingError
from filippov.base.status import mode_text
from filippov.solving.state.events import Mode

Rule = Literal["filippov", "moments", "utkin"]


class State(Measure, quantity="state"):
    """The state at a time; the run is continued if that is beyond the span.

    component  one state by name; default: all
    side       "-" or "+": before or after a jump there
    sliding    the rule of sliding
    """

    t: When = None
    component: str | None = None
    side: Literal["-", "+"] = "-"
    sliding: Rule | None = None

    def __call__(self, subject: CaseRuns) -> Any:
        t = moment(subject, self.t)
        if self.sliding is None:
            x = subject.state(t, side=self.side)
        else:
            run = subject.solve(t_end=t, sliding=self.sliding)
            if not run.status.ok:
                raise MissingError(run.message)
            x = run.x_end
        return x if self.component is None else x[subject.component(self.component)]


def mode_at(runs: CaseRuns, when: When) -> Mode:
    """The mode just after a time, or at the end of a run."""
    t = moment(runs, when)
    if when is None and not runs.main.status.ok:
        return runs.main.end_mode
    run = runs.covering(t)
    return run.end_mode if t == run.t_end else run.mode_at(t, "+")


class ModeAt(Measure, quantity="mode"):
    """The mode at a time, a text of +, - and 0 (sliding), one for each declared surface."""

    t: When = None

    def __call__(self, subject: CaseRuns) -> Any:
        return mode_text(mode_at(subject, self.t))[: len(subject.built.declared)]


class Segments(Measure, quantity="segments"):
    """The parts of the run in one mode, in order, or the first of them: their modes or lengths, a list."""

    take: Literal["mode", "length"] = "mode"
    first: int | None = None

    def __call__(self, subject: CaseRuns) -> Any:
        count, run = len(subject.built.declared), subject.main
        modes, lengths = [mode[:count] for mode in run.modes], [segment.dwell for segment in run.segments]
        return (modes if self.take == "mode" else lengths)[: self.first]


class SlidingOn(Measure, quantity="sliding_on"):
    """Numbers of the declared surfaces that the solution slides on at a time, in order."""

    t: When = None

    def __call__(self, subject: CaseRuns) -> Any:
        mode = mode_at(subject, self.t)
        return [i for i in range(len(subject.built.declared)) if mode[i] == 0]


class End(Measure, quantity="end"):
    """The end of the run: its status as text (success, non_unique, zeno, grazing, not_finite, ...), or time.

    take     status, t, or size: the largest |x| there
    grazing  whether the run ends at a grazing
    """

    take: Literal["status", "t", "size"] = "status"
    grazing: bool = False

    def __call__(self, subject: CaseRuns) -> Any:
        run = subject.solve(on_graze="error") if self.grazing else subject.main
        if self.take == "size":
            return float(np.max(np.abs(run.x_end)))
        return run.status.value if self.take == "status" else run.t_end


class Steady(Measure, quantity="steady_state"):
    """The state that the solution settles at, followed up to 64 times the span.

    still  largest |x'| times the span, relative to the state, that counts as settled
    """

    component: str | None = None
    still: Number = 1e-9

    def __call__(self, subject: CaseRuns) -> Any:
        start, end = subject.built.t_span
        for factor in (1.0, 4.0, 16.0, 64.0):
            run = subject.solve(t_end=start + factor * (end - start), zeno="continue")
            if not run.status.ok:
                raise MissingError(run.message)
            velocity, _ = subject.velocity(run)
            moved = np.max(np.abs(velocity)) * abs(end - start)
            if moved <= number(self.still, subject.names) * (1 + np.max(np.abs(run.x_end))):
                return run.x_end if self.component is None else run.x_end[subject.component(self.component)]
        raise MissingError("the solution does not settle")
