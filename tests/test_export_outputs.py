"""Outputs in exported models: formulas of the state, with the multiplier for a sign that is slid on."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from exported import load
from sympy import Max, Piecewise, sqrt

from filippov import Problem, Surface, System, cos, export_system, parameters, sign, solve, states, t

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
x, v, w = states("x v w")


def driven(rng: np.random.Generator) -> Problem:
    """Stick and slip of a driven body: its friction force, its power, and choices by the sign of v."""
    p = parameters(F=rng.uniform(0.3, 0.6), k=rng.uniform(0.5, 1.5))
    force = p.F * sign(v)
    system = System(
        {x: v, v: -p.k * x - force + 0.9 * cos(t)},
        outputs={
            "friction": force, "power": force * v, "square": sign(v) ** 2, "net": p.k * x + force,
            "chosen": Piecewise((2.0 + v, v > 0), (-1.0 + x, True)), "clock": t,
            "plain": x**2 + sign(x) + abs(v),
        },
    )  # fmt: skip
    return Problem(system, (rng.uniform(-1, 1), 0.0), (0, 12))


def joined(rng: np.random.Generator) -> Problem:
    """Two frictions that do not act on each other, a kink, and an output with a value on one side alone."""
    f, g = rng.uniform(0.2, 0.5, 2).tolist()
    system = System(
        {x: v, v: -x - f * sign(v) + 0.8 * cos(t), w: -g * sign(w - x / 4) + 0.3 * cos(2 * t) - w * abs(w)},
        outputs={
            "both": sign(v) + 2 * sign(w - x / 4), "product": sign(v) * sign(w - x / 4), "larger": Max(x, w),
            "root": Piecewise((sqrt(v), v > 0), (0.0, True)),
        },
    )  # fmt: skip
    return Problem(system, (rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(0.1, 1)), (0, 8))


def dropped(rng: np.random.Generator) -> Problem:
    """A body that stays on a floor until it is lifted."""
    c = rng.uniform(0.1, 0.5)
    floor = Surface("floor", x, reset={v: 0 * v})
    drag = c * v * abs(v)
    system = System({x: v, v: -9.81 - drag + 3 * t}, surfaces=[floor], outputs={"drag": drag})
    return Problem(system, (rng.uniform(0.5, 1.5), 0.0), (0, 5))


@pytest.mark.parametrize("make", [driven, joined, dropped])
@pytest.mark.parametrize("seed", range(3))
def test_15_6_outputs_are_those_of_the_exact_run(
    make: object, seed: int, tmp_path: Path
) -> None:
    assert callable(make)
    problem = make(np.random.default_rng(seed))
    solution = solve(problem, rtol=1e-11, atol=1e-13)
    assert solution.success
    result = load(export_system(problem, tmp_path / "run.py")).run()
    assert result.status == "success", result.message
    assert set(result.outputs) == set(problem.system.outputs)
    ends = [event.t for event in solution.events]
    clear = [k for k, time in enumerate(result.t) if all(abs(time - end) > 1e-7 for end in ends)]
    times = np.array(result.t)[clear]
    for name, values in result.outputs.items():
        assert len(values) == len(result.t)
        expected = solution.evaluate(name, times)
        assert np.array(values)[clear] == pytest.approx(expected, rel=1e-6, abs=1e-6, nan_ok=True), name
        assert values[-1] == pytest.approx(solution[name][-1], rel=1e-6, abs=1e-6), name
    if COMPILER is None:
        return
    source, program = export_system(problem, tmp_path / "run.c"), tmp_path / "run"
    subprocess.run([COMPILER, "-O1", "-Wall", "-Werror", str(source), "-o", str(program), "-lm"], check=True)
    done = subprocess.run([str(program)], capture_output=True, encoding="utf-8", check=True)
    last = [float(q) for q in done.stdout.splitlines()[-1].split(",")[3:]]
    named = [*problem.system.states, *problem.system.outputs]
    assert last == pytest.approx([solution[name][-1] for name in named], rel=1e-6, abs=1e-6)


def test_15_6_outputs_in_stick_hold_the_multiplier(tmp_path: Path) -> None:
    """x = 0.1 sticks under 0.1 k: the friction force is -k x, and the sign is -k x/F, not 0 or 1."""
    mean = Piecewise((3.0, v > 0), (1.0, True))
    system = System({x: v, v: -2 * x - sign(v)}, outputs={"sign": sign(v), "mean": mean})
    result = load(export_system(system, tmp_path / "s.py", x0=(0.1, 0), t_span=(0, 1))).run()
    assert result.outputs["sign"] == pytest.approx([-0.2] * len(result.t), abs=1e-12)
    assert result.outputs["mean"] == pytest.approx([1.8] * len(result.t), abs=1e-12)


@pytest.mark.parametrize(("make", "seeds"), [(driven, (0, 1, 2)), (joined, (0, 1, 2))])
def test_outputs_of_the_modelica_text_are_those_of_the_exact_run(
    make: Callable[..., Problem], seeds: tuple[int, ...], tmp_path: Path
) -> None:
    rumoca = pytest.importorskip("rumoca")
    for seed in seeds:
        problem = make(np.random.default_rng(seed))
        solution, span = solve(problem, rtol=1e-11, atol=1e-13), problem.t_span[1]
        path = export_system(problem, tmp_path / "Model.mo")
        assert not [note for note in rumoca.validate(path) if str(note.level) == "error"]
        config = rumoca.SimConfig(rtol=1e-9, atol=1e-11)
        run = rumoca.Session().load(path, model="Model").simulate((0.0, span), dt=span / 97, config=config)
        times, ends = np.array(run.time), [event.t for event in solution.events]
        clear = [k for k, time in enumerate(times) if all(abs(time - end) > 1e-3 for end in ends)]
        assert len(clear) > 50
        for name in problem.system.outputs:
            expected = solution.evaluate(name, times[clear])
            word = f"{name}_" if name == "product" else name  # a function of Modelica
            assert np.array(run[word])[clear] == pytest.approx(expected, rel=1e-4, abs=1e-4), name


def test_names_of_outputs_that_modelica_and_fmi_have_not_are_told_beside_them(tmp_path: Path) -> None:
    """No reason to refuse a model: velocity is a function of the text, der a word, and letters are ASCII."""
    system = System(
        {x: v, v: -x - sign(v)}, outputs={"velocity": v, "der": -v, "kraft_\u00fc": sign(v), "plain": x},
    )  # fmt: skip
    text = export_system(system, tmp_path / "Words.mo", x0=(1.4, 0.3), t_span=(0, 1)).read_text("utf-8")
    assert 'output Real velocity_ "velocity";' in text
    assert 'output Real der_ "der";' in text
    assert 'output Real output3_ "kraft_' in text
    assert "output Real plain;" in text
    rumoca = pytest.importorskip("rumoca")
    run = rumoca.Session().load(tmp_path / "Words.mo", model="Words").simulate((0.0, 1.0), dt=0.1)
    assert np.array(run["velocity_"]) == pytest.approx(np.array(run["v"]), abs=1e-9)


@pytest.mark.parametrize("make", [driven, joined, dropped])
def test_outputs_of_the_fmu_are_those_of_the_exact_run(make: Callable[..., Problem], tmp_path: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    pytest.importorskip("pythonfmu3")
    problem = make(np.random.default_rng(4))
    solution = solve(problem, rtol=1e-11, atol=1e-13)
    path = export_system(problem, tmp_path / "outputs.fmu")
    names = list(problem.system.outputs)
    stop = float(problem.t_span[1])
    run = fmpy.simulate_fmu(str(path), stop_time=stop, output_interval=stop / 40, output=names)
    ends = [event.t for event in solution.events]
    clear = [k for k, time in enumerate(run["time"]) if all(abs(time - end) > 1e-6 for end in ends)]
    assert len(clear) > 30
    for name in names:
        expected = solution.evaluate(name, run["time"][clear])
        assert run[name][clear] == pytest.approx(expected, rel=1e-6, abs=1e-6, nan_ok=True), name


def test_fmus_of_one_file_name_stay_apart_in_one_process(tmp_path: Path) -> None:
    """A half swing from 1.1 ends at mu 2 - 1.1, for either of two plants, that run beside each other."""
    fmpy = pytest.importorskip("fmpy")
    pytest.importorskip("pythonfmu3")
    running, levels = [], (0.1, 0.3)
    for level in levels:
        folder = tmp_path / str(level)
        folder.mkdir()
        path = str(export_system(System({x: v, v: -x - level * sign(v)}), folder / "plant.fmu", x0=(1.1, 0)))
        about = fmpy.read_model_description(path)
        fmu = fmpy.instantiate_fmu(fmpy.extract(path, folder / "out"), about, fmi_type="CoSimulation")
        fmu.enterInitializationMode(startTime=0.0)
        fmu.exitInitializationMode()
        (place,) = (q.valueReference for q in about.modelVariables if q.name == "x")
        running.append((fmu, place))
    for fmu, _ in running:
        fmu.doStep(0.0, np.pi)
    found = [fmu.getFloat64([place])[0] for fmu, place in running]
    assert found == pytest.approx([2 * level - 1.1 for level in levels], abs=1e-8)
    for fmu, _ in running:
        fmu.terminate()
        fmu.freeInstance()
