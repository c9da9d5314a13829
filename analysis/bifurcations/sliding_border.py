"""Where an orbit meets the border of sliding of a surface, and how far from it: test functions of curves.

A solution that arrives at h = 0 from the side sigma goes on sliding where the field of the other side points
back, and crosses where it does not. Crossing-sliding and switching-sliding are both

    sigma dh/dt = 0 at the arrival, with the multiplier at its end on the other side;

they differ in what comes after. Adding-sliding is where the distance of the multiplier s from an end of its
set has the least value 0 along the sliding solution, which is followed beyond the end where the orbit leaves.
Source: di Bernardo, Budd, Champneys & Kowalczyk 2008.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from filippov import EventKind, Solution
from filippov.analysis.sensitivity.variation import ModeField, mode_field
from filippov.base.arrays import Array
from filippov.solving.segments import Segment
from filippov.solving.state.events import Mode

ARRIVALS, ADDING = ("crossing-sliding", "switching-sliding"), "adding-sliding"
# A tangency by c tau**2 leaves the surface for 4 tau, with the least distance at a quarter of that.
_GRID, _BEYOND, _SHORT = 8, 0.5, 0.5
SIDES = np.array([-1.0, 1.0])


@dataclass(frozen=True)
class Contact:
    """State x and time t of an arrival at a surface or of a least distance; gap: the test function, 0 on the
    border of sliding; side: where the solution comes from, or the end of the set that is near."""

    x: Array
    t: float
    gap: float
    side: int

    def distance(self, other: Contact, scale: Array, period: float) -> float:
        """How far apart two contacts are; period: that of the forcing, 0 for an autonomous system."""
        apart = float(np.linalg.norm((self.x - other.x) / scale))
        if period > 0:
            phase = (self.t - other.t) / period
            apart += abs(phase - round(phase))
        return apart if self.side == other.side else float("inf")


def contacts(kind: str, solutions: Sequence[Solution], i: int) -> list[Contact]:
    """All contacts of an orbit with the border of sliding on surface i that a kind of change is tested at."""
    found = _least if kind == ADDING else _arrivals
    return [contact for solution in solutions for contact in found(solution, i)]


def _arrivals(solution: Solution, i: int) -> Iterator[Contact]:
    system, p = solution.problem.system, solution.problem.p
    for event in solution.events:
        if event.index != i or event.before[i] == 0:
            continue
        if event.kind not in (EventKind.CROSSING, EventKind.ENTRY):
            continue
        side = event.before[i]
        rates = []
        for at in (-side, side):
            mode = (*event.before[:i], at, *event.before[i + 1 :])
            field, t, x = mode_field(system, mode), np.array([event.t]), np.asarray(event.x)[None, :]
            s = field.multipliers(t, x, p)
            rates.append(float(field.part("r", t, x, s, p)[0, i, 0]))
        yield Contact(np.asarray(event.x), event.t, side * rates[0] / abs(rates[1]), side)


def _least(solution: Solution, i: int) -> Iterator[Contact]:
    """Least distances of the multiplier from the ends of its set, also of sliding solutions that left."""
    sol = solution.sol
    assert sol is not None
    phases: list[list[Segment]] = []
    for segment in solution.segments:
        if phases and phases[-1][-1].mode == segment.mode:
            phases[-1].append(segment)
        else:
            phases.append([segment])
    for k, phase in enumerate(phases):
        mode, t0, t1 = phase[0].mode, phase[0].t0, phase[-1].t1
        if mode[i] != 0 or not t0 < t1:
            continue
        edge = _Edge(solution, mode, i)
        ends = [t0, *sol.start[(sol.start > t0) & (sol.start < t1)].tolist(), t1]
        grid = np.concatenate([np.linspace(a, b, _GRID, endpoint=False) for a, b in pairwise(ends)])[1:]
        path: Callable[[Array], Array] = sol
        if k + 1 < len(phases) and phases[k + 1][0].mode[i] != 0:
            # The exit is located a little before or after the least distance, so both sides are joined.
            beyond = edge.beyond(t1, sol(t1), sum(segment.dwell for segment in phases[k + 1]))
            if beyond is not None:
                path = _joined(sol, beyond[0], t1)
                grid = np.concatenate((grid, beyond[1]))
        yield from edge.minima(path, grid)


def _joined(
    first: Callable[[Array], Array], second: Callable[[Array], Array], at: float
) -> Callable[[Array], Array]:
    """One solution up to a time, another one from there; t: (k,)."""
    return lambda t: np.where(t <= at, first(np.minimum(t, at)), second(np.maximum(t, at)))


class _Edge:
    """The multiplier of surface i while a mode slides on it, against the ends of its set."""

    def __init__(self, solution: Solution, mode: Mode, i: int) -> None:
        self.field: ModeField = mode_field(solution.problem.system, mode)
        self.p, self.i, self.place = solution.problem.p, i, self.field.sliding.index(i)

    def gaps(self, t: Array, x: Array) -> tuple[Array, Array]:
        """Distance of s from the lower and the upper end at times (k,) and states (n, k), and its derivative
        along the sliding solution: (k, 2) each."""
        field, rows = self.field, np.ascontiguousarray(x.T)
        s = field.multipliers(t, rows, self.p)
        speed = field.velocity(t, rows, s, self.p)
        ends = field.part("radius", t, rows, s, self.p)[:, self.i]
        moves = field.part("radiusy", t, rows, s, self.p)[:, 2 * self.i : 2 * self.i + 2]
        slope = field.multiplier_slope(t, rows, s, self.p)[:, self.place]
        rates = np.einsum("kej,kj->ke", moves - slope[:, None], speed)
        return SIDES * (ends - s[:, self.i, None]), SIDES * rates

    def minima(self, x: Callable[[Array], Array], grid: Array) -> Iterator[Contact]:
        """Interior least distances of the solution x(t) between the times of a grid."""
        _, rates = self.gaps(grid, x(grid))
        for column, side in enumerate(SIDES.tolist()):
            for k in np.flatnonzero((rates[:-1, column] < 0) & (rates[1:, column] >= 0)):
                t = float(brentq(
                    lambda t, c=column: self.gaps(np.array([t]), x(np.array([t])))[1][0, c],
                    grid[k], grid[k + 1], xtol=1e-8 * (grid[k + 1] - grid[k]), rtol=1e-14,
                ))  # fmt: skip
                at = x(np.array([t]))
                yield Contact(at[:, 0], t, float(self.gaps(np.array([t]), at)[0][0, column]), int(side))

    def beyond(self, t: float, x: Array, dwell: float) -> tuple[Callable[[Array], Array], Array] | None:
        """The sliding solution from where the orbit left it, as if its set had no end; None where it stops.

        None also for an excursion off the surface that is too long to come from a tangency.
        """
        gaps, rates = self.gaps(np.array([t]), x[:, None])
        if np.min(np.abs(rates)) * dwell > _SHORT * np.sum(gaps):
            return None

        def f(now: float, state: Array) -> Array:
            time, row = np.array([now]), state[None, :]
            s = self.field.multipliers(time, row, self.p)
            return np.asarray(self.field.part("f", time, row, s, self.p)[0, :, 0])

        try:
            end = t + _BEYOND * dwell
            run = solve_ivp(f, (t, end), x, "DOP853", dense_output=True, rtol=1e-11, atol=1e-13)
        except (np.linalg.LinAlgError, ValueError):
            return None
        return (run.sol, np.linspace(t, run.t[-1], 4 * _GRID)) if run.t[-1] > t else None
