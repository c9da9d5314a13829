"""Backwards in time (E11, B18): directions stay in true time, and the past of a sliding motion is a set."""

import numpy as np
import pytest

from filippov import Status, Surface, System, sign, solve, states, t

X, Y, V = states("x y v")
TIGHT = {"rtol": 1e-12, "atol": 1e-14}
RELAY = System({X: V, V: -X - 0.4 * sign(V)})
# x slides while |y| < 2: y = 1 - (1 - y0) exp(-t).
SLIDE = System({X: Y - 2 * sign(X), Y: 1 - Y})
LEAVE = System({X: Y - sign(X), Y: 1 + 0 * X})


def test_b18_there_and_back_through_crossings() -> None:
    there = solve(RELAY, (3, -0.1), (0, 8), **TIGHT)
    back = solve(RELAY, there.x_end, (8, 0), **TIGHT)
    np.testing.assert_allclose(back.x_end, [3, -0.1], atol=1e-10)
    assert [event.direction for event in back.events] == [event.direction for event in there.events][::-1]
    np.testing.assert_allclose(back.events.t, there.events.t[::-1], atol=1e-9)
    assert [event.after for event in back.events] == [event.before for event in there.events][::-1]


def test_b18_t_eval_and_max_step_backwards() -> None:
    times = np.linspace(8, 0, 9)
    there = solve(RELAY, (3, -0.1), (0, 8), **TIGHT)
    back = solve(RELAY, there.x_end, (8, 0), t_eval=times, max_step=0.05, **TIGHT)
    assert back.t.tolist() == times.tolist()
    np.testing.assert_allclose(back.y, there.sol(times), atol=1e-10)
    assert back.steps >= 160
    dense = solve(RELAY, there.x_end, (8, 0), max_step=0.05, **TIGHT)
    assert np.all(np.diff(dense.t) < 0)
    assert np.max(-np.diff(dense.t)) <= 0.05 * (1 + 1e-12)


def test_b18_sliding_backwards_is_not_unique_and_says_so() -> None:
    run = solve(SLIDE, (0, 0.5), (1, 0))
    assert run.status is Status.NON_UNIQUE
    assert run.t_end == 1
    assert run.ambiguity is not None
    assert run.ambiguity.name == "repelling sliding"
    assert "backwards in time" in run.message


def test_b18_tree_backwards_lists_the_arrivals() -> None:
    """Every path, run forwards again, comes to (0, 1/2) at t = 1 by sliding."""
    tree = solve(SLIDE, (0, 0.5), (1, 0), nonunique="branch", release_times=3, **TIGHT)
    assert tree.success
    assert len(tree.paths()) == 3 + 2 * 3
    for path in tree.paths():
        again = solve(SLIDE, path.x_end, (0, 1), **TIGHT)
        assert again.success
        np.testing.assert_allclose(again.x_end, [0, 0.5], atol=1e-9)
        arrival = [segment.t1 for segment in path.segments if segment.mode == (0,)]
        entries = again.events.of(kind="sliding entry").t
        if arrival and arrival[0] > 0:
            np.testing.assert_allclose(entries, arrival, atol=1e-9)


def test_b18_leaving_point_of_sliding_is_not_passed_silently() -> None:
    """Forwards x slides until y = 1 and leaves along (y - 1)**2/2; backwards the past is a set from there:

    (y - 1)**2/2 above, sliding, or from below with x' = y + 1, so that x(0) is 1/2, 0 or -3/2.
    """
    there = solve(LEAVE, (0, 0), (0, 3), **TIGHT)
    back = solve(LEAVE, there.x_end, (3, 0), **TIGHT)
    assert back.status is Status.NON_UNIQUE, back.message
    assert back.t_end == pytest.approx(1, abs=1e-4)
    assert back.ambiguity is not None
    assert back.ambiguity.name == "visible tangency"
    assert {candidate.mode for candidate in back.candidates} == {(1,), (-1,), (0,)}
    tree = solve(LEAVE, there.x_end, (3, 0), nonunique="branch", **TIGHT)
    assert sorted(path.x_end[0] for path in tree.paths()) == pytest.approx([-1.5, 0, 0.5], abs=1e-6)


def test_b18_repelling_sliding_is_reached_backwards() -> None:
    """x' = sign(x) + y/2, y' = 1: backwards both sides lead onto x = 0, and sliding on it is the one past."""
    system = System({X: sign(X) + 0.5 * Y, Y: 1 + 0 * X})
    run = solve(system, (1, 0.1), (1, -0.5), **TIGHT)
    assert run.success
    assert run.end_mode == (0,)
    left = [run.events[0].t]
    forward = solve(system, run.x_end, (-0.5, 1), nonunique="branch", release_times=left, **TIGHT)
    assert np.min(np.linalg.norm(forward.reachable(1).x - [1, 0.1], axis=1)) < 1e-9


def test_b18_moving_surface_backwards() -> None:
    """x' = 1 meets the ramp x = t**2 at t = 1/2 + sqrt(1/4 - 1/5) and before; directions are in true time."""
    system = System({X: 1 + 0 * X}, surfaces=[Surface("ramp", X - t**2, kind="observer")])
    there = solve(system, (-0.2,), (0, 2), **TIGHT)
    back = solve(system, there.x_end, (2, 0), **TIGHT)
    np.testing.assert_allclose(there.events.t, [0.5 - np.sqrt(0.05), 0.5 + np.sqrt(0.05)], atol=1e-12)
    np.testing.assert_allclose(back.events.t[::-1], there.events.t, atol=1e-12)
    assert [event.direction for event in there.events] == [1, -1]
    assert [event.direction for event in back.events] == [-1, 1]
