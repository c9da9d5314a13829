"""filippov study: a whole study, from the model to the report."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder


def run(settings: dict[str, Any], console: Console) -> int:
    """Run the study and write its report."""
    name = settings["name"]
    from filippov.app.report.study import run_study
    from filippov.solving.state.batch import cores

    folder = Folder(settings["output"] or f"results/{name}", console)
    with console.progress(f"study {name}") as progress:
        output = Path(folder.path or ".")
        summary = run_study(
            name, output, progress=progress, quick=settings["quick"], resolution=settings["resolution"],
            jobs=min(2, cores()),
        )  # fmt: skip
    console.result(summary)
    console.say(f"wrote the report into {folder.path}")
    return 0
