"""Expressions as nested lists of text and numbers, exactly: what is read back equals what was written.

    ["int", "3"]  ["rational", "1", "10"]  ["float", [sign, mantissa, exponent, bits], precision]
    ["t"]  ["x", 0]  ["p", 2]  ["s", 0]  ["a", 0]     time, state, parameter, sign and size by number
    ["u", 4]                                          input, or derivative of one
    ["constant", "pi"]      ["Add", tree, tree, ...]  and the other functions of HEADS

Text such as "0.1*x" would be shorter, but it does not tell 1/10 from 0.1 or s*(a + b) from s*a + s*b. Nothing
is looked up by name but in these tables, and nothing is evaluated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import sympy
from sympy import Symbol
from sympy.functions.elementary.piecewise import ExprCondPair

from filippov.base.elementary import ELEMENTARY
from filippov.base.errors import ModelError
from filippov.model.symbolic import Select
from filippov.model.symbols import t

DEEPEST = 200
LARGEST = 200_000
LONGEST_NUMBER = 2000
HEADS: dict[str, Any] = {
    name: getattr(sympy, name)
    for name in (
        *(f.symbolic for f in ELEMENTARY), "Add", "Mul", "Pow", "cot", "sec", "csc", "acot", "coth", "Abs",
        "sign", "Heaviside", "Min", "Max", "frac", "Mod", "erfc", "gamma", "loggamma", "LambertW", "besselj",
        "bessely", "besseli", "besselk",
    )
} | {"Select": Select}  # fmt: skip
_LOGIC: dict[str, Any] = {"Piecewise": sympy.Piecewise, "ExprCondPair": ExprCondPair} | {
    name: getattr(sympy, name) for name in ("And", "Or", "Not", "Xor", "ITE")
}
_RELATIONS: dict[str, Any] = {
    kind.__name__: kind for kind in (sympy.Gt, sympy.Ge, sympy.Lt, sympy.Le, sympy.Eq, sympy.Ne)
}
_CONSTANTS: dict[str, Any] = {
    "pi": sympy.pi, "E": sympy.E, "GoldenRatio": sympy.GoldenRatio, "EulerGamma": sympy.EulerGamma,
    "Catalan": sympy.Catalan, "true": sympy.true, "false": sympy.false, "oo": sympy.oo, "-oo": -sympy.oo,
}  # fmt: skip
_NAME = {value: name for name, value in _CONSTANTS.items()}

Symbols = Mapping[str, Sequence[Symbol]]


class Writer:
    """Writes expressions; `symbols` maps "x", "p", "s", "a" to what is numbered under this letter."""

    def __init__(self, symbols: Symbols) -> None:
        self.places: dict[Symbol, list[Any]] = {t: ["t"]}
        for letter, items in symbols.items():
            self.places |= {symbol: [letter, i] for i, symbol in enumerate(items)}
        self.written = 0

    def tree(self, f: Any, depth: int = 0) -> list[Any]:
        """The expression as a tree; ModelError for what the format does not hold."""
        self.written += 1
        if depth > DEEPEST or self.written > LARGEST:
            raise ModelError(f"the expression is deeper than {DEEPEST} or larger than {LARGEST} terms.")
        if f in self.places:
            return list(self.places[f])
        if f in _NAME:
            return ["constant", _NAME[f]]
        if f.is_Integer:
            return ["int", str(f.p)]
        if f.is_Rational:
            return ["rational", str(f.p), str(f.q)]
        if f.is_Float:
            sign, mantissa, exponent, bits = f._mpf_
            return ["float", [int(sign), str(int(mantissa)), int(exponent), int(bits)], int(f._prec)]
        name = type(f).__name__
        if {**HEADS, **_LOGIC, **_RELATIONS}.get(name) is not type(f):
            raise ModelError(f"{name} in {str(f)[:60]!r} is not a function that can be stored.")
        return [name, *(self.tree(arg, depth + 1) for arg in f.args)]


class Reader:
    """Reads what a Writer with the same symbols wrote. Raises ModelError for everything else."""

    def __init__(self, symbols: Symbols) -> None:
        self.symbols = symbols
        self.read_so_far = 0

    def expression(self, tree: Any, depth: int = 0) -> Any:
        """The expression of a tree."""
        self.read_so_far += 1
        if depth > DEEPEST or self.read_so_far > LARGEST:
            raise ModelError(f"a stored expression is deeper than {DEEPEST} or larger than {LARGEST} terms.")
        if not isinstance(tree, list) or not tree or not isinstance(tree[0], str):
            raise _strange(tree)
        head, rest = tree[0], tree[1:]
        try:
            leaf = self._leaf(head, rest)
        except (ValueError, TypeError, IndexError, KeyError):
            raise _strange(tree) from None
        if leaf is not None:
            return leaf
        for table in (HEADS, _LOGIC, _RELATIONS):
            if head in table:
                args = [self.expression(arg, depth + 1) for arg in rest]
                try:
                    # As it was written: evaluating again could change it, and could take forever.
                    return table[head](*args) if table is _LOGIC else table[head](*args, evaluate=False)
                except (ValueError, TypeError, AttributeError):
                    raise _strange(tree) from None
        raise _strange(tree)

    def _leaf(self, head: str, rest: list[Any]) -> Any:
        if head == "t" and not rest:
            return t
        if head in self.symbols:
            (place,) = rest
            if isinstance(place, bool) or not isinstance(place, int) or place < 0:
                raise ValueError
            return self.symbols[head][place]
        if head == "constant":
            (name,) = rest
            return _CONSTANTS[name]
        if head in {"int", "rational"}:
            numbers = [_whole(text) for text in rest]
            if len(numbers) != (1 if head == "int" else 2):
                raise ValueError
            return sympy.Integer(*numbers) if head == "int" else sympy.Rational(*numbers)
        if head == "float":
            (sign, mantissa, exponent, bits), precision = rest
            if any(type(part) is not int for part in (sign, exponent, bits, precision)):
                raise ValueError
            if sign not in (0, 1) or not 1 <= precision <= 4000 or abs(exponent) > 100_000 or bits > 4000:
                raise ValueError
            return sympy.Float((sign, _whole(mantissa), exponent, bits), precision=precision)
        return None


def _whole(text: object) -> int:
    if not isinstance(text, str) or len(text) > LONGEST_NUMBER:
        raise ValueError
    return int(text)


def _strange(tree: Any) -> ModelError:
    return ModelError(f"{str(tree)[:80]} is not a stored expression.")
