"""A periodic orbit by collocation, handed over to multiple shooting.

The arcs of a guessed solution give the sequence of modes. Collocation solves for the orbit with this
sequence, whether it repels or not; then signs and multipliers along it are checked, and nodes are placed so
that nothing grows by much more than a factor of 10 between them. The equations of multiple shooting,
solutions of the exact solver, decide whether it is an orbit of the inclusion, and how accurate it is. Source:
see `filippov.analysis.orbits.collocation`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from filippov.analysis.algebra import linalg
from filippov.analysis.orbits.arcs import Arc, Ending, WordError, arcs_of, joined
from filippov.analysis.orbits.collocation import Boundary, BoundaryProblem, Mesh, solved
from filippov.analysis.orbits.gauss_step import Steps
from filippov.analysis.orbits.oddness import repeats
from filippov.analysis.orbits.shooting import NoConvergenceError, Shooting, velocity_at
from filippov.analysis.orbits.shooting import newton as shoot
from filippov.analysis.sensitivity.variation import mode_field
from filippov.base.arrays import Array
from filippov.base.status import mode_text
from filippov.solving.solution import Solution
from filippov.solving.state.events import Mode
from filippov.solving.state.machine import Machine

_GROWTH, _POINTS, _ODD = 10.0, 12, 1e-6
# Beyond a surface or an end of a multiplier's set by more than this, in units of its size, is not admissible.
_BEYOND = 1e-6
# How far the exact solutions may move the orbit that collocation found, in units of its size.
_MOVED = 1e-3


@dataclass(frozen=True)
class Collocated:
    """An orbit as collocation has it: the equations, the mesh, and the steps on it."""

    base: Shooting
    p: Array
    problem: BoundaryProblem
    mesh: Mesh
    steps: tuple[Steps, ...]

    @property
    def period(self) -> float:
        """T."""
        return float(self.mesh.times[-1] - self.mesh.times[0]) * self.base.symmetry_order

    def at(self, t: float) -> tuple[Array, Mode]:
        """State and mode at a time within the mesh."""
        k = int(np.clip(np.searchsorted(self.mesh.times, t, side="right") - 1, 0, len(self.steps) - 1))
        low, high = self.mesh.times[k : k + 2]
        place = np.array([(t - low) / (high - low) if high > low else 0.0])
        return self.steps[k].at(place)[0], self.problem.modes[k]

    def factors(self) -> list[tuple[float, Array]]:
        """(time at its end, matrix (n, n)) of each step and ending: their product is the derivative of the
        return, without the symmetry."""
        problem, n = self.problem, self.problem.n
        machine = Machine(problem.system, "DOP853", self.p)
        out: list[tuple[float, Array]] = []
        for k, steps in enumerate(self.steps):
            ends = steps.t0 + steps.grid[1:] * (steps.t1 - steps.t0)
            out += list(zip(ends.tolist(), steps.by_state, strict=True))
            if k < len(problem.endings):
                out.append((steps.t1, self._saltation(problem.endings[k], steps, machine)[:n, :n]))
        return out

    def _saltation(self, ending: Ending, steps: Steps, machine: Machine) -> Array:
        system, jacobian, t, x = self.problem.system, self.problem.jacobian, steps.t1, self._last(steps)
        _, slope = ending.condition(system, (), jacobian, t, x, self.p)
        following, by = ending.follow(system, (), machine, t, x, self.p)
        before = np.append(velocity_at(system, ending.before, t, x, self.p, jacobian), 1.0)
        after = velocity_at(system, ending.after, t, following, self.p, jacobian)
        rate = float(slope @ before)
        return np.asarray(by + np.outer(after - by @ before, slope) / rate)

    def _last(self, steps: Steps) -> Array:
        return np.asarray(steps.at(np.ones(1))[0])


def guess_arcs(solutions: Sequence[Solution], final: tuple[Mode, Array]) -> list[Arc]:
    """The arcs of a guess; final: the mode and the state that the last arc is to end with.

    If the last mode differs, the one missing event is appended.
    """
    arcs = arcs_of(solutions)
    last, (mode, state) = arcs[-1], final
    missing = joined(last.mode, mode)
    if missing is not None:
        length = float(last.t[-1] - arcs[0].t[0])
        end = float(last.t[-1])
        arcs[-1] = Arc(last.mode, last.t, last.x, missing)
        arcs.append(Arc(mode, np.array([end, end + 1e-3 * length]), np.vstack([last.x[-1], state])))
    if any(arc.t[-1] <= arc.t[0] for arc in arcs):
        raise WordError("two events of the guess happen at one instant; give another state or more states.")
    return arcs


def anchored(arcs: Sequence[Arc]) -> list[Arc]:
    """The arcs of a whole period from the middle of the longest one with fewest sliding surfaces."""
    if len(arcs) == 1:
        return list(arcs)
    first, last = arcs[0], arcs[-1]
    period = float(last.t[-1] - first.t[0])
    following = _later(first, period)
    joint = Arc(
        first.mode, np.append(last.t, following.t), np.vstack([last.x, following.x]), following.ending
    )  # fmt: skip
    ring = [*arcs[1:-1], joint]
    k = min(range(len(ring)), key=lambda i: (ring[i].mode.count(0), ring[i].t[0] - ring[i].t[-1]))
    arc = ring[k]
    middle = 0.5 * float(arc.t[0] + arc.t[-1])
    at = np.array([np.interp(middle, arc.t, row) for row in arc.x.T])
    before, after = arc.t < middle, arc.t > middle
    start = Arc(arc.mode, np.append(middle, arc.t[after]), np.vstack([at, arc.x[after]]), arc.ending)
    end = Arc(arc.mode, np.append(arc.t[before], middle), np.vstack([arc.x[before], at]))
    return [start, *ring[k + 1 :], *(_later(q, period) for q in (*ring[:k], end))]


def _later(arc: Arc, period: float) -> Arc:
    ending = arc.ending
    return Arc(
        arc.mode, arc.t + period, arc.x, None if ending is None else replace(ending, t=ending.t + period)
    )


def collocate(base: Shooting, arcs: Sequence[Arc], p: Array) -> Collocated:
    """The orbit with the sequence of modes of the arcs. Raises NoConvergenceError, WordError."""
    system, n = base.system, base.n
    states = np.vstack([arc.x for arc in arcs])
    extent = np.ptp(states, axis=0)
    size = np.maximum(extent, 1e-9 * (np.max(np.abs(states), axis=0) + 1e-300))
    still = size < 1e-6 * np.max(size)
    size[still] = np.maximum(np.max(np.abs(states), axis=0), np.max(size))[still]
    begin, reference, first = float(arcs[0].t[0]), arcs[0].x[0], arcs[0].mode
    speed = velocity_at(system, first, begin, reference, p, base.jacobian) / size**2
    speed = speed / max(float(np.linalg.norm(speed * size)), 1e-300)
    always = [i for i in range(len(system.surfaces)) if all(arc.mode[i] == 0 for arc in arcs)]
    field, gate = mode_field(system, first, (), base.jacobian), base.gate
    length = base.period(p) / base.symmetry_order if base.period is not None else None

    def boundary(x0: Array, x1: Array, t: float, values: Array) -> Boundary:
        left, by_first = x1 - gate @ x0, -gate.copy()
        if always:
            # Sliding keeps h as it is: that h = 0 has to be asked for.
            time, state = np.array([begin]), x0[None, :]
            s = field.multipliers(time, state, values)
            rows = field.conditions(always)
            h = field.part("held", time, state, s, values)[0, rows, 0]
            slope = field.part("heldy", time, state, s, values)[0, rows, :n]
            back = linalg.pinv(slope)
            left, by_first = left + back @ h, by_first + back @ slope
        row = np.zeros((1, n)) if length is not None else speed[None, :]
        last = t - begin - length if length is not None else float(speed @ (x0 - reference))
        return Boundary(
            np.append(left, last), np.vstack([by_first, row]), np.vstack([np.eye(n), np.zeros((1, n))]),
            np.append(np.zeros(n), 1.0 if length is not None else 0.0), np.zeros((n + 1, 0)),
        )  # fmt: skip

    endings = [arc.ending for arc in arcs if arc.ending is not None]
    problem = BoundaryProblem(
        system, [arc.mode for arc in arcs], endings, p, boundary, size, jacobian=base.jacobian
    )
    total = float(arcs[-1].t[-1]) - begin
    counts = [int(np.clip(48 * (arc.t[-1] - arc.t[0]) / total, 6, 48)) for arc in arcs]
    mesh, steps = solved(problem, Mesh.from_arcs(arcs, counts))
    return Collocated(base, p, problem, mesh, tuple(steps))


def check_admissible(found: Collocated) -> None:
    """Raise WordError where a sign or a multiplier along the orbit is not what its mode says."""
    system, problem = found.problem.system, found.problem
    word = " ".join(map(mode_text, problem.modes))
    shortest = int(np.argmin(np.diff(found.mesh.times)))
    if not np.diff(found.mesh.times)[shortest] > 0:
        raise WordError(
            f"the orbit with the modes {word} is not admissible: it goes back in time in its arc "
            f"{shortest + 1}. Give a guess with the sequence of modes of the orbit."
        )
    for mode, steps in zip(problem.modes, found.steps, strict=True):
        field = mode_field(system, mode, (), problem.jacobian)
        x = steps.between(np.arange(_POINTS) / _POINTS).reshape(-1, problem.n)
        places = steps.grid[:-1, None] + np.diff(steps.grid)[:, None] * np.arange(_POINTS) / _POINTS
        t = (steps.t0 + places * (steps.t1 - steps.t0)).ravel()
        s = field.multipliers(t, x, found.p)
        h, radius = field.part("h", t, x, s, found.p)[:, :, 0], field.part("radius", t, x, s, found.p)
        for i, (sign, surface) in enumerate(zip(mode, system.surfaces, strict=True)):
            if sign == 0:
                over = np.maximum(s[:, i] - radius[:, i, 1], radius[:, i, 0] - s[:, i])
                size = 1.0
            else:
                over, size = -sign * h[:, i] - float(surface.width), float(np.max(np.abs(h[:, i])))
            worst = int(np.argmax(over))
            if over[worst] > _BEYOND * size:
                what = "its multiplier leaves its set" if sign == 0 else "it goes beyond the surface"
                raise WordError(
                    f"the orbit with the modes {word} is not admissible: in mode {mode_text(mode)} {what} on "
                    f"{surface.name!r} at t = {t[worst]:.6g}, by {over[worst]:.3g}. Give a guess with the "
                    "sequence of modes of the orbit."
                )


def polished(found: Collocated) -> tuple[Shooting, Array, float]:
    """The equations of multiple shooting on nodes of the orbit, their solution, and what is left of them.

    Raises NoConvergenceError where the exact solutions are not those that collocation found.
    """
    base, begin = found.base, float(found.mesh.times[0])
    length = found.period / base.symmetry_order
    times = _nodes(found)
    states, modes = zip(*(found.at(t) for t in times), strict=True)
    shares = np.diff([*times, begin + length]) / length
    speed = velocity_at(base.system, modes[0], begin, states[0], found.p, base.jacobian)
    problem = replace(
        base, reference=states[0].copy(), velocity=speed / np.linalg.norm(speed),
        t0=begin if base.period is not None else 0.0,
        unit=base.period(found.p) if base.period is not None else 0.0, shares=tuple(shares.tolist()),
        sliding=tuple(tuple(i for i, sign in enumerate(mode) if sign == 0) for mode in modes),
    )  # fmt: skip
    u = np.concatenate(states)
    u = u if base.period is not None else np.append(u, found.period)
    try:
        problem, refined, left = shoot(problem, u, found.p)
    except NoConvergenceError as error:
        raise NoConvergenceError(
            f"collocation found an orbit that the exact solutions do not confirm: {error}", error.residual
        ) from None
    sizes = np.tile(found.problem.size, len(times))
    moved = float(np.max(np.abs(refined - u)[: sizes.size] / sizes))
    if moved > _MOVED:
        raise NoConvergenceError(
            f"collocation found an orbit that the exact solutions move by {moved:.3g} of its size."
        )
    return problem, refined, left


def _nodes(found: Collocated) -> list[float]:
    """Times of nodes, the first state among them, between which displacements grow by about a factor of 10.

    An orbit with x(t + T/2) = -x(t) has the nodes of its first half again in the second.
    """
    mesh, size = found.mesh, found.problem.size
    begin, end = float(mesh.times[0]), float(mesh.times[-1])
    half = 0.5 * (begin + end)
    odd = found.base.symmetry_order == 1 and all(
        float(np.max(np.abs(found.at(t)[0] + found.at(t + half - begin)[0]) / size)) < _ODD
        for t in np.linspace(begin, half, 14)[:-1].tolist()
    )
    out, growth = [begin], np.eye(len(size))
    for t, matrix in found.factors():
        if odd and t >= half - 1e-9 * (half - begin):
            break
        growth = matrix @ growth
        at_event = float(np.min(np.abs(mesh.times - t))) < 1e-9 * (end - begin)
        if not at_event and np.linalg.norm(growth * size / size[:, None], 2) > _GROWTH:
            out.append(t)
            growth = np.eye(len(size))
    if odd and len(out) > 1:
        out += [t + half - begin for t in out]
    return out


def least_period(found: Collocated) -> int:
    """How often the orbit was traversed: the multiple of its least period with which it was found.

    That of a forced system is also one of the system, whose surfaces keep their signs: a part of the word is
    then a word.
    """
    base, begin = found.base, float(found.mesh.times[0])
    if base.symmetry_order > 1:
        return 1
    start = found.at(begin)[0]
    for count in range(32, 1, -1):
        gap = np.abs(found.at(begin + found.period / count)[0] - start) / found.problem.size
        if float(np.max(gap)) < _ODD and (base.period is None or _repeats(found, count)):
            return count
    return 1


def _repeats(found: Collocated, count: int) -> bool:
    """Whether the forced system repeats after a part of the period."""
    base = found.base
    size = np.max(np.abs(np.vstack(found.mesh.states)), axis=0)
    return repeats(
        base.system, found.p, size, float(found.mesh.times[0]), found.period, found.period / count,
        method=base.method, jacobian=base.jacobian, mirrored=False,
    )  # fmt: skip

