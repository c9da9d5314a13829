"""One relay or Coulomb friction beside a positive real linear plant: all motions come to the equilibria.

    x' = A x + f - b s,   s in Sgn(c . x + c0),   G(s) = c (s - A)^-1 b

With A Hurwitz, (A, b) controllable, (c, A) observable and Re G(i w) >= 0 for all w there is P > 0 with P
A + A^T P <= 0 and P b = c^T (Kalman, Yakubovich, Popov). Around any equilibrium e with the multiplier s_e
the function (x - e) . P (x - e)/2 changes by at most -(c . x + c0)(s - s_e) <= 0, so every equilibrium is
stable; around one with |s_e| < 1 it stays the same on h = 0 only. There the motion is that of the zeros
of G: if they lie on the left, but for one at 0 along a set, all motions come to the equilibria. Nothing
of P has to be computed.
Source: Yakubovich, Leonov, Gelig 2004, Stability of Stationary Sets in Control Systems with Discontinuous
Nonlinearities, chapter 3; Brogliato 2004, Systems Control Lett. 51, 343.
"""

from __future__ import annotations

import sympy
from sympy import Poly

from filippov.analysis.certificates.certificate import Certificate
from filippov.analysis.equilibrium import EquilibriumPoint, EquilibriumSet
from filippov.analysis.polynomial import Verdict, count_roots, exact
from filippov.analysis.stability_context import Context
from filippov.symbols import t as time

SOURCE = "Yakubovich, Leonov, Gelig 2004, chapter 3 (circle criterion for [0, oo), KYP lemma)"
LARGEST = 8
_S, _W = sympy.Symbol("s"), sympy.Symbol("w", real=True)


def passivity(context: Context, found: EquilibriumPoint | EquilibriumSet) -> Certificate | None:
    """The verdict on the point or segment on the one surface; None where G does not fit."""
    parts = _lure(context)
    if parts is None or found.mode.count("0") != 1:
        return None
    A, b, c = parts
    n = A.rows
    if isinstance(found, EquilibriumPoint) and not all(abs(s) < 1 - 1e-9 for s in found.s_value):
        return None
    if isinstance(found, EquilibriumSet) and found.bounds[0][0] >= found.bounds[0][1]:
        return None
    controls = sympy.Matrix.hstack(*[A**k * b for k in range(n)])
    sees = sympy.Matrix.vstack(*[c * A**k for k in range(n)])
    if controls.rank() < n or sees.rank() < n:
        return None
    below = A.charpoly(_S).as_expr()
    above = sympy.expand((c * (_S * sympy.eye(n) - A).adjugate() * b)[0])
    if not _hurwitz(below):
        return None
    # Re G(i w) has the sign of Re N(i w) D(-i w), a polynomial in w^2.
    product = sympy.expand(above.subs(_S, sympy.I * _W) * below.subs(_S, -sympy.I * _W))
    even = Poly(sympy.re(product), _W)
    if not _nowhere_negative(even):
        return None
    zeros = Poly(above, _S)
    at_zero = 0
    while zeros.eval(0) == 0:
        zeros, at_zero = zeros.quo(Poly(_S, _S)), at_zero + 1
    if at_zero > 1 or at_zero != found.dimension or not _hurwitz(zeros.as_expr()):
        return None
    checked = (
        "the field is linear but for one sign, constant in strength",
        "A is Hurwitz, (A, b) controllable, (c, A) observable (in exact numbers)",
        "Re G(i w) >= 0 for all w (no root of odd order of its numerator, Sturm's count)",
        "the zeros of G lie on the left" + (", but for one at 0 along the set" if at_zero else ""),
    )
    text = "a positive real plant and a monotone set-valued feedback: all motions come to the equilibria"
    return Certificate("asymptotically stable", text, SOURCE, checked, "global")


def _hurwitz(polynomial: sympy.Expr) -> bool:
    coefficients = Poly(polynomial, _S).all_coeffs()
    return len(coefficients) < 2 or count_roots(coefficients).verdict is Verdict.ASYMPTOTICALLY_STABLE


def _nowhere_negative(p: Poly) -> bool:
    """Whether a real polynomial is >= 0 everywhere, and not 0."""
    if p.is_zero or p.LC() < 0:
        return False
    _, factors = p.sqf_list()
    return all(factor.count_roots() == 0 for factor, order in factors if order % 2)


def _lure(context: Context) -> tuple[sympy.Matrix, sympy.Matrix, sympy.Matrix] | None:
    """(A, b, c) of a system that is linear but for the sign of one affine surface."""
    form, system = context.form, context.system
    if len(form.s) != 1 or len(form.x) > LARGEST or system.time_events:
        return None
    surface = system.surfaces[0]
    if surface.kind != "switching" or surface.width or form.radius[0] != (-1, 1):
        return None
    values = {**context.values, **context.put}
    field = sympy.Matrix([sympy.expand(exact(f.subs(values))) for f in form.field])
    h = sympy.expand(exact(form.h[0].subs(values)))
    others = (field.free_symbols - {*form.x, *form.s}) | (h.free_symbols - {*form.x})
    if others or field.has(time) or h.has(time):
        return None
    A, g = field.jacobian(form.x), field.jacobian(form.s)
    c = sympy.Matrix([h]).jacobian(form.x)
    if any(not e.is_Rational for part in (A, g, c) for e in part):
        return None
    return A, -g, c
