"""Conditions of a program: what is decided, what becomes a surface, and equalities."""

from __future__ import annotations

import ast
import enum
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
import sympy
from sympy import And, Expr, Not, Or

from filippov.analysis.programs.choice import (
    Choice,
    Nothing,
    as_number,
    expression,
    is_condition,
    is_number,
    length_less,
    plain,
)
from filippov.analysis.programs.notes import ReadingError, Site, at
from filippov.analysis.programs.outside import Outside, Parameters
from filippov.analysis.programs.source import Source
from filippov.analysis.programs.switching import Switching
from filippov.model.symbolic import Select

_SYMPY: dict[str, Any] = {"<": sympy.Lt, "<=": sympy.Le, ">": sympy.Gt, ">=": sympy.Ge}
_PLAIN: dict[str, Callable[[Any, Any], bool]] = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq,
    "!=": operator.ne,
}  # fmt: skip
# What takes two values, and what is one of two expressions.
STEPS: tuple[Any, ...] = (Select, sympy.sign, sympy.Heaviside)
CORNERS: tuple[Any, ...] = (sympy.Abs, sympy.Max, sympy.Min)
MOST_STEPS = 12
# The half-width of the band for which an equality is taken, where that is asked for.
NEAREST = 1e-300
# Of these, in one comparison, that are looked through for a part of the states where it is 0.
MOST_CORNERS = 6


def cases_of(atom: Any) -> tuple[Any, Any, Any]:
    """(h, the value where h > 0, the value where h < 0)."""
    first, *rest = atom.args
    if isinstance(atom, Select):
        return first, rest[0], rest[1]
    if isinstance(atom, sympy.sign):
        return first, sympy.S.One, sympy.S.NegativeOne
    if isinstance(atom, sympy.Heaviside):
        return first, sympy.S.One, sympy.S.Zero
    if isinstance(atom, sympy.Abs):
        return first, first, -first
    other = atom.func(*rest)
    return (first - other, first, other) if isinstance(atom, sympy.Max) else (other - first, first, other)


def _joined(h: Any, yes: Any, no: Any) -> Any:
    """A condition that is `yes` where h > 0, else `no`."""
    if yes is no or yes == no:
        return yes
    above = sympy.Gt(h, 0, evaluate=False)
    return plain(Or(And(above, yes), And(Not(above), no)))


class Conditions(Switching):
    """Part of the reader: values as conditions."""

    parameters: Parameters
    sites: list[Site]
    source: Source
    equal_nearby: bool

    # -- notes ---------------------------------------------------------------------------------------------

    def site(self, node: ast.AST, kind: str, h: Any) -> None:
        """Note that the program switches here, unless parameters alone decide."""
        if h is not None and self.fixed(h) is not None:
            return
        found = Site(at(node), self.source.file, self.source.text(node), kind, h)
        if found not in self.sites:
            self.sites.append(found)

    def fixed(self, value: Any) -> float | None:
        """The number of a value that depends on parameters alone, else None."""
        return self.parameters.fixed(value)

    def fail(self, node: ast.AST, message: str) -> ReadingError:
        """The error that names line and text."""
        text = self.source.text(node)
        shown = text if len(text) < 70 else text[:67] + "..."
        return ReadingError(f"line {at(node)}, `{shown}`: {message}.", at(node))

    # -- conditions ----------------------------------------------------------------------------------------

    def truth(self, node: ast.AST, value: Any) -> Any:
        """A value as a condition: True, False, or what is not decided yet."""
        value = plain(value)
        if isinstance(value, (bool, np.bool_)) or value is None:
            return bool(value)
        if is_condition(value) or value in self.flags.symbols:
            return value
        if isinstance(value, Expr) or is_number(value):
            return self.compare(node, "!=", value, 0)
        if isinstance(value, np.ndarray) and value.size == 1:
            return self.truth(node, value.ravel()[0])
        if isinstance(value, (str, list, tuple, dict, Outside)):
            return bool(value.value) if isinstance(value, Outside) else bool(value)
        if isinstance(value, Choice):
            sides = (self.truth(node, part) for part in (value.yes, value.no))
            return self.flags.choose(value.condition, *sides)
        if isinstance(value, Nothing):
            raise self.fail(node, "a condition on what not every path sets")
        if isinstance(value, np.ndarray):
            raise self.fail(node, "the truth of an array is ambiguous; ask .any() or .all()")
        return True

    def compare(self, node: ast.AST, how: str, a: Any, b: Any) -> Any:
        """A comparison of two values."""
        a, b = plain(a), plain(b)
        for one, other in ((a, b), (b, a)):
            if isinstance(one, Choice):
                sides = (
                    self.compare(node, how, *((part, other) if one is a else (other, part)))
                    for part in (one.yes, one.no)
                )
                return self.flags.choose(one.condition, *sides)
        if all(isinstance(v, (bool, str, enum.Enum, type(None), list, tuple, dict)) for v in (a, b)):
            return bool(_PLAIN[how](a, b))
        if any(isinstance(v, (str, enum.Enum)) or v is None for v in (a, b)):
            if how in {"==", "!="}:
                return how == "!="
            raise self.fail(node, "a comparison with something that is no number")
        for flag, other in ((a, b), (b, a)):
            if flag in self.flags.symbols and self.fixed(other) in {0.0, 1.0} and how in {"==", "!="}:
                wanted = (self.fixed(other) == 1.0) == (how == "==")
                return flag if wanted else Not(flag)
        a, b = as_number(a), as_number(b)
        first, second = self.fixed(a), self.fixed(b)
        if first is not None and second is not None:
            return bool(_PLAIN[how](first, second))
        difference = expression(a - b)
        half = self.half_step(difference)
        if half is not None:
            self.site(node, "if", difference)
            return self._counted(how, difference, half)
        if how in {"==", "!="}:
            # Of what is 0 in a whole part of the states, as u == clip(u, -1, 1), this is no exact hit.
            held = self._equal(node, difference, 0, noted=not self.rests(difference))
            return plain(Not(held)) if how == "!=" else held
        decided = self._stepped(node, how, difference, 0) if difference.has(*STEPS) else None
        if decided is None and self.rests(difference):
            decided = self._by_case(node, how, difference)
        if decided is not None:
            return decided
        length = length_less(a, b, self.fixed)
        if length is not None:
            a, b = (length, sympy.S.Zero) if isinstance(a, sympy.Pow) else (sympy.S.Zero, length)
        held = plain(_SYMPY[how](a, b, evaluate=False))
        if not isinstance(held, bool):
            self.site(node, "if", a - b)
        return held

    def _counted(self, how: str, difference: Any, half: Any) -> Any:
        """A comparison with 0 of what counts, in steps of 2 half: with a limit that it never takes."""
        above, below = (sympy.Gt(difference + q, 0, evaluate=False) for q in (-half, half))
        held = {">": above, ">=": below, "<": Not(below), "<=": Not(above), "==": And(below, Not(above))}
        return plain(held[how] if how in held else Or(Not(below), above))

    def _stepped(self, node: ast.AST, how: str, difference: Any, depth: int) -> Any:
        """A comparison with 0 of what takes finitely many values; None where it takes others."""
        number = self.fixed(difference)
        if number is not None:
            return bool(_PLAIN[how](number, 0.0))
        found = sorted(difference.atoms(*STEPS), key=sympy.default_sort_key)
        if not found or depth >= MOST_STEPS:
            return None
        h, yes, no = cases_of(found[0])
        parts = [
            self._stepped(node, how, sympy.expand(difference.xreplace({found[0]: value})), depth + 1)
            for value in (yes, no)
        ]
        if None in parts:
            return None
        return _joined(h, *parts)

    def rests(self, difference: Any, depth: int = 0) -> bool:
        """Whether a difference is 0 in a whole part of the states: there no sign says which side counts."""
        found = self._outer(difference, (*STEPS, *CORNERS))
        if not found or depth >= MOST_CORNERS:
            return depth > 0 and self.fixed(sympy.expand(difference)) == 0.0
        _, *sides = cases_of(found[0])
        return any(self.rests(difference.xreplace({found[0]: value}), depth + 1) for value in sides)

    def _by_case(self, node: ast.AST, how: str, difference: Any) -> Any:
        """A comparison with 0 in each case of a difference by itself."""
        found = self._outer(difference, (*STEPS, *CORNERS))
        number = None if found else self.fixed(sympy.expand(difference))
        if number is not None:
            return bool(_PLAIN[how](number, 0.0))
        if not found:
            self.site(node, "if", difference)
            return plain(_SYMPY[how](difference, 0, evaluate=False))
        h, yes, no = cases_of(found[0])
        return _joined(h, *(self._by_case(node, how, difference.xreplace({found[0]: q})) for q in (yes, no)))

    @staticmethod
    def _outer(value: Any, kinds: tuple[Any, ...] = STEPS) -> list[Any]:
        """The steps of a value that are in no other step."""
        found = value.atoms(*kinds)
        inner = {q for atom in found for part in atom.args for q in part.atoms(*kinds)}
        return sorted(found - inner, key=sympy.default_sort_key)

    def _equal(self, node: ast.AST, difference: Any, depth: int, noted: bool) -> Any:
        """Where a difference is 0 in a whole part of the states; on a surface alone counts as never."""
        number = self.fixed(difference)
        if number is not None:
            return number == 0.0
        found = sorted(difference.atoms(*STEPS, *CORNERS), key=sympy.default_sort_key)
        if not found:
            if noted:
                self.site(node, "equality", difference)
            near = noted and self.equal_nearby
            return plain(sympy.Lt(sympy.Abs(difference), NEAREST, evaluate=False)) if near else False
        if depth >= MOST_STEPS:
            raise self.fail(node, f"an equality of what has more than {MOST_STEPS} cases")
        h, yes, no = cases_of(found[0])
        first, second = (
            self._equal(node, sympy.expand(difference.xreplace({found[0]: value})), depth + 1, noted)
            for value in (yes, no)
        )
        return _joined(h, first, second)
