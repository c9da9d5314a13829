"""Cycles that shrink as a power of their number: no steady ratio tells their limit.

Between walls that close in on each other they have a limit in time (`power_law`). Around a corner there are
infinitely many and none (`slow_spiral`); so around h = h' = 0 of one surface whose sign acts on h'' alone:
there the speed across it is the distance.

Where the field of every mode is finite at the corner and the cycles are marginal to first order, the distance
d of the n-th cycle obeys d' = d - a d**2, so d falls as 1/n; a cycle lasts a time in proportion to d, so d
falls as exp(-rate t) while the number of events grows as exp(rate t). A genetic loop with thresholds does
this. In the plane the rate is half of that at which the fields shrink areas (tests: two genes, (a + b)/2).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from filippov.base.arrays import Array
from filippov.base.status import EventKind
from filippov.solving.resets.zeno import Accumulation, onto, second_order
from filippov.solving.state.events import Event
from filippov.solving.state.run import Run

# Events that a law is read off, and how well its parts are to agree, in octaves for each octave.
LEAST_LAPS, STEADY = 64, 0.03
# How far the distance has to fall, in octaves; how much its rate in time may change from part to part.
LEAST_FALL, LEVEL = 0.05, 2.0
RECENT = 64
# Of a limit in time: least number of events, how much shorter each half of them is to be than the one before,
# and how well the halves are to agree.
LEAST_EVENTS, HALVES, ALIKE = 512, 0.9, 0.05


@dataclass(frozen=True)
class SlowSpiral:
    """A spiral into a corner: surfaces, time, point, how far off the solution is, the time that halves it."""

    surfaces: tuple[int, ...]
    t: float
    x: Array
    distance: float
    half_life: float

    def __str__(self) -> str:
        return (
            "event cycles around a corner shrink as n**-1: infinitely many events, while the "
            f"distance from the corner halves every {self.half_life:.3g} and is {self.distance:.2g} now"
        )

    @property
    def followed(self) -> str:
        """The message of a run that was continued in the corner."""
        return (
            f" From t = {self.t:.9g} on this is the solution in a corner, from which the true one is "
            f"{self.distance:.2g} away there, and half as far every {self.half_life:.3g} later: event cycles "
            "shrink as n**-1. A larger max_events goes on longer event by event."
        )


def slow_spiral(run: Run) -> SlowSpiral | None:
    """The spiral to which the events so far belong, None where they follow no such law."""
    machine, m = run.machine, run.machine.m
    # What is watched alone and clocks that move nothing have no part in the law.
    events = [event for event in run.events if run.decides(event.index)]
    if len(events) < 4 * LEAST_LAPS or len(run.events) < run.events.total:
        return None
    clocks = {event.index - m for event in run.events[-RECENT:] if event.index >= m}
    if any(machine.system.time_events[k].reset is not None for k in clocks):
        return None
    recent = events[-RECENT:]
    part = tuple(sorted({event.index for event in recent}))
    plain = all(machine.roles[i] == "switching" and machine.widths[i] == 0.0 for i in part)
    if not part or not plain or any(event.kind is not EventKind.CROSSING for event in recent):
        return None
    last = events[-1]
    same = [e for e in events if e.index == last.index and e.after == last.after]
    count = len(same)
    if count < LEAST_LAPS:
        return None
    distance = _distance if len(part) > 1 else _speed
    places = np.array([count // 4, count // 2, 3 * count // 4, count - 1])
    sizes = np.array([distance(run, same[k], part) for k in places])
    times = np.array([same[k].t for k in places])
    if not np.all(sizes) or not np.all(np.abs(np.diff(times))):
        return None
    # The run may begin anywhere in the law: 1/d grows evenly, however many cycles went before.
    growth = np.diff(1.0 / sizes) / np.diff(places)
    fall = float(np.log2(sizes[0] / sizes[-1]))
    if fall < LEAST_FALL or np.min(growth) <= 0.0 or np.ptp(np.log2(growth)) > STEADY * fall:
        return None
    rates = -np.diff(np.log2(sizes)) / np.abs(np.diff(times))
    if np.max(rates) > LEVEL * np.min(rates):
        return None
    x = onto(run, run.t, run.x, part)
    if len(part) == 1:
        folds = second_order(run, Accumulation(run.t, run.x, 0.0, np.inf, 1.0, part))
        if folds is None:
            return None
        x = folds
    return SlowSpiral(part, run.t, x, float(np.max(np.abs(x - run.x))), 1.0 / float(rates[-1]))


def power_law(run: Run) -> Accumulation | None:
    """The limit of events whose intervals shrink by a power of their number, as between closing walls.

    Then t_n = t - c n**-k: the last half of the events took 2**-k of the time that the half before took.
    None where three such halvings do not agree.
    """
    past = run.events.past(len(run.events))
    # What is watched alone, and clocks, have no part in the law.
    own = [run.decides(i) for i in past.surface.tolist()]
    times, surfaces = past.t[own], past.surface[own]
    n = len(times)
    if n < LEAST_EVENTS or len(run.events) < run.events.total:
        return None
    spans = np.abs(np.diff(times[[n // 16, n // 8, n // 4, n // 2, n - 1]]))
    if not np.all(spans > 0):
        return None
    ratios = spans[1:] / spans[:-1]
    if np.max(ratios) >= HALVES or np.ptp(ratios) > ALIKE:
        return None
    rest = spans[1:] * ratios / (1.0 - ratios)
    limits = np.cumsum(spans)[1:] + rest
    error = float(abs(limits[-1] - limits[-2]))
    t = float(times[-1] + run.direction * rest[-1])
    part = tuple(sorted(set(surfaces[-64:].tolist())))
    return Accumulation(t, run.x.copy(), error, float(np.max(np.abs(run.x), initial=0.0)), 1.0, part)


def _distance(run: Run, event: Event, surfaces: tuple[int, ...]) -> float:
    """The largest distance from one of the surfaces, to first order."""
    x = np.ascontiguousarray(event.x)
    h = run.machine.guards(event.t, x, run.mode)
    g, _ = run.machine.gradients(event.t, x, run.mode)
    return max(abs(float(h[i])) / float(np.linalg.norm(g[i])) for i in surfaces)


def _speed(run: Run, event: Event, surfaces: tuple[int, ...]) -> float:
    """How fast the one surface is crossed."""
    x, mode = np.ascontiguousarray(event.x), np.array(event.before, dtype=float)
    g, gt = run.machine.gradients(event.t, x, mode)
    field = run.machine.rhs(event.t, x, np.where(mode == 0.0, 1.0, mode), mode)
    return abs(float(g[surfaces[0]] @ field + gt[surfaces[0]]))
