"""The outcome of one case, as data."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from filippov.base.json_text import json_text


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
        return {
            "id": self.id, "passed": self.passed, "max_error": _finite(self.max_error),
            "tolerance": _finite(self.tolerance), "evaluated": list(self.evaluated),
            "not_evaluated": list(self.not_evaluated), "status": self.status, "seconds": self.seconds,
            "message": self.message, "field_calls": self.field_calls,
            "reasons": dict(zip(self.not_evaluated, self.reasons, strict=False)),
        }  # fmt: skip


def rows_json(rows: Iterable[Row]) -> str:
    """The rows as one JSON list."""
    return json_text([row.to_dict() for row in rows])


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)
