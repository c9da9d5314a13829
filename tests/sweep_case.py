"""What the tests of sweeps share: x' = -k x with its closed form, and measures that do harm."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from filippov import Problem, Sweep, System, parameters, states
from filippov.sweep.table import SweepTable

ROOT = Path(__file__).resolve().parent.parent

# A measure that does harm looks at k: 1 is the template, which it leaves in peace.
HARM = """
import os, signal, time
from pathlib import Path

HERE = Path(__file__).parent

def plain(solution):
    return {"twice": 2*solution.problem.parameters["k"]}

def kills(solution):
    k = solution.problem.parameters["k"]
    if k == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    if k == 7 and not (HERE / "seven").exists():
        (HERE / "seven").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return {"twice": 2*k}

def slow(solution):
    time.sleep(0.01)
    return {"twice": 2*solution.problem.parameters["k"]}

def stuck(solution):
    while solution.problem.parameters["k"] == 3:
        pass
    return {"twice": 2*solution.problem.parameters["k"]}

def sleeps(solution):
    if solution.problem.parameters["k"] > 5:
        time.sleep(600)
    return {"twice": 2*solution.problem.parameters["k"]}

def hungry(solution):
    if solution.problem.parameters["k"] == 3:
        bytearray(1 << 44)
    return {"twice": 2*solution.problem.parameters["k"]}

def fails(solution):
    if solution.problem.parameters["k"] == 3:
        raise ValueError("no three, please")
    return {"twice": 2*solution.problem.parameters["k"]}
"""
MODEL = """
from filippov import Problem, System, parameters, states

x, = states("x")
p = parameters(k=1.0)
decay = Problem(System({x: -p.k*x}), x0=(1.0,), t_span=(0, 2))
"""
TOML = """
model = "decay.py:decay"
[sweep]
over = {{ k = "1:{count}:{count}" }}
measure = ["end(x)", "harm.py:{measure}"]
"""


def decay() -> Problem:
    (x,) = states("x")
    p = parameters(k=1.0)
    return Problem(System({x: -p.k * x}), x0=(1.0,), t_span=(0, 2))


def write_case(folder: Path, measure: str = "plain", count: int = 8) -> Path:
    """The model, the measures and the configuration in a folder; the path of the measures."""
    (folder / "harm.py").write_text(HARM, encoding="utf-8")
    (folder / "decay.py").write_text(MODEL, encoding="utf-8")
    (folder / "sweep.toml").write_text(TOML.format(measure=measure, count=count), encoding="utf-8")
    return folder / "harm.py"


def sweep_of(harm: Path, measure: str = "plain", count: int = 8, **options: Any) -> Sweep:
    k = np.linspace(1, count, count)
    return Sweep(decay(), {"k": k}, measure=["end(x)", f"{harm}:{measure}"], **options)


def serial(sweep: Sweep, folder: Path | None = None, **how: Any) -> SweepTable:
    """A run in this process."""
    with ThreadPoolExecutor(1) as pool:
        return sweep.run(folder, executor=pool, jobs=1, **how)


def check(table: SweepTable, bad: tuple[int, ...] = ()) -> None:
    """Every point once and right: x(2) = exp(-2 k); `bad` are values of k without a result."""
    assert table.complete
    for k, end, twice, status in zip(table["k"], table["end(x)"], table["twice"], table.status, strict=True):
        if k in bad:
            assert status not in ("success", "")
            assert math.isnan(end)
        else:
            assert status == "success"
            assert abs(end - math.exp(-2 * k)) < 1e-8
            assert twice == 2 * k


def start(folder: Path, *words: str, **options: Any) -> subprocess.Popen[str]:
    """`filippov sweep --config sweep.toml -o out ...` in a process of its own, with a group of its own."""
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    command = [sys.executable, "-m", "filippov", "sweep", "--config", "sweep.toml", "-o", "out", *words]
    return subprocess.Popen(
        command, cwd=folder, env={**os.environ, "PYTHONPATH": path, **options.pop("env", {})}, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, **{"start_new_session": True, **options},
    )  # fmt: skip
