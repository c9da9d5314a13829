"""Event-triggered control with hold, against matrix exponentials (Tabuada 2007).

x' = A x + B K e with the sample e of x is sampled again where the distance |x - e| is sigma |x| + floor. Each
sampling ends where the distance is 0, and its slope 0/0; the function itself is far from 0 there.
"""

import math
from functools import partial

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from filippov import Surface, System, parameters, solve, solve_many, sqrt, states
from filippov.analysis import find_orbit

X, Y, A, B = states("x y a b")


def drawn(seed: int) -> tuple[np.ndarray, float, float, np.ndarray]:
    """The matrix of (x, e), sigma, the floor, and a start that is its own sample."""
    rng = np.random.default_rng(seed)
    whole = np.zeros((4, 4))
    whole[:2, :2], whole[:2, 2:] = rng.normal(size=(2, 2)), rng.normal(size=(2, 2)) - 2.0 * np.eye(2)
    x = rng.normal(size=2)
    return whole, float(rng.uniform(0.02, 0.3)), float(rng.choice([0.0, 0.05])), np.concatenate((x, x))


def expected(
    whole: np.ndarray, sigma: float, floor: float, z: np.ndarray, end: float
) -> tuple[list[float], np.ndarray]:
    def ahead(z: np.ndarray, span: float) -> float:
        y = expm(whole * span) @ z
        return float(np.hypot(y[0] - y[2], y[1] - y[3]) - sigma * np.hypot(y[0], y[1]) - floor)

    times, t, step = [], 0.0, 2e-3
    while True:
        spans = np.arange(1, int((end - t) / step) + 2) * step
        first = next((span for span in spans if ahead(z, span) > 0.0), None)
        span = end if first is None else brentq(partial(ahead, z), first - step, first, xtol=1e-15)
        if first is None or t + span >= end:
            return times, expm(whole * (end - t)) @ z
        t, z = t + span, expm(whole * span) @ z
        z[2:] = z[:2]
        times.append(t)


def _triggered() -> System:
    entries = parameters(**{f"m{i}{j}": 0.0 for i in range(2) for j in range(4)}, sigma=0.1, floor=0.0)
    rows = [sum(entries[f"m{i}{j}"] * q for j, q in enumerate((X, Y, A, B))) for i in range(2)]
    h = sqrt((X - A) ** 2 + (Y - B) ** 2) - entries.sigma * sqrt(X**2 + Y**2) - entries.floor
    trigger = Surface("trigger", h, reset={A: X, B: Y}, side="-")
    return System({X: rows[0], Y: rows[1], A: 0 * A, B: 0 * B}, surfaces=[trigger], parameters=entries)


TRIGGERED = _triggered()


def values(whole: np.ndarray, sigma: float, floor: float) -> dict[str, float]:
    entries = {f"m{i}{j}": float(whole[i, j]) for i in range(2) for j in range(4)}
    return {**entries, "sigma": sigma, "floor": floor}


@pytest.mark.parametrize("seed", range(16))
def test_a_distance_of_0_after_a_reset_has_no_slope(seed: int) -> None:
    whole, sigma, floor, start = drawn(seed)
    times, end = expected(whole, sigma, floor, start, 2.0)
    q = values(whole, sigma, floor)
    run = solve(TRIGGERED, start, (0, 2), parameters=q, rtol=1e-11, atol=1e-14)
    assert run.success, run.message
    assert run.events.of("trigger").t == pytest.approx(times, abs=1e-9)
    assert run.x_end == pytest.approx(end, rel=1e-8, abs=1e-9)


def test_in_lanes_in_python_and_as_functions() -> None:
    whole, sigma, floor, start = drawn(0)
    times, end = expected(whole, sigma, floor, start, 2.0)
    q, told = values(whole, sigma, floor), {"rtol": 1e-11, "atol": 1e-14}
    python = solve(TRIGGERED, start, (0, 2), parameters=q, backend="python", **told)
    assert python.x_end == pytest.approx(end, abs=1e-9)
    many = solve_many(TRIGGERED, [start] * 8, (0, 2), parameters=q, lanes=8, **told)
    assert many.success.all()
    assert many.x == pytest.approx(np.tile(end, (8, 1)), abs=1e-9)

    def distance(t, x, p):  # type: ignore[no-untyped-def]
        return math.hypot(x[0] - x[2], x[1] - x[3]) - sigma * np.sqrt(x[0] ** 2 + x[1] ** 2) - floor

    surface = Surface("trigger", distance, reset=lambda t, x, p: [x[0], x[1], x[0], x[1]], side="-")
    plain = System(field=lambda t, x, p, s: whole @ np.asarray(x), surfaces=[surface], states="x y a b")
    run = solve(plain, start, (0, 2), **told)
    assert run.success, run.message
    assert run.events.t == pytest.approx(times, abs=1e-8)


def test_an_orbit_through_such_resets_has_its_multiplier() -> None:
    # x' = y, y' = 1 - y from y = 0; where the way from the sample is 1, y is divided by 4 and x begins anew.
    distance = Surface("way", sqrt(X**2 + A**2) - 1, reset={X: 0, Y: Y / 4}, side="-")
    system = System({X: Y, Y: 1 - Y, A: -A}, surfaces=[distance])
    orbit = find_orbit(system, (0, 0.2, 0))

    def speed(v: float) -> tuple[float, float]:
        """The speed after the next reset, and the time to it: x = t + (v - 1)(1 - exp(-t))."""
        t = brentq(lambda t: t + (v - 1) * (1 - np.exp(-t)) - 1, 1e-9, 20, xtol=1e-15)
        return float((1 + (v - 1) * np.exp(-t)) / 4), float(t)

    v = brentq(lambda v: speed(v)[0] - v, 0.01, 0.9, xtol=1e-15)
    slope = (speed(v + 1e-5)[0] - speed(v - 1e-5)[0]) / 2e-5
    assert orbit.period == pytest.approx(speed(v)[1], rel=1e-9)
    assert min(abs(orbit.multipliers.real - slope)) < 1e-8
