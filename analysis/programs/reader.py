"""A program f(t, y) followed statement by statement on both sides of its conditions, to its equations.

Nothing of the program is run: its syntax tree is gone through. Numbers that it finds outside itself (globals,
closures, defaults, attributes) become parameters; what it changes outside itself is a memory. Where a
condition depends on the state both sides are followed, and what they leave behind is put together.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import sympy
from sympy import Expr, Not, Symbol

from filippov.analysis.programs import automaton
from filippov.analysis.programs.arrays import Mask
from filippov.analysis.programs.calls import Live
from filippov.analysis.programs.choice import Flags, Nothing, copied, expression, is_condition, is_number
from filippov.analysis.programs.expressions import Closure
from filippov.analysis.programs.matching import Matching
from filippov.analysis.programs.notes import Again, Clock, Memory, ReadingError, Site, at
from filippov.analysis.programs.outside import Parameters, opened
from filippov.analysis.programs.source import Source, source_of

# Statements that are gone through until a program counts as too long.
MOST_STATEMENTS = 20_000
MODULES: dict[str, Any] = {"math": math, "numpy": np, "operator": operator}
Then = Callable[[], Any]
Loop = tuple[Then, Then] | None


@dataclass(frozen=True)
class Reading:
    """What a program says.

    source       where it stands
    field        one expression per state, in `time`, `states`, the symbols of parameters, memories and clocks
    states       symbols; names: those that the program gives them, None where it gives none
    parameters   numbers that it reads, with their names
    sites        where it switches; memories, clocks: what it needs states of their own for
    remarks      sentences
    unread       memories that no rate depends on, such as a number of calls
    dropped      dead bands that the field has no more: condition, what is small there, half-width
    held         (u, r): at u = 0 the sign of u may be anything in [-r, r]
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
    unread: tuple[Memory, ...] = ()
    dropped: tuple[tuple[Any, Any, float], ...] = ()
    held: tuple[tuple[Any, Any], ...] = ()


class Reader(Matching):
    """One reading of a program with n states and further arguments."""

    def __init__(
        self, source: Source, n: int, args: Sequence[Any], memories: dict[Any, Memory], logs: set[int],
        equal_nearby: bool = False,
    ) -> None:  # fmt: skip
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
        self._statements, self.depth, self.entered = 0, 0, 0
        self.sources: dict[Any, Source] = {}
        self.logs, self.equal_nearby = logs, equal_nearby
        self.assumed: dict[Any, bool] = {}  # conditions of the path that is gone

    def read(self) -> Reading:
        """Follow the program. Raises ReadingError, which names the line."""
        state = np.array(self.states, dtype=object)
        first = self.parameter_names(self.source)
        extra = [
            self.parameters.inside(value, first[2 + k] if 2 + k < len(first) else f"argument_{k + 1}")
            for k, value in enumerate(self.given)
        ]
        live = self.source.function
        value = self.call(self.source.node, Live(self.source, live), [self.time, state, *extra], {})
        field = self._rates(value)
        for memory in self.memories.values():
            memory.after = self.remembered.get(_key(memory), memory.symbol)
        read = self._read(field)
        unread = tuple(memory for memory in self.memories.values() if memory not in read)
        gone = {memory.symbol for memory in unread}
        sites = (site for site in self.sites if not gone & getattr(site.h, "free_symbols", set()))
        return Reading(
            self.source, field, self.time, self.states, self.state_names(), self.parameters,
            tuple(sites), tuple(read), tuple(self.clocks.values()), tuple(self.remarks), unread,
        )  # fmt: skip

    def _read(self, field: Sequence[Any]) -> list[Memory]:
        """The memories that a rate depends on, or another one that a rate depends on."""
        used = {symbol for rate in field for symbol in rate.free_symbols}
        read: list[Memory] = []
        while more := [m for m in self.memories.values() if m.symbol in used and m not in read]:
            read += more
            for memory in more:
                used |= getattr(memory.after, "free_symbols", set())
        return [memory for memory in self.memories.values() if memory in read]

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
            raise self.fail(node, f"it returns {type(value).__name__}, expected one rate per state")
        rates = np.array(value, dtype=object).ravel().tolist()
        if len(rates) != len(self.states):
            raise self.fail(node, f"it returns {len(rates)} rates for {len(self.states)} states")
        for rate in rates:
            if isinstance(rate, Nothing):
                raise self.fail(node, "a rate is not set on every path")
            if not isinstance(rate, Expr) and not is_number(rate) and not is_condition(rate):
                raise self.fail(node, f"a rate is {type(rate).__name__}, expected a number")
        return tuple(expression(rate) for rate in rates)

    # -- state of the program ------------------------------------------------------------------------------

    def _kept(self) -> tuple[Any, Any]:
        return copied({"frames": self.frames, "memory": self.remembered}, {})["frames"], dict(self.remembered)

    def forked(self, condition: Any, yes: Then, no: Then) -> Any:
        """Follow both sides of a condition; the value is what they give, the state what they leave."""
        if condition in self.assumed:
            return yes() if self.assumed[condition] else no()
        frames, remembered = self._kept()
        scopes, assumed = self.scopes, self.assumed
        self.assumed = {**assumed, condition: True, Not(condition): False}
        first = yes()
        after, memory = self.frames, self.remembered
        self.frames, self.remembered, self.scopes = frames, remembered, scopes
        self.assumed = {**assumed, condition: False, Not(condition): True}
        second = no()
        self.assumed = assumed
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
                self.remark(f"line {at(node)} raises an exception: that part of the states is left out")
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
                    return self.forked(held, *(partial(self.block, part, following, loop) for part in both))
                self.forked(held, *(partial(self.block, part, _nothing) for part in both))
            elif isinstance(node, ast.Match):
                if _leaves(node):
                    return self.cases(node, lambda c: self.block(c.body, following, loop), following)
                self.cases(node, lambda c: self.block(c.body, _nothing), _nothing)
            elif isinstance(node, ast.With):
                self._unheard(node)
                return self.block(node.body, following, loop)
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
                    node.test, "a loop that the state or the time ends is not followed; write its cases "
                    "with if, and a time within its period as t % T"
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

    def _unheard(self, node: ast.With) -> None:
        """Let a `with` pass that keeps numpy's warnings quiet."""
        for item in node.items:
            call = item.context_expr
            quiet = isinstance(call, ast.Call) and self.value(call.func) is np.errstate
            if not quiet or item.optional_vars is not None:
                raise self.fail(node, "with is followed for np.errstate(...) only")

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
                self.outer(node, name)
        elif isinstance(node, (ast.Import, ast.ImportFrom)):
            self._import(node)
        elif not isinstance(node, (ast.Pass, ast.Assert)):
            raise self.fail(
                node, f"{type(node).__name__.lower()} is not followed; write its cases with if"
            )

    def _augmented(self, node: ast.AugAssign) -> None:
        target = node.target
        load = ast.copy_location(
            ast.Name(target.id, ast.Load()) if isinstance(target, ast.Name)
            else ast.Attribute(target.value, target.attr, ast.Load()) if isinstance(target, ast.Attribute)
            else ast.Subscript(target.value, target.slice, ast.Load()), target,
        )  # fmt: skip
        if isinstance(target, ast.Subscript) and isinstance(key := self.key(target.slice), Mask):
            owner = self.value(target.value)
            more = self.value(node.value)
            fits = isinstance(owner, np.ndarray) and np.shape(owner) == np.shape(key.held)
            if not fits or np.ndim(more) != 0:
                raise self.fail(target, "an index of conditions is for one number and their own array")
            new = self.binary(node, node.op, owner, more)
            owner[...] = self.where(node, key.held, new, owner)
            return
        old = self.value(load)
        new = self.binary(node, node.op, old, self.value(node.value))
        if isinstance(old, np.ndarray):  # in place: all names of the array see it
            old[...] = new
        else:
            self.assign(target, new)

    def _import(self, node: ast.Import | ast.ImportFrom) -> None:
        for alias in node.names:
            home = alias.name if isinstance(node, ast.Import) else str(node.module)
            first, *parts = home.split(".")
            if first not in MODULES:
                raise self.fail(
                    node, f"an import inside the function is followed for {', '.join(MODULES)} only"
                )
            found: Any = MODULES[first]
            if not isinstance(node, ast.Import) or alias.asname:
                for part in (*parts, *(() if isinstance(node, ast.Import) else (alias.name,))):
                    found = getattr(found, part)
            self.frames[self.scopes[-1]][alias.asname or alias.name.partition(".")[0]] = found


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


def read_program(
    function: Callable[..., Any], n: int, args: Sequence[Any] = (), equal_nearby: bool = False
) -> Reading:
    """The equations of a program f(t, y, *args) with n states. Raises ModelError, ReadingError.

    equal_nearby    whether a float equals another in a band of no width to speak of; else it never does
    """
    source = source_of(function)
    memories: dict[Any, Memory] = {}
    logs: set[int] = set()
    for _ in range(20):
        try:
            return Reader(source, n, args, memories, logs, equal_nearby).read()
        except Again:
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
