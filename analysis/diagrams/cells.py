"""Cycles of a map for many parameter sets at once: sign changes of R(d) - d over a grid, each solved for."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from filippov.analysis.maps.gap_roots import NOISE, Samples, Whole, brackets, coordinates, roots, split
from filippov.analysis.maps.map_rows import MapRows

Array = npt.NDArray[np.float64]
CLOSEST, STEPS, SLOPE, JUMP, NEAR = 1e-5, 7, 1e-4, 0.05, 0.2


def cells(
    event_maps: MapRows, rows: Array, hi: float, points: int
) -> tuple[Whole, Whole, npt.NDArray[np.bool_], Array, Array]:
    """cycles, stable, set_stable, amplitude and lost of parameter rows (k, P), each of shape (k,)."""
    d = coordinates(0.0, hi, points, CLOSEST)
    grid = np.broadcast_to(d, (len(rows), d.size))
    image = event_maps(rows, grid)

    def gap(at: Array, cell: Whole) -> Array:
        return event_maps(rows[cell], at[:, None])[:, 0] - at

    samples = split(gap, Samples.of(d, image - grid), NOISE * event_maps.options["rtol"])
    between = brackets(gap, samples, near=NEAR, steps=2 * STEPS)
    found = roots(gap, between, rtol=1e-12, jump=JUMP, floor=1e-6 * between.high, steps=STEPS)
    cell, root = between.map[found.fixed], found.d[found.fixed]
    reach = SLOPE * root
    slope = 1.0 + (gap(root + reach, cell) - gap(root - reach, cell)) / (2 * reach)
    known = np.isfinite(slope)
    cell, root, slope = cell[known], root[known], slope[known]
    count = np.bincount(cell, minlength=len(rows))
    firm = np.abs(slope) < 1
    held = np.bincount(cell[firm], minlength=len(rows))
    amplitude = np.full(len(rows), np.nan)
    for where, place in zip(cell[firm], root[firm], strict=True):
        amplitude[where] = np.nanmax([amplitude[where], place])
    set_stable = np.abs(image[:, 0]) < d[0]
    return count, held, set_stable, amplitude, np.mean(np.isnan(image), axis=1)
