"""Names of what a run reports, of sets of solutions, of places of rest, of single events, of thresholds."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from sympy import Symbol

from filippov.app.bank.measures.events import EventCount, OneEvent, SomeEvents
from filippov.app.bank.measures.measure import Formula, Measure
from filippov.app.bank.measures.sets import Reachable, Rest, Threshold
from filippov.app.bank.measures.sliding import Continuations, Signs
from filippov.app.bank.measures.states import End, ModeAt, State, Steady
from filippov.app.bank.measures.turns import Turns
from filippov.app.bank.migrate.events import kind_word
from filippov.app.bank.migrate.rule import Old, Reading, rule
from filippov.app.bank.migrate.states import moment, velocity
from filippov.app.bank.reason import NotUnderstoodError
from filippov.base.status import Status

_NUMBERS = {"two": 2, "three": 3, "four": 4, "five": 5, "six": 6, "2": 2, "3": 3, "4": 4, "5": 5, "6": 6}
_NON_UNIQUE = r"non-?\s?uniq|not unique|ambiguous|multiple|several|repelling|escaping|branch|set-valued"
_REPORTS = (
    (_NON_UNIQUE, Status.NON_UNIQUE),
    (r"zeno|accumulat|chatter", Status.ZENO),
    (r"graz|touch|tangen", Status.GRAZING),
    (r"blow|infinite|finite escape|not finite|nan", Status.NOT_FINITE),
    (r"no (?:solution|continuation)", Status.NO_CONTINUATION),
)
RELEASES = 7  # departures sampled along sliding that can be left at any time
NEAR = 1e-8  # how near a time or a point named in a text has to be met, where it has no tolerance
_KINDS = "impact|crossing|slide|stick|stop|switch|reset|exit|entry|entrie|grazing|bounce"


@rule(r"must_report|must_name|report|reports|must_warn")
def _must_report(old: Old, _: re.Match[str]) -> list[Reading]:
    text = old.text.casefold()
    status = next((status for words, status in _REPORTS if re.search(words, text)), None)
    if status is None:
        raise NotUnderstoodError("the text names nothing that a run can report")
    grazing = status is Status.GRAZING
    found = [old.e(End(grazing=grazing), text=status.value)]
    at = re.search(r"\bt\s*=\s*([^\s,;:)]+)", text)
    if at is not None:
        when = old.number(at[1].rstrip("."))
        found.append(old.e(End("t", grazing), value=when, atol=max(old.tol, NEAR)))
    if status is Status.NON_UNIQUE:
        found.append(old.e(Continuations(), least=_at_least(text), atol=0))
    return [Reading(tuple(found))]


def _at_least(text: str) -> int:
    """How many continuations a text speaks of, at least two."""
    listed = re.search(r"\{([^{}]*)\}", text)
    if listed is not None:
        return len(listed[1].split(","))
    found = re.search(r"\b(\w+) (?:families|branches|solutions|continuations|continuation|modes)", text)
    count = _NUMBERS.get(found[1], 2) if found is not None else 2
    named = re.search(r"\b(\w+) codim-?\s?2 sliding", text)
    if named is not None:
        count = max(count, _NUMBERS.get(named[1], 1))
    return count + (1 if re.search(r"\band an? (?:direct )?exit|also (?:a |direct )?exit", text) else 0)


@rule(r"reachable_(?:set_|interval_)?(?:(?P<state>{state})_)?at_(?P<time>[\d./]+)")
def _reachable(old: Old, match: re.Match[str]) -> list[Reading]:
    time = moment(old, match["time"])
    if isinstance(old.value, str):
        found = [piece.split(",") for piece in re.findall(r"\(([^()]*,[^()]*)\)", old.value)]
        points = [[old.number(v) for v in piece] for piece in found if len(piece) == len(old.states)]
        if not points:
            raise NotUnderstoodError("the text names no points")
        return old.one(Reachable(time), value=points, order="set", atol=max(old.tol, NEAR))
    if np.shape(old.wanted()) != (2,):
        raise NotUnderstoodError("it is no interval")
    return old.one(Reachable(time, match["state"] or old.states[0], RELEASES))


# -- single events -------------------------------------------------------------------------------------


def _kind(old: Old, word: str) -> Any:
    return None if word == "switch" else kind_word(old, word)


@rule(rf"(?:n|number_of|num|count)_(?P<kind>{_KINDS})(?:s|es)?")
def _count(old: Old, match: re.Match[str]) -> list[Reading]:
    return old.one(EventCount(_kind(old, match["kind"])))


@rule(rf"t_(?P<kind>{_KINDS})s|(?P<kind2>{_KINDS})_instants")
def _times(old: Old, match: re.Match[str]) -> list[Reading]:
    return old.one(SomeEvents(_kind(old, match["kind"] or match["kind2"]), first=old.size))


@rule(r"t_(?:hit|reach|capture|contact|first_hit)(?:_(?P<k>\d+))?|(?:hit|hitting|contact)_time")
def _hit(old: Old, match: re.Match[str]) -> list[Reading]:
    return old.one(OneEvent(number=_number(match["k"])))


def _number(text: str | None) -> int:
    if text is not None and not int(text):
        raise NotUnderstoodError("events count from 1")
    return int(text or 1)


@rule(rf"(?P<state>{{state}}|state)_at_(?P<kind>{_KINDS})(?:_(?P<k>\d+))?")
def _at_event(old: Old, match: re.Match[str]) -> list[Reading]:
    takes = ("state", "state_after") if match["state"] == "state" else (match["state"], f"{match['state']}@after")
    kind, k = _kind(old, match["kind"]), _number(match["k"])
    return old.either(*(OneEvent(kind, number=k, take=take) for take in takes))


@rule(r"codim_?2_(?P<what>entry|exit)_(?:point|state)|point_codim_?2_(?P<what2>entry|exit)")
def _corner(old: Old, match: re.Match[str]) -> list[Reading]:
    if (match["what"] or match["what2"]) == "exit":
        return old.one(OneEvent("exit", codimension=2, take="state"))
    start = State(old.motion.built.t_span[0])
    return [old.other(OneEvent("slide", codimension=2, take="state"), start)]


@rule(r"(?:rebound|bounce|apex|peak)_heights")
def _heights(old: Old, _: re.Match[str]) -> list[Reading]:
    return old.one(Turns(old.states[0], "max", first=old.size))


@rule(r"(?P<kind>crossing|exit|entry|stick|reset|rebound)_(?:velocity|speed)")
def _velocity(old: Old, match: re.Match[str]) -> list[Reading]:
    take = velocity(old) + ("@after" if match["kind"] == "rebound" else "")
    v = OneEvent(_kind(old, match["kind"]), take=take)
    return old.either(v, Formula("Abs(v)", {"v": v}))


# -- modes, and where the motion ends ------------------------------------------------------------------


@rule(r"(?:final|end|last)_mode|mode_at_(?P<time>.+)")
def _mode(old: Old, match: re.Match[str]) -> list[Reading]:
    wanted = old.text.strip()
    if not re.fullmatch(r"[-+0]+", wanted):
        raise NotUnderstoodError("the value is no mode such as +0-")
    return old.one(ModeAt(None if match["time"] is None else moment(old, match["time"])), text=wanted)


@rule(r"(?:equivalent_control|u_eq|ueq|lambda|multiplier|sign)_at_(?P<time>.+)")
def _multiplier_at(old: Old, match: re.Match[str]) -> list[Reading]:
    return old.one(Signs(moment(old, match["time"])))


@rule(
    r"steady_state|(?:steady_state|steady)_(?P<state>{state})|(?P<state2>{state})_(?:steady|inf|infinity|ss|steady_state)"
)
def _steady(old: Old, match: re.Match[str]) -> list[Reading]:
    return old.one(Steady(match["state"] or match["state2"], still=max(1e-9, 1e-2 * old.tol)))


@rule(r"(?:blow_?up|escape|finite_escape)_time|t_(?:blow_?up|escape)")
def _blow_up(old: Old, _: re.Match[str]) -> list[Reading]:
    large, when = old.e(End("size"), least=1e3), old.e(End("t"))
    statuses = (Status.NOT_FINITE.value, Status.MIN_STEP.value)
    return [Reading((old.e(End(), text=status), large, when)) for status in statuses]


@rule(r"(?:rest|equilibrium|stiction|sticking)_(?:interval|band|zone|set)|stick_(?:band|zone|set)")
def _rest_set(old: Old, _: re.Match[str]) -> list[Reading]:
    ends = np.atleast_1d(old.wanted())
    if ends.shape != (2,):
        raise NotUnderstoodError("it is no interval")
    step, others, found = max(10 * old.tol, 1e-6), [0.0] * (len(old.states) - 1), []
    for end, outwards in zip(ends.tolist(), (-1, 1), strict=True):
        for place, answer in ((end - outwards * step, "yes"), (end + outwards * step, "no")):
            found.append(old.e(Rest((place, *others), "rests"), text=answer))
    return [Reading(tuple(found))]


# -- parameters ----------------------------------------------------------------------------------------


@rule(r"(?P<name>\w+)_(?:grazing|graze|critical_grazing)|grazing_(?P<name2>\w+)")
def _grazing(old: Old, match: re.Match[str]) -> list[Reading]:
    name, value = match["name"] or match["name2"], float(old.wanted())
    if name not in (old.motion.built.raw.get("params") or {}):
        raise NotUnderstoodError(f"the case has no parameter {name!r}")
    if old.tol == 0:
        raise NotUnderstoodError("it has no tolerance")
    return old.one(Threshold(name, (value - old.tol, value + old.tol)))


@rule(r"\w+")
def _parameter(old: Old, _: re.Match[str]) -> list[Reading]:
    names = old.motion.names
    name = next((n for n in (old.name, old.name + "_") if n in names and not isinstance(names[n], Symbol)), None)
    if name is None:
        raise NotUnderstoodError("no rule knows the name")
    return old.one(Formula(name))
