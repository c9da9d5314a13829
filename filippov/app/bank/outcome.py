"""Expectations by name: a registry of patterns, each with the function that works out what the case gives.

A reader is entered with `@reads(pattern, text)`. Patterns are matched against the whole name, in the order
of entry; {state} in a pattern stands for the names of the case's states. A reader returns

    a number, a list of numbers, or several such readings in `Either` (the nearest one counts), compared
    with the value within its tolerance, or
    an Outcome of its own.

It raises NotUnderstoodError for what it cannot evaluate and MissingError for what the case should have and
has not.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from filippov.app.bank.case import Case, Expectation, number
from filippov.app.bank.motion import Motion
from filippov.app.bank.polynomial import Polynomial
from filippov.app.bank.reason import MissingError, NotUnderstoodError
from filippov.base.errors import ModelError

ROUNDING = 8 * np.finfo(float).eps


@dataclass(frozen=True)
class Outcome:
    """The error of one expectation against its tolerance."""

    error: float
    tolerance: float
    note: str = ""

    @property
    def passed(self) -> bool:
        """Whether the error is within the tolerance."""
        return bool(self.error <= self.tolerance)

    @property
    def ratio(self) -> float:
        """Error over tolerance."""
        if self.error <= self.tolerance and self.tolerance == 0:
            return 0.0
        return self.error / self.tolerance if self.tolerance else np.inf


class Either(list[Any]):
    """Several readings of one name; the nearest to the expected value counts."""


@dataclass(frozen=True)
class Ask:
    """One expectation of one case, put to a reader.

    subject  the runs of the case, or its polynomial
    """

    case: Case
    entry: Expectation
    subject: Motion | Polynomial

    @property
    def motion(self) -> Motion:
        """The runs of the case."""
        assert isinstance(self.subject, Motion)
        return self.subject

    @property
    def polynomial(self) -> Polynomial:
        """The polynomial of the case."""
        assert isinstance(self.subject, Polynomial)
        return self.subject

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return self.motion.built.system.states if isinstance(self.subject, Motion) else ()

    @property
    def names(self) -> Mapping[str, Any]:
        """What names stand for in the case's formulas."""
        return self.subject.built.names if isinstance(self.subject, Motion) else self.subject.names

    def number(self, text: Any) -> float:
        """A number in the case's parameters. Raises NotUnderstoodError."""
        try:
            return number(text, self.names)
        except ModelError as error:
            raise NotUnderstoodError(str(error)) from None

    def wanted(self) -> Any:
        """The expected value as a number or an array. Raises NotUnderstoodError where it is prose."""
        return self.numbers(self.entry.value)

    def numbers(self, value: Any) -> Any:
        """A number, or nested lists of numbers as an array."""
        if isinstance(value, Sequence) and not isinstance(value, str):
            return np.array([self.numbers(item) for item in value], dtype=float)
        return self.number(value)

    def compare(self, got: Any, wanted: Any) -> Outcome:
        """Largest difference; what is a count or a list of another length is wrong by so many."""
        if isinstance(got, Either):
            if not got:
                raise MissingError("the run has no such value")
            outcomes = [self.compare(reading, wanted) for reading in got]
            return min(outcomes, key=lambda outcome: outcome.ratio)
        a, b = np.asarray(got, dtype=float), np.asarray(wanted, dtype=float)
        if a.shape != b.shape and a.size == b.size == 1:
            a, b = a.reshape(()), b.reshape(())
        if a.shape != b.shape:
            return Outcome(max(abs(a.size - b.size), 1.0), 0.0, f"{a.size} values, expected {b.size}")
        tolerance = max(self.entry.tol, ROUNDING * float(np.max(np.abs(b), initial=0.0)))
        gap = np.abs(a - b)
        error = float(np.max(gap, initial=0.0)) if np.all(np.isfinite(gap)) else np.inf
        note = "" if error <= tolerance else f"{_short(a)}, expected {_short(b)}"
        return Outcome(error, tolerance, note)


Reader = Callable[[Ask, re.Match[str]], Any]


@dataclass(frozen=True)
class Pattern:
    """One entry of the registry; `about` says whether it asks a "motion" or a "polynomial"."""

    pattern: str
    text: str
    reader: Reader
    about: str

    def match(self, name: str, states: Sequence[str]) -> re.Match[str] | None:
        """The match of the whole name."""
        one = "|".join(re.escape(s) for s in sorted(states, key=len, reverse=True)) or "(?!)"
        return re.fullmatch(self.pattern.replace("{state}", f"(?:{one})"), name)


ENTERED: list[Pattern] = []


def reads(pattern: str, text: str, about: str = "motion") -> Callable[[Reader], Reader]:
    """Enter a reader for names that match the pattern."""

    def enter(reader: Reader) -> Reader:
        ENTERED.append(Pattern(pattern, text, reader, about))
        return reader

    return enter


def _short(value: Any) -> str:
    flat = np.atleast_1d(value).ravel()
    text = ", ".join(f"{v:.9g}" for v in flat[:4])
    return text + (", ..." if flat.size > 4 else "")
