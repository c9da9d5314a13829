"""Names of what a run reports, of sets of solutions, of rest, of thresholds, and of sliding."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import sympy
from sympy import Symbol

from filippov import Status
from filippov import t as time_symbol
from filippov.app.bank.build import build
from filippov.app.bank.migrate.events import counting, kind_word
from filippov.app.bank.migrate.rule import Groups, Old, Reading, Rules
from filippov.app.bank.migrate.states import velocity_name, when
from filippov.app.bank.notation import formula
from filippov.app.bank.outcome import NotUnderstoodError
from filippov.app.bank.quantities.along import Along
from filippov.app.bank.quantities.events import EventCount, OneEvent, SomeEvents
from filippov.app.bank.quantities.orbits import Threshold
from filippov.app.bank.quantities.quantity import Formula
from filippov.app.bank.quantities.sliding import (
    Continuations,
    Rate,
    RateBounds,
    Reachable,
    Signs,
    VertexWeights,
)
from filippov.app.bank.quantities.states import End, ModeAt, Phases, Rest, State, Steady, TurningPoints

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
_RULE = "moments|utkin"
_END = "final_state|x_final|final"
_FIELD = "(?:vector_)?field"
_SIGNS = "equivalent_control|u_eq"
# Candidates of which one may be meant.
_FEW = 4


def _must_report(old: Old, _: Groups) -> list[Reading]:
    text = old.text.casefold()
    status = next((status for words, status in _REPORTS if re.search(words, text)), None)
    if status is None:
        raise NotUnderstoodError("the text names nothing that a run can report")
    grazing = status is Status.GRAZING
    found = [old.e(End(grazing=grazing), text=status.value)]
    if status is Status.NOT_FINITE:
        # Towards a pole the steps end before the state overflows: it has to have grown by then.
        large = old.e(End("size"), least=1e3, atol=0)
        return [Reading((old.e(End(), text=Status.MIN_STEP.value), large)), Reading(tuple(found))]
    at = re.search(r"\bt\s*=\s*([^\s,;:)]+)", text)
    if at is not None:
        time = old.number(at[1].rstrip("."))
        found.append(old.e(End("t", grazing), value=time, atol=max(old.tol, NEAR)))
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
    time = when(old, g["time"])
    if isinstance(old.value, str):
        found = [piece.split(",") for piece in re.findall(r"\(([^()]*,[^()]*)\)", old.value)]
        points = [[old.number(v) for v in piece] for piece in found if len(piece) == len(old.states)]
        if not points:
            raise NotUnderstoodError("the text names no points")
        return old.one(Reachable(time), value=points, order="set", atol=max(old.tol, NEAR))
    if np.shape(old.wanted()) != (2,):
        raise NotUnderstoodError("it is no interval")
    return old.one(Reachable(time, g["state"] or old.states[0], RELEASES))


def _branch_ends(old: Old, _: Groups) -> list[Reading]:
    points: Any = np.atleast_1d(old.wanted())
    if points.ndim == 1 and len(old.states) == 1:
        points = points[:, None]
    if points.ndim != 2 or points.shape[1] != len(old.states):
        raise NotUnderstoodError(f"the points have no {len(old.states)} states each")
    value = [[float(x) for x in row] for row in points]
    return old.one(Reachable(), value=value, order="set", atol=max(old.tol, NEAR))


def _solutions(old: Old, _: Groups) -> list[Reading]:
    """One solution, or infinitely many; another number depends on what counts as one."""
    word = old.text.strip().casefold()
    if word not in ("1", "unique", "infinite", "infinitely many", "inf"):
        raise NotUnderstoodError("it is neither one nor infinitely many")
    status = Status.SUCCESS if word in ("1", "unique") else Status.NON_UNIQUE
    return old.one(End(), text=status.value)


def _non_unique_time(old: Old, _: Groups) -> list[Reading]:
    return [Reading((old.e(End(), text=Status.NON_UNIQUE.value), old.e(End("t"))))]


def _count_by(old: Old, g: Groups) -> list[Reading]:
    """The number of events up to the end of the span, or up to a time beyond it."""
    time = old.number(g["time"])
    end = max(old.runs.built.t_span)
    if time < end * (1 - 1e-12):
        raise NotUnderstoodError("the time is within the span")
    return old.one(EventCount(kind_word(old, g["kind"]), until=None if time <= end else time))


def _side_weight(old: Old, g: Groups) -> list[Reading]:
    sign = "-" if g["side"] in ("minus", "-") else "+"
    return old.one(Formula(f"(1{sign}s)/2", {"s": Signs()}))


def _at_event(old: Old, g: Groups) -> list[Reading]:
    name, kind, k = g["state"], kind_word(old, g["kind"]), counting(g["k"])
    takes = ("state", "state_after") if name == "state" else (name, f"{name}@after")
    return old.either(*(OneEvent(kind, number=k, take=take) for take in takes))


def _corner(old: Old, g: Groups) -> list[Reading]:
    if g["what"] == "exit":
        return old.one(OneEvent("exit", codimension=2, take="state"))
    return [old.other(OneEvent("slide", codimension=2, take="state"), State(old.runs.built.t_span[0]))]


def _velocity(old: Old, g: Groups) -> list[Reading]:
    take = velocity_name(old) + ("@after" if g["kind"] == "rebound" else "")
    v = OneEvent(kind_word(old, g["kind"]), take=take)
    return old.either(v, Formula("Abs(v)", {"v": v}))


def _mode(old: Old, g: Groups) -> list[Reading]:
    wanted = old.text.strip()
    if not re.fullmatch(r"[-+0]+", wanted):
        raise NotUnderstoodError("the value is no mode such as +0-")
    return old.one(ModeAt(None if g["time"] is None else when(old, g["time"])), text=wanted)


def _blow_up(old: Old, _: Groups) -> list[Reading]:
    large, time = old.e(End("size"), least=1e3), old.e(End("t"))
    statuses = (Status.NOT_FINITE.value, Status.MIN_STEP.value)
    return [Reading((old.e(End(), text=status), large, time)) for status in statuses]


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


def _forcing(old: Old, _: Groups) -> list[Reading]:
    """The value at which a motion grazes, of the one parameter that scales the forcing."""
    found = []
    for name in old.runs.built.raw.get("params") or {}:
        raw = build(old.runs.built.raw, free=name)
        every = {f for row in raw.fields.values() for f in row}
        p = next((s for f in every for s in f.free_symbols if s.name == name), None)
        free = set[Any]().union(*(sympy.diff(f, p).free_symbols for f in every)) if p is not None else set()
        if time_symbol in free and not {s.name for s in free} & {name, *old.states}:
            found.append(name)
    if len(found) != 1:
        raise NotUnderstoodError(f"{len(found)} parameters scale a forcing")
    return _grazing(old, {"name": found[0]})


def _parameter(old: Old, _: Groups) -> list[Reading]:
    names = old.runs.names
    for name in (old.name, old.name + "_"):
        if name in names and not isinstance(names[name], Symbol):
            return old.one(Formula(name))
    raise NotUnderstoodError("no rule knows the name")


def _first(take: Any) -> Phases:
    return Phases(slides=True, number=1, take=take)


def _speed(old: Old, _: Groups) -> list[Reading]:
    wanted, names = float(old.wanted()), tuple(f"rate{k}" for k in range(len(old.states)))
    norm = "sqrt(" + "+".join(f"{name}**2" for name in names) + ")"
    texts = [f"{speed}-({wanted!r})" for speed in (names[0], f"Abs({names[0]})", norm)]
    return old.either(*(Along(text, over="sliding", rates=names) for text in texts), value=0)


def _field(old: Old, g: Groups) -> list[Reading]:
    chosen = [Continuations(slides=True, number=k + 1, take="fields") for k in range(_FEW)]
    return old.either(*chosen) if g["repels"] else [old.other(c, Rate(_first("middle"))) for c in chosen]


def _multiplier(old: Old, _: Groups) -> list[Reading]:
    values = old.value if isinstance(old.value, list) else [old.value]
    names, found = tuple(f"sign{k}" for k in range(len(values))), []
    for name, value in zip(names, values, strict=True):
        text = _of_time(old, value) if isinstance(value, str) else repr(old.number(value))
        found.append(old.e(Along(f"{name}-({text})", over="first_sliding", signs=names), value=0))
    return [Reading(tuple(found))]


def _of_time(old: Old, text: str) -> str:
    """A formula in t. Raises NotUnderstoodError, ModelError."""
    if formula(text, old.runs.names).free_symbols - {time_symbol}:
        raise NotUnderstoodError("it is no formula in t")
    return text


def _weights(old: Old, _: Groups) -> list[Reading]:
    found = old.one(Formula("(1+s)/2", {"s": Signs()}))
    if old.size == 2:
        sides = zip("+-", old.value, strict=True)
        pair = [old.e(Formula(f"(1{sign}s)/2", {"s": Signs()}), value=value) for sign, value in sides]
        found.append(Reading(tuple(pair)))
    return found


def _multipliers(old: Old, _: Groups) -> list[Reading]:
    rows = _assignments(old) if isinstance(old.value, str) else np.atleast_2d(old.wanted()).tolist()
    both = Continuations(slides=True, deepest=True, take="signs")
    one = Reading((old.e(Signs(), value=rows[0] if len(rows) == 1 else rows),))
    return [Reading((old.e(both, value=rows, order="any"),), one)]


def _assignments(old: Old) -> list[list[float]]:
    """Values of u1, u2, ... from "u1=u2=+1/2 and u1=u2=-1/2"; what stands in brackets at the end is prose."""
    text = re.sub(r"\s+\([^()]*(?:\([^()]*\)[^()]*)*\)\s*$", "", old.text)
    rows = []
    for part in re.split(r"\s+and\s+|;", text):
        found: dict[str, float] = {}
        for chain in part.split(","):
            *names, value = (piece.strip() for piece in chain.split("="))
            if not names or not all(re.fullmatch(r"[a-z]\w*", name) for name in names):
                raise NotUnderstoodError(f"{part!r} gives no multipliers")
            found |= dict.fromkeys(names, old.number(value))
        rows.append([found[name] for name in sorted(found)])
    return rows


def _equilibrium(old: Old, _: Groups) -> list[Reading]:
    point = tuple(np.atleast_1d(old.wanted()).tolist())
    if len(point) != len(old.states):
        raise NotUnderstoodError(f"the case has {len(old.states)} states")
    return old.one(Rest(point), value=0)


def _equilibria(old: Old, _: Groups) -> list[Reading]:
    points: Any = np.atleast_1d(old.wanted())
    if points.ndim == 1 and len(old.states) == 1:
        points = points[:, None]
    if points.ndim != 2 or points.shape[1] != len(old.states):
        raise NotUnderstoodError(f"the points have no {len(old.states)} states each")
    return [Reading(tuple(old.e(Rest(tuple(point)), value=0) for point in points.tolist()))]


def _capture(old: Old, _: Groups) -> list[Reading]:
    pairs = re.findall(r"\(([^()]*)\)\s*:\s*([-+\d.eE]+)", old.text)
    if not pairs:
        raise NotUnderstoodError("no pairs (state):time were found")
    start, found = old.runs.built.t_span[0], []
    for state, time in pairs:
        x0 = tuple(old.number(text) for text in state.split(","))
        until = start + 2 * old.number(time)
        found.append(old.e(OneEvent("slide", x0=x0, until=until, number=-1), value=time))
    return [Reading(tuple(found))]


RULES: Rules = (
    (r"must_report must_name report reports must_warn", _must_report),
    (r"reachable_(?:set_|interval_)?(?:{state}_)?at_(?P<time>[\d./]+)", _reachable),
    (rf"(?:n|number_of|num|count)_(?P<kind>{_KINDS})(?:s|es)?",
     lambda o, g: o.one(EventCount(kind_word(o, g["kind"])))),
    (rf"t_(?P<kind>{_KINDS})s (?P<kind>{_KINDS})_instants",
     lambda o, g: o.one(SomeEvents(kind_word(o, g["kind"]), first=o.size))),
    (r"t_(?:hit|reach|capture|contact|threshold|first_hit)(?:_(?P<k>\d+))? (?:hit|hitting|contact)_time",
     lambda o, g: o.one(OneEvent(number=counting(g["k"])))),
    (rf"(?P<state>{{one}}|state)_at_(?P<kind>{_KINDS})(?:_(?P<k>\d+))?", _at_event),
    (r"codim_?2_(?P<what>entry|exit)_(?:point|state) point_codim_?2_(?P<what>entry|exit)", _corner),
    (r"(?:rebound|bounce|apex|peak)_heights",
     lambda o, _: o.one(TurningPoints(o.states[0], "max", first=o.size))),
    (r"(?P<kind>crossing|exit|entry|stick|reset|rebound)_(?:velocity|speed)", _velocity),
    (r"(?:final|end|last)_mode mode_at_(?P<time>.+)", _mode),
    (r"(?:equivalent_control|u_eq|ueq|lambda|multiplier|sign)_at_(?P<time>.+)",
     lambda o, g: o.one(Signs(when(o, g["time"])))),
    (r"steady_state (?:steady_state|steady)_{state} {state}_(?:steady|inf|infinity|ss|steady_state)",
     lambda o, g: o.one(Steady(g["state"], still=max(1e-9, 1e-2 * o.tol)))),
    (r"(?:blow_?up|escape|finite_escape)_time t_(?:blow_?up|escape)", _blow_up),
    (r"(?:rest|equilibrium|stiction|sticking|dead)_(?:interval|band|zone|set) stick_(?:band|zone|set)",
     _rest_set),
    (r"(?P<name>\w+)_(?:grazing|graze|critical_grazing) grazing_(?P<name>\w+)", _grazing),
    (r"grazing_(?:forcing_)?amplitude (?:forcing_)?amplitude_(?:at_)?grazing", _forcing),
    (r"(?:branch_)?end_(?:states|points) branch_end_(?:states|points) branch_ends", _branch_ends),
    (r"(?:number_of|n|count_of)_solutions", _solutions),
    (r"t_non_?unique non_?uniqueness_time t_(?:branch|branching)", _non_unique_time),
    (rf"(?:n|number_of|num|count)_(?P<kind>{_KINDS})(?:s|es)?_(?:before|until|by|up_to)_(?P<time>[\d.]+)",
     _count_by),
    (r"(?:convex_)?weight_(?:of_)?(?P<side>plus|minus|\+|-)", _side_weight),
    (r"\w+", _parameter),
    (r"(?:slide|sliding|stick)_interval", lambda o, _: o.one(_first("interval"))),
    (r"slide_until sliding_until slides_to", lambda o, _: o.one(State(_first("end")))),
    (r"sliding_(?:speed|velocity)", _speed),
    (rf"sliding_(?:vector_field|field|vector) (?P<repels>(?:repelling|escaping)_(?:sliding_)?{_FIELD})",
     _field),
    (r"equivalent_control u_eq ueq sliding_multiplier equivalent_signs?", _multiplier),
    (r"(?:bilinear_|sliding_|convex_)?weights", _weights),
    (r"(?:sliding|bilinear)_multipliers", _multipliers),
    (r"{state}dot(?:_bilinear)? d{state}(?:/)?dt", lambda o, g: o.one(Rate(component=g["state"]))),
    (r"{state}dot_values",
     lambda o, g: o.either(*(Continuations(s, take=g["state"]) for s in (True, False)), order="any")),
    (r"filippov_interval_{state}dot", lambda o, g: o.one(RateBounds(g["state"]))),
    (r"(?:pseudo_?|pseudo-)?equilibrium(?:_point)? rest_point", _equilibrium),
    (r"(?:pseudo_?|pseudo-)?equilibria rest_points", _equilibria),
    (r"capture_times?", _capture),
    (rf"{{state}}dot_(?P<rule>{_RULE}) (?P<rule>{_RULE})_{{state}}dot",
     lambda o, g: o.one(Rate(component=g["state"], sliding=g["rule"]))),
    (rf"(?:{_END})_(?P<rule>{_RULE}) (?P<rule>{_RULE})_(?:{_END})",
     lambda o, g: o.one(State(sliding=g["rule"]))),
    (rf"(?P<rule>{_RULE})_(?:sliding_)?{_FIELD} sliding_{_FIELD}_(?P<rule>{_RULE})",
     lambda o, g: o.one(Rate(_first("middle"), sliding=g["rule"]))),
    (rf"(?P<rule>{_RULE})_(?:multipliers?|{_SIGNS}) (?:{_SIGNS})_(?P<rule>{_RULE})",
     lambda o, g: o.one(Signs(sliding=g["rule"]))),
    (r"moments_weights",
     lambda o, _: o.either(VertexWeights(), Formula("(1+s)/2", {"s": Signs(sliding="moments")}))),
)  # fmt: skip
