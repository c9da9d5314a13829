"""Backwards in time (E11, B18): directions stay in true time, and the past of a sliding motion is a set."""

import os

import numpy as np
import pytest

from filippov import Status, Surface, System, parameters, sign, solve, states, t

X, Y, V = states("x y v")
TIGHT = {"rtol": 1e-12, "atol": 1e-14}
RELAY = System({X: V, V: -X - 0.4 * sign(V)})
# x slides while |y| < 2: y = 1 - (1 - y0) exp(-t).
SLIDE = System({X: Y - 2 * sign(X), Y: 1 - Y})
LEAVE = System({X: Y - sign(X), Y: 1 + 0 * X})


def test_b18_there_and_back_through_crossings() -> None:
    there = solve(RELAY, (3, -0.1), (0, 8), **TIGHT)
    back = solve(RELAY, there.x_end, (8, 0), backward=True, **TIGHT)
    np.testing.assert_allclose(back.x_end, [3, -0.1], atol=1e-10)
    assert [event.direction for event in back.events] == [event.direction for event in there.events][::-1]
    np.testing.assert_allclose(back.events.t, there.events.t[::-1], atol=1e-9)
    assert [event.after for event in back.events] == [event.before for event in there.events][::-1]


def test_b18_t_eval_and_max_step_backwards() -> None:
    times = np.linspace(8, 0, 9)
    there = solve(RELAY, (3, -0.1), (0, 8), **TIGHT)
    back = solve(RELAY, there.x_end, (8, 0), backward=True, t_eval=times, max_step=0.05, **TIGHT)
    assert back.t.tolist() == times.tolist()
    np.testing.assert_allclose(back.y, there.sol(times), atol=1e-10)
    assert back.steps >= 160
    dense = solve(RELAY, there.x_end, (8, 0), backward=True, max_step=0.05, **TIGHT)
    assert np.all(np.diff(dense.t) < 0)
    assert np.max(-np.diff(dense.t)) <= 0.05 * (1 + 1e-12)


def test_b18_sliding_backwards_is_not_unique_and_says_so() -> None:
    run = solve(SLIDE, (0, 0.5), (1, 0), backward=True)
    assert run.status is Status.NON_UNIQUE
    assert run.t_end == 1
    assert run.ambiguity is not None
    assert run.ambiguity.name == "repelling sliding"
    assert "backwards in time" in run.message


def test_b18_tree_backwards_lists_the_arrivals() -> None:
    """Every path, run forwards again, comes to (0, 1/2) at t = 1 by sliding."""
    tree = solve(SLIDE, (0, 0.5), (1, 0), backward=True, nonunique="branch", release_times=3, **TIGHT)
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
    back = solve(LEAVE, there.x_end, (3, 0), backward=True, **TIGHT)
    assert back.status is Status.NON_UNIQUE, back.message
    assert back.t_end == pytest.approx(1, abs=1e-4)
    assert back.ambiguity is not None
    assert back.ambiguity.name == "visible tangency"
    assert {candidate.mode for candidate in back.candidates} == {(1,), (-1,), (0,)}
    tree = solve(LEAVE, there.x_end, (3, 0), backward=True, nonunique="branch", **TIGHT)
    assert sorted(path.x_end[0] for path in tree.paths()) == pytest.approx([-1.5, 0, 0.5], abs=1e-6)


def test_b18_repelling_sliding_is_reached_backwards() -> None:
    """x' = sign(x) + y/2, y' = 1: backwards both sides lead onto x = 0, and sliding on it is the one past."""
    system = System({X: sign(X) + 0.5 * Y, Y: 1 + 0 * X})
    run = solve(system, (1, 0.1), (1, -0.5), backward=True, **TIGHT)
    assert run.success
    assert run.end_mode == (0,)
    left = [run.events[0].t]
    forward = solve(system, run.x_end, (-0.5, 1), nonunique="branch", release_times=left, **TIGHT)
    assert np.min(np.linalg.norm(forward.reachable(1).x - [1, 0.1], axis=1)) < 1e-9


def test_b18_moving_surface_backwards() -> None:
    """x' = 1 meets the ramp x = t**2 at t = 1/2 + sqrt(1/4 - 1/5) and before; directions are in true time."""
    system = System({X: 1 + 0 * X}, surfaces=[Surface("ramp", X - t**2, kind="observer")])
    there = solve(system, (-0.2,), (0, 2), **TIGHT)
    back = solve(system, there.x_end, (2, 0), backward=True, **TIGHT)
    np.testing.assert_allclose(there.events.t, [0.5 - np.sqrt(0.05), 0.5 + np.sqrt(0.05)], atol=1e-12)
    np.testing.assert_allclose(back.events.t[::-1], there.events.t, atol=1e-12)
    assert [event.direction for event in there.events] == [1, -1]
    assert [event.direction for event in back.events] == [-1, 1]


NAMES = (
    "c", *(f"d{s}{i}" for s in range(2) for i in range(2)),
    *(f"a{s}{i}{j}" for s in range(2) for i in range(2) for j in range(2)),
)  # fmt: skip
P = parameters(**dict.fromkeys(NAMES, 0.1))


def affine(s: int) -> list[object]:
    rows = [getattr(P, f"a{s}{i}0") * (X - P.c) + getattr(P, f"a{s}{i}1") * Y for i in range(2)]
    return [getattr(P, f"d{s}{i}") + row for i, row in enumerate(rows)]


PLANE = System.from_modes(h=[Y], fields={"+": affine(0), "-": affine(1)}, states=[X, Y], parameters=P)


def test_F8_random_slides_that_were_left() -> None:
    """A slide on y = 0 in a plane with affine fields, left; backwards from later the exit is met again."""
    rng = np.random.default_rng(1)
    done = 0
    while done < {"ci": 40, "nightly": 1000}.get(os.environ.get("FILIPPOV_PROFILE", ""), 20):
        values = {name: float(rng.normal()) for name in NAMES}
        values["c"] *= float(rng.choice([0, 1, 10]))
        values["d01"], values["d11"] = -abs(values["d01"]) - 0.05, abs(values["d11"]) + 0.05
        rtol = float(rng.choice([1e-7, 1e-9, 1e-11]))
        options = {"parameters": values, "rtol": rtol, "atol": 1e-3 * rtol}
        there = solve(PLANE, (values["c"], 0), (0, 4), **options)
        left = there.events.of(kind="sliding exit").t
        if not len(left):
            continue
        later = there.events.t[there.events.t > left[0]]
        end = min([4.0, left[0] + rng.uniform(0.1, 1), *(left[0] + 0.6 * (later - left[0]))])
        # Where the motion has parted from its past by more than that, errors have grown as much.
        if end - left[0] < 0.05 or np.max(np.abs(there.sol(end) - there.sol(left[0]))) > 10:
            continue
        done += 1
        back = solve(PLANE, there.sol(end), (end, 0), backward=True, **options)
        assert back.status is Status.NON_UNIQUE, f"{done}: {values}, {back.message}"
        assert back.t_end == pytest.approx(left[0], abs=max(1e-3, 10 * rtol**0.5))
        assert back.ambiguity is not None
        assert back.ambiguity.name == "visible tangency"
        assert len(back.candidates) == 3


def test_b18_a_run_that_ends_where_it_began_has_that_time_alone() -> None:
    for span, times in (((1, 0), [1, 0.5, 0]), ((0, -2), [0, -1]), ((1, 0), [0.5])):
        run = solve(SLIDE, (0, 0.5), span, backward=True, t_eval=times)
        assert run.status is Status.NON_UNIQUE
        assert run.t.tolist() == [span[0]]
        np.testing.assert_array_equal(run.y, [[0], [0.5]])
