"""Points on surfaces with linear resets: a quadratic function that falls between resets and rises at none.

x' = A x, and x+ = R x where c . x = 0. V = x . P x with P > 0, A^T P + P A < 0 and x . (P - R^T P R) x >= 0
on c . x = 0 falls along all solutions. States that a reset keeps make the last matrix singular there: its
product with them is 0, which ties entries of P (for a state set to 0 this is the H_beta condition). Where a
reset allows resting contact, the push D must do no work: x . P D = 0 on c . x = c . A x = 0.
Source: Beker, Hollot, Chait, Han 2004, Automatica 40, 905; Leine & van de Wouw 2008.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy

from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.local import Local
from filippov.analysis.local_stability.certificates.matrix_inequality import (
    DIGITS,
    available,
    feasible,
    positive_definite,
    rounded,
    symmetric,
)

SOURCE = "Beker, Hollot, Chait, Han 2004, Automatica 40, 905"
LARGEST = 8


@dataclass(frozen=True)
class Reset:
    """x+ = R x on the columns of N; K: what R keeps of them, M: a complement; push acts on those of held."""

    R: sympy.Matrix
    N: sympy.Matrix
    K: sympy.Matrix
    M: sympy.Matrix
    push: sympy.Matrix | None
    held: sympy.Matrix

    def change(self, P: sympy.Matrix) -> sympy.Matrix:
        """N^T (P - R^T P R) N."""
        return self.N.T * (P - self.R.T * P * self.R) * self.N

    def ties(self, P: sympy.Matrix) -> list[sympy.Expr]:
        """What must be 0."""
        out = list(self.change(P) * self.K) if self.K.cols else []
        if self.push is not None and self.held.cols:
            out += list(self.held.T * P * self.push)
        return out


def resets(found: Local) -> Certificate | None:
    """The verdict on a point on surfaces with resets alone beside one linear field; else None."""
    n = len(found.x)
    if set(found.resets) != set(range(len(found.h))) or not found.h or not 2 <= n <= LARGEST:
        return None
    if not available():
        return None
    parts = _parts(found)
    if parts is None:
        return None
    A, rules = parts
    names = sympy.symbols(f"p0:{n * (n + 1) // 2}")
    P = symmetric(n, iter(names))
    equations = [e for rule in rules for e in rule.ties(P)]
    system = sympy.Matrix(equations).jacobian(names) if equations else sympy.zeros(1, len(names))
    basis = [P.subs(dict(zip(names, list(q), strict=True))) for q in system.nullspace()]
    shares = _solved(A, rules, basis)
    for digits in DIGITS if shares is not None else ():
        Q = sum((e * q for e, q in zip(rounded(shares, digits), basis, strict=True)), sympy.zeros(n, n))
        if _holds(A, rules, Q):
            return Certificate(
                "asymptotically stable", "a quadratic Lyapunov function that no reset raises", SOURCE,
                (
                    f"surfaces with linear resets at the point: {len(rules)}; one linear field beside them",
                    f"P = {Q.tolist()}",
                    "P, -(A^T P + P A) > 0, P - R^T P R >= 0 on c . x = 0 (pivots in exact numbers)",
                ),
            )  # fmt: skip
    return None


def _parts(found: Local) -> tuple[sympy.Matrix, list[Reset]] | None:
    field = found.smooth()
    if field is None:
        return None
    x, here = found.x, dict.fromkeys(found.x, sympy.S.Zero)
    A = sympy.Matrix(field).jacobian(x)
    c = sympy.Matrix(found.h).jacobian(x)
    rows = [sympy.Matrix(found.resets[k]).jacobian(x) for k in range(len(found.h))]
    if any(not e.is_Rational for part in (A, c, *rows) for e in part):
        return None
    if any(sympy.S(f).subs(here) != 0 for f in (*field, *(e for r in found.resets.values() for e in r))):
        return None
    rules = []
    for k, R in enumerate(rows):
        across = c.row(k)
        if across.is_zero_matrix:
            return None
        N = sympy.Matrix.hstack(*across.nullspace())
        kept = ((sympy.eye(len(x)) - R) * N).nullspace()
        K = sympy.Matrix.hstack(*kept) if kept else sympy.zeros(N.cols, 0)
        rest = K.T.nullspace() if kept else [sympy.eye(N.cols)]
        M = sympy.Matrix.hstack(*rest) if rest else sympy.zeros(N.cols, 0)
        both = sympy.Matrix.vstack(across, across * A).nullspace()
        held = sympy.Matrix.hstack(*both) if both else sympy.zeros(len(x), 0)
        push = found.pushes.get(k)
        if push is not None and any(not e.is_Rational for e in push):
            return None
        rules.append(Reset(R, N, K, M, None if push is None else sympy.Matrix(push), held))
    return A, rules


def _solved(A: sympy.Matrix, rules: Sequence[Reset], basis: Sequence[sympy.Matrix]) -> Any:
    """Shares of the matrices of the basis, by the solver; None where there are none."""
    import cvxpy

    if not basis:
        return None
    shares = cvxpy.Variable(len(basis))

    def along(of: Any) -> Any:
        terms = [shares[k] * np.array(of(q).tolist(), dtype=float) for k, q in enumerate(basis)]
        total = terms[0]
        for term in terms[1:]:
            total = total + term
        return total

    scale = max(1.0, float(np.linalg.norm(np.array(A.tolist(), dtype=float), 2)))
    P = along(lambda q: q)
    positive = [P, along(lambda q: -(A.T * q + q * A)) / scale]
    positive += [along(lambda q, r=r: r.M.T * r.change(q) * r.M) for r in rules if r.M.cols]
    return shares.value if feasible([shares], positive, [], [P]) else None


def _holds(A: sympy.Matrix, rules: Sequence[Reset], P: sympy.Matrix) -> bool:
    if not positive_definite(P) or not positive_definite(-(A.T * P + P * A)):
        return False
    for rule in rules:
        if any(e != 0 for e in rule.ties(P)):
            return False
        if rule.M.cols and not positive_definite(rule.M.T * rule.change(P) * rule.M):
            return False
    return True
