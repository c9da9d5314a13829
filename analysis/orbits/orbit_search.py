"""Find a periodic orbit: from a state on or near it, a solution that approaches it, or another orbit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import dist
from typing import Any

import numpy as np

from filippov import Solution, SolveError, Status, System, UsageError
from filippov.analysis.orbits.collocation_search import CollocationSearch, collocated_from
from filippov.analysis.orbits.no_derivative import with_cure
from filippov.analysis.orbits.orbit import Orbit, make_orbit
from filippov.analysis.orbits.search_start import anchor, extent, rests, return_time, settled, settling
from filippov.analysis.orbits.shooting import (
    NoConvergenceError,
    ReturnError,
    Shooting,
    least,
    newton,
    onto_surfaces,
    resolved,
    shortest,
    suited,
    symmetry_matrix,
    velocity_at,
)
from filippov.analysis.steady.forcing import Period, is_forced
from filippov.base.arrays import Array
from filippov.base.given import Amount, NonNegative, Positive
from filippov.base.keywords import keywords
from filippov.solving.state.events import Mode
from filippov.solving.state.option_types import Tolerance
from filippov.solving.state.options import check_state
from filippov.solving.uncut import solve

_SPANS = 12
# Periods of a forced solution after which its best returns are tried, and how many of them.
_STAGES, _TRIES = (1, 8, 32, 128, 512), 5
# How many returns collocation is tried with, and how many of them with the same sequence of modes; the nodes
# of shooting that finds another one.
_RETURNS, _TRIES_OF_WORD, _MANY = 32, 2, 16
# A solution may be seen to come back only after some returns.
_MOST_TURNS = 32
# How often collocation is tried where shooting fails on the returns of one solution: each time that is
# farther from an orbit that repels, and longer.
_STRONG = 3
# The most events of the first solution in which a return is looked for, and up to where they are doubled.
_EVENTS, _MOST_EVENTS = 2000, 64_000
# How many times the extent of a guess of one period is not that of its orbit.
_AWAY = 100.0
COLLOCATION = "collocation"
# A forced solution is back where it started, on an orbit, to this part of its extent.
_BACK = 1e-4


@keywords()
@with_cure()
def find_orbit(
    system: System,
    guess: Any = None,
    *,
    parameters: Mapping[str, float] | None = None,
    period: Any = None,
    symmetry: Any = None,
    nodes: Amount = 1,
    transient: NonNegative = 0.0,
    t_max: Positive = 1000.0,
    t0: float = 0.0,
    rtol: Positive = 1e-11,
    atol: Tolerance = 1e-13,
    method: str = "DOP853",
    jacobian: Callable[..., Any] | None = None,
    progress: Callable[[float, float, str], None] | None = None,
) -> Orbit:
    """The periodic orbit near a state, stable or not, by Newton's method on a return or multiple shooting.

    guess       a state on or near the orbit, or one from which the solution approaches it, in order or by
                name; a Solution (its end); an Orbit (of other parameter values); several states (k, n) on it,
                at equal distances in time over one period: the nodes of multiple shooting (needs the period)
    period      autonomous: a guess of T, for an orbit that does not attract; without it the first return of
                the solution is used. Forced: the period, a number or a formula in the parameters such as
                "2*pi/omega", or a multiple of the forcing's for subharmonic orbits; default: read off the
                sines and cosines of t and the clocks, and the least multiple after which the solution from
                the guess comes back. The orbit has its least period, a part of the given one where orbit and
                system repeat after it (the system at other parameter values too)
    symmetry    "odd" for x(t + T/2) = -x(t), or a matrix G for x(t + T/k) = G x(t): the part of the orbit is
                solved for. An odd orbit is also recognised without it
    nodes       points of multiple shooting, for orbits that repel strongly
    transient   time to run before the search; t_max: longest time of the search
    t0          time of the guess, for a forced system; at a tick of a clock it is the state after it
    method      integration method of the solutions; or "collocation": the sequence of modes is taken from the
                solution of the guess, and the orbit solved for by collocation on an adapted mesh, for orbits
                that repel strongly. It places its own nodes for the exact solutions (DOP853) that confirm it;
                the other methods switch to it if shooting does not converge
    jacobian    of a system of plain functions, (t, x, p, s) -> df/dx with the signs held; else differences
    progress    called with (t, t_max, note)

    Raises ReturnError (NO_RETURN) where the solution comes to rest or does not return within t_max,
    NoConvergenceError, NotDifferentiableError where the search or the orbit grazes a surface or impacts
    accumulate on it, SolveError, UsageError, ModelError.
    """
    if nodes < 1:
        raise UsageError(f"nodes is {nodes!r}, expected 1, 2, ...")
    collocation = method == COLLOCATION
    if collocation and nodes != 1:
        raise UsageError(f"nodes is {nodes!r}: collocation lays its own. Leave nodes out.")
    method = "DOP853" if collocation else method
    if isinstance(guess, Orbit) and not collocation:
        values = {**guess.parameters, **(parameters or {})}
        return refine(guess, values, rtol=rtol, atol=atol)
    if isinstance(guess, Orbit):
        return collocated_from(guess, parameters, rtol, atol)
    if isinstance(guess, Solution):
        parameters = {**guess.problem.parameters, **(parameters or {})}
        guess, t0 = guess.x_end, guess.t_end
    if guess is None:
        raise UsageError("find_orbit needs a guess: a state on or near the orbit, a Solution or an Orbit.")
    several = _has_rows(guess)
    rows = guess if several else [guess]
    points = np.array([check_state(row, system) for row in rows])
    x0 = points[0]
    p = resolved(system, parameters)
    matrix, symmetry_order = symmetry_matrix(symmetry, system)
    forced = is_forced(system) or (period is not None and not isinstance(period, int | float))
    base = Shooting(
        system, x0, np.zeros_like(x0), t0, period=Period(system, period).following(p) if forced else None,
        symmetry=matrix, symmetry_order=symmetry_order, rtol=rtol, atol=atol, method=method,
        jacobian=jacobian,
    )  # fmt: skip
    search = _Search(base, p, nodes, t_max, progress, collocation)
    if several:
        if period is None and base.period is None:
            raise UsageError("several states are given as nodes; they need the period of the orbit.")
        return search.nodes_at(points, t0, base.period(p) if base.period is not None else float(period))
    if transient > 0:
        x0, t0 = search.run(x0, t0, transient)
    if base.period is not None:
        return search.forced(x0, t0, follow=period is None)
    if period is not None:
        if not 0 < float(period) < np.inf:
            raise UsageError(f"period is {period!r}, expected a number > 0.")
        return search.near(x0, t0, float(period))
    return search.autonomous(x0)


@keywords()
@with_cure()
def refine(
    orbit: Orbit, parameters: Mapping[str, float] | None = None, rtol: Positive | None = None,
    atol: Tolerance | None = None,
) -> Orbit:  # fmt: skip
    """The orbit at other parameter values or tolerances, by Newton's method from this one."""
    if orbit.problem is None or orbit.unknowns is None:
        return find_orbit(
            orbit.system, orbit.x0, parameters={**orbit.parameters, **(parameters or {})}, t0=orbit.t0,
            period=None if orbit.forced else orbit.period, rtol=rtol or orbit.rtol, atol=atol or orbit.atol,
            method=orbit.method,
        )  # fmt: skip
    problem = replace(orbit.problem, rtol=rtol or orbit.rtol, atol=atol or orbit.atol)
    p = resolved(orbit.system, {**orbit.parameters, **(parameters or {})})
    problem, u, left = newton(problem, orbit.unknowns, p)
    solutions = problem.solutions(u, p)
    return make_orbit(problem.at(u, p, solutions), u, p, left, solutions)


def _has_rows(guess: Any) -> bool:
    """Whether states stand in rows; the entries of one may be quantities, which numpy does not take."""
    if isinstance(guess, np.ndarray):
        return guess.ndim == 2
    first = guess[0] if isinstance(guess, list | tuple) and guess else None
    return isinstance(first, list | tuple) or (isinstance(first, np.ndarray) and first.ndim == 1)


class _Search:
    """One search, with what it shares."""

    def __init__(
        self, base: Shooting, p: Array, nodes: int, t_max: float, progress: Callable[..., None] | None,
        collocation: bool = False,
    ) -> None:  # fmt: skip
        self.collocation, self.failed, self.strong = collocation, "", 0
        self.base, self.p, self.nodes, self.t_max, self.progress = base, p, nodes, t_max, progress
        self.values = dict(zip(base.system.parameters.names, p.tolist(), strict=True))
        self.size, self.piece = 0.0, np.inf

    @property
    def scale(self) -> float:
        """The extent that an orbit is compared with: of all that was seen, but a solution that goes away from
        an orbit that repels, without bound, is seen along the guess only."""
        return min(self.size, _AWAY * self.piece)

    def solution(
        self, x0: Array, t0: float, length: float, dense: bool = True, most: int | None = None
    ) -> Solution:
        """A solution from x0. Raises SolveError where it ends early, but after `most` events, if given."""
        base = self.base
        budget: dict[str, Any] = {} if most is None else {"max_events": most}
        out = solve(
            base.system, x0, (t0, t0 + length), parameters=self.values, rtol=base.rtol, atol=base.atol,
            method=base.method, zeno="continue", nonunique="stick", dense_output=dense, **budget,
        )  # fmt: skip
        if out.status is not Status.SUCCESS and (most is None or out.status is not Status.MAX_EVENTS):
            raise SolveError(f"the solution from the guess ended early: {out.message}", out)
        return out

    def state(self, solution: Solution, t: float) -> Array:
        """The state at t, on the surfaces that the solution slides on there: its dense output may be off."""
        if solution.sol is None:
            return solution.x_end
        sliding = tuple(i for i, sign in enumerate(solution.mode_at(t, "+")) if sign == 0)
        return onto_surfaces(self.base.system, np.asarray(solution.sol(t, side="+")), t, self.p, sliding)

    def run(self, x0: Array, t0: float, length: float) -> tuple[Array, float]:
        """Where a transient leads."""
        end = self.solution(x0, t0, length, dense=False)
        return end.x_end, end.t_end

    def tell(self, t: float, note: str) -> None:
        """Report progress."""
        if self.progress is not None:
            self.progress(t, self.t_max, note)

    # -- forced ------------------------------------------------------------------------------------------

    def forced(self, x0: Array, t0: float, follow: bool) -> Orbit:
        """Newton's method on the stroboscopic map; where it fails, again from the best returns of more and
        more periods, with more nodes.

        follow: the orbit may take several periods, as many as the solution from the guess needs to come back
        """
        forcing, base, nodes = self.base.period, self.base, self.nodes
        assert forcing is not None
        count = self._subharmonic(x0, t0, forcing(self.p)) if follow else 1
        if count > 1:
            self.base = replace(base, period=forcing.times(count))
            try:
                return self._stroboscopic(x0, t0)
            except NoConvergenceError:
                self.base, self.nodes = base, nodes
        return self._stroboscopic(x0, t0, follow)

    def _stroboscopic(self, x0: Array, t0: float, follow: bool = False) -> Orbit:
        """The orbit of the period that `base` has; follow: of several where it settles to one."""
        forcing = self.base.period
        assert forcing is not None
        period, nodes = forcing(self.p), self.nodes
        error: Exception | None = None
        gaps: list[float] = []
        states, tried = [x0], set[int]()
        for stage in _STAGES:
            while len(states) <= stage:
                states.append(self.run(states[-1], t0 + len(gaps) * period, period)[0])
                gaps.append(dist(states[-1], states[-2]))
            found = self._settled(states, t0) if follow else None
            if found is not None:
                return found
            # An orbit that repels is where the solution came back best; one that attracts, at its end.
            order = [k for k in np.argsort(gaps) if k not in tried][: _TRIES if stage > 1 else 1]
            if self.collocation:
                found = self._returned(states, gaps, t0, period)
                if found is not None:
                    return found
            for count in (nodes,) if stage == 1 else (nodes, max(4, nodes), max(_MANY, nodes)):
                self.nodes = count
                for k in order:
                    try:
                        found = self._shot(self.solution(states[k], t0 + k * period, period), period)
                        if self.collocation:
                            return self._collocated(found.pieces)
                        return self._with(nodes, found, period)
                    except NoConvergenceError as failed:
                        error = failed
            tried |= {int(k) for k in order}
            self.tell(stage * period, f"after {stage} periods")
        found = None if self.collocation else self._returned(states, gaps, t0, period)
        if found is not None:
            return found
        raise NoConvergenceError(
            f"no periodic orbit was found in {stage} periods of the forcing. {error or ''}{self.failed}"
        )

    def _settled(self, states: list[Array], t0: float) -> Orbit | None:
        """The orbit of several periods to which the last states at strobes have come; None without one."""
        base, forcing, count = self.base, self.base.period, settled(states, _MOST_TURNS)
        if count == 1 or forcing is None:
            return None
        self.base, period = replace(base, period=forcing.times(count)), forcing(self.p)
        try:
            last = self.solution(states[-1], t0 + (len(states) - 1) * period, count * period)
            found = self._shot(last, count * period)
            return self._collocated(found.pieces) if self.collocation else found
        except SolveError:
            self.base = base
            return None

    def _returned(self, states: list[Array], gaps: list[float], t0: float, period: float) -> Orbit | None:
        """The orbit by collocation from the best returns of each sequence of modes; None without one."""
        tried: dict[Any, int] = {}
        for k in np.argsort(gaps)[:_RETURNS].tolist():
            try:
                laid = self._laid(self.solution(states[k], t0 + k * period, period), period)
                word = tuple((e.surface, e.after) for e in laid.events)
                tried[word] = tried.get(word, 0) + 1
                if tried[word] <= _TRIES_OF_WORD:
                    return self._collocated([laid])
            except (SolveError, ArithmeticError) as error:
                self.failed = f" Collocation: {error}"
        return None

    def _with(self, nodes: int, found: Orbit, period: float) -> Orbit:
        """The orbit with as many nodes as were asked for; as it was found if that fails."""
        more, self.nodes = self.nodes > nodes, nodes
        if not more:
            return found
        try:
            return self._from(self.solution(found.x0, found.t0, period), period)
        except NoConvergenceError:
            return found

    def _subharmonic(self, x0: Array, t0: float, period: float) -> int:
        """The number of periods after which the solution from x0 is back, or comes back far better than after
        fewer of them, and as well after twice as many; 1 where it is near no orbit."""
        first = self.solution(x0, t0, period)
        size, x = np.maximum(np.ptp(first.y, axis=1), 1e-9 * (1.0 + np.max(np.abs(first.y)))), first.x_end
        gaps = [float(np.max(np.abs(x - x0) / size))]
        while gaps[-1] > _BACK and len(gaps) < _MOST_TURNS:
            x = self.solution(x, t0 + len(gaps) * period, period, dense=False).x_end
            gaps.append(float(np.max(np.abs(x - x0) / size)))
        return len(gaps) if gaps[-1] <= _BACK else settling(gaps)

    def near(self, x0: Array, t0: float, period: float) -> Orbit:
        """Newton's method with a given guess of the period."""
        return self._from(self.solution(x0, t0, period), period)

    def _from(self, solution: Solution, period: float) -> Orbit:
        """Solve the equations along a solution; by collocation where shooting does not."""
        if self.collocation:
            return self._strong(self._laid(solution, period), period)
        try:
            return self._shot(solution, period)
        except NoConvergenceError as error:
            self.strong += 1
            if self.strong > _STRONG:
                raise
            try:
                return self._strong(self._laid(solution, period), period)
            except (SolveError, ArithmeticError):
                raise error from None

    def _strong(self, laid: Solution, period: float) -> Orbit:
        """By collocation; where the solution and the orbit differ in the sequence of modes, after shooting
        from many nodes, which needs none."""
        try:
            return self._collocated([laid])
        except (SolveError, ArithmeticError) as error:
            try:
                return self._collocated(self._shot(laid, period, _MANY).pieces)
            except (SolveError, ArithmeticError):
                raise error from None

    def _laid(self, solution: Solution, period: float) -> Solution:
        """A solution of a period's length from a good start."""
        length = period / self.base.symmetry_order
        # The phase of a forced orbit stays where it is when an impact comes to it as a parameter changes.
        forced = self.base.period is not None
        start = anchor(solution, min(length, solution.t_end - solution.problem.t_span[0]), whole=forced)
        self.size, self.piece = max(self.size, extent([solution])), extent([solution])
        self.base = suited(self.base, solution)
        if start > solution.problem.t_span[0]:
            return self.solution(self.state(solution, start), start, length)
        return self.solution(solution.problem.x0, solution.problem.t_span[0], length)

    def _shot(self, solution: Solution, period: float, nodes: int = 0) -> Orbit:
        """Solve the equations with nodes laid along a solution over about one period."""
        shifted, length = self._laid(solution, period), period / self.base.symmetry_order
        count, sol = nodes or self.nodes, shifted.sol
        assert sol is not None
        begin = shifted.problem.t_span[0]
        places = begin + length * np.arange(count) / count
        modes = [shifted.start_mode, *(shifted.mode_at(float(t), "+") for t in places[1:])]
        x = np.vstack([shifted.problem.x0, *(np.asarray(sol(float(t), side="+")) for t in places[1:])])
        return self._solve(x, modes, begin, period)

    def nodes_at(self, points: Array, t0: float, period: float) -> Orbit:
        """Solve the equations with given states at the nodes."""
        length = period / self.base.symmetry_order / len(points)
        self.size = float(np.max(np.ptp(points, axis=0)))

        def pieces() -> list[Solution]:
            return [self.solution(x, t0 + k * length, length) for k, x in enumerate(points)]

        if self.collocation:
            return self._collocated(pieces())
        modes = [self.solution(x, t0 + k * length, 1e-9 * length).start_mode for k, x in enumerate(points)]
        try:
            return self._solve(points, modes, t0, period)
        except NoConvergenceError as error:
            try:
                return self._collocated(pieces())
            except (SolveError, ArithmeticError):
                raise error from None

    def _collocated(self, solutions: Sequence[Solution]) -> Orbit:
        """The orbit by collocation from solutions of about one period."""
        return CollocationSearch(self.base, self.p, self.scale, self.solution).orbit(solutions)

    def _solve(self, x: Array, modes: Sequence[Mode], begin: float, period: float) -> Orbit:
        base, count = self.base, len(x)
        speed = velocity_at(base.system, modes[0], begin, x[0], self.p, base.jacobian)
        size = float(np.linalg.norm(speed))
        if base.period is None and size == 0.0:
            raise ReturnError(f"the guess {x[0].tolist()} is at rest: take another.", None, begin)
        problem = replace(
            base, reference=x[0].copy(), velocity=speed / (size or 1.0), t0=begin if base.period else 0.0,
            unit=base.period(self.p) if base.period else 0.0,
            shares=(1.0 / count,) * count,
            sliding=tuple(tuple(i for i, sign in enumerate(mode) if sign == 0) for mode in modes),
        )  # fmt: skip
        u = x.ravel() if base.period is not None else np.append(x.ravel(), period)
        problem, u, left = newton(problem, u, self.p)
        if base.period is None:
            self._check(problem, u, period)
        pieces: list[Solution] | None = None
        if base.period is not None:
            problem, u, left, pieces = least(problem, u, left, self.p)
        elif count == base.symmetry_order == 1:
            problem, u, left = shortest(problem, u, left, self.p, _MOST_TURNS)
        found = make_orbit(problem, u, self.p, left, pieces)
        if found.trivial is not None and abs(found.trivial - 1.0) > 1e-2:
            raise NoConvergenceError("Newton's method went to an equilibrium.")
        return found

    def _check(self, problem: Shooting, u: Array, guess: float) -> None:
        """An equilibrium solves the equations as well."""
        small = extent(problem.solutions(u, self.p)) <= 1e-5 * self.scale
        if small or not 0.02 * guess < float(u[-1]) < 50 * guess:
            raise NoConvergenceError("Newton's method went to an equilibrium or to another period.")

    # -- autonomous --------------------------------------------------------------------------------------

    def autonomous(self, x0: Array) -> Orbit:
        """Look for returns of the solution, and try the best of them; from later states if that fails."""
        base = self.base
        start = self.solution(x0, 0.0, 1e-9)
        speed = velocity_at(base.system, start.start_mode, 0.0, start.problem.x0, self.p, base.jacobian)
        rate = float(np.linalg.norm(speed))
        span = min(20.0 * (1.0 + float(np.linalg.norm(x0))) / max(rate, 0.05), self.t_max)
        state, now, failed = x0, 0.0, ""
        most: int | None = _EVENTS
        for _ in range(_SPANS * 4):
            span = min(span, self.t_max - now)
            if span <= 0:
                break
            solution = self.solution(state, 0.0, span, most=most)
            # The unit of time is the user's own: a span of many events is long enough.
            span, most = solution.t_end, 2 * most if most is not None and most < _MOST_EVENTS else None
            self.size = max(self.size, extent([solution]))
            if rests(solution) or extent([solution]) <= 1e-8 * self.size:
                raise ReturnError(
                    f"the solution comes to rest at state {np.array2string(solution.x_end, precision=6)}; t "
                    f"reached {now + solution.t_end:.6g}. Give another guess.",
                    solution, now + solution.t_end,
                )  # fmt: skip
            for share in (0.0, 0.5):
                found = self._return(solution, share * span)
                if found is None:
                    continue
                try:
                    return self._from(*found)
                except SolveError as error:
                    failed = f" The last attempt failed: {error}"
            now, state = now + span, solution.x_end
            self.tell(now, "looking for a return")
            span *= 1.6
        more = ""
        if self.strong > _STRONG:
            tried = f" Collocation was tried on {_STRONG} of {self.strong} returns"
            more = f"{tried}; method='collocation' tries it on each."
        raise ReturnError(
            f"the solution does not come back to where it was within t = {now:.6g} (t_max = {self.t_max:g})."
            f"{failed}{more}", solution, now,
        )  # fmt: skip

    def _return(self, solution: Solution, begin: float) -> tuple[Solution, float] | None:
        """A solution from a good start on the orbit, and the time of its return to there; None if there is
        none."""
        base = self.base
        start = anchor(solution, solution.t_end - solution.problem.t_span[0], begin)
        mode = solution.mode_at(start, "+")
        x0 = self.state(solution, start)
        speed = base.gate @ velocity_at(base.system, mode, start, x0, self.p, base.jacobian)
        goal = base.gate @ x0
        time = return_time(solution, start, goal, speed, base.symmetry_order == 1)
        if time is None:
            return None
        period = (time - start) * base.symmetry_order
        return self.solution(x0, 0.0, period / base.symmetry_order * 1.02), period
