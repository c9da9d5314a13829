"""Functions of numpy in expressions: np.sin(x), np.where(v > 0, a, b), np.maximum(v, 0), (x > 0)*1.

numpy asks its arguments who computes a function (__array_ufunc__ of NEP 13, __array_function__ of NEP 18),
and Python asks an operand for a product with a number. The expressions and conditions of sympy say nothing to
that, so they are given the answer here. What `if`, `and`, `max` and math.sin mean is decided by Python: they
ask for a truth value or a number, and the error of sympy then says what to write.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
import sympy
from sympy import Expr
from sympy.core.relational import Relational
from sympy.logic.boolalg import Boolean

from filippov.base.elementary import ELEMENTARY

IN_AN_EQUATION = (
    "In an equation a choice is a function: Piecewise((a, v > 0), (b, True)) for if, Max and Min for max and "
    "min, sign(v), Abs(v), Heaviside(v); conditions are joined by & and |. np.sign, np.maximum and np.clip "
    "take one expression at a time, no list of them."
)
_RENAMED = {"asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2", "asinh": "arcsinh",
            "acosh": "arccosh", "atanh": "arctanh"}  # fmt: skip
UFUNCS: dict[Any, Callable[..., Any]] = {
    getattr(np, _RENAMED.get(f.name, f.name)): getattr(sympy, f.symbolic)
    for f in ELEMENTARY
    if f.formula and hasattr(np, _RENAMED.get(f.name, f.name))
} | {
    np.sqrt: sympy.sqrt, np.sign: sympy.sign, np.absolute: sympy.Abs, np.fabs: sympy.Abs,
    np.maximum: sympy.Max, np.minimum: sympy.Min, np.fmax: sympy.Max, np.fmin: sympy.Min,
    np.heaviside: lambda x, half: sympy.Heaviside(x), np.hypot: lambda x, y: sympy.sqrt(x**2 + y**2),
    np.square: lambda x: x**2, np.cbrt: lambda x: sympy.sign(x) * sympy.Abs(x) ** sympy.Rational(1, 3),
    np.expm1: lambda x: sympy.exp(x) - 1, np.log1p: lambda x: sympy.log(1 + x),
    np.log10: lambda x: sympy.log(x) / sympy.log(10), np.log2: lambda x: sympy.log(x) / sympy.log(2),
    np.deg2rad: lambda x: x * sympy.pi / 180, np.rad2deg: lambda x: x * 180 / sympy.pi,
    np.less: operator.lt, np.less_equal: operator.le, np.greater: operator.gt, np.greater_equal: operator.ge,
    np.logical_and: sympy.And, np.logical_or: sympy.Or, np.logical_not: sympy.Not,
}  # fmt: skip
# What numpy does with objects element by element, by their operators.
_BY_OPERATORS = {
    np.add, np.subtract, np.multiply, np.true_divide, np.power, np.negative, np.positive, np.equal,
    np.not_equal, np.reciprocal, np.matmul,
}  # fmt: skip


_ENDLESS = {
    np.floor, np.ceil, np.rint, np.trunc, np.remainder, np.fmod, np.floor_divide, np.divmod, np.modf,
}  # fmt: skip
_STEPS = (
    "It jumps infinitely often: a quantiser has a Surface('name', sin(pi*u)), a sampled value is a state "
    "that a TimeEvent('clock', period=...) resets."
)


def number_of(condition: Any) -> Expr:
    """1 where a condition holds, else 0."""
    return sympy.Piecewise((1, condition), (0, True))


def _plain(value: Any) -> Any:
    # A symbol is of both kinds.
    return number_of(value) if isinstance(value, Boolean) and not isinstance(value, Expr) else value


def apply_ufunc(self: Any, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
    """What numpy's function of numbers gives for expressions."""
    if method != "__call__" or options.get("out") is not None:
        return NotImplemented
    asked = {name for name, value in options.items() if (name, value) not in (("out", None), ("where", True))}
    if asked:
        raise TypeError(f"np.{ufunc.__name__} of expressions takes no {', '.join(sorted(asked))}.")
    known = UFUNCS.get(ufunc)
    # A function of Python made one of arrays (np.frompyfunc, np.vectorize) takes whatever it is given.
    own = ufunc.types == ["O" * ufunc.nin + "->" + "O" * ufunc.nout]
    if ufunc in _ENDLESS:
        few = "A few steps are Piecewise or Heaviside from filippov."
        raise TypeError(f"np.{ufunc.__name__} is not known of expressions. {_STEPS} {few}")
    if known is None and ufunc not in _BY_OPERATORS and not own:
        raise TypeError(
            f"np.{ufunc.__name__} is not known of expressions: use sin, cos, tan, exp, log, sqrt, tanh, "
            "sign, Abs, Min, Max, Heaviside or Piecewise from filippov."
        )
    function = np.frompyfunc(known, ufunc.nin, 1) if known is not None else ufunc
    # In arrays of dimension 0, so that numpy does not ask again.
    objects = [_boxed(item) for item in inputs]
    out = function(*objects)
    return out.item() if isinstance(out, np.ndarray) and out.ndim == 0 else out


def _boxed(item: Any) -> Any:
    box = np.empty(np.shape(item) if isinstance(item, np.ndarray) else (), dtype=object)
    box[...] = item.item() if isinstance(item, np.generic) else item
    return box


def _where(condition: Any, x: Any, y: Any) -> Any:
    return sympy.Piecewise((x, condition), (y, True))


def _clip(a: Any, a_min: Any = None, a_max: Any = None, **limits: Any) -> Any:
    # The names are those of numpy, old and new.
    if left := limits.keys() - {"min", "max"}:
        raise TypeError(f"takes no {', '.join(sorted(left))}")
    low, high = limits.get("min", a_min), limits.get("max", a_max)
    upper = a if high is None else sympy.Min(a, high)
    return upper if low is None else sympy.Max(upper, low)


def _select(condlist: Any, choicelist: Any, default: Any = 0) -> Any:
    return sympy.Piecewise(*zip(choicelist, condlist, strict=True), (default, True))


FUNCTIONS: dict[Any, Callable[..., Any]] = {np.where: _where, np.clip: _clip, np.select: _select}
# What puts arrays together, whatever they hold.
_OF_SHAPES = {
    np.hstack, np.vstack, np.stack, np.column_stack, np.concatenate, np.append, np.atleast_1d, np.ravel,
    np.reshape, np.transpose, np.squeeze, np.shape, np.ndim, np.size, np.array_split, np.split, np.roll,
    np.flip, np.repeat,
}  # fmt: skip


def apply_function(self: Any, function: Any, types: Any, args: Any, options: Any) -> Any:
    """What numpy's function of arrays gives for expressions."""
    known = FUNCTIONS.get(function)
    if function in _OF_SHAPES:
        return function(*_as_arrays(args), **options)
    if known is None:
        name = getattr(function, "__name__", function)
        raise TypeError(
            f"np.{name} is not known of expressions: write it with Piecewise, Min and Max from filippov, or "
            "give the system as plain functions: System(field=f, ...)."
        )
    try:
        return known(*args, **{name: value for name, value in options.items() if value is not None})
    except TypeError as error:
        name = getattr(function, "__name__", function)
        raise TypeError(f"np.{name} of expressions: {str(error).removeprefix(known.__name__)}.") from None


def _as_arrays(value: Any) -> Any:
    """Expressions as arrays of dimension 0, also inside lists, so that numpy does not ask again."""
    if isinstance(value, list | tuple):
        return type(value)(_as_arrays(item) for item in value)
    return _boxed(value) if isinstance(value, Expr | Boolean) else value


def _with_advice(method: Callable[..., Any], advice: str) -> Callable[..., Any]:
    def asked(self: Any, *more: Any) -> Any:
        try:
            return method(self, *more)
        except TypeError as error:
            raise TypeError(f"{error}. {advice}") from None

    return asked


def _no_power(self: Any, other: Any) -> Any:
    # A symbol is a condition as well, and those have "either or".
    if isinstance(self, Boolean) and isinstance(other, Boolean):
        return sympy.Xor(self, other)
    raise TypeError(f"({self}) ^ ({other}) is no power in Python: write ({self})**({other}).")


def _method(function: Callable[..., Any]) -> Callable[[Any], Any]:
    def of_one(self: Any) -> Any:
        return function(self)

    return of_one


def install() -> None:
    """Give sympy's expressions and conditions the answers, once, where they have none of their own."""
    if hasattr(Expr, "__array_ufunc__"):
        return
    for kind in (Expr, Boolean):
        kind.__array_ufunc__ = apply_ufunc
        kind.__array_function__ = apply_function
    # For an array of expressions numpy calls the method of each that has the function's name.
    for ufunc, function in UFUNCS.items():
        if ufunc.nin == 1 and not hasattr(Expr, ufunc.__name__) and "O->O" in ufunc.types:
            setattr(Expr, ufunc.__name__, _method(function))
    Boolean.__mul__ = Boolean.__rmul__ = lambda self, other: number_of(self) * _plain(other)
    Boolean.__add__ = Boolean.__radd__ = lambda self, other: number_of(self) + _plain(other)
    Boolean.__sub__ = lambda self, other: number_of(self) - _plain(other)
    Boolean.__rsub__ = lambda self, other: _plain(other) - number_of(self)
    Boolean.__neg__ = lambda self: -number_of(self)
    Relational.__bool__ = _with_advice(Relational.__bool__, IN_AN_EQUATION)
    advice = "In an equation use sin, cos, exp, ... from filippov (or numpy), not those of math."
    Expr.__float__ = _with_advice(Expr.__float__, advice)
    Expr.__int__, Expr.__round__ = (_with_advice(f, _STEPS) for f in (Expr.__int__, Expr.__round__))
    Expr.__xor__ = Expr.__rxor__ = _no_power
