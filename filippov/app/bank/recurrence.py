"""The periodic solution that a run settles on: the shortest repetition of its events."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from filippov import Solution
from filippov.solving.segments import Segment
from filippov.solving.state.events import Event

_word = attrgetter("index", "kind", "direction")


@dataclass(frozen=True)
class Cycle:
    """The last period of a run: from the event before the last return to the last event.

    residual  largest difference between the states of its events and those a period earlier, relative
    """

    run: Solution
    period: float
    events: tuple[Event, ...]
    residual: float

    @property
    def span(self) -> tuple[float, float]:
        """First and last time of it."""
        return self.events[-1].t - self.period, self.events[-1].t

    @property
    def segments(self) -> tuple[Segment, ...]:
        """Its parts in one mode."""
        (low, high), tiny = self.span, 1e-9 * self.period
        return tuple(s for s in self.run.segments if s.t0 >= low - tiny and s.t1 <= high + tiny)


def recurrence(run: Solution, events: Sequence[Event]) -> Cycle | None:
    """The shortest repetition at the end of a run: k events that equal the k before them."""
    best: Cycle | None = None
    scale = 1.0 + max((float(np.max(np.abs(e.x), initial=0.0)) for e in events), default=0.0)
    for k in range(1, len(events) // 2 + 1):
        pairs = list(zip(events[-k:], events[-2 * k : -k], strict=True))
        if any(_word(a) != _word(b) for a, b in pairs):
            continue
        gap = max(float(np.max(np.abs(a.x - b.x))) for a, b in pairs) / scale
        shifts = np.array([a.t - b.t for a, b in pairs])
        gap = max(gap, float(np.ptp(shifts)) / (1.0 + abs(float(shifts[-1]))))
        if gap < 1e-7 and shifts[-1] > 0:
            found = Cycle(run, float(shifts[-1]), tuple(events[-k:]), gap)
            if best is None or found.residual < 1e-2 * best.residual:
                best = found
            if found.residual < 3e-11:
                return found
    return best
