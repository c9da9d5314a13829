"""Derivatives of a mode for systems of plain functions: supplied, by dual numbers, or else by differences.

The field is smooth while its signs are held, also a little beyond a surface, so central differences of fourth
order may cross it. Their error is about 1e-10 relative to the size of the field.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from filippov import ModelError, System
from filippov.base.arrays import Array
from filippov.kernel.derivative.difference import local_slope
from filippov.kernel.derivative.exact import Exact, along
from filippov.kernel.derivative.overloaded import overloaded

# Offsets and weights of the central difference of fourth order, and its length along a sign.
_OFFSETS = (-2.0, -1.0, 1.0, 2.0)
_WEIGHTS = (1.0 / 12.0, -2.0 / 3.0, 2.0 / 3.0, -1.0 / 12.0)
_OF_SIGNS = 1e-2
# The magnitude of what is 0.
_OF_ZERO = 1e-2


class PlainParts:
    """The parts of a mode of plain functions, point by point (shapes as in `SymbolicParts`).

    jacobian   (t, x, p, s) -> df/dx, shape (n, n), the signs held; None for differences
    """

    affine = False  # nobody knows

    def __init__(
        self, system: System, mode: tuple[int, ...], names: tuple[str, ...],
        jacobian: Callable[..., Any] | None,
    ) -> None:  # fmt: skip
        self.system, self.mode, self.jacobian = system, mode, jacobian
        self.places = [system.parameters.index(name) for name in names]
        self.sliding = [i for i, sign in enumerate(mode) if sign == 0]
        self.owners = tuple(self.sliding)
        assert system.field is not None
        dual = _DualParts(system)
        self._exact = {
            name: Exact(partial(self._at, getattr(self, f"_{name}")), getattr(dual, name))
            for name in ("f", "h", "r", "radius")
        }
        self._known: dict[str, tuple[bytes, tuple[Array, Array] | None]] = {}

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
            return self._by_all("f", at)
        n = self.system.dimension
        matrix = np.asarray(self.jacobian(at.t, at.x, self.system.parameters.record(at.p), at.s), dtype=float)
        if matrix.shape != (n, n):
            raise ModelError(f"jacobian returned the shape {matrix.shape}, expected ({n}, {n}).")
        return np.hstack([matrix, self._by_all("f", at, states=False)])

    def _fs(self, at: _Point) -> Array:
        return self._by_signs("f", at)

    def _h(self, at: _Point) -> Array:
        record = self.system.parameters.record(at.p)
        values = [float(surface.h(at.t, at.x, record)) for surface in self.system.surfaces]
        return np.array(values).reshape(-1, 1)

    def _hy(self, at: _Point) -> Array:
        out = self._by_all("h", at)
        for i, surface in enumerate(self.system.surfaces):
            if surface.gradient is not None:
                row = surface.gradient(at.t, at.x, self.system.parameters.record(at.p))
                out[i, : self.system.dimension] = np.asarray(row, dtype=float)
        return out

    def _r(self, at: _Point) -> Array:
        slope, n = self._hy(at), self.system.dimension
        return slope[:, -1:] + slope[:, :n] @ self._f(at)

    def _ry(self, at: _Point) -> Array:
        return self._by_all("r", at)

    def _rs(self, at: _Point) -> Array:
        return self._by_signs("r", at)

    def _held(self, at: _Point) -> Array:
        return self._h(at)[self.sliding]

    def _heldy(self, at: _Point) -> Array:
        return self._hy(at)[self.sliding]

    def _k(self, at: _Point) -> Array:
        return self._r(at)[self.sliding]

    def _ky(self, at: _Point) -> Array:
        return self._ry(at)[self.sliding]

    def _ks(self, at: _Point) -> Array:
        return self._rs(at)[self.sliding]

    def _radius(self, at: _Point) -> Array:
        record = self.system.parameters.record(at.p)
        rows = [
            [float(b(at.t, at.x, record)) if callable(b) else float(b) for b in surface.radius]
            for surface in self.system.surfaces
        ]  # fmt: skip
        return np.array(rows).reshape(-1, 2)

    def _radiusy(self, at: _Point) -> Array:
        return self._by_all("radius", at)

    def _at(self, function: Callable[[_Point], Array], numbers: Array) -> Array:
        t, x, s, p = _split(self.system, numbers)
        return function(_Point(float(t), x, s, p)).ravel()

    def _matrix(self, name: str, at: _Point) -> Array | None:
        """The derivatives of a part by x, p, s and t, in this order; None where differences have to do."""
        numbers = np.concatenate([at.x, at.p, at.s, [at.t]])
        key = numbers.tobytes()
        if self._known.get(name, (b"",))[0] != key:
            self._known[name] = key, self._exact[name](numbers)
        found = self._known[name][1]
        return None if found is None else found[1]

    def _by_all(self, name: str, at: _Point, states: bool = True) -> Array:
        """Derivatives by x, the parameters and t, one column each."""
        n, matrix = len(at.x), self._matrix(name, at)
        if matrix is not None:
            return matrix[:, [*range(n if states else 0), *(n + j for j in self.places), -1]]
        places = [("x", j) for j in range(n if states else 0)]
        places += [*(("p", j) for j in self.places), ("t", 0)]
        return np.hstack([self._difference(name, at, *place) for place in places])

    def _by_signs(self, name: str, at: _Point) -> Array:
        matrix = self._matrix(name, at)
        if matrix is not None:
            return matrix[:, [len(at.x) + len(at.p) + j for j in self.sliding]]
        columns = [self._sign_difference(name, at, j) for j in self.sliding]
        return np.hstack(columns) if columns else np.zeros((len(getattr(self, f"_{name}")(at)), 0))

    def _difference(self, name: str, at: _Point, of: str, j: int) -> Array:
        """The derivative of each component of a part by one number, over a length on which it is straight."""
        function, value, known = getattr(self, f"_{name}"), at.value(of, j), dict[float, Array]()
        others = float(np.max(np.abs(at.x), initial=0.0)) if of == "x" else 0.0

        def component(i: int, moved: float) -> float:
            if moved not in known:
                known[moved] = function(at.moved(of, j, moved - value)).ravel()
            return float(known[moved][i])

        count, size = function(at).size, max(abs(value), 1e-3 * others) or _OF_ZERO
        return np.array([[local_slope(partial(component, i), value, size)] for i in range(count)])

    def _sign_difference(self, name: str, at: _Point, j: int) -> Array:
        # Signs are of size 1, and parts are as good as linear in them.
        function = getattr(self, f"_{name}")
        total = sum(
            w * function(at.moved("s", j, o * _OF_SIGNS)) for o, w in zip(_OFFSETS, _WEIGHTS, strict=True)
        )
        return np.asarray(total / _OF_SIGNS).reshape(-1, 1)


class _DualParts:
    """The parts of a mode as functions of the numbers (x, p, s, t), which may be dual."""

    def __init__(self, system: System) -> None:
        assert system.field is not None
        self.system, self.field = system, overloaded(system.field)
        self.surfaces = [overloaded(surface.h) for surface in system.surfaces]
        ends = [end for surface in system.surfaces for end in surface.radius]
        self.ends: list[Any] = [overloaded(end) if callable(end) else end for end in ends]
        self.record = system.parameters.record(np.zeros(len(system.parameters)))

    def f(self, numbers: Any) -> Any:
        t, x, s, p = _split(self.system, numbers)
        return self.field(t, x, self.record.holding(p), s)

    def h(self, numbers: Any) -> list[Any]:
        t, x, _, p = _split(self.system, numbers)
        return [h(t, x, self.record.holding(p)) for h in self.surfaces]

    def r(self, numbers: Any) -> list[Any]:
        still = [0.0] * (len(numbers) - self.system.dimension - 1)
        return along(self.h, numbers, [*self.f(numbers), *still, 1.0])[1]

    def radius(self, numbers: Any) -> list[Any]:
        t, x, _, p = _split(self.system, numbers)
        return [end(t, x, self.record.holding(p)) if callable(end) else end for end in self.ends]


def _split(system: System, numbers: Any) -> tuple[Any, Any, Any, Any]:
    """t, x, s and p of the numbers (x, p, s, t)."""
    n, places = system.dimension, system.dimension + len(system.parameters)
    return numbers[-1], numbers[:n], numbers[places:-1], numbers[n:places]


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
