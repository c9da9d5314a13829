"""Resets of one instant in exported automata, and what a tick leaves of signs in the Modelica text."""

import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rumoca
from exported import load

from filippov import Surface, System, TimeEvent, export_system, sign, solve, states

COMPILER = shutil.which("cc") or shutil.which("gcc")
x, v, n, q = states("x v n q")
ONE: Any = ({n: n + 1}, {n: 2 * n}, {q: q + 1}, {q: q + n}, {n: 3, q: 1})
BY_HAND: Any = (
    lambda n, q: (n + 1, q), lambda n, q: (2 * n, q), lambda n, q: (n, q + 1), lambda n, q: (n, q + n),
    lambda n, q: (3, 1),
)  # fmt: skip


def in_python(system: System, x0: Any, end: float, folder: Path) -> tuple[str, list[float]]:
    run = load(export_system(system, folder / "made.py", x0=x0, t_span=(0, end))).run()
    return run.status, run.x[-1]


def in_c(system: System, x0: Any, end: float, folder: Path) -> tuple[str, list[float]]:
    source, program = export_system(system, folder / "made.c", x0=x0, t_span=(0, end)), folder / "made"
    subprocess.run([COMPILER or "", "-O1", str(source), "-o", str(program), "-lm"], check=True)
    said = subprocess.run([str(program)], capture_output=True, text=True, check=False).stdout
    last = said.splitlines()[-1].split(",")
    return last[2], [float(value) for value in last[3:]]


def in_modelica(system: System, x0: Any, end: float, folder: Path) -> tuple[str, list[float]]:
    path = export_system(system, folder / "Made.mo", x0=x0, t_span=(0, end))
    config = rumoca.SimConfig(rtol=1e-9, atol=1e-11)
    run = rumoca.Session().load(path, model="Made").simulate((0.0, end), dt=end / 40, config=config)
    status = "success" if run.termination is None else str(run.termination).split(":")[0]
    return status, [float(run[name][-1]) for name in system.states]


WAYS = [in_python, pytest.param(in_c, marks=pytest.mark.skipif(COMPILER is None, reason="no C")), in_modelica]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("one", "other"), [(0, 1), (0, 2), (1, 2), (2, 3), (3, 4)])
def test_clocks_of_one_instant_all_strike_or_end_the_run(
    way: Any, one: int, other: int, tmp_path: Path
) -> None:
    """Ticks at 1, 2, 3 in both orders by hand; the exported files took the first, or lost a reset."""
    system = System(
        {x: 1 + 0.5 * sign(x - 0.3), n: 0, q: 0},
        time_events=[TimeEvent(name, period=1, reset=ONE[k]) for name, k in (("a", one), ("b", other))],
    )
    ends = []
    for order in ((one, other), (other, one)):
        at = (0, 0)
        for _ in range(3):
            for k in order:
                at = BY_HAND[k](*at)
        ends.append(at)
    status, end = way(system, (0, 0, 0), 3.25, tmp_path)
    if ends[0] == ends[1]:
        assert status == "success"
        assert end == pytest.approx([0.3 + 1.5 * (3.25 - 0.6), *ends[0]], abs=1e-6)
    else:
        assert status == "non_unique"


@pytest.mark.parametrize("way", WAYS)
def test_a_clock_and_a_surface_of_one_instant_end_the_run(way: Any, tmp_path: Path) -> None:
    """x = 1 at the tick: q gets n before or after n + 1. The files went on with either."""
    system = System(
        {x: 1, n: 0, q: 0}, surfaces=[Surface("up", 1 - x, reset={x: x - 1, n: n + 1})],
        time_events=[TimeEvent("tick", period=1, reset={q: q + n})],
    )  # fmt: skip
    assert way(system, (0, 0, 0), 2.25, tmp_path)[0] in ("non_unique", "corner")


@pytest.mark.parametrize("start", [0.0, 0.05, -0.0999])
def test_hysteresis_keeps_its_sign_at_ticks_in_modelica(start: float, tmp_path: Path) -> None:
    """x goes to and fro between -0.1 and 0.1; every 0.03 from before 0 on a tick gave it the sign of x."""
    system = System(
        {x: -sign(x), n: 0}, surfaces=[Surface("relay", x, width=0.1)],
        time_events=[TimeEvent("tick", period=0.03, start=-0.5, reset={n: n + 1})],
    )  # fmt: skip
    status, end = in_modelica(system, (start, 0), 1.0, tmp_path)
    phase = (1.0 + (0.1 - start if start >= 0 else 0.3 + start)) % 0.4  # 0 at x = 0.1 on the way down
    place = 0.1 - phase if phase < 0.2 else phase - 0.3
    assert status == "success"
    assert end == pytest.approx([place, 34], abs=1e-6)


@pytest.mark.parametrize("unit", [1.0, 1e-8, 1e4])
@pytest.mark.parametrize("seed", range(3))
def test_kicked_oscillators_in_any_unit_of_length_in_modelica(seed: int, unit: float, tmp_path: Path) -> None:
    """A kick of up to half a unit crosses the surface or leaves it; 1e-6 was the distance of all units."""
    rng = np.random.default_rng(seed)
    level, force, kick = unit * rng.uniform([-0.3, 0.2, 0.3], [0.3, 0.5, 0.6])
    system = System(
        {x: v, v: -x - 0.1 * v - force * sign(v - level)},
        time_events=[TimeEvent("kick", period=0.7, reset={v: v - kick})],
    )
    x0 = (unit, unit * float(rng.uniform(-1, 1)))
    exact = solve(system, x0, (0, 5), atol=1e-12 * unit)
    path = export_system(system, tmp_path / "Kicked.mo", x0=x0, t_span=(0, 5))
    config = rumoca.SimConfig(rtol=1e-9, atol=1e-11 * unit)
    run = rumoca.Session().load(path, model="Kicked").simulate((0.0, 5.0), dt=0.1, config=config)
    assert run.termination is None
    assert [run[name][-1] / unit for name in "xv"] == pytest.approx(exact.x_end / unit, abs=1e-5)


def test_a_coupled_surface_reached_in_a_slide_ends_the_modelica_text(tmp_path: Path) -> None:
    """The condition held within one event only, which the tool skipped: it went on off the surface."""
    system = System({x: 0.3 - 0.42 * sign(x - 0.89), v: -0.5 * v + sign(x - 0.38 * v - 0.24)})
    assert solve(system, (0.25, -0.48), (0, 6)).success
    status, end = in_modelica(system, (0.25, -0.48), 6.0, tmp_path)
    assert status == "corner"
    assert end[0] - 0.38 * end[1] - 0.24 == pytest.approx(0, abs=1e-6)
