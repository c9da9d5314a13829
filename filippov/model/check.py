"""What an expression of a model may hold."""

from __future__ import annotations

import numbers

import numpy as np
import sympy
from sympy import Basic, Expr
from sympy.core.function import AppliedUndef
from sympy.core.numbers import ComplexInfinity, ImaginaryUnit, Infinity, NaN, NegativeInfinity
from sympy.logic.boolalg import Boolean

from filippov.base.errors import ModelError
from filippov.base.given import as_float, shown
from filippov.base.symbolic_value import single
from filippov.model.size import Scale

LARGEST, DEEPEST = 200_000, 100

_INFINITE = {NaN, ComplexInfinity, Infinity, NegativeInfinity}
# What is real of real arguments.
_REAL = {
    sympy.Add, sympy.Mul, sympy.Abs, sympy.sign, sympy.exp, sympy.sin, sympy.cos, sympy.tan, sympy.tanh,
    sympy.Max, sympy.Min, sympy.Heaviside, sympy.atan,
}  # fmt: skip
_JUMPS = (
    "it jumps infinitely often. Jumps in time are a TimeEvent('clock', period=...) with a state that it "
    "resets; jumps in a state u are Surface('name', sin(pi*u))"
)
_UNEVALUATED = "carry it out first (.doit()), the result must be a plain expression"
_REFUSED: dict[type, str] = {
    sympy.floor: _JUMPS,
    sympy.ceiling: _JUMPS,
    sympy.frac: _JUMPS,
    sympy.Mod: _JUMPS,
    sympy.Derivative: _UNEVALUATED,
    sympy.Integral: _UNEVALUATED,
    sympy.Sum: _UNEVALUATED,
    sympy.Product: _UNEVALUATED,
    sympy.Limit: _UNEVALUATED,
    sympy.Subs: _UNEVALUATED,
    sympy.DiracDelta: "an impulse is a reset of the state at an event, not a term of the field",
    sympy.SingularityFunction: "write it with Heaviside",
    sympy.arg: "use atan2(y, x)",
    sympy.re: "states and parameters are real",
    sympy.im: "states and parameters are real",
    sympy.conjugate: "states and parameters are real",
    AppliedUndef: "an undefined function cannot be evaluated; write its formula, or use System(field=f)",
}


def as_expression(value: object, where: str) -> Expr:
    """Return `value` (an expression or a real number) as a sympy expression; text is never parsed."""
    value = single(value)
    if isinstance(value, Expr):
        return value
    if isinstance(value, Boolean):
        raise ModelError(
            f"{where}: {value} is a condition, expected an expression. Write Heaviside(u - v) for u > v, "
            "or Piecewise((a, u > v), (b, True))."
        )
    if isinstance(value, bool | np.bool_):
        raise ModelError(
            f"{where}: {value} ({type(value).__name__}) was given, expected a sympy expression or a real "
            "number. Python's == compares names, not values, and what holds where x is 0 the inclusion sets: "
            "write Piecewise((a, x > 0), (b, True)) for the sides; for True and False write 1 and 0."
        )
    found = as_float(value)
    if found is not None:
        exact = isinstance(value, numbers.Rational)
        return sympy.sympify(value if exact else found)
    raise ModelError(
        f"{where}: {shown(value)} ({type(value).__name__}) was given, expected a sympy expression or a real "
        "number." + _cure(value)
    )


def _cure(value: object) -> str:
    if isinstance(value, str):
        return " Text is never parsed; write the expression itself."
    if type(value).__name__ == "Table":
        return " A table stands at an expression: curve(x) for curve = Table(x, y)."
    if callable(value):
        return " Functions go with System(field=f, states='x v')."
    if value is None:
        return " Where the state does not change write 0."
    if isinstance(value, (list, tuple, np.ndarray, sympy.MatrixBase)):
        return " Give one equation per state."
    return ""


def check_size(expr: Expr, where: str) -> None:
    """Raise ModelError if `expr` has more than LARGEST nodes or is nested deeper than DEEPEST.

    All that is shared in it counts as written out, for so it is gone through.
    """
    nodes, depth = Scale().weigh(expr)
    if depth > DEEPEST:
        raise ModelError(
            f"{where}: the expression is nested {depth} deep, expected at most {DEEPEST}. Give the system as "
            "plain functions: System(field=f, ...)."
        )
    if nodes > LARGEST:
        raise ModelError(
            f"{where}: the expression has {float(nodes):.3g} nodes, expected at most {LARGEST}. Give the "
            "system as plain functions: System(field=f, ...)."
        )


def check_expression(expr: Expr, where: str) -> None:
    """Raise ModelError if `expr` is complex, not finite, or holds a function that has no place in a field.
    """
    check_size(expr, where)
    kinds = {type(node) for node in sympy.preorder_traversal(expr)}
    if kinds & _INFINITE:
        raise ModelError(
            f"{where}: {expr} is not finite. Look for a division by zero or an infinite constant."
        )
    if ImaginaryUnit in kinds or (not _stays_real(expr) and expr.is_extended_real is False):
        raise ModelError(f"{where}: {expr} is complex, expected a real expression.")
    if not expr.is_commutative or getattr(expr, "is_Matrix", False):
        raise ModelError(f"{where}: {expr} is not a scalar. Give one equation a component.")
    for kind, advice in _REFUSED.items():
        if any(issubclass(found, kind) for found in kinds):
            node = next(node for node in sympy.preorder_traversal(expr) if isinstance(node, kind))
            raise ModelError(f"{where}: {node} cannot be used: {advice}.")


def _stays_real(expr: Basic) -> bool:
    """Whether an expression is real, or has no value, told by what it is made of.

    sympy's own answer takes most of the time that a large system takes to be read.
    """
    if not expr.args:
        return expr.is_extended_real is True
    real = expr.func in _REAL or (expr.is_Pow and expr.args[1].is_Integer)
    return real and all(map(_stays_real, expr.args))
