"""Terminal events: counted together where no direction is given, in `solve` and in ensembles."""

import numpy as np
import pytest

from filippov import Surface, System, sign, solve, states
from filippov.base.status import EventKind, Status
from filippov.solving.ensemble import solve_many
from filippov.solving.state.events import Stop

x, y = states("x y")
# x = cos t: crossings of x = 0 at pi/2 + k pi, downwards first.
CIRCLE = System({x: y, y: -x}, surfaces=[Surface("x", x, kind="observer")])
CASES = [
    ("crossing", 1, 0.5), ("crossing", 2, 1.5), ("crossing", 5, 4.5), ("crossing up", 2, 3.5),
    ("crossing down", 2, 2.5),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "count", "turns"), CASES)
def test_the_count_of_crossings_is_that_of_both_directions(kind: str, count: int, turns: float) -> None:
    got = solve(CIRCLE, (1, 0), (0, 100), stop=Stop("x", kind, count))
    assert got.status is Status.STOPPED
    assert got.t_end == pytest.approx(turns * np.pi, abs=1e-7)


@pytest.mark.parametrize("lanes", [1, 8])
@pytest.mark.parametrize(("kind", "count", "turns"), CASES)
def test_the_count_in_ensembles(kind: str, count: int, turns: float, lanes: int) -> None:
    x0 = np.column_stack([np.linspace(1, 2, 16), np.zeros(16)])
    got = solve_many(CIRCLE, x0, (0, 100), stop=Stop("x", kind, count), lanes=lanes, rtol=1e-10)
    assert set(got.status) == {Status.STOPPED}
    np.testing.assert_allclose(got.t, turns * np.pi, rtol=1e-8)


def test_several_stops_on_one_surface_end_at_the_first_that_is_reached() -> None:
    both = (Stop("x", "crossing", 4), Stop("x", "crossing up", 3), Stop("x", "crossing", 3))
    assert solve(CIRCLE, (1, 0), (0, 100), stop=both).t_end == pytest.approx(2.5 * np.pi, abs=1e-7)
    both = (Stop("x", "crossing", 9), Stop("x", "crossing up", 1))
    assert solve(CIRCLE, (1, 0), (0, 100), stop=both).t_end == pytest.approx(1.5 * np.pi, abs=1e-7)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_count_of_exits_is_that_of_both_sides(count: int) -> None:
    # Forced block: stuck while |1.1 sin t| < 1, let go upwards, stopped, let go downwards.
    u, c = states("u c")
    system = System({u: 1.1 * c - sign(u), c: -x, x: c})
    start, span = (0, 0, -1), (0, 40)
    exits = solve(system, start, span).events.of("u", EventKind.EXIT)
    assert {event.direction for event in exits[:2]} == {1, -1}
    got = solve(system, start, span, stop=Stop("u", "sliding exit", count))
    assert got.t_end == pytest.approx(exits[count - 1].t, abs=1e-9)


def test_crossings_decided_by_the_general_path_count() -> None:
    # Two surfaces are met at once at t = 1/2, 3/2, ...: none of these events is simple.
    a, b, c = states("a b c")
    first, second = Surface("first", a, kind="observer"), Surface("second", a + c, kind="observer")
    system = System({a: b, b: -np.pi**2 * a, c: 0}, surfaces=[first, second])
    got = solve(system, (1, 0, 0), (0, 9), stop=Stop("second", "crossing", 3))
    assert got.t_end == pytest.approx(2.5, abs=1e-7)
