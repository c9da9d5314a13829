"""Sliding of second order: a super-twisting controller rests, or ends with a name, after its accumulation."""

import math
from typing import Any

import numpy as np
import pytest
import sympy

from filippov import System, sign, solve, states, t
from filippov.base.status import EventKind, Status

X, Y = states("x y")
K1, K2 = 1.5, 1.1


def twisting(onto_x: object = 0, onto_y: object = 0) -> System:
    return System({X: -K1 * sympy.sqrt(abs(X)) * sign(X) + Y + onto_x, Y: -K2 * sign(X) + onto_y})


def limit_time() -> float:
    """From (1, 0). With z = sqrt|x| and dtau = dt/z the motion is linear: z' = (y - K1 z)/2, y' = -K2 z, so
    that |y| shrinks from cycle to cycle by rho = exp(-a pi/w), and changes at the rate K2."""
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


def test_a_limit_that_moves_is_followed() -> None:
    # Held at x = 0, y = -0.3 sin t, with K2 s = 0.3 cos t.
    got = solve(twisting(onto_x=0.3 * sympy.sin(t)), (1, 0), (0, 20), zeno="continue")
    assert got.status is Status.SUCCESS
    assert "sliding of order 2" in got.events[-1].note
    times = np.linspace(got.events[-1].t + 1e-9, 20, 40)
    assert np.max(np.abs(got.sol(times)[0])) < 1e-12
    assert np.max(np.abs(got.sol(times)[1] + 0.3 * np.sin(times))) < 1e-12
    np.testing.assert_allclose(got.multiplier("x", times), 0.3 * np.cos(times) / K2, atol=1e-12)


@pytest.mark.parametrize(("a", "power"), [(1, sympy.Rational(1, 2)), (2, sympy.Rational(2, 3))])
def test_terminal_sliding_ends_in_the_origin_and_rests(a: int, power: sympy.Rational) -> None:
    # On y = -a |x|^p sign x: x' = -a x^p, 0 after x^(1-p) / (a (1-p)) (Venkataraman & Gulati 1993).
    surface = Y + a * abs(X) ** power * sign(X)
    got = solve(System({X: Y, Y: -3 * sign(surface)}), (1, 1), (0, 10), rtol=1e-10, atol=1e-12)
    # At the origin the curve touches x = 0, which rounding may show beside the arrival.
    entry, *touched, rest = got.events
    assert all(e.kind is EventKind.GRAZING and abs(e.t - rest.t) < 1e-9 for e in touched)
    p = float(power)
    after = abs(entry.x[0]) ** (1 - p) / (a * (1 - p))
    assert got.status is Status.SUCCESS
    assert abs(entry.x[1] + a * entry.x[0] ** p) < 1e-9
    assert rest.t == pytest.approx(entry.t + after, abs=1e-5)  # x^(1-p) of an error of 1e-12 in x
    np.testing.assert_allclose(got.x_end, 0, atol=1e-12)


@pytest.mark.parametrize(
    ("a", "power"), [(1, sympy.Rational(1, 2)), (2, sympy.Rational(2, 3)), (1, sympy.Rational(3, 4))]
)
def test_terminal_sliding_has_no_state_without_a_value(a: int, power: sympy.Rational) -> None:
    """A step that lands beyond x = 0, where the sliding field has no value, is no landing (3 % of runs)."""
    system = System({X: Y, Y: -3 * sign(Y + a * abs(X) ** power * sign(X))})
    for k in range(60):
        got = solve(system, (1, 1), (0, 10), rtol=1e-10 * (1 + 4e-3 * k), atol=1e-12)
        assert np.all(np.isfinite(got.y)), (k, got.message)
        assert not got.success or np.max(np.abs(got.x_end)) < 1e-12, (k, got.x_end)
        assert got.success or got.status is Status.MIN_STEP, (k, got.message)


def test_parabolic_switching_curve_ends_in_the_origin_and_rests() -> None:
    # Least time from (2, 0) with |u| <= 1: sqrt(2) to the curve x = -y |y| / 2, sqrt(2) along it.
    got = solve(System({X: Y, Y: -sign(X + Y * abs(Y) / 2)}), (2, 0), (0, 10))
    assert got.status is Status.SUCCESS
    assert got.events[0].t == pytest.approx(math.sqrt(2), abs=1e-9)
    assert got.sol(2)[0] == pytest.approx((2 * math.sqrt(2) - 2) ** 2 / 2, rel=1e-7)
    assert np.max(np.abs(got.sol(np.linspace(2.8285, 10, 9)))) < 1e-4
    np.testing.assert_allclose(got.x_end, 0, atol=1e-12)


@pytest.mark.parametrize("method", ["DOP853", "DP5", "Radau"])
@pytest.mark.parametrize("power", [sympy.Rational(1, 10), sympy.Rational(1, 3), sympy.Rational(1, 2)])
def test_non_lipschitz_equilibrium_is_reached_and_kept(power: sympy.Rational, method: str) -> None:
    # x' = -x^p: x^(1-p) = 1 - (1 - p) t, then 0 forever.
    got = solve(System({X: -sign(X) * abs(X) ** power}), (1,), (0, 12), method=method, rtol=1e-11, atol=1e-15)
    assert got.status is Status.SUCCESS
    assert abs(got.x_end[0]) < 1e-14
    assert got.events[0].t == pytest.approx(1 / (1 - float(power)), abs=1e-6)
    middle = got.sol(0.5)[0]
    assert middle == pytest.approx((1 - (1 - float(power)) * 0.5) ** (1 / (1 - float(power))), rel=1e-9)


@pytest.mark.parametrize("speed", [0.0, 1e-11, -1e-11])
def test_relay_of_order_two_that_starts_within_the_tolerance_of_its_slide(speed: float) -> None:
    """Cycles of such a speed and length went on one by one, and their end moved z by half of it.

    w = z - v/2 feels no switching: w' = -z/2, so w falls as exp(-t/2) but for the integral of v, which is 0.
    """
    x, v, z = states("x v z")
    relay = System({x: -3 * x + v, v: -2 * x + z - sign(x), z: -x - sign(x) / 2})
    run = solve(relay, (1e-15, speed, 0.1), (0, 0.3), max_events=300)
    assert run.success
    assert run.modes[-1] == "0"
    assert np.allclose(run.x_end, [0, 0, (0.1 - speed / 2) * np.exp(-0.15)], rtol=0, atol=1e-10)


def test_relay_of_order_two_whose_cycles_grow_is_followed() -> None:
    """The same with a zero to the right: cycles of that size grow, and are no slide."""
    x, v, z = states("x v z")
    relay = System({x: -x + v, v: -2 * x + z - sign(x), z: -x - 3 * sign(x)})
    run = solve(relay, (1e-15, 0, 0.1), (0, 1), max_events=300)
    assert run.status is Status.MAX_EVENTS
    assert run.modes[-1] != "0"
    assert abs(run.events[-1].x[1]) > abs(run.events[0].x[1])


def test_cycles_above_the_tolerance_are_not_asked_each_whether_they_are_a_slide(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Every second event of a relay of order two was, 2,401 of a run of 15 s, for 25 ms each."""
    from filippov.solving.selection import higher_order

    asked, begin = [], higher_order.HigherOrder.begin

    def counted(self: higher_order.HigherOrder, *args: Any, **options: Any) -> Any:
        asked.append(self.run.t)
        return begin(self, *args, **options)

    monkeypatch.setattr(higher_order.HigherOrder, "begin", counted)
    x, v, z, w = states("x v z w")
    a, b, push = [4.327, 6.775, 4.562, 1.12], [1.1047, 0.0616, 0.3078], sign(x)
    relay = System({
        x: v - a[0] * x, v: z - a[1] * x - b[0] * push,
        z: w - a[2] * x - b[1] * push, w: -a[3] * x - b[2] * push,
    })  # fmt: skip
    run = solve(relay, (0, 5.3e-6, 0.448, 0.1335), (0, 0.01), max_events=300)
    assert run.status is Status.MAX_EVENTS
    assert len(asked) <= 1
