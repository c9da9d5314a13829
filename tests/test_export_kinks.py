"""Exported automata beside kinks of the field: passed, started on, come to rest on, and left again."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from exported import load
from sympy import Max

from filippov import Surface, System, TimeEvent, export_system, sign, sin, solve, states, t

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
x, v, u, w = states("x v u w")
Start = tuple[float, ...]


def passing(rng: np.random.Generator) -> tuple[System, Start]:
    """A body with friction, drag and kinked springs that passes its kinks and comes to rest."""
    c, k, force = rng.uniform(0.05, 0.6), rng.uniform(0.5, 2), rng.uniform(0.1, 0.4)
    drag = [c * v * abs(v), c * Max(v, 0), c * v][rng.integers(3)]
    spring = [k * x * abs(x), k * Max(x, 0) + 0.3 * x, k * x + 0.2 * abs(x)][rng.integers(3)]
    return System({x: v, v: -spring - drag - force * sign(v)}), (rng.uniform(-2, 2), rng.uniform(-1, 1))


def at_rest(rng: np.random.Generator) -> tuple[System, Start]:
    """The kinks of a spring or a drag are where the state begins and stays."""
    c, k = rng.uniform(0.1, 1, 2).tolist()
    chosen = rng.integers(3)
    if chosen == 0:
        return System({x: v, v: -k * x - c * v * abs(v)}), (0.0, 0.0)
    if chosen == 1:
        return System({x: v, v: -k * x * abs(x) - c * sign(v)}), (0.0, 0.0)
    return System({x: v, v: -k * x - c * v, w: -c * w * abs(w)}), (rng.uniform(0.5, 1), 0.2, 0.0)


def stuck(rng: np.random.Generator) -> tuple[System, Start]:
    """Friction holds a body on the kink of its spring until the force has grown."""
    c, k, force = rng.uniform(0.1, 0.3), rng.uniform(0.5, 2), rng.choice([-1, 1]) * rng.uniform(0.4, 0.8)
    return System({x: v, v: -k * x * abs(x) - c * sign(v) + force * sin(t)}), (0.0, 0.0)


def switched(rng: np.random.Generator) -> tuple[System, Start]:
    """A clock turns on the force on a body that rests in its drag, to one side or the other."""
    force = rng.choice([-1, 1]) * rng.uniform(0.3, 1)
    clock = TimeEvent("go", period=2.0, start=rng.uniform(0.3, 1), reset={u: force - u})
    return System({v: u - rng.uniform(0.2, 1) * v * abs(v), u: 0}, time_events=[clock]), (0.0, 0.0)


def dropped(rng: np.random.Generator) -> tuple[System, Start]:
    """A body with drag falls on a floor, rests there with v = 0 on the kink of the drag, and is lifted."""
    c, lift = rng.uniform(0.1, 0.5), rng.uniform(2.5, 3.5)
    pull = [lift * t, lift * t * sin(3 * t), lift][rng.integers(3)]
    floor = Surface("floor", x, reset={v: 0 * v})
    fall = -9.81 - c * v * abs(v) + pull
    return System({x: v, v: fall, w: -abs(v) * w}, surfaces=[floor]), (rng.uniform(0.5, 1.5), 0.0, 1.0)


Make = Callable[[np.random.Generator], tuple[System, Start]]
KINDS: list[Make] = [passing, at_rest, stuck, switched, dropped]


def agree(found: list[tuple[float, str, str]], solution: Any) -> None:
    expected = [(e.t, e.surface, str(e.kind)) for e in solution.events if str(e.kind) != "grazing"]
    assert [row[1:] for row in found] == [row[1:] for row in expected]
    assert [row[0] for row in found] == pytest.approx([row[0] for row in expected], rel=1e-7, abs=1e-8)


@pytest.mark.parametrize("make", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_15_6_kinks_are_passed_rested_on_and_left_as_by_the_exact_run(
    make: Any, seed: int, tmp_path: Path
) -> None:
    system, x0 = make(np.random.default_rng(seed))
    solution = solve(system, x0, (0, 8), rtol=1e-11, atol=1e-13)
    assert solution.success
    result = load(export_system(system, tmp_path / "kinks.py", x0=x0, t_span=(0, 8))).run()
    assert result.status == "success", result.message
    assert result.x[-1] == pytest.approx(list(solution.x_end), rel=1e-8, abs=1e-8)
    agree([(e.t, e.surface, e.kind) for e in result.events], solution)
    if COMPILER is None or seed > 3:
        return
    source, program = export_system(system, tmp_path / "k.c", x0=x0, t_span=(0, 8)), tmp_path / "k"
    subprocess.run([COMPILER, "-O1", "-Wall", "-Werror", str(source), "-o", str(program), "-lm"], check=True)
    done = subprocess.run([str(program)], capture_output=True, encoding="utf-8", check=True)
    *rows, last = [line.split(",") for line in done.stdout.splitlines()]
    assert [float(q) for q in last[3:]] == pytest.approx(list(solution.x_end), rel=1e-8, abs=1e-8)
    agree([(float(row[0]), row[1], row[2]) for row in rows], solution)


def test_15_6_a_kink_that_is_left_along_it_is_never_taken_for_rest(tmp_path: Path) -> None:
    """v = t^7 from v = 0: too flat a start to see, and the run says so or follows it."""
    system = System({v: 7 * t**6 - abs(v) * v})
    solution = solve(system, (0,), (0, 2), rtol=1e-11, atol=1e-13)
    result = load(export_system(system, tmp_path / "flat.py", x0=(0,), t_span=(0, 2))).run()
    if result.status == "success":
        assert result.x[-1] == pytest.approx(list(solution.x_end), rel=1e-8)
    else:
        assert result.status == "tangency"
