"""A bank run through reference solvers: which cases each gets right, and which failures it reports."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from filippov.app.bank.case import LARGEST_FILE, chosen, read_bank
from filippov.app.bank.reference.process import SolverProcess
from filippov.app.bank.reference.row import OUTCOMES, SolverRow
from filippov.app.bank.reference.solver import Limits, ReferenceSolver, whole_and_parts
from filippov.app.bank.reference.solvers import FAMILIES, FILIPPOV
from filippov.app.bank.row import widest
from filippov.base.errors import UsageError
from filippov.base.escape import printable
from filippov.base.json_text import json_text
from filippov.base.names import unknown
from filippov.base.read_whole import read_json

_MARKS = {
    "right": "yes", "wrong": "WRONG", "silent": "silent", "hang": "hang", "error": "error", "cannot": "-",
}  # fmt: skip


@dataclass(frozen=True)
class SolverTable:
    """All rows, with the versions of the solvers and what counted as right."""

    rows: tuple[SolverRow, ...]
    versions: Mapping[str, str]
    rtol: float
    tolerance: float
    max_calls: int
    max_time: float

    def count(self, solver: str, outcome: str) -> int:
        """How often a solver had an outcome."""
        return sum((row.solver, row.outcome) == (solver, outcome) for row in self.rows)

    @property
    def solvers(self) -> tuple[str, ...]:
        """Names of the solvers."""
        return tuple(dict.fromkeys(row.solver for row in self.rows))

    @property
    def cases(self) -> tuple[str, ...]:
        """Ids of the cases."""
        return tuple(dict.fromkeys(row.id for row in self.rows))


def compare_bank(
    bank: str | Path | Sequence[Any] | Mapping[str, Any],
    *,
    only: Sequence[str] | None = None,
    solvers: Sequence[str] | None = None,
    rtol: float = 1e-8,
    tolerance: float = 1e-6,
    max_calls: int = 50_000,
    max_time: float = 20.0,
    progress: Callable[..., None] | None = None,
) -> SolverTable:
    """Every case of a system, through every solver naively, each solver in a process of its own.

    solvers    "scipy", "heyoka", "diffrax"; default: those that are installed
    rtol       of every solver; the absolute tolerance is rtol / 100
    tolerance  right means: all that is compared within tolerance (1 + |value|), far above rtol
    max_calls  field calls for each case and solver, max_time: seconds
    progress   called with (done, of, what)

    Cases that are polynomials alone are left out; a case with labelled parts counts as its parts. An
    interrupt ends the run; KeyboardInterrupt carries the table of the finished rows as its argument.
    Raises UsageError for a solver that is unknown or not installed.
    """
    every = (*FILIPPOV, *_solvers(solvers))
    systems = [case for case in chosen(read_bank(bank), only) if case.raw.get("polynomial") is None]
    cases = [one for case in systems for one in whole_and_parts(case)]
    versions = {solver.module: solver.version for solver in every if solver not in FILIPPOV}
    rows: dict[tuple[int, int], SolverRow] = {}

    def table() -> SolverTable:
        done = tuple(rows[k] for k in sorted(rows))
        return SolverTable(done, versions, rtol, tolerance, max_calls, max_time)

    try:
        for column, solver in enumerate(every):
            with closing(SolverProcess(solver.name)) as process:
                for line, case in enumerate(cases):
                    if progress is not None:
                        done = column * len(cases) + line
                        progress(done, len(every) * len(cases), f"{case.id}, {solver.name}")
                    limits = Limits(rtol, rtol / 100, max_calls, max_time)
                    rows[line, column] = process.run(case, limits, tolerance)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(table()) from None
    return table()


def _solvers(names: Sequence[str] | None) -> list[ReferenceSolver]:
    if names is None:
        return [solver for family in FAMILIES.values() for solver in family if solver.installed]
    out: list[ReferenceSolver] = []
    for name in names:
        if name not in FAMILIES:
            raise UsageError(unknown("reference solver", name, FAMILIES))
        if not FAMILIES[name][0].installed:
            raise UsageError(f"the reference solver {name!r} is not installed.")
        out += FAMILIES[name]
    return out


# -- texts ---------------------------------------------------------------------------------------------


def solvers_text(table: SolverTable) -> str:
    """Who gets which case right, and how many each."""
    width = widest(table.cases)
    by = {(row.id, row.solver): row for row in table.rows}

    def line(first: str, cells: Sequence[object]) -> str:
        return f"{first:<{width}}  " + "  ".join(f"{cell:>14}" for cell in cells)

    lines = [line("case", table.solvers)]
    for name in table.cases:
        marks = [_MARKS[by[name, solver].outcome] if (name, solver) in by else "" for solver in table.solvers]
        lines.append(line(printable(name), marks))
    lines += [line(o, [table.count(solver, o) for solver in table.solvers]) for o in OUTCOMES]
    versions = ", ".join(f"{name} {version}" for name, version in table.versions.items())
    lines.append(
        f"{len(table.cases)} cases at rtol {table.rtol:g}; right: within {table.tolerance:g} (1 + |x|); "
        f"at most {table.max_calls} field calls and {table.max_time:g} s; {versions}"
    )
    reasons = {row.id: row.message for row in table.rows if row.outcome == "cannot"}
    lines += [printable(f"  cannot be stated: {name}: {reason}") for name, reason in reasons.items()]
    return "\n".join(lines)


def solvers_json(table: SolverTable) -> str:
    """The table as one JSON object."""
    return json_text(asdict(table))


def read_solvers(path: str | Path) -> SolverTable:
    """The table from what `solvers_json` wrote, today or when it called a solver a peer."""
    try:
        data = read_json(path, LARGEST_FILE)
        rows = [{"solver" if k == "peer" else k: value for k, value in row.items()} for row in data["rows"]]
        return SolverTable(**{**data, "rows": tuple(SolverRow(**row) for row in rows)})
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise UsageError(f"{str(path)!r} is no table of solvers ({type(error).__name__}: {error}).") from None
