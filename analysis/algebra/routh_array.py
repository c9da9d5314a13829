"""The Routh array of a polynomial with symbolic coefficients, without fractions on the way.

Row k of the array is r_(k,j) = (r_(k-1,1) r_(k-2,j+1) - r_(k-2,1) r_(k-1,j+1)) / r_(k-1,1). Here b_(k,j),
the same without the division, is divided exactly by the Hurwitz determinant three rows above, so b_(k,1) is
the Hurwitz determinant of order k and r_(k,j) = b_(k,j) / b_(k-1,1) (Jeltsch, An optimal fraction free Routh
array, Int. J. Control 30, 1979). Expressions then grow no faster than the determinants do.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import sympy
from sympy.polys.fields import field as rational_functions

from filippov.analysis.algebra.budget import Clock, OutOfBudgetError
from filippov.analysis.algebra.generators import Generators
from filippov.analysis.algebra.polynomial import SYMBOL, sign_of_number


class Infinitesimal(sympy.Symbol):
    """A symbol that equals no symbol of a user, whatever its name."""

    __slots__ = ()


# Million calls for the cancellation of one long entry.
CANCELLING = 0.5
EPSILON = Infinitesimal("epsilon", positive=True)


@dataclass(frozen=True)
class Special:
    """A special case of the array in the row of s^power; a zero row has an auxiliary polynomial."""

    kind: Literal["zero pivot", "zero row"]
    power: int
    auxiliary: sympy.Expr | None = None


class Ring:
    """Polynomials in the parameters; whatever is neither a symbol nor rational becomes a generator."""

    def __init__(self, coefficients: tuple[sympy.Expr, ...], clock: Clock) -> None:
        self.clock = clock
        clock.check(sum(_size(c) for c in coefficients))
        generators = Generators(coefficients)
        plain, self.back = generators.plain, generators.back
        free: set[sympy.Symbol] = set().union(*(c.free_symbols for c in plain))
        symbols = sorted(free, key=lambda x: (x.name, str(x.sort_key())))
        self.fractions = rational_functions([*symbols, EPSILON], sympy.QQ)[0]
        self.ring = self.fractions.ring
        elements = [self.fractions.from_expr(c) for c in plain]
        self.denominator = self.ring.one
        for element in elements:
            clock.check(len(self.denominator) * len(element.denom))
            self.denominator = self.denominator.lcm(element.denom)
        self.coefficients = [e.numer * self.denominator.exquo(e.denom) for e in elements]
        self.epsilon = self.ring.gens[-1]

    def expression(self, element: Any) -> sympy.Expr:
        """Return a ring element as an expression in the parameters."""
        self.clock.check(10 * len(element))
        expression = element.as_expr()
        return expression.xreplace(self.back).expand() if self.back else expression

    def vanishes(self, element: Any) -> bool:
        """Whether an element is zero for every value of the parameters."""
        if not element:
            return True
        if not self.back:
            return False
        expression = self.expression(element)
        return bool(expression.is_zero or (len(element) < 50 and expression.equals(0)))

    def quotient(self, numerator: Any, denominator: Any) -> sympy.Expr:
        """Numerator / denominator, cancelled where that can be done with a part of the work."""

        def cancelled() -> Any:
            return self.fractions(numerator) / self.fractions(denominator)

        try:
            small = len(numerator) * len(denominator) <= 5_000
            fraction = cancelled() if small else self.clock.within(cancelled, CANCELLING)
        except OutOfBudgetError:
            return self.expression(numerator) / self.expression(denominator)
        return self.expression(fraction.numer) / self.expression(fraction.denom)


@dataclass
class RouthArray:
    """Rows of the array from s^n downwards.

    `rows` are the entries as the textbook has them. `minors` are the first entries b_(k,1) as ring elements
    as long as no case was special, the leading coefficient first. `complete` is False where the budget ended.
    """

    ring: Ring | None
    rows: list[tuple[sympy.Expr, ...]]
    minors: list[Any]
    special: list[Special]
    complete: bool
    reason: str = ""

    @property
    def first_column(self) -> tuple[sympy.Expr, ...]:
        """The first entry of every row."""
        return tuple(row[0] for row in self.rows)


def routh_array(coefficients: tuple[sympy.Expr, ...], clock: Clock, s: sympy.Symbol = SYMBOL) -> RouthArray:
    """Return the array of a_0 s^n + ... + a_n, its special cases resolved and listed.

    A zero pivot in a row that is not zero is replaced by epsilon, which stands for a positive number smaller
    than any other and is carried through as a symbol. A zero row is replaced by the derivative of the
    auxiliary polynomial, which the row above holds; so are further zero rows that follow.
    """
    n = len(coefficients) - 1
    result = RouthArray(None, [], [], [], complete=False)
    try:
        result.ring = ring = Ring(coefficients, clock)
        _fill(result, ring, n, clock, s)
        result.complete = True
    except OutOfBudgetError as error:
        result.reason = str(error)
        # The first two rows are the coefficients, which are known without any computation.
        plain = [tuple(coefficients[k::2]) for k in (0, 1)][: n + 1]
        result.rows += plain[len(result.rows) :]
    return result


def _fill(result: RouthArray, ring: Ring, n: int, clock: Clock, s: sympy.Symbol) -> None:
    b: list[list[Any]] = []  # row k as polynomials; the textbook's row is b[k] / scale[k]
    scale: list[Any] = []
    base = 0  # the row from which the determinants are counted; moved where a special case broke the chain
    for k in range(n + 1):
        clock.check()
        if k < 2:
            row, row_scale = ring.coefficients[k::2], ring.denominator
        else:
            row = _next_row(b, k, base, clock)
            row_scale = b[k - 1][0] * scale[base + (k - base) % 2]
        row = [ring.ring.zero if ring.vanishes(x) else x for x in row]
        power = n - k
        if not any(row):
            row = [(power + 1 - 2 * j) * x for j, x in enumerate(b[k - 1]) if power + 1 - 2 * j > 0]
            row_scale, base = scale[k - 1], k - 1
            above = [ring.quotient(x, row_scale) for x in b[k - 1]]
            auxiliary = sympy.Add(*(c * s ** (power + 1 - 2 * j) for j, c in enumerate(above)))
            result.special.append(Special("zero row", power, auxiliary))
        elif not row[0]:
            row = [ring.epsilon * row_scale, *row[1:]]
            base = k - 1
            result.special.append(Special("zero pivot", power))
        b.append(row)
        scale.append(row_scale)
        if not result.special:
            result.minors.append(row[0])
        entries = tuple(ring.quotient(x, row_scale) for x in row[: _own(result, b, k, power)])
        # What the row above has nothing under is carried on from two rows above.
        result.rows.append(entries if k < 2 else (*entries, *result.rows[k - 2][len(entries) + 1 :]))


def _own(result: RouthArray, b: list[list[Any]], k: int, power: int) -> int | None:
    """How many entries of the row k are not those of two rows above; None for all."""
    if k < 2 or (result.special and result.special[-1].power == power):
        return None
    return len(b[k - 1]) - 1


def _next_row(b: list[list[Any]], k: int, base: int, clock: Clock) -> list[Any]:
    above, below = b[k - 2], b[k - 1]
    row = []
    for j in range(1, len(above)):
        other = below[j] if j < len(below) else 0 * below[0]
        clock.check(len(below[0]) * len(above[j]) + len(above[0]) * len(other))
        raw = below[0] * above[j] - above[0] * other
        # Sylvester's identity: the division leaves no rest from the fourth row after `base` on.
        row.append(raw.exquo(b[k - 3][0]) if k - base > 3 else raw)
    return row


def signs_at_zero(column: tuple[sympy.Expr, ...]) -> tuple[int, ...]:
    """Signs of the entries of a numeric column in the limit epsilon -> 0+."""
    return tuple(_sign_at_zero(entry) for entry in column)


def _sign_at_zero(entry: sympy.Expr) -> int:
    numerator, denominator = sympy.fraction(sympy.together(entry))
    signs = [sign_of_number(sympy.Poly(part, EPSILON).EC()) for part in (numerator, denominator)]
    return signs[0] * signs[1]


def _size(expression: sympy.Expr) -> int:
    """Upper bound of the number of terms after expansion."""
    if expression.is_Add:
        return sum(_size(a) for a in expression.args)
    if expression.is_Mul:
        product = 1
        for a in expression.args:
            product = min(product * _size(a), 10**12)
        return product
    if expression.is_Pow and expression.exp.is_Integer:
        power, terms = abs(int(expression.exp)), _size(expression.base)
        if terms == 1 or power > 1000:
            return 1 if terms == 1 else 10**12
        return min(math.comb(power + terms - 1, power), 10**12)
    return 1
