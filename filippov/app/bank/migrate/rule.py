"""Rules by which a name of the earlier form becomes expectations; a name may have several readings."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from filippov.app.bank.case import Case, Entry
from filippov.app.bank.case_runs import CaseRuns
from filippov.app.bank.expectation import Expectation, Subject, numbers
from filippov.app.bank.notation import number
from filippov.app.bank.outcome import MissingError, NotUnderstoodError, Outcome
from filippov.app.bank.quantities.quantity import Quantity
from filippov.base.errors import ModelError, UsageError

LONGEST_TOLERANCE = 100


@dataclass(frozen=True)
class Reading:
    """A meaning of a name: expectations, and the alternative where they cannot be measured."""

    expectations: tuple[Expectation, ...]
    instead: Reading | None = None

    def outcome(self, subject: Subject) -> tuple[Outcome, Reading]:
        """The worst outcome, and the reading that had it. Raises MissingError."""
        try:
            found = [expectation.outcome(subject) for expectation in self.expectations]
        except MissingError:
            if self.instead is None:
                raise
            return self.instead.outcome(subject)
        return max(found, key=lambda outcome: outcome.ratio), self


@dataclass(frozen=True)
class Old:
    """An expectation of the earlier form, with the case's runs or polynomial."""

    case: Case
    entry: Entry
    name: str
    subject: Subject
    part: str = ""

    @property
    def value(self) -> Any:
        """As in the file."""
        return self.entry.given.get("value")

    @property
    def text(self) -> str:
        """The value as text."""
        return str(self.value)

    @property
    def tol(self) -> float:
        """The absolute tolerance; 0 for one that is no number."""
        return tolerance(self.entry.given)

    @property
    def runs(self) -> CaseRuns:
        """The runs of the case."""
        assert isinstance(self.subject, CaseRuns)
        return self.subject

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return self.subject.states if isinstance(self.subject, CaseRuns) else ()

    def number(self, text: Any) -> float:
        """A number in the case's parameters. Raises ModelError."""
        return number(text, self.subject.names)

    def wanted(self) -> Any:
        """The expected numbers. Raises ModelError where the value is prose."""
        return numbers(self.value, self.subject)

    @property
    def size(self) -> int:
        """How many numbers are expected. Raises ModelError where the value is prose."""
        return int(np.size(self.wanted()))

    def e(self, measure: Quantity, **compare: Any) -> Expectation:
        """An expectation of this name: of the entry's value, where nothing else is given to compare with."""
        if not {"value", "text", "sign", "least", "most"} & set(compare):
            self.wanted()
            compare["value"] = self.value
        if "text" not in compare:
            compare.setdefault("atol", self.tol)
        return Expectation(self.entry.name, measure, part=self.part, **compare)

    def one(self, measure: Quantity, **compare: Any) -> list[Reading]:
        """That expectation as the only reading."""
        return [Reading((self.e(measure, **compare),))]

    def either(self, *chosen: Quantity, **compare: Any) -> list[Reading]:
        """A reading for each measure."""
        return [Reading((self.e(measure, **compare),)) for measure in chosen]

    def other(self, first: Quantity, second: Quantity, **compare: Any) -> Reading:
        """The second measure where the first cannot be measured."""
        return Reading((self.e(first, **compare),), Reading((self.e(second, **compare),)))


def tolerance(given: Mapping[str, Any]) -> float:
    """The absolute tolerance of an entry; 0 for one that is no number."""
    tol = given.get("tol", 0)
    try:
        if isinstance(tol, str) and len(tol) > LONGEST_TOLERANCE:
            return 0.0
        return abs(number(tol))
    except ModelError:
        return 0.0


# The named groups of a pattern; None for one that did not take part.
Groups = Mapping[str, Any]
# Patterns of a name, separated by spaces, one of which matches it as a whole, and what it may then mean.
# {one} stands for the name of a state of the case, {state} for the same as a group of that name.
Rules = tuple[tuple[str, Callable[[Old, Groups], Iterable[Reading]]], ...]


def readings(old: Old, rules: Rules) -> list[Reading]:
    """What a name means by the first rule that has readings of it. Raises NotUnderstoodError."""
    one = "|".join(re.escape(s) for s in sorted(old.states, key=len, reverse=True)) or "(?!)"
    reason = "no rule knows the name"
    for patterns, function in rules:
        whole = patterns.replace("{state}", f"(?P<state>{one})").replace("{one}", f"(?:{one})")
        match = next(filter(None, (re.fullmatch(pattern, old.name) for pattern in whole.split())), None)
        if match is None:
            continue
        try:
            found = list(function(old, defaultdict(lambda: None, match.groupdict())))
        except (NotUnderstoodError, ModelError) as error:
            reason, found = str(error), []
        if found:
            return found
    raise NotUnderstoodError(reason)


def nearest(old: Old, found: Sequence[Reading]) -> tuple[Outcome, Reading]:
    """The outcome of the reading that is nearest to the value. Raises NotUnderstoodError, MissingError."""
    outcomes: list[tuple[Outcome, Reading]] = []
    missing: MissingError | None = None
    reason = ""
    for reading in found:
        try:
            outcomes.append(reading.outcome(old.subject))
        except MissingError as error:
            missing = error
        except (ModelError, UsageError) as error:
            reason = str(error)
    if not outcomes:
        raise missing or NotUnderstoodError(reason)
    return min(outcomes, key=lambda pair: pair[0].ratio)
