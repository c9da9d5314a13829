"""Homoclinic orbits of saddles and pseudo-saddles, with the parameter value at which it exists.

The orbit leaves the saddle xe along its unstable direction w and returns on its stable manifold. With the
parameter q and the duration T unknown,

    x(0) = xe + e0 w,   l (x(T) - xe) = 0,   d (x(T) - xe) = e1,

where l is the left eigenvector of the unstable eigenvalue (projection boundary conditions) and d the
direction from which it comes, solved by collocation over the arcs of the orbit. If no solution approaches the
saddle asymptotically, as at a pseudo-saddle of a planar system, the orbit lands on it in finite time: x(T) =
xe. Source: Beyn 1990, IMA J. Numer. Anal. 10, 379; for pseudo-saddles Kuznetsov, Rinaldi & Gragnani 2003,
Int. J. Bifurcation Chaos 13, 2157.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from filippov import Solution, SolveError, System, UsageError
from filippov.analysis.algebra import linalg
from filippov.analysis.orbits.arcs import Arc, arcs_of
from filippov.analysis.orbits.collocation import Boundary, BoundaryProblem, Mesh, solved
from filippov.analysis.orbits.orbit_collocation import Collocated, check_admissible
from filippov.analysis.orbits.saddle import Saddle, find_saddle, given_mode, one_way_out
from filippov.analysis.orbits.shooting import (
    NoConvergenceError,
    ReturnError,
    Shooting,
    onto_surfaces,
    resolved,
)
from filippov.analysis.steady.forcing import is_forced
from filippov.base.arrays import Array
from filippov.base.given import NonNegative, Positive
from filippov.base.keywords import keywords
from filippov.base.names import unknown
from filippov.base.shown import Shown
from filippov.base.status import Status, mode_text
from filippov.graphs.word import word_of
from filippov.solving.state.events import Mode
from filippov.solving.state.options import check_state
from filippov.solving.uncut import solve

# Distance from the saddle at which the orbit is cut, in units of its size; the factor from one distance to
# the next, far from the saddle and near to it, where its linear part says enough; points of the way there.
_CUT, _NEARER, _SMALL, _TAIL = 1e-4, (0.4, 0.1), 0.03, 16
# The size that is taken first may be this many times that of the orbit; without a return smaller ones are
# tried, by this factor, down to the least. Time constants of the saddle in which the solution is to return,
# and the factor by which more are tried. The absolute tolerance is at most this part of the relative one.
_LARGER, _SMALLER, _LEAST, _LONG, _LONGER, _ABSOLUTE = 2.0, 1e-2, 1e-12, 200.0, 10.0, 1e-2
# Below this the distance of the saddle from 0 is no size: Newton's method leaves 1e-14.
_PLACED = 1e-8
# A solution that goes beyond this escapes: its squares are still numbers. One with so many events that did
# not come back goes to an equilibrium through ever smaller cycles, or to a cycle.
_ESCAPED, _EVENTS = 1e150, 2_000
# What the exact solutions between points of the orbit may miss, in units of its size.
_ROUNDING = 1e-12
_MISSED, _POINTS = 1e-7, 48


@dataclass(frozen=True, eq=False)
class Homoclinic(Shown):
    """A homoclinic orbit.

    system, parameters   with the value of `free` at which the orbit exists
    free, value          that parameter
    saddle               see `filippov.analysis.orbits.saddle`
    period               time between the cuts near the saddle: the duration of the orbit itself is infinite
    pieces               solutions along it, one after the other
    residual             largest gap between these solutions, in units of the orbit's size
    """

    system: System
    parameters: Mapping[str, float]
    free: str
    value: float
    saddle: Saddle
    period: float
    modes: tuple[str, ...]
    word: str
    residual: float
    pieces: tuple[Solution, ...] = field(repr=False, default=())

    def plot(self, *given: Any, **options: Any) -> Any:
        """Phase portrait beside time series (see `filippov.plot.orbits.plot_orbit`)."""
        from filippov.plot.orbits import plot_orbit

        place = ", ".join(f"{round(v, 9) + 0.0:.5g}" for v in self.saddle.x.tolist())
        title = f"homoclinic orbit of the saddle ({place}) in mode {mode_text(self.saddle.mode)}\n"
        return plot_orbit(self, *given, **{"title": f"{title}{self.free} = {self.value:.10g}", **options})

    def __repr__(self) -> str:
        mode = mode_text(self.saddle.mode)
        return f"Homoclinic({self.free} = {self.value:.12g}, saddle in mode {mode}, {self.word!r})"

    def to_dict(self) -> dict[str, Any]:
        """Plain data: numbers, text, lists and dicts; complex numbers as [re, im]."""
        return {
            "parameters": dict(self.parameters), "free": self.free, "value": self.value,
            "saddle": self.saddle.x.tolist(), "mode": mode_text(self.saddle.mode),
            "eigenvalues": [[v.real, v.imag] for v in self.saddle.eigenvalues.tolist()],
            "duration": self.period, "word": self.word, "modes": list(self.modes), "residual": self.residual,
        }  # fmt: skip


@keywords()
def find_homoclinic(
    system: System,
    near: Any,
    *,
    free: str,
    parameters: Mapping[str, float] | None = None,
    mode: str | Sequence[int] | None = None,
    side: int = 0,
    t_max: Positive | None = None,
    rtol: Positive = 1e-11,
    atol: NonNegative = 1e-13,
    jacobian: Any = None,
) -> Homoclinic:
    """The homoclinic orbit of the saddle near a state, and the value of a parameter at which it exists.

    near        a state near the saddle, in order or by name
    free        the parameter that is solved for; its value in `parameters` (or its default) is the guess
    mode        of the saddle, "+0" or signs; default: that of the state; 0 for the surfaces that a
                pseudo-saddle slides on
    side        +1 or -1: along which sense of the unstable direction the orbit leaves, its largest entry
                taken positive; 0: the one that comes back nearer
    t_max       longest time in which the solution is to come back near to the saddle; default: 200 times its
                longest time constant, and ten times as long where it does not come back

    Raises ReturnError where the solution does not come back, NoConvergenceError, WordError (not admissible),
    UsageError. Autonomous systems; saddles with one unstable direction.
    """
    if free not in system.parameters:
        raise UsageError(unknown("parameter", free, system.parameters.names))
    if side not in (-1, 0, 1):
        raise UsageError(f"side is {side!r}, expected -1, 0 or 1.")
    if is_forced(system):
        raise UsageError("the system depends on time; homoclinic orbits are those of autonomous systems.")
    p, state = resolved(system, parameters), check_state(near, system)
    search = _Search(system, p, free, rtol, atol, jacobian)
    signs = search.solution(p, state, 1e-9).start_mode if mode is None else given_mode(system, mode)
    search.saddle = search.saddle_of(signs, state, p)
    errors = []
    for solution in search.returns(side, t_max):
        try:
            return search.solve(solution)
        except (SolveError, ArithmeticError, np.linalg.LinAlgError) as error:
            errors.append(error)
    raise errors[0]


def _until_escape(arcs: list[Arc]) -> list[Arc]:
    """The arcs of a solution before it escapes."""
    out: list[Arc] = []
    for arc in arcs:
        gone = np.flatnonzero(np.max(np.abs(arc.x), axis=1) > _ESCAPED)
        if gone.size:
            return [*out, Arc(arc.mode, arc.t[: gone[0]], arc.x[: gone[0]])] if gone[0] > 1 else out
        out.append(arc)
    return out


class _Search:
    """One search, with what it shares."""

    saddle: Saddle
    leaving: Array

    def __init__(
        self, system: System, p: Array, free: str, rtol: float, atol: float, jacobian: Any
    ) -> None:  # fmt: skip
        self.system, self.p, self.free, self.jacobian = system, p, free, jacobian
        self.place = system.parameters.index(free)
        self.rtol, self.atol, self.size, self.way = rtol, atol, 1.0, 1.0

    def saddle_of(self, mode: Mode, near: Array, p: Array) -> Saddle:
        """The saddle of a mode, with one unstable direction."""
        return one_way_out(find_saddle(self.system, mode, near, p, self.jacobian))

    def saddle_at(self, p: Array) -> Saddle:
        """The saddle for other parameter values, next to the last one."""
        return self.saddle_of(self.saddle.mode, self.saddle.x, p)

    def solution(self, p: Array, x: Array, length: float) -> Solution:
        """A solution of so much time."""
        values = dict(zip(self.system.parameters.names, p.tolist(), strict=True))
        return solve(
            self.system, x, (0.0, length), parameters=values, rtol=self.rtol, atol=self.atol,
            zeno="continue", nonunique="stick", max_events=_EVENTS,
        )  # fmt: skip

    def returns(self, side: int, t_max: float | None) -> list[tuple[float, list[Arc]]]:
        """(way, arcs from the saddle to where the solution is nearest to it again), the best first."""
        saddle, found = self.saddle, []
        self.leaving = saddle.unstable
        constant = 1.0 / float(np.min(np.abs(saddle.eigenvalues.real)))
        spans = (_LONG * constant, _LONGER * _LONG * constant) if t_max is None else (t_max,)
        for span in spans:
            for way in (1.0, -1.0) if side == 0 else (float(side),):
                best = self._back(way, span)
                if best is not None:
                    found.append((best[0], way, best[1]))
            if found:
                break
        else:
            raise ReturnError(
                f"the solution from the saddle {saddle.x.tolist()} does not come back near to it within "
                f"t_max = {spans[-1]:g}. Give parameters nearer to those of a homoclinic orbit, or a t_max.",
                None, spans[-1],
            )  # fmt: skip
        return [(way, arcs) for _, way, arcs in sorted(found, key=lambda item: item[0])]

    def _back(self, way: float, t_max: float) -> tuple[float, list[Arc]] | None:
        """What `_nearest` finds on the solution that leaves in one sense, from a distance that is small
        beside the way that it takes."""
        saddle = self.saddle
        on = tuple(i for i, sign in enumerate(saddle.mode) if sign == 0)
        size = float(np.max(np.abs(saddle.x)))
        if size < _PLACED:
            size += 1.0
        while True:
            out = saddle.x + way * _CUT * size * saddle.unstable
            start = onto_surfaces(self.system, out, 0.0, self.p, on)
            best = self._nearest(_until_escape(arcs_of([self.solution(self.p, start, t_max)])))
            larger = 1.0 / _SMALLER
            if best is not None:
                extent = np.ptp(np.vstack([arc.x for arc in best[1]]), axis=0)
                least = np.finfo(float).eps * float(np.max(extent))
                larger = size * float(np.max(np.abs(saddle.unstable) / np.maximum(extent, least)))
            if larger <= _LARGER or size < _LEAST:
                return best
            size /= larger
            self.atol = min(self.atol, _ABSOLUTE * self.rtol * size)

    def _nearest(self, arcs: list[Arc]) -> tuple[float, list[Arc]] | None:
        """The share of the way out at which the solution is nearest to the saddle after its first turn."""
        x = np.vstack([arc.x for arc in arcs])
        t = np.concatenate([arc.t for arc in arcs])
        away = np.linalg.norm(x - self.saddle.x, axis=1)
        if self.saddle.stable == 0:
            # It lands on the saddle: at the end of an arc off the surface.
            ends = [k for k, arc in enumerate(arcs) if 0 not in arc.mode and arc.ending is not None]
            gaps = [(float(np.linalg.norm(arcs[k].x[-1] - self.saddle.x)), k) for k in ends]
            if not gaps:
                return None
            # A solution that has come to a cycle lands at one place again and again: the first of them.
            least = min(gap for gap, _ in gaps)
            gap, k = next((gap, k) for gap, k in gaps if gap <= least * (1 + _MISSED))
            last = Arc(arcs[k].mode, arcs[k].t, arcs[k].x)
            return gap / float(np.max(away)), [*arcs[:k], last]
        falling = np.flatnonzero(np.diff(away) < 0)
        if not falling.size:
            return None
        # Between two arcs stands one state twice, with rounding.
        onwards = (np.diff(away) > 0) & (np.diff(t) > 0)
        rises = np.flatnonzero(onwards & (np.arange(len(away) - 1) > falling[0]))
        # The first time that it goes away again, having come near.
        near = away < 0.5 * np.maximum.accumulate(away)
        lows = [k for k in rises if near[k] and away[k] <= away[k - 1] * (1 + _ROUNDING)]
        k = int(lows[0]) if lows else len(away) - 1
        out = []
        for arc in arcs:
            if arc.t[-1] < t[k]:
                out.append(arc)
                continue
            keep = arc.t <= t[k]
            out.append(Arc(arc.mode, arc.t[keep], arc.x[keep]))
            break
        if len(out[-1].t) < 2:
            out.pop()
            out[-1] = Arc(out[-1].mode, out[-1].t, out[-1].x)
        return float(away[k] / np.max(away)), out

    def solve(self, guess: tuple[float, list[Arc]]) -> Homoclinic:
        """The orbit from a guess, truncated closer and closer to the saddle."""
        self.way, arcs = guess
        saddle = self.saddle
        self.size = float(np.max(np.ptp(np.vstack([arc.x for arc in arcs]), axis=0)))
        start = float(np.linalg.norm(arcs[0].x[0] - saddle.x))
        end = float(np.linalg.norm(arcs[-1].x[-1] - saddle.x))
        total = float(arcs[-1].t[-1] - arcs[0].t[0])
        counts = [int(np.clip(80 * (arc.t[-1] - arc.t[0]) / total, 8, 80)) for arc in arcs]
        mesh = Mesh.from_arcs(arcs, counts, [float(self.p[self.place])])
        while True:
            towards = mesh.states[-1][-1] - saddle.x
            problem = self._problem(arcs, start, end, towards)
            mesh, steps = solved(problem, mesh)
            if saddle.stable == 0 or end <= 1.0001 * _CUT * self.size:
                break
            self.saddle = saddle = self.saddle_at(problem.p(mesh.free))
            factor = _NEARER[end < _SMALL * self.size]
            following = max(factor * end, _CUT * self.size)
            mesh, end = self._longer(mesh, following / end), following
        p = problem.p(mesh.free)
        found = Collocated(Shooting(self.system, saddle.x, saddle.x), p, problem, mesh, tuple(steps))
        check_admissible(found)
        return self._confirmed(found, float(mesh.free[0]))

    def _problem(self, arcs: list[Arc], start: float, end: float, towards: Array) -> BoundaryProblem:
        system, n = self.system, self.system.dimension
        lands = self.saddle.stable == 0
        leaving = self.leaving
        towards = towards - self.saddle.unstable * (self.saddle.left @ towards)
        towards = towards / float(np.linalg.norm(towards) or 1.0)

        def conditions(x0: Array, x1: Array, p: Array) -> Array:
            saddle = self.saddle_at(p)
            # Between entries of one size the largest may change its place.
            out = self.way * saddle.unstable * np.sign(saddle.unstable @ leaving)
            off = x1 - saddle.x
            rows = [saddle.left @ off, towards @ off / end - 1.0]
            if lands:
                rows = [saddle.left @ off, *(saddle.normals @ off)]
            return np.append(x0 - saddle.x - start * out, rows)

        def boundary(x0: Array, x1: Array, t: float, p: Array) -> Boundary:
            saddle = self.saddle_at(p)
            second = saddle.normals if lands else towards[None, :] / end
            reach = 1e-6 * (max(abs(float(p[self.place])), abs(float(self.p[self.place]))) or 1e-2)
            moved = []
            for by in (reach, -reach):
                q = p.copy()
                q[self.place] += by
                moved.append(conditions(x0, x1, q))
            return Boundary(
                conditions(x0, x1, p), np.vstack([np.eye(n), np.zeros((2, n))]),
                np.vstack([np.zeros((n, n)), saddle.left, second]), np.zeros(n + 2),
                ((moved[0] - moved[1]) / (2 * reach))[:, None],
            )  # fmt: skip

        states = np.vstack([arc.x for arc in arcs])
        size = np.maximum(np.ptp(states, axis=0), 1e-6 * self.size)
        return BoundaryProblem(
            system, [arc.mode for arc in arcs], [arc.ending for arc in arcs if arc.ending is not None],
            self.p, boundary, size, names=(self.free,), jacobian=self.jacobian, origin=self.saddle.x,
        )  # fmt: skip

    def _longer(self, mesh: Mesh, part: float) -> Mesh:
        """A solution, gone on along the stable manifold until the distance has this part."""
        saddle, grid, x = self.saddle, mesh.grids[-1], mesh.states[-1]
        begin, end = mesh.times[-2:].tolist()
        slowest = -float(np.max(saddle.eigenvalues[1:].real))
        times = np.log(1.0 / part) / slowest * np.arange(1, _TAIL + 1) / _TAIL
        off = x[-1] - saddle.x
        off = off - saddle.unstable * (saddle.left @ off)
        tail = np.array([saddle.x + linalg.expm(saddle.matrix * t) @ off for t in times])
        all_times = np.append(begin + grid * (end - begin), end + times)
        longer = (all_times - begin) / (all_times[-1] - begin)
        longer[-1] = 1.0
        return Mesh(
            (*mesh.grids[:-1], longer), (*mesh.states[:-1], np.vstack([x, tail])),
            np.append(mesh.times[:-1], all_times[-1]), mesh.free,
        )  # fmt: skip

    def _confirmed(self, found: Collocated, value: float) -> Homoclinic:
        """The record, with exact solutions between points of the orbit. Raises NoConvergenceError."""
        begin, end = float(found.mesh.times[0]), float(found.mesh.times[-1])
        times = np.linspace(begin, end, _POINTS + 1).tolist()
        p, pieces, gap = found.p, [], 0.0
        values = dict(zip(self.system.parameters.names, p.tolist(), strict=True))
        for t0, t1 in pairwise(times):
            x, mode = found.at(t0)
            on = tuple(i for i, sign in enumerate(mode) if sign == 0)
            piece = solve(
                self.system, onto_surfaces(self.system, x, t0, p, on), (t0, t1), parameters=values,
                rtol=self.rtol, atol=self.atol, zeno="continue", nonunique="stick",
            )  # fmt: skip
            if piece.status is not Status.SUCCESS:
                raise SolveError(f"the solution along the orbit ended early: {piece.message}", piece)
            gap = max(gap, float(np.max(np.abs(piece.x_end - found.at(t1)[0]))) / self.size)
            pieces.append(piece)
        if gap > _MISSED:
            raise NoConvergenceError(
                f"collocation found an orbit that the exact solutions miss by {gap:.3g} of its size.", gap
            )
        saddle = self.saddle_at(p)
        modes = tuple(map(mode_text, found.problem.modes))
        if all(mode == found.problem.modes[0] for mode in found.problem.modes):
            modes = modes[:1]
        return Homoclinic(
            self.system, values, self.free, value, saddle, end - begin, modes,
            word_of(modes, self.system), gap, tuple(pieces),
        )  # fmt: skip

