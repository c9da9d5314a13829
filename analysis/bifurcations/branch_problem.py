"""What a continuation can follow: fixed points of a map, orbits.

A problem has unknowns u and one parameter; `evaluate` gives residual and matrix, `point` describes a
solution and gives its test functions. Equilibria are in `filippov.analysis.bifurcations.equilibrium_branch`,
zeros of a function in `filippov.analysis.bifurcations.function_problem`.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from scipy.optimize import brentq

from filippov import EventKind, Solution, Status, System, UsageError
from filippov.analysis.algebra.growth import ACCURACY, by_multipliers
from filippov.analysis.bifurcations.branch import BranchPoint
from filippov.analysis.bifurcations.reset_sides import reset_sides
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.set_slope import log_slope, near_set
from filippov.analysis.orbits.orbit import Orbit, cycle_of_modes, make_orbit, whole_period
from filippov.analysis.orbits.shooting import NoConvergenceError, velocity_at
from filippov.analysis.orbits.time_limit import time_left
from filippov.analysis.sensitivity.saltation import derivative_by_all
from filippov.base.arrays import Array, Complex
from filippov.base.changed import changed
from filippov.base.names import unknown
from filippov.graphs.word import word_of
from filippov.solving.uncut import solve

# A cycle this much smaller than at the start is taken to shrink into the equilibrium set.
_SHRUNK = 1e-5
# One this much smaller is followed in steps that multiply d by 0.4, where the parameters' part of the tangent
# is below _STILL.
_SMALL, _LONGEST_STEP, _STILL = 0.05, 0.3, 0.1
# It joins the set where its branch is this near to it, in widths of the bounds; it is followed down to so
# many times the least coordinate that rounding leaves.
# Where the slope at the set is farther than this from 1, in its logarithm, the cycle does not join it.
_JOINS, _SLACK, _FAR = 1e-3, 100.0, 0.1
# An event this near to the initial state of an orbit, relative to its duration, moves that state.
_CLOSE = 0.03
# The number of cached jets of a map: a curve needs those of neighbours, and again with another border.
_KEPT = 64
_SWITCHES = (EventKind.CROSSING, EventKind.ENTRY, EventKind.EXIT, EventKind.RESET, EventKind.TIME)


class BranchProblem(Protocol):
    """Equations F(u, value) = 0 with m unknowns."""

    kind: str
    scale: Array
    start: Array

    def evaluate(self, u: Array, value: float) -> tuple[Array, Array]:
        """Residual (m,) and its derivatives by u and the parameter (m, m + 1)."""

    def point(self, u: Array, value: float) -> BranchPoint:
        """The solution's description with test functions."""

    def moved(self, u: Array, value: float) -> BranchProblem:
        """The problem for the next step, its phase condition moved here."""


# So many of the smallest coordinates that rounding leaves are well resolved.
_RESOLVED = 1e7


class MapProblem:
    """Fixed points R(d) = d of an event map, as R(d)/d - 1 over log d where the map rests at 0."""

    kind = "map"

    def __init__(self, event_map: EventMap, parameter: str, start: float) -> None:
        self.event_map, self.parameter = event_map, parameter
        self.names = (parameter,)
        self.rests = event_map(0.0) == 0.0 and start > 0
        self.least = 0.0
        if self.rests:
            near, self.least = near_set(event_map, abs(start))
            # Small cycles need the absolute tolerance that rounding leaves.
            self.event_map = event_map = event_map.remake(atol=np.minimum(event_map.atol, near.atol))
        # At the set its slope is read from coordinates that are small, but resolved.
        self.reach = max(1e-3 * abs(start), min(abs(start), _RESOLVED * self.least)) or 1e-3
        self.scale = np.array([3.0 if self.rests else abs(start) or 1e-3])
        # Of an odd map the second iterate's fixed points are those of -R, at half the work.
        self.half = event_map.order == 2 and self._odd(start)
        if self.half:
            self.event_map = event_map.remake(order=1)
        self.start = np.array([np.log(start) if self.rests else start])
        self._jets: dict[tuple[float, float, bytes], Array] = {}

    def with_parameter(self, name: str, value: float) -> MapProblem:
        """The same at another value of another parameter; jets are kept for both."""
        return changed(self, event_map=self.event_map.remake(parameters={name: value}))

    def doubled(self) -> MapProblem:
        """The fixed points of twice as many returns; for an odd map those without the symmetry."""
        event_map = self.event_map.remake(order=2 * self.event_map.order)
        return changed(self, event_map=event_map, half=False, _jets={})

    def _odd(self, start: float) -> bool:
        """Whether -R has the fixed point that R(R) has, and R is odd there."""
        once = self.event_map.remake(order=1)
        d = np.array([start, -start, 0.5 * start, -0.5 * start])
        image = once(d)
        odd = np.allclose(image[::2], -image[1::2], rtol=1e-8, atol=0)
        return bool(odd and abs(image[0] + start) < 1e-3 * abs(start))

    def d(self, u: Array) -> float:
        """The coordinate on the section."""
        return float(np.exp(u[0]) if self.rests else u[0])

    def jet(self, u: Array, value: float) -> Array:
        """R(d), dR/dd, dR/dparameter; those of the last calls are kept."""
        event_map = self.event_map.remake(parameters={self.parameter: value})
        key = float(u[0]), value, event_map.p.tobytes()
        if key not in self._jets:
            jet = event_map.jet(self.d(u), self.names)
            if not np.all(np.isfinite(jet)):
                raise NoConvergenceError(f"the map does not return at d = {self.d(u):.6g}.")
            while len(self._jets) >= _KEPT:
                del self._jets[next(iter(self._jets))]
            self._jets[key] = -jet if self.half else jet
        return self._jets[key]

    def room(self, u: Array, tangent: Array) -> float:
        """The longest step where a branch, or a curve of special points, approaches the equilibrium set: a
        small cycle shrinks while the parameters hardly change; 0 elsewhere."""
        small = self.rests and u[0] < self.start[0] + np.log(_SMALL)
        return _LONGEST_STEP if small and np.linalg.norm(tangent[1:]) < _STILL else 0.0

    def evaluate(self, u: Array, value: float) -> tuple[Array, Array]:
        """See `BranchProblem`."""
        jet, d = self.jet(u, value), self.d(u)
        if self.rests:
            ratio = jet[0] / d
            return np.array([ratio - 1.0]), np.array([[jet[1] - ratio, jet[2] / d]])
        return np.array([jet[0] - d]), np.array([[jet[1] - 1.0, jet[2]]])

    def point(self, u: Array, value: float) -> BranchPoint:
        """See `BranchProblem`."""
        jet, d = self.jet(u, value), self.d(u)
        half = float(jet[1])
        slope = half**2 if self.half else half
        name = "symmetry breaking" if self.half else "period doubling"
        return BranchPoint(
            value, tuple(u.tolist()), {self.event_map.section.coordinate: d, "slope": slope},
            (complex(slope),), by_multipliers(half, ACCURACY * self.event_map.rtol),
            tests={name: half + 1.0}, residual=abs(float(jet[0]) - d),
        )  # fmt: skip

    def moved(self, u: Array, value: float) -> MapProblem:
        """See `BranchProblem`."""
        return self

    def ending(self, u: Array, value: float, bounds: tuple[float, float]) -> BranchPoint | None:
        """The end of the branch where it shrinks into the equilibrium set at 0; None while it does not.

        There the slope of the map at the set is 1, which is solved for, within the bounds. A cycle that is
        too near to the set for the rounding of its states, while the slope is 1 elsewhere, ends the branch
        by name.
        """
        if not self.rests:
            return None
        width, tiny = bounds[1] - bounds[0], u[0] <= np.log(_SLACK * self.least)
        if not tiny and u[0] > self.start[0] + np.log(_SHRUNK):
            return None
        if not tiny and abs(self._excess(value)) > _FAR:
            return None
        at = self._set_changes(value, bounds)
        if at is not None and abs(at - value) < _JOINS * width:
            return BranchPoint(
                at, (float("-inf"),), {self.event_map.section.coordinate: 0.0, "slope": 1.0},
                (1.0 + 0j,), "undecided", special="cycle shrinks into the equilibrium set",
                note="the set changes stability",
            )  # fmt: skip
        if not tiny:
            return None
        where = "outside the bounds" if at is None else f"at {at:.6g}"
        return replace(
            self.point(u, value), special="cycle below rounding",
            note=f"the set changes stability {where}; nearer to it cycles are not resolved",
        )  # fmt: skip

    def _excess(self, value: float) -> float:
        """The logarithm of the slope at the set."""
        return log_slope(self.event_map, self.reach, **{self.parameter: value})

    def _set_changes(self, value: float, bounds: tuple[float, float]) -> float | None:
        """The parameter next to `value`, within the bounds, where the slope at the set is 1, or None."""
        here, reach = self._excess(value), 1e-4 * (bounds[1] - bounds[0])
        last = dict.fromkeys((-1.0, 1.0), (value, here))
        for _ in range(14):
            for side, (inner, before) in last.items():
                end = min(max(value + side * reach, bounds[0]), bounds[1])
                there = self._excess(end) if end != inner else before
                if np.isfinite(before * there) and before * there < 0:
                    return float(brentq(self._excess, inner, end, xtol=1e-12, rtol=1e-14))
                last[side] = end, there
            reach *= 2.0
        return None


def check_varied(system: System, parameter: str, start: Any) -> None:
    """Raise UsageError for a parameter that is not known, or that stands in none of the formulas."""
    if parameter not in system.parameters:
        raise UsageError(unknown("parameter", parameter, system.parameters.names))
    form = system.symbolic
    if form is None or (isinstance(start, tuple) and isinstance(start[0], EventMap)):
        return  # functions, and a section, may depend on it
    written = (*form.expressions(), *(q for event in system.time_events for q in event.expressions()))
    used = {symbol.name for formula in written for symbol in formula.free_symbols}
    if parameter not in used:
        others = ", ".join(name for name in system.parameters.names if name in used) or "none"
        raise UsageError(
            f"parameter {parameter!r} stands in no equation, surface, reset or clock of the system: nothing "
            f"varies with it. Vary one that does: {others}."
        )


# A state that moves by less than this part of it, or than so many absolute tolerances, has no extent.
_HELD, _NOISE = 1e-9, 1e3


def _sizes(orbit: Orbit) -> Array:
    """The unit of each state along a branch: its extent; of one that is held its value, as it may vary along
    the branch; of one that is held at 0 the largest of the others, 1 where all are, as by a sliding mode."""
    assert orbit.problem is not None
    extent, place = orbit.high - orbit.low, np.maximum(np.abs(orbit.high), np.abs(orbit.low))
    noise = _NOISE * np.asarray(orbit.problem.atol)
    size = np.where(extent > np.maximum(_HELD * place, noise), extent, np.where(place > noise, place, 0.0))
    largest = float(np.max(place))
    return np.where(size > 0.0, size, np.max(size) or (largest if largest > np.max(noise) / _NOISE else 1.0))


class OrbitProblem:
    """Periodic orbits by (multiple) shooting."""

    kind = "orbit"

    def __init__(self, orbit: Orbit, parameter: str) -> None:
        assert orbit.problem is not None
        assert orbit.unknowns is not None
        self.parameter, self.names = parameter, (parameter,)
        self.shooting = orbit.problem
        if orbit.symmetric and self.shooting.symmetry_order == 1 and len(self.shooting.shares) == 1:
            # Half the work, and the branch cannot change to one without the symmetry.
            self.shooting = replace(self.shooting, symmetry=-np.eye(self.shooting.n), symmetry_order=2)
        self.base = orbit.system.parameters.resolve(dict(orbit.parameters))
        self.index = orbit.system.parameters.index(parameter)
        self.start = orbit.unknowns
        # Of an autonomous orbit, in periods from the state at which the branch began.
        self.shift = 0.0
        parts = [np.tile(_sizes(orbit), len(self.shooting.shares))]
        if self.shooting.period is None:
            parts.append(np.array([orbit.period]))
        self.scale = np.concatenate(parts)
        self._last: tuple[bytes, float, list[Any]] | None = None
        self._equations: tuple[list[Any], Array, Array] | None = None

    @property
    def rows(self) -> Array:
        """Units of the equations: of the states, and of the phase condition."""
        sizes = np.resize(self.scale[: self.shooting.n], self.shooting.n * len(self.shooting.shares))
        if self.shooting.period is not None:
            return sizes
        phase = float(np.linalg.norm(self.shooting.velocity * sizes[: self.shooting.n]))
        return np.append(sizes, phase or 1.0)

    def p(self, value: float) -> Array:
        """Parameter values, checked against their bounds."""
        names = self.shooting.system.parameters.names
        values = dict(zip(names, self.base.tolist(), strict=True))
        return np.asarray(self.shooting.system.parameters.resolve({**values, self.parameter: value}))

    @property
    def phase(self) -> float:
        """Of the first node in periods: of the forcing, or along the branch."""
        return self.shift if self.shooting.period is None else self.shooting.phase

    def with_parameter(self, name: str, value: float) -> OrbitProblem:
        """The same at another value of another parameter."""
        base = self.base.copy()
        base[self.shooting.system.parameters.index(name)] = value
        return changed(self, base=base, _last=None)

    def _shot(self, **parts: Any) -> OrbitProblem:
        """The same with other parts of the shooting."""
        return changed(self, shooting=replace(self.shooting, **parts), _last=None)

    def with_system(self, system: System) -> OrbitProblem:
        """The same equations for another system of the same states and parameters."""
        return self._shot(system=system)

    def doubled(self) -> OrbitProblem:
        """The orbits of twice the period, of a symmetric orbit those of its period without the symmetry.

        Raises UsageError for an orbit of several nodes.
        """
        shooting = self.shooting
        if len(shooting.shares) != 1:
            raise UsageError("the orbit has several nodes; find it with one (nodes=1) to leave it there.")
        if shooting.symmetry_order > 1:
            return self._shot(symmetry=None, symmetry_order=1)
        if shooting.period is not None:
            return changed(self, shooting=shooting.times(2), _last=None)
        return changed(self, scale=np.append(self.scale[:-1], 2 * self.scale[-1]), _last=None)

    def phased(self, u: Array, value: float, t: float) -> tuple[OrbitProblem, Array]:
        """The same orbit of a forced system from another state of it, and that state: one after which the
        time t is inside the solution. Unchanged where the orbit has several nodes or is not forced."""
        shooting = self.shooting
        if shooting.period is None or len(shooting.shares) != 1:
            return self, u
        solution = self.solutions(u, value)[0]
        low, high = solution.problem.t_span
        for share in (0.37, 0.55, 0.22, 0.71):
            at = low + (t - low - share * (high - low)) % (high - low)
            if 0 not in next((s.mode for s in solution.segments if s.t0 < at < s.t1), (0,)):
                break
        else:
            return self, u
        state, period = solution.sol(at), shooting.period(self.p(value))
        return self._shot(t0=at % period, unit=period, sliding=((),)), state

    def solutions(self, u: Array, value: float) -> list[Any]:
        """The solutions from the nodes; those of the last call are kept."""
        key = u.tobytes()
        if self._last is None or self._last[:2] != (key, value):
            self._last = (key, value, self.shooting.solutions(u, self.p(value)))
        return self._last[2]

    def word(self, u: Array, value: float) -> str:
        """The mode word of the orbit, as its point has it."""
        p, system = self.p(value), self.shooting.system
        whole = whole_period(self.shooting, u, p, self.solutions(u, value))
        return _told(word_of(cycle_of_modes(whole), system), whole, p)

    def facing(self, u: Array, value: float) -> float:
        """The cosine of the angle between an autonomous orbit at its first node and the normal of the phase
        condition, with and without units of the states the lesser one; 1 where there is no such condition."""
        shooting = self.shooting
        if shooting.period is not None:
            return 1.0
        here, before = shooting.at(u, self.p(value), self.solutions(u, value)).velocity, shooting.velocity
        unit = self.scale[: shooting.n]
        pairs = ((here, before), (here / unit, before / unit))
        return min(float(a @ b) / (float(np.linalg.norm(a) * np.linalg.norm(b)) or 1.0) for a, b in pairs)

    def residual(self, u: Array, value: float) -> Array:
        """The residual of the equations."""
        return self.shooting.residual(u, self.solutions(u, value), self.p(value))

    def evaluate(self, u: Array, value: float) -> tuple[Array, Array]:
        """See `BranchProblem`."""
        p, solutions = self.p(value), self.solutions(u, value)
        if self._equations is None or self._equations[0] is not solutions:
            matrix = self.shooting.matrix(u, solutions, p, self.names)
            self._equations = solutions, self.shooting.residual(u, solutions, p), matrix
        return self._equations[1:]

    def orbit(self, u: Array, value: float, margins: bool = False) -> Orbit:
        """The orbit with these unknowns."""
        p, solutions = self.p(value), self.solutions(u, value)
        left = float(np.max(np.abs(self.shooting.residual(u, solutions, p))))
        return make_orbit(self.shooting, u, p, left, solutions, margins=margins)

    def point(self, u: Array, value: float) -> BranchPoint:
        """See `BranchProblem`."""
        orbit = self.orbit(u, value)
        half = orbit.half_multipliers
        tests = {"Neimark-Sacker": pairs(orbit.multipliers if half is None else half)}
        if half is not None:
            tests["symmetry breaking"] = product(half + 1.0)
        else:
            tests["period doubling"] = product(orbit.multipliers + 1.0)
        names = orbit.system.states
        data = {"period": orbit.period}
        for i, name in enumerate(names):
            data[f"max {name}"], data[f"min {name}"] = float(orbit.high[i]), float(orbit.low[i])
            data[f"amplitude {name}"] = 0.5 * float(orbit.high[i] - orbit.low[i])
        word = _told(orbit.word, orbit.solutions, self.p(value))
        return BranchPoint(
            value, tuple(u.tolist()), data, tuple(complex(v) for v in orbit.multipliers), orbit.verdict,
            word, orbit.modes, orbit.period, tests, orbit.residual, phase=self.phase,
        )  # fmt: skip

    def in_phase(self, u: Array, value: float, direction: Array) -> Array:
        """A direction (u, value) along a branch of autonomous orbits, less what only shifts them in phase: as
        the phase condition at this solution has it."""
        shooting = self.shooting
        if shooting.period is not None:
            return direction
        p, n, out = self.p(value), shooting.n, direction.copy()
        speeds = [
            velocity_at(
                shooting.system, one.start_mode, one.problem.t_span[0], one.problem.x0, p, shooting.jacobian
            )
            for one in self.solutions(u, value)
        ]
        size = float(speeds[0] @ speeds[0])
        if size:
            out[: n * len(speeds)] -= float(speeds[0] @ direction[:n]) / size * np.concatenate(speeds)
        return out

    def at_phase(self, phase: float) -> OrbitProblem:
        """The same equations from another phase, in periods, off the surfaces."""
        shooting = self.shooting
        if len(shooting.shares) != 1 or phase == self.phase:
            return self
        if shooting.period is None:
            return changed(self._shot(sliding=((),)), shift=phase)
        return self._shot(t0=phase * shooting.unit, sliding=((),))

    def rephased(self, u: Array, value: float) -> tuple[OrbitProblem, Array, Array] | None:
        """The same orbit from a phase away from its events, where one comes near the first state of u.

        Returns the equations, their unknowns there, and the derivatives of these by (u, parameter):
        (size, size + 1). None where no event is near, there is no better phase, or the orbit has several
        nodes.
        """
        shooting = self.shooting
        if len(shooting.shares) != 1:
            return None
        solution = self.solutions(u, value)[0]
        low, high = solution.problem.t_span
        times = sorted(e.t for e in solution.events if e.kind in _SWITCHES)
        if not times or min(times[0] - low, high - times[-1]) > _CLOSE * (high - low):
            return None
        # Between neighbours on the circle; the segment that spans the end is examined in both parts.
        gaps = [(b - a, 0.5 * (a + b)) for a, b in pairwise(times)]
        gaps += [(times[0] - low, 0.5 * (times[0] + low)), (high - times[-1], 0.5 * (high + times[-1]))]
        free = [(width, t) for width, t in gaps if 0 not in solution.mode_at(t, "+")]
        width, t = max(free, default=(0.0, low))
        if width < 4 * _CLOSE * (high - low):
            return None
        n, p = shooting.n, self.p(value)
        part = solve(
            shooting.system, u[:n], (low, t), parameters=solution.problem.parameters, rtol=shooting.rtol,
            atol=shooting.atol, method=shooting.method, max_time=time_left(), zeno="continue",
            nonunique="stick",
        )  # fmt: skip
        if part.status is not Status.SUCCESS:
            return None
        by = derivative_by_all(part, False, self.names, shooting.jacobian)
        if shooting.period is None:
            carried = np.eye(n + 1, n + 2)
            carried[:n, :n], carried[:n, n + 1] = by[:n, :n], by[:n, n]
            whole = self.at_phase(self.shift + (t - low) / float(u[n]))
            return whole, np.append(part.x_end, u[n]), carried
        period = shooting.period(p)
        speed = velocity_at(shooting.system, part.end_mode, t, part.x_end, p, shooting.jacobian)
        moves = float(shooting.period.slope(p, self.names)[0])
        carried = by[:n, : n + 1].copy()
        carried[:, n] += (by[:n, -1] * shooting.phase + speed * (t - low) / period) * moves
        return self.at_phase(t / period), part.x_end, carried

    def moved(self, u: Array, value: float) -> OrbitProblem:
        """See `BranchProblem`."""
        # The solutions do not depend on the phase condition.
        solutions = self.solutions(u, value)
        shooting = self.shooting.attached(u, solutions, self.p(value))
        known = self._last if shooting.sliding == self.shooting.sliding else None
        return changed(
            self, shooting=shooting.at(u, self.p(value), solutions), _equations=None, _last=known
        )


def _told(word: str, solutions: Sequence[Solution], p: Array) -> str:
    """The word of a period with the number of its resets, and the sides of their kinks on which they are."""
    count = len(solutions[0].system.surfaces)
    jumps = sum(e.kind is EventKind.RESET and e.index < count for one in solutions for e in one.events)
    word += f" with {jumps} resets" if jumps else ""
    sides = reset_sides(solutions, p)
    return f"{word}; {sides}" if sides else word


def product(values: Complex) -> float:
    """The product of conjugate numbers: real."""
    return float(np.prod(values).real) if values.size else 1.0


def pairs(values: Complex, sums: bool = False) -> float:
    """Product of 1 - a b over pairs: 0 where a pair is on the unit circle; `sums`: of a + b."""
    both = itertools.combinations(values, 2)
    return product(np.array([a + b if sums else 1.0 - a * b for a, b in both], dtype=complex))
