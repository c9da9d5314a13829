"""Random systems whose orbits graze, with what is known of them by scipy: belts under falling friction,
oscillators with a stop. Each fault of a branch is told in words."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from filippov import Surface, System, cos, exp, parameters, sign, states, t
from filippov.analysis import continuation, find_orbit

Array = npt.NDArray[np.float64]
X, V = states("x v")
TIGHT: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
# How exactly a special point is located, in widths of the bounds, and how well an orbit closes.
LOCATED, CLOSES = 2e-8, 1e-7
GRAZINGS = ("grazing-sliding", "C-bifurcation")


@dataclass
class Belt:
    """x'' = -k x - g(|s|) sgn s - b s, s = v - vb: a block on a belt, g = Fc + (Fs - Fc) exp(-|s/vs|^n)."""

    k: float
    Fs: float
    Fc: float
    vs: float
    b: float
    n: float

    @classmethod
    def draw(cls, seed: int) -> Belt:
        rng = np.random.default_rng(seed)
        Fc = rng.uniform(2, 8)
        return cls(
            rng.uniform(30, 300), Fc * rng.uniform(1.2, 2), Fc, rng.uniform(0.08, 0.6), rng.uniform(0.2, 2),
            float(rng.choice([1.0, 1.0, 1.0, 1.5, 2.0])),
        )  # fmt: skip

    def force(self, s: Any) -> Any:
        """The friction at slip s < 0, backwards positive."""
        return self.Fc + (self.Fs - self.Fc) * np.exp(-np.abs(s / self.vs) ** self.n) - self.b * s

    def field(self, vb: float) -> Callable[[float, Array], list[float]]:
        """In slip below the belt's speed; beyond it the even continuation, which no event is reached in."""
        return lambda time, y: [y[1], -self.k * y[0] + self.force(min(y[1] - vb, 0.0))]

    def return_of(self, s: float, vb: float) -> tuple[float, float]:
        """From a greatest velocity vb + s to the next one: (its slip, above 0 where it sticks, the time)."""
        f = self.field(vb)
        start = [float(self.force(s)) / self.k, vb + s]

        def top(time: float, y: Array) -> float:
            return f(time, y)[1]

        top.direction, top.terminal = -1.0, True  # type: ignore[attr-defined]
        part = 0.5 / np.sqrt(self.k)
        first = solve_ivp(f, (0, part), start, **TIGHT)
        rest = solve_ivp(f, (part, 40 * part), first.y[:, -1], events=top, **TIGHT)
        if not len(rest.t_events[0]):
            return np.nan, np.nan
        return float(rest.y_events[0][0][1]) - vb, float(rest.t_events[0][0])

    def grazing(self, low: float, high: float) -> list[float]:
        """All vb at which the solution that leaves stick comes back to the belt's speed and grazes it."""
        values = np.linspace(low, high, 60)
        tops = np.array([self.return_of(0.0, float(vb))[0] for vb in values])
        out = []
        for k in np.flatnonzero(tops[:-1] * tops[1:] < 0):
            found = brentq(lambda vb: self.return_of(0.0, vb)[0], values[k], values[k + 1], xtol=1e-12)
            out.append(float(found))
        return out

    def system(self) -> System:
        p = parameters(vb=0.2)
        s = V - p.vb
        power = int(self.n) if self.n % 1 == 0 else self.n
        law = self.Fc + (self.Fs - self.Fc) * exp(-((abs(s) / self.vs) ** power))
        return System({X: V, V: -self.k * X - law * sign(s) - self.b * s}, parameters=p)

    def faults(self, branch: Any) -> Iterator[str]:
        """What of a branch over vb is wrong."""
        low, high = float(branch.values.min()), float(branch.values.max())
        folds = self.grazing(max(low - 0.05, 0.01), high + 0.05)
        for q in branch.points:
            top = q.coordinates["max v"] - q.value
            if q.special in GRAZINGS:
                apart = min((abs(q.value - fold) for fold in folds), default=np.inf)
                if apart > LOCATED * (WIDE[1] - WIDE[0]):
                    yield f"{q.special} at {q.value:.10g}, by scipy at {folds}"
            elif q.special and not q.special.startswith(("cycle", "fold")):
                yield f"{q.special} at {q.value:.10g}"
            elif "cycle" in q.special:
                continue
            elif "stick" in q.word:
                back, _ = self.return_of(0.0, q.value)
                if not back > -1e-7:
                    yield f"sticks at {q.value:.10g}, by scipy it passes the belt's speed by {back:.3g}"
            else:
                back, period = self.return_of(top, q.value)
                if not (abs(back - top) < CLOSES * (1 + abs(top)) * (1 + max(map(abs, q.multipliers)))):
                    yield f"slips at {q.value:.10g} with s = {top:.4g}, returns with {back:.4g}"
                elif abs(period - q.period) > 1e-5 * period:
                    yield f"period {q.period:.8g} at {q.value:.8g}, by scipy {period:.8g}"
        yield from retraced(branch)

    def branches(self) -> Iterator[Any]:
        """The branch of stick-slip to larger vb, and from a slip orbit of it both ways."""
        system = self.system()
        start = find_orbit(system, (0, 0), parameters={"vb": 0.2})
        first = continuation(system, start, parameter="vb", bounds=WIDE, direction=1, max_points=120).run()
        yield first
        folds = self.grazing(0.2, WIDE[1])
        if not folds:
            return
        # A slip orbit at 0.9 of the fold, by scipy.
        vb = 0.9 * folds[0]
        slips = np.linspace(-0.98 * vb, -1e-4, 40)
        gaps = np.array([self.return_of(float(s), vb)[0] - s for s in slips])
        turns = np.flatnonzero(gaps[:-1] * gaps[1:] < 0)
        if not len(turns):
            return
        k = int(turns[-1])
        s = float(brentq(lambda s: self.return_of(s, vb)[0] - s, slips[k], slips[k + 1], xtol=1e-13))
        period = self.return_of(s, vb)[1]
        at = float(self.force(s)) / self.k, vb + s
        orbit = find_orbit(system, at, parameters={"vb": vb}, period=period)
        options: dict[str, Any] = {"parameter": "vb", "bounds": WIDE, "max_points": 120}
        for way in (1, -1):
            yield continuation(system, orbit, direction=way, **options).run()


WIDE = (0.05, 4.0)


@dataclass
class Stop:
    """x'' + 2 z x' + x = a cos wt with a stop at x = 1 of restitution e."""

    z: float
    w: float
    e: float

    @classmethod
    def draw(cls, seed: int) -> Stop:
        rng = np.random.default_rng(seed)
        return cls(rng.uniform(0.02, 0.3), rng.uniform(0.4, 3.2), rng.uniform(0.2, 0.95))

    @property
    def grazing(self) -> float:
        """The amplitude at which the orbit without impacts grazes, in closed form."""
        return float(abs(1 - self.w**2 + 2j * self.z * self.w))

    def system(self, a: float) -> System:
        p = parameters(a=a)
        stop = Surface("stop", X - 1, reset={V: -self.e * V}, side="-")
        force = p.a * cos(self.w * t)
        return System({X: V, V: -X - 2 * self.z * V + force}, surfaces=[stop], parameters=p)

    def period_from(
        self, x: Array, begin: float, duration: float, a: float
    ) -> tuple[Array, int, float, float]:
        """The state after a period, number of impacts, least speed of them, least distance."""

        def f(time: float, y: Array) -> list[float]:
            return [y[1], -y[0] - 2 * self.z * y[1] + a * np.cos(self.w * time)]

        def turn(time: float, y: Array) -> float:
            return float(y[1])

        turn.direction, turn.terminal = -1.0, True  # type: ignore[attr-defined]
        time, state, speed, pass_by, count = begin, np.array(x), np.inf, np.inf, 0
        end = begin + duration
        while time < end and count < 200:
            run = solve_ivp(f, (time, end), state, events=turn, dense_output=True, max_step=0.1, **TIGHT)
            top = run.y[0, -1]
            if not top > 1.0:
                if run.status == 1:
                    pass_by = min(pass_by, 1.0 - top)
                time, state = float(run.t[-1]), run.y[:, -1]
                # A turn is left on its far side.
                state = state - np.array([0.0, 1e-15 * (run.status == 1)])
                continue
            # It rises from below the stop to the turn: one impact in between, however slow.
            beneath = max(float(q) for q, y in zip(run.t, run.y[0], strict=True) if y < 1.0)
            at = float(brentq(lambda q, run=run: run.sol(q)[0] - 1.0, beneath, run.t[-1], xtol=1e-15))
            v = float(run.sol(at)[1])
            time, state = at, np.array([1.0, -self.e * v])
            count, speed = count + 1, min(speed, v)
        return state, count, speed, pass_by

    def faults(self, branch: Any) -> Iterator[str]:
        """What of a branch over a is wrong."""
        for q in branch.points:
            begin, grown = q.phase * q.period, 1 + max(map(abs, q.multipliers))
            start = np.array(q.u)
            end, count, speed, pass_by = self.period_from(start, begin, q.period, q.value)
            off = float(np.max(np.abs(end - start)))
            expected = int(q.word.split(" with ")[1].split()[0]) if " with " in q.word else 0
            if q.special in GRAZINGS:
                # A speed v stands for a distance v^2/2 per unit of acceleration.
                if not min(pass_by, speed**2) < 1e-6:
                    yield f"{q.special} at {q.value:.10g} passes at {pass_by:.3g}, least speed {speed:.3g}"
                alone = expected == 0 or any(change in q.note for change in ("0 -> 1", "1 -> 0"))
                if alone and abs(q.value - self.grazing) > LOCATED * (self.wide[1] - self.wide[0]):
                    yield f"{q.special} at {q.value:.10g}, in closed form {self.grazing:.10g}"
                if "higher order" in q.predicts:
                    yield q.predicts
                continue
            if not off < CLOSES * grown and min(pass_by, speed**2) > 1e-8:
                yield f"no orbit at {q.value:.10g}: off by {off:.3g}, {q.word}"
            elif count != expected and min(pass_by, speed**2) > 1e-8:
                yield f"{expected} resets at {q.value:.10g}, by scipy {count}"
        yield from retraced(branch)

    @property
    def wide(self) -> tuple[float, float]:
        return 0.5 * self.grazing, 1.5 * self.grazing

    def branches(self) -> Iterator[Any]:
        """From the orbit without impacts over its grazing, and from one with impacts both ways."""
        a = 0.8 * self.grazing
        system = self.system(a)
        low = self.wide
        rest = find_orbit(system, (0, 0), transient=100)
        options: dict[str, Any] = {"parameter": "a", "bounds": low, "max_points": 120}
        yield continuation(system, rest, direction=1, **options).run()
        try:
            hitting = find_orbit(system, (0.5, 0), parameters={"a": 1.3 * self.grazing}, transient=300)
        except Exception:  # noqa: BLE001 - no such orbit of one period: nothing to follow
            return
        for way in (1, -1):
            yield continuation(system, hitting, direction=way, **options).run()


def retraced(branch: Any) -> Iterator[str]:
    """Whether a branch, closed ones apart, comes back to orbits that it had: three in a row."""
    if "closed" in branch.message:
        return
    points, held = branch.points, 0
    names = list(points[0].coordinates)
    rows = np.array([[q.coordinates[name] for name in names] for q in points])
    unit = np.ptp(rows, axis=0) + 1e-12
    for k, q in enumerate(points):
        found = False
        for j in range(k - 4):
            a, b = points[j], points[j + 1]
            inside = (a.value - q.value) * (b.value - q.value) <= 0 and a.value != b.value
            if not inside or {q.word} != {a.word, b.word}:
                continue
            share = (q.value - a.value) / (b.value - a.value)
            guess = rows[j] + share * (rows[j + 1] - rows[j])
            bent = 0.02 * np.abs(rows[j + 1] - rows[j]) / unit + 1e-7
            found = found or bool(np.all(np.abs(rows[k] - guess) / unit < bent))
        held = held + 1 if found else 0
        if held >= 3:
            yield f"retraces itself at {q.value:.8g}"
            return
