"""Run a bank: every case is built, solved and compared; what goes wrong in one is its row, not the end."""

from __future__ import annotations

import dataclasses
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from filippov.analysis.algebra.budget import OutOfBudgetError
from filippov.analysis.algebra.deadline import within
from filippov.app.bank.build import build
from filippov.app.bank.case import Case, Expectation, chosen, read_bank
from filippov.app.bank.expect import readers
from filippov.app.bank.motion import Motion, Settings
from filippov.app.bank.outcome import Ask, Outcome
from filippov.app.bank.part import part, part_of
from filippov.app.bank.polynomial import Polynomial, read_polynomial
from filippov.app.bank.reason import MissingError, NotUnderstoodError, OutOfTimeError
from filippov.app.bank.row import Row
from filippov.base.errors import UsageError
from filippov.base.status import Status
from filippov.solving.state.options import Options

Told = Callable[[Row], None]


def run_bank(
    bank: str | Path | Sequence[Any] | Mapping[str, Any],
    *,
    only: Sequence[str] | None = None,
    rtol: float = 1e-11,
    atol: float = 1e-13,
    method: str = "DOP853",
    max_time: float = 120.0,
    jobs: int = 1,
    told: Told | None = None,
) -> list[Row]:
    """One Row a case, in the order of the file.

    bank      a JSON file, or what such a file holds (see `read_bank`)
    only      ids of the cases to run, or their parts before the first underscore
    rtol, atol, method   how they are solved; atol is at most a hundredth of the least tolerance of a case
    max_time  seconds for each case
    jobs      processes
    told      called with every row when it is there

    An interrupt ends the run; KeyboardInterrupt carries the rows that are there as its argument. Raises
    UsageError for a file that is no bank, an unknown id or option.
    """
    settings = Settings(rtol=rtol, atol=atol, method=method, max_time=max_time)
    Options(rtol=rtol, atol=atol, method=method, max_time=max_time)
    if type(jobs) is not int or jobs < 1:
        raise UsageError(f"jobs is {jobs!r}, expected a whole number of at least 1.")
    cases = chosen(read_bank(bank), only)
    rows: dict[int, Row] = {}
    try:
        for place, row in _rows(cases, settings, jobs):
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
        while left:
            done, _ = wait(left, return_when=FIRST_COMPLETED)
            for future in done:
                place = left.pop(future)
                error = future.exception()
                if error is None:
                    yield place, future.result()
                else:
                    yield place, _broken(cases[place], f"{type(error).__name__}: {error}", "error", 0.0)
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def run_case(case: Case, settings: Settings | None = None) -> Row:
    """The outcome of one case; whatever is raised in it becomes a row that did not pass."""
    settings = _fine_enough(case, Settings() if settings is None else settings)
    started = time.monotonic()
    try:
        subject = within(settings.max_time, lambda: _subject(case, settings, started))
    except OutOfBudgetError:
        return _broken(case, f"not built within {settings.max_time:g} s", "timeout", started)
    except Exception as error:  # noqa: BLE001 (a case may be wrong in any way; the others go on)
        return _broken(case, _sentence(error), "error", started)
    outcomes: dict[str, Outcome] = {}
    left: dict[str, str] = {}
    status = ""
    subjects = {"": subject}

    def outcome(entry: Expectation) -> Outcome:
        label, inner = part_of(case, entry)
        if label not in subjects:
            subjects[label] = _subject(part(case, label), settings, started)
        return evaluate(Ask(case, inner, subjects[label]))

    for name, entry in _entries(case):
        try:
            outcomes[name] = _in_time(started + settings.max_time, partial(outcome, entry))
        except NotUnderstoodError as reason:
            left[name] = str(reason)
        except MissingError as reason:
            outcomes[name] = Outcome(float("inf"), entry.tol, str(reason))
        except OutOfTimeError:
            outcomes[name] = Outcome(float("inf"), entry.tol, f"more than {settings.max_time:g} s")
            status = "timeout"
        except Exception as error:  # noqa: BLE001 (as above)
            outcomes[name] = Outcome(float("inf"), entry.tol, _sentence(error))
            status = status or "error"
    row = _row(case, subject, outcomes, left, status or _status(subject), started)
    calls = sum(other.field_calls for other in subjects.values() if isinstance(other, Motion))
    return dataclasses.replace(row, field_calls=calls)


def _in_time(deadline: float, function: Callable[[], Outcome]) -> Outcome:
    """function(), ended also where it computes with formulas for ever. Raises OutOfTimeError."""
    left = deadline - time.monotonic()
    if left <= 0.0:
        raise OutOfTimeError
    try:
        return within(left, function)
    except OutOfBudgetError:
        raise OutOfTimeError from None


def _fine_enough(case: Case, settings: Settings) -> Settings:
    """The settings with an absolute tolerance of at most a hundredth of what the case accepts."""
    accepted = [entry.tol for entry in case.expected if entry.tol > 0]
    return dataclasses.replace(settings, atol=min([settings.atol, *(max(0.01 * a, 1e-30) for a in accepted)]))


def _subject(case: Case, settings: Settings, started: float) -> Motion | Polynomial:
    if case.raw.get("polynomial") is not None and not case.raw.get("wrong"):
        return read_polynomial(case.raw, settings.max_time)
    return Motion(build(case.raw), settings, started + settings.max_time)


def _entries(case: Case) -> list[tuple[str, Expectation]]:
    """The expectations under names that differ, with the number of events that the case itself gives."""
    entries = list(case.expected)
    count = case.raw.get("n_events")
    if count is not None and all(entry.name != "n_events" for entry in entries):
        entries.append(Expectation("n_events", count, 0.0, {}))
    out: dict[str, Expectation] = {}
    times: Counter[str] = Counter()
    for entry in entries:
        name = entry.name
        while name in out:
            times[entry.name] += 1
            name = f"{entry.name} #{times[entry.name] + 1}"
        out[name] = entry
    return list(out.items())


def evaluate(ask: Ask) -> Outcome:
    """The outcome of one expectation. Raises NotUnderstoodError, MissingError."""
    reason = "no reader knows the name"
    about = "motion" if isinstance(ask.subject, Motion) else "polynomial"
    for pattern, match in readers.matching(ask.entry.name, ask.states, about):
        try:
            found = pattern.reader(ask, match)
            return found if isinstance(found, Outcome) else ask.compare(found, ask.wanted())
        except NotUnderstoodError as error:
            reason = str(error)
    raise NotUnderstoodError(reason)


def _row(
    case: Case,
    subject: Motion | Polynomial,
    outcomes: dict[str, Outcome],
    left: dict[str, str],
    status: str,
    started: float,
) -> Row:
    failed = {name: outcome for name, outcome in outcomes.items() if not outcome.passed}
    worst = max(outcomes.values(), key=lambda outcome: outcome.ratio, default=None)
    message = "; ".join(f"{name}: {o.note or f'error {o.error:.2g}'}" for name, o in failed.items())
    if not outcomes:
        message = "no expectation could be evaluated"
    if not message and isinstance(subject, Motion) and status not in ("success", "complete"):
        message = subject.main.message
    return Row(
        case.id, bool(outcomes) and not failed, None if worst is None else worst.error,
        None if worst is None else worst.tolerance, tuple(outcomes), tuple(left), status,
        round(time.monotonic() - started, 4), message,
        0, tuple(left.values()),
    )  # fmt: skip


def _status(subject: Motion | Polynomial) -> str:
    if isinstance(subject, Polynomial):
        return subject.routh.status
    # A case all of whose expectations were prose may not have been solved.
    ran = subject.__dict__.get("main")
    return ran.status.value if ran is not None else Status.SUCCESS.value


def _broken(case: Case, message: str, status: str, started: float) -> Row:
    """The row of a case that could not be put to the solver."""
    names = tuple(name for name, _ in _entries(case))
    seconds = round(time.monotonic() - started, 4) if started else 0.0
    return Row(case.id, False, None, None, (), names, status, seconds, message, 0, (message,) * len(names))


def _sentence(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}"
