"""The arcs of a solution: segments in one mode, with the condition that ends each of them.

An arc ends where a surface is reached (h = 0), where a multiplier reaches an end of its set (sliding exit),
or at an instant (clocks); then the state continues unchanged, or is reset. Boundary problems over several
arcs (`filippov.analysis.orbits.collocation`) are made of them.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from filippov import Solution, SolveError, System
from filippov.analysis.sensitivity.reset_slopes import reset_slopes
from filippov.analysis.sensitivity.saltation import Together, passive
from filippov.analysis.sensitivity.variation import mode_field
from filippov.base.arrays import Array
from filippov.base.status import EventKind, mode_text
from filippov.solving.state.events import Event, Mode
from filippov.solving.state.machine import Machine


class WordError(SolveError):
    """The sequence of arcs does not define a boundary problem, or is not that of the solution."""


@dataclass(frozen=True)
class Ending:
    """What ends an arc.

    kind    CROSSING or ENTRY: h = 0 of the surface `index`; EXIT: its multiplier at the end `side` of its
            set; RESET: h = 0 and a reset; TIME: the instant t, with a reset
    before, after  modes
    """

    kind: EventKind
    index: int
    before: Mode
    after: Mode
    side: int = 1
    t: float = 0.0

    def condition(
        self, system: System, names: tuple[str, ...], jacobian: Any, t: float, x: Array, p: Array
    ) -> tuple[float, Array]:
        """The value that is 0 at the end, and its derivatives by (x, named parameters, t): (N,)."""
        if self.kind is EventKind.TIME:
            return t - self.t, np.array([*[0.0] * (system.dimension + len(names)), 1.0])
        field = mode_field(system, self.before, names, jacobian)
        time, state = np.array([t]), np.asarray(x, dtype=float)[None, :]
        s, i = field.multipliers(time, state, p), self.index
        if self.kind is EventKind.EXIT:
            which = int(self.side > 0)
            value = s[0, i] - field.part("radius", time, state, s, p)[0, i, which]
            slope = field.multiplier_slope(time, state, s, p)[0, field.sliding.index(i)]
            return float(value), slope - field.part("radiusy", time, state, s, p)[0, 2 * i + which]
        value = field.part("h", time, state, s, p)[0, i, 0]
        width = system.surfaces[i].width
        if width:
            # A relay with hysteresis is left at h = -s width.
            value += self.before[i] * float(width)
        return float(value), np.asarray(field.part("hy", time, state, s, p)[0, i])

    def follow(
        self, system: System, names: tuple[str, ...], machine: Machine, t: float, x: Array, p: Array
    ) -> tuple[Array, Array]:
        """The state that the next arc begins with (n,), and its derivatives by (x, named parameters, t)."""
        n = system.dimension
        if self.kind not in (EventKind.RESET, EventKind.TIME):
            return x.copy(), np.eye(n, n + len(names) + 1)
        before = np.array(self.before, dtype=float)
        event = Event(
            t, "", self.index, self.kind, self.before, self.after, x, float("nan"), 0.0, 0
        )  # fmt: skip
        return machine.reset(self.index, t, x, before), reset_slopes(system, event, names, p)[:n]


@dataclass(frozen=True)
class Arc:
    """One segment of a solution in one mode: its times and states (k, n) there, and what ends it (None: the
    end of the solution)."""

    mode: Mode
    t: Array
    x: Array
    ending: Ending | None = None


@lru_cache(maxsize=32)
def _watched(system: System) -> tuple[bool, ...]:
    """For each surface whether it is watched only."""
    return tuple(q.kind == "observer" for q in system.surfaces)


def arcs_of(solutions: Sequence[Solution]) -> list[Arc]:
    """The arcs of solutions that follow each other. Raises WordError where events at one instant cannot be
    separated, impacts accumulate, or the mode changes between two solutions as no single event changes it.
    """
    out: list[Arc] = []
    for solution in solutions:
        sol = solution.sol
        assert sol is not None
        if out:
            between = joined(out[-1].mode, solution.start_mode)
            if between is None:
                last = out.pop()
                begin_t, begin_x = [last.t], [last.x]
            else:
                begin_t, begin_x = [], []
                out[-1] = Arc(out[-1].mode, out[-1].t, out[-1].x, between)
        else:
            begin_t, begin_x = [], []
        begin, mode = solution.problem.t_span[0], solution.start_mode
        for _, group in itertools.groupby(solution.events, key=lambda event: event.group):
            events = list(group)
            ending = _ending(solution, events)
            if ending is None:
                continue
            out.append(_arc(solution, mode, begin, events[0].t, ending, begin_t, begin_x))
            begin, mode, begin_t, begin_x = events[0].t, ending.after, [], []
        out.append(_arc(solution, mode, begin, solution.t_end, None, begin_t, begin_x))
    return out


def _arc(
    solution: Solution, mode: Mode, begin: float, end: float, ending: Ending | None, t: list[Array],
    x: list[Array],
) -> Arc:  # fmt: skip
    sol = solution.sol
    assert sol is not None
    knots = np.concatenate([[begin], sol.start[(sol.start > begin) & (sol.start < end)], [end]])
    inner = (knots[:-1, None] + np.diff(knots)[:, None] * np.arange(8) / 8).ravel()
    states = sol(inner, side="+").T
    last = np.asarray(sol(end, side="-"))[None, :]
    times = np.append(inner, end)
    return Arc(mode, np.concatenate([*t, times]), np.concatenate([*x, states, last]), ending)


def _ending(solution: Solution, events: list[Event]) -> Ending | None:
    """What the events of one instant come to; None where the field goes on as it was."""
    system = solution.problem.system
    first, last = events[0].before, events[-1].after
    acting = [e for e in events if not passive(e)]
    jumps = [e for e in acting if e.x_after is not None]
    if len(jumps) > 1:
        raise _refused(events, "several resets at one instant")
    if jumps:
        (event,) = jumps
        return Ending(event.kind, event.index, first, last, 1, event.t)
    if first == last:
        return None
    switching = [e for e in acting if e.kind is not EventKind.GRAZING]
    for event in switching:
        if event.kind is EventKind.ENTRY and system.surfaces[event.index].kind == "reset":
            raise _refused(events, "impacts accumulate")
    together = Together(solution, events)
    leaders = [e for e in switching if together.leads(e)]
    if len(leaders) > 1:
        leaders = [e for e in leaders if not _watched(system)[e.index]] or leaders[:1]
    if len(leaders) != 1:
        raise _refused(events, "several surfaces at one instant")
    (event,) = leaders
    side = 1 if last[event.index] > 0 else -1
    return Ending(event.kind, event.index, first, last, side, event.t)


def joined(before: Mode, after: Mode) -> Ending | None:
    """The event between two solutions that are put together: none where the modes agree."""
    changed = [i for i, (a, b) in enumerate(zip(before, after, strict=True)) if a != b]
    if not changed:
        return None
    if len(changed) > 1:
        raise WordError(
            f"between two of the given states the mode changes from {mode_text(before)} to "
            f"{mode_text(after)}, more than one event; give states at smaller distances."
        )
    (i,) = changed
    kind = EventKind.EXIT if before[i] == 0 else EventKind.ENTRY if after[i] == 0 else EventKind.CROSSING
    return Ending(kind, i, before, after, 1 if after[i] > 0 else -1)


def _refused(events: Sequence[Event], why: str) -> WordError:
    names = ", ".join(repr(e.surface) for e in events)
    return WordError(
        f"collocation needs events one at a time: {why} at t = {events[0].t:.9g} ({names}). Use shooting "
        "(method='DOP853') with several nodes."
    )
