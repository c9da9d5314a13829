"""The file of a bank and its cases, checked as far as every case needs it: JSON, nothing is run as code."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from filippov.base.errors import ModelError, UsageError
from filippov.base.names import unknown
from filippov.model.expression import parse_expression

LARGEST_FILE = 1 << 26
LONGEST_TOLERANCE = 100


@dataclass(frozen=True)
class Expectation:
    """What is expected of one named quantity.

    value   as in the file: numbers as text or numbers, lists of them, or text
    tol     acceptance tolerance, absolute
    fields  the other keys of the entry, such as t and sliding_on
    """

    name: str
    value: Any
    tol: float
    fields: Mapping[str, Any]


@dataclass(frozen=True)
class Case:
    """One case of a bank: its id, its expectations, and the rest as in the file."""

    id: str
    raw: Mapping[str, Any]
    expected: tuple[Expectation, ...]

    def expectation(self, name: str) -> Expectation | None:
        """The expectation of this name."""
        return next((entry for entry in self.expected if entry.name == name), None)


def read_bank(path: str | Path | Sequence[Any] | Mapping[str, Any]) -> list[Case]:
    """The cases of a bank: a JSON file, or what such a file holds ({"cases": [...]} or the list itself).

    A case that is malformed is kept, with what is wrong told when it is run. Raises UsageError where the
    file is no JSON, is larger than LARGEST_FILE, or has no list of cases.
    """
    data = _load(Path(path)) if isinstance(path, str | Path) else path
    cases = data.get("cases") if isinstance(data, Mapping) else data
    if not isinstance(cases, Sequence) or isinstance(cases, str):
        raise UsageError("a bank is a list of cases, or an object with the key 'cases'; neither was found.")
    return [_case(item, number) for number, item in enumerate(cases)]


def chosen(cases: Sequence[Case], only: Sequence[str] | None) -> list[Case]:
    """The cases named by id, or by the part of it before the first underscore. Raises UsageError."""
    if only is None:
        return list(cases)
    for name in only:
        if not any(_named(case, name) for case in cases):
            raise UsageError(unknown("case", name, [case.id for case in cases]))
    return [case for case in cases if any(_named(case, name) for name in only)]


def number(value: Any, names: Mapping[str, Any] | None = None) -> float:
    """A finite number: itself, or text with a formula. Raises ModelError."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise ModelError(f"{value!r} is not a number or a formula.")
    try:
        result = float(value)
    except ValueError:
        result = math.nan
    if math.isnan(result):
        try:
            result = float(parse_expression(str(value), names))
        except (TypeError, OverflowError):
            raise ModelError(f"{str(value)[:80]!r} is not a real number.") from None
    if not math.isfinite(result):
        raise ModelError(f"{str(value)[:80]!r} is not a finite number.")
    return result


def _named(case: Case, name: str) -> bool:
    return name in (case.id, case.id.partition("_")[0])


def _load(path: Path) -> Any:
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise UsageError(f"{str(path)!r} has over {LARGEST_FILE} bytes, too many for a bank.")
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"cannot read the bank {str(path)!r}: {error.strerror or error}.") from None
    except (ValueError, RecursionError) as error:
        raise UsageError(f"the bank {str(path)!r} is not JSON: {error}.") from None


def _case(item: Any, place: int) -> Case:
    if not isinstance(item, Mapping):
        return Case(
            f"case {place + 1}", {"wrong": f"case {place + 1} is {item!r:.60}, expected an object."}, ()
        )
    name = item.get("id")
    case_id = name if isinstance(name, str) and name.strip() else f"case {place + 1}"
    entries = item.get("expected") or []
    if not isinstance(entries, Sequence) or isinstance(entries, str):
        wrong = f"expected is {entries!r:.60}, a list of objects is needed."
        return Case(case_id, {**item, "wrong": wrong}, ())
    return Case(case_id, item, tuple(_expectation(entry, k) for k, entry in enumerate(entries)))


def _expectation(entry: Any, place: int) -> Expectation:
    if not isinstance(entry, Mapping):
        return Expectation(f"expectation {place + 1}", None, 0.0, {})
    tol = entry.get("tol", 0)
    try:
        if isinstance(tol, str) and len(tol) > LONGEST_TOLERANCE:
            raise ModelError(f"tol has {len(tol)} characters, expected at most {LONGEST_TOLERANCE}.")
        tolerance = abs(number(tol))
    except ModelError:
        tolerance = 0.0
    fields = {key: value for key, value in entry.items() if key not in ("name", "value", "tol")}
    return Expectation(
        str(entry.get("name", f"expectation {place + 1}")), entry.get("value"), tolerance, fields
    )
