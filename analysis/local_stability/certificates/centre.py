"""Smooth equilibria with roots on the imaginary axis: the centre manifold and the first Lyapunov coefficient.

One root 0, the others on the left: on the centre manifold y = c(u), found as a power series, u' = a u^k +
...; stable if and only if k is odd and a < 0. One pair +-i w, the others on the left:

    l1 = Re[ <p, C(q, q, q')> - 2 <p, B(q, A^-1 B(q, q'))> + <p, B(q', (2 i w - A)^-1 B(q, q))> ] / (2 w)

with A q = i w q, A^T p = -i w p, <p, q> = 1, B and C the second and third derivatives, ' the conjugate.
l1 < 0: asymptotically stable, l1 > 0: unstable.
Source: Carr 1981; Kuznetsov 2004, Elements of Applied Bifurcation Theory.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import sympy
from sympy import Expr, Symbol

from filippov.analysis.algebra import linalg
from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.local import Local
from filippov.base.arrays import Complex

CARR = "Carr 1981"
HOPF = "Kuznetsov 2004"
HIGHEST, LARGEST, CLEAR = 7, 6, 1e-9
_U = sympy.Dummy("u", real=True)


def centre(found: Local) -> Certificate | None:
    """The verdict on a smooth point with a root 0 or an imaginary pair; None for more roots on the axis."""
    if found.resets:
        return None
    field = found.smooth()
    if field is None or not 2 <= len(found.x) <= LARGEST:
        return None
    here = dict.fromkeys(found.x, sympy.S.Zero)
    A = sympy.Matrix(field).jacobian(found.x).subs(here)
    if A.has(sympy.nan, sympy.zoo, sympy.oo):
        return None
    roots = linalg.eigvals(np.array(A.tolist(), dtype=float))
    size = max(1.0, float(np.max(np.abs(roots))))
    axis = roots[np.abs(roots.real) < 1e-7 * size]
    if np.any(roots.real > 1e-7 * size) or np.any((roots.real < 0) & (roots.real > -1e-5 * size)
                                                  & (np.abs(roots.real) >= 1e-7 * size)):  # fmt: skip
        return None
    if len(axis) == 1 and A.det() == 0:
        return _zero(found.x, field, A)
    if len(axis) == 2 and abs(axis[0].imag) > 1e-4 * size and _imaginary(A):
        return _pair(found.x, field, A, float(abs(axis[0].imag)))
    return None


def _imaginary(A: sympy.Matrix) -> bool:
    """Whether p(s) and p(-s) have a common root, in exact numbers."""
    s = sympy.Dummy("s")
    p = A.charpoly(s).as_expr()
    return bool(
        sympy.resultant(sympy.expand((p + p.subs(s, -s)) / 2), sympy.expand((p - p.subs(s, -s)) / 2), s) == 0
    )


def taylor(field: Sequence[Expr], x: Sequence[Symbol], order: int) -> tuple[Expr, ...] | None:
    """The field up to an order in x; itself where it is a polynomial."""
    if all(f.is_polynomial(*x) for f in field):
        return tuple(field)
    e, out = sympy.Dummy("e"), []
    put = {q: e * q for q in x}
    for f in field:
        g, total, factor = f.xreplace(put), sympy.S.Zero, sympy.S.One
        for k in range(order + 1):
            value = g.subs(e, 0)
            if value.has(sympy.nan, sympy.zoo, sympy.oo):
                return None
            total += value / factor
            g, factor = g.diff(e), factor * (k + 1)
        out.append(sympy.expand(total))
    return tuple(out)


def _zero(x: Sequence[Symbol], field: Sequence[Expr], A: sympy.Matrix) -> Certificate | None:
    n = len(x)
    (right,), (left,) = A.nullspace(), A.T.nullspace()
    across = (left.T * right)[0]
    if across == 0:
        return None
    # x = u right + W y with the columns of W spanning left^perp: left . x = u (left . right).
    W = sympy.Matrix.hstack(*left.T.nullspace())
    T = sympy.Matrix.hstack(right, W)
    inverse = T.inv()
    expanded = taylor(field, x, HIGHEST)
    if expanded is None:
        return None
    manifold = sympy.zeros(n - 1, 1)
    block = (inverse * A * T)[1:, 1:]
    # The series order by order: A_y c_k = c'(u) u' - (what y' holds besides), each side known up to order k.
    for order in range(2, HIGHEST + 1):
        moved = _moved(x, expanded, T, inverse, manifold, order)
        rate, rest = moved[0], sympy.Matrix(moved[1:])
        residual = (manifold.diff(_U) * rate - rest).applyfunc(sympy.expand)
        coefficients = residual.applyfunc(lambda e, k=order: e.coeff(_U, k))
        manifold += block.inv() * coefficients * _U**order
        rate = _moved(x, expanded, T, inverse, manifold, order)[0]
        a = sympy.expand(rate).coeff(_U, order)
        if sympy.simplify(a) != 0:
            return _by_power(order, sympy.nsimplify(a) if a.is_Float else a)
    return None


def _moved(
    x: Sequence[Symbol], field: Sequence[Expr], T: sympy.Matrix, inverse: sympy.Matrix,
    manifold: sympy.Matrix,
    order: int,
) -> list[Expr]:  # fmt: skip
    """(u', y') on y = c(u), up to an order in u."""
    place = T * sympy.Matrix([_U, *manifold])
    put = dict(zip(x, place, strict=True))
    values = [_cut(sympy.expand(f.subs(put, simultaneous=True)), order) for f in field]
    return [sympy.expand(e) for e in inverse * sympy.Matrix(values)]


def _cut(e: Expr, order: int) -> Expr:
    if not e.has(_U):
        return e
    return sympy.Add(*(c * _U ** m[0] for m, c in sympy.Poly(e, _U).terms() if m[0] <= order))


def _by_power(order: int, a: Expr) -> Certificate:
    told = (
        "one root is 0, all others lie in the left half plane",
        f"on the centre manifold u' = a u**{order} + ..., a = {float(a):.6g}",
    )
    if order % 2 and a < 0:
        return Certificate(
            "asymptotically stable", "the solution on the centre manifold comes to it", CARR, told
        )
    return Certificate("unstable", "the solution on the centre manifold leaves it", CARR, told)


def _pair(x: Sequence[Symbol], field: Sequence[Expr], A: sympy.Matrix, w: float) -> Certificate | None:
    a = np.array(A.tolist(), dtype=float)
    n, here = len(x), dict.fromkeys(x, sympy.S.Zero)
    second = np.zeros((n, n, n))
    third = np.zeros((n, n, n, n))
    for i, f in enumerate(field):
        for j, k in itertools.combinations_with_replacement(range(n), 2):
            g = f.diff(x[j], x[k])
            value = g.subs(here)
            if not value.is_number or value.has(sympy.nan, sympy.zoo):
                return None
            second[i, j, k] = second[i, k, j] = float(value)
            for m in range(k, n):
                value = g.diff(x[m]).subs(here)
                if not value.is_number or value.has(sympy.nan, sympy.zoo):
                    return None
                for order in itertools.permutations((j, k, m)):
                    third[(i, *order)] = float(value)
    coefficient = lyapunov_coefficient(a, second, third, w)
    scale = float(np.max(np.abs(third))) + float(np.max(np.abs(second))) ** 2
    if abs(coefficient) <= CLEAR * scale:
        return None
    told = (
        f"one pair of roots +-{w:.6g} i on the imaginary axis, all others lie in the left half plane",
        f"first Lyapunov coefficient {coefficient:.6g} {'<' if coefficient < 0 else '>'} 0",
    )
    if coefficient < 0:
        return Certificate("asymptotically stable", "a weak focus: third-order terms draw in", HOPF, told)
    return Certificate("unstable", "a weak focus: third-order terms drive away", HOPF, told)


def lyapunov_coefficient(
    a: npt.NDArray[np.float64], second: npt.NDArray[np.float64], third: npt.NDArray[np.float64], w: float
) -> float:
    """l1 of x' = a x + B(x, x)/2 + C(x, x, x)/6, of shapes (n, n), (n, n, n), (n, n, n, n), at +-i w."""

    def B(u: Any, v: Any) -> Complex:
        return np.asarray(np.einsum("ijk,j,k->i", second, u, v))

    values, vectors = linalg.eig(a)
    q = vectors[:, int(np.argmin(np.abs(values - 1j * w)))]
    q = q / np.linalg.norm(q)
    values, vectors = linalg.eig(a.T)
    p = vectors[:, int(np.argmin(np.abs(values + 1j * w)))]
    p = p / np.conj(np.vdot(p, q))
    back = np.conj(q)
    eye = np.eye(len(a))
    total = np.einsum("ijkl,j,k,l->i", third, q, q, back)
    total = total - 2 * B(q, linalg.solve(a, B(q, back)))
    total = total + B(back, linalg.solve(2j * w * eye - a, B(q, q)))
    return float(np.real(np.vdot(p, total)) / (2 * w))
