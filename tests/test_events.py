"""The event contract, clause by clause, against closed forms."""

import threading
import time
from typing import Any

import numpy as np
import pytest
from sympy import Rational, cos, pi, sin

from filippov import (
    EventKind,
    ModelError,
    Solution,
    Status,
    Surface,
    System,
    UsageError,
    parameters,
    sign,
    solve,
    states,
    t,
)
from filippov.solving.state.events import Stop

x, v = states("x v")
q = parameters(F=0.4, a=0.0)
COULOMB = System({x: v, v: -x - q.F * sign(v)})
CLOCK = System({x: 1}, surfaces=[Surface("s", x - 1, kind="observer")])
SPRING = System({x: v, v: -x}, surfaces=[Surface("x", x, kind="observer"), Surface("v", v, kind="observer")])
FOLD = System.from_modes([Surface("y", v)], {"+": [1, x], "-": [0, 1]}, [x, v])
TIGHT: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-14}


def words(got: Solution) -> list[str]:
    return [f"{event.kind} {event.surface}" for event in got.events]


# E1


def test_e1_mode_after_event_is_the_memory() -> None:
    got = solve(COULOMB, (3, 0), (0, 20), **TIGHT)
    assert got.modes == ("-", "+", "-", "+", "0")
    np.testing.assert_allclose(got.events.t, np.pi * np.arange(1, 5), atol=1e-10)
    np.testing.assert_allclose(got.events.x[:, 0], [-2.2, 1.4, -0.6, -0.2], atol=1e-10)


def test_e1_no_retrigger_from_any_event_state() -> None:
    whole = solve(COULOMB, (3, 0), (0, 9), **TIGHT)
    for event in whole.events:
        again = solve(COULOMB, event.x, (event.t, 9), **TIGHT)
        assert len(again.events) == sum(other.t > event.t for other in whole.events)
        np.testing.assert_allclose(again.x_end, whole.x_end, atol=1e-10)


# E2


def test_e2_all_roots_of_a_step_in_order() -> None:
    system = System(
        {x: 1}, surfaces=[Surface(f"s{k}", t - Rational(k, 7), kind="observer") for k in range(1, 7)]
    )
    got = solve(system, (0,), (0, 1))
    assert [event.surface for event in got.events] == [f"s{k}" for k in range(1, 7)]
    np.testing.assert_allclose(got.events.t, np.arange(1, 7) / 7, atol=1e-14)


def test_e2_fast_guard_within_slow_motion() -> None:
    system = System({x: 1}, surfaces=[Surface("s", sin(40 * x), kind="observer")])
    got = solve(system, (0.01,), (0, 3))
    np.testing.assert_allclose(
        0.01 + got.events.t, np.pi / 40 * np.arange(1, len(got.events) + 1), atol=1e-12
    )
    assert len(got.events) == int(40 * 3.01 / np.pi)


@pytest.mark.parametrize("depth", [1e-2, 1e-6, 1e-9, 1e-11])
def test_e2_close_pairs(depth: float) -> None:
    system = System({x: 2 * (t - 1)}, surfaces=[Surface("s", x, kind="observer")])
    got = solve(system, (1 - depth,), (0, 2), **TIGHT)
    np.testing.assert_allclose(
        got.events.t, [1 - np.sqrt(depth), 1 + np.sqrt(depth)], atol=1e-15 / np.sqrt(depth) + 1e-14
    )


def test_e2_double_root_is_grazing_and_nothing_changes_side() -> None:
    system = System({x: 2 * (t - 1)}, surfaces=[Surface("s", x, kind="observer")])
    got = solve(system, (1,), (0, 2))
    assert [event.kind for event in got.events] == [EventKind.GRAZING]
    assert got.events[0].t == pytest.approx(1, abs=1e-7)
    assert got.modes == ("+",)


# E3


def test_e3_guard_is_at_rounding_level_at_events() -> None:
    circle = System({x: v, v: -x}, surfaces=[Surface("s", x**2 + x * v - Rational(1, 3), kind="observer")])
    got = solve(circle, (1, 0), (0, 20), rtol=1e-6, atol=1e-9)
    values = [abs(e.x[0] ** 2 + e.x[0] * e.x[1] - 1 / 3) for e in got.events]
    assert len(values) > 10
    assert max(values) < 4e-15


def test_e3_guard_is_at_rounding_level_while_sliding() -> None:
    disc = System.from_modes([x**2 + v**2 - 2], {"+": [1, -1], "-": [x, v]}, [x, v])
    got = solve(disc, (-1 / 15, 0.1), (0, 6.4), rtol=1e-6, atol=1e-9)
    inside = got.t > got.events[0].t
    assert np.max(np.abs(np.sum(got.y[:, inside] ** 2, axis=0) - 2)) < 4e-15


def test_e3_stick_position_is_constant_to_the_last_bit() -> None:
    got = solve(COULOMB, (3, 0), (0, 20))
    rest = got.events[-1]
    assert np.all(got.y[0, got.t >= rest.t] == rest.x[0])
    assert np.all(got.y[1, got.t >= rest.t] == 0)


# E4


@pytest.mark.parametrize("stop", [None, Stop("s")])
def test_e4_event_at_the_end_is_reported_once(stop: Stop | None) -> None:
    got = solve(CLOCK, (0,), (0, 1), **({} if stop is None else {"stop": stop}))
    assert list(got.events.t) == [1.0]
    assert got.t[-1] == 1.0
    assert np.all(np.diff(got.t) > 0)


def test_e4_event_at_an_output_time() -> None:
    got = solve(CLOCK, (0,), (0, 2), t_eval=[0, 0.5, 1, 1.5, 2])
    np.testing.assert_allclose(got.events.t, [1], atol=1e-15)
    np.testing.assert_allclose(got.y[0], got.t, atol=1e-14)


def test_e4_split_at_an_event_gives_it_once() -> None:
    one = solve(CLOCK, (0,), (0, 1))
    two = solve(CLOCK, one.x_end, (1, 2))
    assert (len(one.events), len(two.events)) == (1, 0)


def test_e4_start_on_several_surfaces_is_no_event() -> None:
    got = solve(SPRING, (0, 0.0), (0, 1))
    assert len(got.events) == 0
    np.testing.assert_array_equal(got.x_end, [0, 0])


def test_e4_start_tangent_to_a_surface() -> None:
    got = solve(FOLD, (0, 0), (0, 1), **TIGHT)
    assert len(got.events) == 0
    assert got.modes == ("+",)
    np.testing.assert_allclose(got.x_end, [1, 0.5], atol=1e-12)


# E5


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_e5_simultaneous_events_are_one_set(order: tuple[int, int]) -> None:
    surfaces = [Surface("x", x), Surface("v", v)]
    system = System({x: -2 * sign(x), v: -2 * sign(v)}, surfaces=[surfaces[i] for i in order])
    got = solve(system, (1, -1), (0, 1))
    assert sorted(event.surface for event in got.events) == ["v", "x"]
    assert {event.group for event in got.events} == {0}
    np.testing.assert_allclose(got.events.t, 0.5, atol=1e-15)
    assert got.events[0].t == got.events[1].t
    assert got.end_mode == (0, 0)


# E6


def test_e6_exit_where_the_multiplier_reaches_its_bound() -> None:
    system = System({x: t - sign(x)})
    got = solve(system, (0,), (0, 3), **TIGHT)
    assert words(got) == [f"sliding exit {system.surfaces[0].name}"]
    assert got.events[0].t == pytest.approx(1, abs=1e-13)
    assert got.events[0].x[0] == 0
    assert got.x_end[0] == pytest.approx(2, abs=1e-12)


def test_e6_multiplier_that_touches_its_bound_goes_on_sliding() -> None:
    system = System({x: 1 - (t - 1) ** 2 - sign(x)})
    got = solve(system, (0,), (0, 2.2), **TIGHT)
    assert got.end_mode == (0,)
    assert got.x_end[0] == 0


def test_e6_wide_set_breaks_away_with_a_jump() -> None:
    system = System({x: v, v: t - sign(v)}, surfaces=[Surface("v", v, radius=2)])
    got = solve(system, (0, 0), (0, 3), **TIGHT)
    assert got.events[0].t == pytest.approx(2, abs=1e-13)
    assert got.events[0].multiplier == pytest.approx(2, abs=1e-12)
    assert got.x_end[1] == pytest.approx((9 - 4) / 2 - 1, abs=1e-12)


# E7


@pytest.mark.parametrize("factor", [1e-12, 1e-6, 1e6, 1e12])
def test_e7_scale_of_h_changes_nothing(factor: float) -> None:
    plain = solve(COULOMB, (3, 0), (0, 20))
    scaled = System({x: v, v: -x - q.F * sign(v)}, surfaces=[Surface("v", factor * v)])
    got = solve(scaled, (3, 0), (0, 20))
    np.testing.assert_allclose(got.events.t, plain.events.t, rtol=1e-13)
    assert got.modes == plain.modes


@pytest.mark.parametrize("rate", [1e-13, 1e13])
def test_e7_scale_of_time_changes_nothing(rate: float) -> None:
    k = parameters(k=1)
    system = System({x: k.k * v, v: k.k * (-x - Rational(2, 5) * sign(v))})
    got = solve(system, (3, 0), (0, 20 / rate), parameters={"k": rate})
    np.testing.assert_allclose(got.events.t * rate, np.pi * np.arange(1, 5), rtol=1e-8)
    assert got.modes == ("-", "+", "-", "+", "0")


# E8


def test_e8_field_undefined_beyond_its_surface() -> None:
    def field(_: float, y: Any, __: Any, s: Any) -> list[float]:
        return [-1 - np.sqrt(y[0])] if s[0] > 0 else [-2.0]

    with np.errstate(invalid="ignore"):
        got = solve(
            System(field=field, surfaces=[Surface("x", lambda _, y, __: y[0])], states="x"), (1.0,), (0, 3)
        )
    assert got.success, got.message
    reached = 2 * (1 - np.log(2))
    assert got.events.t == pytest.approx([reached], abs=1e-8)
    assert got.x_end[0] == pytest.approx(-2 * (3 - reached), abs=1e-7)
    assert np.all(np.isfinite(got.y))


@pytest.mark.parametrize("beta", [0.1, 0.5, 0.9])
def test_e8_restart_where_the_field_is_not_lipschitz(beta: float) -> None:
    """x' = 1 + |x|**beta - sign(x), which is x' = x**beta for x > 0: a Bernoulli equation."""
    b = parameters(beta=0.5)
    system = System({x: 1 + abs(x) ** b.beta - sign(x)}, surfaces=[Surface("s", x)])
    # x' = x**beta for x > 0, from x0 > 0: x**(1 - beta) = x0**(1 - beta) + (1 - beta) t
    got = solve(system, (1e-3,), (0, 2), parameters={"beta": beta}, **TIGHT)
    wanted = (1e-3 ** (1 - beta) + (1 - beta) * 2) ** (1 / (1 - beta))
    assert got.x_end[0] == pytest.approx(wanted, rel=1e-9)


# E9


@pytest.mark.parametrize(
    ("options", "status"),
    [
        ({"max_steps": 5}, Status.MAX_STEPS),
        ({"max_events": 2}, Status.MAX_EVENTS),
        ({"max_time": 1e-9}, Status.TIMEOUT),
    ],
)
def test_e9_budgets_end_in_a_named_status(options: dict[str, Any], status: Status) -> None:
    system = System({x: v, v: -x}, surfaces=[Surface("x", x, kind="observer")])
    got = solve(system, (1, 0), (0, 1e7), rtol=1e-12, max_step=0.5, **({"max_time": 20} | options))
    assert got.status is status
    assert got.status.advice in got.message
    assert 0 < got.t_end < 1e7
    assert np.all(np.isfinite(got.y))


def test_e9_interrupt_keeps_what_was_computed() -> None:
    calls = 0

    def field(_: float, y: Any, __: Any, ___: Any) -> list[float]:
        nonlocal calls
        calls += 1
        if calls == 400:
            raise KeyboardInterrupt
        return [y[1], -y[0]]

    got = solve(System(field=field, states="x v"), (1.0, 0.0), (0, 1000))
    assert got.status is Status.INTERRUPTED
    assert got.t_end > 1
    np.testing.assert_allclose(got.y[0], np.cos(got.t), atol=1e-6)


def test_e9_blow_up() -> None:
    got = solve(System({x: x**2}), (1,), (0, 2))
    assert got.status in {Status.NOT_FINITE, Status.MIN_STEP}
    assert got.t_end == pytest.approx(1, abs=1e-6)


# E10


def test_e10_clock_surface_in_time() -> None:
    system = System({x: sign(sin(pi * t))})
    got = solve(system, (0,), (0.0, 4.5))
    np.testing.assert_allclose(got.events.t, [1, 2, 3, 4], atol=1e-13)
    assert got.x_end[0] == pytest.approx(0.5, abs=1e-12)


def test_e10_moving_surface() -> None:
    system = System({x: -2 * sign(x - cos(t) / 2)})
    got = solve(system, (0.5,), (0, 10), **TIGHT)
    np.testing.assert_allclose(got.y[0], np.cos(got.t) / 2, atol=1e-13)
    times = np.linspace(0.1, 9.9, 20)
    np.testing.assert_allclose(got.multiplier(system.surfaces[0].name, times), np.sin(times) / 4, atol=1e-12)


# E11


def test_e11_directions_are_in_true_time() -> None:
    forward = solve(SPRING, (1, 0.5), (0, 10), **TIGHT)
    backward = solve(SPRING, forward.x_end, (10, 0), backward=True, **TIGHT)
    np.testing.assert_allclose(backward.x_end, [1, 0.5], atol=1e-11)
    np.testing.assert_allclose(backward.events.t[::-1], forward.events.t, atol=1e-11)
    assert [e.direction for e in backward.events][::-1] == [e.direction for e in forward.events]
    assert [e.surface for e in backward.events][::-1] == [e.surface for e in forward.events]


def test_e11_stop_direction_backwards() -> None:
    got = solve(SPRING, (1, 0), (0, -10), backward=True, stop=Stop("x", "crossing up"), **TIGHT)
    assert got.t_end == pytest.approx(-np.pi / 2, abs=1e-11)
    assert got.events[-1].direction == 1


def test_e11_backward_dense_output() -> None:
    got = solve(COULOMB, (3, -0.5), (0, -8), backward=True, **TIGHT)
    for event in got.events:
        np.testing.assert_allclose(got.sol(event.t), event.x, atol=1e-11)
    times = np.linspace(0, got.t_end, 301)
    centre = np.array([0.4 if got.mode_at(u)[0] < 0 else -0.4 for u in times])
    slope = np.array([(got.sol(u + 1e-5) - got.sol(u - 1e-5)) / 2e-5 for u in times[1:-1]])
    y = got.sol(times)
    near = np.min(np.abs(times[1:-1, None] - got.events.t), axis=1) < 1e-3
    np.testing.assert_allclose(slope[~near, 1], (centre - y[0])[1:-1][~near], atol=1e-6)


def test_e11_backwards_onto_sliding_is_not_unique() -> None:
    system = System({x: -sign(x)})
    got = solve(system, (0,), (0, -1), backward=True)
    assert got.status is Status.NON_UNIQUE
    stuck = solve(system, (0,), (0, -1), backward=True, nonunique="stick")
    assert stuck.success
    assert stuck.x_end[0] == 0


# E12


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_e12_nan_in_a_function_is_named(bad: float) -> None:
    system = System(field=lambda u, y, p, s: [bad if u > 0.5 else 1.0], states="x")
    got = solve(system, (0,), (0, 1))
    assert got.status is Status.NOT_FINITE
    assert got.t_end <= 0.5
    np.testing.assert_allclose(got.y[0], got.t, atol=1e-12)


def test_e12_exception_of_the_user_comes_through_unchanged() -> None:
    error = LookupError("mine")

    def field(u: float, *_: Any) -> list[float]:
        if u > 0.5:
            raise error
        return [1.0]

    with pytest.raises(LookupError) as caught:
        solve(System(field=field, states="x"), (0,), (0, 1))
    assert caught.value is error


def test_e12_exception_in_a_guard_comes_through_unchanged() -> None:
    def guard(u: float, *_: Any) -> float:
        if u > 0.5:
            raise ZeroDivisionError("mine")
        return 1.0

    with pytest.raises(ZeroDivisionError, match="mine"):
        solve(System(field=lambda *_: [1.0], surfaces=[Surface("s", guard)], states="x"), (0,), (0, 1))


def test_plain_functions_and_expressions_agree() -> None:
    plain = System(
        field=lambda _, y, p, s: [y[1], -y[0] - p.F * s[0]],
        surfaces=[Surface("v", lambda _, y, __: y[1])],
        states="x v",
        parameters={"F": 0.4},
    )
    a, b = solve(plain, (3, 0), (0, 20), **TIGHT), solve(COULOMB, (3, 0), (0, 20), **TIGHT)
    np.testing.assert_allclose(a.events.t, b.events.t, atol=1e-12)
    assert a.modes == b.modes
    np.testing.assert_allclose(a.x_end, b.x_end, atol=1e-12)


def test_threads_share_a_system() -> None:
    wanted = solve(COULOMB, (3, 0), (0, 20)).x_end
    got: list[Any] = []
    threads = [
        threading.Thread(target=lambda: got.append(solve(COULOMB, (3, 0), (0, 20)).x_end)) for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(got) == 8
    assert all(np.array_equal(y, wanted) for y in got)


def test_mode_at_and_dwell() -> None:
    got = solve(COULOMB, (3, 0), (0, 20), **TIGHT)
    first = got.events[0].t
    assert (got.mode_at(first, "-"), got.mode_at(first, "+")) == ((-1,), (1,))
    assert sum(segment.dwell for segment in got.segments) == pytest.approx(20, abs=1e-12)
    assert got.dwell_times()["0"] == pytest.approx(20 - 4 * np.pi, abs=1e-9)
    with pytest.raises(UsageError):
        got.mode_at(21)
    with pytest.raises(UsageError):
        got.multiplier("nothing", 1.0)


def test_same_surface_twice_is_refused() -> None:
    with pytest.raises(ModelError, match="same set"):
        System({x: v, v: -sign(v)}, surfaces=[Surface("a", v), Surface("b", 2 * v)])


def test_time_limit_is_not_waited_for() -> None:
    def field(*_: Any) -> list[float]:
        time.sleep(0.002)
        return [1.0]

    system = System(field=field, states="x")
    got = solve(system, (0,), (0, 1e6), max_step=0.01, max_time=0.2)
    assert got.status is Status.TIMEOUT


@pytest.mark.parametrize("method", ["DP5", "DOP853", "Radau"])
@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize(
    ("start", "reached", "modes"), [((-1.5, 0), 1, "-+"), ((0, 0), 1, "0+"), ((0, 1), 0, "+")]
)
def test_visible_fold_met_exactly(
    start: tuple[float, float], reached: int, modes: str, side: int, scale: float, method: str
) -> None:
    """x' = y - sign x, y' = 1 at its fold (0, 1), from below, along sliding, from itself: (t - t1)^2/2."""
    x, y = states("x y")
    q = parameters(T=1.0, side=1.0)
    fold = System({x: (y - sign(x)) / q.T, y: q.side / q.T})
    got = solve(
        fold, (side * start[0], side * start[1]), (0, 3 * scale), method=method,
        parameters={"T": scale, "side": side},
    )  # fmt: skip
    swap = {"+": "+", "-": "-", "0": "0"} if side > 0 else {"+": "-", "-": "+", "0": "0"}
    assert got.success
    assert "".join(got.modes) == "".join(swap[mode] for mode in modes)
    assert [e.t / scale for e in got.events] == pytest.approx([reached] if len(modes) > 1 else [], abs=1e-13)
    exact = [side * (3 - reached) ** 2 / 2, side * (start[1] + 3)]
    assert got.x_end == pytest.approx(np.array(exact), abs=1e-12)


def test_times_are_those_of_the_events() -> None:
    """Asked for before the events themselves, in part after them, and after them."""
    relay = System({x: -sign(x) * (2 + sin(t))}, surfaces=[Surface("x", x, width=0.1)])
    for looked in (0, 1):
        run = solve(relay, (1,), (0, 20))
        if looked:
            assert run.events[0].t > 0
        times = run.events.t
        assert len(times) == len(run.events) > 4
        np.testing.assert_array_equal(times, [event.t for event in run.events])
        np.testing.assert_array_equal(times, run.events.t)
    assert solve(relay, (1,), (0, 1e-3)).events.t.shape == (0,)


@pytest.mark.parametrize("method", ["DOP853", "Taylor", "Radau"])
def test_a_level_is_observed_where_the_state_is_large_beside_its_swing(method: str) -> None:
    """x = offset + swing cos(w t), the swing 20 to 10,000 times the tolerance of x: each crossing an event.

    A level that was crossed once counted as an integral of the motion, and the run ended at a later crossing.
    """
    y, u = states("y u")
    k = parameters(offset=1.0, w=1.0, level=1.0)
    level = Surface("level", y - k.level, kind="observer")
    system = System({y: k.w * u, u: -k.w * (y - k.offset)}, surfaces=[level])
    for seed in range(25):
        rng = np.random.default_rng(seed)
        offset, rtol, w = 10 ** rng.uniform(0, 5), 10 ** rng.uniform(-9, -3), rng.uniform(0.5, 3)
        swing, part = rtol * offset * 10 ** rng.uniform(1.3, 4), rng.uniform(-0.6, 0.6)
        values = {"offset": offset, "w": w, "level": offset + part * swing}
        options: dict[str, Any] = {"method": method, "rtol": rtol, "atol": 1e-3 * rtol}
        run = solve(system, (offset + swing, 0), (0, 30), parameters=values, **options)
        turns = 2 * np.pi * np.arange(15)
        wanted = np.sort(np.concatenate([turns + np.arccos(part), turns + 2 * np.pi - np.arccos(part)])) / w
        assert run.success, run.message
        assert len(run.events) == np.count_nonzero(wanted < 30)
