"""A user's file run by the command: however it ends the program, the exit code tells; stdout stays JSON."""

import io
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np
import pytest
from command import ROOT, command, strict

from filippov import Problem, Sweep, System, UsageError, states
from filippov.app.cli.main import main

MODEL = """
import atexit, os, subprocess, sys, threading
from filippov import Problem, Surface, System, sign, states

x, v = states("x v")
brake = System({x: v, v: -sign(v)})
stop = Problem(brake, x0=(0, 1), t_span=(0, 3))

def field(t, x, p, s):
    LEAVE
    return [x[1], -s[0]]

def h(t, x, p):
    return x[1]

def leaves():
    LEAVE
    return stop

plain = Problem(
    System(field=field, surfaces=[Surface("v", h)], states="x v"), x0=(0, 1), t_span=(0, 3)
)
"""
ENDS = {
    "sys.exit(0)": "SystemExit: 0",
    "sys.exit()": "SystemExit: None",
    "sys.exit('all done')": "SystemExit: all done",
    "sys.exit(3)": "SystemExit: 3",
    "sys.exit(('a', 1))": "SystemExit",
    "raise SystemExit": "SystemExit",
    "raise KeyError('k')": "KeyError",
    "raise GeneratorExit('odd')": "GeneratorExit: odd",
    "raise type('Own', (BaseException,), {})('mine')": "Own: mine",
}


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    # A model of one test is not to be that of the next: modules are kept by name.
    monkeypatch.delitem(sys.modules, "ends", raising=False)
    return tmp_path


@pytest.mark.parametrize("end", sorted(ENDS))
@pytest.mark.parametrize("name", ["plain", "leaves"])
def test_11_20_leaving_the_program_is_no_success(
    end: str, name: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = folder / "ends.py"
    path.write_text(MODEL.replace("LEAVE", end), encoding="utf-8")
    out = folder / "out"
    code = main(["simulate", f"{path}:{name}", "-o", str(out), "--json"])
    printed, said = capsys.readouterr()
    assert code == 1
    assert ENDS[end] in said
    assert "line " in said or "SystemExit" not in ENDS[end]
    assert "Traceback" not in said
    assert not printed
    assert not (out / "summary.json").exists()


def test_11_20_the_line_that_left_is_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = folder / "ends.py"
    path.write_text(MODEL.replace("LEAVE", "sys.exit('text')"), encoding="utf-8")
    lines = path.read_text(encoding="utf-8").splitlines()
    line = next(k for k, text in enumerate(lines, 1) if "exit(" in text)
    assert main(["simulate", f"{path}:plain"]) == 1
    said = capsys.readouterr().err
    assert f"line {line} of {path}" in said
    assert main(["simulate", f"{path}:plain", "--traceback"]) == 1
    assert "Traceback" in capsys.readouterr().err


NOISY = """
import atexit, os, subprocess, sys
from filippov import Problem, Surface, System, sign, states

print("on import")
atexit.register(print, "at the very end")
sys.__stdout__.write("by the other name")
os.write(1, b"past Python")
subprocess.run(["echo", "by another program"], check=True)
""" + MODEL.replace("LEAVE", "print('in the model')")


def test_11_20_stdout_holds_json_only_whatever_prints(folder: Path) -> None:
    path = folder / "noisy.py"
    path.write_text(NOISY, encoding="utf-8")
    for name in ("plain", "leaves"):
        done = command("simulate", f"{path}:{name}", "--json")
        assert done.returncode == 0, done.stderr
        assert strict(done.stdout)["status"] == "success"
        for text in ("on import", "very end", "by the other name", "past Python", "by another program"):
            assert text in done.stderr
        assert "in the model" in done.stderr
    # Without --json stdout is the model's.
    assert "on import" in command("simulate", f"{path}:plain").stdout


def test_11_20_workers_print_to_stderr_too(folder: Path) -> None:
    path = folder / "noisy.py"
    path.write_text(NOISY, encoding="utf-8")
    words = ["sweep", f"{path}:plain", "--over", "x0.x=0:1:4", "-j", "2", "--measure", "end(x)", "--json"]
    done = command(*words)
    assert done.returncode == 0, done.stderr
    assert strict(done.stdout)["points"] == 4


def test_stdout_is_given_back_where_python_goes_on(folder: Path) -> None:
    path = folder / "noisy.py"
    path.write_text(MODEL.replace("LEAVE", "print('heard')"), encoding="utf-8")
    for words in (["--json"], []):
        taken = io.StringIO()
        with redirect_stdout(taken):
            assert main(["simulate", f"{path}:leaves", "--quiet", *words]) == 0
            print("after")
        *document, last = taken.getvalue().splitlines()
        assert last == "after"
        if words:
            assert strict("\n".join(document))["success"] is True
        else:
            assert document == ["heard"]


@pytest.mark.parametrize("closed", ["stdout", "stderr"])
@pytest.mark.skipif(os.name != "posix", reason="a shell of POSIX closes the stream")
def test_a_closed_stream_is_no_traceback(closed: str) -> None:
    number = {"stdout": 1, "stderr": 2}[closed]
    words = f"{sys.executable} -m filippov simulate hunting --t-span 0 1 --json {number}>&-"
    done = subprocess.run(
        ["sh", "-c", words], cwd=ROOT, capture_output=True, text=True, timeout=60, check=False
    )
    if closed == "stdout":
        assert done.returncode == 2
        assert "stdout is closed" in done.stderr
        assert "Traceback" not in done.stderr
    else:
        assert done.returncode == 0
        assert strict(done.stdout)["success"] is True


def test_json_is_utf_8_in_every_locale(folder: Path) -> None:
    path = folder / "größe ∂.py"
    path.write_text(MODEL.replace("LEAVE", "pass"), encoding="utf-8")
    environment = {**os.environ, "PYTHONIOENCODING": "ascii", "LC_ALL": "C", "PYTHONUTF8": "0"}
    done = subprocess.run(
        [sys.executable, "-m", "filippov", "simulate", f"{path}:plain", "--json"], cwd=ROOT,
        env=environment, capture_output=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    # A name that the locale cannot read is kept byte for byte.
    model = strict(done.stdout.decode("utf-8"))["model"]
    assert os.fsencode(model).decode("utf-8", "surrogateescape").endswith("größe ∂.py:plain")


DECAY = """
from filippov import Problem, System, states

x, = states("x")
decay = Problem(System({x: -RATE*x}), x0=(1,), t_span=(0, 1))

def twice(solution):
    return {"twice": 2.0*RATE}
"""


def test_a_file_is_run_as_it_is_now(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Byte code of a text of the same size and second is not taken for it, nor what a process read before."""
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "decay_at_a_rate.py"
    problem = Problem(System({states("x")[0]: 1}), x0=(0,), t_span=(0, 1))
    for rate in ("1.0", "2.0", "3.0"):
        file.write_text(DECAY.replace("RATE", rate))
        os.utime(file, (1e9, 1e9))
        made = io.StringIO()
        with redirect_stdout(made):
            assert main(["simulate", f"{file.name}:decay", "--json", "--quiet"]) == 0
        assert strict(made.getvalue())["x_end"]["x"] == pytest.approx(np.exp(-float(rate)), rel=1e-8)
        sweep = Sweep(problem, {"x0.x": [1, 2]}, measure=f"{file}:twice")
        file.write_text("changed = 'since'")  # while it runs
        with ThreadPoolExecutor(1) as pool:
            assert sweep.run(executor=pool)["twice"].tolist() == [2 * float(rate)] * 2
        assert sweep.run(jobs=1)["twice"].tolist() == [2 * float(rate)] * 2


FAULTS = {
    "def field(t, x, p, s):\n    return [1/0]\n": "ZeroDivisionError: division by zero (line 3 of mine.py)",
    "def field(t, x, p, s):\n    return [p.q]\n": "unknown parameter 'q'; known: k (line 3 of mine.py)",
    "import helper\nfield = helper.field\n": "ValueError (line 2 of helper.py)",
    "import faulty\n": "ZeroDivisionError: division by zero (line 2, line 3 of faulty.py)",
}


@pytest.mark.parametrize("text", FAULTS)
def test_an_error_in_a_file_is_said_with_its_line(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("helper.py").write_text("def field(t, x, p, s):\n    raise ValueError\n")
    Path("faulty.py").write_text("\n\n1/0\n")
    rest = (
        "system = System(field=field, surfaces=[], states='x', parameters={'k': 1.0})\n"
        "problem = Problem(system, x0=(1,), t_span=(0, 1))\n"
    )
    Path("mine.py").write_text(f"from filippov import Problem, System\n{text}{rest}")
    try:
        assert main(["simulate", "mine.py:problem", "--quiet"]) == 1
    finally:
        for name in ("helper", "faulty", "mine"):
            sys.modules.pop(name, None)
    assert FAULTS[text] in capsys.readouterr().err


@pytest.mark.parametrize("value", ["'1.5'", "None", "1j", "[1]", "{}"])
def test_what_a_measure_returns_are_numbers(value: str, tmp_path: Path) -> None:
    problem = Problem(System({states("x")[0]: 1}), x0=(0,), t_span=(0, 1))
    (tmp_path / "mine.py").write_text(f"def own(solution):\n    return {{'a': {value}}}\n")
    with pytest.raises(UsageError, match=r"own: 'a' is .*, expected a number"):
        Sweep(problem, {"x0.x": [1, 2]}, measure=f"{tmp_path}/mine.py:own")
