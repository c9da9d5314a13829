"""Planar fields that are continuous and linear in sectors at an equilibrium: the signs that decide.

In polar coordinates y' = A(phi) y becomes phi' = g(phi), r'/r = k(phi) with e = (cos phi, sin phi),
n = (-sin phi, cos phi), g = n . A e and k = e . A e; A is that of the sector of phi. Where g vanishes a ray
is invariant, and the sign of k on it decides; without such a ray solutions circle the origin, and the sign of
the integral of k/g over a turn decides. Terms of second order do not matter where no sign is 0.
Source: Filippov 1988; Carmona, Freire, Ponce, Torres 2002, IEEE Trans. Circuits Syst. I 49, 609.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from filippov.analysis.algebra import linalg
from filippov.base.arrays import Array

# Samples of a turn between which a sign change of g is looked for, and what counts as 0 of A's size.
SAMPLES, ZERO = 4096, 1e-7
# A ray is that of the set where the cosine of the angle between them is as near to 1.
NEAR = 1e-6


def planar_cone(matrix_at: Callable[[Array], Array], rest: Sequence[Array] = ()) -> bool | None:
    """Whether the origin of y' = A(y) y is asymptotically stable; None where first order does not decide.

    matrix_at   A, shape (2, 2), of the sector in which a direction lies
    rest        rays of equilibria from the origin: they are left out, and stability is that of the rays

    False means unstable: a ray leads away, or solutions that circle the origin grow.
    """
    phi = np.linspace(0.0, 2 * np.pi, SAMPLES + 1)
    directions = np.array([np.cos(phi), np.sin(phi)]).T
    images = np.array([matrix_at(e) @ e for e in directions])
    turn = directions[:, 0] * images[:, 1] - directions[:, 1] * images[:, 0]
    grow = np.sum(directions * images, axis=1)
    size = float(np.max(np.hypot(turn, grow)))
    if not (np.isfinite(size) and size > 0):
        return None
    own = _eigenvectors(directions, matrix_at)
    if not own and np.min(np.abs(turn)) > ZERO * size and (np.all(turn > 0) or np.all(turn < 0)):
        return _turns(phi, matrix_at)
    rays = own + [_ray(a, b, matrix_at) for a, b in _changes(phi, turn)]
    rays += [(directions[j], float(grow[j])) for j in np.flatnonzero(np.abs(turn) <= ZERO * size)]
    rates = [k for e, k in rays if all(e @ r < (1.0 - NEAR) * np.hypot(*r) for r in rest)]
    if not rates:
        return None
    if max(rates) > ZERO * size:
        return False
    return True if max(rates) < -ZERO * size else None


def _eigenvectors(
    directions: Array, matrix_at: Callable[[Array], Array]
) -> list[tuple[Array, float]]:
    """The rays along eigenvectors inside their sectors, with their roots: two may be closer than samples."""
    found: list[tuple[Array, float]] = []
    seen: list[Array] = []
    for A in (matrix_at(e) for e in directions[:-1]):
        if any(A is other or np.array_equal(A, other) for other in seen):
            continue
        seen.append(A)
        values, vectors = linalg.eig(A)
        for value, vector in zip(values, vectors.T, strict=True):
            if value.imag == 0.0:
                e = vector.real / np.hypot(*vector.real)
                found += [(k * e, float(value.real)) for k in (1, -1) if np.array_equal(matrix_at(k * e), A)]
    return found


def _changes(phi: Array, turn: Array) -> list[tuple[float, float]]:
    """The steps in which g changes its sign."""
    return [(float(phi[j]), float(phi[j + 1])) for j in np.flatnonzero(turn[:-1] * turn[1:] < 0)]


def _g(e: Array, matrix_at: Callable[[Array], Array]) -> float:
    y = matrix_at(e) @ e
    return float(e[0] * y[1] - e[1] * y[0])


def _unit(angle: float) -> Array:
    return np.array([np.cos(angle), np.sin(angle)])


def _ray(a: float, b: float, matrix_at: Callable[[Array], Array]) -> tuple[Array, float]:
    """The invariant ray between two angles, and k on it."""
    from scipy.optimize import brentq

    def turn(angle: float) -> float:
        return _g(_unit(angle), matrix_at)

    # On a border the side of an angle is rounding, so that the signs at the ends may agree here.
    inside = turn(a) * turn(b) < 0
    e = _unit(float(brentq(turn, a, b, xtol=1e-14)) if inside else min(a, b, key=lambda q: abs(turn(q))))
    return e, float(e @ matrix_at(e) @ e)


def _turns(phi: Array, matrix_at: Callable[[Array], Array]) -> bool | None:
    from scipy.integrate import quad

    def ratio(angle: float) -> float:
        e = _unit(angle)
        return float(e @ matrix_at(e) @ e) / _g(e, matrix_at)

    parts = [quad(ratio, a, b, limit=200)[0] for a, b in itertools.pairwise(phi[:: SAMPLES // 64])]
    growth = sum(parts) * (1.0 if _g(_unit(0.0), matrix_at) > 0 else -1.0)
    return None if abs(growth) <= ZERO else bool(growth < 0)
