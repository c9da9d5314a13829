"""Points at which linear fields meet in cones: a common or a piecewise quadratic Lyapunov function.

x' = A_i x where s_k c_k . x >= 0 for the signs s of side i. One V = x . P x with P > 0 and A_i^T P + P A_i <
0 for all i falls along all convex combinations too, so along sliding on any number of surfaces. Else V = x .
P_i x, P_i = F_i^T T F_i with F_i x = (max(c_1 . x, 0), ..., x), which is continuous, with the S-procedure

    P_i - E_i^T W_i E_i > 0,    A_i^T P_i + P_i A_i + E_i^T U_i E_i < 0,    W_i, U_i >= 0 entry by entry,

E_i the rows s_k c_k. For sliding V_i falls along the fields of the other sides j as well where these meet
it, on C x = 0, C the rows c_k of different sign; on one surface away from others only where it slides:

    A_j^T P_i + P_i A_j + N C + C^T N^T + E_i^T U_ij E_i - r (A_i^T c^T c A_j + A_j^T c^T c A_i) < 0,   r >= 0

Source: Boyd, El Ghaoui, Feron, Balakrishnan 1994, Linear Matrix Inequalities in System and Control Theory;
Johansson & Rantzer 1998, IEEE Trans. Automat. Contr. 43, 555.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy

from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.local import Local, Signs
from filippov.analysis.local_stability.certificates.matrix_inequality import (
    DIGITS,
    available,
    feasible,
    positive_definite,
    rounded,
)
from filippov.base.arrays import Array

COMMON = "Boyd, El Ghaoui, Feron, Balakrishnan 1994"
PIECES = "Johansson & Rantzer 1998, IEEE Trans. Automat. Contr. 43, 555"
LARGEST, MOST = 8, 3


@dataclass(frozen=True)
class Cones:
    """The linear parts A by signs, the rows c (k, n), whether a surface may slide, whether all are planes."""

    matrices: dict[Signs, sympy.Matrix]
    c: sympy.Matrix
    slides: bool
    flat: bool


def quadratic(found: Local) -> Certificate | None:
    """The verdict by a quadratic function, common or by pieces; None where there is none or no solver."""
    parts = linear_cones(found)
    if parts is None or not available():
        return None
    return _common(parts) or _by_pieces(parts)


def linear_cones(found: Local) -> Cones | None:
    """The linear parts where all fields vanish at the point and have rational derivatives; else None."""
    n = len(found.x)
    if not 1 <= len(found.h) <= MOST or not 2 <= n <= LARGEST or found.resets:
        return None
    if set(found.kinds) - {"kink", "switching"}:
        return None
    here = dict.fromkeys(found.x, sympy.S.Zero)
    c = sympy.Matrix(found.h).jacobian(found.x).subs(here)
    matrices = {}
    for signs, field in found.fields.items():
        if any(not f.is_polynomial(*found.x) or f.subs(here) != 0 for f in field):
            return None
        matrices[signs] = sympy.Matrix(field).jacobian(found.x).subs(here)
    if any(not e.is_Rational for m in (c, *matrices.values()) for e in m) or not _rows_count(c):
        return None
    # Surfaces that bend move cells by terms of second order: a common function does not mind.
    bent = sympy.Matrix(found.h) - c * sympy.Matrix(found.x)
    flat = bent.applyfunc(sympy.expand).is_zero_matrix
    return Cones(matrices, c, "switching" in found.kinds, flat)


def _rows_count(c: sympy.Matrix) -> bool:
    return all(not c.row(i).is_zero_matrix for i in range(c.rows))


def _floats(m: sympy.Matrix) -> Array:
    return np.array(m.tolist(), dtype=float)


def _scale(matrices: Iterable[sympy.Matrix]) -> float:
    return max(1.0, *(float(np.linalg.norm(_floats(m), 2)) for m in matrices))


def _common(parts: Cones) -> Certificate | None:
    import cvxpy

    exact_ones = list({m.as_immutable() for m in parts.matrices.values()})
    n = exact_ones[0].rows
    scale = _scale(exact_ones)
    P: Any = cvxpy.Variable((n, n), symmetric=True)
    falls = [-(_floats(m).T @ P + P @ _floats(m)) / scale for m in exact_ones]
    if not feasible([P], [P, *falls], [], [P]):
        return None
    for digits in DIGITS:
        Q = rounded((P.value + P.value.T) / 2, digits)
        if positive_definite(Q) and all(positive_definite(-(m.T * Q + Q * m)) for m in exact_ones):
            told = [f"{len(exact_ones)} linear parts meet at the point", f"P = {Q.tolist()}",
                    "P and all -(A^T P + P A) are positive definite (pivots in exact numbers)"]  # fmt: skip
            if parts.slides:
                told.append("so it falls along sliding as well, which is a convex combination")
            text = "all sides have a common quadratic Lyapunov function"
            return Certificate("asymptotically stable", text, COMMON, tuple(told))
    return None


@dataclass(frozen=True)
class Pair:
    """A face at which the cells i and j meet: its rows, and unknowns N, U and r (0 where others meet too)."""

    i: Signs
    j: Signs
    rows: tuple[int, ...]
    N: Any
    U: Any
    r: Any


def _by_pieces(parts: Cones) -> Certificate | None:
    import cvxpy

    m, n = parts.c.rows, parts.c.cols
    if not parts.flat:
        return None
    c = _floats(parts.c)
    scale = _scale(parts.matrices.values())
    T: Any = cvxpy.Variable((m + n, m + n), symmetric=True)
    unknowns: list[Any] = [T]
    positive, more, size = [], [], []
    cells: dict[Signs, tuple[Any, Any]] = {}
    whole = {}
    for signs, matrix in parts.matrices.items():
        A, F, E = _floats(matrix) / scale, _continuous(c, signs), np.array(signs)[:, None] * c
        W, U = (cvxpy.Variable((m, m), symmetric=True) for _ in range(2))
        P = whole[signs] = F.T @ T @ F
        positive += [P - E.T @ W @ E, -(A.T @ P + P @ A) - E.T @ U @ E]
        more += [W >= 0, U >= 0]
        size.append(P)
        unknowns += [W, U]
        cells[signs] = (W, U)
    pairs = []
    for i, j, rows in _faces(parts):
        A, B, P, C = (
            _floats(parts.matrices[j]) / scale,
            _floats(parts.matrices[i]) / scale,
            whole[i],
            c[list(rows)],
        )
        N, U, r = cvxpy.Variable((n, len(rows))), cvxpy.Variable((m, m), symmetric=True), cvxpy.Variable()
        E = np.array(i)[:, None] * c
        same = A.T @ C.T @ C @ B
        positive.append(-(A.T @ P + P @ A) - N @ C - C.T @ N.T - E.T @ U @ E + r * (same + same.T))
        more += [U >= 0, r >= 0 if len(rows) == 1 else r == 0]
        unknowns += [N, U, r]
        pairs.append(Pair(i, j, rows, N, U, r))
    if not feasible(unknowns, positive, more, size):
        return None
    for digits in DIGITS:
        found = _checked(parts, T.value, cells, pairs, scale, digits)
        if found is not None:
            told = [
                f"{len(parts.matrices)} cells, c = {parts.c.tolist()}; V = y . T y, y = (max(c . x, 0), x)",
                f"T = {found.tolist()}",
                "V is positive and falls on each cell (S-procedure, pivots in exact numbers)",
            ]
            if pairs:
                told.append("where sides meet it falls along all their fields that may slide")
            text = "a continuous piecewise quadratic Lyapunov function"
            return Certificate("asymptotically stable", text, PIECES, tuple(told))
    return None


def _faces(parts: Cones) -> Iterator[tuple[Signs, Signs, tuple[int, ...]]]:
    """(i, j, rows) of the cells whose fields differ where they meet: one surface, or several that cross."""
    if not parts.slides:
        return
    m, n = parts.c.rows, parts.c.cols
    for i, j in itertools.permutations(parts.matrices, 2):
        rows = tuple(k for k, (a, b) in enumerate(zip(i, j, strict=True)) if a != b)
        on = sympy.Matrix.vstack(*[parts.c.row(k) for k in rows]).nullspace()
        if all(((parts.matrices[i] - parts.matrices[j]) * q).is_zero_matrix for q in on):
            continue
        yield i, j, rows
        if len(rows) == 1:
            for other in range(m):
                both = tuple(sorted({*rows, other}))
                if len(both) == 2 and parts.c.extract(list(both), list(range(n))).rank() < n:
                    yield i, j, both


def _continuous(c: Array, signs: Signs) -> Array:
    return np.vstack([np.array([s > 0 for s in signs], dtype=float)[:, None] * c, np.eye(c.shape[1])])


def _checked(
    parts: Cones,
    value: Array,
    cells: dict[Signs, tuple[Any, Any]],
    pairs: list[Pair],
    scale: float,
    digits: int,
) -> sympy.Matrix | None:
    """T in fractions if all inequalities hold in exact numbers, else None."""
    c, n = parts.c, parts.c.cols
    by = sympy.Rational(scale)
    T = rounded((value + value.T) / 2, digits)
    whole, beside = {}, {}
    for signs, given in parts.matrices.items():
        A = given / by
        F = sympy.Matrix.vstack(*[c.row(k) * (1 if s > 0 else 0) for k, s in enumerate(signs)], sympy.eye(n))
        E = beside[signs] = sympy.diag(*signs) * c
        W, U = (_not_negative(q, digits) for q in cells[signs])
        P = whole[signs] = F.T * T * F
        if not positive_definite(P - E.T * W * E):
            return None
        if not positive_definite(-(A.T * P + P * A) - E.T * U * E):
            return None
    for pair in pairs:
        A, B, P, E = parts.matrices[pair.j] / by, parts.matrices[pair.i] / by, whole[pair.i], beside[pair.i]
        C = sympy.Matrix.vstack(*[c.row(k) for k in pair.rows])
        N, U = rounded(pair.N.value, digits).reshape(n, len(pair.rows)), _not_negative(pair.U, digits)
        r = max(rounded(pair.r.value, digits)[0], sympy.S.Zero) if len(pair.rows) == 1 else sympy.S.Zero
        same = A.T * C.T * C * B
        whole_pair = -(A.T * P + P * A) - N * C - C.T * N.T - E.T * U * E + r * (same + same.T)
        if not positive_definite(whole_pair):
            return None
    return T


def _not_negative(q: Any, digits: int) -> sympy.Matrix:
    return rounded(np.maximum((q.value + q.value.T) / 2, 0.0), digits)
