"""The points of a sweep: an array (N, P), or a grid, which is stored as its axes and expanded when read."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array, Whole
from filippov.io.archive import Archive

BLOCK = 1 << 18


@dataclass(frozen=True)
class Grid:
    """Every combination of the values of P axes, the last axis fastest: N = product of their lengths points.

    It is indexed as the array (N, P) would be: grid[7], grid[index], grid[:, k], grid[index, k]; np.asarray
    makes all of it, 8 N P bytes.
    """

    axes: tuple[Array, ...]
    ndim = 2

    @property
    def shape(self) -> tuple[int, int]:
        """(N, P)."""
        return len(self), len(self.axes)

    def __len__(self) -> int:
        return math.prod(len(axis) for axis in self.axes)

    def __getitem__(self, key: Any) -> Array:
        rows, columns = key if isinstance(key, tuple) else (key, slice(None))
        index = self._index(rows)
        wanted = np.arange(len(self.axes))[columns]
        if np.ndim(wanted) == 0:
            return self._values(index, int(wanted))
        out = np.empty((*np.shape(index), len(wanted)))
        for place, k in enumerate(wanted.tolist()):
            out[..., place] = self._values(index, k)
        return out

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> npt.NDArray[Any]:
        return np.asarray(self[:], dtype=dtype)

    def tolist(self) -> list[list[float]]:
        """The coordinates of every point."""
        return self[:].tolist()  # type: ignore[no-any-return]

    def _index(self, rows: Any) -> Any:
        count = len(self)
        if isinstance(rows, slice):
            return np.arange(*rows.indices(count))
        index = np.asarray(rows)
        if index.dtype == bool:
            index = np.nonzero(index)[0]
        if index.size and not -count <= int(index.min()) <= int(index.max()) < count:
            raise IndexError(f"points {int(index.min())} ... {int(index.max())} of {count}")
        return np.where(index < 0, index + count, index)

    def _values(self, index: Whole, k: int) -> Array:
        inner = math.prod(len(axis) for axis in self.axes[k + 1 :])
        out: Array = self.axes[k][index // inner % len(self.axes[k])]
        return out


Points = Array | Grid


def extremes(points: Points, k: int) -> tuple[float, float]:
    """The smallest and the largest value of a coordinate."""
    column = points.axes[k] if isinstance(points, Grid) else points[:, k]
    return float(column.min()), float(column.max())


def digest_of(points: Points) -> str:
    """sha256 of the points: of the axes of a grid, else of all values."""
    total = hashlib.sha256()
    for name, array in stored(points).items():
        total.update(f"{name} {array.shape}\n".encode())
        for first in range(0, len(array), BLOCK):
            total.update(np.ascontiguousarray(array[first : first + BLOCK]).tobytes())
    return total.hexdigest()


def stored(points: Points) -> dict[str, npt.NDArray[Any]]:
    """The arrays that a file holds of them."""
    if isinstance(points, Grid):
        lengths = np.array([len(axis) for axis in points.axes], dtype=np.int64)
        return {"lengths": lengths, "axes": np.concatenate(points.axes)}
    return {"points": np.asarray(points, dtype=float)}


def restored(archive: Archive) -> Points:
    """The points that a file holds. Raises UsageError for a file without any."""
    if archive.names == {"points"}:
        return np.asarray(archive.read("points"), dtype=float)
    if archive.names != {"lengths", "axes"}:
        raise archive.refuse("holds no points of a sweep")
    lengths, values = archive.read("lengths"), np.asarray(archive.read("axes"), dtype=float)
    if lengths.ndim != 1 or values.ndim != 1 or np.any(lengths < 1) or int(lengths.sum()) != len(values):
        raise archive.refuse("has axes that do not fit their lengths")
    return Grid(tuple(np.split(values, np.cumsum(lengths)[:-1])))


def shape_of(points: Points) -> tuple[int, ...]:
    """Lengths of the axes of a grid; (N,) for points that are none."""
    return tuple(len(axis) for axis in points.axes) if isinstance(points, Grid) else (len(points),)
