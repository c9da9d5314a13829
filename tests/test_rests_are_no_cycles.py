"""Coordinates from which a solution rests for ever are sets of rests and no cycles of an event map.

The oracle is an oscillator x'' = -k x - f sign x' + n x' of half turns: from a turning point at the distance
d from the middle the next one is at r (d - s) - s with s = f/k and r = exp(n pi/(2 w)), w**2 = k - n**2/4.
What turns nearer than s rests. For n > 0 there is the one cycle d = s (r + 1)/(r - 1); it repels with r**2.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from filippov import System, parameters, sign, states
from filippov.analysis import EventMap, Section, basin

X, V = states("x v")
AT_LEFT = {"x": "-d", "v": "0"}


Q = parameters(k=1.0, f=0.5, n=0.0, c=0.0)
SYSTEM = System({X: V, V: -Q.k * (X - Q.c) - Q.f * sign(V) + Q.n * V}, parameters=Q)


def _map(k: float, f: float, n: float, kind: str, c: float = 0.0, order: int = 1) -> EventMap:
    """The map of the turning points of an oscillator about x = c."""
    section = Section("v", kind, "-x", AT_LEFT, t_max=60.0)
    return EventMap(SYSTEM, section, parameters={"k": k, "f": f, "n": n, "c": c}, order=order)


def _growth(k: float, n: float) -> float:
    return math.exp(n * math.pi / (2 * math.sqrt(k - n * n / 4)))


def _draw(seed: int) -> tuple[float, float, float]:
    draw = np.random.default_rng(seed)
    exponents = draw.uniform(-1, 1), draw.uniform(-1, 0.5)
    return float(10 ** exponents[0]), float(10 ** exponents[1]), float(draw.uniform(0.08, 0.5))


@pytest.mark.parametrize("seed", range(6))
def test_without_damping_there_is_no_cycle(seed: int) -> None:
    k, f, _ = _draw(seed)
    s = f / k
    found = _map(k, f, 0.0, "crossing up").fixed_points(0, 6.3 * s)
    (one,) = found
    assert (one.kind, one.d, one.period) == ("equilibrium set", 0.0, 0.0)
    assert one.rests == pytest.approx((0.0, s), rel=1e-8)
    assert "at rest" in one.note
    (both,) = _map(k, f, 0.0, "crossing up").fixed_points(-3.1 * s, 4.7 * s, 150)
    assert both.rests == pytest.approx((-s, s), rel=1e-8)
    # A part of the set, and what lies beside it.
    (part,) = _map(k, f, 0.0, "crossing up").fixed_points(0.2 * s, 0.7 * s, 40)
    assert part.rests == pytest.approx((0.2 * s, 0.7 * s))
    assert part.d == pytest.approx(0.2 * s)
    assert not _map(k, f, 0.0, "crossing up").fixed_points(1.1 * s, 6.3 * s, 100)


@pytest.mark.parametrize("seed", range(100, 106))
def test_the_one_cycle_of_negative_damping(seed: int) -> None:
    k, f, share = _draw(seed)
    n, s = share * math.sqrt(k), f / k
    r = _growth(k, n)
    cycle = s * (r + 1) / (r - 1)
    the_map = _map(k, f, n, "crossing up")
    sets, one = the_map.fixed_points(0, 2.3 * cycle)
    assert (sets.kind, one.kind) == ("equilibrium set", "limit cycle")
    assert sets.rests == pytest.approx((0.0, s), rel=1e-8)
    assert one.d == pytest.approx(cycle, rel=1e-9)
    assert one.slope == pytest.approx(r * r, rel=1e-7)
    assert one.period == pytest.approx(2 * math.pi / math.sqrt(k - n * n / 4), rel=1e-9)
    assert one.verdict == "unstable"
    assert one.rests is None
    intervals = the_map.basins(0, 2.3 * cycle)
    assert [q.attractor for q in intervals] == [0.0, None, None]
    assert [q.hi for q in intervals] == pytest.approx([s, cycle, 2.3 * cycle], rel=1e-8)


@pytest.mark.parametrize("seed", range(200, 206))
def test_a_set_that_draws_solutions_in(seed: int) -> None:
    """Every turn is an event where it is an entry into sliding or a crossing to either side."""
    k, f, _ = _draw(seed)
    s, c = f / k, float(np.random.default_rng(seed).uniform(-2, 2)) * f / k
    the_map = _map(k, f, 0.0, "sliding entry", c)
    found = the_map.fixed_points(-c - 1.8 * s, -c + 1.7 * s, 80)
    (one,) = found
    assert (one.kind, one.verdict, one.slope) == ("equilibrium set", "stable", 0.0)
    assert one.rests == pytest.approx((-c - s, -c + s), rel=1e-7, abs=1e-8 * s)
    assert one.d == pytest.approx(0.0 if abs(c) <= s else -c + math.copysign(s, c), rel=1e-7, abs=1e-8 * s)
    intervals = the_map.basins(-c - 1.8 * s, -c + 1.7 * s, 80)
    assert len(intervals) == 3
    assert {q.attractor for q in intervals} == {one.d}


@pytest.mark.parametrize("seed", range(300, 303))
def test_states_that_rest_go_to_the_set_they_lie_in(seed: int) -> None:
    """A set beside 0: what starts at rest belongs to it as what comes to rest does."""
    k, f, _ = _draw(seed)
    s = f / k
    c = 2.5 * s
    section = Section("v", "sliding entry", "x", {"x": "d", "v": "0"}, t_max=60.0)
    at = {"k": k, "f": f, "n": 0.0, "c": c}
    places = c + s * np.array([-0.9, -0.3, 0.5, 0.9])
    found = basin(SYSTEM, section, ("x", places), ("v", [0.0, 0.1 * s * math.sqrt(k)]), (0.5 * s, 5 * s),
                  order=1, points=24, parameters=at)  # fmt: skip
    assert found.attractors == pytest.approx((c - s,), rel=1e-6)
    assert found.label.tolist() == [[0] * 4] * 2


def test_iterates_of_the_map() -> None:
    for order in (2, 3):
        (sets, one) = _map(1.0, 0.5, 0.2, "crossing up", order=order).fixed_points(0, 8)
        assert sets.rests == pytest.approx((0.0, 0.5), rel=1e-8)
        assert (one.kind, one.d) == ("limit cycle", pytest.approx(3.19341159, rel=1e-8))


def test_a_narrow_set_between_two_coordinates_of_the_grid() -> None:
    """No coordinate of the grid rests, and the change of sign of R(d) - d across it is of one that does."""
    the_map = _map(1.0, 1e-3, 0.0, "sliding entry", -0.613)
    (one,) = the_map.fixed_points(0.6, 0.62, 8)
    assert one.kind == "equilibrium set"
    assert one.rests == pytest.approx((0.612, 0.614), rel=1e-7)
