"""Random members of published problems, each against a closed form or matrix exponentials."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.optimize import brentq, minimize_scalar

from filippov import Heaviside, Status, Surface, System, cos, parameters, sign, sin, solve, sqrt, states, t
from filippov.analysis import EventMap, Section, continuation, find_orbit, stability_report

X, Y, Z, V = states("x y z v")
Array = np.ndarray[Any, Any]
SEEDS = pytest.mark.parametrize("seed", range(3))


@SEEDS
def test_relay_feedback_of_astrom(seed: int) -> None:
    """Astrom 1995, theorem 1: C (I + exp(A h))^-1 int exp(A s) B = w, half map (f C/(C f) - I) exp(A h)."""
    r = np.random.default_rng([1, seed])
    _, c2, c1, c0 = np.poly(-r.uniform(0.3, 3, 3))
    a, gain, w = np.array([[-c2, 1, 0], [-c1, 0, 1], [-c0, 0, 0]]), r.uniform(0.5, 3), 0.1 * seed
    b, one = np.array([0, -0.3 * gain, gain]), np.eye(3)

    def start(h: float) -> Array:
        return np.asarray(np.linalg.solve(one + expm(a * h), np.linalg.solve(a, expm(a * h) - one) @ b))

    grid = np.linspace(0.05, 25, 800)
    ends = next(p for p in pairwise(grid) if start(p[0])[0] < w <= start(p[1])[0])
    h = brentq(lambda h: start(h)[0] - w, *ends, xtol=1e-14)
    x, out = start(h), np.outer(-a @ start(h) - b, [1, 0, 0])
    values = np.linalg.eigvals((out / out[0, 0] - one) @ expm(a * h)) ** 2
    q = (X, Y, Z)
    rows = {q[i]: sum(a[i, j] * q[j] for j in range(3)) - b[i] * sign(X) for i in range(3)}
    orbit = find_orbit(System(rows, surfaces=[Surface("out", X, width=w)]), tuple(1.02 * x + 1e-3))
    assert orbit.period == pytest.approx(2 * h, abs=1e-9)
    wanted = values[np.argsort(-np.abs(values))][:2]
    assert np.sort_complex(orbit.multipliers) == pytest.approx(
        np.sort_complex(wanted.astype(complex)), abs=1e-8
    )


@SEEDS
def test_a_slide_into_the_two_fold_of_teixeira(seed: int) -> None:
    """Colombo & Jeffrey 2011: (-y, 1, V+) over (z, V-, 1), V+ V- > 1; linear in int ds/(y + z)."""
    r = np.random.default_rng([2, seed])
    up, down = -r.uniform(1.1, 2.5, 2)
    a = np.array([[down, 1], [1, up]])
    slow = np.linalg.eigh(a)[1][:, 1]
    x = slow / slow.sum() + r.uniform(0, 0.05) * np.array([1, -1])
    fold = System.from_modes([X], {"+": [-Y, 1, up], "-": [Z, down, 1]}, [X, Y, Z])
    run = solve(fold, (0, *x), (0, 20))
    assert run.status is Status.NON_UNIQUE
    assert run.t_end == pytest.approx(-np.ones(2) @ np.linalg.solve(a, x), abs=1e-8)
    later = expm(0.5 * a) @ x
    assert run.sol(np.ones(2) @ np.linalg.solve(a, later - x))[1:] == pytest.approx(later, abs=1e-8)


@SEEDS
def test_super_twisting_ends_at_its_time(seed: int) -> None:
    """Levant 1993: linear in w = sqrt |x| and ds = dt/w, a half turn takes y to -q y."""
    r = np.random.default_rng([3, seed])
    k2, y = r.uniform(0.5, 3), r.uniform(0.5, 2)
    turn = r.uniform(0.4, 1) * math.sqrt(k2 / 2)
    k1 = 4 * math.sqrt(k2 / 2 - turn**2)
    q = math.exp(-k1 / 4 * math.pi / turn)
    run = solve(
        System({X: -k1 * sqrt(abs(X)) * sign(X) + Y, Y: -k2 * sign(X)}), (0, y), (0, 30), zeno="continue"
    )
    assert run.events[0].t == pytest.approx((1 + q) * y / k2, abs=1e-7)
    assert run.success
    assert run.x_end == pytest.approx([0, 0], abs=1e-9)
    assert run.zeno is None or run.zeno.t == pytest.approx((1 + q) * y / k2 / (1 - q), abs=1e-6)


@SEEDS
def test_the_rocking_block_of_housner(seed: int) -> None:
    """Housner 1963, (6) and (10): half periods (2/p) acosh(1/(1 - phi))."""
    r = np.random.default_rng([4, seed])
    p, a, e, phi = r.uniform(1, 3), r.uniform(0.1, 0.4), r.uniform(0.6, 0.95), r.uniform(0.2, 0.9)
    block = System(
        {X: V, V: p**2 * (X - a * sign(X))}, surfaces=[Surface("edge", X, reset={V: e * V}, side="both")]
    )
    run = solve(block, (phi * a, 0), (0, 200), zeno="continue")
    times = [math.acosh(1 / (1 - phi)) / p]
    for _ in range(1500):
        u = e**2 * phi * (2 - phi)
        phi = u / (1 + math.sqrt(1 - u))
        times.append(times[-1] + 2 * math.asinh(math.sqrt(phi * (2 - phi)) / (1 - phi)) / p)
    assert [event.t for event in run.events][:5] == pytest.approx(times[:5], abs=1e-8)
    assert run.success
    assert run.zeno is not None
    assert run.zeno.t == pytest.approx(times[-1], abs=1e-6)


@SEEDS
def test_the_rimless_wheel_on_a_slope(seed: int) -> None:
    """McGeer 1990; Coleman 1998: c = cos 2a, speed after a step w^2 (1 - c^2) = 2 c^2 dE, multiplier c^2."""
    a, g = 0.2 + 0.08 * seed, 0.08 + 0.05 * seed
    c = math.cos(2 * a)
    w2 = c * c * 2 * (math.cos(g - a) - math.cos(g + a)) / (1 - c * c)

    def speed(q: float) -> float:
        return math.sqrt(w2 + 2 * (math.cos(g - a) - math.cos(q)))

    wheel = System(
        {X: V, V: sin(X)}, surfaces=[Surface("step", X - (g + a), reset={X: g - a, V: c * V}, side="-")]
    )
    orbit = find_orbit(wheel, (g - a, 1.1 * math.sqrt(w2)))
    period = quad(lambda q: 1 / speed(q), g - a, g + a, epsabs=1e-13, epsrel=1e-13)[0]
    assert orbit.period == pytest.approx(period, abs=1e-9)
    assert orbit.multipliers[0] == pytest.approx(c * c, abs=1e-9)
    steps = EventMap(wheel, Section("step", "reset", "v", {"x": str(g - a), "v": "d"}))
    assert [k.d for k in steps.fixed_points(0.8 * w2**0.5, 1.5 * w2**0.5)] == pytest.approx(
        [w2**0.5], abs=1e-9
    )


@SEEDS
def test_the_fold_of_the_impact_oscillator(seed: int) -> None:
    """Shaw & Holmes 1983, section 3: one impact per period over the amplitude: a least amplitude, a fold."""
    r = np.random.default_rng([5, seed])
    z, e, w, d = r.uniform(0.02, 0.1), r.uniform(0.5, 0.9), r.uniform(1.6, 1.8), r.uniform(0.3, 1.0)
    period, gain = 2 * math.pi / w, 1 / complex(1 - w * w, 2 * z * w)
    over = expm(np.array([[0, 1], [-1, -2 * z]]) * period)

    def forced(v: float) -> tuple[float, float]:
        """Amplitude and phase of the orbit that leaves the stop with speed v."""
        q, s = np.linalg.solve(np.eye(2) - over, np.array([d, -v / e]) - over @ [d, v])
        found = complex(q, -s / w) / gain
        return abs(found), float(np.angle(found)) / w % period

    least = minimize_scalar(
        lambda v: forced(v)[0], bounds=(-6, -1e-9), method="bounded", options={"xatol": 1e-11}
    )
    assert least.x < -0.01
    p = parameters(a=forced(1.3 * least.x)[0])
    wall = Surface("stop", X - d, reset={V: -e * V}, side="-")
    shaken = System({X: V, V: -X - 2 * z * V + p.a * cos(w * t)}, surfaces=[wall], parameters=p)
    orbit = find_orbit(shaken, (d, 1.3 * least.x), t0=forced(1.3 * least.x)[1])
    run = continuation(shaken, orbit, parameter="a", bounds=(0.7 * least.fun, 2 * least.fun), direction=-1)
    fold = next(point for point in run if point.special)
    assert fold.special == "fold"
    assert fold.value == pytest.approx(least.fun, abs=1e-8)


@pytest.mark.parametrize("digits", [2, 5, 8, 10])
def test_the_cubic_tangency_unfolds(digits: int) -> None:
    """Kuznetsov, Rinaldi & Gragnani 2003, double tangency: it leaves at -q, lands at 2 q."""
    eps = 10.0**-digits
    q = math.sqrt(eps)

    def slid(x: float) -> float:
        return (1 - eps) * x + x**3 / 3

    run = solve(System.from_modes([Y], {"+": [1, eps - X**2], "-": [0, 1]}, [X, Y]), (-0.5, 0), (0, 2))
    leaves = slid(-q) - slid(-0.5)
    end = brentq(lambda x: slid(x) - slid(2 * q) - (2 - leaves - 3 * q), 0, 5, xtol=1e-15)
    assert run.success
    assert run.x_end == pytest.approx([end, 0], abs=1e-9)
    if digits < 10:
        assert [event.t for event in run.events][-2:] == pytest.approx([leaves, leaves + 3 * q], abs=1e-8)


@SEEDS
def test_harvest_above_a_threshold(seed: int) -> None:
    """Meza, Costa, Bhaya & Kaszkurewicz 2005: the pseudo-equilibria of Rosenzweig's model."""
    r = np.random.default_rng([6, seed])
    k, a, level, most = r.uniform(3, 8), r.uniform(0.5, 1.2), r.uniform(0.3, 0.8), 1.5
    prey = X * (1 - X / k) - a * X * Y / (1 + 0.3 * a * X)
    model = System({X: prey, Y: Y * (0.6 * a * X / (1 + 0.3 * a * X) - 0.2 - most * Heaviside(Y - level))})
    wanted = []
    for x in np.roots([-0.3 * a / k, 0.3 * a - 1 / k, 1 - a * level]):
        growth = 0.6 * a * x.real / (1 + 0.3 * a * x.real) - 0.2
        if x.imag == 0 < x.real and 0 < growth < most:
            slope = 1 - 2 * x.real / k - a * level / (1 + 0.3 * a * x.real) ** 2
            wanted.append((x.real, "asymptotically stable" if slope < 0 else "unstable"))
    items = [i for i in stability_report(model).items if i.equilibrium.mode == "0"]
    found = [(float(i.equilibrium.value[0]), i.answer) for i in items if float(i.equilibrium.value[0]) > 1e-9]
    assert [x for x, _ in sorted(found)] == pytest.approx([x for x, _ in sorted(wanted)], abs=1e-9)
    assert [word for _, word in sorted(found)] == [word for _, word in sorted(wanted)]
