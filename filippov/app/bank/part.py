"""Cases within a case: `parts` by label, and which of them an expectation LABEL_name is about."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping

from filippov.app.bank.case import Case, Expectation
from filippov.app.bank.reason import NotUnderstoodError

_LABELLED = re.compile(r"(?P<label>[A-Z]\d+)_(?P<rest>.+)")


def part_of(case: Case, entry: Expectation) -> tuple[str, Expectation]:
    """The label of the part that an expectation is about, "" for the case itself, and its name without it.

    F2_y(20) is y(20) of the part F2. A label that only the prose under `more` explains is not understood; one
    that nothing explains is the case itself.
    """
    match = _LABELLED.fullmatch(entry.name)
    if match is None:
        return "", entry
    inner = dataclasses.replace(entry, name=match["rest"])
    parts = case.raw.get("parts")
    if isinstance(parts, Mapping) and match["label"] in parts:
        return match["label"], inner
    if re.search(rf"\b{match['label']}\s*:", str(case.raw.get("more", ""))):
        raise NotUnderstoodError(f"{match['label']} is told in prose")
    return "", inner


def part(case: Case, label: str) -> Case:
    """The part of that label as a case of its own, with the parameters of the whole where it has none."""
    raw = case.raw["parts"][label]
    if not isinstance(raw, Mapping):
        raise NotUnderstoodError(f"the part {label} is no object")
    return Case(f"{case.id} {label}", {"params": case.raw.get("params"), **raw}, ())
