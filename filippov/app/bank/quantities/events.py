"""Events: one of them, their list, their number, and the limit at which they accumulate (Zeno)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from filippov import EventKind, Solution, Status
from filippov.app.bank.case_runs import CaseRuns
from filippov.app.bank.notation import Number
from filippov.app.bank.outcome import MissingError
from filippov.app.bank.quantities.quantity import Quantity, When, moment, one_of
from filippov.solving.state.events import Event
from filippov.solving.state.machine import Machine

Kind = Literal["cross", "slide", "exit", "graze", "reset", "time", "any"]
WORDS = {
    EventKind.CROSSING: "cross", EventKind.ENTRY: "slide", EventKind.EXIT: "exit", EventKind.GRAZING: "graze",
    EventKind.RESET: "reset", EventKind.TIME: "time",
}  # fmt: skip
# Spans in which an accumulation is looked for, as multiples of the case's.
LONGER = (1.0, 2.0, 8.0, 32.0)
# The least distance from the limit that is compared, and the most events.
NEAREST, MOST = 1e-9, 24


class Filter(Quantity):
    """Which events of a run, in order.

    kind         cross, slide (sliding begins), exit (it ends), graze, reset, time, any; else all but graze
    direction    "+" or "-": the side on which h is afterwards
    surface      number of the surface in the order of h, event_functions, time_events, or its name; or a list
    codimension  number of surfaces that the solution slides on after the event, or, for an exit, before it
    acting       only events at which the field or the state changes
    over         "span", or "period": the events of the last period of the solution that the run settles on
    x0           another start
    until        the run is continued to this time if that is beyond the span
    """

    kind: Kind | None = None
    direction: Literal["+", "-"] | None = None
    surface: int | str | tuple[int | str, ...] | None = None
    codimension: int | None = None
    acting: bool = False
    over: Literal["span", "period"] = "span"
    x0: tuple[Number, ...] | None = None
    until: When = None

    def chosen(self, runs: CaseRuns) -> list[Event]:
        """The events."""
        every = list(runs.cycle.events) if self.over == "period" else runs.events(self._run(runs))
        many = self.surface if isinstance(self.surface, tuple) else (self.surface,)
        places = {runs.place(surface) for surface in many if surface is not None}

        def passes(e: Event) -> bool:
            mode = e.before if e.kind is EventKind.EXIT else e.after
            kinds = ("any", WORDS[e.kind], *([] if e.kind is EventKind.GRAZING else [None]))
            return (
                self.kind in kinds
                and self.direction in (None, {1: "+", -1: "-"}.get(e.direction, ""))
                and (self.surface is None or runs.place(e.surface) in places)
                and self.codimension in (None, mode.count(0))
                and (not self.acting or acts(runs, e))
            )

        return [e for e in every if passes(e)]

    def _run(self, runs: CaseRuns) -> Solution:
        start, end = runs.built.t_span
        last = end if self.until is None else moment(runs, self.until)
        beyond = last > max(start, end)
        if self.x0 is not None:
            return runs.solve(x0=tuple(map(runs.number, self.x0)), t_end=last if beyond else end)
        return runs.covering(last) if beyond else runs.main


def acts(runs: CaseRuns, event: Event) -> bool:
    """Whether the field, or the state, changes at an event: not all surfaces act everywhere."""
    if event.kind is not EventKind.CROSSING:
        return event.kind is not EventKind.GRAZING
    fields = runs.built.fields
    count = len(next(iter(fields), ""))
    modes = (event.before, event.after)
    sides = ["".join("+" if sign >= 0 else "-" for sign in mode[:count]) for mode in modes]
    return fields.get(sides[0]) != fields.get(sides[1])


def word(event: Event) -> str:
    """An event's kind with its direction: cross+, slide, exit-, graze, reset."""
    return WORDS[event.kind] + {1: "+", -1: "-"}.get(event.direction, "")


def taken(runs: CaseRuns, event: Event, take: str) -> Any:
    """A property of an event: t, kind, signed_kind, surface, state, state_after, or a state by name."""
    after = event.x if event.x_after is None else event.x_after
    named = {
        "t": event.t, "kind": WORDS[event.kind], "signed_kind": word(event), "state": event.x,
        "surface": runs.place(event.surface), "state_after": after,
    }  # fmt: skip
    if take in named:
        return named[take]
    name, _, side = take.partition("@")
    return (after if side == "after" else event.x)[runs.component(name)]


class OneEvent(Filter, quantity="event"):
    """One event: the `number`-th of those that pass the filter, from 1, or from the end with -1.

    take   "t", "kind", "signed_kind" (cross+, exit-), "surface", "state", "state_after", the name of a state,
           or that name with @after
    """

    number: int = 1
    take: str = "t"

    def __call__(self, subject: CaseRuns) -> Any:
        return taken(subject, one_of(self.chosen(subject), self.number, "such events"), self.take)


class SomeEvents(Filter, quantity="events"):
    """A property of all events that pass the filter, or of the first or last of them, as a list."""

    first: int | None = None
    last: int | None = None
    take: str = "t"

    def __call__(self, subject: CaseRuns) -> Any:
        events = self.chosen(subject)[: self.first]
        return [taken(subject, e, self.take) for e in events[-self.last if self.last else None :]]


class EventCount(Filter, quantity="event_count"):
    """The number of events that pass the filter."""

    def __call__(self, subject: CaseRuns) -> Any:
        return float(len(self.chosen(subject)))


@dataclass(frozen=True)
class EventRecord:
    """The expected properties of one event; those left out are not compared.

    kind   with or without the direction: cross+, cross
    """

    t: Number | None = None
    kind: str | None = None
    surface: int | str | None = None
    state: tuple[Number, ...] | None = None
    state_after: tuple[Number, ...] | None = None


class EventList(Quantity, quantity="event_list"):
    """The largest deviation of times and states of the run's first events from this list.

    The events are in order, those at one instant in any order. An empty list: there are none.

    together  events within this time of each other are at one instant
    grazing   whether the list holds grazing events
    """

    events: tuple[EventRecord, ...]
    together: Number = 1e-9
    grazing: bool = False

    def __call__(self, subject: CaseRuns) -> Any:
        """The largest deviation. Raises MissingError where an event is not in the run."""
        kinds = [e for e in subject.events() if self.grazing or e.kind is not EventKind.GRAZING]
        if not self.events and kinds:
            raise MissingError(f"{len(kinds)} events, expected none")
        worst = 0.0
        for place, record in enumerate(self.events):
            event = self._match(subject, kinds, record)
            if event is None:
                raise MissingError(f"event {place + 1} ({record.kind} at {record.t}) is not in the run")
            kinds.remove(event)
            after = event.x if event.x_after is None else event.x_after
            for given, got in ((record.t, [event.t]), (record.state, event.x), (record.state_after, after)):
                if given is not None:
                    row = [*map(subject.number, given if isinstance(given, tuple) else (given,))]
                    worst = max(worst, *np.abs(np.subtract(got, row))) if len(row) == len(got) else np.inf
        return worst

    def _match(self, runs: CaseRuns, left: list[Event], record: EventRecord) -> Event | None:
        within = runs.number(self.together)
        for event in left:
            if event.t > left[0].t + within:
                return None
            there = record.surface is None or runs.place(record.surface) == runs.place(event.surface)
            if there and record.kind in (None, WORDS[event.kind], word(event)):
                return event
        return None


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


class Accumulation(Quantity, quantity="accumulation"):
    """The limit of accumulating events.

    take  t; or state_after: the state half as long again after it
    """

    take: Literal["t", "state_after"] = "t"

    def __call__(self, subject: CaseRuns) -> Any:
        run = accumulation(subject)
        if self.take == "t":
            return run.t_end if run.zeno is None else run.zeno.t
        end = run.t_end + 0.5 * abs(run.t_end - subject.built.t_span[0])
        return subject.finished(t_end=end, zeno="continue").x_end


class Ratios(Quantity, quantity="ratios"):
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
            machine = Machine(runs.built.system, runs.main.options.stepper, runs.main.problem.p)
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
