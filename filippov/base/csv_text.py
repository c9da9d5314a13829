"""Tables as text with commas: numbers read back equal, text that cannot act as a formula."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any

from filippov.base.escape import cell


def csv_text(columns: Sequence[str], rows: Iterable[Iterable[Any]]) -> str:
    """The table; floats in the shortest form that reads back equal, nothing for None, true and false.

    Text goes through `filippov.base.escape.cell`; a list is one cell, its entries with blanks between them.
    """
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow([cell(name) for name in columns])
    writer.writerows([_written(value) for value in row] for row in rows)
    return table.getvalue()


def _written(value: Any) -> Any:
    if hasattr(value, "item"):
        value = value.item()
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return repr(float(value))
    if isinstance(value, int):
        return int(value)
    if isinstance(value, list | tuple):
        return cell(" ".join(str(_written(v)) for v in value))
    return "" if value is None else cell(value)
