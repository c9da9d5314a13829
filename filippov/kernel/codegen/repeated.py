"""Statements that are the same but for the places of what they read and write: loops over the places.

The blocks of a chain, the cells of a line or the neurons of a network have equations of one form each. Rows
whose places in x, p, s, m and the result go up by constant steps are one loop; the others are written out.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sympy import Expr, Symbol

# Fewer rows of one form are written out.
FEWEST = 32
SIZE = "size"
_PLACE = re.compile(r"(\w+)\[(\d+)\]")
Row = tuple[str, Expr]
Place = tuple[str, int]


@dataclass(frozen=True)
class Repeated:
    """Rows of one form: the first one, how many there are, and the text of every place in row `b`.

    sizes: those that the rows read, in order, with the mode that each is multiplied with
    """

    row: Row
    count: int
    names: dict[Symbol, str]
    sizes: list[tuple[Symbol, str]]


class Places:
    """Where symbols stand: in an array, or as the size |h_i|, whose h is read with them."""

    def __init__(self, names: Mapping[Symbol, str], sizes: Mapping[Symbol, tuple[int, Expr]]) -> None:
        """names: the text of each symbol; sizes: the number and h of those that stand for |h|."""
        self.sizes = sizes
        self.of: dict[Symbol, Place] = {symbol: (SIZE, i) for symbol, (i, _) in sizes.items()}
        for symbol, text in names.items():
            if symbol not in sizes and (found := _PLACE.fullmatch(text)):
                self.of[symbol] = found[1], int(found[2])
        self._known: dict[Hashable, int] = {}

    def read(self, e: Expr) -> dict[Symbol, Place]:
        """The places that a row reads, those inside of its sizes among them."""
        waiting, seen = list(e.free_symbols), dict[Symbol, Place]()
        while waiting:
            symbol = waiting.pop()
            if symbol in seen or symbol not in self.of:
                continue
            seen[symbol] = self.of[symbol]
            if symbol in self.sizes:
                waiting.extend(self.sizes[symbol][1].free_symbols)
        return seen

    def form(self, e: Expr, read: Mapping[Symbol, Place]) -> Hashable:
        """What a row is but for its places: equal for rows of one form."""
        ranks: dict[str, int] = {}
        roles: dict[Symbol, Place] = {}
        for symbol, (array, _) in sorted(read.items(), key=lambda pair: pair[1]):
            ranks[array] = ranks.get(array, -1) + 1
            roles[symbol] = array, ranks[array]
        inside = [self._form(self.sizes[q][1], roles) for q in roles if q in self.sizes]
        return self._form(e, roles), tuple(inside)

    def _form(self, e: Expr, roles: Mapping[Symbol, Place]) -> int:
        key: Hashable
        if not e.args:
            key = roles.get(e, e)
        else:
            parts = [self._form(arg, roles) for arg in e.args]
            key = e.func, tuple(sorted(parts) if e.is_Add or e.is_Mul else parts)
        return self._known.setdefault(key, len(self._known))


def repeated(
    rows: Sequence[Row], names: Mapping[Symbol, str], sizes: Mapping[Symbol, tuple[int, Expr]]
) -> tuple[list[Repeated], list[Row]]:
    """The loops that rows make, and the rows that are left; names, sizes: as in `Places`."""
    if len(rows) < FEWEST:
        return [], list(rows)
    places = Places(names, sizes)
    groups: dict[Hashable, list[tuple[int, Place, dict[Symbol, Place]]]] = {}
    for number, (target, e) in enumerate(rows):
        found, read = _PLACE.fullmatch(target), places.read(e)
        if found:
            groups.setdefault((found[1], places.form(e, read)), []).append(
                (number, (found[1], int(found[2])), read)
            )
    loops: list[Repeated] = []
    taken: set[int] = set()
    for group in groups.values():
        steps = [[at[1], *sorted(read.values())] for _, at, read in group]
        first = 0
        while first + FEWEST <= len(group):
            last = _last(steps, first)
            if last - first < FEWEST:
                first = last - 1  # which may be the first of the next
                continue
            number, (array, start), read = group[first]
            loops.append(_loop(rows[number], array, start, read, steps[first : first + 2], last - first))
            taken |= {number for number, _, _ in group[first:last]}
            first = last
    return loops, [row for number, row in enumerate(rows) if number not in taken]


def _moved(before: Sequence[Any], after: Sequence[Any]) -> list[int]:
    return [after[0] - before[0], *(b[1] - a[1] for a, b in zip(before[1:], after[1:], strict=True))]


def _last(steps: Sequence[Sequence[Any]], first: int) -> int:
    """The end of the rows from the first one on whose places go up by constant steps."""
    step, last = _moved(steps[first], steps[first + 1]), first + 2
    while last < len(steps) and _moved(steps[last - 1], steps[last]) == step:
        last += 1
    return last


def _loop(
    row: Row, array: str, start: int, read: Mapping[Symbol, Place], steps: Sequence[Sequence[Any]], count: int
) -> Repeated:
    target, *moved = _moved(*steps)
    names, sizes = {}, []
    for (symbol, (name, i)), step in zip(sorted(read.items(), key=lambda pair: pair[1]), moved, strict=True):
        if name == SIZE:
            sizes.append((symbol, at("m", i, step)))
        else:
            names[symbol] = at(name, i, step)
    return Repeated((at(array, start, target), row[1]), count, names, sizes)


def at(array: str, start: int, step: int) -> str:
    """An entry of an array in row b of a loop."""
    along = {0: "", 1: "b"}.get(step, f"{step} * b")
    return f"{array}[{' + '.join(filter(None, (along, str(start) if start or not along else '')))}]"
