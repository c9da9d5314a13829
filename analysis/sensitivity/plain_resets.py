"""Derivatives of resets and instants that are plain functions: by dual numbers, or else by differences."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import numpy as np

from filippov import System
from filippov.base.arrays import Array
from filippov.kernel.derivative.difference import local_slope
from filippov.kernel.derivative.exact import Exact
from filippov.kernel.derivative.overloaded import overloaded

# The magnitude of what is 0, relative to that of the other states, and where these are 0 too.
_BESIDE, _OF_ZERO = 1e-3, 1e-2


def plain_reset_slopes(system: System, index: int, t: float, x: Array, p: Array) -> Array:
    """dR/d(x, p, t) of the reset x+ = R(t, x, p): (n, n + number of parameters + 1).

    index: the surface, or the number of surfaces plus that of the time event
    """
    return _reset(system, index)(np.concatenate([x, p, [t]]), len(x))


def plain_instant_slopes(system: System, function: Callable[[Any], Any], p: Array) -> Array:
    """dT/dp of an instant T(p)."""

    def instant(called: Callable[..., Any], record: Callable[..., Any], numbers: Any) -> Any:
        return [called(record(numbers))]

    return np.asarray(_Slopes(instant, system, function)(p, 0)[0])


class _Slopes:
    """The derivatives of what a function of the user gives, by all numbers that it is called with.

    made   (function, p of numbers, all numbers) -> the values
    """

    def __init__(self, made: Callable[..., Any], system: System, function: Callable[..., Any]) -> None:
        self.made, empty = made, system.parameters.record(np.zeros(len(system.parameters)))
        self.values = partial(self._called, function, system.parameters.record)
        self.exact = Exact(self.values, partial(made, overloaded(function), empty.holding))

    def _called(self, function: Callable[..., Any], record: Callable[..., Any], numbers: Array) -> Array:
        return np.asarray(self.made(function, record, numbers), dtype=np.float64).ravel()

    def __call__(self, numbers: Array, states: int) -> Array:
        """The derivatives at the numbers, of which the first are states: (values, numbers)."""
        found = self.exact(numbers)
        if found is not None:
            return found[1]
        beside = _BESIDE * float(np.max(np.abs(numbers[:states]), initial=0.0))
        sizes = [max(abs(v), beside if j < states else 0.0) or _OF_ZERO for j, v in enumerate(numbers)]
        columns = [self._difference(numbers, j, size) for j, size in enumerate(sizes)]
        return np.array(columns).reshape(len(numbers), -1).T

    def _difference(self, numbers: Array, j: int, size: float) -> list[float]:
        known: dict[float, Array] = {}

        def component(i: int, value: float) -> float:
            if value not in known:
                moved = numbers.copy()
                moved[j] = value
                known[value] = self.values(moved)
            return float(known[value][i])

        count = self.values(numbers).size
        return [local_slope(partial(component, i), float(numbers[j]), size) for i in range(count)]


@lru_cache(maxsize=128)
def _reset(system: System, index: int) -> _Slopes:
    m, n = len(system.surfaces), system.dimension
    reset = system.surfaces[index].reset if index < m else system.time_events[index - m].reset

    def after(function: Callable[..., Any], record: Callable[..., Any], numbers: Any) -> Any:
        return function(numbers[-1], numbers[:n], record(numbers[n:-1]))

    return _Slopes(after, system, reset)
