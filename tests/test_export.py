"""The exact automaton as Python, C, Modelica and FMU: each run again and compared with the exact run."""

import json
import math
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
import rumoca
from exported import load
from fmpy.validation import validate_fmu
from scipy.integrate import RK45

from filippov import (
    Max,
    ModelError,
    Problem,
    Surface,
    System,
    UsageError,
    export_system,
    parameters,
    sign,
    sin,
    solve,
    states,
    t,
)
from filippov.app.cli.main import main
from filippov.io.automaton import method
from filippov.models import registry

NAMES = (
    "relay", "hunting", "hunting_static", "belt", "two_blocks", "thermostat", "bouncing_ball",
    "impact_oscillator", "rocking_block", "boost_pwm", "sampled_pid", "escapement",
)  # fmt: skip
Row = tuple[float, str, str]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("export")


_EXACT: dict[str, Any] = {}


def problem(name: str) -> Problem:
    model = registry.get(name)
    return Problem(model.build(), model.x0, model.t_span)


def exact(name: str) -> Any:
    if name not in _EXACT:
        _EXACT[name] = solve(problem(name), rtol=1e-11, atol=1e-13)
        assert _EXACT[name].success
    return _EXACT[name]


def rows_of(solution: Any, end: float) -> list[Row]:
    """Events of an exact run before the end, without tangencies, which an automaton does not report."""
    found = [(event.t, event.surface, str(event.kind)) for event in solution.events]
    return [row for row in found if row[2] != "grazing" and row[0] < end * (1 - 1e-9)]


def module(folder: Path, name: str) -> Any:
    path = folder / f"{name}.py"
    return load(path if path.exists() else export_system(problem(name), path))


def agree(found: list[Row], expected: list[Row], within: float) -> None:
    assert [row[1:] for row in found] == [row[1:] for row in expected]
    for one, other in zip(found, expected, strict=True):
        assert one[0] == pytest.approx(other[0], rel=within, abs=within)


# -- Python ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_15_6_the_python_module_follows_the_exact_run(name: str, folder: Path) -> None:
    result, solution = module(folder, name).run(), exact(name)
    assert result.status == "success", result.message
    end = result.t[-1]
    assert end == solution.t[-1]
    agree(
        [(e.t, e.surface, e.kind) for e in result.events if e.t < end * (1 - 1e-9)],
        rows_of(solution, end),
        1e-8,
    )
    modes = [event.after for event in solution.events if str(event.kind) != "grazing"]
    assert [event.after for event in result.events][: len(modes)] == modes[: len(result.events)]
    before = result.t[-2]
    there = solution.sol(before, side="+")
    assert np.allclose(result.x[-2], there, rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize("name", ["relay", "hunting_static", "two_blocks", "boost_pwm"])
def test_15_6_random_starts_and_parameters(name: str, folder: Path) -> None:
    given, run = problem(name), module(folder, name).run
    rng = np.random.default_rng(15)
    x0, span = np.array(given.x0, dtype=float), given.t_span
    short = (span[0], span[0] + 0.3 * (span[1] - span[0]))
    for k in range(5):
        start = x0 + rng.uniform(-1, 1, len(x0)) * np.maximum(np.abs(x0), 0.3 * np.max(np.abs(x0)))
        chosen = given.system.parameters.names[k % len(given.system.parameters)]
        value = float(given.system.parameters[chosen].default) * rng.uniform(0.9, 1.1)
        changed = {chosen: given.system.parameters[chosen].default if value > 1e3 else value}
        solution = solve(given.system, start, short, parameters=changed, rtol=1e-11, atol=1e-13)
        result = run(start.tolist(), short, parameters=changed)
        assert result.status in ("success", "corner", "tangency", "zeno"), result.message
        end = result.t[-1] - 1e-6 * (short[1] - short[0])
        agree([(e.t, e.surface, e.kind) for e in result.events if e.t < end],
              [row for row in rows_of(solution, math.inf) if row[0] < end], 1e-8)  # fmt: skip


def test_15_6_impacts_and_their_accumulation_in_closed_form(folder: Path) -> None:
    result = module(folder, "bouncing_ball").run((1.0, 0.0), (0.0, 4.0))
    fall, e = math.sqrt(2 / 9.81), 0.7
    for k, event in enumerate(result.events[:25]):
        assert event.t == pytest.approx(fall * (1 + 2 * sum(e**j for j in range(1, k + 1))), abs=1e-9)
    assert result.status == "zeno"
    assert result.t[-1] == pytest.approx(fall * (1 + e) / (1 - e), abs=1e-6)
    # A plastic impact ends in rest, which stays.
    flat = module(folder, "bouncing_ball").run((1.0, 0.0), (0.0, 2.0), parameters={"e": 0.0})
    assert (flat.status, flat.modes[-1], flat.x[-1]) == ("success", (0,), [0.0, 0.0])


def test_15_6_thermostat_in_closed_form(folder: Path) -> None:
    # T' = -K (T - 18) + 2 to 23.5, then without 2 to 22: logarithms of distances to the two limits.
    up = 10 * math.log((38 - 22) / (38 - 23.5))
    down = 10 * math.log((23.5 - 18) / (22 - 18))
    t = [event.t for event in module(folder, "thermostat").run().events]
    assert np.allclose(np.diff(t[::2]), up + down, rtol=1e-9)
    assert np.allclose(np.diff(t)[:2], [down, up], rtol=1e-9)


def test_15_6_the_dense_output_is_the_one_of_the_literature() -> None:
    assert np.allclose(method.DENSE, RK45.P, rtol=1e-15, atol=0)
    assert np.allclose(method.WEIGHTS, RK45.B, rtol=1e-15, atol=0)
    assert np.allclose(method.ERROR, RK45.E, rtol=1e-13, atol=0)


def test_15_6_first_zeros_of_random_polynomials() -> None:
    rng = np.random.default_rng(6)
    for _ in range(400):
        roots = rng.uniform(-1, 2, rng.integers(0, 5))
        places = np.array(method.PLACES)
        values = np.prod([places - root for root in roots], axis=0) * (1 + rng.uniform(0, 1) * places)
        values = values * np.ones(9)
        values = values if values[0] > 0 else -values
        found = method.first_zero(method.coefficients(values.tolist()))
        inside = [root for root in roots if 0 < root <= 1]
        # Two roots closer than the resolution are a tangency.
        if len(inside) > 1 and np.min(np.diff(sorted(inside))) < 1e-3:
            continue
        assert (found is None) == (not inside)
        if inside:
            assert found == pytest.approx(min(inside), abs=1e-7)


# -- C ---------------------------------------------------------------------------------------------------


COMPILER = shutil.which("cc") or shutil.which("gcc")


@pytest.mark.skipif(COMPILER is None, reason="no C compiler on this machine")
@pytest.mark.parametrize("name", ["relay", "hunting", "two_blocks", "bouncing_ball", "boost_pwm"])
def test_15_6_the_c_file_follows_the_exact_run(name: str, folder: Path) -> None:
    source, program = export_system(problem(name), folder / f"{name}.c"), folder / f"{name}.bin"
    strict = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-O0"]
    words = [str(COMPILER), *strict, str(source), "-o", str(program), "-lm"]
    built = subprocess.run(words, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    done = subprocess.run([str(program)], capture_output=True, text=True, check=False, timeout=60)
    *events, last = [line.split(",") for line in done.stdout.splitlines()]
    assert (done.returncode, last[2]) == (0, "success")
    end = float(last[0])
    agree([(float(row[0]), row[1], row[2]) for row in events if float(row[0]) < end * (1 - 1e-9)],
          rows_of(exact(name), end), 1e-8)  # fmt: skip
    # Both runtimes are the same steps.
    assert np.allclose([float(v) for v in last[3:]], module(folder, name).run().x[-1], rtol=1e-9, atol=1e-10)
    if name == "relay":
        for words in (["-p", "nothing=1"], ["-x"], ["-p", "x"]):
            assert subprocess.run([str(program), *words], capture_output=True, check=False).returncode == 2


# -- Modelica and FMI ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["relay", "hunting", "bouncing_ball", "boost_pwm", "sampled_pid", "escapement"]
)
def test_15_6_the_modelica_text_runs_in_a_compiler_of_modelica(name: str, tmp_path: Path) -> None:
    path, solution = export_system(problem(name), tmp_path / "Model.mo"), exact(name)
    assert not [note for note in rumoca.validate(path) if str(note.level) == "error"]
    span, own = solution.t[-1], rumoca.SimConfig(rtol=1e-9, atol=1e-11)
    run = (
        rumoca.Session()
        .load(path, model="Model")
        .simulate((0.0, float(span)), dt=float(span) / 97, config=own)
    )
    times, events = np.array(run.time), np.array([event.t for event in solution.events])
    clear = [k for k, t in enumerate(times) if np.min(np.abs(events - t)) > 1e-3 * span / 100]
    assert len(clear) > 50
    for i, state in enumerate(solution.system.states):
        found = np.array(run[state])[clear]
        expected = np.array([solution.sol(times[k])[i] for k in clear])
        assert np.max(np.abs(found - expected)) < 1e-4 * np.max(np.abs(expected)), state


def test_15_6_an_accumulation_terminates_the_modelica_text(tmp_path: Path) -> None:
    path = export_system(problem("bouncing_ball"), tmp_path / "Ball.mo")
    run = rumoca.Session().load(path, model="Ball").simulate((0.0, 4.0), dt=0.02)
    assert "accumulate" in str(run.termination)
    assert run.time[-1] == pytest.approx(math.sqrt(2 / 9.81) * 1.7 / 0.3, abs=1e-2)


def test_15_6_the_fmu_is_valid_and_follows_the_exact_run(tmp_path: Path) -> None:
    given = problem("hunting")
    path = export_system(given, tmp_path / "hunting.fmu")
    assert validate_fmu(str(path)) == []
    settings: dict[str, Any] = {"stop_time": 20.0, "output_interval": 0.5}
    run = fmpy.simulate_fmu(str(path), **settings, output=["x", "v", "z", "events"])
    solution = exact("hunting")
    for i, state in enumerate("xvz"):
        assert np.allclose(run[state], [solution.sol(t)[i] for t in run["time"]], rtol=0, atol=1e-8)
    assert run["events"][-1] == len(solution.events)
    other = fmpy.simulate_fmu(str(path), **settings, start_values={"P": 20.0, "x": 0.05}, output=["x"])
    again = solve(given.system, (0.05, 0, 0), (0, 20), parameters={"P": 20}, rtol=1e-11, atol=1e-13)
    assert np.allclose(other["x"], [again.sol(t)[0] for t in other["time"]], rtol=0, atol=1e-8)


# -- where it stops, what it refuses ---------------------------------------------------------------------


def test_15_6_what_the_automaton_does_not_decide_stops_by_name(tmp_path: Path) -> None:
    x, y = states("x y")
    corner = System({x: -sign(x) - 0.5 * sign(y), y: -sign(y) + 0.5 * sign(x)})
    power = System({x: -(abs(x) ** 0.5) * sign(x)})
    fold = System({x: 1 + 0 * x, y: -(1 - x) * sign(y)}, surfaces=[Surface("fold", y)])
    cases: list[tuple[System, Any, Any, str]] = [
        (corner, (0.3, 0.7), (0, 3), "corner"), (corner, (0, 0), (0, 1), "corner"),
        (power, (1,), (0, 3), "non_lipschitz"), (fold, (0, 0), (0, 2), "no_sliding"),
        (registry.get("bouncing_ball").build(), (0, 1), (0, 1), "corner"),
    ]  # fmt: skip
    for k, (system, x0, span, status) in enumerate(cases):
        result = load(export_system(system, tmp_path / f"case{k}.py")).run(x0, span)
        assert (result.status, result.success) == (status, False), (k, result.message)
        assert result.t[-1] < span[1]


def test_15_6_what_cannot_be_exported_is_refused(tmp_path: Path) -> None:
    (u,) = states("µ")
    plain = System(
        field=lambda t, x, p, s: [-s[0]], surfaces=[Surface("x", lambda t, x, p: x[0])], states="x"
    )
    odd, good = System({u: -sign(u)}), registry.get("relay").build()
    for system, name, more, error, said in (
        (plain, "a.py", {}, ModelError, "plain function"),
        (good, "a.txt", {}, UsageError, "no suffix"),
        (good, "a.py", {"to": "cc"}, UsageError, "known: python"),
        (good, "a.mo", {}, UsageError, "needs x0"),
        (good, "a.py", {"x0": (1, 2)}, UsageError, "shape"),
        (good, "a.py", {"t_span": (1, 0)}, UsageError, "increasing"),
        (good, "a.py", {"parameters": {"nothing": 1}}, ModelError, "unknown parameter"),
        (odd, "a.mo", {"x0": (1,), "t_span": (0, 1)}, ModelError, "ASCII"),
        (odd, "a.fmu", {"x0": (1,)}, ModelError, "ASCII"),
        (good, "when.mo", {"x0": (1, 0, 0), "t_span": (0, 1)}, ModelError, "word of Modelica"),
    ):
        with pytest.raises(error, match=said):
            export_system(system, tmp_path / name, **more)  # type: ignore[arg-type]
    assert not list(tmp_path.iterdir())
    run = load(export_system(odd, tmp_path / "odd.py")).run
    for arguments, said in ((((1, 2), (0, 1)), "x0"), (((1,), (1, 0)), "t_span"), ((None, (0, 1)), "needed")):
        with pytest.raises(ValueError, match=said):
            run(*arguments)
    with pytest.raises(ValueError, match="unknown parameter"):
        run((1,), (0, 1), {"k": 1})
    result = run((1,), (0, 2))
    assert [event.t for event in result.events] == pytest.approx([1.0], abs=1e-12)


def test_15_6_names_of_the_user_are_no_code(tmp_path: Path) -> None:
    hostile = '*/ " \\ ??/ \n\'""" {x} %s'
    (x,) = states("x")
    p = parameters(int=2.0, lambda_=1.0)
    system = System({x: -p["int"] * p["lambda_"] * sign(x)}, surfaces=[Surface(hostile, x)], parameters=p)
    for suffix in (".py", ".c", ".mo"):
        if suffix == ".mo":
            continue
        path = export_system(system, tmp_path / f"hostile{suffix}", x0=(1,), t_span=(0, 1))
        if suffix == ".py":
            assert load(path).run().events[0].surface == hostile
        elif COMPILER is not None:
            program = str(tmp_path / "hostile")
            subprocess.run([COMPILER, "-std=c99", "-Werror", str(path), "-o", program, "-lm"], check=True)
            done = subprocess.run([program, "-p", "int=4"], capture_output=True, text=True, check=True)
            assert done.stdout.startswith("0.25")
            assert hostile in done.stdout
    plain = System({x: -sign(x)}, surfaces=[Surface(hostile, x)])
    path = export_system(plain, tmp_path / "Hostile.mo", x0=(1,), t_span=(0, 2))
    run = rumoca.Session().load(path, model="Hostile").simulate((0.0, 2.0), dt=0.5)
    assert run["x"][-1] == pytest.approx(0.0, abs=1e-6)


def test_15_6_the_command_writes_the_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "thermostat.txt"
    words = ["export", "thermostat", "-p", "K=0.2", "--to", "python", "-o", str(path)]
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == {"model": "thermostat", "file": str(path), "bytes": path.stat().st_size}
    done = subprocess.run([sys.executable, "-I", str(path)], capture_output=True, text=True, check=True)
    first = float(done.stdout.split(",")[0])
    assert first == pytest.approx(5 * math.log((28 - 15) / (28 - 23.5)), rel=1e-9)
    for wrong in (words[:-2], [*words[:-1], str(tmp_path)], ["export", "thermostat", "-o", "x.zip"]):
        assert main(wrong) != 0
        assert capsys.readouterr().err.startswith("filippov: ")


def damped(rng: np.random.Generator) -> tuple[System, tuple[float, float], float]:
    """A body with a kink or a friction in v that hits a floor or a shaken wall: its v changes sign there."""
    x, v = states("x v")
    e, c = rng.uniform(0.4, 0.9), rng.uniform(0.05, 0.4)
    drag = [c * v * abs(v), c * sign(v), c * Max(v, 0)][rng.integers(3)]
    floor = [x, x - 0.1 * sin(5 * t), x + 0.1 * v**2][rng.integers(2)]
    surface = Surface("floor", floor, reset={v: -e * v}, contact=False)
    return System({x: v, v: -9.81 - drag}, surfaces=[surface]), (rng.uniform(0.5, 1.5), rng.uniform(-1, 1)), e


@pytest.mark.parametrize("seed", range(12))
def test_15_6_a_reset_that_crosses_other_surfaces_tells_of_them(seed: int, tmp_path: Path) -> None:
    """The exact run has the crossing of v = 0 that the impact makes; the exported ones had it not."""
    system, x0, _ = damped(np.random.default_rng(seed))
    given = Problem(system, x0, (0, 1.0))
    solution = solve(given, rtol=1e-11, atol=1e-13)
    assert any(event.kind == "reset" for event in solution.events)
    result = load(export_system(given, tmp_path / "drop.py")).run()
    assert result.status == "success", result.message
    agree([(e.t, e.surface, e.kind) for e in result.events], rows_of(solution, math.inf), 1e-8)
    if COMPILER is None:
        return
    source, program = export_system(given, tmp_path / "drop.c"), tmp_path / "drop"
    subprocess.run([COMPILER, "-O1", str(source), "-o", str(program), "-lm"], check=True)
    done = subprocess.run([str(program)], capture_output=True, encoding="utf-8", check=True)
    *rows, _ = [line.split(",") for line in done.stdout.splitlines()]
    agree([(float(row[0]), row[1], row[2]) for row in rows], rows_of(solution, math.inf), 1e-8)
