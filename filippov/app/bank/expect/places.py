"""Single places of a motion: counts and states of events, modes at times, where it settles or rests."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.app.bank.expect.events import WORDS, counted, kind_word
from filippov.app.bank.expect.state import turns, velocity_index
from filippov.app.bank.outcome import Ask, Either, Outcome, reads
from filippov.app.bank.reason import MissingError, NotUnderstoodError
from filippov.base.status import EventKind, Status, mode_text
from filippov.solving.state.events import Event

_KINDS = "impact|crossing|slide|stick|stop|switch|reset|exit|entry|entrie|grazing|bounce"
SETTLED = 1e-9


@reads(
    rf"(?:n|number_of|num|count)_(?P<kind>{_KINDS})(?:s|es)?",
    "number of such events in the span",
)
def _count(ask: Ask, match: re.Match[str]) -> Any:
    return float(len(_of_kind(ask, match["kind"])))


def _of_kind(ask: Ask, word: str) -> list[Event]:
    word = {"stop": "slide", "entrie": "slide", "bounce": "reset"}.get(word, word)
    events = counted(ask, ["graze"] if word == "grazing" else ())
    if word == "switch":
        return events
    found = [e for e in events if WORDS[e.kind] == kind_word(word)]
    if not found and kind_word(word) == "reset":  # impacts without a reset are crossings
        found = [e for e in events if WORDS[e.kind] == "cross"]
    return found


@reads(
    rf"t_(?P<kind>{_KINDS})s|(?P<kind2>{_KINDS})_instants",
    "times of the first events of that kind: a list",
)
def _times(ask: Ask, match: re.Match[str]) -> Any:
    found = _of_kind(ask, match["kind"] or match["kind2"])
    return [e.t for e in found][: np.atleast_1d(ask.wanted()).size]


@reads(
    r"t_(?:hit|reach|capture|contact|first_hit)(?:_(?P<k>\d+))?|(?:hit|hitting|contact)_time",
    "time at which a surface is reached first, or for the k-th time",
)
def _hit(ask: Ask, match: re.Match[str]) -> Any:
    events = counted(ask)
    k = int(match["k"] or 1) - 1
    if not 0 <= k < len(events):
        raise MissingError("the run has no such event")
    return events[k].t


def _sides(event: Event) -> list[npt.NDArray[np.float64]]:
    """The state before and after an event."""
    return [event.x, event.x if event.x_after is None else event.x_after]


@reads(
    rf"(?P<state>{{state}}|state)_at_(?P<kind>{_KINDS})(?:_(?P<k>\d+))?",
    "one state, or all, at the first or k-th event of that kind, before or after it",
)
def _at_event(ask: Ask, match: re.Match[str]) -> Any:
    found = _of_kind(ask, match["kind"])
    k = int(match["k"] or 1) - 1
    if not 0 <= k < len(found):
        raise MissingError("the run has no such event")
    sides = _sides(found[k])
    if match["state"] == "state":
        return Either(sides)
    return Either([x[ask.states.index(match["state"])] for x in sides])


@reads(
    r"codim_?2_(?P<what>entry|exit)_(?:point|state)|point_codim_?2_(?P<what2>entry|exit)",
    "the state where sliding on two surfaces at once begins, or ends",
)
def _corner(ask: Ask, match: re.Match[str]) -> Any:
    leaves = (match["what"] or match["what2"]) == "exit"
    for event in ask.motion.events():
        zeros = [sum(sign == 0 for sign in mode) for mode in (event.before, event.after)]
        if (zeros[0] >= 2 > zeros[1]) if leaves else (zeros[1] >= 2 > zeros[0]):
            return event.x
    start = ask.motion.main.start_mode
    if not leaves and sum(sign == 0 for sign in start) >= 2:
        return list(ask.motion.built.x0)
    raise MissingError("the run has no such event")


@reads(r"(?:rebound|bounce|apex|peak)_heights", "largest values of the first state between impacts: a list")
def _heights(ask: Ask, _match: re.Match[str]) -> Any:
    run = ask.motion.main
    assert run.sol is not None
    start = run.problem.t_span[0]
    times = [t for t, way in turns(ask, ask.states[0]) if way < 0 and t > start + 1e-12]
    return [float(run.sol(t)[0]) for t in times][: np.atleast_1d(ask.wanted()).size]


@reads(
    r"(?:final|end|last)_mode|mode_at_(?P<time>.+)",
    "the mode at the end of the span, or at a time, as text such as +0-",
)
def _mode(ask: Ask, match: re.Match[str]) -> Outcome:
    text = match["time"]
    run = ask.motion.main
    if text in (None, "T", "end", "t_end"):
        mode = run.end_mode
    else:
        t = ask.number(text)
        mode = ask.motion.covering(t).mode_at(t, "+")
    wanted = str(ask.entry.value).strip()
    if not re.fullmatch(r"[-+0]+", wanted):
        raise NotUnderstoodError("the value is no mode such as +0-")
    found = mode_text(mode)[: len(ask.motion.built.declared)]
    return Outcome(float(found != wanted), 0.0, "" if found == wanted else f"mode {found}, expected {wanted}")


@reads(
    r"(?:equivalent_control|u_eq|ueq|lambda|multiplier|sign)_at_(?P<time>.+)",
    "the sign's value in sliding at a time: a number, or a list, one a sliding surface",
)
def _multiplier_at(ask: Ask, match: re.Match[str]) -> Any:
    t = ask.motion.built.t_span[1] if match["time"] in ("T", "end") else ask.number(match["time"])
    run = ask.motion.covering(t)
    mode = run.end_mode if t == run.t_end else run.mode_at(t, "+")
    on = [i for i, sign in enumerate(mode) if sign == 0]
    if not on:
        raise MissingError(f"the motion does not slide at t = {t:.9g}")
    return [ask.motion.velocity(run, t)[1][i] for i in on]


# -- where it ends -------------------------------------------------------------------------------------


@reads(
    r"steady_state|(?:steady_state|steady)_(?P<state>{state})|(?P<state2>{state})_(?:steady|inf|infinity|ss|steady_state)",
    "the state, or one state, that the motion settles at",
)
def _steady(ask: Ask, match: re.Match[str]) -> Any:
    start, end = ask.motion.built.t_span
    for factor in (1.0, 4.0, 16.0, 64.0):
        run = ask.motion.solve(t_end=start + factor * (end - start), zeno="continue")
        if not run.status.ok:
            raise MissingError(run.message)
        velocity, _ = ask.motion.velocity(run)
        moved = np.max(np.abs(velocity)) * abs(end - start)
        if moved <= max(SETTLED, 1e-2 * ask.entry.tol) * (1 + np.max(np.abs(run.x_end))):
            state = match["state"] or match["state2"]
            return run.x_end[ask.states.index(state)] if state else run.x_end
    raise MissingError("the motion does not settle")


@reads(
    r"(?:blow_?up|escape|finite_escape)_time|t_(?:blow_?up|escape)",
    "time at which the state grows without bound",
)
def _blow_up(ask: Ask, _match: re.Match[str]) -> Any:
    run = ask.motion.main
    if run.status not in (Status.NOT_FINITE, Status.MIN_STEP) or not np.max(np.abs(run.x_end)) > 1e3:
        raise MissingError(f"the run ends with {run.status.value}")
    return run.t_end


@reads(
    r"(?P<kind>crossing|exit|entry|stick|reset|rebound)_(?:velocity|speed)",
    "velocity at the first such event (rebound: after the first impact)",
)
def _velocity(ask: Ask, match: re.Match[str]) -> Any:
    word = {"rebound": "reset"}.get(match["kind"], match["kind"])
    found = _of_kind(ask, word)
    if not found:
        raise MissingError("the run has no such event")
    x = _sides(found[0])[1 if match["kind"] == "rebound" else 0]
    v = x[velocity_index(ask)]
    return Either([v, abs(v)])


@reads(
    r"poincare_point|fixed_point|section_point|return_point",
    "the state where the periodic motion meets a surface",
)
def _section(ask: Ask, _match: re.Match[str]) -> Any:
    wanted = np.atleast_1d(ask.wanted())
    events = [e for e in ask.motion.cycle.events if e.kind is not EventKind.GRAZING]
    return Either([e.x if wanted.size > 1 else e.x[0] for e in events])


@reads(
    r"(?:rest|equilibrium|stiction|sticking)_(?:interval|band|zone|set)|stick_(?:band|zone|set)",
    "[least, largest] value of the first state at which the motion rests, the other states being 0",
)
def _rest_set(ask: Ask, _match: re.Match[str]) -> Outcome:
    ends = np.atleast_1d(ask.wanted())
    if ends.size != 2:
        raise NotUnderstoodError("it is no interval")
    step = max(10 * ask.entry.tol, 1e-6)
    for end, outwards in zip(ends, (-1, 1), strict=True):
        for place, rests in ((end - outwards * step, True), (end + outwards * step, False)):
            if _stays(ask, float(place)) != rests:
                said = "rests" if not rests else "does not rest"
                return Outcome(float("inf"), ask.entry.tol, f"the motion {said} at {place:.9g}")
    return Outcome(0.0, ask.entry.tol)


def _stays(ask: Ask, place: float) -> bool:
    start, end = ask.motion.built.t_span
    x0 = (place, *[0.0] * (len(ask.states) - 1))
    run = ask.motion.solve(x0=x0, t_end=start + min(1.0, abs(end - start)), nonunique="stick")
    return run.status.ok and bool(np.all(run.x_end == np.array(x0)))


