"""Blocks with inputs and outputs, put together to one system: every wire replaced by what it carries."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.model.surface import Surface
from filippov.model.system import System
from filippov.model.time_event import TimeEvent


@dataclass(frozen=True)
class Block:
    """x' = rates(t, x, u), y = outputs(t, x, u): expressions in its states and in the symbols of its inputs.

    surfaces, time_events   whose expressions may hold inputs as well
    """

    name: str
    inputs: tuple[Symbol, ...]
    outputs: tuple[Expr, ...]
    states: tuple[Symbol, ...] = ()
    rates: tuple[Expr, ...] = ()
    surfaces: tuple[Surface, ...] = ()
    time_events: tuple[TimeEvent, ...] = ()


def wired(
    blocks: Sequence[Block], sources: Mapping[Symbol, Expr], labels: Mapping[Symbol, Symbol],
    outputs: Mapping[str, Expr],
) -> System:  # fmt: skip
    """The system of blocks whose inputs are `sources`, expressions in the symbols of block outputs.

    labels   the symbol of an output in `sources` -> the input or output that it stands for is looked up there
    outputs  quantities of the system by name

    Raises ModelError where blocks without memory act on each other at once.
    """
    carried = _Wires({**sources, **labels})
    equations = {
        x: carried(rate) for block in blocks for x, rate in zip(block.states, block.rates, strict=True)
    }
    if not equations:
        raise ModelError("no block has a state: there is nothing to solve.")
    surfaces = [
        Surface(q.name, carried(q.h), radius=tuple(map(carried, q.radius)), width=q.width)
        for block in blocks
        for q in block.surfaces
    ]
    clocks = [
        TimeEvent(
            q.name, period=q.period, start=q.start, reset={name: carried(e) for name, e in q.reset or ()}
        )
        for block in blocks
        for q in block.time_events
    ]
    named = {name: carried(e) for name, e in outputs.items() if name not in {q.name for q in equations}}
    return System(equations, surfaces=surfaces, time_events=clocks, outputs=named)


class _Wires:
    """Replaces symbols of wires by what they carry, one through the other."""

    def __init__(self, meaning: Mapping[Symbol, Any]) -> None:
        self.meaning = meaning
        self.known: dict[Symbol, Expr] = {}
        self.open: list[Symbol] = []

    def __call__(self, e: Any) -> Any:
        """The expression with no wire left in it."""
        if not isinstance(e, Expr):
            return e
        return e.xreplace({q: self._value(q) for q in e.free_symbols if q in self.meaning})

    def _value(self, wire: Symbol) -> Expr:
        if wire in self.known:
            return self.known[wire]
        if wire in self.open:
            ring = " -> ".join(q.name for q in [*self.open[self.open.index(wire) :], wire])
            raise ModelError(
                f"an algebraic loop, {ring}: blocks without memory act on each other at once. Add the lag of "
                "an actuator or a filter."
            )
        self.open.append(wire)
        self.known[wire] = self(self.meaning[wire])
        self.open.pop()
        return self.known[wire]


def identifier(text: str) -> str:
    """A label such as "x[0]" or "plant.y" as a name."""
    name = re.sub(r"\W+", "_", text.replace("[", "").replace("]", "")).strip("_")
    return name if name and not name[0].isdigit() else f"x{name}"
