"""Contraction of an event map over its coordinate, for many parameter sets at once.

    rho = max over d in [lo, hi], d != 0, of |P(d)/d|

Below 1 every excursion comes back smaller: there is no cycle within the interval, and the set of equilibria
at d = 0 attracts. Every turn of every parameter set is one trajectory of the same ensemble.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from filippov.analysis.maps.map_rows import MapRows, coordinates
from filippov.analysis.maps.section import Section
from filippov.base.errors import UsageError
from filippov.model.system import System

Array = npt.NDArray[np.float64]
CLOSEST = 1e-6
NEAR, FINER, PASSES = 0.8, 7, 2


@dataclass(frozen=True)
class Contraction:
    """Largest |P(d)|/d of each parameter set.

    ratio    (k,); inf where the map leaves the interval without a value that can be judged
    at       d of the largest ratio, (k,)
    nearest  |P(d)|/d at the least d, (k,): what decides about the set of equilibria
    lost     share of the d whose motion does not come back within the section's t_max, (k,)
    """

    ratio: Array
    at: Array
    nearest: Array
    lost: Array


def contraction(
    system: System,
    section: Section,
    values: Mapping[str, Array],
    interval: tuple[float, float],
    *,
    parameters: Mapping[str, float] | None = None,
    points: int = 48,
    rtol: float = 1e-7,
    threads: int | None = None,
) -> Contraction:
    """The largest ratio of successive amplitudes for k parameter sets.

    values      arrays (k,) by parameter name; parameters: the same for all
    interval    (0, hi), or (lo, hi) with lo < 0 for a loop without symmetry: d is taken up to its ends from
                1e-6 of them on, evenly in its logarithm and evenly
    points      number of d on each side

    A motion that comes to rest before the next event counts as ratio 0; one that is still on its way after
    t_max is counted in `lost`. Raises UsageError.
    """
    lo, hi = interval
    if not (lo <= 0.0 < hi and points >= 4):
        raise UsageError(f"interval is {interval}, points {points}; expected lo <= 0 < hi and at least 4.")
    least = CLOSEST * max(hi, -lo)
    d = coordinates(hi, points, CLOSEST)
    if lo < 0.0:
        d = np.append(d, -coordinates(-lo, points, CLOSEST))
    turns = MapRows(system, section, rtol=rtol, atol=1e-3 * rtol * least, threads=threads)
    rows = turns.rows(values, parameters)
    count = len(rows)
    grid = np.broadcast_to(d, (count, d.size))
    ratio = np.abs(turns(rows, grid) / grid)
    known = np.nan_to_num(ratio, nan=-1.0)
    best = np.argmax(known, axis=1)
    largest, at = known[np.arange(count), best], d[best]
    # Between the samples the largest ratio is a little larger: looked for where that may decide.
    close = np.nonzero((largest > NEAR) & (largest < 1) & (best > 0) & (best < d.size - 1))[0]
    if close.size:
        low, high = d[best[close] - 1], d[best[close] + 1]
        for _ in range(PASSES):
            finer = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, FINER)
            again = np.nan_to_num(np.abs(turns(rows[close], finer) / finer), nan=-1.0)
            peak = np.argmax(again, axis=1)
            row = np.arange(close.size)
            at[close] = finer[row, peak]
            low, high = finer[row, np.maximum(peak - 1, 0)], finer[row, np.minimum(peak + 1, FINER - 1)]
        largest[close] = np.maximum(largest[close], _parabola_top(again, peak))
    nearest = np.max(ratio[:, np.abs(d) < 2 * least], axis=1)
    return Contraction(
        np.where(largest < 0, np.inf, largest), at, nearest, np.mean(np.isnan(ratio), axis=1)
    )


def _parabola_top(values: Array, peak: Array) -> Array:
    """Largest value of the parabola through the three values around each row's peak."""
    row = np.arange(len(values))
    middle = np.clip(peak, 1, values.shape[1] - 2)
    before, here, after = (values[row, middle + k] for k in (-1, 0, 1))
    bend = before - 2 * here + after
    top = here - np.where(bend < 0, (after - before) ** 2 / np.where(bend < 0, 8 * bend, 1.0), 0.0)
    return np.asarray(np.where((peak > 0) & (peak < values.shape[1] - 1), top, values[row, peak]))
