"""A signal from samples: a polynomial between one knot and the next, in (t - the knot before)."""

from __future__ import annotations

import bisect
import hashlib
import math
from collections.abc import Sequence
from typing import Any, NoReturn

import numpy as np

from filippov.base.arrays import Array
from filippov.base.errors import ModelError, UsageError
from filippov.base.given import number_array
from filippov.base.quantity import is_quantity
from filippov.model.parameter import as_number

KINDS = ("linear", "hold", "cubic")
OUTSIDE = ("refuse", "hold")
# What scipy, pandas and Simulink call these kinds.
ELSEWHERE = {
    "zoh": "hold", "zero": "hold", "previous": "hold", "ffill": "hold", "step": "hold", "constant": "hold",
    "foh": "linear", "slinear": "linear", "first": "linear", "spline": "cubic", "CubicSpline": "cubic",
}  # fmt: skip
# Coefficients of a piece; the first derivative that is 0 for each kind.
ROOM = 4
ORDERS = {"hold": 1, "linear": 2, "cubic": 4}


class Samples:
    """What an `Input` knows; immutable and compared by content. Arguments as there."""

    __slots__ = ("coef", "digest", "kind", "name", "outside", "period", "t", "values")
    name: str
    kind: str
    outside: str
    period: float | None
    t: Array
    values: Array
    coef: Array
    digest: str

    def __init__(
        self, name: str, t: Any, values: Any, kind: str = "linear", outside: str = "refuse",
        period: float | None = None,
    ) -> None:  # fmt: skip
        where = f"input {name!r}"
        if kind not in KINDS:
            same = ELSEWHERE.get(kind)
            cure = f" Write kind={same!r}." if same else ""
            raise ModelError(f"{where}: kind is {kind!r}, expected one of {', '.join(KINDS)}.{cure}")
        if outside not in OUTSIDE:
            raise ModelError(f"{where}: outside is {outside!r}, expected one of {', '.join(OUTSIDE)}.")
        knots, heights = _column(t, f"{where}: t"), _column(values, f"{where}: values")
        least = 1 if kind == "hold" and (outside == "hold" or period is not None) else 2
        if len(knots) != len(heights) or len(knots) < least:
            raise ModelError(
                f"{where}: {len(knots)} times and {len(heights)} values were given, expected as many of "
                f"each, and at least {least}."
            )
        if (places := np.flatnonzero(np.diff(knots) <= 0)).size:
            k = int(places[0])
            raise ModelError(
                f"{where}: t[{k}] = {knots[k]:g} is followed by {knots[k + 1]:g}, expected increasing times. "
                "A jump is a signal of kind='hold', or two inputs added."
            )
        if period is not None:
            knots, heights = _closed(knots, heights, kind, period, where)
        coef = _coefficients(knots, heights, kind, period is not None)
        text = hashlib.sha256(f"{kind} {outside} {period!r}".encode())
        for part in (knots, heights):
            text.update(np.ascontiguousarray(part).tobytes())
            part.flags.writeable = False
        content = {
            "name": name, "kind": kind, "outside": outside, "period": period, "t": knots, "values": heights,
            "coef": coef, "digest": text.hexdigest(),
        }  # fmt: skip
        for key, value in content.items():
            object.__setattr__(self, key, value)

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"the samples of an input are fixed: {name!r} cannot be set.")

    def arguments(self) -> tuple[Any, ...]:
        """What makes the same samples again."""
        t, values = (self.t, self.values) if self.period is None else (self.t[:-1], self.values[:-1])
        return self.name, t, values, self.kind, self.outside, self.period

    def __reduce__(self) -> tuple[Any, ...]:
        return Samples, self.arguments()

    @property
    def span(self) -> tuple[float, float]:
        """The times at which the signal is known."""
        if self.period is not None or self.outside == "hold":
            return -math.inf, math.inf
        return float(self.t[0]), float(self.t[-1])

    def check_span(self, span: Sequence[float]) -> None:
        """Raise UsageError for a span of time in which the signal is not known throughout."""
        low, high = self.span
        if min(span) < low or max(span) > high:
            raise UsageError(
                f"input {self.name!r} is known for t in [{low:g}, {high:g}], but the run is over "
                f"[{min(span):g}, {max(span):g}]. Give a shorter t_span, more samples, or "
                "Input(..., outside='hold') or period=..."
            )

    def neighbours(self, t: float) -> tuple[float, float]:
        """The last knot at or before t and the first one after it; -inf and inf where there is none."""
        periods = 0.0
        if self.period is not None:
            periods = math.floor((t - float(self.t[0])) / self.period)
            while self._knot(0, periods) > t:
                periods -= 1
            while self._knot(0, periods + 1) <= t:
                periods += 1
        k = bisect.bisect_right(self.t, t if self.period is None else t - periods * self.period)
        if self.period is None:
            return (
                float(self.t[k - 1]) if k else -math.inf,
                float(self.t[k]) if k < len(self.t) else math.inf,
            )
        k = min(max(k, 1), len(self.t) - 1)
        while k > 1 and self._knot(k - 1, periods) > t:
            k -= 1
        while k < len(self.t) - 1 and self._knot(k, periods) <= t:
            k += 1
        last = k == len(self.t) - 1
        return self._knot(k - 1, periods), self._knot(0, periods + 1) if last else self._knot(k, periods)

    def _knot(self, k: int, periods: float) -> float:
        return float(self.t[k]) + periods * float(self.period or 0.0)

    def piece(self, low: float, high: float) -> tuple[float, Array]:
        """The polynomial between two neighbouring knots: where it begins, its coefficients."""
        constant = self.outside == "hold" or self.kind == "hold"
        if low == -math.inf:
            return high, self._end(self.values[0]) if constant else self.coef[0]
        if high == math.inf:
            return (low, self._end(self.values[-1])) if constant else (float(self.t[-2]), self.coef[-1])
        middle = 0.5 * (low + high)
        if self.period is not None:
            middle -= math.floor((middle - float(self.t[0])) / self.period) * self.period
        k = bisect.bisect_right(self.t, middle) - 1
        return low, np.asarray(self.coef[min(max(k, 0), len(self.coef) - 1)])

    @staticmethod
    def _end(value: float) -> Array:
        return np.array([value, 0.0, 0.0, 0.0])

    def at(self, t: Any, order: int = 0, side: str = "+") -> Any:
        """The signal at times, or its derivative of an order; at a knot its value before ("-") or after.

        Raises UsageError where it is not known.
        """
        times = np.asarray(t, dtype=float)
        low, high = self.span
        if np.any(bad := ~((times >= low) & (times <= high))):
            value = float(times[bad].flat[0])
            raise UsageError(
                f"input {self.name!r} was asked for t = {value}, known on [{low:g}, {high:g}]. Give more "
                "samples, or Input(..., outside='hold') or period=..."
            )
        local = times
        if self.period is not None:
            local = times - np.floor((times - float(self.t[0])) / self.period) * self.period
        k = np.searchsorted(self.t, local, side="right" if side == "+" else "left") - 1
        if self.period is not None and side == "-":
            # Before the first knot of a period comes the last piece of the period before it.
            local = np.where(k < 0, local + self.period, local)
            k = np.where(k < 0, len(self.coef) - 1, k)
        inside = np.clip(k, 0, len(self.coef) - 1)
        rows, theta = self.coef[inside], local - self.t[inside]
        out = np.zeros(times.shape)
        for power in range(ROOM - 1, order - 1, -1):
            out = out * theta + rows[..., power] * math.perm(power, order)
        if self.period is None:
            ends = np.where(k < 0, self.values[0], self.values[-1]) if order == 0 else 0.0
            held = self.outside == "hold"
            beyond = (k < 0) | (k >= len(self.t) - 1) if held or self.kind == "hold" else np.zeros(1, bool)
            out = np.where(beyond, ends, out) if np.any(beyond) else out
        return out if times.ndim else float(out)


def _column(given: Any, where: str) -> Array:
    if is_quantity(given):
        raise ModelError(f"{where} is a quantity with a unit, expected numbers: give q.to(unit).magnitude.")
    column = number_array(where, given, ModelError)
    if column.ndim != 1 or not np.all(np.isfinite(column)):
        what = f"has shape {column.shape}" if column.ndim != 1 else "holds a number that is not finite"
        raise ModelError(f"{where} {what}, expected a list of finite numbers.")
    return column


def _closed(t: Array, values: Array, kind: str, period: float, where: str) -> tuple[Array, Array]:
    """The samples of one period with the first one again at its end."""
    length = as_number(period, f"{where}: period")
    if not length > 0:
        raise ModelError(f"{where}: period is {period!r}, expected a number > 0.")
    end = float(t[0]) + length
    close = 1e-9 * length
    if t[-1] > end + close:
        raise ModelError(
            f"{where}: the samples last {t[-1] - t[0]:g}, longer than the period {length:g}. Give one period."
        )
    if t[-1] >= end - close:
        if kind != "hold" and abs(values[-1] - values[0]) > 1e-9 * np.max(np.abs(values)):
            raise ModelError(
                f"{where}: it ends at {values[-1]:g} and begins with {values[0]:g}, expected the same value "
                "one period later. Leave the last sample out to let it lead back, or use kind='hold'."
            )
        t, values = t[:-1], values[:-1]
    if len(t) < (1 if kind == "hold" else 2):
        raise ModelError(
            f"{where}: one period has {len(t)} samples, expected at least two in it, or one with "
            "kind='hold'."
        )
    return np.append(t, end), np.append(values, values[0])


def _coefficients(t: Array, values: Array, kind: str, periodic: bool) -> Array:
    """A row c0, c1, c2, c3 a piece: c0 + c1 u + c2 u^2 + c3 u^3 with u = t - t_k."""
    coef = np.zeros((max(len(t) - 1, 1), ROOM))
    if len(t) == 1:
        coef[0, 0] = values[0]
        return coef
    coef[:, 0] = values[:-1]
    if kind == "linear":
        coef[:, 1] = np.diff(values) / np.diff(t)
    elif kind == "cubic":
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(t, values, bc_type="periodic" if periodic else "not-a-knot")
        coef = np.ascontiguousarray(spline.c[::-1].T)
    return coef
