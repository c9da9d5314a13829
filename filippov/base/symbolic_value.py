"""Whether a value is symbolic, asked without loading sympy: as long as it is not loaded there is none.

Loading it takes longer than anything else at the start of a process; what is made of plain functions, and
what only runs compiled code, does without.
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any, TypeGuard

if TYPE_CHECKING:
    from sympy import Expr, Symbol


def is_expression(value: object) -> TypeGuard[Expr]:
    """Whether a value is a sympy expression."""
    return _is("sympy.core.expr", "Expr", value)


def is_symbol(value: object) -> TypeGuard[Symbol]:
    """Whether a value is a sympy symbol."""
    return _is("sympy.core.symbol", "Symbol", value)


def single(value: Any) -> Any:
    """The symbol of a tuple of one, as states("u") gives; anything else as it is."""
    return value[0] if isinstance(value, tuple) and len(value) == 1 and is_symbol(value[0]) else value


def is_condition(value: object) -> bool:
    """Whether a value is a condition such as x > 0, and no expression."""
    return _is("sympy.logic.boolalg", "Boolean", value) and not is_expression(value)


def _is(module: str, name: str, value: object) -> bool:
    # A module that is being loaded just now may not have its class yet.
    kind: Any = getattr(sys.modules.get(module), name, None)
    return kind is not None and isinstance(value, kind)
