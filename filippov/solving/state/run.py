"""One run of the compiled loop: its arrays, and the steps and events it hands over."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array
from filippov.base.errors import ModelError
from filippov.base.status import EventKind
from filippov.kernel.language.records import Rows
from filippov.kernel.loop.state import Clock, Count, EventCycles, Trajectory
from filippov.kernel.tables import codes
from filippov.kernel.tables.root_tables import NODES
from filippov.solving.state.clocks import Clocks, start_clock
from filippov.solving.state.event_log import EventLog
from filippov.solving.state.events import Event, Mode, Stop
from filippov.solving.state.gradients import check_gradients, scatter
from filippov.solving.state.machine import Machine
from filippov.solving.state.options import Options

_EVENT_ROOM, _RECORD_ROOM = 256, 512
# Events that are kept where they are only counted: what recognising an accumulation looks back on.
_KEPT = 64
# Events at which the gradients of functions are looked at.
_LOOKED_AT = 32


def guard_terms(g: Array, gt: Array, t: float, x: Array) -> Array:
    """The size of the terms of every h, sum_k |x_k dh/dx_k| + |t dh/dt|: what rounding in it is part of.

    Without those of an infinite slope, that of a root which is 0.
    """
    slopes, drift = (np.where(np.isfinite(q), np.abs(q), 0.0) for q in (g, gt))
    return np.asarray(slopes @ np.abs(x) + drift * abs(t))


def near_within(run: Run, x: Array, slack: Array, mode: Array) -> list[int]:
    """The surfaces on which a state is but for `slack` in its components, also where a slope is infinite."""
    machine = run.machine
    h = np.abs(machine.guards(run.t, x, mode))
    g, _ = machine.gradients(run.t, x, mode)
    with np.errstate(invalid="ignore"):
        off = ~np.isfinite(h) | (h > np.abs(g) @ slack)
    able = [role != "observer" and w == 0.0 for role, w in zip(machine.roles, machine.widths, strict=True)]
    return [i for i in range(machine.m) if able[i] and not off[i]]


# Roots of a function that lie in one place, at most: their time is known to a power of rounding.
MOST_MULTIPLE = 3
# How closely the root of a function is to be known, relative to the time.
NEAR_ROOT = 1e-9
# Relative to 1 and the states: what h may be at its zero, however steep it is.
JUMP = 1e-9


class Run:
    """State and buffers of one trajectory; `advance` moves it on and collects what came out."""

    # What compiled functions are called with where the run stands, made once; None where Python looks first.
    _guarding: list[Any] | None
    _probing: list[Any] | None

    def __init__(self, machine: Machine, x0: Array, span: tuple[float, float], options: Options) -> None:
        n, m = machine.n, machine.m
        self.x, self.atol = np.zeros(n), np.zeros(n)
        self.mode, self.lam, self.h, self.held = np.zeros((4, m))
        self.probed = np.zeros(n + NODES * 2 * m)
        self.order, self.trigger = np.zeros((2, m), dtype=np.int64)
        self.clock, self.count = Clock.new(), Count.new()
        self.stop = np.zeros((m, codes.STOPS), dtype=np.int64)
        self.zeno = Rows(EventCycles, np.zeros((m, EventCycles.size)))
        powers = machine.compiled.sizes.powers
        self.record = np.zeros((_RECORD_ROOM, 2))
        self.coef = np.zeros((_RECORD_ROOM, powers, n))
        room = _EVENT_ROOM + m + len(machine.system.time_events)
        self.found = np.zeros((room, machine.event_size))
        self.marks = np.zeros((room, 3 + 2 * m), dtype=np.int64)
        events, clocks = (q.name for q in machine.events), (q.name for q in machine.system.time_events)
        self.names: tuple[str, ...] = (*machine.system.surface_names, *events, *clocks)
        self.trajectory = Trajectory.new()
        self.trajectory.refer(
            clock=self.clock, count=self.count, x=self.x, m=self.mode, order=self.order, trigger=self.trigger,
            lam=self.lam, atol=self.atol, stop=self.stop, zeno=self.zeno, rec=self.record,
            rec_coef=self.coef, events=self.found, marks=self.marks,
        )  # fmt: skip
        self._blank = (
            self.order, self.trigger, self.lam, self.stop, self.zeno.array,
            self.clock.array, self.count.array, self.trajectory.now.array,
        )  # fmt: skip
        self.own, self.ticked = machine, False
        self.attach(machine)
        self._start(x0, span, options)

    def _start(self, x0: Array, span: tuple[float, float], options: Options) -> None:
        """The values that a run starts from, where everything else is 0."""
        m, clock, count = self.machine.m, self.clock, self.count
        self.options = options
        self.x[:] = x0
        self.mode.fill(1.0)
        start_clock(clock, span, options)
        count.store = int(options.dense_output)
        count.event_room, count.record_room = _EVENT_ROOM + m, _RECORD_ROOM
        self.atol[:] = (
            options.atol if type(options.atol) is float else options.tolerances(self.machine.system)
        )
        keep = None if options.save_events == "all" else _KEPT
        users = range(len(self.machine.system.roles), m)
        forwards = span[1] >= span[0]
        self.events = EventLog(self.names, 1 if forwards else -1, self.x.size, keep, users)
        self.steps: list[tuple[Array, Array]] = []
        # The limit of the events so far, and what it was asked for (see `resets.zeno`).
        self.limit: tuple[Any, Any] | None = None
        # Whether cycles shrink by a power of their number, and the number of events until which that is so.
        self.of_a_power: tuple[bool, int] = (False, 0)
        # Where the present mode was taken up.
        self.taken = span[0], self.x.copy()
        self.begun = self.x.copy()
        self.direction = 1.0 if forwards else -1.0

    def again(self, p: Array, x0: Array, span: tuple[float, float], options: Options) -> None:
        """As a new run of the same machine, with other values."""
        self.machine.again(p)
        for array in self._blank:
            array.fill(0)
        self._start(x0, span, options)

    def attach(self, machine: Machine) -> None:
        """Go on with another machine of the same states, surfaces and method; what was counted goes along."""
        last = getattr(self, "machine", machine)
        if machine.pieces is not None and last.pieces is not None and last is not machine:
            machine.pieces.like(last.pieces)
        if last is not machine:
            machine.calls += last.calls
            machine.iw.jacobians += last.iw.jacobians
            machine.iw.factors += last.iw.factors
            last.iw.jacobians = last.iw.factors = 0
            last.calls = 0
        self.machine = machine
        self.trajectory.refer(p=machine.p, w=machine.w, iw=machine.iw, ctx=machine.context)
        self._arguments = machine.compiled.arguments("advance", {"run": self.trajectory})
        self._guarding, self._probing = None, None
        if machine.formulas:
            here = {"t": 0.0, "x": self.x, "p": machine.p, "m": self.mode, "ctx": machine.context}
            self._guarding = machine.compiled.arguments("guards", {"out": self.h, **here})
            there = {"step": 0.0, "lam": self.held, "out": self.probed, "w": machine.w, "iw": machine.iw}
            self._probing = machine.compiled.arguments("probe", {**here, **there})

    def tick(self, clocks: Clocks) -> None:
        """Let the compiled loop look after the time events, where they are all that is due at instants."""
        if not clocks and self.ticked:
            return
        self.ticked = True
        self.trajectory.refer(ticks=clocks.ticks, instants=clocks.instants)
        self.count.ticks = len(clocks.events) if self.machine.ticking and self.direction > 0 else 0

    @property
    def t(self) -> float:
        """Time reached."""
        return float(self.clock.t)

    @property
    def signs(self) -> Mode:
        """The mode as integers."""
        return tuple(map(int, self.mode.tolist()))

    def begin(self) -> int:
        """Find the initial mode in compiled code; GENERAL where it is not simple."""
        machine = self.machine
        if machine.callbacks is None:
            return int(machine.compiled.functions["begin"](*self._arguments))
        check_gradients(machine, self.t, self.x)
        return machine.call("begin", run=self.trajectory)

    def guards(self) -> Array:
        """All switching functions where the run stands; the array is used again."""
        if self._guarding is None:
            return self.machine.guards(self.t, self.x, self.mode)
        self._guarding[0] = self.t
        self.machine.compiled.functions["guards"](*self._guarding)
        return self.h

    def multipliers(self) -> Array:
        """The multipliers where the run stands: the loop leaves those of the last stage that it took."""
        if 0.0 not in self.mode.tolist():
            return self.lam.copy()
        if self._probing is None:
            code, _, lam, _ = self.machine.probe(self.t, 0.0, self.x, self.mode, self.lam)
        else:
            self._probing[0], self.held[:] = self.t, self.lam
            code, lam = self.machine.compiled.functions["probe"](*self._probing), self.held.copy()
        return lam if code == 0 else self.lam.copy()

    def watch(self, stops: tuple[Stop, ...]) -> None:
        """Set the events at which to stop."""
        names = self.machine.system.surface_names
        for item in stops:
            row = self.stop[names.index(item.surface)]
            row[item.column] = min(item.count, row[item.column] or item.count)

    def stop_at(self, index: int, direction: float) -> None:
        """Stop at the next crossing of a surface: upwards, downwards, or (0) either."""
        column = codes.CROSSING_UP if direction > 0 else codes.CROSSING_DOWN
        self.stop[index, codes.CROSSING_EITHER if direction == 0 else column] = 1

    def advance(self, steps: int) -> int:
        """Run the compiled loop for at most so many steps; returns its code. User errors are raised."""
        self.count.step_budget = steps
        left = max(self.options.max_events - self.events.total, 1)
        self.count.event_room = min(_EVENT_ROOM, left) + self.machine.m
        if self.machine.callbacks is not None:
            self.machine.callbacks.speed_up(self.machine.system.parameters.names, self.t, self.x)
        code = int(self.machine.compiled.functions["advance"](*self._arguments))
        self.collect()
        self.machine.raise_error()
        if code == codes.GENERAL:
            check_gradients(self.machine, self.t, self.x)
        return code

    def collect(self) -> None:
        """Move what the buffers hold to the lists."""
        records, events = int(self.count.records), int(self.count.events)
        if records:
            self.steps.append((self.record[:records].copy(), self.coef[:records].copy()))
            self.count.records = 0
        if self.machine.callbacks is not None:
            self._check_continuous(events)
        self.events.add_rows(self.found[:events], self.marks[:events])
        self.count.events = 0

    def cut(self, t: float) -> None:
        """Let the dense output end at an earlier time."""
        while self.steps:
            rows, coef = self.steps[-1]
            t0, step = rows[-1]
            if (t0 - t) * self.direction >= 0.0:
                rows, coef = rows[:-1], coef[:-1]
                self.steps.pop()
                if len(rows):
                    self.steps.append((rows, coef))
                continue
            part = (t - t0) / step
            if part < 1.0:
                rows[-1, 1] = t - t0
                coef[-1] *= part ** np.arange(len(coef[-1]))[:, None]
            return

    def _check_continuous(self, events: int) -> None:
        """Refuse a function h that changed its sign without a zero: a jump cannot be located."""
        machine = self.machine
        for number, (row, mark) in enumerate(
            zip(self.found[:events], self.marks[:events].tolist(), strict=True)
        ):
            # The first events say it; of many more every so manieth does.
            if self.events.total < _LOOKED_AT or number % _LOOKED_AT == 0:
                check_gradients(machine, float(row[0]), row[3 : 3 + machine.n].copy(), (mark[0],))
            if mark[1] not in (codes.CROSSING_UP, codes.CROSSING_DOWN, codes.ENTRY) or row[2] == 0.0:
                continue
            self.check_root(float(row[0]), mark[0], row[3 : 3 + machine.n].copy(), float(row[2]), self.signs)

    def check_root(self, t: float, i: int, x: Array, residual: float, before: Mode) -> None:
        """Raise ModelError where |h_i| = residual, reached in a mode, is no zero of a continuous function."""
        machine = self.machine
        if machine.surfaces[i].symbolic:
            return
        g, gt = machine.gradients(t, x, self.mode)
        size = float(np.max(np.abs(x), initial=0.0))
        # A zero that is nearer than the tolerance of the states is reached: h may stay 0 there, as where v
        # sticks. Differences across a jump are steep: it is larger than that.
        within = float(np.abs(g[i]) @ (self.atol + np.finfo(float).eps * np.abs(x)))
        if residual <= min(within, JUMP * (1.0 + size)):
            return
        # What is reached at the instant of another event is off 0 by its rate and the rounding of time.
        _, velocity, _, _ = machine.probe(t, 0.0, x, np.array(before, dtype=float), self.lam)
        rate = abs(machine.rate(i, g, velocity)) + abs(gt[i])
        late = 64 * np.finfo(float).eps * max(abs(t), abs(t - float(self.clock.t_start))) * rate
        reach = np.abs(x) + self.atol + 1e-9 * size
        # A function may be a difference of terms of this size, of which nothing but rounding is left.
        rounding = 64 * np.finfo(float).eps * (1.0 + size + abs(t))
        known = 1e-6 * float(np.abs(g[i]) @ reach + abs(gt[i] * t)) + machine.widths[i] + late
        spread = 16 * scatter(machine, t, x, self.mode, i)
        # A multiple root is known far worse than rounding, and Newton's steps to it stop on the way.
        multiple = machine.roles[i] == "observer" and (
            int(self.order[i]) > MOST_MULTIPLE or (residual > spread and not self._passes(t, i, x, velocity))
        )
        if multiple or residual > known + min(rounding, spread):
            raise ModelError(
                f"surface {machine.surfaces[i].name!r}: h changes its sign at t = {t:.9g} without being 0 "
                f"there (|h| = {residual:.3g}). h must be continuous: give the function whose zero is the "
                "surface, or declare a time event. Where roots lie in one place, give the factors apart."
            )

    def reaches(self, i: int) -> bool:
        """Whether an observer is reached with a speed, not touched only."""
        return self.machine.roles[i] == "observer" and int(self.trigger[i]) == codes.ROOT

    def _passes(self, t: float, i: int, x: Array, velocity: Array) -> bool:
        """Whether h_i changes its sign as close to an event as that is to be known."""
        reach = NEAR_ROOT * max(abs(t), abs(t - float(self.clock.t_start)))
        sides = [
            self.machine.guards(t + off, x + off * velocity, self.mode)[i]
            for off in (-reach, reach)
        ]
        return bool(sides[0] * sides[1] <= 0.0)

    def add_event(
        self, t: float, index: int, kind: EventKind, before: Mode, after: Mode, x: Array, multiplier: float,
        residual: float, note: str = "", together: bool = False, x_after: Array | None = None,
    ) -> None:  # fmt: skip
        """Append an event; `together` puts it into the set of the one before."""
        x.flags.writeable = False
        self.clock.event_t = t
        self.events.add(t, index, kind, before, after, x, multiplier, residual, note, together, x_after)

    def count_down(self, index: int, kind: EventKind, direction: int) -> bool:
        """Count an event of the classification against the stops; True where the run is to end."""
        columns = {
            EventKind.CROSSING: (
                codes.CROSSING_EITHER, codes.CROSSING_UP if direction > 0 else codes.CROSSING_DOWN
            ),
            EventKind.ENTRY: (codes.ENTRY,),
            EventKind.EXIT: (codes.EXIT_EITHER, codes.EXIT_UP if direction > 0 else codes.EXIT_DOWN),
            EventKind.GRAZING: (codes.GRAZING,),
            EventKind.RESET: (codes.RESET,),
            EventKind.TIME: (),
            EventKind.USER: (),
        }[kind]  # fmt: skip
        ended = False
        for column in columns:
            if self.stop[index, column] > 0:
                self.stop[index, column] -= 1
                ended = ended or bool(self.stop[index, column] == 0)
        return ended

    def put(
        self, mode: Mode, order: tuple[int, ...], multipliers: tuple[float, ...], along: Sequence[int] = ()
    ) -> None:
        """Take up a mode; along: surfaces on which those slid on hold the solution."""
        if self.signs != mode:
            self.taken = self.t, self.x.copy()
        self.mode[:] = mode
        self.order[:] = order
        self.order[list(along)] = codes.ALONG
        self.lam[:] = multipliers
        self.clock.trend = self.clock.grow = 0.0
        self.count.cut = 0
        self.clock.relative = min(self.clock.relative, 0.0)

    def held_along(self) -> list[int]:
        """The surfaces off which the solution does not slide, and on which others hold it."""
        return [int(i) for i in np.flatnonzero(self.order == codes.ALONG)]

    def decides(self, i: int) -> bool:
        """Whether i is a surface that decides the solution, and nothing that is watched alone or a clock."""
        return i < self.machine.m and self.machine.roles[i] != "observer"

    def decided(self, most: int) -> list[Event]:
        """The last events, so many at most, of surfaces that decide the solution and of clocks."""
        m = self.machine.m
        decided = (e for e in reversed(self.events) if e.index >= m or self.decides(e.index))
        return [*islice(decided, most)][::-1]

    def last_decided(self) -> Event | None:
        """The last of these events."""
        return next(iter(self.decided(1)), None)

    @property
    def attempts(self) -> int:
        """Steps so far, the rejected ones included."""
        return int(self.count.steps + self.count.rejected)

    def calls(self) -> int:
        """Field calls so far."""
        return int(self.count.field_calls) + self.machine.calls

    def factorisations(self) -> tuple[int, int]:
        """Jacobians taken and LU factorisations made by an implicit method, as scipy counts them."""
        return int(self.machine.iw.jacobians), int(self.machine.iw.factors)

    def scales(self, on: Sequence[int] = ()) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """|h| and the size of its terms, for every surface at the present point, which lies on some."""
        machine, resting = self.machine, self.mode.copy()
        # On its own surface |h| is 0, whatever rounding left of h: a root would make much of it.
        resting[[i for i in on if machine.contacts[i] == 0]] = 0.0
        h = np.abs(machine.guards(self.t, self.x, resting))
        g, gt = machine.gradients(self.t, self.x, self.mode)
        return h, guard_terms(g, gt, self.t, self.x)
