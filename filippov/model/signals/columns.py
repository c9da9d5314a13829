"""Columns of numbers from a file of text."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

from filippov.base.errors import ModelError
from filippov.base.names import unknown
from filippov.base.read_whole import read_text

LARGEST_FILE = 1 << 28


def read_columns(
    path: Path, wanted: Sequence[str | int], preferred: Mapping[int, str] | None = None
) -> list[list[float]]:
    """The columns wanted, by title or number, of a file of values separated by commas.

    preferred   titles by place among those wanted: such a column is taken where there is one

    The first line may hold titles. Raises ModelError for what is no such file.
    """
    try:
        lines = io.StringIO(read_text(path, LARGEST_FILE), newline="")
        reader = csv.reader(lines)
        numbered = [(reader.line_num, row) for row in reader if row and not row[0].startswith("#")]
    except FileNotFoundError:
        raise ModelError(f"there is no file {str(path)!r}: give its path from the present folder.") from None
    except (OSError, ValueError, csv.Error) as error:
        raise ModelError(
            f"{path}: cannot be read as text in columns: {error}. Save it as CSV in UTF-8."
        ) from None
    rows = [row for _, row in numbered]
    if not rows:
        raise ModelError(f"{path}: the file is empty, expected lines such as 0.0,1.5.")
    refuse_other_marks(path, rows)
    titles = [] if _numbers(rows[0]) is not None else [title.strip() for title in rows.pop(0)]
    if not rows:
        raise ModelError(
            f"{path}: below its titles it has no rows of numbers, expected lines such as 0.0,1.5."
        )
    places = []
    for place, given in enumerate(wanted):
        title = (preferred or {}).get(place)
        column = title if title in titles else given
        if isinstance(column, str) and titles.count(column) > 1:
            raise ModelError(f"{path}: the column {column!r} is there twice. Give its number, from 0.")
        if isinstance(column, str) and column not in titles:
            raise ModelError(f"{path}: {unknown('column', column, titles)}")
        if not isinstance(column, str) and column < 0:
            raise ModelError(f"{path}: there is no column {column}: give its title, or its number from 0.")
        places.append(titles.index(column) if isinstance(column, str) else column)
    out: list[list[float]] = [[] for _ in wanted]
    count = len(titles or rows[0])
    if max(places) >= count:
        raise ModelError(
            f"{path}: there is no column {max(places)}: it has {count}, so give a number from 0 to "
            f"{count - 1}."
        )
    for line, row in numbered[1:] if titles else numbered:
        values = _numbers([row[k] for k in places]) if max(places) < len(row) else None
        if values is None:
            raise ModelError(
                f"{path}, line {line}: {','.join(row)[:60]!r} has no numbers in these columns. Expected "
                "numbers with a decimal point in every row."
            )
        if any(row[count:]):
            raise ModelError(
                f"{path}, line {line}: {','.join(row)[:60]!r} has {len(row)} fields, expected {count}. "
                "Numbers have a decimal point, not a comma; a table with decimal commas is read by "
                "pandas.read_csv(path, sep=';', decimal=',')."
            )
        for numbers, value in zip(out, values, strict=True):
            numbers.append(value)
    return out


def refuse_other_marks(
    path: Path, rows: Sequence[Sequence[str]], error: type[Exception] = ModelError
) -> None:
    """Raise `error` for columns that are separated by something else than commas."""
    for mark, name in ((";", "semicolons"), ("\t", "tabs")):
        if all(mark in ",".join(row) for row in rows[:3]):
            raise error(
                f"{path}: its columns are separated by {name}, expected commas, and numbers with a decimal "
                f"point. Convert it: pandas.read_csv({path.name!r}, sep={mark!r}"
                f"{', decimal=' + repr(',') if mark == ';' else ''})"
                f".to_csv({'new-' + path.name!r}, index=False)."
            )


def _numbers(row: Sequence[str]) -> list[float] | None:
    try:
        return [float(text) for text in row]
    except ValueError:
        return None
