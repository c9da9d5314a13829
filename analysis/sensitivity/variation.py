"""The linearised field of every mode, sliding included, exact from the symbolic form.

Derivatives are taken by y = (x, q, t): the states, requested parameters q, and time, which evolve with
y' = (f, 0, 1). In a sliding mode the multipliers follow: s(y) solves k(y, s) = dh/dt = 0, so the matrix of
the linearised field is A = f_y - f_s (k_s)^-1 k_y (implicit function theorem). Where no sign acts on dh/dt,
as in sliding of higher order, k is the first derivative d^q h/dt^q on which one does, and those before it are
0 as h is: together they are the conditions of the slide. A system of plain functions is differentiated in
`filippov.analysis.sensitivity.plain_variation`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
import sympy

from filippov import System, UsageError
from filippov import t as time
from filippov.analysis.algebra import linalg
from filippov.analysis.sensitivity.plain_variation import PlainParts
from filippov.base.arrays import Array
from filippov.base.names import unknown
from filippov.model.symbolic import rate_along

# Of the sum of its terms: a rate below it is 0 to rounding, and a field that a multiplier moves by less does
# not depend on it.
ROUNDING = 1e-13


class Parts(Protocol):
    """Field, switching functions and derivatives of one mode, on many points at once.

    affine   whether the rates of the sliding surfaces are known to be affine in their multipliers
    owners   the sliding surface of each condition of the slide
    """

    affine: bool
    owners: tuple[int, ...]

    def part(self, name: str, t: Array, x: Array, s: Array, p: Array) -> Array:
        """One of f, fy, fs, h, hy, r, ry, rs, k, ky, ks, held, heldy, radius, radiusy."""


class SymbolicParts:
    """The parts of a mode from expressions.

    f (n, 1), fy (n, N), fs (n, sliding); h (m, 1), hy (m, N); r = dh/dt (m, 1), ry (m, N), rs (m, sliding);
    what the multipliers solve, k (sliding, 1), ky (sliding, N), ks (sliding, sliding); the conditions of the
    slide held (c, 1), heldy (c, N); radius (m, 2), radiusy (2 m, N), with N = n + number of parameters + 1.
    """

    def __init__(self, system: System, mode: tuple[int, ...], names: tuple[str, ...]) -> None:
        form = system.symbolic
        assert form is not None
        arguments = (time, *form.x, *form.s, *form.p)
        places = [system.parameters.index(name) for name in names]
        by = (*form.x, *(form.p[i] for i in places), time)
        f, h = sympy.Matrix(form.at_mode(mode)), _column(form.h_at_mode(mode))
        free = [form.s[i] for i, sign in enumerate(mode) if sign == 0]
        slope = h.jacobian(form.x) if len(h) else sympy.zeros(0, len(form.x))
        rate = h.diff(time) + slope * f if len(h) else h
        held = [i for i, sign in enumerate(mode) if sign == 0]
        chains = {i: _acted_on(rate[i], list(f), form.x, set(free)) for i in held}
        known = {i: chain[-1] for i, chain in chains.items()}
        conditions = [(i, q) for i, chain in chains.items() for q in (h[i], *chain[:-1])]
        self.owners = tuple(i for i, _ in conditions)
        radius = sympy.Matrix([list(pair) for pair in form.radius]) if len(h) else sympy.zeros(0, 2)
        ends = _column(radius)
        matrices = {
            "f": f, "fy": _slopes(f, by), "fs": _slopes(f, free), "h": h, "hy": _slopes(h, by),
            "r": rate, "ry": _slopes(rate, by), "rs": _slopes(rate, free), "k": _column(known.values()),
            "held": (zero := _column(q for _, q in conditions)), "heldy": _slopes(zero, by),
            "radius": radius, "radiusy": _slopes(ends, by),
        }  # fmt: skip
        for name, first, names_of in (("ky", "ry", by), ("ks", "rs", free)):
            rows = [
                matrices[first][i, :] if k == rate[i] else _slopes(sympy.Matrix([k]), names_of)
                for i, k in known.items()
            ]
            matrices[name] = sympy.Matrix.vstack(*rows) if rows else sympy.zeros(0, len(names_of))
        self.affine = not matrices["ks"].free_symbols & set(free)
        self._shapes = {name: matrix.shape for name, matrix in matrices.items()}
        self._arguments = arguments
        self._matrices = matrices
        self._functions: dict[str, Callable[..., Any]] = {}

    def part(self, name: str, t: Array, x: Array, s: Array, p: Array) -> Array:
        """One of the parts on all points: (k, rows, columns)."""
        rows, columns = self._shapes[name]
        if not rows * columns:
            return np.empty((t.size, rows, columns))
        if name not in self._functions:
            matrix = self._matrices[name]
            self._functions[name] = sympy.lambdify(self._arguments, list(matrix), "numpy", cse=True)
        with np.errstate(all="ignore"):
            values = self._functions[name](t, *x.T, *s.T, *p)
        out = np.empty((t.size, rows * columns))
        for j, value in enumerate(values):
            out[:, j] = value
        return out.reshape(t.size, rows, columns)


def _acted_on(rate: Any, field: Sequence[Any], x: Sequence[Any], free: set[Any]) -> list[Any]:
    """The rate and its derivatives along the field up to the first with a free sign in it; alone for none."""
    found = [rate]
    for _ in range(len(x)):
        if found[-1].free_symbols & free:
            return found
        found.append(rate_along(found[-1], field, x))
    return found if found[-1].free_symbols & free else [rate]


def _column(items: Any) -> sympy.Matrix:
    flat = list(items)
    return sympy.Matrix(flat) if flat else sympy.zeros(0, 1)


def _slopes(functions: sympy.Matrix, by: Any) -> sympy.Matrix:
    if not len(functions) or not len(by):
        return sympy.zeros(len(functions), len(by))
    return functions.jacobian(by)


class ModeField:
    """A mode's field with its derivatives: the parts, and what follows from them.

    Each method takes times (k,), states (k, n), signs (k, m) with the multipliers of sliding surfaces in
    place, and one parameter row; shapes of the results begin with k.
    """

    def __init__(
        self, system: System, mode: tuple[int, ...], names: tuple[str, ...] = (), jacobian: Any = None
    ) -> None:
        for name in names:
            if name not in system.parameters:
                raise UsageError(unknown("parameter", name, system.parameters.names))
        self.system, self.mode, self.names = system, mode, names
        self.size = system.dimension + len(names) + 1
        self.sliding = [i for i, sign in enumerate(mode) if sign == 0]
        self.parts: Parts = (
            PlainParts(system, mode, names, jacobian)
            if system.symbolic is None
            else SymbolicParts(system, mode, names)
        )

    def part(self, name: str, t: Array, x: Array, s: Array, p: Array) -> Array:
        """One of the parts on all points."""
        return self.parts.part(name, t, x, s, p)

    def conditions(self, surfaces: Sequence[int]) -> list[int]:
        """The rows of "held" that belong to these sliding surfaces."""
        return [row for row, i in enumerate(self.parts.owners) if i in surfaces]

    def velocity(self, t: Array, x: Array, s: Array, p: Array) -> Array:
        """y' = (f, 0, 1): (k, N)."""
        out = np.zeros((t.size, self.size))
        out[:, : self.system.dimension] = self.part("f", t, x, s, p)[:, :, 0]
        out[:, -1] = 1.0
        return out

    def velocity_at(self, t: float, x: Array, p: Array) -> Array:
        """y' at one point, with the multipliers there: (N,)."""
        times, states = np.array([t]), x[None, :]
        return np.asarray(self.velocity(times, states, self.multipliers(times, states, p), p)[0])

    def multiplier_slope(self, t: Array, x: Array, s: Array, p: Array) -> Array:
        """ds/dy of the sliding surfaces: (k, sliding, N)."""
        ks, ky = self.part("ks", t, x, s, p), self.part("ky", t, x, s, p)
        try:
            return np.asarray(-linalg.solve(ks, ky), dtype=np.float64)
        except linalg.MatrixError:
            if np.any(self._left_free(ks, t, x, s, p)):
                raise
            return np.asarray(-(linalg.pinv(ks) @ ky), dtype=np.float64)

    def matrix(self, t: Array, x: Array, s: Array, p: Array) -> Array:
        """A = dy'/dy along the mode: (k, N, N)."""
        n = self.system.dimension
        out = np.zeros((t.size, self.size, self.size))
        out[:, :n] = self.part("fy", t, x, s, p)
        if self.sliding:
            out[:, :n] += self.part("fs", t, x, s, p) @ self.multiplier_slope(t, x, s, p)
        return out

    def multipliers(self, t: Array, x: Array, p: Array) -> Array:
        """Signs (k, m) with the multipliers of the sliding surfaces solved from k = 0 (Newton from 0)."""
        s = np.tile(np.array(self.mode, dtype=float), (t.size, 1))
        for _ in range(40 if self.sliding else 0):
            known, ks = self.part("k", t, x, s, p)[:, :, 0], self.part("ks", t, x, s, p)
            change = self._newton(ks, known, t, x, s, p)
            s[:, self.sliding] -= change
            if self.parts.affine or np.max(np.abs(change), initial=0.0) < 1e-14 * (1.0 + np.max(np.abs(s))):
                break
        return s

    def _newton(self, ks: Array, known: Array, t: Array, x: Array, s: Array, p: Array) -> Array:
        """The change of the multipliers to k = 0. Where neither a rate nor the field depends on one, as where
        a slide k v (1 - s) comes to v = 0, any value holds it: the nearest one."""
        try:
            return np.asarray(linalg.solve(ks, known[..., None])[..., 0])
        except linalg.MatrixError:
            change = (linalg.pinv(ks) @ known[..., None])[..., 0]
            left = np.abs((ks @ change[..., None])[..., 0] - known)
            normals = np.abs(self.part("hy", t, x, s, p)[:, self.sliding, :])
            size = (normals @ np.abs(self.velocity(t, x, s, p))[..., None])[..., 0]
            size = np.maximum(size, np.abs(ks).sum(axis=2) * (1.0 + np.abs(s).max(axis=1, keepdims=True)))
            if np.any(left > ROUNDING * size) or np.any(self._left_free(ks, t, x, s, p)):
                raise
            return np.asarray(change)

    def _left_free(self, ks: Array, t: Array, x: Array, s: Array, p: Array) -> npt.NDArray[np.bool_]:
        """Where the field depends on what k = 0 leaves free in the multipliers: (points,)."""
        f, fs = self.part("f", t, x, s, p), self.part("fs", t, x, s, p)
        moved = np.abs(fs @ (np.eye(ks.shape[-1]) - linalg.pinv(ks) @ ks))
        size = np.maximum(np.abs(f).max(axis=(1, 2)), np.abs(fs).max(axis=(1, 2)))
        return np.asarray(moved.max(axis=(1, 2)) > ROUNDING * size)


@lru_cache(maxsize=512)
def mode_field(
    system: System, mode: tuple[int, ...], names: tuple[str, ...] = (), jacobian: Any = None
) -> ModeField:
    """The (cached) linearised field of a mode; names: parameters to differentiate by.

    jacobian: for a system of plain functions, (t, x, p, s) -> df/dx with the signs held; else by dual
              numbers or differences.
    """
    return ModeField(system, mode, names, jacobian)


def signs_at(
    system: System, t: Array, x: Array, p: Array, jacobian: Any = None
) -> tuple[Array, Array]:
    """The switching functions at points (k, m), and their signs (+1 at 0), by which sizes in others go."""
    m = len(system.surfaces)
    h, signs = np.zeros((t.size, m)), np.ones((t.size, m))
    for _ in range(m + 1):
        for mode in {tuple(int(v) for v in row) for row in signs}:
            rows = np.all(signs == np.array(mode, dtype=float), axis=1)
            part = mode_field(system, mode, (), jacobian)
            h[rows] = part.part("h", t[rows], x[rows], signs[rows], p)[:, :, 0]
        last, signs = signs, np.where(h >= 0.0, 1.0, -1.0)
        if np.array_equal(last, signs):
            break
    return h, signs


def gauss(stages: int) -> tuple[Array, Array, Array]:
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


_NODES, _WEIGHTS, _MATRIX = gauss(4)
# One Gauss step of length h is wrong by 6e-10 |z|**9 of exp(z), z = eigenvalue times h; by how much a product
# of steps may be wrong, and into how many parts one is divided at most. A step of less is not divided.
_ERROR, _WRONG, _MOST_PARTS, _FURTHEST = 6e-10, 1e-14, 16, 0.3
# What decays faster than this need not be followed but only decay: parts of length _DAMPED / |z| leave 0.006
# of it each, which no longer ones do; then so many parts carry on what is slow.
_DECAYS, _DAMPING, _DAMPED, _SLOW_PARTS = 30.0, 6, 5.5, 2
# Stiff eigenvalues within this factor of each other decay together.
_TOGETHER = 1.3
# Numbers in the linear equations of steps that are solved at once.
_MOST_NUMBERS = 1 << 23


def _divided(
    field: ModeField, start: Array, step: Array, state: Callable[[Array], Array], p: Array
) -> tuple[Array, Array, npt.NDArray[np.int64]]:
    """The steps, divided where an eigenvalue of A times the step asks for it, and into how many each."""
    times = start + 0.5 * step
    x = state(times)
    a = field.matrix(times, x, field.multipliers(times, x, p), p)
    reach = np.abs(step) * np.max(np.sum(np.abs(a), axis=2), axis=1)
    check = np.isfinite(reach) & (reach > _FURTHEST)
    if not np.any(check):
        return start, step, np.ones(start.size, dtype=np.int64)
    counts, early = np.ones(start.size, dtype=int), np.zeros(start.size, dtype=int)
    length = np.zeros(start.size)
    n = field.system.dimension
    z = linalg.eigvals(a[check][:, :n, :n]) * step[check, None]
    counts[check], early[check], length[check] = _parts(z)
    rest = (1.0 - early * length) / (counts - early)
    each = np.repeat(np.arange(start.size), counts)
    k = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    first = k < early[each]
    passed = np.minimum(k, early[each]) * length[each] + np.maximum(k - early[each], 0) * rest[each]
    return (
        start[each] + passed * step[each], np.where(first, length[each], rest[each]) * step[each], counts
    )  # fmt: skip


def _parts(z: npt.NDArray[np.complex128]) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], Array]:
    """Numbers of parts for rows of eigenvalues times a step, how many of them come first, and their length.

    The length is of the step; the others are equal.
    """
    size, decay = np.abs(z), np.minimum(z.real, 0.0)
    # m parts together are wrong by _ERROR m (|z|/m)**9 exp(Re z), relative to 1.
    needed = (_ERROR / _WRONG * size**9 * np.exp(decay)) ** 0.125
    stiff = decay < -np.maximum(_DECAYS, 0.9 * size)
    largest, least = np.max(size, axis=1), np.min(np.where(stiff, size, np.inf), axis=1)
    slow = np.max(np.where(stiff, 0.0, needed), axis=1)
    whole = np.where(stiff.any(axis=1), np.inf, slow)
    counts = np.clip(np.ceil(whole), 1, _MOST_PARTS).astype(int)
    begun = np.maximum(np.ceil(slow), _SLOW_PARTS) + _DAMPING
    damped = (begun < _MOST_PARTS) & stiff.any(axis=1) & (largest < _TOGETHER * least)
    return (
        np.where(damped, begun, counts).astype(int),
        np.where(damped, _DAMPING, 0),
        np.where(damped, _DAMPED / np.maximum(largest, 1.0), 0.0),
    )


def transitions(
    field: ModeField, spans: Sequence[tuple[Array, Array]], state: Callable[[Array], Array], p: Array
) -> list[Array]:
    """Products of the transition matrices of Y' = A Y over spans of steps in one mode: (N, N) for each.

    spans: (starts, steps) of each; state(t) gives x at the nodes. Gauss collocation of order 8 on the
    integrator's own steps, all of them at once. A step is divided where the matrix itself requires it, even
    if the solution does not.
    """
    sizes = np.array([start.size for start, _ in spans])
    starts, steps, counts = _divided(
        field, np.concatenate([start for start, _ in spans]), np.concatenate([step for _, step in spans]),
        state, p,
    )  # fmt: skip
    at_once = max(1, _MOST_NUMBERS // (len(_NODES) * field.system.dimension) ** 2)
    matrices = np.concatenate([
        _over_steps(field, starts[k : k + at_once], steps[k : k + at_once], state, p)
        for k in range(0, max(starts.size, 1), at_once)
    ])  # fmt: skip
    ends = np.append(0, np.cumsum(counts))[np.append(0, np.cumsum(sizes))]
    return [_product(matrices[first:last]) for first, last in pairwise(ends.tolist())]


def _over_steps(
    field: ModeField, start: Array, step: Array, state: Callable[[Array], Array], p: Array
) -> Array:
    """The transition matrix of each step: (k, N, N)."""
    n, size, stages = field.system.dimension, field.size, len(_NODES)
    times = (start[:, None] + step[:, None] * _NODES).ravel()
    x = state(times)
    s = field.multipliers(times, x, p)
    # Parameters and time do not depend on the states: only the rows of the states are unknown.
    a, units = _balanced(field.matrix(times, x, s, p)[:, :n])
    a = a.reshape(start.size, stages, n, size)
    # K_i = A_i (Y + step sum_j a_ij K_j): one linear system of size stages * n a step.
    scaled = -step[:, None, None, None] * a[..., :n]
    blocks = scaled[:, :, :, None, :] * _MATRIX[:, None, :, None]
    for i in range(stages):
        blocks[:, i, :, i, :] += np.eye(n)
    k = linalg.solve(blocks.reshape(-1, stages * n, stages * n), a.reshape(-1, stages * n, size))
    change = np.tensordot(k.reshape(-1, stages, n, size), _WEIGHTS, (1, 0))
    steps = np.tile(np.eye(size), (start.size, 1, 1))
    steps[:, :n] += step[:, None, None] * change * units[:n, None] / units
    return steps


def _balanced(a: Array) -> tuple[Array, Array]:
    """The matrices (k, n, N) in units of the states in which they are balanced, and the units (N,), 1 for
    what is no state. In others a pivot is taken where a unit is small, and rows lose all digits of theirs."""
    n, units = a.shape[1], np.ones(a.shape[2])
    known = np.isfinite(a).all(axis=(1, 2))
    if n > 1 and known.any():
        units[:n] = linalg.balance(np.max(np.abs(a[known][:, :, :n]), axis=0))
    return a * units / units[:n, None], units


def _product(steps: Array) -> Array:
    """The product of matrices (k, N, N), the first one to the right: pairwise, by far fewer calls."""
    while len(steps) > 1:
        odd = steps[-1:] if len(steps) % 2 else steps[:0]
        even = len(steps) - len(odd)
        steps = np.concatenate((steps[1:even:2] @ steps[0:even:2], odd))
    return np.asarray(steps[0]) if len(steps) else np.eye(steps.shape[1])
