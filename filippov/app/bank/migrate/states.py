"""Names of states: at a time, at the end, over an interval, at an event, where they turn."""

from __future__ import annotations

import re

import numpy as np
from sympy import Symbol

from filippov.app.bank.measures.along import Along
from filippov.app.bank.measures.events import OneEvent, SomeEvents
from filippov.app.bank.measures.measure import When
from filippov.app.bank.measures.sets import Stop
from filippov.app.bank.measures.states import SlidingOn, State
from filippov.app.bank.measures.turns import LevelTimes, Turns
from filippov.app.bank.migrate.events import kind_word, resets, sequence
from filippov.app.bank.migrate.rule import Old, Reading, rule
from filippov.app.bank.notation import formula
from filippov.app.bank.reason import NotUnderstoodError
from filippov.base.errors import ModelError

_KINDS = "enter|entry|exit|leave|cross|crossing|slide|stick|switch|event|impact|reset|release"


@rule(r"final_state|final|final_value|x_final|x_end|state_final|end_state")
def _final(old: Old, _: re.Match[str]) -> list[Reading]:
    given = old.entry.given
    t = moment(old, given["t"]) if "t" in given else None
    alone = old.states[0] if old.size == 1 < len(old.states) else None
    value = np.atleast_1d(old.wanted()).tolist()
    found = [old.e(State(t, alone, side="+"), value=value[0] if alone else value)]
    sliding = given.get("sliding_on")
    if isinstance(sliding, list):
        names = old.motion.built.declared
        try:
            places = sorted(names.index(s) if s in names else int(s) for s in sliding)
        except (TypeError, ValueError):
            raise NotUnderstoodError(f"sliding_on is {sliding!r:.60}, no list of surfaces") from None
        found.append(old.e(SlidingOn(t), value=places, atol=0))
    return [Reading(tuple(found))]


@rule(r"final_(?P<state>{state})|(?P<state2>{state})_(?:final|end)")
def _final_of(old: Old, match: re.Match[str]) -> list[Reading]:
    return old.one(State(None, match["state"] or match["state2"], side="+"))


@rule(r"(?P<state>{state}|state|[A-Za-z]\w*?)_at_\[(?P<times>[^\]]*)\]")
def _at_times(old: Old, match: re.Match[str]) -> list[Reading]:
    times = match["times"].split(",")
    old.wanted()
    if not isinstance(old.value, list) or len(times) != len(old.value):
        raise NotUnderstoodError(f"{len(times)} times are given")
    name = match["state"] if match["state"] in old.states else old.states[0]
    pairs = zip(times, old.value, strict=True)
    return [Reading(tuple(old.e(State(moment(old, t), name), value=value) for t, value in pairs))]


@rule(
    r"(?P<state>{state}|state|x|y)(?:_at_(?:t\s*=?\s*)?|\((?:t\s*=\s*)?)(?P<time>[^()=<>\[\]]*(?:\([^()]*\)[^()]*)*)\)?"
)
def _at_time(old: Old, match: re.Match[str]) -> list[Reading]:
    text, name, states = match["time"].strip(), match["state"], old.states
    if text in ("", "t"):
        raise NotUnderstoodError("it is no time")
    many = isinstance(old.value, list)
    if many and old.size == len(states) and (len(states) > 1 or name not in states):
        return old.one(State(moment(old, text)))
    component = name if name in states else None if many else states[0]
    return old.one(State(moment(old, text), component))


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


@rule(r"(?P<state>{state})_for_(?P<low>.+?)<=?t<=?(?P<high>.+)")
def _for(old: Old, match: re.Match[str]) -> list[Reading]:
    over = (moment(old, match["low"]), moment(old, match["high"]))
    return old.one(Along(f"{match['state']}-({float(old.wanted())!r})", over=over), value=0)


@rule(r"(?P<what>max|min|max_abs|sup)_\|?(?P<state>{state})\|?|\|?(?P<state2>{state})\|?_(?P<what2>max|min)")
def _extreme(old: Old, match: re.Match[str]) -> list[Reading]:
    what = match["what"] or match["what2"]
    take = "max_abs" if what in ("max_abs", "sup") or "|" in old.name else what
    return old.one(Along(match["state"] or match["state2"], take))


# -- at events -----------------------------------------------------------------------------------------


def at_events(old: Old, kind: str, first: bool, take: str) -> list[Reading]:
    """The first event of a kind; or that and the last ones of either direction, in the period if there is one."""
    word, acting = kind_word(old, kind), False
    if word in ("switch", "event"):
        word, acting = None, word == "switch"
    found = old.one(OneEvent(word, acting=acting, take=take))
    if not first:
        for direction in ("+", "-", None):
            last = [OneEvent(word, direction, over=o, acting=acting, number=-1, take=take) for o in ("period", "span")]
            found.append(old.other(*last))
    return found


@rule(rf"point_(?P<first>first_)?(?P<kind>{_KINDS})|(?P<first2>first_)?(?P<kind2>{_KINDS})_(?:point|state)")
def _point(old: Old, match: re.Match[str]) -> list[Reading]:
    first = bool(match["first"] or match["first2"])
    return at_events(old, match["kind"] or match["kind2"], first, "state")


@rule(
    rf"(?P<state>{{state}})_(?P<first>first_)?(?P<kind>{_KINDS})"
    rf"|(?P<first2>first_)?(?:sliding_|stick_|slip_)?(?P<kind2>{_KINDS}|restick|slip_start)_(?P<state2>{{state}})"
)
def _state_at_event(old: Old, match: re.Match[str]) -> list[Reading]:
    word = match["kind2"] or match["kind"]
    kind = {"restick": "slide", "slip_start": "exit"}.get(word, word)
    first = bool(match["first"] or match["first2"])
    return at_events(old, kind, first, match["state"] or match["state2"])


@rule(r"(?P<what>[tx]|{state})_(?:stop|rest)|(?:stop|rest)_(?P<what2>position|time|{state})")
def _stop(old: Old, match: re.Match[str]) -> list[Reading]:
    what = match["what"] or match["what2"]
    if what in ("t", "time") and what not in old.states:
        return old.one(Stop())
    return old.one(Stop(what if what in old.states else old.states[0]))


# -- where a state turns -------------------------------------------------------------------------------


@rule(r"turn(?:ing)?_(?P<what>points?|times?)(?:_(?P<state>{state}))?")
def _turns(old: Old, match: re.Match[str]) -> list[Reading]:
    name = match["state"] or old.states[0]
    take = "value" if match["what"].startswith("point") else "t"
    return sequence(old, lambda n: [Turns(name, start=start, first=n, take=take) for start in (True, False)])


@rule(r"first_turn_(?P<what>t|time|{state})")
def _first_turn(old: Old, match: re.Match[str]) -> list[Reading]:
    take = match["what"] if match["what"] in old.states else "t"
    return old.one(Turns(old.states[0], number=1, take=take))


@rule(r"first_(?P<what>max|min)_(?P<state>{state})")
def _first_extreme(old: Old, match: re.Match[str]) -> list[Reading]:
    return old.one(Turns(match["state"], match["what"], number=1))


@rule(r"(?:first_)?(?:times?|t)_(?P<left>[^=]+?)=(?P<right>[^=]+?)(?P<way>(?:_up|_down)*)")
def _level(old: Old, match: re.Match[str]) -> list[Reading]:
    text = level(old, match["left"], match["right"])
    ways = tuple("+" if way == "up" else "-" for way in match["way"].split("_") if way)
    return old.one(LevelTimes(text, ways or None, first=None if ways else old.size))  # type: ignore[arg-type]


def level(old: Old, left: str, right: str) -> str:
    """The formula that vanishes where left = right. Raises NotUnderstoodError."""
    try:
        formula(left, old.subject.names), formula(right, old.subject.names)
    except ModelError as error:
        raise NotUnderstoodError(str(error)) from None
    return f"{left}-({right})"


# -- velocities at impacts -----------------------------------------------------------------------------


def velocity(old: Old) -> str:
    """The state that is the derivative of the first one, else one whose name begins with v, else the last."""
    rows = {row[0] for row in old.motion.built.fields.values()}
    only = next(iter(rows)) if len(rows) == 1 else None
    if isinstance(only, Symbol) and only.name in old.states:
        return only.name
    return next((name for name in old.states if name.startswith("v")), old.states[-1])


@rule(r"impact_velocit(?:y|ies)|impact_speeds?|(?P<first>first)_impact_(?:velocity|speed|v)")
def _impact_velocities(old: Old, match: re.Match[str]) -> list[Reading]:
    hits = {"kind": "reset"} if resets(old.motion) else {"kind": "any", "surface": 0}
    take = velocity(old)
    formula_in_n = isinstance(old.value, str) and re.search(r"\bn\b", old.value)
    if match["first"] or not (isinstance(old.value, list) or formula_in_n):
        return old.one(OneEvent(**hits, number=1, take=take))  # type: ignore[arg-type]
    return sequence(old, lambda n: [SomeEvents(**hits, first=n, take=take)])  # type: ignore[arg-type]
