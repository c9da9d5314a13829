"""Arrays of a program: entries that the state chooses, what is in order, and linear equations.

An index that takes finitely many whole numbers, such as int(np.sign(v)) or np.argmax(y), chooses between the
entries as an if does. What has no limit to its values is refused by whoever asks.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import sympy
from sympy import Expr

from filippov.analysis.algebra.linalg import MatrixError, inv
from filippov.analysis.programs.choice import (
    Choice,
    Nothing,
    as_number,
    expression,
    is_condition,
    is_number,
)
from filippov.analysis.programs.conditions import MOST_STEPS, Conditions, cases_of
from filippov.analysis.programs.switching import HANDLERS as SWITCHES

# Leaves of an index, entries that are put in order, and unknowns of equations that hold symbols.
MOST_LEAVES = 64
MOST_IN_ORDER = 4
MOST_UNKNOWNS = 4
_CHOICE = "an index that depends on the state chooses; write it with conditions"


@dataclass(frozen=True)
class Chosen:
    """An index that the state decides: a number with steps in it, or a condition as the key of a dict."""

    value: Any


@dataclass(frozen=True)
class Mask:
    """An index of conditions, one for each entry."""

    held: Any


class Arrays(Conditions):
    """Part of the reader: each public method is a function of a program, or what an index does."""

    # -- finitely many values ------------------------------------------------------------------------------

    def split(self, value: Any, function: Callable[[float], Any]) -> Any:
        """A function of what takes finitely many values; None where it takes others."""
        if not isinstance(value, Expr) and not is_number(value) and not is_condition(value):
            return None
        leaves = self._leaves(expression(value), 0)
        if leaves is None or sum(1 for _ in _numbers(leaves)) > MOST_LEAVES:
            return None

        def joined(part: Any) -> Any:
            if not isinstance(part, tuple):
                return function(part)
            condition, yes, no = part
            return self.flags.choose(condition, joined(yes), joined(no))

        return joined(leaves)

    def _leaves(self, value: Any, depth: int) -> Any:
        """A number, or (condition, leaves where it holds, where not); None where there are others."""
        number = self.fixed(value)
        if number is not None:
            return number
        if depth > MOST_STEPS:
            return None
        flags = sorted(value.free_symbols & self.flags.symbols, key=str)
        condition: Any
        if flags:
            condition = flags[0]
            sides = [value.xreplace({condition: sympy.Integer(k)}) for k in (1, 0)]
        else:
            outer = self._outer(value)
            if not outer:
                return None
            h, *both = cases_of(outer[0])
            condition = sympy.Gt(h, 0, evaluate=False)
            sides = [value.xreplace({outer[0]: q}) for q in both]
        leaves = [self._leaves(sympy.expand(side), depth + 1) for side in sides]
        return None if any(part is None for part in leaves) else (condition, *leaves)

    # -- entries -------------------------------------------------------------------------------------------

    def entry(self, node: ast.AST, owner: Any, key: Chosen | Mask) -> Any:
        """owner[key]."""
        if isinstance(key, Mask):
            raise self.fail(
                node, "a part of an array whose length depends on the state is not followed; np.where keeps "
                "the length"
            )  # fmt: skip

        def at(k: float) -> Any:
            return self._of(node, owner, int(k))

        value = key.value
        if isinstance(value, Choice):
            sides = (self.entry(node, owner, Chosen(q)) if isinstance(q, Choice) else self._of(node, owner, q)
                     for q in (value.yes, value.no))  # fmt: skip
            out = self.flags.choose(value.condition, *sides)
        elif is_condition(value) or value in self.flags.symbols:
            # Of a list and an array a bool of numpy is no index of an entry.
            if not isinstance(owner, dict):
                raise self.fail(node, _CHOICE)
            out = self.flags.choose(value, at(1), at(0))
        elif isinstance(owner, (list, tuple, dict, np.ndarray)):
            out = self.split(value, lambda k: at(self._whole(node, k)))
        else:
            out = None
        if out is None or isinstance(out, Nothing):
            raise self.fail(node, _CHOICE)
        return out

    def _of(self, node: ast.AST, owner: Any, key: Any) -> Any:
        try:
            return owner[key]
        except (KeyError, IndexError, TypeError) as error:
            raise self.fail(node, f"{type(error).__name__}: {error}") from None

    def set_entry(self, node: ast.AST, owner: Any, key: Chosen | Mask, value: Any) -> None:
        """owner[key] = value."""
        single = is_number(value) or isinstance(value, Expr) or is_condition(value)
        if isinstance(key, Mask):
            if not isinstance(owner, np.ndarray) or np.shape(owner) != np.shape(key.held) or not single:
                raise self.fail(node, "an index of conditions is followed for one number and their own array")
            for place in np.ndindex(owner.shape):
                owner[place] = self._one_of(self.truth(node, key.held[place]), value, owner[place])
            return
        if not isinstance(owner, (list, np.ndarray)) or np.ndim(owner) != 1 or not single:
            raise self.fail(node, _CHOICE)
        for k in range(len(owner)):
            here = self.split(key.value, partial(self._is_place, node, len(owner), k))
            if here is None:
                raise self.fail(node, _CHOICE)
            owner[k] = self._one_of(here, value, owner[k])

    def _one_of(self, held: Any, yes: Any, no: Any) -> Any:
        if isinstance(held, (bool, np.bool_)):
            return yes if held else no
        return self.flags.choose(held, yes, no)

    def _is_place(self, node: ast.AST, length: int, place: int, k: float) -> bool:
        if not -length <= self._whole(node, k) < length:
            raise self.fail(node, f"an index of {int(k)} for {length} entries")
        return k % length == place

    def _whole(self, node: ast.AST, k: float) -> float:
        if k != round(k):
            raise self.fail(node, f"an index of {k}, expected a whole number")
        return k

    # -- order ---------------------------------------------------------------------------------------------

    def place_of_largest(self, node: ast.AST, a: Any) -> Any:
        """np.argmax: the first of the largest."""
        return self._place(node, ">", a)

    def place_of_least(self, node: ast.AST, a: Any) -> Any:
        """np.argmin: the first of the least."""
        return self._place(node, "<", a)

    def _place(self, node: ast.AST, how: str, a: Any) -> Any:
        first, *items = np.ravel(np.asarray(a, dtype=object)).tolist()
        place, best = 0, as_number(first)
        for k, item in enumerate(items, 1):
            held = self.compare(node, how, as_number(item), best)
            place, best = (self._one_of(held, *pair) for pair in ((k, place), (as_number(item), best)))
        return place

    def in_order(self, node: ast.AST, a: Any, reverse: Any = False) -> Any:
        """Sorted and np.sort of few numbers, by comparisons of two each."""
        array = isinstance(a, np.ndarray)
        items = [as_number(q) for q in (a.tolist() if array else self.listed(a))]
        if np.ndim(np.asarray(items, dtype=object)) != 1 or len(items) > MOST_IN_ORDER:
            raise self.fail(node, f"what is put in order is a list of at most {MOST_IN_ORDER} numbers")
        for last in range(len(items) - 1, 0, -1):
            for k in range(last):
                pair = items[k], items[k + 1]
                items[k], items[k + 1] = self.least(node, *pair), self.largest(node, *pair)
        items = items[::-1] if reverse else items
        return np.array(items, dtype=object) if array else items

    @staticmethod
    def listed(values: Any) -> list[Any]:
        """A list of what an iteration gives."""
        return list(values)

    def sorted_array(self, node: ast.AST, a: Any) -> Any:
        """np.sort."""
        return self.in_order(node, np.asarray(a, dtype=object))

    def middle(self, node: ast.AST, a: Any) -> Any:
        """np.median."""
        items = self.in_order(node, np.ravel(np.asarray(a, dtype=object)))
        half = len(items) // 2
        return items[half] if len(items) % 2 else (items[half - 1] + items[half]) / 2

    def extent(self, node: ast.AST, a: Any) -> Any:
        """np.ptp."""
        return self.largest(node, a) - self.least(node, a)

    def variance(self, node: ast.AST, a: Any) -> Any:
        """np.var: the mean of the squares of the distances from the mean."""
        del node
        items = [as_number(q) for q in np.ravel(np.asarray(a, dtype=object)).tolist()]
        mean = sum(items) / sympy.Integer(len(items))
        return sum((q - mean) ** 2 for q in items) / len(items)

    def deviation(self, node: ast.AST, a: Any) -> Any:
        """np.std."""
        return sympy.sqrt(self.variance(node, a))

    def place_in(self, node: ast.AST, a: Any, v: Any, side: Any = "left") -> Any:
        """np.searchsorted in a table of numbers: how many of them lie below."""
        table = [self.fixed(q) for q in np.ravel(np.asarray(a, dtype=object)).tolist()]
        if None in table or table != sorted(table) or side not in {"left", "right"}:  # type: ignore[type-var]
            raise self.fail(node, "places are followed in tables of rising numbers, not of the state")
        if isinstance(v, (np.ndarray, list, tuple)):
            raise self.fail(node, "places of several numbers at once are not followed")
        out: Any = len(table)
        for k in range(len(table) - 1, -1, -1):
            held = self.compare(node, "<=" if side == "left" else "<", as_number(v), table[k])
            out = self._one_of(held, k, out)
        return out

    def place_left(self, node: ast.AST, a: Any, x: Any) -> Any:
        """bisect.bisect_left."""
        return self.place_in(node, a, x, "left")

    def place_right(self, node: ast.AST, a: Any, x: Any) -> Any:
        """bisect.bisect."""
        return self.place_in(node, a, x, "right")

    def bin_of(self, node: ast.AST, x: Any, bins: Any, right: Any = False) -> Any:
        """np.digitize of rising bins."""
        return self.place_in(node, bins, x, "left" if right else "right")

    # -- linear algebra ------------------------------------------------------------------------------------

    def solved(self, node: ast.AST, a: Any, b: Any) -> Any:
        """np.linalg.solve."""
        return np.asarray(np.dot(self.inverse(node, a), np.asarray(b, dtype=object)), dtype=object)

    def inverse(self, node: ast.AST, a: Any) -> Any:
        """np.linalg.inv: of numbers by itself, of few expressions by minors."""
        matrix = self._square(node, a)
        numbers = [q for q in matrix.ravel().tolist() if is_number(q)]
        if len(numbers) == matrix.size:
            try:
                out = inv(matrix.astype(float))
            except MatrixError:
                raise self.fail(node, "the matrix is singular") from None
            return np.array(out.tolist(), dtype=object)
        if len(matrix) > MOST_UNKNOWNS:
            raise self.fail(
                node, f"equations with symbols in their matrix are followed for {MOST_UNKNOWNS} unknowns, "
                f"here there are {len(matrix)}; write the rates solved, or the matrix in numbers"
            )  # fmt: skip
        whole = sympy.Matrix(matrix.tolist())
        det = whole.det(method="berkowitz")
        if self.fixed(det) == 0.0 or sympy.expand(det) == 0:
            raise self.fail(node, "the matrix is singular")
        return np.array((whole.adjugate(method="berkowitz") / det).tolist(), dtype=object)

    def determinant(self, node: ast.AST, a: Any) -> Any:
        """np.linalg.det."""
        matrix = self._square(node, a)
        if len(matrix) > MOST_UNKNOWNS:
            raise self.fail(node, f"determinants are followed for {MOST_UNKNOWNS} rows")
        return sympy.Matrix(matrix.tolist()).det(method="berkowitz")

    def _square(self, node: ast.AST, a: Any) -> Any:
        matrix = np.asarray(a, dtype=object)
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
            raise self.fail(node, f"a matrix of shape {matrix.shape}, expected a square one")
        out = np.empty(matrix.shape, dtype=object)
        for place in np.ndindex(matrix.shape):
            out[place] = as_number(matrix[place])
        return out

    def summed(self, node: ast.AST, subscripts: Any, *operands: Any) -> Any:
        """np.einsum with its subscripts as a text."""
        if not isinstance(subscripts, str):
            raise self.fail(node, "np.einsum is followed with its subscripts as a text")
        try:
            out = np.einsum(subscripts, *(self._numbers(q) for q in operands))
        except ValueError as error:
            raise self.fail(node, f"ValueError: {error}") from None
        return np.asarray(out, dtype=object)[()]

    @staticmethod
    def _numbers(value: Any) -> Any:
        """An array with its conditions as 1 and 0."""
        array = np.asarray(value, dtype=object)
        return np.asarray(np.frompyfunc(as_number, 1, 1)(array), dtype=object)


def _numbers(leaves: Any) -> Iterable[float]:
    if isinstance(leaves, tuple):
        yield from _numbers(leaves[1])
        yield from _numbers(leaves[2])
    else:
        yield leaves


HANDLERS: dict[str, Callable[..., Any]] = SWITCHES | {
    name: value for name, value in vars(Arrays).items() if callable(value) and not name.startswith("_")
}
