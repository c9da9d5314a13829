"""Contraction of an event map over its coordinate, for many parameter sets at once.

    rho = max over d in [lo, hi], d != 0, of |R(d)/d|

Below 1 every excursion returns smaller: there is no cycle within the interval, and the set of equilibria
at d = 0 attracts. Every return of every parameter set is one trajectory of the same ensemble.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.optimize import elementwise

from filippov import System, UsageError
from filippov.analysis.maps.gap_roots import NOISE, coordinates
from filippov.analysis.maps.map_rows import MapRows
from filippov.analysis.maps.section import Section
from filippov.base.arrays import Array

CLOSEST, STEPS = 1e-6, 12


@dataclass(frozen=True)
class Contraction:
    """Largest |R(d)|/d of each parameter set.

    ratio    (k,); inf where the map leaves the interval without a value that can be judged
    at       d of the largest ratio, (k,)
    nearest  |R(d)|/d at the least d, (k,): it decides whether the set of equilibria attracts
    lost     share of the d whose solution does not return within the section's t_max, (k,)
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
    least: float = CLOSEST,
    threads: int | None = None,
) -> Contraction:
    """The largest ratio of successive amplitudes for k parameter sets.

    values      arrays (k,) by parameter name; parameters: the same for all
    interval    (0, hi), or (lo, hi) with lo < 0 for a loop without symmetry: d is taken up to its ends from
                `least` of them on, evenly in its logarithm and evenly
    points      number of d on each side

    A solution that comes to rest before the next event counts as ratio 0; one that is still on its way after
    t_max is counted in `lost`. Raises UsageError.
    """
    lo, hi = interval
    if not (lo <= 0.0 < hi and points >= 4):
        raise UsageError(f"interval is {interval}, points {points}; expected lo <= 0 < hi and at least 4.")
    nearest_d = least * max(hi, -lo)
    d = coordinates(0.0, hi, points, least)
    if lo < 0.0:
        d = np.concatenate((-coordinates(0.0, -lo, points, least)[::-1], d))
    event_maps = MapRows(system, section, rtol=rtol, threads=threads)
    rows = event_maps.rows(values, parameters)
    event_maps.suited(rows, max(hi, lo, key=abs), least)
    count = len(rows)
    grid = np.broadcast_to(d, (count, d.size))
    ratio = np.abs(event_maps(rows, grid) / grid)
    known = np.nan_to_num(ratio, nan=-1.0)
    best = np.argmax(known, axis=1)
    largest, at = known[np.arange(count), best], d[best]
    # Between the samples every maximum is a little higher: looked for where it may be the largest.
    middle = known[:, 1:-1]
    bend = 2.0 * middle - known[:, :-2] - known[:, 2:]
    peaks = (middle >= np.maximum(known[:, :-2], known[:, 2:])) & (d[:-2] * d[2:] > 0)
    peaks &= (middle + bend > largest[:, None]) & (bend > NOISE * rtol * middle)
    row, k = np.nonzero(peaks)
    if row.size:

        def smallness(at: Array, row: Array) -> Array:
            return -np.nan_to_num(np.abs(event_maps(rows[row.astype(int)], at[:, None])[:, 0] / at), nan=-1.0)

        peak = elementwise.find_minimum(smallness, (d[k], d[k + 1], d[k + 2]), args=(row,), maxiter=STEPS)
        order = np.argsort(-peak.f_x)
        order = order[-peak.f_x[order] > largest[row[order]]]
        at[row[order]], largest[row[order]] = peak.x[order], -peak.f_x[order]
    nearest = np.max(ratio[:, np.abs(d) < 2 * nearest_d], axis=1)
    return Contraction(
        np.where(largest < 0, np.inf, largest), at, nearest, np.mean(np.isnan(ratio), axis=1)
    )
