"""Names of states, of periodic solutions and averages over them, of accumulations of events."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from sympy import Symbol

from filippov.app.bank.migrate.events import kind_word, resets, sequence
from filippov.app.bank.migrate.rule import Groups, Old, Reading, Rules
from filippov.app.bank.notation import formula
from filippov.app.bank.outcome import NotUnderstoodError
from filippov.app.bank.quantities.along import Along, Share
from filippov.app.bank.quantities.events import Accumulation, EventCount, OneEvent, Ratios, SomeEvents
from filippov.app.bank.quantities.orbits import HarmonicBalance, PeriodicOrbit
from filippov.app.bank.quantities.quantity import Formula, Quantity, When
from filippov.app.bank.quantities.sliding import Signs
from filippov.app.bank.quantities.states import (
    LevelTimes,
    Phases,
    Segments,
    SlidingOn,
    State,
    Stop,
    TurningPoints,
)

_KINDS = "enter|entry|exit|leave|cross|crossing|slide|stick|switch|event|impact|reset|release|hit"
_SPANS: tuple[Any, ...] = ("period", "span")
_FEW = 8
_WIDTH = "peak_to_peak|range|ripple|pp|swing"
_CYCLE = "limit_cycle|cycle|orbit"
_VERDICTS = {"true": True, "stable": True, "yes": True, "false": False, "unstable": False, "no": False}


def _final(old: Old, _: Groups) -> list[Reading]:
    given = old.entry.given
    t = when(old, given["t"]) if "t" in given else None
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
    return [Reading(tuple(old.e(State(when(old, t), name), value=value) for t, value in pairs))]


def _at_time(old: Old, g: Groups) -> list[Reading]:
    text, name, states = g["time"].strip(), g["state"], old.states
    if text in ("", "t"):
        raise NotUnderstoodError("it is no time")
    many = isinstance(old.value, list)
    if many and old.size == len(states) and (len(states) > 1 or name not in states):
        return old.one(State(when(old, text)))
    return old.one(State(when(old, text), name if name in states else None if many else states[0]))


def when(old: Old, given: object) -> When:
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
    over = (when(old, g["low"]), when(old, g["high"]))
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
    """The formula that vanishes where left = right. Raises ModelError."""
    formula(left, old.subject.names), formula(right, old.subject.names)
    return f"{left}-({right})"


def velocity_name(old: Old) -> str:
    """The state that is the derivative of the first one, else one whose name begins with v, else the last."""
    rows = {row[0] for row in old.runs.built.fields.values()}
    only = next(iter(rows)) if len(rows) == 1 else None
    if isinstance(only, Symbol) and only.name in old.states:
        return str(only.name)
    return next((name for name in old.states if name.startswith("v")), old.states[-1])


def _impact_velocities(old: Old, g: Groups) -> list[Reading]:
    hits: dict[str, Any] = {"kind": "reset"} if resets(old.runs) else {"kind": "any", "surface": 0}
    take = velocity_name(old)
    formula_in_n = isinstance(old.value, str) and re.search(r"\bn\b", old.value)
    if g["first"] or not (isinstance(old.value, list) or formula_in_n):
        return old.one(OneEvent(**hits, number=1, take=take))
    return sequence(old, lambda n: [SomeEvents(**hits, first=n, take=take)])


def _orbit(old: Old, take: Any, **options: Any) -> PeriodicOrbit:
    """The orbit; the period that another expectation gives is a guess of it."""
    given = {entry.name: entry.given.get("value") for entry in old.case.expected}
    found = given.get("period", given.get("limit_cycle_period"))
    return PeriodicOrbit(take, period=None if found is None else old.number(found), **options)


def _of_period(old: Old, text: str) -> list[Reading]:
    """A formula in the period T: of the solution, or, without surfaces, between risings through a level."""
    orbit = Formula(text, {"T": _orbit(old, "period")}) if text != "T" else _orbit(old, "period")
    for entry in old.case.expected if not old.runs.built.declared else ():
        match = re.fullmatch(r"(?:first_)?times?_([^=]+?)=([^=]+?)(?:(?:_up|_down)*)", entry.name)
        if match is not None:
            through, ends = level(old, match[1], match[2]), (("a", -2), ("b", -1))
            where: dict[str, Quantity] = {name: LevelTimes(through, ("+",), number=k) for name, k in ends}
            return [old.other(Formula(re.sub(r"\bT\b", "(b-a)", text), where), orbit)]
    return old.one(orbit)


def _duration(old: Old, g: Groups) -> list[Reading]:
    slides = g["what"] != "slip"
    if g["first"]:
        return old.one(Phases(slides, number=1))
    pairs = [(Phases(slides, "period", number=k), Phases(slides, whole=True, number=k)) for k in (-1, 1)]
    return [old.other(*pair) for pair in pairs]


def _stick_position(old: Old, g: Groups) -> list[Reading]:
    take, size = g["state"] or old.states[0], old.size
    if size > 1:
        return [old.other(*(SomeEvents("slide", over=o, last=size, take=take) for o in _SPANS), order="any")]
    return [old.other(*(OneEvent("slide", over=o, number=k, take=take) for o in _SPANS)) for k in (-1, -2)]


def _crossings(old: Old, g: Groups) -> list[Reading]:
    value = np.atleast_1d(old.wanted()).tolist()
    return old.one(SomeEvents("any", over="period", take=g["state"]), value=value, order="any")


def _per_period(old: Old, g: Groups) -> list[Reading]:
    kinds: dict[str, Any] = {"crossings": "cross", "impacts": "reset", "events": "any"}
    count = EventCount(kinds.get(g["what"], "slide"), over="period")
    return old.one(Formula("n/2", {"n": count}) if g["half"] else count)


def _amplitude(old: Old, g: Groups) -> list[Reading]:
    name = g["state"] or old.states[0]
    whole = Along(name, "range", "period")
    return old.either(Formula("r/2", {"r": whole}), Along(name, "max_abs", "period"), whole)


def _multipliers(old: Old, g: Groups) -> list[Reading]:
    half = bool(g["half"])
    if old.size > 1 or g["many"]:
        values = sorted(np.atleast_1d(old.wanted()).tolist(), key=abs)
        kinds = [(take, trivial) for take in ("multipliers", "moduli") for trivial in (True, False)]
        found = old.either(*(_orbit(old, k, half=half, trivial=one) for k, one in kinds), value=values)
        if len(values) == len(old.states) and values[0] == 0:
            # The return map of a section as a matrix in all states: along the flow it has 0 in place of 1.
            takes: tuple[Any, ...] = ("multipliers", "moduli")
            found += old.either(*(_orbit(old, k, half=half) for k in takes), value=values[1:])
        return found
    takes = ("multiplier",) if g["sign"] else ("multiplier", "modulus")
    return old.either(*(_orbit(old, take, half=half) for take in takes))


def _stability(old: Old, _: Groups) -> list[Reading]:
    word = old.text.strip().casefold()
    if word not in _VERDICTS:
        raise NotUnderstoodError(f"{word!r:.40} is no verdict")
    return old.one(_orbit(old, "stability"), text="stable" if _VERDICTS[word] else "unstable")


def _ratios(old: Old, g: Groups) -> list[Reading]:
    between = "intervals" if g["gaps"] else velocity_name(old) if g["speeds"] else "distances"
    surfaces: list[Any] = [None, *range(len(old.runs.built.declared))]
    found = old.either(*(Ratios(between, k) for k in surfaces if k is not None or not g["speeds"]), each=True)
    if between == "distances" and len(old.runs.built.declared) == 1:
        # All events lie on the one surface: what shrinks is the state along it.
        found += old.either(*(Ratios(name) for name in old.states), each=True)
    return found


def _after(old: Old, _: Groups) -> list[Reading]:
    stays = r"(?:stays?|rests?|remains?|stops?) (?:at|in) "
    match = re.search(stays + r"\(([^()]*)\)", old.text)
    if match is not None:
        point = [old.number(piece) for piece in match[1].split(",")]
    elif re.search(stays + r"(?:the )?(?:origin|rest|zero)|origin is an equilibrium", old.text):
        point = [0.0] * len(old.states)
    else:
        raise NotUnderstoodError("the text names no point to stay at")
    # A text has no digits of its own: the accuracy of the accumulation's limit.
    return old.one(Accumulation("state_after"), value=point, atol=max(old.tol, 1e-8))


def _frequency(old: Old, g: Groups) -> list[Reading]:
    angular = _of_period(old, "2*pi/T")
    return angular if g["angular"] else [*_of_period(old, "1/T"), *angular]


def _duty(old: Old, _: Groups) -> list[Reading]:
    """The share of the time in one mode, or, along sliding, the weight of that mode's field."""
    slid = old.either(*(Formula(f"(1{sign}s)/2", {"s": Signs()}) for sign in "+-"))
    return [*(old.other(*(Share(mode, over=over) for over in _SPANS)) for mode in "+-"), *slid]


def _width(old: Old, g: Groups) -> list[Reading]:
    """The width of the range of a state, or its two ends, over a period or else the span."""
    if old.size == 1:
        return old.either(*(Along(g["state"], "range", over) for over in _SPANS))
    low, high = np.asarray(old.wanted(), dtype=float)
    found = []
    for over in _SPANS:
        ends: tuple[tuple[Any, float], ...] = (("min", float(low)), ("max", float(high)))
        found.append(
            Reading(tuple(old.e(Along(g["state"], take, over), value=value) for take, value in ends))
        )
    return found


def _distance(old: Old, _: Groups) -> list[Reading]:
    """How far the first state is from its start at rest."""
    begin = float(old.runs.built.x0[0])
    return old.one(Formula(f"Abs(x_-({begin!r}))", {"x_": Stop(old.states[0])}))


def _swings(old: Old, g: Groups) -> list[Reading]:
    """Magnitudes at the turning points, with or without the start."""
    name = g["state"] or old.states[0]
    points = [TurningPoints(name, start=start, first=old.size) for start in (True, False)]
    return old.either(*(Formula("Abs(v)", {"v": one}) for one in points))


def _extreme_time(old: Old, g: Groups) -> list[Reading]:
    """The time at which a state is largest or least over the span, at a turning point of it."""
    name, what = g["state"] or old.states[0], g["what"]
    if g["state"] is None and len(old.states) > 1:
        raise NotUnderstoodError("it names no state")
    top = old.e(Formula("v-m", {"v": State(old.value, name), "m": Along(name, what)}), value=0)
    turns = [old.e(TurningPoints(name, what, number=k + 1, take="t")) for k in range(_FEW)]
    return [Reading((one, top)) for one in turns]


def _durations(old: Old, g: Groups) -> list[Reading]:
    wanted: Any = np.atleast_1d(old.wanted())
    take: Any = "interval" if wanted.ndim == 2 else "length"
    return old.one(Phases(g["what"] != "slip", first=len(wanted), take=take))


def _phase_time(old: Old, _: Groups) -> list[Reading]:
    ends: dict[str, Quantity] = {n: OneEvent("any", over="period", number=k) for n, k in (("a", 1), ("b", 2))}
    whole: dict[str, Quantity] = {**ends, "T": PeriodicOrbit("period", "settled")}
    count = old.e(EventCount("any", over="period"), value=2, atol=0)
    return [Reading((old.e(one), count)) for one in (Formula("b-a", ends), Formula("T-(b-a)", whole))]


def _section(old: Old, _: Groups) -> list[Reading]:
    take = "state" if old.size > 1 else old.states[0]
    return old.either(*(OneEvent(over="period", number=k + 1, take=take) for k in range(_FEW)))


RULES: Rules = (
    (r"final_state final final_value x_final x_end state_final end_state", _final),
    (r"final_{state} {state}_(?:final|end)", lambda o, g: o.one(State(None, g["state"], side="+"))),
    (r"(?P<state>{one}|state|[A-Za-z]\w*?)_at_\[(?P<times>[^\]]*)\]", _at_times),
    ((r"(?P<state>{one}|state|x|y)(?:_at_(?:t\s*=?\s*)?|\((?:t\s*=\s*)?)"
     r"(?P<time>[^()=<>\[\]]*(?:\([^()]*\)[^()]*)*)\)?"),
     _at_time),
    (r"{state}_for_(?P<low>.+?)<=?t<=?(?P<high>.+)", _for),
    (r"(?P<what>max|min|max_abs|sup)_\|?{state}\|? \|?{state}\|?_(?P<what>max|min)", _extreme),
    (rf"point_(?P<first>first_)?(?P<kind>{_KINDS}) (?P<first>first_)?(?P<kind>{_KINDS})_(?:point|state)",
     lambda o, g: at_events(o, g, "state")),
    ((rf"{{state}}_(?P<first>first_)?(?P<kind>{_KINDS}) "
     rf"(?P<first>first_)?(?:sliding_|stick_|slip_)?(?P<kind>{_KINDS}|restick|slip_start)_{{state}} "
     rf"{{state}}_(?P<kind>restick|slip_start)"),
     lambda o, g: at_events(o, g, g["state"])),
    (r"(?P<what>{one})_(?:stop|rest) (?:stop|rest)_(?P<what>position|{one}) x_(?:stop|rest)",
     lambda o, g: o.one(Stop(g["what"] if g["what"] in o.states else o.states[0]))),
    (r"t_(?:stop|rest) (?:stop|rest|stopping)_time", lambda o, _: o.one(Stop())),
    (r"(?:stop|stopping)_distance", _distance),
    (r"(?:swing_|turning_)?amplitudes(?:_{state})?", _swings),
    (r"(?:t|time)_(?:of|at)_(?P<what>max|min)(?:_{state})? (?:t|time)_(?P<what>max|min)_{state}",
     _extreme_time),
    (r"turn(?:ing)?_(?P<what>points?|times?)(?:_{state})?", _turns),
    (r"first_turn_(?:{state}|t|time)",
     lambda o, g: o.one(TurningPoints(o.states[0], number=1, take=g["state"] or "t"))),
    (r"first_(?P<what>max|min)_{state}", lambda o, g: o.one(TurningPoints(g["state"], g["what"], number=1))),
    (r"(?:first_)?(?:times?|t)_(?P<left>[^=]+?)=(?P<right>[^=]+?)(?P<way>(?:_up|_down)*)", _level),
    (r"impact_velocit(?:y|ies) impact_speeds? (?P<first>first)_impact_(?:velocity|speed|v)",
     _impact_velocities),
    (r"(?:limit_cycle_|orbit_|cycle_|hunting_|steady_)?(?P<half>half_)?period T_cycle",
     lambda o, g: _of_period(o, "T/2" if g["half"] else "T")),
    (r"(?P<first>first_)?(?P<what>stick|slip|sliding|slide)_(?:duration|time|interval_length)", _duration),
    (r"stick_positions? stick_{state} rest_positions?", _stick_position),
    (r"cycle_(?:(?:crossings?|events?|switches)_)?{state}", _crossings),
    (r"(?P<what>slides|sticks|crossings|events|stops|impacts)_per_(?P<half>half_)?period", _per_period),
    ((rf"(?:limit_cycle_|cycle_|hunting_|steady_)?amplitude(?:_{{state}})? (?:max_|peak_)amplitude "
     rf"(?:{_CYCLE}|steady)_{{state}}_amplitude"),
     _amplitude),
    (r"(?P<sign>signed_)?(?P<half>half_(?:map_|period_)?)?(?:floquet_)?multiplier(?P<many>s)?(?:_moduli)?",
     _multipliers),
    (rf"(?:{_CYCLE}|periodic_motion)_(?:is_)?(?:stable|stability)", _stability),
    (r"floquet_exponent largest_exponent", lambda o, _: o.one(_orbit(o, "exponent"))),
    (r"(?:describing_function|harmonic_balance)_(?P<what>period|frequency|amplitude)",
     lambda o, g: o.either(*(HarmonicBalance(g["what"], k) for k in (1, 2, 3)))),
    ((r"t_converge t_converged convergence_time zeno_time t_zeno t_limit t_accumulation accumulation_time "
      r"reaching_time"),
     lambda o, _: [o.other(Accumulation(), OneEvent("slide", number=-1))]),
    ((r"(?P<gaps>ratio_of_intervals|interval_ratio|contraction_of_intervals) "
     r"(?P<speeds>(?:velocity|speed)_ratio\w*) contraction(?:_per_\w+|_ratio)? contraction_factor"),
     _ratios),
    (r"after(?:_\w+)? afterwards", _after),
    (r"(?P<what>mean|average|time_average|avg|rms)_{state} {state}_(?P<what>mean|average|avg|rms)",
     lambda o, g: o.either(*(Along(g["state"], "rms" if g["what"] == "rms" else "mean", x) for x in _SPANS))),
    (rf"(?:{_WIDTH})_{{state}} {{state}}_(?:{_WIDTH})",
     _width),
    (rf"(?:{_CYCLE}|steady)_{{state}}_(?P<what>max|min) (?:{_CYCLE}|steady)_(?P<what>max|min)_{{state}}",
     lambda o, g: o.one(Along(g["state"], g["what"], "period"))),
    ((r"(?:limit_cycle_|cycle_|orbit_|switching_|hunting_|self_oscillation_)?(?P<angular>angular_)?frequency "
     r"(?:limit_cycle_|cycle_|orbit_)(?P<angular>omega) (?P<angular>omega)_(?:limit_)?cycle"),
     _frequency),
    ((r"(?P<what>stick|slip|slide|sliding)_(?:fraction|ratio|share) "
     r"fraction_of_time_(?P<what>stick|slid|slipp)ing"),
     lambda o, g: [o.other(*(Share(slides=g["what"][:4] != "slip", over=over) for over in _SPANS))]),
    (r"duty_?(?:cycle|ratio)? on_(?:fraction|ratio)",
     _duty),
    ((r"(?:time_in_|total_)(?P<what>stick|sliding|slip)(?:ping|ing)?(?:_time)? "
     r"(?P<what>stick|sliding|slip)_time_total"),
     lambda o, g: o.one(Share(slides=g["what"] != "slip", take="time"))),
    (r"(?P<what>stick|slide|sliding|slip)_(?:durations|lengths|intervals)", _durations),
    (r"dwell_times?", lambda o, _: o.one(Segments("length", first=o.size))),
    (r"(?P<what>on|off|heating|cooling|up|down|rise|fall)_(?:time|duration)", _phase_time),
    (r"poincare_point fixed_point section_point return_point", _section),
)  # fmt: skip
