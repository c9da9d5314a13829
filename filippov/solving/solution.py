"""The result of a run: scipy's names, and the segments, modes and events behind them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from filippov.base.delegates import delegate
from filippov.base.errors import ModelError, UsageError
from filippov.base.status import EventKind, Status, mode_text
from filippov.kernel.tables import codes
from filippov.solving.resets.zeno import Accumulation
from filippov.solving.selection.ambiguity import Ambiguity
from filippov.solving.selection.candidate import sliding_solutions
from filippov.solving.selection.higher_order import multipliers
from filippov.solving.selection.modes import Successor
from filippov.solving.state.event_log import EventLog
from filippov.solving.state.events import Event, Events, Mode
from filippov.solving.state.interpolant import Interpolant
from filippov.solving.state.machine import Machine
from filippov.solving.state.point import Point
from filippov.solving.state.problem import Problem
from filippov.solving.state.run import Run
from filippov.solving.state.watched import Watch

if TYPE_CHECKING:
    import networkx as nx

    from filippov.model.system import System

Array = npt.NDArray[np.float64]
# What a multiplier may be beyond its set by the error of the dense output.
OUTSIDE = 1e-6


@dataclass(frozen=True)
class Segment:
    """One stretch of the motion in one mode, from t0 to t1 in the direction of integration."""

    t0: float
    t1: float
    mode: Mode

    @property
    def dwell(self) -> float:
        """Length of the stretch in time."""
        return abs(self.t1 - self.t0)

    def __str__(self) -> str:
        return f"{mode_text(self.mode)} [{self.t0:.9g}, {self.t1:.9g}]"


def _still(t: float, x: Array, run: Run) -> tuple[Array, Array]:
    coef = np.zeros((1, *run.coef.shape[1:]))
    coef[0, 0] = x
    return np.array([[t, run.direction * np.finfo(float).tiny]]), coef


def _multipliers_at(run: Run) -> Array:
    """The multipliers where the run stands: the loop leaves those of the last stage that it took."""
    if np.all(run.mode != 0.0):
        return run.lam.copy()
    code, _, lam, _ = run.machine.probe(run.t, 0.0, run.x, run.mode, run.lam)
    return lam if code == 0 else run.lam.copy()


class Solution:
    """A solved problem.

    t, y        times (k,) and states (n, k): at t_eval, else at the ends of the steps. t increases strictly,
                but for `jumps`: there it stands twice, with the state before and the one after. At t_eval a
                jump has one sample, the state before it
    jumps       times at which the state jumps
    sol         dense output sol(t, side="-"), None without dense_output
    t_events, y_events   times and states of the events: a list a surface, time event, user event
    user_events names of the user events
    events      all events in order; segments: stretches of one mode; modes: their modes
    status, message, success   how the run ended
    nfev, njev, nlu, steps, rejected   work done
    problem     what was solved
    ambiguity   what can follow at the end of a run with status NON_UNIQUE, else None
    accumulations  limits of events that accumulate, in order; `zeno`: the last of them
    """

    def __init__(
        self, problem: Problem, run: Run, start_mode: Mode, status: Status, message: str,
        t_eval: Array | None, watch: Watch,
    ) -> None:  # fmt: skip
        self.problem, self.status, self.message = problem, status, message
        self.start_mode = start_mode[: watch.surfaces]
        self.ambiguity: Ambiguity | None = None
        self.accumulations: tuple[Accumulation, ...] = ()
        self.events: Events = watch.events(run)
        self.events.place_of = problem.system.surface_place
        self.user_events = watch.names
        self.options = run.options
        self.nfev = run.calls()
        self.njev, self.nlu = run.factorisations()
        self.steps, self.rejected = int(run.count[codes.STEPS]), int(run.count[codes.REJECTED])
        self.t_end, self.x_end, self.end_mode = run.t, run.x.copy(), run.signs[: watch.surfaces]
        self.end_multipliers = _multipliers_at(run)[: watch.surfaces]
        self.sol = self._interpolant(run)
        self.t, self.y = self._samples(run, t_eval)

    @property
    def success(self) -> bool:
        """Whether the run did what it was asked to do."""
        return self.status.ok

    @property
    def zeno(self) -> Accumulation | None:
        """The last limit of events that accumulate, None without one."""
        return self.accumulations[-1] if self.accumulations else None

    @property
    def candidates(self) -> tuple[Successor, ...]:
        """The modes that can follow where the run ended as NON_UNIQUE; else empty."""
        return self.ambiguity.candidates if self.ambiguity is not None else ()

    @property
    def system(self) -> Any:
        """The system that was solved."""
        return self.problem.system

    def _interpolant(self, run: Run) -> Interpolant | None:
        if not run.options.dense_output:
            return None
        n = run.machine.n
        span = (self.problem.t_span[0], run.t)
        if not run.steps and not self.jumps.size:
            coef = np.zeros((1, 2, n))
            coef[0, 0] = run.x
            return Interpolant(np.array([span[0]]), np.ones(1), coef, span)
        pieces = list(run.steps)
        # A jump at either end of the run lies between a state and no step: the state is kept as a step of 0.
        if span[0] in self.jumps:
            pieces.insert(0, _still(span[0], self.problem.x0, run))
        if span[1] in self.jumps:
            pieces.append(_still(span[1], run.x, run))
        table = np.concatenate([table for table, _ in pieces])
        coef = np.concatenate([coef for _, coef in pieces])
        return Interpolant(table[:, 0].copy(), table[:, 1].copy(), coef, span)

    def _samples(self, run: Run, t_eval: Array | None) -> tuple[Array, Array]:
        if self.sol is None and self._may_jump:
            return self._corners(run)
        if self.sol is None:
            t, x = run.events.table()
            times = np.concatenate(([self.problem.t_span[0]], t, [self.t_end]))
            x = x.reshape(len(t), len(self.problem.x0))
            states = np.concatenate((self.problem.x0[None, :], x, self.x_end[None, :]))
            keep = np.append(True, np.diff(times) != 0)
            return times[keep], states[keep].T.copy()
        if t_eval is not None:
            direction = self.sol.direction
            reached = t_eval[(t_eval - self.t_end) * direction <= 0]
            if self.t_end != self.problem.t_span[1] and (not len(reached) or reached[-1] != self.t_end):
                # A run that ends early ends at a point of its own.
                reached = np.append(reached, self.t_end)
            return reached, self.sol(reached).reshape(len(self.problem.x0), len(reached))
        times = np.append(self.sol.start, self.t_end)
        times = times[np.append(True, np.diff(times) != 0)]
        states = self.sol(times, side="+").reshape(len(self.problem.x0), len(times))
        states[:, -1] = self.x_end
        if self.jumps.size:
            at = np.searchsorted(times * self.sol.direction, self.jumps * self.sol.direction)
            first = {e.t: e.x for e in reversed(self.events) if e.x_after is not None}
            before = np.array([first[t] for t in self.jumps.tolist()]).T
            times, states = np.insert(times, at, self.jumps), np.insert(states, at, before, axis=1)
        return times, states

    def _corners(self, run: Run) -> tuple[Array, Array]:
        """Start, events and end, where no steps are kept; a jump has the state before and the one after."""
        rows = [(self.problem.t_span[0], self.problem.x0)]
        for event in run.events:
            if event.t != rows[-1][0] or event.x_after is not None:
                if event.t == rows[-1][0] and len(rows) > 1 and rows[-2][0] == event.t:
                    rows.pop()  # a second event of the same jump
                elif event.t != rows[-1][0]:
                    rows.append((event.t, event.x))
                if event.x_after is not None:
                    rows.append((event.t, event.x_after))
        if self.t_end != rows[-1][0]:
            rows.append((self.t_end, self.x_end))
        return np.array([t for t, _ in rows]), np.array([x for _, x in rows]).T.copy()

    @property
    def jumps(self) -> Array:
        """Times at which the state jumps, each once; there t has two entries, before and after."""
        if not self._may_jump:
            return np.zeros(0)
        return np.array(list(dict.fromkeys(e.t for e in self.events if e.x_after is not None)), dtype=float)

    @property
    def _may_jump(self) -> bool:
        return any(q.reset is not None for q in (*self.system.surfaces, *self.system.time_events))

    @cached_property
    def segments(self) -> tuple[Segment, ...]:
        """The stretches of one mode; their lengths add up to the span."""
        if self.options.save_events == "count":
            raise UsageError("segments need the events, which were counted; pass save_events='all'.")
        out: list[Segment] = []
        begin, mode = self.problem.t_span[0], self.start_mode
        for event in self.events:
            if event.after == mode:
                continue
            if event.t != begin:
                out.append(Segment(begin, event.t, mode))
            begin, mode = event.t, event.after
        if not out or begin != self.t_end:
            out.append(Segment(begin, self.t_end, mode))
        return tuple(out)

    @property
    def modes(self) -> tuple[str, ...]:
        """Modes of the segments, as text."""
        return tuple(mode_text(segment.mode) for segment in self.segments)

    @property
    def event_counts(self) -> dict[str, dict[str, int]]:
        """Number of events by surface and kind; all of them, also with save_events="count"."""
        counts: Counter[tuple[str, str]] = Counter()
        if isinstance(self.events, EventLog):
            for (index, kind), number in self.events.counts.items():
                counts[self.events.names[index], str(kind)] += number
        else:
            counts.update((event.surface, str(event.kind)) for event in self.events)
        out: dict[str, dict[str, int]] = {}
        for (name, kind_name), number in sorted(counts.items()):
            out.setdefault(name, {})[kind_name] = number
        return out

    @property
    def t_events(self) -> list[Array]:
        """Times of the events of each surface, then of each time event, then of each user event."""
        return [np.array([e.t for e in self.events if self._listed(e, i)]) for i in self._places]

    @property
    def y_events(self) -> list[Array]:
        """States at these events, one row an event; before it, where the state jumps."""
        n = len(self.problem.x0)
        rows = [[e.x for e in self.events if self._listed(e, i)] for i in self._places]
        return [np.array(row, dtype=float).reshape(len(row), n) for row in rows]

    def _listed(self, event: Event, i: int) -> bool:
        # A touching is listed for a surface; it is no event of a user's function.
        touching = event.kind is EventKind.GRAZING and i >= len(self.system.surfaces)
        return event.index == i and not touching

    @property
    def _places(self) -> range:
        system = self.system
        return range(len(system.surfaces) + len(system.time_events) + len(self.user_events))

    def mode_at(self, t: float, side: str = "-") -> Mode:
        """The mode at a time; at an event the one before it for "-", after it for "+"."""
        low, high = sorted((self.problem.t_span[0], self.t_end))
        if not low <= t <= high:
            raise UsageError(f"mode_at was asked for t = {t}, outside the solved span [{low}, {high}].")
        first, last = (self.segments, reversed(self.segments))
        for segment in first if side == "-" else last:
            if min(segment.t0, segment.t1) <= t <= max(segment.t0, segment.t1):
                return segment.mode
        return self.end_mode

    def multiplier(self, surface: str, t: Any) -> Array:
        """Value of a surface's sign: +-1 off it, the multiplier of Filippov's combination while sliding.

        surface     its name, or the formula of its h; for h = v - vb "vb - v" gives the sign of vb - v
        """
        try:
            i, sense = self.system.surface_place(surface)
        except ModelError as error:
            raise UsageError(str(error)) from None
        if self.sol is None:
            raise UsageError("the multiplier needs the dense output; solve without dense_output=False.")
        options = self.options
        machine = Machine(self.problem.system, options.method, self.problem.p, sliding=options.sliding)
        times = np.atleast_1d(np.asarray(t, dtype=float))
        out = np.empty(times.size)
        for k, time in enumerate(times.tolist()):
            mode = np.array(self.mode_at(time), dtype=float)
            out[k] = mode[i]
            if mode[i] == 0:
                held = multipliers(machine, time, self.sol(time), mode)
                out[k] = (self._multipliers(machine, time, mode) if held is None else held)[i]
        out *= sense
        return out if np.ndim(t) else out[0]

    def _multipliers(self, machine: Machine, t: float, mode: Array) -> Array:
        """Multipliers while sliding: where signs multiply, the root that the motion followed.

        That is the one in its set; of several, the one with the field of the motion.
        """
        assert self.sol is not None
        x = self.sol(t)
        point = Point(machine, t, x, self.sol.direction, 0.0, np.zeros(mode.size))
        roots = sliding_solutions(point, mode, np.flatnonzero(mode == 0).tolist())
        if not roots:
            return machine.probe(t, 0.0, x, mode, point.guess)[2]
        if len(roots) == 1:
            return roots[0][0]
        rate, radii, on = self.sol.rate(t), machine.radii(t, x), mode == 0

        def misses(root: tuple[Array, Array]) -> tuple[float, float]:
            out = np.maximum(root[0] - radii[:, 1], radii[:, 0] - root[0])[on]
            return max(float(np.max(out)), OUTSIDE), float(np.linalg.norm(root[1] - rate))

        return min(roots, key=misses)[0]

    def dwell_times(self) -> Mapping[str, float]:
        """Total time in each mode."""
        total: dict[str, float] = {}
        for segment in self.segments:
            name = mode_text(segment.mode)
            total[name] = total.get(name, 0.0) + segment.dwell
        return total

    def mode_graph(self) -> nx.MultiDiGraph:
        """The transitions that were observed, with counts and dwell times (see `filippov.graphs.graph`)."""
        graph: nx.MultiDiGraph = delegate("Solution.mode_graph")(self)
        return graph

    def plot(self, **options: Any) -> Any:
        """Time response with sliding phases marked (see `filippov.plot.solution`)."""
        return delegate("Solution.plot")(self, **options)

    def save(self, path: str | Path) -> Path:
        """Write the solution to a file; it appears complete or not at all (see `filippov.io.storage`)."""
        written: Path = delegate("Solution.save")(self, path)
        return written

    @classmethod
    def load(cls, path: str | Path, system: System | None = None) -> Solution:
        """Read what `save` wrote; a system of plain functions has to be given again."""
        loaded: Solution = delegate("Solution.load")(path, system)
        return loaded

    def to_xarray(self) -> Any:
        """An xarray.Dataset: every state over t, every event over `event` (see `filippov.io.export`)."""
        return delegate("Solution.to_xarray")(self)

    def __repr__(self) -> str:
        counted = self.options.save_events == "count"
        parts = "" if counted else f"{len(self.segments)} segments, "
        number = sum(sum(kinds.values()) for kinds in self.event_counts.values())
        return (
            f"Solution({self.status.value} at t = {self.t_end:.9g}; {number} events, "
            f"{parts}{self.steps} steps, {self.nfev} field calls)"
        )
