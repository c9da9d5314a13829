"""Rules by which a name of the earlier form becomes expectations; a name may have several readings."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from filippov.app.bank.case import Case, Entry
from filippov.app.bank.case_runs import CaseRuns
from filippov.app.bank.expectation import Expectation, Subject
from filippov.app.bank.measures.measure import Measure
from filippov.app.bank.notation import number
from filippov.app.bank.outcome import MissingError, NotUnderstoodError, Outcome
from filippov.app.bank.polynomial import Polynomial
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
    def polynomial(self) -> Polynomial:
        """The polynomial of the case."""
        assert isinstance(self.subject, Polynomial)
        return self.subject

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return self.subject.states if isinstance(self.subject, CaseRuns) else ()

    def number(self, text: Any) -> float:
        """A number in the case's parameters. Raises NotUnderstoodError."""
        try:
            return number(text, self.subject.names)
        except ModelError as error:
            raise NotUnderstoodError(str(error)) from None

    def numbers(self, value: Any) -> Any:
        """A number, or nested lists of numbers as an array. Raises NotUnderstoodError."""
        if isinstance(value, Sequence) and not isinstance(value, str):
            try:
                return np.array([self.numbers(item) for item in value], dtype=float)
            except ValueError:
                raise NotUnderstoodError("the lists are of different lengths") from None
        return self.number(value)

    def wanted(self) -> Any:
        """The expected numbers. Raises NotUnderstoodError where the value is prose."""
        return self.numbers(self.value)

    @property
    def size(self) -> int:
        """How many numbers are expected. Raises NotUnderstoodError where the value is prose."""
        return int(np.size(self.wanted()))

    def e(self, measure: Measure, **compare: Any) -> Expectation:
        """An expectation of this name: of the entry's value, where nothing else is given to compare with."""
        if not {"value", "text", "sign", "least", "most"} & set(compare):
            self.wanted()
            compare["value"] = self.value
        if "text" not in compare:
            compare.setdefault("atol", self.tol)
        return Expectation(self.entry.name, measure, part=self.part, **compare)

    def one(self, measure: Measure, **compare: Any) -> list[Reading]:
        """That expectation as the only reading."""
        return [Reading((self.e(measure, **compare),))]

    def either(self, *chosen: Measure, **compare: Any) -> list[Reading]:
        """A reading for each measure."""
        return [Reading((self.e(measure, **compare),)) for measure in chosen]

    def other(self, first: Measure, second: Measure, **compare: Any) -> Reading:
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


# The groups of a name's pattern by name: state, state2 and state3 are one; None where it did not take part.
Groups = Mapping[str, Any]
Rule = Callable[[Old, Groups], Iterable[Reading]]
RULES: list[tuple[str, type, Rule]] = []


def enter(about: type, *rows: tuple[str, Rule]) -> None:
    """Enter rules for names that match a pattern whole; {state} stands for the names of the case's states.

    They are tried in the order in which they are entered, until one has readings.
    """
    RULES.extend((pattern, about, function) for pattern, function in rows)


def readings(old: Old) -> list[Reading]:
    """What a name may mean. Raises NotUnderstoodError."""
    reason = "no rule knows the name"
    for function, groups in _matching(old):
        try:
            found = list(function(old, groups))
        except NotUnderstoodError as error:
            reason = str(error)
            continue
        if found:
            return found
    raise NotUnderstoodError(reason)


def _matching(old: Old) -> Iterator[tuple[Rule, Groups]]:
    one = "|".join(re.escape(s) for s in sorted(old.states, key=len, reverse=True)) or "(?!)"
    for pattern, about, function in RULES:
        match = re.fullmatch(pattern.replace("{state}", f"(?:{one})"), old.name)
        if match is not None and isinstance(old.subject, about):
            groups: dict[str, Any] = {}
            for name, text in match.groupdict().items():
                key = name.rstrip("23")
                groups[key] = groups.get(key) or text
            yield function, groups


def nearest(old: Old, found: Sequence[Reading]) -> tuple[Outcome, Reading]:
    """The outcome of the reading that is nearest to the value. Raises NotUnderstoodError, MissingError."""
    outcomes: list[tuple[Outcome, Reading]] = []
    missing: Exception = MissingError("the run has no such value")
    understood = False
    for reading in found:
        try:
            outcomes.append(reading.outcome(old.subject))
            understood = True
        except MissingError as error:
            missing, understood = error, True
        except (ModelError, UsageError) as error:
            missing = missing if understood else error
    if not understood:
        raise NotUnderstoodError(str(missing))
    if not outcomes:
        raise missing
    return min(outcomes, key=lambda pair: pair[0].ratio)
