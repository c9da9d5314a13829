"""A batch of trajectories as flat arrays, run in compiled code by several threads, in lanes or one by one."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array, Whole
from filippov.kernel.codegen.build import Compiled, build
from filippov.kernel.language.records import Rows
from filippov.kernel.loop.state import (
    Clock,
    Count,
    Entries,
    EventCycles,
    Group,
    Past,
    Tally,
    Tick,
    Trajectories,
    Trajectory,
)
from filippov.kernel.tables import codes
from filippov.model.system import System
from filippov.model.time_event import TimeEvent
from filippov.solving.state.clocks import start_clock, tick_rows
from filippov.solving.state.event_log import looked_at
from filippov.solving.state.events import Stop
from filippov.solving.state.gradients import check_gradients
from filippov.solving.state.machine import Machine
from filippov.solving.state.options import Options

_EVENT_ROOM = 64
# Steps of one call into compiled code, in which nobody looks up: some tens of milliseconds.
_CHUNK = 50_000
_WAITING = 0.05
# Steps that the calling thread does before it asks others for help, about a millisecond: as long as they take
# to begin.
_ALONE = 3_000
# Rows that a thread takes at a time, and parts of its share of all rows: at the end no thread waits long.
# Rows at whose ends the gradients of functions are looked at.
_LOOKED_AT = 32
_MOST_TAKEN, _PARTS = 64, 32
# Rows of a batch that keeps its scratch, those of one that waits for the next of its kind, and how many wait.
FEW, _SMALL, _MOST_WAITING = 16, 1024, 16
# How many rows repay the compilation of a plain loop beside the lanes that is made for the system.
OWN_LOOP = 256
UNFINISHED = -1
# Lanes of trajectories that do not slide, and of those that do.
_GROUPS = 2
# Rows under way for every lane: in both groups, and three times as many that wait for either.
_UNDER_WAY = 8


def cores() -> int:
    """Cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def lane_unit(machine: Machine, method: str, lanes: int, own_loop: bool) -> Compiled:
    """The machine's system and method compiled for several trajectories side by side; see `build`."""
    return build(machine.source, machine.constants, method, lanes, own_loop)


class Batch:
    """Rows of trajectories; `run` carries them to their ends, in place.

    code[q] says how row q ended (see `kernel.tables.codes`), UNFINISHED where it did not. kinds[q] counts its
    events by surface and kind; behind them stand surface and kind of the last one, -1 without one.
    """

    def __init__(
        self, machine: Machine, states: Array, values: Array, span: tuple[float, float],
        stops: tuple[Stop, ...], options: Options,
    ) -> None:  # fmt: skip
        k, m = len(states), machine.m
        self.machine, self.size, self.options = machine, k, options
        self.values, self.x = values, states.copy()
        clock, count = Clock.new(), Count.new()
        start_clock(clock, span, options)
        count.step_budget, count.event_budget = options.max_steps, options.max_events
        events = machine.time_events if machine.ticking and span[1] > span[0] else ()
        # Whether the compiled loop stops wherever the field is to change.
        self.ticking = bool(events) or not machine.system.clocked
        count.ticks = len(events)
        stop = np.zeros((m, codes.STOPS), dtype=np.int64)
        for item in stops:
            place = machine.system.surface_index(item.surface), item.column
            stop[place] = min(stop[place], item.count) if stop[place] > 0 else item.count
        kinds = np.zeros((k, m * codes.KINDS + 2), dtype=np.int64)
        kinds[:, -2:] = -1
        # What has been taken, the number of rows that are done, and how many are taken at a time: the
        # threads share them.
        queue = np.array([0, 0, 1])
        self._state, parts = _together(
            _rows(k, clock.array), _rows(k, count.array), np.zeros((k, m, EventCycles.size)), np.ones((k, m)),
            np.zeros((k, m)), *np.zeros((2, k, m), dtype=np.int64), _rows(k, stop), kinds,
            np.full(k, UNFINISHED, dtype=np.int64), queue,
        )  # fmt: skip
        self.clock, self.count = Rows(Clock, parts[0]), Rows(Count, parts[1])
        self.zeno = Rows(EventCycles, parts[2])
        self.mode, self.lam, self.order, self.trigger = parts[3:7]
        self.stop, self.kinds, self.code, self.queue = parts[7:]
        # What functions of the user's raised, by row.
        self.raised: dict[int, BaseException] = {}
        self.atol = options.tolerances(machine.system)
        self.p = machine.derived(values)
        self.ticks, self.instants = _ticks(events, machine.system.parameters.names, values)
        # Where they stop at accumulations on contacts: time, error, error of the state, and the state.
        told = k if options.zeno == "stop" and any(machine.contacts) else 0
        self.limits = np.zeros((told, 3 + machine.n))
        self.rows = Trajectories.new()
        self.rows.refer(
            clocks=self.clock, counts=self.count, xs=self.x, ms=self.mode, orders=self.order,
            triggers=self.trigger, lams=self.lam, ps=self.p, stops=self.stop, zenos=self.zeno,
            kinds=self.kinds, codes=self.code, queue=self.queue, ticks=self.ticks,
            limits=self.limits,
        )  # fmt: skip
        self.asked = _asked(machine, k, span, stops, options)
        self._chunk: _Chunks | None = None
        self._start = self._state if self.asked is None else self._state.copy()

    @classmethod
    def ready(
        cls, machine: Machine, states: Array, values: Array, span: tuple[float, float],
        stops: tuple[Stop, ...], options: Options,
    ) -> Batch:  # fmt: skip
        """A batch at its start: one that waits for the same question, with these rows, or a new one."""
        asked = _asked(machine, len(states), span, stops, options)
        found: Batch | None = None if asked is None else machine.batches.pop(asked, None)
        if found is None:
            return cls(machine, states, values, span, stops, options)
        found.again(states, values)
        return found

    def again(self, states: Array, values: Array) -> None:
        """At its start with other rows; values that are the same array are there already."""
        self.x[:] = states
        if values is not self.values:
            self.values, self.p[:, : values.shape[1]] = values, values
        self._state[:] = self._start

    def put_back(self) -> None:
        """Let a small batch wait for the next one, when nobody needs its arrays any more."""
        if self.asked is not None:
            if len(self.machine.batches) >= _MOST_WAITING:
                self.machine.batches.clear()
            self.machine.batches[self.asked] = self

    def run(self, threads: int, unit: Compiled | None, look: Callable[[int], None] | None = None) -> None:
        """Carry every row to its end; `unit` runs them in lanes. `look` is told how many rows are done.

        What `look` raises, and KeyboardInterrupt, ends the work within the time of a chunk; rows that are
        done keep their ends.
        """
        if self.asked is not None and unit is None and self.size <= FEW:
            self._run_few(look)
            return
        if threads == 1:
            for _ in self._chunks(unit):
                if look is not None:
                    look(int(self.queue[1]))
            return
        if self.machine.callbacks is None:
            self.queue[2] = max(1, min(_MOST_TAKEN, self.size // (_PARTS * threads)))
        mine = self._chunks(unit, _ALONE)
        for _ in mine:
            if mine.more:
                break
        if look is not None:
            look(int(self.queue[1]))
        if not mine.more:
            return
        halt = threading.Event()
        with ThreadPoolExecutor(threads) as pool:
            parts = [mine, *(self._chunks(unit) for _ in range(threads - 1))]
            work = [pool.submit(self._work, part, halt) for part in parts]
            try:
                while wait(work, timeout=_WAITING).not_done:
                    if look is not None:
                        look(int(self.queue[1]))
            finally:
                halt.set()
            for done in work:
                done.result()

    def _run_few(self, look: Callable[[int], None] | None) -> None:
        """The same for a batch that keeps its scratch."""
        chunk = self._chunk
        if chunk is None:
            chunk = self._chunk = _Chunks(self, None)
        else:
            chunk.room.wipe()
        left = 1
        while left != 0:
            left = chunk.function(chunk.last, chunk.steps, *chunk.arguments)
            if look is not None:
                look(int(self.queue[1]))

    def _work(self, part: _Chunks, halt: threading.Event) -> None:
        for _ in part:
            if halt.is_set():
                return

    def _chunks(self, unit: Compiled | None, first: int = 0) -> _Chunks:
        return _Chunks(self, unit, first)


class _Room:
    """One thread's scratch: lanes, events and what a step needs, kept for the machine's next batch."""

    def __init__(self, machine: Machine, unit: Compiled | None) -> None:
        n, m = machine.n, machine.m
        events = _EVENT_ROOM + m + len(machine.time_events)
        lanes = 1 if unit is None else unit.lanes
        run = self.run = Trajectory.new()
        # The rows under way, each with its past.
        count = 1 if unit is None else _UNDER_WAY * lanes + 1
        self.pasts, self.kept = _pasts(machine, count)
        run.refer(
            past=self.pasts[0],
            w=machine.compiled.scratch(), iw=machine.compiled.integers(), ctx=machine.context,
            events=np.zeros(events * machine.event_size),
            marks=np.zeros(events * (3 + 2 * m), dtype=np.int64),
        )  # fmt: skip
        # The rows under way, what is left of those that the thread has taken, and in lanes those that wait.
        # Behind them, how many have a past, and the numbers of the pasts that are free.
        waiting = 4 + _GROUPS * lanes * (1 + 3 * (1 + m))
        mine = np.zeros(3 if unit is None else waiting + 1 + count, dtype=np.int64)
        self.rows = mine[:1] if unit is None else mine[4 : 4 + _GROUPS * lanes]
        self.free = mine[3:] if unit is None else mine[waiting + 1 :]
        self.numbers = np.arange(self.free.size)
        # The batch under way, and by name what the entry point is called with: addresses keep nothing alive.
        self.batch, entry = Trajectories.new(), "ensemble" if unit is None else "lane_run"
        self.places: dict[str, Any] = {"last": 0, "steps": 0, "batch": self.batch, "run": run}
        self.places["mine" if unit is None else "rows"] = mine
        # What a batch starts with in zeros, and the lanes of each group by their names.
        self.blank: list[npt.NDArray[Any]] = [run.w.array, run.iw.array, run.now.array, mine]
        self.wide: list[dict[str, Array]] = []
        compiled = machine.compiled if unit is None else unit
        self.function = compiled.functions[entry]
        if unit is None:
            _, _, *self.arguments = compiled.arguments(entry, self.places)
            return
        width, inside = int(machine.unit.constants["P"]), run.w.array.size  # type: ignore[arg-type]
        sizes = {
            "clock": Clock.size, "tally": Tally.size, "x": n, "m": m, "order": m, "p": width, "atol": n,
            "w": inside,
        }  # fmt: skip
        rows = Rows(Group, np.zeros((_GROUPS, Group.size), dtype=np.int64))
        room, start = _aligned(_GROUPS * sum(sizes.values()) * lanes), 0
        for number in range(_GROUPS):
            parts = {}
            for name, size in sizes.items():
                parts[name] = room[start : start + size * lanes].reshape(size, lanes)
                start += size * lanes
            group = rows[number]
            group.refer(**parts)
            self.wide.append(parts)
        self.blank.append(room)
        entries = Entries.new()
        for name in Entries.places:
            setattr(entries, name, unit.addresses[name])
        iw = machine.compiled.integers()
        self.blank.append(iw.array)
        self.places |= {"entries": entries, "groups": rows, "iw_l": iw, "pasts": self.pasts}
        _, _, *self.arguments = compiled.arguments(entry, self.places)

    def take_up(self, batch: Batch) -> None:
        """As new, for a batch: what the one before left behind must not reach it."""
        atol = batch.atol
        self.batch.array[:] = batch.rows.array
        self.run.refer(atol=atol, instants=batch.instants)
        self.pasts.column("stops")[:] = batch.options.zeno == "stop"
        self.wipe()
        for parts in self.wide:
            for name in ("rtol", "trend"):
                parts["clock"][Clock.places[name].offset] = 1.0
            parts["m"][:] = 1.0
            parts["atol"][:] = atol[:, None]

    def wipe(self) -> None:
        """Clear what running one trajectory at a time leaves behind."""
        for array in self.blank:
            array.fill(0)
        self.rows.fill(-1)
        if self.numbers.size:
            self.free[:] = self.numbers


def _pasts(machine: Machine, count: int) -> tuple[Rows[Past], tuple[npt.NDArray[Any], ...]]:
    """The pasts of so many trajectories, and the arrays that they lead to; empty where nothing can rest."""
    kind = cast(type[Past], machine.compiled.records["Past"])
    pasts, most = Rows(kind, np.zeros((count, kind.size), dtype=np.int64)), looked_at(machine.m)
    # Twice as many events determine a limit better; the earlier half of all is given up at once.
    room = 4 * most if any(machine.contacts) else 0
    pasts.column("most")[:], pasts.column("room")[:] = most, room
    times, reached = np.zeros((2, count, room)), np.zeros((count, room), dtype=np.int64)
    for q in range(count):
        pasts[q].refer(times=times[0, q], same=times[1, q], reached=reached[q])
    return pasts, (times, reached)


def _aligned(size: int) -> Array:
    """Doubles in zeros from a cache line on: vectors must not lie across two."""
    room = np.zeros(size + 8)
    first = (-room.ctypes.data // 8) % 8
    return room[first : first + size]


class _Chunks:
    """One thread's part of a batch: an iterator that works for a chunk of steps at a time.

    first   steps of the first chunk, where they are others
    """

    def __init__(self, batch: Batch, unit: Compiled | None, first: int = 0) -> None:
        machine = batch.machine
        self.batch, self.last, self.steps = batch, batch.size, _CHUNK
        if unit is not None:
            self.steps = _CHUNK // unit.lanes
        self.usual, self.steps = self.steps, first or self.steps
        self.rooms = machine.rooms.setdefault(unit.lanes if unit is not None else 1, [])
        try:
            self.room = self.rooms.pop()
        except IndexError:
            self.room = _Room(machine, unit)
        self.room.take_up(batch)
        self.function, self.arguments = self.room.function, self.room.arguments
        self.row = 0
        self.more = True

    def __iter__(self) -> _Chunks:
        return self

    def __next__(self) -> None:
        if not self.more:
            self.rooms.append(self.room)
            raise StopIteration
        machine = self.batch.machine
        if machine.callbacks is not None:
            # One row a call: the parameters of plain functions are handed over before it.
            if self.room.rows[0] < 0:
                machine.callbacks.parameters(self.batch.values[self.row])
                names, start = machine.system.parameters.names, float(self.batch.clock[self.row].t)
                machine.callbacks.speed_up(names, start, self.batch.x[self.row])
                self._look(self.row)
                self.batch.queue[0] = self.row
                self.row += 1
            left = self.function(self.row, self.steps, *self.arguments)
            error, machine.callbacks.error = machine.callbacks.error, None
            if isinstance(error, KeyboardInterrupt):
                raise error
            if error is not None:  # it is this row's; the others go on
                self.batch.raised[self.row - 1] = error
                self.batch.code[self.row - 1] = codes.USER_ERROR
                self.room.rows[0], left = -1, 0
            elif left == 0:
                self._look(self.row - 1)
            self.more = left != 0 or self.row < self.last
            return
        self.more = self.function(self.last, self.steps, *self.arguments) != 0
        self.steps = self.usual

    def _look(self, row: int) -> None:
        """Compare the gradients of functions with differences where a row begins or ends."""
        x = self.batch.x[row]
        if row < _LOOKED_AT and np.all(np.isfinite(x)):
            check_gradients(self.batch.machine, float(self.batch.clock[row].t), x.copy())


def _ticks(
    events: Sequence[TimeEvent], names: Sequence[str], values: Array
) -> tuple[Rows[Tick], Array]:
    """The time events of each trajectory, by its parameters (k, P)."""
    if not events:
        return tick_rows((), [])
    # Of many parameters few stand in instants.
    inside = {s.name for event in events for e in event.expressions() for s in e.free_symbols}
    places = [i for i, name in enumerate(names) if name in inside]
    _, first, of = np.unique(values[:, places], axis=0, return_index=True, return_inverse=True)
    named = [dict(zip(names, row, strict=True)) for row in values[first].tolist()]
    numbers = [[event.numbers(None, known) for event in events] for known in named]
    return tick_rows(events, [numbers[k] for k in of.reshape(-1).tolist()])


def waits(machine: Machine, k: int) -> bool:
    """Whether a batch of k rows is kept for the next one of its kind."""
    plain = machine.callbacks is not None or machine.compiled.plain
    return k <= _SMALL and not (plain or machine.system.clocked or machine.system.variable_widths)


def _asked(
    machine: Machine, k: int, span: tuple[float, float], stops: tuple[Stop, ...], options: Options
) -> tuple[Any, ...] | None:
    """The key of a small batch that may be kept for the next one; None for others."""
    if not waits(machine, k):
        return None
    # The batch that waits holds its options: no others can be at their place.
    return k, span, stops, id(options)


def _together(*arrays: npt.NDArray[Any]) -> tuple[Whole, list[npt.NDArray[Any]]]:
    """Arrays of words, copied into one, and the parts of it in their place."""
    block = np.concatenate([array.reshape(-1).view(np.int64) for array in arrays])
    places = np.split(block, np.cumsum([array.size for array in arrays])[:-1])
    pairs = zip(places, arrays, strict=True)
    return block, [part.view(array.dtype).reshape(array.shape) for part, array in pairs]


def _rows(k: int, row: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The same for each of k trajectories."""
    rows = np.empty((k, *row.shape), dtype=row.dtype)
    rows[:] = row
    return rows


def system_threads(system: System, threads: int | None, rows: int, least: int) -> int:
    """How many threads: as asked, at most one for every `least` rows, one for plain Python functions."""
    if system.field is not None:
        return 1
    most = rows // least or 1
    return max(1, min(threads or cores(), most)) if most > 1 else 1
