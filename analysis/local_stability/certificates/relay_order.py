"""A point on one relay whose sign acts on the second or a higher derivative of h only.

Let h, h', ..., h^(r-1) not hold s and h^(r) = a(x) + b(x) s, at the point a + b s0 = 0, |s0| < 1. For r
>= 3 it is unstable whatever b is, and for r = 2 where b > 0. For r = 2, b < 0 solutions beside it switch
ever faster about h = h' = 0; with z = h' their energy z^2/2 - b (|h| - s0 h) falls at the rate of

    d = (grad(a + b s0) . g)/b z^2,     g = df/ds,

so it is asymptotically stable if d < 0 and the field on h = h' = 0 has all its roots on the left, and
unstable if d > 0 or a root lies on the right (solutions in h = h' = 0 are solutions of the inclusion).
Source: Anosov 1959, Autom. Remote Control 20, 135; Fridman & Levant 2002; Tsypkin 1984,
Relay Control Systems.
"""

from __future__ import annotations

import numpy as np
import sympy
from sympy import Expr

from filippov.analysis.algebra import linalg
from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.local import Local
from filippov.model.symbolic import lie_derivative

ANOSOV = "Anosov 1959, Autom. Remote Control 20, 135; Tsypkin 1984"
ON = "Fridman & Levant 2002"
CLEAR = 1e-9


def relay_order(found: Local) -> Certificate | None:
    """The verdict on a point on one relay of order 2 or more; None where first derivatives hold its sign."""
    if len(found.h) != 1 or found.kinds != ("switching",) or found.s is None or found.resets:
        return None
    plus, minus = (sympy.Matrix(found.fields[(k,)]) for k in (1, -1))
    s0 = found.s[0]
    if not bool(abs(s0) < 1):
        return None
    mean, push = (plus + minus) / 2, (plus - minus) / 2
    here = dict.fromkeys(found.x, sympy.S.Zero)
    if any(f.has(sympy.Pow) and f.atoms(sympy.Pow) - {q for q in f.atoms(sympy.Pow) if q.exp.is_Integer}
           for f in (*mean, *push)):  # fmt: skip
        return None
    h, order = found.h[0], 0
    rows: list[Expr] = []
    while True:
        rows.append(h)
        order += 1
        gain = sympy.simplify(lie_derivative(h, push, found.x))
        rest = sympy.expand(lie_derivative(h, mean, found.x))
        if gain != 0 or order == len(found.x):
            break
        h = rest
    if gain == 0 or order < 2:
        return None
    b = gain.subs(here)
    if not b.is_number or b == 0 or b.has(sympy.nan, sympy.zoo):
        return None
    head = f"h is smooth and the sign acts on its derivative of order {order} first: gain {float(b):.6g}"
    if order >= 3:
        return Certificate("unstable", f"a relay of order {order} is unstable", ANOSOV, (head,))
    if b > 0:
        return Certificate("unstable", "the relay pushes away from its surface", ANOSOV, (head,))
    total = rest + gain * s0
    slope = sympy.Matrix([total]).jacobian(found.x).subs(here)
    strength = push.subs(here)
    d = (slope * strength)[0] / b
    A = (mean + push * s0).jacobian(found.x).subs(here)
    sliding = A - strength * slope / b
    if not d.is_number or sliding.free_symbols:
        return None
    roots = _without_two(np.array(sliding.tolist(), dtype=float))
    told = [head, f"the energy of the switching changes at the rate d z^2, d = {float(d):.6g}"]
    if len(roots):
        told.append(f"roots of the field on h = h' = 0: real parts up to {max(roots.real):.6g}")
    if len(roots) and max(roots.real) > CLEAR:
        return Certificate("unstable", "solutions in h = h' = 0 lead away", ON, tuple(told))
    if float(d) > CLEAR:
        return Certificate("unstable", "the switching about h = h' = 0 grows", ANOSOV, tuple(told))
    if float(d) < -CLEAR and (not len(roots) or max(roots.real) < -CLEAR):
        text = "the switching about h = h' = 0 dies out, and solutions in it come to the point"
        return Certificate("asymptotically stable", text, ANOSOV, tuple(told))
    return None


def _without_two(matrix: np.ndarray) -> np.ndarray:
    """The roots but the two that belong to h and h', which are 0."""
    roots = linalg.eigvals(matrix)
    return np.asarray(roots[np.argsort(np.abs(roots))][2:])
