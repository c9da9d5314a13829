"""Bifurcation diagram by running the event map: where a parameter leads after a transient, chaos included."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from filippov.analysis.maps.map_rows import MapRows
from filippov.analysis.maps.section import Section
from filippov.base.errors import UsageError
from filippov.base.names import unknown
from filippov.model.system import System

Array = npt.NDArray[np.float64]
REST = 1e-8


@dataclass(frozen=True)
class BruteForce:
    """Iterates of the map after a transient.

    parameter, values   what is varied, (k,)
    d        iterates kept, (k, keep); NaN after a motion that does not return
    period   least p with d[i + p] = d[i] to 1e-6 of the range of d, 0 where there is none up to half of keep
    complete False where it was interrupted
    """

    parameter: str
    values: Array
    d: Array
    period: npt.NDArray[np.int64]
    complete: bool = True


def brute_force(
    system: System,
    section: Section,
    parameter: str,
    values: Sequence[float],
    start: float,
    *,
    transient: int = 200,
    keep: int = 64,
    parameters: Mapping[str, float] | None = None,
    follow: bool = False,
    rtol: float = 1e-8,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> BruteForce:
    """Iterate the event map from `start` for every value of a parameter, all values side by side.

    transient, keep  iterates that are dropped, and those that are kept
    follow           start each value at the last iterate of the one before it: branches are followed, one
                     value after the other

    An excursion below 1e-8 of the start is taken for rest. Ctrl-C returns what there is. Raises UsageError.
    """
    if parameter not in system.parameters:
        raise UsageError(unknown("parameter", parameter, system.parameters))
    if transient < 0 or keep < 1:
        raise UsageError(f"transient {transient}, keep {keep}: expected at least 0 and 1.")
    turns = MapRows(system, section, rtol=rtol, threads=threads)
    grid = np.asarray(values, dtype=float)
    rows = turns.rows({parameter: grid}, parameters)
    d = np.full((grid.size, keep), np.nan)
    parts = [slice(k, k + 1) for k in range(grid.size)] if follow else [slice(0, grid.size)]
    here = np.full(grid.size, float(start))
    total, done, complete = (transient + keep) * len(parts), 0, True
    try:
        for number, part in enumerate(parts):
            if follow and number and np.isfinite(here[number - 1]):
                here[number] = here[number - 1]
            for k in range(transient + keep):
                here[part] = turns(rows[part], here[part][:, None])[:, 0]
                # Below the accuracy of a turn there is nothing left to follow.
                here[part] = np.where(np.abs(here[part]) < REST * abs(start), 0.0, here[part])
                if k >= transient:
                    d[part, k - transient] = here[part]
                done += 1
                if progress is not None:
                    progress(done, total)
    except KeyboardInterrupt:
        complete = False
    return BruteForce(parameter, grid, d, _periods(d), complete)


def _periods(d: Array) -> npt.NDArray[np.int64]:
    known = d[np.isfinite(d)]
    size = float(np.ptp(known)) if known.size else 0.0
    out = np.zeros(len(d), dtype=np.int64)
    for i, row in enumerate(d):
        for p in range(1, row.size // 2 + 1):
            if np.all(np.abs(row[p:] - row[:-p]) <= 1e-6 * size):
                out[i] = p
                break
    return out
