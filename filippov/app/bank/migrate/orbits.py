"""Names of periodic solutions, averages over them, and accumulations of events."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from filippov.app.bank.case_runs import CaseRuns
from filippov.app.bank.measures.accumulations import Accumulation, Ratios
from filippov.app.bank.measures.along import Along, Share
from filippov.app.bank.measures.events import EventCount, OneEvent, SomeEvents
from filippov.app.bank.measures.measure import Formula, Measure
from filippov.app.bank.measures.orbits import HarmonicBalance, PeriodicOrbit
from filippov.app.bank.measures.phases import Phases
from filippov.app.bank.measures.states import Segments
from filippov.app.bank.measures.turning_points import LevelTimes
from filippov.app.bank.migrate.rule import Groups, Old, Reading, enter
from filippov.app.bank.migrate.states import level, velocity
from filippov.app.bank.outcome import NotUnderstoodError

_FEW = 8
_SPANS: tuple[Any, ...] = ("period", "span")
_WIDTH = "peak_to_peak|range|ripple|pp|swing"
_CYCLE = "limit_cycle|cycle|orbit"
_VERDICTS = {"true": True, "stable": True, "yes": True, "false": False, "unstable": False, "no": False}


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
            where: dict[str, Measure] = {name: LevelTimes(through, ("+",), number=k) for name, k in ends}
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
        return old.either(*(_orbit(old, k, half=half, trivial=one) for k, one in kinds), value=values)
    takes = ("multiplier",) if g["sign"] else ("multiplier", "modulus")
    return old.either(*(_orbit(old, take, half=half) for take in takes))


def _stability(old: Old, _: Groups) -> list[Reading]:
    word = old.text.strip().casefold()
    if word not in _VERDICTS:
        raise NotUnderstoodError(f"{word!r:.40} is no verdict")
    return old.one(_orbit(old, "stability"), text="stable" if _VERDICTS[word] else "unstable")


def _ratios(old: Old, g: Groups) -> list[Reading]:
    between = "intervals" if g["gaps"] else velocity(old) if g["speeds"] else "distances"
    surfaces: list[Any] = [None, *range(len(old.runs.built.declared))]
    return old.either(*(Ratios(between, k) for k in surfaces if k is not None or not g["speeds"]), each=True)


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


def _durations(old: Old, g: Groups) -> list[Reading]:
    wanted: Any = np.atleast_1d(old.wanted())
    take: Any = "interval" if wanted.ndim == 2 else "length"
    return old.one(Phases(g["what"] != "slip", first=len(wanted), take=take))


def _phase_time(old: Old, _: Groups) -> list[Reading]:
    ends: dict[str, Measure] = {n: OneEvent("any", over="period", number=k) for n, k in (("a", 1), ("b", 2))}
    whole: dict[str, Measure] = {**ends, "T": PeriodicOrbit("period", "settled")}
    count = old.e(EventCount("any", over="period"), value=2, atol=0)
    return [Reading((old.e(one), count)) for one in (Formula("b-a", ends), Formula("T-(b-a)", whole))]


def _section(old: Old, _: Groups) -> list[Reading]:
    take = "state" if old.size > 1 else old.states[0]
    return old.either(*(OneEvent(over="period", number=k + 1, take=take) for k in range(_FEW)))


enter(
    CaseRuns,
    (r"(?:limit_cycle_|orbit_|cycle_|hunting_|steady_)?(?P<half>half_)?period|T_cycle",
     lambda o, g: _of_period(o, "T/2" if g["half"] else "T")),
    (r"(?P<first>first_)?(?P<what>stick|slip|sliding|slide)_(?:duration|time|interval_length)", _duration),
    (r"stick_positions?|stick_(?P<state>{state})|rest_positions?", _stick_position),
    (r"cycle_(?:crossings?|events?|switches)_(?P<state>{state})", _crossings),
    (r"(?P<what>slides|sticks|crossings|events|stops|impacts)_per_(?P<half>half_)?period", _per_period),
    ((rf"(?:limit_cycle_|cycle_|hunting_|steady_)?amplitude(?:_(?P<state>{{state}}))?|(?:max_|peak_)amplitude"
     rf"|(?:{_CYCLE}|steady)_(?P<state2>{{state}})_amplitude"),
     _amplitude),
    ((r"(?P<sign>signed_)?(?P<half>half_map_|half_period_|half_)?(?:floquet_)?multiplier(?P<many>s)?"
     r"(?:_moduli)?"),
     _multipliers),
    (rf"(?:{_CYCLE}|periodic_motion)_(?:is_)?(?:stable|stability)", _stability),
    (r"floquet_exponent|largest_exponent", lambda o, _: o.one(_orbit(o, "exponent"))),
    (r"(?:describing_function|harmonic_balance)_(?P<what>period|frequency|amplitude)",
     lambda o, g: o.either(*(HarmonicBalance(g["what"], k) for k in (1, 2, 3)))),
    (r"t_converge|t_converged|convergence_time|zeno_time|t_zeno|t_limit|t_accumulation|reaching_time",
     lambda o, _: [o.other(Accumulation(), OneEvent("slide", number=-1))]),
    ((r"(?P<gaps>ratio_of_intervals|interval_ratio|contraction_of_intervals)"
     r"|(?P<speeds>(?:velocity|speed)_ratio\w*)|contraction(?:_per_\w+|_ratio)?|contraction_factor"),
     _ratios),
    (r"after(?:_\w+)?|afterwards", _after),
    (
        (r"(?P<what>mean|average|time_average|avg|rms)_(?P<state>{state})"
        r"|(?P<state2>{state})_(?P<what2>mean|average|avg|rms)"),
        lambda o, g: o.either(
            *(Along(g["state"], "rms" if g["what"] == "rms" else "mean", over) for over in _SPANS)
        ),
    ),
    (rf"(?:{_WIDTH})_(?P<state>{{state}})|(?P<state2>{{state}})_(?:{_WIDTH})",
     lambda o, g: o.either(*(Along(g["state"], "range", over) for over in _SPANS))),
    (rf"(?:{_CYCLE}|steady)_(?:(?P<state>{{state}})_(?P<what>max|min)|(?P<what2>max|min)_(?P<state2>{{state}}))",
     lambda o, g: o.one(Along(g["state"], g["what"], "period"))),
    ((r"(?:limit_cycle_|cycle_|orbit_|switching_|hunting_|self_oscillation_)?(?P<angular>angular_)?frequency"
     r"|(?:limit_cycle_|cycle_|orbit_)(?P<angular2>omega)|(?P<angular3>omega)_(?:limit_)?cycle"),
     _frequency),
    ((r"(?P<what>stick|slip|slide|sliding)_(?:fraction|ratio|share)"
     r"|fraction_of_time_(?P<what2>stick|slid|slipp)ing"),
     lambda o, g: [o.other(*(Share(slides=g["what"][:4] != "slip", over=over) for over in _SPANS))]),
    (r"duty_?(?:cycle|ratio)?|on_(?:fraction|ratio)",
     lambda o, _: [o.other(*(Share(mode, over=over) for over in _SPANS)) for mode in "+-"]),
    ((r"(?:time_in_|total_)(?P<what>stick|sliding|slip)(?:ping|ing)?(?:_time)?"
     r"|(?P<what2>stick|sliding|slip)_time_total"),
     lambda o, g: o.one(Share(slides=g["what"] != "slip", take="time"))),
    (r"(?P<what>stick|slide|sliding|slip)_(?:durations|lengths|intervals)", _durations),
    (r"dwell_times?", lambda o, _: o.one(Segments("length", first=o.size))),
    (r"(?P<what>on|off|heating|cooling|up|down|rise|fall)_(?:time|duration)", _phase_time),
    (r"poincare_point|fixed_point|section_point|return_point", _section),
)  # fmt: skip
