"""What a program remembers, as a state that resets change: q' = 0, and a surface for every condition that sets it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sympy
from sympy import And, Expr, Piecewise, Symbol
from sympy.core.relational import Relational

from filippov.analysis.programs.notes import Memory, ReadingError
from filippov.analysis.programs.outside import Parameters
from filippov.model.surface import Surface

Rule = tuple[Expr, int, Any]
ADVICE = (
    "Write it as a state q with q' = 0 that resets change, Surface('on', T - low, reset={q: 1}, side='-'), or as "
    "Surface(..., width=...) where it is a relay with hysteresis"
)


def rules(memory: Memory, parameters: Parameters) -> list[Rule]:
    """(h, side, value): where h comes to 0 from its side (+1: from above) the memory becomes `value`.

    Of a memory that is True or False, set under one comparison each. Raises ReadingError for any other.
    """
    where = f"line {memory.line}: it remembers {memory.label} from call to call"
    if not memory.flag:
        raise ReadingError(f"{where}, a number. {ADVICE}.", memory.line)
    out: list[Rule] = []
    for held in (0, 1):
        after = sympy.sympify(memory.after if not isinstance(memory.after, bool) else int(memory.after))
        after = after.xreplace({memory.symbol: sympy.Integer(held)})
        for path, value in _paths(after):
            if value == held:
                continue
            positive = [condition for condition, holds in path if holds]
            if value != 1 - held or len(positive) != 1 or not isinstance(positive[0], Relational):
                raise ReadingError(
                    f"{where} in a way that is not one comparison for each change. {ADVICE}.", memory.line
                )
            h = positive[0].gts - positive[0].lts
            for condition, holds in path:
                if not holds and not _excluded(h, condition, parameters):
                    raise ReadingError(f"{where}, under conditions that meet. {ADVICE}.", memory.line)
            out.append((h, -1, 1 - held))
    return out


def _paths(expr: Any) -> Iterator[tuple[list[tuple[Any, bool]], Any]]:
    """Conditions with whether they hold, and the value there, for every branch of nested choices."""
    if not isinstance(expr, Piecewise):
        yield [], expr
        return
    before: list[tuple[Any, bool]] = []
    for value, condition in expr.args:
        own = [] if condition == True else [(part, True) for part in And.make_args(condition)]  # noqa: E712
        for path, inner in _paths(value):
            yield [*before, *own, *path], inner
        if condition != True:  # noqa: E712
            before.append((condition, False))


def _excluded(h: Expr, condition: Any, parameters: Parameters) -> bool:
    """Whether the condition is false wherever h > 0: h + (its own difference) is a constant below 0."""
    if not isinstance(condition, Relational):
        return False
    total = parameters.fixed(sympy.expand(h + condition.gts - condition.lts))
    return total is not None and total <= 0


def surfaces(memory: Memory, found: list[Rule], symbols: dict[Any, Any]) -> list[Surface]:
    """The surfaces with resets of a memory, in the symbols of the system."""
    state: Symbol = symbols[memory.symbol]
    counts: dict[int, int] = {}
    out = []
    for h, _, value in found:
        counts[value] = counts.get(value, 0) + 1
        word = f"{state.name} {'on' if value else 'off'}" + (f" {counts[value]}" if counts[value] > 1 else "")
        out.append(Surface(word, h.xreplace(symbols), reset={state: value}, side="-"))
    return out


def first_value(memory: Memory, values: dict[Any, Any]) -> float:
    """The value that the memory has once the program was called at the start."""
    after = memory.after if not isinstance(memory.after, bool) else int(memory.after)
    return float(sympy.sympify(after).xreplace({**values, memory.symbol: sympy.Integer(int(memory.initial))}))
