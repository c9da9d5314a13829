"""Conditions decided by the constants of a unit: branches that they rule out are not translated."""

import ast
import operator
from collections.abc import Callable, Container, Mapping

from filippov.kernel.language.unit import Constant

_COMPARE: dict[type[ast.cmpop], Callable[[float, float], bool]] = {
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
    ast.Eq: operator.eq, ast.NotEq: operator.ne,
}  # fmt: skip


def settled(node: ast.expr, constants: Mapping[str, Constant], changing: Container[str]) -> bool | None:
    """The truth of a condition decided by numbers and constants alone; None for others.

    changing: names of variables, which hide constants
    """
    value = _value(node, constants, changing)
    return None if value is None else bool(value)


def _value(node: ast.expr, constants: Mapping[str, Constant], changing: Container[str]) -> float | None:
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return node.value
    if isinstance(node, ast.Name) and node.id not in changing:
        value = constants.get(node.id)
        return None if isinstance(value, list) else value
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        inner = _value(node.operand, constants, changing)
        return None if inner is None else not inner
    if isinstance(node, ast.Compare) and len(node.ops) == 1:
        left, right = (_value(side, constants, changing) for side in (node.left, node.comparators[0]))
        return None if left is None or right is None else _COMPARE[type(node.ops[0])](left, right)
    if isinstance(node, ast.BoolOp):
        absorbs = isinstance(node.op, ast.Or)
        # From the left, as far as known: an earlier operand may be a call with side effects.
        for item in node.values:
            inner = _value(item, constants, changing)
            if inner is None:
                return None
            if bool(inner) == absorbs:
                return absorbs
        return not absorbs
    return None
