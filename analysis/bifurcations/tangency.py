"""Where trajectories graze a surface, or nearly: least heights of side h, and events at almost no speed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from filippov.analysis.orbits.shooting import NoConvergenceError
from filippov.analysis.sensitivity.variation import ModeField, mode_field
from filippov.base.arrays import Array
from filippov.solving.solution import Solution

_GRID = 8


@dataclass(frozen=True, eq=False)
class Tangency:
    """State x and time t of an interior least height of side h, or of an event there; height: what is left
    of side h, negative beyond the surface (of an event: the height that it would come to)."""

    x: Array
    t: float
    height: float

    @property
    def gap(self) -> float:
        """The height: 0 where the surface is grazed."""
        return self.height

    def distance(self, other: Tangency, scale: Array, period: float) -> float:
        """How far apart two tangencies are; period: that of the forcing, 0 for an autonomous system."""
        apart = float(np.linalg.norm((self.x - other.x) / scale))
        if period > 0:
            phase = (self.t - other.t) / period
            apart += abs(phase - round(phase))
        return apart


def tangencies(solutions: Sequence[Solution], i: int, side: int) -> list[Tangency]:
    """All tangencies of trajectories to surface i from one side."""
    return [found for one in solutions for found in (*_least(one, i, side), *_slow(one, i, side))]


def nearest(found: Sequence[Tangency]) -> Tangency:
    """The tangency with the least height in magnitude. Raises NoConvergenceError where there is none."""
    if not found:
        raise NoConvergenceError("the orbit turns nowhere towards the surface.")
    return min(found, key=lambda touch: abs(touch.height))


def _least(solution: Solution, i: int, side: int) -> Iterator[Tangency]:
    """Interior least heights while the surface is off."""
    system, p, sol = solution.problem.system, solution.problem.p, solution.sol
    assert sol is not None
    observer = system.surfaces[i].kind == "observer"
    for segment in solution.segments:
        if not observer and segment.mode[i] != side:
            continue
        mode = segment.mode
        part = mode_field(system, mode)

        def read(name: str, t: Array, part: ModeField = part) -> Array:
            x = np.ascontiguousarray(np.atleast_2d(sol(t).T))
            s = part.multipliers(t, x, p)
            return side * part.part(name, t, x, s, p)[:, i, 0]

        # A reset turns the state back within its mode: the surface is reached there, not grazed.
        events = [e.t for e in solution.events if e.x_after is not None]
        jumps = sorted({t for t in events if segment.t0 < t < segment.t1})
        for low, high in pairwise([segment.t0, *jumps, segment.t1]):
            inside = sol.start[(sol.start > low) & (sol.start < high)]
            knots = np.concatenate(([low], inside, [high]))
            near = 1e-9 * (high - low)
            times = (knots[:-1, None] + np.diff(knots)[:, None] * np.arange(_GRID) / _GRID).ravel()
            times = np.unique(np.clip(np.append(times, knots[-1]), low + near, high - near))
            rates = read("r", times)
            for k in np.flatnonzero((rates[:-1] < 0) & (rates[1:] >= 0)).tolist():
                t = float(brentq(
                    lambda t, read=read: float(read("r", np.array([t]))[0]), times[k], times[k + 1],
                    xtol=1e-14,
                ))  # fmt: skip
                at = np.array([t])
                yield Tangency(np.atleast_2d(sol(at).T)[0].copy(), t, float(read("h", at)[0]))


def _slow(solution: Solution, i: int, side: int) -> Iterator[Tangency]:
    """Events of the surface reached from the side, with the height that the solution would come to."""
    system, p = solution.problem.system, solution.problem.p
    for event in solution.events:
        if event.index != i or event.before[i] != side or system.surfaces[i].kind == "observer":
            continue
        part = mode_field(system, event.before)
        t, x = np.array([event.t]), np.asarray(event.x, dtype=float)[None, :]
        s = part.multipliers(t, x, p)
        speed = float(part.part("r", t, x, s, p)[0, i, 0])
        slope = part.part("ry", t, x, s, p)[0, i]
        bend = side * float(slope @ part.velocity(t, x, s, p)[0])
        if bend > 0:
            yield Tangency(x[0].copy(), event.t, -(speed**2) / (2 * bend))
