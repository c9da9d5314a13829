"""Random forced piecewise linear oscillators, followed by matrix exponentials, and their Floquet multipliers.

    x' = A x + b + F (cos w t, sin w t) + B sgn(c x - d),  x+ = R x + r at a clock,  v+ = -e v at a stop

With z = (x, 1, cos w t, sin w t) every mode is z' = L z: for s = -1, +1, and sliding, where s solves
c x' = 0. The derivative of the return is the product of exponentials, of saltation matrices
I + (f+ - f-) c/(c f-) and of those of impacts W + (f+ - W f-) g/(g f-). Leine & Nijmeijer 2004, ch. 7.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag, expm
from scipy.optimize import brentq

from filippov import Surface, System, TimeEvent, cos, sign, sin, states, t
from filippov.analysis.orbits.orbit_search import find_orbit

Array = npt.NDArray[np.float64]
STEPS, MOST = 600, 40
NAMES = states("x y z")


class NotGenericError(Exception):
    """The oracle does not judge: something is nearly tangent, or happens too often."""


@dataclass
class Oscillator:
    """Its coefficients; tick: (phase, R, r) or None; stop: (q0, e) on the first state or None."""

    A: Array
    b: Array
    F: Array
    w: float
    B: Array
    c: Array
    d: float
    tick: tuple[float, Array, Array] | None = None
    stop: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        n = self.n = len(self.b)
        self.T = 2 * np.pi / self.w
        turning = block_diag([[0.0]], [[0.0, -self.w], [self.w, 0.0]])
        own = np.hstack((self.A, self.b[:, None], self.F))
        free = np.vstack((own, np.hstack((np.zeros((3, n)), turning))))
        push = np.append(self.B, np.zeros(3))
        self.h = np.concatenate((self.c, [-self.d, 0.0, 0.0]))
        self.held = -(self.h @ free) / (self.c @ self.B)
        one = np.eye(n + 3)[n]
        self.L = {s: free + s * np.outer(push, one) for s in (-1, 1)} | {0: free + np.outer(push, self.held)}
        self.step = {s: expm(matrix * self.T / STEPS) for s, matrix in self.L.items()}
        ends = {"low": self.held + one, "high": self.held - one}
        stop = {} if self.stop is None else {"stop": np.eye(n + 3)[0] - self.stop[0] * one}
        self.guards = {-1: {"h": self.h, **stop}, 1: {"h": self.h, **stop}, 0: {**ends, **stop}}

    def system(self) -> System:
        """As it is written for the solver."""
        x = NAMES[: self.n]
        relay = sign(sum(float(k) * q for k, q in zip(self.c, x, strict=True)) - self.d)
        rows = {
            q: sum(float(k) * p for k, p in zip(a, x, strict=True)) + float(b)
            + float(f[0]) * cos(self.w * t) + float(f[1]) * sin(self.w * t) + float(push) * relay
            for q, a, b, f, push in zip(x, self.A, self.b, self.F, self.B, strict=True)
        }  # fmt: skip
        clocks, stops = [], []
        if self.tick is not None:
            phase, R, r = self.tick
            after = {q: sum(float(k) * p for k, p in zip(row, x, strict=True)) + float(e)
                     for q, row, e in zip(x, R, r, strict=True)}  # fmt: skip
            clocks = [TimeEvent("clock", period=self.T, start=phase * self.T, reset=after)]
        if self.stop is not None:
            stops = [Surface("stop", x[0] - self.stop[0], reset={x[1]: -self.stop[1] * x[1]}, side="+")]
        return System(rows, surfaces=stops, time_events=clocks)


def mode_at(a: Oscillator, z: Array, near: float = 1e-6) -> int:
    """The mode at z: by the sign of h, or sliding on h = 0 (`near` of it)."""
    value = a.h @ z
    if abs(value) > near:
        return int(np.sign(value))
    if near < 1e-6 and abs(a.held @ z) < 0.999 and a.c @ a.B < 0:
        return 0
    raise NotGenericError("starts on the surface")


def period(a: Oscillator, x: Array, t0: float = 0.0) -> tuple[Array, Array, int]:
    """State and derivative after one period, and the number of events."""
    n, now, events = a.n, 0.0, 0
    z = np.concatenate((x, [1.0, np.cos(a.w * t0), np.sin(a.w * t0)]))
    mode, M = mode_at(a, z, 1e-10), np.eye(n)
    if mode == 0:
        M = np.eye(n) - np.outer(a.B, a.c) / (a.c @ a.B)
    tick = np.inf if a.tick is None else (a.tick[0] * a.T - t0) % a.T
    if a.tick is not None and min(tick, a.T - tick) < 1e-6 * a.T:
        raise NotGenericError("starts at a tick")
    while now < a.T:
        span = min(tick, a.T) - now
        name, taken, z_end = until(a, mode, z, span)
        M = expm(a.L[mode] * taken)[:n, :n] @ M
        now, z = now + taken, z_end
        if name == "":
            if tick < a.T and now >= tick - 1e-14:
                now, tick = tick, np.inf
                z[:n], M = a.tick[1] @ z[:n] + a.tick[2], a.tick[1] @ M
                mode, events = mode_at(a, z), events + 1
                continue
            break
        events += 1
        if events > MOST:
            raise NotGenericError("too many events")
        mode, z, S = passed(a, mode, z, name)
        M = S @ M
    return z[:n], M, events


def until(a: Oscillator, mode: int, z: Array, span: float) -> tuple[str, float, Array]:
    """The first guard that is reached within `span` ("" for none), when, and the state there."""
    rows, names = np.array(list(a.guards[mode].values())), list(a.guards[mode])
    dt, count = a.T / STEPS, int(span / (a.T / STEPS))
    path = [z]
    for _ in range(count):
        path.append(a.step[mode] @ path[-1])
    path.append(expm(a.L[mode] * (span - count * dt)) @ path[-1])
    values = rows @ np.array(path).T
    # The side that the mode is on: below the one, above the other.
    side = np.array([{"low": 1, "high": -1, "stop": 1, "h": mode}[name] for name in names])
    beyond = values * side[:, None] < 0
    # A root at the start is the event before; of the first values it is the sign that tells.
    started = np.abs(values[:, 0]) < 1e-9
    if np.any(beyond[~started, 0]) or np.any(beyond[started, 1]):
        raise NotGenericError("leaves at once")
    beyond[:, 0] = False
    first = int(np.argmax(np.any(beyond, axis=0))) if np.any(beyond) else len(path)
    inside = (values * side[:, None])[:, :first]
    dips = (inside[:, 1:-1] < inside[:, :-2]) & (inside[:, 1:-1] < inside[:, 2:])
    if np.any(dips & (inside[:, 1:-1] < 1e-3 * (1 + np.max(np.abs(values))))):
        raise NotGenericError("nearly tangent")
    if first == len(path):
        return "", span, path[-1]
    found = []
    for k in np.flatnonzero(beyond[:, first]):
        def value(tau: float, k: int = k) -> float:
            return float(rows[k] @ expm(a.L[mode] * tau) @ path[first - 1])

        high = dt if first <= count else span - count * dt
        if value(0.0) * side[k] <= 0:
            raise NotGenericError("a root at a sample")
        found.append((brentq(value, 0.0, high, xtol=1e-15, rtol=1e-14), names[k]))
    if len(found) > 1:
        raise NotGenericError("two at once")
    tau, name = found[0]
    return name, (first - 1) * dt + tau, expm(a.L[mode] * tau) @ path[first - 1]


def passed(a: Oscillator, mode: int, z: Array, name: str) -> tuple[int, Array, Array]:
    """Mode and state after an event, and its saltation matrix."""
    n = a.n
    before = (a.L[mode] @ z)[:n]
    if name in ("low", "high"):
        return (-1 if name == "low" else 1), z, np.eye(n)
    if name == "stop":
        if abs(z[1]) < 1e-2 or a.stop is None:
            raise NotGenericError("slow impact")
        W, g, after = np.diag([1.0, -a.stop[1]]), np.array([1.0, 0.0]), z.copy()
        after[1] *= -a.stop[1]
        left = mode_at(a, after)
        return left, after, W + np.outer((a.L[left] @ after)[:n] - W @ before, g) / (g @ before)
    other = (a.L[-mode] @ z)[:n]
    if abs(a.c @ other) < 1e-3 or abs(a.c @ before) < 1e-3:
        raise NotGenericError("tangent")
    left = -mode if (a.c @ other) * (a.c @ before) > 0 else 0
    after = (a.L[left] @ z)[:n]
    return left, z, np.eye(n) + np.outer(after - before, a.c) / (a.c @ before)


def drawn(seed: int) -> tuple[Oscillator, Array]:
    """An oscillator of a mass with a relay or friction, or of three states, and a state."""
    rng = np.random.default_rng([66, seed])
    n, w = int(rng.choice([2, 2, 3])), float(rng.uniform(0.7, 2.5))
    tick = stop = None
    if n == 2:
        A = np.array([[0.0, 1.0], [-rng.uniform(0.3, 4), rng.uniform(-0.8, 0.2)]])
        b, F = np.array([0.0, rng.uniform(-0.5, 0.5)]), np.vstack((np.zeros(2), rng.uniform(-2, 2, 2)))
        B = np.array([0.0, -rng.uniform(0.1, 1.5)])
        c = np.array([0.0, 1.0]) if rng.random() < 0.4 else np.array([1.0, rng.uniform(0.1, 1)])
        if rng.random() < 0.4:
            stop = (float(rng.uniform(-1.5, -0.1)), float(rng.uniform(0.3, 0.9)))
    else:
        A = rng.uniform(-1.2, 1, (3, 3)) - 0.4 * np.eye(3)
        b, F = rng.uniform(-1, 1, 3), rng.uniform(-2, 2, (3, 2))
        B, c = rng.uniform(-1.5, 1.5, 3), rng.uniform(-1, 1, 3)
        B *= -np.sign(B @ c)
    if rng.random() < 0.4 and stop is None:
        tick = (float(rng.uniform(0.1, 0.9)), rng.uniform(-1, 1, (n, n)), rng.uniform(-0.5, 0.5, n))
    d = float(rng.uniform(-0.5, 0.5)) if c[0] else 0.0
    x = rng.uniform(-1, 1, n)
    if stop is not None:
        x[0] = abs(x[0]) + 0.2
    return Oscillator(A, b, F, w, B, c, d, tick, stop), x


def known_orbit(a: Oscillator, x: Array) -> Array | None:
    """A fixed point of the return, by iterates and Newton's method."""
    for _ in range(8):
        x = period(a, x)[0]
    for _ in range(25):
        after, M, _ = period(a, x)
        gap = after - x
        if np.max(np.abs(gap)) < 1e-11:
            return x
        x = x + np.linalg.solve(np.eye(a.n) - M, gap)
        if not np.all(np.abs(x) < 50):
            return None
    return None


def multipliers(seed: int) -> str | None:
    """What is wrong with the orbit that is found and its multipliers; None where the oracle is silent."""
    return judged(*drawn(seed), seed)


def judged(a: Oscillator, start: Array, seed: int) -> str | None:
    """The same of an oscillator, from the orbit that the oracle finds from a state."""
    try:
        x = known_orbit(a, start)
        if x is None or period(a, x)[2] == 0:
            return None
        known = np.linalg.eigvals(period(a, x)[1])
        if np.min(np.abs(known - 1)) < 0.02 or np.max(np.abs(known)) > 20:
            return None
    except (NotGenericError, np.linalg.LinAlgError):
        return None
    near = x + 1e-4 * np.random.default_rng([67, seed]).uniform(-1, 1, a.n)
    orbit = find_orbit(a.system(), near, period=a.T)
    try:
        after, M, _ = period(a, orbit.x0, orbit.t0)
    except NotGenericError:
        return None
    if np.max(np.abs(after - orbit.x0)) > 1e-8:
        return f"{orbit.x0} at {orbit.t0} comes back to {after}"
    values = np.linalg.eigvals(M)
    far = max(min(np.abs(values - q)) for q in orbit.multipliers)
    if len(orbit.multipliers) != a.n or far > 1e-6 * max(1.0, float(np.max(np.abs(values)))):
        return f"multipliers {orbit.multipliers}, known {values}"
    largest = float(np.max(np.abs(values)))
    if abs(largest - 1) > 1e-6 and orbit.verdict != ("stable" if largest < 1 else "unstable"):
        return f"{orbit.verdict}, known {values}"
    return ""
