"""A process for one solver: what hangs in it is ended, what crashes in it is an outcome.

The process is `python -m filippov.app.bank.reference.process NAME`. It reads cases as lines of JSON and
answers each with its row; nothing else goes to where the rows go, whatever the solver prints.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import queue
import signal
import subprocess
import sys
import threading
from dataclasses import asdict
from pathlib import Path
from typing import Any

import filippov
from filippov.app.bank.case import Case, read_bank
from filippov.app.bank.reference.row import SolverRow, solver_row
from filippov.app.bank.reference.solver import Limits
from filippov.app.bank.reference.solvers import SOLVERS

STARTING = 300.0  # seconds for the interpreter and the solver's module, on any machine
GRACE = 5.0  # seconds beyond those allowed, within which a solver can end by itself


class SolverProcess:
    """Runs the cases of one solver, in a process that is made anew when it had to be ended."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._process: subprocess.Popen[str] | None = None
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()

    def run(self, case: Case, limits: Limits, tolerance: float) -> SolverRow:
        """The row of a case; "hang" where the time is over, "error" where the process died."""
        try:
            given = {"case": {**case.raw, "id": case.id}, "limits": asdict(limits), "tolerance": tolerance}
            print(json.dumps(given), file=self._started().stdin, flush=True)
            answer = self._lines.get(timeout=limits.seconds + GRACE)
        except queue.Empty:
            self.close()
            return SolverRow(case.id, self.name, "hang", False, None, f"ended after {limits.seconds:g} s")
        except BrokenPipeError:
            answer = ""
        if not answer:
            code = self.close()
            return SolverRow(case.id, self.name, "error", False, None, f"its process died (exit code {code})")
        return SolverRow(**json.loads(answer))

    def _started(self) -> subprocess.Popen[str]:
        """The process, ready for a case. Raises queue.Empty when it does not get ready."""
        if self._process is not None and self._process.poll() is None:
            return self._process
        self.close()
        self._process = subprocess.Popen(  # noqa: S603 (this interpreter, a name of SOLVERS)
            [sys.executable, "-P", "-m", "filippov.app.bank.reference.process", self.name],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
            env=_environment(),
        )  # fmt: skip
        self._lines = queue.SimpleQueue()
        threading.Thread(target=_pump, args=(self._process, self._lines), daemon=True).start()
        self._lines.get(timeout=STARTING)
        return self._process

    def close(self) -> int | None:
        """End the process; its exit code."""
        process, self._process = self._process, None
        if process is None:
            return None
        if process.stdin is not None:
            with contextlib.suppress(BrokenPipeError):
                process.stdin.close()
        try:
            # One that is done ends by itself, and says with which code it died.
            return process.wait(timeout=0 if process.poll() is None else None)
        except subprocess.TimeoutExpired:
            process.kill()
            return process.wait()


def _environment() -> dict[str, str]:
    """That of this process, with this package found and nothing of the current folder.

    A file scipy.py there is not the solver; where the process is started by `-m`, Python would run it.
    """
    given = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    paths = [str(Path(filippov.__file__).resolve().parents[1]), *(p for p in given if Path(p).is_absolute())]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "PYTHONSAFEPATH": "1"}


def _pump(process: subprocess.Popen[str], lines: queue.SimpleQueue[str]) -> None:
    """Every line of the process into the queue, and an empty one at its end."""
    assert process.stdout is not None
    with process.stdout as stream:
        for line in stream:
            lines.put(line)
    lines.put("")


def serve(name: str) -> None:
    """Answer cases on stdin until it ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is for who started this process
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    solver = SOLVERS[name]
    importlib.import_module(solver.module)
    print("ready", file=answers, flush=True)
    for line in sys.stdin:
        asked: dict[str, Any] = json.loads(line)
        limits, (case,) = Limits(**asked["limits"]), read_bank([asked["case"]])
        row = solver_row(solver, case, limits, asked["tolerance"])
        print(json.dumps(asdict(row)), file=answers, flush=True)


if __name__ == "__main__":
    serve(sys.argv[1])
