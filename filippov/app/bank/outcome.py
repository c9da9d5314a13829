"""The error of an expectation against its tolerance, how numbers are compared, and why there is none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

ROUNDING = 8 * np.finfo(float).eps


class NotUnderstoodError(Exception):
    """The runner cannot evaluate this expectation; it is listed as not evaluated."""


class MissingError(Exception):
    """The expectation is understood and the result does not have it: it counts as failed."""


class OutOfTimeError(Exception):
    """The time allowed for the case is used up."""


@dataclass(frozen=True)
class Outcome:
    """The error of one expectation against its tolerance."""

    error: float
    tolerance: float
    note: str = ""

    @property
    def passed(self) -> bool:
        """Whether the error is within the tolerance."""
        return bool(self.error <= self.tolerance)

    @property
    def ratio(self) -> float:
        """Error over tolerance."""
        if self.error <= self.tolerance and self.tolerance == 0:
            return 0.0
        return self.error / self.tolerance if self.tolerance else np.inf


def compared(got: Any, wanted: Any, atol: float, rtol: float, order: str = "given") -> Outcome:
    """The entry that is worst against atol + rtol |wanted|; a list of another length is wrong by so many.

    order  "given"; "any": the lists are matched entry to entry; "set": every entry has one near to it in the
           other list
    """
    a, b = np.asarray(got, dtype=float), np.asarray(wanted, dtype=float)
    if a.shape != b.shape and a.size == b.size == 1:
        a, b = a.reshape(()), b.reshape(())
    if order == "set" and a.ndim == b.ndim == 2 and a.shape[1] == b.shape[1] and a.size and b.size:
        gaps = np.max(np.abs(a[:, None, :] - b[None, :, :]), axis=2)
        error = float(max(np.max(np.min(gaps, axis=0)), np.max(np.min(gaps, axis=1))))
        return Outcome(error, atol, "" if error <= atol else "the sets differ")
    if a.shape != b.shape:
        return Outcome(max(abs(a.size - b.size), 1.0), 0.0, f"{a.size} values, expected {b.size}")
    if order == "any" and a.size and np.all(np.isfinite(a)):
        rows, wide = a.reshape(len(a), -1), b.reshape(len(b), -1)
        a = a[linear_sum_assignment(np.linalg.norm(rows[None, :, :] - wide[:, None, :], axis=2))[1]]
    gap = np.abs(a - b).ravel()
    floor = ROUNDING * float(np.max(np.abs(b), initial=0.0))
    accepted = np.maximum(atol + rtol * np.abs(b).ravel(), floor)
    if not np.all(np.isfinite(gap)):
        return Outcome(np.inf, atol, f"{short(a)}, expected {short(b)}")
    if gap.size == 0:
        return Outcome(0.0, atol)
    # Against a tolerance of 0 the largest gap is the worst.
    worst = int(np.argmax(gap / accepted)) if np.all(accepted > 0) else int(np.argmax(gap - accepted))
    error, tolerance = float(gap[worst]), float(accepted[worst])
    return Outcome(error, tolerance, "" if error <= tolerance else f"{short(a)}, expected {short(b)}")


def short(value: Any) -> str:
    """The first numbers of an array."""
    flat = np.atleast_1d(value).ravel()
    return ", ".join(f"{v:.9g}" for v in flat[:4]) + (", ..." if flat.size > 4 else "")


def compared_texts(got: Any, wanted: str | Sequence[str]) -> Outcome:
    """The number of texts that differ."""
    a = [str(got)] if isinstance(wanted, str) else [str(item) for item in got]
    b = [wanted] if isinstance(wanted, str) else list(wanted)
    wrong = sum(x != y for x, y in zip(a, b, strict=False)) + abs(len(a) - len(b))
    return Outcome(float(wrong), 0.0, f"{', '.join(a[:8])}, expected {', '.join(b[:8])}" if wrong else "")
