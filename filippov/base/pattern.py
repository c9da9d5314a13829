"""Expressions up to the names of their symbols: what is found of one holds for all of the same pattern."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any


def pattern(expressions: Sequence[Any], roles: Mapping[Any, Hashable]) -> tuple[Hashable, ...]:
    """What stands in expressions, with every symbol that has a role by its role and its place among them.

    Two rows of expressions with equal patterns are the same but for the names of such symbols; all others,
    parameters with their bounds above all, are distinguished.
    """
    places: dict[Any, int] = {}
    out: list[Any] = []
    waiting = list(expressions)
    while waiting:
        e = waiting.pop()
        if e.args:
            out += (e.func, len(e.args))
            waiting.extend(e.args)
        elif (role := roles.get(e)) is None:
            out += (type(e), e)
        else:
            out += (role, places.setdefault(e, len(places)))
    return tuple(out)
