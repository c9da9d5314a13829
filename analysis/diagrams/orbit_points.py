"""What is read off a periodic orbit at the events of a section."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from filippov.analysis.maps.fixed_points import FixedPoint
from filippov.analysis.maps.returns import returns
from filippov.analysis.maps.section import Section
from filippov.analysis.maps.stroboscope import Stroboscope, strobes_and_turns
from filippov.analysis.orbits.orbit import Orbit
from filippov.base.arrays import Array
from filippov.model.system import System

# An event this near to the end of a period, in parts of it, is the one at its begin.
_SAME = 1e-9


def orbit_points(section: Section | Stroboscope, orbit: Orbit) -> list[FixedPoint]:
    """An orbit as the fixed points of the map, one for each event of the section in its period, in order."""
    length, turns = section_period(orbit.system, section, orbit.period, orbit.parameters)
    found = read(orbit.system, section, orbit.x0, orbit.t0, length, orbit.parameters)
    slope = largest(orbit.multipliers.tolist(), turns)
    return [
        FixedPoint(d, "limit cycle", slope, orbit.verdict, orbit.residual, length) for d in found.tolist()
    ]


def section_period(
    system: System, section: Section | Stroboscope, period: float, parameters: Mapping[str, float]
) -> tuple[float, int]:
    """The time after which an orbit is back at the section, and its turns until then.

    They are its period and 1, except at strobes that are longer than it, or no part of it.
    """
    if isinstance(section, Section):
        return period, 1
    strobe = section.period_on(system)(system.parameters.resolve(parameters))
    strobes, turns = strobes_and_turns(period, strobe)
    return strobes * strobe, turns


def largest(multipliers: Sequence[complex], turns: int = 1) -> float:
    """The multiplier of largest modulus after so many turns, or its modulus where one of a complex pair."""
    first = max(multipliers, key=abs, default=0.0 + 0.0j) ** turns
    return float(first.real if abs(first.imag) <= 1e-9 * (1 + abs(first)) else abs(first))


def read(
    system: System, section: Section | Stroboscope, x0: Array, t0: float, period: float,
    parameters: Mapping[str, float],
) -> Array:  # fmt: skip
    """The coordinates at the section's events in one period from x0 on an orbit."""
    count = 1
    found = returns(system, section, x0, count, parameters=parameters, t0=t0)
    while not found.message and found.t[-1] <= t0 + period * (1 - _SAME):
        count *= 2
        found = returns(system, section, x0, count, parameters=parameters, t0=t0)
    inside = found.t <= t0 + period * (1 + _SAME)
    if np.sum(inside) > 1 and found.t[inside][-1] - found.t[0] > period * (1 - _SAME):
        inside[np.flatnonzero(inside)[-1]] = False
    return np.asarray(found.d[inside])
