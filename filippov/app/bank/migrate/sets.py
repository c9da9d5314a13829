"""Names of what a run reports, of sets of solutions, of places of rest, of single events, of thresholds."""

from __future__ import annotations

import re

import numpy as np
from sympy import Symbol

from filippov.app.bank.case_runs import CaseRuns
from filippov.app.bank.measures.events import EventCount, OneEvent, SomeEvents
from filippov.app.bank.measures.measure import Formula
from filippov.app.bank.measures.parameters import Threshold
from filippov.app.bank.measures.sets import Reachable, Rest
from filippov.app.bank.measures.sliding import Continuations, Signs
from filippov.app.bank.measures.states import End, ModeAt, State, Steady
from filippov.app.bank.measures.turning_points import TurningPoints
from filippov.app.bank.migrate.events import counting, kind_word
from filippov.app.bank.migrate.rule import Groups, Old, Reading, enter
from filippov.app.bank.migrate.states import moment, velocity
from filippov.app.bank.outcome import NotUnderstoodError
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
NEAR = 1e-8  # how near a time or a point named in a text has to be reached, where it has no tolerance
_KINDS = "impact|crossing|slide|stick|stop|switch|reset|exit|entry|entrie|grazing|bounce"


def _must_report(old: Old, _: Groups) -> list[Reading]:
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


def _reachable(old: Old, g: Groups) -> list[Reading]:
    time = moment(old, g["time"])
    if isinstance(old.value, str):
        found = [piece.split(",") for piece in re.findall(r"\(([^()]*,[^()]*)\)", old.value)]
        points = [[old.number(v) for v in piece] for piece in found if len(piece) == len(old.states)]
        if not points:
            raise NotUnderstoodError("the text names no points")
        return old.one(Reachable(time), value=points, order="set", atol=max(old.tol, NEAR))
    if np.shape(old.wanted()) != (2,):
        raise NotUnderstoodError("it is no interval")
    return old.one(Reachable(time, g["state"] or old.states[0], RELEASES))


def _at_event(old: Old, g: Groups) -> list[Reading]:
    name, kind, k = g["state"], kind_word(old, g["kind"]), counting(g["k"])
    takes = ("state", "state_after") if name == "state" else (name, f"{name}@after")
    return old.either(*(OneEvent(kind, number=k, take=take) for take in takes))


def _corner(old: Old, g: Groups) -> list[Reading]:
    if g["what"] == "exit":
        return old.one(OneEvent("exit", codimension=2, take="state"))
    return [old.other(OneEvent("slide", codimension=2, take="state"), State(old.runs.built.t_span[0]))]


def _velocity(old: Old, g: Groups) -> list[Reading]:
    take = velocity(old) + ("@after" if g["kind"] == "rebound" else "")
    v = OneEvent(kind_word(old, g["kind"]), take=take)
    return old.either(v, Formula("Abs(v)", {"v": v}))


def _mode(old: Old, g: Groups) -> list[Reading]:
    wanted = old.text.strip()
    if not re.fullmatch(r"[-+0]+", wanted):
        raise NotUnderstoodError("the value is no mode such as +0-")
    return old.one(ModeAt(None if g["time"] is None else moment(old, g["time"])), text=wanted)


def _blow_up(old: Old, _: Groups) -> list[Reading]:
    large, when = old.e(End("size"), least=1e3), old.e(End("t"))
    statuses = (Status.NOT_FINITE.value, Status.MIN_STEP.value)
    return [Reading((old.e(End(), text=status), large, when)) for status in statuses]


def _rest_set(old: Old, _: Groups) -> list[Reading]:
    ends = np.atleast_1d(old.wanted())
    if ends.shape != (2,):
        raise NotUnderstoodError("it is no interval")
    step, others, found = max(10 * old.tol, 1e-6), [0.0] * (len(old.states) - 1), []
    for end, outwards in zip(ends.tolist(), (-1, 1), strict=True):
        for place, answer in ((end - outwards * step, "yes"), (end + outwards * step, "no")):
            found.append(old.e(Rest((place, *others), "rests"), text=answer))
    return [Reading(tuple(found))]


def _grazing(old: Old, g: Groups) -> list[Reading]:
    name, value = g["name"], float(old.wanted())
    if name not in (old.runs.built.raw.get("params") or {}):
        raise NotUnderstoodError(f"the case has no parameter {name!r}")
    if old.tol == 0:
        raise NotUnderstoodError("it has no tolerance")
    return old.one(Threshold(name, (value - old.tol, value + old.tol), width=old.tol))


def _parameter(old: Old, _: Groups) -> list[Reading]:
    names = old.runs.names
    for name in (old.name, old.name + "_"):
        if name in names and not isinstance(names[name], Symbol):
            return old.one(Formula(name))
    raise NotUnderstoodError("no rule knows the name")


enter(
    CaseRuns,
    (r"must_report|must_name|report|reports|must_warn", _must_report),
    (r"reachable_(?:set_|interval_)?(?:(?P<state>{state})_)?at_(?P<time>[\d./]+)", _reachable),
    (rf"(?:n|number_of|num|count)_(?P<kind>{_KINDS})(?:s|es)?",
     lambda o, g: o.one(EventCount(kind_word(o, g["kind"])))),
    (rf"t_(?P<kind>{_KINDS})s|(?P<kind2>{_KINDS})_instants",
     lambda o, g: o.one(SomeEvents(kind_word(o, g["kind"]), first=o.size))),
    (r"t_(?:hit|reach|capture|contact|first_hit)(?:_(?P<k>\d+))?|(?:hit|hitting|contact)_time",
     lambda o, g: o.one(OneEvent(number=counting(g["k"])))),
    (rf"(?P<state>{{state}}|state)_at_(?P<kind>{_KINDS})(?:_(?P<k>\d+))?", _at_event),
    (r"codim_?2_(?P<what>entry|exit)_(?:point|state)|point_codim_?2_(?P<what2>entry|exit)", _corner),
    (r"(?:rebound|bounce|apex|peak)_heights",
     lambda o, _: o.one(TurningPoints(o.states[0], "max", first=o.size))),
    (r"(?P<kind>crossing|exit|entry|stick|reset|rebound)_(?:velocity|speed)", _velocity),
    (r"(?:final|end|last)_mode|mode_at_(?P<time>.+)", _mode),
    (r"(?:equivalent_control|u_eq|ueq|lambda|multiplier|sign)_at_(?P<time>.+)",
     lambda o, g: o.one(Signs(moment(o, g["time"])))),
    ((r"steady_state|(?:steady_state|steady)_(?P<state>{state})"
     r"|(?P<state2>{state})_(?:steady|inf|infinity|ss|steady_state)"),
     lambda o, g: o.one(Steady(g["state"], still=max(1e-9, 1e-2 * o.tol)))),
    (r"(?:blow_?up|escape|finite_escape)_time|t_(?:blow_?up|escape)", _blow_up),
    (r"(?:rest|equilibrium|stiction|sticking)_(?:interval|band|zone|set)|stick_(?:band|zone|set)", _rest_set),
    (r"(?P<name>\w+)_(?:grazing|graze|critical_grazing)|grazing_(?P<name2>\w+)", _grazing),
    (r"\w+", _parameter),
)  # fmt: skip
