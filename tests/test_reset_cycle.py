"""Surfaces whose resets lead onto each other: a rimless wheel comes to stand on two spokes."""

import math
import os
from functools import cache

import numpy as np
import pytest

from filippov import Status, Surface, System, TimeEvent, cos, parameters, sin, solve, states

DRAWS = {"default": 5, "ci": 20, "nightly": 1000}[os.environ.get("FILIPPOV_PROFILE", "default")]


@cache
def wheel(linear: bool, more: bool = False, kicked: bool = False) -> System:
    """The angle of the spoke on which the wheel stands, spokes by 2 alpha apart; k = g/l, slope gamma."""
    q, w, z = states("theta omega z")
    p = parameters(alpha=0.4, k=9.81, gamma=0.0, u=1.0)
    after = {q: -p.alpha + p.gamma, w: cos(2 * p.alpha) * w}
    front = Surface("front", p.alpha + p.gamma - q, reset=after)
    back = Surface("back", q + p.alpha - p.gamma, reset={**after, q: p.alpha + p.gamma})
    equations = {q: w, w: p.k * (q if linear else sin(q))} | ({z: 1 + 0 * q} if more else {})
    kick = [TimeEvent("kick", times=(6.0,), reset={w: w + p.u})] if kicked else []
    return System(equations, surfaces=[front, back], time_events=kick)


def limit(speed: float, alpha: float, k: float) -> float:
    """The time after which the linear wheel rests, from a speed below alpha sqrt(k) on a new spoke."""
    total, top, c = 0.0, alpha * math.sqrt(k), math.cos(2 * alpha)
    while speed > 1e-18:
        total += 2 * math.atanh(speed / top) / math.sqrt(k)
        speed *= c
    return total


def test_11_5_a_rimless_wheel_on_flat_ground_rests_at_the_limit_of_its_impacts() -> None:
    random = np.random.default_rng(1)
    for _ in range(DRAWS):
        alpha, k = random.uniform(0.2, 0.6), random.uniform(2, 15)
        speed = random.uniform(0.05, 0.9) * alpha * math.sqrt(k)
        values, ends = {"alpha": alpha, "k": k}, limit(speed, alpha, k)
        start = (-alpha, speed)
        run = solve(wheel(True), start, (0, ends + 1), parameters=values, zeno="continue", max_events=5000)
        assert run.success, run.message
        assert run.zeno.t == pytest.approx(ends, abs=1e-7), (alpha, k, speed)
        assert abs(run.zeno.t - ends) <= run.zeno.error
        assert abs(run.x_end[0]) == pytest.approx(alpha, abs=1e-12)
        assert run.x_end[1] == 0
        last = run.events[-1]
        assert (last.kind.value, last.t) == ("sliding entry", run.zeno.t)
        assert "resets lead onto each other" in last.note
        # It stays there, and the dense output does not leave the spoke before.
        after = run.sol(np.linspace(last.t, run.t_end, 50))
        assert np.ptp(after[0]) == 0
        assert np.all(np.abs(run.sol(np.linspace(0, run.t_end, 500))[0]) <= alpha + 1e-9)


def test_11_5_the_wheel_rests_on_a_gentle_slope_too_and_from_any_start() -> None:
    random = np.random.default_rng(2)
    for _ in range(DRAWS):
        gamma = random.uniform(-0.05, 0.05)
        values = {"alpha": 0.4, "gamma": gamma}
        start = (gamma + random.uniform(-0.39, 0.39), random.uniform(-2, 2))
        run = solve(wheel(False), start, (0, 30), parameters=values, zeno="continue", max_events=5000)
        assert run.success, run.message
        assert abs(run.x_end[0] - gamma) == pytest.approx(0.4, abs=1e-9)
        assert run.x_end[1] == 0


def test_11_5_a_wheel_starts_at_rest_on_two_spokes_and_is_kicked_on_either() -> None:
    for q in (0.4, -0.4):
        run = solve(wheel(False), (q, 0), (0, 2), zeno="continue")
        assert run.success
        assert run.x_end == pytest.approx([q, 0], abs=1e-12)
        assert solve(wheel(False), (q, 0), (0, 2)).status is Status.ZENO
    # Whether it strikes the next spoke first depends on the spoke that it is said to stand on.
    run = solve(wheel(False, kicked=True), (0.1, 0), (0, 12), zeno="continue")
    assert run.status is Status.NON_UNIQUE
    assert run.t_end == 6
    assert run.sol(5.9)[1] == 0


def test_11_5_what_moves_on_in_the_limit_is_no_rest() -> None:
    run = solve(wheel(False, more=True), (0.1, 0, 0), (0, 5), zeno="continue")
    assert run.status is Status.ZENO
    assert "no resting contact" in run.message
    stopped = solve(wheel(False), (0.1, 0), (0, 5))
    assert stopped.status is Status.ZENO
