"""What a Routh-Hurwitz analysis found, as plain data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import sympy

from filippov.analysis.algebra.polynomial import SYMBOL, RootCounts, Verdict
from filippov.analysis.algebra.routh_array import Special


@dataclass(frozen=True)
class RouthCase:
    """What holds where the leading coefficient is 0 or not; `reduced` is None for the polynomial itself."""

    condition: Any
    reduced: RouthResult | None


@dataclass(frozen=True)
class RouthResult:
    """The Routh array of a polynomial and what follows from it.

    coefficients    a_0 ... a_n, exact
    array           rows from s^n downwards
    conditions      the polynomial is asymptotically stable iff all of them hold (leading coefficient not
                    zero); with status "timeout" they are necessary only
    special         zero pivots and zero rows that occurred
    counts          for numbers: exact counts of the roots; None while parameters are left
    cases           where the leading coefficient may vanish: one for != 0, one for each way to be 0
    """

    coefficients: tuple[sympy.Expr, ...]
    array: tuple[tuple[sympy.Expr, ...], ...]
    conditions: tuple[Any, ...]
    special: tuple[Special, ...] = ()
    counts: RootCounts | None = None
    cases: tuple[RouthCase, ...] = ()
    status: Literal["complete", "timeout"] = "complete"
    message: str = ""
    assume: tuple[Any, ...] = ()
    budget: float = 10.0
    s: sympy.Symbol = SYMBOL

    @property
    def degree(self) -> int:
        """n."""
        return len(self.coefficients) - 1

    @property
    def first_column(self) -> tuple[sympy.Expr, ...]:
        """The first entry of every row."""
        return tuple(row[0] for row in self.array)

    @property
    def verdict(self) -> Verdict | None:
        """Asymptotically stable, marginally stable or unstable; None while parameters are left."""
        return self.counts.verdict if self.counts else None

    @property
    def symbols(self) -> tuple[sympy.Symbol, ...]:
        """The parameters that are left, by name."""
        free: set[sympy.Symbol] = set().union(*(c.free_symbols for c in self.coefficients))
        return tuple(sorted(free, key=lambda x: (x.name, str(x.sort_key()))))

    @property
    def stable_when(self) -> Any:
        """The conditions as one sympy expression, true or false for numbers."""
        return sympy.And(*self.conditions)
