"""What the parts of a stability analysis share: the system, its parameter values, what is assumed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy
from sympy import Expr, Symbol

from filippov import System, UsageError
from filippov.analysis.algebra import linalg
from filippov.analysis.algebra.budget import Clock
from filippov.analysis.algebra.polynomial import Verdict, count_roots, exact
from filippov.analysis.algebra.routh_hurwitz import RouthHurwitz, routh_hurwitz
from filippov.analysis.local_stability.linear_growth import is_bounded
from filippov.analysis.local_stability.stability_result import EIGENVALUE, SetStability, Solved
from filippov.analysis.steady.edges import side
from filippov.analysis.steady.linearisation import SlidingLinearisation
from filippov.model import symbols
from filippov.model.symbolic import SymbolicForm

SMALL = 1e-9


@dataclass(frozen=True)
class Context:
    """The analysis of one system at parameter values; `put` are the values put into the formulas."""

    system: System
    form: SymbolicForm
    values: Mapping[Symbol, Expr]
    assume: tuple[Any, ...]
    symbol: Symbol | None
    hook: SetStability | None
    clock: Clock
    put: dict[Symbol, Expr] = field(default_factory=dict)

    def put_degenerate(self, degenerate: Sequence[str], t: float | None) -> Context:
        """Put the values on which an equilibrium rests, given as "I = 0", and the time."""
        names = {text.split(" = ")[0] for text in degenerate}
        put = {q: v for q, v in self.values.items() if q.name in names}
        if t is not None:
            put[symbols.t] = exact(t)
        return replace(
            self, put=put, assume=tuple(a for a in self.assume if not a.has(*put)) if put else self.assume
        )

    def number(self, expression: Any, more: Mapping[Symbol, Expr] | None = None) -> float:
        """The value of an expression, nan where it is not a real number."""
        value = sympy.S(expression).subs({**self.values, **(more or {})}).evalf(20)
        if not value.is_number or value.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo):
            return float("nan")
        real, imaginary = value.as_real_imag()
        return float(real) if abs(imaginary) < SMALL else float("nan")

    def vanishes(self, expression: Expr, at: Mapping[Symbol, Expr]) -> bool:
        """Whether an expression is 0 at a place: exactly, or to a part of its terms if they are floats."""
        return side(expression, at, self.values) == 0

    def numbers(
        self, matrix: sympy.Matrix, more: Mapping[Symbol, Expr] | None = None
    ) -> npt.NDArray[np.float64]:
        """A matrix at the parameter values."""
        rows = [[self.number(e, more) for e in matrix.row(i)] for i in range(matrix.rows)]
        return np.array(rows, dtype=float).reshape(matrix.rows, matrix.cols)

    def without_zeros(self, polynomial: Sequence[Expr], most: int) -> tuple[tuple[Expr, ...], int]:
        """Take out up to `most` roots that are 0; return what is left and how many were."""
        kept, zeros = list(polynomial), 0
        while zeros < most and len(kept) > 1 and self.zero(kept[-1]):
            kept.pop()
            zeros += 1
        return tuple(kept), zeros

    def zero(self, expression: Expr) -> bool:
        """Whether an expression is 0, for all parameters or to rounding at their values."""
        if expression.is_zero:
            return True
        free = expression.free_symbols - set(self.values)
        more = dict.fromkeys(free, sympy.Rational(3, 11))
        return bool(abs(self.number(expression, more)) < SMALL) and bool(sympy.simplify(expression) == 0)

    def routh(self, polynomial: Sequence[Expr] | None) -> RouthHurwitz | None:
        """The Routh-Hurwitz analysis in formulas; None for a constant."""
        if polynomial is None or len(polynomial) < 2 or any(c.has(symbols.t) for c in polynomial):
            return None
        try:
            left = min(10.0, self.clock.remaining())
            return routh_hurwitz(polynomial, EIGENVALUE, assume=self.assume, budget=left)
        except (UsageError, sympy.PolynomialError):
            return None

    def verdict(
        self, polynomial: Sequence[Expr], more: Mapping[Symbol, Expr] | None = None
    ) -> Verdict | None:
        """Where the roots lie at the parameter values; asymptotically stable if there are none.

        Roots on the axis are marginal however often they are repeated: of a solution near an equilibrium they
        say nothing (x'' = -x**3 has the double root 0 and is stable).
        """
        if len(polynomial) < 2:
            return Verdict.ASYMPTOTICALLY_STABLE
        coefficients = [sympy.S(c).subs({**self.values, **(more or {})}) for c in polynomial]
        try:
            counts = count_roots(coefficients)
            return counts.verdict if counts.rhp or not counts.axis else Verdict.MARGINALLY_STABLE
        except UsageError:
            numbers = [self.number(c) for c in coefficients]
        if not np.all(np.isfinite(numbers)):
            return None
        largest = float(np.max(linalg.roots(numbers).real))
        if abs(largest) < SMALL:
            return None
        return Verdict.ASYMPTOTICALLY_STABLE if largest < 0 else Verdict.UNSTABLE

    def solved(self, routh: RouthHurwitz, put: Mapping[Symbol, Expr] | None = None) -> Solved | None:
        """The conditions solved for the chosen parameter; None if there is none or it does not occur."""
        symbol = self.symbol
        if symbol is None or symbol not in routh.symbols:
            return None
        others = {
            q: v for q, v in {**self.values, **(put or {})}.items() if q in routh.symbols and q != symbol
        }
        try:
            return Solved(symbol, routh.solve_for(symbol), routh.solve_for(symbol, others))
        except UsageError:
            return None

    def bounded(self, matrix: sympy.Matrix) -> bool | None:
        """Whether exp(A t) stays bounded: no root on the right, those on the axis with all eigenvectors.

        None where the entries are no numbers at the parameter values, or rounding leaves it open.
        """
        plain = matrix.applyfunc(lambda e: sympy.S(e).subs(self.values))
        return None if plain.free_symbols else is_bounded(plain)

    def semisimple(
        self, sliding: SlidingLinearisation, zeros: int, more: Mapping[Symbol, Expr] | None = None
    ) -> bool:
        """Whether the sliding field has as many null directions in the surfaces as roots that are 0."""
        assert sliding.matrix is not None
        if zeros == 0:
            return True
        on_surface = self.numbers(sliding.matrix * sliding.tangent, more)
        sizes = linalg.svd(on_surface, compute_uv=False)
        return bool(np.sum(sizes <= 1e-9 * max(1.0, float(sizes[0]))) >= zeros)
