"""Partial derivatives of expressions that share parts: each part is differentiated once.

sympy differentiates a tree, and asks every node again which symbols are below it; the levels of friction that
name each other are a graph with few nodes, whose tree has hundreds of thousands.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import sympy
from sympy import Expr, Symbol
from sympy.core.function import Application


class Partials:
    """The symbols in expressions and their partial derivatives, kept for every part that is asked for.

    A power b**e has the slope e b**(e - 1) by b: sympy's own, e b**e / b, is 0/0 at b = 0. A function with a
    method `differentiated` makes its derivative of those of its arguments.
    """

    def __init__(self) -> None:
        self._symbols: dict[Any, frozenset[Symbol]] = {}
        self._slopes: dict[Symbol, dict[Expr, Expr]] = {}

    def symbols(self, e: Any) -> frozenset[Symbol]:
        """The symbols in an expression."""
        known = self._symbols.get(e)
        if known is None:
            inside = [self.symbols(arg) for arg in e.args]
            known = frozenset().union(*inside) if inside else frozenset(e.free_symbols)
            self._symbols[e] = known
        return known

    def by(self, e: Expr, q: Symbol) -> Expr:
        """The partial derivative of an expression."""
        if q not in self.symbols(e):
            return sympy.S.Zero
        if e is q or not e.args:
            return sympy.S.One
        known = self._slopes.setdefault(q, {})
        if e not in known:
            known[e] = self._by(e, q)
        return known[e]

    def _by(self, e: Expr, q: Symbol) -> Expr:
        args = e.args
        inner = [self.by(arg, q) for arg in args]
        if e.is_Add:
            return sympy.Add(*inner)
        if e.is_Mul:
            terms = [sympy.Mul(*args[:i], d, *args[i + 1 :]) for i, d in enumerate(inner) if d != 0]
            return sympy.Add(*terms)
        if e.is_Pow:
            base, exponent = args
            by_base = exponent * sympy.Pow(base, exponent - 1) * inner[0] if inner[0] != 0 else sympy.S.Zero
            return by_base + e * sympy.log(base) * inner[1] if inner[1] != 0 else by_base
        if hasattr(e, "differentiated"):
            own: Expr = e.differentiated(inner)
            return own
        if not isinstance(e, Application) or not all(isinstance(arg, Expr) for arg in args):
            return e.diff(q)
        outer = _slopes(e.func, len(args))
        return sympy.Add(
            *(slope.xreplace(dict(zip(places, args, strict=True))) * d
              for (places, slope), d in zip(outer, inner, strict=True) if d != 0)
        )  # fmt: skip


@lru_cache(maxsize=1024)
def _slopes(function: Any, count: int) -> list[tuple[tuple[Symbol, ...], Expr]]:
    """The derivatives of a function by each of its arguments, and the symbols that stand for these."""
    places = tuple(sympy.Dummy(f"q{i}", real=True) for i in range(count))
    value = function(*places)
    return [(places, value.diff(q)) for q in places]
