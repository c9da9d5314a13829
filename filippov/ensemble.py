"""Many trajectories of one system in compiled code: where each ends, nothing kept of the way."""

from __future__ import annotations

import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov._kernels import codes
from filippov.errors import UsageError
from filippov.events import Stop
from filippov.machine import Array, Machine
from filippov.names import check_known
from filippov.options import Options, check_span, check_stops
from filippov.problem import Problem
from filippov.solver import solve
from filippov.status import Status
from filippov.system import System

_STATUS = {
    codes.REACHED: Status.SUCCESS,
    codes.STOPPED: Status.STOPPED,
    codes.CHUNK_DONE: Status.MAX_STEPS,
    codes.EVENTS_FULL: Status.MAX_EVENTS,
    codes.NOT_FINITE: Status.NOT_FINITE,
    codes.MIN_STEP: Status.MIN_STEP,
    codes.NO_SLIDING: Status.NO_SLIDING,
}
_OPTIONS = (
    "method",
    "rtol",
    "atol",
    "first_step",
    "max_step",
    "max_steps",
    "max_events",
    "nonunique",
    "zeno",
)
_EVENT_ROOM = 64


@dataclass(frozen=True)
class Ensemble:
    """Ends of many trajectories.

    t, x      time and state reached: (k,), (k, n); mode: (k, m)
    status    one Status a trajectory; message: what the general path had to say, "" elsewhere
    nfev      field calls of each
    """

    t: Array
    x: Array
    mode: npt.NDArray[np.int64]
    status: tuple[Status, ...]
    message: tuple[str, ...]
    nfev: npt.NDArray[np.int64]

    @property
    def success(self) -> npt.NDArray[np.bool_]:
        """Which trajectories did what they were asked to do."""
        return np.array([status.ok for status in self.status])


def solve_many(
    system: System,
    x0: Any,
    t_span: Any,
    *,
    parameters: Mapping[str, Any] | None = None,
    stop: Stop | tuple[Stop, ...] = (),
    threads: int | None = None,
    **options: Any,
) -> Ensemble:
    """Solve from many initial states, and for many parameter values, in compiled code.

    x0          (k, n), or (n,) for one state with many parameter sets
    parameters  values by name, each a number or k numbers
    stop        terminal events, as in `solve`
    threads     default: all cores (1 for systems of plain Python functions)

    Other options as in `solve`. What the compiled path does not decide (a corner, an accumulation of events,
    a non-unique point) is solved again by `solve`, without touching its neighbours. Raises UsageError,
    ModelError.
    """
    check_known("option", options, _OPTIONS, UsageError)
    span, stops = check_span(t_span), check_stops(stop, system)
    checked = Options(dense_output=False, **options)
    states, values = _points(system, x0, parameters or {})
    work = _Work(system, states, values, span, stops, checked)
    count = len(states)
    if system.symbolic is None:
        threads = 1
    pool = max(1, min(threads or _cores(), count // 16 or 1))
    bounds = np.linspace(0, count, pool + 1).astype(int)
    if pool == 1:
        work.run(0, count)
    else:
        with ThreadPoolExecutor(pool) as executor:
            list(executor.map(work.run, bounds[:-1], bounds[1:]))
    return work.result(options, stops)


def _cores() -> int:
    """Cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _points(system: System, x0: Any, parameters: Mapping[str, Any]) -> tuple[Array, Array]:
    states = np.array(x0, dtype=float, ndmin=2)
    if states.ndim != 2 or states.shape[1] != system.dimension:
        raise UsageError(
            f"x0 has shape {np.shape(x0)}, expected (k, {system.dimension}) "
            f"(states: {', '.join(system.states)})."
        )
    if not np.all(np.isfinite(states)):
        row, column = np.argwhere(~np.isfinite(states))[0]
        raise UsageError(
            f"x0[{row}]: state {system.states[column]!r} is {states[row, column]}, expected a number."
        )
    single = {k: v for k, v in parameters.items() if np.ndim(v) == 0}
    columns = {k: np.asarray(v, dtype=float) for k, v in parameters.items() if np.ndim(v) != 0}
    lengths = {len(column) for column in columns.values()} | {len(states)}
    count = max(lengths)
    if not lengths <= {1, count}:
        raise UsageError(f"x0 and parameters have lengths {sorted(lengths)}, expected one length or 1.")
    base = system.parameters.resolve({**single, **{k: float(column[0]) for k, column in columns.items()}})
    values = np.tile(base, (count, 1))
    for name, column in columns.items():
        declared = system.parameters[name]
        for extreme in (float(np.min(column)), float(np.max(column))):
            declared.check(extreme, f"parameter {name!r}")
        values[:, system.parameters.index(name)] = column
    return np.ascontiguousarray(np.broadcast_to(states, (count, system.dimension))), values


class _Work:
    """Arrays of an ensemble; every thread runs its own rows with its own scratch."""

    def __init__(
        self, system: System, states: Array, values: Array, span: tuple[float, float],
        stops: tuple[Stop, ...], options: Options,
    ) -> None:  # fmt: skip
        k, m = len(states), len(system.surfaces)
        self.system, self.options, self.span = system, options, span
        self.start = states
        self.x, self.values = states.copy(), values
        self.mode, self.lam = np.ones((k, m)), np.zeros((k, m))
        self.order, self.hit = np.zeros((k, m), dtype=np.int64), np.zeros((k, m), dtype=np.int64)
        self.clock = np.zeros((k, codes.CLOCK_SIZE))
        self.clock[:, [codes.T, codes.T_START]] = span[0]
        self.clock[:, codes.T_END] = span[1]
        self.clock[:, codes.RTOL], self.clock[:, codes.MAX_STEP] = options.rtol, options.max_step
        self.clock[:, codes.STEP] = options.first_step or 0.0
        self.count = np.zeros((k, codes.COUNT_SIZE), dtype=np.int64)
        self.count[:, codes.STEP_BUDGET] = options.max_steps
        self.count[:, codes.EVENT_ROOM], self.count[:, codes.EVENT_BUDGET] = (
            _EVENT_ROOM + m,
            options.max_events,
        )
        self.stop = np.zeros((k, m, codes.KINDS), dtype=np.int64)
        names = [surface.name for surface in system.surfaces]
        for item in stops:
            for column in item.columns:
                self.stop[:, names.index(item.surface), column] = item.count
        self.zeno = np.zeros((k, m, codes.ZENO_ROOM))
        self.code = np.full(k, codes.CHUNK_DONE, dtype=np.int64)
        self.atol = options.tolerances(system)
        # Compiled once, before the threads ask for it.
        self.machine = Machine(system, options.method, values[0])
        self.p = self.machine.derived(values)

    def run(self, first: int, last: int) -> None:
        """Rows first ... last - 1."""
        machine = self.machine
        if (first, last) != (0, len(self.x)):
            machine = Machine(self.system, self.options.method, self.values[first])
        m = machine.m
        events = np.zeros((_EVENT_ROOM + m, machine.event_size))
        marks = np.zeros((_EVENT_ROOM + m, 2 + 2 * m), dtype=np.int64)
        if machine.callbacks is not None:
            for row in range(first, last):
                machine.callbacks.parameters(self.values[row])
                self._call(machine, row, row + 1, events, marks)
            return
        self._call(machine, first, last, events, marks)

    def _call(
        self, machine: Machine, first: int, last: int, events: Array, marks: npt.NDArray[np.int64]
    ) -> None:
        machine.call(
            "ensemble", int(first), int(last), self.clock, self.count, self.x, self.mode, self.order,
            self.hit, self.lam, self.p, self.atol, self.stop, self.zeno, events, marks, self.code, machine.w,
            machine.iw, machine.context,
        )  # fmt: skip

    def result(self, options: Mapping[str, Any], stops: tuple[Stop, ...]) -> Ensemble:
        """Collect, with the rows that need the general path solved by it."""
        statuses = [_STATUS.get(code) for code in self.code.tolist()]
        messages = [""] * len(statuses)
        for q in [q for q, status in enumerate(statuses) if status is None]:
            values = dict(zip(self.system.parameters.names, self.values[q].tolist(), strict=True))
            problem = Problem(self.system, self.start[q], self.span, values)
            solution = solve(problem, stop=stops, dense_output=False, **options)
            statuses[q], messages[q] = solution.status, solution.message
            self.clock[q, codes.T], self.x[q], self.mode[q] = (
                solution.t_end,
                solution.x_end,
                solution.end_mode,
            )
            self.count[q, codes.FIELD_CALLS] += solution.nfev
        done = tuple(status for status in statuses if status is not None)
        return Ensemble(
            self.clock[:, codes.T].copy(), self.x, self.mode.astype(np.int64), done, tuple(messages),
            self.count[:, codes.FIELD_CALLS].copy(),
        )  # fmt: skip
