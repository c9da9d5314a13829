"""Borders of a map of regions as curves: the fold of cycles by continuation, the change of stability of the
equilibrium set by root-finding on the slope of the event map there.

They do not come from the cells; the cells only tell where to start.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from filippov import System, UsageError
from filippov.analysis.bifurcations.continuation import continuation
from filippov.analysis.bifurcations.corrector import FAILURES
from filippov.analysis.bifurcations.curve import curve
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.analysis.maps.set_slope import log_slope
from filippov.base.arrays import Array

Border = tuple[str, Array]
Excess = Callable[[float, float], float]
FOLD, SET = "fold of two cycles", "set changes stability"
# The curve of the set is solved for at so many values of y, from brackets between so many values of x.
# Only every _SCANNED-th row is scanned, the rows between begin where the last one ended.
_ROWS, _COLUMNS, _SCANNED, _REACH = 13, 7, 6, 1e-3


def exact_borders(
    system: System,
    section: Section,
    x: tuple[str, Sequence[float]],
    y: tuple[str, Sequence[float]],
    amplitude: Array,
    hi: float,
    *,
    parameters: Mapping[str, float] | None = None,
    order: int = 2,
) -> tuple[Border, ...]:
    """(name, points (k, 2) in x and y) of the curves that were found within the axes.

    amplitude  d of the largest stable cycle in each cell (len(y), len(x)), NaN without one: where a branch
               is begun
    hi         the end of the interval of coordinates

    The other arguments are those of `filippov.analysis.diagrams.regions.regions`.
    """
    across, up = np.asarray(x[1], dtype=float), np.asarray(y[1], dtype=float)
    whole = EventMap(system, section, parameters=parameters, order=order)
    found = _folds(whole, (x[0], across), (y[0], up), amplitude)
    return (*found, *_changes(whole, (x[0], across), (y[0], up), _REACH * hi))


def _folds(
    whole: EventMap, x: tuple[str, Array], y: tuple[str, Array], amplitude: Array
) -> list[Border]:
    """Curves of folds, from the branches of the largest cycles in a few rows."""
    across, up = x[1], y[1]
    found: list[Border] = []
    for i in dict.fromkeys((len(up) // 2, len(up) - 1, 0, len(up) // 4, 3 * len(up) // 4)):
        known = np.flatnonzero(np.isfinite(amplitude[i]))
        if not known.size or any(_passes(points, up[i]) for _, points in found):
            continue
        j = int(known[len(known) // 2])
        at = whole.remake(parameters={x[0]: float(across[j]), y[0]: float(up[i])})
        try:
            near = at.fixed_points(0.8 * amplitude[i, j], 1.2 * amplitude[i, j], 24)
            start = min(near, key=lambda point: abs(point.d - amplitude[i, j]), default=None)
            if start is None:
                continue
            bounds = (float(across.min()), float(across.max()))
            run = continuation(at.system, (at, float(start.d)), parameter=x[0], bounds=bounds)
            for fold in run.run().folds:
                halves = [
                    curve(run, fold, parameter=y[0], bounds=(float(up.min()), float(up.max())), direction=way,
                          max_step=0.4).run()
                    for way in (-1, 1)
                ]  # fmt: skip
                rows = [np.column_stack([half.coordinate(x[0]), half.values]) for half in halves]
                found.append((FOLD, np.vstack([rows[0][::-1], rows[1][1:]])))
        except FAILURES:
            continue
    return found


def _passes(points: Array, value: float) -> bool:
    """Whether a curve has a point at this value of y."""
    return bool(points[:, 1].min() <= value <= points[:, 1].max())


def _changes(whole: EventMap, x: tuple[str, Array], y: tuple[str, Array], reach: float) -> list[Border]:
    """Where the map has the slope +-1 at the set, for values of y: one curve for each root in order."""

    @cache
    def excess(at: float, value: float) -> float:
        return log_slope(whole, reach, **{x[0]: at, y[0]: value})

    roots: list[list[tuple[float, float]]] = []
    grid = np.linspace(float(x[1].min()), float(x[1].max()), _COLUMNS)
    cell = grid[1] - grid[0]
    rows = np.linspace(float(y[1].min()), float(y[1].max()), _ROWS)
    for i, value in enumerate(rows):
        try:
            if i % _SCANNED == 0 or not roots:
                brackets = _brackets(excess, grid, value)
            else:
                # Where the curve goes by its last two points, else at its last one.
                ends = [2 * c[-1][0] - c[-2][0] if len(c) > 1 else c[-1][0] for c in roots]
                brackets = [_around(excess, at, cell, (grid[0], grid[-1]), value) for at in ends]
            here = [
                float(brentq(excess, a, b, args=(value,), xtol=1e-11 * cell, rtol=1e-12))
                for a, b in brackets if a < b
            ]  # fmt: skip
        except (*FAILURES, UsageError):
            continue
        for k, root in enumerate(here):
            if k == len(roots):
                roots.append([])
            roots[k].append((root, float(value)))
    return [(SET, np.array(points)) for points in roots if len(points) > 1]


def _brackets(excess: Excess, grid: Array, value: float) -> list[tuple[float, float]]:
    """Neighbours on a grid between which the function changes its sign."""
    heights = [excess(at, value) for at in grid]
    return [
        (float(a), float(b))
        for (a, f), (b, g) in pairwise(zip(grid, heights, strict=True))
        if np.isfinite(f) and np.isfinite(g) and f * g < 0
    ]


def _around(
    excess: Excess, at: float, cell: float, ends: tuple[float, float], value: float
) -> tuple[float, float]:
    """An interval around a guess in which the function changes its sign; empty where there is none."""
    for reach in (0.02 * cell, 0.3 * cell, 1.5 * cell):
        low, high = max(at - reach, ends[0]), min(at + reach, ends[1])
        if low < high and excess(low, value) * excess(high, value) < 0:
            return low, high
    return 0.0, 0.0
