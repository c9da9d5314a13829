"""Calls of a program: of its own functions, of libraries, of methods of values."""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import types
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
import sympy
from sympy import Expr, Symbol

from filippov.analysis.programs import functions
from filippov.analysis.programs.arrays import HANDLERS
from filippov.analysis.programs.choice import as_number, elementwise, expression, is_number
from filippov.analysis.programs.expressions import Closure, Expressions, Method
from filippov.analysis.programs.outside import Outside, opened
from filippov.analysis.programs.source import Source, source_of
from filippov.base.errors import ModelError

# Calls inside each other until a program counts as too long.
MOST_CALLS = 40


class Live:
    """A function of the program that is there when it runs, with what comes before its arguments."""

    scopes: tuple[int, ...] = ()

    def __init__(self, source: Source, live: types.FunctionType) -> None:
        self.node, self.source, self.live = source.node, source, live
        self.bound, self.named = source.bound, source.named


Closure.bound = ()  # type: ignore[attr-defined]  # a function within the program has nothing before its arguments
Closure.named = {}  # type: ignore[attr-defined]


class Calls(Expressions):
    """Part of the reader: values of calls."""

    sources: dict[Any, Source]
    depth: int
    entered: int

    def block(self, statements: Sequence[ast.stmt], then: Callable[[], Any]) -> Any:
        """Do statements, then what comes after; the value is what the function returns."""
        raise NotImplementedError

    def call(self, node: ast.AST, function: Any, args: list[Any], named: dict[str, Any]) -> Any:
        """The value of a call of a function of the program or of a library."""
        if isinstance(function, Outside):
            function = function.value
        if isinstance(function, (Closure, Live)):
            return self._enter(node, function, args, named)
        if isinstance(function, types.FunctionType) and functions.is_library(function):
            return self.library(node, function, args, named)
        if isinstance(function, np.vectorize):
            return self.call(node, function.pyfunc, args, named)
        is_own = isinstance(function, (types.FunctionType, types.MethodType)) or (
            not functions.is_library(function) and not isinstance(function, type) and callable(function)
        )
        built_in = isinstance(function, types.BuiltinFunctionType)
        if not is_own or built_in or functions.is_unsteady(function):
            return self.library(node, function, args, named)
        try:
            if function not in self.sources:
                self.sources[function] = source_of(function)
        except ModelError as error:
            raise self.fail(node, str(error).rstrip(".")) from None
        source = self.sources[function]
        return self._enter(node, Live(source, source.function), args, named)

    def _enter(self, node: ast.AST, function: Any, args: list[Any], named: dict[str, Any]) -> Any:
        inner, source = function.node, function.source
        if self.depth >= MOST_CALLS:
            raise self.fail(node, f"calls are nested more than {MOST_CALLS} deep")
        frame = self._bound(node, function, args, named)
        self.entered += 1
        number = self.entered
        kept = self.source, self.scopes
        self.frames[number] = frame
        self.source, self.scopes = source, (*function.scopes, number)
        self.depth += 1
        try:
            if isinstance(inner, ast.Lambda):
                return self.value(inner.body)
            return self.block(inner.body, lambda: None)
        finally:
            self.depth -= 1
            self.source, self.scopes = kept

    def _bound(self, node: ast.AST, function: Any, args: list[Any], named: dict[str, Any]) -> dict[str, Any]:
        """The arguments of a call by name, as Python binds them."""
        a = function.node.args
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
            raise self.fail(node, f"the arguments {', '.join(missing)} have no value: give args=(...)")
        return frame

    def _defaults(self, function: Any) -> dict[str, Any]:
        a = function.node.args
        positional = [part.arg for part in (*a.posonlyargs, *a.args)]
        if isinstance(function, Live):
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

    def _Call(self, node: ast.Call) -> Any:
        if isinstance(node.func, ast.Name) and node.func.id == "print":
            return None
        if isinstance(node.func, ast.Name) and node.func.id == "super" and not node.args:
            return self._above(node)
        function = self.value(node.func)
        args = self._elements(node.args)
        named: dict[str, Any] = {}
        for word in node.keywords:
            if word.arg is not None:
                named[word.arg] = self.value(word.value)
                continue
            more = opened(self.value(word.value), self.parameters)
            if not isinstance(more, dict):
                raise self.fail(node, "** of what is no dict")
            named |= more
        if isinstance(function, Method):
            return self._method(node, function, args, named)
        return self.call(node, function, args, named)

    def _above(self, node: ast.AST) -> Outside:
        """super() in a method: its object, seen from the class above that of the method."""
        first = next(iter(self.frames[self.scopes[-1]].values()), None)
        try:
            own = self.source.outside("__class__")
        except (KeyError, ValueError):
            own = None
        if own is None or not isinstance(first, Outside):
            raise self.fail(node, "super() is followed in methods only")
        return Outside(super(own, first.value), "super()")

    def mapped(self, node: ast.AST, function: Any, *values: Any) -> list[Any]:
        """map(...), as a list."""
        rows = zip(*(self.items(node, value) for value in values), strict=False)
        return [self.call(node, function, list(row), {}) for row in rows]

    def library(self, node: ast.AST, function: Any, args: list[Any], named: dict[str, Any]) -> Any:
        """A call of a function of Python, math or numpy."""
        if functions.is_unsteady(function):
            raise self.fail(
                node, "it gives another value at each call: such a field has no solution to compare with"
            )
        if function is builtins.map:
            return self.mapped(node, *args)
        if "out" in named:
            raise self.fail(node, "out= is not followed; assign what the function gives")
        args = [opened(a, self.parameters) for a in args]
        named = {k: opened(v, self.parameters) for k, v in named.items() if k != "dtype"}
        if function in functions.SILENT:
            return None
        if function in functions.SWITCHING:
            return self._handled(node, functions.SWITCHING[function], args, named)
        if function in functions.SMOOTH and not named:
            return elementwise(lambda *v: self._smooth(node, function, *v), *args)
        if function in functions.BUILDING:
            return self._built(node, function, args, named)
        numbers = [self._known(a) for a in args]
        if functions.is_library(function) and _concrete([*numbers, *named.values()]):
            out = function(*self._lowered(numbers), **named)
            return np.asarray(out, dtype=object) if isinstance(out, np.ndarray) else out
        raise self.fail(node, functions.not_followed(function))

    def _handled(self, node: ast.AST, name: str, args: list[Any], named: dict[str, Any]) -> Any:
        handler = HANDLERS[name]
        try:
            inspect.signature(handler).bind(self, node, *args, **named)
        except TypeError as error:
            raise self.fail(node, f"it is not followed with these arguments: {error}") from None
        return handler(self, node, *args, **named)

    def _smooth(self, node: ast.AST, function: Any, *values: Any) -> Any:
        values = tuple(as_number(v) for v in values)
        if function is math.pow or function in {np.power, pow, np.float_power}:
            return self.power(node, *values)
        if all(is_number(v) for v in values):
            return function(*values)
        out = functions.SMOOTH[function](*values)
        if (
            isinstance(out, Expr)
            and out.has(sympy.Abs)
            and not any(expression(v).has(sympy.Abs) for v in values)
        ):
            self.site(node, "abs", next(iter(out.atoms(sympy.Abs))).args[0])
        return out

    def _built(self, node: ast.AST, function: Any, args: list[Any], named: dict[str, Any]) -> Any:
        if function is range:
            ends = [self.whole_number(node, a) for a in args]
            if None in ends:
                raise self.fail(node, "a range that depends on the state is not followed")
            return range(*ends)  # type: ignore[arg-type]
        try:
            if function in {np.array, np.asarray, np.atleast_1d, np.copy}:
                return (
                    np.array(args[0], dtype=object).reshape(-1)
                    if function is np.atleast_1d
                    else np.array(args[0], dtype=object)
                )
            if function is np.full:
                return np.full(self._shape(node, args[0]), args[1], dtype=object)
            out = function(*args, **named)
        except (TypeError, ValueError, IndexError) as error:
            raise self.fail(node, f"{type(error).__name__}: {error}") from None
        return np.asarray(out, dtype=object)[()] if isinstance(out, (np.ndarray, np.generic)) else out

    def _shape(self, node: ast.AST, value: Any) -> Any:
        if isinstance(value, (tuple, list)):
            return tuple(self.whole_number(node, v) for v in value)
        return self.whole_number(node, value)

    def _lowered(self, values: list[Any]) -> list[Any]:
        return [np.array(v.tolist()) if isinstance(v, np.ndarray) else v for v in values]

    def _known(self, value: Any) -> Any:
        """A value with numbers in place of parameters."""
        if isinstance(value, (tuple, list)):
            return type(value)(self._known(v) for v in value)
        number = self.fixed(value) if isinstance(value, Expr) else None
        return value if number is None else int(number) if number == round(number) else number

    def _method(self, node: ast.AST, method: Method, args: list[Any], named: dict[str, Any]) -> Any:
        if isinstance(method.owner, Outside) and method.name in {"append", "extend", "add", "write"}:
            self.log(node, method.owner)
            return None
        owner, name = opened(method.owner, self.parameters), method.name
        over = {
            "sum": "total",
            "max": "largest",
            "min": "least",
            "any": "any_of",
            "all": "all_of",
            "clip": "clip",
            "argmax": "place_of_largest",
            "argmin": "place_of_least",
            "std": "deviation",
            "var": "variance",
        }
        if name in over:
            return self._handled(node, over[name], [owner, *args], named)
        if isinstance(owner, list) and name in {"append", "extend"}:
            getattr(owner, name)(*args)
            return None
        if name == "astype":
            return elementwise(as_number, owner)
        if name not in functions.METHODS:
            raise self.fail(node, f"the method {name} is not followed")
        if name == "get" and isinstance(owner, dict):
            return owner.get(*args)
        if isinstance(owner, Symbol):
            return owner
        out = getattr(owner, name)(*args, **named)
        return np.asarray(out, dtype=object)[()] if isinstance(out, np.ndarray) else out

    def log(self, node: ast.AST, owner: Outside) -> None:
        """Note that the program keeps a record in a container outside."""
        raise NotImplementedError


def _concrete(values: Iterable[Any]) -> bool:
    """Whether no value holds an expression."""
    for value in values:
        if isinstance(value, sympy.Basic) or (callable(value) and not isinstance(value, type)):
            return False
        if isinstance(value, dict):
            return False
        if isinstance(value, (list, tuple, np.ndarray)) and not _concrete(
            np.ravel(np.asarray(value, dtype=object))
        ):
            return False
    return True
