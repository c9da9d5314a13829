"""Events of a solution that exact and approximate models share: entries into stick, exits, crossings."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from filippov import EventKind, Solution, System
from filippov.analysis.comparisons.approximation import Approximation
from filippov.analysis.comparisons.band_model import Reader, Stay
from filippov.base.arrays import Array
from filippov.solving.state.options import STEPPING

MOST_NODES = 4000
# Gauss points a step for the way covered in stick.
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(4)
# Of the time computed: what lasts less lies between events of one instant, which rounding orders.
INSTANT = 1e-9
# Of the time in which the force of a surface moves h by the half-width: what lasts less is a matter of the
# band. Where several share a rate, those that hold the body meet others on the way, and take it over there.
UNTOLD = 10.0


@dataclass(frozen=True)
class Read:
    """What is read of a solution on one surface.

    stays      stays in stick
    crossings  times at which h changes its sign outside of them
    drift      largest |integral of h dt| within a stay from its entry on: the way slipped, for a velocity h
    least      how long a stay lasts at least that is not made by the band or by rounding
    """

    surface: str
    stays: tuple[Stay, ...]
    crossings: tuple[float, ...]
    drift: float
    least: float = 0.0

    def events(self, scale: float) -> list[tuple[float, str, str]]:
        """(time, surface, kind), in order of time; a start on the edge of stick is no event."""
        found = [(t, self.surface, "crossing") for t in self.crossings]
        for stay in self.stays:
            if not stay.from_start:
                found.append((stay.t0, self.surface, "entry"))
            if not stay.to_end and not (stay.from_start and stay.t1 - stay.t0 <= 1e-9 * scale):
                found.append((stay.t1, self.surface, "exit"))
        return sorted(found)

    @property
    def time(self) -> float:
        """Time spent in stick."""
        return sum(stay.t1 - stay.t0 for stay in self.stays)

    def begun_as(self, exact: Read) -> Read:
        """The same, where a first entry during the stay that the exact solution begins in is no event.

        At a start on several surfaces the others are within their bands for a while, and act otherwise.
        """
        own, theirs = self.stays[:1], exact.stays[:1]
        if not own or not theirs or own[0].from_start or not theirs[0].from_start:
            return self
        late = own[0].t0 >= theirs[0].t1 or any(t < own[0].t0 for t in self.crossings)
        return self if late else replace(self, stays=(replace(own[0], from_start=True), *self.stays[1:]))


class EventReader:
    """Reads solutions of a system and of its approximations on each of its switching surfaces."""

    def __init__(self, exact: System, p: Array) -> None:
        names = [q.name for q in exact.surfaces if q.kind == "switching"]
        self.readers = {name: Reader(exact, name, p) for name in names}
        self.places = {name: places_of(exact, name) for name in names}

    def exact(self, solution: Solution) -> tuple[Read, ...]:
        """What is read of the exact solution."""
        out = []
        for name, reader in self.readers.items():
            stays = reader.of_exact(solution)
            times = tuple(e.t for e in solution.events.of(name) if e.kind is EventKind.CROSSING)
            drift = self.drift(solution, name, stays)
            out.append(Read(name, tuple(stays), times, drift, INSTANT * _span(solution)))
        return tuple(out)

    def model(self, solution: Solution, model: Approximation, width: float) -> tuple[Read, ...]:
        """What is read of the solution of an approximation."""
        out = []
        for name, reader in self.readers.items():
            if not model.sticks:
                out.append(Read(name, (), (), 0.0))
                continue
            if _still_exact(solution.system, name):
                stays, edge = reader_exact(solution, name), 0.0
            else:
                band = model.band_model(name)
                stays, edge = reader.of_model(solution, band, width), band.reach * width
            crossings = self._crossings(solution, reader, stays, edge)
            jump, least = self.jump(solution, name), INSTANT * _span(solution)
            least = max(least, UNTOLD * edge / jump) if jump > 0 else least
            out.append(Read(name, tuple(stays), crossings, self.drift(solution, name, stays), least))
        return tuple(out)

    def jump(self, solution: Solution, name: str) -> float:
        """The largest |dL| between the two signs of a surface along a solution, halved: L = dh/dt."""
        reader = self.readers[name]
        chosen = np.unique(np.linspace(0, solution.t.size - 1, 60).astype(int))
        found = [reader.rates(float(solution.t[k]), solution.y[:, k]) for k in chosen]
        return max((0.5 * abs(below - above) for below, above in found), default=0.0)

    def magnitude(self, solution: Solution, name: str) -> float:
        """The largest |h| along a solution."""
        reader = self.readers[name]
        chosen = np.unique(np.linspace(0, solution.t.size - 1, 400).astype(int))
        return max(abs(reader.height(float(solution.t[k]), solution.y[:, k])) for k in chosen)

    def _crossings(
        self, solution: Solution, reader: Reader, stays: Sequence[Stay], edge: float
    ) -> tuple[float, ...]:
        """Zeros of h between |h| > edge on one side and on the other, without a stay in between."""
        sol = solution.sol
        assert sol is not None
        t = np.unique(np.concatenate([_nodes(solution), solution.events.t]))
        h = np.array([reader.height(float(q), sol(float(q))) for q in t])
        kept = np.flatnonzero(np.abs(h) > edge)
        found = []
        for a, b in itertools.pairwise(kept):
            if h[a] * h[b] < 0 and not any(stay.t0 <= t[b] and stay.t1 >= t[a] for stay in stays):
                found.append(float(brentq(lambda q: reader.height(q, sol(q)), t[a], t[b], xtol=1e-14)))
        return tuple(found)

    def drift(self, solution: Solution, name: str, stays: Sequence[Stay]) -> float:
        """The way slipped in stick: of the places where states are these, else the integral of h."""
        sol, worst, reader, places = solution.sol, 0.0, self.readers[name], self.places[name]
        assert sol is not None
        ends = _nodes(solution)
        for stay in stays:
            inner = ends[(ends > stay.t0) & (ends < stay.t1)]
            nodes = np.concatenate([[stay.t0], inner, [stay.t1]])
            half = 0.5 * np.diff(nodes)[:, None]
            t = (0.5 * (nodes[1:] + nodes[:-1])[:, None] + half * POINTS).ravel()
            x = sol(t)
            h = np.array([reader.height(float(q), x[:, i]) for i, q in enumerate(t)])
            if not places:
                way = np.cumsum(np.sum(half * WEIGHTS * h.reshape(-1, POINTS.size), axis=1))
            else:  # x' = v with h = c (v - w), of one body or two: the places against what moves with w
                other = sum(c * x[j] for _, j, c in places) - h
                moving = np.cumsum(np.sum(half * WEIGHTS * other.reshape(-1, POINTS.size), axis=1))
                at = sum(c * sol(nodes, side="+")[k] for k, _, c in places) if nodes.size else nodes
                way = (at[1:] - at[0] - moving) / places[0][2]
            worst = max(worst, float(np.max(np.abs(way), initial=0.0)))
        return worst


def _span(solution: Solution) -> float:
    return abs(solution.t_end - solution.problem.t_span[0])


def _nodes(solution: Solution) -> Array:
    """Ends of steps; of the very many of time stepping, some thousand."""
    every = solution.t.size // MOST_NODES
    if solution.options.method != STEPPING or every < 2:
        return solution.t
    return np.append(solution.t[::every], solution.t[-1])


def places_of(system: System, surface: str) -> list[tuple[int, int, float]]:
    """(k, j, c) where state k has the rate x_j and h = sum of c x_j - w, w without states; or []."""
    form = system.symbolic
    if form is None:
        return []
    h = form.h[system.surface_index(surface)]
    out = []
    for j, x in enumerate(form.x):
        if not h.has(x):
            continue
        slope, place = h.diff(x), next((k for k, f in enumerate(form.field) if f == x), None)
        if not slope.is_number or place is None:
            return []
        out.append((place, j, float(slope)))
    return out


def _still_exact(system: System, surface: str) -> bool:
    """Whether a surface is in an approximation as it is in the exact system."""
    found = [q for q in system.surfaces if q.name == surface and q.kind == "switching"]
    return bool(found) and found[0].width == 0


def reader_exact(solution: Solution, name: str) -> list[Stay]:
    """Stays on a surface that an approximation leaves exact."""
    from filippov.analysis.comparisons.band_model import by_mode

    index = solution.system.surface_index(name)
    return by_mode(solution, lambda mode, t, x: mode[index] == 0)
