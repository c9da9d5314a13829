"""The runs of a case and of its parts, and its expectations put to them, whatever form the case has."""

from __future__ import annotations

import time
from collections.abc import Mapping
from functools import cached_property
from typing import Any

from filippov.app.bank.build import build
from filippov.app.bank.case import Case, Entry
from filippov.app.bank.case_runs import CaseRuns, Settings
from filippov.app.bank.expectation import Expectation, Subject
from filippov.app.bank.form import CaseForm, read_case
from filippov.app.bank.migrate import case as earlier
from filippov.app.bank.outcome import Outcome
from filippov.app.bank.polynomial import read_polynomial
from filippov.base.errors import ModelError
from filippov.base.names import check_known


class Subjects:
    """The runs, or the polynomial, of a case and of its labelled parts, each when it is asked for."""

    def __init__(self, case: Case, settings: Settings, started: float | None = None) -> None:
        self.case, self.settings = case, settings
        self.started = time.monotonic() if started is None else started
        self._made: dict[str, Subject] = {}

    @cached_property
    def form(self) -> CaseForm:
        """The case, checked, where it is of today's form."""
        return read_case(self.case.raw)

    def __call__(self, label: str = "") -> Subject:
        """The runs of a part; "" for the case itself. Raises ModelError."""
        if label not in self._made:
            raw = self.system(label)
            if raw.get("polynomial") is not None and not raw.get("wrong"):
                self._made[label] = read_polynomial(raw, self.settings.max_time)
            else:
                self._made[label] = CaseRuns(build(raw), self.settings, self.started + self.settings.max_time)
        return self._made[label]

    @property
    def field_calls(self) -> int:
        """Evaluations of vector fields."""
        return sum(subject.field_calls for subject in self._made.values() if isinstance(subject, CaseRuns))

    def system(self, label: str = "") -> Mapping[str, Any]:
        """What the case, or a part of it, says of its system. Raises ModelError."""
        raw = self.case.raw
        if self.case.typed:
            assert self.form.id
        elif not raw.get("wrong"):
            return self._earlier(raw, label)
        if not label:
            return raw
        check_known("part", [label], raw.get("parts") or {})
        part: Mapping[str, Any] = raw["parts"][label]
        return {key: raw[key] for key in ("params", "options") if key in raw} | dict(part)

    def _earlier(self, raw: Mapping[str, Any], label: str) -> Mapping[str, Any]:
        if label:
            part = raw["parts"][label]
            if not isinstance(part, Mapping):
                raise ModelError(f"the part {label} is {part!r:.60}, expected an object.")
            raw = {"params": raw.get("params"), "expected": raw.get("expected"), **part}
        return earlier.system(raw)

    def outcome(self, entry: Entry) -> Outcome:
        """The outcome of one expectation. Raises NotUnderstoodError, MissingError, ModelError."""
        if not self.case.typed:
            return earlier.outcome(self.case, entry, self)
        expectation = self.form.expected[self.case.expected.index(entry)]
        return expectation.outcome(self(expectation.part))

    def expectations(self) -> list[Expectation]:
        """What is expected, in the first readings of a case of the earlier form."""
        if self.case.typed:
            return list(self.form.expected)
        return [one for entry in self.case.expected for one in earlier.first_reading(self.case, entry, self)]
