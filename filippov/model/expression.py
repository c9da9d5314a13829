"""Expressions from text, safely: numbers, known names, + - * / **, comparisons and listed functions only."""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from typing import Any

import sympy
from sympy import Expr, Symbol

from filippov.base.elementary import ELEMENTARY
from filippov.base.errors import ModelError
from filippov.base.names import unknown
from filippov.model.size import MOST_NODES, Scale
from filippov.model.symbols import t

LONGEST = 20_000
DEEPEST = 60
LARGEST_POWER = 64
LARGEST_ARGUMENT = 700
LARGEST_NUMBER = 4096  # bits of numerator and denominator together
MOST_CHOICES = 32  # arguments of Min and Max, which are compared pair by pair
FUNCTIONS: dict[str, Any] = {
    **{f.name: getattr(sympy, f.symbolic) for f in ELEMENTARY if f.formula},
    **{name: getattr(sympy, name) for name in ("sqrt", "Abs", "sign", "Heaviside", "Min", "Max")},
    "abs": sympy.Abs, "ln": sympy.log, "min": sympy.Min, "max": sympy.Max, "sgn": sympy.sign,
    "cbrt": sympy.cbrt, "Piecewise": sympy.Piecewise, "Rational": lambda p, q=sympy.S.One: _ratio(p, q),
    "sec": lambda u: 1 / sympy.cos(u), "csc": lambda u: 1 / sympy.sin(u), "cot": lambda u: 1 / sympy.tan(u),
}
_CONSTANTS = {"pi": sympy.pi, "t": t}
_NUMBER = re.compile(r"[0-9.]+([eE][+-]?[0-9]+)?")


def parse_expression(text: str, names: Mapping[str, Expr | Symbol | float] | None = None) -> Expr:
    """The sympy expression that a text stands for.

    names: what other names mean (states, parameters); they take precedence over the constants pi and t.
    Decimal numbers are read exactly (0.1 is 1/10). Raises ModelError for anything outside the language, for
    text longer than LONGEST, nesting deeper than DEEPEST, powers beyond LARGEST_POWER, and for what stands
    for more than MOST_NODES nodes with its names written out. Sums and products may have thousands of terms.
    """
    if not isinstance(text, str):
        raise ModelError(f"expression is {text!r}, expected text.")
    tree = _tree(text, "expression")
    return _Reader(text, dict(_CONSTANTS) | dict(names or {})).read(tree.body, 0)


def parse_condition(text: str, names: Mapping[str, Expr | Symbol | float] | None = None) -> Any:
    """The sympy condition that a text such as "0 < K < 1386" or "a > 0 and a*b > c" stands for.

    Comparisons < <= > >= (also chained) of expressions, joined by `and`, `or`, `not` and brackets. Raises
    ModelError as `parse_expression` does.
    """
    tree = _tree(text, "condition")
    return _Reader(text, dict(_CONSTANTS) | dict(names or {})).condition(tree.body, 0)


def _tree(text: str, what: str) -> ast.Expression:
    """The syntax tree of a text; nothing of it is run."""
    if len(text) > LONGEST:
        raise ModelError(f"{what} has {len(text)} characters, expected at most {LONGEST}.")
    try:
        return ast.parse(text.strip(), mode="eval")
    except (RecursionError, MemoryError):
        raise ModelError(f"{what} {text[:80]!r} is nested too deeply or has thousands of terms.") from None
    except (SyntaxError, ValueError):
        bars = " Write abs(u) for |u|." if "|" in text else ""
        raise ModelError(
            f"cannot read the {what} {text[:80]!r}: it is not a formula such as 2*sin(x) + v**2.{bars}"
        ) from None


_COMPARISONS: dict[type[ast.cmpop], Any] = {
    ast.Lt: sympy.Lt, ast.LtE: sympy.Le, ast.Gt: sympy.Gt, ast.GtE: sympy.Ge,
}  # fmt: skip


_LOGIC: dict[str, Any] = {"And": sympy.And, "Or": sympy.Or, "Not": sympy.Not}


class _Reader:
    def __init__(self, text: str, names: Mapping[str, Any]) -> None:
        self.text, self.names = text, names
        self.lines = [line.encode() for line in text.strip().splitlines(keepends=True)]
        self.scale = Scale()

    def piece(self, node: ast.expr) -> str:
        """The text of a part on one line; of a longer one the beginning."""
        line = self.lines[node.lineno - 1]
        end = node.end_col_offset if node.end_lineno == node.lineno else len(line)
        return line[node.col_offset : end].decode(errors="replace")

    def refuse(self, node: ast.expr, why: str) -> ModelError:
        piece = self.piece(node)
        return ModelError(f"expression {self.text[:80]!r}: {piece[:60]!r} {why}.")

    def read(self, node: ast.expr, depth: int) -> Any:
        """The value of a part; ModelError where it is too large."""
        value = self.value(node, depth)
        nodes, deep = self.scale.weigh(value)
        if nodes > MOST_NODES:
            raise self.refuse(
                node, f"stands for an expression of {float(nodes):.3g} nodes, expected at most {MOST_NODES}"
            )
        if deep > DEEPEST:
            raise self.refuse(node, f"stands for an expression nested deeper than {DEEPEST}")
        if value.is_Rational and value.p.bit_length() + value.q.bit_length() > LARGEST_NUMBER:
            raise self.refuse(node, "is too large a number")
        return value

    def value(self, node: ast.expr, depth: int) -> Any:
        if depth > DEEPEST:
            raise ModelError(f"expression {self.text[:80]!r} is nested deeper than {DEEPEST}.")
        if isinstance(node, ast.Constant):
            return self.number(node)
        if isinstance(node, ast.Name):
            if node.id not in self.names:
                raise ModelError(unknown("name", node.id, self.names))
            value = self.names[node.id]
            return value if isinstance(value, sympy.Basic) else sympy.Float(value)
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
            value = self.read(node.operand, depth + 1)
            return -value if isinstance(node.op, ast.USub) else value
        if isinstance(node, ast.BinOp):
            return self.binary(node, depth)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
            if node.func.id not in FUNCTIONS:
                raise ModelError(unknown("function", node.func.id, FUNCTIONS))
            if node.func.id == "Piecewise":
                return self.piecewise(node, depth + 1)
            return self.apply(node, [self.read(argument, depth + 1) for argument in node.args])
        function = node.func if isinstance(node, ast.Call) else None
        if isinstance(function, ast.Attribute):  # np.sin(x), math.sin(x)
            raise self.refuse(node, f"is not allowed; write {function.attr}(...) alone")
        raise self.refuse(node, "is not allowed; use numbers, names, + - * / ** and functions")

    def condition(self, node: ast.expr, depth: int) -> Any:
        if depth > DEEPEST:
            raise ModelError(f"condition {self.text[:80]!r} is nested deeper than {DEEPEST}.")
        if isinstance(node, ast.BoolOp):
            join = sympy.And if isinstance(node.op, ast.And) else sympy.Or
            return join(*(self.condition(part, depth + 1) for part in node.values))
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitAnd | ast.BitOr):  # (a < b) & (c < d)
            join = sympy.And if isinstance(node.op, ast.BitAnd) else sympy.Or
            return join(*(self.condition(part, depth + 1) for part in (node.left, node.right)))
        if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.Invert):
            return sympy.Not(self.condition(node.operand, depth + 1))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _LOGIC:
            return self.joined(node, _LOGIC[node.func.id], depth + 1)
        if isinstance(node, ast.Compare) and all(type(op) in _COMPARISONS for op in node.ops):
            sides = [self.read(side, depth + 1) for side in (node.left, *node.comparators)]
            pairs = zip(node.ops, sides[:-1], sides[1:], strict=True)
            return sympy.And(*(_COMPARISONS[type(op)](a, b) for op, a, b in pairs))
        raise self.refuse(node, "is not a condition; use < <= > >= and, or, not")

    def joined(self, node: ast.Call, join: Any, depth: int) -> Any:
        if node.keywords or not 1 <= len(node.args) <= (1 if join is sympy.Not else MOST_CHOICES):
            raise self.refuse(node, "has the wrong number of conditions")
        return join(*(self.condition(part, depth) for part in node.args))

    def piecewise(self, node: ast.Call, depth: int) -> Any:
        """The value of Piecewise((u, x > 0), ..., (w, True))."""
        pairs = [part.elts for part in node.args if isinstance(part, ast.Tuple) and len(part.elts) == 2]
        if not 1 <= len(pairs) == len(node.args) <= MOST_CHOICES:
            raise self.refuse(node, "is not of the form Piecewise((u, x > 0), (w, True))")
        pieces: list[Any] = []
        for value, condition in pairs:
            always = isinstance(condition, ast.Constant) and condition.value is True
            pieces.append((self.read(value, depth), always or self.condition(condition, depth)))
        return sympy.Piecewise(*pieces)

    def number(self, node: ast.Constant) -> Expr:
        if isinstance(node.value, bool) or not isinstance(node.value, int | float):
            raise self.refuse(node, "is not a number")
        source = self.piece(node)
        if not _NUMBER.fullmatch(source) or len(source) > 60 or abs(node.value) > 1e300:
            raise self.refuse(node, "is not a decimal number of reasonable size")
        if node.value and abs(node.value) < 1e-300:
            raise self.refuse(node, "is too small a number")
        return sympy.Rational(source)

    def binary(self, node: ast.BinOp, depth: int) -> Any:
        if isinstance(node.op, ast.Add | ast.Sub):
            signs = {ast.Add: 1, ast.Sub: -1}
            first, rest = _chain(node, ast.Add | ast.Sub)
            parts = [(self.read(part, depth + 1), signs[op]) for op, part in rest]
            return sympy.Add(self.read(first, depth + 1), *(sign * value for value, sign in parts))
        if isinstance(node.op, ast.Mult | ast.Div):
            return self.product(node, depth)
        if isinstance(node.op, ast.Pow):
            left, right = self.read(node.left, depth + 1), self.read(node.right, depth + 1)
            if right.is_number and not abs(right) <= LARGEST_POWER:
                raise self.refuse(node, f"has an exponent beyond {LARGEST_POWER}")
            if left.is_number and left.is_Rational and left.p.bit_length() + left.q.bit_length() > 4096:
                raise self.refuse(node, "is too large a number")
            return left**right
        raise self.refuse(node, "uses an operator that is not allowed; use + - * / **")

    def product(self, node: ast.BinOp, depth: int) -> Any:
        first, rest = _chain(node, ast.Mult | ast.Div)
        factors = [self.read(first, depth + 1)]
        for op, part in rest:
            value = self.read(part, depth + 1)
            if op is ast.Div and value.is_zero:
                raise self.refuse(part, "is zero, and something is divided by it")
            factors.append(value if op is ast.Mult else 1 / value)
        return sympy.Mul(*factors)

    def apply(self, node: ast.Call, values: list[Any]) -> Any:
        if len(values) > MOST_CHOICES:
            raise self.refuse(node, f"has {len(values)} arguments, expected at most {MOST_CHOICES}")
        # sympy turns exp(n log 2) into the whole number 2**n, however many digits that has.
        for value in values if node.func.id in ("exp", "sinh", "cosh") else ():  # type: ignore[attr-defined]
            if value.is_number and not abs(value.evalf(8)) < LARGEST_ARGUMENT:
                raise self.refuse(node, f"has an argument beyond {LARGEST_ARGUMENT}")
        try:
            return FUNCTIONS[node.func.id](*values)  # type: ignore[attr-defined]
        except (TypeError, ValueError):
            raise self.refuse(node, "has the wrong number or kind of arguments") from None


def _ratio(p: Expr, q: Expr) -> Expr:
    if q.is_zero:
        raise ValueError
    return p / q


def _chain(node: ast.BinOp, ops: Any) -> tuple[ast.expr, list[tuple[type[ast.operator], ast.expr]]]:
    """The first part of a + b - c + ..., and the others with their operators, in order."""
    rest: list[tuple[type[ast.operator], ast.expr]] = []
    place: ast.expr = node
    while isinstance(place, ast.BinOp) and isinstance(place.op, ops):
        rest.append((type(place.op), place.right))
        place = place.left
    return place, rest[::-1]
