"""Equilibria behind a stop, and what rests on one that is passed, against solutions."""

from __future__ import annotations

import numpy as np
import pytest
from sympy import Rational

from filippov import Surface, System, TimeEvent, parameters, solve, states
from filippov.analysis.local_stability.stability import stability_report
from filippov.analysis.steady.equilibria import equilibria

x, v, w = states("x v w")


def tenths(draw: np.random.Generator, low: int, high: int) -> Rational:
    return Rational(int(draw.integers(low, high + 1)), 10)


@pytest.mark.parametrize("seed", range(20))
def test_12_4_solutions_pass_to_an_equilibrium_unless_it_lies_behind_a_stop(seed: int) -> None:
    """x'' = -k (x - c) - d x' with a wall at w that is reached from one side: v+ = -e v, or x is set back."""
    draw = np.random.default_rng([4, seed])
    k, d, at = tenths(draw, 5, 30), tenths(draw, 2, 10), tenths(draw, -5, 5)
    side = int(draw.choice([-1, 1]))
    centre = at + side * tenths(draw, -8, 8)
    kind = seed % 3
    e = tenths(draw, 0, 9) if kind == 0 else -tenths(draw, 1, 9)
    after = {x: at + side * tenths(draw, 1, 5)} if kind == 2 else {v: -e * v}
    wall = Surface("wall", x - at, side="+" if side > 0 else "-", reset=after)
    system = System({x: v, v: -k * (x - centre) - d * v}, surfaces=[wall])
    beyond = side * (centre - at) < 0
    found = [p for p in equilibria(system).points if p.mode != "0" and abs(p.value[0] - float(centre)) < 1e-9]
    assert len(found) == 1
    stops = kind != 1
    assert found[0].behind == (("wall",) if beyond and stops else ())
    for _ in range(3):
        start = [float(at) + side * draw.uniform(0.1, 2), draw.uniform(-3, 3)]
        run = solve(system, start, (0, 20), zeno="continue", max_events=300)
        lowest = np.min(side * (run.y[0] - float(at)))
        assert lowest > -1e-9 if stops else (lowest < 0 or not beyond)


@pytest.mark.parametrize("e", [-0.9, -0.4, -0.1, 0.0, 0.3, 0.9])
@pytest.mark.parametrize("spring", [0, 1, -1])
def test_12_4_what_an_impact_passes_is_not_rested_on_for_long(e: float, spring: int) -> None:
    """v+ = -e v with e < 0 goes on in its direction, and beyond the floor the weight leads away."""
    q = Rational(str(e))
    field = {x: v, v: -1 - spring * x / 4 - v / 10}
    system = System(field, surfaces=[Surface("floor", x, reset={v: -q * v})])
    found = [item for item in stability_report(system).items if item.equilibrium.mode == "0"]
    assert [item.answer for item in found] == ["unstable" if e < 0 else "asymptotically stable"]
    run = solve(system, [1e-3, 0], (0, 1), zeno="continue")
    assert bool(abs(run.x_end[0]) > 0.05) == (e < 0)


def test_12_4_what_another_reset_may_move_across_has_no_stop() -> None:
    p = parameters(e=0.5)
    floor = Surface("floor", x, reset={v: -p.e * v})
    field = {x: v, v: -x - 1 - v}
    report = stability_report(System(field, surfaces=[floor], parameters=p))
    (item,) = (i for i in report.items if i.equilibrium.mode == "-")
    assert item.equilibrium.behind == ("floor",)
    assert "behind floor: asymptotically stable" in report.to_text()
    assert report.to_dict()["equilibria"][0]["behind"] == ["floor"]
    passing = stability_report(System(field, surfaces=[floor], parameters=p), parameters={"e": -0.5})
    assert all(not i.equilibrium.behind for i in passing.items)
    kick = TimeEvent("kick", period=1, reset={x: x / 2})
    door = Surface("door", v - 3, reset={x: -2 + 0 * x})
    for more in ({"time_events": [kick]}, {"surfaces": [floor, door]}):
        given = {"surfaces": [floor], "parameters": p, **more}
        assert all(not e.behind for e in equilibria(System(field, **given)))
