"""What the periodic motion is expected to be: its period, its stick and slip, its multipliers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from filippov.analysis.orbits.orbit import Orbit
from filippov.analysis.sensitivity.saltation import NotDifferentiableError, flow_derivative
from filippov.analysis.steady.forcing import depends_on_time
from filippov.app.bank.expect.state import level_times
from filippov.app.bank.motion import Cycle, slides
from filippov.app.bank.outcome import Ask, Either, Outcome, reads
from filippov.app.bank.reason import MissingError, NotUnderstoodError
from filippov.base.status import EventKind
from filippov.solving.solution import Segment
from filippov.solving.state.events import Event


@reads(
    r"(?:limit_cycle_|orbit_|cycle_|hunting_|steady_)?(?P<half>half_)?period|T_cycle",
    "period of the motion that the run settles on",
)
def _period(ask: Ask, match: re.Match[str]) -> Any:
    return (0.5 if match["half"] else 1.0) * period_of(ask)


def period_of(ask: Ask) -> float:
    """The period of the motion that the run settles on, else of the orbit near its start."""
    try:
        return ask.motion.cycle.period if ask.motion.events() else float(_by_level(ask))
    except MissingError:
        return orbit_of(ask).period


def orbit_of(ask: Ask) -> Orbit:
    """The periodic orbit near the start; where the case gives a period, that is the guess of it."""
    entry = ask.case.expectation("period") or ask.case.expectation("limit_cycle_period")
    return ask.motion.orbit(None if entry is None else ask.number(entry.value))


def _by_level(ask: Ask) -> Any:
    """Time between the last two risings through a level that another expectation names."""
    for entry in ask.case.expected:
        match = re.fullmatch(r"(?:first_)?times?_([^=]+?)=([^=]+?)(?:(?:_up|_down)*)", entry.name)
        if match is not None:
            rising = [t for t, direction in level_times(ask, match[1], match[2]) if direction > 0]
            if len(rising) > 1:
                return np.diff(rising)[-1]
    raise MissingError("the run has no events from which a period could be told")


def _stretches(cycle: Cycle) -> list[Segment]:
    low, high = cycle.span
    tiny = 1e-9 * cycle.period
    return [s for s in cycle.run.segments if s.t0 >= low - tiny and s.t1 <= high + tiny]


@reads(r"(?P<first>first_)?(?P<what>stick|slip|sliding|slide)_(?:duration|time|interval_length)",
       "length of a stick (sliding) or slip phase of the periodic motion, else of the first one")  # fmt: skip
def _duration(ask: Ask, match: re.Match[str]) -> Any:
    wants_slide = match["what"] != "slip"
    if match["first"]:
        stretches: Sequence[Segment] = ask.motion.main.segments
    else:
        try:
            stretches = _stretches(ask.motion.cycle)
        except MissingError:
            stretches = ask.motion.main.segments[1:-1] or ask.motion.main.segments
    lengths = [high - low for kind, low, high in phases(stretches) if kind == wants_slide]
    if not lengths:
        raise MissingError("the motion has no such phase")
    return lengths[0] if match["first"] else Either([lengths[-1], lengths[0]])


def phases(stretches: Sequence[Segment]) -> list[tuple[bool, float, float]]:
    """Whether it slides, begin and end; a slip through h = 0 is one phase, whatever modes it passes."""
    out: list[tuple[bool, float, float]] = []
    for stretch in stretches:
        kind, low = slides(stretch.mode), stretch.t0
        if out and out[-1][0] == kind:
            low = out.pop()[1]
        out.append((kind, low, stretch.t1))
    return out


@reads(
    r"stick_positions?|stick_(?P<state>{state})|rest_positions?",
    "where the first (or named) state sticks in the periodic motion, of either sign",
)
def _stick_position(ask: Ask, match: re.Match[str]) -> Any:
    k = ask.states.index(match["state"]) if match["state"] else 0
    found = [e.x[k] for e in _cycle_or_all(ask) if e.kind is EventKind.ENTRY]
    if not found:
        raise MissingError("the motion does not stick")
    wanted = np.atleast_1d(ask.wanted())
    if wanted.size > 1:
        return ask.compare(sorted(found[-wanted.size :]), np.sort(wanted))
    return Either(found[-2:])


def _cycle_or_all(ask: Ask) -> Sequence[Event]:
    try:
        return ask.motion.cycle.events
    except MissingError:
        return ask.motion.events()


@reads(
    r"cycle_(?:crossings?|events?|switches)_(?P<state>{state})",
    "values of a state at the events of a period, in any order",
)
def _crossings(ask: Ask, match: re.Match[str]) -> Any:
    k = ask.states.index(match["state"])
    wanted = np.sort(np.atleast_1d(ask.wanted()))
    return ask.compare(sorted(e.x[k] for e in ask.motion.cycle.events), wanted)


@reads(
    r"(?P<what>slides|sticks|crossings|events|stops|impacts)_per_(?P<half>half_)?period",
    "number of such events in a period or half of it",
)
def _per_period(ask: Ask, match: re.Match[str]) -> Any:
    kinds = {"slides": EventKind.ENTRY, "sticks": EventKind.ENTRY, "stops": EventKind.ENTRY,
             "crossings": EventKind.CROSSING, "impacts": EventKind.RESET}  # fmt: skip
    kind = kinds.get(match["what"])
    count = sum(kind is None or e.kind is kind for e in ask.motion.cycle.events)
    return count / (2.0 if match["half"] else 1.0)


@reads(
    r"(?:limit_cycle_|cycle_|hunting_|steady_)?amplitude(?:_(?P<state>{state}))?|(?:max_|peak_)amplitude",
    "half the range of a state (the first) over a period, or its largest size",
)
def _amplitude(ask: Ask, match: re.Match[str]) -> Any:
    k = ask.states.index(match["state"]) if match["state"] else 0
    cycle = ask.motion.cycle
    low, high = cycle.span
    assert cycle.run.sol is not None
    times = np.unique(np.concatenate([ask.motion.times(cycle.run, low, high), _turns(ask, cycle, k)]))
    values = cycle.run.sol(times)[k]
    return Either([np.ptp(values) / 2, np.max(np.abs(values)), np.ptp(values)])


def _turns(ask: Ask, cycle: Cycle, k: int) -> Any:
    rows = {row[k] for row in ask.motion.built.fields.values()}
    low, high = cycle.span
    found = [t for t, _ in ask.motion.zeros(cycle.run, rows.pop())] if len(rows) == 1 else []
    return np.array([t for t in found if low <= t <= high])


@reads(r"(?P<sign>signed_)?(?P<half>half_map_|half_period_|half_)?(?:floquet_)?multiplier(?P<many>s)?(?:_moduli)?|floquet_multiplier",
       "multipliers of the periodic motion; one: the largest besides the 1 of an autonomous system; half: of "
       "the half map under x -> -x")  # fmt: skip
def _multipliers(ask: Ask, match: re.Match[str]) -> Any:
    wanted = np.atleast_1d(ask.wanted())
    values, rest = multipliers_of(ask, bool(match["half"]))
    if wanted.size > 1 or match["many"]:
        rows = [row for row in (values, rest) if len(row) == wanted.size]
        target = sorted(wanted.tolist(), key=abs)
        readings: list[Any] = [[v.real for v in sorted(row, key=abs)] for row in rows]
        readings += [[abs(v) for v in sorted(row, key=abs)] for row in rows]
        return ask.compare(Either(readings), target)
    if not rest:
        raise MissingError("the motion has no multiplier besides 1")
    largest = max(rest, key=abs)
    readings = [largest.real if abs(largest.imag) < 1e-12 * (1 + abs(largest)) else abs(largest)]
    if not match["sign"]:
        readings.append(abs(largest))
    return Either(readings)


def multipliers_of(ask: Ask, half: bool = False) -> tuple[list[complex], list[complex]]:
    """Multipliers of the motion that the run settles on, else of the orbit near its start: all of them, and
    without the 1 of an autonomous system."""
    try:
        values = _eigenvalues(ask, ask.motion.cycle, half)
    except MissingError:
        orbit = orbit_of(ask)
        found = orbit.half_multipliers if half else orbit.multipliers
        if found is None:
            raise NotUnderstoodError("the periodic motion is not symmetric under x -> -x") from None
        rest = [complex(v) for v in found]
        return ([*rest, 1.0 + 0j] if orbit.trivial is not None else rest), rest
    rest = values.copy()
    if rest and not depends_on_time(ask.motion.built.system):
        rest.remove(min(rest, key=lambda v: abs(v - 1)))
    return values, rest


@reads(
    r"(?:limit_cycle|cycle|orbit|periodic_motion)_(?:is_)?(?:stable|stability)",
    "true or false, stable or unstable: whether all multipliers of the periodic motion are inside the circle",
)
def _stability(ask: Ask, _match: re.Match[str]) -> Outcome:
    word = str(ask.entry.value).strip().casefold()
    said = {"true": True, "stable": True, "yes": True, "false": False, "unstable": False, "no": False}
    if word not in said:
        raise NotUnderstoodError(f"{word!r:.40} is no verdict")
    largest = max((abs(v) for v in multipliers_of(ask)[1]), default=0.0)
    right = (largest < 1) == said[word]
    return Outcome(float(not right), 0.0, "" if right else f"the largest multiplier is {largest:.9g}")


@reads(r"floquet_exponent|largest_exponent", "logarithm of the largest multiplier over the period")
def _exponent(ask: Ask, _match: re.Match[str]) -> Any:
    rest = multipliers_of(ask)[1]
    if not rest:
        raise MissingError("the motion has no multiplier besides 1")
    with np.errstate(divide="ignore"):
        return float(np.log(max(abs(v) for v in rest))) / period_of(ask)


def _eigenvalues(ask: Ask, cycle: Cycle, half: bool) -> list[complex]:
    """Of the derivative of the flow over the period, from the middle of its longest stretch."""
    free = [s for s in _stretches(cycle) if not slides(s.mode)] or _stretches(cycle)
    if not free:
        raise MissingError("the cycle has no stretch to start from")
    longest = max(free, key=lambda s: s.dwell)
    t0 = 0.5 * (longest.t0 + longest.t1)
    assert cycle.run.sol is not None
    x0 = np.asarray(cycle.run.sol(t0))
    length = cycle.period / (2 if half else 1)
    run = ask.motion.solve(x0=tuple(float(v) for v in x0), t0=t0, t_end=t0 + length)
    if not run.status.ok:
        raise MissingError(run.message)
    if half and np.max(np.abs(run.x_end + x0)) > 1e-6 * (1 + np.max(np.abs(x0))):
        raise NotUnderstoodError("the periodic motion is not symmetric under x -> -x")
    try:
        matrix = flow_derivative(run)
    except NotDifferentiableError as error:
        raise MissingError(str(error)) from None
    return [complex(v) for v in np.linalg.eigvals(-matrix if half else matrix)]
