"""The linearised field of every mode, sliding included: A(t, x) = df_mode/dx, exact from the symbolic form.

In a sliding mode the multipliers follow the state: s(x) solves r(x, s) = dh/dt = 0, so
A = f_x - f_s (r_s)^-1 r_x (implicit function theorem).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy

from filippov.errors import UsageError
from filippov.symbols import t as time
from filippov.system import System

Array = npt.NDArray[np.float64]


class ModeField:
    """Field, switching functions and their derivatives in one mode, on many points at once.

    Each method takes times (k,), states (k, n), signs (k, m) with the multipliers of sliding surfaces in
    place, and one parameter row; shapes of the results begin with k.
    """

    def __init__(self, system: System, mode: tuple[int, ...]) -> None:
        form = system.symbolic
        if form is None:
            raise UsageError(
                "derivatives need a system written in expressions; this one is given by plain functions. "
                "Rewrite it with states(...) and parameters(...), or use differences of the map."
            )
        self.system, self.mode = system, mode
        self.sliding = [i for i, sign in enumerate(mode) if sign == 0]
        arguments = (time, *form.x, *form.s, *form.p)
        f, h = sympy.Matrix(form.at_mode(mode)), sympy.Matrix(form.h_at_mode(mode))
        free = [form.s[i] for i in self.sliding]
        gradient = h.jacobian(form.x) if len(h) else sympy.zeros(0, len(form.x))
        rate = h.diff(time) + gradient * f if len(h) else h
        radius = sympy.Matrix([list(pair) for pair in form.radius]) if len(h) else sympy.zeros(0, 2)
        parts = {
            "f": f,
            "fx": f.jacobian(form.x),
            "fs": f.jacobian(free) if free else sympy.zeros(len(f), 0),
            "g": gradient,
            "gt": h.diff(time),
            "r": rate,
            "rx": rate.jacobian(form.x) if len(h) else sympy.zeros(0, len(form.x)),
            "rs": rate.jacobian(free) if free and len(h) else sympy.zeros(len(h), len(free)),
            "radius": radius,
        }
        self._shapes = {name: matrix.shape for name, matrix in parts.items()}
        self._functions: dict[str, Callable[..., Any]] = {
            name: sympy.lambdify(arguments, list(matrix), "numpy", cse=True) for name, matrix in parts.items()
        }

    def part(self, name: str, t: Array, x: Array, s: Array, p: Array) -> Array:
        """One of f, fx, fs, g, gt, r, rx, rs, radius on all points: (k, rows, columns)."""
        rows, columns = self._shapes[name]
        with np.errstate(all="ignore"):
            values = self._functions[name](t, *x.T, *s.T, *p)
        stacked = [np.broadcast_to(np.asarray(v, dtype=float), t.shape) for v in values]
        if not stacked:
            return np.zeros((t.size, rows, columns))
        return np.asarray(np.stack(stacked, axis=-1).reshape(t.size, rows, columns))

    def multiplier_slope(self, t: Array, x: Array, s: Array, p: Array) -> Array:
        """ds/dx of the sliding surfaces: (k, sliding, n)."""
        rs = self.part("rs", t, x, s, p)[:, self.sliding, :]
        rx = self.part("rx", t, x, s, p)[:, self.sliding, :]
        return np.asarray(-np.linalg.solve(rs, rx), dtype=np.float64)

    def jacobian(self, t: Array, x: Array, s: Array, p: Array) -> Array:
        """A = df/dx along the mode, (k, n, n)."""
        a = self.part("fx", t, x, s, p)
        if self.sliding:
            a = a + self.part("fs", t, x, s, p) @ self.multiplier_slope(t, x, s, p)
        return a

    def multipliers(self, t: Array, x: Array, p: Array) -> Array:
        """Signs (k, m) with the multipliers of the sliding surfaces solved from r = 0 (Newton from 0)."""
        s = np.tile(np.array(self.mode, dtype=float), (t.size, 1))
        for _ in range(40 if self.sliding else 0):
            r = self.part("r", t, x, s, p)[:, self.sliding, 0]
            rs = self.part("rs", t, x, s, p)[:, self.sliding, :]
            change = np.linalg.solve(rs, r[..., None])[..., 0]
            s[:, self.sliding] -= change
            if np.max(np.abs(change), initial=0.0) < 1e-14:
                break
        return s


@lru_cache(maxsize=512)
def mode_field(system: System, mode: tuple[int, ...]) -> ModeField:
    """The (cached) linearised field of a mode."""
    return ModeField(system, mode)


def _gauss(stages: int) -> tuple[Array, Array, Array]:
    """Nodes, weights and matrix of Gauss collocation on [0, 1] (order 2 * stages)."""
    nodes, weights = np.polynomial.legendre.leggauss(stages)
    c, b = 0.5 * (nodes + 1.0), 0.5 * weights
    a = np.empty((stages, stages))
    for j in range(stages):
        others = np.delete(c, j)
        basis = np.poly1d(others, r=True) / np.prod(c[j] - others)
        integral = basis.integ()
        a[:, j] = integral(c) - integral(0.0)
    return c, b, a


_NODES, _WEIGHTS, _MATRIX = _gauss(4)


def transition(
    system: System,
    mode: tuple[int, ...],
    start: Array,
    step: Array,
    state: Callable[[Array], Array],
    p: Array,
) -> Array:
    """Product of the transition matrices of X' = A X over steps of one mode: (n, n).

    Gauss collocation of order 8 on the integrator's own steps, all of them at once; state(t) gives x on the
    nodes.
    """
    n, stages = system.dimension, len(_NODES)
    field = mode_field(system, mode)
    times = (start[:, None] + step[:, None] * _NODES).ravel()
    x = state(times)
    s = field.multipliers(times, x, p)
    a = field.jacobian(times, x, s, p).reshape(start.size, stages, n, n)
    # K_i = A_i (X + step sum_j a_ij K_j): one linear system of size stages * n a step.
    identity = np.eye(n)
    system_matrix = np.zeros((start.size, stages, n, stages, n))
    for i in range(stages):
        for j in range(stages):
            system_matrix[:, i, :, j, :] = -step[:, None, None] * _MATRIX[i, j] * a[:, i]
        system_matrix[:, i, :, i, :] += identity
    size = stages * n
    k = np.linalg.solve(system_matrix.reshape(-1, size, size), a.reshape(-1, size, n)).reshape(
        -1, stages, n, n
    )
    steps = identity + step[:, None, None] * np.einsum("i,sijk->sjk", _WEIGHTS, k)
    total = identity
    for matrix in steps:
        total = matrix @ total
    return total
