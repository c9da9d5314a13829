"""Rows of a table of results, and the work that makes them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array, Whole
from filippov.sweep.points import Points

# What a row can hold beside the names of `Status`: a function of the user raised; the point ends its worker.
ERROR, QUARANTINED = "error", "quarantined"
DONE = ("success", "stopped")


@dataclass(frozen=True)
class Rows:
    """Results of some points.

    index    numbers of the points, (k,); values: one row each, (k, c), NaN where there is none
    status   name of a Status, "error" or "quarantined", one each
    message  cause of a row that failed, by the number of its point
    """

    index: Whole
    values: Array
    status: tuple[str, ...]
    message: Mapping[int, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.index)

    @property
    def failed(self) -> int:
        """How many rows are no success."""
        return sum(status not in DONE for status in self.status)


def failed_row(point: int, columns: int, status: str, message: str) -> Rows:
    """The row of one point that has no values."""
    return Rows(np.array([point]), np.full((1, columns), np.nan), (status,), {point: message})


@dataclass(frozen=True)
class Limits:
    """What one point may take.

    max_time  seconds, None for no limit
    late      called with the number of a point that does not return; ends the process, None where that is
              not possible
    apart     compute the points asked for and no others of their block: one of them may end the process
    """

    max_time: float | None = None
    late: Callable[[int], Any] | None = None
    apart: bool = False


class Work(Protocol):
    """Something to be computed point by point; it is sent to other processes.

    fields   all that decides the results, by name; two runs mix only where every field agrees
    unseen   what decides them as well but cannot be compared, in words; a run goes on with rows of an
             earlier one only where the caller says that they can be trusted
    names    of the coordinates; points: their values, (N, P), an array or a Grid
    columns  of the results; units: of coordinates and columns, where known
    first    number of points to begin with in one go
    grain    points that are always computed together, as a block 0 ... grain - 1, grain ... 2 grain - 1, ...:
             where a result depends on its neighbours these are then always the same
    """

    @property
    def fields(self) -> Mapping[str, str]: ...  # noqa: D102
    @property
    def unseen(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def names(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def points(self) -> Points: ...  # noqa: D102
    @property
    def columns(self) -> tuple[str, ...]: ...  # noqa: D102
    @property
    def units(self) -> Mapping[str, str]: ...  # noqa: D102
    @property
    def first(self) -> int: ...  # noqa: D102
    @property
    def grain(self) -> int: ...  # noqa: D102

    def compute(self, index: Whole, limits: Limits) -> Rows:
        """Rows of the points with these numbers."""


def in_blocks(
    index: Whole, grain: int, points: int, limits: Limits, compute: Callable[[Whole], Rows]
) -> Rows:
    """Rows of the points asked for, computed block by block."""
    if limits.apart or grain == 1:
        return compute(index)
    parts = []
    for block in np.unique(index // grain).tolist():
        rows = compute(np.arange(block * grain, min((block + 1) * grain, points)))
        parts.append(chosen(rows, np.isin(rows.index, index)))
    return joined(parts)


def chosen(rows: Rows, which: npt.NDArray[np.bool_]) -> Rows:
    """Some of the rows."""
    index = rows.index[which]
    status = tuple(status for status, keep in zip(rows.status, which.tolist(), strict=True) if keep)
    kept = set(index.tolist())
    message = {point: text for point, text in rows.message.items() if point in kept}
    return Rows(index, rows.values[which], status, message)


def joined(parts: list[Rows]) -> Rows:
    """All rows of several."""
    message = {point: text for part in parts for point, text in part.message.items()}
    return Rows(
        np.concatenate([part.index for part in parts]), np.concatenate([part.values for part in parts]),
        tuple(status for part in parts for status in part.status), message,
    )  # fmt: skip
