"""Clocks of exported automata: instants beside events and ends of steps, and jumps across resets."""

import shutil
import subprocess
from pathlib import Path
from typing import Any

import fmpy
import pytest
import rumoca
from exported import load
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Slave

from filippov import ModelError, Surface, System, TimeEvent, export_system, sign, solve, states, t

COMPILER = shutil.which("cc") or shutil.which("gcc")
x, n, q = states("x n q")


def ticking(at: float) -> System:
    """x' = 1, from x = at on 3/2; n counts the ticks at 0.1, 0.2, ..."""
    return System(
        {x: 1.25 + 0.25 * sign(x - at), n: 0}, surfaces=[Surface("gate", x - at)],
        time_events=[TimeEvent("tick", period=0.1, reset={n: n + 1})],
    )  # fmt: skip


@pytest.mark.parametrize("at", [0.3, 0.6, 0.7, 1.2, 1.7])
def test_15_6_a_tick_within_rounding_behind_an_event_counts(at: float, tmp_path: Path) -> None:
    """0.3 is below 3*0.1 by one bit: the event at x = 0.3 took the place of the tick, which never came."""
    given: dict[str, Any] = {"x0": (0, 0), "t_span": (0, 2.05)}
    run = load(export_system(ticking(at), tmp_path / "ticking.py", **given)).run()
    assert run.status == "success"
    assert run.x[-1] == pytest.approx([at + 1.5 * (2.05 - at), 20], abs=1e-12)
    if COMPILER:
        source, program = export_system(ticking(at), tmp_path / "ticking.c", **given), tmp_path / "ticking"
        subprocess.run([COMPILER, "-O2", str(source), "-o", str(program), "-lm"], check=True)
        said = subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout
        assert float(said.splitlines()[-1].split(",")[-1]) == 20


@pytest.mark.parametrize("step", [0.04, 0.025, 0.1, 0.037])
def test_15_6_an_fmu_loses_no_tick_at_its_communication_points(step: float, tmp_path: Path) -> None:
    """15*0.04 is below 6*0.1 by one bit: such ticks came in none of the two steps."""
    path = export_system(ticking(9), tmp_path / "counter.fmu", x0=(0, 0), t_span=(0, 2.05))
    found = fmpy.simulate_fmu(str(path), stop_time=2.05, output_interval=step, output=["n", "events"])
    late = int(found["time"][-1] * 10 + 1e-9)
    assert found["n"][-1] == late
    assert found["events"][-1] == late


@pytest.mark.parametrize("start", [0.0, 0.55, 1.7, -0.3])
def test_an_fmu_begins_at_its_start_time(start: float, tmp_path: Path) -> None:
    """x' = 2 t off x = 9; it began at 0: x_end and the count of ticks were those from there."""
    system = System(
        {x: 2 * t + sign(9 - x) - 1, n: 0}, time_events=[TimeEvent("tick", period=0.1, reset={n: n + 1})]
    )
    path = export_system(system, tmp_path / "late.fmu", x0=(0, 0), t_span=(0.55, 2))
    found = fmpy.simulate_fmu(
        str(path), start_time=start, stop_time=2.05, output_interval=(2.05 - start) / 10, output=["x", "n"]
    )
    assert found["time"][-1] == pytest.approx(2.05)
    exact = solve(system, (0, 0), (start, 2.05))
    assert exact.x_end == pytest.approx([2.05**2 - start**2, 20 - max(int(start * 10 + 1e-9), -1)])
    assert [found["x"][-1], found["n"][-1]] == pytest.approx(exact.x_end, abs=1e-9)


def test_an_fmu_takes_no_step_twice(tmp_path: Path) -> None:
    """A second step from the same time left the state as it was, as a success."""
    path = export_system(ticking(9), tmp_path / "again.fmu", x0=(0, 0), t_span=(0, 2))
    described = fmpy.read_model_description(str(path))
    unit = FMU3Slave(
        guid=described.guid, unzipDirectory=fmpy.extract(str(path), str(tmp_path / "open")),
        modelIdentifier=described.coSimulation.modelIdentifier, instanceName="again",
    )  # fmt: skip
    unit.instantiate()
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    unit.doStep(0.0, 0.5)
    unit.doStep(0.5 + 1e-12, 0.5)
    with pytest.raises(FMICallException):
        unit.doStep(0.5, 0.5)


def test_15_6_steps_to_just_before_each_tick_lose_none(tmp_path: Path) -> None:
    """The automaton by hand, to times within rounding below the instants."""
    module = load(export_system(ticking(9), tmp_path / "counted.py", x0=(0, 0), t_span=(0, 1)))
    automaton = module.Automaton(module.Model, [0.0, 0.0], 0.0)
    for k in range(1, 11):
        assert automaton.advance(k * 0.1 * (1 - 2e-16))
    assert automaton.advance(1.05)
    assert automaton.x[1] == 10


def saw(jump: Any) -> System:
    """x falls and rises by 1 between 0 and 2; every 2.5 it jumps."""
    return System(
        {x: 2 * q - 1, q: 0},
        surfaces=[Surface("low", x, reset={q: 1}), Surface("high", 2 - x, reset={q: 0})],
        time_events=[TimeEvent("tick", period=2.5, reset={x: jump})],
    )


def modelica(system: System, folder: Path, name: str, end: float) -> Any:
    """The run of the exported text from x = 1, q = 0."""
    path = export_system(system, folder / f"{name}.mo", x0=(1, 0), t_span=(0, end))
    config = rumoca.SimConfig(rtol=1e-9, atol=1e-11)
    return rumoca.Session().load(path, model=name).simulate((0.0, end), dt=end / 50, config=config)


def test_15_6_a_tick_within_the_sides_of_two_resets_runs_in_modelica(tmp_path: Path) -> None:
    """At t = 2.5 x goes from 1.5 to 0.75, turns at 3.75, goes from 0.75 to 0.375 at 5, turns at 5.375."""
    run = modelica(saw(x / 2), tmp_path, "Halved", 6.0)
    assert run.termination is None
    assert [run["x"][-1], run["q"][-1]] == pytest.approx([0.625, 1], abs=1e-7)
    exact = solve(saw(x / 2), (1, 0), (0, 6))
    assert exact.x_end == pytest.approx([0.625, 1], abs=1e-12)


def test_15_6_a_tick_across_a_reset_ends_the_modelica_text(tmp_path: Path) -> None:
    """From 1.5 to -0.5: the reset undid the jump, and the run went on to the end."""
    run = modelica(saw(x - 2), tmp_path, "Across", 6.0)
    assert "leads across surface low, which has a reset" in str(run.termination)
    assert run.time[-1] == pytest.approx(2.5, abs=1e-9)
    module = load(export_system(saw(x - 2), tmp_path / "across.py", x0=(1, 0), t_span=(0, 6)))
    assert module.run().status == "corner"


def test_15_6_a_reset_that_moves_another_ones_surface_is_refused_in_modelica(tmp_path: Path) -> None:
    """From 0 to 3, across 2, whose reset read the 0: the end was at 0.8, the exact solution has 0.4."""
    system = System(
        {x: -1, q: 0},
        surfaces=[Surface("low", x, reset={x: 3}), Surface("high", 2 - x, reset={q: q + 1, x: 1 + 0.1 * x})],
    )
    exact = solve(system, (1, 0), (0, 3.2))
    assert exact.x_end == pytest.approx([0.4, 2], abs=1e-12)  # 1.3 at t = 1 and 2.3, each by both resets
    with pytest.raises(ModelError, match="the reset of surface 'low' changes what surface 'high'"):
        modelica(system, tmp_path, "Both", 3.2)
