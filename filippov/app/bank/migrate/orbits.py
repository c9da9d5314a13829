"""Names of periodic motions, averages over them, and accumulations of events."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from filippov.app.bank.measures.accumulations import Accumulation, Ratios
from filippov.app.bank.measures.along import Along, Share
from filippov.app.bank.measures.events import EventCount, OneEvent, SomeEvents
from filippov.app.bank.measures.measure import Formula, Measure
from filippov.app.bank.measures.orbits import HarmonicBalance, PeriodicOrbit
from filippov.app.bank.measures.phases import Dwells, Phases
from filippov.app.bank.measures.turns import LevelTimes
from filippov.app.bank.migrate.rule import Old, Reading, rule
from filippov.app.bank.migrate.states import level, velocity
from filippov.app.bank.reason import NotUnderstoodError

_FEW = 8
_SPANS: tuple[Any, ...] = ("period", "span")


def _guess(old: Old) -> Any:
    """The period that another expectation gives, as a guess of it."""
    given = {entry.name: entry.given.get("value") for entry in old.case.expected}
    found = given.get("period", given.get("limit_cycle_period"))
    return None if found is None else old.number(found)


def _orbit(old: Old, take: Any, **options: Any) -> PeriodicOrbit:
    return PeriodicOrbit(take, period=_guess(old), **options)


def _of_period(old: Old, text: str) -> list[Reading]:
    """A formula in the period T: of the motion, or, without surfaces, between risings through a level."""
    orbit = Formula(text, {"T": _orbit(old, "period")}) if text != "T" else _orbit(old, "period")
    for entry in old.case.expected if not old.motion.built.declared else ():
        match = re.fullmatch(r"(?:first_)?times?_([^=]+?)=([^=]+?)(?:(?:_up|_down)*)", entry.name)
        if match is not None:
            through = level(old, match[1], match[2])
            where: dict[str, Measure] = {
                name: LevelTimes(through, ("+",), number=k) for name, k in (("a", -2), ("b", -1))
            }
            return [old.other(Formula(re.sub(r"\bT\b", "(b-a)", text), where), orbit)]
    return old.one(orbit)


@rule(r"(?:limit_cycle_|orbit_|cycle_|hunting_|steady_)?(?P<half>half_)?period|T_cycle")
def _period(old: Old, match: re.Match[str]) -> list[Reading]:
    return _of_period(old, "T/2" if match["half"] else "T")


@rule(r"(?P<first>first_)?(?P<what>stick|slip|sliding|slide)_(?:duration|time|interval_length)")
def _duration(old: Old, match: re.Match[str]) -> list[Reading]:
    slides = match["what"] != "slip"
    if match["first"]:
        return old.one(Phases(slides, number=1))
    return [
        old.other(Phases(slides, "period", number=k), Phases(slides, whole=True, number=k)) for k in (-1, 1)
    ]


@rule(r"stick_positions?|stick_(?P<state>{state})|rest_positions?")
def _stick_position(old: Old, match: re.Match[str]) -> list[Reading]:
    take, size = match["state"] or old.states[0], old.size
    if isinstance(old.value, list) and size > 1:
        many = [SomeEvents("slide", over=over, last=size, take=take) for over in _SPANS]
        return [old.other(*many, order="any")]
    return [old.other(*(OneEvent("slide", over=o, number=k, take=take) for o in _SPANS)) for k in (-1, -2)]


@rule(r"cycle_(?:crossings?|events?|switches)_(?P<state>{state})")
def _crossings(old: Old, match: re.Match[str]) -> list[Reading]:
    value = old.value if isinstance(old.value, list) else [old.value]
    old.wanted()
    return old.one(SomeEvents("any", over="period", take=match["state"]), value=value, order="any")


@rule(r"(?P<what>slides|sticks|crossings|events|stops|impacts)_per_(?P<half>half_)?period")
def _per_period(old: Old, match: re.Match[str]) -> list[Reading]:
    kinds: dict[str, Any] = {"crossings": "cross", "impacts": "reset", "events": "any"}
    count = EventCount(kinds.get(match["what"], "slide"), over="period")
    return old.one(Formula("n/2", {"n": count}) if match["half"] else count)


@rule(
    r"(?:limit_cycle_|cycle_|hunting_|steady_)?amplitude(?:_(?P<state>{state}))?|(?:max_|peak_)amplitude"
    r"|(?:limit_cycle|cycle|orbit|steady)_(?P<state2>{state})_amplitude"
)
def _amplitude(old: Old, match: re.Match[str]) -> list[Reading]:
    name = match["state"] or match["state2"] or old.states[0]
    whole = Along(name, "range", "period")
    return old.either(Formula("r/2", {"r": whole}), Along(name, "max_abs", "period"), whole)


@rule(
    r"(?P<sign>signed_)?(?P<half>half_map_|half_period_|half_)?(?:floquet_)?multiplier(?P<many>s)?(?:_moduli)?"
)
def _multipliers(old: Old, match: re.Match[str]) -> list[Reading]:
    half = bool(match["half"])
    if old.size > 1 or match["many"]:
        values = sorted(np.atleast_1d(old.wanted()).tolist(), key=abs)
        kinds = [(take, trivial) for take in ("multipliers", "moduli") for trivial in (True, False)]
        return old.either(*(_orbit(old, take, half=half, trivial=trivial) for take, trivial in kinds), value=values)
    takes = ("multiplier",) if match["sign"] else ("multiplier", "modulus")
    return old.either(*(_orbit(old, take, half=half) for take in takes))


@rule(r"(?:limit_cycle|cycle|orbit|periodic_motion)_(?:is_)?(?:stable|stability)")
def _stability(old: Old, _: re.Match[str]) -> list[Reading]:
    word = old.text.strip().casefold()
    if word not in ("true", "stable", "yes", "false", "unstable", "no"):
        raise NotUnderstoodError(f"{word!r:.40} is no verdict")
    said = "stable" if word in ("true", "stable", "yes") else "unstable"
    return old.one(_orbit(old, "stability"), text=said)


@rule(r"floquet_exponent|largest_exponent")
def _exponent(old: Old, _: re.Match[str]) -> list[Reading]:
    return old.one(_orbit(old, "exponent"))


@rule(r"(?:describing_function|harmonic_balance)_(?P<what>period|frequency|amplitude)")
def _harmonic(old: Old, match: re.Match[str]) -> list[Reading]:
    take: Any = match["what"]
    return old.either(*(HarmonicBalance(take, k) for k in (1, 2, 3)))


# -- accumulations -------------------------------------------------------------------------------------


@rule(r"t_converge|t_converged|convergence_time|zeno_time|t_zeno|t_limit|t_accumulation|reaching_time")
def _limit(old: Old, _: re.Match[str]) -> list[Reading]:
    return [old.other(Accumulation(), OneEvent("slide", number=-1))]


@rule(
    r"(?P<gaps>ratio_of_intervals|interval_ratio|contraction_of_intervals)|(?P<speeds>(?:velocity|speed)_ratio\w*)"
    r"|contraction(?:_per_\w+|_ratio)?|contraction_factor"
)
def _ratios(old: Old, match: re.Match[str]) -> list[Reading]:
    between = "intervals" if match["gaps"] else velocity(old) if match["speeds"] else "distances"
    surfaces: list[int | None] = [*([] if match["speeds"] else [None]), *range(len(old.motion.built.declared))]
    return old.either(*(Ratios(between, surface) for surface in surfaces), each=True)


@rule(r"after(?:_\w+)?|afterwards")
def _after(old: Old, _: re.Match[str]) -> list[Reading]:
    stays = r"(?:stays?|rests?|remains?|stops?) (?:at|in) "
    match = re.search(stays + r"\(([^()]*)\)", old.text)
    if match is not None:
        point = [old.number(piece) for piece in match[1].split(",")]
    elif re.search(stays + r"(?:the )?(?:origin|rest|zero)|origin is an equilibrium", old.text):
        point = [0.0] * len(old.states)
    else:
        raise NotUnderstoodError("the text names no point to stay at")
    # A text has no digits of its own: what the accumulation's limit is good for.
    return old.one(Accumulation("state_after"), value=point, atol=max(old.tol, 1e-8))


# -- averages ------------------------------------------------------------------------------------------


@rule(
    r"(?P<what>mean|average|time_average|avg|rms)_(?P<state>{state})|(?P<state2>{state})_(?P<what2>mean|average|avg|rms)"
)
def _average(old: Old, match: re.Match[str]) -> list[Reading]:
    take: Any = "rms" if "rms" in (match["what"], match["what2"]) else "mean"
    return old.either(*(Along(match["state"] or match["state2"], take, over) for over in _SPANS))


_WIDTH = "peak_to_peak|range|ripple|pp|swing"


@rule(rf"(?:{_WIDTH})_(?P<state>{{state}})|(?P<state2>{{state}})_(?:{_WIDTH})")
def _range(old: Old, match: re.Match[str]) -> list[Reading]:
    return old.either(*(Along(match["state"] or match["state2"], "range", over) for over in _SPANS))


@rule(
    r"(?:limit_cycle|cycle|orbit|steady)_(?:(?P<state>{state})_(?P<what>max|min)|(?P<what2>max|min)_(?P<state2>{state}))"
)
def _cycle_extreme(old: Old, match: re.Match[str]) -> list[Reading]:
    take: Any = match["what"] or match["what2"]
    return old.one(Along(match["state"] or match["state2"], take, "period"))


@rule(
    r"(?:limit_cycle_|cycle_|orbit_|switching_|hunting_|self_oscillation_)?(?P<angular>angular_)?frequency"
    r"|(?:limit_cycle_|cycle_|orbit_)(?P<omega>omega)|(?P<omega2>omega)_(?:limit_)?cycle"
)
def _frequency(old: Old, match: re.Match[str]) -> list[Reading]:
    angular = _of_period(old, "2*pi/T")
    if match["angular"] or match["omega"] or match["omega2"]:
        return angular
    return [*_of_period(old, "1/T"), *angular]


@rule(r"(?P<what>stick|slip|slide|sliding)_(?:fraction|ratio|share)|fraction_of_time_(?P<what2>stick|slid|slipp)ing")
def _fraction(old: Old, match: re.Match[str]) -> list[Reading]:
    slides = not (match["what"] or match["what2"]).startswith("slip")
    return [old.other(*(Share(slides=slides, over=over) for over in _SPANS))]


@rule(r"duty_?(?:cycle|ratio)?|on_(?:fraction|ratio)")
def _duty(old: Old, _: re.Match[str]) -> list[Reading]:
    return [old.other(*(Share(mode, over=over) for over in _SPANS)) for mode in "+-"]


@rule(r"(?:time_in_|total_)(?P<what>stick|sliding|slip)(?:ping|ing)?(?:_time)?|(?P<what2>stick|sliding|slip)_time_total")
def _total(old: Old, match: re.Match[str]) -> list[Reading]:
    return old.one(Share(slides=(match["what"] or match["what2"]) != "slip", take="time"))


@rule(r"(?P<what>stick|slide|sliding|slip)_(?:durations|lengths|intervals)")
def _durations(old: Old, match: re.Match[str]) -> list[Reading]:
    wanted: Any = np.atleast_1d(old.wanted())
    take: Any = "interval" if wanted.ndim == 2 else "length"
    return old.one(Phases(match["what"] != "slip", first=len(wanted), take=take))


@rule(r"dwell_times?")
def _dwells(old: Old, _: re.Match[str]) -> list[Reading]:
    return old.one(Dwells(first=old.size))


@rule(r"(?P<what>on|off|heating|cooling|up|down|rise|fall)_(?:time|duration)")
def _phase_time(old: Old, _: re.Match[str]) -> list[Reading]:
    ends: dict[str, Measure] = {n: OneEvent("any", over="period", number=k) for n, k in (("a", 1), ("b", 2))}
    count = old.e(EventCount("any", over="period"), value=2, atol=0)
    whole: dict[str, Measure] = {**ends, "T": PeriodicOrbit("period", "settled")}
    return [
        Reading((old.e(Formula("b-a", ends)), count)), Reading((old.e(Formula("T-(b-a)", whole)), count)),
    ]  # fmt: skip


@rule(r"poincare_point|fixed_point|section_point|return_point")
def _section(old: Old, _: re.Match[str]) -> list[Reading]:
    take = "state" if old.size > 1 else old.states[0]
    return old.either(*(OneEvent(over="period", number=k + 1, take=take) for k in range(_FEW)))
