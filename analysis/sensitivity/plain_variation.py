"""Derivatives of a mode for systems of plain functions: supplied ones, else differences of fourth order.

The field is smooth while its signs are held, also a little beyond a surface, so central differences may cross
it. Their error is about 1e-10 relative to the size of the field.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.base.errors import ModelError
from filippov.model.system import System

Array = npt.NDArray[np.float64]
# Offsets and weights of the central difference of fourth order.
_OFFSETS = (-2.0, -1.0, 1.0, 2.0)
_WEIGHTS = (1.0 / 12.0, -2.0 / 3.0, 2.0 / 3.0, -1.0 / 12.0)
_RELATIVE, _SMALLEST = 1e-4, 1e-2


class PlainParts:
    """The parts of a mode of plain functions, point by point (shapes as in `SymbolicParts`).

    jacobian   (t, x, p, s) -> df/dx, shape (n, n), the signs held; None for differences
    """

    def __init__(
        self, system: System, mode: tuple[int, ...], names: tuple[str, ...],
        jacobian: Callable[..., Any] | None,
    ) -> None:  # fmt: skip
        self.system, self.mode, self.jacobian = system, mode, jacobian
        self.places = [system.parameters.index(name) for name in names]
        self.sliding = [i for i, sign in enumerate(mode) if sign == 0]

    def part(self, name: str, t: Array, x: Array, s: Array, p: Array) -> Array:
        """One of the parts on all points: (k, rows, columns)."""
        function = getattr(self, f"_{name}")
        return np.array([function(_Point(float(t[q]), x[q], s[q], p)) for q in range(t.size)])

    def _f(self, at: _Point) -> Array:
        field = self.system.field
        assert field is not None
        value = np.asarray(field(at.t, at.x, self.system.parameters.record(at.p), at.s), dtype=float)
        return value.reshape(self.system.dimension, 1)

    def _fy(self, at: _Point) -> Array:
        if self.jacobian is None:
            return self._by_all(self._f, at)
        n = self.system.dimension
        matrix = np.asarray(self.jacobian(at.t, at.x, self.system.parameters.record(at.p), at.s), dtype=float)
        if matrix.shape != (n, n):
            raise ModelError(f"jacobian returned the shape {matrix.shape}, expected ({n}, {n}).")
        return np.hstack([matrix, self._by_all(self._f, at, states=False)])

    def _fs(self, at: _Point) -> Array:
        return self._by_signs(self._f, at)

    def _h(self, at: _Point) -> Array:
        record = self.system.parameters.record(at.p)
        values = [float(surface.h(at.t, at.x, record)) for surface in self.system.surfaces]
        return np.array(values).reshape(-1, 1)

    def _hy(self, at: _Point) -> Array:
        out = self._by_all(self._h, at)
        for i, surface in enumerate(self.system.surfaces):
            if surface.gradient is not None:
                row = surface.gradient(at.t, at.x, self.system.parameters.record(at.p))
                out[i, : self.system.dimension] = np.asarray(row, dtype=float)
        return out

    def _r(self, at: _Point) -> Array:
        slope, n = self._hy(at), self.system.dimension
        return slope[:, -1:] + slope[:, :n] @ self._f(at)

    def _ry(self, at: _Point) -> Array:
        return self._by_all(self._r, at)

    def _rs(self, at: _Point) -> Array:
        return self._by_signs(self._r, at)

    def _radius(self, at: _Point) -> Array:
        record = self.system.parameters.record(at.p)
        rows = [
            [float(b(at.t, at.x, record)) if callable(b) else float(b) for b in surface.radius]
            for surface in self.system.surfaces
        ]  # fmt: skip
        return np.array(rows).reshape(-1, 2)

    def _radiusy(self, at: _Point) -> Array:
        return self._by_all(lambda point: self._radius(point).reshape(-1, 1), at)

    def _by_all(self, function: Callable[[_Point], Array], at: _Point, states: bool = True) -> Array:
        """Derivatives by x, the parameters and t, one column each."""
        columns = [_difference(function, at, "x", j) for j in range(len(at.x) if states else 0)]
        columns += [_difference(function, at, "p", j) for j in self.places]
        columns.append(_difference(function, at, "t", 0))
        return np.hstack(columns)

    def _by_signs(self, function: Callable[[_Point], Array], at: _Point) -> Array:
        columns = [_difference(function, at, "s", j, 1e-2) for j in self.sliding]
        return np.hstack(columns) if columns else np.zeros((len(function(at)), 0))


class _Point:
    """t, x, s, p in one place, with one number moved."""

    def __init__(self, t: float, x: Array, s: Array, p: Array) -> None:
        self.t, self.x, self.s, self.p = t, x, s, p

    def value(self, name: str, j: int) -> float:
        return float(self.t if name == "t" else getattr(self, name)[j])

    def moved(self, name: str, j: int, by: float) -> _Point:
        values: dict[str, Any] = {"t": self.t, "x": self.x, "s": self.s, "p": self.p}
        if name == "t":
            values["t"] = self.t + by
        else:
            values[name] = values[name].copy()
            values[name][j] += by
        return _Point(**values)


def _difference(
    function: Callable[[_Point], Array], at: _Point, name: str, j: int, step: float | None = None
) -> Array:
    reach = step or _RELATIVE * max(abs(at.value(name, j)), _SMALLEST)
    total = sum(w * function(at.moved(name, j, o * reach)) for o, w in zip(_OFFSETS, _WEIGHTS, strict=True))
    return np.asarray(total / reach)
