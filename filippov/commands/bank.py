"""filippov bank: run a file of cases with reference values, or run it through other solvers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from filippov.bank import Row, read_bank, rows_json, run_bank
from filippov.bank.case import chosen
from filippov.bank.table import head, line, summary
from filippov.commands.console import Console
from filippov.commands.folder import Folder
from filippov.errors import UsageError

NOT_PASSED, INTERRUPTED = 3, 130


def run(settings: dict[str, Any], console: Console) -> int:
    """Run the cases, or compare with peers; 3 where a case did not pass."""
    if settings["action"] is None or settings["file"] is None:
        raise UsageError("bank needs what to do and a file: filippov bank run FILE")
    return _run(settings, console) if settings["action"] == "run" else _compare(settings, console)


def _run(settings: dict[str, Any], console: Console) -> int:
    if settings["peers"] is not None:
        raise UsageError("--peers goes with: filippov bank compare FILE")
    given = {
        key: settings[key] for key in ("rtol", "atol", "method", "max_time") if settings[key] is not None
    }
    cases = chosen(read_bank(settings["file"]), settings["only"])
    width = max([len(case.id) for case in cases], default=4)
    console.say(head(width))
    rows: list[Row] = []

    def told(row: Row) -> None:
        rows.append(row)
        console.say(line(row, width))
        progress(len(rows), max(len(cases), 1), row.id)

    interrupted = False
    with console.progress("bank") as progress:
        try:
            rows = run_bank(
                settings["file"], only=settings["only"], jobs=settings["jobs"], told=told, **given
            )
        except KeyboardInterrupt:
            interrupted = True
    _write(settings, console, rows_json(rows))
    for text in summary(rows):
        console.say(text)
    if interrupted:
        console.warn(f"interrupted; the rows of {len(rows)} of {len(cases)} cases are kept")
        return INTERRUPTED
    return 0 if all(row.passed for row in rows) else NOT_PASSED


def _write(settings: dict[str, Any], console: Console, text: str) -> None:
    """The JSON where it was asked for: on stdout, in a file, in the folder of -o."""
    where = settings["json"]
    if where is True:
        console.raw(text)
    elif isinstance(where, str):
        path = Path(where)
        Folder(str(path.parent), console).text(path.name, text)
    folder = Folder(settings["output"], console)
    folder.text("rows.json", text)
    folder.report()


def _compare(settings: dict[str, Any], console: Console) -> int:
    from filippov.bank.compare import compare_bank, peers_json, peers_text

    for name in ("atol", "method"):
        if settings[name] is not None:
            raise UsageError(f"--{name} goes with: filippov bank run FILE")
    given = {key: settings[key] for key in ("rtol", "max_time") if settings[key] is not None}
    code = 0
    with console.progress("bank compare") as progress:
        try:
            table = compare_bank(
                settings["file"], only=settings["only"], peers=settings["peers"], progress=progress, **given
            )
        except KeyboardInterrupt as interrupt:
            if not interrupt.args:
                raise
            table, code = interrupt.args[0], INTERRUPTED
    _write(settings, console, peers_json(table))
    console.say(peers_text(table))
    if code:
        console.warn(f"interrupted; {len(table.rows)} rows are kept")
    return code
