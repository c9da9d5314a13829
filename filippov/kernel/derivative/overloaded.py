"""Plain functions as they are for dual numbers: what they call of `math` takes these too."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from types import BuiltinFunctionType, CellType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

from filippov.kernel.derivative.dual import Dual, apply, arctan2, plain

Function = Callable[..., Any]
# Functions of `math` by the names that numpy, and dual numbers, have for them.
_NAMES = {
    "asin": "arcsin", "acos": "arccos", "atan": "arctan", "asinh": "arcsinh", "acosh": "arccosh",
    "atanh": "arctanh", "degrees": "rad2deg", "radians": "deg2rad",
} | {
    name: name
    for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "exp2", "expm1", "log2", "log10",
                 "log1p", "sqrt", "cbrt")
}  # fmt: skip
# Of the value alone: steps, and questions about it.
_OF_VALUES = ("floor", "ceil", "trunc", "isnan", "isfinite", "isinf", "isclose")


def _log(x: Any, base: Any = None) -> Any:
    return apply("log", x) if base is None else apply("log", x) / apply("log", base)


def _erf(x: Dual, name: str = "erf", sign: float = 1.0) -> Dual:
    by_value = sign * 2.0 / math.sqrt(math.pi) * apply("exp", -x.value * x.value)
    return Dual(x.level, overloaded_name(name)(x.value), x.slope * by_value)


_OTHERS: dict[str, Function] = {
    "log": _log,
    "pow": lambda a, b: a**b,
    "fabs": abs,
    "atan2": arctan2,
    "hypot": lambda *sides: apply("sqrt", sum(side * side for side in sides)),
    "fmod": lambda a, b: a - b * math.trunc(plain(a) / plain(b)),
    "copysign": lambda a, b: a * (math.copysign(1.0, plain(a)) * math.copysign(1.0, plain(b))),
    "erf": _erf,
    "erfc": lambda x: _erf(x, "erfc", -1.0),
}
_DEEPEST = 20


@functools.cache
def overloaded_name(name: str) -> Function:
    """The function of this name of `math` for numbers that may be dual."""
    original: Function = getattr(math, name)

    def call(*arguments: Any) -> Any:
        if not any(isinstance(value, Dual) for value in arguments):
            return original(*arguments)
        if name in _NAMES:
            return apply(_NAMES[name], *arguments)
        if name in _OF_VALUES:
            return original(*(plain(value) for value in arguments))
        if name in _OTHERS:
            return _OTHERS[name](*arguments)
        raise TypeError(f"math.{name} has no derivative here")

    return call


class _Mathematics:
    """The module `math` for dual numbers."""

    def __getattr__(self, name: str) -> Any:
        value = getattr(math, name)
        return overloaded_name(name) if callable(value) else value


class _Names(dict[str, Any]):
    """The names of a module with some replaced: what is missing is read where it stands now."""

    def __init__(self, replaced: dict[str, Any], module: dict[str, Any]) -> None:
        super().__init__(replaced)
        self.module = module

    def __missing__(self, name: str) -> Any:
        return self.module[name]


def overloaded(function: Function) -> Function:
    """The function for arguments that may be dual; where nothing need change the function itself."""
    found = _replaced(function, 0)
    return function if found is None else found


def _replaced(value: Any, depth: int) -> Any:
    """What stands for a value that a function reads; None for the value itself."""
    if value is math:
        return _Mathematics()
    if isinstance(value, BuiltinFunctionType) and value.__module__ == "math":
        return overloaded_name(value.__name__)
    if depth > _DEEPEST:
        return None
    compiled_from = getattr(value, "py_func", None)
    if compiled_from is not None:
        inner = _replaced(compiled_from, depth)
        return compiled_from if inner is None else inner
    if isinstance(value, functools.partial):
        inner = _replaced(value.func, depth + 1)
        return None if inner is None else functools.partial(inner, *value.args, **value.keywords)
    if isinstance(value, MethodType):
        inner = _replaced(value.__func__, depth + 1)
        return None if inner is None else MethodType(inner, value.__self__)
    if isinstance(value, FunctionType):
        # What numpy is written in takes objects as it is.
        foreign = (value.__module__ or "").partition(".")[0] in ("numpy", "scipy")
        return None if foreign else _copy(value, depth)
    if isinstance(value, type | ModuleType):
        return None
    call = getattr(type(value), "__call__", None)  # noqa: B004 - its function is wanted
    if isinstance(call, FunctionType):
        inner = _replaced(call, depth + 1)
        return None if inner is None else MethodType(inner, value)
    return None


def _copy(function: FunctionType, depth: int) -> Any:
    """The function with other names for what it calls of `math`; None where it calls nothing of it."""
    names: dict[str, Any] = {}
    for name in _names(function.__code__):
        if name in function.__globals__ and function.__globals__[name] is not function:
            replaced = _replaced(function.__globals__[name], depth + 1)
            if replaced is not None:
                names[name] = replaced
    cells, changed = [], False
    for cell in function.__closure__ or ():
        replaced = None
        try:
            if cell.cell_contents is not function:
                replaced = _replaced(cell.cell_contents, depth + 1)
        except ValueError:
            # A name of the function around it that is not bound yet.
            pass
        # A cell that holds nothing of the kind is shared, so that the copy reads what is bound to it later.
        cells.append(cell if replaced is None else CellType(replaced))
        changed = changed or replaced is not None
    if not names and not changed:
        return None
    copy = FunctionType(
        function.__code__, _Names(names, function.__globals__), function.__name__, function.__defaults__,
        tuple(cells) if function.__closure__ is not None else None,
    )  # fmt: skip
    copy.__kwdefaults__ = function.__kwdefaults__
    return copy


def _names(code: CodeType) -> Iterator[str]:
    """The global names that code may read, and that of functions within it."""
    yield from code.co_names
    for inner in code.co_consts:
        if isinstance(inner, CodeType):
            yield from _names(inner)
