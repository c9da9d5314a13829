"""The file of a bank and its cases, with the checks common to all cases: JSON, nothing is run as code."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from filippov.base.errors import UsageError
from filippov.base.names import unknown
from filippov.base.read_whole import read_json, unread

LARGEST_FILE = 1 << 26


@dataclass(frozen=True)
class Entry:
    """One expectation as in the file, under a name unique in its case."""

    name: str
    given: Mapping[str, Any]


@dataclass(frozen=True)
class Case:
    """One case of a bank: its id, itself as in the file, and its expectations.

    typed  whether its expectations name what they measure; else it has the earlier form and is migrated when
           it is run (see `filippov.app.bank.migrate`)
    """

    id: str
    raw: Mapping[str, Any]
    expected: tuple[Entry, ...]

    @property
    def typed(self) -> bool:
        """Whether it is of today's form."""
        return any("measure" in entry.given for entry in self.expected)


def read_bank(path: str | Path | Sequence[Any] | Mapping[str, Any]) -> list[Case]:
    """The cases of a bank: a JSON file, or what such a file holds ({"cases": [...]} or the list itself).

    A case that is malformed is kept, with what is wrong told when it is run. Raises UsageError where the
    file is no JSON, is larger than LARGEST_FILE, or has no list of cases.
    """
    data = _load(Path(path)) if isinstance(path, str | Path) else path
    cases = data.get("cases") if isinstance(data, Mapping) else data
    if not isinstance(cases, Sequence) or isinstance(cases, str):
        where = f"{str(path)!r}: " if isinstance(path, str | Path) else ""
        raise UsageError(
            f"{where}a bank is a list of cases, or an object with the key 'cases'; neither was found."
        )
    return [_case(item, number) for number, item in enumerate(cases)]


def chosen(cases: Sequence[Case], only: Sequence[str] | None) -> list[Case]:
    """The cases named by id, or by the part of it before the first underscore. Raises UsageError."""
    if only is None:
        return list(cases)
    for name in only:
        if not any(_named(case, name) for case in cases):
            raise UsageError(unknown("case", name, [case.id for case in cases]))
    return [case for case in cases if any(_named(case, name) for name in only)]


def _named(case: Case, name: str) -> bool:
    return name in (case.id, case.id.partition("_")[0])


def _load(path: Path) -> Any:
    try:
        return read_json(path, LARGEST_FILE)
    except OSError as error:
        raise UsageError(f"cannot read the bank {str(path)!r}: {unread(error)}.") from None
    except UsageError:
        raise
    except ValueError as error:
        raise UsageError(f"the bank {str(path)!r} is not JSON: {error}.") from None


def _case(item: Any, place: int) -> Case:
    case_id = f"case {place + 1}"
    if not isinstance(item, Mapping):
        return Case(case_id, {"wrong": f"{case_id} is {item!r:.60}, expected an object."}, ())
    if isinstance(item.get("id"), str) and item["id"].strip():
        case_id = item["id"]
    entries = item.get("expected") or []
    if not isinstance(entries, Sequence) or isinstance(entries, str):
        wrong = f"expected is {entries!r:.60}, a list of objects is needed."
        return Case(case_id, {**item, "wrong": wrong}, ())
    return Case(case_id, item, _entries(item, entries))


def _entries(item: Mapping[str, Any], entries: Sequence[Any]) -> tuple[Entry, ...]:
    """The expectations under names that differ, with the number of events that the case itself gives."""
    every = [entry if isinstance(entry, Mapping) else {} for entry in entries]
    found = [(str(given.get("name", f"expectation {place}")), given) for place, given in enumerate(every, 1)]
    if item.get("n_events") is not None and all(name != "n_events" for name, _ in found):
        found.append(("n_events", {"name": "n_events", "value": item["n_events"], "tol": 0}))
    out: dict[str, Entry] = {}
    times: Counter[str] = Counter()
    for plain, given in found:
        name = plain
        while name in out:
            times[plain] += 1
            name = f"{plain} #{times[plain] + 1}"
        out[name] = Entry(name, given)
    return tuple(out.values())
