"""A point on several relays: V = sum d_i (|h_i| - s0_i h_i) with weights d_i > 0.

At the point h' = r + M s and 0 = r + M s0. For h to first order V' = (s - s0)^T D M (s - s0), because
where h_i stays 0 both s_i h_i' and s0_i h_i' are 0. If D M + M^T D is negative definite all h_i reach 0
in finite time, and the field sliding on all of them decides what is left. If it is positive definite V
grows off the surfaces. If M s + r points away from all surfaces for one choice of signs, solutions leave
straight.
Source: Utkin 1992, Sliding Modes in Control and Optimization; Filippov 1988.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import sympy
from sympy import Expr

from filippov.analysis.algebra import linalg
from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.local import Local

UTKIN = "Utkin 1992"
MOST = 5


def relays(found: Local) -> Certificate | None:
    """The verdict on a point on k >= 2 relays with independent gradients; None where M does not decide."""
    k, n = len(found.h), len(found.x)
    if not 2 <= k <= min(n, MOST) or set(found.kinds) != {"switching"} or found.resets:
        return None
    here = dict.fromkeys(found.x, sympy.S.Zero)
    c = sympy.Matrix(found.h).jacobian(found.x).subs(here)
    if c.has(sympy.nan, sympy.zoo, sympy.oo) or c.rank() < k:
        return None
    rates = {signs: c * sympy.Matrix([f.subs(here) for f in field]) for signs, field in found.fields.items()}
    if any(not e.is_number or not e.is_finite for rate in rates.values() for e in rate):
        return None
    for signs, rate in rates.items():
        if all(bool(s * e > 0) for s, e in zip(signs, rate, strict=True)):
            where = ", ".join(
                f"{name}: {'+' if s > 0 else '-'}" for name, s in zip(found.names, signs, strict=True)
            )
            text = "between the surfaces a field points away from all of them"
            return Certificate("unstable", text, UTKIN, (f"on the sides {where}",))
    count = 2**k
    r = sum(rates.values(), sympy.zeros(k, 1)) / count
    columns = [
        sum((rate * signs[i] for signs, rate in rates.items()), sympy.zeros(k, 1)) / count for i in range(k)
    ]
    M = sympy.Matrix.hstack(*columns)
    if any(sympy.simplify(r + M * sympy.Matrix(s) - rate).norm() != 0 for s, rate in rates.items()):
        return None
    if M.det() == 0:
        return None
    s0 = -M.inv() * r
    if any(not bool(abs(e) < 1) for e in s0):
        return None
    weights = _weights(M)
    if weights is None:
        return _outwards(M)
    D = sympy.diag(*weights)
    told = [
        "h' = r + M s to first order, M = " + str(M.tolist()),
        "D M + M^T D is negative definite, D = diag"
        + str(tuple(weights))
        + " (leading minors in exact numbers)",
    ]
    assert (-(D * M + M.T * D)).is_positive_definite
    text = "all surfaces are reached in finite time"
    if k == n:
        return Certificate("asymptotically stable", text, UTKIN, tuple(told))
    roots = _sliding_roots(found, c, s0)
    if roots is None:
        return None
    told.append(f"roots of the field that slides on all of them: real parts up to {max(roots.real):.6g}")
    if max(roots.real) < -1e-9:
        return Certificate(
            "asymptotically stable", f"{text}, and sliding leads to the point", UTKIN, tuple(told)
        )
    if max(roots.real) > 1e-9:
        return Certificate("unstable", f"{text}, and sliding leads away", UTKIN, tuple(told))
    return None


def _weights(M: sympy.Matrix) -> Sequence[Expr] | None:
    """d with D M + M^T D negative definite, among those that are simple or balance M; None where none is."""
    k = M.rows
    values = np.array(M.tolist(), dtype=float)
    options = [np.ones(k)]
    with np.errstate(all="ignore"):
        balanced = [np.sqrt(abs(values[1, 0] / values[0, 1]))] if k == 2 and values[0, 1] != 0 else []
        options += [np.array([q, 1.0]) for q in (*balanced, *(b**2 for b in balanced)) if 0 < q < np.inf]
    options += [np.array(p, dtype=float) for p in itertools.product((1, 2, 5), repeat=k)]
    if k <= 3:
        options += [np.array(p, dtype=float) for p in itertools.product((1, 3, 10, 30), repeat=k)]
    for option in options:
        largest = np.max(linalg.eigvalsh(option[:, None] * values + values.T * option[None, :]))
        if largest < -1e-9:
            weights = [sympy.Rational(f"{q:.6g}") for q in option]
            D = sympy.diag(*weights)
            if (-(D * M + M.T * D)).is_positive_definite:
                return weights
    return None


def _outwards(M: sympy.Matrix) -> Certificate | None:
    if not (M + M.T).is_positive_definite:
        return None
    told = ("h' = r + M s to first order, M = " + str(M.tolist()), "M + M^T is positive definite")
    text = "sum |h_i| - s0_i h_i grows on all solutions off the surfaces"
    return Certificate("unstable", text, "Filippov 1988", told)


def _sliding_roots(found: Local, c: sympy.Matrix, s0: sympy.Matrix) -> np.ndarray | None:
    """The roots of the field with h' = 0, but the k that belong to the h themselves."""
    k = len(found.h)
    signs = sympy.symbols(f"s0:{k}")
    # Multi-affine in the signs: the interpolant between the corners of the box.
    field = sympy.zeros(len(found.x), 1)
    for corner, row in found.fields.items():
        share = sympy.Mul(*((1 + a * b) / 2 for a, b in zip(corner, signs, strict=True)))
        field += share * sympy.Matrix(row)
    at = dict(zip(signs, s0, strict=True))
    here = dict.fromkeys(found.x, sympy.S.Zero)
    A = field.subs(at).jacobian(found.x).subs(here)
    G = field.jacobian(signs).subs(at).subs(here)
    rates = (sympy.Matrix(found.h).jacobian(found.x) * field.subs(at)).jacobian(found.x).subs(here)
    sliding = A - G * (c * G).inv() * rates
    if sliding.free_symbols or sliding.has(sympy.nan, sympy.zoo):
        return None
    roots = linalg.eigvals(np.array(sliding.tolist(), dtype=float))
    return np.asarray(roots[np.argsort(np.abs(roots))][k:])
