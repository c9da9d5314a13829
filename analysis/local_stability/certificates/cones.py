"""Equilibria on kinks in any dimension, where x' = A_i x in cones: what holds for all A_i together.

Metzler majorant: with B_jj = max a_jj, B_jk = max |a_jk|, max_j |x_j|/w_j falls if B w < 0 for some w >
0, that is if -B is an M-matrix. Two matrices that differ by rank one have a common quadratic Lyapunov
function if and only if both are Hurwitz and A_1 A_2 has no root on the negative half line (which for one
kink is the circle criterion). A ray that comes back to itself longer than it was makes the point
unstable.
Source: Dahlquist 1958 and Horn & Johnson 1991 (majorant); Shorten & Narendra 2003, IEEE
Trans. Automat. Contr. 48, 618, and Shorten, Mason, O'Cairbre, Curran 2004, Int. J. Control 77, 1 (two
matrices); Carmona, Freire, Ponce, Torres 2005, Internat. J. Bifur. Chaos 15, 2469 (rays).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import sympy

from filippov.analysis.algebra import linalg
from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.local import Local
from filippov.base.arrays import Array

MAJORANT = "Horn & Johnson 1991; Coppel 1965"
COMMON = "Shorten & Narendra 2003, IEEE Trans. Automat. Contr. 48, 618"
RAYS = "Carmona, Freire, Ponce, Torres 2005, Internat. J. Bifur. Chaos 15, 2469"
STARTS, HALF_TURNS, LONGEST, CLEAR = 24, 60, 200.0, 1e-6


def cones(found: Local) -> Certificate | None:
    """The verdict on a point on kinks alone, dimension 2 and up; None where none of the tests decides."""
    if not found.h or set(found.kinds) != {"kink"} or found.resets or len(found.x) < 2:
        return None
    here = dict.fromkeys(found.x, sympy.S.Zero)
    matrices = []
    for field in found.fields.values():
        A = sympy.Matrix(field).jacobian(found.x).subs(here)
        if A.free_symbols or A.has(sympy.nan, sympy.zoo, sympy.oo):
            return None
        if A not in matrices:
            matrices.append(A)
    told = f"{len(matrices)} linear parts meet at the point"
    if _majorant(matrices):
        text = "a weighted largest modulus of the states falls on every side"
        return Certificate(
            "asymptotically stable", text, MAJORANT,
            (told, "minus the majorant of the linear parts is an M-matrix (leading minors in exact numbers)"),
        )  # fmt: skip
    if len(matrices) <= 2 and _common(matrices):
        text = "the sides have a common quadratic Lyapunov function"
        return Certificate(
            "asymptotically stable", text, COMMON,
            (told, "they differ by rank one and are Hurwitz", "A_1 A_2 has no root below 0 (Sturm's count)"),
        )  # fmt: skip
    if len(found.h) == 1:
        return _ray(found, told)
    return None


def _majorant(matrices: Sequence[sympy.Matrix]) -> bool:
    n = matrices[0].rows
    B = sympy.Matrix(n, n, lambda i, j: sympy.Max(*(A[i, i] if i == j else abs(A[i, j]) for A in matrices)))
    return all(bool((-B[:k, :k]).det() > 0) for k in range(1, n + 1))


def _common(matrices: Sequence[sympy.Matrix]) -> bool:
    first, last = matrices[0], matrices[-1]
    if (first - last).rank() > 1:
        return False
    for A in (first, last):
        if max(linalg.eigvals(np.array(A.tolist(), dtype=float)).real) > -1e-9:
            return False
    s = sympy.Dummy("s")
    try:
        p = sympy.Poly((first * last).charpoly(s).as_expr(), s)
        return bool(p.count_roots(-sympy.oo, 0) == 0)
    except (NotImplementedError, sympy.PolynomialError):
        return False


def _ray(found: Local, told: str) -> Certificate | None:
    """A ray on the kink that two half turns bring back longer."""
    here = dict.fromkeys(found.x, sympy.S.Zero)
    c = np.array([float(found.h[0].diff(x).subs(here)) for x in found.x])
    A = {
        k: np.array(sympy.Matrix(found.fields[(k,)]).jacobian(found.x).subs(here).tolist(), dtype=float)
        for k in (1, -1)
    }
    rng = np.random.default_rng(0)
    for _ in range(STARTS):
        x, signs = rng.standard_normal(len(c)), []
        x -= c * (c @ x) / (c @ c)
        times: list[float] = []
        for _ in range(HALF_TURNS):
            side = 1 if c @ A[1] @ x > 0 else -1
            span = _passage(A[side], c, x, side)
            if span is None:
                break
            x = linalg.expm(A[side] * span) @ x
            x = x / np.linalg.norm(x)
            times.append(span)
            signs.append(side)
        else:
            growth = _closed(A, c, x, signs[-2:])
            if growth is not None and growth > 1 + CLEAR:
                return Certificate(
                    "unstable", "a ray on the kink comes back longer after two half turns", RAYS,
                    (told, f"it is multiplied by {growth:.6g} (matrix exponentials)"),
                )  # fmt: skip
    return None


def _passage(A: Array, c: Array, x: Array, side: int) -> float | None:
    """The time until c . x = 0 again on one side; None where it does not come."""
    from scipy.optimize import brentq

    size = float(np.linalg.norm(A))
    step = 0.05 / size
    E, y, now = linalg.expm(A * step), x.copy(), 0.0
    for j in range(int(LONGEST / 0.05)):
        z = E @ y
        if side * (c @ z) <= 0 and j > 0:
            return now + float(brentq(lambda q, y=y: c @ linalg.expm(A * q) @ y, 0.0, step, xtol=1e-14))
        y, now = z, now + step
    return None


def _closed(A: dict[int, Array], c: Array, x: Array, signs: list[int]) -> float | None:
    """The factor of two half turns on a ray that they map to itself; None where the ray is not kept."""
    start = x / np.linalg.norm(x)
    y = start
    for _ in itertools.repeat(None, 2):
        side = 1 if c @ A[1] @ y > 0 else -1
        span = _passage(A[side], c, y, side)
        if span is None:
            return None
        y = linalg.expm(A[side] * span) @ y
    del signs
    length = float(np.linalg.norm(y))
    return length if np.linalg.norm(y / length - start) < 1e-8 else None
