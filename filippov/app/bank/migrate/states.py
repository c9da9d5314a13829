"""Names of states: at a time, at the end, over an interval, at an event, where they turn."""

from __future__ import annotations

import re
from typing import Any

from sympy import Symbol

from filippov.app.bank.case_runs import CaseRuns
from filippov.app.bank.measures.along import Along
from filippov.app.bank.measures.events import OneEvent, SomeEvents
from filippov.app.bank.measures.measure import When
from filippov.app.bank.measures.sets import Stop
from filippov.app.bank.measures.states import SlidingOn, State
from filippov.app.bank.measures.turning_points import LevelTimes, TurningPoints
from filippov.app.bank.migrate.events import kind_word, resets, sequence
from filippov.app.bank.migrate.rule import Groups, Old, Reading, enter
from filippov.app.bank.notation import formula
from filippov.app.bank.outcome import NotUnderstoodError
from filippov.base.errors import ModelError

_KINDS = "enter|entry|exit|leave|cross|crossing|slide|stick|switch|event|impact|reset|release"
_SPANS: tuple[Any, ...] = ("period", "span")


def _final(old: Old, _: Groups) -> list[Reading]:
    given = old.entry.given
    t = moment(old, given["t"]) if "t" in given else None
    alone = old.states[0] if old.size == 1 < len(old.states) else None
    value = old.value if isinstance(old.value, list) else [old.value]
    found = [old.e(State(t, alone, side="+"), value=value[0] if alone else value)]
    sliding, names = given.get("sliding_on"), old.runs.built.declared
    if isinstance(sliding, list):
        try:
            places = sorted(names.index(s) if s in names else int(s) for s in sliding)
        except (TypeError, ValueError):
            raise NotUnderstoodError(f"sliding_on is {sliding!r:.60}, no list of surfaces") from None
        found.append(old.e(SlidingOn(t), value=places, atol=0))
    return [Reading(tuple(found))]


def _at_times(old: Old, g: Groups) -> list[Reading]:
    times = g["times"].split(",")
    old.wanted()
    if not isinstance(old.value, list) or len(times) != len(old.value):
        raise NotUnderstoodError(f"{len(times)} times are given")
    name = g["state"] if g["state"] in old.states else old.states[0]
    pairs = zip(times, old.value, strict=True)
    return [Reading(tuple(old.e(State(moment(old, t), name), value=value) for t, value in pairs))]


def _at_time(old: Old, g: Groups) -> list[Reading]:
    text, name, states = g["time"].strip(), g["state"], old.states
    if text in ("", "t"):
        raise NotUnderstoodError("it is no time")
    many = isinstance(old.value, list)
    if many and old.size == len(states) and (len(states) > 1 or name not in states):
        return old.one(State(moment(old, text)))
    return old.one(State(moment(old, text), name if name in states else None if many else states[0]))


def moment(old: Old, given: object) -> When:
    """A time: a number or formula, the end of the span, the first entry, exit or crossing."""
    text = str(given).strip()
    if text in ("t_enter", "t_entry", "t_e", "te"):
        return OneEvent("slide")
    if text in ("t_exit", "t_cross"):
        return OneEvent("exit" if text == "t_exit" else "cross")
    if text in ("end", "T", "t_end", "tf"):
        return None
    old.number(given)
    return given if isinstance(given, int | float) else text


def _for(old: Old, g: Groups) -> list[Reading]:
    over = (moment(old, g["low"]), moment(old, g["high"]))
    return old.one(Along(f"{g['state']}-({float(old.wanted())!r})", over=over), value=0)


def _extreme(old: Old, g: Groups) -> list[Reading]:
    take: Any = "max_abs" if g["what"] in ("max_abs", "sup") or "|" in old.name else g["what"]
    return old.one(Along(g["state"], take))


def at_events(old: Old, g: Groups, take: str) -> list[Reading]:
    """The first event of a kind; or that and the last ones of either direction, of the period if any."""
    kind = str({"restick": "slide", "slip_start": "exit"}.get(g["kind"], g["kind"]))
    word, acting = kind_word(old, kind), kind == "switch"
    found = old.one(OneEvent(word, acting=acting, take=take))
    if not g["first"]:
        for way in ("+", "-", None):
            last = [OneEvent(word, way, over=o, acting=acting, number=-1, take=take) for o in _SPANS]
            found.append(old.other(*last))
    return found


def _turns(old: Old, g: Groups) -> list[Reading]:
    name, take = g["state"] or old.states[0], "value" if g["what"].startswith("point") else "t"
    return sequence(
        old, lambda n: [TurningPoints(name, start=start, first=n, take=take) for start in (True, False)]
    )


def _level(old: Old, g: Groups) -> list[Reading]:
    text = level(old, g["left"], g["right"])
    ways: Any = tuple("+" if way == "up" else "-" for way in g["way"].split("_") if way)
    return old.one(LevelTimes(text, ways or None, first=None if ways else old.size))


def level(old: Old, left: str, right: str) -> str:
    """The formula that vanishes where left = right. Raises NotUnderstoodError."""
    try:
        formula(left, old.subject.names), formula(right, old.subject.names)
    except ModelError as error:
        raise NotUnderstoodError(str(error)) from None
    return f"{left}-({right})"


def velocity(old: Old) -> str:
    """The state that is the derivative of the first one, else one whose name begins with v, else the last."""
    rows = {row[0] for row in old.runs.built.fields.values()}
    only = next(iter(rows)) if len(rows) == 1 else None
    if isinstance(only, Symbol) and only.name in old.states:
        return str(only.name)
    return next((name for name in old.states if name.startswith("v")), old.states[-1])


def _impact_velocities(old: Old, g: Groups) -> list[Reading]:
    hits: dict[str, Any] = {"kind": "reset"} if resets(old.runs) else {"kind": "any", "surface": 0}
    take = velocity(old)
    formula_in_n = isinstance(old.value, str) and re.search(r"\bn\b", old.value)
    if g["first"] or not (isinstance(old.value, list) or formula_in_n):
        return old.one(OneEvent(**hits, number=1, take=take))
    return sequence(old, lambda n: [SomeEvents(**hits, first=n, take=take)])


enter(
    CaseRuns,
    (r"final_state|final|final_value|x_final|x_end|state_final|end_state", _final),
    (r"final_(?P<state>{state})|(?P<state2>{state})_(?:final|end)",
     lambda o, g: o.one(State(None, g["state"], side="+"))),
    (r"(?P<state>{state}|state|[A-Za-z]\w*?)_at_\[(?P<times>[^\]]*)\]", _at_times),
    ((r"(?P<state>{state}|state|x|y)(?:_at_(?:t\s*=?\s*)?|\((?:t\s*=\s*)?)"
     r"(?P<time>[^()=<>\[\]]*(?:\([^()]*\)[^()]*)*)\)?"),
     _at_time),
    (r"(?P<state>{state})_for_(?P<low>.+?)<=?t<=?(?P<high>.+)", _for),
    (r"(?P<what>max|min|max_abs|sup)_\|?(?P<state>{state})\|?|\|?(?P<state2>{state})\|?_(?P<what2>max|min)",
     _extreme),
    (rf"point_(?P<first>first_)?(?P<kind>{_KINDS})|(?P<first2>first_)?(?P<kind2>{_KINDS})_(?:point|state)",
     lambda o, g: at_events(o, g, "state")),
    ((rf"(?P<state>{{state}})_(?P<first>first_)?(?P<kind>{_KINDS})"
     rf"|(?P<first2>first_)?(?:sliding_|stick_|slip_)?(?P<kind2>{_KINDS}|restick|slip_start)_(?P<state2>{{state}})"),
     lambda o, g: at_events(o, g, g["state"])),
    (r"(?P<what>{state})_(?:stop|rest)|(?:stop|rest)_(?P<what2>position|{state})|x_(?:stop|rest)",
     lambda o, g: o.one(Stop(g["what"] if g["what"] in o.states else o.states[0]))),
    (r"t_(?:stop|rest)|(?:stop|rest)_time", lambda o, _: o.one(Stop())),
    (r"turn(?:ing)?_(?P<what>points?|times?)(?:_(?P<state>{state}))?", _turns),
    (r"first_turn_(?:(?P<state>{state})|t|time)",
     lambda o, g: o.one(TurningPoints(o.states[0], number=1, take=g["state"] or "t"))),
    (r"first_(?P<what>max|min)_(?P<state>{state})",
     lambda o, g: o.one(TurningPoints(g["state"], g["what"], number=1))),
    (r"(?:first_)?(?:times?|t)_(?P<left>[^=]+?)=(?P<right>[^=]+?)(?P<way>(?:_up|_down)*)", _level),
    (r"impact_velocit(?:y|ies)|impact_speeds?|(?P<first>first)_impact_(?:velocity|speed|v)",
     _impact_velocities),
)  # fmt: skip
