"""The points of a sweep: a grid, a list, a Latin hypercube or Sobol's sequence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from filippov.errors import UsageError
from filippov.names import unknown
from filippov.options import check_count
from filippov.sweep.rows import Array

SAMPLES = ("grid", "list", "latin_hypercube", "sobol")
MOST = 50_000_000


def sample(vary: Mapping[str, Any], samples: str, n: int | None, seed: int) -> Array:
    """Points (N, len(vary)) from values by name, or from (low, high) by name. Raises UsageError."""
    if samples not in SAMPLES:
        raise UsageError(unknown("samples", samples, SAMPLES))
    columns = {name: _numbers(name, values) for name, values in vary.items()}
    if not columns:
        raise UsageError('vary is empty, expected values by name: {"P": [10, 20], "x0.v": [0, 1]}.')
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
    grid = np.meshgrid(*columns.values(), indexing="ij")
    return np.column_stack([axis.ravel() for axis in grid])


def shape_of(vary: Mapping[str, Any], samples: str, count: int) -> tuple[int, ...]:
    """Shape of the grid; (count,) for points that are none."""
    return tuple(len(values) for values in vary.values()) if samples == "grid" else (count,)


def _draw(columns: Mapping[str, Array], samples: str, n: int, seed: int) -> Array:
    from scipy.stats import qmc

    if seed < 0:
        raise UsageError(f"seed is {seed!r}, expected a whole number of at least 0.")
    if n > MOST:
        raise UsageError(f"n is {n}, more than {MOST}.")
    for name, column in columns.items():
        if len(column) != 2 or not column[0] < column[1]:
            raise UsageError(f"vary: {name} is {column.tolist()}, expected (low, high) for {samples!r}.")
    ends = np.array(list(columns.values()))
    generator = np.random.default_rng(seed)
    if samples == "sobol":
        u = qmc.Sobol(len(ends), rng=generator).random_base2(math.ceil(math.log2(n)))[:n]
    else:
        u = qmc.LatinHypercube(len(ends), rng=generator).random(n)
    return np.asarray(ends[:, 0] + (ends[:, 1] - ends[:, 0]) * u)


def _numbers(name: str, values: Any) -> Array:
    if isinstance(values, str) or not isinstance(values, Sequence | np.ndarray):
        raise UsageError(f"vary: {name} is {values!r}, expected a list of numbers.")
    try:
        column = np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise UsageError(f"vary: {name} is {values!r}, expected numbers.") from None
    if column.ndim != 1 or not column.size or not np.all(np.isfinite(column)):
        raise UsageError(f"vary: {name} is {values!r}, expected one or more finite numbers.")
    return column
