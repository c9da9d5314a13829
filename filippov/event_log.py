"""Events as they come out of the compiled loop: kept as arrays, made into Event objects on demand."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov._kernels import codes
from filippov.events import Event, Events, Mode
from filippov.status import EventKind

Array = npt.NDArray[np.float64]
_KINDS = {
    codes.CROSSING_UP: EventKind.CROSSING,
    codes.CROSSING_DOWN: EventKind.CROSSING,
    codes.ENTRY: EventKind.ENTRY,
    codes.EXIT_UP: EventKind.EXIT,
    codes.EXIT_DOWN: EventKind.EXIT,
    codes.GRAZING: EventKind.GRAZING,
    codes.RESET: EventKind.RESET,
}


class EventLog(Events):
    """The events of a run in the order of integration, growing while it runs."""

    def __init__(self, names: tuple[str, ...], sense: int, n: int, keep: int | None = None) -> None:
        self.names, self.sense, self.n, self.keep = names, sense, n, keep
        self.counts: Counter[tuple[int, EventKind]] = Counter()
        self._made: list[Event] = []
        self._raw: list[tuple[Array, npt.NDArray[np.int64]]] = []
        self._waiting = 0

    @property
    def _items(self) -> list[Event]:
        for floats, marks in self._raw:
            m = (marks.shape[1] - 2) // 2
            floats.flags.writeable = False
            states, jumped = floats[:, 3 : 3 + self.n], floats[:, 3 + self.n :]
            for k, (row, mark) in enumerate(zip(floats[:, :3].tolist(), marks.tolist(), strict=True)):
                before, after = tuple(mark[2 : 2 + m]), tuple(mark[2 + m :])
                x_after = jumped[k] if mark[1] == codes.RESET else None
                kind = _KINDS[mark[1]]
                self._append(row[0], mark[0], kind, before, after, states[k], row[1], row[2], x_after=x_after)
        self._raw, self._waiting = [], 0
        return self._made

    @_items.setter
    def _items(self, value: list[Event]) -> None:
        self._made = list(value)

    def _append(
        self, t: float, index: int, kind: EventKind, before: Mode, after: Mode, x: Array, multiplier: float,
        residual: float, note: str = "", together: bool = False, x_after: Array | None = None,
    ) -> None:  # fmt: skip
        group = self._made[-1].group + (0 if together else 1) if self._made else 0
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

    def add_rows(self, floats: Array, marks: npt.NDArray[np.int64]) -> None:
        """Append rows as the loop writes them (copied)."""
        if len(floats):
            self._raw.append((floats.copy(), marks.copy()))
            self._waiting += len(floats)
            pairs, numbers = np.unique(marks[:, :2], axis=0, return_counts=True)
            for (index, kind), number in zip(pairs.tolist(), numbers.tolist(), strict=True):
                self.counts[index, _KINDS[kind]] += number
            self._forget()

    @property
    def total(self) -> int:
        """The number of events so far, whether they are kept or not."""
        return self.counts.total()

    def _forget(self) -> None:
        """With `keep`, drop all but the last events: the run needs no more to go on."""
        if self.keep is not None and len(self) > 2 * self.keep:
            del self._items[: -self.keep]

    def add(self, *values: Any, **named: Any) -> Event:
        """Append one event found by the general path; returns it."""
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

    def __len__(self) -> int:
        return len(self._made) + self._waiting

    def __bool__(self) -> bool:
        return len(self) > 0

    def __getstate__(self) -> dict[str, Any]:
        rest = {"_made": self._items, "_raw": [], "_waiting": 0, "keep": self.keep, "counts": self.counts}
        return {"names": self.names, "sense": self.sense, "n": self.n, **rest}
