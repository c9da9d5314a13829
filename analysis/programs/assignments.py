"""Assignments of a program: to names, items and attributes, and what of them outlives a call."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy
from sympy import Symbol

from filippov.analysis.programs.arrays import Chosen, Mask
from filippov.analysis.programs.calls import Calls
from filippov.analysis.programs.choice import is_number
from filippov.analysis.programs.notes import Again, Memory, at
from filippov.analysis.programs.outside import Outside


@dataclass(frozen=True)
class Place:
    """Where a value outside is kept: kind "item", "attribute" or "cell"."""

    kind: str
    holder: Any
    key: Any


class Assignments(Calls):
    """Part of the reader: what names and items stand for."""

    states: tuple[Symbol, ...]
    given_to: dict[tuple[int, str], dict[Symbol | None, None]]
    remarks: list[str]
    logs: set[int]

    def assign(self, target: ast.expr, value: Any) -> None:
        """Give a value to names, attributes and items."""
        if isinstance(target, ast.Name):
            self._name(target, value)
        elif isinstance(target, (ast.Tuple, ast.List)):
            items = self.items(target, value)
            starred = [k for k, part in enumerate(target.elts) if isinstance(part, ast.Starred)]
            if starred:
                k, after = starred[0], len(target.elts) - starred[0] - 1
                items = [*items[:k], items[k : len(items) - after], *items[len(items) - after :]]
            if len(items) != len(target.elts):
                raise self.fail(target, f"{len(items)} values for {len(target.elts)} names")
            for part, item in zip(target.elts, items, strict=True):
                self.assign(part.value if isinstance(part, ast.Starred) else part, item)
        elif isinstance(target, ast.Subscript):
            owner, key = self.value(target.value), self.key(target.slice)
            if isinstance(key, (Chosen, Mask)):
                self.set_entry(target, owner, key, value)
            elif isinstance(owner, Outside):
                self._remember(target, Place("item", owner.value, key), value)
            elif isinstance(owner, (list, dict, np.ndarray)):
                owner[key] = value
            else:
                raise self.fail(target, f"an assignment to an item of {type(owner).__name__}")
        elif isinstance(target, ast.Attribute):
            owner = self.value(target.value)
            held = owner.value if isinstance(owner, Outside) else owner
            self._remember(target, Place("attribute", held, target.attr), value)
        else:
            raise self.fail(target, f"an assignment to {type(target).__name__} is not followed")

    def _name(self, target: ast.Name, value: Any) -> None:
        outer = self.frames[self.scopes[-1]].get("%outer", {}).get(target.id)
        if outer is not None:
            if isinstance(outer, int):
                self.frames[outer][target.id] = value
            else:
                self._remember(target, outer, value)
            return
        self._called(target.id, value)
        self.frames[self.scopes[-1]][target.id] = value

    def _called(self, name: str, value: Any) -> None:
        """Note what a name is given, by which states and parameters get theirs."""
        found = [(name, value)]
        if isinstance(value, np.ndarray) and 1 < value.size < len(self.states):
            found = [(f"{name}{k + 1}", part) for k, part in enumerate(value.ravel().tolist())]
        for label, part in found:
            state = part if isinstance(part, Symbol) and part in self.states else None
            self.given_to.setdefault((id(self.source.node), label), {})[state] = None
            if isinstance(part, Symbol):
                self.parameters.name(part, label)

    def state_names(self) -> tuple[str | None, ...]:
        """The first name of each state that means this state wherever it is given."""
        names: dict[Symbol, str] = {}
        for (_, name), values in self.given_to.items():
            only = next(iter(values)) if len(values) == 1 else None
            if only is not None:
                names.setdefault(only, name)
        return tuple(names.get(x) for x in self.states)

    def outer(self, node: ast.Global | ast.Nonlocal, name: str) -> None:
        """A name that a function declares as not its own."""
        frame = self.frames[self.scopes[-1]].setdefault("%outer", {})
        if isinstance(node, ast.Nonlocal):
            for number in reversed(self.scopes[:-1]):
                if name in self.frames[number]:
                    frame[name] = number
                    return
        holder, key = self.holder(name)
        if isinstance(node, ast.Global):
            holder, key = self.source.function.__globals__, name
            if key not in holder:
                raise self.fail(
                    node, f"the global {name!r} has no value yet; give it one beside the function"
                )
        frame[name] = Place("cell" if key is None else "item", holder, key)
        self._known_memory(node, frame[name], name)

    def _known_memory(self, node: ast.AST, place: Place, label: str) -> tuple[Any, ...]:
        found = (id(place.holder), place.key)
        if found not in self.memories:
            symbol = sympy.Dummy(label, real=True)
            memory = Memory(label, label, symbol, None, (place.kind, place.holder, place.key), at(node))
            memory.initial = memory.now()
            if not is_number(memory.initial):
                raise self.fail(
                    node, f"it remembers {label}, {type(memory.initial).__name__}, from call to call. A "
                    "memory is "
                    "a state of its own that resets change (Surface(..., reset={mode: 1})); only True, "
                    "False and "
                    "numbers are translated",
                )  # fmt: skip
            self.memories[found] = memory
            raise Again
        return found

    def _remember(self, node: ast.expr, place: Place, value: Any) -> None:
        self.remembered[self._known_memory(node, place, self.source.text(node))] = value

    def log(self, node: ast.AST, owner: Outside) -> None:
        """Note that the program keeps a record in a container outside."""
        if id(owner.value) not in self.logs:
            self.logs.add(id(owner.value))
            raise Again
        self.remark(f"line {at(node)} keeps a record in {owner.label}, which is left out")

    def remark(self, sentence: str) -> None:
        """Keep a sentence that the user should know of."""
        if sentence not in self.remarks:
            self.remarks.append(sentence)
