"""What events are expected: their list, number, kinds, times, and the states at them."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from filippov.app.bank.case import number
from filippov.app.bank.motion import first_where
from filippov.app.bank.outcome import Ask, Either, Outcome, reads
from filippov.app.bank.reason import MissingError, NotUnderstoodError
from filippov.base.errors import ModelError
from filippov.base.status import EventKind
from filippov.solving.state.events import Event

# Numbers that one formula in n may stand for.
LONGEST_LIST = 100_000
WORDS = {
    EventKind.CROSSING: "cross", EventKind.ENTRY: "slide", EventKind.EXIT: "exit", EventKind.GRAZING: "graze",
    EventKind.RESET: "reset", EventKind.TIME: "time",
}  # fmt: skip
_SAME = {
    "enter": "slide", "entry": "slide", "sliding": "slide", "stick": "slide", "saturate": "slide",
    "capture": "slide", "leave": "exit", "release": "exit", "slip": "exit", "crossing": "cross",
    "impact": "reset", "jump": "reset", "grazing": "graze", "touch": "graze", "tangency": "graze",
}  # fmt: skip
_KIND = (
    "enter|entry|slide|sliding|stick|saturate|capture|exit|leave|release|slip|cross|crossing|impact|reset|jump|"
    "graze|grazing|touch"
)
_PLACE = {"first": 0, "second": 1, "third": 2, "fourth": 3, "fifth": 4, "last": -1}


def kind_word(text: str) -> str:
    """The bank's word for a kind of event."""
    return _SAME.get(text, text)


def word(event: Event) -> str:
    """An event's kind in the bank's words: cross+, slide, exit-, graze, reset."""
    return WORDS[event.kind] + {1: "+", -1: "-"}.get(event.direction, "")


def fits(event: Event, wanted: str) -> bool:
    """Whether an event is of a kind given in the bank's words, with or without a direction."""
    base = kind_word(wanted.rstrip("+-").strip())
    direction = wanted[-1:] if wanted[-1:] in ("+", "-") else ""
    return WORDS[event.kind] == base and (
        not direction or event.direction == 0 or word(event).endswith(direction)
    )


def counted(ask: Ask, wanted_kinds: Sequence[str] = ()) -> list[Event]:
    """The events of the run over the case's span; touchings only where the case speaks of them."""
    events = ask.motion.events()
    if any(kind_word(kind.rstrip("+-")) == "graze" for kind in wanted_kinds):
        return events
    return [event for event in events if event.kind is not EventKind.GRAZING]


@reads(r"events", "list of {t, type, surface, state}: the first events of the run, in order")
def _events(ask: Ask, _match: re.Match[str]) -> Outcome:
    value = ask.entry.value
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        raise NotUnderstoodError("events are no list of objects")
    found = counted(ask, [str(item.get("type", "")) for item in value])
    error, wrong = 0.0, []
    left = list(found)
    for place, item in enumerate(value):
        event = _pick(ask, left, item)
        if event is None:
            wrong.append(f"event {place + 1} ({item.get('type')} at {item.get('t')}) is not in the run")
            if left:
                left.pop(0)
            continue
        left.remove(event)
        if "t" in item:
            error = max(error, abs(event.t - ask.number(item["t"])))
        state = item.get("state", item.get("x"))
        if state is not None:
            before, after = event.x, event.x if event.x_after is None else event.x_after
            wanted = np.atleast_1d(ask.numbers(state))
            error = max(error, min(_gap(before, wanted), _gap(after, wanted)))
    if wrong:
        return Outcome(float(len(wrong)), 0.0, "; ".join(wrong[:2]))
    if not value and found:
        return Outcome(float(len(found)), 0.0, f"{len(found)} events, expected none")
    return Outcome(error, ask.entry.tol, "" if error <= ask.entry.tol else "times or states differ")


def _pick(ask: Ask, left: list[Event], item: dict[str, Any]) -> Event | None:
    """The next event, or one at the same instant, that is of the kind and on the surface asked for."""
    for event in left:
        if event.t > left[0].t + max(ask.entry.tol, 1e-9):
            return None
        kind = item.get("type")
        if kind is not None and not fits(event, str(kind)):
            continue
        surface = item.get("surface")
        if (
            surface is None
            or surface == event.surface
            or ask.motion.built.declared.index(event.surface) == surface
        ):
            return event
    return None


def _gap(a: Any, b: Any) -> float:
    return float(np.max(np.abs(a - b), initial=0.0)) if np.shape(a) == np.shape(b) else np.inf


@reads(r"n_events|number_of_events|event_count", "number of events in the span")
def _n_events(ask: Ask, _match: re.Match[str]) -> Any:
    return float(len(counted(ask)))


@reads(r"event_types|event_kinds|event_sequence", "kinds in order, a list or text such as [cross,slide,exit]")
def _event_types(ask: Ask, _match: re.Match[str]) -> Outcome:
    value = ask.entry.value
    kinds = re.findall(r"[A-Za-z]+[+-]?", value) if isinstance(value, str) else [str(item) for item in value]
    found = counted(ask, kinds)
    wrong = sum(not fits(e, k) for e, k in zip(found, kinds, strict=False)) + abs(len(found) - len(kinds))
    note = f"{', '.join(word(e) for e in found[:8])}, expected {', '.join(kinds[:8])}" if wrong else ""
    return Outcome(float(wrong), 0.0, note)


@reads(r"modes|mode_sequence|mode_word", "modes of the segments in order, as +0- texts")
def _modes(ask: Ask, _match: re.Match[str]) -> Outcome:
    value = ask.entry.value
    modes = re.findall(r"[-+0]+", value) if isinstance(value, str) else [str(item) for item in value]
    count = len(ask.motion.built.declared)
    found = [mode[:count] for mode in ask.motion.main.modes]
    wrong = sum(a != b for a, b in zip(found, modes, strict=False)) + abs(len(found) - len(modes))
    return Outcome(float(wrong), 0.0, f"modes {' '.join(found[:8])}" if wrong else "")


@reads(
    r"(?:(?P<what>event|switch|switching|impact|crossing|entry|exit|slide|reset)_times)|t_events|t_switches",
    "times of the first events (of that kind): a list, or a formula in n",
)
def _times(ask: Ask, match: re.Match[str]) -> Any:
    what = match["what"]
    if what == "impact" and not any(e.kind is EventKind.RESET for e in ask.motion.events()):
        what = "event"

    def chosen(n: int) -> Either:
        end = _horizon(ask)
        events = ask.motion.events(ask.motion.covering(end)) if end is not None else ask.motion.events()
        if what not in (None, "event", "switch", "switching"):
            events = [e for e in events if WORDS[e.kind] == kind_word(what)]
        every = [e.t for e in events if e.kind is not EventKind.GRAZING]
        active = [e.t for e in events if switches(ask, e)]
        return Either([every[:n], active[:n], [e.t for e in events][:n]])

    return sequence(ask, chosen)


def _horizon(ask: Ask) -> float | None:
    """The latest time in a list of times, where it is beyond the span."""
    try:
        latest = float(np.max(np.atleast_1d(ask.wanted()))) + 2 * ask.entry.tol
    except NotUnderstoodError:
        return None
    start, end = ask.motion.built.t_span
    return latest if latest > max(start, end) else None


def switches(ask: Ask, event: Event) -> bool:
    """Whether the field, or the state, changes at a crossing: not all surfaces act everywhere."""
    if event.kind is not EventKind.CROSSING:
        return event.kind is not EventKind.GRAZING
    fields = ask.motion.built.fields
    count = len(next(iter(fields), ""))
    sides = [
        "".join("+" if sign >= 0 else "-" for sign in mode[:count]) for mode in (event.before, event.after)
    ]
    rows = [fields.get(side) for side in sides]
    return rows[0] != rows[1]


def sequence(ask: Ask, values: Callable[[int], Either]) -> Any:
    """Compare a list, or a formula in n (counted from 0 or from 1, or n=a..b), with the first values."""
    value = ask.entry.value
    if not isinstance(value, str):
        wanted = np.atleast_1d(ask.wanted())
        return values(len(wanted))
    rows = formula_in_n(ask, value, 24)
    best: Outcome | None = None
    for row in rows:
        for reading in values(len(row)):
            n = min(len(reading), len(row))
            if n == 0 or (len(rows) == 1 and n < len(row)):
                continue
            outcome = ask.compare(reading[:n], row[:n])
            if best is None or outcome.ratio < best.ratio:
                best = outcome
    if best is None:
        raise MissingError("the run has no such event")
    return best


def formula_in_n(ask: Ask, text: str, most: int) -> list[list[float]]:
    """The rows of numbers that a formula in n stands for."""
    body, _, where = text.partition(",")
    if "=" in body:
        body = body.partition("=")[2]
    match = re.fullmatch(r"\s*(?:n\s*=\s*)(-?\d+)\s*(?:\.\.+|to)\s*(-?\d+)\s*", where)
    if where.strip() and match is None:
        raise NotUnderstoodError(f"{text!r} is not a formula in n")
    if match and int(match[2]) - int(match[1]) >= LONGEST_LIST:
        raise NotUnderstoodError(f"{text!r:.80} stands for more than {LONGEST_LIST} numbers")
    ranges = [range(int(match[1]), int(match[2]) + 1)] if match else [range(most), range(1, most + 1)]
    if not re.search(r"\bn\b", body):
        raise NotUnderstoodError(f"{text!r} is not a formula in n")
    from sympy import Symbol

    from filippov.app.bank.notation import formula

    n = Symbol("n", integer=True)
    try:
        expression = formula(body, {**ask.motion.built.names, "n": n})
        return [[number(str(expression.subs(n, k).evalf(20))) for k in values] for values in ranges]
    except (ModelError, TypeError, ValueError):
        raise NotUnderstoodError(f"{text!r} is not a formula in n") from None


@reads(
    r"events?_(?P<numbers>\d+(?:_\d+)*)(?:_times?)?",
    "times of the events of the surfaces of these numbers (from 1)",
)
def _numbered(ask: Ask, match: re.Match[str]) -> Any:
    declared = ask.motion.built.declared
    chosen = [int(text) - 1 for text in match["numbers"].split("_")]
    if any(not 0 <= k < len(declared) for k in chosen):
        raise NotUnderstoodError(f"the case has {len(declared)} surfaces")
    names = {declared[k] for k in chosen}
    return [e.t for e in ask.motion.events() if e.surface in names]


@reads(r"(?:switch|event|t|t_event|t_switch|impact)_(?P<k>\d+)", "time of the k-th event")
def _kth(ask: Ask, match: re.Match[str]) -> Any:
    events = [e.t for e in ask.motion.events() if e.kind is not EventKind.GRAZING]
    active = [e.t for e in ask.motion.events() if switches(ask, e)]
    k = int(match["k"]) - 1
    return Either([row[k] for row in (events, active) if 0 <= k < len(row)])


@reads(
    rf"t_(?:(?P<place>first|second|third|fourth|fifth|last)_)?(?P<kind>{_KIND})(?:_(?P<k>\d+))?(?:_codim_?(?P<deep>\d))?"
    rf"|(?P<place2>first|second|third|last)_(?P<kind2>{_KIND})_(?:time|t)",
    "time of the first (second, last, k-th) event of that kind; with codim2, on several surfaces at once",
)
def _time(ask: Ask, match: re.Match[str]) -> Any:
    kind = kind_word(match["kind"] or match["kind2"])
    events = [e for e in _reaching(ask) if WORDS[e.kind] == kind]
    if kind == "reset" and not events:
        events = [e for e in _reaching(ask) if WORDS[e.kind] == "cross"]
    if match["deep"]:
        # Sliding on so many surfaces begins, or ends.
        deep = int(match["deep"])
        sides = [(e, e.before if kind == "exit" else e.after) for e in events]
        events = [e for e, mode in sides if sum(sign == 0 for sign in mode) == deep]
    place = _PLACE[match["place"] or match["place2"] or "first"] if not match["k"] else int(match["k"]) - 1
    if not -len(events) <= place < len(events):
        raise MissingError("the run has no such event")
    return events[place].t


def _reaching(ask: Ask) -> list[Event]:
    """The events of a run that goes on to the time expected, where that is beyond the span."""
    end = _horizon(ask)
    return (
        ask.motion.events() if end is None else ask.motion.events(ask.motion.covering(end + 1e-6 * abs(end)))
    )


@reads(
    r"t_first(?:_[\d._-]+)?|t_event|t_switch|first_event_t(?:ime)?|first_switch(?:_t)?",
    "time of the first event",
)
def _t_first(ask: Ask, _match: re.Match[str]) -> Any:
    return first_where(ask.motion.events(), lambda e: e.kind is not EventKind.GRAZING).t
