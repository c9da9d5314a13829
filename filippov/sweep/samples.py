"""The points of a sweep: a grid, a list, a Latin hypercube or Sobol's sequence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from filippov.base.arrays import Array
from filippov.base.errors import UsageError
from filippov.base.given import check_count
from filippov.base.names import unknown
from filippov.sweep.points import Grid, Points

SAMPLES = ("grid", "list", "latin_hypercube", "sobol")
MOST = 50_000_000
_PIECE = 1 << 16


def sample(over: Mapping[str, Any], samples: str, n: int | None, seed: int) -> Points:
    """Points (N, len(over)) from values by name, or from (low, high) by name. Raises UsageError."""
    if samples not in SAMPLES:
        raise UsageError(unknown("samples", samples, SAMPLES))
    columns = {name: _numbers(name, values) for name, values in over.items()}
    if not columns:
        raise UsageError('over is empty, expected values by name: {"P": [10, 20], "x0.v": [0, 1]}.')
    drawn = samples in ("latin_hypercube", "sobol")
    if drawn != (n is not None):
        raise UsageError(
            f"n is {n!r} for samples={samples!r}: expected "
            + ("the number of points." if drawn else "none, because the values themselves are the points.")
        )
    if n is not None:
        return _draw(columns, samples, check_count("n", n), seed)
    if samples == "list":
        lengths = {name: len(column) for name, column in columns.items()}
        if len(set(lengths.values())) > 1:
            raise UsageError(f"samples='list' pairs values one by one, but their numbers differ: {lengths}.")
        return np.column_stack(list(columns.values()))
    if math.prod(len(column) for column in columns.values()) > MOST:
        raise UsageError(f"the grid has more than {MOST} points. Make it coarser.")
    return Grid(tuple(columns.values()))


def _draw(columns: Mapping[str, Array], samples: str, n: int, seed: int) -> Array:
    if seed < 0:
        raise UsageError(f"seed is {seed!r}, expected a whole number of at least 0.")
    if n > MOST:
        raise UsageError(
            f"n is {n}, expected at most {MOST}: make several sweeps, each with a seed of its own."
        )
    for name, column in columns.items():
        if len(column) != 2 or not column[0] < column[1]:
            raise UsageError(f"over: {name} is {column.tolist()}, expected (low, high) for {samples!r}.")
    ends = np.array(list(columns.values()))
    generator = np.random.default_rng(seed)
    out = (_sobol if samples == "sobol" else _latin_hypercube)(len(ends), n, generator)
    out *= ends[:, 1] - ends[:, 0]
    out += ends[:, 0]
    return out


def _sobol(dimension: int, n: int, generator: np.random.Generator) -> Array:
    """The first n points of a scrambled sequence in the unit cube."""
    from scipy.stats import qmc

    sequence = qmc.Sobol(dimension, rng=generator)
    out = np.empty((n, dimension))
    # Pieces of a power of two that divides all of them: the sequence is the same, its room is not.
    size = min(_PIECE, 1 << math.ceil(math.log2(n)))
    for first in range(0, n, size):
        out[first : first + size] = sequence.random(size)[: n - first]
    return out


def _latin_hypercube(dimension: int, n: int, generator: np.random.Generator) -> Array:
    """One point in each of n slices of every axis: (k_i - u_i)/n, k a permutation of 1 ... n.

    In place, with the draws of `scipy.stats.qmc.LatinHypercube`.
    """
    generator = generator.spawn(1)[0]
    out = generator.uniform(size=(n, dimension))
    for axis in range(dimension):
        _spread(out[:, axis], generator)
    return out


def _spread(u: Array, generator: np.random.Generator) -> None:
    """u_i = (k_i - u_i)/n, in place."""
    order = np.arange(1, u.size + 1)
    generator.shuffle(order)
    np.subtract(order, u, out=u)
    u /= u.size


def _numbers(name: str, values: Any) -> Array:
    if hasattr(values, "to_numpy") and getattr(values, "ndim", 0) == 1:  # a column of a table
        values = values.to_numpy()
    if isinstance(values, str) or not isinstance(values, Sequence | np.ndarray):
        raise UsageError(f"over: {name} is {values!r}, expected a list of numbers: over={{{name!r}: [...]}}.")
    try:
        column = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise UsageError(f"over: {name} is {values!r}, expected numbers.") from None
    if column.ndim != 1 or not column.size or not np.all(np.isfinite(column)):
        raise UsageError(f"over: {name} is {values!r}, expected one or more finite numbers.")
    return column
