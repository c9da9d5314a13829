"""filippov stability: every equilibrium and equilibrium set, with what decides about it."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.model import load_model
from filippov.base.errors import UsageError
from filippov.base.names import unknown


def run(settings: dict[str, Any], console: Console) -> int:
    """Write the report in its four forms, and the certificates if they are asked for."""
    loaded = load_model(settings["model"])
    values = loaded.values(settings["parameters"])
    wanted = settings["solve_for"]
    if wanted is not None and wanted not in loaded.system.parameters:
        raise UsageError(unknown("parameter", wanted, loaded.system.parameters))
    folder = Folder(settings["output"], console)
    from filippov.analysis.local_stability import stability as module

    with console.progress("stability") as progress:
        report = module.stability_report(
            loaded.system, values, solve_for=wanted, modes=settings["modes"] or None, t=settings["t"],
            budget=settings["budget"], progress=progress,
        )  # fmt: skip
    console.result(json.loads(report.to_json()))
    console.say(str(report))
    folder.content("report.txt", report.to_text())
    folder.content("report.md", report.to_markdown())
    folder.content("report.tex", report.to_latex(document=True))
    folder.content("report.json", report.to_json())
    if settings["certify"]:
        with console.progress("certificates"):
            found = module.certify(loaded.system, values, budget=settings["budget"])
        rows = [_row(equilibrium, certificate) for equilibrium, certificate in found]
        for row in rows:
            checked = "".join(f"\n  checked: {text}" for text in row["checked"])
            head = f"{row['mode']} {row['x']}: {row['answer']} ({row['reach']})"
            console.say(f"{head}, {row['theorem']}{checked}")
        folder.content("certificates.json", json.dumps(rows, indent=2) + "\n")
    folder.report()
    return 0


def _row(equilibrium: Any, certificate: Any) -> dict[str, Any]:
    """One equilibrium with its certificate, or with "undecided"."""
    found = {} if certificate is None else dataclasses.asdict(certificate)
    return {
        "mode": equilibrium.mode,
        "x": dict(zip(equilibrium.states, map(str, equilibrium.x), strict=True)),
        "answer": found.get("answer", "undecided"),
        "reach": found.get("reach", "none"),
        "theorem": found.get("theorem", "no certificate"),
        "source": found.get("source", ""),
        "checked": list(found.get("checked", ())),
    }
