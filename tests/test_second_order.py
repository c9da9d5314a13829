"""Sliding of second order: a super-twisting controller rests, or ends with a name, after its accumulation."""

import math

import numpy as np
import pytest
import sympy

from filippov import System, sign, solve, states, t
from filippov.status import Status

X, Y = states("x y")
K1, K2 = 1.5, 1.1


def twisting(onto_x: object = 0, onto_y: object = 0) -> System:
    return System({X: -K1 * sympy.sqrt(abs(X)) * sign(X) + Y + onto_x, Y: -K2 * sign(X) + onto_y})


def limit_time() -> float:
    """From (1, 0). With z = sqrt|x| and dtau = dt/z the motion is linear: z' = (y - K1 z)/2, y' = -K2 z, so
    that |y| shrinks from lap to lap by rho = exp(-a pi/w), and changes at the rate K2."""
    a = K1 / 4
    w = math.sqrt(K2 / 2 - a**2)
    rho = math.exp(-a * math.pi / w)
    tau = math.atan2(w, a) / w
    first = 2 * math.exp(-a * tau) * (w * math.sin(w * tau) + a * math.cos(w * tau))
    return first / K2 * (1 + (1 + rho) / (1 - rho))


def test_the_controller_comes_to_rest_where_its_laps_end() -> None:
    got = solve(twisting(), (1, 0), (0, 20), zeno="continue")
    assert got.status is Status.SUCCESS
    np.testing.assert_array_equal(got.x_end, [0, 0])
    limit = got.accumulations[-1]
    assert abs(limit.t - limit_time()) <= limit.error <= 1e-5
    assert got.nfev < 10_000


@pytest.mark.parametrize("push", [sympy.Rational(3, 10), 0.4 * sympy.cos(t), 0.9 * sympy.sin(3 * t)])
def test_what_pushes_the_integral_is_held_off(push: object) -> None:
    got = solve(twisting(onto_y=push), (1, 0), (0, 20), zeno="continue", max_events=5000)
    assert got.status is Status.SUCCESS
    np.testing.assert_array_equal(got.x_end, [0, 0])


def test_a_push_that_outgrows_the_sign_is_not_held_off() -> None:
    # y' = -K2 s + t/4 can be 0 up to t = 4.4 only: staying at 0 until 20 is no solution.
    got = solve(twisting(onto_y=t / 4), (1, 0), (0, 20), zeno="continue", max_events=5000)
    assert got.status is not Status.SUCCESS or abs(got.x_end[0]) > 1


def test_a_limit_that_moves_ends_with_a_name_and_not_in_a_storm() -> None:
    # Held at x = 0, y = -0.3 sin t: no mode of the surface does that.
    got = solve(twisting(onto_x=0.3 * sympy.sin(t)), (1, 0), (0, 20), zeno="continue")
    assert got.status is Status.ZENO
    assert "higher order" in got.message
    assert got.x_end[1] == pytest.approx(-0.3 * math.sin(got.t_end), abs=1e-4)
    assert len(got.events) < 1000
