"""filippov export: the exact automaton of a model as Python, C, Modelica or an FMU."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from filippov import UsageError, export_system
from filippov.app.cli.console import Console
from filippov.app.cli.model import load_model
from filippov.base.escape import printable


def run(settings: dict[str, Any], console: Console) -> int:
    """Write the file."""
    if settings["output"] is None:
        raise UsageError("no file was given: name it with -o FILE (.py, .c, .mo, .fmu).")
    loaded = load_model(settings["model"])
    has_start = settings["x0"] is not None or loaded.x0 is not None
    path = export_system(
        loaded.system, Path(settings["output"]), settings["to"],
        parameters=loaded.values(settings["parameters"]),
        x0=loaded.state(settings["x0"]) if has_start else None,
        t_span=settings["t_span"] or loaded.t_span,
    )  # fmt: skip
    console.result({"model": loaded.name, "file": str(path), "bytes": path.stat().st_size})
    console.say(f"wrote {printable(path)}")
    return 0
