"""Events as they come out of the compiled loop: kept as arrays, made into Event objects on demand."""

from __future__ import annotations

from collections import Counter
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array
from filippov.base.status import JUMPED_OVER, EventKind
from filippov.kernel.loop.event_cycle import CYCLES, LONGEST_CYCLE
from filippov.kernel.tables import codes
from filippov.solving.state.events import Event, Events, Mode

# Roots closer than this part of the time, among the last events, are separated by rounding only.
CROWDED, LOOK_BACK = 1e-9, 8
MANY_ROOTS = "not resolved: a multiple root, or several next to each other"
_KINDS = {
    codes.CROSSING_UP: EventKind.CROSSING,
    codes.CROSSING_DOWN: EventKind.CROSSING,
    codes.ENTRY: EventKind.ENTRY,
    codes.EXIT_UP: EventKind.EXIT,
    codes.EXIT_DOWN: EventKind.EXIT,
    codes.GRAZING: EventKind.GRAZING,
    codes.RESET: EventKind.RESET,
    codes.TIME: EventKind.TIME,
    codes.TIME_RESET: EventKind.TIME,
    codes.OVER_UP: EventKind.CROSSING,
    codes.OVER_DOWN: EventKind.CROSSING,
}
_CODES = max(_KINDS) + 1
_JUMPS, _OVER = (codes.RESET, codes.TIME_RESET), (codes.OVER_UP, codes.OVER_DOWN)


def looked_at(surfaces: int) -> int:
    """Among how many of the last events cycles are looked for that accumulate."""
    return (LONGEST_CYCLE * CYCLES + 1) * max(surfaces, 1)


class Past(NamedTuple):
    """Events as arrays: times, numbers of surfaces, whether they are grazings, states."""

    t: Array
    surface: npt.NDArray[np.int64]
    grazing: npt.NDArray[np.bool_]
    x: Array


class EventLog(Events):
    """The events of a run in the order of integration, growing while it runs."""

    # The group before the first event that is kept.
    _base = -1

    def __init__(
        self, names: tuple[str, ...], sense: int, n: int, keep: int | None = None, always: range = range(0)
    ) -> None:
        self.names: tuple[str, ...] = names
        self.sense, self.n, self.keep, self.always = sense, n, keep, always
        self._room = 2 * keep if keep is not None else 0
        self.counts: Counter[tuple[int, EventKind]] = Counter()
        self._made: list[Event] = []
        self._raw: list[tuple[Array, npt.NDArray[np.int64]]] = []
        self._waiting = 0

    @property
    def _items(self) -> list[Event]:
        for floats, marks in self._raw:
            m = (marks.shape[1] - 3) // 2
            floats.flags.writeable = False
            states, jumped = floats[:, 3 : 3 + self.n], floats[:, 3 + self.n :]
            # What happens with a reset is told with the state after it too.
            moved = np.any(jumped != states, axis=1).tolist() if jumped.size else [False] * len(marks)
            for k, (row, mark) in enumerate(zip(floats[:, :3].tolist(), marks.tolist(), strict=True)):
                before, after = tuple(mark[2 : 2 + m]), tuple(mark[2 + m : -1])
                x_after = jumped[k] if moved[k] or mark[1] in _JUMPS else None
                note = JUMPED_OVER if mark[1] in _OVER else ""
                self._append(
                    row[0], mark[0], _KINDS[mark[1]], before, after, states[k], row[1], row[2], note,
                    mark[-1] != 0, x_after,
                )  # fmt: skip
        self._raw, self._waiting = [], 0
        return self._made

    @_items.setter
    def _items(self, value: list[Event]) -> None:
        self._made = list(value)

    @property
    def t(self) -> Array:
        """Times of the events, which need not be made for it."""
        made = np.array([event.t for event in self._made])
        return np.concatenate([made, *(floats[:, 0] for floats, _ in self._raw)])

    def _append(
        self, t: float, index: int, kind: EventKind, before: Mode, after: Mode, x: Array, multiplier: float,
        residual: float, note: str = "", together: bool = False, x_after: Array | None = None,
    ) -> None:  # fmt: skip
        if index in self.always and not note:
            note = self._crowded(t, index)
        last = self._made[-1].group if self._made else self._base
        group = max(0, last + (0 if together else 1))
        self._made.append(
            Event(
                t,
                self.names[index],
                index,
                kind,
                before,
                after,
                x,
                multiplier,
                residual,
                group,
                note,
                x_after,
                self.sense,
            )
        )

    def _crowded(self, t: float, index: int) -> str:
        """What is said of a root next to another one of the same guard (E2)."""
        near = any(e.index == index and abs(e.t - t) <= CROWDED * abs(t) for e in self._made[-LOOK_BACK:])
        return MANY_ROOTS if near else ""

    def add_rows(self, floats: Array, marks: npt.NDArray[np.int64]) -> None:
        """Append rows as the loop writes them (copied)."""
        if not len(floats):
            return
        numbers = np.bincount(_CODES * marks[:, 0] + marks[:, 1])
        for place in np.flatnonzero(numbers).tolist():
            self.counts[place // _CODES, _KINDS[place % _CODES]] += int(numbers[place])
        if self.keep is not None and not self.always and self.keep <= len(floats) > self._room - len(self):
            # None of the others would be kept: they need not be made.
            older = [*(rows for _, rows in self._raw), marks[: len(marks) - self.keep]]
            last = self._made[-1].group if self._made else self._base
            self._base = last + sum(int(np.count_nonzero(rows[:, -1] == 0)) for rows in older)
            floats, marks = floats[-self.keep :], marks[-self.keep :]
            self._made, self._raw, self._waiting = [], [], 0
        self._raw.append((floats.copy(), marks.copy()))
        self._waiting += len(floats)
        self._forget()

    @property
    def total(self) -> int:
        """The number of events so far, whether they are kept or not."""
        return self.counts.total()

    def _forget(self) -> None:
        """With `keep`, drop all but the last events and those of `always`, which were asked for."""
        if self.keep is not None and len(self) > self._room:
            older = self._items[: -self.keep]
            self._items[: -self.keep] = [event for event in older if event.index in self.always]
            self._room = 2 * max(self.keep, len(self))

    def add(self, *values: Any, **named: Any) -> Event:
        """Append one event found by the classification; returns it."""
        items = self._items
        self._append(*values, **named)
        self.counts[items[-1].index, items[-1].kind] += 1
        self._forget()
        return items[-1]

    def table(self) -> tuple[Array, Array]:
        """Times and states of all events, without making objects of those that are still rows."""
        times = [np.array([event.t for event in self._made])] + [floats[:, 0] for floats, _ in self._raw]
        states = [event.x[None, :] for event in self._made] + [
            floats[:, 3 : 3 + self.n] for floats, _ in self._raw
        ]
        return np.concatenate(times), np.concatenate(states) if states else np.zeros((0, 0))

    def past(self, count: int) -> Past:
        """The last events, at most so many, without making objects of those that are still rows."""
        rows, missing = [], count
        for block, notes in reversed(self._raw):
            floats, marks = block[-missing:], notes[-missing:]
            states = floats[:, 3 : 3 + self.n]
            rows.append((floats[:, 0], marks[:, 0], marks[:, 1] == codes.GRAZING, states))
            missing -= len(floats)
            if missing <= 0:
                break
        made = self._made[-missing:] if missing > 0 else []
        if made or not rows:
            kinds = np.array([e.kind is EventKind.GRAZING for e in made], dtype=bool)
            numbers = np.array([e.index for e in made], dtype=np.int64)
            states = np.array([e.x for e in made]).reshape(len(made), self.n)
            rows.append((np.array([e.t for e in made], dtype=float), numbers, kinds, states))
        return Past(*(np.concatenate(parts) for parts in zip(*rows[::-1], strict=True)))

    def __len__(self) -> int:
        return len(self._made) + self._waiting

    def __bool__(self) -> bool:
        return len(self) > 0

    def __getstate__(self) -> dict[str, Any]:
        rest = {"_made": self._items, "_raw": [], "_waiting": 0, "keep": self.keep, "counts": self.counts}
        rest |= {"always": self.always, "_room": self._room, "_base": self._base}
        rest |= {"place_of": self.place_of, "states": self.states}
        return {"names": self.names, "sense": self.sense, "n": self.n, **rest}
