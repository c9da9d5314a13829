"""filippov stability: every equilibrium and equilibrium set, with what decides about it."""

from __future__ import annotations

import json
from typing import Any

from filippov.commands.console import Console
from filippov.commands.folder import Folder
from filippov.commands.model import load_model
from filippov.errors import UsageError
from filippov.names import unknown


def run(settings: dict[str, Any], console: Console) -> int:
    """Write the report in its four forms."""
    loaded = load_model(settings["model"])
    values = loaded.values(settings["parameters"])
    wanted = settings["solve_for"]
    if wanted is not None and wanted not in loaded.system.parameters:
        raise UsageError(unknown("parameter", wanted, loaded.system.parameters))
    folder = Folder(settings["output"], console)
    from filippov.analysis import stability as module

    with console.progress("stability"):
        report = module.stability_report(loaded.system, values, solve_for=wanted, budget=settings["budget"])
    console.result(json.loads(report.to_json()))
    console.say(report.to_text())
    folder.content("report.txt", report.to_text())
    folder.content("report.md", report.to_markdown())
    folder.content("report.tex", report.to_latex())
    folder.content("report.json", report.to_json())
    folder.report()
    return 0
