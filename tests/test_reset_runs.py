"""Resets and time events in ensembles, in trees and backwards in time; closed forms."""

import math

import numpy as np
import pytest

from filippov import Surface, System, TimeEvent, parameters, sign, solve, states
from filippov.base.status import Status
from filippov.solving.ensemble import solve_many
from filippov.solving.solution import Solution

X, Y, V, Q = states("x y v q")
E, G = 0.5, 10.0


def ball(**more: object) -> System:
    p = parameters(e=E)
    equations = {Y: V, V: -G, **more.pop("equations", {})}
    return System(equations, surfaces=[Surface("floor", Y, reset={V: -p.e * V}, side="+")])


def fall(height: float, t: float) -> tuple[float, float, int]:
    """Height, velocity and number of impacts of a ball let go at rest."""
    flight, speed, begin, count = math.sqrt(2 * height / G), 0.0, 0.0, 0
    y = height
    while t > begin + flight:
        begin, count = begin + flight, count + 1
        speed = math.sqrt(2 * G * height) * E**count
        flight, y = 2 * speed / G, 0.0
    s = t - begin
    return y + speed * s - G * s**2 / 2, speed - G * s, count


@pytest.mark.parametrize("lanes", [1, 8, None])
def test_resets_in_an_ensemble(lanes: int | None) -> None:
    heights, end = np.linspace(1, 9, 64), 1.2
    got = solve_many(ball(), np.column_stack([heights, 0 * heights]), (0, end), lanes=lanes, rtol=1e-11)
    wanted = np.array([fall(h, end) for h in heights])
    assert set(got.status) == {Status.SUCCESS}
    np.testing.assert_allclose(got.x, wanted[:, :2], atol=1e-8)
    np.testing.assert_array_equal(got.events("floor", "reset"), wanted[:, 2])
    assert len(set(wanted[:, 2])) > 1


@pytest.mark.parametrize("lanes", [1, 8, None])
def test_time_events_in_an_ensemble(lanes: int | None) -> None:
    # y' = q - y with q = 1 in the first quarter of every period.
    clocks = [
        TimeEvent("on", period=1.0, reset={Q: 1}),
        TimeEvent("off", period=1.0, start=0.25, reset={Q: 0}),
    ]
    above = Surface("above", Y - 0.3, kind="observer")
    system = System({Y: Q - Y, Q: 0 * Y}, surfaces=[above], time_events=clocks)
    starts = np.linspace(0, 1, 64)
    got = solve_many(system, np.column_stack([starts, 0 * starts + 1]), (0, 3), lanes=lanes, rtol=1e-11)
    pulse, turn = (1 - math.exp(-0.25)) * math.exp(-0.75), math.exp(-1)
    np.testing.assert_allclose(
        got.x[:, 0], starts * turn**3 + pulse * (1 + turn + turn**2), atol=1e-9
    )
    np.testing.assert_array_equal(got.x[:, 1], 1)  # at t = 3 the clock switches on again


def test_a_tree_goes_on_over_impacts() -> None:
    """x' = 2 sgn x is left at 0, 1/2 or 3/2, or at an impact, while a ball bounces at 1 and 2."""
    system = ball(equations={X: 2 * sign(X)})
    tree = solve(system, (5, 0, 0), (0, 2.2), nonunique="branch", release_times=[0.5, 1.5])
    assert tree.success
    ends = np.array([path.x_end for path in tree.paths()])
    height, speed, count = fall(5, 2.2)
    np.testing.assert_allclose(ends[:, 0], height, atol=1e-9)
    np.testing.assert_allclose(ends[:, 1], speed, atol=1e-8)
    left = {round(2.2 - abs(x) / 2, 6) for x in ends[:, 2]}
    assert {0.0, 0.5, 1.5, 2.2} <= left <= {0.0, 0.5, 1.0, 1.5, 2.0, 2.2}
    for path in tree.paths():
        assert len(path.events.of("floor", "reset")) == count == 2
        np.testing.assert_allclose(path.events.of("floor", "reset").t, [1, 2], atol=1e-9)
    low, high = tree.reachable(2.2).low, tree.reachable(2.2).high
    np.testing.assert_allclose([low[2], high[2]], [-4.4, 4.4], atol=1e-9)


def test_backwards_over_a_reset_is_named(tmp_path) -> None:
    run = solve(ball(), (1, 3), (2, 0), backward=True)
    assert run.status is Status.NON_UNIQUE
    assert run.ambiguity is not None
    assert run.ambiguity.name == "before a reset"
    assert run.ambiguity.candidates == ()
    assert run.ambiguity.t == run.t_end == pytest.approx(2 - (math.sqrt(29) - 3) / G, abs=1e-9)
    again = Solution.load(run.save(tmp_path / "run.npz"))
    assert again.ambiguity == run.ambiguity


def test_a_tree_backwards_ends_at_the_reset() -> None:
    tree = solve(ball(), (1, 3), (2, 0), backward=True, nonunique="branch")
    assert len(tree.paths()) == 1
    assert tree.paths()[0].status is Status.NON_UNIQUE
