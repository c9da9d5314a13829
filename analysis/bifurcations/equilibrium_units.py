"""Units of the unknowns of a branch of equilibria: those in which steps along it have a size.

The linear equations A d + b w = 0, w the width of the parameter, tell them: of units u the terms |A_ij| u_j
and |b_i| w of one row are of one size (Meintjes, Morgan 1987). A branch that turns like a root moves less
over the whole width than its slope says: of a distance x from 0 and that of the slope the geometric mean lies
between those of a line and of a root.
"""

from __future__ import annotations

import numpy as np

from filippov.analysis.steady.dimensionless import APART, Terms, balanced_units
from filippov.base.arrays import Array

# A state below this part of its unit is 0. Units farther from 1 come of a slope that is 0 but for rounding.
_ZERO, _FARTHEST = 1e-6, 1e12


def branch_units(matrix: Array, x: Array, width: float) -> Array:
    """Of the states, (n,): 1 or |x| where these are near enough, else what the equations say.

    matrix  (n + k, n + k + 1) by states, multipliers and the parameter, at a solution with the states x
    """
    n, usual = len(x), np.maximum(np.abs(x), 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        terms = _terms(matrix, n, width)
        if not terms:
            return usual
        units = balanced_units(terms, usual)
    if not np.all((units * _FARTHEST > usual) & (units < usual * _FARTHEST)):
        return usual
    known = np.abs(x) > _ZERO * units
    root = np.sqrt(np.abs(x[known]) / units[known])
    low = np.maximum(np.abs(x), units * np.min(root, initial=1.0))
    high = np.maximum(np.abs(x), units)
    if np.all((usual * APART > low) & (usual < high * APART)):
        return usual
    return np.clip(usual, low, high)


def _terms(matrix: Array, n: int, width: float) -> list[Terms]:
    one, none = np.eye(n, dtype=int), (0,) * n
    out: list[Terms] = []
    for row in np.abs(matrix):
        if not np.all(np.isfinite(row)):
            return []
        terms = [(float(c), tuple(one[j].tolist())) for j, c in enumerate(row[:n]) if c > 0.0]
        rest = max(float(np.max(row[n:-1], initial=0.0)), float(row[-1]) * width)
        out.append((*terms, (rest, none)) if rest > 0.0 else tuple(terms))
    return out
