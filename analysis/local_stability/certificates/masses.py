"""Any number of masses with linear springs, dampers and dry friction: all solutions come to rest, or not.

    q' = v,   M v' = -K q - C v + f - sum k_i c_i^T s_i,   s_i in Sgn(c_i . v)

with M diagonal, K symmetric, C symmetric and positive semidefinite, k_i > 0. For K positive definite the
energy around ANY equilibrium e, v.Mv/2 + (q - e).K(q - e)/2, does not grow, because each friction force
minus the one that holds e has a power that is not positive: every equilibrium is stable. So it is for K
positive semidefinite if friction outdoes the load f along every d != 0 with K d = 0, sum k_i |c_i.d| > f.d:
the power lost to friction less that of the load is convex and homogeneous in v, so what is lost over a time
is at least its value at the whole way q - e, and the energy bounds that way. By LaSalle's
principle solutions tend to those that lose nothing: c_i . v = 0 and C v = 0 forever. On N = ker(c_1, c_2,
...) these obey N'MN w'' = -N'KN w with C N w' = 0, so all solutions come to rest if and only if that pair
is observable; else one swings forever beside the point where no friction is needed. If K has a root
below 0, lambda > 0 with (lambda^2 M + lambda C + K) d = 0 leads away from the end of the set at which all
contacts slip along d. Without springs the speed falls at a rate > 0.
Source: Leine & van de Wouw 2008; Shevitz & Paden 1994.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import sympy
from sympy import Expr

from filippov.analysis.algebra import linalg
from filippov.analysis.algebra.polynomial import exact
from filippov.analysis.local_stability.certificates.certificate import Certificate
from filippov.analysis.local_stability.certificates.impacts import keep_energy, locally, resetting
from filippov.analysis.local_stability.stability_context import Context
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet
from filippov.model.symbols import t as time

SOURCE = "Leine & van de Wouw 2008; Shevitz & Paden 1994"

_EVERY = "every equilibrium is stable by the energy around it"


@dataclass(frozen=True)
class Masses:
    """The matrices of the masses, in exact numbers; contacts has one row c_i each, friction the k_i.

    places, speeds   the states q and v
    """

    mass: sympy.Matrix
    stiffness: sympy.Matrix
    damping: sympy.Matrix
    force: sympy.Matrix
    contacts: sympy.Matrix
    friction: tuple[Expr, ...]
    surfaces: tuple[int, ...]
    places: tuple[Expr, ...]
    speeds: tuple[Expr, ...]


def masses(context: Context, found: EquilibriumPoint | EquilibriumSet) -> Certificate | None:
    """The verdict on the set of all equilibria to which this one belongs; None for other systems."""
    parts = of_system(context)
    if parts is None or not parts.surfaces:
        return None
    alone = partial(_without_walls, parts, found)
    if not resetting(context) or not keep_energy(context, parts.mass, parts.places, parts.speeds):
        return locally(context, found, alone)
    certificate = alone()
    if certificate is None or certificate.answer == "unstable":
        return locally(context, found, lambda: certificate)
    # With impacts what swings without slip may be led to slip, or be kept from what the dampers see.
    if not parts.stiffness.is_zero_matrix and parts.contacts.nullspace():
        near = locally(context, found, lambda: certificate)
        return near or replace(certificate, answer="stable", theorem=_EVERY, reach="local")
    text = "resets keep the places of the masses and raise no kinetic energy"
    return replace(certificate, checked=(*certificate.checked, text))


def _without_walls(parts: Masses, found: EquilibriumPoint | EquilibriumSet) -> Certificate | None:
    """The verdict on the masses without what resets them."""
    M, K, C = parts.mass, parts.stiffness, parts.damping
    if not C.is_positive_semidefinite:
        return None
    m = M.rows
    said = [
        f"{m} masses, {len(parts.surfaces)} contacts with Coulomb friction, springs and dampers are linear",
        "the matrix of the dampers is symmetric and positive semidefinite",
    ]
    if K.is_zero_matrix:
        return _free(parts, said)
    if K.is_positive_definite:
        text = (
            "the matrix of the springs is symmetric and positive definite (leading minors in exact numbers)"
        )
        return _held(parts, [*said, text])
    loose = K.nullspace()
    if loose and K.is_positive_semidefinite and (load := _outdone(parts, loose)):
        n = len(loose)
        freely = f"{n} way{'s' * (n > 1)} in which no spring is stretched"
        text = f"the matrix of the springs is symmetric and positive semidefinite, with {freely}; {load}"
        return _held(parts, [*said, text])
    if K.det() != 0 and all(found.mode[i] == "0" for i in parts.surfaces):
        return _buckled(parts, said)
    return None


def _held(parts: Masses, said: list[str]) -> Certificate:
    M, K, C = parts.mass, parts.stiffness, parts.damping
    slipping = parts.contacts.nullspace()
    every = _EVERY
    if slipping:
        N = sympy.Matrix.hstack(*slipping)
        A = (N.T * M * N).inv() * (N.T * K * N)
        rows = sympy.Matrix.vstack(*[C * N * A**k for k in range(N.cols)])
        rank = rows.rank()
        said.append(
            f"solutions without slip have {N.cols} degrees of freedom, of which {rank} are seen by the "
            "dampers"
        )
        if rank < N.cols:
            text = f"{every}; where all contacts hold, {N.cols - rank} degrees of freedom swing forever"
            return Certificate("stable", text, SOURCE, tuple(said))
    else:
        said.append("no solution is without slip in some contact")
    text = f"{every}, and the energy falls on all solutions but the equilibria"
    return Certificate("asymptotically stable", text, SOURCE, tuple(said), "global")


def _outdone(parts: Masses, loose: Sequence[sympy.Matrix]) -> str:
    """That friction outdoes the load wherever no spring is stretched; "" where it may not."""
    N = sympy.Matrix.hstack(*loose)
    if (parts.contacts * N).rank() < N.cols:
        return ""
    loads = N.T * parts.force
    if loads.is_zero_matrix:
        return "no load acts along these and a contact slips along each"
    if N.cols > 1:
        return ""
    held = sum(k * abs(c) for k, c in zip(parts.friction, parts.contacts * N, strict=True))
    return "friction outdoes the load along it" if bool(abs(loads[0]) < held) else ""


def _free(parts: Masses, said: list[str]) -> Certificate | None:
    """No springs: the friction needed to balance the force is unique and below its limit."""
    c = parts.contacts
    if c.rows != c.cols or c.det() == 0:
        return None
    loads = (c.T.inv() * parts.force).tolist()
    shares = [abs(load[0] / k) for load, k in zip(loads, parts.friction, strict=True)]
    if any(not bool(share < 1) for share in shares):
        return None
    largest = max(float(share) for share in shares)
    said += [
        "no springs",
        f"friction bears the loads with at most {largest:.6g} of its limit, every contact slips",
    ]
    text = "every equilibrium is stable, and the speed falls at a rate above 0 until it is 0"
    return Certificate("asymptotically stable", text, SOURCE, tuple(said), "global")


def _buckled(parts: Masses, said: list[str]) -> Certificate | None:
    M, K, C = (np.array(q.tolist(), dtype=float) for q in (parts.mass, parts.stiffness, parts.damping))
    m = len(M)
    block = np.block([[np.zeros((m, m)), np.eye(m)], [-linalg.solve(M, K), -linalg.solve(M, C)]])
    values = linalg.eigvals(block)
    real = [q.real for q in values if abs(q.imag) < 1e-9 and q.real > 1e-6]
    if not real:
        return None
    said.append(f"the springs push apart: root {max(real):.6g} of lambda^2 M + lambda C + K")
    text = "from the end of the set at which contacts slip along this root's direction solutions lead away"
    return Certificate("unstable", text, SOURCE, tuple(said))


def of_system(context: Context) -> Masses | None:
    """The matrices, or None where the system is not of this form."""
    form = context.form
    values = {**context.values, **context.put}
    pairs, speeds = [], set()
    field = [sympy.expand(exact(f.subs(values))) for f in form.field]
    for i, f in enumerate(field):
        if f in form.x and f != form.x[i]:
            pairs.append((i, form.x.index(f)))
            speeds.add(form.x.index(f))
    if len(pairs) != len(speeds) or 2 * len(pairs) != len(form.x) or speeds & {i for i, _ in pairs}:
        return None
    rows = [field[j] for _, j in pairs]
    if any(f.has(time) or f.free_symbols - {*form.x, *form.s} for f in rows):
        return None
    q, v = [form.x[i] for i, _ in pairs], [form.x[j] for _, j in pairs]
    used = [i for i, s in enumerate(form.s) if any(f.has(s) for f in rows)]
    s = [form.s[i] for i in used]
    A, B, G = (sympy.Matrix(rows).jacobian(by) if by else sympy.zeros(len(q), 0) for by in (q, v, s))
    if any(part.free_symbols for part in (A, B, G)):
        return None
    rest = sympy.Matrix([f.subs(dict.fromkeys([*form.x, *form.s], 0)) for f in rows])
    contacts = []
    for i in used:
        h, surface = sympy.expand(exact(form.h[i].subs(values))), context.system.surfaces[i]
        row = sympy.Matrix([[h.diff(e) for e in v]])
        if surface.kind != "switching" or surface.width or row.free_symbols or form.radius[i] != (-1, 1):
            return None
        if sympy.expand(h - (row * sympy.Matrix(v))[0]) != 0:
            return None
        contacts.append(row)
    c = sympy.Matrix.vstack(*contacts) if contacts else sympy.zeros(0, len(q))
    weights = _weights((A, B), G, c)
    if weights is None:
        return None
    M = sympy.diag(*weights)
    K, C, pushes = -M * A, -M * B, -M * G
    friction = []
    for k in range(c.rows):
        at = next((j for j in range(c.cols) if c[k, j] != 0), None)
        if at is None:
            return None
        scale = pushes[at, k] / c[k, at]
        if not bool(scale > 0) or not (pushes[:, k] - scale * c[k, :].T).is_zero_matrix:
            return None
        friction.append(scale)
    if not (K - K.T).is_zero_matrix or not (C - C.T).is_zero_matrix:
        return None
    return Masses(M, K, C, M * rest, c, tuple(friction), tuple(used), tuple(q), tuple(v))


def _weights(coupled: Sequence[sympy.Matrix], G: sympy.Matrix, c: sympy.Matrix) -> list[Expr] | None:
    """Masses that make -M A symmetric for each A and -M G a multiple of c^T; checked by the caller."""
    m = c.cols
    ratio: dict[tuple[int, int], Expr] = {}
    for A, i, j in itertools.product(coupled, range(m), range(m)):
        if i != j and A[i, j] != 0 and A[j, i] != 0:
            ratio[i, j] = A[i, j] / A[j, i]  # m_j = ratio m_i
    for k in range(c.rows):
        held = [j for j in range(m) if c[k, j] != 0 and G[j, k] != 0]
        for i in held:
            for j in held:
                if i != j:
                    ratio[i, j] = (G[i, k] / c[k, i]) / (G[j, k] / c[k, j])
    weights: dict[int, Expr] = {}
    for root in range(m):
        if root in weights:
            continue
        weights[root], queue = sympy.S.One, [root]
        while queue:
            i = queue.pop()
            for (a, j), r in ratio.items():
                if a == i and j not in weights:
                    if not bool(r > 0):
                        return None
                    weights[j] = weights[i] * r
                    queue.append(j)
    return [weights[i] for i in range(m)]
