"""The state and its mode at a time, at the end, at rest; phases of sliding and slip; turning points."""

from __future__ import annotations

from dataclasses import field
from typing import Any, Literal

import numpy as np

from filippov.app.bank.case_runs import CaseRuns, slides
from filippov.app.bank.notation import Number
from filippov.app.bank.outcome import MissingError
from filippov.app.bank.quantities.quantity import Quantity, When, expression, moment, one_of
from filippov.base.status import EventKind, mode_text
from filippov.solving.segments import Segment
from filippov.solving.solution import Solution
from filippov.solving.state.events import Mode

Rule = Literal["filippov", "moments", "utkin"]


class State(Quantity, quantity="state"):
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
            x = subject.finished(t_end=t, sliding=self.sliding).x_end
        return subject.part(x, self.component)


def under(runs: CaseRuns, rule: Rule | None, when: When) -> tuple[Solution, float]:
    """The run under a rule of sliding, and the value of the time. Raises MissingError."""
    if when is None and not runs.main.status.ok and rule is None:
        return runs.main, runs.main.t_end
    t = moment(runs, when)
    if rule is None:
        return runs.covering(t), t
    run = runs.solve(sliding=rule)
    if not run.status.ok:
        raise MissingError(f"with sliding={rule!r} the run ends with {run.status.value} ({run.message})")
    return run, t


def mode_at(run: Solution, t: float) -> Mode:
    """The mode just after a time, or at the end of a run."""
    return run.end_mode if t == run.t_end else run.mode_at(t, "+")


class ModeAt(Quantity, quantity="mode"):
    """The mode at a time, a text of +, - and 0 (sliding), one for each declared surface."""

    t: When = None

    def __call__(self, subject: CaseRuns) -> Any:
        return mode_text(mode_at(*under(subject, None, self.t)))[: len(subject.built.declared)]


class Segments(Quantity, quantity="segments"):
    """The parts of the run in one mode, in order, or the first of them: their modes or lengths, a list."""

    take: Literal["mode", "length"] = "mode"
    first: int | None = None

    def __call__(self, subject: CaseRuns) -> Any:
        count, run = len(subject.built.declared), subject.main
        modes, lengths = [mode[:count] for mode in run.modes], [segment.dwell for segment in run.segments]
        return (modes if self.take == "mode" else lengths)[: self.first]


class SlidingOn(Quantity, quantity="sliding_on"):
    """Numbers of the declared surfaces that the solution slides on at a time, in order."""

    t: When = None

    def __call__(self, subject: CaseRuns) -> Any:
        mode = mode_at(*under(subject, None, self.t))
        return [i for i in range(len(subject.built.declared)) if mode[i] == 0]


class End(Quantity, quantity="end"):
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


class Steady(Quantity, quantity="steady_state"):
    """The state that the solution settles at, followed up to 64 times the span.

    still  largest |x'| times the span, relative to the state, that counts as settled
    """

    component: str | None = None
    still: Number = 1e-9

    def __call__(self, subject: CaseRuns) -> Any:
        start, end = subject.built.t_span
        for factor in (1.0, 4.0, 16.0, 64.0):
            run = subject.finished(t_end=start + factor * (end - start), zeno="continue")
            velocity, _ = subject.velocity(run)
            moved = np.max(np.abs(velocity)) * abs(end - start)
            if moved <= subject.number(self.still) * (1 + np.max(np.abs(run.x_end))):
                return subject.part(run.x_end, self.component)
        raise MissingError("the solution does not settle")


class Rest(Quantity, quantity="rest"):
    """A solution that is started at a point, for the span of the case but at most a time of 1.

    take  drift: how far it moves, with its velocity at the end; rests: the text yes or no
    """

    point: tuple[Number, ...]
    take: Literal["drift", "rests"] = "drift"

    def __call__(self, subject: CaseRuns) -> Any:
        start, end = subject.built.t_span
        point = np.array([*map(subject.number, self.point)])
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


class Stop(Quantity, quantity="stop"):
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
        moves = np.max(np.abs(velocity)) > subject.number(self.still)
        if not entries or run.end_mode != entries[-1].after or moves:
            raise MissingError("the solution does not rest at the end of the span")
        if self.take == "t":
            return entries[-1].t
        return subject.part(run.x_end, None if self.take == "state" else self.take)


class Phases(Quantity, quantity="phases"):
    """Phases that slide (stick), or that do not (slip); a slip through h = 0 is one phase.

    slides  whether those that slide are meant
    over    "span", or "period": those that lie within the last period of the solution that the run settles on
    whole   without those at the beginning and the end of the span, if there are others
    number  only that one, from 1 or from the end with -1; first: only so many
    take    length, interval ([begin, end]), begin, middle, end
    """

    slides: bool
    over: Literal["span", "period"] = "span"
    whole: bool = False
    number: int | None = None
    first: int | None = None
    take: Literal["length", "interval", "begin", "middle", "end"] = "length"

    def __call__(self, subject: CaseRuns) -> Any:
        segments: tuple[Segment, ...] = subject.main.segments
        if self.over == "period":
            segments = subject.cycle.segments
        elif self.whole:
            segments = segments[1:-1] or segments
        found = [(low, high) for kind, low, high in phases(segments) if kind == self.slides]
        taken = [self._taken(*phase) for phase in found][: self.first]
        return taken if self.number is None else one_of(taken, self.number, "such phases")

    def _taken(self, low: float, high: float) -> Any:
        return {
            "length": high - low, "interval": [low, high], "begin": low, "middle": 0.5 * (low + high),
            "end": high,
        }[self.take]  # fmt: skip


def phases(segments: tuple[Segment, ...]) -> list[tuple[bool, float, float]]:
    """Whether it slides, its begin and end; a slip through h = 0 is one phase, in any number of modes."""
    out: list[tuple[bool, float, float]] = []
    for segment in segments:
        kind, low = slides(segment.mode), segment.t0
        if out and out[-1][0] == kind:
            low = out.pop()[1]
        out.append((kind, low, segment.t1))
    return [phase for phase in out if phase[1] != phase[2]]


class LevelTimes(Quantity, quantity="level_times"):
    """Times at which a formula in t and the states vanishes along the run.

    directions  "+" rising, "-" falling: the first time of the first of these, then the next time of the
                second, and so on
    number      only that one, from 1 or from the end with -1; first: only so many
    """

    formula: str
    directions: tuple[Literal["+", "-"], ...] | None = None
    number: int | None = None
    first: int | None = None
    where: dict[str, Quantity] = field(default_factory=dict)

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


class TurningPoints(Quantity, quantity="turning_points"):
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
        name = self.component if self.take == "value" else self.take
        found = [t if name == "t" else x[subject.component(name)] for t, x, _ in rows]
        return found[: self.first] if self.number is None else one_of(found, self.number, "turning points")


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
