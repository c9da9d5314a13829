"""What the tests of the command share: running it, reading what it writes, a model in a file."""

import csv
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from filippov.app.cli.main import main

ROOT = Path(__file__).resolve().parent.parent
SECTION = (
    "--surface", "velocity", "--event", "sliding entry", "--coordinate", "x",
    "--parametrisation", "x=d, v=0, z=(sign(d)*Fs/P - d)/I",
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


def summary(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    assert main([*words, "--json", "--quiet"]) == 0
    return strict(capsys.readouterr().out)


def write_own(folder: Path) -> Path:
    path = folder / "own_model.py"
    path.write_text(OWN, encoding="utf-8")
    return path
