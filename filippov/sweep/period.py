"""The period of a solution from the events on one surface."""

from __future__ import annotations

from collections.abc import Iterable

from filippov.solving.state.events import Event

# Beyond so many of its own intervals without an event, a kind of event belongs to a transient.
SILENCE = 1.5


def period_of(events: Iterable[Event], begin: float, end: float) -> float:
    """Mean time between events of the same kind in the same direction, in the part from `begin` to `end`.

    An event's kind and direction is its EventKind with the signs of its surface before and after it: an entry
    from h > 0, one from h < 0 and an exit are three. Kinds that do not go on from `begin` to `end` are left
    out; of the others the one that comes back most seldom gives the period, as others may come several times
    in it. NaN where none is left.
    """
    times: dict[tuple[object, ...], list[float]] = {}
    low, high = sorted((begin, end))
    for event in events:
        if low <= event.t <= high:
            signs = (event.before[event.index], event.after[event.index])
            times.setdefault((event.kind, *signs), []).append(event.t)
    found = []
    for t in times.values():
        if len(t) < 2:
            continue
        mean = abs(t[-1] - t[0]) / (len(t) - 1)
        if max(abs(t[0] - begin), abs(end - t[-1])) <= SILENCE * mean:
            found.append(mean)
    return max(found, default=float("nan"))
