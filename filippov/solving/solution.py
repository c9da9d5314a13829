"""The result of a run: scipy's names, and the segments, modes and events behind them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from filippov.base.arrays import Array
from filippov.base.delegates import delegate
from filippov.base.errors import UsageError
from filippov.base.given import Amount, Positive
from filippov.base.keywords import keywords
from filippov.base.names import no_attribute
from filippov.base.status import EventKind, Status, mode_text
from filippov.solving.resets.zeno import Accumulation
from filippov.solving.segments import Segment, Segments
from filippov.solving.selection.ambiguity import Ambiguity
from filippov.solving.selection.modes import Successor
from filippov.solving.state.event_log import EventLog
from filippov.solving.state.events import Event, Events, Mode
from filippov.solving.state.interpolant import Interpolant, outside
from filippov.solving.state.options import Options
from filippov.solving.state.problem import Problem

if TYPE_CHECKING:
    import networkx as nx
    from matplotlib.figure import Figure

    from filippov.model.system import System


_PICTURES = (".png", ".pdf", ".svg", ".jpg", ".jpeg", ".eps")
_AT_TIMES = (
    "to_pandas takes no times: its rows are those of solution.t. At others solve with t_eval=times, or read "
    "solution.evaluate('x', times)."
)
_OTHER_PLOTS = {
    "phase": "phase is no option: a phase portrait is filippov.plot.plot_phase(solution, 'x', 'v').",
    "outputs": "outputs stand beside the states: plot(['x', 'effort']).",
    "ax": "ax is no option: figure=fig draws into a figure of yours; its axes are fig.axes.",
    "xlabel": "xlabel is labels={'t': 'time [s]'} here.",
    "ylabel": "ylabel is labels={'x': 'position [m]'} here, by name of state.",
    **{
        name: f"{name} is set on the axes of the figure: for ax in solution.plot().axes: ..."
        for name in ("xlim", "ylim", "grid", "legend")
    },
    "figsize": "figsize is no option: plot(figure=plt.figure(figsize=(8, 6), layout='constrained')).",
    "show": "show is no option: the figure is returned; matplotlib.pyplot.show() shows it.",
    "filename": "filename is no option: plot().savefig('run.png') writes the figure.",
}


# What others call it, or would like to call.
_FIGURE = "solution.plot() is the figure; .savefig('run.png') writes it."
_TABLE = "solution.to_pandas() is a table; .to_csv('run.csv') writes it."
_BY_NAME = "solution['x'] is a state or an output by its name, y has a row per state."
_OF_ORBITS = "that of an orbit is in filippov.analysis.find_orbit, along a trajectory in Sweep(measure=...)."
_OTHER_NAMES = {
    **dict.fromkeys(("x", "X", "u", "states"), _BY_NAME),
    **dict.fromkeys(("time", "times", "T"), "the times are t."),
    **dict.fromkeys(("savefig", "show", "figure"), _FIGURE),
    **dict.fromkeys(("to_csv", "to_excel", "to_dataframe", "df"), _TABLE),
    **dict.fromkeys(("period", "amplitude"), _OF_ORBITS),
    **dict.fromkeys(("at", "interpolate", "interp", "resample"), "solution.sol(t) has the states at t."),
    "plot_phase": "filippov.plot.plot_phase(solution, 'x', 'v') is the phase portrait.",
}


# Parts of the solution of a run that are made when they are asked for.
_WHEN_ASKED = {"t", "y", "sol", "message"}


def may_jump(system: System) -> bool:
    """Whether a system has resets."""
    sides = (role.side for role in system.roles)
    return any(side is not None for side in sides) or any(q.reset is not None for q in system.time_events)


def jump_times(system: System, events: Events) -> Array:
    """Times at which the state jumps, each once."""
    if not may_jump(system):
        return np.zeros(0)
    return np.array(list(dict.fromkeys(e.t for e in events if e.x_after is not None)), dtype=float)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Solution:
    """A solved problem.

    t, y        times (k,) and states (n, k): at t_eval, else at the ends of the steps. t increases strictly,
                except at `jumps`, where it appears twice, with the state before and after. At t_eval a jump
                has one sample, the state before it
    jumps       times at which the state jumps
    sol         dense output sol(t, side="-"), None without dense_output
    t_events, y_events   times and states of the events: a list per surface, time event, user event
    user_events names of the user events
    events      all events in order; segments: its parts in one mode; modes: their modes
    status, message, success   how the run ended
    nfev, njev, nlu, steps, rejected   work done
    problem     what was solved
    ambiguity   what can follow at the end of a run with status NON_UNIQUE, else None
    accumulations  limits of events that accumulate, in order; `zeno`: the last of them
    """

    _write: ClassVar[str] = ": what solve(system, x0, t_span) returns"

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

    @classmethod
    def made_of(cls, course: Any, **parts: Any) -> Solution:
        """A solution of which `course` makes some when it is asked for them (see `_WHEN_ASKED`)."""
        made = cls.__new__(cls)
        made.__dict__.update(parts, _course=course)
        return made

    if not TYPE_CHECKING:  # what is not there is an error for the type checker

        def __getattr__(self, name: str) -> Any:
            course, parts = self.__dict__.get("_course"), self.__dict__
            if course is not None and name in _WHEN_ASKED:
                parts.update(course.made(name, self))
                if parts.keys() >= _WHEN_ASKED:
                    parts.pop("_course", None)
            if name not in parts:  # another thread may have made it
                raise AttributeError(self._absent(name))
            return parts[name]

    def _absent(self, name: str) -> str:
        answers, problem = dict(_OTHER_NAMES), self.__dict__.get("problem")
        if problem is not None:
            named = (*problem.system.states, *problem.system.outputs)
            answers |= {one: f"its values are solution[{one!r}]." for one in named}
        return no_attribute("Solution", name, {*dir(type(self)), *self.__dataclass_fields__}, answers)

    @property
    def success(self) -> bool:
        """Whether the run reached its end, or the event at which it was to stop."""
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
    def segments(self) -> Segments:
        """The segments, each in one mode; their lengths add up to the span. segments.of("stick") selects."""
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
        return Segments.made(out, self.system.surface_names)

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
        """States at these events, one row per event; before it, where the state jumps."""
        n = len(self.problem.x0)
        rows = [[e.x for e in self.events if self._listed(e, i)] for i in self._places]
        return [np.array(row, dtype=float).reshape(len(row), n) for row in rows]

    def _listed(self, event: Event, i: int) -> bool:
        # A tangency is listed for a surface; it is no event of a user's function.
        grazing = event.kind is EventKind.GRAZING and i >= len(self.system.roles)
        return event.index == i and not grazing

    @property
    def _places(self) -> range:
        system = self.system
        return range(len(system.roles) + len(system.time_events) + len(self.user_events))

    @keywords()
    def mode_at(self, t: float, side: str = "-") -> Mode:
        """The mode at a time; at an event the one before it for "-", after it for "+"."""
        low, high = sorted((self.problem.t_span[0], self.t_end))
        if not low <= t <= high:
            raise UsageError(outside("mode_at", t, low, high))
        first, last = (self.segments, reversed(self.segments))
        for segment in first if side == "-" else last:
            if min(segment.t0, segment.t1) <= t <= max(segment.t0, segment.t1):
                return segment.mode
        return self.end_mode

    def __len__(self) -> int:
        raise TypeError("a Solution has no length: len(solution.t) samples, len(solution.events) events.")

    def __bool__(self) -> bool:
        return True

    def __getitem__(self, name: Any) -> Array:
        """The values of a state or an output at `t`, by its name: r["x"], r["effort"]."""
        found: Array = delegate("Solution.__getitem__")(self, name)
        return found

    @keywords()
    def evaluate(self, what: Any, t: Any = None, side: str = "-") -> Any:
        """The value of an expression or output at times, else at `t` (see `filippov.solving.reading`)."""
        return delegate("Solution.evaluate")(self, what, t, side)

    @keywords()
    def multiplier(self, surface: str, t: Any = None) -> Any:
        """Value of a surface's sign at times, or at `t`: +-1, Filippov's multiplier while sliding.

        surface     its name, or the formula of its h; for h = v - vb "vb - v" gives the sign of vb - v
        """
        return delegate("Solution.multiplier")(self, surface, t)

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

    @keywords(answers=_OTHER_PLOTS)
    def plot(
        self, states: Sequence[str] | str | None = None, *, multiplier: str | None = None,
        labels: Mapping[str, str] | None = None, events: bool = True, points: Amount = 2000, title: str = "",
        figure: Figure | None = None,
    ) -> Figure:  # fmt: skip
        """Time response of states and outputs, sliding phases marked (see `filippov.plot.solution`)."""
        for name in (states,) if isinstance(states, str) else states or ():
            if str(name).lower().endswith(_PICTURES):
                raise UsageError(
                    f"plot was given {name!r}, expected states; it returns the figure: "
                    f"solution.plot().savefig({name!r})."
                )
        drawn: Figure = delegate("Solution.plot")(
            self, states, multiplier=multiplier, labels=labels, events=events, points=points, title=title,
            figure=figure,
        )  # fmt: skip
        return drawn

    @keywords()
    def animate(
        self, path: str | Path, states: Sequence[str] | str | None = None, *, seconds: Positive = 6.0,
        frames: Amount = 90, labels: Mapping[str, str] | None = None, title: str = "",
    ) -> Path:  # fmt: skip
        """Write the solution as a film, .gif or .mp4 (see `filippov.plot.animation`)."""
        written: Path = delegate("Solution.animate")(
            self, path, states, seconds=seconds, frames=frames, labels=labels, title=title
        )
        return written

    @keywords()
    def save(self, path: str | Path) -> Path:
        """Write the solution to a file; it appears complete or not at all (see `filippov.io.storage`)."""
        written: Path = delegate("Solution.save")(self, path)
        return written

    @classmethod
    @keywords()
    def load(cls, path: str | Path, system: System | None = None) -> Solution:
        """Read what `save` wrote; a system of plain functions has to be given again."""
        loaded: Solution = delegate("Solution.load")(path, system)
        return loaded

    @keywords()
    def to_xarray(self) -> Any:
        """An xarray.Dataset: every state over t, every event over `event` (see `filippov.io.export`)."""
        return delegate("Solution.to_xarray")(self)

    @keywords(answers={"*": _AT_TIMES})
    def to_pandas(self) -> Any:
        """A pandas.DataFrame of states and outputs over t (see `filippov.io.export`)."""
        return delegate("Solution.to_pandas")(self)

    def _repr_html_(self) -> str:
        text: str = delegate("Solution._repr_html_")(self)
        return text

    def __repr__(self) -> str:
        counted = self.options.save_events == "count"
        parts = "" if counted else f"{len(self.segments)} segments, "
        number = sum(sum(kinds.values()) for kinds in self.event_counts.values())
        back = f", backwards from {self.problem.t_span[0]:.9g}" if self.problem.backward else ""
        return (
            f"Solution({self.status.value} at t = {self.t_end:.9g}{back}; {number} events, "
            f"{parts}{self.steps} steps, {self.nfev} field calls)"
        )

    def __str__(self) -> str:
        return repr(self) if self.success else f"{self!r}\n{self.message}"
