"""Two folds that meet in the plane, both invisible: the solution turns, by a half return on either side.

With u along the surface and w = h, u' = a + a1 u + a2 w + ... and w' = b u + c w + d u^2 + ..., a solution
that leaves w = 0 at u comes back at -u + k u^2 + O(u^3), k = 2/3 ((a1 + c)/a - d/b). One turn leads from u
to u + (k- - k+) u^2 + O(u^3).
Source: Filippov 1988, section 19; Kuznetsov, Rinaldi & Gragnani 2003, Int. J. Bifurcation Chaos 13, 2157.
"""

from __future__ import annotations

import sympy
from sympy import Expr

from filippov.analysis.algebra.polynomial import sign_of_number
from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.local import Local

SOURCE = "Filippov 1988, section 19; Kuznetsov, Rinaldi & Gragnani 2003, Int. J. Bifurcation Chaos 13, 2157"


def half_returns(found: Local) -> Certificate | None:
    """The verdict on two invisible folds that meet in the plane; None where this order does not tell."""
    if len(found.x) != 2 or found.kinds != ("switching",) or found.resets:
        return None
    sides = [_half_return(found, sign) for sign in (1, -1)]
    if sides[0] is None or sides[1] is None:
        return None
    (up, above), (down, below) = sides[0], sides[1]
    change = sympy.simplify(below - above)
    if sign_of_number(up) * sign_of_number(down) >= 0 or change.is_zero:
        return None
    inwards = sign_of_number(change) * sign_of_number(up) > 0
    halves = f"{above}, where it is < 0 with k = {below}"
    checked = (
        f"where {found.names[0]} > 0 half a turn leads from u to -u + k u**2 with k = {halves}",
        f"a turn leads from u to u + ({change}) u**2, with u' = {up} at the point where {found.names[0]} > 0",
    )
    head = "two invisible folds meet, and turns"
    if inwards:
        return Certificate("asymptotically stable", f"{head} shorten", SOURCE, checked)
    return Certificate("unstable", f"{head} lengthen", SOURCE, checked)


def _half_return(found: Local, sign: int) -> tuple[Expr, Expr] | None:
    """u' at the point and the coefficient k on one side; None where its fold is not invisible."""
    x, (h,) = sympy.Matrix(found.x), found.h
    origin = dict.fromkeys(found.x, 0)
    slopes = sympy.Matrix([h]).jacobian(x)
    normal = slopes.subs(origin)
    if not all(e.is_finite and e.is_real for e in normal) or not any(normal):
        return None
    along = sympy.Matrix([[-normal[1], normal[0]]])
    field = sympy.Matrix(found.fields[(sign,)])
    to_states = along.col_join(slopes).inv()
    f, g = (along * field)[0], (slopes * field)[0]

    def derivative(e: Expr, k: int) -> Expr:
        """With respect to u or to w."""
        return (sympy.Matrix([e]).jacobian(x) * to_states[:, k])[0]

    def at(e: Expr) -> Expr:
        return sympy.simplify(e.subs(origin))

    bend = derivative(g, 0)
    a, rate, b = at(f), at(g), at(bend)
    rest = [at(e) for e in (derivative(f, 0), derivative(g, 1), derivative(bend, 0) / 2)]
    if not all(e.is_number and e.is_finite and e.is_real for e in (a, rate, b, *rest)):
        return None
    if not rate.is_zero or sign_of_number(a * b) * sign >= 0:
        return None
    a1, c, d = rest
    return a, sympy.simplify(sympy.Rational(2, 3) * ((a1 + c) / a - d / b))
