"""Multipliers that make a transfer function positive real, found in floats and checked in exact numbers.

A real rational H = p/q without common factors is positive real if and only if p + q has all its roots on
the left and Re p(i w) q(-i w) >= 0 for all w (the Cayley transform of H is bounded by 1). With K > 0 or oo:

    Popov:        1/K + (1 + a s) G(s), a >= 0
    Zames, Falb:  Re [M(i w) (1/K + G(i w))] > 0 for all w, M = 1 - sum of a_j b_j/(b_j + s) or its mirror,
                  sum |a_j| < 1; all a_j >= 0 unless the feedback is odd

Source: Khalil 2002; Zames & Falb 1968, SIAM J. Control 6, 89; Megretski & Rantzer
1997, IEEE Trans. Automat. Contr. 42, 819.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt
import sympy
from sympy import Poly, Rational

from filippov.analysis.algebra import linalg
from filippov.analysis.algebra.polynomial import Verdict, count_roots
from filippov.base.arrays import Array
from filippov.base.shown import Shown

S = sympy.Symbol("s")
_W = sympy.Symbol("w", real=True)
POINTS, DECADES, RATES, LEAST = 241, 3, 13, 1e-7
DENOMINATORS = (1, 2, 5, 10, 100, 1000, 10_000, 1_000_000)


@dataclass(frozen=True)
class Multiplier(Shown):
    """M = 1 - sum of share b/(b + s), or b/(b - s) where it runs against time; rows (share, b, forward)."""

    terms: tuple[tuple[Rational, Rational, bool], ...]

    def __str__(self) -> str:
        """The formula."""
        parts = [
            f"{'-' if a > 0 else '+'} {abs(a)} {b}/({b} {'+' if forward else '-'} s)"
            for a, b, forward in self.terms
        ]
        return " ".join(["1", *parts])


def hurwitz(p: Poly) -> bool:
    """Whether all roots lie on the left, in exact numbers; true for a constant."""
    if p.is_zero:
        return False
    coefficients = p.all_coeffs()
    return len(coefficients) < 2 or count_roots(coefficients).verdict is Verdict.ASYMPTOTICALLY_STABLE


def real_part(p: Poly, q: Poly) -> Poly:
    """Re p(i w) q(-i w), a polynomial in w."""
    even = sympy.S.Zero
    product = (p * q.compose(Poly(-S, S, domain="QQ"))).all_coeffs()[::-1]
    for k, c in enumerate(product):
        if k % 2 == 0:
            even += (-1) ** (k // 2) * c * _W**k
    return Poly(even, _W, domain="QQ")


def nowhere_negative(p: Poly) -> bool:
    """Whether a real polynomial is >= 0 everywhere, and not 0."""
    if p.is_zero or p.LC() < 0:
        return False
    _, factors = p.sqf_list()
    return all(factor.count_roots() == 0 for factor, order in factors if order % 2)


def positive_real(p: Poly, q: Poly) -> bool:
    """Whether p/q is positive real and without common factors."""
    if p.is_zero or q.is_zero or p.gcd(q).degree() > 0:
        return False
    total = p + q
    return (
        total.degree() == max(p.degree(), q.degree()) and hurwitz(total) and nowhere_negative(real_part(p, q))
    )


def popov(above: Poly, below: Poly, bound: Rational | None) -> Rational | None:
    """a >= 0 with 1/K + (1 + a s) above/below positive real and no common factors; None where none is found.

    bound  K, None for oo
    """
    share = sympy.S.Zero if bound is None else 1 / bound
    if above.is_zero or above.gcd(below).degree() > 0:
        return None
    for a in _slopes(above, below, float(share)):
        whole = Poly(1 + a * S, S, domain="QQ") * above
        if whole.gcd(below).degree() == 0 and positive_real(share * below + whole, below):
            return a
    return None


def _frequencies(below: Poly) -> Array:
    roots = np.abs(linalg.roots([float(c) for c in below.all_coeffs()]))
    sizes = roots[roots > 1e-9]
    low, high = (np.min(sizes), np.max(sizes)) if len(sizes) else (1.0, 1.0)
    fine = np.geomspace(low * 10.0**-DECADES, high * 10.0**DECADES, POINTS * 3)
    near = np.concatenate([r * np.linspace(0.8, 1.25, 41) for r in sizes]) if len(sizes) else fine
    return np.unique(np.concatenate((fine, near)))


def _response(p: Poly, q: Poly, w: Array) -> npt.NDArray[np.complex128]:
    with np.errstate(all="ignore"):
        top, bottom = (np.polyval([float(c) for c in e.all_coeffs()], 1j * w) for e in (p, q))
        return np.asarray(top / bottom)


def _slopes(above: Poly, below: Poly, share: float) -> Iterator[Rational]:
    """Values of a at which the real part is >= 0 on a grid, simple ones first."""
    w = _frequencies(below)
    G = _response(above, below, w)
    kept = np.isfinite(G)
    w, G = w[kept], G[kept]
    rest, gain = share + G.real, -w * G.imag
    low = float(np.max(-rest[gain > 0] / gain[gain > 0], initial=0.0))
    high = float(np.min(-rest[gain < 0] / gain[gain < 0], initial=np.inf))
    if low <= 0.0:
        yield sympy.S.Zero
        low = 0.0
    if high < low * (1 - LEAST):
        return
    if high == np.inf:
        high = 4 * low + 4 / float(np.median(w))
    ends = (low, high)
    inner = [low + part * (high - low) for part in (0.5, 0.1, 0.9, 0.01, 0.99, 1e-4)]
    if low > 0:
        inner.insert(1, float(np.sqrt(low * high)))
    for value in (*inner, *ends):
        for limit in DENOMINATORS:
            a = Fraction(value).limit_denominator(limit)
            if a > 0 and low <= a <= high:
                yield Rational(a.numerator, a.denominator)
                break


def zames_falb(above: Poly, below: Poly, bound: Rational, odd: bool) -> Multiplier | None:
    """A multiplier for slopes in [0, K] and a stable G; None where none is found."""
    if not hurwitz(below):
        return None
    p = above + below / bound
    for rates in _rates(below):
        found = _shares(p, below, rates, odd)
        if found is not None and _exceeds(p, below, found):
            return found
    return None


def _rates(below: Poly) -> Iterator[list[Rational]]:
    sizes = np.abs(linalg.roots([float(c) for c in below.all_coeffs()]))
    for count, reach in ((5, 4.0), (RATES, 20.0), (RATES, 200.0)):
        values = np.geomspace(np.min(sizes) / reach, np.max(sizes) * reach, count)
        yield [Rational(f"{v:.2g}") for v in values]


def _shares(p: Poly, q: Poly, rates: list[Rational], odd: bool) -> Multiplier | None:
    """The shares that make the least real part on a grid largest, by a linear program."""
    from scipy.optimize import linprog

    w = _frequencies(q)
    F = _response(p, q, w)
    size = np.abs(F)
    columns, labels = [], []
    for b in rates:
        for forward in (True, False):
            rest = float(b) / (float(b) + (1j if forward else -1j) * w)
            for sign in (1, -1) if odd else (1,):
                columns.append(sign * np.real(rest * F) / size)
                labels.append((sign, b, forward))
    # max d with Re F/|F| - sum a_j column_j >= d, sum a_j <= 1.
    A = np.column_stack([*columns, np.ones(len(w))])
    A = np.vstack([A, [*np.ones(len(columns)), 0.0]])
    limit = np.concatenate((F.real / size, [1.0 - 1e-6]))
    cost = np.zeros(A.shape[1])
    cost[-1] = -1.0
    found = linprog(cost, A_ub=A, b_ub=limit, bounds=[(0, None)] * len(columns) + [(None, 1)], method="highs")
    if not found.success or found.x[-1] <= LEAST:
        return None
    terms = []
    for share, (sign, b, forward) in zip(found.x[:-1], labels, strict=True):
        a = sign * Rational(int(share * 10**5), 10**5)
        if a != 0:
            terms.append((a, b, forward))
    return Multiplier(tuple(terms))


def _exceeds(p: Poly, q: Poly, m: Multiplier) -> bool:
    """Whether Re M(i w) p/q > 0 for all w and at oo, in exact numbers."""
    if sum(abs(a) for a, _, _ in m.terms) >= 1:
        return False
    whole, below = sympy.S.One, sympy.S.One
    for a, b, forward in m.terms:
        bottom = b + S if forward else b - S
        whole = sympy.expand(whole * bottom - a * b * below)
        below = sympy.expand(below * bottom)
    even = real_part(Poly(whole, S, domain="QQ") * p, Poly(below, S, domain="QQ") * q)
    last = 2 * (q.degree() + Poly(below, S).degree())
    return bool(even.degree() == last and even.LC() > 0 and even.count_roots() == 0)
