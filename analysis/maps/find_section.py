"""Find a section from a solution: what recurs along it is the return."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from filippov import EventKind, System, UsageError
from filippov.analysis.maps.returns import after, is_still, returns
from filippov.analysis.maps.section import Section
from filippov.analysis.maps.stroboscope import Stroboscope, clock_times
from filippov.analysis.steady.forcing import is_forced
from filippov.base.arrays import Array
from filippov.base.given import Positive
from filippov.base.keywords import keywords
from filippov.solving.state.events import Event
from filippov.solving.state.options import check_state
from filippov.solving.uncut import solve

# Lengths of the solutions that are looked at, one after the other until something recurs; most events and
# steps of one.
_SPANS, _EVENTS, _STEPS = (1e2, 1e3, 1e4, 1e5), 400, 20_000
# A kind of event recurs that happens so many times in the last half, and whose last one is not long past.
_TIMES, _SILENCE = 4, 1.5
# The longest return, in units of the longest that was seen; periods that a forced solution is looked at.
_LONGEST, _PERIODS = 100.0, 32
# Of events that are as frequent, the one further to the left is taken.
_ORDER = ("sliding entry", "crossing up", "reset", "sliding exit up", "crossing down", "sliding exit down")
# A state is the coordinate if it varies by this part of the one that varies most.
_VARIES = 0.1


@keywords()
def find_section(
    system: System, x0: Any, *, parameters: Mapping[str, float] | None = None, t_max: Positive | None = None,
    period: Any = None, coordinate: Any = None,
) -> Section | Stroboscope:  # fmt: skip
    """The section on which the solution from x0 returns, without a parametrisation.

    For a system forced by t or a clock, its states once per period (`Stroboscope`); for any other the rarest
    kind of event on a surface that recurs, because others may occur several times per return.

    x0          a state, in order or by name
    t_max       longest time of the solution; default: up to 1e5, or 400 events
    period      of the forcing, as in `Stroboscope`
    coordinate  what is read on the section; default: the first state that varies there along the solution

    Raises UsageError where nothing recurs: the solution rests, slides forever or reaches no surface.
    """
    start = check_state(x0, system)
    if t_max is not None and not 0 < t_max < np.inf:
        raise UsageError(f"t_max is {t_max!r}, expected a number > 0.")
    if is_forced(system) or period is not None:
        return _strobe(system, start, parameters, period, coordinate)
    if not any(role.kind != "observer" for role in system.roles):
        raise UsageError(
            "no section was found: of signs, surfaces, clocks and t there is none in the system, so nothing "
            "marks a return. Watch a surface, Surface('half', x - 0.5, kind='observer'), and write "
            "Section('half', 'crossing up', 'v'), on the command line --surface, --event and --coordinate; "
            "or give the period of the solution, period=6.28."
        )
    said = ""
    for span in _SPANS if t_max is None else (t_max,):
        run = solve(
            system, start, (0.0, span), parameters=parameters, max_events=_EVENTS, max_steps=_STEPS,
            zeno="continue", dense_output=False, rtol=1e-8,
        )  # fmt: skip
        # It moved and then did not: events that still recur are made by rounding.
        rests = is_still(run, 0.5 * run.t_end) and not is_still(run, 0.0)
        found = None if rests else _recurring(system, run.events, float(run.t_end))
        if found is not None:
            surface, kind, events = found
            x = np.array([after(e) for e in events])
            size = np.ptp(run.y, axis=1)
            gap = max(np.diff([0.0, *(e.t for e in events)]))
            return Section(
                surface, kind, _coordinate(system, x, size) if coordinate is None else coordinate,
                t_max=float(_LONGEST * gap),
            )
        said = f" The solution ended at t = {run.t_end:g}: {run.message}" if not run.success else ""
        if rests:
            said = f" It comes to rest at {run.x_end.tolist()}."
        if rests or not run.success:
            break
    raise UsageError(
        f"no section was found: along the solution from x0 = {start.tolist()} to t = {run.t_end:g} no kind "
        f"of event on a surface ({', '.join(system.surface_names) or 'there is none'}) comes back again and "
        "again."
        f"{said} Start from another state or other parameter values, or give a section: "
        "Section(surface, kind, coordinate); on the command line --surface, --event and --coordinate."
    )


def _strobe(
    system: System, x0: Array, parameters: Mapping[str, float] | None, period: Any, coordinate: Any
) -> Stroboscope:
    """Once a period; after the ticks of the clock whose period is that of the forcing, where there is one."""
    values = system.parameters.resolve(parameters)
    first = Stroboscope(system.states[0], period)
    length = first.period_on(system)(values)
    ticking = [e.name for e in system.time_events if e.period is not None]
    clocks = [name for name in ticking if abs(clock_times(system, name, values)[1] / length - 1) <= 1e-9]
    made = Stroboscope(coordinate or system.states[0], period, clocks[0] if clocks else "")
    if coordinate is not None:
        return made
    seen = returns(system, made, x0, _PERIODS, parameters=parameters, rtol=1e-8)
    run = solve(system, x0, (0.0, length), parameters=parameters, rtol=1e-8)
    return Stroboscope(_coordinate(system, seen.x, np.ptp(run.y, axis=1)), period, made.clock)


def _recurring(
    system: System, events: Sequence[Event], t_end: float
) -> tuple[str, str, list[Event]] | None:
    """(surface, kind, its events) of what goes on to the end of the solution, the most seldom."""
    by: dict[tuple[str, str], list[Event]] = {}
    for event in events:
        own = event.index < len(system.surfaces) and system.surfaces[event.index].kind != "observer"
        if own and event.kind not in (EventKind.GRAZING, EventKind.USER):
            way = {1: " up", -1: " down"}.get(event.direction, "")
            by.setdefault((event.surface, f"{event.kind}{way}"), []).append(event)
    best: tuple[int, int] | None = None
    chosen = None
    for (surface, kind), those in by.items():
        t = np.array([e.t for e in those])
        late = t[t >= 0.5 * t_end]
        if late.size < _TIMES or kind not in _ORDER or t_end - t[-1] > _SILENCE * np.max(np.diff(late)):
            continue
        key = (int(late.size), _ORDER.index(kind))
        if best is None or key < best:
            best, chosen = key, (surface, kind, those)
    return chosen


def _coordinate(system: System, x: Array, size: Array) -> str:
    """The first state that varies on the section, in units of its size along the solution."""
    spread = np.ptp(x, axis=0) / np.where(size > 0, size, np.inf) if len(x) else np.zeros(system.dimension)
    if not np.max(spread) > 1e-9:
        # On a cycle from the start: a state that moves, and stands off 0 on the section.
        spread = np.abs(x[-1]) / np.where(size > 0, size, np.inf) if len(x) else spread
    return str(system.states[int(np.argmax(spread >= _VARIES * np.max(spread)))])
