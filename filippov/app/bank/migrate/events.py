"""Names of events: their list, number, kinds, times, and the states at them."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from sympy import Symbol

from filippov.app.bank import record
from filippov.app.bank.expectation import LONGEST_LIST
from filippov.app.bank.measures.events import EventCount, EventList, OneEvent, Record, SomeEvents
from filippov.app.bank.measures.measure import Measure
from filippov.app.bank.measures.states import Modes
from filippov.app.bank.migrate.rule import Old, Reading, rule
from filippov.app.bank.motion import Motion
from filippov.app.bank.notation import formula
from filippov.app.bank.reason import NotUnderstoodError
from filippov.base.errors import ModelError

_SAME = {
    "enter": "slide", "entry": "slide", "entrie": "slide", "sliding": "slide", "stick": "slide", "stop": "slide",
    "saturate": "slide", "capture": "slide", "leave": "exit", "release": "exit", "slip": "exit",
    "crossing": "cross", "impact": "reset", "jump": "reset", "bounce": "reset", "rebound": "reset",
    "grazing": "graze", "touch": "graze", "tangency": "graze",
}  # fmt: skip
_KIND = (
    "enter|entry|slide|sliding|stick|saturate|capture|exit|leave|release|slip|cross|crossing|impact|reset|jump|"
    "graze|grazing|touch"
)
_PLACE = {"first": 1, "second": 2, "third": 3, "fourth": 4, "fifth": 5, "last": -1}
# How many values of a formula in n without a range are compared.
MOST = 24


def kind_word(old: Old, text: str) -> Any:
    """The kind of event that a word means: impacts of a system without resets are crossings."""
    word = _SAME.get(text, text)
    return "cross" if word == "reset" and not resets(old.motion) else word


def resets(motion: Motion) -> bool:
    """Whether a surface resets the state."""
    return any(surface.reset is not None for surface in motion.built.system.surfaces)


def horizon(old: Old) -> float | None:
    """The latest time expected, where it is beyond the span."""
    try:
        latest = float(np.max(np.atleast_1d(old.wanted()), initial=-np.inf)) + 2 * old.tol
    except NotUnderstoodError:
        return None
    return latest * (1 + 1e-6) if latest > max(old.motion.built.t_span) else None


@rule(r"events")
def _events(old: Old, _: re.Match[str]) -> list[Reading]:
    if not isinstance(old.value, list) or not all(isinstance(item, dict) for item in old.value):
        raise NotUnderstoodError("events are no list of objects")
    grazing = any(_base(item) == "graze" for item in old.value)
    jumps, out = resets(old.motion) or bool(old.motion.built.system.time_events), []
    for key in ("state", "state_after") if jumps else ("state",):
        rows = [_record(old, item, key) for item in old.value]
        together = max(old.tol, 1e-9)
        out += old.one(EventList(tuple(rows), together, grazing), value=0)
    return out


def _record(old: Old, item: dict[str, Any], key: str) -> Record:
    base, sign = _base(item), str(item.get("type", ""))[-1:]
    signed = sign in ("+", "-") and base in ("cross", "exit")
    data: dict[str, Any] = {"kind": base + (sign if signed else "")} if item.get("type") is not None else {}
    if "t" in item:
        data["t"] = old.number(item["t"])
    if item.get("surface") is not None:
        data["surface"] = item["surface"]
    state = item.get("state", item.get("x"))
    if state is not None:
        row = [float(v) for v in np.atleast_1d(old.numbers(state))]
        data[key if base in ("reset", "time") else "state"] = row
    try:
        found: Record = record.read(Record, data, "event")
    except ModelError as error:
        raise NotUnderstoodError(str(error)) from None
    return found


def _base(item: dict[str, Any]) -> str:
    word = str(item.get("type", "")).rstrip("+-").strip()
    return _SAME.get(word, word)


@rule(r"n_events|number_of_events|event_count")
def _n_events(old: Old, _: re.Match[str]) -> list[Reading]:
    return old.one(EventCount())


@rule(r"event_types|event_kinds|event_sequence")
def _event_types(old: Old, _: re.Match[str]) -> list[Reading]:
    kinds = re.findall(r"[A-Za-z]+[+-]?", old.value) if isinstance(old.value, str) else list(old.value or ())
    words = [str(kind) for kind in kinds]
    bases = [_SAME.get(word.rstrip("+-"), word.rstrip("+-")) for word in words]
    among: Any = "any" if "graze" in bases else None
    found: list[Any] = [old.e(EventCount(kind=among), value=len(words), atol=0)]
    for place, (word, base) in enumerate(zip(words, bases, strict=True)):
        signed = word[-1] in "+-" and base in ("cross", "exit")
        take, text = ("signed_kind", base + word[-1]) if signed else ("kind", base)
        found.append(old.e(OneEvent(kind=among, number=place + 1, take=take), text=text))
    return [Reading(tuple(found))]


@rule(r"modes|mode_sequence|mode_word")
def _modes(old: Old, _: re.Match[str]) -> list[Reading]:
    value = old.value
    modes = re.findall(r"[-+0]+", value) if isinstance(value, str) else [str(item) for item in value or ()]
    return old.one(Modes(), text=tuple(modes))


@rule(r"(?:(?P<what>event|switch|switching|impact|crossing|entry|exit|slide|reset)_times)|t_events|t_switches")
def _times(old: Old, match: re.Match[str]) -> list[Reading]:
    what = match["what"]
    if what == "impact" and not resets(old.motion):
        what = "event"
    until = horizon(old)

    def measures(first: int) -> list[Measure]:
        if what not in (None, "event", "switch", "switching"):
            kind = kind_word(old, what)
            return [SomeEvents(kind, acting=acting, until=until, first=first) for acting in (False, True)]
        return [
            SomeEvents(until=until, first=first), SomeEvents(acting=True, until=until, first=first),
            SomeEvents("any", until=until, first=first),
        ]  # fmt: skip

    return sequence(old, measures)


def sequence(old: Old, measures: Callable[[int], Sequence[Measure]]) -> list[Reading]:
    """The first values of measures: a list, or a formula in n, from 0 or from 1, or n=a..b."""
    if not isinstance(old.value, str):
        return old.either(*measures(old.size))
    body, _, where = old.value.partition(",")
    body = body.partition("=")[2] if "=" in body else body
    match = re.fullmatch(r"\s*(?:n\s*=\s*)(-?\d+)\s*(?:\.\.+|to)\s*(-?\d+)\s*", where)
    if (where.strip() and match is None) or not re.search(r"\bn\b", body):
        raise NotUnderstoodError(f"{old.value!r} is not a formula in n")
    if match and int(match[2]) - int(match[1]) >= LONGEST_LIST:
        raise NotUnderstoodError(f"{old.value!r:.80} stands for more than {LONGEST_LIST} numbers")
    try:
        formula(body, {**old.subject.names, "n": Symbol("n", integer=True)})
    except ModelError as error:
        raise NotUnderstoodError(str(error)) from None
    ranges = [(int(match[1]), int(match[2]))] if match else [(0, None), (1, None)]
    return [
        Reading((old.e(measure, value=body.strip(), n=(first, last)),))
        for first, last in ranges
        for measure in measures(MOST if last is None else last - first + 1)
    ]


@rule(r"events?_(?P<numbers>\d+(?:_\d+)*)(?:_times?)?")
def _numbered(old: Old, match: re.Match[str]) -> list[Reading]:
    chosen = [int(text) - 1 for text in match["numbers"].split("_")]
    if any(not 0 <= k < len(old.motion.built.declared) for k in chosen):
        raise NotUnderstoodError(f"the case has {len(old.motion.built.declared)} surfaces")
    return old.one(SomeEvents("any", surface=tuple(chosen)))


@rule(r"(?:switch|event|t|t_event|t_switch|impact)_(?P<k>\d+)")
def _kth(old: Old, match: re.Match[str]) -> list[Reading]:
    k = int(match["k"])
    if not k:
        raise NotUnderstoodError("events count from 1")
    return old.either(OneEvent(number=k), OneEvent(acting=True, number=k))


@rule(
    rf"t_(?:(?P<place>first|second|third|fourth|fifth|last)_)?(?P<kind>{_KIND})(?:_(?P<k>\d+))?(?:_codim_?(?P<deep>\d))?"
    rf"|(?P<place2>first|second|third|last)_(?P<kind2>{_KIND})_(?:time|t)"
)
def _time(old: Old, match: re.Match[str]) -> list[Reading]:
    kind = kind_word(old, match["kind"] or match["kind2"])
    place = int(match["k"]) if match["k"] else _PLACE[match["place"] or match["place2"] or "first"]
    if not place:
        raise NotUnderstoodError("events count from 1")
    deep = int(match["deep"]) if match["deep"] else None
    return old.one(OneEvent(kind, codimension=deep, until=horizon(old), number=place))


@rule(r"t_first(?:_[\d._-]+)?|t_event|t_switch|first_event_t(?:ime)?|first_switch(?:_t)?")
def _t_first(old: Old, _: re.Match[str]) -> list[Reading]:
    return old.one(OneEvent())
