"""Take what depends on the parameters alone out of the field: computed once a run, divisions included."""

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
        if not e.args or not e.free_symbols & self.parameters:
            return e
        if self.constant(e):
            return self._named(e)
        if e.is_Add or e.is_Mul:
            fixed = [a for a in e.args if self.constant(a)]
            numbers = [a for a in e.args if a.is_number] if fixed else []
            rest = [self(a) for a in e.args if a not in fixed and a not in numbers]
            if fixed:
                rest.append(self._named(e.func(*numbers, *fixed)))
            return e.func(*rest)
        return e.func(*(self(a) for a in e.args))
