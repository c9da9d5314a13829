"""Verdicts where a multiplier is on its border within its own error: "undecided" by name, in fixed points,
orbits, branches and their files; random members with multipliers that are known in closed form."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from filippov import Surface, System, parameters, states
from filippov.analysis.algebra.growth import by_eigenvalues, by_multipliers
from filippov.analysis.bifurcations.branch import Branch
from filippov.analysis.bifurcations.continuation import continuation
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.analysis.orbits.orbit_search import find_orbit

x, y, z = states("x y z")
COARSE = {"step": 0.1, "max_step": 0.4}
# What a growth lies beyond the border, and what can be told of it at tolerances of 1e-10 and less.
BEYOND = [(0.0, "undecided"), (3e-13, "undecided"), (-3e-13, "undecided"), (2e-3, "unstable"),
          (-2e-3, "stable")]  # fmt: skip


def clocked(image: Any, more: Any = None, **values: float) -> System:
    """x (and y) rest between the ticks of z' = 1 and jump at each: x -> image(x), y -> more(x, y)."""
    p = parameters(**values)
    after = {x: image(x, p), z: 0 * z} | ({} if more is None else {y: more(x, y)})
    rows = {x: 0 * x, z: 1 + 0 * z} | ({} if more is None else {y: 0 * y})
    return System(rows, surfaces=[Surface("tick", z - 1, reset=after, side="-")], parameters=p)


def section_map(system: System, order: int = 1) -> EventMap:
    return EventMap(system, Section("tick", "reset", "x", {"x": "d", "z": 0}, t_max=5), order=order)


@pytest.mark.parametrize(("beyond", "wanted"), BEYOND)
@pytest.mark.parametrize("sign", [1, -1])
def test_fixed_points_orbits_and_branches_say_where_a_multiplier_is_1(
    beyond: float, wanted: str, sign: int
) -> None:
    rng = np.random.default_rng(7)
    for _ in range(4):
        at, bend = rng.uniform(-0.5, 0.5), rng.uniform(0.3, 2) * (-1 if beyond < 0 else 1)
        twist = rng.uniform(-0.9, 0.9)

        def image(u: Any, p: Any, at: float = at, bend: float = bend) -> Any:
            return at + p.slope * (u - at) + bend * (u - at) ** 3

        def more(u: Any, v: Any, at: float = at, twist: float = twist) -> Any:
            return twist * v + (u - at)

        # The fixed point is at `at` with the slope as its multiplier; y adds the multiplier `twist` below 1.
        system = clocked(image, slope=sign * (1 + beyond))
        found = section_map(system).fixed_points(at - 0.31, at + 0.33, 40)
        (point,) = (q for q in found if abs(q.d - at) < 2e-4)
        assert point.verdict == wanted
        assert point.stable == (wanted == "stable")
        coupled = clocked(image, more, slope=sign * (1 + beyond))
        orbit = find_orbit(coupled, (at, 0.3, 0.0), period=1.0)
        assert np.allclose(sorted(np.abs(orbit.multipliers)), [abs(twist), 1 + beyond], atol=1e-7)
        assert orbit.verdict == wanted
        begun = clocked(image, slope=0.5)
        run = continuation(begun, (section_map(begun), at), parameter="slope", bounds=(-2, 2), **COARSE)
        assert run.problem.point(run.problem.start, sign * (1 + beyond)).verdict == wanted


@pytest.mark.parametrize("seed", range(6))
def test_equilibria_by_random_eigenvalues(seed: int) -> None:
    rng = np.random.default_rng(seed)
    for _ in range(30):
        n, scale = int(rng.integers(1, 5)), 10.0 ** rng.uniform(-9, 9)
        blocks, growth = [], []
        while len(blocks) < n:
            real = float(rng.choice([-1.0, -1.0, -1e-3, 0.0, 1e-3])) * rng.uniform(0.5, 2)
            growth.append(real)
            if rng.random() < 0.5:
                blocks.append(np.array([[real]]))
            else:
                turn = rng.uniform(0.5, 2)
                blocks.append(np.array([[real, turn], [-turn, real]]))
        size = sum(len(b) for b in blocks)
        matrix, k = np.zeros((size, size)), 0
        for b in blocks:
            matrix[k : k + len(b), k : k + len(b)], k = b, k + len(b)
        basis = np.linalg.qr(rng.normal(size=(size, size)))[0]
        top = max(growth)
        wanted = "unstable" if top > 0 else "undecided" if top == 0 else "stable"
        assert by_eigenvalues(np.linalg.eigvals(scale * basis @ matrix @ basis.T)) == wanted


def test_multipliers_that_are_equal_are_known_to_the_root_of_their_error() -> None:
    block = np.array([[1.0, 1.0], [1e-9, 1.0]])  # 1 +- 3e-5
    values = np.linalg.eigvals(block)
    assert by_multipliers(values, 1e-8) == "undecided"
    assert by_multipliers(values[:1], 1e-8, values[1:]) == "undecided"
    assert by_multipliers([1 + 3e-5, 0.5], 1e-8) == "unstable"
    assert by_multipliers([], 1e-8) == "stable"
    assert by_multipliers([float("nan")], 1e-8) == "undecided"
    assert by_multipliers([1 + 1e-4, 0.5], 1e-8, critical=1) == "undecided"
    assert by_multipliers([1 + 1e-4, 1.5], 1e-8, critical=1) == "unstable"


@pytest.mark.parametrize("other", [0.4, 1.7])
def test_special_points_are_not_judged_by_what_makes_them_special(other: float, tmp_path: Path) -> None:
    # Maps u -> u + a - u^2 (fold at 0), a u - u^3 (branch point at a = 1) and -a u + u^3 (doubling at 1).
    wanted = "undecided" if other < 1 else "unstable"
    for name, at, start, value, image in (
        ("fold", 0.0, 0.7, 0.49, lambda u, p: u + p.a - u**2),
        ("branch point", 1.0, 0.0, 0.7, lambda u, p: p.a * u - u**3),
        ("period doubling", 1.0, 0.0, 0.7, lambda u, p: -p.a * u + u**3 + u**2),
    ):
        system = clocked(image, lambda u, v: other * v + u, a=value)
        orbit = find_orbit(system, (start, 0.3, start / (1 - other)), period=1.0)
        run = continuation(
            system, orbit, parameter="a", bounds=(-0.3, 1.3), direction=1 if at else -1, **COARSE
        )
        branch = run.run()
        point = next(q for q in branch.special if q.special == name)
        assert abs(point.value - at) < 1e-8
        assert point.verdict == wanted
        assert f", {wanted}" in str(point)
        first = branch.points[0]
        assert first.verdict == ("stable" if other < 1 else "unstable")
    path = branch.save(tmp_path / "branch.json")
    assert Branch.load(path).special[0].verdict == wanted
    # A file of before says only whether a point is stable.
    data = json.loads(path.read_text())
    del data["sha256"]
    for row in data["points"]:
        row["stable"] = row.pop("verdict") == "stable"
    path.write_text(json.dumps(data))
    assert {q.verdict for q in Branch.load(path).points} <= {"stable", "unstable"}


def test_equilibria_at_special_points() -> None:
    p = parameters(a=0.7, c=-1.0)
    downwards = {"parameter": "a", "bounds": (-1, 1), "direction": -1, "mode": ""}
    for c, wanted in ((-1.0, "undecided"), (0.5, "unstable")):
        fold = System({x: p.a - x**2, y: p.c * y + x}, parameters=p)
        at = (np.sqrt(0.7), -np.sqrt(0.7) / c)
        branch = continuation(fold, at, parameters={"c": c}, **downwards).run()
        (point,) = branch.special
        assert (point.special, point.verdict) == ("fold", wanted)
        assert abs(point.value) < 1e-9
    spin = System({x: p.a * x - y - x**3, y: x + p.a * y - y**3, z: p.c * z}, parameters=p)
    for c, wanted in ((-1.0, "undecided"), (0.5, "unstable")):
        branch = continuation(spin, (0, 0, 0), parameters={"c": c}, **downwards).run()
        (point,) = branch.special
        assert (point.special, point.verdict) == ("Hopf", wanted)
