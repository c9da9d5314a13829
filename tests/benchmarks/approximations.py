"""Write the table of docs/comparison.md and the study: python tests/benchmarks/approximations.py [CSV]."""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT)]

from filippov.app.approximations import COLUMNS, table_of_approximations  # noqa: E402
from filippov.base.csv_text import csv_text  # noqa: E402


def cell(value: object) -> object:
    """Three digits, which do not depend on the machine."""
    return f"{value:.3g}" if isinstance(value, float) else value


def main(path: Path) -> None:
    """All plants under all models."""
    rows = table_of_approximations(progress=print)
    text = csv_text(COLUMNS, ([cell(row[name]) for name in COLUMNS] for row in rows))
    path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "models" / "approximations.csv")
