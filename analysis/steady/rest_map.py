"""The homogeneous return map of a linearised inclusion to its rest set, from the slip polynomial alone.

Let a segment of equilibria lie on one attracting surface h = 0, and let the slip field on the side of an
end vanish at that end. From the end, slip obeys y' = A y, and sliding y' = J y with J = (1 - g c/(c g)) A.

n = 3, J nilpotent on h = 0 (every slide drifts along the segment): a functional psi with psi J = 0 on h = 0
and psi g = 0 is kept by sliding and obeys psi' = nu h in slip. Slip starts where h = h' = 0, so y =
psi(t)/psi(0) solves

    y''' + a2 y'' + a1 y' + a0 y = 0,  y(0) = 1, y'(0) = y''(0) = 0    (s^3 + a2 s^2 + a1 s + a0 = det(s - A))

until y' = 0 again at T > 0, where sliding takes over. kappa = y(T) is the slope at the end of the map from
one rest position to the next. kappa < 0: the next slide goes to the other end. So the set is attractive if
|kappa| < 1 (for two different ends: if the product is below 1) and repels if it is above.

Routh-Hurwitz is sufficient: with r = a0/a2 <= a1 and w = y'' + r y, w' + a2 w = -(a1 - r) y' >= 0 while y'
< 0, so w > 0 and (y'^2 + r y^2)' = 2 y' w < 0, hence |y(T)| < 1. It is not necessary.

n = 2: the whole surface near the segment is at rest while |s| is within its bounds, y'' + a1 y' + a0 y = 0
starts at y = 1, y' = 0 beyond an end and comes to rest inside the segment after half a turn if the roots
are complex.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from filippov.analysis.algebra import linalg
from filippov.analysis.algebra.growth import by_eigenvalues
from filippov.base.errors import UsageError
from filippov.base.keywords import keywords

LEAVES = 2.0


@dataclass(frozen=True)
class RestMap:
    """After break-away at an end, slip returns with slope kappa, converges to the end, or leaves; undecided
    where that hangs on a root that is 0 to rounding.

    duration   of the slip in the linear system, inf where it does not return
    """

    outcome: Literal["returns", "converges", "leaves", "undecided"]
    kappa: float
    duration: float


_STILL = {
    "stable": RestMap("converges", 0.0, math.inf),
    "unstable": RestMap("leaves", math.inf, math.inf),
    "undecided": RestMap("undecided", math.nan, math.inf),
}


@keywords()
def rest_map(polynomial: Sequence[float]) -> RestMap:
    """Return the map of a slip polynomial of degree 2 or 3, highest coefficient first."""
    if len(polynomial) not in (3, 4) or not polynomial[0]:
        raise UsageError(f"polynomial is {polynomial}, expected 3 or 4 coefficients, the first not 0.")
    a = np.array(polynomial, dtype=float) / float(polynomial[0])
    roots = linalg.roots(a)
    turning = roots[np.abs(roots.imag) > 1e-12 * (1.0 + np.abs(roots))]
    real = [r.real for r in roots if not np.any(r == turning)]
    still = _STILL[by_eigenvalues(roots)]
    if not len(turning):
        return still
    sigma, omega = float(turning[0].real), abs(float(turning[0].imag))
    if not real:
        return RestMap("returns", -math.exp(sigma * math.pi / omega), math.pi / omega)
    mu = real[0] - sigma
    if mu >= 0:  # 1 - exp(-mu t) (cos wt + (mu/w) sin wt) > 0 for all t > 0
        return still
    duration = _first_return(mu, omega)
    return RestMap("returns", _position(a, duration), duration)


def _first_return(mu: float, omega: float) -> float:
    """The first t > 0 with exp(mu t) = cos wt + (mu/w) sin wt, mu < 0: one, in (pi, 2 pi)/w."""
    from scipy.optimize import brentq

    def g(t: float) -> float:
        return math.exp(mu * t) - math.cos(omega * t) - mu / omega * math.sin(omega * t)

    return float(brentq(g, math.pi / omega, 2 * math.pi / omega, xtol=1e-15 / omega, rtol=8.9e-16))


def _position(a: Sequence[float] | np.ndarray, t: float) -> float:
    """y(t) of the third-order equation."""
    companion = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-a[3], -a[2], -a[1]]])
    return float(linalg.expm(companion * t)[0, 0])


@keywords()
def growth(maps: Sequence[RestMap]) -> float:
    """Size of the factor from one rest position to the next, over one passage of the ends: < 1 is attractive.

    maps   one for each end, or one that stands for both. 0 where the solution stays at an end that attracts,
           NaN where one is undecided and none leaves
    """
    if not maps:
        raise UsageError("maps is empty, expected one for each end, or one that stands for both.")
    if any(m.outcome == "leaves" or m.kappa >= 1 for m in maps):
        return LEAVES
    if any(m.outcome == "undecided" for m in maps):
        return math.nan
    if any(m.kappa >= 0 for m in maps):
        return 0.0
    return float(math.prod(-m.kappa for m in maps) ** (1 / len(maps)))


def threshold(
    measure: Callable[[float], float], low: float, high: float, points: int = 200
) -> tuple[float, ...]:
    """Return where the measure passes 1 in (low, high), both positive, between the points of a scan."""
    from scipy.optimize import brentq

    grid = np.geomspace(low, high, points)
    values = [measure(q) - 1.0 for q in grid]
    found = []
    for a, b, fa, fb in zip(grid[:-1], grid[1:], values[:-1], values[1:], strict=True):
        if fa * fb < 0:
            found.append(float(brentq(lambda q: measure(q) - 1.0, a, b, xtol=1e-13 * b, rtol=1e-14)))
    return tuple(found)
