"""The dense output of a run: one polynomial per step, valid in its own mode."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array
from filippov.base.errors import UsageError
from filippov.base.given import number_array


def outside(what: str, t: float, low: float, high: float) -> str:
    """The sentence on a time that a run does not cover."""
    return (
        f"{what} was asked for t = {t}, outside the solved span [{low}, {high}]: take a time within it, or "
        "give "
        "a longer t_span. Where the run ended early, its message says why."
    )


class Interpolant:
    """x(t) from the steps of a run, called as sol(t, side="-"): shape (n,) for a number, (n, k) for k times.

    start, step  of every step, in the order of integration
    coef         (steps, powers, n): x = sum_j coef[j] theta**j, theta = (t - start) / step
    jumps        times at which the state jumps (resets); there `side` tells which value is meant

    Its error is a few times the tolerance of the run. Along a plane h = 0 holds to rounding, along a curved
    surface to that error; the ends of the steps lie on the surface.
    Raises UsageError outside the solved span and for NaN: nothing is extrapolated.
    """

    def __init__(self, start: Array, step: Array, coef: Array, span: tuple[float, float]) -> None:
        self.start, self.step, self.coef, self.span = start, step, coef, span
        self.direction = 1.0 if span[1] >= span[0] else -1.0

    def locate(self, t: Array, side: str) -> npt.NDArray[np.int64]:
        """Number of the step that holds each time; at a seam the earlier for "-", the later for "+"."""
        given: object = side
        if not isinstance(given, str) or given not in ("-", "+"):
            raise UsageError(f"side is {side!r}, expected '-' (before) or '+' (after).")
        low, high = min(self.span), max(self.span)
        bad = ~((t >= low) & (t <= high))
        if np.any(bad):
            value = t[np.argmax(bad)]
            raise UsageError(outside("sol", value, low, high))
        where: Literal["left", "right"] = "left" if (side == "-") == (self.direction > 0) else "right"
        if self.direction > 0:
            index = np.searchsorted(self.start, t, side=where) - 1
        else:
            index = len(self.start) - 1 - np.searchsorted(self.start[::-1], t, side=where)
        return np.clip(index, 0, len(self.start) - 1).astype(np.int64)

    def __call__(self, t: Any, side: str = "-") -> Array:
        """States at the times, shape (n,) or (n, k)."""
        if isinstance(t, str):
            raise UsageError(
                f"sol was asked for t = {t!r}, expected times. A state by its name is solution['x'], at "
                "times solution.evaluate('x', t)."
            )
        times = number_array("t", t)
        flat = np.atleast_1d(times).ravel()
        index = self.locate(flat, side)
        theta = (flat - self.start[index]) / self.step[index]
        # The last step of a solution that grows beyond the range of numbers may hold infinite coefficients.
        with np.errstate(over="ignore", invalid="ignore"):
            if len(flat) > len(self.start):
                value = self._by_power(index, theta[:, None])
            else:
                coef = self.coef[index]
                value = coef[:, -1, :]
                for power in range(coef.shape[1] - 2, -1, -1):
                    value = value * theta[:, None] + coef[:, power, :]
        return np.ascontiguousarray(value[0] if times.ndim == 0 else value.T)

    def _by_power(self, index: npt.NDArray[np.int64], theta: Array) -> Array:
        """States at many times: a power of all steps lies together, those that no step has are left out."""
        powers = np.ascontiguousarray(self.coef.transpose(1, 0, 2))
        used = len(powers)
        while used > 1 and not powers[used - 1].any():
            used -= 1
        value: Array = powers[used - 1].take(index, axis=0)
        for coef in powers[: used - 1][::-1]:
            value *= theta
            value += coef.take(index, axis=0)
        return value

    def rate(self, t: float, side: str = "-") -> Array:
        """dx/dt at one time, shape (n,)."""
        index = int(self.locate(np.array([t]), side)[0])
        theta = (t - self.start[index]) / self.step[index]
        powers = np.arange(1, self.coef.shape[1])
        return np.asarray((powers * theta ** (powers - 1)) @ self.coef[index, 1:] / self.step[index])
