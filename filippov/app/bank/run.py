"""Run a bank: every case is built, solved and compared; an error in one is a row, not the end of the run."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from filippov import Status
from filippov.analysis.algebra.budget import OutOfBudgetError
from filippov.analysis.algebra.deadline import within
from filippov.app.bank.case import Case, chosen, read_bank
from filippov.app.bank.case_runs import Settings, in_time
from filippov.app.bank.expectation import Subject
from filippov.app.bank.outcome import MissingError, NotUnderstoodError, Outcome, OutOfTimeError
from filippov.app.bank.polynomial import Polynomial
from filippov.app.bank.row import Row
from filippov.app.bank.subjects import Subjects
from filippov.base.given import check_count
from filippov.solving.state.options import Options

Told = Callable[[Row], None]


def run_bank(
    bank: str | Path | Sequence[Any] | Mapping[str, Any],
    *,
    only: Sequence[str] | None = None,
    rtol: float | None = None,
    atol: float | None = None,
    method: str | None = None,
    max_time: float = 120.0,
    jobs: int = 1,
    told: Told | None = None,
) -> list[Row]:
    """One Row per case, in the order of the file.

    bank      a JSON file, or what such a file holds (see `read_bank`)
    only      ids of the cases to run, or their parts before the first underscore
    rtol, atol, method   how all cases are solved; if left out, each has its own options
    max_time  seconds for each case
    jobs      processes
    told      called with every finished row

    An interrupt ends the run; KeyboardInterrupt carries the finished rows as its argument. Raises UsageError
    for a file that is not a bank, an unknown id or option.
    """
    settings = Settings(rtol=rtol, atol=atol, method=method, max_time=max_time)
    Options(**settings.options, max_time=max_time)
    cases = chosen(read_bank(bank), only)
    rows: dict[int, Row] = {}
    try:
        for place, row in _rows(cases, settings, check_count("jobs", jobs)):
            rows[place] = row
            if told is not None:
                told(row)
    except KeyboardInterrupt:
        raise KeyboardInterrupt([rows[k] for k in sorted(rows)]) from None
    return [rows[k] for k in sorted(rows)]


def _rows(cases: Sequence[Case], settings: Settings, jobs: int) -> Iterable[tuple[int, Row]]:
    if jobs == 1 or len(cases) < 2:
        for place, case in enumerate(cases):
            yield place, run_case(case, settings)
        return
    pool = ProcessPoolExecutor(min(jobs, len(cases)), mp_context=get_context("spawn"))
    try:
        left: dict[Future[Row], int] = {
            pool.submit(run_case, case, settings): place for place, case in enumerate(cases)
        }
        for future in as_completed(left):
            place, error = left[future], future.exception()
            said, now = f"{type(error).__name__}: {error}", time.monotonic()
            yield place, future.result() if error is None else _broken(cases[place], said, "error", now)
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def run_case(case: Case, settings: Settings | None = None) -> Row:
    """The outcome of one case; whatever is raised in it becomes a row that did not pass."""
    settings = Settings() if settings is None else settings
    started = time.monotonic()
    subjects = Subjects(case, settings, started)
    try:
        subject = within(settings.max_time, subjects)
    except OutOfBudgetError:
        return _broken(case, f"not built within {settings.max_time:g} s", "timeout", started)
    except Exception as error:  # noqa: BLE001 (a case may be wrong in any way; the others go on)
        return _broken(case, f"{type(error).__name__}: {error}", "error", started)
    outcomes: dict[str, Outcome] = {}
    left: dict[str, str] = {}
    status = ""
    for entry in case.expected:
        try:
            outcomes[entry.name] = in_time(started + settings.max_time, partial(subjects.outcome, entry))
        except NotUnderstoodError as reason:
            left[entry.name] = str(reason)
        except MissingError as reason:
            outcomes[entry.name] = Outcome(float("inf"), 0.0, str(reason))
        except OutOfTimeError:
            outcomes[entry.name] = Outcome(float("inf"), 0.0, f"more than {settings.max_time:g} s")
            status = "timeout"
        except Exception as error:  # noqa: BLE001 (as above)
            outcomes[entry.name] = Outcome(float("inf"), 0.0, f"{type(error).__name__}: {error}")
            status = status or "error"
    ended, message = _end(subject)
    message = message if outcomes else "no expectation could be evaluated"
    return _row(case, outcomes, left, status or ended, started, message, subjects.field_calls)


def _row(
    case: Case, outcomes: dict[str, Outcome], left: dict[str, str], status: str, started: float,
    message: str, field_calls: int = 0,
) -> Row:  # fmt: skip
    failed = {name: outcome for name, outcome in outcomes.items() if not outcome.passed}
    worst = max(outcomes.values(), key=lambda outcome: outcome.ratio, default=None)
    said = "; ".join(f"{name}: {o.note or f'error {o.error:.2g}'}" for name, o in failed.items())
    return Row(
        case.id, bool(outcomes) and not failed, None if worst is None else worst.error,
        None if worst is None else worst.tolerance, tuple(outcomes), tuple(left), status,
        round(time.monotonic() - started, 4), said or message, field_calls, tuple(left.values()),
    )  # fmt: skip


def _end(subject: Subject) -> tuple[str, str]:
    """How the run of a case ended, and what it says where it did not succeed."""
    if isinstance(subject, Polynomial):
        return subject.routh.status, ""
    # A case all of whose expectations were prose may not have been solved.
    ran = subject.__dict__.get("main")
    if ran is None or ran.status is Status.SUCCESS:
        return Status.SUCCESS.value, ""
    return ran.status.value, ran.message


def _broken(case: Case, message: str, status: str, started: float) -> Row:
    """The row of a case that could not be put to the solver."""
    return _row(case, {}, {entry.name: message for entry in case.expected}, status, started, message)
