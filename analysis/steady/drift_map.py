"""The homogeneous return map of a linearised inclusion to its rest set, followed in any dimension.

As in `filippov.analysis.steady.rest_map`: a segment of equilibria on one attracting surface, slip y' = A y
beyond an end of it, sliding y' = J y on h = c y = 0. On the surface J has the double root 0 with one null
direction d, the segment's; the others lie in the left half plane. With J e = d and the functional psi with
psi J = 0 and psi e = 1, every slide drifts along d at the rate psi y, which it keeps, while what is neither e
nor d decays.

A slow drift lasts long: it arrives at the end with nothing left but y = e + a d, where the rate of h in slip,
c A y, is 0. From there slip and sliding are followed by matrix exponentials, also where sliding is left again
soon, until a slide stays inside the segment or arrives at the end like the first. kappa is its psi y: the
next drift in units of the last, the slope of the map from one rest position to the next. In dimension 3 it is
that of `rest_map`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from filippov.analysis.algebra import linalg
from filippov.analysis.steady.rest_map import RestMap
from filippov.base.arrays import Array

# Roots below this part of the largest are 0: a double one is known to half the digits only.
NULL = 1e-6
# Steps in which a root is looked for, as parts of the shortest time of the matrix; how many of them at most.
PART, STEPS = 0.05, 100_000
# Exponent of what is as good as nothing.
FADED = -36.0
SLIPS = 200
GONE = 1e-9


@dataclass(frozen=True)
class _Drift:
    """Directions of the segment (outward) and of its drift, and the functional that measures the drift."""

    along: Array
    beside: Array
    psi: Array


def drift_map(slip: Array, slide: Array, normal: Array) -> RestMap | None:
    """The map at an end. None where sliding does not drift along a segment, or nothing is decided.

    slip    A (n, n), beyond the end; slide: J (n, n); normal: c (n,), slip has c y > 0
    """
    unit = linalg.balance(np.abs(slip) + np.abs(slide))
    slip, slide, normal = slip * unit / unit[:, None], slide * unit / unit[:, None], normal * unit
    rate = normal @ slip
    drift = _drift(slide, normal, rate)
    if drift is None:
        return None
    # The break-away: on the surface, psi y = 1, no rate.
    away = drift.beside - (rate @ drift.beside) / (rate @ drift.along) * drift.along
    y, elapsed = away, 0.0
    for _ in range(SLIPS):
        time = first_zero(slip, normal, y)
        if time is None:
            return None
        if math.isinf(time):
            return RestMap("leaves" if time > 0 else "converges", math.inf if time > 0 else 0.0, math.inf)
        y = linalg.expm(slip * time) @ y
        y -= normal * (normal @ y) / (normal @ normal)
        elapsed += time
        size = float(drift.psi @ y)
        if abs(size) > 1 / GONE:
            return RestMap("leaves", math.inf, math.inf)
        if np.max(np.abs(y)) < GONE:
            return RestMap("converges", 0.0, math.inf)
        time = first_zero(slide, -rate, y, drift)
        if time is None:
            return None
        if math.isinf(time):
            return RestMap("returns", size, elapsed)
        y = linalg.expm(slide * time) @ y
        if np.max(np.abs(y - size * away)) < GONE * np.max(np.abs(y)):
            return RestMap("returns", size, elapsed)
    return None


def _drift(slide: Array, normal: Array, rate: Array) -> _Drift | None:

    basis = linalg.null_space(normal[None, :])
    inner = basis.T @ slide @ basis
    roots = linalg.eigvals(inner)
    roots = roots[np.argsort(np.abs(roots))]
    scale = float(np.max(np.abs(inner)))
    if len(roots) < 2 or not scale > 0 or abs(roots[1]) > math.sqrt(NULL) * scale:
        return None
    if len(roots) > 2 and not np.max(roots[2:].real) < -NULL * scale:
        return None
    left, sizes, right = linalg.svd(inner)
    if sizes[-1] > NULL * scale or (len(sizes) > 1 and sizes[-2] <= NULL * scale):
        return None
    along, psi = right[-1], left[:, -1]
    beside = linalg.lstsq(inner, along, rcond=NULL)[0]
    weight = float(psi @ beside)
    if abs(psi @ along) > math.sqrt(NULL) or weight == 0.0:
        return None
    way = math.copysign(1.0, float(rate @ (basis @ along)))
    return _Drift(way * (basis @ along), way * (basis @ beside), way / weight * (basis @ psi))


def first_zero(matrix: Array, row: Array, y: Array, drift: _Drift | None = None) -> float | None:
    """The first t > 0 at which row exp(M t) y falls through 0, not counting t = 0.

    States are in units in which the matrix is balanced, whatever those of the system.

    -inf where the solution fades away before, inf where it grows without end or, for a slide, stays; None
    where neither is seen.
    """
    from scipy.optimize import brentq

    if drift is None:
        unit = linalg.balance(matrix)
        matrix, row, y = matrix * unit / unit[:, None], row * unit, y / unit
    roots = linalg.eigvals(matrix)
    # Of a nilpotent matrix the roots are rounding.
    slowest = 0.01 * float(np.max(np.abs(matrix)))
    start = float(np.max(np.abs(y)))
    state, time, step, left = y, 0.0, 0.0, len(roots) + 1
    for k in range(STEPS):
        # What has faded away no longer asks for short steps.
        alive = np.abs(roots[roots.real * time > FADED])
        if len(alive) < left:
            left, step = len(alive), PART / max(float(np.max(alive, initial=0.0)), slowest)
            forward = linalg.expm(matrix * step)
        after = forward @ state
        if row @ after < 0.0:
            if k == 0 and not row @ y > 0.0:
                return 0.0

            def height(u: float, x: Array = state) -> float:
                return float(row @ linalg.expm(matrix * u) @ x)

            return time + float(brentq(height, 0.0, step, xtol=1e-15 * step))
        state, time = after, time + step
        if drift is None:
            size = float(np.max(np.abs(state))) / start
            if size < GONE or size > 1 / GONE:
                return math.inf if size > 1 else -math.inf
        elif drift.psi @ state < 0 and k % 20 == 0 and _settled(state, drift):
            return math.inf
    return None


def _settled(state: Array, drift: _Drift) -> bool:
    """Whether nothing is left of a slide but its drift."""
    frame = np.column_stack([drift.along, drift.beside])
    left = state - frame @ linalg.lstsq(frame, state, rcond=None)[0]
    return bool(np.max(np.abs(left)) < GONE * np.max(np.abs(state)))
