"""What the state is expected to be: at a time, at the end, over an interval, at an event, where it turns."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from sympy import Symbol

from filippov.app.bank.expect.events import WORDS, kind_word, sequence, switches
from filippov.app.bank.outcome import Ask, Either, Outcome, reads
from filippov.app.bank.reason import MissingError, NotUnderstoodError
from filippov.base.status import EventKind
from filippov.solving.solution import Solution
from filippov.solving.state.events import Event

_KINDS = "enter|entry|exit|leave|cross|crossing|slide|stick|switch|event|impact|reset|release"


@reads(
    r"final_state|final|final_value|x_final|x_end|state_final|end_state",
    "the state at t, or at the end of the span",
)
def _final(ask: Ask, _match: re.Match[str]) -> Outcome:
    end = ask.number(ask.entry.fields["t"]) if "t" in ask.entry.fields else ask.motion.built.t_span[1]
    wanted = np.atleast_1d(ask.wanted())
    got = ask.motion.state(end, side="+")
    if wanted.size == 1 < got.size:
        got = got[:1]
    outcome = ask.compare(got, wanted)
    sliding = ask.entry.fields.get("sliding_on")
    if outcome.passed and isinstance(sliding, list):
        run = ask.motion.covering(end)
        mode = run.end_mode if end == run.t_end else run.mode_at(end, "+")
        found = [i for i in range(len(ask.motion.built.declared)) if mode[i] == 0]
        names = ask.motion.built.declared
        if sorted(names.index(s) if s in names else s for s in sliding) != found:
            return Outcome(1.0, 0.0, f"slides on {found} at t = {end:.9g}, expected {sliding}")
    return outcome


@reads(r"final_(?P<state>{state})|(?P<state2>{state})_(?:final|end)", "one state at the end of the span")
def _final_of(ask: Ask, match: re.Match[str]) -> Any:
    return ask.motion.state(ask.motion.built.t_span[1], "+")[
        ask.states.index(match["state"] or match["state2"])
    ]


@reads(r"(?P<state>{state}|state|[A-Za-z]\w*?)_at_\[(?P<times>[^\]]*)\]", "a state at several times")
def _at_times(ask: Ask, match: re.Match[str]) -> Any:
    return [_at(ask, match["state"], ask.number(text)) for text in match["times"].split(",")]


@reads(
    r"(?P<state>{state}|state|x|y)(?:_at_(?:t\s*=?\s*)?|\((?:t\s*=\s*)?)(?P<time>[^()=<>\[\]]*(?:\([^()]*\)[^()]*)*)\)?",
    "x_at_3, x(3), y(pi/2): that state, or all states, at a time",
)
def _at_time(ask: Ask, match: re.Match[str]) -> Any:
    text = match["time"].strip()
    if text in ("", "t"):
        raise NotUnderstoodError("it is no time")
    return _at(ask, match["state"], _moment(ask, text))


def _at(ask: Ask, name: str, t: float) -> Any:
    x = ask.motion.state(t)
    many = isinstance(ask.entry.value, list) and "_at_[" not in ask.entry.name
    if many and len(ask.entry.value) == len(x) and (len(x) > 1 or name not in ask.states):
        return x
    if name in ask.states:
        return x[ask.states.index(name)]
    return x if many else x[0]


def _moment(ask: Ask, text: str) -> float:
    """A time: a number, t0 or T, t_enter or t_exit."""
    text = text.strip()
    if text in ("t_enter", "t_entry", "t_e", "te", "t_exit", "t_cross"):
        kind = {"t_exit": "exit", "t_cross": "cross"}.get(text, "slide")
        found = [e.t for e in ask.motion.events() if WORDS[e.kind] == kind]
        if not found:
            raise MissingError(f"the run has no {kind}")
        return float(found[0])
    if text in ("end", "T", "t_end", "tf"):
        return ask.motion.built.t_span[1]
    return ask.number(text)


@reads(
    r"(?P<state>{state})_for_(?P<low>.+?)<=?t<=?(?P<high>.+)",
    "x_for_a<t<b: the state keeps this value throughout the interval",
)
def _for(ask: Ask, match: re.Match[str]) -> Any:
    low, high = (_moment(ask, match[key]) for key in ("low", "high"))
    run = ask.motion.covering(high)
    assert run.sol is not None
    values = run.sol(np.clip(ask.motion.times(run, low, high), low, high))[ask.states.index(match["state"])]
    wanted = float(ask.wanted())
    return values[int(np.argmax(np.abs(values - wanted)))]


@reads(r"(?P<what>max|min|max_abs|sup)_\|?(?P<state>{state})\|?|\|?(?P<state2>{state})\|?_(?P<what2>max|min)",
       "largest or least value of a state over the span")  # fmt: skip
def _extreme(ask: Ask, match: re.Match[str]) -> Any:
    state = match["state"] or match["state2"]
    what = match["what"] or match["what2"]
    run = ask.motion.main
    assert run.sol is not None
    times = np.unique(np.concatenate([ask.motion.times(run), [t for t, _ in turns(ask, state)]]))
    values = run.sol(times)[ask.states.index(state)]
    if what in ("max_abs", "sup") or "|" in ask.entry.name:
        return np.max(np.abs(values))
    return np.max(values) if what == "max" else np.min(values)


# -- at events -----------------------------------------------------------------------------------------


def at_events(ask: Ask, kind: str, first: bool) -> list[Event]:
    """The first event of a kind; or that and the last ones of either direction."""
    base = kind_word(kind)
    events = [e for e in ask.motion.events() if e.kind is not EventKind.GRAZING]
    if base in ("switch", "event"):
        found = [e for e in events if switches(ask, e)] or events
    else:
        found = [e for e in events if WORDS[e.kind] == base]
    if base == "reset" and not found:
        found = [e for e in events if WORDS[e.kind] == "cross"]
    if not found:
        raise MissingError(f"the run has no {base}")
    if first:
        return found[:1]
    settled = _settled(ask, found)
    return [found[0], *settled]


def _settled(ask: Ask, found: list[Event]) -> list[Event]:
    """The last of them of either direction, in the periodic motion where there is one."""
    try:
        cycle = [e for e in ask.motion.cycle.events if e.kind is found[0].kind]
    except MissingError:
        cycle = found
    last = {e.direction: e for e in (cycle or found)}
    return list(last.values())


@reads(
    rf"point_(?P<first>first_)?(?P<kind>{_KINDS})|(?P<first2>first_)?(?P<kind2>{_KINDS})_(?:point|state)",
    "the state at the first (or the settled) event of that kind",
)
def _point(ask: Ask, match: re.Match[str]) -> Any:
    kind = match["kind"] or match["kind2"]
    return Either([e.x for e in at_events(ask, kind, bool(match["first"] or match["first2"]))])


@reads(
    rf"(?P<state>{{state}})_(?P<first>first_)?(?P<kind>{_KINDS})"
    rf"|(?P<first2>first_)?(?:sliding_|stick_|slip_)?(?P<kind2>{_KINDS}|restick|slip_start)_(?P<state2>{{state}})",
    "x_enter, exit_x, restick_x, slip_start_x: one state at the first or the settled event of that kind",
)
def _state_at_event(ask: Ask, match: re.Match[str]) -> Any:
    name = match["state"] or match["state2"]
    kind = {"restick": "slide", "slip_start": "exit"}.get(
        match["kind2"] or "", match["kind"] or match["kind2"]
    )
    events = at_events(ask, kind, bool(match["first"] or match["first2"]))
    return Either([e.x[ask.states.index(name)] for e in events])


@reads(r"(?P<what>[tx]|{state})_(?:stop|rest)|(?:stop|rest)_(?P<what2>position|time|{state})",
       "when the motion comes to rest for good, and where")  # fmt: skip
def _stop(ask: Ask, match: re.Match[str]) -> Any:
    what = match["what"] or match["what2"]
    run = ask.motion.main
    entries = [e for e in ask.motion.events() if e.kind is EventKind.ENTRY]
    velocity, _ = ask.motion.velocity(run)
    if not entries or run.end_mode != entries[-1].after or np.max(np.abs(velocity)) > 1e-9:
        raise MissingError("the motion does not rest at the end of the span")
    if what in ("t", "time"):
        return entries[-1].t
    return run.x_end[ask.states.index(what)] if what in ask.states else run.x_end[0]


# -- where a state turns -------------------------------------------------------------------------------


def turns(ask: Ask, state: str, run: Solution | None = None) -> list[tuple[float, int]]:
    """Times at which a state's derivative vanishes, with the direction in which it does."""
    k = ask.states.index(state)
    run = ask.motion.main if run is None else run
    rows = list(ask.motion.built.fields.values())
    kinds = {row[k] for row in rows}
    if len(kinds) == 1:
        return _merged(ask.motion.zeros(run, next(iter(kinds))))
    assert run.sol is not None
    times = np.unique(np.concatenate([ask.motion.times(run), _stationary(ask, k, run)]))
    values = run.sol(times)[k]
    inner = np.flatnonzero((values[1:-1] - values[:-2]) * (values[2:] - values[1:-1]) <= 0) + 1
    return [(float(times[i]), int(np.sign(values[i + 1] - values[i]))) for i in inner]


def _stationary(ask: Ask, k: int, run: Solution) -> list[float]:
    """Times inside the stretches off the surfaces at which the field of a state vanishes."""
    fields = ask.motion.built.fields
    count = len(next(iter(fields)))
    found = []
    for stretch in run.segments:
        row = fields.get("".join({1: "+", -1: "-"}.get(sign, "0") for sign in stretch.mode[:count]))
        if row is not None and stretch.t1 > stretch.t0:
            found += [t for t, _ in ask.motion.zeros(run, row[k], stretch.t0, stretch.t1)]
    return found


def _merged(found: list[tuple[float, int]]) -> list[tuple[float, int]]:
    """Zeros that stay (sticking) count once."""
    out: list[tuple[float, int]] = []
    for t, direction in found:
        if not out or t - out[-1][0] > 1e-7 * (1 + abs(t)):
            out.append((t, direction))
    return out


def _turn_values(ask: Ask, state: str) -> tuple[list[float], list[float]]:
    run = ask.motion.main
    assert run.sol is not None
    times = [t for t, _ in turns(ask, state)]
    values = [float(run.sol(t)[ask.states.index(state)]) for t in times]
    # The end of a time of rest is no turn.
    keep = [i for i in range(len(times)) if i == 0 or abs(values[i] - values[i - 1]) > 1e-12]
    return [times[i] for i in keep], [values[i] for i in keep]


@reads(r"turning_points?(?:_(?P<state>{state}))?|turn_points", "values of a state (the first) where it turns")
def _turning_points(ask: Ask, match: re.Match[str]) -> Any:
    _, values = _turn_values(ask, match["state"] or ask.states[0])
    return sequence(ask, lambda n: Either([values[:n], values[1 : n + 1]]))


@reads(r"turning_times?(?:_(?P<state>{state}))?|turn_times", "times at which a state (the first) turns")
def _turning_times(ask: Ask, match: re.Match[str]) -> Any:
    times, _ = _turn_values(ask, match["state"] or ask.states[0])
    return sequence(ask, lambda n: Either([times[:n], times[1 : n + 1]]))


@reads(r"first_turn_(?P<what>t|time|{state})", "time or place of the first turn of the first state")
def _first_turn(ask: Ask, match: re.Match[str]) -> Any:
    run = ask.motion.main
    assert run.sol is not None
    start = run.problem.t_span[0]
    found = [t for t, _ in turns(ask, ask.states[0]) if t > start + 1e-12]
    if not found:
        raise MissingError("the first state does not turn")
    name = match["what"]
    return found[0] if name in ("t", "time") else run.sol(found[0])[ask.states.index(name)]


@reads(r"first_(?P<what>max|min)_(?P<state>{state})", "the first local maximum or minimum of a state")
def _first_extreme(ask: Ask, match: re.Match[str]) -> Any:
    run = ask.motion.main
    assert run.sol is not None
    k = ask.states.index(match["state"])
    sign = -1 if match["what"] == "max" else 1
    start = run.problem.t_span[0]
    for t, direction in turns(ask, match["state"]):
        if t > start + 1e-12 and direction == sign:
            return run.sol(t)[k]
    raise MissingError("the run has no such turn")


@reads(
    r"(?:first_)?(?:times?|t)_(?P<left>[^=]+?)=(?P<right>[^=]+?)(?P<way>(?:_up|_down)*)",
    "first_times_v=0.05_up_down: times at which a formula takes a value, rising or falling",
)
def _level(ask: Ask, match: re.Match[str]) -> Any:
    wanted = np.atleast_1d(ask.wanted())
    ways = [{"up": 1, "down": -1}[w] for w in match["way"].split("_") if w]
    found = level_times(ask, match["left"], match["right"])
    if not ways:
        return [t for t, _ in found][: len(wanted)]
    out, place = [], 0
    for way in ways:
        later = [(t, k) for k, (t, d) in enumerate(found) if k >= place and d == way]
        if not later:
            raise MissingError("the run does not reach this value so often")
        out.append(later[0][0])
        place = later[0][1] + 1
    return out


def level_times(ask: Ask, left: str, right: str) -> list[tuple[float, int]]:
    """Times at which left = right, with the direction."""
    from filippov.app.bank.notation import formula
    from filippov.base.errors import ModelError

    try:
        expression = formula(left, ask.motion.built.names) - formula(right, ask.motion.built.names)
    except ModelError as error:
        raise NotUnderstoodError(str(error)) from None
    return ask.motion.zeros(ask.motion.main, expression)


# -- velocities at impacts -----------------------------------------------------------------------------


def velocity_index(ask: Ask) -> int:
    """The state that is the derivative of the first one, else one whose name begins with v, else the last."""
    rows = {row[0] for row in ask.motion.built.fields.values()}
    only = next(iter(rows)) if len(rows) == 1 else None
    if isinstance(only, Symbol) and only.name in ask.states:
        return ask.states.index(only.name)
    named = [i for i, name in enumerate(ask.states) if name.startswith("v")]
    return named[0] if named else len(ask.states) - 1


def _impacts(ask: Ask) -> list[float]:
    events = [e for e in ask.motion.events() if e.kind is EventKind.RESET]
    if not events and ask.motion.built.declared:
        events = [e for e in ask.motion.events() if e.surface == ask.motion.built.declared[0]]
    k = velocity_index(ask)
    return [float(e.x[k]) for e in events]


@reads(
    r"impact_velocit(?:y|ies)|impact_speeds?",
    "velocity at the resets (else on the first surface), a list or a formula in n",
)
def _impact_velocities(ask: Ask, _match: re.Match[str]) -> Any:
    found = _impacts(ask)
    if not isinstance(ask.entry.value, str | list):
        return found[0]
    if isinstance(ask.entry.value, str) and not re.search(r"\bn\b", ask.entry.value):
        return Either(found[:1])
    return sequence(ask, lambda n: Either([found[:n]]))


@reads(r"first_impact_(?:velocity|speed|v)", "velocity at the first impact")
def _first_impact_velocity(ask: Ask, _match: re.Match[str]) -> Any:
    found = _impacts(ask)
    if not found:
        raise MissingError("the run has no impact")
    return found[0]
