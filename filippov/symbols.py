"""Time, states, and the sympy functions of which right-hand sides are made."""

from __future__ import annotations

import re
from collections.abc import Sequence

from sympy import (
    Abs,
    Expr,
    Heaviside,
    Max,
    Min,
    Piecewise,
    Symbol,
    cos,
    exp,
    log,
    pi,
    sign,
    sin,
    sqrt,
    tan,
    tanh,
)

from filippov.errors import ModelError
from filippov.names import check_name, check_unique

__all__ = [
    "Abs",
    "Expr",
    "Heaviside",
    "Max",
    "Min",
    "Piecewise",
    "Symbol",
    "cos",
    "exp",
    "log",
    "pi",
    "sign",
    "sin",
    "sqrt",
    "state_names",
    "states",
    "t",
    "tan",
    "tanh",
]

t = Symbol("t", real=True)


def state_names(names: str | Sequence[str | Symbol]) -> tuple[str, ...]:
    """Return checked, different names from "x v z", "x, v, z" or a sequence of names or symbols."""
    if isinstance(names, Symbol):
        names = [names]
    if isinstance(names, str):
        parts: list[object] = list(re.split(r"[\s,]+", names.strip(" ,\t\n")))
    elif isinstance(names, Sequence):
        parts = [n.name if isinstance(n, Symbol) else n for n in names]
    else:
        raise ModelError(f"states are {names!r}, expected text such as 'x v z' or a list of names.")
    if not parts or parts == [""]:
        raise ModelError("no state was named, expected at least one, for instance states('x v').")
    return check_unique((check_name(part, "state") for part in parts), "state")


def states(names: str | Sequence[str]) -> tuple[Symbol, ...]:
    """Return one real symbol a name: x, v = states("x v"). Always a tuple: (x,) = states("x")."""
    return tuple(Symbol(name, real=True) for name in state_names(names))
