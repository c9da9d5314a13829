"""Dual numbers, which carry derivatives through plain functions (forward-mode automatic differentiation).

    a + b eps with eps^2 = 0:   f(a + b eps) = f(a) + f'(a) b eps

b may be a vector, for derivatives along several directions at once, and a and b may be dual numbers of a
lower level, for second derivatives. numpy calls the methods here for its functions of arrays of objects.
Source: A. Griewank, A. Walther, Evaluating Derivatives, 2nd ed. (SIAM 2008), chapter 3.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from typing import Any

import numpy as np

_NUMBERS = (int, float, np.number, np.bool_)
Operator = Callable[[Any, Any], Any]
Rule = Callable[[Any, Any, Any], Any]


def plain(number: Any) -> Any:
    """The value of a number without its derivatives."""
    while isinstance(number, Dual):
        number = number.value
    return number


def apply(name: str, number: Any) -> Any:
    """The function of this name in numpy, of a number that may be dual."""
    return getattr(number, name)() if isinstance(number, Dual) else getattr(np, name)(number)


def _binary(function: Operator, by_first: Rule, by_second: Rule) -> Operator:
    """The function of two numbers, of which one is dual; the rules have (a, b, value)."""

    def call(a: Any, b: Any) -> Any:
        first = a.level if isinstance(a, Dual) else -1
        second = b.level if isinstance(b, Dual) else -1
        if (first < 0 and not isinstance(a, _NUMBERS)) or (second < 0 and not isinstance(b, _NUMBERS)):
            return NotImplemented
        level = max(first, second)
        x = a.value if first == level else a
        y = b.value if second == level else b
        value = function(x, y)
        if first < level:
            return Dual(level, value, b.slope * by_second(x, y, value))
        slope = a.slope * by_first(x, y, value)
        return Dual(level, value, slope + b.slope * by_second(x, y, value) if second == level else slope)

    return call


def _turned(function: Operator) -> Operator:
    return lambda b, a: function(a, b)


def _compared(function: Operator) -> Operator:
    return lambda a, b: function(plain(a), plain(b))


def _by_base(a: Any, b: Any, _: Any) -> Any:
    return b * a ** (b - 1) if b != 0 else 0.0


def _plain_arctan2(a: Any, b: Any) -> Any:
    return arctan2(a, b) if isinstance(a, Dual) or isinstance(b, Dual) else np.arctan2(a, b)


_add = _binary(operator.add, lambda a, b, r: 1.0, lambda a, b, r: 1.0)
_sub = _binary(operator.sub, lambda a, b, r: 1.0, lambda a, b, r: -1.0)
_mul = _binary(operator.mul, lambda a, b, r: b, lambda a, b, r: a)
_div = _binary(operator.truediv, lambda a, b, r: 1.0 / b, lambda a, b, r: -r / b)
_pow = _binary(operator.pow, _by_base, lambda a, b, r: r * apply("log", a))
# Of a quotient rounded down only the jumps change.
_mod = _binary(operator.mod, lambda a, b, r: 1.0, lambda a, b, r: -float(plain(a) // plain(b)))
arctan2 = _binary(_plain_arctan2, lambda a, b, r: b / (a * a + b * b), lambda a, b, r: -a / (a * a + b * b))


class Dual:
    """The number value + slope eps of a level; numbers of lower levels are constants to it."""

    __slots__ = ("level", "slope", "value")

    def __init__(self, level: int, value: Any, slope: Any) -> None:
        self.level, self.value, self.slope = level, value, slope

    __add__, __radd__ = _add, _turned(_add)
    __sub__, __rsub__ = _sub, _turned(_sub)
    __mul__, __rmul__ = _mul, _turned(_mul)
    __truediv__, __rtruediv__ = _div, _turned(_div)
    __pow__, __rpow__ = _pow, _turned(_pow)
    __mod__, __rmod__ = _mod, _turned(_mod)
    __lt__, __le__ = _compared(operator.lt), _compared(operator.le)
    __gt__, __ge__ = _compared(operator.gt), _compared(operator.ge)
    __eq__, __ne__ = _compared(operator.eq), _compared(operator.ne)

    def __neg__(self) -> Dual:
        return Dual(self.level, -self.value, -self.slope)

    def __pos__(self) -> Dual:
        return self

    def __abs__(self) -> Any:
        # At 0 the mean of the slopes on both sides, which is what a central difference has.
        return self * float(np.sign(plain(self)))

    def __bool__(self) -> bool:
        return bool(plain(self) != 0.0)

    # Steps are constant but where they jump.
    def __floor__(self) -> int:
        return math.floor(float(plain(self)))

    def __ceil__(self) -> int:
        return math.ceil(float(plain(self)))

    def __trunc__(self) -> int:
        return math.trunc(float(plain(self)))

    def __round__(self, digits: int | None = None) -> Any:
        return round(float(plain(self)), digits)

    def __floordiv__(self, other: Any) -> Any:
        return plain(self) // plain(other)

    def __rfloordiv__(self, other: Any) -> Any:
        return plain(other) // plain(self)

    # By the names that numpy has for them; the functions of one number follow below.
    arctan2 = arctan2
    fabs = __abs__
    conjugate = __pos__

    def hypot(self, other: Any) -> Any:
        """sqrt(a^2 + b^2)"""
        return apply("sqrt", self * self + other * other)


# Derivatives by the names that numpy has for the functions, of the argument and the value.
_FUNCTIONS: dict[str, Callable[[Any, Any], Any]] = {
    "sin": lambda v, r: apply("cos", v),
    "cos": lambda v, r: -apply("sin", v),
    "tan": lambda v, r: 1.0 + r * r,
    "arcsin": lambda v, r: 1.0 / apply("sqrt", (1.0 - v) * (1.0 + v)),
    "arccos": lambda v, r: -1.0 / apply("sqrt", (1.0 - v) * (1.0 + v)),
    "arctan": lambda v, r: 1.0 / (1.0 + v * v),
    "sinh": lambda v, r: apply("cosh", v),
    "cosh": lambda v, r: apply("sinh", v),
    "tanh": lambda v, r: (1.0 - r) * (1.0 + r),
    "arcsinh": lambda v, r: 1.0 / apply("sqrt", v * v + 1.0),
    "arccosh": lambda v, r: 1.0 / apply("sqrt", (v - 1.0) * (v + 1.0)),
    "arctanh": lambda v, r: 1.0 / ((1.0 - v) * (1.0 + v)),
    "exp": lambda v, r: r,
    "exp2": lambda v, r: r * math.log(2.0),
    "expm1": lambda v, r: r + 1.0,
    "log": lambda v, r: 1.0 / v,
    "log2": lambda v, r: 1.0 / (v * math.log(2.0)),
    "log10": lambda v, r: 1.0 / (v * math.log(10.0)),
    "log1p": lambda v, r: 1.0 / (1.0 + v),
    "sqrt": lambda v, r: 0.5 / r,
    "cbrt": lambda v, r: r / (3.0 * v),
    "square": lambda v, r: 2.0 * v,
    "reciprocal": lambda v, r: -r * r,
    "deg2rad": lambda v, r: math.pi / 180.0,
    "radians": lambda v, r: math.pi / 180.0,
    "rad2deg": lambda v, r: 180.0 / math.pi,
    "degrees": lambda v, r: 180.0 / math.pi,
}


def _function(name: str) -> Callable[[Dual], Dual]:
    rule = _FUNCTIONS[name]

    def call(number: Dual) -> Dual:
        value = apply(name, number.value)
        return Dual(number.level, value, number.slope * rule(number.value, value))

    return call


for _name in _FUNCTIONS:
    setattr(Dual, _name, _function(_name))
