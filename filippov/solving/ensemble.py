"""Many trajectories of one system in compiled code: only the end of each is kept."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, ClassVar, cast

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array
from filippov.base.errors import ModelError, UsageError
from filippov.base.failure import failure
from filippov.base.given import Count, Positive, shown
from filippov.base.keywords import keywords
from filippov.base.names import Answering, check_known, unknown
from filippov.base.shown import Shown
from filippov.base.status import EventKind, Status, stopped_at
from filippov.kernel.codegen.build import widest
from filippov.kernel.tables import codes
from filippov.kernel.tables.layout import LANES, MOST_LANES
from filippov.model.system import System
from filippov.solving.ensemble_rows import End, rows_of, unusable
from filippov.solving.resets.slow_spiral import LEAST_EVENTS
from filippov.solving.resets.zeno import sentence
from filippov.solving.scale import default_atols, of_little_ends, small
from filippov.solving.state.batch import FEW, OWN_LOOP, UNFINISHED, Batch, lane_unit, system_threads, waits
from filippov.solving.state.events import Stop, columns_of, turned
from filippov.solving.state.machine import Machine
from filippov.solving.state.option_types import (
    ANSWERS,
    ENDS_ONLY,
    SAME_AS,
    MethodName,
    OnZeno,
    Policy,
    SlidingRule,
    Stops,
    Together,
    Tolerance,
)  # fmt: skip
from filippov.solving.state.options import (
    Options,
    check_span,
    check_stops,
    checked_options,
    falls,
    given_options,
    options_but,
)
from filippov.solving.state.problem import Problem, needs_system

_STATUS = {
    UNFINISHED: Status.INTERRUPTED,
    codes.REACHED: Status.SUCCESS,
    codes.STOPPED: Status.STOPPED,
    codes.CHUNK_DONE: Status.MAX_STEPS,
    codes.EVENTS_FULL: Status.MAX_EVENTS,
    codes.USER_ERROR: Status.ERROR,
    codes.LIMIT: Status.ZENO,
}
# The same as a table over all codes, from UNFINISHED on; None where `solve` has to decide.
_OF_CODE = np.array([_STATUS.get(code) for code in range(UNFINISHED, codes.LIMIT + 1)], dtype=object)
_LEFT = ("max_time", "on_graze", "stop", "dense_output", "save_events", "backend", "dt", "theta")
_OPTIONS = options_but(*_LEFT)
STUCK, _BUDGETS = 1e-9, (codes.CHUNK_DONE, codes.EVENTS_FULL)  # of the time left: a step that leads nowhere
# Methods that run in lanes, and how many rows repay the compilation; that of series takes seconds.
_IN_LANES = {"DOP853": 64, "DP5": 64, "Taylor": 2048}
_ROWS_EACH = (16, 128)  # a thread of its own for every so many rows, one by one and in lanes
_BLOCK = 1 << 16  # rows in memory at a time with all that a running trajectory needs


@dataclass(frozen=True)
class Ensemble(Shown, Answering):
    """Ends of many trajectories; ensemble[k] is that of number k, an `End`.

    t, x       time and state reached: (k,), (k, n); at a terminal event, its time and state
    mode       mode there: (k, m)
    status     one Status per trajectory; message: that of the classification, "" elsewhere.
               ERROR: a function of the user's raised, the message has it; t and x are of the last step before
    nfev       field calls of each
    counts     events of each by surface and kind, (k, m, kinds): see `events`
    last       number of the surface and kind of the last event of each, (k, 2), -1 where there was none
    measured   what `measure` made of them, None without it
    complete   False where the work was interrupted; trajectories that had not ended have status INTERRUPTED
               and the state of their last step
    lanes      trajectories side by side in the compiled code: 16, 8 or 1; threads: how many worked
    """

    _elsewhere: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(("y", "sol", "segments", "plot"), "it keeps the ends, t and x; solve has the rest."),
        **dict.fromkeys(("t_end", "x_end", "y_end"), "the ends are t and x, a row for each trajectory."),
    }

    t: Array
    x: Array
    mode: npt.NDArray[np.int64]
    status: tuple[Status, ...]
    message: tuple[str, ...]
    nfev: npt.NDArray[np.int64]
    counts: npt.NDArray[np.int32]
    last: npt.NDArray[np.int64]
    measured: Any = None
    complete: bool = True
    lanes: int = 1
    threads: int = 1
    surfaces: tuple[str, ...] = field(default=(), repr=False)
    place_of: Callable[[str], tuple[int, int]] | None = field(default=None, repr=False, compare=False)

    def __len__(self) -> int:
        return len(self.status)

    def __getitem__(self, k: Any) -> End:
        if not isinstance(k, int | np.integer) or isinstance(k, bool):
            raise UsageError(
                f"ensemble[{shown(k)}]: expected the number of a trajectory. Of several take rows of its "
                "arrays, ensemble.x[ensemble.success]; a state over all is a column, ensemble.x[:, 0]."
            )
        if not -len(self) <= k < len(self):
            raise IndexError(f"there is no trajectory {k}: there are {len(self)}, numbered from 0.")
        return End(float(self.t[k]), self.x[k], self.mode[k], self.status[k], self.message[k])

    def __str__(self) -> str:
        ends, counts = np.unique([s.value for s in self.status], return_counts=True)
        return f"Ensemble({', '.join(f'{n} {end}' for end, n in zip(ends, counts, strict=True))})"

    @property
    def success(self) -> npt.NDArray[np.bool_]:
        """Which trajectories did what they were asked to do."""
        return np.array([status.ok for status in self.status])

    @keywords()
    def events(self, surface: str | None = None, kind: str | None = None) -> npt.NDArray[np.int64]:
        """Number of events of each trajectory, (k,): on one surface, of one kind (as in `Stop`), or all.

        Raises UsageError.
        """
        rows = self.counts
        if surface is not None:
            place, sense = self._place(surface)
            rows = rows[:, place : place + 1]
            kind = kind if kind is None or sense > 0 else turned(kind)
        if kind is not None:
            rows = rows[:, :, list(columns_of(kind))]
        return np.asarray(rows.sum(axis=(1, 2), dtype=np.int64))

    def _place(self, surface: str) -> tuple[int, int]:
        if surface in self.surfaces or self.place_of is None:
            if surface not in self.surfaces:
                raise UsageError(unknown("surface", surface, self.surfaces))
            return self.surfaces.index(surface), 1
        try:
            return self.place_of(surface)
        except ModelError as error:
            raise UsageError(str(error)) from None


@keywords(same=SAME_AS, answers=ANSWERS | ENDS_ONLY, own=("system", "method"), first=needs_system)
def solve_many(
    system: System,
    x0: Any,
    t_span: Any,
    *,
    parameters: Mapping[str, Any] | None = None,
    stop: Stops = (),
    threads: Count | None = None,
    lanes: int | None = None,
    measure: Callable[[Ensemble], Any] | None = None,
    progress: Callable[[int, int], object] | None = None,
    backward: bool = False,
    method: MethodName | str = "DOP853",
    rtol: Positive = Options.rtol,
    atol: Tolerance | None = None,
    first_step: Positive | None = None,
    max_step: Positive = math.inf,
    max_steps: Count = Options.max_steps,
    max_events: Count = Options.max_events,
    nonunique: Policy = "raise",
    zeno: OnZeno = "stop",
    simultaneous: Together = "raise",
    sliding: SlidingRule = "filippov",
    compile: bool | None = None,  # noqa: A002 (the word for it)
) -> Ensemble:
    """Solve from many initial states, and for many parameter values, in compiled code.

    x0          (k, n), or (n,) for one state with many parameter sets
    parameters  values by name, each a number or k numbers
    stop        terminal events, as in `solve`
    threads     default: all cores (1 for systems of plain Python functions)
    lanes       trajectories side by side in vector instructions: 16, 8 or 1; default: where the system is
                symbolic, without inputs, and there are 64 trajectories or more (by Taylor's method
                2048), 16 on processors with AVX-512 and 8 on others
    measure     function of the Ensemble of a block of trajectories (up to 65,536, in order) that returns an
                array with a row for each; the blocks' results, joined, are `measured`
    progress    called with (trajectories done, k) from time to time
    backward    True for t_span = (t0, t1) with t1 < t0, as in `solve`

    Other options as in `solve`. What lanes cannot follow (an event, a corner) the plain compiled loop takes
    over for that trajectory alone; what that loop does not decide (an accumulation of events on several
    surfaces, a non-unique point) is solved again by `solve`. Results agree with those of the plain loop to
    within the tolerance. At Ctrl-C the trajectories done so far are returned, with `complete` False. An
    exception in a function of the user's ends its own trajectory, with Status.ERROR and the exception in its
    message; so do nan and infinities in its state or parameters, unless every row has some.
    Raises UsageError, ModelError, and what `measure` and `progress` raise.
    """
    options = given_options({**locals(), "stop": ()})
    span = check_span(t_span, backward, x0)
    prepared = Prepared(system, span, stop=stop, threads=threads, lanes=lanes, backward=backward, **options)
    states, values = rows_of(system, x0, parameters or {})
    return prepared.run(states, values, measure=measure, progress=progress)


class Prepared:
    """What calls of `solve_many` with one system, span and options have in common, checked and compiled once.

    Arguments as there.
    """

    def __init__(
        self, system: System, t_span: Any, *, stop: Stops = (), threads: int | None = None,
        lanes: int | None = None, backward: bool = False, **options: Any,
    ) -> None:  # fmt: skip
        check_known("option", options, _OPTIONS, UsageError)
        self.system, self.options = system, options
        self.span, self.stops = check_span(t_span, backward), check_stops(stop, system)
        for samples in system.inputs:
            samples.check_span(self.span)
        self.checked = checked_options({"dense_output": False, **options})
        self.checked.check_system(system)
        self.threads, self.lanes = threads, lanes
        self.machine: Machine | None = None
        if system.field is None:
            # An equal system may have been here before: what was made of it is this one's as well.
            self.machine = _machine(system, self.checked.stepper, self.checked.sliding)
            system.units.update(self.machine.system.units)
        # Batches of a few rows that wait for the next, by size; whether those need not be looked at before.
        self._waiting: dict[int, Batch] = {}
        self._few = self.machine is not None and not lanes and "atol" in options and waits(self.machine, FEW)

    def run(
        self, states: Array, values: Array, *, measure: Callable[[Ensemble], Any] | None = None,
        progress: Callable[[int, int], object] | None = None,
    ) -> Ensemble:  # fmt: skip
        """The ends of trajectories from states (k, n) with rows of parameters (k, P)."""
        count, system, checked, span = len(states), self.system, self.checked, self.span
        machine = self.machine or Machine(
            system, checked.stepper, values[0], sliding=checked.sliding, compiled=checked.compile
        )
        alone = machine.compiled.plain or bool(system.inputs)
        width = 1 if alone else _lanes(self.lanes, machine, checked.method, count)
        own_loop = self.lanes is not None or count >= OWN_LOOP
        unit = _lane_unit(machine, checked.stepper, width, own_loop) if width > 1 else None
        workers = system_threads(system, self.threads, count, _ROWS_EACH[width > 1])
        unfit, parts = unusable(system, states, values), list[Ensemble]()
        for first in range(0, max(count, 1), _BLOCK):
            rows = slice(first, min(first + _BLOCK, count))

            def look(done: int, first: int = first) -> None:
                if progress is not None:
                    progress(first + done, count)

            def carried(x: Array, p: Array, used: Options) -> Ensemble:
                batch, complete = Batch.ready(machine, x, p, span, self.stops, used), True
                try:
                    if not batch.ticking or machine.compiled.plain:
                        # The driver of `solve` stops at knots and at what else the loop does not look after,
                        # and runs kernels in Python.
                        batch.code[:] = codes.GENERAL
                    else:
                        batch.run(workers, unit, look)
                except KeyboardInterrupt:
                    complete = False
                options = {**self.options, "atol": used.atol}
                ends = _collect(batch, x, span, self.stops, options, complete, width, workers)
                if complete:
                    batch.put_back()
                return ends

            part = self._usable(first, states[rows], values[rows], carried, look, unfit)
            parts.append(part if measure is None else replace(part, measured=_measured(measure, part)))
            if not part.complete:
                break
        return _joined(parts, states, span)

    def ends(self, states: Array, values: Array) -> tuple[Array, list[Status], npt.NDArray[Any]]:
        """State, status and mode at the ends: of an Ensemble what a map needs, sooner for a few rows."""
        machine = self.machine
        if self._few and machine is not None and len(states) <= FEW:
            ready = machine, states, values, self.span, self.stops, self.checked
            batch = self._waiting.pop(len(states), None) or Batch.ready(*ready)
            batch.again(states, values)
            batch.run(1, None)
            statuses = _statuses(batch)
            if None not in statuses:
                x, mode = batch.x.copy(), batch.mode.copy()
                self._waiting[len(states)] = batch
                return x, cast(list[Status], statuses), mode
        if not (whole := self.run(states, values)).complete:
            raise KeyboardInterrupt
        return whole.x, list(whole.status), whole.mode

    def _usable(
        self, first: int, states: Array, values: Array, carried: Callable[[Array, Array, Options], Ensemble],
        look: Callable[[int], None], unfit: dict[int, str],
    ) -> Ensemble:  # fmt: skip
        """The ends of a block; rows that cannot be run end where they are, and say why."""
        cause = {k - first: why for k, why in unfit.items() if first <= k < first + len(states)}
        usable = np.ones(len(states), dtype=bool)
        usable[list(cause)] = False
        if usable.all():
            return self._by_scale(states, values, carried)
        order = np.concatenate([np.flatnonzero(usable), np.flatnonzero(~usable)])
        some = self._by_scale(states[usable], values[usable], carried)
        whole = _permuted(_joined([some], states[order], self.span), np.argsort(order))
        status, message = list(whole.status), list(whole.message)
        for q, why in cause.items():
            status[q], message[q] = Status.ERROR, why
        if some.complete:
            look(len(states))
        return replace(whole, status=tuple(status), message=tuple(message))

    def _by_scale(
        self, states: Array, values: Array, carried: Callable[[Array, Array, Options], Ensemble]
    ) -> Ensemble:
        """The ends of a block: rows that are small throughout have an absolute tolerance of their own."""
        checked = self.checked
        if "atol" in self.options or not small(states, checked.rtol).any():
            return carried(states, values, checked)
        atol = default_atols(self.system, states, self.span, values, checked)
        levels = np.unique(atol).tolist()
        if len(levels) == 1:
            return carried(states, values, self._with_atol(levels[0]))
        order: list[npt.NDArray[np.int64]] = []
        parts: list[Ensemble] = []
        for level in reversed(levels):
            at = np.flatnonzero(atol == level)
            if parts and not parts[-1].complete:
                break
            order.append(at)
            parts.append(carried(states[at], values[at], self._with_atol(level)))
        whole = np.concatenate([*order, np.setdiff1d(np.arange(len(states)), np.concatenate(order))])
        return _permuted(_joined(parts, states[whole], self.span), np.argsort(whole))

    def _with_atol(self, atol: float) -> Options:
        return checked_options({"dense_output": False, **self.options, "atol": atol})


@lru_cache(maxsize=64)
def _machine(system: System, method: str, sliding: str) -> Machine:
    """The machine of a symbolic system; batches bring work arrays of their own."""
    return Machine(system, method, system.parameters.resolve(None), sliding=sliding)


_lane_unit = lru_cache(maxsize=64)(lane_unit)


def _lanes(lanes: int | None, machine: Machine, method: str, count: int) -> int:
    system = machine.system
    # The series of large systems are loops.
    in_lanes = method in _IN_LANES and bool(machine.constants.get("IN_LANES", True))
    if lanes is None:
        possible = system.field is None and in_lanes and machine.sliding != "utkin"
        return widest() if possible and count >= _IN_LANES[method] else 1
    if isinstance(lanes, bool) or lanes not in (1, LANES, MOST_LANES):
        raise UsageError(f"lanes is {lanes!r}, expected 1, {LANES} or {MOST_LANES}.")
    if lanes > 1 and system.field is not None:
        raise UsageError(
            f"lanes is {lanes}, but the system is made of plain Python functions, which are called one state "
            "at a time. Give the equations in symbols, or leave lanes at 1."
        )
    if lanes > 1 and machine.sliding == "utkin":
        raise UsageError(f"lanes is {lanes}, but sliding='utkin' runs one by one. Leave lanes at 1.")
    if lanes > 1 and not in_lanes:
        of = " for a system of this size" if method in _IN_LANES else ""
        known = ", ".join(name for name in _IN_LANES if name != method)
        raise UsageError(f"lanes is {lanes}, but {method} runs one by one{of}; lanes know {known}.")
    return lanes


def _collect(
    batch: Batch, start: Array, span: tuple[float, float], stops: tuple[Stop, ...],
    options: Mapping[str, Any], complete: bool, lanes: int, threads: int,
) -> Ensemble:  # fmt: skip
    """The ends of a batch, with the rows that need the classification solved by it."""
    system = batch.machine.system
    statuses = _statuses(batch)
    x = batch.x if batch.asked is None else batch.x.copy()
    messages = [""] * batch.size
    for q, text in of_little_ends(system.states, start, x, batch.atol):
        messages[q] = text
    for q in np.flatnonzero(batch.code == codes.LIMIT).tolist() if len(batch.limits) else ():
        messages[q] = f"{_of_limit(batch, q)} {messages[q]}".rstrip()
    for q, error in batch.raised.items():
        messages[q] = failure(error)
    t, nfev = batch.clock.column("t").copy(), batch.count.column("field_calls").copy()
    counts = batch.kinds[:, :-2].reshape(batch.size, batch.machine.m, codes.KINDS).astype(np.int32)
    last = batch.kinds[:, -2:].copy()
    general = [q for q, status in enumerate(statuses) if status is None] if None in statuses else []
    for q in general:
        if not complete:
            statuses[q] = Status.INTERRUPTED
            continue
        values = dict(zip(system.parameters.names, batch.values[q].tolist(), strict=True))
        from filippov.solving.solver import solve

        try:
            solution = solve(
                Problem(system, start[q], span, values, falls(span)), stop=stops, dense_output=False,
                **options,
            )  # fmt: skip
        except BaseException as error:  # noqa: BLE001  # the row's own, whatever it is; `failure` knows others
            statuses[q], messages[q] = Status.ERROR, failure(error)
            continue
        statuses[q], messages[q] = solution.status, solution.message
        t[q], x[q], batch.mode[q] = solution.t_end, solution.x_end, solution.end_mode
        nfev[q] += solution.nfev
        counts[q], last[q] = 0, -1
        for event in solution.events.of_surfaces(batch.machine.m):
            column = _column(event.kind, event.direction)
            last[q] = event.index, column
            counts[q, event.index, column] += 1
        complete = solution.status is not Status.INTERRUPTED
    return Ensemble(
        t, x, batch.mode.astype(np.int64), cast(tuple[Status, ...], tuple(statuses)), tuple(messages),
        nfev, counts, last, complete=complete, lanes=lanes, threads=threads, surfaces=system.surface_names,
        place_of=system.surface_place,
    )  # fmt: skip


def _of_limit(batch: Batch, q: int) -> str:
    """What `solve` says where it stops at an accumulation."""
    t, error, x_error = batch.limits[q, :3].tolist()
    where = stopped_at(float(batch.clock[q].t), tuple(map(int, batch.mode[q])))
    return f"{where}: {sentence(t, error, batch.limits[q, 3:], x_error)} {Status.ZENO.advice}"


def _statuses(batch: Batch) -> list[Status | None]:
    """How each row ended; None where `solve` decides, also of rows that got nowhere at last."""
    first = (listed := batch.code.tolist() or [UNFINISHED])[0]
    if first not in _BUDGETS and listed.count(first) == len(listed):
        return [_STATUS.get(first)] * batch.size
    step, t, t_end = map(batch.clock.column, ("step", "t", "t_end"))
    stuck = np.isin(batch.code, _BUDGETS) & (step < STUCK * np.abs(t_end - t))
    # So many events may follow a law that tells where they lead.
    stuck |= (batch.code == codes.EVENTS_FULL) & (batch.options.max_events >= LEAST_EVENTS)
    return list(_OF_CODE[np.where(stuck, codes.GENERAL, batch.code) - UNFINISHED].tolist())


@lru_cache(maxsize=64)
def _column(kind: EventKind, direction: int) -> int:
    """The kernel's number for a kind of event."""
    way = {1: " up", -1: " down"}.get(direction, "")
    return columns_of(f"{kind}{way}")[0]


def _measured(measure: Callable[[Ensemble], Any], part: Ensemble) -> npt.NDArray[Any]:
    made = measure(part)
    values = np.empty(()) if isinstance(made, Ensemble) else np.asarray(made)
    if values.ndim == 0 or len(values) != len(part.t):
        said = f"{type(made).__name__} of shape {values.shape}"
        raise UsageError(f"measure returned {said} for {len(part.t)} trajectories, expected a row for each.")
    return values


def _permuted(whole: Ensemble, order: npt.NDArray[np.int64]) -> Ensemble:
    """The same with the rows in another order."""
    arrays = {name: getattr(whole, name)[order] for name in ("t", "x", "mode", "nfev", "counts", "last")}
    return replace(
        whole, **arrays, status=tuple(whole.status[q] for q in order.tolist()),
        message=tuple(whole.message[q] for q in order.tolist()),
    )  # fmt: skip


def _joined(parts: list[Ensemble], states: Array, span: tuple[float, float]) -> Ensemble:
    """One ensemble of all blocks; what was never begun stands at its start."""
    done = sum(len(part.t) for part in parts)
    if len(parts) == 1 and done == len(states):
        return parts[0]
    left, last = len(states) - done, parts[-1]
    rest = replace(
        last, t=np.full(left, span[0]), x=states[done:].copy(),
        mode=np.ones((left, last.mode.shape[1]), np.int64),
        status=(Status.INTERRUPTED,) * left, message=("",) * left, nfev=np.zeros(left, np.int64),
        counts=np.zeros((left, *last.counts.shape[1:]), np.int32), last=np.full((left, 2), -1),
    )  # fmt: skip
    pieces = [*parts, rest] if left else parts

    def join(name: str) -> Any:
        return np.concatenate([getattr(piece, name) for piece in pieces])

    arrays = {name: join(name) for name in ("t", "x", "mode", "nfev", "counts", "last")}
    measured = None if last.measured is None else np.concatenate([part.measured for part in parts])
    return replace(
        last, **arrays, measured=measured, complete=all(part.complete for part in parts),
        status=tuple(s for piece in pieces for s in piece.status),
        message=tuple(s for piece in pieces for s in piece.message),
    )  # fmt: skip
