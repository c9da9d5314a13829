"""Several relays and kinks around one linear plant: a quadratic function with the integrals of the feedbacks.

    z' = A z + B w around an equilibrium,   0 <= w_k (y_k - w_k/K_k),   y = C z,   K = oo for a relay

w_k is the sign less its value at the equilibrium, or |h| + h less its own (K = 2). With Q, T >= 0 diagonal,
V = z . P z + 2 sum Q_k (integral of w_k over y_k) has V' <= (z, w) . L (z, w) along all solutions,

    L = [ P A + A^T P    P B + A^T C^T Q + C^T T ]
        [      .         Q C B + B^T C^T Q - 2 T/K ]

at almost all times on a jump y_k' = 0. For P > 0, L < 0 all solutions come to the equilibrium. A relay whose
row and column of C B are 0 leaves no room in L: its column is made 0, which ties P, Q and T.
Source: Khalil 2002; Yakubovich, Leonov, Gelig 2004; Boyd, El Ghaoui, Feron,
Balakrishnan 1994.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import sympy
from sympy import Expr, Rational

from filippov.analysis.algebra.polynomial import exact
from filippov.analysis.local_stability.certificates.certificate import Certificate
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
from filippov.model.symbols import t as time

SOURCE = "Khalil 2002 (Popov); with jumps Yakubovich, Leonov, Gelig 2004"
LARGEST, MOST = 8, 5


@dataclass(frozen=True)
class Feedbacks:
    """A (n, n), B (n, m), C (m, n); bounds 1/K_k."""

    A: sympy.Matrix
    B: sympy.Matrix
    C: sympy.Matrix
    shares: tuple[Expr, ...]

    def inequality(self, P: sympy.Matrix, Q: sympy.Matrix, T: sympy.Matrix) -> sympy.Matrix:
        """L."""
        A, B, C = self.A, self.B, self.C
        corner = P * B + A.T * C.T * Q + C.T * T
        last = Q * C * B + B.T * C.T * Q - 2 * T * sympy.diag(*self.shares)
        return sympy.Matrix(sympy.BlockMatrix([[P * A + A.T * P, corner], [corner.T, last]]))

    def tied(self) -> list[int]:
        """The relays whose sign acts on no y' and on whose y' no sign acts."""
        CB = self.C * self.B
        return [
            k
            for k, share in enumerate(self.shares)
            if share == 0 and CB.row(k).is_zero_matrix and CB.col(k).is_zero_matrix
        ]


def feedbacks(context: Context, found: EquilibriumPoint | EquilibriumSet) -> Certificate | None:
    """The verdict on a point for all solutions; None for one surface, other systems, or no such function."""
    if not isinstance(found, EquilibriumPoint) or not available():
        return None
    parts = of_system(context)
    if parts is None or len(parts.shares) < 2:
        return None
    n, m = parts.B.shape
    names = sympy.symbols(f"p0:{n * (n + 1) // 2 + 2 * m}")
    free = iter(names)
    P = symmetric(n, free)
    Q, T = (sympy.diag(*[next(free) for _ in range(m)]) for _ in range(2))
    L = parts.inequality(P, Q, T)
    tied = parts.tied()
    kept = [i for i in range(n + m) if i - n not in tied]
    equations = [L[i, n + k] for k in tied for i in range(n)]
    system = sympy.Matrix(equations).jacobian(names) if equations else sympy.zeros(1, len(names))
    basis = [dict(zip(names, list(q), strict=True)) for q in system.nullspace()]
    values = _solved(L.extract(kept, kept), P, [*Q.diagonal(), *T.diagonal()], basis)
    if values is None:
        return None
    for digits in DIGITS:
        shares = list(rounded(values, digits))
        put = {
            q: sum((s * row[q] for s, row in zip(shares, basis, strict=True)), sympy.S.Zero) for q in names
        }
        at = [M.subs(put) for M in (P, Q, T)]
        if min(*at[1].diagonal(), *at[2].diagonal()) < 0 or not positive_definite(at[0]):
            continue
        whole = parts.inequality(*at)
        if any(whole[i, n + k] != 0 for k in tied for i in range(n + m)):
            continue
        if positive_definite(-whole.extract(kept, kept)):
            return Certificate(
                "asymptotically stable",
                "a quadratic function with the integrals of the feedbacks falls along all solutions",
                SOURCE,
                (
                    f"the field is linear but for {m} signs and kinks of affine inputs",
                    f"P = {at[0].tolist()}, Q = {list(at[1].diagonal())}, T = {list(at[2].diagonal())}",
                    "P and -L are positive definite (pivots in exact numbers)",
                ),
                "global",
            )
    return None


def _solved(
    L: sympy.Matrix, P: sympy.Matrix, signs: list[Expr], basis: list[dict[sympy.Symbol, Rational]]
) -> np.ndarray | None:
    """Shares of the solutions of the equations, by the solver; None where there are none."""
    import cvxpy

    if not basis:
        return None
    shares = cvxpy.Variable(len(basis))

    def floats(M: sympy.Matrix, row: dict[sympy.Symbol, Rational]) -> np.ndarray:
        return np.array(M.subs(row).tolist(), dtype=float)

    whole, first = (sum(shares[k] * floats(M, row) for k, row in enumerate(basis)) for M in (L, P))
    line = sympy.Matrix([signs])
    most = sum(shares[k] * floats(line, row)[0] for k, row in enumerate(basis))
    solved = feasible([shares], [-whole, first], [most >= 0, most <= 100], [first])
    return np.asarray(shares.value) if solved else None


def of_system(context: Context) -> Feedbacks | None:
    """The matrices around an equilibrium, or None where the system is not of this form."""
    form, system = context.form, context.system
    values = {**context.values, **context.put}
    n, m = len(form.x), len(form.h)
    if not 1 <= m <= MOST or n > LARGEST or system.time_events:
        return None
    if any(q.width or q.kind not in {"switching", "kink"} for q in system.surfaces):
        return None
    if any(form.radius[i] != (-1, 1) for i in range(m) if system.surfaces[i].kind == "switching"):
        return None
    field = sympy.Matrix([sympy.expand(exact(f.subs(values))) for f in form.field])
    h = sympy.Matrix([sympy.expand(exact(e.subs(values))) for e in form.h])
    known = {*form.x, *form.s, *form.a}
    if field.has(time) or field.free_symbols - known or h.free_symbols - set(form.x):
        return None
    A, G, D, C = field.jacobian(form.x), field.jacobian(form.s), field.jacobian(form.a), h.jacobian(form.x)
    if any(not e.is_Rational for part in (A, G, D, C) for e in part):
        return None
    columns: list[sympy.Matrix] = []
    rows: list[sympy.Matrix] = []
    shares: list[Expr] = []
    for k in range(m):
        relay, kink = not G.col(k).is_zero_matrix, not D.col(k).is_zero_matrix
        if relay:
            columns, rows, shares = [*columns, G.col(k)], [*rows, C.row(k)], [*shares, sympy.S.Zero]
        if kink:
            # |h| = (|h| + h) - h, the bracket with slopes from 0 to 2.
            A = A - D.col(k) * C.row(k)
            columns, rows = [*columns, D.col(k)], [*rows, C.row(k)]
            shares = [*shares, Rational(1, 2)]
    if not columns:
        return None
    return Feedbacks(A, sympy.Matrix.hstack(*columns), sympy.Matrix.vstack(*rows), tuple(shares))
