"""What lies in the current folder is not run in place of what is installed."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from filippov.app.bank.case import read_bank
from filippov.app.bank.reference.process import SolverProcess
from filippov.app.bank.reference.solver import Limits

ROOT = Path(__file__).resolve().parent.parent
TRAP = """
from pathlib import Path
Path(__file__).with_suffix(".ran").touch()
raise ImportError("a file of the current folder")
"""
CASE = {
    "id": "relay", "states": ["x"], "h": ["x"], "fields": {"+": ["-2"], "-": ["2"]}, "x0": ["1"],
    "t_span": ["0", "1"],
    "expected": [{"name": "final_state", "t": "0.25", "value": ["1/2"], "tol": "1e-9"}],
}  # fmt: skip
TRAPS = ("scipy.py", "numpy.py", "sympy.py", "json.py", "signal.py", "queue.py", "numba.py")


@pytest.fixture
def trapped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in TRAPS:
        (tmp_path / name).write_text(TRAP, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def none_ran(folder: Path) -> bool:
    return not list(folder.glob("*.ran"))


@pytest.mark.parametrize("path", [None, os.pathsep.join(("", ".", "lib"))])
def test_11_23_solvers_are_those_that_are_installed(
    path: str | None, trapped: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if path is None:
        monkeypatch.delenv("PYTHONPATH", raising=False)
    else:
        monkeypatch.setenv("PYTHONPATH", path)
    process = SolverProcess("scipy RK45")
    try:
        row = process.run(read_bank([CASE])[0], Limits(1e-8, 1e-10, 2_000, 60.0), 1e-6)
    finally:
        process.close()
    assert none_ran(trapped)
    assert row.outcome == "right", row


def test_11_23_the_module_run_as_a_command_finds_what_is_installed(trapped: Path) -> None:
    # What Python itself imports before the command begins is not in its hand: the standard library's names.
    for name in ("json.py", "signal.py", "queue.py"):
        (trapped / name).unlink()
    (trapped / "bank.json").write_text(json.dumps([CASE]), encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        [sys.executable, "-m", "filippov", "bank", "run", "bank.json", "--json"], cwd=trapped,
        env=environment, capture_output=True, text=True, timeout=100, check=False,
    )  # fmt: skip
    assert none_ran(trapped)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)[0]["passed"] is True
