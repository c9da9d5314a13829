"""Random small systems x' = A x + g + B phi(C x), with clocks and floors, and their verdicts against motions.

The motions are followed by a midpoint rule whose signs are those at the start of a step. It knows nothing of
modes, sliding, sets or certificates, and chatters within a step of a surface.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np
import numpy.typing as npt
import sympy

from filippov import Max, Min, Piecewise, Surface, System, TimeEvent, sign, states
from filippov.analysis.local_stability.stability import StabilityReport, stability_report
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet

Array = npt.NDArray[np.float64]
Equilibrium = EquilibriumPoint | EquilibriumSet
NAMES = states("x y z w")
RELAY, SATURATION, DEAD, CUBE = range(4)
AS, ST, UN = "asymptotically stable", "stable", "unstable"
STARTS, KEPT, LATE, FAR = 50, 400, 40, 1e6
# Radius of the starts, length and step of what is tried one after the other, until the motions say something.
TRIES = ((0.02, 40.0, 2e-4), (0.02, 240.0, 4e-4), (0.3, 240.0, 4e-4))
SMALL_BASIN = (0.002, 20.0, 2e-5)


@dataclass(frozen=True)
class Draw:
    """phi: a code for each column of B; clock: (period, matrix) of x+ = M x; floor: M of jumps at x = 0."""

    A: Array
    B: Array
    C: Array
    phi: tuple[int, ...]
    g: Array
    clock: tuple[float, Array] | None = None
    floor: Array | None = None

    def system(self) -> System:
        """As expressions."""
        x = NAMES[: len(self.A)]

        def exact(q: float) -> sympy.Expr:
            return sympy.Rational(repr(round(float(q), 6)))

        def row(c: Array) -> sympy.Expr:
            return sum((exact(q) * e for q, e in zip(c, x, strict=True) if q), sympy.S.Zero)

        def jump(m: Array) -> dict:
            return {s: row(r) for s, r, e in zip(x, m, np.eye(len(x)), strict=True) if np.any(r != e)}

        kinds: dict[int, Callable[[sympy.Expr], sympy.Expr]] = {
            RELAY: sign, SATURATION: lambda y: Max(-1, Min(1, y)), CUBE: lambda y: y**3,
            DEAD: lambda y: Piecewise((y - 1, y > 1), (y + 1, y < -1), (0, True)),
        }  # fmt: skip
        feeds = [kinds[code](row(c)) for code, c in zip(self.phi, self.C, strict=True)]
        field = {
            s: row(self.A[i]) + exact(self.g[i])
            + sum((exact(b) * f for b, f in zip(self.B[i], feeds, strict=True) if b), sympy.S.Zero)
            for i, s in enumerate(x)
        }  # fmt: skip
        surfaces = [] if self.floor is None else [Surface("floor", x[0], reset=jump(self.floor))]
        clocks = []
        if self.clock is not None and jump(self.clock[1]):
            period, after = self.clock
            clocks = [TimeEvent("clock", period=period, start=period, reset=jump(after))]
        return System(field, surfaces=surfaces, time_events=clocks)

    def follow(self, starts: Array, length: float, dt: float) -> Array:
        """States (KEPT + 1, k, n) at equal times, FAR where a motion has run off."""
        n = len(self.A)
        period, after = self.clock or (np.inf, np.eye(n))
        ticks = round(period / dt) if np.isfinite(period) else 0
        floor = np.zeros((0, 0)) if self.floor is None else self.floor
        phi, every = np.array(self.phi, dtype=np.int64), max(1, round(length / dt / KEPT))
        return _follow(starts, self.A, self.g, self.B, self.C, phi, ticks, after, floor, dt, every)


@numba.njit
def _times(M, x, out):  # type: ignore[no-untyped-def]
    for i in range(M.shape[0]):
        out[i] = 0.0
        for k in range(M.shape[1]):
            out[i] += M[i, k] * x[k]


@numba.njit
def _rate(x, fixed, A, g, B, C, phi, out):  # type: ignore[no-untyped-def]
    _times(A, x, out)
    for j in range(phi.size):
        q, f = 0.0, fixed[j]
        for k in range(x.size):
            q += C[j, k] * x[k]
        if phi[j] == SATURATION:
            f = max(-1.0, min(1.0, q))
        elif phi[j] == DEAD:
            f = q - max(-1.0, min(1.0, q))
        elif phi[j] == CUBE:
            f = q**3
        for i in range(x.size):
            out[i] += B[i, j] * f
    for i in range(x.size):
        out[i] += g[i]


@numba.njit
def _follow(starts, A, g, B, C, phi, ticks, after, floor, dt, every):  # type: ignore[no-untyped-def]
    out = np.full((KEPT + 1, *starts.shape), FAR)
    n = starts.shape[1]
    x, before, other, rate, fixed = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(phi.size)
    for k in range(len(starts)):
        x[:] = starts[k]
        out[0, k] = x
        for step in range(1, every * KEPT + 1):
            before[:] = x
            _times(C, x, fixed)
            for j in range(phi.size):
                fixed[j] = np.sign(fixed[j])
            _rate(x, fixed, A, g, B, C, phi, rate)
            for i in range(n):
                other[i] = x[i] + 0.5 * dt * rate[i]
            _rate(other, fixed, A, g, B, C, phi, rate)
            for i in range(n):
                x[i] += dt * rate[i]
            if floor.size > 0 and x[0] <= 0.0:
                # Back to the contact on a straight line; what rests on the floor goes on in it.
                share = before[0] / (before[0] - x[0]) if before[0] > 0.0 else 1.0
                for i in range(n):
                    other[i] = before[i] + share * (x[i] - before[i])
                other[0] = 0.0
                _times(floor, other, x)
            if ticks > 0 and step % ticks == 0:
                other[:] = x
                _times(after, other, x)
            size = 0.0
            for i in range(n):
                size = max(size, abs(x[i]))
            if not size < 1e3:
                break
            if step % every == 0:
                out[step // every, k] = x
    return out


# -- kinds -------------------------------------------------------------------------------------------------


def tenths(rng: np.random.Generator, low: float, high: float, *shape: int, share: float = 1.0) -> Array:
    """Uniform in tenths, each other than 0 with the probability `share`."""
    return np.round(rng.uniform(low, high, shape), 1) * (rng.random(shape) < share)


def relays(rng: np.random.Generator) -> Draw:
    """Two relays with cubic terms."""
    n, k = int(rng.integers(2, 4)), int(rng.integers(1, 3))
    A = tenths(rng, -2, 1.5, n, n, share=0.5)
    if n == 3 and rng.random() < 0.5:
        A[2] = [float(tenths(rng, -1, 1)), 0, 0]
    C = np.vstack([np.eye(2, n), np.eye(n)[rng.integers(n, size=k)]])
    C[1, 0] = tenths(rng, -1, 1, share=0.3)
    B = np.hstack([tenths(rng, -2, 2, n, 2), tenths(rng, -2, 2, n, k, share=0.5)])
    B[2:, :2] *= 0.5
    if rng.random() < 0.6:
        B[[0, 1], [0, 1]] = -np.abs(B[[0, 1], [0, 1]]) - 0.2
    return Draw(A, B, C, (RELAY, RELAY) + (CUBE,) * k, np.zeros(n))


def rests(rng: np.random.Generator) -> Draw:
    """A body above a floor, with others that its impacts push."""
    n = int(rng.integers(2, 5))
    A, M, g = np.zeros((n, n)), np.eye(n), np.zeros(n)
    A[:2, :2] = [[0, 1], tenths(rng, -2, 0.5, 2)]
    g[1] = -tenths(rng, 0.2, 2, share=0.7)
    M[1, 1] = -tenths(rng, 0, 1.1)
    A[2:, 2:], A[1, 2:] = tenths(rng, -1.5, 0.7, n - 2, n - 2), tenths(rng, -1, 1, n - 2, share=0.5)
    A[2:, :2] = tenths(rng, -1, 1, n - 2, 2, share=0.4)
    M[2:, 1] = tenths(rng, -0.5, 0.5, n - 2, share=0.5)
    m = int(n > 2 and rng.random() < 0.5)
    C, B = np.eye(n)[2 : 2 + m], -np.abs(tenths(rng, 0.2, 1.5)) * np.eye(n)[:, 2 : 2 + m]
    return Draw(A, B, C, (int(rng.choice([RELAY, SATURATION, CUBE])),) * m, g, floor=M)


def clocked(rng: np.random.Generator) -> Draw:
    """A relay, saturation or dead zone whose state a clock changes."""
    n = int(rng.integers(1, 4))
    C = np.eye(1, n)
    if n > 1:
        C[0, 1] = tenths(rng, -1, 1, share=0.4)
    B, M = tenths(rng, -2, 1, n, 1, share=0.6), np.diag(tenths(rng, -1.5, 1.8, n))
    if n > 1 and rng.random() < 0.5:
        M[tuple(rng.integers(n, size=2))] = tenths(rng, -1, 1)
    phi = (int(rng.choice([RELAY, RELAY, RELAY, SATURATION, DEAD])),)
    clock = (float(tenths(rng, 0.3, 2)), M)
    return Draw(tenths(rng, -2, 1.5, n, n, share=0.7), B, C, phi, np.zeros(n), clock=clock)


def dead(rng: np.random.Generator) -> Draw:
    """A mass in a dead zone, with friction and an integrator or filter."""
    n, k = int(rng.integers(2, 4)), int(rng.integers(1, 4))
    A = np.zeros((n, n))
    A[:2, :2] = [[0, 1], [tenths(rng, -1, 0.5, share=0.3), tenths(rng, -1.5, 0.5)]]
    if n == 3:
        A[1, 2], A[2, ::2] = tenths(rng, -1, 1), tenths(rng, -1, 0.5, 2, share=0.6)
    C = np.vstack([np.eye(1, n), np.eye(n)[[1] * (k - 1)]])
    C[0, 1] = tenths(rng, -0.5, 1, share=0.4)
    B = np.zeros((n, k))
    B[1] = -np.concatenate([tenths(rng, -1, 3, 1), tenths(rng, 0.1, 1, k - 1)])
    return Draw(A, B, C, (DEAD, RELAY, int(rng.choice([DEAD, CUBE])))[:k], np.zeros(n))


def saturated(rng: np.random.Generator) -> Draw:
    """Saturation beside another feedback."""
    n, k = int(rng.integers(1, 4)), int(rng.integers(1, 3))
    C = tenths(rng, -2, 2, k, n, share=0.7)
    C[~C.any(axis=1), 0] = 1.0
    phi = (SATURATION, int(rng.choice([SATURATION, CUBE, RELAY])))[:k]
    A, B = tenths(rng, -1.5, 1.5, n, n, share=0.7), tenths(rng, -3, 1, n, k, share=0.7)
    return Draw(A, B, C, phi, np.zeros(n))


KINDS = (relays, rests, clocked, dead, saturated)


def draw(seed: int) -> Draw:
    return KINDS[seed % len(KINDS)](np.random.default_rng([12, 6, seed]))


# -- verdicts ----------------------------------------------------------------------------------------------


def points(e: Equilibrium, report: StabilityReport, said: str, rng: np.random.Generator) -> list[Array]:
    """The equilibrium; the middle and the ends of a set, within reach."""
    if isinstance(e, EquilibriumPoint):
        return [np.array(e.value)]
    low, high = np.clip(np.array(e.bounds).T, -2, 2)
    if e.dimension > 1:
        edge = 1e-3 if "0" in e.mode else 0.2
        shares = rng.uniform(edge, 1 - edge, (3, e.dimension))
        return [_state(e, low + share * (high - low)) for share in shares]
    others = [item.equilibrium for item in report.items if item.equilibrium != e]
    ends = [end.value for other in others if isinstance(other, EquilibriumSet) for end in other.ends]
    inner = [0.5]
    for side, c in enumerate((low, high)):
        # What holds of a part of a set off all surfaces need not hold where it borders on another part.
        shared = said != UN and any(np.allclose(end, _state(e, c)) for end in ends) and "0" not in e.mode
        edge = 0.2 if shared else 1e-3
        inner.append(1 - edge if side else edge)
    return [_state(e, low + share * (high - low)) for share in inner]


def _state(e: EquilibriumSet, c: Array) -> Array:
    return np.array(sympy.lambdify(e.free, e.x)(*np.atleast_1d(c)), dtype=float)


def distance(of: Equilibrium, report: StabilityReport, x: Array) -> Array:
    """Of states (..., n) from an equilibrium, or from all sets if it is one. Raises NotImplementedError."""
    best = np.full(x.shape[:-1], np.inf)
    sets = [item.equilibrium for item in report.items if isinstance(item.equilibrium, EquilibriumSet)]
    for e in sets if isinstance(of, EquilibriumSet) else [of]:
        if isinstance(e, EquilibriumPoint):
            best = np.minimum(best, np.max(np.abs(x - np.array(e.value)), axis=-1))
            continue
        low, high = np.clip(np.array(e.bounds).T, -30, 30)
        bent = any(sympy.diff(q, a, b) != 0 for q in e.x for a in e.free for b in e.free)
        if e.dimension > 1 and (bent or np.isfinite(np.array(e.bounds)).any()):
            raise NotImplementedError("a set of several dimensions with borders")
        parts = 60 if bent else 1
        for k in range(parts):
            base, ends = low + (high - low) * k / parts, (high - low) / parts
            corner = _state(e, base)
            sides = np.array([_state(e, base + np.where(i, ends, 0)) - corner for i in np.eye(len(low))])
            c = np.clip((x - corner) @ np.linalg.pinv(sides), 0, 1)
            best = np.minimum(best, np.max(np.abs(x - corner - c @ sides), axis=-1))
    return best


def examine(seed: int) -> tuple[list[str], int]:
    """Verdicts that motions from 50 states contradict, and the number of those that they confirm."""
    a, rng, sure = draw(seed), np.random.default_rng(seed), 0
    report = stability_report(a.system(), budget=6.0)
    faults: list[str] = []
    for item in report.items:
        if item.answer == "undecided" or (a.floor is not None and item.equilibrium.mode[0] == "-"):
            continue
        try:
            truth, told = _motions(a, report, item.equilibrium, item.answer, rng)
        except NotImplementedError:
            continue
        # The parts of one segment have the verdict of the whole, which its outer ends decide.
        part = any("part of one segment" in s.text for s in item.statements)
        never = {UN: () if part else (AS, "neutral"), ST: (UN,), AS: (UN, "neutral", "grows")}[item.answer]
        sure += truth not in never
        if truth in never:
            e = item.equilibrium
            faults.append(f"{e.mode} {e.x}: {item.answer}, but {truth} ({told})")
    return faults, sure


def _motions(
    a: Draw, report: StabilityReport, e: Equilibrium, said: str, rng: np.random.Generator
) -> tuple[str, str]:
    """(what the motions do, the same in numbers)."""
    near, told = points(e, report, said, rng), ""

    def tried(r: float, length: float, dt: float) -> tuple[float, float, float]:
        x0 = np.array([near[k % len(near)] for k in range(STARTS)])
        x0 += r * rng.uniform(-1, 1, x0.shape)
        if a.floor is not None:
            # A fall from the height r reaches a speed of the order of r**(1/2): these reach that of r.
            x0[:, 0] = r * np.abs(x0[:, 0])
        far = distance(e, report, a.follow(x0, length, dt)) / r
        middle, end = far[KEPT // 2 - LATE : KEPT // 2].max(axis=0), far[-LATE:].max(axis=0)
        return float(far.max()), float(end.max()), float(end.mean() / max(middle.mean(), 1e-300))

    for r, length, dt in TRIES:
        peak, end, fell = tried(r, length, dt)
        told = f"r = {r:g}, t = {length:g}: to {peak:.3g} radii, in the end {end:.3g}, falls by {fell:.3g}"
        if r < 0.1 and peak > 10:
            if said != UN and tried(*SMALL_BASIN)[0] <= 10:
                return "a small basin", told
            return UN, told
        if end < 0.2:  # what chatters within a step of two surfaces ends at 0.15
            return AS, told
    if said == UN and tried(*SMALL_BASIN)[0] > 10:  # it ends on a cycle about it
        return UN, told
    return ("falls" if fell < 0.95 else "grows" if peak > 10 or fell > 1.05 else "neutral"), told
