"""Names of sliding: where and when, with which multipliers and which velocity, under which rule."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from filippov.app.bank.case_runs import CaseRuns
from filippov.app.bank.measures.along import Along
from filippov.app.bank.measures.events import OneEvent
from filippov.app.bank.measures.measure import Formula
from filippov.app.bank.measures.phases import Phases
from filippov.app.bank.measures.sets import Rest
from filippov.app.bank.measures.sliding import Continuations, Rate, RateBounds, Signs, VertexWeights
from filippov.app.bank.measures.states import State
from filippov.app.bank.migrate.rule import Groups, Old, Reading, enter
from filippov.app.bank.notation import formula
from filippov.app.bank.outcome import NotUnderstoodError
from filippov.base.errors import ModelError
from filippov.model.symbols import t as time_symbol

_RULE = "moments|utkin"
_END = "final_state|x_final|final"
_FIELD = "(?:vector_)?field"
_SIGNS = "equivalent_control|u_eq"
# Candidates of which one may be meant.
_FEW = 4


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
    """A formula in t. Raises NotUnderstoodError."""
    try:
        found = formula(text, old.runs.names)
    except ModelError as error:
        raise NotUnderstoodError(str(error)) from None
    if found.free_symbols - {time_symbol}:
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


enter(
    CaseRuns,
    (r"(?:slide|sliding|stick)_interval", lambda o, _: o.one(_first("interval"))),
    (r"slide_until|sliding_until|slides_to", lambda o, _: o.one(State(_first("end")))),
    (r"sliding_(?:speed|velocity)", _speed),
    (rf"sliding_(?:vector_field|field|vector)|(?P<repels>(?:repelling|escaping)_(?:sliding_)?{_FIELD})",
     _field),
    (r"equivalent_control|u_eq|ueq|sliding_multiplier|equivalent_signs?", _multiplier),
    (r"(?:bilinear_|sliding_|convex_)?weights", _weights),
    (r"sliding_multipliers", _multipliers),
    (r"(?P<state>{state})dot(?:_bilinear)?|d(?P<state2>{state})(?:/)?dt",
     lambda o, g: o.one(Rate(component=g["state"]))),
    (r"(?P<state>{state})dot_values",
     lambda o, g: o.either(*(Continuations(s, take=g["state"]) for s in (True, False)), order="any")),
    (r"filippov_interval_(?P<state>{state})dot", lambda o, g: o.one(RateBounds(g["state"]))),
    (r"(?:pseudo_?|pseudo-)?equilibrium(?:_point)?|rest_point", _equilibrium),
    (r"capture_times?", _capture),
    (rf"(?P<state>{{state}})dot_(?P<rule>{_RULE})|(?P<rule2>{_RULE})_(?P<state2>{{state}})dot",
     lambda o, g: o.one(Rate(component=g["state"], sliding=g["rule"]))),
    (rf"(?:{_END})_(?P<rule>{_RULE})|(?P<rule2>{_RULE})_(?:{_END})",
     lambda o, g: o.one(State(sliding=g["rule"]))),
    (rf"(?P<rule>{_RULE})_(?:sliding_)?{_FIELD}|sliding_{_FIELD}_(?P<rule2>{_RULE})",
     lambda o, g: o.one(Rate(_first("middle"), sliding=g["rule"]))),
    (rf"(?P<rule>{_RULE})_(?:multipliers?|{_SIGNS})|(?:{_SIGNS})_(?P<rule2>{_RULE})",
     lambda o, g: o.one(Signs(sliding=g["rule"]))),
    (r"moments_weights",
     lambda o, _: o.either(VertexWeights(), Formula("(1+s)/2", {"s": Signs(sliding="moments")}))),
)  # fmt: skip
