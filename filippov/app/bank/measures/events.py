"""Events: one of them, their list, their number."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from filippov.app.bank.case_runs import CaseRuns
from filippov.app.bank.measures.measure import Measure, Number, When, moment, one_of
from filippov.app.bank.notation import number
from filippov.app.bank.outcome import MissingError
from filippov.base.status import EventKind
from filippov.solving.state.events import Event

Kind = Literal["cross", "slide", "exit", "graze", "reset", "time", "any"]
WORDS = {
    EventKind.CROSSING: "cross", EventKind.ENTRY: "slide", EventKind.EXIT: "exit", EventKind.GRAZING: "graze",
    EventKind.RESET: "reset", EventKind.TIME: "time",
}  # fmt: skip


class Filter(Measure):
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
        if self.over == "period":
            events: list[Event] = list(runs.cycle.events)
        else:
            events = runs.events(self._run(runs))
        if self.kind is None:
            events = [e for e in events if e.kind is not EventKind.GRAZING]
        elif self.kind != "any":
            events = [e for e in events if WORDS[e.kind] == self.kind]
        if self.direction is not None:
            sign = 1 if self.direction == "+" else -1
            events = [e for e in events if e.direction == sign]
        if self.surface is not None:
            many = self.surface if isinstance(self.surface, tuple) else (self.surface,)
            places = {runs.place(surface) for surface in many}
            events = [e for e in events if runs.place(e.surface) in places]
        if self.codimension is not None:
            sides = [(e, e.before if e.kind is EventKind.EXIT else e.after) for e in events]
            events = [e for e, mode in sides if sum(sign == 0 for sign in mode) == self.codimension]
        return [e for e in events if acts(runs, e)] if self.acting else events

    def _run(self, runs: CaseRuns) -> Any:
        start, end = runs.built.t_span
        last = end if self.until is None else moment(runs, self.until)
        beyond = last > max(start, end)
        if self.x0 is not None:
            x0 = tuple(number(value, runs.names) for value in self.x0)
            return runs.solve(x0=x0, t_end=last if beyond else end)
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
        events = self.chosen(subject)
        return taken(subject, one_of(events, self.number, "such events"), self.take)


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


class EventList(Measure, quantity="event_list"):
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
                    row = given if isinstance(given, tuple) else (given,)
                    wanted = np.array([number(value, subject.names) for value in row])
                    same = len(row) == len(got)
                    worst = max(worst, float(np.max(np.abs(got - wanted))) if same else np.inf)
        return worst

    def _match(self, runs: CaseRuns, left: list[Event], record: EventRecord) -> Event | None:
        within = number(self.together, runs.names)
        for event in left:
            if event.t > left[0].t + within:
                return None
            there = record.surface is None or runs.place(record.surface) == runs.place(event.surface)
            if there and record.kind in (None, WORDS[event.kind], word(event)):
                return event
        return None
