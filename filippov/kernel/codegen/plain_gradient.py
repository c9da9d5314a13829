"""Gradients of surfaces given by functions: by dual numbers where these take them, else by differences."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from filippov.base.arrays import Array
from filippov.kernel.derivative.difference import local_slope, slope
from filippov.kernel.derivative.exact import Exact, along
from filippov.kernel.derivative.overloaded import overloaded
from filippov.model.surface import Surface


class PlainGradients:
    """dh_i/dx and dh_i/dt of the surfaces of a run, and the derivatives of their rates.

    value(i, t, x) -> h_i, checked; gradient(i, t, x) -> the user's dh_i/dx, checked; `p` is the record that
    the user's functions see.
    """

    def __init__(
        self,
        surfaces: Sequence[Surface],
        field: Callable[..., Any],
        n: int,
        value: Callable[[int, float, Array], float],
        gradient: Callable[[int, float, Array], Array],
    ) -> None:
        self.surfaces, self.n, self.value, self.gradient = surfaces, n, value, gradient
        self.field = field
        self.field_twin: Callable[..., Any] | None = None
        self.p: Any = None
        self._constant: dict[int, Array] = {}
        self._exact: dict[int, Exact] = {}
        self._rates: dict[tuple[int, bytes], Exact] = {}

    def parameters(self, record: Any) -> None:
        """Set the record that the functions see."""
        self.p = record
        self._constant.clear()

    def row(self, i: int, t: float, x: Array) -> Array:
        """(dh_i/dx, dh_i/dt), shape (n + 1,)."""
        surface = self.surfaces[i]
        if surface.linear and i in self._constant:
            return self._constant[i]
        if i not in self._exact:
            self._exact[i] = self._made(i)
        found = self._exact[i](np.append(x, t))
        row = self._differenced(i, t, x) if found is None else found[1][0]
        if surface.gradient is not None:
            row[: self.n] = self.gradient(i, t, x)
        if surface.linear:
            self._constant[i] = row
        return row

    def _made(self, i: int) -> Exact:
        n, twin = self.n, overloaded(self.surfaces[i].h)
        return Exact(
            lambda point: [self.value(i, float(point[n]), _state(point, n))],
            lambda point: [twin(point[n], point[:n], self.p)],
        )

    def rate_slopes(
        self, i: int, t: float, x: Array, signs: Array, rate: Callable[..., float]
    ) -> Array | None:
        """dL/dx and dL/dt of L = h_t + grad h . f, shape (n + 1,); None where differences have to do.

        rate(t, x) -> L
        """
        key = i, signs.tobytes()
        if key not in self._rates:
            self._rates[key] = self._rate_made(i, signs, rate)
        found = self._rates[key](np.append(x, t))
        return None if found is None else found[1][0]

    def _rate_made(self, i: int, signs: Array, rate: Callable[..., float]) -> Exact:
        n, twin = self.n, overloaded(self.surfaces[i].h)
        if self.field_twin is None:
            self.field_twin = overloaded(self.field)
        field, signed = self.field_twin, signs.astype(object)

        def of_dual(point: Any) -> list[Any]:
            f = list(field(point[n], point[:n], self.p, signed))
            return along(lambda at: [twin(at[n], at[:n], self.p)], point, [*f, 1.0])[1]

        return Exact(lambda point: [rate(float(point[n]), _state(point, n))], of_dual)

    def _differenced(self, i: int, t: float, x: Array) -> Array:
        places = range(self.n) if self.surfaces[i].gradient is None else ()
        row = np.zeros(self.n + 1)
        for j in (*places, self.n):
            row[j] = self._slope(i, t, x, j)
        return row

    def _slope(self, i: int, t: float, x: Array, j: int) -> float:
        """dh_i/dx_j (dh_i/dt for j = n), by differences."""
        largest, at = float(np.max(np.abs(x), initial=0.0)), t if j == self.n else float(x[j])

        def along(moved: float) -> float:
            if j == self.n:
                return self.value(i, moved, x)
            y = x.copy()
            y[j] = moved
            y.flags.writeable = False
            return self.value(i, t, y)

        size = max(abs(at), 1e-3 * largest, 1e-6 if at == 0.0 else 0.0)
        # The rate of a contact is differenced again, which needs one length throughout.
        kept = any(surface.contact for surface in self.surfaces)
        return slope(along, at, size) if kept else local_slope(along, at, size)


def _state(point: Array, n: int) -> Array:
    x = point[:n].copy()
    x.flags.writeable = False
    return x
