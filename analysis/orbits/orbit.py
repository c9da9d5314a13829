"""A periodic orbit: period, Floquet multipliers, mode word, amplitude, margins."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from filippov import Solution, SolveError, System, UsageError
from filippov.analysis.algebra.growth import ACCURACY, Growth, by_multipliers
from filippov.analysis.orbits.floquet import product_multipliers, return_factors, without_trivial
from filippov.analysis.orbits.margin import Margin, margin
from filippov.analysis.orbits.oddness import is_odd
from filippov.analysis.orbits.shooting import NoConvergenceError, Shooting
from filippov.analysis.orbits.time_limit import check_time, time_left
from filippov.base.arrays import Array, Complex
from filippov.base.given import number
from filippov.base.keywords import keywords
from filippov.base.names import Answering
from filippov.base.read_whole import content_of
from filippov.base.shown import Told
from filippov.base.status import EventKind, Status, mode_text
from filippov.graphs.word import word_of
from filippov.io.stored_system import system_data, system_of
from filippov.solving.state.events import Event, Mode
from filippov.solving.uncut import solve

FORMAT, VERSION = "filippov orbit", 1
# A symmetric orbit satisfies x(t + T/2) = -x(t) to this part of its size.
_SYMMETRIC = 1e-7
# Part of the duration that a solution may take from a node onto the surfaces that the orbit slides on there.
_AT_NODE = 1e-7


@dataclass(frozen=True, eq=False)
class Orbit(Told, Answering):
    """A limit cycle, or a periodic solution of a forced system.

    system, parameters  what it is an orbit of; parameters by name
    x0, t0         a state on it, off the surfaces where there is such a segment; its time (forced systems)
    period         T
    multipliers    Floquet multipliers, complex, largest modulus first; of an autonomous orbit without the
                   trivial one
    trivial        the multiplier that belongs to a shift in time, 1 to rounding; None for a forced system
    half_multipliers  of a symmetric orbit, x(t + T/2) = -x(t): eigenvalues of -d x(T/2)/d x0 (the half map),
                   whose squares are the multipliers; None for others. The trivial one is left out
    word           modes of a period, such as "stick slip- stick slip+" (see `filippov.graphs.word`)
    amplitude      half the distance between the largest and the smallest value, by state
    low, high      those values, (n,)
    verdict        "stable": all multipliers have modulus < 1; "unstable": one has more; "undecided": the
                   largest is 1 to the accuracy of multipliers, as on the orbits of a centre
    stable         the verdict is "stable"
    events         events of one period from x0
    signature      the switching events of a period in order, wherever it begins: what the word leaves out
    margin         see `filippov.analysis.orbits.margin`
    symmetric      x(t + T/2) = -x(t)
    residual       largest residual of the equations of the orbit
    """

    _elsewhere: ClassVar[Mapping[str, str]] = {
        "T": "its period is period.",
        **dict.fromkeys(("floquet", "eigenvalues"), "its Floquet multipliers are multipliers."),
        **dict.fromkeys(("x", "y", "t", "sol"), "a state on it is x0; solve(system, x0, ...) follows it."),
    }
    _also = ("verdict", "stable", "amplitude")
    _untold = ("system", "problem", "unknowns", "solutions")

    system: System
    parameters: Mapping[str, float]
    x0: Array
    t0: float
    period: float
    multipliers: Complex
    trivial: complex | None
    half_multipliers: Complex | None
    word: str
    modes: tuple[str, ...]
    low: Array
    high: Array
    margin: Margin
    symmetric: bool
    residual: float
    forced: bool
    rtol: float = 1e-11
    atol: float | tuple[float, ...] = 1e-13
    method: str = "DOP853"
    problem: Shooting | None = field(default=None, repr=False)
    unknowns: Array | None = field(default=None, repr=False)
    solutions: tuple[Solution, ...] = field(default=(), repr=False)

    @property
    def verdict(self) -> Growth:
        """Whether all multipliers lie inside the unit circle, one outside, or one on it."""
        shift = [] if self.trivial is None else [self.trivial]
        return by_multipliers(self.multipliers, ACCURACY * self.rtol, shift)

    @property
    def stable(self) -> bool:
        """Whether all multipliers have modulus below 1, by more than their accuracy."""
        return self.verdict == "stable"

    @property
    def amplitude(self) -> dict[str, float]:
        """Half the peak-to-peak value of each state."""
        return dict(zip(self.system.states, (0.5 * (self.high - self.low)).tolist(), strict=True))

    @property
    def events(self) -> tuple[Event, ...]:
        """Events of one period."""
        return tuple(event for solution in self._solutions for event in solution.events)

    @cached_property
    def signature(self) -> tuple[tuple[str, str, str, str], ...]:
        """(surface, kind, mode before, mode after) of the events that matter, from the first in order."""
        items = tuple(
            (e.surface, str(e.kind), mode_text(e.before), mode_text(e.after))
            for e in self.events
            if e.kind is not EventKind.GRAZING
            and e.index < len(self.system.surfaces)
            and self.system.surfaces[e.index].kind != "observer"
        )
        return min((items[k:] + items[:k] for k in range(len(items))), default=())

    @property
    def pieces(self) -> tuple[Solution, ...]:
        """The solutions that make up one period, one after the other: several where it repels strongly."""
        return self._solutions

    @cached_property
    def _solutions(self) -> tuple[Solution, ...]:
        return self.solutions or (self.solution(),)

    @keywords()
    def solution(self, periods: float = 1.0) -> Solution:
        """The solution over so many periods from x0; it departs from an orbit that repels (see `pieces`)."""
        return solve(
            self.system, self.x0, (self.t0, self.t0 + periods * self.period), parameters=self.parameters,
            rtol=self.rtol, atol=self.atol, method=self.method, zeno="continue", nonunique="stick",
        )  # fmt: skip

    def plot(self, *given: Any, **options: Any) -> Any:
        """Phase portrait beside time series (see `filippov.plot.orbits.plot_orbit`)."""
        from filippov.plot.orbits import plot_orbit

        return plot_orbit(self, *given, **options)

    def __repr__(self) -> str:
        largest = np.abs(self.multipliers[0]) if self.multipliers.size else 0.0
        size = f"largest |multiplier| {largest:.6g}"
        return f"Orbit({self.verdict}, period {self.period:.12g}, {size}, {self.word!r})"

    @classmethod
    @keywords()
    def from_dict(cls, data: Mapping[str, Any], system: System) -> Orbit:
        """The orbit that `to_dict` described. Raises UsageError for data that do not describe one."""
        try:
            keep: dict[str, Any] = {k: data[k] for k in ("word", "symmetric", "forced", "method")}
            keep |= {k: number(data[k], k, k == "residual") for k in ("t0", "period", "residual", "rtol")}
            atol = data["atol"]
            keep["atol"] = tuple(map(float, atol)) if isinstance(atol, list | tuple) else float(atol)
            if not 0 < keep["period"] < np.inf:
                raise ValueError(f"period is {keep['period']}")
            return cls(
                system, dict(data["parameters"]), np.array(data["x0"], dtype=float),
                multipliers=_complex(data["multipliers"]),
                trivial=None if data["trivial"] is None else complex(*data["trivial"]),
                half_multipliers=(
                    None if data["half_multipliers"] is None else _complex(data["half_multipliers"])
                ),
                modes=tuple(data["modes"]), low=np.array(data["low"], dtype=float),
                high=np.array(data["high"], dtype=float), margin=Margin(**data["margin"]), **keep,
            )  # fmt: skip
        except (KeyError, TypeError, ValueError) as error:
            raise UsageError(f"these data describe no orbit ({type(error).__name__}: {error}).") from None

    @keywords()
    def save(self, path: str | Path) -> Path:
        """Write the orbit as JSON, with its system where that is symbolic."""
        from filippov.analysis.orbits.orbit_file import write_json

        return write_json(path, {"format": FORMAT, "version": VERSION, "system": system_data(self.system)} | {
            "orbit": self.to_dict()
        })  # fmt: skip

    @classmethod
    @keywords()
    def load(cls, path: str | Path, system: System | None = None) -> Orbit:
        """Read what `save` wrote; a system of plain functions has to be given."""
        from filippov.analysis.orbits.orbit_file import read_json

        data = read_json(path, FORMAT, VERSION)
        with content_of(path):
            return cls.from_dict(data["orbit"], stored_system(data, system, path))


def stored_system(data: Mapping[str, Any], system: System | None, path: Any) -> System:
    """The system of a file, compared with the one that is given."""
    if data.get("system") is None:
        if system is None:
            raise UsageError(f"{str(path)!r} holds no system (it has plain functions); give it: system=...")
        return system
    read = system_of(data["system"])
    if system is not None and system != read:
        raise UsageError(f"the system that is given is not the one {str(path)!r} was made with.")
    return read


def make_orbit(
    problem: Shooting, u: Array, p: Array, residual: float, solutions: Sequence[Solution] | None = None,
    margins: bool = True,
) -> Orbit:
    """The orbit that solves the equations at the unknowns u, with all that is derived from it.

    solutions: those from the nodes, where they are known; margins: whether they are wanted. Raises
    NotDifferentiableError, SolveError.
    """
    pieces = list(solutions or problem.solutions(u, p))
    if off := problem.strays(u, pieces):
        raise NoConvergenceError(f"the nodes {off} of the orbit have left the surfaces that they slid on.")
    # On its surfaces: beside them by rounding, static friction beyond the slip force would let go.
    start, period = np.array(pieces[0].problem.x0), problem.split(u, p)[1]
    system, forced = problem.system, problem.period is not None
    whole = whole_period(problem, u, p, pieces)
    factors, zeros = return_factors(pieces, problem.symmetry, problem.jacobian)
    half: Complex | None = None
    order = problem.symmetry_order
    low, high = _extent(whole)
    symmetric = order == 2 and np.array_equal(problem.gate, -np.eye(problem.n))
    values = product_multipliers(factors, zeros, order)
    if symmetric:
        half = product_multipliers(factors, zeros)
    elif order == 1 and _opposite(whole, problem.begin(p), period, high - low) and is_odd(
        system, p, np.maximum(np.abs(low), np.abs(high)), problem.begin(p), period, problem.jacobian
    ):
        found = _half(problem, pieces, period, p)
        if found is not None and _same(found**2, values):
            half, symmetric, values = found, True, found**2
    trivial: complex | None = None
    if not forced:
        values, trivial = without_trivial(values)
        half = None if half is None else without_trivial(half)[0]
    texts = cycle_of_modes(whole)
    names = system.parameters.names
    return Orbit(
        system, dict(zip(names, p.tolist(), strict=True)), start, problem.begin(p), period, values,
        trivial, half, word_of(texts, system), texts, low, high,
        margin(whole, problem.jacobian) if margins else Margin(),
        bool(symmetric), residual, forced, problem.rtol, problem.atol, problem.method, problem, u.copy(),
        tuple(whole),
    )  # fmt: skip


def whole_period(problem: Shooting, u: Array, p: Array, pieces: list[Solution]) -> list[Solution]:
    """The solutions of a whole period; of a part of it, from several nodes, also the images of all."""
    if problem.symmetry_order == 1:
        return pieces
    nodes, period = problem.split(u, p)
    if len(nodes) == 1:
        return [_whole(problem, nodes[0], period, p)]
    images = [nodes]
    for _ in range(problem.symmetry_order - 1):
        images.append(images[-1] @ problem.gate.T)
    full = replace(
        problem, symmetry=None, symmetry_order=1,
        shares=tuple(share / problem.symmetry_order for share in problem.shares) * problem.symmetry_order,
        sliding=problem.sliding * problem.symmetry_order,
    )  # fmt: skip
    return full.solutions(np.append(np.concatenate(images).ravel(), u[nodes.size :]), p)


def _whole(problem: Shooting, x0: Array, period: float, p: Array) -> Solution:
    values = dict(zip(problem.system.parameters.names, p.tolist(), strict=True))
    begin = problem.begin(p)
    solution = solve(
        problem.system, x0, (begin, begin + period), parameters=values, rtol=problem.rtol, atol=problem.atol,
        method=problem.method, max_time=time_left(), zeno="continue", nonunique="stick",
    )  # fmt: skip
    if solution.status is Status.TIMEOUT:
        check_time()
    if not solution.success:
        raise SolveError(f"the solution along the orbit ended early: {solution.message}", solution)
    return solution


def cycle_of_modes(solutions: Sequence[Solution]) -> tuple[str, ...]:
    """Modes of a period in order without repetitions, the last one joined with the first."""
    out: list[Mode] = []
    ends = [solution.end_mode for solution in solutions]
    for before, solution in zip([ends[-1], *ends[:-1]], solutions, strict=True):
        segments = list(solution.segments)
        length = abs(solution.t_end - solution.problem.t_span[0])
        # A node in sliding is off the surface by the residual of the equations, for as long as that takes.
        if len(segments) > 1 and segments[1].mode == before and segments[0].dwell < _AT_NODE * length:
            del segments[0]
        for segment in segments:
            if not out or out[-1] != segment.mode:
                out.append(segment.mode)
    if len(out) > 1 and out[0] == out[-1]:
        out.pop()
    return tuple(mode_text(mode) for mode in out)


def _extent(solutions: Sequence[Solution]) -> tuple[Array, Array]:
    """Least and largest value of each state: samples, refined where the dense output has its extremes."""
    lows: list[Array] = []
    highs: list[Array] = []
    for solution in solutions:
        sol = solution.sol
        assert sol is not None
        ends = np.append(sol.start, solution.t_end)
        x = sol(np.append((ends[:-1, None] + np.diff(ends)[:, None] * np.arange(8) / 8).ravel(), ends[-1]))
        # At a reset the state has two values.
        jumps = np.hstack([sol(ends, side=side) for side in ("-", "+")])
        for sign, into in ((1.0, lows), (-1.0, highs)):
            best = np.minimum(np.min(sign * x, axis=1), np.min(sign * jumps, axis=1))
            for i, row in enumerate(sign * x):
                k = int(np.argmin(row)) // 8
                for step in {max(k - 1, 0), min(k, len(sol.start) - 1)}:
                    curve = np.polynomial.Polynomial(sign * sol.coef[step][:, i])
                    roots = curve.deriv().roots()
                    inside = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0) & (roots.real < 1)]
                    inside = inside[sol.start[step] + inside * sol.step[step] <= ends[step + 1]]
                    best[i] = min([best[i], *curve(inside).tolist()])
            into.append(sign * best)
    return np.min(lows, axis=0), np.max(highs, axis=0)


def _opposite(solutions: Sequence[Solution], t0: float, period: float, size: Array) -> bool:
    """Whether x(t + T/2) = -x(t)."""
    begins = [solution.problem.t_span[0] for solution in solutions]

    def states(t: Array) -> Array:
        place, out = np.searchsorted(begins, t, side="right") - 1, np.empty((len(size), len(t)))
        for k in np.unique(place).tolist():
            sol = solutions[k].sol
            assert sol is not None
            out[:, place == k] = sol(t[place == k])
        return out

    times = t0 + period * np.linspace(0.0, 0.499, 24)
    gap = np.abs(states(times) + states(times + 0.5 * period))
    return bool(np.max(gap) < _SYMMETRIC * np.max(size))


def _half(problem: Shooting, pieces: Sequence[Solution], period: float, p: Array) -> Complex | None:
    """Multipliers of the half map x -> -x(T/2); None where several solutions have no node at T/2."""
    if len(pieces) == 1:
        first = [_whole(problem, pieces[0].problem.x0, 0.5 * period, p)]
    else:
        end = problem.begin(p) + 0.5 * period
        first = [solution for solution in pieces if solution.problem.t_span[0] < end - 1e-9 * period]
        if abs(first[-1].t_end - end) > 1e-9 * period:
            return None
    return product_multipliers(*return_factors(first, -np.eye(problem.n), problem.jacobian))


def _same(a: Complex, b: Complex) -> bool:
    scale = 1e-5 * (1.0 + float(np.max(np.abs(b), initial=0.0)))
    return bool(np.allclose(np.sort_complex(a), np.sort_complex(b), rtol=0, atol=scale))


def _pairs(values: Complex) -> list[list[float]]:
    return [[float(v.real), float(v.imag)] for v in values]


def _complex(rows: Any) -> Complex:
    return np.array([complex(*row) for row in rows], dtype=complex)
