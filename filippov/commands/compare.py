"""filippov compare: the exact inclusion against its band and regularised models."""

from __future__ import annotations

import importlib
from typing import Any

from filippov.commands.console import Console
from filippov.commands.folder import Folder
from filippov.commands.maps import section_of
from filippov.commands.model import load_model


def run(settings: dict[str, Any], console: Console) -> int:
    """Errors, field calls and times as a table."""
    loaded = load_model(settings["model"])
    values = loaded.values(settings["parameters"])
    section = section_of(loaded, settings)
    folder = Folder(settings["output"], console)
    module = importlib.import_module("filippov.analysis.comparison")
    given = {name: settings[name] for name in ("widths", "alphas") if settings[name] is not None}
    with console.progress("compare") as progress:
        result = module.compare(loaded.system, section, parameters=values, progress=progress, **given)
    rows = [dict(row) for row in result.rows]
    columns = tuple(dict.fromkeys(key for row in rows for key in row))
    console.result({"model": loaded.name, "parameters": values, "rows": rows})
    console.say(result.to_text())
    folder.csv("comparison.csv", columns, ([row.get(key) for key in columns] for row in rows))
    folder.json("comparison.json", {"model": loaded.name, "parameters": values, "rows": rows})
    folder.text("comparison.txt", result.to_text())
    folder.picture("comparison.png", result.plot)
    folder.report()
    return 0
