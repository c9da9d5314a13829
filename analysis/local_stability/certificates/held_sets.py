"""Sets of equilibria that several relays or frictions hold: a quadratic function around all of them at once.

    z' = A z + B w,   y = C z,   w_k y_k >= 0

around any point of the set, which has the directions D: C D = 0, A D = -B E. With P B + C^T T = 0, T > 0
diagonal, V = z . P z has V' = z . S z - 2 sum T_k w_k y_k, S = P A + A^T P. D^T S D = 0, so S D = 0. If P >
0 and S < 0 across D, every equilibrium is stable, and solutions tend to what stays in D: there z = D a has z'
= B (w - E a), which is 0 where B and D together have full rank. So all solutions come to the set.
Source: Brogliato 2004, Systems Control Lett. 51, 343; Leine & van de Wouw 2008.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import sympy

from filippov.analysis.algebra.polynomial import exact
from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.feedbacks import Feedbacks, of_system
from filippov.analysis.local_stability.certificates.matrix_inequality import (
    DIGITS,
    available,
    feasible,
    positive_definite,
    rounded,
    symmetric,
)
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet

SOURCE = "Brogliato 2004, Systems Control Lett. 51, 343"


def held_sets(context: Context, found: EquilibriumPoint | EquilibriumSet) -> Certificate | None:
    """The verdict on a set for all solutions; None for other systems, and where there is no such function."""
    if not isinstance(found, EquilibriumSet) or not available():
        return None
    parts = of_system(context)
    if parts is None or any(share != 0 for share in parts.shares):
        return None
    values = {**context.values, **context.put}
    place = sympy.Matrix([exact(sympy.S(e).subs(values)) for e in found.x])
    D = place.jacobian(list(found.free))
    n, m = parts.B.shape
    if any(not e.is_Rational for e in D) or D.rank() < D.cols or not (parts.C * D).is_zero_matrix:
        return None
    both = sympy.Matrix.hstack(parts.B, D)
    # A D must lie in the columns of B, which have nothing in common with D.
    if both.rank() < m + D.cols or sympy.Matrix.hstack(parts.B, parts.A * D).rank() > m:
        return None
    names = sympy.symbols(f"p0:{n * (n + 1) // 2 + m}")
    free = iter(names)
    P = symmetric(n, free)
    T = sympy.diag(*[next(free) for _ in range(m)])
    ties = [*(P * parts.B + parts.C.T * T), *((P * parts.A + parts.A.T * P) * D)]
    basis = [dict(zip(names, list(q), strict=True)) for q in sympy.Matrix(ties).jacobian(names).nullspace()]
    M = sympy.Matrix.hstack(*D.T.nullspace())
    shares = _solved(parts, P, T, M, basis)
    if shares is None:
        return None
    for digits in DIGITS:
        row = list(rounded(shares, digits))
        put = {q: sum((s * e[q] for s, e in zip(row, basis, strict=True)), sympy.S.Zero) for q in names}
        at, by = P.subs(put), T.subs(put)
        S = at * parts.A + parts.A.T * at
        if not (at * parts.B + parts.C.T * by).is_zero_matrix or not (S * D).is_zero_matrix:
            continue
        if positive_definite(at) and positive_definite(by) and positive_definite(-M.T * S * M):
            text = "a quadratic function around every equilibrium falls: all solutions come to the set"
            told = (
                f"the field is linear but for {m} signs of affine inputs",
                f"P = {at.tolist()}, T = {list(by.diagonal())}",
                "P B + C^T T = 0, P > 0, P A + A^T P < 0 but along the set (pivots in exact numbers)",
            )
            return Certificate("asymptotically stable", text, SOURCE, told, "global")
    return None


def _solved(
    parts: Feedbacks, P: sympy.Matrix, T: sympy.Matrix, M: sympy.Matrix, basis: list[dict[Any, Any]]
) -> np.ndarray | None:
    """Shares of the solutions of the equations, by the solver; None where there are none."""
    import cvxpy

    if not basis:
        return None
    shares = cvxpy.Variable(len(basis))

    def along(whole: sympy.Matrix) -> Any:
        rows = [np.array(whole.subs(row).tolist(), dtype=float) for row in basis]
        return sum(shares[k] * row for k, row in enumerate(rows))

    falls = along(-M.T * (P * parts.A + parts.A.T * P) * M)
    solved = feasible([shares], [along(P), along(T), falls], [], [along(P)])
    return np.asarray(shares.value) if solved else None
