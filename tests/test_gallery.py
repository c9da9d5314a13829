"""One number of each model of the gallery against a closed form or scipy, phase by phase."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from numpy.linalg import matrix_power
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from filippov import models, solve

Array = npt.NDArray[np.float64]
approx = pytest.approx
Side = Callable[[Array], float]


def run(name: str, end: float | None = None, **parameters: float) -> Any:
    """The model's default run, or one to another end or with other parameters."""
    model = models.get(name)
    span = (0.0, end or model.t_span[1])
    solution = solve(model.build(), model.x0, span, parameters=parameters, rtol=1e-11, atol=1e-14)
    assert solution.success, solution.message
    return solution


def affine(A: Any, b: Any, t: float) -> Array:
    """The flow of x' = A x + b over t as a matrix on (x, 1)."""
    rate = np.zeros((len(b) + 1, len(b) + 1))
    rate[:-1, :-1], rate[:-1, -1] = A, b
    return np.asarray(expm(rate * t))


def until(A: Any, b: Any, x: Any, side: Side, dt: float) -> tuple[float, Array]:
    """(time, state) where side(x) next changes its sign along x' = A x + b; looked at every dt."""
    start = np.append(x, 1.0)
    step, at, count = affine(A, b, dt), affine(A, b, 1e-6 * dt) @ start, 0
    sign = side(at[:-1])
    while side(at[:-1]) * sign > 0:
        at, count = step @ at, count + 1
    low, high = (count - 1) * dt, (count + 1e-6) * dt
    time = brentq(lambda t: side((affine(A, b, t) @ start)[:-1]), max(low, 1e-7 * dt), high, xtol=1e-15)
    return time, (affine(A, b, time) @ start)[:-1]


# -- textbook ------------------------------------------------------------------------------------------


def test_16_6_fuller_switches_in_a_geometric_series() -> None:
    c = math.sqrt((math.sqrt(33) - 1) / 24)
    ratio, first = math.sqrt((1 - 2 * c) / (1 + 2 * c)), 1 / math.sqrt(0.5 + c)
    assert 1 / ratio == approx(4.13016, abs=5e-6)
    times = run("fuller").events.of("curve").t
    steps = first * (1 + ratio) * ratio ** np.arange(len(times) - 1)
    assert len(times) == 4
    assert times == approx(first + np.append(0, np.cumsum(steps)), rel=1e-9)


def test_16_6_capture_is_held_by_the_mean_of_both_sides() -> None:
    solution = run("capture")
    assert solution.events.t == approx([2.0], rel=1e-12)
    assert solution.x_end[0] == 0
    assert solution.multiplier("zero", 3.0) == approx(0.5, rel=1e-12)


def test_16_6_visible_fold_is_left_where_sliding_has_turned_to_it() -> None:
    """y = r cos u, z = r sin u with dt = (y + z) du: until y = 0 it takes r - z0 + y0."""
    solution, r = run("visible_fold"), math.sqrt(1.04)
    rest = 3 - (r - 0.2 + 1.0)
    assert solution.modes == ("0", "+")
    assert solution.events[0].t == approx(3 - rest, rel=1e-9)
    assert solution.x_end == approx([rest**2 / 2, -rest, r], rel=1e-8)


def test_16_6_teixeira_flights_are_two_matrices() -> None:
    b, x = -0.98, np.array([-0.1, 0.001])
    above, below = np.array([[-1, 0], [-2 * b, 1]]), np.array([[1, -2 * b], [0, -1]])
    solution, time = run("teixeira"), 0.0
    assert len(solution.events) == 15
    for k, event in enumerate(solution.events):
        time += 2 * (abs(x[0]) if k % 2 == 0 else abs(x[1]))
        x = (above if k % 2 == 0 else below) @ x
        assert [event.t, *event.x] == approx([time, 0, *x], rel=1e-9, abs=1e-12)
    # Sliding then brings y and z together, (y + z)' = 1 + b.
    assert solution.modes[-1] == "0"
    assert solution.x_end == approx([0, *2 * [(sum(x) + (1 + b) * (12 - time)) / 2]], rel=1e-9, abs=1e-12)


# -- impacts -------------------------------------------------------------------------------------------


def test_16_6_cradle_passes_the_swing_from_end_to_end() -> None:
    solution = run("newton_cradle")
    for time in (1.0, 3.0, 4.0, 7.0, 9.0, 12.0):
        left = math.cos(time) > 0
        expected = [-math.cos(time) if left else 0, 0, 0 if left else -math.cos(time)]
        assert solution.sol(time)[:3] == approx(expected, abs=1e-9)


def test_16_6_impact_pair_flies_straight_between_its_walls() -> None:
    time, x, v = 0.0, 0.0, 0.5
    for event in run("impact_pair").events:

        def room(s: float, side: float) -> float:
            return side * (x + v * (s - time) - math.sin(s)) - 1  # noqa: B023

        grid = time + 1e-6 + np.arange(0, 10, 1e-2)
        hits = [next((s for s in grid if room(s, side) > 0), math.inf) for side in (1, -1)]
        side, late = (1, hits[0]) if hits[0] < hits[1] else (-1, hits[1])
        hit = brentq(room, late - 1e-2, late, (side,), xtol=1e-14)
        x, v, time = x + v * (hit - time), 1.6 * math.cos(hit) - 0.6 * v, hit
        assert [event.t, *event.x_after] == approx([time, x, v], rel=1e-8, abs=1e-8)


def test_16_6_ball_on_a_table_bounces_once_a_period() -> None:
    period, speed = 2 * math.pi / 10, 9.81 * 2 * math.pi / 10 * 0.5 / 3
    hits = run("ball_on_table", 40.0).events[-3:]
    assert np.diff([e.t for e in hits]) == approx([period, period], rel=1e-8)
    assert [1.1 * math.cos(10 * e.t) for e in hits] == approx([speed] * 3, rel=1e-7)
    assert [e.x_after[1] for e in hits] == approx([9.81 * period / 2] * 3, rel=1e-8)


def test_16_6_rocking_block_has_the_times_of_housner() -> None:
    rate, alpha = 2.0, 0.2
    kept = 1 - 1.5 * math.sin(alpha) ** 2
    times, height = [math.acosh(1 / (1 - 0.15 / alpha)) / rate], 0.15
    while times[-1] < 7.6:
        left = kept**2 * (alpha**2 - (alpha - height) ** 2)
        height = alpha - math.sqrt(alpha**2 - left)
        times.append(times[-1] + 2 * math.acosh(1 / (1 - height / alpha)) / rate)
    assert run("rocking_block").events.t == approx(times, rel=1e-9)


def test_16_6_rimless_wheel_walks_at_the_fixed_point_of_mcgeer() -> None:
    speed = math.sqrt(4 * math.sin(0.1) * math.sin(0.3)) / math.tan(0.6)
    steps = run("rimless_wheel", 60.0).events
    assert steps[-1].x_after[1] == approx(speed, rel=1e-8)


# -- power ---------------------------------------------------------------------------------------------


def test_16_6_chua_is_three_linear_pieces() -> None:
    a, b, m0, m1 = 15.6, 28.0, -8 / 7, -5 / 7
    x, time = np.array([0.7, 0, 0]), 0.0
    region = 0
    for event in run("chua").events:
        slope, jump = (m1, region * (m0 - m1)) if region else (m0, 0.0)
        A = [[-a * (1 + slope), a, 0], [1, -1, 1], [0, -b, 0]]
        # In the middle either edge may be next, outside only the one that was passed.
        edge: Side = (lambda q: q[0] - region) if region else (lambda q: 1 - abs(q[0]))  # noqa: B023
        took, x = until(A, [-a * jump, 0, 0], x, edge, 0.01)
        time, region = time + took, 0 if region else round(x[0])
        assert [event.t, *event.x] == approx([time, *x], rel=1e-6, abs=1e-6)


def test_16_6_rectifier_conducts_until_the_current_is_0() -> None:
    omega, lag = 314.0, 0.01
    off = (math.pi - math.atan(omega * lag)) / omega
    on = brentq(
        lambda t: math.sin(omega * off) * math.exp(-(t - off) / lag) - math.sin(omega * t),
        2 * math.pi / omega, 2.5 * math.pi / omega, xtol=1e-16,
    )  # fmt: skip
    events = run("rectifier").events
    assert events.t[:3] == approx([off, on, off + 2 * math.pi / omega], rel=1e-9)


def test_16_6_boost_is_a_product_of_two_exponentials() -> None:
    Vin, L, C, R, T = 5.0, 1e-3, 5e-5, 20.0, 1e-4
    closed = affine([[0, 0], [0, -1 / (R * C)]], [Vin / L, 0], T / 2)
    opened = affine([[0, -1 / L], [1 / C, -1 / (R * C)]], [Vin / L, 0], T / 2)
    period = opened @ closed
    assert run("boost_pwm").x_end[:2] == approx((matrix_power(period, 50) @ [1, 5, 1])[:2], rel=1e-8)


def test_16_6_boost_in_sliding_mode_has_a_square_that_settles_as_an_exponential() -> None:
    solution = run("boost_sliding")
    start = solution.events[0]
    assert start.t == approx(0.8 * 1e-3 / 5, rel=1e-12)
    assert start.x[1] == approx(8 * math.exp(-start.t / 1e-3), rel=1e-10)
    for t in (3e-4, 1e-3, 4e-3):
        square = 100 + (start.x[1] ** 2 - 100) * math.exp(-2 * (t - start.t) / 1e-3)
        assert solution.sol(t) == approx([1, math.sqrt(square)], rel=1e-9)


# -- biology and climate -------------------------------------------------------------------------------


def test_16_6_neuron_fires_with_the_period_of_its_logarithm() -> None:
    fires = run("neuron").events.t
    assert np.diff(fires) == approx(10 * math.log(5), rel=1e-9)


def test_16_6_welander_mixes_and_rests_as_its_exponentials() -> None:
    x, time, k = np.array([0.5, 0.2]), 0.0, 0.0
    for event in run("welander").events:
        A = [[-1 - k, 0], [0, -0.5 - k]]
        took, x = until(A, [1, 0.5], x, lambda q: q[1] - 0.8 * q[0] + 0.01, 0.01)
        time, k = time + took, 5.0 - k
        assert [event.t, *event.x] == approx([time, *x], rel=1e-8)


def test_16_6_stommel_rests_at_a_root() -> None:
    flow = brentq(lambda q: 3 / (1 + q) - 1 / (0.3 + q) - q, 0.3, 2, xtol=1e-15)
    assert run("stommel").x_end == approx([3 / (1 + flow), 1 / (0.3 + flow)], rel=1e-8)


# -- friction ------------------------------------------------------------------------------------------


def test_16_6_clutch_locks_in_closed_form() -> None:
    solution, locks = run("clutch"), 200 / ((120 - 50) / 0.2 + (120 - 20) / 1)
    assert solution.events.t == approx([locks], rel=1e-12)
    speed = 100 * locks + (50 - 20) / 1.2 * (1 - locks)
    assert solution.x_end == approx([speed, speed], rel=1e-11)


def test_16_6_brake_holds_on_the_slope_and_lets_go() -> None:
    solution, stop = run("brake"), (4.5 - math.sqrt(4.5**2 - 15)) / 0.5
    rest = 15 * stop - 2.25 * stop**2 + stop**3 / 12
    assert solution.events.of("wheels").t == approx([stop, 9], rel=1e-10)
    assert solution.x_end == approx([rest + 3**3 / 12 + 2.25 * 2 + 0.75 * 2**2, 5.25], rel=1e-10)


def test_16_6_drill_string_sticks_and_slips_as_two_linear_systems() -> None:
    J1, J2, k, d, c, Ts, Tc = 2000.0, 370.0, 470.0, 20.0, 2000.0, 2000.0, 1000.0
    top = [-k / J1, -(c + d) / J1, d / J1]
    stick = [[0, 1, 0], [*top[:2], 0], [0, 0, 0]]
    slip = [[0, 1, -1], top, [k / J2, d / J2, -d / J2]]
    x, time = np.array([0, 2.0, 0]), 0.0
    for event in run("drill_string").events:
        if event.before == (0,):
            took, x = until(stick, [0, 2 * c / J1, 0], x, lambda q: k * q[0] + d * q[1] - Ts, 0.01)
        else:
            took, x = until(slip, [0, 2 * c / J1, -Tc / J2], x, lambda q: q[2], 0.01)
            x[2] = 0
        time += took
        assert [event.t, *event.x] == approx([time, *x], rel=1e-7, abs=1e-7)


def test_16_6_wiper_sticks_until_the_static_friction_and_slips_as_scipy_says() -> None:
    events = run("wiper").events

    def pull(t: float, x: float, v: float) -> float:
        return 500 * (0.3 * math.sin(4 * t) - x) + 1.2 * math.cos(4 * t) - v

    first = brentq(lambda t: pull(t, 0.0, 0.0) - 5, 0.0, 0.1, xtol=1e-15)
    assert (events[0].t, str(events[0].kind)) == (approx(first, rel=1e-10), "sliding exit")

    def slip(t: float, x: Array) -> list[float]:
        return [x[1], (pull(t, x[0], x[1]) - 2 - 3 / (1 + x[1] / 0.3)) / 0.1]

    def caught(t: float, x: Array) -> float:
        return x[1] if t > first + 1e-3 else 1.0

    caught.terminal = True  # type: ignore[attr-defined]
    free = solve_ivp(slip, (first, 1), [0.0, 0.0], events=caught, method="DOP853", rtol=1e-12, atol=1e-15)
    assert [events[1].t, events[1].x[0]] == approx([free.t[-1], free.y[0, -1]], rel=1e-8)
    held = [abs(pull(e.t, e.x[0], 0.0)) for e in events.of(kind="sliding exit")]
    assert held == approx([5.0] * len(held), rel=1e-9)


def test_16_6_planar_friction_is_a_parabola_then_the_belt() -> None:
    solution, slip, a = run("planar_friction"), math.hypot(1.5, 1), 0.4 * 9.81
    met = solution.events[0]
    assert (met.t, str(met.kind)) == (approx(slip / a, rel=1e-12), "sliding entry")
    # Both components of the slip velocity fall to 0 together, each at its share of mu g.
    ends = [1.5 * slip / (2 * a), 1.0 * slip / (2 * a), 0.0]
    assert [*met.x] == approx(ends, rel=1e-12, abs=1e-12)
    assert [*solution.y[:, -1]] == approx([ends[0], ends[1] + 1.0 - slip / a, 0.0], rel=1e-12, abs=1e-12)


def test_16_6_unit_vector_is_a_turn_and_then_a_straight_line() -> None:
    """z = x + iy, z' = -c z + r exp(i q) with r = rho/a - (rho/a - r0) exp(a t), in closed form."""
    solution, end = run("unit_vector"), 2 * math.log(2)
    turn = np.exp(0.5j)

    def at(t: float) -> complex:
        steady, growing = 4 / (1 + 3j), 2 / (1.5 + 3j)
        part = steady * (np.exp(3j * t) - np.exp(-t)) - growing * (np.exp((0.5 + 3j) * t) - np.exp(-t))
        return complex(np.exp(-t) + turn * part)

    assert solution.events.t == approx([end], rel=1e-12)
    for t in (0.4, 1.0, end, 2.0, 4.0):
        z = at(t) if t <= end else at(end) * math.exp(end - t)
        assert solution.sol(t)[:2] == approx([z.real, z.imag], rel=1e-9)


def test_16_6_violin_tears_loose_at_the_static_friction() -> None:
    w, bow = 2 * math.pi * 440, 0.1
    loose = (0.5 / 1e-3 - 2 * 0.01 * w * bow) / w**2

    def slip(t: float, x: Array) -> list[float]:
        friction = -(0.2 + 0.3 / (1 + (bow - x[1]) / 0.1))
        return [x[1], -0.02 * w * x[1] - w**2 * x[0] - friction / 1e-3]

    def caught(t: float, x: Array) -> float:
        return x[1] - bow if t > 1e-5 else -1.0

    caught.terminal = True  # type: ignore[attr-defined]
    free = solve_ivp(
        slip, (0, 0.01), [loose, bow - 1e-14], events=caught, method="DOP853", rtol=1e-12, atol=1e-16
    )
    events = run("violin").events
    assert events[0].x[0] == approx(loose, rel=1e-10)
    assert events[1].t - events[0].t == approx(free.t[-1], rel=1e-6)
    assert np.diff(events.of(kind="sliding entry").t) == approx(
        free.t[-1] + (loose - free.y[0, -1]) / bow, rel=1e-6
    )


def test_16_6_escapement_turns_where_energy_says() -> None:
    f, kick = 0.05, 0.4
    turns = [event.x[0] for event in run("escapement").events.of("velocity") if event.x[0] > 0]
    expected = [math.sqrt((0.5 - f) ** 2 + kick) - f]
    while len(expected) < len(turns):
        expected.append(math.sqrt((expected[-1] - 3 * f) ** 2 + kick) - f)
    assert turns == approx(expected, rel=1e-9)
    assert expected[-1] == approx(kick / (8 * f) + f, rel=0.1)


# -- control -------------------------------------------------------------------------------------------


def test_16_6_differentiator_shrinks_by_the_closed_ratio() -> None:
    """With w = sqrt|e| and dt = 2 w du an arc is w'' + g w' + 2 a w = 0, from w = 0 to w = 0."""
    z, time, times = 1.0, 0.0, []
    for a in (0.9, 1.3, 0.9, 1.3):
        shrink = math.exp(-math.pi / math.sqrt(8 * a - 1))
        time += z * (1 + shrink) / a
        z *= shrink
        times.append(time)
    solution = run("differentiator")
    assert solution.events.t == approx(times, rel=1e-6)
    assert abs(solution.x_end[1] - (1 + 0.2 * 1.9)) < 0.02


def test_16_6_sliding_observer_has_its_reaching_time_and_its_decay() -> None:
    solution, reached = run("sliding_observer"), (math.sqrt(21) - 3) / 6
    assert solution.events.t == approx([reached], rel=1e-10)
    assert solution.x_end[1] - solution.x_end[3] == approx(
        -6 * reached * math.exp(-2 * (6 - reached)), rel=1e-4, abs=1e-9
    )


def test_16_6_anti_windup_leaves_its_limit_in_closed_form() -> None:
    limited = [[-1, 0], [-4 + 2 * 2, -2]]
    time, x = until(limited, [1.2, 4 + 2 * (1.2 - 2)], [0, 0], lambda q: 2 * (1 - q[0]) + q[1] - 1.2, 0.01)
    solution = run("anti_windup")
    assert solution.events.t == approx([time], rel=1e-9)
    free = affine([[-3, 1], [-4, 0]], [2, 4], 8 - time)
    assert solution.x_end == approx((free @ [*x, 1])[:2], rel=1e-8)


def test_16_6_pll_slips_cycles_of_two_parabolas() -> None:
    q, w, time, ahead = 0.5, 0.0, 0.0, 1
    for event in run("pll").events:
        rate = 4.0 - w - ahead
        edge = math.pi * (math.floor(q / math.pi + 1e-9) + (1 if rate > 0 else 0))
        roots = np.roots([-0.25 * ahead, rate, q - edge])
        ahead_of = [r.real for r in roots if abs(r.imag) < 1e-12 and r.real > 1e-9]
        if not ahead_of:  # the phase turns round before the next half turn
            edge -= math.pi
            ahead_of = [r for r in np.roots([-0.25 * ahead, rate, q - edge]).real if r > 1e-9]
        took = min(ahead_of)
        q, w, time, ahead = edge, w + 0.5 * ahead * took, time + took, -ahead
        assert [event.t, *event.x] == approx([time, q, w], rel=1e-9)
    assert event.kind == "sliding entry"


def test_16_6_quantised_pi_stays_half_a_step_off() -> None:
    solution = run("quantised_pi")
    first = -math.log1p(-0.4 / 1.6)  # before the integral counts, bounded from below by it
    caught = solution.events[-1]
    assert 0 < solution.events[0].t < first
    x, time, q = np.array([0.0, 0.0]), 0.0, 0.8
    for event, edge in zip(solution.events, (0.4, 0.8), strict=True):
        took, x = until([[-1, 1], [0, 0]], [2 * q, q], x, lambda s: s[0] - edge, 0.01)  # noqa: B023
        time, q = time + took, q - 0.4
        assert [event.t, *event.x] == approx([time, *x], rel=1e-9)
    assert caught.kind == "sliding entry"
    assert solution.x_end == approx([0.8, 0.8 - (0.8 - x[1]) * math.exp(-(8 - time) / 2)], rel=1e-9)


def test_16_6_sampled_pid_without_friction_is_a_matrix_power() -> None:
    K, D, I, T = 4.0, 2.5, 2.0, 0.1
    hold = np.eye(5)
    hold[0, 1:3], hold[1, 2] = (T, T**2 / 2), T
    sample = np.eye(5)
    sample[2] = [-K - D / T, 0, 0, D / T, -I * T]
    sample[3], sample[4, 0] = [1, 0, 0, 0, 0], 1
    end = matrix_power(sample @ hold, 100) @ [1, 0, 0, 1, 0]
    assert run("sampled_pid", Fc=0.0).x_end == approx(end, rel=1e-8, abs=1e-9)


def test_16_6_there_are_enough_models_and_each_says_where_it_is_from() -> None:
    assert len(models.names()) >= 45
    assert all(models.get(name).source for name in models.names())


@pytest.mark.parametrize("grip", [60.0, 200.0])
def test_16_6_a_clutch_that_grips_otherwise_locks_otherwise(grip: float) -> None:
    locks = 200 / ((grip - 50) / 0.2 + (grip - 20))
    assert run("clutch", 4.0, grip=grip).events[0].t == approx(locks, rel=1e-12)


# -- friction and relays: what holds at each event --------------------------------------------------------


def test_16_6_pendulum_turns_where_friction_has_taken_the_height() -> None:
    """m g l (cos b - cos a) = M |b - a| between turning points a and b; it rests where it no longer falls."""
    angle, turns = 1.0, []
    while 9.81 * math.sin(abs(angle)) > 0.5:
        ends = sorted((-0.01 * angle, -angle))
        angle = brentq(
            lambda b, a=angle: 9.81 * (math.cos(b) - math.cos(a)) - 0.5 * abs(b - a), *ends, xtol=1e-15
        )
        turns.append(angle)
    solution = run("pendulum")
    assert solution.events.x[:, 0] == approx(turns, abs=1e-9)
    assert solution.x_end == approx([turns[-1], 0], abs=1e-9)


def test_16_6_forced_oscillator_leaves_its_first_stick_where_the_force_does() -> None:
    """It holds x = 1 as long as 1 - cos(0.6 t) < 0.6."""
    assert run("oscillator_forced").events[0].t == approx(math.acos(0.4) / 0.6, rel=1e-10)


def test_16_6_stribeck_belt_lets_go_at_the_static_level() -> None:
    exits = run("belt_stribeck").events.of(kind="sliding exit")
    assert len(exits) > 3
    assert exits.x == approx(np.tile([1.0, 0.2], (len(exits), 1)), abs=1e-9)


def test_16_6_blocks_of_the_chain_let_go_at_the_static_level() -> None:
    solution = run("chain")
    known = solution.system.parameters
    kc, kp, dc, static = (known.resolve({})[known.index(name)] for name in ("kc", "kp", "dc", "Fs"))
    exits = solution.events.of(kind="sliding exit")
    assert len(exits) > 10
    for event in exits:
        x, v, i = event.x[0::2], event.x[1::2], int(event.surface.split()[1]) - 1
        pull = -kp * x[i] + sum(
            kc * (x[j] - x[i]) + dc * (v[j] - v[i]) for j in (i - 1, i + 1) if 0 <= j < x.size
        )
        assert abs(pull) == approx(static, abs=1e-8)


def test_16_6_buck_slides_as_an_exponential_and_with_hysteresis_between_its_ends() -> None:
    solution = run("buck")
    entry = solution.events.of(kind="sliding entry")[-1]
    t = np.linspace(entry.t, 0.002, 7)
    known = 8 + (entry.x[0] - 8) * np.exp(-2000 * (t - entry.t))
    assert solution.sol(t)[0] == approx(known, abs=1e-8)
    switches = run("buck_hysteresis").events
    y, i = switches.x.T
    line = 2000 * (y - 8) + (i - y / 10) / 1e-4
    assert len(switches) > 20
    assert line == approx(500 * (-1.0) ** np.arange(len(switches)), abs=1e-6)


def test_16_6_harvest_ends_where_the_predator_needs_none() -> None:
    """On the threshold C' = C (a e R - m) - q2 C u with u in [0, 1]: u is 0 at R = m/(a e) = 1."""
    leaves = run("threshold_harvest").events.of(kind="sliding exit")
    assert leaves.x[0] == approx([1.0, 0.8], abs=1e-9)
