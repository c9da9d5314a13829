"""User events that are plain functions of an expression that is worth compiling: they become the expression.

A function of scipy's form g(t, y), as `lambda t, y: y[1]`, is called; an expression is compiled, and one that
is the h of a surface is decided with it. Where the instructions of a function do arithmetic only, in one line
without a branch or a call, and all else that it reads is constant, its value for symbols is the function. It
is taken if it is a number times the h of a surface with the parameters of the run, or has no numbers: of
functions with another threshold each, each would be compiled.
"""

from __future__ import annotations

import dis
from collections.abc import Sequence
from dataclasses import replace
from inspect import CO_VARARGS, CO_VARKEYWORDS
from types import FunctionType
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.base.arrays import Array
from filippov.kernel.codegen.purity import purity
from filippov.model.system import System
from filippov.model.user_event import UserEvent

if TYPE_CHECKING:
    from sympy import Expr

# Instructions of arithmetic on arguments and constants, by how they begin.
_ARITHMETIC = (
    "BINARY_", "CACHE", "COPY", "EXTENDED_ARG", "LOAD_CONST", "LOAD_DEREF", "LOAD_FAST", "LOAD_GLOBAL",
    "LOAD_SMALL_INT", "NOP", "RESUME", "RETURN_", "STORE_FAST", "SWAP", "UNARY_NEGATIVE", "UNARY_POSITIVE",
    "UNPACK_SEQUENCE",
)  # fmt: skip
# More states make arithmetic on all of them long.
MOST_STATES = 200


def as_expressions(system: System, p: Array, users: tuple[UserEvent, ...]) -> tuple[UserEvent, ...]:
    """The events, with an expression for a function that is one of a surface, or of states alone."""
    called = [user for user in users if isinstance(user.g, FunctionType) and _is_arithmetic(user.g)]
    # Expressions are made when they are asked for.
    form = system.symbolic if called else None
    if form is None or len(form.x) > MOST_STATES:
        return users
    from filippov.model.symbols import t

    values = dict(zip(form.p, map(float, p), strict=True))
    surfaces = [
        h
        for h, surface in zip(form.h, system.surfaces, strict=True)
        if surface.kind != "observer" and h.free_symbols <= {t, *form.x, *form.p}
    ]
    return tuple(
        replace(user, g=_expression(user.g, form.x, surfaces, values) or user.g) if user in called else user
        for user in users
    )


def _is_arithmetic(function: FunctionType) -> bool:
    """Whether a function is one line of arithmetic on its arguments and on constants."""
    code = function.__code__
    given = function.__defaults__ or ()
    plain = code.co_argcount == 2 + len(given) and all(type(value) in (int, float) for value in given)
    plain = plain and not code.co_kwonlyargcount and not code.co_flags & (CO_VARARGS | CO_VARKEYWORDS)
    plain = plain and all(i.opname.startswith(_ARITHMETIC) for i in dis.get_instructions(code))
    return plain and not purity(function).reason


def _expression(g: Any, x: Sequence[Expr], surfaces: Sequence[Expr], values: dict[Any, float]) -> Expr | None:
    """The h of a surface, or -h, that a function is but for a factor, or what it is of states; else None."""
    from sympy import Expr, Float, Number, S, diff, expand

    from filippov.model.symbols import t

    state = np.array(x, dtype=object)
    state.flags.writeable = False
    try:
        found = g(t, state)
    except Exception:  # noqa: BLE001  # the function is called at its own risk with symbols
        return None
    if not isinstance(found, Expr) or not found.free_symbols <= {t, *x}:
        return None
    numbers = {symbol: Float(value, 17) for symbol, value in values.items()}
    for h in surfaces:
        own = h.xreplace(numbers)
        if own.free_symbols != found.free_symbols or not own.free_symbols:
            continue
        symbol = min(own.free_symbols, key=str)
        factor = diff(found, symbol) / diff(own, symbol)
        if factor.is_number and factor.is_finite and factor.is_real and expand(found - factor * own) == 0:
            return h if factor > 0 else -h
    return found if found.free_symbols and found.atoms(Number) <= {S.One, -S.One} else None
