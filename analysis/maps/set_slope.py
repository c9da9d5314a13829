"""The slope of an event map at the equilibrium set: in closed form, or from ratios R(d)/d at ever smaller d.

`filippov.analysis.maps.linear_return` has the closed form. Elsewhere, where the slip field is smooth beside
the set, R(d)/d = kappa + c d + ...: Richardson's extrapolation by halving. A friction curve |v|**beta makes
it a series in u = d**(beta - 1), which may fall slowly: there log R(d)/d is fitted by polynomials in d**gamma
over windows of d, gamma free, and three degrees tell the error.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import minimize_scalar

from filippov.analysis.algebra import linalg
from filippov.analysis.maps.linear_return import linear_slope
from filippov.analysis.maps.map_units import FINE, map_units
from filippov.base.arrays import Array

if TYPE_CHECKING:
    from filippov.analysis.maps.scalar_map import ScalarMap

TIGHT = 1e-12
LEVELS = 24
# Below this many roundings of the states, in units of the coordinate, it is not resolved.
ROUNDINGS = 1e4
EXPONENTS = np.linspace(0.04, 2.2, 55)
DEGREES = (2, 3, 4, 5)
# What rounding leaves of a slope in closed form, relative to it.
CLOSED = 1e-9


class SetSlope(NamedTuple):
    """Limit of R(d)/d at the set, its error, and a note on it: infinite where the map jumps there."""

    value: float
    error: float
    note: str = ""
    jumps: bool = False


def near_set(event_map: ScalarMap, reach: float) -> tuple[ScalarMap, float]:
    """The map at tolerances for small coordinates, and the smallest coordinate that rounding leaves.

    The absolute tolerance of a state is what rounding of all of them is worth of it.
    """
    units = map_units(event_map, reach)
    lost = units.rounding
    return event_map.remake(rtol=TIGHT * 0.1, atol=units.worth(FINE * lost)), ROUNDINGS * lost


def equilibrium_slope(event_map: ScalarMap, reach: float, side: float = 1.0) -> SetSlope:
    """Limit of R(d)/d for d -> 0 on one side.

    It is the product of the limits over the returns of the map, each on the side to which the one before it
    leads.
    """
    slope, share, notes = 1.0, 0.0, []
    for _ in range(event_map.order):
        found = _one_return_slope(event_map.remake(order=1), side * reach)
        one, error, note, _ = found
        if not np.isfinite(one):
            return found._replace(value=abs(one), error=0.0)
        slope *= one
        share += error / abs(one) if one else 0.0
        side = side if one > 0 else -side
        notes.append(note)
    return SetSlope(slope, abs(slope) * share, next((note for note in notes if note), ""))


def log_slope(event_map: ScalarMap, reach: float, **parameters: float) -> float:
    """log |slope| at the equilibrium set for these parameters: 0 where the set changes stability.

    -inf where the slope is 0, inf where it has no bound, NaN where it is not known.
    """
    slope = equilibrium_slope(event_map.remake(parameters=parameters), reach).value
    return float(np.log(abs(slope))) if slope else -np.inf


def _one_return_slope(event_map: ScalarMap, reach: float) -> SetSlope:
    """Limit of R(d)/d in closed form; else from ratios at reach, reach/2, ..., extrapolated until rounding
    takes over."""
    exact = linear_slope(event_map, reach)
    if exact is not None and np.isfinite(exact):
        return SetSlope(exact, CLOSED * abs(exact))
    fine, least = near_set(event_map, reach)
    if exact is not None:
        return _unbounded(exact, np.inf, _leaving(fine, float(np.copysign(least, reach))))
    d = reach * 0.5 ** np.arange(LEVELS)
    ratios = fine(d) / d
    good = int(np.argmin(np.isfinite(ratios))) if not np.all(np.isfinite(ratios)) else LEVELS
    d, ratios = d[:good], ratios[:good]
    if good < 6:
        return SetSlope(float("nan"), np.inf, "the map does not return near the equilibrium set")
    growth = np.abs(ratios[1:] / ratios[:-1])
    if abs(ratios[-1]) > 10.0 and np.all(growth[-5:] > 1.05) and growth[-1] > growth[-3] - 1e-3:
        sign = float(np.sign(ratios[-1]))
        jump = f"{float(ratios[-1] * abs(d[-1])):.9g}" if np.all(growth[-3:] > 1.9) else ""
        return _unbounded(sign * np.inf, 0.0, jump)
    table: list[Array] = [ratios]
    for j in range(1, min(6, good - 2)):
        previous = table[-1]
        table.append(previous[1:] + (previous[1:] - previous[:-1]) / (2.0**j - 1.0))
    best, error = float(ratios[-1]), np.inf
    for column in table[1:]:
        changes = np.abs(np.diff(column))
        if np.min(changes) < error:
            place = int(np.argmin(changes))
            best, error = float(column[place + 1]), float(changes[place])
    if error > 1e-6 * max(1.0, abs(best)):
        best, error = min((best, error), _fitted(fine, reach, least), key=lambda pair: pair[1])
    told = error < 1e-6 * max(1.0, abs(best))
    note = "" if told else f"slope at the equilibrium set known to {error:.1g} only"
    return SetSlope(best, max(error, CLOSED * abs(best)), note)


def _unbounded(value: float, error: float, jump: str) -> SetSlope:
    """A slope without bound; jump: the image R(0+) where the map jumps at the set, else ""."""
    note = f"the map jumps at the equilibrium set: R(0+) = {jump}"
    if not jump:
        note = "the slope of the map grows without bound at the equilibrium set"
    return SetSlope(value, error, note, bool(jump))


def _leaving(fine: ScalarMap, least: float) -> str:
    """The image of 0+ where the map jumps at the set, from the smallest coordinates; "" where it does not."""
    near, far = fine(np.array([30.0 * least, 60.0 * least]))
    return f"{near:.6g}" if abs(far / near - 1.0) < 0.01 else ""


def _fitted(fine: ScalarMap, reach: float, least: float) -> tuple[float, float]:
    """Limit of R(d)/d for d -> 0 and its error, from fits in d**gamma over windows above `least`."""
    d = reach * np.geomspace(1.0, min(least / abs(reach), 0.5), 56)
    ratios = fine(d) / d
    best = (float("nan"), float("inf"))
    if not np.all(np.isfinite(ratios)) or np.any(ratios * ratios[0] <= 0):
        return best
    scale, y = np.log(d / d[0]), np.log(np.abs(ratios))
    for first, last in ((0, 28), (10, 38), (18, 46), (26, 54)):
        limits = [_fit(scale[first:last], y[first:last], degree) for degree in DEGREES]
        # Two degrees may agree by chance, three do not.
        for three in zip(limits, limits[1:], limits[2:], strict=False):
            known = [limit for limit in three if limit is not None]
            if len(known) == 3 and max(known) - min(known) < best[1]:
                best = (known[-1], max(known) - min(known))
    return float(np.sign(ratios[0])) * best[0], best[1]


def _fit(scale: Array, y: Array, degree: int) -> float | None:
    """exp of the constant of the best polynomial in exp(gamma scale); None at the ends of gamma."""

    def left(gamma: float) -> tuple[float, float]:
        rows = np.vander(np.exp(gamma * scale), degree + 1, increasing=True)
        c, *_ = linalg.lstsq(rows, y, rcond=None)
        return float(np.sum((rows @ c - y) ** 2)), float(c[0])

    k = int(np.argmin([left(gamma)[0] for gamma in EXPONENTS]))
    if k in (0, len(EXPONENTS) - 1):
        return None
    between = (float(EXPONENTS[k - 1]), float(EXPONENTS[k + 1]))
    found = minimize_scalar(lambda gamma: left(gamma)[0], bounds=between, method="bounded")
    return float(np.exp(left(float(found.x))[1]))
