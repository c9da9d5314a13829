"""Real polynomials with exact coefficients, and where their roots lie."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
import sympy
from sympy.polys.constructor import construct_domain

from filippov.base.errors import UsageError
from filippov.base.given import several

SYMBOL = sympy.Symbol("s")
# Of the field of the coefficients over the rational numbers: the work grows with its square and more.
LARGEST_FIELD = 8
# An exponent is a fraction of a small denominator where it is one to the rounding of a double.
LARGEST_DENOMINATOR, SAME_EXPONENT = 1000, 1e-15


class Verdict(Enum):
    """Stability of the linear system whose characteristic polynomial this is."""

    ASYMPTOTICALLY_STABLE = "asymptotically stable"
    MARGINALLY_STABLE = "marginally stable"
    UNSTABLE = "unstable"


@dataclass(frozen=True)
class RootCounts:
    """Roots in the open right half plane, on the imaginary axis, in the open left half plane.

    Each root is counted with its multiplicity. `axis_multiplicities` holds (multiplicity, number of different
    roots on the axis that have it), by rising multiplicity.
    """

    rhp: int
    axis: int
    lhp: int
    axis_multiplicities: tuple[tuple[int, int], ...] = ()

    @property
    def verdict(self) -> Verdict:
        """A repeated root on the axis is unstable: t cos(wt) grows."""
        if self.rhp or any(multiplicity > 1 for multiplicity, _ in self.axis_multiplicities):
            return Verdict.UNSTABLE
        return Verdict.MARGINALLY_STABLE if self.axis else Verdict.ASYMPTOTICALLY_STABLE


def exact(value: Any) -> sympy.Expr:
    """Return a number or an expression with every float replaced by a rational number.

    A float stands for the shortest decimal that rounds to it, so 0.1 is 1/10; for exponents see
    `plain_exponents`. Text is refused, and so are nan, inf and complex numbers.
    """
    if isinstance(value, sympy.Expr):
        value = plain_exponents(value, lambda number: exact(float(number)))
        if value.has(sympy.nan, sympy.zoo, sympy.oo, -sympy.oo, sympy.I):
            raise UsageError(f"coefficient {value}: expected a finite real expression")
        return value
    if isinstance(value, bool | np.bool_ | str | bytes) or value is None:
        raise UsageError(f"coefficient {value!r}: expected a real number or an expression")
    if isinstance(value, int | np.integer):
        return sympy.Integer(int(value))
    if isinstance(value, Fraction):
        return sympy.Rational(value.numerator, value.denominator)
    if isinstance(value, float | np.floating):
        if not math.isfinite(value):
            raise UsageError(f"coefficient {value!r} is not finite")
        fraction = Fraction(repr(float(value)))
        return sympy.Rational(fraction.numerator, fraction.denominator)
    raise UsageError(f"coefficient {value!r}: expected a real number or an expression")


def plain_exponents(
    expression: sympy.Expr, number: Callable[[sympy.Float], sympy.Expr] | None = None
) -> sympy.Expr:
    """The expression with 1/3 for 0.3333333333333333 in exponents, and a float for what is no such fraction.

    number   what to put for floats elsewhere

    With the denominator 10^16 polynomials in the root of x are of that degree, and powers of numbers, which
    sympy takes apart into primes, have as many digits.
    """
    powers = expression.atoms(sympy.Pow)
    if not any(_long(q) for p in powers for q in p.exp.atoms(sympy.Number)):
        floats = {q: number(q) for q in expression.atoms(sympy.Float)} if number is not None else {}
        return expression.xreplace(floats) if floats else expression

    def plain(e: sympy.Basic) -> sympy.Basic:
        if isinstance(e, sympy.Float):
            return e if number is None else number(e)
        if not e.args:
            return e
        if not isinstance(e, sympy.Pow):
            return e.func(*map(plain, e.args))
        power = sympy.Pow(
            plain(e.base), e.exp.xreplace({q: near_fraction(q) for q in e.exp.atoms(sympy.Number)})
        )
        return number(power) if number is not None and isinstance(power, sympy.Float) else power

    return plain(expression)


def _long(q: sympy.Number) -> bool:
    return isinstance(q, sympy.Float) or (q.is_Rational and q.q > LARGEST_DENOMINATOR)


def near_fraction(q: sympy.Number) -> sympy.Number:
    """The fraction of a small denominator that a number is, to rounding; else the number as a float."""
    if not _long(q) or not q.is_finite:
        return q
    whole = Fraction(repr(float(q)))
    near = whole.limit_denominator(LARGEST_DENOMINATOR)
    apart = abs(float(whole - near))
    same = apart <= SAME_EXPONENT * max(1.0, abs(float(near)))
    return sympy.Rational(near.numerator, near.denominator) if same else sympy.Float(float(q))


def in_exponents(
    expressions: Iterable[sympy.Expr], values: Mapping[sympy.Symbol, sympy.Expr]
) -> dict[sympy.Symbol, sympy.Expr]:
    """The values of parameters, those that stand in exponents as `plain_exponents` has them."""
    inside: set[sympy.Basic] = set()
    for e in expressions:
        inside = inside.union(*(p.exp.free_symbols for p in sympy.S(e).atoms(sympy.Pow)))
    return {
        q: near_fraction(v) if q in inside and isinstance(v, sympy.Number) else v for q, v in values.items()
    }


def coefficients(polynomial: Any, s: sympy.Symbol | None = None) -> tuple[sympy.Expr, ...]:
    """a_0, ..., a_n of a_0 s^n + ... + a_n, from a sequence, a sympy.Poly or an expression in s.

    Leading coefficients that are zero for every value of the parameters are dropped. Raises UsageError for
    the zero polynomial, for an expression that is no polynomial in s, and for one in which `s` is not given
    and cannot be guessed (it is the only symbol, or the only one called "s").
    """
    if isinstance(polynomial, sympy.Poly):
        if len(polynomial.gens) != 1 and s is None:
            raise UsageError(f"polynomial in {polynomial.gens}: say which one is the variable, s=...")
        polynomial, s = polynomial.as_expr(), s or polynomial.gens[0]
    if isinstance(polynomial, sympy.Expr):
        given = _from_expression(exact(polynomial), s)
    elif isinstance(polynomial, Iterable) and not isinstance(polynomial, str | bytes):
        given = [exact(c) for c in several("polynomial", polynomial)]
    else:
        raise UsageError(f"polynomial {polynomial!r}: give coefficients, a sympy.Poly or an expression in s")
    while given and given[0].expand().is_zero:
        given.pop(0)
    if not given:
        raise UsageError(
            "the polynomial is zero: its roots are not defined. Give its coefficients, the highest first: "
            "[1, 2, 1]."
        )
    return tuple(given)


def _from_expression(expression: sympy.Expr, s: sympy.Symbol | None) -> list[sympy.Expr]:
    free = sorted(expression.free_symbols, key=str)
    if s is None:
        candidates = [x for x in free if x.name == "s"] or free
        if len(candidates) > 1:
            raise UsageError(f"polynomial {expression} in {free}: say which one is the variable, s=...")
        s = candidates[0] if candidates else SYMBOL
    numerator, denominator = expression.as_numer_denom()
    if denominator.has(s) or not numerator.is_polynomial(s):
        raise UsageError(f"{expression} is not a polynomial in {s}; give the characteristic polynomial")
    return [c / denominator for c in sympy.Poly(numerator, s).all_coeffs()]


def count_roots(polynomial: Any, s: sympy.Symbol | None = None) -> RootCounts:
    """Exact counts for a polynomial with rational, algebraic or float coefficients.

    p = s^k g q with g = gcd(p(s), p(-s)), which holds every other root on the axis. In q the Cauchy index
    gives lhp - rhp (Gantmacher, The Theory of Matrices II); g is a polynomial in
    w = s^2, whose roots w < 0 are the pairs on the axis and whose other roots lie symmetric about it.
    """
    given = coefficients(polynomial, s)
    roots = roots_in(given)
    if in_large_field(given):
        raise UsageError(
            f"coefficients with {len(roots)} different roots: roots are counted in fields of degree up to "
            f"{LARGEST_FIELD}. Give them as rational numbers or floats."
        )
    # The gcd is taken over the exact field of the coefficients, so "on the axis" is decided, not estimated.
    domain, elements = construct_domain(list(given), field=True, extension=True)
    if not (domain.is_QQ or (domain.is_Algebraic and not any(c.has(sympy.I) for c in given))):
        raise UsageError(f"coefficients {given}: roots are counted for rational, algebraic and float ones")
    p = sympy.Poly.from_list(elements, SYMBOL, domain=domain)
    zeros = len(given) - 1 - max(i for i, c in enumerate(p.all_coeffs()) if c != 0)
    p = p.exquo(sympy.Poly(SYMBOL**zeros, SYMBOL, domain=domain))
    reversed_p = p.compose(sympy.Poly(-SYMBOL, SYMBOL, domain=domain))
    g = p.gcd(reversed_p)
    left_less_right = _cauchy_index(p.exquo(g))
    degree = p.degree() - g.degree()
    on_axis = {zeros: 1} if zeros else {}
    squares = sympy.Poly.from_list(g.rep.to_list()[::2], SYMBOL, domain=domain)
    for factor, multiplicity in squares.sqf_list()[1]:
        pairs = _negative_roots(factor)
        if pairs:
            on_axis[multiplicity] = on_axis.get(multiplicity, 0) + 2 * pairs
    pairs_axis = sum(m * number for m, number in on_axis.items()) - zeros
    symmetric = (g.degree() - pairs_axis) // 2
    return RootCounts(
        rhp=(degree - left_less_right) // 2 + symmetric,
        axis=pairs_axis + zeros,
        lhp=(degree + left_less_right) // 2 + symmetric,
        axis_multiplicities=tuple(sorted(on_axis.items())),
    )


def roots_in(expressions: Iterable[sympy.Expr]) -> set[sympy.Expr]:
    """The powers with fractions as exponents that occur."""
    powers = {q for e in expressions for q in e.atoms(sympy.Pow)}
    return {q for q in powers if q.exp.is_Rational and not q.exp.is_Integer}


def in_large_field(expressions: Iterable[sympy.Expr]) -> bool:
    """Whether exact arithmetic with these numbers takes place in a field of a degree above LARGEST_FIELD."""
    return bool(math.prod(q.exp.q for q in roots_in(expressions)) > LARGEST_FIELD)


def sign_of_number(number: sympy.Expr) -> int:
    """Sign of a real constant, decided exactly; raises UsageError where sympy cannot."""
    if number.is_zero:
        return 0
    if number.is_positive or number.is_negative:
        return 1 if number.is_positive else -1
    if number.equals(0):
        return 0
    digits = number.evalf(40)
    if not digits.is_Float:
        raise UsageError(f"the sign of {number} could not be decided; give it as a rational number")
    return 1 if digits > 0 else -1


def _cauchy_index(q: sympy.Poly) -> int:
    """lhp - rhp of a polynomial without roots on the axis, by a generalised Sturm chain."""
    # Elements of the domain: what goes through an expression is looked for in the field again.
    c, zero = q.rep.to_list(), q.domain.zero
    n = q.degree()
    # q(iw) / i^n: even part a0 w^n - a2 w^(n-2) + ..., odd part a1 w^(n-1) - a3 w^(n-3) + ...
    even = [c[k] * (-1) ** (k // 2) if k % 2 == 0 else zero for k in range(n + 1)]
    odd = [c[k] * (-1) ** (k // 2) if k % 2 else zero for k in range(1, n + 1)]
    f0 = sympy.Poly.from_list(even, SYMBOL, domain=q.domain)
    f1 = sympy.Poly.from_list(odd or [zero], SYMBOL, domain=q.domain)
    chain = _sturm_chain(f0, f1)
    tops = [sign_of_number(f.LC()) for f in chain]
    bottoms = [t * (-1) ** f.degree() for t, f in zip(tops, chain, strict=True)]
    return sign_changes(bottoms) - sign_changes(tops)


def _negative_roots(f: sympy.Poly) -> int:
    """Number of roots below 0 of a square-free polynomial with f(0) != 0 (Sturm)."""
    chain = _sturm_chain(f, f.diff())
    below = [sign_of_number(g.LC()) * (-1) ** g.degree() for g in chain]
    return sign_changes(below) - sign_changes([sign_of_number(g.nth(0)) for g in chain])


def _sturm_chain(f0: sympy.Poly, f1: sympy.Poly) -> list[sympy.Poly]:
    chain = [f0]
    while not f1.is_zero:
        chain.append(f1)
        rest = -f0.rem(f1)
        # A positive factor changes no sign and keeps the coefficients short.
        if rest.domain.is_QQ and not rest.is_zero:
            rest = rest.quo_ground(abs(rest.clear_denoms()[1].content()) / rest.clear_denoms()[0])
        f0, f1 = f1, rest
    return chain


def sign_changes(signs: Sequence[int]) -> int:
    """Number of sign changes in a sequence, zeros left out."""
    kept = [x for x in signs if x]
    return sum(a != b for a, b in pairwise(kept))
