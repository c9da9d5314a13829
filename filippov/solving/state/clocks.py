"""The clock of a run: its start, and the next instant of a time event or of a knot of the inputs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from filippov.base.arrays import Array
from filippov.kernel.language.records import Rows
from filippov.kernel.loop.state import Clock, Tick
from filippov.kernel.loop.ticks import following, located_time, preceding, same_time
from filippov.model.system import System
from filippov.model.time_event import TimeEvent
from filippov.solving.state.options import Options


def start_clock(clock: Clock, span: tuple[float, float], options: Options) -> None:
    """Set a clock, in zeros, to the start of a run."""
    clock.t = clock.t_start = span[0]
    clock.t_end = clock.t_final = span[1]
    clock.instant = clock.event_t = math.nan
    clock.rtol, clock.max_step = options.rtol, options.max_step
    clock.step = options.first_step or 0.0


def tick_rows(
    events: Sequence[TimeEvent], numbers: Sequence[Sequence[Sequence[float]]], more: int = 0
) -> tuple[Rows[Tick], Array]:
    """The records of time events, with the times that they list.

    numbers  for every trajectory those of each event, see `TimeEvent.numbers`
    more     empty records behind those of a trajectory
    """
    each = len(events) + more
    rows = Rows(Tick, np.zeros((each * len(numbers), Tick.size), dtype=np.int64))
    listed: list[float] = []
    known: dict[tuple[float, ...], int] = {}
    for k, row in enumerate(numbers):
        for i, (event, values) in enumerate(zip(events, row, strict=True)):
            tick = rows[k * each + i]
            tick.moves = int(event.reset is not None)
            if event.times is None:
                tick.start, tick.period = values
                tick.gap = 0.25 * tick.period
                continue
            times = tuple(values)
            if times not in known:
                known[times] = len(listed)
                listed += times
            tick.first, tick.listed = known[times], len(times)
            tick.gap = apart(times)
    return rows, np.array(listed)


_NONE = tick_rows((), [])


def apart(times: Sequence[float] | Array) -> float:
    """A quarter of the least time between instants that are listed, inf for a single one."""
    return 0.25 * min((b - a for a, b in pairwise(times)), default=math.inf)


class Clocks:
    """The time events of one run, with numbers for their instants; behind them its inputs, with their knots.

    start: the time at which the run began
    """

    def __init__(self, system: System, p: Any, values: Mapping[str, float], start: float) -> None:
        self.events, self.inputs, self.start = system.time_events, system.inputs, start
        numbers = [event.numbers(p, values) for event in self.events]
        self.ticks, self.instants = tick_rows(self.events, [numbers], len(self.inputs)) if self else _NONE
        self.gaps = [self.ticks[i].gap for i in range(len(self.events))]
        self.gaps += [apart(samples.t) for samples in self.inputs]

    def __bool__(self) -> bool:
        return bool(self.events) or bool(self.inputs)

    @property
    def due(self) -> list[int]:
        """What is due at the instant that the run is led to."""
        return np.flatnonzero(self.ticks.column("due")).tolist() if self else []

    @due.setter
    def due(self, numbers: Sequence[int]) -> None:
        flags = self.ticks.column("due")
        flags[:] = 0
        flags[list(numbers)] = 1

    def same(self, t: float) -> float:
        """How close to t an instant counts as t."""
        return same_time(t, self.start)

    def located(self, t: float) -> float:
        """How close to an instant t an event on a surface counts as one of it."""
        return located_time(t, self.start)

    def _slack(self, t: float) -> list[float]:
        """The same for each source of instants: none has two that are one."""
        same = self.same(t)
        return [min(same, gap) for gap in self.gaps]

    def following(self, t: float) -> tuple[float, list[int]]:
        """The first instant after t, and the time events due there; (inf, []) if there is none."""
        late = [t + slack for slack in self._slack(t)]
        due = [following(self.ticks[i], self.instants, late[i]) for i in range(len(self.events))]
        due += [samples.neighbours(q)[1] for samples, q in zip(self.inputs, late[len(due) :], strict=True)]
        first = min(due, default=math.inf)
        if first == math.inf:
            return first, []
        return first, [i for i, slack in enumerate(self._slack(first)) if due[i] - first <= slack]

    def before(self, t: float) -> tuple[float, list[int]]:
        """The last instant before t, and the time events due there; (-inf, []) if there is none."""
        early = [t - slack for slack in self._slack(t)]
        due = [preceding(self.ticks[i], self.instants, early[i]) for i in range(len(self.events))]
        knots = [math.nextafter(q, -math.inf) for q in early[len(due) :]]
        due += [samples.neighbours(q)[0] for samples, q in zip(self.inputs, knots, strict=True)]
        last = max(due, default=-math.inf)
        if last == -math.inf:
            return last, []
        return last, [i for i, slack in enumerate(self._slack(last)) if last - due[i] <= slack]

    def pieces(self, t: float, direction: float) -> list[tuple[float, float]]:
        """The knots around the piece of each input that a solution from t on runs through."""
        slacks = self._slack(t)[len(self.events) :]
        ahead = [t + slack if direction > 0 else math.nextafter(t - slack, -math.inf) for slack in slacks]
        return [samples.neighbours(q) for samples, q in zip(self.inputs, ahead, strict=True)]
