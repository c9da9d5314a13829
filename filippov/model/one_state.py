"""What states("u") returns: a tuple of one state that counts as the state itself in expressions."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from sympy import Symbol
from sympy.core.sympify import converter

from filippov.base.symbolic_value import single
from filippov.model.numpy_functions import apply_function, apply_ufunc

_BOTH = ("add", "sub", "mul", "truediv", "pow")
_ONE = ("lt", "le", "gt", "ge")


class OneState(tuple[Symbol]):  # noqa: SLOT001  # numpy is to leave sums with it to it
    """(u,) of a state u: `(u,) = states("u")` unpacks it, and 2*u, -u, sin(u), {u: ...} take it as u."""

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> Any:
        return apply_ufunc(self[0], ufunc, method, *map(single, inputs), **options)

    def __array_function__(self, function: Any, types: Any, args: Any, options: Any) -> Any:
        return apply_function(self[0], function, types, tuple(map(single, args)), options)

    def __neg__(self) -> Any:
        return -self[0]

    def __abs__(self) -> Any:
        return abs(self[0])

    @property
    def name(self) -> str:
        """The name of the state."""
        return str(self[0].name)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self[0], name)


def _forward(function: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    return lambda self, other: function(self[0], single(other))


def _backward(function: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    return lambda self, other: function(single(other), self[0])


for _name in _BOTH:
    setattr(OneState, f"__{_name}__", _forward(getattr(operator, _name)))
    setattr(OneState, f"__r{_name}__", _backward(getattr(operator, _name)))
for _name in _ONE:
    setattr(OneState, f"__{_name}__", _forward(getattr(operator, _name)))

converter[OneState] = single
