"""Derivatives of plain functions by dual numbers, where the functions take these and give the same values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array
from filippov.kernel.derivative.dual import Dual

Function = Callable[[Any], Any]
# Values of the two forms of a function that are equal but for rounding, relative to the terms of the value.
EQUAL = 1e-12
# Derivatives along so many directions are carried at once, which bounds memory.
AT_ONCE = 128


class Exact:
    """Values and Jacobian matrix of a function of a vector.

    function, twin   of a vector of floats, and of numbers that may be dual (`overloaded`): the same numbers

    A call is None where the function does not take dual numbers, gives them another value, or has no finite
    derivative; where it does not take them it is not asked again.
    """

    def __init__(self, function: Function, twin: Function) -> None:
        self.function, self.twin, self.refused = function, twin, False

    def __call__(self, point: Array) -> tuple[Array, Array] | None:
        """The values, shape (m,), and the derivatives at a point of n numbers, shape (m, n)."""
        if self.refused:
            return None
        try:
            # What is not finite is not used.
            with np.errstate(all="ignore"):
                blocks = [self._block(point, first) for first in range(0, point.size, AT_ONCE)]
        except (TypeError, AttributeError):
            self.refused = True
            return None
        except Exception:  # noqa: BLE001  # the function is called at its own risk with numbers of ours
            return None
        value, matrix = blocks[0][0], np.hstack([part for _, part in blocks])
        if not np.all(np.isfinite(matrix)):
            return None
        told = np.asarray(self.function(point), dtype=np.float64).ravel()
        if told.shape != value.shape or not np.all(np.isfinite(told)):
            return None
        terms = np.abs(told) + np.abs(matrix) @ np.abs(point)
        if not np.all(np.abs(value - told) <= EQUAL * terms):
            return None
        return told, matrix

    def _block(self, point: Array, first: int) -> tuple[Array, Array]:
        """The values and the derivatives by some of the numbers of the point."""
        size = min(AT_ONCE, point.size - first)
        arguments: list[Any] = list(point)
        for j, row in enumerate(np.eye(size)):
            arguments[first + j] = Dual(0, point[first + j], row)
        values, slopes = _parts(self.twin(_vector(arguments)), 0)
        matrix = np.zeros((len(slopes), size))
        for i, slope in enumerate(slopes):
            matrix[i] = slope
        return np.array(values, dtype=np.float64), matrix


def along(function: Function, point: Sequence[Any], direction: Sequence[Any]) -> tuple[list[Any], list[Any]]:
    """The values of a function and their derivatives along a direction, of numbers that may be dual."""
    given = [number.level for number in (*point, *direction) if isinstance(number, Dual)]
    level = 1 + max(given, default=0)
    moved = _vector([Dual(level, v, d) for v, d in zip(point, direction, strict=True)])
    return _parts(function(moved), level)


def _vector(numbers: Sequence[Any]) -> npt.NDArray[Any]:
    """A read-only array of numbers that may be dual, as a state is."""
    out = np.empty(len(numbers), dtype=object)
    out[:] = numbers
    out.flags.writeable = False
    return out


def _parts(found: Any, level: int) -> tuple[list[Any], list[Any]]:
    """The values and the derivatives of a level in the numbers that a function returned."""
    listed = np.asarray(found, dtype=object).ravel()
    # What numpy makes of a choice between objects has no dimension, but is no number.
    entries = [v.item() if isinstance(v, np.ndarray) else v for v in listed]
    dual = [isinstance(v, Dual) and v.level == level for v in entries]
    values = [v.value if own else v for v, own in zip(entries, dual, strict=True)]
    return values, [v.slope if own else 0.0 for v, own in zip(entries, dual, strict=True)]
