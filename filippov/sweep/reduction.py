"""A summary of a table: mean, extrema and the like of every column, over the points that succeeded."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from filippov.base.errors import UsageError
from filippov.base.given import names
from filippov.base.names import unknown
from filippov.sweep.rows import DONE
from filippov.sweep.table import SweepTable

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "mean": np.mean, "min": np.min, "max": np.max, "median": np.median, "std": np.std, "count": np.size
}  # fmt: skip
REDUCTIONS = tuple(_FUNCTIONS)


def check_reduce(given: Any) -> Any:
    """None, a function, or names of reductions. Raises UsageError."""
    if given is None or callable(given):
        return given
    found = names("reduce", given)
    for name in found:
        if name not in _FUNCTIONS:
            raise UsageError(unknown("reduction", name, REDUCTIONS))
    return found


def reduce_table(table: SweepTable, how: Any) -> Any:
    """What a function makes of a table; or {column: {name: value}}, None where no point has a value."""
    if callable(how):
        return how(table)
    good = np.array([status in DONE for status in table.status], dtype=bool)
    out: dict[str, dict[str, float | None]] = {}
    for k, column in enumerate(table.columns):
        values = table.values[good, k]
        values = values[~np.isnan(values)]
        out[column] = {
            name: float(_FUNCTIONS[name](values)) if values.size or name == "count" else None for name in how
        }
    return out
