"""The equations of a periodic orbit: solutions between nodes on it fit together (multiple shooting).

Unknowns are the states at the nodes and, for an autonomous system, the period T:

    Phi(x_i, t_i, c_i T) = x_{i+1},   Phi(x_last, ...) = G x_0,   f_0 . (x_0 - reference) = 0

with G = 1 for a whole period and a symmetry of the system (such as x -> -x) for a part of it; a forced
system knows its T and needs no phase condition. The matrix of the equations is exact
(`filippov.analysis.sensitivity.saltation`).
Source: Seydel 2010; Leine & Nijmeijer 2004, for sliding.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from filippov import ModelError, Solution, SolveError, Status, System, UsageError
from filippov.analysis.algebra import linalg
from filippov.analysis.orbits.oddness import repeats
from filippov.analysis.orbits.time_limit import check_time, time_left
from filippov.analysis.sensitivity.saltation import derivative_by_all
from filippov.analysis.sensitivity.variation import mode_field
from filippov.analysis.steady.forcing import Period, is_forced
from filippov.base.arrays import Array
from filippov.solving.state.events import Mode
from filippov.solving.uncut import solve

MOST_STEPS = 2_000_000
# Parts of a forced period that are tried, each repeatedly; how near to itself the orbit then is, in parts of
# its extent; shares of the part at which it is looked at, none of them a likely instant of a clock.
_PRIMES = tuple(k for k in range(2, 100) if all(k % q for q in range(2, k)))
SAME, _SHARES = 1e-6, (0.0618, 0.1459, 0.2361, 0.3819)
# By how much parameters are moved to see whether a shorter period is the system's at others as well.
_MOVED = 1e-3
# The unit of a state is at least so many absolute tolerances.
_NOISE = 1e7
# The absolute tolerance of a state that is small beside it, in parts of rtol times its size.
_OF_RTOL, _LEFT = 1e-2, 1e2
# A node is off its surfaces by more than this part of the states along the orbit, next to others by less.
_OFF, _NEXT = 1e-8, 1e-6


class ReturnError(SolveError):
    """A solution does not return; `solution` holds it, `t` the time reached. Its status is NO_RETURN."""

    status = Status.NO_RETURN

    def __init__(self, message: str, solution: Any = None, t: float = float("nan")) -> None:
        super().__init__(f"NO_RETURN: {message}", solution)
        self.t = t


class NoConvergenceError(SolveError):
    """Newton's method did not find a solution of the equations; `residual` is the remaining one."""

    def __init__(self, message: str, residual: float = float("nan")) -> None:
        super().__init__(message)
        self.residual = residual


@dataclass(frozen=True)
class Shooting:
    """The equations for one system, with reference point, nodes and symmetry.

    reference   state at the first node (n,), velocity there (n,): for the phase condition
    t0, unit    time of the first node of a forced system, taken where the period is `unit`: it keeps its
                phase, t0 T/unit, when a parameter changes the period; unit 0: t0 is the time
    shares      parts of the duration between nodes, adding up to 1
    sliding     for each node the surfaces it lies on (a node in sliding stays on them)
    period      of the forcing, None for an autonomous system
    atol        one number, or one for each state
    symmetry    the matrix G (n, n), and symmetry_order the power of it that is the identity: the solution
                lasts T/symmetry_order
    sizes       of the states along the orbit (n,), where it is known: a node that is farther from its
                surfaces than a small part of them is on none
    """

    system: System
    reference: Array
    velocity: Array
    t0: float = 0.0
    unit: float = 0.0
    shares: tuple[float, ...] = (1.0,)
    sliding: tuple[tuple[int, ...], ...] = ((),)
    period: Period | None = None
    symmetry: Array | None = None
    symmetry_order: int = 1
    rtol: float = 1e-11
    atol: Any = 1e-13
    method: str = "DOP853"
    jacobian: Callable[..., Any] | None = None
    sizes: Array | None = None

    @property
    def n(self) -> int:
        """Number of states."""
        return self.system.dimension

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.n * len(self.shares) + (self.period is None)

    @property
    def gate(self) -> Array:
        """G."""
        return np.eye(self.n) if self.symmetry is None else self.symmetry

    def split(self, u: Array, p: Array) -> tuple[Array, float]:
        """States at the nodes (k, n) and the period from the unknowns."""
        nodes = u[: self.n * len(self.shares)].reshape(-1, self.n)
        return nodes, float(u[-1]) if self.period is None else self.period(p)

    @property
    def phase(self) -> float:
        """Time of the first node in periods of the forcing."""
        return self.t0 / self.unit if self.unit else 0.0

    def begin(self, p: Array) -> float:
        """Time of the first node."""
        return self.t0 if self.period is None or not self.unit else self.phase * self.period(p)

    def times(self, count: float) -> Shooting:
        """The equations of a multiple of the period of the forcing, or of a part of it."""
        assert self.period is not None
        return replace(self, period=self.period.times(count), unit=self.unit * count)

    def solutions(self, u: Array, p: Array) -> list[Solution]:
        """The solutions from the nodes. Raises SolveError where one ends early or T is not positive, and
        OutOfTimeError."""
        nodes, period = self.split(u, p)
        if not period > 0 or not np.all(np.isfinite(u)):
            raise NoConvergenceError(f"the period came out as {period:.6g}.")
        values = dict(zip(self.system.parameters.names, p.tolist(), strict=True))
        out, t = [], self.begin(p)
        for x, share, surfaces in zip(nodes, self.shares, self.sliding, strict=True):
            end = t + share * period / self.symmetry_order
            start, _ = self.placed(x, t, p, surfaces)
            solution = solve(
                self.system, start, (t, end), parameters=values, rtol=self.rtol, atol=self.atol,
                method=self.method, max_steps=MOST_STEPS, max_time=time_left(), zeno="continue",
                nonunique="stick",
            )  # fmt: skip
            if solution.status is Status.TIMEOUT:
                check_time()
            if solution.status is not Status.SUCCESS:
                raise SolveError(f"the solution along the orbit ended early: {solution.message}", solution)
            out.append(solution)
            t = end
        return out

    def placed(
        self, x: Array, t: float, p: Array, surfaces: tuple[int, ...]
    ) -> tuple[Array, tuple[int, ...]]:
        """The state on the surfaces, and these; the state itself and none where it is not next to them."""
        there = onto_surfaces(self.system, x, t, p, surfaces)
        near = self.sizes is None or np.max(np.abs(there - x) / self.sizes) <= _NEXT
        return (there, surfaces) if near else (x, ())

    def strays(self, u: Array, solutions: Sequence[Solution]) -> list[int]:
        """The nodes that are off the surfaces on which their solutions begin: these were put there, and what
        solves the equations is no orbit."""
        nodes = u[: self.n * len(self.shares)].reshape(-1, self.n)
        units = _units(self, u, solutions)[0][: nodes.size].reshape(nodes.shape)
        gaps = np.array([solution.problem.x0 for solution in solutions]) - nodes
        return np.flatnonzero(np.max(np.abs(gaps) / units, axis=1) > _OFF).tolist()

    def attached(self, u: Array, solutions: Sequence[Solution], p: Array) -> Shooting:
        """The same with each node on the surfaces on which the solution before it ends, where it is next to
        them, and with the sizes of now."""
        nodes, _ = self.split(u, p)
        known, out = replace(self, sizes=_units(self, u, solutions)[0][: self.n]), []
        for i, solution in enumerate(solutions):
            ends = tuple(j for j, sign in enumerate(solutions[i - 1].end_mode) if sign == 0)
            # The first node lies on images of the surfaces on which a part of a symmetric orbit ends.
            surfaces = ends if i or self.symmetry is None else self.sliding[0]
            out.append(known.placed(nodes[i], solution.problem.t_span[0], p, surfaces)[1])
        return replace(known, sliding=tuple(out))

    def residual(self, u: Array, solutions: Sequence[Solution], p: Array) -> Array:
        """The residual of the equations: (size,)."""
        nodes, _ = self.split(u, p)
        ends = [*nodes[1:], self.gate @ nodes[0]]
        rows = [solution.x_end - end for solution, end in zip(solutions, ends, strict=True)]
        if self.period is None:
            rows.append(np.array([self.velocity @ (nodes[0] - self.reference)]))
        return np.concatenate(rows)

    def matrix(self, u: Array, solutions: Sequence[Solution], p: Array, names: tuple[str, ...] = ()) -> Array:
        """Derivative of the residual by the unknowns and the named parameters: (size, size + names)."""
        n, k, e = self.n, len(self.shares), len(names)
        out = np.zeros((self.size, self.size + e))
        fixed = self.period.slope(p, names) if self.period is not None else np.zeros(e)
        begin = self.phase * self.symmetry_order
        for i, (solution, share) in enumerate(zip(solutions, self.shares, strict=True)):
            rows = slice(i * n, (i + 1) * n)
            by = derivative_by_all(solution, False, names, self.jacobian)
            # A node that is on a surface by rounding slides from there as the nodes beside it do.
            node, t = u[i * n : (i + 1) * n], solution.problem.t_span[0]
            _, slid = self.placed(node, t, p, self.sliding[i])
            slid = slid or tuple(j for j, sign in enumerate(solution.start_mode) if sign == 0)
            out[rows, i * n : (i + 1) * n] = by[:n, :n] @ tangent(solution, slid)
            last = solution.end_mode, solution.t_end, solution.x_end
            end = velocity_at(self.system, *last, p, self.jacobian)
            length = share / self.symmetry_order * end
            if self.period is None:
                out[rows, self.size - 1] = length
            # Parameters move the state, the start of the node's solution, and its length.
            by_start = by[:n, -1] * begin / self.symmetry_order
            out[rows, self.size :] = by[:n, n : n + e] + np.multiply.outer(length + by_start, fixed)
            begin += share
            following = ((i + 1) % k) * n
            out[rows, following : following + n] -= self.gate if i == k - 1 else np.eye(n)
        if self.period is None:
            out[-1, :n] = self.velocity
        return out

    def at(self, u: Array, p: Array, solutions: Sequence[Solution] | None = None) -> Shooting:
        """The same equations with the reference point moved to these unknowns and their solutions."""
        nodes, _ = self.split(u, p)
        solution = (solutions or self.solutions(u, p))[0]
        speed = velocity_at(
            self.system, solution.start_mode, self.begin(p), solution.problem.x0, p, self.jacobian
        )
        # A state that a clock holds has no speed, and a forced orbit needs none.
        size = float(np.linalg.norm(speed))
        return replace(self, reference=nodes[0].copy(), velocity=speed / (size or 1.0))


def suited(problem: Shooting, solution: Solution) -> Shooting:
    """The same with an absolute tolerance of its own for each state that is small beside the one for all, but
    not so small that it may be what the tolerance has left of 0."""
    largest, atol = np.max(np.abs(solution.y), axis=1), np.asarray(problem.atol)
    small = (atol > problem.rtol * largest) & (largest > _LEFT * atol)
    if not np.any(small):
        return problem
    own = np.where(small, _OF_RTOL * problem.rtol * largest, atol)
    return replace(problem, atol=tuple(own.tolist()))


def velocity_at(
    system: System, mode: Mode, t: float, x: Array, p: Array, jacobian: Callable[..., Any] | None = None
) -> Array:
    """The field of a mode at one point: (n,)."""
    part = mode_field(system, mode, (), jacobian)
    time, state = np.array([t]), np.asarray(x, dtype=float)[None, :]
    return np.asarray(part.part("f", time, state, part.multipliers(time, state, p), p)[0, :, 0])


def onto_surfaces(system: System, x: Array, t: float, p: Array, surfaces: tuple[int, ...]) -> Array:
    """The nearest state on the given surfaces (Newton's method along their gradients)."""
    if not surfaces:
        return x
    mode = tuple(0 if i in surfaces else 1 for i in range(len(system.surfaces)))
    part = mode_field(system, mode)
    state, time, s = x.copy(), np.array([t]), np.array([mode], dtype=float)
    for _ in range(20):
        h = part.part("held", time, state[None, :], s, p)[0, :, 0]
        slope = part.part("heldy", time, state[None, :], s, p)[0, :, : system.dimension]
        change = linalg.lstsq(slope, h, rcond=None)[0]
        state = state - change
        if np.max(np.abs(change)) <= 4e-16 * (1.0 + np.max(np.abs(state))):
            break
    return state


def tangent(solution: Solution, surfaces: tuple[int, ...]) -> Array:
    """Projection of displacements onto the surfaces a solution starts on: (n, n)."""
    system, p = solution.problem.system, solution.problem.p
    n = system.dimension
    if not surfaces:
        return np.eye(n)
    part = mode_field(system, solution.start_mode)
    t, x = np.array([solution.problem.t_span[0]]), solution.problem.x0[None, :]
    slope = part.part("heldy", t, x, part.multipliers(t, x, p), p)[0, part.conditions(surfaces), :n]
    return np.asarray(np.eye(n) - linalg.pinv(slope) @ slope)


def newton(
    problem: Shooting, u: Array, p: Array, *, tolerance: float = 1e-11, iterations: int = 25
) -> tuple[Shooting, Array, float]:
    """Solve the equations by damped Newton steps of least squares; returns the equations, the unknowns and
    what is left. Nodes that leave the surfaces they were on are free in what is returned.

    Raises NoConvergenceError, and what a solution along the orbit raises.
    """
    solutions = problem.solutions(u, p)
    left = problem.residual(u, solutions, p)
    for step_number in range(iterations + 1):
        before, problem = problem.sliding, problem.attached(u, solutions, p)
        if problem.sliding != before or problem.strays(u, solutions):
            solutions = problem.solutions(u, p)
            left = problem.residual(u, solutions, p)
        # Along the solutions of now: beside those from a guess far away any residual is small.
        columns, rows = _units(problem, u, solutions)
        size = float(np.max(np.abs(left) / rows))
        if size <= tolerance * 1e-2 or step_number == iterations:
            break
        matrix = problem.matrix(u, solutions, p) * columns / rows[:, None]
        step = columns * linalg.lstsq(matrix, -left / rows, rcond=1e-13)[0]
        for halving in range(5):
            trial = u + step * 0.5**halving
            try:
                tried = problem.solutions(trial, p)
            except SolveError:
                continue
            rest = problem.residual(trial, tried, p)
            if float(np.max(np.abs(rest) / rows)) < size:
                break
        else:
            break
        u, solutions, left = trial, tried, rest
    if not size <= max(tolerance, 1e3 * problem.rtol):
        over = float(np.max(np.abs(left)))
        raise NoConvergenceError(
            f"Newton's method did not converge to a periodic orbit: {over:.3g} is left of its equations. "
            "Give a state nearer to the orbit, more nodes, or the period.",
            over,
        )
    return problem, u, float(np.max(np.abs(left)))


def _units(problem: Shooting, u: Array, solutions: Sequence[Solution]) -> tuple[Array, Array]:
    """Units of the unknowns and of the equations: of each state its largest magnitude along the solutions, or
    what the absolute tolerance leaves of it; of one that is 0 throughout the largest of all."""
    states = np.column_stack([np.abs(solution.y) for solution in solutions])
    size = np.max(states[:, np.all(np.isfinite(states), axis=0)], axis=1, initial=0.0)
    size = np.where(size > 0.0, size, float(np.max(size)) or 1.0)
    size = np.maximum(size, _NOISE * np.asarray(problem.atol))
    nodes = np.tile(size, len(problem.shares))
    if problem.period is not None:
        return nodes, nodes
    phase = float(np.linalg.norm(problem.velocity * size))
    return np.append(nodes, abs(float(u[-1]))), np.append(nodes, phase or 1.0)


def least(
    problem: Shooting, u: Array, left: float, p: Array
) -> tuple[Shooting, Array, float, list[Solution]]:
    """The same forced orbit with its least period, where it was found with a multiple of it: the equations,
    unknowns, what is left of them, and the solutions from the nodes."""
    path = _Path(problem, u, left, problem.solutions(u, p), p)
    for prime in _PRIMES:
        while (shorter := path.shorter(prime)) is not None:
            path = shorter
    return path.problem, path.u, path.left, path.pieces


def shortest(
    problem: Shooting, u: Array, left: float, p: Array, most: int
) -> tuple[Shooting, Array, float]:
    """The same autonomous orbit of one node with its least period, that found over up to `most`."""
    sol = problem.solutions(u, p)[0].sol
    assert sol is not None
    size = float(np.max(np.ptp(sol(np.linspace(0.0, float(u[-1]), 64)), axis=1)))
    for count in range(most, 1, -1):
        if np.max(np.abs(sol(float(u[-1]) / count) - u[:-1])) < SAME * size:
            try:
                return newton(problem, np.append(u[:-1], u[-1] / count), p)
            except SolveError:
                continue
    return problem, u, left


class _Path:
    """A forced orbit of some period, with what tells whether it repeats within it."""

    def __init__(self, problem: Shooting, u: Array, left: float, pieces: list[Solution], p: Array) -> None:
        assert problem.period is not None
        self.problem, self.u, self.left, self.pieces, self.p = problem, u, left, pieces, p
        self.begin, self.period = problem.begin(p), problem.period(p)
        self.begins = [piece.problem.t_span[0] for piece in pieces]
        part = self.period / problem.symmetry_order
        seen = np.array([self.state(self.begin + share * part) for share in np.arange(64) / 64])
        seen = np.vstack([seen, *(row.y.T for row in pieces)])
        images = [seen @ np.linalg.matrix_power(problem.gate, k).T for k in range(problem.symmetry_order)]
        seen = np.vstack(images)
        self.extent, self.size = float(np.max(np.ptp(seen, axis=0))), np.max(np.abs(seen), axis=0)
        error = problem.rtol * float(np.max(self.size)) + float(np.max(problem.atol))
        self.near = SAME * self.extent + 10 * (error + left)

    def place(self, t: float) -> tuple[Solution, float, Array]:
        """The solution with the state at t, its time there, and the power of the symmetry that is left."""
        part = self.period / self.problem.symmetry_order
        turns = int((t - self.begin) // part)
        at = t - turns * part
        piece = self.pieces[max(int(np.searchsorted(self.begins, at, side="right")) - 1, 0)]
        return piece, at, np.linalg.matrix_power(self.problem.gate, turns)

    def state(self, t: float) -> Array:
        """The state at t, after what happens there."""
        piece, at, power = self.place(t)
        assert piece.sol is not None
        return np.asarray(power @ piece.sol(at, side="+"))

    def shorter(self, prime: int) -> _Path | None:
        """The orbit with a part of its period; None where it, or the system, does not repeat after it."""
        problem, p, order, short = self.problem, self.p, self.problem.symmetry_order, self.period / prime
        if order % prime == 0:
            return None
        if self.extent <= self.near and not is_forced(problem.system):
            return None  # a rest has every period
        # Not at the start: both sides of a jump are treated alike where there is none.
        for t in (self.begin + share * short for share in _SHARES):
            if float(np.max(np.abs(self.state(t + short) - self.state(t)))) > self.near:
                return None
        if not _repeating(problem, p, self.size, prime):
            return None
        nodes, sliding = [self.u[: problem.n]], [problem.sliding[0]]
        for share in np.cumsum(problem.shares[:-1]).tolist():
            t = self.begin + share * short / order
            piece, at, _ = self.place(t)
            nodes.append(self.state(t))
            sliding.append(tuple(i for i, sign in enumerate(piece.mode_at(at, "+")) if sign == 0))
        # x(t + T/m) = G x(t) with period T/k is x(t + T/(k m)) = G**a x(t) with a k = 1 modulo m.
        gate = problem.gate if order == 1 else np.linalg.matrix_power(problem.gate, pow(prime, -1, order))
        part = replace(
            problem.times(1.0 / prime), sliding=tuple(sliding),
            symmetry=None if problem.symmetry is None else gate,
        )  # fmt: skip
        guess = np.concatenate(nodes)
        try:
            part, u, left = newton(part, guess, p)
            # Beside a period doubling there are two orbits, one of which has branched off the other.
            if float(np.max(np.abs(u - guess))) > self.near:
                return None
            return _Path(part, u, left, part.solutions(u, p), p)
        except SolveError:
            return None


def _repeating(problem: Shooting, p: Array, size: Array, prime: int) -> bool:
    """Whether the system itself repeats after a part of its period: at other parameter values too, if the
    whole period is theirs, so that the orbit can be followed."""
    period = problem.period
    assert period is not None
    other = np.where(p == 0.0, _MOVED, p * (1.0 + _MOVED * np.cos(np.arange(p.size))))
    for values in (p, other) if p.size else (p,):
        try:
            length, begin = period(values), problem.begin(values)
            shifts = (length / prime,) if values is p else (length, length / prime)
            for shift in shifts:
                if not repeats(
                    problem.system, values, size, begin, length, shift, method=problem.method,
                    jacobian=problem.jacobian,
                ):  # fmt: skip
                    return values is not p and shift == length
        except (UsageError, ModelError, ArithmeticError):
            return values is not p
    return True


def symmetry_matrix(given: Any, system: System) -> tuple[Array | None, int]:
    """G and its order: G to that power is the identity. given: None, "odd" (x -> -x) or a matrix."""
    n = system.dimension
    if given is None:
        return None, 1
    if isinstance(given, str):
        if given != "odd":
            raise UsageError(f"symmetry is {given!r}, expected 'odd' (x -> -x), a matrix (n, n) or None.")
        return -np.eye(n), 2
    matrix = np.array(given, dtype=float)
    if matrix.shape != (n, n):
        raise UsageError(f"symmetry has the shape {matrix.shape}, expected ({n}, {n}).")
    power = matrix
    for symmetry_order in range(1, 13):
        if np.allclose(power, np.eye(n), atol=1e-12):
            return (matrix, symmetry_order) if symmetry_order > 1 else (None, 1)
        power = power @ matrix
    raise UsageError(
        "symmetry: none of the first 12 powers of the matrix is the identity. Give G with G^k = 1, for "
        "x(t + T/k) = G x(t), or symmetry='odd'."
    )


def resolved(system: System, parameters: Mapping[str, float] | None) -> Array:
    """Parameter values in order."""
    return np.asarray(system.parameters.resolve(parameters), dtype=float)
