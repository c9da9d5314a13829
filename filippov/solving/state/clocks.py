"""The next instant at which the time events of a system are due, or a knot of its inputs."""

from __future__ import annotations

import bisect
import math
from collections.abc import Mapping
from typing import Any

from filippov.model.system import System

# Instants closer than this part of the time run are one.
SAME = 1e-12


class Clocks:
    """The time events of one run, with numbers for their instants; behind them its inputs, with their knots.
    """

    def __init__(
        self, system: System, p: Any, values: Mapping[str, float], span: tuple[float, float]
    ) -> None:
        self.events, self.inputs = system.time_events, system.inputs
        self.numbers = [event.numbers(p, values) for event in self.events]
        self.span = span

    def __bool__(self) -> bool:
        return bool(self.events) or bool(self.inputs)

    def same(self, t: float) -> float:
        """How close to t an instant counts as t."""
        return SAME * max(abs(t), abs(t - self.span[0]))

    def following(self, t: float) -> tuple[float, list[int]]:
        """The first instant after t, and the time events due there; (inf, []) if there is none."""
        late = t + self.same(t)
        due = [self._next(i, late) for i in range(len(self.events))]
        due += [samples.neighbours(late)[1] for samples in self.inputs]
        first = min(due, default=math.inf)
        if first == math.inf:
            return first, []
        return first, [i for i, q in enumerate(due) if q - first <= self.same(first)]

    def before(self, t: float) -> tuple[float, list[int]]:
        """The last instant before t, and the time events due there; (-inf, []) if there is none."""
        early = t - self.same(t)
        due = [self._last(i, early) for i in range(len(self.events))]
        due += [samples.neighbours(math.nextafter(early, -math.inf))[0] for samples in self.inputs]
        last = max(due, default=-math.inf)
        if last == -math.inf:
            return last, []
        return last, [i for i, q in enumerate(due) if last - q <= self.same(last)]

    def pieces(self, t: float, direction: float) -> list[tuple[float, float]]:
        """The knots around the piece of each input that a motion from t on runs through."""
        ahead = math.nextafter(t + direction * self.same(t), direction * math.inf)
        ahead = t + self.same(t) if direction > 0 else ahead
        return [samples.neighbours(ahead) for samples in self.inputs]

    def _next(self, i: int, t: float) -> float:
        if self.events[i].times is not None:
            place = bisect.bisect_right(self.numbers[i], t)
            return self.numbers[i][place] if place < len(self.numbers[i]) else math.inf
        start, period = self.numbers[i]
        k = max(math.floor((t - start) / period) - 1, 0)
        while start + k * period <= t:
            k += 1
        return start + k * period

    def _last(self, i: int, t: float) -> float:
        if self.events[i].times is not None:
            place = bisect.bisect_left(self.numbers[i], t)
            return self.numbers[i][place - 1] if place > 0 else -math.inf
        start, period = self.numbers[i]
        k = math.ceil((t - start) / period) + 1
        while k >= 0 and start + k * period >= t:
            k -= 1
        return start + k * period if k >= 0 else -math.inf
