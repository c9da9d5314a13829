"""Polynomial fields with roots on the axis: V = sum w_i x_i^2 whose derivative has even powers alone.

V' = sum 2 w_i x_i f_i is a polynomial with coefficients linear in w. Weights w > 0 are sought for which
every term with an odd power vanishes. If all terms left have one sign, V falls or grows. The rest is the
argument of LaSalle: where V' = 0, a state that V' holds in a pure power is 0, so is its rate, and if that
leads to all states no solution but the rest stays there.
"""

from __future__ import annotations

from collections.abc import Sequence

import sympy
from sympy import Expr, Symbol

from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.local import Local

LASALLE = "Khalil 2002, Nonlinear Systems, corollary 4.1"
KRASOVSKII = "Krasovskii 1963, Stability of Motion"
KEPT = "Khalil 2002, Nonlinear Systems, theorem 4.1"
Terms = list[tuple[tuple[int, ...], Expr]]


def even_terms(found: Local) -> Certificate | None:
    """The verdict on a point off all surfaces by a weighted sum of squares; None where there is none."""
    if found.h or not found.x:
        return None
    (field,) = found.fields.values()
    if any(not f.is_polynomial(*found.x) for f in field):
        return None
    weights = sympy.symbols(f"w0:{len(found.x)}")
    change = sum((2 * w * x * f for w, x, f in zip(weights, found.x, field, strict=True)), sympy.S.Zero)
    terms = _terms(change, found.x)
    odd = [c for powers, c in terms if any(k % 2 for k in powers)]
    if any(c.free_symbols - set(weights) for _, c in terms):
        return None
    basis = sympy.Matrix(odd).jacobian(weights).nullspace() if odd else list(_axes(len(weights)))
    at = _positive(basis)
    if at is None:
        return None
    put = dict(zip(weights, at, strict=True))
    left = [(powers, c.subs(put)) for powers, c in terms if not any(k % 2 for k in powers)]
    left = [(powers, c) for powers, c in left if c != 0]
    signs = {bool(c > 0) for _, c in left}
    squares = " + ".join(f"{w}*{x}**2" if w != 1 else f"{x}**2" for w, x in zip(at, found.x, strict=True))
    told = (f"V = {squares}", f"V' = {sympy.expand(change.subs(put))}")
    if not left:
        return Certificate("stable", "a sum of squares is kept", KEPT, told)
    if len(signs) > 1:
        return None
    alone = _alone(left, field, found.x)
    if signs == {True}:
        if not alone:
            return None
        return Certificate("unstable", "a sum of squares grows along solutions", KRASOVSKII, told)
    if not alone:
        return Certificate("stable", "a sum of squares does not grow", KEPT, told)
    text = "a sum of squares falls along solutions, and V' = 0 holds no other solution"
    return Certificate("asymptotically stable", text, LASALLE, told)


def _terms(e: Expr, x: Sequence[Symbol]) -> Terms:
    return [] if sympy.expand(e) == 0 else list(sympy.Poly(e, *x).terms())


def _axes(n: int) -> list[sympy.Matrix]:
    return [sympy.eye(n).col(k) for k in range(n)]


def _positive(basis: Sequence[sympy.Matrix]) -> list[Expr] | None:
    """Positive weights in the span of vectors, where the sum of those without a negative entry is one."""
    turned = [-q if all(e <= 0 for e in q) else q for q in basis]
    useful = [q for q in turned if all(e >= 0 for e in q)]
    if not useful:
        return None
    total = sum(useful[1:], useful[0])
    return list(total) if all(e > 0 for e in total) else None


def _alone(left: Terms, field: Sequence[Expr], x: Sequence[Symbol]) -> bool:
    """Whether V' = 0 and what follows for the rates leave x = 0 alone."""
    zero: set[Symbol] = set()
    held: list[Terms] = [left]
    while True:
        before = set(zero)
        for terms in held:
            kept = [(m, c) for m, c in terms if not any(k and q in zero for k, q in zip(m, x, strict=True))]
            if len({bool(c > 0) for _, c in kept}) != 1:
                continue
            even = all(not any(k % 2 for k in powers) for powers, _ in kept)
            pure = [powers for powers, _ in kept if sum(k > 0 for k in powers) == 1]
            if even or len(kept) == 1:
                zero |= {x[next(i for i, k in enumerate(powers) if k)] for powers in pure}
        rates = [field[i].subs(dict.fromkeys(zero, 0)) for i, q in enumerate(x) if q in zero]
        held = [left, *(_terms(rate, x) for rate in rates)]
        if len(zero) == len(x):
            return True
        if zero == before:
            return False
