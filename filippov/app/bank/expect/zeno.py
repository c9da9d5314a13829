"""What an accumulation of events is expected to be: when it ends, how fast it contracts, what comes after."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from filippov.app.bank.expect.state import velocity_index
from filippov.app.bank.outcome import Ask, Either, Outcome, reads
from filippov.app.bank.reason import MissingError, NotUnderstoodError
from filippov.base.status import EventKind, Status
from filippov.solving.solution import Solution
from filippov.solving.state.events import Event

LONGER = (1.0, 2.0, 8.0, 32.0)


def accumulation(ask: Ask) -> Solution:
    """The run up to the limit of its events, from ever longer spans."""
    start, end = ask.motion.built.t_span
    for factor in LONGER:
        run = ask.motion.solve(t_end=start + factor * (end - start), zeno="stop")
        if run.status is Status.ZENO:
            return run
        if not run.status.ok:
            raise MissingError(run.message)
    raise MissingError(f"no events accumulate within {LONGER[-1]:g} times the span")


@reads(r"t_converge|t_converged|convergence_time|zeno_time|t_zeno|t_limit|t_accumulation|reaching_time",
       "the time at which events accumulate; where none do, of the entry into the last sliding")  # fmt: skip
def _time(ask: Ask, _match: re.Match[str]) -> Any:
    try:
        run = accumulation(ask)
    except MissingError:
        entries = [e.t for e in ask.motion.events() if e.kind is EventKind.ENTRY]
        if not entries:
            raise
        return entries[-1]
    return run.t_end if run.zeno is None else run.zeno.t


def _tail(ask: Ask) -> list[Event]:
    """Events of the accumulating motion that are far enough from its limit to have digits."""
    events = ask.motion.events()
    if len(events) < 6:
        events = ask.motion.events(accumulation(ask))
    if len(events) < 4:
        raise MissingError("the run has too few events")
    return events[: max(4, min(len(events), 24))]


@reads(
    r"ratio_of_intervals|interval_ratio|contraction_of_intervals",
    "ratio of successive intervals between events, or between those of one surface",
)
def _intervals(ask: Ask, _match: re.Match[str]) -> Any:
    events = _tail(ask)
    rows = [events, *([e for e in events if e.index == i] for i in {e.index for e in events})]
    readings = []
    for row in rows:
        gaps = np.diff([e.t for e in row])
        if len(gaps) > 2:
            readings.append(_worst(ask, gaps[1:] / gaps[:-1]))
    return Either(readings)


@reads(r"velocity_ratio\w*|speed_ratio\w*", "ratio of successive velocities at the events of one surface")
def _velocities(ask: Ask, _match: re.Match[str]) -> Any:
    k = velocity_index(ask)
    readings = []
    events = _tail(ask)
    for i in {e.index for e in events}:
        speeds = np.abs([e.x[k] for e in events if e.index == i])
        if len(speeds) > 2 and np.all(speeds > 0):
            readings.append(_worst(ask, speeds[1:] / speeds[:-1]))
    return Either(readings)


@reads(
    r"contraction(?:_per_\w+|_ratio)?|contraction_factor",
    "ratio of the distances |h_1| + |h_2| + ... at successive events, or at those of one surface",
)
def _contraction(ask: Ask, _match: re.Match[str]) -> Any:
    from filippov.solving.state.machine import Machine

    run = ask.motion.main
    machine = Machine(run.problem.system, "DOP853", run.problem.p)
    events = _tail(ask)

    def size(event: Event) -> float:
        mode = np.array(event.before, dtype=float)
        return float(np.sum(np.abs(machine.guards(event.t, np.ascontiguousarray(event.x), mode))))

    readings = []
    for row in (events, *([e for e in events if e.index == i] for i in {e.index for e in events})):
        sizes = np.array([size(e) for e in row])
        if len(sizes) > 2 and np.all(sizes[:-1] > 1e-9):
            readings.append(_worst(ask, sizes[1:] / sizes[:-1]))
    return Either(readings)


def _worst(ask: Ask, ratios: Any) -> float:
    wanted = float(ask.wanted())
    return float(ratios[int(np.argmax(np.abs(ratios - wanted)))])


@reads(
    r"after(?:_\w+)?|afterwards",
    "text 'stays at (0,0)' or 'origin is an equilibrium': the state after the accumulation, in its limit",
)
def _after(ask: Ask, _match: re.Match[str]) -> Any:
    text = str(ask.entry.value)
    match = re.search(r"(?:stays?|rests?|remains?|stops?) (?:at|in) \(([^()]*)\)", text)
    if match is not None:
        point = [ask.number(piece) for piece in match[1].split(",")]
    elif re.search(
        r"(?:stays?|rests?|remains?|stops?) (?:at|in) (?:the )?(?:origin|rest|zero)|origin is an equilibrium",
        text,
    ):
        point = [0.0] * len(ask.states)
    else:
        raise NotUnderstoodError("the text names no point to stay at")
    start, _end = ask.motion.built.t_span
    limit = accumulation(ask).t_end
    run = ask.motion.solve(t_end=limit + 0.5 * abs(limit - start), zeno="continue")
    if not run.status.ok:
        raise MissingError(run.message)
    return _near(ask, run, point)


def _near(ask: Ask, run: Solution, point: list[float]) -> Outcome:
    gap = float(np.max(np.abs(run.x_end - np.array(point))))
    # A text has no digits of its own: what the accumulation's limit is good for.
    tolerance = max(ask.entry.tol, 1e-8)
    return Outcome(gap, tolerance, "" if gap <= tolerance else "the state moves on")
