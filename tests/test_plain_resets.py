"""Derivatives through resets and clocks that are plain functions, against closed forms.

The maps are those of Brette & Gerstner 2005 (integrate and fire with adaptation), Shaw & Holmes 1983 (impact
oscillator, (2.2) and (3.1)), Banerjee & Verghese 2001, ch. 3 (boost converter under current control).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq, fsolve

from filippov import Surface, System, TimeEvent, solve
from filippov.analysis import continuation, find_orbit, flow_derivative, lyapunov
from filippov.analysis.sensitivity.plain_resets import plain_instant_slopes, plain_reset_slopes

Array = np.ndarray[Any, Any]


def affine(a: Array, b: Array, x: Array, t: float) -> Array:
    """The state at t of x' = a x + b from x."""
    n = len(x)
    m = np.zeros((n + 1, n + 1))
    m[:n, :n], m[:n, n] = a, b
    return np.asarray((expm(m * t) @ np.append(x, 1.0))[:n])


def ordered(values: Any) -> Array:
    found = np.asarray(values, dtype=complex)
    return found[np.argsort(-np.abs(found), kind="stable")]


@pytest.mark.parametrize("seed", range(6))
def test_a_neuron_with_adaptation(seed: int) -> None:
    """v' = I - v - w, w' = (a v - w)/tau; at v = 1: v = 0, w = w + b; the map of w by matrix exponentials."""
    r = np.random.default_rng([1, seed])
    current, a, tau, b = r.uniform(2, 4), r.uniform(-0.2, 0.5), r.uniform(2, 8), r.uniform(0.05, 0.3)
    matrix, drive = np.array([[-1, -1], [a / tau, -1 / tau]]), np.array([current, 0.0])

    def spike(w: float) -> tuple[float, float]:
        def above(t: float) -> float:
            return float(affine(matrix, drive, np.array([0, w]), t)[0]) - 1

        end = next(t for t in np.arange(0.05, 50, 0.05) if above(t) > 0)
        t = brentq(above, 1e-9, end, xtol=1e-15)
        return float(affine(matrix, drive, np.array([0, w]), t)[1]) + b, t

    w = 0.1
    for _ in range(150):
        w = spike(w)[0]
    jump = Surface("spike", lambda t, x, p: x[0] - 1, reset=lambda t, x, p: [0, x[1] + p.b], side="-")
    neuron = System(
        field=lambda t, x, p, s: [current - x[0] - x[1], (a * x[0] - x[1]) / tau],
        surfaces=[jump], states="v w", parameters={"b": b},
    )  # fmt: skip
    orbit = find_orbit(neuron, (0, w + 0.01))
    assert orbit.period == pytest.approx(spike(w)[1], abs=1e-10)
    ahead, behind, far, back = (spike(w + k * 1e-3)[0] for k in (1, -1, 2, -2))
    slope = (8 * (ahead - behind) - (far - back)) / 12e-3
    assert orbit.multipliers[0] == pytest.approx(slope, abs=1e-9)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("dual", [True, False])
def test_an_impact_oscillator_whose_reset_may_refuse_dual_numbers(seed: int, dual: bool) -> None:
    """x'' + 2 z x' + x = a cos w t, x <= d: the orbit of one impact, and the area that it keeps."""
    r = np.random.default_rng([2, seed])
    z, e, w, d = r.uniform(0.05, 0.1), r.uniform(0.5, 0.8), r.uniform(2.2, 2.8), r.uniform(-0.1, 0.1)
    period, a = 2 * math.pi / w, np.array([[0, 1], [-1, -2 * z]])
    gain, whole = 1 / complex(1 - w * w, 2 * z * w), expm(a * period)

    def forced(t: float) -> Array:
        q = gain * np.exp(1j * w * t)
        return np.array([q.real, (1j * w * q).real])

    def closes(u: Array) -> Array:
        q = forced(u[0])
        return np.asarray(whole @ (np.array([d, u[1]]) - q) + q - np.array([d, -u[1] / e]))

    t0, v0 = next(
        found
        for start in np.linspace(0, period, 17)
        for found, _, flag, _ in [fsolve(closes, [start, -1.0], full_output=True, xtol=1e-14)]
        if flag == 1 and found[1] < -0.1
    )
    before, after = -v0 / e, v0
    jump = after, -d - 2 * z * after + math.cos(w * t0)
    rate = before, -d - 2 * z * before + math.cos(w * t0)
    reset = np.diag([1.0, -e])
    saltation = reset + np.outer(np.array(jump) - reset @ rate, [1.0, 0.0]) / before
    wall = Surface(
        "wall", lambda t, x, p: x[0] - d, side="-",
        reset=lambda t, x, p: [x[0], -e * (x[1] if dual else float(x[1]))],
    )  # fmt: skip
    system = System(
        field=lambda t, x, p, s: [x[1], -x[0] - 2 * z * x[1] + math.cos(w * t)],
        surfaces=[wall], states="x v",
    )  # fmt: skip
    orbit = find_orbit(system, (d, v0), t0=t0 % period, period=period)
    assert orbit.period == pytest.approx(period, abs=1e-12)
    wanted = np.linalg.eigvals(saltation @ whole)
    assert ordered(orbit.multipliers) == pytest.approx(ordered(wanted), abs=1e-8)
    assert np.prod(orbit.multipliers).real == pytest.approx(e**2 * math.exp(-2 * z * period), abs=1e-8)


def boost(period: float, load: float) -> System:
    """i' = 1 - (1 - q) v, 2 v' = (1 - q) i - v/load; i = I: q = 0; the clock: q = 1."""
    return System(
        field=lambda t, x, p, s: [1 - (1 - x[2]) * x[1], ((1 - x[2]) * x[0] - x[1] / load) / 2, 0.0],
        surfaces=[
            Surface("ref", lambda t, x, p: x[0] - p.I, reset=lambda t, x, p: [x[0], x[1], 0], side="-")
        ],
        time_events=[TimeEvent("clock", period=period, reset=lambda t, x, p: [x[0], x[1], 1])],
        states="i v q", parameters={"I": 1.0},
    )  # fmt: skip


@pytest.mark.parametrize("seed", range(4))
def test_a_boost_converter_doubles_its_period_where_its_map_does(seed: int) -> None:
    r = np.random.default_rng([3, seed])
    period, load = r.uniform(0.25, 0.4), r.uniform(1.5, 3)
    on, off = np.array([[0, 0], [0, -0.5 / load]]), np.array([[0, -1], [0.5, -0.5 / load]])
    b = np.array([1.0, 0.0])

    def once(x: Array, most: float) -> Array:
        rise = most - x[0]
        return affine(off, b, affine(on, b, x, rise), period - rise)

    def fixed(most: float) -> Array:
        return np.asarray(fsolve(lambda x: once(x, most) - x, [most - period / 2, 1.6], xtol=1e-12))

    def flips(most: float) -> float:
        x, e = fixed(most), 1e-4 * np.eye(2)
        columns = [(once(x + k, most) - once(x - k, most)) / 2e-4 for k in e]
        return float(np.linalg.det(np.array(columns).T + np.eye(2)))

    low = next(v for v in np.arange(0.5, 6, 0.1) if flips(v) > 0 > flips(v + 0.1))
    most = brentq(flips, low, low + 0.1)
    system = boost(period, load)
    start = find_orbit(system, (*fixed(most - 0.1), 1), period=period, parameters={"I": most - 0.1})
    branch = continuation(
        system, start, parameter="I", bounds=(most - 0.1, most + 0.05), direction=1
    ).run()
    (doubling,) = branch.special
    assert doubling.special == "period doubling"
    assert doubling.value == pytest.approx(most, abs=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_derivatives_by_parameters_of_resets_and_clocks(seed: int) -> None:
    """x' = c x, at n T: x+ = k x + t, T = 1/f: x(t1) and its derivatives by x0, c, k and f are sums."""
    r = np.random.default_rng([4, seed])
    x0, c, k, f = r.uniform(0.5, 2), r.uniform(-1, 0.5), r.uniform(-1.5, 1.5), r.uniform(0.7, 1.3)
    clock = TimeEvent(
        "clock", period=lambda p: 1 / p.f, start=lambda p: 1 / p.f,
        reset=lambda t, x, p: [p.k * x[0] + t],
    )  # fmt: skip
    system = System(
        field=lambda t, x, p, s: [p.c * x[0]], time_events=[clock], states="x",
        parameters={"c": c, "k": k, "f": f},
    )  # fmt: skip
    end = 3.4

    def exact(x0: float, c: float, k: float, f: float) -> float:
        x, ticks = x0, math.floor(end * f)
        for n in range(1, ticks + 1):
            x = k * x * math.exp(c / f) + n / f
        return x * math.exp(c * (end - ticks / f))

    run = solve(system, (x0,), (0, end), rtol=1e-12, atol=1e-14)
    assert run.x_end[0] == pytest.approx(exact(x0, c, k, f), abs=1e-10)
    at, h = np.array([x0, c, k, f]), 1e-4
    slopes = [(exact(*(at + h * e)) - exact(*(at - h * e))) / (2 * h) for e in np.eye(4)]
    finer = [(exact(*(at + h / 2 * e)) - exact(*(at - h / 2 * e))) / h for e in np.eye(4)]
    wanted = (4 * np.array(finer) - slopes) / 3
    assert flow_derivative(run, parameters=("c", "k", "f"))[0] == pytest.approx(wanted, abs=1e-8)


def walled(a: Array, number: Any) -> System:
    """A wall whose reset has products, powers, a kink and time in it; number: of its first value."""

    def reset(t: float, x: Array, p: Any) -> list[float]:
        first = a[0] * math.sin(x[0]) + a[1] * x[0] * x[1] + a[2] * p.q**2
        return [number(first), abs(a[3] * x[1]) + math.exp(p.q) + math.cos(t)]

    wall = Surface("wall", lambda t, x, p: x[0], reset=reset)
    return System(field=lambda t, x, p, s: [x[1], 0.0], surfaces=[wall], states="x v", parameters={"q": 0.0})


@pytest.mark.parametrize("number", [lambda v: v, float])
def test_a_thousand_resets_by_dual_numbers_and_by_differences(number: Any) -> None:
    for seed in range(500):
        r = np.random.default_rng([5, seed])
        a, t, x, p = r.normal(size=4), r.uniform(-2, 2), r.normal(size=2), r.normal(size=1)
        wanted = [
            [a[0] * math.cos(x[0]) + a[1] * x[1], a[1] * x[0], a[2] * p[0] * 2, 0],
            [0, abs(a[3]) * math.copysign(1, x[1]), math.exp(p[0]), -math.sin(t)],
        ]
        found = plain_reset_slopes(walled(a, number), 0, t, x, p)
        assert found == pytest.approx(np.array(wanted), abs=2e-8)
        later = plain_instant_slopes(walled(a, number), lambda p: 2 / number(1 + p.q**2), p)
        assert later == pytest.approx([-4 * p[0] / (1 + p[0] ** 2) ** 2], abs=2e-8)


def test_the_exponent_of_a_tent_map_by_a_clock_of_plain_functions() -> None:
    """x -> x/a below a, (1 - x)/(1 - a) above: -a ln a - (1 - a) ln(1 - a)."""
    a = 0.3
    clock = TimeEvent(
        "n", period=1.0, reset=lambda t, x, p: [x[0] / a if x[0] < a else (1 - x[0]) / (1 - a)]
    )
    system = System(field=lambda t, x, p, s: [0.0], time_events=[clock], states="x")
    found = lyapunov(system, (0.3141,), 1500, interval=1.0)
    assert found.exponents[0] == pytest.approx(-a * math.log(a) - (1 - a) * math.log(1 - a), abs=0.05)
