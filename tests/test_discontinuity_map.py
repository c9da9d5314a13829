"""Leading terms of tangencies against the motions themselves: random fields, integrated piece by piece."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import sympy
from scipy.integrate import solve_ivp

from filippov import Surface, System, UsageError, cos, parameters, sign, states
from filippov import t as time
from filippov.analysis.bifurcations.discontinuity_map import DiscontinuityMap, discontinuity_map

Array = npt.NDArray[np.float64]
Field = Callable[[Array], Array]
X = states("x y z")
SIZES = {
    "crossing-sliding": (1e-3, 1e-4), "switching-sliding": (1e-2, 1e-3), "adding-sliding": (1e-5, 1e-6),
}  # fmt: skip
KINDS = (
    "crossing-sliding", "switching-sliding", "adding-sliding", "grazing-sliding", "jump of the field", "kink",
    "impact",
)  # fmt: skip


def flow(f: Field, x: Array, t: float) -> Array:
    """phi(t) x."""
    if t == 0:
        return x
    run = solve_ivp(lambda _, q: f(q), (0, t), x, "DOP853", rtol=1e-13, atol=1e-15)
    return np.asarray(run.y[:, -1])


def until(f: Field, x: Array, stop: Callable[[Array], float], way: int, t: float) -> tuple[float, Array]:
    """Time, also negative, and state where stop changes its sign in the sense `way`, after the start."""
    def event(now: float, q: Array) -> float:
        # The start itself may have the value 0.
        return stop(q) if abs(now) > 1e-4 * abs(t) else -way * np.sign(t) * 1.0

    event.terminal = True  # type: ignore[attr-defined]
    run = solve_ivp(
        lambda _, q: f(q), (0, t), x, "DOP853", rtol=1e-13, atol=1e-15, events=event, max_step=abs(t) / 30
    )
    assert run.t_events[0].size, "no event"
    return float(run.t_events[0][0]), np.asarray(run.y_events[0][0])


class Local:
    """Two quadratic fields beside H = x + quadratic terms = 0, made to touch at the origin."""

    def __init__(self, kind: str, seed: int) -> None:
        rng = np.random.default_rng([seed, KINDS.index(kind)])
        self.kind = kind
        q = list(X)
        monomials = [sympy.S.One, *q, *(a * b for k, a in enumerate(q) for b in q[k:])]

        zero = dict.fromkeys(q, 0)

        def field() -> list[Any]:
            made = [sum(c * m for c, m in zip(rng.normal(size=10).round(3), monomials, strict=True))
                    for _ in range(3)]  # fmt: skip
            # Along the surface the motion is not slow.
            made[1] += 1 if made[1].subs(zero) > 0 else -1
            return made

        bent = zip(rng.normal(size=6).round(3), monomials[4:], strict=True)
        self.H = q[0] + sum(c * m for c, m in bent) / 4
        g = [self.H.diff(s) for s in q]

        def lie(v: Any, f: list[Any]) -> Any:
            return sum(v.diff(s) * c for s, c in zip(q, f, strict=True))

        def fixed(f: list[Any], goals: list[float]) -> list[Any]:
            """The field with v, L v, L^2 v at the origin as they are wanted."""
            for k, goal in enumerate(goals):
                v = sum(a * b for a, b in zip(g, f, strict=True))
                for _ in range(k):
                    v = lie(v, f)
                size = f[1].subs(zero)
                term = q[1] ** k / sympy.Integer(max(k, 1))
                change = sympy.S(goal - v.subs(zero)) / (size**k if k else 1)
                f = [f[0] + change * term * (sympy.Rational(1, 1) if k < 2 else 1), *f[1:]]
            return f

        f1, f2 = field(), field()
        a = float(rng.uniform(0.5, 1.5))
        if kind == "crossing-sliding":
            f1, f2 = fixed(f1, [-a]), fixed(f2, [0.0, -float(rng.uniform(0.5, 1.5))])
        elif kind == "switching-sliding":
            f1, f2 = fixed(f1, [-a]), fixed(f2, [0.0, float(rng.uniform(0.5, 1.5))])
        elif kind == "adding-sliding":
            f1, f2 = fixed(f1, [-a]), fixed(f2, [0.0, 0.0, float(rng.uniform(0.5, 1.5))])
        elif kind == "grazing-sliding":
            f1, f2 = fixed(f1, [0.0, a]), fixed(f2, [float(rng.uniform(0.5, 1.5))])
        elif kind == "jump of the field":
            # v1 = v2 on all of the surface is more than is needed: f2 = f1 + a jump along the surface.
            f1, jump = fixed(f1, [0.0, a]), field()
            across = sum(c * b for c, b in zip(g, jump, strict=True))
            f2 = [f1[0] + jump[0] - across / g[0], f1[1] + jump[1], f1[2] + jump[2]]
            size = lie(sum(c * b for c, b in zip(g, f2, strict=True)), f2).subs(zero)
            if size < 0.3:
                f2 = fixed(f2, [0.0, 0.5])
        elif kind == "kink":
            f1 = fixed(f1, [0.0, a])
            f2 = [c + self.H * b for c, b in zip(f1, field(), strict=True)]
        else:
            f1 = fixed(f1, [0.0, a])
            f2 = list(f1)
            v1 = sum(c * b for c, b in zip(g, f1, strict=True))
            self.R = [c + v1 * b for c, b in zip(q, field(), strict=True)]
            # v+ = -e v- to leading order: v1_x . (R - x) = -(1 + e) v1.
            slope = [v1.diff(s).subs(zero) for s in q]
            k = int(np.argmax(np.abs(np.array(slope[1:], dtype=float)))) + 1
            push = [b.subs(zero) for b in ((r - c) / v1 for r, c in zip(self.R, q, strict=True))]
            e = float(rng.uniform(0.3, 0.9))
            first = -push[0]
            self.R[0] += v1 * first
            push[0] = sympy.S.Zero
            lack = -(1 + e) - sum(a * b for a, b in zip(slope, push, strict=True))
            self.R[k] += v1 * lack / slope[k]
        self.fields = [f1, f2]
        self.f1, self.f2 = (self._numbers(f) for f in (f1, f2))
        self.h = self._number(self.H)
        vs = [sum(a * b for a, b in zip(g, f, strict=True)) for f in (f1, f2)]
        self.v1, self.v2 = (self._number(v) for v in vs)
        self.sliding = self._numbers([
            b - vs[1] / (vs[0] - vs[1]) * (c - b) for c, b in zip(f1, f2, strict=True)
        ]) if kind.endswith("sliding") else self.f1  # fmt: skip
        self.slide_rate = self._number(lie(vs[1], [
            b - vs[1] / (vs[0] - vs[1]) * (c - b) for c, b in zip(f1, f2, strict=True)
        ])) if kind == "adding-sliding" else self.v1  # fmt: skip

    @staticmethod
    def _numbers(f: list[Any]) -> Field:
        made = sympy.lambdify([X], f)
        return lambda x: np.array(made(x), dtype=float)

    @staticmethod
    def _number(f: Any) -> Callable[[Array], float]:
        made = sympy.lambdify([X], f)
        return lambda x: float(made(x))

    def system(self) -> System:
        if self.kind == "impact":
            reset = dict(zip(X, self.R, strict=True))
            stop = Surface("h", self.H, reset=reset, side="+")
            return System(dict(zip(X, self.fields[0], strict=True)), surfaces=[stop])
        return System.from_modes([self.H], {"+": self.fields[0], "-": self.fields[1]}, list(X))

    def formula(self) -> DiscontinuityMap:
        kind = self.kind if self.kind in KINDS[:3] else "grazing"
        return discontinuity_map(self.system(), kind, np.zeros(3), 0.0, np.zeros(0), (1,), 0, 1)

    def displaced(self, z: float) -> Array:
        """D(x) - x with its size z, from the motions."""
        T = 12 * (z if self.kind in ("crossing-sliding", "switching-sliding") else np.sqrt(z))
        T *= 6 if self.kind == "jump of the field" else 1
        if self.kind == "crossing-sliding":
            x = self._solve([self.h, lambda q: self.v2(q) - z])
            t, end = until(self.sliding, x, self.v2, -1, T)
            return flow(self.f2, end, -t) - x
        if self.kind == "switching-sliding":
            x = self._solve([self.h, lambda q: self.v2(q) + z])
            t, end = until(self.f2, x, self.h, 1, T)
            return flow(self.sliding, end, -t) - x
        if self.kind == "adding-sliding":
            x = self._solve([self.h, lambda q: self.v2(q) + z, self.slide_rate])
            t0, out = until(self.sliding, x, self.v2, -1, -T)
            t1, end = until(self.f2, out, self.h, 1, T)
            return flow(self.sliding, end, -t0 - t1) - x
        x = self._solve([lambda q: self.h(q) + z, self.v1])
        t0, entry = until(self.f1, x, self.h, -1, -T)
        if self.kind == "impact":
            made = sympy.lambdify([X], self.R)
            return flow(self.f1, np.array(made(entry), dtype=float), -t0) - x
        if self.kind == "grazing-sliding":
            t1, end = until(self.sliding, entry, self.v1, 1, T)
        else:
            t1, end = until(self.f2, entry, self.h, 1, T)
        return flow(self.f1, end, -t0 - t1) - x

    @staticmethod
    def _solve(equations: list[Callable[[Array], float]]) -> Array:
        """The state next to the origin that satisfies them (Gauss-Newton)."""
        x = np.zeros(3)
        for _ in range(30):
            left = np.array([e(x) for e in equations])
            by = np.array([[(e(x + d) - e(x - d)) / 2e-6 for d in 1e-6 * np.eye(3)] for e in equations])
            x = x - np.linalg.lstsq(by, left, rcond=None)[0]
        assert np.linalg.norm([e(x) for e in equations]) < 1e-14
        return x


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("kind", KINDS)
def test_12_13_leading_term_has_its_coefficient_and_its_order(kind: str, seed: int) -> None:
    case = Local(kind, seed)
    found = case.formula()
    assert found.kind == kind
    steps = SIZES.get(kind, (1e-5, 1e-7))
    errors = []
    for z in steps:
        exact = case.displaced(z) / z**found.exponent
        errors.append(np.linalg.norm(exact - found.vector) / np.linalg.norm(found.vector))
    # The next term is at least half an order on.
    assert errors[1] < 0.12
    assert errors[1] < max(2 * np.sqrt(steps[1] / steps[0]) * errors[0], 1e-4)


def test_12_13_touchings_without_a_known_term_are_refused_by_name() -> None:
    x, v, _ = X
    at = (np.array([0.0, 0.0]), 0.0, np.array([1.0]))
    p = parameters(k=1.0)

    def refused(system: System, kind: str, words: str, x0: Array = at[0]) -> None:
        with pytest.raises(UsageError, match=words):
            discontinuity_map(system, kind, x0, 0.0, at[2], (1,), 0, 1)

    wide = System({x: 1 + 0 * x, v: -sign(v) - x}, surfaces=[Surface("v", v, radius=2)], parameters=p)
    refused(wide, "crossing-sliding", "wider than the hull")
    # Away on the other side; tangent to higher order; a reset that moves the state at rest, too.
    refused(System({x: v, v: p.k + 0 * x - (1 - sign(x)) * 3}, parameters=p), "grazing", "by a jump")
    refused(System({x: v, v: x - sign(x) + 1}, parameters=p), "grazing", "higher order")
    stop = Surface("stop", x, reset={x: x + 1, v: -v})
    refused(System({x: v, v: p.k + 0 * x}, surfaces=[stop], parameters=p), "grazing", "without speed: a jump")
    surface = Surface("h", lambda t, x, p: x[1])
    plain = System(field=lambda t, x, p, s: [x[1], -s[0]], surfaces=[surface], states="x v")
    with pytest.raises(UsageError, match="written in expressions"):
        discontinuity_map(plain, "grazing", at[0], 0.0, np.zeros(0), (1,), 0, 1)


def test_12_13_time_counts_as_a_state() -> None:
    # x' = f(t) - Sgn x, f = cos t: at an arrival from above v2 = f + 1, L_F2^2 H = f', U = -1.
    system = System({X[0]: cos(time) - sign(X[0])})
    when = np.pi - 0.1
    found = discontinuity_map(system, "crossing-sliding", np.zeros(1), when, np.zeros(0), (1,), 0, 1)
    assert abs(found.bend + np.sin(0.1)) < 1e-12
    # F1 - F2 = -2 and v2 - v1 = 2.
    assert abs(found.vector[0] + 1 / (2 * np.sin(0.1))) < 1e-12
