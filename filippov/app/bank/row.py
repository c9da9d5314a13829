"""The outcome of one case, as data and as a line of a table of text."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from filippov.base.escape import printable
from filippov.base.json_text import finite, json_text

WIDEST_MESSAGE = 100


@dataclass(frozen=True)
class Row:
    """The outcome of one case.

    passed         at least one expectation was evaluated and all evaluated ones are within their tolerance
    max_error, tolerance   of the evaluated expectation that is worst against its tolerance; None without one
    evaluated, not_evaluated   names of expectations
    status         how the run of the case ended: a Status, "complete" for a polynomial, "error", "timeout"
    seconds        wall time
    message        what failed, why something was not evaluated, or how the run ended
    field_calls    evaluations of the vector field
    reasons        for each name in not_evaluated, why
    """

    id: str
    passed: bool
    max_error: float | None
    tolerance: float | None
    evaluated: tuple[str, ...]
    not_evaluated: tuple[str, ...]
    status: str
    seconds: float
    message: str = ""
    field_calls: int = 0
    reasons: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The row as JSON has it."""
        reasons = dict(zip(self.not_evaluated, self.reasons, strict=False))
        found: dict[str, Any] = finite(asdict(self) | {"reasons": reasons})
        return found


def rows_json(rows: Iterable[Row]) -> str:
    """The rows as one JSON list."""
    return json_text([row.to_dict() for row in rows])


def rows_text(rows: Sequence[Row]) -> str:
    """A line for each row, and one that counts them."""
    width = widest(row.id for row in rows)
    lines = [head(width), *(line(row, width) for row in rows), *summary(rows)]
    return "\n".join(lines)


def widest(names: Iterable[str]) -> int:
    """The width of the column of ids, each on one line whatever it holds."""
    return max([len(printable(name)) for name in names], default=4)


def head(width: int) -> str:
    """The names of the columns."""
    return f"{'case':<{width}}  passed     error  tolerance  evaluated  field calls  seconds  message"


def line(row: Row, width: int) -> str:
    """One row; `width` is that of the column of ids."""
    counts = f"{len(row.evaluated)}/{len(row.evaluated) + len(row.not_evaluated)}"
    text = printable(row.message)
    text = text if len(text) <= WIDEST_MESSAGE else text[: WIDEST_MESSAGE - 3] + "..."
    return (
        f"{printable(row.id):<{width}}  {'yes' if row.passed else 'NO':<6}  {_short(row.max_error):>8}  "
        f"{_short(row.tolerance):>9}  {counts:>9}  {row.field_calls:>11}  {row.seconds:>7.2f}  {text}"
    ).rstrip()


def summary(rows: Sequence[Row]) -> list[str]:
    """How many passed, and what was not evaluated."""
    passed = sum(row.passed for row in rows)
    evaluated = sum(len(row.evaluated) for row in rows)
    left = sum(len(row.not_evaluated) for row in rows)
    seconds = sum(row.seconds for row in rows)
    said = (
        f"{passed} of {len(rows)} cases passed; {evaluated} expectations evaluated, {left} not evaluated; "
        f"{seconds:.1f} s"
    )
    left_out = ((row.id, ", ".join(row.not_evaluated)) for row in rows if row.not_evaluated)
    return [said, *(printable(f"  not evaluated in {name}: {names}") for name, names in left_out)]


def _short(value: float | None) -> str:
    return "-" if value is None else f"{value:.2g}"
