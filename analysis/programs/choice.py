"""Values of a program that is followed on both sides of its conditions, and how two of them become one.

A value is a number, an expression of sympy, a condition, text, None, a function, a list, tuple, dict or
array of values. An array is one of numpy with objects in it.
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from typing import Any

import numpy as np
import sympy
from sympy import ITE, And, Expr, Not, Or, Symbol, Xor
from sympy.core.relational import Ge, Gt, Le, Lt
from sympy.logic.boolalg import Boolean, BooleanFalse, BooleanTrue

from filippov.model.check import as_expression
from filippov.model.symbolic import Select

Elements = Callable[[Any, Any], Any]
NUMBERS = (int, float, np.integer, np.floating)


class Nothing:
    """What stands where a path has no value: a name not set, a function left by an exception."""

    def __init__(self, why: str) -> None:
        self.why = why


class Choice:
    """One of two words (texts or members of an enumeration), as a condition decides."""

    def __init__(self, condition: Any, yes: Any, no: Any) -> None:
        self.condition, self.yes, self.no = condition, yes, no


def is_number(value: Any) -> bool:
    """Whether a value is a plain number (True and False are some)."""
    return isinstance(value, (bool, np.bool_, *NUMBERS))


def is_condition(value: Any) -> bool:
    """Whether a value is a condition that is not decided. A Symbol is a number here."""
    return (
        isinstance(value, Boolean)
        and not isinstance(value, Symbol)
        and value not in {sympy.true, sympy.false}
    )


def plain(value: Any) -> Any:
    """The same as a plain bool where sympy decided it."""
    if isinstance(value, (BooleanTrue, BooleanFalse)):
        return bool(value)
    return value


def as_number(value: Any) -> Any:
    """A condition as 1 or 0, anything else as it is."""
    if is_condition(value):
        return select(value, sympy.S.One, sympy.S.Zero)
    return int(value) if isinstance(value, (bool, np.bool_)) else value


def expression(value: Any) -> Any:
    """A number or condition as an expression of sympy."""
    return as_expression(as_number(value), "a value of the program")


def elementwise(function: Callable[..., Any], *values: Any) -> Any:
    """A function of numbers, carried out for each element where an argument is an array."""
    if any(isinstance(value, np.ndarray) for value in values):
        cast = [np.asarray(v, dtype=object) if isinstance(v, (list, tuple)) else v for v in values]
        return np.asarray(np.frompyfunc(function, len(values), 1)(*cast), dtype=object)
    return function(*values)


def select(condition: Any, yes: Any, no: Any) -> Any:
    """Select(h, yes, no) for a comparison, nested ones for several: a Piecewise would unfold those within."""
    condition = plain(condition)
    if isinstance(condition, bool):
        return yes if condition else no
    if isinstance(condition, (Gt, Ge, Lt, Le)):
        if condition.gts.free_symbols:
            return Select(condition.gts - condition.lts, yes, no)
        return Select(condition.lts - condition.gts, no, yes)
    if isinstance(condition, Not):
        return select(condition.args[0], no, yes)
    if isinstance(condition, ITE):
        test, first, second = condition.args
        return select(test, select(first, yes, no), select(second, yes, no))
    if not isinstance(condition, (And, Or, Xor)):
        raise TypeError(f"{condition} is no condition of comparisons")
    first, *others = sorted(condition.args, key=sympy.default_sort_key)
    rest = condition.func(*others)
    if isinstance(condition, And):
        return select(first, select(rest, yes, no), no)
    if isinstance(condition, Or):
        return select(first, yes, select(rest, yes, no))
    return select(first, select(rest, no, yes), select(rest, yes, no))


class Flags:
    """Symbols of memories that are True or False: as conditions they stand for q > 1/2."""

    def __init__(self) -> None:
        self.symbols: set[Symbol] = set()

    def choose(
        self, condition: Any, yes: Any, no: Any, memo: dict[tuple[int, int], Any] | None = None
    ) -> Any:
        """The value that is `yes` where the condition holds, else `no`."""
        memo = {} if memo is None else memo
        if yes is no:
            return yes
        if isinstance(yes, Nothing) or isinstance(no, Nothing):
            if isinstance(yes, Nothing) and isinstance(no, Nothing):
                return yes
            kept, lost = (no, yes) if isinstance(yes, Nothing) else (yes, no)
            return kept if lost.why == "raise" else Nothing("path")
        if isinstance(yes, (list, tuple, np.ndarray)) and isinstance(no, (list, tuple, np.ndarray)):
            return self._both(condition, yes, no, memo)
        if isinstance(yes, dict) and isinstance(no, dict) and yes.keys() == no.keys():
            return {key: self.choose(condition, yes[key], no[key], memo) for key in yes}
        if _is_value(yes) and _is_value(no):
            return self._value(condition, yes, no)
        if type(yes) is type(no) and _equal(yes, no):
            return yes
        words = all(isinstance(value, (str, enum.Enum, Choice)) for value in (yes, no))
        return Choice(condition, yes, no) if words else Nothing("path")

    def _both(self, condition: Any, yes: Any, no: Any, memo: dict[tuple[int, int], Any]) -> Any:
        if len(yes) != len(no):
            return Nothing("path")
        key = (id(yes), id(no))
        if key not in memo:
            if isinstance(yes, np.ndarray) or isinstance(no, np.ndarray):
                first, second = (np.asarray(v, dtype=object) for v in (yes, no))
                if first.shape != second.shape:
                    return Nothing("path")
                out: Any = np.empty(first.shape, dtype=object)
                for place in np.ndindex(first.shape):
                    out[place] = self.choose(condition, first[place], second[place], memo)
            else:
                out = [self.choose(condition, a, b, memo) for a, b in zip(yes, no, strict=True)]
                out = tuple(out) if isinstance(yes, tuple) else out
            memo[key] = out
        return memo[key]

    def _value(self, condition: Any, yes: Any, no: Any) -> Any:
        if _equal(yes, no):
            return yes
        truths = [is_condition(v) or isinstance(v, (bool, np.bool_)) for v in (yes, no)]
        if all(truths) and not self.held(condition):
            return plain(Or(And(condition, yes), And(Not(condition), no)))
        yes, no = as_number(yes), as_number(no)
        if isinstance(condition, Symbol):
            return condition * yes + (1 - condition) * no
        if isinstance(condition, Not) and self.held(condition):
            return self._value(condition.args[0], no, yes)
        if isinstance(condition, (And, Or)) and self.held(condition):
            first = next(part for part in condition.args if self.held(part))
            rest = condition.func(*(part for part in condition.args if part is not first))
            if isinstance(condition, And):
                return self._value(first, self._value(rest, yes, no), no)
            return self._value(first, yes, self._value(rest, yes, no))
        return select(condition, expression(yes), expression(no))

    def held(self, condition: Any) -> bool:
        """Whether a condition asks for a memory."""
        return bool(self.symbols) and bool(condition.free_symbols & self.symbols)


def _is_value(value: Any) -> bool:
    return isinstance(value, (Expr, Boolean)) or is_number(value)


def _equal(a: Any, b: Any) -> bool:
    same = a == b
    return bool(same) if isinstance(same, (bool, np.bool_)) else False


def copied(value: Any, memo: dict[int, Any]) -> Any:
    """A copy of a value in which lists, dicts and arrays are new, the same ones the same."""
    if isinstance(value, (list, dict, np.ndarray, tuple)):
        if id(value) not in memo:
            if isinstance(value, dict):
                memo[id(value)] = {key: copied(item, memo) for key, item in value.items()}
            elif isinstance(value, np.ndarray):
                memo[id(value)] = value.copy()
            else:
                made: Any = [copied(item, memo) for item in value]
                memo[id(value)] = made if isinstance(value, list) else _tuple_like(value, made)
        return memo[id(value)]
    return value


def _tuple_like(value: Any, items: list[Any]) -> Any:
    return type(value)(*items) if hasattr(value, "_fields") else tuple(items)


def length_less(a: Any, b: Any, fixed: Callable[[Any], float | None]) -> Any:
    """q - c^2 of a length sqrt(q), a sum of squares, beside a number c > 0; None of others.

    sqrt(q) has no slope at 0, where a body at rest begins. fixed: the number of what parameters decide.
    """
    for root, number in ((a, b), (b, a)):
        if isinstance(root, sympy.Pow) and root.exp == sympy.S.Half and isinstance(root.base, sympy.Add):
            limit = fixed(number)
            if limit is not None and limit > 0 and all(q.is_nonnegative for q in root.base.args):
                return root.base - expression(number) ** 2
    return None
