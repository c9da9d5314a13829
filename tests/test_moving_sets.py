"""Sets of signs whose ends depend on time or state: where motions come to rest and break away, exactly."""

import math

import numpy as np
import pytest
import sympy as sp

from filippov import Surface, System, solve, states
from filippov.model.symbols import t
from filippov.solving.ensemble import solve_many

METHODS = ("DOP853", "DP5", "Radau")
x, v = states("x v")


def pushed(radius: sp.Expr) -> System:
    """v' = 3/2 - s with s in [-radius, radius] at v = 0: held while radius >= 3/2, then v' = 1/2."""
    return System({x: v, v: 1.5 - sp.sign(v)}, surfaces=[Surface("contact", v, radius=radius)])


BREAK_AWAY = {
    2 - t / 4: 2.0,
    2 - t**2 / 8: 2.0,
    1 + sp.exp(-t): math.log(2.0),
    2 + sp.Rational(9, 10) * sp.cos(2 * t): math.acos(-5 / 9) / 2,
    sp.Rational(3, 2) + sp.cos(t) / 4: math.pi / 2,
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("radius", BREAK_AWAY, ids=str)
def test_a_block_breaks_away_when_static_friction_falls_to_the_load(radius: sp.Expr, method: str) -> None:
    at = BREAK_AWAY[radius]
    solution = solve(pushed(radius), (0, 0), (0, 8), method=method)
    assert [event.kind for event in solution.events] == ["sliding exit"]
    assert solution.events[0].t == pytest.approx(at, abs=1e-12)
    assert solution.x_end == pytest.approx([(8 - at) ** 2 / 4, (8 - at) / 2], rel=1e-9)


@pytest.mark.parametrize("lanes", [1, 8])
def test_so_does_every_block_of_an_ensemble(lanes: int) -> None:
    ends = solve_many(pushed(2 - t / 4), np.zeros((100, 2)), (0, 8), lanes=lanes)
    assert ends.x == pytest.approx(np.tile([9.0, 3.0], (100, 1)), rel=1e-9)
    assert np.all(ends.counts.sum(axis=(1, 2)) == 1)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("first", "slope", "kind"), [(1.2, 1, "sliding entry"), (2, -2, "crossing")])
def test_the_set_at_the_arrival_decides_whether_a_block_sticks(
    first: float, slope: float, kind: str, method: str
) -> None:
    """v' = 5/2 from v = -1: at v = 0 when t = 2/5, where the radius is 1.6 or 1.2 against a load of 1.5."""
    solution = solve(pushed(first + slope * t), (0, -1), (0, 0.45), method=method)
    assert [event.kind for event in solution.events] == [kind]
    assert solution.events[0].t == pytest.approx(0.4, abs=1e-12)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("functions", [False, True])
def test_friction_that_falls_along_the_way_lets_a_carried_block_go(functions: bool, method: str) -> None:
    """x' = v, v' = -x - s on a belt of speed 1, radius 2 - x/4: carried until x = 2 - x/4, x = 8/5."""
    if functions:
        surface = Surface("belt", lambda t, x, p: x[1] - 1, radius=lambda t, x, p: 2 - x[0] / 4, linear=True)
        system = System(field=lambda t, x, p, s: (x[1], -x[0] - s[0]), surfaces=[surface], states="x v")
    else:
        system = System({x: v, v: -x - sp.sign(v - 1)}, surfaces=[Surface("belt", v - 1, radius=2 - x / 4)])
    solution = solve(system, (0, 1), (0, 2), method=method)
    assert [event.kind for event in solution.events] == ["sliding exit"]
    assert solution.events[0].t == pytest.approx(1.6, abs=1e-12)
    # Slips below the belt's speed, with s = -1 there: x - 1 = 0.6 cos + sin of the time since.
    late = 0.4
    expected = [1 + 0.6 * math.cos(late) + math.sin(late), math.cos(late) - 0.6 * math.sin(late)]
    assert solution.x_end == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("method", METHODS)
def test_of_two_coupled_contacts_the_weaker_one_gives_way(method: str) -> None:
    """s1 - s2/5 = 3/2 and s2 = 1/2 hold both: s1 = 1.6, which radius 2 - t/4 reaches at t = 8/5."""
    y, w = states("y w")
    equations = {x: v, v: 1.5 - sp.sign(v) + sp.sign(w) / 5, y: w, w: 0.5 - sp.sign(w)}
    surfaces = [Surface("first", v, radius=2 - t / 4), Surface("second", w)]
    solution = solve(System(equations, surfaces=surfaces), (0, 0, 0, 0), (0, 3), method=method)
    assert [(event.kind, event.surface) for event in solution.events] == [("sliding exit", "first")]
    assert solution.events[0].t == pytest.approx(1.6, abs=1e-12)
    # 1.5 - 1 + 0.1 is left of the load.
    assert solution.x_end == pytest.approx([0.3 * 1.4**2, 0.6 * 1.4, 0, 0], rel=1e-9, abs=1e-14)
