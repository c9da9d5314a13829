"""A whole bank of the earlier form converted to the present one, with notes on what to check."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from filippov.app.bank.case import chosen, read_bank
from filippov.app.bank.case_runs import Settings
from filippov.app.bank.migrate.case import migrated
from filippov.app.bank.subjects import Subjects
from filippov.base.errors import ModelError, UsageError


def migrate_bank(
    bank: str | Path | Sequence[Any] | Mapping[str, Any],
    *,
    only: Sequence[str] | None = None,
    max_time: float = 120.0,
) -> tuple[dict[str, Any], list[str]]:
    """The bank in today's form, and a line for each expectation that is left out or had to be guessed.

    Names that have several readings are settled by a run: the nearest to the value is taken. A case that is
    no problem is left out and reported. Cases of the present form are kept. max_time: seconds for each case.
    """
    cases: list[Mapping[str, Any]] = []
    said: list[str] = []
    for case in chosen(read_bank(bank), only):
        if case.typed:
            cases.append(case.raw)
            continue
        try:
            data, lines = migrated(case, Subjects(case, Settings(max_time=max_time)))
        except (ModelError, UsageError) as error:
            said.append(f"{case.id}: not carried over: {error}")
        else:
            cases.append(data)
            said += lines
    return {"cases": cases}, said
