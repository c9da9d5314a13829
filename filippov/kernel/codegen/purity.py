"""Whether a plain function is pure: its value depends on its arguments alone.

Machine code keeps the values that were read at compile time. A function may therefore be replaced by its
machine code only where all that it reads besides its arguments is constant: numbers, modules of mathematics,
and functions that are pure themselves. A name of a module or of an enclosing function may be bound to another
number later: such names are listed, to be checked again.
"""

from __future__ import annotations

import builtins
import dis
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

_MATHEMATICS = ("math", "numpy", "numpy.linalg")
_IMPURE_NAMES = ("random", "ctypeslib", "testing")
_BUILTINS = frozenset(
    getattr(builtins, name)
    for name in ("abs", "all", "any", "bool", "complex", "divmod", "enumerate", "float", "int", "len", "list",
                 "max", "min", "pow", "range", "reversed", "round", "sorted", "sum", "tuple", "zip")
)  # fmt: skip
# Instructions that write outside the function, or give access to what other code may write to.
_WRITES = {
    "STORE_GLOBAL": "assigns to the global name {}",
    "DELETE_GLOBAL": "deletes the global name {}",
    "STORE_ATTR": "assigns to the attribute {}",
    "DELETE_ATTR": "deletes the attribute {}",
    "IMPORT_NAME": "imports {} when it is called",
    "LOAD_BUILD_CLASS": "makes a class",
    "YIELD_VALUE": "yields",
}
_CHAIN = ("LOAD_ATTR", "LOAD_METHOD")
_GLOBAL = ("LOAD_GLOBAL", "LOAD_NAME")
_ENCLOSED = ("LOAD_DEREF", "LOAD_CLASSDEREF", "LOAD_FROM_DICT_OR_DEREF")
_DEEPEST = 20
_MISSING = object()


@dataclass
class Purity:
    """The result of inspecting a function.

    reason   why the function is not pure; empty where it is
    watched  functions that look up its names, with the values found: other values change its meaning
    """

    reason: str = ""
    watched: list[tuple[Callable[[], Any], Any]] = field(default_factory=list)

    def unchanged(self) -> bool:
        """Whether every name is still bound to the same value."""
        return all(look() is value for look, value in self.watched)


def purity(function: Any) -> Purity:
    """Whether a function is pure by inspection, with all functions that it calls, and what to watch."""
    found = Purity()
    try:
        _Inspection(found).function(function, 0)
    except _ImpureError as error:
        found.reason = str(error)
    return found


class _ImpureError(Exception):
    """What makes a function impure."""


class _Inspection:
    """Inspect a function and those that it calls."""

    def __init__(self, found: Purity) -> None:
        self.found = found
        self.seen: set[int] = set()

    def watch(self, look: Callable[[], Any], value: Any) -> None:
        """Keep a name to be looked up again."""
        self.found.watched.append((look, value))

    def function(self, function: Any, depth: int) -> None:
        """Inspect one function."""
        plain = getattr(function, "py_func", function)
        if not isinstance(plain, FunctionType):
            raise _ImpureError(f"{_shown(function)} is not a plain function")
        if id(plain) in self.seen:
            return
        self.seen.add(id(plain))
        if depth > _DEEPEST:
            raise _ImpureError(f"functions call each other more than {_DEEPEST} deep")
        for value in (*(plain.__defaults__ or ()), *(plain.__kwdefaults__ or {}).values()):
            if not _constant(value):
                raise _ImpureError(f"a default argument is {_shown(value)}, which can change")
        for name in ("__code__", "__defaults__", "__kwdefaults__"):
            self.watch(partial(getattr, plain, name), getattr(plain, name))
        cells = dict(zip(plain.__code__.co_freevars, plain.__closure__ or (), strict=True))
        self.code(plain.__code__, plain.__globals__, cells, depth)

    def code(
        self, code: CodeType, names: Mapping[str, Any], cells: Mapping[str, Any], depth: int
    ) -> None:
        """Inspect the bytecode of a function, or of one nested in it."""
        steps = list(dis.get_instructions(code))
        for place, step in enumerate(steps):
            op, name = step.opname, step.argval
            if op in _WRITES:
                raise _ImpureError(_WRITES[op].format(name))
            if op in ("STORE_DEREF", "DELETE_DEREF") and name in cells:
                raise _ImpureError(f"assigns to {name} of the function around it")
            if op in _GLOBAL or (op in _ENCLOSED and name in cells):
                found = self.named(name, names) if op in _GLOBAL else self.enclosed(name, cells[name])
                self.value(str(name), found, _chain(steps[place + 1 :]), depth)
        for inner in code.co_consts:
            if isinstance(inner, CodeType):
                kept = {name: cells[name] for name in inner.co_freevars if name in cells}
                self.code(inner, names, kept, depth)

    def named(self, name: str, names: Mapping[str, Any]) -> Any:
        """The value of a global or built-in name."""
        value = names.get(name, _MISSING)
        self.watch(partial(names.get, name, _MISSING), value)
        if value is _MISSING:
            value = vars(builtins).get(name, _MISSING)
        if value is _MISSING:
            raise _ImpureError(f"{name} has no value yet")
        return value

    def enclosed(self, name: str, cell: Any) -> Any:
        """The value of a name of an enclosing function."""
        look = partial(getattr, cell, "cell_contents", _MISSING)
        value = look()
        if value is _MISSING:
            raise _ImpureError(f"{name} has no value yet")
        self.watch(look, value)
        return value

    def value(self, name: str, value: Any, chain: Iterator[str], depth: int) -> None:
        """Refuse a value that can change under the same name."""
        for attribute in chain:
            if not isinstance(value, ModuleType):
                if _constant(value):
                    return
                raise _ImpureError(f"reads the attribute {attribute} of {name}, {_shown(value)}")
            if attribute in _IMPURE_NAMES:
                raise _ImpureError(f"uses {name}.{attribute}")
            inner = getattr(value, attribute, _MISSING)
            self.watch(partial(getattr, value, attribute, _MISSING), inner)
            name, value = f"{name}.{attribute}", inner
        if isinstance(value, ModuleType):
            raise _ImpureError(f"hands on the module {name}")
        if _constant(value) or _of_mathematics(value):
            return
        if callable(value) and isinstance(getattr(value, "py_func", value), FunctionType):
            self.function(value, depth + 1)
            return
        raise _ImpureError(f"reads {name}, {_shown(value)}, which can change")


def _chain(steps: list[dis.Instruction]) -> Iterator[str]:
    """The attributes that are taken one after another of what was loaded last."""
    for step in steps:
        if step.opname in ("CACHE", "PUSH_NULL", "EXTENDED_ARG", "NOP"):
            continue
        if step.opname not in _CHAIN:
            return
        yield str(step.argval)


def _constant(value: Any) -> bool:
    """Whether a value can never change: numbers, text, and tuples of these."""
    if isinstance(value, tuple):
        return all(_constant(item) for item in value)
    # Classes derived from these may hold anything.
    return value is None or type(value) in (bool, int, float, complex, str) or (
        isinstance(value, np.bool_ | np.number) and type(value).__module__ == "numpy"
    )


def _of_mathematics(value: Any) -> bool:
    """Whether a value is a stateless function of Python, math or numpy."""
    if isinstance(value, np.ufunc):
        return True
    if isinstance(value, type):
        return value in _BUILTINS or (issubclass(value, np.bool_ | np.number) and value.__module__ == "numpy")
    try:
        if value in _BUILTINS:
            return True
    except TypeError:
        return False
    module, name = getattr(value, "__module__", None), getattr(value, "__name__", "")
    home: Any = {"math": math, "numpy": np, "numpy.linalg": np.linalg}.get(str(module))
    return module in _MATHEMATICS and callable(value) and getattr(home, name, None) is value


def _shown(value: Any) -> str:
    return f"{getattr(value, '__name__', '')} ({type(value).__name__})".strip()
