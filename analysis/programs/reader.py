"""A program f(t, y) followed statement by statement on both sides of its conditions, to its equations.

Nothing of the program is run: its syntax tree is gone through. Numbers that it finds outside itself (globals,
closures, defaults, attributes) become parameters; what it changes outside itself is a memory. Where a
condition depends on the state both sides are followed, and what they leave behind is put together.
"""

from __future__ import annotations

import ast
import inspect
import types
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import sympy
from sympy import Expr, Symbol

from filippov.analysis.programs import automaton, functions
from filippov.analysis.programs.choice import Flags, Nothing, as_number, copied, is_condition, is_number
from filippov.analysis.programs.expressions import Closure, Expressions
from filippov.analysis.programs.notes import Clock, Memory, ReadingError, Site, at
from filippov.analysis.programs.outside import Outside, Parameters, opened
from filippov.analysis.programs.source import Source, source_of
from filippov.base.errors import ModelError

# Statements that are gone through, and calls inside each other, until a program counts as too long.
MOST_STATEMENTS, MOST_CALLS = 20_000, 40
Then = Callable[[], Any]
Loop = tuple[Then, Then] | None


@dataclass(frozen=True)
class Reading:
    """What a program says.

    source       where it stands
    field        one expression a state, in `time`, `states`, the symbols of parameters, memories and clocks
    states       symbols; names: those that the program gives them, None where it gives none
    parameters   numbers that it reads, with their names
    sites        where it switches; memories, clocks: what it needs states of their own for
    remarks      sentences
    """

    source: Source
    field: tuple[Any, ...]
    time: Symbol
    states: tuple[Symbol, ...]
    names: tuple[str | None, ...]
    parameters: Parameters
    sites: tuple[Site, ...]
    memories: tuple[Memory, ...]
    clocks: tuple[Clock, ...]
    remarks: tuple[str, ...]


class _Again(Exception):  # noqa: N818
    """The program remembers more than was known when the reading began."""


class Reader(Expressions):
    """One reading of a program with n states and further arguments."""

    def __init__(self, source: Source, n: int, args: Sequence[Any], memories: dict[Any, Memory]) -> None:
        self.source, self.memories = source, memories
        self.parameters, self.flags = Parameters(), Flags()
        self.flags.symbols = {m.symbol for m in memories.values() if m.flag}
        self.sites = []
        self.remarks: list[str] = []
        self.clocks: dict[Any, Clock] = {}
        self.time = sympy.Dummy("t", real=True)
        self.states = tuple(sympy.Dummy(f"y{i}", real=True) for i in range(n))
        self.given_to: dict[tuple[int, str], dict[Symbol | None, None]] = {}
        self.frames, self.remembered = {}, {}
        self.scopes: tuple[int, ...] = ()
        self.given = tuple(args)
        self._frame, self._statements, self._depth = 0, 0, 0
        self._sources: dict[Any, Source] = {}
        self.logs: set[int] = set()

    def read(self) -> Reading:
        """Follow the program. Raises ReadingError, which names the line."""
        state = np.array(self.states, dtype=object)
        first = self.parameter_names(self.source)
        extra = [
            self.parameters.inside(value, first[2 + k] if 2 + k < len(first) else f"argument_{k + 1}")
            for k, value in enumerate(self.given)
        ]
        live = self.source.function
        value = self.call(self.source.node, _Live(self.source, live), [self.time, state, *extra], {})
        field = self._rates(value)
        for memory in self.memories.values():
            memory.after = self.remembered.get(_key(memory), memory.symbol)
        return Reading(
            self.source, field, self.time, self.states, self._names(), self.parameters, tuple(self.sites),
            tuple(self.memories.values()), tuple(self.clocks.values()), tuple(self.remarks),
        )  # fmt: skip

    @staticmethod
    def parameter_names(source: Source) -> list[str]:
        """Names of the arguments that a call gives, those that are bound already left out."""
        names = [a.arg for a in (*source.node.args.posonlyargs, *source.node.args.args)]
        return names[len(source.bound) :]

    def _rates(self, value: Any) -> tuple[Any, ...]:
        node = self.source.node
        value = opened(value, self.parameters)
        if isinstance(value, Nothing) or value is None:
            raise self.fail(node, "it returns nothing, at least on one path; expected dy/dt")
        if isinstance(value, (Expr, *(int, float))) or is_condition(value):
            value = [value]
        if not isinstance(value, (list, tuple, np.ndarray)):
            raise self.fail(node, f"it returns {type(value).__name__}, expected one rate a state")
        rates = np.array(value, dtype=object).ravel().tolist()
        if len(rates) != len(self.states):
            raise self.fail(node, f"it returns {len(rates)} rates for {len(self.states)} states")
        for rate in rates:
            if isinstance(rate, Nothing):
                raise self.fail(node, "a rate is not set on every path")
            if not isinstance(rate, Expr) and not is_number(rate) and not is_condition(rate):
                raise self.fail(node, f"a rate is {type(rate).__name__}, expected a number")
        return tuple(sympy.sympify(as_number(rate)) for rate in rates)

    # -- state of the program ------------------------------------------------------------------------------

    def _kept(self) -> tuple[Any, Any]:
        return copied({"frames": self.frames, "memory": self.remembered}, {})["frames"], dict(self.remembered)

    def _forked(self, condition: Any, yes: Then, no: Then) -> Any:
        """Follow both sides of a condition; the value is what they give, the state what they leave."""
        frames, remembered = self._kept()
        scopes = self.scopes
        first = yes()
        after, memory = self.frames, self.remembered
        self.frames, self.remembered, self.scopes = frames, remembered, scopes
        second = no()
        memo: dict[tuple[int, int], Any] = {}
        out = self.flags.choose(condition, first, second, memo)
        nothing = Nothing("path")
        self.frames = {
            number: {
                name: self.flags.choose(
                    condition, after[number].get(name, nothing), here.get(name, nothing), memo
                )
                for name in {**after[number], **here}
            }
            for number, here in self.frames.items() if number in after
        }  # fmt: skip
        keys = {**memory, **self.remembered}
        self.remembered = {
            key: self.flags.choose(
                condition, memory.get(key, self.memories[key].symbol),
                self.remembered.get(key, self.memories[key].symbol),
            )
            for key in keys
        }  # fmt: skip
        return out

    # -- statements ----------------------------------------------------------------------------------------

    def block(self, statements: Sequence[ast.stmt], then: Then, loop: Loop = None) -> Any:
        """Do statements, then what comes after; the value is what the function returns."""
        for k, node in enumerate(statements):
            self._statements += 1
            if self._statements > MOST_STATEMENTS:
                raise self.fail(node, f"more than {MOST_STATEMENTS} statements are gone through")
            rest = statements[k + 1 :]

            def following(rest: Sequence[ast.stmt] = rest) -> Any:
                return self.block(rest, then, loop)

            if isinstance(node, ast.Return):
                return None if node.value is None else self.value(node.value)
            if isinstance(node, ast.Raise):
                self._remark(f"line {at(node)} raises an exception: that part of the states is left out")
                return Nothing("raise")
            if isinstance(node, (ast.Break, ast.Continue)):
                assert loop is not None
                return loop[isinstance(node, ast.Continue)]()
            if isinstance(node, ast.If):
                held = self.truth(node.test, self.value(node.test))
                if isinstance(held, bool):
                    return self.block(node.body if held else node.orelse, following, loop)
                both = node.body, node.orelse
                if _leaves(node):
                    return self._forked(held, *(partial(self.block, part, following, loop) for part in both))
                self._forked(held, *(partial(self.block, part, _nothing) for part in both))
            elif isinstance(node, (ast.For, ast.While)):
                return self._loop(node, following)
            else:
                self._simple(node)
        return then()

    def _loop(self, node: ast.For | ast.While, following: Then) -> Any:
        done: Then = following if not node.orelse else lambda: self.block(node.orelse, following)
        items = self.items(node.iter, self.value(node.iter)) if isinstance(node, ast.For) else None

        def begin(k: int) -> bool:
            """Whether there is a k-th turn."""
            if isinstance(node, ast.For):
                assert items is not None
                if k < len(items):
                    self.assign(node.target, items[k])
                return k < len(items)
            held = self.truth(node.test, self.value(node.test))
            if not isinstance(held, bool):
                raise self.fail(
                    node.test, "a loop that the state ends is not followed; write its cases with if"
                )
            return held

        def turn(k: int) -> Any:
            if not begin(k):
                return done()
            return self.block(node.body, lambda: turn(k + 1), (following, lambda: turn(k + 1)))

        if _leaves(node):
            return turn(0)
        number = 0
        while begin(number):
            self.block(node.body, _nothing)
            number += 1
        return done()

    def _simple(self, node: ast.stmt) -> None:
        if isinstance(node, ast.Assign):
            value = self.value(node.value)
            for target in node.targets:
                self.assign(target, value)
        elif isinstance(node, ast.AnnAssign):
            if node.value is not None:
                self.assign(node.target, self.value(node.value))
        elif isinstance(node, ast.AugAssign):
            self._augmented(node)
        elif isinstance(node, ast.Expr):
            if not isinstance(node.value, ast.Constant):
                self.value(node.value)
        elif isinstance(node, ast.FunctionDef):
            if node.decorator_list:
                raise self.fail(node, "a decorated function inside is not followed")
            self.frames[self.scopes[-1]][node.name] = Closure(node, self.source, self.scopes)
        elif isinstance(node, (ast.Global, ast.Nonlocal)):
            for name in node.names:
                self._outer(node, name)
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            self._import(node)
        elif not isinstance(node, (ast.Pass, ast.Assert)):
            raise self.fail(node, f"{type(node).__name__.lower()} is not followed")

    def _augmented(self, node: ast.AugAssign) -> None:
        target = node.target
        load = ast.copy_location(
            ast.Name(target.id, ast.Load()) if isinstance(target, ast.Name)
            else ast.Attribute(target.value, target.attr, ast.Load()) if isinstance(target, ast.Attribute)
            else ast.Subscript(target.value, target.slice, ast.Load()), target,
        )  # fmt: skip
        old = self.value(load)
        new = self.binary(node, node.op, old, self.value(node.value))
        if isinstance(old, np.ndarray):  # in place: all names of the array see it
            old[...] = new
        else:
            self.assign(target, new)

    def _import(self, node: ast.Import | ast.ImportFrom) -> None:
        import importlib

        for alias in node.names:
            home = alias.name if isinstance(node, ast.Import) else str(node.module)
            if home.split(".")[0] not in {"math", "numpy", "scipy", "operator"}:
                raise self.fail(
                    node, "an import inside the function is followed for math, numpy and scipy only"
                )
            module: Any = importlib.import_module({"math": "math", "operator": "operator"}.get(home, home))
            found = module if isinstance(node, ast.Import) else getattr(module, alias.name)
            self.frames[self.scopes[-1]][alias.asname or alias.name.split(".")[0]] = found

    # -- assignments ---------------------------------------------------------------------------------------

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
            if isinstance(owner, Outside):
                self._remember(target, _Place("item", owner.value, key), value)
            elif isinstance(owner, (list, dict, np.ndarray)):
                owner[key] = value
            else:
                raise self.fail(target, f"an assignment to an item of {type(owner).__name__}")
        elif isinstance(target, ast.Attribute):
            owner = self.value(target.value)
            held = owner.value if isinstance(owner, Outside) else owner
            self._remember(target, _Place("attribute", held, target.attr), value)
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

    def _names(self) -> tuple[str | None, ...]:
        """The first name of each state that means this state wherever it is given."""
        names: dict[Symbol, str] = {}
        for (_, name), values in self.given_to.items():
            only = next(iter(values)) if len(values) == 1 else None
            if only is not None:
                names.setdefault(only, name)
        return tuple(names.get(x) for x in self.states)

    def _outer(self, node: ast.Global | ast.Nonlocal, name: str) -> None:
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
        frame[name] = _Place("cell" if key is None else "item", holder, key)
        self._known_memory(node, frame[name], name)

    def _known_memory(self, node: ast.AST, place: _Place, label: str) -> tuple[Any, ...]:
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
            raise _Again
        return found

    def _remember(self, node: ast.expr, place: _Place, value: Any) -> None:
        self.remembered[self._known_memory(node, place, self.source.text(node))] = value

    def log(self, node: ast.AST, owner: Outside) -> None:
        """Note that the program keeps a record in a container outside."""
        self.logs.add(id(owner.value))
        self._remark(f"line {at(node)} keeps a record in {owner.label}, which is left out")

    def _remark(self, sentence: str) -> None:
        if sentence not in self.remarks:
            self.remarks.append(sentence)

    # -- calls ---------------------------------------------------------------------------------------------

    def call(self, node: ast.AST, function: Any, args: list[Any], named: dict[str, Any]) -> Any:
        """The value of a call of a function of the program or of a library."""
        if isinstance(function, Outside):
            function = function.value
        if isinstance(function, (Closure, _Live)):
            return self._enter(node, function, args, named)
        if isinstance(function, types.FunctionType) and functions.is_library(function):
            return self.library(node, function, args, named)
        if isinstance(function, np.vectorize):
            return self.call(node, function.pyfunc, args, named)
        is_own = isinstance(function, (types.FunctionType, types.MethodType)) or (
            not functions.is_library(function) and not isinstance(function, type) and callable(function)
        )
        if not is_own or functions.is_unsteady(function):
            return self.library(node, function, args, named)
        try:
            if function not in self._sources:
                self._sources[function] = source_of(function)
        except ModelError as error:
            raise self.fail(node, str(error).rstrip(".")) from None
        source = self._sources[function]
        return self._enter(node, _Live(source, source.function), args, named)

    def _enter(self, node: ast.AST, function: Any, args: list[Any], named: dict[str, Any]) -> Any:
        inner, source = function.node, function.source
        if self._depth >= MOST_CALLS:
            raise self.fail(node, f"calls are nested more than {MOST_CALLS} deep")
        frame = self._bound(node, function, args, named)
        self._frame += 1
        number = self._frame
        kept = self.source, self.scopes
        self.frames[number] = frame
        self.source, self.scopes = source, (*function.scopes, number)
        self._depth += 1
        try:
            if isinstance(inner, ast.Lambda):
                return self.value(inner.body)
            return self.block(inner.body, _nothing)
        finally:
            self._depth -= 1
            self.source, self.scopes = kept

    def _bound(self, node: ast.AST, function: Any, args: list[Any], named: dict[str, Any]) -> dict[str, Any]:
        """The arguments of a call by name, as Python binds them."""
        a, source = function.node.args, function.source
        bound = [self.parameters.inside(v, "self" if k == 0 else "") for k, v in enumerate(function.bound)]
        preset = {k: self.parameters.inside(v, k) for k, v in function.named.items()}
        args, named = [*bound, *args], {**preset, **named}
        names = [part.arg for part in (*a.posonlyargs, *a.args)]
        frame: dict[str, Any] = dict(zip(names, args, strict=False))
        if len(args) > len(names) and a.vararg is None:
            raise self.fail(node, f"{len(args)} arguments for {len(names)}")
        if a.vararg is not None:
            frame[a.vararg.arg] = tuple(args[len(names) :])
        known = {*names, *(part.arg for part in a.kwonlyargs)}
        for key in list(named):
            if key in known:
                frame[key] = named.pop(key)
        if a.kwarg is not None:
            frame[a.kwarg.arg] = named
        elif named:
            raise self.fail(node, f"{', '.join(named)} is no argument of it")
        for name, default in self._defaults(function).items():
            if name not in frame:
                frame[name] = default
        missing = [name for name in known if name not in frame]
        if missing:
            raise self.fail(
                node, f"the arguments {', '.join(missing)} have no value: give args=(...)"
                if source.function is self._program else f"the arguments {', '.join(missing)} are missing",
            )  # fmt: skip
        return frame

    @property
    def _program(self) -> Any:
        return (
            next(iter(self._sources.values()), self.source).function
            if self._sources
            else self.source.function
        )

    def _defaults(self, function: Any) -> dict[str, Any]:
        a = function.node.args
        positional = [part.arg for part in (*a.posonlyargs, *a.args)]
        if isinstance(function, _Live):
            given = function.live.__defaults__ or ()
            names = positional[len(positional) - len(given) :]
            values = {**dict(zip(names, given, strict=True)), **(function.live.__kwdefaults__ or {})}
            return {name: self.parameters.inside(value, name) for name, value in values.items()}
        names = positional[len(positional) - len(a.defaults) :]
        out = {name: self.value(value) for name, value in zip(names, a.defaults, strict=True)}
        for part, value in zip(a.kwonlyargs, a.kw_defaults, strict=True):
            if value is not None:
                out[part.arg] = self.value(value)
        return out


@dataclass(frozen=True)
class _Place:
    """Where a value outside is kept: kind "item", "attribute" or "cell"."""

    kind: str
    holder: Any
    key: Any


class _Live:
    """A function of the program that is there when it runs, with what comes before its arguments."""

    scopes: tuple[int, ...] = ()

    def __init__(self, source: Source, live: types.FunctionType) -> None:
        self.node, self.source, self.live = source.node, source, live
        self.bound, self.named = source.bound, source.named


Closure.bound = ()  # type: ignore[attr-defined]  # a function within the program has nothing before its arguments
Closure.named = {}  # type: ignore[attr-defined]


def _key(memory: Memory) -> tuple[Any, ...]:
    kind, holder, key = memory.place
    return (id(holder), None if kind == "cell" else key)


def _nothing() -> None:
    return None


def _leaves(node: ast.AST) -> bool:
    """Whether a statement may leave its block: a return, a break or a continue stands in it."""
    for part in ast.iter_child_nodes(node):
        if isinstance(part, (ast.FunctionDef, ast.Lambda, ast.ClassDef)):
            continue
        if isinstance(part, (ast.Return, ast.Break, ast.Continue, ast.Raise)) or _leaves(part):
            return True
    return False


def read_program(function: Callable[..., Any], n: int, args: Sequence[Any] = ()) -> Reading:
    """The equations of a program f(t, y, *args) with n states. Raises ModelError, ReadingError."""
    source = source_of(function)
    memories: dict[Any, Memory] = {}
    for _ in range(20):
        try:
            return Reader(source, n, args, memories).read()
        except _Again:
            continue
        except ReadingError:
            for memory in memories.values():
                if not memory.flag:  # said first: what is done with the number follows from it
                    automaton.rules(memory, Parameters())
            raise
        except RecursionError:
            raise ReadingError(
                f"{source.name} in {Path(source.file).name} is nested too deeply to be followed; write "
                "loops with "
                "returns in them as conditions.", at(source.node),
            ) from None  # fmt: skip
    raise ReadingError(f"{source.name} remembers more than 20 values between calls.", at(source.node))


def signature(function: Callable[..., Any]) -> str:
    """The arguments of a function as text."""
    return str(inspect.signature(function))
