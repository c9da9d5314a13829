"""The events of a motion as exact and approximate models share them: entries into stick, exits, crossings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from filippov.analysis.comparisons.approximation import Approximation
from filippov.analysis.comparisons.band_model import Reader, Stay
from filippov.base.status import EventKind
from filippov.model.system import System
from filippov.solving.solution import Solution

Array = npt.NDArray[np.float64]
# Gauss points a step for the way covered in stick.
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True)
class Read:
    """What is read of a motion on one surface.

    stays      stays in stick
    crossings  times at which h changes its sign outside of them
    drift      largest |integral of h dt| from the entry on within a stay: the way slipped, where h is a velocity
    """

    surface: str
    stays: tuple[Stay, ...]
    crossings: tuple[float, ...]
    drift: float

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


class EventReader:
    """Reads motions of a system and of its approximations on each of its switching surfaces."""

    def __init__(self, exact: System, p: Array) -> None:
        names = [q.name for q in exact.surfaces if q.kind == "switching"]
        self.readers = {name: Reader(exact, name, p) for name in names}

    def exact(self, solution: Solution) -> tuple[Read, ...]:
        """What is read of the exact motion."""
        out = []
        for name, reader in self.readers.items():
            stays = reader.of_exact(solution)
            times = tuple(e.t for e in solution.events.of(name) if e.kind is EventKind.CROSSING)
            out.append(Read(name, tuple(stays), times, self._drift(solution, reader, stays)))
        return tuple(out)

    def model(self, solution: Solution, model: Approximation, width: float) -> tuple[Read, ...]:
        """What is read of the motion of an approximation."""
        out = []
        for name, reader in self.readers.items():
            if name in model.without:
                stays = reader_exact(solution, name)
            else:
                stays = reader.of_model(solution, model.band_model(name), width)
            crossings = self._crossings(solution, reader, stays)
            out.append(Read(name, tuple(stays), crossings, self._drift(solution, reader, stays)))
        return tuple(out)

    def jump(self, solution: Solution, name: str) -> float:
        """The largest |dL| between the two signs of a surface along a motion, halved: L = dh/dt."""
        reader = self.readers[name]
        chosen = np.unique(np.linspace(0, solution.t.size - 1, 60).astype(int))
        found = [reader.rates(float(solution.t[k]), solution.y[:, k]) for k in chosen]
        return max((0.5 * abs(below - above) for below, above in found), default=0.0)

    def size(self, solution: Solution, name: str) -> float:
        """The largest |h| along a motion."""
        reader = self.readers[name]
        chosen = np.unique(np.linspace(0, solution.t.size - 1, 400).astype(int))
        return max(abs(reader.height(float(solution.t[k]), solution.y[:, k])) for k in chosen)

    def _crossings(self, solution: Solution, reader: Reader, stays: Sequence[Stay]) -> tuple[float, ...]:
        sol = solution.sol
        assert sol is not None
        t = np.unique(np.concatenate([solution.t, solution.events.t]))
        h = np.array([reader.height(float(q), sol(float(q))) for q in t])
        kept = np.flatnonzero(h)
        found = []
        for a, b in zip(kept[:-1], kept[1:], strict=True):
            if h[a] * h[b] > 0:
                continue
            time = float(brentq(lambda q: reader.height(q, sol(q)), t[a], t[b], xtol=1e-14))
            if not any(stay.t0 <= time <= stay.t1 for stay in stays):
                found.append(time)
        return tuple(found)

    def _drift(self, solution: Solution, reader: Reader, stays: Sequence[Stay]) -> float:
        sol, worst = solution.sol, 0.0
        assert sol is not None
        for stay in stays:
            inner = solution.t[(solution.t > stay.t0) & (solution.t < stay.t1)]
            nodes = np.concatenate([[stay.t0], inner, [stay.t1]])
            half = 0.5 * np.diff(nodes)[:, None]
            t = 0.5 * (nodes[1:] + nodes[:-1])[:, None] + half * POINTS
            h = np.array([reader.height(float(q), sol(float(q))) for q in t.ravel()]).reshape(t.shape)
            way = np.cumsum(np.sum(half * WEIGHTS * h, axis=1))
            worst = max(worst, float(np.max(np.abs(way), initial=0.0)))
        return worst


def reader_exact(solution: Solution, name: str) -> list[Stay]:
    """Stays on a surface that an approximation leaves exact."""
    from filippov.analysis.comparisons.band_model import by_mode

    index = solution.system.surface_index(name)
    return by_mode(solution, lambda mode, t, x: mode[index] == 0)


def ending(solution: Solution, count: int, extent: Array) -> dict[str, Any]:
    """How a motion ends: "rest", "cycle" or "motion", with its amplitude, period and last speed.

    A cycle: over each of the last two quarters of the span the state that moves most has the same amplitude
    (to 5 %) and goes up through its middle at least once. Rest: the last twentieth moves by no more than 1e-9
    of `extent`. count, extent: states of the exact system and how far each moves.
    """
    sol, (t0, t1) = solution.sol, (solution.problem.t_span[0], solution.t_end)
    assert sol is not None
    t = np.linspace(t0, t1, 4001)
    x = sol(t)[:count]
    moved = [np.ptp(part, axis=1) / extent for part in (x[:, -200:], x[:, -1000:], x[:, -2000:-1000])]
    last = float(np.max(moved[0]))
    data: dict[str, Any] = {
        "kind": "motion", "amplitude": None, "period": None, "speed": last / (0.05 * (t1 - t0)),
        "state": int(np.argmax(moved[0])),
    }  # fmt: skip
    if last <= 1e-9:
        return data | {"kind": "rest"}
    k = int(np.argmax(moved[1]))
    now, before = float(moved[1][k]), float(moved[2][k])
    tail = x[k, -2000:]
    middle = 0.5 * (float(np.max(tail)) + float(np.min(tail)))
    above = tail > middle
    ups = np.flatnonzero(~above[:-1] & above[1:])
    if ups.size < 2 or now < 1e-6 or abs(now - before) > 0.05 * max(now, before):
        return data
    times = [
        float(brentq(lambda q: float(sol(q)[k]) - middle, t[-2000 + i], t[-1999 + i], xtol=1e-14)) for i in ups
    ]
    return data | {
        "kind": "cycle", "amplitude": 0.5 * now * float(extent[k]), "state": k,
        "period": (times[-1] - times[0]) / (len(times) - 1),
    }  # fmt: skip
