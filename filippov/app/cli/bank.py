"""filippov bank: run a file of cases with reference values, or put it to reference solvers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from filippov.app.bank import Row, migrate_bank, read_bank, rows_json, run_bank, schema
from filippov.app.bank.case import chosen
from filippov.app.bank.row import head, line, summary, widest
from filippov.app.cli.configuration import unused
from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.base.errors import UsageError
from filippov.base.json_text import json_text

NOT_PASSED, INTERRUPTED = 3, 130
SHOWN = 5


def run(settings: dict[str, Any], console: Console) -> int:
    """Run the cases, compare with reference solvers, migrate, or print the schema; 3 where a case failed."""
    own = {"schema": ("json", "output"), "migrate": ("json", "output", "only", "max_time")}
    if settings["action"] in own:
        kept = {"action", "file", "config", "quiet", "traceback", *own[settings["action"]]}
        others = [name for name in settings if name not in kept]
        unused(settings, others, f"bank {settings['action']} solves nothing")
    if settings["action"] == "schema":
        return _document(settings, console, "schema.json", schema())
    if settings["action"] is None or settings["file"] is None:
        raise UsageError("bank needs what to do and a file: filippov bank run FILE")
    return {"run": _run, "compare": _compare, "migrate": _migrate}[settings["action"]](settings, console)


def _document(settings: dict[str, Any], console: Console, name: str, data: Any) -> int:
    """JSON into the files that were asked for, else to stdout."""
    places = _places(settings, console, name)
    if not places and not console.json:
        console.raw(json_text(data))
    _write(places, console, json_text(data))
    return 0


def _migrate(settings: dict[str, Any], console: Console) -> int:
    given = {} if settings["max_time"] is None else {"max_time": settings["max_time"]}
    data, said = migrate_bank(settings["file"], only=settings["only"], **given)
    for text in said:
        console.say(text)
    return _document(settings, console, "bank.json", data)


def _run(settings: dict[str, Any], console: Console) -> int:
    if settings["solvers"] is not None:
        raise UsageError("--solvers goes with: filippov bank compare FILE")
    given = {
        key: settings[key] for key in ("rtol", "atol", "method", "max_time") if settings[key] is not None
    }
    cases = chosen(read_bank(settings["file"]), settings["only"])
    width, places = widest(case.id for case in cases), _places(settings, console, "rows.json")
    earlier = sum(bool(case.expected) and not case.typed for case in cases)
    if earlier:
        console.say(f"{earlier} of {len(cases)} cases are of the earlier form and migrated on the way")
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
    _write(places, console, rows_json(rows))
    for text in summary(rows):
        console.say(text)
    if interrupted:
        console.warn(f"interrupted; the rows of {len(rows)} of {len(cases)} cases are kept")
        return INTERRUPTED
    failed = [row.id for row in rows if not row.passed]
    if failed:
        console.warn(f"{len(failed)} of {len(rows)} cases did not pass: {', '.join(failed[:SHOWN])}"
                     f"{', ...' if failed[SHOWN:] else ''}")  # fmt: skip
    return NOT_PASSED if failed else 0


def _places(settings: dict[str, Any], console: Console, name: str) -> list[tuple[Folder, str]]:
    """Folders, made and tried, with the names of the files that the JSON goes to."""
    where = settings["json"]
    places = [(Folder(settings["output"], console), name)] if settings["output"] else []
    if isinstance(where, str):
        path = Path(where)
        places.append((Folder(str(path.parent), console), path.name))
    return places


def _write(places: list[tuple[Folder, str]], console: Console, text: str) -> None:
    """The JSON where it was asked for: on stdout, in a file, in the folder of -o."""
    if console.json:
        console.raw(text)
    for folder, name in places:
        folder.content(name, text)
        folder.report()


def _compare(settings: dict[str, Any], console: Console) -> int:
    from filippov.app.bank.compare import compare_bank, solvers_json, solvers_text

    unused(settings, ("jobs",), "the reference solvers run one after the other")
    for name in ("atol", "method"):
        if settings[name] is not None:
            raise UsageError(f"--{name} goes with: filippov bank run FILE")
    given = {key: settings[key] for key in ("rtol", "max_time") if settings[key] is not None}
    code, places = 0, _places(settings, console, "rows.json")
    with console.progress("bank compare") as progress:
        try:
            table = compare_bank(
                settings["file"], only=settings["only"], solvers=settings["solvers"], progress=progress,
                **given,
            )
        except KeyboardInterrupt as interrupt:
            if not interrupt.args:
                raise
            table, code = interrupt.args[0], INTERRUPTED
    _write(places, console, solvers_json(table))
    console.say(solvers_text(table))
    if code:
        console.warn(f"interrupted; {len(table.rows)} rows are kept")
    return code
