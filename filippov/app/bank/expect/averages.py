"""Numbers made of a whole motion or period: averages, ranges, frequencies, shares of time, phases."""

from __future__ import annotations

import itertools
import re
from typing import Any

import numpy as np

from filippov.app.bank.expect.cycle import period_of, phases
from filippov.app.bank.expect.state import turns
from filippov.app.bank.motion import Cycle, slides
from filippov.app.bank.outcome import Ask, Either, reads
from filippov.app.bank.reason import MissingError, NotUnderstoodError
from filippov.solving.solution import Solution

_NODES, _GAUSS = np.polynomial.legendre.leggauss(24)


def _cycle(ask: Ask) -> Cycle | None:
    try:
        return ask.motion.cycle
    except MissingError:
        return None


def _spans(ask: Ask) -> list[tuple[Solution, float, float]]:
    """What an average may be over: a period where there is one, and the span of the case."""
    cycle, run = _cycle(ask), ask.motion.main
    whole = [(run, run.problem.t_span[0], run.t_end)]
    return whole if cycle is None else [(cycle.run, *cycle.span), *whole]


def _mean(run: Solution, low: float, high: float, k: int, power: int) -> float:
    """Mean of a power of a state, by Gauss's rule on each step."""
    assert run.sol is not None
    inner = np.asarray(run.t)
    knots = np.unique(np.concatenate([[low], inner[(inner > low) & (inner < high)], [high]]))
    total = 0.0
    for a, b in itertools.pairwise(knots):
        values = run.sol(0.5 * (a + b) + 0.5 * (b - a) * _NODES)[k]
        total += 0.5 * (b - a) * float(_GAUSS @ values**power)
    return total / (high - low)


@reads(
    r"(?P<what>mean|average|time_average|avg|rms)_(?P<state>{state})|(?P<state2>{state})_(?P<what2>mean|average|avg|rms)",
    "mean or root mean square of a state over a period, else over the span",
)
def _average(ask: Ask, match: re.Match[str]) -> Any:
    k = ask.states.index(match["state"] or match["state2"])
    if (match["what"] or match["what2"]) == "rms":
        return Either([np.sqrt(_mean(*place, k, 2)) for place in _spans(ask)])
    return Either([_mean(*place, k, 1) for place in _spans(ask)])


def _values(ask: Ask, run: Solution, low: float, high: float, k: int) -> Any:
    assert run.sol is not None
    state = ask.states[k]
    times = [t for t, _ in turns(ask, state, run) if low <= t <= high]
    return run.sol(np.unique(np.concatenate([ask.motion.times(run, low, high), times])))[k]


@reads(
    r"(?:peak_to_peak|range|ripple|pp|swing)_(?P<state>{state})|(?P<state2>{state})_(?:peak_to_peak|range|ripple|pp|swing)",
    "largest less least value of a state over a period, else over the span",
)
def _range(ask: Ask, match: re.Match[str]) -> Any:
    k = ask.states.index(match["state"] or match["state2"])
    return Either([np.ptp(_values(ask, *place, k)) for place in _spans(ask)])


@reads(
    r"(?:limit_cycle|cycle|orbit|steady)_(?P<state>{state})_(?P<what>max|min|amplitude)"
    r"|(?:limit_cycle|cycle|orbit|steady)_(?P<what2>max|min)_(?P<state2>{state})",
    "largest or least value of a state over a period, or half their distance",
)
def _cycle_extreme(ask: Ask, match: re.Match[str]) -> Any:
    cycle = ask.motion.cycle
    values = _values(ask, cycle.run, *cycle.span, ask.states.index(match["state"] or match["state2"]))
    what = match["what"] or match["what2"]
    if what == "amplitude":
        return Either([np.ptp(values) / 2, np.max(np.abs(values)), np.ptp(values)])
    return np.max(values) if what == "max" else np.min(values)


@reads(
    r"(?:limit_cycle_|cycle_|orbit_|switching_|hunting_|self_oscillation_)?(?P<angular>angular_)?frequency"
    r"|(?:limit_cycle_|cycle_|orbit_)(?P<omega>omega)|(?P<omega2>omega)_(?:limit_)?cycle",
    "1/T of the periodic motion, or 2 pi/T",
)
def _frequency(ask: Ask, match: re.Match[str]) -> Any:
    period = period_of(ask)
    if match["angular"] or match["omega"] or match["omega2"]:
        return 2 * np.pi / period
    return Either([1 / period, 2 * np.pi / period])


# -- shares of time ------------------------------------------------------------------------------------


@reads(
    r"(?P<what>stick|slip|slide|sliding)_(?:fraction|ratio|share)|fraction_of_time_(?P<what2>stick|slid|slipp)ing",
    "part of a period, else of the span, spent sliding (sticking) or not",
)
def _fraction(ask: Ask, match: re.Match[str]) -> Any:
    what = (match["what"] or match["what2"])[:4]
    out = []
    for run, low, high in _spans(ask):
        rests = sum(length for length, mode in _inside(run, low, high) if slides(mode)) / (high - low)
        out.append(1 - rests if what == "slip" else rests)
    return Either(out[:1])


@reads(
    r"duty_?(?:cycle|ratio)?|on_(?:fraction|ratio)",
    "part of a period, else of the span, with the first h > 0, or with h < 0",
)
def _duty(ask: Ask, _match: re.Match[str]) -> Any:
    run, low, high = _spans(ask)[0]
    part = sum(length for length, mode in _inside(run, low, high) if mode[0] > 0) / (high - low)
    return Either([part, 1 - part])


@reads(
    r"(?:time_in_|total_)(?P<what>stick|sliding|slip)(?:ping|ing)?(?:_time)?|(?P<what2>stick|sliding|slip)_time_total",
    "total time spent sliding (sticking) or not over the span",
)
def _total(ask: Ask, match: re.Match[str]) -> Any:
    run = ask.motion.main
    wants = (match["what"] or match["what2"]) != "slip"
    return sum(s.dwell for s in run.segments if slides(s.mode) == wants)


def _inside(run: Solution, low: float, high: float) -> list[tuple[float, tuple[int, ...]]]:
    parts = [(min(s.t1, high) - max(s.t0, low), s.mode) for s in run.segments]
    return [(length, mode) for length, mode in parts if length > 0]


@reads(
    r"(?P<what>stick|slide|sliding|slip)_(?:durations|lengths|intervals)",
    "lengths of the first sliding (stick) or slip phases: a list; or their [begin, end]",
)
def _durations(ask: Ask, match: re.Match[str]) -> Any:
    wanted = np.array(ask.wanted())
    found = [p for p in phases(ask.motion.main.segments) if p[0] == (match["what"] != "slip")]
    rows = [[a, b] for _, a, b in found] if wanted.ndim == 2 else [b - a for _, a, b in found]
    return rows[: len(wanted)]


@reads(r"dwell_times?", "lengths of the first stretches of one mode: a list")
def _dwells(ask: Ask, _match: re.Match[str]) -> Any:
    return [s.dwell for s in ask.motion.main.segments][: np.atleast_1d(ask.wanted()).size]


@reads(
    r"(?P<what>on|off|heating|cooling|up|down|rise|fall)_(?:time|duration)",
    "length of a stretch between the two switchings of a period",
)
def _phase_time(ask: Ask, _match: re.Match[str]) -> Any:
    cycle = ask.motion.cycle
    times = [cycle.events[0].t, *(e.t for e in cycle.events[1:]), cycle.events[0].t + cycle.period]
    if len(cycle.events) != 2:
        raise NotUnderstoodError(f"the period has {len(cycle.events)} switchings, not two")
    return Either(np.diff(times))
