"""The command: exit codes, streams, suggestions, configuration, progress, interrupts."""

import io
import json
import math
import os
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from command import ROOT, SECTION, command, strict, summary, write_own

from filippov.app.cli.catalogue import commands
from filippov.app.cli.main import main
from filippov.base import progress
from filippov.kernel.tables.layout import RULES
from filippov.solving.solver import solve
from filippov.solving.state.options import METHODS, OPTIONS, Options, options_but

HEAVY = ("numpy", "scipy", "sympy", "numba", "llvmlite", "networkx", "matplotlib", "rich")


@pytest.fixture
def own(tmp_path: Path) -> Path:
    return write_own(tmp_path)


# -- help and streams ------------------------------------------------------------------------------------


@pytest.mark.parametrize("words", [["--help"], ["simulate", "--help"], ["--version"]])
def test_help_imports_nothing_heavy(words: Sequence[str]) -> None:
    code = (
        f"import sys; from filippov.app.cli.main import main; code = main({list(words)!r});"
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
    options = entry.settings
    assert all(len(option.help) > 3 for option in options)
    names = [option.name for option in options]
    assert len(set(names)) == len(names)


def test_choices_are_those_of_python() -> None:
    options = {option.name: option for option in commands()["simulate"].options}
    for name, known in (("method", METHODS), ("sliding", RULES)):
        for value in known:
            assert options[name].read(value, name) == value
        assert options[name].metavar == "{" + ",".join(known) + "}"


def test_13_4_the_options_of_solve_stand_in_one_list() -> None:
    flags = {option.name: option for option in commands()["simulate"].options}
    assert set(OPTIONS) - set(flags) <= {"dense_output", "compile"}
    for name in OPTIONS:
        shown = flags[name].metavar if name in flags else ""
        for word in shown.strip("{}").split(",") if isinstance(shown, str) and shown.startswith("{") else ():
            Options(**{name: word}, dt=1.0 if word == "Moreau" else None)
    assert all(re.search(rf"^    .*\b{name}\b", solve.__doc__ or "", re.MULTILINE) for name in OPTIONS)
    with pytest.raises(AssertionError):
        options_but("rtoll")


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


def test_events_can_be_counted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["simulate", "hunting", "--t-span", "0", "30", "--json"]
    assert main(words) == 0
    kept = strict(capsys.readouterr().out)
    assert main([*words, "--save-events", "count", "-o", str(tmp_path / "run")]) == 0
    out, err = capsys.readouterr()
    counted = strict(out)
    assert sorted(counted["event_counts"], key=str) == sorted(kept["event_counts"], key=str)
    assert "no solution.npz" in err
    assert {path.name for path in (tmp_path / "run").iterdir()} == {
        "events.csv", "trajectory.csv", "summary.json",
    }  # fmt: skip
    assert main([*words, "--save-events", "some"]) == 2
    assert main([*words, "--save-events", "count", "--nonunique", "branch"]) == 2


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
        (["diagram", "hunting", "--t-span", "0", "9"], "an option of simulate, sweep, "),
        (["event-map", "hunting", "--t-span", "0", "9"], "not of event-map, which follows a return"),
        (["simulate", "hunting", "--against", "band"], "an option of compare, not of simulate (see"),
        (["simulate", "hunting", "--rto", "1e-6"], "'--rto'; did you mean '--rtol'?"),
        (["simulate", "hunting", "--method", "DOP85"], "'DOP85'; did you mean 'DOP853'?"),
        (["simulate", "hunting", "--x0", "y=1"], "unknown state 'y'"),
        (["simulate", "hunting", "--x0", "1,2"], "expected 3 numbers (states: x, v, z)"),
        (["simulate", "hunting", "--t-span", "0", "inf"], "expected a finite number"),
        (["simulate", "hunting", "--t-span", "0"], "expected 2 arguments"),
        (["simulate", "hunting", "-p", "P"], "expected name=value"),
        (["simulate", "hunting", "-p", "m=-1"], "outside its bounds"),
        (["simulate", "hunting", "--stop", "velocty"], "did you mean 'velocity'?"),
        (["simulate", "hunting", "--events", "y - 1"], "unknown name 'y'"),
        (["simulate", "hunting", "--events", "x:sideways"], "up, down or both"),
        (["simulate", "hunting", "--events", "x", "--nonunique", "branch"], "one solution"),
        (["simulate", "hunting", "--stop", "velocity:sliding enty"], "did you mean 'sliding entry'?"),
        (["simulate", "hunting", "--max-steps", "1.5"], "expected a whole number"),
        (["simulate", "hunting", "--rtol", "nan"], "expected a finite number"),
        (["simulate", "hunting", "extra"], "'extra'"),
        (["simulate"], "no MODEL was given"),
        (["stability", "hunting", "--solve-for", "p"], "did you mean 'P'?"),
        (["models", "describe"], "which model?"),
        (["models", "lst"], "did you mean 'list'?"),
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
        ("{}:brake", 2, "has no time span and no initial state of its own; give --t-span"),
        ("{}:stop -p k=1", 2, "unknown parameter 'k'"),
        ("nowhere/own.py:brake", 2, "there is no file 'nowhere/own.py'"),
    ],
)
def test_what_is_wrong_with_a_file(
    name: str, code: int, said: str, own: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, *more = name.split(" ", 1)
    assert main(["simulate", path.format(own), *(word for text in more for word in text.split())]) == code
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


# -- progress ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("rich", [True, False])
def test_progress_on_a_terminal(rich: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(progress, "PATIENCE", 0.0)
    if not rich:
        monkeypatch.setitem(sys.modules, "rich.console", None)
    with progress.Progress("counting") as told:
        told(1, 2, "half")
        told(2, 2)
    assert "counting" in screen.getvalue()


def test_progress_is_silent_for_short_work(capsys: pytest.CaptureFixture[str]) -> None:
    with progress.Progress("counting") as told:
        told(1, 2)
    assert capsys.readouterr() == ("", "")


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
        "import sys, filippov.app.cli.main as cli\n"
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


def test_roots_to_watch(capsys: pytest.CaptureFixture[str]) -> None:
    """The second fall through x = 0.05 ends the run."""
    words = ["simulate", "hunting", "--x0", "x=0.1", "--t-span", "0", "50", "--json"]
    assert main([*words, "--events", "x - 1/20:down:2", "--events", "v - b/100"]) == 0
    data = json.loads(capsys.readouterr().out)
    falls = [e for e in data["events"] if e["surface"] == "x - 1/20"]
    assert data["status"] == "stopped"
    assert len(falls) == 2
    assert all(e["kind"] == "user event" for e in falls)
    assert all(abs(e["x"]["x"] - 0.05) < 1e-9 and e["x"]["v"] < 0 for e in falls)
    assert data["t_end"] == falls[-1]["t"]
