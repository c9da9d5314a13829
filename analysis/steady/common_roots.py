"""Real common roots of two polynomials in two unknowns, all of them, by their resultant.

The resultant in v is a polynomial in u with exact coefficients that vanishes at the u of every common root.
Source: Cox, Little, O'Shea 2015, Ideals, Varieties, and Algorithms, section 3.6.
"""

from __future__ import annotations

from collections.abc import Iterable

import sympy
from sympy import EXRAW, Expr, Poly, Symbol
from sympy.polys.polyerrors import BasePolynomialError

DIGITS, STEPS = 30, 200
# Imaginary part of a real root, and what is left of an equation at a root, in units of its terms.
ROUNDING = 1e-9
# A coefficient, in units of its terms.
ZERO = 1e-20
_UNKNOWN = sympy.Dummy()


def common_roots(f: Expr, g: Expr, u: Symbol, v: Symbol) -> list[tuple[Expr, Expr]] | None:
    """All real (u, v) with f = g = 0, to 20 digits and more.

    None where a coefficient is no rational number, or their number is not finite. Raises
    `sympy.polys.polytools.NoConvergence`.
    """
    f_whole, g_whole = whole_coefficients(f, v, u), whole_coefficients(g, v, u)
    if f_whole is None or g_whole is None:
        return None
    if f_whole.gcd(g_whole).total_degree() > 0:
        return None
    resultant = Poly(f_whole.resultant(g_whole), u)
    found: list[tuple[Expr, Expr]] = []
    for at in real_roots(resultant.sqf_part()):
        lines = [line for p in (f_whole, g_whole) if len(line := _at(p, u, v, at)) > 0]
        lines.sort(key=len)
        for other in real_roots(Poly(lines[0], v)):
            again = any(at == p and abs(other - q) <= ROUNDING * max(1, abs(q)) for p, q in found)
            if not again and all(_is_root(line, other) for line in lines[1:]):
                found.append((at, other))
    return found


def whole_coefficients(e: Expr, *unknowns: Symbol) -> Poly | None:
    """The polynomial with whole coefficients and simple factors that has the zeros of e; None where e is none
    with rational coefficients."""
    try:
        polynomial = Poly(e, *unknowns)
    except BasePolynomialError:
        return None
    if not (polynomial.domain.is_ZZ or polynomial.domain.is_QQ):
        return None
    return polynomial.clear_denoms(convert=True)[1].sqf_part()


def real_roots(polynomial: Poly) -> list[Expr]:
    """The real roots of a polynomial in one unknown whose coefficients are numbers."""
    if polynomial.degree() < 1:
        return []
    (least,), rest = polynomial.terms_gcd()
    zero = [sympy.S.Zero] * least
    if rest.degree() < 1:
        return zero
    parts = [r.as_real_imag() for r in rest.nroots(n=DIGITS, maxsteps=STEPS)]
    return [*zero, *(real for real, imaginary in parts if abs(imaginary) < ROUNDING * abs(real))]


def _at(polynomial: Poly, u: Symbol, v: Symbol, at: Expr) -> list[Expr]:
    """Coefficients in v, the highest first, at a number for u; [] where all vanish."""
    line: list[Expr] = []
    for c in Poly(polynomial, v).all_coeffs():
        parts = Poly(c, u).all_coeffs()
        value = _value(parts, at)
        zero = abs(value) <= ZERO * _value(map(abs, parts), abs(at))
        if line or not zero:
            line.append(sympy.S.Zero if zero else value)
    return line


def _is_root(line: list[Expr], at: Expr) -> bool:
    return bool(abs(_value(line, at)) <= ROUNDING * _value(map(abs, line), abs(at)))


def _value(coefficients: Iterable[Expr], at: Expr) -> Expr:
    """The value of a polynomial, highest coefficient first."""
    return Poly([*coefficients], _UNKNOWN, domain=EXRAW).eval(at)
