"""Multipliers that turn much faster than the motion: every break-away is met, at a bounded cost."""

import math

import numpy as np
import pytest
import sympy as sp

from filippov import Surface, System, solve, states
from filippov.model.symbols import t
from filippov.solving.ensemble import solve_many

METHODS = ("DOP853", "DP5", "Radau")
x, v = states("x v")
AMPLITUDE, RATE = 1.01, 50.0


def shaken(force: sp.Expr, beside: bool = False) -> System:
    """v' = force - Sgn(v); beside it, where wanted, an oscillator that has nothing to do with it."""
    y, w = states("y w")
    return System({x: v, v: force - sp.sign(v)} | ({y: w, w: -y} if beside else {}))


def slip_times(amplitude: float) -> tuple[float, float]:
    """When the block under amplitude sin(50 t) breaks away for the first time, and rests again.

    v' = A sin(50 t) - 1 from v = 0 at 50 t0 = asin(1/A): v = 0 again where
    A (cos 50 t0 - cos 50 t) = 50 (t - t0).
    """
    start = math.asin(1 / amplitude)
    low, high = start + 1e-3, start + 3.0

    def speed(u: float) -> float:
        return amplitude * (math.cos(start) - math.cos(u)) - (u - start)

    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if speed(middle) > 0 else (low, middle)
    return start / RATE, low / RATE


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("functions", [False, True])
def test_every_slip_of_a_shaken_block_is_met(functions: bool, method: str) -> None:
    """16 half periods in (0, 1), a slip in each of the first 15.9: the force exceeds the friction by 1 %."""
    system = shaken(AMPLITUDE * sp.sin(RATE * t))
    if functions:
        surface = Surface("v", lambda t, x, p: x[1], linear=True)
        system = System(
            field=lambda t, x, p, s: (x[1], AMPLITUDE * math.sin(RATE * t) - s[0]),
            surfaces=[surface],
            states="x v",
        )
    solution = solve(system, (0, 0), (0, 1), method=method, rtol=1e-10, atol=1e-13)
    away, back = slip_times(AMPLITUDE)
    expected = [time + k * math.pi / RATE for k in range(16) for time in (away, back)]
    assert [event.t for event in solution.events] == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("lanes", [1, 8])
def test_lanes_meet_every_slip(lanes: int) -> None:
    x0 = np.zeros((100, 2))
    ends = solve_many(shaken(AMPLITUDE * sp.sin(RATE * t)), x0, (0, 1), lanes=lanes)
    assert np.all(ends.counts.sum(axis=(1, 2)) == 32)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("beside", [False, True])
def test_a_force_that_grows_slowly_breaks_away_in_the_right_period(beside: bool, method: str) -> None:
    """(0.9 + t/10^4) |sin 50 t| reaches 1 in the period where its maximum first does, after 7,958 others."""
    system = shaken((0.9 + t * 1e-4) * sp.sin(RATE * t), beside)
    x0 = (0, 0, 1, 0) if beside else (0, 0)
    solution = solve(system, x0, (0, 1000.1), method=method, max_steps=1_000_000, rtol=1e-6)
    k = math.ceil((1000.0 * RATE - math.pi / 2) / math.pi)
    top = (k + 0.5) * math.pi / RATE
    low, high = top - math.pi / 2 / RATE, top
    for _ in range(100):
        middle = 0.5 * (low + high)
        beyond = (0.9 + middle * 1e-4) * abs(math.sin(RATE * middle)) > 1
        low, high = (low, middle) if beyond else (middle, high)
    assert solution.events[0].t == pytest.approx(high, abs=1e-9)
    assert solution.events[0].kind == "sliding exit"


@pytest.mark.parametrize("method", METHODS)
def test_a_force_that_stays_below_costs_a_few_hundred_field_calls_a_period(method: str) -> None:
    solution = solve(shaken(0.999999 * sp.sin(RATE * t)), (0, 0), (0, 100), method=method)
    assert solution.success
    assert len(solution.events) == 0
    assert solution.nfev < 500 * 100 * RATE / (2 * math.pi)


@pytest.mark.parametrize("method", METHODS)
def test_a_belt_over_a_washboard_lets_the_block_go_where_the_board_first_holds_it(method: str) -> None:
    """Carried at speed 1 over sin(50 x): the field of the slide is constant, its multiplier is not."""
    system = System({x: v, v: -AMPLITUDE * sp.sin(RATE * x) - sp.sign(v - 1)})
    solution = solve(system, (0, 1), (0, 1), method=method)
    assert solution.events[0].kind == "sliding exit"
    assert solution.events[0].t == pytest.approx(math.asin(1 / AMPLITUDE) / RATE, abs=1e-12)
