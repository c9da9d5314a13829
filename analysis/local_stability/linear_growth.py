"""Whether solutions of x' = A x stay bounded: no root on the right, all eigenvectors for those on the axis.

With exact entries: let g = gcd(p(s), p(-s)) of the characteristic polynomial p. If no root lies on the right,
g holds the roots on the axis, as often as p does, and A is bounded if and only if its distinct roots times
p/g annihilate A (the minimal polynomial has them once). Source: Gantmacher 1959, Theory of Matrices, ch. VII.
"""

from __future__ import annotations

import numpy as np
import sympy
from scipy.linalg import matrix_balance

from filippov.analysis.algebra import linalg
from filippov.analysis.algebra.polynomial import SYMBOL, count_roots
from filippov.base.arrays import Array

# Of entries that are no fractions: real parts and gaps of roots below SAME of the norm are 0, those above
# APART are not, and between them nothing is said.
SAME, APART = 1e-11, 1e-6


def is_bounded(matrix: sympy.Matrix) -> bool | None:
    """Whether exp(A t) is bounded for t >= 0, A without symbols; None where rounding leaves it open."""
    if all(e.is_Rational for e in matrix):
        return _exactly(matrix)
    A = np.array(matrix.evalf(30).tolist(), dtype=float)
    return _numerically(A) if np.all(np.isfinite(A)) else None


def _exactly(matrix: sympy.Matrix) -> bool:
    p = matrix.charpoly(SYMBOL)
    p = sympy.Poly(p.as_expr(), SYMBOL, domain="QQ")
    if count_roots(p.all_coeffs()).rhp:
        return False
    mirrored = sympy.Poly(p.as_expr().subs(SYMBOL, -SYMBOL), SYMBOL, domain="QQ")
    g = sympy.gcd(p, mirrored)
    if g.degree() == 0:
        return True
    least = g.sqf_part() * p.quo(g)
    total = sympy.zeros(matrix.rows)
    for c in least.all_coeffs():
        total = total * matrix + c * sympy.eye(matrix.rows)
    return bool(total.is_zero_matrix)


def _numerically(A: Array) -> bool | None:
    """The same by eigenvalues of the matrix with its rows and columns brought to one size."""
    balanced, _ = matrix_balance(A, permute=False)
    size = float(np.linalg.norm(balanced))
    if size == 0.0:
        return True
    roots = linalg.eigvals(balanced / size)
    if np.any(roots.real > APART):
        return False
    if np.any(np.abs(roots.real[roots.real > -APART]) > SAME):
        return None
    axis = roots[np.abs(roots.real) <= SAME]
    for root in axis:
        gaps = np.abs(axis - root)
        sizes = linalg.svd(balanced / size - 1j * root.imag * np.eye(len(A)), compute_uv=False)
        if np.any((gaps > SAME) & (gaps < APART)) or np.any((sizes > SAME) & (sizes < APART)):
            return None
        if np.sum(sizes <= SAME) < np.sum(gaps <= SAME):
            return False
    return True
