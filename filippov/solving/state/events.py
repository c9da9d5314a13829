"""Events of a run, and those at which it stops."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, overload

import numpy as np
import numpy.typing as npt

from filippov.base.delegates import delegate
from filippov.base.errors import ModelError, UsageError
from filippov.base.keywords import constructor, keywords
from filippov.base.names import Answering, unknown
from filippov.base.status import EventKind, mode_text, no_kind

Mode = tuple[int, ...]


class Event(NamedTuple):
    """One event on one surface.

    t           time
    surface     name of the surface, time event or user event; index: its number among them in this order
    kind        EventKind
    before      mode before it in the direction of integration, after: the mode then taken
    x           state at the event (after it: x_after, which differs at a reset only)
    multiplier  value of the surface's sign in sliding, where the solution slides before or after; for a user
                event its direction; else NaN
    residual    |h| at the event (for an exit: the guard of the multiplier)
    group       events with the same number happen at the same instant and are one set
    note        what is special: two-fold, ambiguous corner, repelling sliding, ...
    sense       +1 in a run forwards in time, -1 backwards
    """

    t: float
    surface: str
    index: int  # type: ignore[assignment]  # a tuple's method of that name is not missed here
    kind: EventKind
    before: Mode
    after: Mode
    x: npt.NDArray[np.float64]
    multiplier: float
    residual: float
    group: int
    note: str = ""
    x_after: npt.NDArray[np.float64] | None = None
    sense: int = 1

    @property
    def direction(self) -> int:
        """+1 where the surface is left or crossed towards h > 0 in true time, -1 towards h < 0, else 0."""
        if self.kind is EventKind.CROSSING:
            return self.after[self.index] * self.sense
        if self.kind is EventKind.USER:
            return int(self.multiplier)
        return self.after[self.index] if self.kind is EventKind.EXIT else 0

    def __str__(self) -> str:
        arrow = f"{mode_text(self.before)} -> {mode_text(self.after)}"
        note = f" ({self.note})" if self.note else ""
        return f"t = {self.t:.12g}  {self.kind} on '{self.surface}'  {arrow}{note}"


if not TYPE_CHECKING:  # a NamedTuple has no other bases
    Event.__getattr__ = Answering.__getattr__


class Events(Answering, Sequence[Event]):
    """The events of a run in the order of integration."""

    _elsewhere: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(("times", "time"), "their times are t: events.of('v').t."),
        **dict.fromkeys(("states", "y"), "the states at them are x, one row per event."),
        **dict.fromkeys(("to_csv", "df"), "events.to_pandas() is a table; .to_csv('events.csv') writes it."),
        **dict.fromkeys(("filter", "where", "select", "on"), "events.of(surface, kind) selects."),
    }
    # The number and the sense of a surface asked for by name or formula (`System.surface_place`).
    place_of: Callable[[str], tuple[int, int]] | None = None
    # Names of what can happen: surfaces, time events, user events; of states; None where nothing is known.
    names: tuple[str, ...] | None = None
    states: tuple[str, ...] | None = None

    def __init__(self, items: Sequence[Event] = (), like: Events | None = None) -> None:
        self._items = list(items)
        if like is not None:
            self.place_of, self.names, self.states = like.place_of, like.names, like.states

    @overload
    def __getitem__(self, item: int) -> Event: ...
    @overload
    def __getitem__(self, item: slice) -> Events: ...
    def __getitem__(self, item: int | slice) -> Event | Events:
        given: object = item
        if isinstance(given, str):
            raise UsageError(
                f"events go by number or slice, not {item!r}: events.of({item!r}) has those of a name."
            )
        if isinstance(item, slice):
            return Events(self._items[item], self)
        try:
            return self._items[item]
        except IndexError:
            raise IndexError(
                f"there is no event {item!r}: there are {len(self)}, numbered from 0; len(events) tells."
            ) from None

    def __len__(self) -> int:
        return len(self._items)

    def __iter__(self) -> Iterator[Event]:
        return iter(self._items)

    def __repr__(self) -> str:
        return "\n".join(str(event) for event in self._items) or "no events"

    def of_surfaces(self, m: int) -> Events:
        """The events on surfaces, of which there are m: without time events and those of the user."""
        return Events([event for event in self._items if event.index < m], self)

    @property
    def t(self) -> npt.NDArray[np.float64]:
        """Times of the events."""
        return np.array([event.t for event in self._items])

    @property
    def x(self) -> npt.NDArray[np.float64]:
        """States at the events, one row per event."""
        return np.array([event.x for event in self._items])

    @keywords()
    def of(
        self, surface: str | None = None, kind: EventKind | str | None = None, direction: int = 0
    ) -> Events:
        """The events on one surface, of one kind, in one direction (0: either).

        surface     name of a surface, time event or user event, or the formula of a surface's h: for
                    h = v - vb also "vb - v", which rises where v - vb falls

        Raises UsageError for an unknown surface or kind of event.
        """
        wanted = None if kind is None else EventKind(kind)
        if direction not in (-1, 0, 1):
            raise UsageError(f"direction is {direction!r}, expected 1 (up), -1 (down) or 0 (either).")
        if surface is not None and all(event.surface != surface for event in self._items):
            surface, direction = self._asked(surface, direction)
        return Events(
            [
                event
                for event in self._items
                if (surface is None or event.surface == surface)
                and (wanted is None or event.kind is wanted)
                and direction in (0, event.direction)
            ],
            self,
        )

    @keywords()
    def count(self, surface: Any = None, kind: EventKind | str | None = None, direction: int = 0) -> int:
        """The number of events on one surface, of one kind, in one direction, as in `of`."""
        if isinstance(surface, Event):
            return sum(event is surface for event in self)
        return len(self.of(surface, kind, direction))

    def to_pandas(self) -> Any:
        """A pandas.DataFrame with one row per event (see `filippov.io.export`)."""
        return delegate("Events.to_pandas")(self)

    def _repr_html_(self) -> str:
        text: str = delegate("Events._repr_html_")(self)
        return text

    def _asked(self, surface: str, direction: int) -> tuple[str, int]:
        """The name under which the events of a surface stand, and the direction for it."""
        if self.names is not None and surface in self.names:
            return surface, direction
        try:
            if self.place_of is None:
                raise ModelError
            index, sense = self.place_of(surface)
        except ModelError:
            if self.names is None:
                return surface, direction  # of another system: none
            raise UsageError(unknown("surface or event", surface, self.names)) from None
        name = next((event.surface for event in self._items if event.index == index), surface)
        return name, direction * sense


_COLUMNS = {
    "crossing": (1, 2),
    "crossing up": (1,),
    "crossing down": (2,),
    "sliding entry": (3,),
    "sliding exit": (4, 5),
    "sliding exit up": (4,),
    "sliding exit down": (5,),
    "grazing": (6,),
    "reset": (7,),
}
_EITHER = {"crossing": 8, "sliding exit": 9}
STOP_KINDS = tuple(_COLUMNS)


def columns_of(kind: str) -> tuple[int, ...]:
    """The kernel's numbers for a kind of event, named as in `Stop`. Raises UsageError."""
    if kind not in _COLUMNS:
        raise UsageError(no_kind(kind, _COLUMNS))
    return _COLUMNS[kind]


def turned(kind: str) -> str:
    """The same kind of event, named for -h instead of h: up and down are exchanged."""
    word, _, way = str(kind).rpartition(" ")
    return {"up": f"{word} down", "down": f"{word} up"}.get(way, kind)


@constructor()
@dataclass(frozen=True)
class Stop:
    """End the run at the count-th event of a kind on a surface.

    kind    "crossing", "crossing up", "crossing down", "sliding entry", "sliding exit", "sliding exit up",
            "sliding exit down", "grazing" or "reset"; directions are in true time
    count   1, 2, ...; without a direction those in either are counted together

    Raises UsageError.
    """

    surface: str
    kind: str = "crossing"
    count: int = 1

    def __post_init__(self) -> None:
        if self.kind not in _COLUMNS:
            raise UsageError(no_kind(self.kind, _COLUMNS))
        if type(self.count) is not int or self.count < 1:
            raise UsageError(f"Stop: count is {self.count!r}, expected 1, 2, ...")

    def counted(self, count: int) -> Stop:
        """The same with another count."""
        return Stop(self.surface, self.kind, count)

    def on(self, surface: str, sense: int) -> Stop:
        """The same event on the surface of this name; sense -1: its h has the opposite sign."""
        return Stop(surface, self.kind if sense > 0 else turned(self.kind), self.count)

    @property
    def column(self) -> int:
        """Where the kernel counts this kind down."""
        return _EITHER.get(self.kind) or _COLUMNS[self.kind][0]
