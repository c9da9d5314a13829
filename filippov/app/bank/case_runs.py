"""The solutions of a case, computed at first use, also beyond its span or with other options if needed."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, TypeVar

import numpy as np
import sympy
from scipy.optimize import brentq
from sympy import Expr

from filippov import ModelError, Solution, SolutionTree, SolveError, Status, UsageError, solve
from filippov import t as time_symbol
from filippov.analysis import Orbit, find_orbit
from filippov.analysis.algebra.budget import OutOfBudgetError
from filippov.analysis.algebra.deadline import within
from filippov.analysis.sensitivity.saltation import NotDifferentiableError
from filippov.app.bank.build import Built
from filippov.app.bank.notation import number
from filippov.app.bank.outcome import MissingError, OutOfTimeError
from filippov.app.bank.recurrence import Cycle, recurrence
from filippov.base.arrays import Array
from filippov.base.names import check_known
from filippov.solving.selection.modes import Successor
from filippov.solving.state.events import Event, Mode
from filippov.solving.state.machine import Machine
from filippov.solving.state.options import falls

T = TypeVar("T")
SAMPLES = 64  # of each segment of one mode, for the search of zeros and extremes
LONGEST = 16.0  # so many times its span a solution is followed until it recurs


@dataclass
class Settings:
    """Options that override those of every case (None: they do not), and the seconds for each."""

    rtol: float | None = None
    atol: float | None = None
    method: str | None = None
    max_time: float = 120.0

    @property
    def options(self) -> dict[str, Any]:
        """Those of the solver that are given."""
        found = {"rtol": self.rtol, "atol": self.atol, "method": self.method}
        return {key: value for key, value in found.items() if value is not None}


@dataclass
class CaseRuns:
    """Runs of one case: `options` of the solver are the defaults, the case's own, and those of the call."""

    built: Built
    settings: Settings
    deadline: float
    field_calls: int = 0
    _runs: dict[Any, Solution] = field(default_factory=dict)

    @cached_property
    def options(self) -> dict[str, Any]:
        """Options of the solver."""
        return {**self.built.options, **self.settings.options}

    @property
    def names(self) -> Mapping[str, Any]:
        """The meaning of names in the case's formulas."""
        return self.built.names

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return self.built.system.states

    def number(self, value: Any) -> float:
        """A number, or a formula in the case's parameters. Raises ModelError."""
        return number(value, self.names)

    def part(self, x: Any, component: str | None) -> Any:
        """One state of x by name; None: all. Raises ModelError."""
        return x if component is None else x[self.component(component)]

    def component(self, name: str) -> int:
        """The place of a state. Raises ModelError."""
        check_known("state", [name], self.states)
        return self.states.index(name)

    def place(self, surface: int | str) -> int:
        """The number of a declared surface, given by number or name. Raises ModelError."""
        declared = self.built.declared
        if isinstance(surface, int) and 0 <= surface < len(declared):
            return surface
        check_known("surface", [surface], declared)
        return declared.index(str(surface))

    def solve(
        self,
        x0: Sequence[float] | None = None,
        t_end: float | None = None,
        t0: float | None = None,
        **options: Any,
    ) -> Solution:
        """A run of the case's system; another start, end or policy where given. Raises OutOfTimeError."""
        start = tuple(self.built.x0 if x0 is None else x0)
        begin, end = self.built.t_span
        span = (begin if t0 is None else t0, end if t_end is None else t_end)
        plain = not any(map(callable, options.values()))
        key = (start, span, str(sorted(options.items())) if plain else None)
        if plain and key in self._runs:
            return self._runs[key]
        chosen = {**self.options, "max_time": remaining(self.deadline), **options}
        if "max_step" in chosen:  # the case's longest step may exceed a fraction of its span
            chosen["max_step"] = min(chosen["max_step"], abs(span[1] - span[0]) or math.inf)
        run: Solution = solve(self.built.system, start, span, backward=falls(span), **chosen)
        self.field_calls += run.nfev
        if run.status is Status.TIMEOUT:
            raise OutOfTimeError
        if run.status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        if plain:
            self._runs[key] = run
        return run

    def finished(self, **options: Any) -> Solution:
        """As `solve`. Raises MissingError where the run ends early."""
        run = self.solve(**options)
        if not run.status.ok:
            raise MissingError(run.message)
        return run

    @cached_property
    def main(self) -> Solution:
        """The run over the case's own span."""
        return self.solve()

    def covering(self, t: float) -> Solution:
        """A run that reaches the time t, in the span or beyond it."""
        start, end = self.built.t_span
        forwards = end >= start
        inside = (start <= t <= end) if forwards else (end <= t <= start)
        run = self.main if inside else self.solve(t_end=t)
        if abs(t - start) > abs(run.t_end - start) and abs(t - run.t_end) > 1e-12 * (1 + abs(t)):
            # A solution that accumulates goes on in its limit.
            run = self.solve(t_end=max(t, end) if forwards else min(t, end), zeno="continue")
        if abs(t - start) > abs(run.t_end - start) and abs(t - run.t_end) > 1e-12 * (1 + abs(t)):
            raise MissingError(f"the run ends at t = {run.t_end:.9g} ({run.message})")
        return run

    def state(self, t: float, side: str = "-") -> Array:
        """x(t)."""
        run = self.covering(t)
        assert run.sol is not None
        low, high = sorted((run.problem.t_span[0], run.t_end))
        if t == run.t_end:
            return np.asarray(run.x_end)
        return np.asarray(run.sol(min(max(t, low), high), side=side))

    def events(self, run: Solution | None = None) -> list[Event]:
        """The events on the case's own surfaces; those on kinks of its formulas are left out."""
        return [e for e in (self.main if run is None else run).events if e.surface in self.built.declared]

    def candidates(self) -> list[Successor]:
        """The modes that can follow where the run first has several."""
        seen: list[Successor] = []
        self.solve(nonunique=seen.extend)
        return seen

    def velocity(self, run: Solution, t: float | None = None, side: str = "+") -> tuple[Array, Array]:
        """Field and multipliers of the mode at a time, or at the end of a run."""
        system = run.problem.system
        machine = Machine(system, run.options.stepper, run.problem.p, sliding=run.options.sliding)
        if t is None or t == run.t_end:
            at, x, mode = run.t_end, run.x_end, run.end_mode
            guess = run.end_multipliers
        else:
            assert run.sol is not None
            at, x, mode = t, np.asarray(run.sol(t, side=side)), run.mode_at(t, side)
            guess = np.zeros(len(mode))
        _, velocity, lam, _ = machine.probe(
            float(at), 0.0, np.ascontiguousarray(x), np.array(mode, dtype=float), np.ascontiguousarray(guess)
        )
        return velocity.copy(), lam

    def times(self, run: Solution, low: float | None = None, high: float | None = None) -> Array:
        """Sample times: SAMPLES in each segment of one mode, between two bounds."""
        low = run.problem.t_span[0] if low is None else low
        high = run.t_end if high is None else high
        if high <= low:
            return np.array([low])
        edges = [low, *(e.t for e in run.events if low < e.t < high), high]
        parts = [np.linspace(a, b, SAMPLES) for a, b in itertools.pairwise(edges) if b > a]
        return np.unique(np.concatenate(parts))

    def along(self, run: Solution, expression: Expr) -> Callable[[Any], Array]:
        """An expression in t and the states along a run, as a function of one or more times."""
        assert run.sol is not None
        sol, of_state = run.sol, sympy.lambdify([time_symbol, *self.built.states], expression, "numpy")
        return lambda t: np.broadcast_to(np.asarray(of_state(t, *sol(t)), dtype=float), np.shape(t))

    def zeros(
        self, run: Solution, expression: Expr, low: float | None = None, high: float | None = None
    ) -> list[tuple[float, int]]:
        """Times at which an expression vanishes along a run, each with its direction (0: it stays)."""
        value = self.along(run, expression)
        low = run.problem.t_span[0] if low is None else low
        high = run.t_end if high is None else high
        steps = np.asarray(run.t)
        steps = steps[(steps >= low) & (steps <= high)]
        times = np.unique(np.concatenate([self.times(run, low, high), steps]))
        values = value(times)
        small = 1e-10 * (1.0 + float(np.max(np.abs(values), initial=0.0)))
        signs = np.where(np.abs(values) <= small, 0, np.sign(values)).astype(int)
        found: list[tuple[float, int]] = []
        for k in range(len(times)):
            if signs[k] == 0:
                before = signs[k - 1] if k else 0
                later = signs[k + 1] if k + 1 < len(times) else 0
                if before != 0 or later != 0 or k == 0:
                    found.append((float(times[k]), int(np.sign(later - before))))
            elif k and signs[k] * signs[k - 1] < 0:
                root = brentq(value, times[k - 1], times[k], xtol=1e-15, rtol=1e-14)
                found.append((float(root), int(signs[k])))
        return found

    @cached_property
    def cycle(self) -> Cycle:
        """The periodic solution that the case settles on. Raises MissingError where it does not."""
        start, end = self.built.t_span
        factor, found = 1.0, None
        while factor <= LONGEST:
            run = self.solve(t_end=start + factor * (end - start))
            found = recurrence(run, self.events(run)) or found
            if found is not None and found.residual < 3e-11:
                return found
            if not run.status.ok:
                break
            factor *= 2.0
        if found is None or found.residual > 1e-7:
            raise MissingError(f"the solution does not recur within {LONGEST:g} times its span")
        return found

    def orbit(self, period: float | None = None) -> Orbit:
        """The periodic orbit near the start of the case, stable or not, from a guess of its period.

        Raises MissingError.
        """
        built, options = self.built, self._accuracy
        search = partial(find_orbit, built.system, built.x0, t0=built.t_span[0], period=period, **options)
        try:
            return in_time(self.deadline, search)
        except (SolveError, NotDifferentiableError, ModelError, UsageError) as error:
            raise MissingError(f"no periodic orbit was found: {error}") from None

    @property
    def _accuracy(self) -> dict[str, Any]:
        return {name: self.options[name] for name in ("rtol", "atol", "method") if name in self.options}

    def tree(self, t_end: float, release_times: int = 0) -> SolutionTree:
        """All solutions up to a time, with departures from sliding that can be left sampled."""
        tree: SolutionTree = solve(
            self.built.system, self.built.x0, (self.built.t_span[0], t_end), nonunique="branch",
            **self._accuracy, max_time=remaining(self.deadline), max_branches=256,
            release_times=release_times or None, backward=t_end < self.built.t_span[0],
        )  # fmt: skip
        self.field_calls += sum(branch.solution.nfev for branch in tree.branches)
        if tree.status is Status.TIMEOUT:
            raise OutOfTimeError
        return tree


def remaining(deadline: float) -> float:
    """Seconds until a time of the monotonic clock. Raises OutOfTimeError."""
    left = deadline - time.monotonic()
    if left <= 0:
        raise OutOfTimeError
    return left


def in_time(deadline: float, function: Callable[[], T]) -> T:
    """function(), interrupted also within symbolic computations. Raises OutOfTimeError."""
    try:
        return within(remaining(deadline), function)
    except OutOfBudgetError:
        raise OutOfTimeError from None


def slides(mode: Mode) -> bool:
    """Whether a mode slides on a surface."""
    return any(sign == 0 for sign in mode)
