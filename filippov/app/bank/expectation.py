"""An expectation: which quantity is measured, and how it is compared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from sympy import Symbol

from filippov.app.bank.case_runs import CaseRuns
from filippov.app.bank.notation import Number, formula, number
from filippov.app.bank.outcome import MissingError, Outcome, compared, compared_texts
from filippov.app.bank.polynomial import Polynomial
from filippov.app.bank.quantities.quantity import Quantity
from filippov.base.errors import ModelError

# Numbers that one formula in n may stand for.
LONGEST_LIST = 100_000
Subject = CaseRuns | Polynomial


@dataclass(frozen=True)
class Expectation:
    """A quantity and what it is expected to be: a value, a text, a sign or bounds.

    name        what the row calls it
    measure     the quantity
    value       a number, a formula in the case's parameters, or nested lists of these
    atol, rtol  accepted: |measured - value| <= atol + rtol |value|, both 0 if left out
    n           [first, last]: value is a formula in n that stands for the list of these n; last null:
                for as many as are measured
    order       any: the entries of a list in any order; set: points, each near one of the other list
    each        the value is that of every measured entry
    text        the measured text, or the list of them
    sign        of the measured number, which is 0 within atol
    least, most  bounds of the measured number, widened by atol
    part        label of the part of the case that it is about
    """

    name: str
    measure: Quantity
    value: Any = None
    atol: Number = 0.0
    rtol: Number = 0.0
    n: tuple[int, int | None] | None = None
    order: Literal["given", "any", "set"] = "given"
    each: bool = False
    text: str | tuple[str, ...] | None = None
    sign: Literal["+", "-", "0"] | None = None
    least: Number | None = None
    most: Number | None = None
    part: str = ""

    def __post_init__(self) -> None:
        given = [
            self.value is not None, self.text is not None, self.sign is not None,
            self.least is not None or self.most is not None,
        ]  # fmt: skip
        if sum(given) != 1:
            raise ModelError(
                f"{self.name} gives {sum(given)} things to compare with, expected one of value, text, sign, "
                "or least and most."
            )

    def outcome(self, subject: Subject) -> Outcome:
        """The error against the tolerance. Raises MissingError, ModelError."""
        if not isinstance(subject, self.measure.ABOUT):
            about = "a polynomial" if self.measure.ABOUT is Polynomial else "a system"
            raise ModelError(f"{self.measure.tag} is a quantity of {about}, which the case is not.")
        got = self.measure(subject)
        if self.text is not None:
            return compared_texts(got, self.text)
        atol, rtol = number(self.atol, subject.names), number(self.rtol, subject.names)
        if self.value is None:
            return self._bounded(float(np.asarray(got, dtype=float).reshape(())), atol, subject)
        count = len(np.atleast_1d(got))
        wanted: Any = numbers(self.value, subject) if self.n is None else self._sequence(subject, count)
        if self.each and np.size(got):
            wanted = np.broadcast_to(wanted, np.shape(got))
        return compared(got, wanted, atol, rtol, self.order)

    def _bounded(self, got: float, atol: float, subject: Subject) -> Outcome:
        if self.sign is not None:
            found = "0" if abs(got) <= atol else "+" if got > 0 else "-"
            wrong = found != self.sign
            return Outcome(float(wrong), 0.0, f"{got:.9g}, expected sign {self.sign}" if wrong else "")
        gap = 0.0 if np.isfinite(got) else np.inf
        if self.least is not None:
            gap = max(gap, number(self.least, subject.names) - got)
        if self.most is not None:
            gap = max(gap, got - number(self.most, subject.names))
        return Outcome(gap, atol, "" if gap <= atol else f"{got:.9g} is out of bounds")

    def _sequence(self, subject: Subject, count: int) -> Any:
        """The numbers that the formula in n stands for."""
        assert self.n is not None
        first, last = self.n
        if last is None and not count:
            raise MissingError("the run has no such value")
        last = first + count - 1 if last is None else last
        if not first <= last < first + LONGEST_LIST:
            raise ModelError(f"n is {self.n}, expected one to {LONGEST_LIST} values.")
        n = Symbol("n", integer=True)
        expression = formula(str(self.value), {**subject.names, "n": n})
        return np.array([number(str(expression.subs(n, k).evalf(20))) for k in range(first, last + 1)])


def numbers(value: Any, subject: Subject) -> Any:
    """A number, or nested lists of them as an array. Raises ModelError."""
    if not isinstance(value, list | tuple):
        return number(value, subject.names)
    rows = [numbers(item, subject) for item in value]
    if len({np.shape(row) for row in rows}) > 1:
        raise ModelError("the lists are of different lengths")
    return np.array(rows, dtype=float)
