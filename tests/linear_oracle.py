"""An oracle for piecewise-linear systems: matrix exponentials and bracketed roots, nothing of the package."""

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm
from scipy.optimize import brentq

Array = npt.NDArray[np.float64]


class NotGenericError(Exception):
    """The motion comes too close to something that two solvers may resolve differently."""


@dataclass(frozen=True)
class Linear:
    """x' = A x + b + sum_i s_i B_i, s_i the sign of c_i x - d_i."""

    A: Array
    b: Array
    B: Array
    c: Array
    d: Array

    def affine(self, mode: tuple[int, ...]) -> tuple[Array, Array]:
        """(A, b) of a mode; the multipliers of sliding surfaces are eliminated."""
        offset = self.b + sum((s * row for s, row in zip(mode, self.B, strict=True)), np.zeros(len(self.b)))
        sliding = [i for i, s in enumerate(mode) if s == 0]
        if not sliding:
            return self.A, offset
        gain = self.c[sliding] @ self.B[sliding].T
        if np.linalg.cond(gain) > 1e6:
            raise NotGenericError
        project = np.eye(len(self.b)) - self.B[sliding].T @ np.linalg.solve(gain, self.c[sliding])
        return project @ self.A, project @ offset

    def multipliers(self, mode: tuple[int, ...], x: Array) -> Array:
        """The signs of all surfaces, those of sliding ones solved from c_i x' = 0; columns as those of x."""
        signs = np.array(mode, dtype=float)
        s = np.repeat(signs, x[0].size).reshape(len(mode), *x.shape[1:])
        sliding = [i for i, v in enumerate(mode) if v == 0]
        if sliding:
            gain = self.c[sliding] @ self.B[sliding].T
            velocity = ((self.A @ x).T + self.b + self.B.T @ signs).T
            s[sliding] = -np.linalg.solve(gain, self.c[sliding] @ velocity)
        return s

    def flow(self, mode: tuple[int, ...], x: Array, t: float) -> Array:
        """The state after time t in one mode."""
        A, b = self.affine(mode)
        n = len(x)
        M = np.zeros((n + 1, n + 1))
        M[:n, :n], M[:n, n] = A * t, b * t
        return (expm(M) @ np.append(x, 1.0))[:n]

    def grid(self, mode: tuple[int, ...], x: Array, dt: float, count: int) -> Array:
        """The guards at 0, dt ... count dt: one matrix exponential, applied again and again."""
        A, b = self.affine(mode)
        n = len(x)
        M = np.zeros((n + 1, n + 1))
        M[:n, :n], M[:n, n] = A * dt, b * dt
        E, z = expm(M), np.empty((count + 1, n + 1))
        z[0] = np.append(x, 1.0)
        for k in range(count):
            z[k + 1] = E @ z[k]
        return self.guards(mode, z[:, :n].T).T

    def guards(self, mode: tuple[int, ...], x: Array) -> Array:
        """Positive while the mode lasts: s_i h_i off a surface, 1 - |multiplier| on it; columns as x's."""
        signs = np.array(mode, dtype=float)
        h = (self.c @ x).T - self.d
        return np.where(signs != 0, signs * h, 1 - np.abs(self.multipliers(mode, x).T)).T


    def guard_slope(self, mode: tuple[int, ...], i: int, x: Array) -> Array:
        """Gradient of guard i: that of s_i h_i off its surface, of 1 - |multiplier| on it."""
        if mode[i]:
            return mode[i] * self.c[i]
        sliding = [j for j, v in enumerate(mode) if v == 0]
        gain = self.c[sliding] @ self.B[sliding].T
        slopes = -np.linalg.solve(gain, self.c[sliding] @ self.A)
        return -float(np.sign(self.multipliers(mode, x)[i])) * slopes[sliding.index(i)]

    def jump(self, mode: tuple[int, ...], after: tuple[int, ...], i: int, x: Array) -> tuple[Array, float]:
        """Saltation matrix at an event, and how far a displacement of size 1 moves its time."""
        before, later = (A @ x + b for A, b in (self.affine(mode), self.affine(after)))
        slope = self.guard_slope(mode, i, x)
        rate = float(slope @ before)
        salt = np.eye(len(x)) + np.outer(later - before, slope) / rate
        return salt, float(np.linalg.norm(slope)) / abs(rate)

    def event(self, mode: tuple[int, ...], i: int, x: Array) -> "Event":
        """What happens where guard i vanishes at x."""
        after = next_mode(self, mode, i, x)
        return Event(x, after, *self.jump(mode, after, i, x))


@dataclass(frozen=True)
class Event:
    """State and mode after an event, saltation matrix, how far a displacement of size 1 moves its time."""

    x: Array
    mode: tuple[int, ...]
    salt: Array
    moved: float


@dataclass(frozen=True)
class Resetting(Linear):
    """The same with x -> R x + r where w x - e falls through 0, which is guard m.

    The signs after a reset are those of the surfaces; one that the reset leaves on a surface is decided by
    the rates there.
    """

    w: Array
    e: float
    R: Array
    r: Array

    def guards(self, mode: tuple[int, ...], x: Array) -> Array:
        return np.concatenate([super().guards(mode, x), [self.w @ x - self.e]])

    def event(self, mode: tuple[int, ...], i: int, x: Array) -> Event:
        if i < len(self.d):
            return super().event(mode, i, x)
        A, b = self.affine(mode)
        before = A @ x + b
        y = self.R @ x + self.r
        h, left = self.c @ y - self.d, self.w @ y - self.e
        on = [k for k, value in enumerate(mode) if value == 0 and abs(h[k]) < 1e-12]
        if any(abs(value) < 1e-3 for k, value in enumerate(h) if k not in on) or left < -1e-12:
            raise NotGenericError
        mode = tuple(0 if k in on else int(np.sign(value)) for k, value in enumerate(h))
        if on:
            mode = consistent(self, mode, on, y)
        A, b = self.affine(mode)
        later, rate = A @ y + b, float(self.w @ before)
        # It must be off the surface by far, or leave it.
        if left < 1e-3 and (left > 1e-12 or self.w @ later < 1e-3):
            raise NotGenericError
        salt = self.R + np.outer(later - self.R @ before, self.w) / rate
        return Event(y, mode, salt, float(np.linalg.norm(self.w)) / abs(rate))


def next_mode(system: Linear, mode: tuple[int, ...], i: int, x: Array) -> tuple[int, ...]:
    """The mode after guard i of one surface vanished at x."""
    if mode[i] == 0:
        side = int(np.sign(system.multipliers(mode, x)[i]))
        return (*mode[:i], side, *mode[i + 1 :])
    if any(m == 0 for m in mode):
        return corner(system, mode, i, x)
    rates = []
    for s in (1, -1):
        A, b = system.affine((*mode[:i], s, *mode[i + 1 :]))
        rates.append(float(system.c[i] @ (A @ x + b)))
    if min(abs(r) for r in rates) < 1e-4:
        raise NotGenericError
    if rates[0] < 0 < rates[1]:
        return (*mode[:i], 0, *mode[i + 1 :])
    if rates[0] * rates[1] < 0:
        raise NotGenericError
    return (*mode[:i], int(np.sign(rates[0])), *mode[i + 1 :])


def corner(system: Linear, mode: tuple[int, ...], i: int, x: Array) -> tuple[int, ...]:
    """The one consistent mode where the sliding motion of another surface reaches surface i."""
    return consistent(system, mode, sorted({i, *(j for j, m in enumerate(mode) if m == 0)}), x)


def consistent(system: Linear, mode: tuple[int, ...], met: list[int], x: Array) -> tuple[int, ...]:
    """The one mode that goes on from a point on the surfaces `met`."""
    found = []
    for picked in itertools.product((1, -1, 0), repeat=len(met)):
        signs = list(mode)
        for j, value in zip(met, picked, strict=True):
            signs[j] = value
        trial = tuple(signs)
        A, b = system.affine(trial)
        rates, s = system.c @ (A @ x + b), system.multipliers(trial, x)
        margins = [trial[j] * rates[j] if trial[j] else 1 - abs(s[j]) for j in met]
        if min(abs(v) for v in margins) < 1e-4:
            raise NotGenericError
        if min(margins) > 0:
            found.append(trial)
    if len(found) != 1:
        raise NotGenericError
    return found[0]


def first_zero(
    f: Callable[[float], Array], grid: Callable[[float, int], Array], end: float, dt: float, skip: int
) -> tuple[float, int] | None:
    """The first time in (0, end] at which an entry of f falls through 0 (grid of width dt, brentq).

    grid(dt, k): the values of f at 0, dt ... k dt.
    """
    count = max(int(np.ceil(end / dt)) - 1, 0)
    values = grid(dt, count)
    # How far a guard may dip between two points of the grid: what a parabola through three of them would.
    bent = np.abs(np.diff(values, 2, axis=0)) if count > 1 else np.zeros((1, values.shape[1]))
    previous, past = 0.0, values[0]
    for k in range(1, count + 2):
        time = k * dt if k <= count else end
        value = values[k] if k <= count else f(end)
        falls = [i for i in range(len(value)) if value[i] < 0]
        if previous == 0.0 and any(i == skip and past[i] < 1e-9 for i in falls):
            # It has come back to the surface that it left within one width of the grid.
            raise NotGenericError
        if falls:
            # A value of the grid that is 0 to rounding may have another sign by itself.
            starts, ends = f(previous), f(time)
            if any(past[i] <= 0 or starts[i] <= 0 or ends[i] >= 0 for i in falls):
                raise NotGenericError
            roots = [
                (brentq(lambda u, i=i: f(u)[i], previous, time, xtol=1e-15, rtol=1e-14), i)
                for i in falls
            ]
            roots.sort()
            if len(roots) > 1 and roots[1][0] - roots[0][0] < 1e-6:
                raise NotGenericError
            return roots[0]
        # Twice down and up again between two points of the grid would not be seen.
        dips = np.max(bent[max(min(k, len(bent)) - 2, 0) : k], axis=0) / 2
        shallow = np.maximum(2e-3, dips)
        close = (value < shallow) | ((past < shallow) & (previous > 0.0))
        if skip >= 0 and previous == 0.0 and past[skip] > 1e-9 and min(past[skip], value[skip]) < dips[skip]:
            raise NotGenericError
        if np.any(close & (np.arange(len(value)) != skip)) or (
            close[skip] if skip >= 0 and previous > 0.05 else False
        ):
            raise NotGenericError
        previous, past = time, value
    return None


@dataclass(frozen=True)
class Answer:
    """Events (time, surface, mode after), the final state, and what the motion makes of small errors.

    state, times   largest factor by which an error made anywhere grows until the end, and in the time of each
                   event: norms of products of matrix exponentials and saltation matrices
    """

    events: list[tuple[float, int, tuple[int, ...]]]
    final: Array
    state: float
    times: Array


def _growth(factors: list[Array]) -> float:
    """Largest norm of a product of the last factors, at least 1."""
    total, largest = np.eye(len(factors[0])), 1.0
    for factor in reversed(factors):
        total = total @ factor
        largest = max(largest, float(np.linalg.norm(total, 2)))
    return largest


def solve_linear(system: Linear, x0: Array, end: float, most: int = 30) -> Answer:
    """The motion from x0 until `end`; NotGenericError near anything delicate, and for `most` events."""
    h = system.c @ x0 - system.d
    if np.min(np.abs(h)) < 1e-3:
        raise NotGenericError
    mode: tuple[int, ...] = tuple(int(v) for v in np.sign(h))
    t, x, skip = 0.0, x0, -1
    events: list[tuple[float, int, tuple[int, ...]]] = []
    factors: list[Array] = []
    times: list[float] = []
    for _ in range(most):
        found = first_zero(
            lambda u, m=mode, y=x: system.guards(m, system.flow(m, y, u)),
            lambda dt, count, m=mode, y=x: system.grid(m, y, dt, count),
            end - t, 0.01, skip,
        )  # fmt: skip
        if found is None:
            factors.append(expm(system.affine(mode)[0] * (end - t)))
            return Answer(events, system.flow(mode, x, end - t), _growth(factors), np.array(times))
        wait, i = found
        factors.append(expm(system.affine(mode)[0] * wait))
        x, t = system.flow(mode, x, wait), t + wait
        event = system.event(mode, i, x)
        times.append(_growth(factors) * event.moved)
        factors.append(event.salt)
        x, mode, skip = event.x, event.mode, i
        events.append((t, i, mode))
    raise NotGenericError
