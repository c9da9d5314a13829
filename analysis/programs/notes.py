"""What a reading of a program notes: where it switches, what it remembers, where it cannot be followed."""

from __future__ import annotations

import ast
from dataclasses import dataclass, field
from typing import Any

from sympy import Expr, Symbol

from filippov.base.errors import ModelError
from filippov.base.shown import Told


class ReadingError(ModelError):
    """A program cannot be translated; `line` is where."""

    def __init__(self, message: str, line: int = 0) -> None:
        super().__init__(message)
        self.line = line


class Again(Exception):  # noqa: N818
    """The program remembers more than was known when the reading began."""


@dataclass(frozen=True)
class Site(Told):
    """A place in the source where the program switches.

    line, file, text   where, and what stands there
    kind               "sign", "if", "abs", "max", "where", "clip", "heaviside", "equality" for a test that a
                       float equals another, "time" where nothing but time decides
    h                  the switching function, one expression; None where it is not one
    """

    _untold = ("h",)

    line: int
    file: str
    text: str
    kind: str
    h: Expr | None


@dataclass
class Memory:
    """A value that outlives a call: a global, an attribute, an item of a container.

    label     as it stands in the source; name: as a state; symbol: for its value before the call
    initial   its value when the program was read; place: (kind, holder, key) to set it back
    """

    label: str
    name: str
    symbol: Symbol
    initial: Any
    place: tuple[str, Any, Any] = field(repr=False)
    line: int = 0
    after: Any = None

    @property
    def flag(self) -> bool:
        """Whether it is True or False."""
        return isinstance(self.initial, bool)

    def put(self, value: Any) -> None:
        """Give it a value in the live program."""
        kind, holder, key = self.place
        if kind == "attribute":
            setattr(holder, key, value)
        elif kind == "cell":
            holder.cell_contents = value
        else:
            holder[key] = value

    def now(self) -> Any:
        """Its value in the live program."""
        kind, holder, key = self.place
        if kind == "attribute":
            return getattr(holder, key)
        return holder.cell_contents if kind == "cell" else holder[key]


@dataclass(frozen=True)
class Clock:
    """A state that stands for alpha t + beta modulo b ("mod") or floor((alpha t + beta)/b) ("floor")."""

    kind: str
    symbol: Symbol
    rate: Any
    offset: Any
    modulus: Any
    line: int


def at(node: ast.AST) -> int:
    """The line of a node."""
    return int(getattr(node, "lineno", 0))
