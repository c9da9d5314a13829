"""Cycles of a map for many parameter sets at once: sign changes of R(d) - d over a grid, each solved for."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from filippov.analysis.algebra.growth import GROWTHS, by_excess
from filippov.analysis.maps.gap_roots import NOISE, Samples, brackets, coordinates, roots, split
from filippov.analysis.maps.map_rows import MapRows
from filippov.base.arrays import Array, Whole

CLOSEST, STEPS, SLOPE, JUMP, NEAR = 1e-5, 7, 1e-3, 0.05, 0.2
# Share of d within which an image is the point of the same cycle next to it.
_SAME = 1e-5
COLUMNS = ("cycles", "stable", "undecided", "set_verdict", "amplitude", "lost")


def cells(
    event_maps: MapRows, rows: Array, hi: float, points: int
) -> tuple[Whole, Whole, Whole, Whole, Array, Array]:
    """COLUMNS of parameter rows (k, P), each of shape (k,); the verdict as its place in GROWTHS."""
    d = coordinates(0.0, hi, points, CLOSEST)
    grid = np.broadcast_to(d, (len(rows), d.size))
    image = event_maps(rows, grid)

    def gap(at: Array, cell: Whole) -> Array:
        return event_maps(rows[cell], at[:, None])[:, 0] - at

    noise = NOISE * event_maps.options["rtol"]
    samples = split(gap, Samples.of(d, image - grid), noise)
    between = brackets(gap, samples, near=NEAR, steps=2 * STEPS)
    found = roots(gap, between, rtol=1e-12, jump=JUMP, floor=1e-6 * between.high, steps=STEPS)
    cell, root = between.map[found.fixed], found.d[found.fixed]
    reach = SLOPE * root
    slope = 1.0 + (gap(root + reach, cell) - gap(root - reach, cell)) / (2 * reach)
    known = np.isfinite(slope) & _largest(event_maps, rows, cell, root)
    cell, root, slope = cell[known], root[known], slope[known]
    count = np.bincount(cell, minlength=len(rows))
    verdict = np.array([by_excess(float(s), noise / SLOPE) for s in np.abs(slope) - 1.0], dtype=object)
    firm = verdict == "stable"
    held = np.bincount(cell[firm], minlength=len(rows))
    open_ = np.bincount(cell[verdict == "undecided"], minlength=len(rows))
    amplitude = np.full(len(rows), np.nan)
    for where, place in zip(cell[firm], root[firm], strict=True):
        amplitude[where] = np.nanmax([amplitude[where], place])
    # The least excursion stands for those that are smaller: what these may differ is its error.
    ratio = np.abs(image[:, :2]) / d[:2]
    error = noise + np.abs(ratio[:, 1] - ratio[:, 0]) * d[0] / (d[1] - d[0])
    excess = (ratio[:, 0] - 1.0).tolist()
    beside = [GROWTHS.index(by_excess(*pair)) for pair in zip(excess, error.tolist(), strict=True)]
    return count, held, open_, np.array(beside), amplitude, np.mean(np.isnan(image), axis=1)


def _largest(event_maps: MapRows, rows: Array, cell: Whole, root: Array) -> npt.NDArray[np.bool_]:
    """Whether a fixed point of the iterate (k,) is the largest of its cycle, which may have several."""
    out, image = np.ones(root.size, dtype=bool), root
    for _ in range(event_maps.order - 1):
        image = event_maps.returned(rows[cell], image[:, None], 1)[:, 0]
        near = np.abs(image[:, None] - root) <= _SAME * root
        larger = root > (1.0 + _SAME) * root[:, None]
        out &= ~np.any(near & larger & (cell[:, None] == cell), axis=1)
    return out
