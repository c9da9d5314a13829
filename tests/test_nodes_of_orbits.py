"""Orbits by several nodes, some of which the search finds in sliding: each comes back by `solve`.

A node that was in sliding on the way to the orbit, and is not on it, was put onto its surface all the same:
its equations were solved to rounding by what is no solution, with multipliers and verdict.
"""

from __future__ import annotations

import numpy as np
import pytest

from filippov import Surface, System, cos, parameters, sign, solve, states, t
from filippov.analysis import continuation, find_orbit

TIGHT = {"rtol": 1e-12, "atol": 1e-13}


def block(radius: float) -> System:
    """A driven block on a belt, with a cubic spring, whose static friction is `radius` times that of slip."""
    p = parameters(a=1.0, w=1.0, c=0.1, f=0.5, b=0.0, k=0.0)
    x, v = states("x v")
    force = p.a * cos(p.w * t) - x - p.k * x**3 - p.c * v - p.f * sign(v - p.b)
    return System({x: v, v: force}, parameters=p, surfaces=[Surface("belt", v - p.b, radius=radius)])


BLOCKS = {radius: block(radius) for radius in (1.0, 1.3)}


def member(seed: int) -> tuple[System, dict[str, float], np.random.Generator]:
    """A block with random parameters, every other one with more friction at rest."""
    rng = np.random.default_rng(seed)
    values = {"a": rng.uniform(0.3, 2), "w": rng.uniform(0.2, 1.5), "c": rng.uniform(0, 0.3)}
    values |= {"f": rng.uniform(0.2, 1.0), "b": rng.choice([0, rng.uniform(-1, 1)])}
    values |= {"k": rng.choice([0.0, rng.uniform(0, 2)])}
    return BLOCKS[1.3 if seed % 2 else 1.0], {name: float(v) for name, v in values.items()}, rng


@pytest.mark.parametrize(
    "seed", [3, 12, 83, 85, 86, 88, 91, 97, 102, 107, 115, 120, 130, 143, *range(150, 160)]
)
def test_an_orbit_by_several_nodes_comes_back(seed: int) -> None:
    system, values, rng = member(seed)
    period = 2 * np.pi / values["w"]
    guess = rng.normal(size=2) * 2
    orbit = find_orbit(system, guess, period=period, nodes=int(rng.integers(2, 12)), parameters=values)
    span = (orbit.t0, orbit.t0 + period)
    back = solve(system, orbit.x0, span, nonunique="stick", parameters=values, **TIGHT)
    assert np.max(np.abs(back.x_end - orbit.x0)) < 1e-8
    # What is slid on at a node is what the solution slides on there.
    at = orbit.t0
    for share, piece in zip(orbit.problem.shares, orbit.solutions, strict=True):
        assert np.max(np.abs(back.sol(at) - piece.sol(at))) < 1e-7
        at += share * period


def test_a_branch_goes_on_where_a_node_ceases_to_slide() -> None:
    """By friction from 0.05, where the block hardly sticks, to 1.4: nodes begin and cease to slide."""
    system = BLOCKS[1.0]
    values = {"a": 1.6, "w": 0.6, "c": 0.1, "f": 0.4, "b": 0.3, "k": 0.5}
    period = 2 * np.pi / values["w"]
    orbit = find_orbit(system, (1.0, 0.0), period=period, nodes=7, parameters=values)
    branch = continuation(system, orbit, parameter="f", bounds=(0.05, 1.4), max_points=200).run()
    reached = sorted(point.value for point in branch.points)
    assert (reached[0], reached[-1]) == (0.05, 1.4)
    sticks = set()
    for point in branch.points[::2]:
        x, begin = np.array(point.u[:2]), point.phase * period
        x[1] = values["b"] if abs(x[1] - values["b"]) < 1e-7 else x[1]
        span = (begin, begin + period)
        back = solve(system, x, span, parameters={**values, "f": point.value}, nonunique="stick", **TIGHT)
        assert np.max(np.abs(back.x_end - x)) < 1e-6
        sticks.add("stick" in point.word)
    assert True in sticks
