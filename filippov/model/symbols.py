"""Time, states, and the sympy functions of which right-hand sides are made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy
from sympy import (
    Abs,
    Expr,
    Heaviside,
    Max,
    Min,
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

from filippov.base.errors import ModelError
from filippov.base.keywords import keywords
from filippov.base.names import state_names
from filippov.model.numpy_functions import install
from filippov.model.one_state import OneState

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

install()
t = Symbol("t", real=True)


def Piecewise(*pieces: Any, **options: Any) -> Expr:
    """Piecewise((a, x > 0), (b, True)): a where x > 0, else b; at x = 0 the inclusion of both.

    Raises ModelError for conditions that Python has decided: `x == 0` compares names, and is False.
    """
    for k, piece in enumerate(pieces, 1):
        decided = piece[1] if isinstance(piece, tuple | list) and len(piece) == 2 else None
        if decided is False or (decided is True and k < len(pieces)):
            raise ModelError(
                f"Piecewise: condition {k} of {len(pieces)} is {decided}, expected one such as x > 0 (True "
                "for the last). Python's == and != compare names, not values, and what holds where x is 0 "
                "the inclusion sets: write Piecewise((a, x > 0), (b, True)) for the sides."
            )
    return sympy.Piecewise(*pieces, **options)


_ONE_TEXT = {"*": "states was given several values, expected the names in one text: x, v = states('x v')."}


@keywords("keyword", error=ModelError, own=("names",), answers=_ONE_TEXT)
def states(names: str | Sequence[str]) -> tuple[Symbol, ...]:
    """Return one real symbol per name: x, v = states("x v"), and (x,) = states("x") or x = states("x")."""
    made = tuple(Symbol(name, real=True) for name in state_names(names))
    return OneState(made) if len(made) == 1 else made


def states_of(given: object) -> tuple[Symbol, ...]:
    """The symbols of states that are given as such or by their names; ModelError for anything else."""
    if isinstance(given, list | tuple) and given and all(isinstance(x, Symbol) for x in given):
        return tuple(given)
    return tuple(states(given))  # type: ignore[arg-type]  # what names no states is refused there
