"""The results of a sweep: every point with its row, in the order of the points."""

from __future__ import annotations

import hashlib
import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array, Whole
from filippov.base.errors import SolveError, UsageError
from filippov.base.names import Answering, unknown
from filippov.base.shown import Shown
from filippov.sweep.points import BLOCK, Points
from filippov.sweep.rows import DONE, Rows, Work

UNKNOWN = ""
# Rows that are shown of a table, half of them from its end.
SHOWN = 20


@dataclass(repr=False)
class SweepTable(Shown, Answering):
    """Points and what they gave.

    names            of the coordinates; coordinates: their values, an array or a Grid, `points` as an array
    columns, values  of the results, (N, c); NaN where there is none
    status           name of a Status, "error", "quarantined", or "" for a point not computed
    message          causes of failure by the number of the point
    known            which points have a row; units: of coordinates and columns, where known
    shape            of the grid, where the points are one, else (N,)
    fields           what decided the results, by name
    damaged          chunks that could not be trusted and were computed again
    reduced          what `reduce` made of it
    """

    names: tuple[str, ...]
    coordinates: Points
    columns: tuple[str, ...]
    values: Array
    status: list[str]
    known: npt.NDArray[np.bool_]
    message: dict[int, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    fields: Mapping[str, str] = field(default_factory=dict)
    shape: tuple[int, ...] = ()
    damaged: tuple[str, ...] = ()
    reduced: Any = None

    @classmethod
    def empty(cls, work: Work) -> SweepTable:
        """The table of a work before anything is done."""
        count = len(work.points)
        values = np.full((count, len(work.columns)), np.nan)
        return cls(
            work.names, work.points, work.columns, values, [UNKNOWN] * count, np.zeros(count, dtype=bool),
            units=work.units, fields=work.fields,
        )  # fmt: skip

    def add(self, rows: Rows) -> None:
        """Take in rows; a point that is known already keeps what it has."""
        for k, point in enumerate(rows.index.tolist()):
            if not self.known[point]:
                self.values[point], self.status[point] = rows.values[k], rows.status[k]
                if point in rows.message:
                    self.message[point] = rows.message[point]
        self.known[rows.index] = True

    def __len__(self) -> int:
        return len(self.coordinates)

    @cached_property
    def points(self) -> Array:
        """The values of the coordinates, (N, P)."""
        return np.asarray(self.coordinates, dtype=float)

    @property
    def complete(self) -> bool:
        """Whether every point has a row."""
        return bool(self.known.all())

    @property
    def failed(self) -> Whole:
        """Numbers of the points whose run did not succeed."""
        bad = [k for k, status in enumerate(self.status) if status not in DONE and status != UNKNOWN]
        return np.array(bad, dtype=np.int64)

    def raise_errors(self, *status: str) -> None:
        """Raise SolveError with the cause of the first point that failed, in one of these ways or in any."""
        for point in self.failed.tolist():
            if not status or self.status[point] in status:
                values = dict(zip(self.names, self.coordinates[point].tolist(), strict=True))
                raise SolveError(f"{self.status[point]} at {values}: {self.message.get(point, '')}")

    @property
    def counts(self) -> dict[str, int]:
        """Number of points by status."""
        return {name: self.status.count(name) for name in sorted(set(self.status))}

    @property
    def content_hash(self) -> str:
        """sha256 of points, values and status; the same for the same results, however they were computed."""
        total = hashlib.sha256("\n".join((*self.names, *self.columns)).encode())
        for array in (self.coordinates, self.values):
            for first in range(0, len(self), BLOCK):
                part = np.asarray(array[first : first + BLOCK])
                # Every NaN alike, whatever its bits.
                total.update(np.where(np.isnan(part), np.nan, part).astype("<f8").tobytes())
        total.update("\n".join(self.status).encode())
        return total.hexdigest()

    def to_pandas(self) -> Any:
        """A pandas.DataFrame, one row per point: coordinates, results, status. Raises ImportError."""
        try:
            pandas: Any = importlib.import_module("pandas")
        except ImportError:
            raise ImportError("to_pandas needs pandas, which is not installed: pip install pandas") from None
        columns = {name: self[name] for name in (*self.names, *self.columns)}
        return pandas.DataFrame({**columns, "status": self.status})

    def __repr__(self) -> str:
        """How many points there are and how they ended, and the first and last rows."""
        ends = ", ".join(f"{count} {name or 'not computed'}" for name, count in self.counts.items())
        head = [*self.names, *self.columns, "status"]
        every = list(range(len(self)))
        kept = every if len(every) <= SHOWN else [*every[: SHOWN // 2], *every[-SHOWN // 2 :]]
        rows = [head]
        for k in kept:
            row = (*np.asarray(self.coordinates[k], dtype=float), *self.values[k])
            rows.append([*(f"{value:.6g}" for value in row), self.status[k]])
        if len(kept) < len(every):
            rows.insert(1 + SHOWN // 2, ["..."] * len(head))
        wide = [max(len(row[i]) for row in rows) for i in range(len(head))]
        lines = ("  ".join(text.rjust(w) for text, w in zip(row, wide, strict=True)) for row in rows)
        return "\n".join((f"{len(self)} points: {ends}", *lines))

    def __getitem__(self, name: str) -> Array:
        """A coordinate or a column, (N,). Raises UsageError for a name it does not have."""
        if name in self.columns:
            return np.asarray(self.values[:, self.columns.index(name)])
        if name in self.names:
            return np.asarray(self.coordinates[:, self.names.index(name)])
        raise UsageError(unknown("column", name, (*self.names, *self.columns)))
