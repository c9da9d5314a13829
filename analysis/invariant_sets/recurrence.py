"""Cells of a grid in state space, and how long each of many solutions has been on cells visited before.

Space is cut into boxes without a bound; a box is a whole number made of its place. A solution that for many
iterates comes only to cells of its own past has come to an attractor, or is slow.
Source: Datseris & Wagemakers 2022, Chaos 32, 023104; Nusse & Yorke 1997.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array, Whole

# Odd factors that spread the places over 64 bits (Steele, Lea & Flood 2014, OOPSLA, 453).
_SPREAD = np.array([0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB], dtype=np.uint64)

MOST_AROUND = 4


class Grid:
    """Cells of edge `size / cells` from the corner `low`; arrays (n,)."""

    def __init__(self, low: Array, size: Array, cells: int) -> None:
        self.low, self.edge = low, size / cells

    def places(self, x: Array) -> Whole:
        """Whole numbers (k, n) of the cells that hold states (k, n)."""
        return np.floor(np.clip((x - self.low) / self.edge, -1e9, 1e9)).astype(np.int64)

    def names(self, x: Array) -> npt.NDArray[np.uint64]:
        """One number per cell, (k,)."""
        total = np.zeros(len(x), dtype=np.uint64)
        for column in self.places(x).T.astype(np.uint64):
            total = (total ^ column) * _SPREAD[0]
            total = (total ^ (total >> np.uint64(30))) * _SPREAD[1]
            total = (total ^ (total >> np.uint64(27))) * _SPREAD[2]
        return total

    def around(self, x: Array) -> Array:
        """Middles of the cells that hold states (k, n), and in up to four dimensions of their neighbours."""
        places = np.unique(self.places(x), axis=0)
        n = places.shape[1]
        if n <= MOST_AROUND:
            beside = np.stack(np.meshgrid(*[[-1, 0, 1]] * n, indexing="ij"), axis=-1).reshape(-1, n)
            places = np.unique((places[:, None, :] + beside[None]).reshape(-1, n), axis=0)
        return np.asarray(self.low + (places + 0.5) * self.edge)


class Past:
    """The cells of every solution so far, and `streak`: iterates in a row on cells visited before."""

    def __init__(self, count: int) -> None:
        self.cells = np.zeros((count, 64), dtype=np.uint64)
        self.length = 0
        self.streak = np.zeros(count, dtype=np.int64)

    def add(self, rows: Whole, names: npt.NDArray[np.uint64]) -> None:
        """Enter the cells to which these solutions have come; the others have ended."""
        if self.length == self.cells.shape[1]:
            self.cells = np.hstack([self.cells, np.zeros_like(self.cells)])
        known = np.any(self.cells[rows, : self.length] == names[:, None], axis=1)
        self.streak[rows] = np.where(known, self.streak[rows] + 1, np.minimum(self.streak[rows], 0))
        self.cells[rows, self.length] = names
        self.length += 1
