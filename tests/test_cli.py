"""The command: exit codes, streams, suggestions, configuration, files, interrupts."""

import csv
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import networkx as nx
import numpy as np
import pytest

from filippov.cli import main
from filippov.commands.catalogue import COMMON, commands
from filippov.solution import Solution

ROOT = Path(__file__).resolve().parent.parent
HEAVY = ("numpy", "scipy", "sympy", "numba", "llvmlite", "networkx", "matplotlib", "rich")
SECTION = (
    "--surface", "velocity", "--event", "sliding entry", "--coordinate", "x",
    "--lift", "x=d, v=0, z=(sign(d)*Fs/P - d)/I",
)  # fmt: skip

# x'' = -sign(x'): from v0 it stops after the time v0.
OWN = """
from filippov import Problem, Surface, System, sign, states

x, v = states("x v")
brake = System({x: v, v: -sign(v)})
stop = Problem(brake, x0=(0, 1), t_span=(0, 3))
number = 7

def made():
    return brake

def needs(a):
    return brake

def slow(t, x, p, s):
    return [x[1], -x[0] - 0.01*s[0]]

plain = System(field=slow, surfaces=[Surface("v", lambda t, x, p: x[1])], states="x v", parameters={"k": 1.0})
"""


@pytest.fixture
def own(tmp_path: Path) -> Path:
    path = tmp_path / "own_model.py"
    path.write_text(OWN, encoding="utf-8")
    return path


def command(*words: str, **options: Any) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "filippov", *words], cwd=ROOT, capture_output=True, text=True, timeout=120,
        check=False, **options,
    )  # fmt: skip


def strict(text: str) -> Any:
    """JSON without NaN and infinities."""

    def refuse(constant: str) -> Any:
        raise AssertionError(constant)

    return json.loads(text, parse_constant=refuse)


def table(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


# -- help and streams ------------------------------------------------------------------------------------


@pytest.mark.parametrize("words", [["--help"], ["simulate", "--help"], ["--version"]])
def test_help_imports_nothing_heavy(words: Sequence[str]) -> None:
    code = (
        f"import sys; from filippov.cli import main; code = main({list(words)!r});"
        f"bad = [m for m in {HEAVY!r} if m in sys.modules];"
        "sys.exit(f'{code} {bad}' if code or bad else 0)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "filippov" in done.stdout
    assert not done.stderr


@pytest.mark.parametrize("name", sorted(commands()))
def test_every_flag_has_help_and_its_command_can_be_loaded(name: str) -> None:
    entry = commands()[name]
    assert callable(entry.load())
    assert entry.help
    assert entry.example.startswith(f"filippov {name}")
    options = (*entry.options, *COMMON)
    assert all(len(option.help) > 3 for option in options)
    names = [option.name for option in options]
    assert len(set(names)) == len(names)


def test_json_goes_to_stdout_and_text_to_stderr() -> None:
    both = command("simulate", "hunting", "--t-span", "0", "1", "--json")
    assert both.returncode == 0
    result = strict(both.stdout)
    assert result["status"] == "success"
    assert result["events"][0]["kind"] == "sliding exit"
    assert "sliding exit on 'velocity'" in both.stderr
    assert both.stderr.isprintable() or "\x1b" not in both.stderr


def test_without_json_stdout_is_empty_and_quiet_is_silent(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "hunting", "--t-span", "0", "1"]) == 0
    out, err = capsys.readouterr()
    assert not out
    assert err
    assert main(["simulate", "hunting", "--t-span", "0", "1", "--quiet"]) == 0
    assert capsys.readouterr() == ("", "")


def test_a_closed_pipe_is_no_traceback() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    done = subprocess.run(
        [sys.executable, "-m", "filippov", "models", "--json", "--quiet"], cwd=ROOT, stdout=writing,
        stderr=subprocess.PIPE, text=True, timeout=60, check=False,
    )  # fmt: skip
    os.close(writing)
    assert done.returncode == 1
    assert not done.stderr


# -- usage: exit 2 with a suggestion ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["simulte", "hunting"], "did you mean 'simulate'?"),
        ([], "no command was given"),
        (["simulate", "huntin"], "unknown model 'huntin'; did you mean 'hunting'?"),
        (["simulate", "hunting", "-p", "Fss=3"], "unknown parameter 'Fss'; did you mean 'Fs'? known: m, P"),
        (["simulate", "hunting", "--rtl", "1e-6"], "'--rtl'; did you mean '--rtol'?"),
        (["simulate", "hunting", "--rto", "1e-6"], "'--rto'; did you mean '--rtol'?"),
        (["simulate", "hunting", "--method", "DOP85"], "'DOP85'; did you mean 'DOP853'?"),
        (["simulate", "hunting", "--x0", "y=1"], "unknown state 'y'"),
        (["simulate", "hunting", "--x0", "1,2"], "expected 3 numbers (states: x, v, z)"),
        (["simulate", "hunting", "--t-span", "0", "inf"], "expected a finite number"),
        (["simulate", "hunting", "--t-span", "0"], "expected 2 arguments"),
        (["simulate", "hunting", "-p", "P"], "expected name=value"),
        (["simulate", "hunting", "-p", "m=-1"], "outside its bounds"),
        (["simulate", "hunting", "--stop", "velocty"], "did you mean 'velocity'?"),
        (["simulate", "hunting", "--stop", "velocity:sliding enty"], "did you mean 'sliding entry'?"),
        (["simulate", "hunting", "--max-steps", "1.5"], "expected a whole number"),
        (["simulate", "hunting", "--rtol", "nan"], "expected a finite number"),
        (["simulate", "hunting", "extra"], "'extra'"),
        (["simulate"], "no MODEL was given"),
        (["stability", "hunting", "--solve-for", "p"], "did you mean 'P'?"),
        (["models", "describe"], "which model?"),
        (["models", "lst"], "did you mean 'list'?"),
        (["event-map", "hunting_lugre", "--interval", "0", "1"], "proposes no section"),
        (["event-map", "hunting", *SECTION[:-1], "x=d,v=0,z=q", "--interval", "0", "1"], "unknown name 'q'"),
        (["event-map", "hunting", *SECTION, "--interval", "1", "0"], "expected LO < HI"),
    ],
)
def test_e6_wrong_usage(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert not out
    assert said in err
    assert "Traceback" not in err


@pytest.mark.parametrize(
    "value",
    ["__import__('os').system('touch {}')", "9**9**9**9", "open('{}','w')", "().__class__", "x", "1/0", "t"],
)
def test_e1_text_is_never_run_as_code(value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mark = tmp_path / "mark"
    text = value.format(mark)
    assert main(["simulate", "hunting", "-p", f"P={text}"]) == 2
    file = tmp_path / "c.toml"
    file.write_text(f"[parameters]\nP = {json.dumps(text)}\n", encoding="utf-8")
    assert main(["simulate", "hunting", "--config", str(file)]) == 2
    assert "expected a number or a formula" in capsys.readouterr().err or value in {"t", "1/0"}
    assert not mark.exists()


# -- values and configuration ----------------------------------------------------------------------------


def summary(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    assert main([*words, "--json", "--quiet"]) == 0
    return strict(capsys.readouterr().out)


def test_numbers_may_be_formulas_and_negative(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["simulate", "hunting", "-p", "P=2*pi**2", "-p", "D=1.5,I=3", "--x0", "x=-1/4"]
    found = summary(capsys, *words, "--t-span", "-1e-1", "-.05")
    assert found["parameters"]["P"] == pytest.approx(2 * math.pi**2, rel=1e-15)
    assert (found["parameters"]["D"], found["parameters"]["I"]) == (1.5, 3.0)
    assert found["x0"] == {"x": -0.25, "v": 0.0, "z": 0.0}
    assert found["t_span"] == [-0.1, -0.05]


def test_flags_go_before_the_commands_table_and_that_before_the_top(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "run.toml"
    file.write_text(
        'model = "hunting"\nrtol = 1e-6\nt_span = [0, "pi"]\njson = true\n'
        "[parameters]\nP = 20\nD = 2\nI = 5\n"
        "[simulate]\nrtol = 1e-7\natol = [1e-9, 1e-9, 1e-10]\nx0 = { x = 0.2 }\n"
        "[simulate.parameters]\nD = 3\nI = 6\n"
        "[graph]\nrecurrent = true\n",
        encoding="utf-8",
    )
    found = summary(capsys, "simulate", "--config", str(file), "-p", "I=7", "--x0", "v=0.1")
    assert found["options"]["rtol"] == 1e-7
    assert found["options"]["atol"] == [1e-9, 1e-9, 1e-10]
    assert found["t_span"] == [0.0, math.pi]
    assert [found["parameters"][k] for k in "PDI"] == [20.0, 3.0, 7.0]
    assert found["x0"] == {"x": 0.2, "v": 0.1, "z": 0.0}
    assert summary(capsys, "simulate", "--config", str(file), "--rtol", "1e-5")["options"]["rtol"] == 1e-5
    assert main(["simulate", "--config", str(file), "--no-json", "--quiet"]) == 0
    assert not capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("rtl = 1e-6", "unknown setting 'rtl'; did you mean 'rtol'?"),
        ("[simulate]\nt_spam = [0, 1]", "[simulate]: unknown setting 't_spam'; did you mean 't_span'?"),
        ("[event-map]\nintervall = [0, 1]", "did you mean 'interval'?"),
        ("interval = [0, 1]", "'interval' is no setting of simulate; it belongs to event-map"),
        ("[simulat]\nrtol = 1", "unknown setting 'simulat'; did you mean 'simulate'?"),
        ("rtol = true", "expected a number"),
        ("rtol = [1", "is not TOML"),
        ("json = 1", "expected true or false"),
        ("t_span = [0, 1, 2]", "has 3 numbers, expected 2"),
        ("config = 'other.toml'", "unknown setting 'config'"),
        ("[parameters]\nPp = 1", "unknown parameter 'Pp'; did you mean 'P'?"),
    ],
)
def test_settings_of_a_file_are_checked(
    text: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "c.toml"
    file.write_text(text, encoding="utf-8")
    assert main(["simulate", "hunting", "--config", str(file)]) == 2
    assert said in capsys.readouterr().err


def test_a_missing_configuration(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "hunting", "--config", str(tmp_path / "no.toml")]) == 2
    assert "cannot read the configuration" in capsys.readouterr().err


# -- models of one's own ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["brake", "stop", "made"])
def test_a_model_in_a_file(name: str, own: Path, capsys: pytest.CaptureFixture[str]) -> None:
    start = [] if name == "stop" else ["--x0", "0,1", "--t-span", "0", "3"]
    found = summary(capsys, "simulate", f"{own}:{name}", *start)
    (event,) = found["events"]
    assert event["t"] == pytest.approx(1.0, abs=1e-12)
    assert event["kind"] == "sliding entry"
    assert found["x_end"]["x"] == pytest.approx(0.5, abs=1e-12)


@pytest.mark.parametrize(
    ("name", "code", "said"),
    [
        ("{}:brak", 2, "did you mean 'brake'? systems in it: brake, stop"),
        ("{}", 2, "name what is in it too"),
        ("{}:number", 2, "is int, expected a System, a Problem, or a function"),
        ("{}:needs", 1, "missing 1 required positional argument: 'a'"),
        ("{}:brake", 2, "has no time span of its own; give --t-span"),
        ("nowhere/own.py:brake", 2, "there is no file 'nowhere/own.py'"),
    ],
)
def test_what_is_wrong_with_a_file(
    name: str, code: int, said: str, own: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", name.format(own)]) == code
    assert said in capsys.readouterr().err


def test_a_file_that_fails_is_named_with_its_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bad_model.py"
    path.write_text("x = 1\ny = undefined\n", encoding="utf-8")
    assert main(["simulate", f"{path}:x"]) == 1
    err = capsys.readouterr().err
    assert "NameError: name 'undefined' is not defined (line 2)" in err
    assert "Traceback" not in err
    assert main(["simulate", f"{path}:x", "--traceback"]) == 1
    assert "Traceback" in capsys.readouterr().err


# -- files -----------------------------------------------------------------------------------------------


def test_simulate_writes_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "new" / "run"
    found = summary(capsys, "simulate", "hunting", "--t-span", "0", "5", "-o", str(out), "--points", "101")
    assert {path.name for path in out.iterdir()} == {
        "events.csv", "trajectory.csv", "solution.npz", "summary.json", "response.png",
    }  # fmt: skip
    solution = Solution.load(out / "solution.npz")
    assert solution.t_end == 5.0
    events = table(out / "events.csv")
    assert [float(row["t"]) for row in events] == [event.t for event in solution.events]
    assert [float(row["t"]) for row in events] == [event["t"] for event in found["events"]]
    rows = table(out / "trajectory.csv")
    assert len(rows) == 101
    sampled = np.array([[float(row[name]) for name in ("x", "v", "z")] for row in rows])
    assert np.array_equal(sampled, solution.sol(np.linspace(0, 5, 101)).T)
    written = strict((out / "summary.json").read_text(encoding="utf-8"))
    assert written == {key: value for key, value in found.items() if key != "events"}
    assert (out / "response.png").read_bytes().startswith(b"\x89PNG")


def test_a_run_that_ends_early_fails_with_its_cause_and_keeps_what_there_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["simulate", "hunting", "--max-steps", "30", "-o", str(tmp_path), "--json"]
    assert main(words) == 1
    out, err = capsys.readouterr()
    assert "max_steps: stopped at t = " in err
    assert strict(out)["success"] is False
    assert 0 < strict((tmp_path / "summary.json").read_text(encoding="utf-8"))["t_end"] < 20


def test_the_output_is_tried_before_the_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "file"
    file.touch()
    assert main(["simulate", "hunting", "-o", str(file)]) == 2
    assert "is a file; name a folder" in capsys.readouterr().err
    assert main(["simulate", "hunting", "-o", str(file / "below")]) == 1
    assert "NotADirectoryError" in capsys.readouterr().err


def test_graph_writes_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = summary(capsys, "graph", "hunting", "-o", str(tmp_path))
    names = {"graph.dot", "graph.graphml", "graph.json", "graph.png"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert {node["id"] for node in found["nodes"]} == {"-", "0", "+"}
    assert set(nx.read_graphml(tmp_path / "graph.graphml").nodes) == {"-", "0", "+"}
    seen = summary(capsys, "graph", "hunting", "--kind", "observed", "--t-span", "0", "3", "--recurrent")
    assert sum(edge["count"] for edge in seen["edges"]) > 0


def test_graph_of_plain_functions_says_what_to_do(own: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["graph", f"{own}:plain"]) == 1
    assert "--kind observed" in capsys.readouterr().err


def test_event_map_writes_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["event-map", "hunting", *SECTION, "--interval", "0.1", "0.4", "--points", "20", "--start", "0.3"]
    found = summary(capsys, *words, "--iterates", "3", "-o", str(tmp_path))
    assert {path.name for path in tmp_path.iterdir()} == {"map.csv", "fixed_points.json", "map.png"}
    rows = table(tmp_path / "map.csv")
    assert [float(row["P"]) for row in rows] == found["P"]
    assert found["orbit"][0] == 0.3
    assert len(found["orbit"]) == 4
    # The reference value of the stable cycle's half: P maps its stick position to the opposite one.
    d = 0.252304806412
    assert np.interp(d, found["d"], found["P"]) == pytest.approx(-d, abs=1e-3)


def test_stability_writes_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    summary(capsys, "stability", "hunting", "-p", "beta=1", "--solve-for", "P", "-o", str(tmp_path))
    assert {path.name for path in tmp_path.iterdir()} == {f"report.{s}" for s in ("txt", "md", "tex", "json")}
    assert "P > 29" in (tmp_path / "report.txt").read_text(encoding="utf-8")
    strict((tmp_path / "report.json").read_text(encoding="utf-8"))


# -- models and doctor -----------------------------------------------------------------------------------


def test_models_are_listed_and_described(own: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = summary(capsys, "models")
    assert {"hunting", "belt", "relay"} <= {entry["name"] for entry in found["models"]}
    one = summary(capsys, "models", "describe", "hunting")
    assert one["states"] == ["x", "v", "z"]
    assert one["field"]["x"] == "v"
    assert "sign(v)" in one["field"]["v"]
    assert [item["name"] for item in one["parameters"]][:2] == ["m", "P"]
    assert summary(capsys, "models", "describe", f"{own}:plain")["field"] is None


def test_e7_doctor_shows_the_traceback_of_a_broken_plug_in(tmp_path: Path) -> None:
    info = tmp_path / "plugs-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: plugs\nVersion: 1.0\n", encoding="utf-8")
    entries = "[filippov.models]\ntorn = torn_plug_in:system\n"
    (info / "entry_points.txt").write_text(entries, encoding="utf-8")
    (tmp_path / "torn_plug_in.py").write_text("raise RuntimeError('torn')\n", encoding="utf-8")
    path = {**os.environ, "PYTHONPATH": str(tmp_path), "FILIPPOV_CACHE": str(tmp_path / "cache")}
    listed = command("models", "--json", env=path)
    assert listed.returncode == 0
    assert "RuntimeError: torn" in strict(listed.stdout)["broken"]["torn"]
    assert "torn: broken plug-in" in listed.stderr
    told = command("doctor", "--json", env=path)
    assert told.returncode == 1
    assert "Traceback" in told.stderr
    report = strict(told.stdout)
    assert report["healthy"] is False
    assert report["cache"]["folder"] == str(tmp_path / "cache")
    assert report["packages"]["numpy"] == np.__version__


# -- interrupts ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("model", ["plain", "hunting"])
def test_d3_ctrl_c_writes_what_there_is(model: str, own: Path, tmp_path: Path) -> None:
    name = model if model == "hunting" else f"{own}:{model}"
    start = [] if model == "hunting" else ["--x0", "1,0", "--nonunique", "stick"]
    out = tmp_path / "out"
    words = ["simulate", name, *start, "--t-span", "0", "1e9", "--max-events", "100000000", "-o", str(out)]
    running = subprocess.Popen(
        [sys.executable, "-m", "filippov", *words, "--json", "--max-step", "1e-3"], cwd=ROOT, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    try:
        assert running.stderr is not None
        line = running.stderr.readline()  # the first word of progress
        assert line.startswith("simulate:"), line
        running.send_signal(signal.SIGINT)
        stdout, stderr = running.communicate(timeout=60)
    finally:
        running.kill()
    assert running.returncode == 130, stderr
    assert strict(stdout)["status"] == "interrupted"
    assert "interrupted: stopped at t = " in stderr
    names = {"events.csv", "trajectory.csv", "solution.npz", "summary.json"}
    assert {path.name for path in out.iterdir()} == names
    assert 0 < strict((out / "summary.json").read_text(encoding="utf-8"))["t_end"] < 1e9
    with np.load(out / "solution.npz", allow_pickle=False) as archive:
        assert np.all(np.diff(archive["t"]) > 0)


def test_ctrl_c_before_there_is_a_result() -> None:
    code = (
        "import sys, filippov.cli as cli\n"
        "def stop(*a): raise KeyboardInterrupt\n"
        "cli.merge = stop\n"
        "sys.exit(cli.main(['doctor']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 130
    assert "interrupted" in done.stderr
    assert "Traceback" not in done.stderr


def test_ctrl_c_keeps_the_part_of_a_map(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from filippov.analysis.event_map import EventMap

    whole, calls = EventMap.returns, []

    def returns(self: EventMap, d: Any) -> Any:
        calls.append(time.monotonic())
        if len(calls) > 1:
            raise KeyboardInterrupt
        return whole(self, d)

    monkeypatch.setattr(EventMap, "returns", returns)
    words = ["event-map", "hunting", *SECTION, "--interval", "0.1", "0.4", "--points", "200"]
    assert main([*words, "-o", str(tmp_path), "--json"]) == 130
    out, err = capsys.readouterr()
    assert "64 of 200 points" in err
    assert strict(out)["complete"] is False
    assert len(table(tmp_path / "map.csv")) == 64
