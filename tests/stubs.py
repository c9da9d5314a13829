"""Writes what type checkers and editors see of a package, after a change of EXPORTS: python tests/stubs.py"""

from __future__ import annotations

import importlib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
STUBS = {
    "filippov": "filippov/__init__.pyi",
    "filippov.analysis": "analysis/__init__.pyi",
    **{f"filippov.{room}": f"filippov/{room}/__init__.pyi" for room in ("app", "graphs", "interop", "plot")},
}
HEAD = "# What this package offers, for type checkers and editors: a name is imported at its first use."
WIDTH = 110


def stub(package: str) -> str:
    """The text of the stub of a package whose names stand in EXPORTS."""
    exports: dict[str, str] = importlib.import_module(package).EXPORTS
    lines = [HEAD, ""]
    for place in sorted(set(exports.values())):
        names = sorted((name for name, own in exports.items() if own == place), key=_order)
        line = f"from {package}.{place} import {', '.join(names)}"
        if len(line) > WIDTH:
            line = f"from {package}.{place} import (\n" + "".join(f"    {name},\n" for name in names) + ")"
        lines.append(line)
    return "\n".join([*lines, "", "__all__ = [", *(f'    "{name}",' for name in sorted(exports)), "]", ""])


def _order(name: str) -> tuple[int, str]:
    """As ruff sorts: constants, classes, the rest."""
    return (0 if name.isupper() and len(name) > 1 else 1 if name[0].isupper() else 2), name


if __name__ == "__main__":
    for package, path in STUBS.items():
        (ROOT / path).write_text(stub(package), encoding="utf-8")
