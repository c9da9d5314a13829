"""The base of all quantities: one is computed from a case's runs, numbers or a text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, dataclass_transform

import numpy as np
import sympy
from sympy import Expr, Symbol

from filippov import ModelError, Solution
from filippov import t as time_symbol
from filippov.app.bank.case_runs import CaseRuns, slides
from filippov.app.bank.notation import Number, formula
from filippov.app.bank.outcome import MissingError
from filippov.app.bank.polynomial import Polynomial


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
class Quantity:
    """A quantity by name: a frozen dataclass; called with a case's runs it returns its value.

    Raises MissingError where the case has none.
    """

    FAMILY: ClassVar[tuple[str, dict[str, type]]] = ("quantity", {})
    ABOUT: ClassVar[type] = CaseRuns
    tag: ClassVar[str]

    def __init_subclass__(cls, quantity: str = "", **options: Any) -> None:
        super().__init_subclass__(**options)
        dataclass(frozen=True)(cls)
        if quantity:
            cls.tag = quantity
            Quantity.FAMILY[1][quantity] = cls

    def __call__(self, subject: Any) -> Any:
        raise NotImplementedError


class PolynomialQuantity(Quantity):
    """A quantity of a polynomial."""

    ABOUT = Polynomial


# A time: a number, a formula, or another quantity that is one; where it is left out, the end of the span.
When = Number | Quantity | None
# The times of a quantity: the span of the case, the last period of the solution that the run settles on, its
# first sliding, all of its sliding, or an interval.
Over = Literal["span", "period", "first_sliding", "sliding"] | tuple[When, When]


class Formula(Quantity, quantity="formula"):
    """A formula in parameters and in other quantities by name; lists are evaluated entry by entry."""

    formula: str
    where: dict[str, Quantity] = field(default_factory=dict)

    def __call__(self, subject: Any) -> Any:
        given = {name: np.asarray(measure(subject), dtype=float) for name, measure in self.where.items()}
        symbols = {name: Symbol(name, real=True) for name in given}
        whole = formula(self.formula, {**subject.names, **symbols})
        left = whole.free_symbols - set(symbols.values())
        if left:
            name = min(map(str, left))
            raise ModelError(f"the formula {self.formula[:60]!r} has {name!r}, which has no value here.")
        return sympy.lambdify(list(symbols.values()), whole, "numpy")(*given.values())


def moment(runs: CaseRuns, when: When) -> float:
    """The value of a time; by default the end of the span."""
    if when is None:
        return runs.built.t_span[1]
    if isinstance(when, Quantity):
        return float(np.asarray(when(runs)).reshape(()))
    return runs.number(when)


def segments_over(runs: CaseRuns, over: Over) -> list[tuple[Solution, float, float]]:
    """The parts in one mode of a quantity's times: run, begin and end of each. Raises MissingError."""
    if over == "period":
        run, (low, high) = runs.cycle.run, runs.cycle.span
    elif isinstance(over, tuple):
        low, high = sorted(moment(runs, when) for when in over)
        start, end = runs.built.t_span
        run = runs.covering(high if end >= start else low)
    else:
        run = runs.main
        low, high = sorted((run.problem.t_span[0], run.t_end))
    parts = [(s, max(min(s.t0, s.t1), low), min(max(s.t0, s.t1), high)) for s in run.segments]
    sliding = over in ("first_sliding", "sliding")
    found = [(run, a, b) for s, a, b in parts if b > a and (slides(s.mode) or not sliding)]
    if not found:
        raise MissingError("the run does not slide" if sliding else "the run is over at once")
    return found[:1] if over == "first_sliding" else found


def expression(
    runs: CaseRuns, text: str, where: dict[str, Quantity], given: dict[str, Symbol] | None = None
) -> Expr:
    """A formula in t, the states, the parameters, quantities that are numbers, and given symbols."""
    names = {**runs.names, **(given or {}), "t": time_symbol}
    for name, measure in where.items():
        names[name] = float(np.asarray(measure(runs)).reshape(()))
    return formula(text, names)


def one_of(items: Sequence[Any], number: int, what: str) -> Any:
    """The entry of a number, from 1, or from the end with -1. Raises MissingError."""
    if not number:
        raise ModelError("number is 0, expected 1, 2, ... from the first, or -1, -2, ... from the last.")
    place = number - 1 if number > 0 else number
    if not -len(items) <= place < len(items):
        raise MissingError(f"there are {len(items)} {what}, number {number} is asked for")
    return items[place]
