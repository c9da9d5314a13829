"""Branches that leave at branch points, period doublings and symmetry breaking, against closed forms."""

from math import sqrt
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command import summary
from scipy.integrate import solve_ivp
from test_bifurcations import COARSE, clock, logistic, map_of, the

from filippov import System, UsageError, parameters, states
from filippov import cos as cosine
from filippov import t as time
from filippov.analysis.bifurcations.continuation import continuation
from filippov.analysis.bifurcations.switch import switch
from filippov.analysis.orbits.orbit_search import find_orbit

x, v = states("x v")


@pytest.mark.parametrize("kind", ["map", "orbit"])
def test_doubled_orbit_of_the_logistic_map(kind: str) -> None:
    # x = (A + 1 +- sqrt((A - 3)(A + 1)))/(2 A), multiplier 4 + 2 A - A^2: -1 at A = 1 + sqrt(6).
    system, at = logistic(), 1 - 1 / 2.6
    start: Any = (map_of(system), at) if kind == "map" else find_orbit(system, (at, 0.3))
    run = continuation(system, start, parameter="a", bounds=(2.6, 3.1), direction=1, **COARSE)
    other = switch(run, the(run, "period doubling"), bounds=(2.9, 3.5), **COARSE)
    branch = other.run()
    assert [point.special for point in branch.special].count("period doubling") == 3
    assert branch.values[0] == branch.values[-1] == 3.5
    assert abs(branch.values.min() - 3) < 1e-9
    for point in branch.points:
        a = point.value
        if a - 3 < 1e-8:
            continue
        pair = [(a + 1 + side * sqrt((a - 3) * (a + 1))) / (2 * a) for side in (1, -1)]
        found = point.coordinates["x"] if kind == "map" else point.coordinates["max x"]
        assert min(abs(found - pair[0]), abs(found - pair[1])) < 1e-9
        if kind == "orbit":
            assert abs(point.coordinates["min x"] - pair[1]) < 1e-9
            assert abs(point.period - 2) < 1e-12
        assert abs(point.multipliers[0] - (4 + 2 * a - a * a)) < 1e-6
    second = branch.special[-1] if branch.special[-1].value > 3.1 else branch.special[0]
    assert abs(second.value - (1 + sqrt(6))) < 1e-8
    if kind == "map":
        fourth = switch(other, second, bounds=(3.4, 3.5), direction=1, **COARSE).run()
        assert fourth.values[-1] == 3.5
        values = map_of(system).remake(parameters={"a": 3.5}).iterate(float(fourth.d[-1]), 4)
        assert abs(values[4] - values[0]) < 1e-9
        assert abs(values[2] - values[0]) > 0.04


@pytest.mark.parametrize(("start", "value"), [(0.2, 0.7), (0.2 + sqrt(0.3), 1.3)], ids=["line", "parabola"])
@pytest.mark.parametrize("kind", ["map", "orbit"])
def test_other_branch_of_a_pitchfork(kind: str, start: float, value: float) -> None:
    # (a - 1) u = u^3 with u = x - 1/5.
    system = clock(lambda u, p: u + (p.a - 1) * (u - 0.2) - (u - 0.2) ** 3, a=value)
    begin: Any = (map_of(system), start) if kind == "map" else find_orbit(system, (start, 0.3), period=1.0)
    way = 1 if value < 1 else -1
    run = continuation(system, begin, parameter="a", bounds=(0.7, 1.3), direction=way, **COARSE)
    branch = switch(run, the(run, "branch point"), **COARSE).run()
    for point in branch.points:
        u = point.coordinates["x" if kind == "map" else "max x"] - 0.2
        assert abs(u) < 1e-8 if value > 1 else abs(point.value - 1 - u * u) < 1e-8
    assert sorted(branch.values[[0, -1]]) == ([1.3, 1.3] if value < 1 else [0.7, 1.3])
    assert [point.special for point in branch.special if point.note] == ["branch point"]


def test_both_branches_of_a_transcritical_point() -> None:
    def F(u: Any, q: float) -> Any:
        return (q - 0.1) * u - u**2

    for start, slope in ((-0.2, 0.0), (0.0, 1.0)):
        run = continuation(F, [start], value=-0.1, bounds=(-0.5, 0.5))
        branch = switch(run, the(run, "branch point")).run()
        assert np.max(np.abs(branch.d - slope * (branch.values - 0.1))) < 1e-9
        assert tuple(branch.values[[0, -1]]) == (-0.5, 0.5)
    up = switch(run, run.branch.special[0], direction=1).run()
    assert np.all(up.values > 0.1 - 1e-9)


def test_pair_without_symmetry_of_an_odd_map() -> None:
    # P = -a d + d^3: from a = 2 a cycle d1 d2 = -1, d1^2 + d2^2 = a.
    system = clock(lambda u, p: -p.a * u + u**3, a=1.5)
    start = (map_of(system, 2), sqrt(0.5))
    run = continuation(system, start, parameter="a", bounds=(1.5, 2.2), direction=1, **COARSE)
    branch = switch(run, the(run, "symmetry breaking"), **COARSE).run()
    assert branch.values[0] == branch.values[-1] == 2.2
    d = branch.d
    assert np.max(np.abs(d**2 + d**-2.0 - branch.values)) < 1e-8
    assert (d[0] - 1) * (d[-1] - 1) < 0
    slope = branch.coordinate("slope")
    assert np.max(np.abs(slope - (3 * d**2 - branch.values) * (3 / d**2 - branch.values))) < 1e-6


def test_pair_without_symmetry_of_a_forced_double_well() -> None:
    # Ueda's equation; both halves are mirror images, and each closes in scipy's hands.
    p = parameters(b=1.0, c=0.3)
    system = System({x: v, v: -p.c * v - x**3 + p.b * cosine(time)}, parameters=p)
    run = continuation(system, find_orbit(system, (0, 0)), parameter="b", bounds=(0.5, 3), direction=1)
    special = next(q for q in run if q.special == "symmetry breaking")
    widths = []
    for side in (1, -1):
        half = switch(run, special, direction=side, max_points=5, step=0.05)
        point, t0 = half.run().points[-1], half.problem.shooting.t0
        motion = solve_ivp(
            lambda s, q, b=point.value: (q[1], -0.3 * q[1] - q[0] ** 3 + b * np.cos(s)), (t0, t0 + 2 * np.pi),
            point.u[:2], method="DOP853", rtol=1e-12, atol=1e-13,
        )  # fmt: skip
        assert np.max(np.abs(motion.y[:, -1] - point.u[:2])) < 1e-8
        widths.append(point.coordinates["max x"] + point.coordinates["min x"])
    assert widths[0] * widths[1] < 0
    assert min(np.abs(widths)) > 1e-2


def test_points_without_another_branch_are_named() -> None:
    run = continuation(lambda u, q: q - u**2, [1.0], value=1.0, bounds=(-1, 2), direction=-1)
    fold = the(run, "fold")
    with pytest.raises(UsageError, match="no other branch leaves at 'fold'"):
        switch(run, fold)
    with pytest.raises(UsageError, match="an ordinary point"):
        switch(run, run.branch.points[0])


def test_command_switches_and_draws_curves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "tick.py"
    model.write_text(
        "from filippov import Surface, System, parameters, states\n"
        "x, z = states('x z')\n"
        "p = parameters(a=2.6, q=0.0)\n"
        "tick = Surface('tick', z - 1, reset={x: (p.a + p.q)*x*(1 - x), z: 0*z}, side='-')\n"
        "system = System({x: 0*x, z: 1 + 0*z}, surfaces=[tick], parameters=p)\n",
        encoding="utf-8",
    )
    words = ["continue", f"{model}:system", "--parameter", "a", "--from", "2.6", "--to", "3.4"]
    words += ["--x0", "x=0.6,z=0.3", "--step", "0.1", "--max-step", "0.4"]
    words += ["--switch", "--curve", "q=0:0.2", "-o", str(tmp_path)]
    data = summary(capsys, *words)
    (other,), (found,) = data["switched"], data["curves"]
    for row in other["points"]:
        assert abs(row["max x"] + row["min x"] - (row["value"] + 1) / row["value"]) < 1e-8
    assert other["points"][0]["value"] == other["points"][-1]["value"] == 3.4
    assert found["kind"] == "period doubling curve"
    assert max(abs(row["a"] + row["value"] - 3) for row in found["points"]) < 1e-8
    names = {"branch.png", "branch-1.json", "branch-1.csv", "curve-1.json", "curve-1.csv", "curves.png"}
    assert names <= {path.name for path in tmp_path.iterdir()}
