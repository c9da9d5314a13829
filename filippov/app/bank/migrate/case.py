"""A case of the earlier form, its expectations by name, as one of today's."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from filippov.app.bank import typed_json
from filippov.app.bank.case import Case, Entry
from filippov.app.bank.case_runs import CaseRuns
from filippov.app.bank.expectation import Expectation, Subject
from filippov.app.bank.migrate import events, hybrid, polynomials, sets, states
from filippov.app.bank.migrate.rule import Old, Reading, nearest, readings, tolerance
from filippov.app.bank.outcome import MissingError, NotUnderstoodError, Outcome, OutOfTimeError
from filippov.app.bank.polynomial import Polynomial
from filippov.app.bank.system_form import SystemForm

# In this order: the rules of `sets` end with one that any name of a parameter fits.
_RULES = {CaseRuns: (*events.RULES, *states.RULES, *sets.RULES), Polynomial: polynomials.RULES}
_LABELLED = re.compile(r"(?P<label>[A-Z]\d+)_(?P<rest>.+)")
_SYSTEM = typed_json.hints(SystemForm)
Subjects = Callable[[str], Subject]


def system(raw: Mapping[str, Any]) -> dict[str, Any]:
    """The system of a case, its hybrid text written out, with the tolerances that this form implies.

    rtol is 1e-11; atol 1e-13, or a hundredth of the least tolerance; a step at most a hundredth of the span,
    so that a short pulse in a field that is constant elsewhere is not stepped over.
    """
    out = hybrid.written_out(raw)
    span, entries = out.get("t_span"), raw.get("expected") or ()
    tols = [tolerance(entry) for entry in entries if isinstance(entry, Mapping)]
    accepted = [max(0.01 * tol, 1e-30) for tol in tols if tol > 0]
    options: dict[str, Any] = {"rtol": 1e-11, "atol": min([1e-13, *accepted])}
    if isinstance(span, list | tuple) and len(span) == 2 and str(span[0]) != str(span[1]):
        options["max_step"] = f"Abs(({span[1]})-({span[0]}))/100"
    return {"options": options, **out}


def part_of(case: Case, name: str) -> tuple[str, str]:
    """The label of the part that an expectation is about, "" for the case itself, and its name without it.

    F2_y(20) is y(20) of the part F2. A label that only the prose under `more` explains is not understood; one
    that nothing explains is the case itself.
    """
    match = _LABELLED.fullmatch(name)
    if match is None:
        return "", name
    parts = case.raw.get("parts")
    if isinstance(parts, Mapping) and match["label"] in parts:
        return match["label"], match["rest"]
    if re.search(rf"\b{match['label']}\s*:", str(case.raw.get("more", ""))):
        raise NotUnderstoodError(f"{match['label']} is told in prose")
    return "", match["rest"]


def _read(case: Case, entry: Entry, subjects: Subjects) -> tuple[Old, list[Reading]]:
    label, name = part_of(case, str(entry.given.get("name", entry.name)))
    old = Old(case, entry, name, subjects(label), label)
    return old, readings(old, _RULES[type(old.subject)])


def outcome(case: Case, entry: Entry, subjects: Subjects) -> Outcome:
    """The outcome of an expectation in its nearest reading. Raises NotUnderstoodError, MissingError."""
    return nearest(*_read(case, entry, subjects))[0]


def first_reading(case: Case, entry: Entry, subjects: Subjects) -> tuple[Expectation, ...]:
    """The meaning of an expectation before anything is run; () where it is not understood."""
    try:
        return _read(case, entry, subjects)[1][0].expectations
    except NotUnderstoodError:
        return ()


def migrated(case: Case, subjects: Subjects) -> tuple[dict[str, Any], list[str]]:
    """The case in today's form, with the readings that are nearest in a run, and notes on what to check.

    What could not be carried over is noted, and kept under about. Raises ModelError for a case without a
    problem.
    """
    said: list[str] = []
    expected: list[Expectation] = []
    left: list[Mapping[str, Any]] = []
    for entry in case.expected:
        try:
            old, found = _read(case, entry, subjects)
            try:
                chosen = nearest(old, found)[1]
            except (MissingError, OutOfTimeError) as error:
                chosen = found[0]
                said.append(f"{case.id}: {entry.name}: not measured ({error}); its first reading is taken")
        except NotUnderstoodError as error:
            said.append(f"{case.id}: {entry.name}: not carried over: {error}")
            left.append(entry.given)
            continue
        if len(found) > 1:
            said.append(f"{case.id}: {entry.name}: {len(found)} readings, the nearest one is taken")
        many = enumerate(chosen.expectations)
        expected += [replace(one, name=f"{entry.name} #{k + 1}" if k else entry.name) for k, one in many]
    rows = {k: {"expected": case.raw.get("expected"), **v} for k, v in (case.raw.get("parts") or {}).items()}
    parts = {k: {key: v for key, v in system(row).items() if key in _SYSTEM} for k, row in rows.items()}
    whole = {**system(case.raw), "parts": parts}
    own = {k: whole[k] for k in (*_SYSTEM, "polynomial", "parts") if whole.get(k) not in (None, {}, [])}
    if "polynomial" in own:
        own.pop("options", None)
    gone = {"id", "expected", "hybrid", "more", "n_events", *_SYSTEM, "polynomial", "parts"}
    about = {k: v for k, v in case.raw.items() if k not in gone and v not in (None, "")}
    about |= {"not_carried_over": left} if left else {}
    data = {"id": case.id, **own, "expected": typed_json.written(expected)}
    return data | ({"about": about} if about else {}), said
