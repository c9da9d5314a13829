"""A user's file run by the command: however it ends the program, the exit code tells; stdout stays JSON."""

import io
import os
import subprocess
import sys
from contextlib import redirect_stdout
from pathlib import Path

import pytest
from command import ROOT, command, strict

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
