"""Search for a periodic orbit by collocation: from solutions of about one period, or from another orbit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from filippov import Solution, SolveError, Status
from filippov.analysis.orbits.arcs import WordError
from filippov.analysis.orbits.orbit import Orbit, make_orbit
from filippov.analysis.orbits.orbit_collocation import (
    anchored,
    check_admissible,
    collocate,
    guess_arcs,
    least_period,
    polished,
)
from filippov.analysis.orbits.shooting import NoConvergenceError, Shooting, onto_surfaces, resolved
from filippov.analysis.steady.forcing import Period
from filippov.base.arrays import Array
from filippov.solving.state.events import Mode
from filippov.solving.uncut import solve

# How many sequences of modes are tried, and how many states of what was found make up another guess.
_WORDS, _STATES = 4, 24


class CollocationSearch:
    """One search.

    base    period, symmetry and tolerances of the orbit; p: parameter values; size: extent of the guess
    solution  (state, time, length) -> Solution
    """

    def __init__(
        self, base: Shooting, p: Array, size: float, solution: Callable[[Array, float, float], Solution]
    ) -> None:
        self.base, self.p, self.size, self.solution = base, p, size, solution

    def pieces(self, points: Array, begin: float, length: float) -> list[Solution]:
        """Solutions from states at equal distances in time."""
        return [self.solution(x, begin + k * length, length) for k, x in enumerate(points)]

    def orbit(self, solutions: Sequence[Solution]) -> Orbit:
        """The orbit by collocation, from solutions that make up about one period (or the part of a symmetry).

        If the modes turn out not to be those of the orbit, solutions from its states are tried, and then a
        part of it in case it was traversed several times.
        """
        base, begin = self.base, solutions[0].problem.t_span[0]
        guess = float(solutions[-1].t_end - begin) * base.symmetry_order
        refused: SolveError | None = None
        for _ in range(_WORDS):
            first = base.gate @ solutions[0].problem.x0
            length = guess / base.symmetry_order
            mode = self.solution(first, begin + length, 1e-9 * length).start_mode
            arcs = guess_arcs(solutions, (mode, first))
            found = collocate(base, anchored(arcs) if base.symmetry_order == 1 else arcs, self.p)
            begin = float(found.mesh.times[0])
            extent = float(np.max(np.ptp(np.vstack(found.mesh.states), axis=0)))
            if extent <= 1e-5 * self.size or not 0.02 * guess < found.period < 50 * guess:
                raise NoConvergenceError("collocation went to an equilibrium or to another period.")
            part = found.period / base.symmetry_order
            try:
                check_admissible(found)
                count = least_period(found)
                if count == 1:
                    problem, u, left = polished(found)
                    orbit = make_orbit(problem, u, self.p, left)
                    if orbit.trivial is not None and abs(orbit.trivial - 1.0) > 1e-2:
                        raise NoConvergenceError("Newton's method went to an equilibrium.")
                    return orbit
                part /= count
                if base.period is not None:
                    self.base = base = replace(base, period=base.period.times(1.0 / count))
            except WordError as error:
                refused = error
            guess, share = part * base.symmetry_order, part / _STATES
            times = begin + share * np.arange(_STATES)
            points = np.array([self._on(*found.at(t), t) for t in times.tolist()])
            solutions = self.pieces(points, begin, share)
        raise NoConvergenceError(str(refused))

    def _on(self, x: Array, mode: Mode, t: float) -> Array:
        """The state, on the surfaces that its mode slides on."""
        on = tuple(i for i, sign in enumerate(mode) if sign == 0)
        return onto_surfaces(self.base.system, x, t, self.p, on)


def collocated_from(
    orbit: Orbit, parameters: Mapping[str, float] | None, rtol: float, atol: Any
) -> Orbit:
    """The orbit at other parameter values by collocation, from this one. Raises as `find_orbit` does."""
    system = orbit.system
    p = resolved(system, {**orbit.parameters, **(parameters or {})})
    old = resolved(system, orbit.parameters)
    known = orbit.problem or Shooting(
        system, orbit.x0, np.zeros_like(orbit.x0), orbit.t0, method=orbit.method,
        period=Period(system, orbit.period).following(old) if orbit.forced else None,
    )  # fmt: skip
    base = replace(known, rtol=rtol, atol=atol, shares=(1.0,), sliding=((),))
    values = dict(zip(system.parameters.names, p.tolist(), strict=True))

    def solution(x: Array, t: float, length: float) -> Solution:
        out = solve(
            system, x, (t, t + length), parameters=values, rtol=rtol, atol=atol, method=base.method,
            zeno="continue", nonunique="stick",
        )  # fmt: skip
        if out.status is not Status.SUCCESS:
            raise SolveError(f"the solution from the guess ended early: {out.message}", out)
        return out

    search = CollocationSearch(base, p, float(np.max(orbit.high - orbit.low)), solution)
    length = (base.period(p) if base.period is not None else orbit.period) / base.symmetry_order / _STATES
    begins = [piece.problem.t_span[0] for piece in orbit.pieces]
    points = []
    for t in (orbit.t0 + orbit.period / base.symmetry_order / _STATES * np.arange(_STATES)).tolist():
        piece = orbit.pieces[max(int(np.searchsorted(begins, t, side="right")) - 1, 0)]
        assert piece.sol is not None
        on = tuple(i for i, sign in enumerate(piece.mode_at(t, "+")) if sign == 0)
        points.append(onto_surfaces(system, np.asarray(piece.sol(t, side="+")), t, p, on))
    return search.orbit(search.pieces(np.array(points), base.begin(p), length))
