"""Properties of solutions on random piecewise-linear systems, and the oracle's answer."""

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from linear_oracle import Answer, Linear, NotGenericError, solve_linear
from linear_systems import END, RTOL, SIZES, drawn, run

from filippov import Solution

# The nightly profile takes minutes a test.
pytestmark = pytest.mark.timeout(3600)


@st.composite
def problems(draw: st.DrawFn) -> tuple[Linear, np.ndarray]:
    n, m = draw(st.sampled_from(SIZES))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return drawn(rng, n, m, draw(st.booleans()))


@st.composite
def generic(draw: st.DrawFn) -> tuple[Linear, np.ndarray, Answer]:
    a, x0 = draw(problems())
    try:
        answer = solve_linear(a, x0, END)
    except NotGenericError:
        assume(False)
    return a, x0, answer


@given(generic())
def test_events_and_final_state_agree_with_the_oracle(
    case: tuple[Linear, np.ndarray, Answer],
) -> None:
    """Within 100 rtol of what the motion makes of errors of size 1 (by the oracle)."""
    a, x0, answer = case
    got = run(a, x0)
    assert got.success, got.message
    sets = [e for i, e in enumerate(got.events) if i == 0 or e.group != got.events[i - 1].group]
    assert [e.after for e in sets] == [mode for _, _, mode in answer.events]
    scale = 100 * RTOL * (1 + np.max(np.abs(got.y)))
    times = np.array([time for time, _, _ in answer.events])
    assert np.all(np.abs([e.t for e in sets] - times) <= scale * np.maximum(answer.times, 1.0))
    assert np.all(np.abs(got.x_end - answer.final) <= scale * answer.state)


def same(a: Solution, b: Solution, tolerance: float = 1e-7) -> None:
    """Both solutions describe the same motion."""
    assert a.modes == b.modes
    np.testing.assert_allclose(a.x_end, b.x_end, atol=tolerance * (1 + np.max(np.abs(a.x_end))))
    np.testing.assert_allclose([e.t for e in a.events], [e.t for e in b.events], atol=tolerance)


@given(generic())
def test_order_of_surfaces(case: Any) -> None:
    a, x0, _ = case
    assume(len(a.d) > 1)
    order = tuple(range(len(a.d) - 1, -1, -1))
    one, two = run(a, x0), run(a, x0, order=order)
    assert [mode[::-1] for mode in two.modes] == list(one.modes)
    np.testing.assert_allclose(one.x_end, two.x_end, atol=1e-9 * (1 + np.max(np.abs(one.x_end))))


@given(generic(), st.sampled_from([1e-12, 1e-3, 1e5, 1e12]))
def test_scale_of_surfaces(case: Any, factor: float) -> None:
    a, x0, _ = case
    same(run(a, x0), run(Linear(a.A, a.b, a.B, a.c * factor, a.d * factor), x0))


@given(generic(), st.sampled_from([1e-9, 1e-3, 1e4]), st.sampled_from([1e-6, 1e3]))
def test_scale_of_time_and_of_states(case: Any, tempo: float, size: float) -> None:
    """x(t) -> size x(t/tempo): the same events at tempo times the times."""
    a, x0, _ = case
    scaled = Linear(a.A / tempo, size * a.b / tempo, size * a.B / tempo, a.c, size * a.d)
    one = run(a, x0)
    two = run(scaled, size * x0, (0, tempo * END), atol=1e-13 * size)
    assert one.modes == two.modes
    np.testing.assert_allclose(two.events.t / tempo, one.events.t, atol=1e-8)
    np.testing.assert_allclose(two.x_end / size, one.x_end, atol=1e-8 * (1 + np.max(np.abs(one.x_end))))


@given(generic(), st.floats(-50, 50))
def test_shift_of_time(case: Any, shift: float) -> None:
    a, x0, _ = case
    one, two = run(a, x0), run(a, x0, (shift, shift + END))
    assert one.modes == two.modes
    np.testing.assert_allclose(two.events.t - shift, one.events.t, atol=1e-8)
    np.testing.assert_allclose(two.x_end, one.x_end, atol=1e-8 * (1 + np.max(np.abs(one.x_end))))


@given(generic())
def test_mirror(case: Any) -> None:
    a, x0, _ = case
    one, two = run(a, x0), run(Linear(a.A, -a.b, a.B, a.c, -a.d), -x0)
    flipped = tuple(mode.translate(str.maketrans("+-", "-+")) for mode in two.modes)
    assert flipped == one.modes
    np.testing.assert_allclose(-two.x_end, one.x_end, atol=1e-10 * (1 + np.max(np.abs(one.x_end))))


@given(generic(), st.floats(0.1, 0.9))
def test_split_interval(case: Any, part: float) -> None:
    a, x0, _ = case
    one = run(a, x0)
    middle = part * END
    assume(all(abs(e.t - middle) > 1e-4 for e in one.events))
    first = run(a, x0, (0, middle))
    second = run(a, first.x_end, (middle, END))
    assert len(first.events) + len(second.events) == len(one.events)
    np.testing.assert_allclose(second.x_end, one.x_end, atol=1e-7 * (1 + np.max(np.abs(one.x_end))))


@given(generic())
def test_surface_that_never_fires(case: Any) -> None:
    a, x0, _ = case
    one, two = run(a, x0), run(a, x0, spare=True)
    assert tuple(mode[1:] for mode in two.modes) == one.modes
    np.testing.assert_allclose(two.x_end, one.x_end, atol=1e-9 * (1 + np.max(np.abs(one.x_end))))


@given(problems())
def test_invariants_of_segments(case: tuple[Linear, np.ndarray]) -> None:
    a, x0 = case
    got = run(a, x0)
    assert sum(s.dwell for s in got.segments) == pytest.approx(got.t_end, abs=1e-12)
    assert np.all(np.diff(got.t) > 0)
    assert [s.t1 for s in got.segments[:-1]] == [s.t0 for s in got.segments[1:]]
    for segment in got.segments:
        inside = (got.t >= segment.t0) & (got.t <= segment.t1)
        h = a.c @ got.y[:, inside] - a.d[:, None]
        terms = np.abs(a.c) @ np.abs(got.y[:, inside]) + np.abs(a.d)[:, None]
        for i, value in enumerate(segment.mode):
            if value == 0:
                assert np.all(np.abs(h[i]) <= 8e-16 * terms[i])
                between = np.linspace(segment.t0, segment.t1, 7)[1:-1]
                multiplier = got.multiplier(f"h{i}", between)
                assert np.all(np.abs(multiplier) <= 1 + 1e-6)
            else:
                assert np.all(value * h[i] >= -1e-11 * terms[i])


@given(arrays(float, 2, elements=st.floats(-2, 2)), st.floats(0.1, 3))
def test_there_and_back_without_sliding(x0: np.ndarray, end: float) -> None:
    a = Linear(
        np.array([[0.0, 1], [-1, 0]]), np.zeros(2), np.array([[0.5, 0]]), np.array([[1.0, 0]]), np.zeros(1)
    )
    there = run(a, x0, (0, end))
    assume(there.success and "0" not in there.modes and np.hypot(*x0) > 0.8)
    back = run(a, there.x_end, (end, 0), backward=True)
    assume(back.success)
    np.testing.assert_allclose(back.x_end, x0, atol=1e-8)
