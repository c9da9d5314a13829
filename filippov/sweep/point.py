"""The points of a sweep, computed: many together in compiled code, or one by one."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from filippov.base.arrays import Array, Whole
from filippov.base.failure import failure
from filippov.base.status import Status
from filippov.model.system import System
from filippov.solving.ensemble import Ensemble, solve_many
from filippov.solving.state.events import Stop
from filippov.solving.state.problem import Problem
from filippov.sweep.measure import Function, Measure
from filippov.sweep.points import Points
from filippov.sweep.rows import ERROR, Limits, Rows, chosen, failed_row, joined

START = "x0."
BLOCK = 512
LEAVE = 2.0  # times max_time, after which a point that does not return ends its process
_OWN_LIMIT = 1.0  # seconds on top


@dataclass(frozen=True)
class Plan:
    """What of a sweep its points need; the names as in `filippov.sweep.plan.Sweep`."""

    problem: Problem
    names: tuple[str, ...]
    points: Points
    measures: tuple[Measure | Function, ...]
    options: Mapping[str, Any]
    stop: tuple[Stop, ...]
    tail: float
    lanes: int

    @property
    def system(self) -> System:
        """The system of the template."""
        return self.problem.system

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the results."""
        return tuple(name for measure in self.measures for name in measure.columns(self.system))

    def problem_at(self, point: int) -> Problem:
        """The problem of one point."""
        x0, values = self.problem.x0.copy(), dict(self.problem.parameters)
        for name, value in zip(self.names, self.points[point].tolist(), strict=True):
            if name.startswith(START):
                x0[self.system.state_index(name.removeprefix(START))] = value
            else:
                values[name] = value
        return Problem(self.system, x0, self.problem.t_span, values, self.problem.backward)


class _LateError(Exception):
    """A point of a batch takes too long."""


def compute_many(plan: Plan, index: Whole, limits: Limits) -> Rows:
    """Rows of points whose measures need the ends only; neighbours change nothing, to the last bit."""
    size = len(index) if limits.max_time is None else BLOCK  # what is late is looked for in halves
    return joined([_together(plan, index[k : k + size], limits) for k in range(0, len(index), size)])


def _together(plan: Plan, index: Whole, limits: Limits) -> Rows:
    try:
        ends = _ends(plan, index, limits)
    except _LateError:
        if len(index) == 1:
            return compute_one(plan, index, limits)
        half = len(index) // 2
        parts = [_together(plan, part, limits) for part in (index[:half], index[half:])]
        return joined(parts)
    broken = np.array([status is Status.ERROR for status in ends.status])
    if broken.any():  # alone they say why, within the limits of a point
        whole = chosen(_rows(plan, index, ends), ~broken)
        return joined([whole, compute_one(plan, index[broken], limits)])
    return _rows(plan, index, ends)


def _rows(plan: Plan, index: Whole, ends: Ensemble) -> Rows:
    values = np.hstack([m.of_ends(ends, plan.system) for m in plan.measures])  # type: ignore[union-attr]
    message = {
        int(point): ends.message[k] or ends.status[k].advice
        for k, point in enumerate(index) if not ends.status[k].ok
    }  # fmt: skip
    return Rows(index, values, tuple(status.value for status in ends.status), message)


def split(plan: Plan, index: Whole) -> tuple[Array, dict[str, Any]]:
    """Initial states (k, n) and parameters by name of some points, as `solve_many` takes them."""
    points = plan.points[index]
    x0 = np.tile(plan.problem.x0, (len(index), 1))
    parameters: dict[str, Any] = dict(plan.problem.parameters)
    for k, name in enumerate(plan.names):
        if name in parameters:
            parameters[name] = points[:, k]
        else:
            x0[:, plan.system.state_index(name.removeprefix(START))] = points[:, k]
    return x0, parameters


def _ends(plan: Plan, index: Whole, limits: Limits) -> Ensemble:
    x0, parameters = split(plan, index)
    seen = [0.0, time.monotonic()]

    def look(done: int, _: int) -> None:
        now = time.monotonic()
        if done != seen[0]:
            seen[:] = done, now
        elif limits.max_time is not None and now - seen[1] > limits.max_time:
            raise _LateError

    return solve_many(
        plan.system, x0, plan.problem.t_span, parameters=parameters, stop=plan.stop, threads=1,
        backward=plan.problem.backward,
        lanes=plan.lanes, progress=look, **plan.options,
    )  # fmt: skip


def compute_one(plan: Plan, index: Whole, limits: Limits) -> Rows:
    """Rows of points, each with its own solution; an error of one is its row."""
    rows = [_row(plan, point, limits) for point in index.tolist()]
    return joined(rows)


def _row(plan: Plan, point: int, limits: Limits) -> Rows:
    columns, index = len(plan.columns), np.array([point])
    watch = None
    longest = np.inf if limits.max_time is None else LEAVE * limits.max_time + _OWN_LIMIT
    if limits.late is not None and longest <= threading.TIMEOUT_MAX:
        watch = threading.Timer(longest, limits.late, (point,))
        watch.daemon = True
        watch.start()
    from filippov.solving.solver import solve

    extra: dict[str, Any] = {} if limits.max_time is None else {"max_time": limits.max_time}
    dense = any(measure.needs == 2 for measure in plan.measures)
    values = np.full((1, columns), np.nan)
    try:
        solution = solve(
            plan.problem_at(point), stop=plan.stop, dense_output=dense, **extra, **plan.options
        )
        status, message = solution.status.value, {} if solution.success else {point: solution.message}
        if solution.status is Status.INTERRUPTED:
            raise KeyboardInterrupt(solution.message)
        parts: list[float] = []
        for measure in plan.measures:
            width = len(measure.columns(plan.system))
            usable = solution.success or measure.needs == 0
            parts += measure.of_solution(solution, plan.tail) if usable else [np.nan] * width
        values[0] = parts
    except MemoryError:
        raise
    except BaseException as error:  # noqa: BLE001
        # Field and measures are the user's and may raise anything: the row says so, the sweep goes on.
        return failed_row(point, columns, ERROR, failure(error))
    finally:
        if watch is not None:
            watch.cancel()
    return Rows(index, values, (status,), message)
