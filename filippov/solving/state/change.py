"""What changes at one instant: the mode and state before, and the kind of event on each surface."""

from __future__ import annotations

from dataclasses import dataclass

from filippov.base.arrays import Array
from filippov.base.status import EventKind
from filippov.solving.state.events import Mode


@dataclass(frozen=True)
class Jump:
    """Mode and state before the events of one instant, the surfaces that reset, the time events.

    together: they belong to the set of the event before.
    knot: the surfaces that the state was on before a knot of an input; None where there is no knot.
    since: the mode before the first of the set, where that is another one.
    """

    before: Mode
    x: Array
    by: tuple[int, ...] = ()
    clocks: tuple[int, ...] = ()
    together: bool = False
    knot: tuple[int, ...] | None = None
    since: Mode | None = None


def change_of(before: int, after: int, reached: bool) -> EventKind | None:
    """The kind of event on a surface whose sign was `before` and is `after`; None where nothing happens."""
    if before == after:
        return EventKind.GRAZING if reached and before != 0 else None
    if after == 0:
        return EventKind.ENTRY
    return EventKind.EXIT if before == 0 else EventKind.CROSSING


def passed_to(mode: Mode, i: int) -> Mode:
    """The mode behind an observer that is reached with a speed where a reset turns the solution back."""
    return (*mode[:i], -mode[i], *mode[i + 1 :])
