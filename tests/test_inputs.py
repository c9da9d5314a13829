"""Numbers, scales and inputs that `solve` must take or refuse: one test a row, named by its id."""

import tracemalloc
import warnings
from typing import Any

import numpy as np
import pytest
from sympy import Rational, sin

from filippov import (
    ModelError,
    SolveError,
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
COULOMB = System({x: v, v: -x - Rational(2, 5) * sign(v)})
GROWTH = System({x: 1 + 0 * x})


def plain(field: Any, guard: Any = None, states_: str = "x v") -> System:
    surfaces = [] if guard is None else [Surface("s", guard)]
    return System(field=field, surfaces=surfaces, states=states_)


def test_b1_nan_at_the_first_call() -> None:
    got = solve(plain(lambda *_: [1.0, np.nan]), (1, 0), (0, 1))
    assert got.status is Status.NOT_FINITE
    assert not got.success
    assert got.t_end == 0
    assert all(text in got.message for text in ("NaN", "dy[1]", "t = 0", "x = 1, v = 0"))
    minus = plain(lambda _, __, ___, s: [1.0, np.nan if s[0] < 0 else 0.0], lambda _, y, __: y[0])
    modal = solve(minus, (-1, 0), (0, 1))
    assert "mode - returned NaN for dy[1]" in modal.message
    with pytest.raises(SolveError) as caught:
        solve(plain(lambda *_: [1.0, np.nan]), (1, 0), (0, 1), throw=True)
    assert caught.value.solution.status is Status.NOT_FINITE


def test_b2_nan_later_keeps_the_part_before() -> None:
    got = solve(plain(lambda u, *_: [1.0, np.nan if u > 0.5 else 0.0]), (0, 0), (0, 1))
    assert got.status is Status.NOT_FINITE
    assert not got.success
    assert got.t_end == pytest.approx(0.5, abs=1e-12)
    assert got.t_end <= 0.5
    assert "dy[1]" in got.message or "v = 0" in got.message
    np.testing.assert_allclose(got.y[0], got.t, atol=1e-12)


def test_b3_blow_up() -> None:
    got = solve(System({x: x**2}), (1,), (0, 2))
    assert got.status is Status.MIN_STEP
    assert not got.success
    assert got.t_end == pytest.approx(1, abs=1e-8)
    before = got.t < 0.9
    np.testing.assert_allclose(got.y[0, before], 1 / (1 - got.t[before]), rtol=1e-7)


@pytest.mark.parametrize(
    "bad",
    [(np.nan, 0), (0, np.inf), (), (1,), (1, 2, 3), [[1, 2]], ("a", "b"), "ab", (1j, 0), None,
     3.0, {"x": 1}, {"x": 1, "w": 2}],
)  # fmt: skip
def test_b4_initial_states_refused(bad: Any) -> None:
    with pytest.raises(UsageError, match=r"x0|state"):
        solve(COULOMB, bad, (0, 1))


@pytest.mark.parametrize("good", [(3, 0), np.array([3, 0]), {"v": 0, "x": 3}, {v: 0, x: 3}])
def test_b4_integers_and_mappings_are_taken(good: Any) -> None:
    got = solve(COULOMB, good, (0, 1))
    assert got.y.dtype == np.float64
    assert got.x_end[0] == pytest.approx(3 * np.cos(1) + 0.4 * (1 - np.cos(1)), abs=1e-8)


@pytest.mark.parametrize("bad", [(0, np.nan), (np.inf, 1), ("0", 1), (0, 1, 2), 3, None, (0, 1j), (True, 2)])
def test_b5_spans_refused(bad: Any) -> None:
    with pytest.raises(UsageError, match="t_span"):
        solve(COULOMB, (3, 0), bad)


def test_b5_equal_times_give_one_point() -> None:
    got = solve(COULOMB, (3, 0), (1, 1))
    assert got.success
    assert got.t.tolist() == [1]
    np.testing.assert_array_equal(got.y[:, 0], [3, 0])
    with_times = solve(COULOMB, (3, 0), (1, 1), t_eval=[1])
    assert with_times.t.tolist() == [1]
    np.testing.assert_array_equal(with_times.y[:, 0], [3, 0])


def test_a_state_given_twice() -> None:
    with pytest.raises(UsageError, match="gives x twice"):
        solve(COULOMB, {x: 1, "x": 2, "v": 0}, (0, 1))
    p = parameters(mu=1)
    with pytest.raises(ModelError, match="given twice"):
        solve(System({x: -p.mu * sign(x)}), (1,), (0, 1), parameters={p.mu: 1, "mu": 2})


@pytest.mark.parametrize("method", ["DOP853", "DP5", "Radau", "Taylor"])
def test_no_absolute_tolerance(method: str) -> None:
    """From v = 0, which has no relative error; it stays at 0.1 from 2 pi on (closed form)."""
    got = solve(System({x: v, v: -x - sign(v) / 5}), (0.9, 0), (0, 9), method=method, atol=0)
    assert got.success, got.message
    np.testing.assert_allclose(got.x_end, [0.1, 0], atol=1e-6)


def test_b5_denormal_length() -> None:
    got = solve(COULOMB, (3, 0), (0, 5e-324))
    assert got.success
    np.testing.assert_allclose(got.x_end, [3, 0], atol=1e-300)


@pytest.mark.parametrize(
    "bad",
    [{"rtol": np.nan}, {"rtol": -1}, {"rtol": 0}, {"rtol": 1e-20}, {"rtol": "small"}, {"rtol": (1e-9, 1e-9)},
     {"atol": np.nan}, {"atol": -1}, {"atol": (1e-9, 1e-9, 1e-9)}, {"atol": "x"}, {"atol": 1j}],
)  # fmt: skip
def test_b6_tolerances_refused(bad: dict[str, Any]) -> None:
    with pytest.raises(UsageError, match=next(iter(bad))):
        solve(COULOMB, (3, 0), (0, 1), **bad)


@pytest.mark.parametrize("name", ["first_step", "max_step"])
@pytest.mark.parametrize("bad", [np.nan, 0, -1, "1", True, 1.5])
def test_b7_steps_refused(name: str, bad: Any) -> None:
    with pytest.raises(UsageError, match=name):
        solve(COULOMB, (3, 0), (0, 1), **{name: bad})


@pytest.mark.parametrize(
    ("value", "text"),
    [(None, "None"), ([1.0], "shape"), ([[1.0, 2.0]], "shape"), ([1.0, [2.0]], "returned"),
     ("ab", "returned"),
     (np.ma.masked_array([1.0, 2.0], [True, False]), "masked"), (np.array([1, "x"], dtype=object), "object")],
)  # fmt: skip
def test_b8_wrong_results_name_the_field(value: Any, text: str) -> None:
    with pytest.raises(ModelError, match=f"field.*{text}"):
        solve(plain(lambda *_: value), (1, 0), (0, 1))


@pytest.mark.parametrize("kind", [np.float32, np.int64, np.float16, object, list])
def test_b8_other_types_are_widened(kind: Any) -> None:
    value = [1, 2] if kind is list else np.array([1, 2], dtype=kind)
    got = solve(plain(lambda *_: value), (0, 0), (0, 1))
    np.testing.assert_allclose(got.x_end, [1, 2], atol=1e-13)


def test_b9_writing_into_the_state_is_refused() -> None:
    def field(_: float, y: Any, __: Any, ___: Any) -> Any:
        y[0] = 7
        return y

    with pytest.raises(ModelError, match=r"field.*read-only"):
        solve(plain(field), (1, 0), (0, 1))

    def guard(_: float, y: Any, __: Any) -> float:
        y[0] = 7
        return 1.0

    with pytest.raises(ModelError, match=r"'s'.*read-only"):
        solve(plain(lambda *_: [1.0, 0.0], guard), (1, 0), (0, 1))


def test_b9_same_buffer_every_time() -> None:
    out = np.empty(2)

    def field(_: float, y: Any, __: Any, ___: Any) -> Any:
        out[:] = y[1], -y[0]
        return out

    got = solve(plain(field), (1, 0), (0, 3))
    np.testing.assert_allclose(got.x_end, [np.cos(3), -np.sin(3)], atol=1e-8)


def test_b10_complex_field() -> None:
    with pytest.raises(ModelError, match="complex"):
        solve(plain(lambda *_: [1j, 0]), (1, 0), (0, 1))


@pytest.mark.parametrize("value", [None, [1.0], np.ones(2), "a", 1j])
def test_b11_wrong_guards(value: Any) -> None:
    with pytest.raises(ModelError, match="'s'"):
        solve(plain(lambda *_: [1.0, 0.0], lambda *_: value), (1, 0), (0, 1))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_b11_guard_that_is_not_finite(value: float) -> None:
    system = plain(lambda *_: [1.0, 0.0], lambda _, y, __: value if y[0] > 1.5 else 1.0)
    got = solve(system, (1, 0), (0, 1))
    assert got.status is Status.NOT_FINITE
    # Differences of h reach 1 part in 250 ahead.
    assert 0.49 < got.t_end <= 0.5
    assert "'s'" in got.message
    at_start = solve(system, (2, 0), (0, 1))
    assert at_start.status is Status.NOT_FINITE
    assert "'s'" in at_start.message


@pytest.mark.parametrize(
    "bad",
    [("v", "crosing"), ("v", None), ("v", "crossing", 0),
     ("v", "crossing", -1), ("v", "crossing", "no"),
     ("v", "crossing", True)],
)  # fmt: skip
def test_b12_stops_refused(bad: tuple[Any, ...]) -> None:
    with pytest.raises(UsageError, match=r"kind|count"):
        Stop(*bad)
    with pytest.raises(UsageError):
        solve(COULOMB, (3, 0), (0, 1), stop="v")


@pytest.mark.parametrize("rtol", [1e-5, 1e-9, 1e-12])
@pytest.mark.parametrize("scale", [1e-13, 1.0, 1e13])
def test_b13_scales_of_time(scale: float, rtol: float) -> None:
    k = parameters(k=1)
    system = System({x: k.k * v, v: -k.k * x}, surfaces=[Surface("x", x, kind="observer")])
    got = solve(system, (1, 0), (0, 20 * scale), parameters={"k": 1 / scale}, rtol=rtol, atol=rtol)
    np.testing.assert_allclose(got.events.t / scale, np.pi * (np.arange(6) + 0.5), rtol=10 * rtol)


@pytest.mark.parametrize(("t0", "length"), [(1e9, 10.0), (1e9, 1e-6)])
def test_b14_large_times(t0: float, length: float) -> None:
    system = System({x: v, v: -x}, surfaces=[Surface("x", x, kind="observer")])
    got = solve(system, (1, 0), (t0, t0 + length))
    assert got.success, got.message
    elapsed = (t0 + length) - t0
    np.testing.assert_allclose(got.x_end, [np.cos(elapsed), -np.sin(elapsed)], atol=1e-6)
    wanted = np.pi * (np.arange(3) + 0.5)
    np.testing.assert_allclose(got.events.t - t0, wanted[wanted < length], atol=1e-6)


@pytest.mark.parametrize(("t0", "length", "dt"), [(1e9, 1e-4, 1e-6), (1e9, 1.0, 1e-3), (1e12, 0.1, 1e-2)])
def test_b14_steps_of_a_few_roundings_of_time(t0: float, length: float, dt: float) -> None:
    """What is added to the state is what is added to the time, though t0 + dt is rounded."""
    got = solve(System({x: v, v: -x}), (1, 0), (t0, t0 + length), max_step=dt)
    assert got.success, got.message
    elapsed = (t0 + length) - t0
    np.testing.assert_allclose(got.x_end, [np.cos(elapsed), -np.sin(elapsed)], atol=1e-12)


def test_b14_time_that_cannot_advance() -> None:
    fast = System({x: 1e6 * v, v: -1e6 * x})
    got = solve(fast, (1, 0), (1e15, 1e15 + 10))
    assert got.status is Status.MIN_STEP
    assert "shift the origin of time" in got.message


def test_b15_states_of_unlike_size() -> None:
    system = System(
        {x: -x, v: -2 * v}, surfaces=[Surface("s", x - Rational(1, 2) * Rational(10) ** -12, kind="observer")]
    )
    got = solve(system, (1e-12, 1e12), (0, 2), rtol=1e-10, atol=(1e-24, 1.0))
    assert got.events.t == pytest.approx([np.log(2)], abs=1e-8)
    np.testing.assert_allclose(got.x_end, [1e-12 * np.exp(-2), 1e12 * np.exp(-4)], rtol=1e-8)


@pytest.mark.parametrize("factor", [1e-12, 1e12])
def test_b16_scale_of_a_plain_guard(factor: float) -> None:
    def field(_: float, y: Any, __: Any, s: Any) -> list[float]:
        return [y[1], -y[0] - 0.4 * s[0]]

    one = solve(plain(field, lambda _, y, __: y[1]), (3, 0), (0, 20))
    two = solve(plain(field, lambda _, y, __: factor * y[1]), (3, 0), (0, 20))
    assert one.modes == two.modes
    np.testing.assert_allclose(two.events.t, one.events.t, rtol=1e-12)


def test_b17_single_precision_input() -> None:
    got = solve(COULOMB, np.array([3, 0], dtype=np.float32), (np.float32(0), np.float32(1)))
    assert got.y.dtype == np.float64
    assert got.x_end[0] == pytest.approx(3 * np.cos(1) + 0.4 * (1 - np.cos(1)), abs=1e-8)


def test_b18_there_and_back() -> None:
    there = solve(COULOMB, (3, -0.1), (0, 8), rtol=1e-12, atol=1e-14)
    back = solve(COULOMB, there.x_end, (8, 0), backward=True, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(back.x_end, [3, -0.1], atol=1e-10)
    assert [e.direction for e in back.events][::-1] == [e.direction for e in there.events]
    resting = solve(COULOMB, (0.1, 0), (8, 0), backward=True)
    assert resting.status is Status.NON_UNIQUE


@pytest.mark.parametrize("phase", np.linspace(0.0, 6.0, 7))
def test_b20_fast_but_smooth_is_no_stagnation(phase: float) -> None:
    # x'' = -w^2 x with w = 1e9 in mixed units: each phase of the turn, next to x = 0 also.
    fast = System({x: v, v: -1e18 * x})
    start = (np.cos(phase), -1e9 * np.sin(phase))
    got = solve(fast, start, (0, 6), max_steps=30_000)
    assert got.status is Status.MAX_STEPS, got.message


def test_b20_stagnation_is_named() -> None:
    chattering = plain(lambda _, y, __, ___: [-1.0 if y[0] > 0 else 1.0, 0.0])
    got = solve(chattering, (1, 0), (0, 3))
    assert got.status is Status.MIN_STEP
    assert got.t_end == pytest.approx(1, abs=1e-5)
    assert got.steps + got.rejected < 20_000
    assert all(text in got.message for text in ("state x = ", "dx/dt jumps from", "surface not declared"))
    # Towards t = 0, where every step is a fraction of the last forever.
    singular = solve(System({x: -1 / t}), (0,), (-1, 1))
    assert singular.status is Status.MIN_STEP
    assert -1e-6 < singular.t_end <= 0


@pytest.mark.parametrize("method", ["DP5", "DOP853", "Radau"])
@pytest.mark.parametrize("power", [1, 2])
def test_b20_stagnation_towards_a_pole_in_t(method: str, power: int) -> None:
    """x' = t^-power ends before its pole, with the surface there named and never met."""
    pole = System({x: t**-power}, surfaces=[Surface("clock", t, kind="observer")])
    got = solve(pole, (0,), (-1, 1), method=method, max_steps=30_000)
    assert got.status is Status.MIN_STEP
    assert -1e-90 < got.t_end < 0
    assert not got.events
    assert "'clock'" in got.message
    assert "state x = " in got.message
    exact = np.log(-got.t_end) if power == 1 else -1 / got.t_end - 1
    assert got.x_end[0] == pytest.approx(exact, rel=1e-6)


def test_b20_jump_without_a_surface_is_named_by_the_implicit_method() -> None:
    chattering = plain(lambda _, y, __, ___: [-1.0 if y[0] > 0 else 1.0, 0.0])
    got = solve(chattering, (1, 0), (0, 3), method="Radau")
    assert got.status is Status.MIN_STEP
    assert got.t_end == pytest.approx(1, abs=1e-9)
    assert got.steps + got.rejected < 20_000
    assert all(text in got.message for text in ("state x = ", "dx/dt jumps from", "surface not declared"))


def test_b21_many_events_end_in_a_named_status() -> None:
    system = System({x: v, v: -x}, surfaces=[Surface("x", x, kind="observer")])
    got = solve(system, (1, 0), (0, 1e6), max_events=500, dense_output=False, rtol=1e-6)
    assert got.status is Status.MAX_EVENTS
    assert len(got.events) >= 500


def test_b21_counted_events_take_no_memory() -> None:
    q = parameters(w=1)
    system = System({x: 1}, surfaces=[Surface("clock", sin(q.w * t), kind="observer")])
    peak = {}
    for number in (500, 5_000):
        span = (0.5, number * np.pi + 0.5)
        tracemalloc.start()
        got = solve(system, (0,), span, save_events="count", max_events=2_000_000, rtol=1e-6, max_step=50)
        peak[number] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert got.success, got.message
        assert got.event_counts == {"clock": {"crossing": number}}
        assert len(got.events) <= 400
    assert peak[5_000] < 1.5 * peak[500] + 100_000
    with pytest.raises(UsageError, match="save_events"):
        _ = got.segments
    span = (0.5, 1_000_000 * np.pi + 0.5)
    million = solve(
        system, (0,), span, save_events="count", max_events=2_000_000, rtol=1e-6, max_step=50, method="DP5"
    )
    assert million.event_counts == {"clock": {"crossing": 1_000_000}}
    assert max(len(million.events), len(million.t)) <= 400
    assert million.events[-1].t == pytest.approx(1_000_000 * np.pi, rel=1e-12)
    capped = solve(system, (0,), (0.5, 1e6), save_events="count", max_events=1_000)
    assert capped.status is Status.MAX_EVENTS
    with pytest.raises(UsageError, match="save_events"):
        solve(system, (0,), (0.5, 1), save_events="some")


def test_b22_nothing_is_extrapolated() -> None:
    got = solve(COULOMB, (3, 0), (0, 5))
    for bad in (-1e-9, 5.0000001, np.nan, np.inf, [0.0, 6.0]):
        with pytest.raises(UsageError, match="outside"):
            got.sol(bad)
    with pytest.raises(UsageError, match="side"):
        got.sol(1.0, side="left")
    event = got.events[0]
    for side in ("-", "+"):
        np.testing.assert_allclose(got.sol(event.t, side=side), event.x, atol=1e-12)


@pytest.mark.parametrize("bad", [[2, 1], [0, 0], [0, 1, 1], [-1, 1], [1, 6], [[1, 2]], ["a"], [np.nan]])
def test_b23_output_times_refused(bad: Any) -> None:
    with pytest.raises(UsageError, match="t_eval"):
        solve(COULOMB, (3, 0), (0, 5), t_eval=bad)


def test_b23_output_times_of_a_run_that_ends_early() -> None:
    got = solve(COULOMB, (3, 0), (0, 20), t_eval=np.arange(21.0), stop=Stop("v", "crossing"))
    # What could be reached, and the point of the event.
    assert got.t.tolist() == [0, 1, 2, 3, got.t_end]
    assert got.y.shape == (2, 5)
    assert got.t_end == pytest.approx(np.pi, abs=1e-8)
    np.testing.assert_allclose(got.y[:, -1], got.x_end, atol=1e-11)
    backward = solve(COULOMB, (3, -0.1), (0, -2), backward=True, t_eval=[0, -1, -2])
    assert backward.t.tolist() == [0, -1, -2]


@pytest.mark.parametrize("end", [20.0, -9.0, np.pi])
def test_b24_times_are_strictly_monotone(end: float) -> None:
    got = solve(COULOMB, (3, -0.01), (0, end), backward=end < 0)
    assert np.all(np.diff(got.t) * np.sign(end) > 0)
    assert got.t[0] == 0
    assert got.t[-1] == end


def test_unknown_option() -> None:
    with pytest.raises(UsageError, match=r"rtoll.*rtol"):
        solve(COULOMB, (3, 0), (0, 1), rtoll=1e-3)


def test_no_warning_escapes() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        solve(System({x: x**2 * t}), (1,), (0, 2))
    assert solve(GROWTH, (0,), (0, 1)).x_end[0] == pytest.approx(1)
