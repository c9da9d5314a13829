"""Routh-Hurwitz: the roots of a_0 s^n + ... + a_n lie in the left half plane iff the column has one sign.

Source: Gantmacher, The Theory of Matrices II (Routh's scheme and its special cases).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Literal

import numpy as np
import sympy
from sympy.core.relational import Relational
from sympy.logic.boolalg import Boolean

from filippov.analysis.algebra import routh_text
from filippov.analysis.algebra.budget import Clock, OutOfBudgetError, counted
from filippov.analysis.algebra.generators import factor_list
from filippov.analysis.algebra.inequalities import (
    KnownSigns,
    positive_when,
    solve_simple,
    solve_univariate,
    substitution,
    without_redundant,
)
from filippov.analysis.algebra.polynomial import (
    SYMBOL,
    Verdict,
    coefficients,
    count_roots,
    sign_changes,
)
from filippov.analysis.algebra.routh_array import RouthArray, routh_array, signs_at_zero
from filippov.analysis.algebra.routh_result import RouthCase, RouthResult
from filippov.base.errors import UsageError
from filippov.base.given import Positive, shown
from filippov.base.keywords import keywords
from filippov.base.shown import Shown


class RouthHurwitz(RouthResult, Shown):
    """The result with its questions: `at` values, `solve_for` a parameter, as text, Markdown, LaTeX, JSON."""

    def at(self, values: Mapping[Any, Any]) -> RouthHurwitz:
        """Return the analysis with numbers or expressions for some parameters, by name or symbol."""
        chosen = substitution(values, self.symbols)
        assume = [relation.subs(chosen) for relation in self.assume]
        if sympy.false in assume:
            raise UsageError(f"values {values!r} contradict the assumptions {self.assume}")
        return routh_hurwitz(
            [c.subs(chosen) for c in self.coefficients], s=self.s, assume=assume, budget=self.budget
        )

    def solve_for(
        self, symbol: sympy.Symbol | str, values: Mapping[Any, Any] | None = None, *, as_set: bool = False
    ) -> Any:
        """The conditions solved for one parameter, such as (0 < K) & (K < 1386), exactly.

        With numbers for all other parameters (`values`) the result is the whole set, values included where
        the degree drops and the reduced polynomial is stable; `as_set` gives it as a sympy set. With other
        parameters left, each condition that is linear in the symbol, or in one exponential of it, with a
        coefficient of known sign (see `assume`) is solved, and the others stay as they are. Raises
        UsageError for an unknown name, for `as_set` where the result is no set, and where the budget ended
        the analysis.
        """
        (x,) = substitution({symbol: 0}, self.symbols)
        routh = self.at(values) if values else self
        if routh.status != "complete":
            raise UsageError(f"not all conditions are known ({routh.message}); give values or more budget")
        if set(routh.symbols) <= {x}:
            found = routh._solve_univariate(x)
            if found is not None:
                return found if as_set else _as_relation(found, x)
        if as_set:
            left = ", ".join(str(y) for y in routh.symbols if y != x)
            left = left or "non-rational terms"
            raise UsageError(f"{x} has no set of its own while {left} stay; give values for them")
        known = KnownSigns((*routh.assume, *(c for c in routh.conditions if not c.has(x))))
        return sympy.And(*(solve_simple(c, x, known) for c in routh.conditions))

    @counted
    def _solve_univariate(self, x: sympy.Symbol) -> sympy.Set | None:
        clock = Clock(self.budget)
        bounds = [a for a in self.assume if a.free_symbols <= {x}]
        try:
            allowed = solve_univariate(bounds, x, clock)
            main = solve_univariate(self.conditions, x, clock)
            zero = solve_univariate([sympy.Ne(self.coefficients[0], 0)], x, clock)
        except OutOfBudgetError as error:
            raise UsageError(f"not solved for {x} within the budget ({error}); give a larger one") from error
        if allowed is None or main is None or zero is None:
            return None
        for value in sympy.Complement(sympy.S.Reals, zero) if self.cases else ():
            # Where all coefficients vanish together every s is a root.
            if all(c.subs(x, value).is_zero for c in self.coefficients):
                main = main - sympy.FiniteSet(value)
            elif self.at({x: value}).verdict is Verdict.ASYMPTOTICALLY_STABLE:
                main = main.union(sympy.FiniteSet(value))
        return main.intersect(allowed)

    def __str__(self) -> str:
        return self.to_text().rstrip()

    def to_text(self) -> str:
        """Plain text: the array, special cases, conditions or counts, and the verdict."""
        return routh_text.text(self)

    def to_markdown(self) -> str:
        """Markdown with the formulas in $...$."""
        return routh_text.markdown(self)

    def to_latex(self) -> str:
        """LaTeX: the array and the conditions."""
        return routh_text.latex(self)

    def to_dict(self) -> dict[str, Any]:
        """Strings, numbers, lists and dicts only."""
        return routh_text.as_dict(self)

    def to_json(self) -> str:
        """`to_dict` as JSON."""
        return routh_text.as_json(self)


def _always(relation: object) -> bool:
    """Whether what is assumed holds anyway; UsageError for what is no inequality."""
    if isinstance(relation, bool | np.bool_):
        relation = sympy.true if relation else sympy.false
    if not isinstance(relation, Boolean):
        raise UsageError(f"assume holds {shown(relation)}, expected inequalities of symbols: assume=[m > 0].")
    return relation is sympy.true


@keywords()
@counted
def routh_hurwitz(
    polynomial: Any, s: sympy.Symbol | None = None, *, assume: Iterable[Any] = (), budget: Positive = 10.0
) -> RouthHurwitz:
    """Return the Routh-Hurwitz analysis of a polynomial.

    It is given as coefficients (highest first), as a sympy.Poly or as an expression in s. Coefficients are
    numbers (floats stand for their shortest decimal) or expressions in real symbols. `assume` are
    inequalities taken to hold, such as m > 0; they shorten the conditions. After `budget` million calls
    (about 0.3 s each, asked between the steps), or where a product would grow beyond all use, the result
    has status "timeout" and the rows so far. Raises UsageError for what is not a
    polynomial with finite real coefficients.
    """
    if not budget > 0:
        raise UsageError(f"budget {budget!r}: expected a positive number")
    given = coefficients(polynomial, s)
    told = tuple(relation for relation in assume if not _always(relation))
    known, clock = KnownSigns(told), Clock(budget)
    if s is None:
        s = polynomial.gens[0] if isinstance(polynomial, sympy.Poly) else SYMBOL
    table = routh_array(given, clock, s)
    array, special = tuple(table.rows), tuple(table.special)
    if not any(c.free_symbols for c in given):
        return _numeric(given, table, told, budget, s)
    conditions, complete, reason = _conditions(table, len(given) - 1, known.copy(), clock)
    try:
        cases = _cases(given, s, known, told, clock)
    except OutOfBudgetError as error:
        cases, complete, reason = (), False, str(error)
    status: Literal["complete", "timeout"] = "complete" if complete else "timeout"
    message = "" if complete else f"stopped: {reason}; the conditions are necessary, not sufficient"
    return RouthHurwitz(given, array, conditions, special, None, cases, status, message, told, budget, s)


def _numeric(
    given: tuple[sympy.Expr, ...], table: RouthArray, assume: tuple[Any, ...], budget: float, s: sympy.Symbol
) -> RouthHurwitz:
    counts = count_roots(given)
    stable = sympy.true if counts.verdict is Verdict.ASYMPTOTICALLY_STABLE else sympy.false
    message = ""
    changes = sign_changes(signs_at_zero(table.first_column)) if table.complete else counts.rhp
    if changes != counts.rhp:
        # Roots on the axis move when a pivot is replaced by epsilon; the exact counts do not use the array.
        message = f"the column changes sign {changes} times, for epsilon moves the roots on the axis"
    rows, special = tuple(table.rows), tuple(table.special)
    return RouthHurwitz(given, rows, (stable,), special, counts, (), "complete", message, assume, budget, s)


def _conditions(
    table: RouthArray, degree: int, known: KnownSigns, clock: Clock
) -> tuple[tuple[Any, ...], bool, str]:
    """(conditions, complete, why not): r_k / a_0 > 0 for every row k, in terms of the minors of r_k."""
    if table.special:
        # A pivot that is zero for all parameters: some root is not in the left half plane, whatever they are.
        return (sympy.false,), table.complete, table.reason
    ring, minors = table.ring, table.minors
    if ring is None or not minors:
        return (), False, table.reason
    found: dict[int, Any] = {}
    complete, reason = table.complete, table.reason
    try:
        leading = ring.expression(minors[0])
        denominators = _factor_set(ring.expression(ring.denominator)) | _factor_set(leading)
        signs = {k: minors[k] for k in range(1, len(minors))}
        with_leading = {k: k % 2 == 1 for k in signs}
        if 1 < degree < len(minors):  # the last minor is a_n times the one before
            signs[degree], with_leading[degree] = minors[degree].exquo(minors[degree - 1]), True
        # The simple conditions first: what they tell shortens the others.
        for k in sorted(signs, key=lambda k: (len(signs[k]), k)):
            expression = ring.expression(signs[k]) * (leading if with_leading[k] else 1)
            found[k] = positive_when(expression, known, denominators, clock)
            if found[k] == sympy.false:
                return (sympy.false,), complete, reason
            known.learn(found[k])
    except OutOfBudgetError as error:
        complete, reason = False, str(error)
    parts = [p for k in sorted(found) for p in (sympy.And.make_args(found[k]))]
    unique = [p for p in dict.fromkeys(parts) if p != sympy.true]
    return tuple(without_redundant(unique, known)) or (sympy.true,), complete, reason


def _factor_set(expression: sympy.Expr) -> frozenset[Any]:
    if expression.is_number:
        return frozenset()
    return frozenset(factor for factor, _ in factor_list(expression)[1])


def _cases(
    given: tuple[sympy.Expr, ...], s: sympy.Symbol, known: KnownSigns, assume: tuple[Any, ...], clock: Clock
) -> tuple[RouthCase, ...]:
    numerator = sympy.fraction(sympy.together(given[0]))[0]
    vanishing = [f for f in sorted(_factor_set(numerator), key=str) if not known.nonzero(f)]
    if not vanishing:
        return ()
    cases = [RouthCase(sympy.Ne(sympy.Mul(*vanishing), 0), None)]
    for factor in vanishing:
        clock.check()
        solved = _zero_of(factor, known)
        rest = [c.subs(solved) for c in given[1:]]
        undefined = any(c.has(sympy.zoo, sympy.nan) for c in rest)
        if undefined or all(c.expand().is_zero for c in rest):
            continue
        left = [r for r in (a.subs(solved) for a in assume) if r != sympy.true]
        if sympy.false not in left:
            reduced = routh_hurwitz(rest, s=s, assume=left, budget=clock.remaining())
            cases.append(RouthCase(sympy.Eq(factor, 0), reduced))
    return tuple(cases)


def _zero_of(factor: sympy.Expr, known: KnownSigns) -> dict[sympy.Symbol, sympy.Expr]:
    """{symbol: value} that makes the factor zero, {} where no symbol enters it linearly."""
    for x in sorted(factor.free_symbols, key=lambda x: x.name):
        if factor.is_polynomial(x) and sympy.degree(factor, x) == 1:
            c1, c0 = sympy.Poly(factor, x).all_coeffs()
            if c1.is_number or known.nonzero(c1):
                return {x: -c0 / c1}
    return {}


def _as_relation(solution: sympy.Set, x: sympy.Symbol) -> Any:
    """A set as a relation, without the -oo < x and x < oo that hold for every real x."""
    relation = solution.as_relational(x)
    trivial = {part: sympy.true for part in relation.atoms(Relational) if part.has(sympy.oo, -sympy.oo)}
    return relation.xreplace(trivial)
