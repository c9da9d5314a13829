"""Plain Python fields as machine code where numba can compile them: the same numbers, only faster."""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import Any

# Returned by the compiled field where the plain one must be called.
ASK = 2
# Functions of math that raise where the functions of C return infinities or NaN.
_DOMAINS = (
    "acos", "acosh", "asin", "atanh", "cos", "cosh", "exp", "expm1", "gamma", "lgamma", "log", "log10",
    "log1p", "log2", "sin", "sinh", "sqrt", "tan",
)  # fmt: skip
_DOMAINS_OF_TWO = ("fmod", "pow")


@dataclass(frozen=True)
class CompiledField:
    """Address of a C function with the signature of `call_field`, and the object that keeps it alive."""

    address: int
    owner: object


class NotCompiledError(Exception):
    """A function that numba does not compile, with the reason."""


def compile_field(field: Callable[..., Any], names: tuple[str, ...], n: int, m: int) -> CompiledField:
    """The user's f(t, x, p, s) as a C function. Raises NotCompiledError.

    It returns ASK where the function raises, divides by zero, reads beyond an array or returns what is not a
    number: the plain function then decides. p is a named tuple in compiled code: p.mass and p[0] work,
    p["mass"] does not.
    """
    plain = getattr(field, "py_func", field)
    if not isinstance(plain, FunctionType):
        raise NotCompiledError("the field is not a plain function (def or lambda)")
    from numba import carray, cfunc, njit, types
    from numba.np.unsafe.ndarray import to_fixed_tuple

    record: Any = namedtuple("Parameters", names)  # type: ignore[misc]  # noqa: PYI024
    count, ask = len(names), ASK
    double = types.CPointer(types.float64)
    signature = types.int64(types.float64, double, double, double, double, double)
    # The arguments are read-only, as those of the plain function.
    vector = types.Array(types.float64, 1, "C", readonly=True)
    values = types.NamedUniTuple(types.float64, count, record) if count else types.NamedTuple((), record)
    try:
        inner = njit(error_model="python", boundscheck=True)(_with_domains(plain))

        def sealed(t, x, p, s):  # type: ignore[no-untyped-def]
            return inner(t, x, p, s)

        typed = njit((types.float64, vector, values, vector))(sealed)

        def call(t, x, p, s, m_, out):  # type: ignore[no-untyped-def]
            try:
                given = record(*to_fixed_tuple(carray(p, (count,)), count))
                result = typed(t, carray(x, (n,)), given, carray(s, (m,)))
                if len(result) != n:
                    return ask
                for i in range(n):
                    if not math.isfinite(result[i]):
                        return ask
                    out[i] = result[i]
            except Exception:  # noqa: BLE001 (the plain function is asked, and raises it)
                return ask
            return 0

        compiled = cfunc(signature)(call)
    except Exception as error:  # noqa: BLE001 (what numba does not know it meets with errors of any kind)
        raise NotCompiledError(f"numba says: {_said(error)}") from None
    return CompiledField(int(compiled.address), compiled)


def _said(error: Exception) -> str:
    """The line of a numba error that says what is wrong."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    telling = [line for line in lines if not line.startswith(("Failed in", "During", "File", "No impl"))]
    return (telling or lines or [type(error).__name__])[0].rstrip(".")[:200]


def _with_domains(plain: FunctionType) -> FunctionType:
    """The function with functions of math that raise outside their domain, as in Python."""
    names = {name: _strict(plain.__globals__[name]) for name in _used(plain) if name in plain.__globals__}
    changed = {name: value for name, value in names.items() if value is not plain.__globals__[name]}
    if not changed:
        return plain
    inside = {**plain.__globals__, **changed}
    out = FunctionType(plain.__code__, inside, plain.__name__, plain.__defaults__, plain.__closure__)
    out.__kwdefaults__ = plain.__kwdefaults__
    return out


def _used(plain: FunctionType) -> set[str]:
    """All names used in a function and in the functions nested in it."""
    waiting, found = [plain.__code__], set[str]()
    while waiting:
        code = waiting.pop()
        found |= set(code.co_names)
        waiting += [item for item in code.co_consts if isinstance(item, type(code))]
    return found


def _strict(value: Any) -> Any:
    if value is math:
        return _mathematics()
    name = value.__name__ if isinstance(value, BuiltinFunctionType) else ""
    return vars(_mathematics())[name] if name and getattr(math, name, None) is value else value


@cache
def _mathematics() -> ModuleType:
    """The module math, for compiled code, with errors where Python has them."""
    from numba import njit

    def one(function: Any) -> Any:
        def checked(x):  # type: ignore[no-untyped-def]
            y = function(x)
            if not math.isfinite(y) and (math.isfinite(x) or (math.isnan(y) and not math.isnan(x))):
                raise ValueError("math domain or range error")
            return y

        return njit(checked)

    def two(function: Any) -> Any:
        def checked(x, y):  # type: ignore[no-untyped-def]
            z = function(x, y)
            if not math.isfinite(z) and math.isfinite(x) and math.isfinite(y):
                raise ValueError("math domain or range error")
            return z

        return njit(checked)

    module = ModuleType("math")
    vars(module).update(vars(math))
    vars(module).update({name: one(getattr(math, name)) for name in _DOMAINS})
    vars(module).update({name: two(getattr(math, name)) for name in _DOMAINS_OF_TWO})
    return module
