"""Take what depends on the parameters alone out of the field: computed once per run, divisions included."""

from __future__ import annotations

from collections.abc import Sequence

import sympy
from sympy import Expr, Symbol


class Hoisted:
    """Expressions with their parameter-only parts replaced by the symbols `derived`, in order."""

    def __init__(self, parameters: Sequence[Symbol]) -> None:
        self.parameters = set(parameters)
        self.derived: dict[Expr, Symbol] = {}

    def constant(self, e: Expr) -> bool:
        """Whether an expression depends on parameters and on nothing else."""
        symbols = e.free_symbols
        return bool(symbols) and symbols <= self.parameters

    def _named(self, e: Expr) -> Expr:
        if e.is_Symbol or (e.is_Mul and len(e.args) == 2 and e.args[0] == -1 and e.args[1].is_Symbol):
            return e
        if e not in self.derived:
            self.derived[e] = sympy.Dummy(f"q{len(self.derived)}", real=True)
        return self.derived[e]

    def __call__(self, e: Expr) -> Expr:
        """Return e with its parameter-only parts named."""
        symbols = e.free_symbols if e.args else set()
        if self.parameters.isdisjoint(symbols):
            return e
        if symbols <= self.parameters:
            return self._named(e)
        if not (e.is_Add or e.is_Mul):
            return e.func(*map(self, e.args))
        fixed: list[Expr] = []
        others: list[Expr] = []
        for a in e.args:
            (fixed if self.constant(a) else others).append(a)
        if not fixed:
            return e.func(*map(self, others))
        numbers = [a for a in others if a.is_number]
        rest = [self(a) for a in others if not a.is_number]
        return e.func(*rest, self._named(e.func(*numbers, *fixed)))
