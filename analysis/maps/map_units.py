"""The units of the states along the returns of a map: tolerances that mean the same for each of them.

From a coordinate d a return takes state i through values up to size_i, and changes it by change_i. What a
state is off by is worth so much of the coordinate as changes it by as much: rounding of a state that is large
and hardly depends on d hides more of d than that of one which is small or moves with it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np

from filippov.analysis.maps.first_return import first_return
from filippov.base.arrays import Array
from filippov.base.status import Status

if TYPE_CHECKING:
    from collections.abc import Mapping

    from filippov.analysis.maps.scalar_map import ScalarMap
    from filippov.analysis.maps.section import BoundSection

Map = TypeVar("Map", bound="ScalarMap")
EPS = float(np.finfo(float).eps)
# Of the return that tells the units: a few digits are enough, and few steps. A state that starts at 0 has an
# absolute tolerance of these parts of the largest one, the first that is small beside what it comes to: what
# is finer than rounding of the start follows rounding, back to the section at once.
ROUGH, STEPS, LITTLE = 1e-4, 20_000, 1e-3
LEVELS = (1e-6, 1e-10, 1e-14, 1e-18, 1e-22, 1e-26)
# A solution that does not come back may grow without bound: its sizes are those up to this many times the
# start.
GROWN = 10.0
# The absolute tolerance of a state in units of rtol times its size.
SHARE = 3e-2
# The absolute tolerance that goes with rounding, in units of what this is worth of the coordinate.
FINE = 0.2


class MapUnits(NamedTuple):
    """Of each state along the return from a coordinate: its largest magnitude, and how far it changes; at the
    start its value, and the slope of that by the coordinate."""

    reach: float
    size: Array
    change: Array
    start: Array
    slope: Array

    def tolerance(self, rtol: float) -> Array:
        """The absolute tolerance of each state that goes with a relative one, or with rounding: (n,)."""
        return np.maximum(SHARE * rtol * self.size, self.worth(FINE * self.rounding))

    @property
    def rounding(self) -> float:
        """What the rounding of the start is worth of the coordinate."""
        response = np.where(self.slope != 0.0, np.abs(self.slope), self.worth(1.0))
        known = response > 0.0
        worth = np.abs(self.start[known]) / response[known]
        return EPS * max(abs(self.reach), float(np.max(worth, initial=0.0)))

    def worth(self, d: float) -> Array:
        """What a change of the coordinate by d changes the states by: (n,); not known, 0, from 0 on."""
        return self.change * (d / abs(self.reach) if self.reach else 0.0)


def map_units(event_map: ScalarMap, d: float) -> MapUnits:
    """The units along the return from d."""
    return units_at(event_map.bound, event_map.parameters, d, event_map.p)


def units_at(bound: BoundSection, parameters: Mapping[str, float], d: float, p: Array) -> MapUnits:
    """The same for a section and values of parameters, by name and in order."""
    x0 = bound.start(np.array([d]), p)[0]
    largest = max(float(np.max(np.abs(x0))), abs(d))
    size = change = np.zeros(len(x0))
    slope = bound.start_slope(d, p)
    usual = np.where(slope != 0.0, np.maximum(np.abs(x0), np.abs(slope * d)), np.inf)
    for level in LEVELS:
        atol = level * np.where(x0 != 0.0, np.abs(x0), largest)
        options: dict[str, Any] = {"rtol": ROUGH, "atol": atol, "max_steps": STEPS}
        run = first_return(bound, x0, parameters, **options)
        x = np.column_stack([x0, run.y, run.x_end])
        kept = np.all(np.isfinite(x), axis=0)
        if run.status is not Status.STOPPED:
            kept &= np.logical_and.accumulate(np.all(np.abs(x) <= GROWN * usual[:, None], axis=0))
        if not kept.any():
            break
        x = x[:, kept]
        size, change = np.max(np.abs(x), axis=1), np.ptp(x, axis=1)
        if np.all((atol <= LITTLE * size) | (change == 0.0)):
            break
    return MapUnits(d, size, change, x0, slope)


def finer(event_map: Map, d: float, rtol: float) -> Map:
    """The map at tolerances that are no wider than these, for coordinates of the size of d."""
    atol = map_units(event_map, d).tolerance(rtol)
    if event_map.atol is not None:
        atol = np.minimum(event_map.atol, atol)
    return event_map.remake(rtol=min(event_map.rtol, rtol), atol=atol)


def level(d: float) -> float:
    """The least coordinate of the two decades of d, from 10**(2 k - 3/2) to 10**(2 k + 1/2); 0 at 0."""
    if d == 0.0:
        return 0.0
    least = 10.0 ** (2 * math.floor(0.5 * (math.log10(abs(d)) - 0.5)) + 0.5)
    return math.copysign(least, d) if least > 0.0 else d
