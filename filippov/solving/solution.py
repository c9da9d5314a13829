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
from filippov.solving.resets.zeno import Accumulation
from filippov.solving.selection.ambiguity import Ambiguity
from filippov.solving.selection.candidate import sliding_solutions
from filippov.solving.selection.higher_order import multipliers
from filippov.solving.selection.modes import Successor
from filippov.solving.state.event_log import EventLog
from filippov.solving.state.events import Event, Events, Mode
from filippov.solving.state.interpolant import Interpolant
from filippov.solving.state.machine import Machine
from filippov.solving.state.options import Options
from filippov.solving.state.point import Point
from filippov.solving.state.problem import Problem

if TYPE_CHECKING:
    import networkx as nx

    from filippov.model.surface import Surface
    from filippov.model.system import System
    from filippov.model.time_event import TimeEvent

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


def may_jump(system: System) -> bool:
    """Whether a system has resets."""
    holders: tuple[Surface | TimeEvent, ...] = (*system.surfaces, *system.time_events)
    return any(holder.reset is not None for holder in holders)


def jump_times(system: System, events: Events) -> Array:
    """Times at which the state jumps, each once."""
    if not may_jump(system):
        return np.zeros(0)
    return np.array(list(dict.fromkeys(e.t for e in events if e.x_after is not None)), dtype=float)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
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

    problem: Problem
    options: Options
    status: Status
    message: str
    t: Array
    y: Array
    sol: Interpolant | None
    events: Events
    user_events: tuple[str, ...]
    start_mode: Mode
    end_mode: Mode
    t_end: float
    x_end: Array
    end_multipliers: Array
    nfev: int
    njev: int
    nlu: int
    steps: int
    rejected: int
    ambiguity: Ambiguity | None = None
    accumulations: tuple[Accumulation, ...] = ()

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
    def system(self) -> System:
        """The system that was solved."""
        return self.problem.system

    @property
    def jumps(self) -> Array:
        """Times at which the state jumps, each once; there t has two entries, before and after."""
        return jump_times(self.system, self.events)

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
        back = f", backwards from {self.problem.t_span[0]:.9g}" if self.problem.backward else ""
        return (
            f"Solution({self.status.value} at t = {self.t_end:.9g}{back}; {number} events, "
            f"{parts}{self.steps} steps, {self.nfev} field calls)"
        )
