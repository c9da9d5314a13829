"""Names of formulas that should hold or stay constant along the solution, and of events."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from sympy import Symbol

from filippov.app.bank import typed_json
from filippov.app.bank.case_runs import CaseRuns
from filippov.app.bank.expectation import LONGEST_LIST, numbers
from filippov.app.bank.migrate.rule import Groups, Old, Reading, Rules
from filippov.app.bank.notation import WORD, formula, words
from filippov.app.bank.outcome import NotUnderstoodError
from filippov.app.bank.quantities.along import Along
from filippov.app.bank.quantities.events import EventCount, EventList, EventRecord, OneEvent, SomeEvents
from filippov.app.bank.quantities.quantity import Formula, Quantity
from filippov.app.bank.quantities.states import Segments
from filippov.base.errors import ModelError
from filippov.base.names import parts
from filippov.model.expression import FUNCTIONS

_ASIDE = re.compile(r"\s+\([^()]*(?:\([^()]*\)[^()]*)*\)")
_PHRASE = re.compile(r"\b(?:while|during|in|along) (?:the )?(?:sliding|sliding motion|stick|sticking)\b")
_CONTROL = ("equivalent control", "u_eq", "ueq", "sign value", "multiplier")
# Kind of event, names of its time, suffix of the names of states there.
_MARKS: tuple[tuple[Any, str, str], ...] = (
    ("slide", "t_enter t_entry t_e te", "_e e _enter _entry"), ("exit", "t_exit t_x tx", "_exit"),
    ("cross", "t_cross t_c tc", "_cross"),
)  # fmt: skip
_SIGN = "sgn_value"
_SAME = {
    word: kind for kind, words in (
        ("slide", "enter entry entrie sliding stick stop saturate capture"),
        ("exit", "leave release slip breakaway"),
        ("cross", "crossing"), ("reset", "impact jump bounce rebound"), ("graze", "grazing touch tangency"),
    ) for word in words.split()
}  # fmt: skip
_KIND = (
    "enter|entry|slide|sliding|stick|saturate|capture|exit|leave|release|slip|breakaway|cross|crossing|impact|"
    "reset|jump|graze|grazing|touch|switch|switching|event|hit"
)
_PLACE = {"first": 1, "second": 2, "third": 3, "fourth": 4, "fifth": 5, "last": -1}
# The number of values compared of a formula in n without a range.
MOST = 24


def _over(old: Old) -> Any:
    """The range of a claim: the first sliding, where its name or text say so, else the whole solution."""
    text = f"{old.name} {old.value}".casefold()
    return "first_sliding" if re.search(r"slid|stick|after_ent", text) else "span"


def _known(old: Old) -> dict[str, Quantity]:
    """Names of times and states at the first entry, exit and crossing, and of the start."""
    known: dict[str, Quantity] = {}
    for kind, times, marks in _MARKS:
        known |= {name: OneEvent(kind) for name in times.split()}
        rows = [(state, state + mark) for state in old.states for mark in marks.split()]
        known |= {name: OneEvent(kind, take=state) for state, name in rows if name not in known}
    for state, value in zip(old.states, old.runs.built.x0, strict=True):
        for mark in ("_0", "0"):
            known.setdefault(state + mark, Formula(repr(value)))
    return {name: measure for name, measure in known.items() if name not in old.runs.names}


def _claims(text: str) -> list[tuple[str, str]]:
    """The equations in a text, left and right sides, without remarks in brackets."""
    found = []
    for clause in re.split(r";|\band\b", text):
        for piece in parts(_PHRASE.sub("", clause)):
            sides = _ASIDE.sub("", " " + piece).split("=") if piece.count("=") != 1 else piece.split("=")
            if len(sides) != 2:
                raise NotUnderstoodError(f"{piece.strip()[:60]!r} is no equation")
            found.append((sides[0].strip(), sides[1].strip()))
    return found


def _side(old: Old, text: str) -> tuple[str, dict[str, Quantity]]:
    """A side of an equation as a formula, with x for x(t), and the meaning of its names."""
    names, known = old.runs.names, _known(old)
    polar = {}
    if len(old.states) == 2:
        x, y = old.states
        polar = {"theta": f"atan2({y},{x})", "r": f"sqrt({x}**2+{y}**2)"}
    put = {name: f"({value})" for name, value in polar.items() if name not in names}
    plain = re.sub(r"\b(\w+)\(t\)", lambda m: m[1] if m[1] in names or m[1] in polar else m[0], text)
    for attempt in (plain, _ASIDE.sub("", " " + plain)):
        used = (set(words(attempt)) - set(FUNCTIONS)) & set(known)
        where = {name: known[name] for name in sorted(used)}
        written = WORD.sub(lambda m: put.get(m[0], m[0]), attempt).strip()
        with suppress(ModelError):
            formula(written, {**names, **dict.fromkeys(where, 1)})
            return written, where
    raise NotUnderstoodError(f"{text[:60]!r} is no formula in known names")


def _holds(old: Old, left: str, right: str, over: Any) -> Any:
    """That two sides are equal along the solution; the left one may be the value of the sign in words."""
    wanted, where = _side(old, right)
    atol = old.tol or 1e-9
    if _ASIDE.sub("", " " + left).strip().casefold() in _CONTROL:
        return old.e(Along(f"{_SIGN}-({wanted})", over=over, where=where, signs=(_SIGN,)), value=0, atol=atol)
    got, more = _side(old, left)
    return old.e(Along(f"({got})-({wanted})", over=over, where=where | more), value=0, atol=atol)


def _of_time(old: Old, g: Groups) -> list[Reading]:
    return [Reading((_holds(old, g["state"], old.text.rpartition("=")[2], "span"),))]


def _law(old: Old, _: Groups) -> list[Reading]:
    if not isinstance(old.value, str) or "=" not in old.value:
        return _kept(old, _)
    return [Reading(tuple(_holds(old, left, right, _over(old)) for left, right in _claims(old.value)))]


def _kept(old: Old, _: Groups) -> list[Reading]:
    """An expression that is constant along the solution, or along its first sliding."""
    if not isinstance(old.value, str):
        return _of_value(old, _)
    text, where = _side(old, old.text.rpartition("=")[2])
    if not set(words(text)) & set(old.states):
        raise NotUnderstoodError("it has no states")
    return old.one(Along(text, "spread", _over(old), where), value=0, atol=old.tol or 1e-9)


def _of_value(old: Old, _: Groups) -> list[Reading]:
    """The value of the expression that another expectation names as a first integral."""
    wanted = float(old.wanted())
    for entry in old.case.expected:
        about = Old(old.case, entry, entry.name, old.subject)
        integral = re.search(r"first_integral|invariant|conserved", entry.name)
        if integral and entry is not old.entry and isinstance(about.value, str):
            text, where = _side(about, about.value)
            return old.one(Along(f"({text})-({wanted!r})", over=_over(about), where=where), value=0)
    raise NotUnderstoodError("no other expectation gives its expression")


def kind_word(old: Old, text: str | None) -> Any:
    """The kind of event that a word means: impacts of a system without resets are crossings."""
    word = _SAME.get(text or "", text)
    if word in ("switch", "switching", "event", "hit"):
        return None
    return "cross" if word == "reset" and not resets(old.runs) else word


def resets(runs: CaseRuns) -> bool:
    """Whether a surface resets the state."""
    return any(surface.reset is not None for surface in runs.built.system.surfaces)


def counting(text: str | None) -> int:
    """The number of an event, 1 where none is given. Raises NotUnderstoodError."""
    if text is not None and not int(text):
        raise NotUnderstoodError("events count from 1")
    return int(text or 1)


def horizon(old: Old) -> float | None:
    """The latest time expected, where it is beyond the span."""
    try:
        latest = float(np.max(np.atleast_1d(old.wanted()), initial=-np.inf)) + 2 * old.tol
    except ModelError:
        return None
    return latest * (1 + 1e-6) if latest > max(old.runs.built.t_span) else None


def _events(old: Old, _: Groups) -> list[Reading]:
    if not isinstance(old.value, list) or not all(isinstance(item, dict) for item in old.value):
        raise NotUnderstoodError("events are no list of objects")
    grazing = any(_kinds(item.get("type"))[0] == "graze" for item in old.value)
    jumps, together = resets(old.runs) or bool(old.runs.built.system.time_events), max(old.tol, 1e-9)
    rows = [[_record(old, item, key) for item in old.value] for key in ("state", "state_after")[: 1 + jumps]]
    return old.either(*(EventList(tuple(row), together, grazing) for row in rows), value=0)


def _kinds(given: object) -> tuple[str, str]:
    """The kind of event that a word means, and the same with its direction where that is compared."""
    plain = str(given).rstrip("+-").strip()
    base, sign = _SAME.get(plain, plain), str(given)[-1:]
    return base, base + sign if sign in ("+", "-") and base in ("cross", "exit") else base


def _record(old: Old, item: dict[str, Any], key: str) -> EventRecord:
    base, kind = _kinds(item.get("type"))
    data: dict[str, Any] = {"kind": kind} if item.get("type") is not None else {}
    data |= {"t": old.number(item["t"])} if "t" in item else {}
    data |= {"surface": item["surface"]} if item.get("surface") is not None else {}
    state = item.get("state", item.get("x"))
    if state is not None:
        where = key if base in ("reset", "time") else "state"
        data[where] = np.atleast_1d(numbers(state, old.subject)).tolist()
    found: EventRecord = typed_json.read(EventRecord, data, "event")
    return found


def _event_types(old: Old, _: Groups) -> list[Reading]:
    kinds = re.findall(r"[A-Za-z]+[+-]?", old.value) if isinstance(old.value, str) else list(old.value or ())
    pairs = [_kinds(kind) for kind in kinds]
    among: Any = "any" if "graze" in dict(pairs) else None
    found: list[Any] = [old.e(EventCount(kind=among), value=len(pairs), atol=0)]
    for place, (base, text) in enumerate(pairs, start=1):
        take = "kind" if text == base else "signed_kind"
        found.append(old.e(OneEvent(kind=among, number=place, take=take), text=text))
    return [Reading(tuple(found))]


def _modes(old: Old, _: Groups) -> list[Reading]:
    value = old.value
    modes = re.findall(r"[-+0]+", value) if isinstance(value, str) else [str(item) for item in value or ()]
    return old.one(Segments(), text=tuple(modes))


def _times(old: Old, g: Groups) -> list[Reading]:
    kind, until = kind_word(old, g["what"] or "event"), horizon(old)
    if g["what"] == "impact" and not resets(old.runs):
        kind = None
    kinds = [(kind, False), (kind, True), *([] if kind else [("any", False)])]
    return sequence(old, lambda n: [SomeEvents(k, acting=a, until=until, first=n) for k, a in kinds])


def sequence(old: Old, measures: Callable[[int], Sequence[Quantity]]) -> list[Reading]:
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
    formula(body, {**old.subject.names, "n": Symbol("n", integer=True)})
    ranges = [(int(match[1]), int(match[2]))] if match else [(0, None), (1, None)]
    counts = [(n, MOST if n[1] is None else n[1] - n[0] + 1) for n in ranges]
    return [r for n, count in counts for r in old.either(*measures(count), value=body.strip(), n=n)]


def _numbered(old: Old, g: Groups) -> list[Reading]:
    chosen = [int(text) - 1 for text in g["numbers"].split("_")]
    if any(not 0 <= k < len(old.runs.built.declared) for k in chosen):
        raise NotUnderstoodError(f"the case has {len(old.runs.built.declared)} surfaces")
    return old.one(SomeEvents("any", surface=tuple(chosen)))


def _time(old: Old, g: Groups) -> list[Reading]:
    place = counting(g["k"]) if g["k"] else _PLACE[g["place"] or "first"]
    deep = int(g["deep"]) if g["deep"] else None
    kind, until = kind_word(old, g["kind"]), horizon(old)
    # A switch is an event at which the field changes, or any.
    ways = (False, True) if g["kind"] in ("switch", "switching") else (False,)
    return old.either(*(OneEvent(kind, codimension=deep, acting=a, until=until, number=place) for a in ways))


def _there(old: Old, g: Groups) -> list[Reading]:
    """A state at the first or last event of a kind, before and after it."""
    kind, place = kind_word(old, g["kind"]), _PLACE[g["place"]]
    takes = (g["state"], f"{g['state']}@after")
    return old.either(*(OneEvent(kind, number=place, take=take) for take in takes))


def _codimension_2(old: Old, g: Groups) -> list[Reading]:
    """The time of the entry into sliding on two surfaces, or a state there."""
    return old.one(OneEvent("slide", codimension=2, until=horizon(old), take=g["state"] or "t"))


RULES: Rules = (
    (r"{state}\(t\) {state}_of_t", _of_time),
    ((r"\w*(?:_law|_invariant|_relation|_identity|_formula) invariant after_entry while_sliding "
     r"sliding_solution closed_form \w+_is_conserved"),
     _law),
    (r"first_integral(?!_value)\w* conserved\w* constant_of_motion\w*", _kept),
    (r"(?:first_integral|invariant|conserved)_value", _of_value),
    (r"events", _events),
    (r"n_events number_of_events event_count", lambda o, _: o.one(EventCount())),
    (r"event_types event_kinds event_sequence", _event_types),
    (r"modes mode_sequence mode_word", _modes),
    ((r"(?P<what>event|switch(?:ing)?|impact|crossing|entry|exit|slide|reset|release|leave)_times t_events "
      r"t_switches root_times"),
     _times),
    (r"events?_(?P<numbers>\d+(?:_\d+)*)(?:_times?)?", _numbered),
    # stick_time and slip_time are lengths.
    ((r"(?:switch|event|t|t_event|t_switch|impact)_(?P<k>\d+) "
     r"(?P<kind>event|switch|switching|crossing|cross|entry|exit|release|leave|impact|reset|grazing)_time"
     r"(?:_(?P<k>\d+))?"),
     lambda o, g: o.either(*(OneEvent(kind_word(o, g["kind"]), acting=a, number=counting(g["k"]))
                             for a in (False, True)))),
    ((rf"t_(?:(?P<place>first|second|third|fourth|fifth|last)_)?(?P<kind>{_KIND})(?:_(?P<k>\d+))?"
     rf"(?:_codim_?(?P<deep>\d))? (?P<place>first|second|third|last)_(?P<kind>{_KIND})_(?:time|t)"),
     _time),
    (rf"{{state}}_at_(?P<place>first|second|third|last)_(?P<kind>{_KIND})", _there),
    (r"t_codim_?2 {state}_at_codim_?2", _codimension_2),
    ((r"t_first(?:_[\d._-]+)? t_event t_switch first_event_t(?:ime)? first_switch(?:_t)? t_root root_time"),
     lambda o, _: o.one(OneEvent())),
)  # fmt: skip
