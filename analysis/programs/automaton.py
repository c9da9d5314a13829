"""What a program remembers as a state: q' = 0, and a surface with a reset for each condition that sets it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sympy
from sympy import Expr, Symbol

from filippov.analysis.programs.choice import expression
from filippov.analysis.programs.notes import Memory, ReadingError
from filippov.analysis.programs.outside import Parameters
from filippov.model.surface import Surface
from filippov.model.symbolic import Select

Rule = tuple[Expr, int]
ADVICE = (
    "Write it as a state q with q' = 0 that resets change, Surface('on', T - low, reset={q: 1}, side='-'), "
    "or as "
    "Surface(..., width=...) where it is a relay with hysteresis"
)


def rules(memory: Memory, parameters: Parameters) -> list[Rule]:
    """(h, value): where h rises through 0 the memory becomes `value`.

    Of a memory that is True or False, set under one comparison each. Raises ReadingError for any other.
    """
    where = f"line {memory.line}: it remembers {memory.label} from call to call"
    if not memory.flag:
        raise ReadingError(f"{where}, a number. {ADVICE}.", memory.line)
    out: list[Rule] = []
    for held in (0, 1):
        after = expression(memory.after)
        after = after.xreplace({memory.symbol: sympy.Integer(held)})
        for path, value in _paths(after):
            if value == held:
                continue
            sides = _independent(path, parameters)
            if value != 1 - held or len(sides) != 1:
                raise ReadingError(
                    f"{where} in a way that is not one comparison for each change. {ADVICE}.", memory.line
                )
            out.append((sides[0], 1 - held))
    return out


def _paths(expr: Any) -> Iterator[tuple[list[Expr], Any]]:
    """What is positive, and the value there, for every branch of nested choices."""
    if not isinstance(expr, Select):
        yield [], expr
        return
    h, plus, minus = expr.args
    for side, branch in ((h, plus), (-h, minus)):
        for path, value in _paths(branch):
            yield [side, *path], value


def _independent(sides: list[Expr], parameters: Parameters) -> list[Expr]:
    """Those of some inequalities h > 0 that do not follow from another one: h' = h + a constant."""
    kept: list[Expr] = []
    for k, h in enumerate(sides):
        ahead = [(j, parameters.fixed(sympy.expand(h - other))) for j, other in enumerate(sides) if j != k]
        if not any(c is not None and (c > 0 or (c == 0 and j < k)) for j, c in ahead):
            kept.append(h)
    return kept


def surfaces(memory: Memory, found: list[Rule], symbols: dict[Any, Any]) -> list[Surface]:
    """The surfaces with resets of a memory, in the symbols of the system."""
    state: Symbol = symbols[memory.symbol]
    counts: dict[int, int] = {}
    out = []
    for h, value in found:
        counts[value] = counts.get(value, 0) + 1
        word = f"{state.name} {'on' if value else 'off'}" + (f" {counts[value]}" if counts[value] > 1 else "")
        out.append(Surface(word, h.xreplace(symbols), reset={state: value}, side="-"))
    return out


def first_value(memory: Memory, values: dict[Any, Any]) -> float:
    """The value that the memory has once the program was called at the start."""
    return float(
        expression(memory.after).xreplace({**values, memory.symbol: sympy.Integer(int(memory.initial))})
    )
