"""A section without a parametrisation: the states at its events along one solution.

The solution goes from one event of the section to the next, so its own states are where the returns start.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov import Solution, Status, System, UsageError
from filippov.analysis.maps.coordinate import Coordinate
from filippov.analysis.maps.first_return import MOST_STEPS
from filippov.analysis.maps.missed import missed
from filippov.analysis.maps.section import BoundSection, Section
from filippov.analysis.maps.stroboscope import Stroboscope, clock_times
from filippov.base.arrays import Array
from filippov.base.given import Amount, Count, Positive
from filippov.base.keywords import keywords
from filippov.solving.state.events import Event
from filippov.solving.state.options import check_state
from filippov.solving.uncut import solve

# Times the solution is run again for twice the events, where some lead into other modes than are wanted.
_LONGER = 8
# A solution rests where each state moves by less than this part of its size, or so many rtol of it or atol.
_STILL, _OF_RTOL, _OF_ATOL = 1e-9, 10.0, 1e3
# Of more events so many are looked at first, unless more than _OTHERS of any kind come for each: what
# moves by no more between the last of them rests, and rounding makes the others.
_FIRST, _LAST, _OTHERS = (16, 32, 64), 8, 12


@dataclass(frozen=True)
class Returns:
    """The section's events along a solution.

    t, x     time and state after each, (k,) and (k, n); k is less than requested if the solution ends earlier
    d        the coordinate there, (k,)
    t_end, x_end  where the solution ended
    message  why there are fewer than requested, else ""
    rests    whether the solution came to rest after the last of them, at x_end
    """

    t: Array
    x: Array
    d: Array
    t_end: float
    x_end: Array
    message: str = ""
    rests: bool = False


@keywords()
def returns(
    system: System, section: Section | Stroboscope, x0: Any, count: Amount, *,
    parameters: Mapping[str, float] | None = None, t0: float = 0.0, rtol: Positive = 1e-10, atol: Any = None,
    method: str = "DOP853", max_events: Count = 1_000_000,
) -> Returns:  # fmt: skip
    """The next `count` events of a section along the solution from x0 at t0; no parametrisation is needed.

    x0           a state, in order or by name
    parameters   values by name
    rtol, atol   of the solution, as in `solve`
    max_events   of all kinds, after which the solution ends

    The solution continues after an accumulation of events (`solve(..., zeno="continue")`). Raises UsageError,
    ModelError.
    """
    if not count >= 1:
        raise UsageError(f"count is {count!r}, expected 1, 2, ...")
    options: dict[str, Any] = {
        "parameters": parameters, "rtol": rtol, "method": method, "zeno": "continue",
        "max_events": max_events, **({} if atol is None else {"atol": atol}),
    }  # fmt: skip
    start = check_state(x0, system)
    if isinstance(section, Stroboscope):
        return _strobed(system, section, start, count, float(t0), options)
    return _of_events(section.bind(system), start, count, float(t0), options)


def coordinate_of(section: Section | Stroboscope, system: System) -> Coordinate:
    """What is read on a section of a system."""
    return Coordinate(section.coordinate, system)


def events_of(bound: BoundSection, solution: Solution) -> list[Event]:
    """The section's events in a solution."""
    return [e for e in solution.events if e.index in bound.surfaces and _is(bound.section.kind, e)
            and bound.wanted(e.after)]  # fmt: skip


def _is(kind: str, event: Event) -> bool:
    way = {1: " up", -1: " down"}.get(event.direction, "")
    return kind in (str(event.kind), f"{event.kind}{way}")


def after(event: Event) -> Array:
    """The state from which the solution goes on."""
    return event.x if event.x_after is None else event.x_after


def _of_events(bound: BoundSection, x0: Array, count: int, t0: float, options: dict[str, Any]) -> Returns:
    for number in (*(first for first in _FIRST if first < count), count):
        most = options["max_events"] if number == count else min(options["max_events"], _OTHERS * number)
        run, found, late = _run_to(bound, x0, number, t0, {**options, "max_events": most})
        kept = int(late[0]) if late.size else len(found)
        # Where it rests rounding makes events, too.
        rests = kept < number and _rests(run, found[kept - 1].t if kept else t0)
        if number < count and (kept == number or run.status is Status.MAX_EVENTS):
            rests = is_still(run, run.events[-_LAST].t)
        elif kept < number:
            break
        if rests:
            break
    t = np.array([e.t for e in found])
    x = np.array([after(e) for e in found[:kept]]).reshape(-1, bound.system.dimension)
    message = ""
    if kept < count:
        where = f"after {kept} of {count} events of the section"
        message = f"{where} the next one did not come within {bound.section.t_max:g}"
        if rests:
            message = f"{where} the solution rests"
        elif not run.success:
            message = f"{where} the solution ended: {run.message}"
        if not kept and run.events:
            message = f"{missed(bound, run)}. {message[0].upper()}{message[1:]}"
    return Returns(t[:kept], x, bound.read(x), float(run.t_end), run.x_end, message, rests)


def _run_to(
    bound: BoundSection, x0: Array, count: int, t0: float, options: dict[str, Any]
) -> tuple[Solution, list[Event], npt.NDArray[np.intp]]:
    """The solution to its count-th event of the section, those events, and which of them come too late."""
    section, asked = bound.section, count
    for _ in range(_LONGER):
        run = solve(
            bound.system, x0, (t0, t0 + count * section.t_max), dense_output=False,
            stop=[stop.counted(asked) for stop in section.stops], max_steps=MOST_STEPS, **options,
        )  # fmt: skip
        found = [e for e in events_of(bound, run) if e.t > t0][:count]
        if run.status is not Status.STOPPED or len(found) == count:
            break
        asked *= 2
    t = np.array([e.t for e in found])
    return run, found, np.flatnonzero(np.diff(np.append(t0, t)) > section.t_max)


def _strobed(
    system: System, section: Stroboscope, x0: Array, count: int, t0: float, options: dict[str, Any]
) -> Returns:
    values = system.parameters.resolve(options["parameters"])
    period, read = section.period_on(system)(values), coordinate_of(section, system)
    ticks = np.floor(t0 / period * (1 + 1e-14)) + 1 + np.arange(count)
    if section.clock:
        begin = max(t0, clock_times(system, section.clock, values)[0])
        run = solve(system, x0, (t0, begin + (count + 0.5) * period), dense_output=False, **options)
        found = [e for e in run.events if e.surface == section.clock and e.t > t0][:count]
        t, x = np.array([e.t for e in found]), np.array([after(e) for e in found])
    else:
        run = solve(system, x0, (t0, ticks[-1] * period), t_eval=ticks * period, **options)
        t, x = run.t, run.y.T
    x = x.reshape(-1, system.dimension)
    ended = f"after {len(t)} of {count} periods the solution ended: {run.message}"
    message = "" if len(t) == count else ended
    return Returns(t, x, read.read(x), float(run.t_end), run.x_end, message)


def _rests(run: Solution, since: float) -> bool:
    """Whether nothing moves in the last half of the time after the last event."""
    done = run.status in (Status.SUCCESS, Status.STOPPED)
    return done and is_still(run, 0.5 * (since + run.t_end))


def is_still(run: Solution, since: float) -> bool:
    """Whether no state moves by more than its tolerance from the time `since` on."""
    late = run.y[:, run.t >= since]
    last = run.y[:, -2:] if late.shape[1] < 2 else late
    part = max(_STILL, _OF_RTOL * run.options.rtol)
    least = part * np.max(np.abs(run.y), axis=1) + _OF_ATOL * np.asarray(run.options.atol)
    return bool(np.all(np.ptp(last, axis=1) <= least))
