"""Stable, unstable or undecided: multipliers against the unit circle, eigenvalues against the imaginary axis,
each within its own error. Of two that are equal the error is the root of that of their matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array

Growth = Literal["stable", "unstable", "undecided"]
GROWTHS: tuple[Growth, ...] = ("unstable", "stable", "undecided")
# The accuracy of derivatives of a return, in units of rtol; of eigenvalues, in units of the largest.
ACCURACY, ROUNDING = 100.0, 1e-12


def by_excess(excess: float, error: float) -> Growth:
    """By how far the largest growth lies beyond the border, and the error of that; NaN decides nothing."""
    if not abs(excess) > error:
        return "undecided"
    return "stable" if excess < 0.0 else "unstable"


def by_multipliers(
    values: npt.ArrayLike, error: float, others: Sequence[complex] = (), critical: int = 0
) -> Growth:
    """Of a map or an orbit: all multipliers inside the unit circle, one outside, or one on it.

    others    further multipliers of the same matrix that decide nothing, as the trivial one
    critical  how many lie on the circle by the definition of the point: where no other lies outside,
              the linear part does not decide
    """
    found = np.atleast_1d(np.asarray(values, dtype=np.complex128))
    return _judged(found, np.abs(found) - 1.0, error, others, critical)


def by_eigenvalues(values: npt.ArrayLike, critical: int = 0) -> Growth:
    """Of an equilibrium: all eigenvalues left of the imaginary axis, one right of it, or one on it."""
    found = np.atleast_1d(np.asarray(values, dtype=np.complex128))
    found = np.asarray(found / (np.max(np.abs(found), initial=0.0) or 1.0))
    return _judged(found, found.real, ROUNDING, (), critical)


def _judged(
    values: npt.NDArray[np.complex128], excess: Array, error: float, others: Sequence[complex], critical: int
) -> Growth:
    apart = np.abs(values[:, None] - np.append(values, others)[None, :])
    np.fill_diagonal(apart, np.inf)
    gap = np.min(apart, axis=1, initial=1.0)
    errors = np.minimum(np.sqrt(error), error / np.maximum(gap, error))
    rest = np.argsort(np.abs(excess))[critical:]
    told = {by_excess(float(excess[k]), float(errors[k])) for k in rest}
    if "unstable" in told:
        return "unstable"
    return "undecided" if critical or "undecided" in told else "stable"
