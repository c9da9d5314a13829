"""Slides that come to rest in finite time where the slope of their own surface is 0 or infinite.

Time-optimal control of the double integrator and the oscillator (Pontryagin et al. 1962; Bushaw 1958),
terminal sliding (Venkataraman & Gulati 1993; Feng, Yu & Man 2002): the way along the curve is known.
"""

import math

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from filippov import Status, System, parameters, sign, solve, solve_many, sqrt, states, t

X, V = states("x v")
P = parameters(a=1.0, u=1.0, k=1.0, c=0.0, d=0.0)
Q = sympy.Rational
CURVES = {
    "root": (V + sqrt(2 * P.a * abs(X)) * sign(X), 0),
    "parabola": (X + V * abs(V) / (2 * P.a), 0),
    "5/3": (X + P.k * abs(V) ** Q(5, 3) * sign(V), 5 / 3),
    "9/7": (X + P.k * abs(V) ** Q(9, 7) * sign(V), 9 / 7),
    "2/3": (V + P.k * abs(X) ** Q(2, 3) * sign(X), -3 / 2),
}
SYSTEMS = {
    name: System({X: V, V: -P.u * sign(h) - P.c * V + P.d}, parameters=P) for name, (h, _) in CURVES.items()
}


Member = tuple[dict[str, float], tuple[float, float], float, float, float]


def along(name: str, q: dict[str, float], speed: float) -> tuple[float, float, float, float]:
    """Time along the curve from this |v|, the power of the time left that it is, |v'| there and at rest."""
    alpha = CURVES[name][1]
    if alpha == 0:
        return speed / q["a"], 1.0, q["a"], q["a"]
    # On x = -k |v|^alpha sign v: v' = -|v|^(2 - alpha) sign v/(k alpha).
    k, alpha = (q["k"], alpha) if alpha > 0 else (q["k"] ** alpha, -alpha)
    lasts = k * alpha * speed ** (alpha - 1) / (alpha - 1)
    return lasts, 1 / (alpha - 1), speed ** (2 - alpha) / (k * alpha), 0.0


def member(name: str, rng: np.random.Generator) -> Member | None:
    """(values, start, time when the curve is met, v there, time of rest) where it is slid along."""
    q = {"a": 1.0, "u": float(rng.uniform(0.3, 5)), "k": float(rng.uniform(0.3, 3)), "c": 0.0, "d": 0.0}
    kind = rng.integers(4)
    q["a"] = q["u"] * (1.0 if kind == 0 else float(rng.uniform(0.1, 0.99)))
    q["c"] = float(rng.uniform(0, 0.5)) if kind == 2 else 0.0
    q["d"] = float(rng.uniform(-0.9, 0.9)) * (q["u"] - q["a"]) if kind == 3 else 0.0
    x0 = float(rng.uniform(-3, 3)), float(rng.uniform(-3, 3)) if rng.integers(2) else 0.0
    numbers = sympy.lambdify((X, V), CURVES[name][0].subs({P[i]: q[i] for i in "ak"}), "numpy")
    side = np.sign(numbers(*x0))

    def meets(time: float, y: np.ndarray) -> float:
        return float(numbers(*y))

    def field(time: float, y: np.ndarray) -> list[float]:
        return [y[1], -q["u"] * side - q["c"] * y[1] + q["d"]]

    meets.terminal = True  # type: ignore[attr-defined]
    arc = solve_ivp(field, (0, 60), x0, "DOP853", events=meets, rtol=1e-13, atol=1e-14, max_step=0.1)
    v, met = arc.y_events[0][0][1], arc.t_events[0][0]
    lasts, _, first, last = along(name, q, abs(v))
    needed = [way * np.sign(v) + q["d"] - q["c"] * speed for way, speed in ((first, v), (last, 0.0))]
    return (q, x0, met, v, met + lasts) if max(map(abs, needed)) <= q["u"] * (1 + 1e-12) else None


def drawn(name: str, count: int) -> list[Member]:
    rng, out = np.random.default_rng(len(name)), []
    while len(out) < count:
        found = member(name, rng)
        out += [found] if found is not None and found[-1] < 30 else []
    return out


@pytest.mark.parametrize("name", CURVES)
def test_slides_rest_where_their_curve_ends(name: str) -> None:
    """Random control, slope, friction, load and start: the time along the curve, and rest."""
    rows = drawn(name, 4)
    for q, x0, met, v, rest in rows:
        run = solve(SYSTEMS[name], x0, (0, rest + 2), parameters=q)
        assert run.success, (q, x0, run.message)
        assert run.x_end == pytest.approx([0, 0], abs=1e-11)
        times = np.linspace(met, rest, 12)[1:-1]
        exact = v * ((rest - times) / (rest - met)) ** along(name, q, abs(v))[1]
        assert run.sol(times)[1] == pytest.approx(exact, abs=1e-8)
        assert run.sol(np.linspace(rest, rest + 2, 9)[1:]) == pytest.approx(0, abs=1e-9)
        # Where no step leads on, v is 0 to 1e-7: the time left is off by that of a start from there.
        close = along(name, q, 1e-7)[0]
        assert abs(run.events[-1].t - rest) <= 1e-8 + close or close > 1e-4
    columns = {i: [q[i] for q, *_ in rows] for i in rows[0][0]}
    ends = solve_many(SYSTEMS[name], [x0 for _, x0, *_ in rows], (0, 32), parameters=columns, lanes=8)
    assert ends.success.all(), ends.message
    assert np.abs(ends.x).max() <= 1e-11


def test_uncompiled_loops_rest_there_too() -> None:
    for name in ("root", "5/3"):
        q, x0, _, _, rest = drawn(name, 1)[0]
        run = solve(SYSTEMS[name], x0, (0, rest + 2), parameters=q, backend="python")
        assert run.success
        assert run.x_end == pytest.approx([0, 0], abs=1e-11)


@pytest.mark.parametrize("name", ["root", "parabola", "2/3"])
@pytest.mark.parametrize("load", [1, -1])
def test_a_load_that_outgrows_the_control_ends_the_rest(name: str, load: int) -> None:
    """x'' = -s + load t/10 holds at 0 until t = 10 with the multiplier t/10; then x = load (t - 10)^3/60."""
    system = System({X: V, V: -sign(CURVES[name][0]) + load * t / 10}, parameters=P)
    run = solve(system, (1, 0), (0, 12), parameters={"a": 0.5})
    assert run.success
    assert run.x_end == pytest.approx([load * 8 / 60, load * 0.2], abs=1e-9)
    assert run.sol(9)[0] == pytest.approx(0, abs=1e-11)
    held = next(i for i, sign in enumerate(run.mode_at(9)) if sign == 0)
    assert run.multiplier(system.surface_names[held], 9.0) == pytest.approx(load * 0.9)


@pytest.mark.parametrize("start", [(1, 0), (0.5, 0.5), (1.5, 0.2), (-1, 0.3), (-0.4, -0.6)])
def test_least_time_of_the_oscillator_ends_in_the_origin(start: tuple[float, float]) -> None:
    """Bushaw 1958: x'' = -x + u by arcs around -u, the last one the semicircle through the origin."""
    curve = V + sign(X) * sqrt(abs(X) * (2 - abs(X)))
    run = solve(System({X: V, V: -X - sign(curve)}), start, (0, 8))
    side = 1 if float(curve.subs({X: start[0], V: start[1]})) > 0 else -1
    z = complex(start[0] + side, -start[1])  # turns by exp(i t) about -side

    def off(time: float) -> float:
        return float(abs(z * np.exp(1j * time) - 2 * side) - 1)

    grid = np.linspace(1e-9, 6, 601)
    k = next(k for k in range(600) if off(grid[k]) * off(grid[k + 1]) < 0)
    met = brentq(off, grid[k], grid[k + 1], xtol=1e-15)
    w = (z * np.exp(1j * met) - 2 * side) / -side
    rest = met + (-np.angle(w)) % (2 * math.pi)
    assert run.success
    assert run.x_end == pytest.approx([0, 0], abs=1e-11)
    assert run.events[0].t == pytest.approx(met, abs=1e-9)
    assert run.events[-1].t == pytest.approx(rest, abs=1e-6)


@pytest.mark.parametrize(("u", "a"), [(2, 1), (2, 0.5), (1, 0.5)])
def test_a_slide_that_others_leave_does_not_rest(u: float, a: float) -> None:
    """x'' = -u sign(x - v^2/(2a)): 0 is a velocity at the origin, and x = u t^2/2 follows as well."""
    run = solve(System({X: V, V: -u * sign(X - V**2 / (2 * a))}), (1, -1), (0, 8))
    assert run.status is Status.NON_UNIQUE
    assert run.x_end == pytest.approx([0, 0], abs=1e-9)


@pytest.mark.parametrize("gains", [(1, 2), (1, 1), (1, 0.5), (3, 1)])
def test_a_continuous_feedback_that_ends_in_finite_time_rests_there(gains: tuple[float, float]) -> None:
    """Bhat & Bernstein 1998: x'' = -k1 |x|^(1/2) sgn x - k2 |v|^(2/3) sgn v is at 0 from a finite time on."""
    q = parameters(k1=1.0, k2=1.0)
    feedback = q.k1 * sqrt(abs(X)) * sign(X) + q.k2 * abs(V) ** Q(2, 3) * sign(V)
    system, values = System({X: V, V: -feedback}, parameters=q), dict(zip(("k1", "k2"), gains, strict=True))
    starts = np.random.default_rng(0).uniform(-2, 2, (200, 2))
    ends = solve_many(system, starts, (0, 25), parameters=values, zeno="continue", max_events=2000, lanes=8)
    assert ends.success.all()
    assert np.abs(ends.x).max() <= 1e-11

    def field(time: float, y: np.ndarray) -> list[float]:
        force = gains[0] * abs(y[0]) ** 0.5 * np.sign(y[0]) + gains[1] * abs(y[1]) ** (2 / 3) * np.sign(y[1])
        return [y[1], -force]

    for x0 in starts[:4]:
        run = solve(system, x0, (0, 25), parameters=values, zeno="continue", max_events=2000)
        assert run.success
        assert run.x_end == pytest.approx([0, 0], abs=1e-11)
        other = solve_ivp(field, (0, 2), x0, "DOP853", rtol=1e-12, atol=1e-13, max_step=1e-3)
        assert run.sol(2.0) == pytest.approx(other.y[:, -1], abs=1e-7)
