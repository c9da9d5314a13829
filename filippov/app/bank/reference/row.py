"""What one solver made of one case."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from filippov.app.bank.case import Case
from filippov.app.bank.case_runs import Settings
from filippov.app.bank.reference.solver import (
    CannotError,
    HangError,
    Limits,
    ReferenceSolver,
    SaidError,
    given,
    worst,
)
from filippov.app.bank.reference.solvers import FILIPPOV
from filippov.app.bank.run import run_case
from filippov.base.errors import ModelError

OUTCOMES = ("right", "wrong", "silent", "hang", "error", "cannot")


@dataclass(frozen=True)
class SolverRow:
    """What one solver made of one case.

    outcome   "right", "wrong", "silent" (one of several solutions, no warning), "hang" (not done within
              the field calls or the time allowed), "error" (raised, or ended early), "cannot" (the case
              cannot be stated for it: message says why)
    reported  whether the solver said that it succeeded
    error     largest difference of what is compared
    """

    id: str
    solver: str
    outcome: str
    reported: bool
    error: float | None
    message: str = ""


def solver_row(solver: ReferenceSolver, case: Case, limits: Limits, tolerance: float) -> SolverRow:
    """The outcome; whatever the solver raises is one."""
    limits.started = time.monotonic()

    def row(outcome: str, text: object = "", reported: bool = False, error: float | None = None) -> SolverRow:
        return SolverRow(case.id, solver.name, outcome, reported, error, str(text)[:200])

    try:
        problem = given(case)
        states, reported = solver.solve(problem, limits)
    except HangError:
        return row("hang")
    except SaidError as said:
        return row("right" if problem.ambiguous else "error", said)
    except (CannotError, ModelError) as reason:
        if solver in FILIPPOV and isinstance(reason, CannotError):
            return _by_expectations(solver.name, case, limits)
        return row("cannot", reason)
    except Exception as error:  # noqa: BLE001 (a solver may raise anything; it is its outcome)
        return row("error", f"{type(error).__name__}: {error}")
    if not reported:
        return row("error", "ended early")
    if problem.ambiguous:
        return row("silent", "one of several solutions", True)
    gap, ratio = worst(problem, states, tolerance)
    return row("right" if ratio <= 1 else "wrong", "", True, float(gap) if np.isfinite(gap) else None)


def _by_expectations(name: str, case: Case, limits: Limits) -> SolverRow:
    """This package in a case without states at known times, or with more than signs: as `run_bank` has it."""
    method = "Radau" if name.endswith("Radau") else "DOP853"
    settings = Settings(rtol=limits.rtol, atol=limits.atol, method=method, max_time=limits.seconds)
    row = run_case(case, settings)
    outcome = "right" if row.passed else "hang" if row.status == "timeout" else "wrong"
    return SolverRow(case.id, name, outcome, row.status == "success", row.max_error, row.message[:200])
