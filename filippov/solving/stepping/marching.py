"""From a problem to its solution in steps of one length: chunks of them, read as modes and events."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from filippov.base.arrays import Array
from filippov.base.status import EventKind, Status, mode_text
from filippov.solving.solution import Solution
from filippov.solving.state.event_log import EventLog
from filippov.solving.state.events import Mode
from filippov.solving.state.interpolant import Interpolant
from filippov.solving.state.options import Options
from filippov.solving.state.problem import Problem
from filippov.solving.stepping import box_kernels, step_kernels
from filippov.solving.stepping.unit import generated, steps

THETA = 0.5
CHUNK, KEPT = 4096, 64
NOTE = "known to within a step"
# Of |grad h| |x|, the part within which a start counts as on the surface.
AT_START = 1e-14
_ENDS = {
    box_kernels.NO_SOLUTION: (
        Status.NO_CONTINUATION,
        "no signs were found that solve the complementarity problem of this step; a smaller dt may have some",
    ),
    box_kernels.SEVERAL: (
        Status.NON_UNIQUE,
        "several sets of signs solve this step, with different solutions; DOP853 tells which, with nonunique",
    ),
    step_kernels.NO_CONVERGENCE: (
        Status.MIN_STEP, "the equations of this step do not converge; a smaller dt makes them less nonlinear"
    ),
    step_kernels.NOT_DEFINED: (Status.NOT_FINITE, "the state or the field is not a finite number here"),
}  # fmt: skip


@dataclass(frozen=True)
class Rows:
    """What steps gave, a row each; first, before: the number of steps before them, and the state there."""

    first: int
    before: Array
    states: Array
    modes: Array
    signs: Array
    impacts: Array

    def last(self) -> Rows:
        """The last of them."""
        before = self.states[-2] if len(self.states) > 1 else self.before
        first = self.first + len(self.states) - 1
        return Rows(first, before, self.states[-1:], self.modes[-1:], self.signs[-1:], self.impacts[-1:])

    def then(self, other: Rows) -> Rows:
        """These and what follows them."""
        mine, more = ((q.states, q.modes, q.signs, q.impacts) for q in (self, other))
        return Rows(self.first, self.before, *(np.vstack(pair) for pair in zip(mine, more, strict=True)))


class March:
    """One run: state, sets and signs, and what has been collected of them."""

    def __init__(self, problem: Problem, options: Options) -> None:
        system = problem.system
        assert options.dt is not None
        self.problem, self.options, self.system = problem, options, system
        self.n, self.m = system.dimension, len(system.surface_names)
        t0, t1 = problem.t_span
        self.total = max(1, math.ceil((t1 - t0) / options.dt * (1 - 1e-12))) if t1 > t0 else 0
        self.step = (t1 - t0) / self.total if self.total else 0.0
        self.theta = THETA if options.theta is None else float(options.theta)
        self.kernels, constants = steps(system), generated(system).constants
        n, m = self.n, self.m
        self.p = np.zeros(max(int(constants["P"]), 1))  # type: ignore[arg-type]
        self.p[: problem.p.size] = problem.p
        self.kernels("derive", self.p)
        self.ctx = np.zeros(8, dtype=np.int64)
        inner = n + 12 * m + 4 * n * (m + 2) + m * m
        self.w = np.zeros(12 * m + 4 * n + 4 * n * m + m * m + inner + 64)
        self.iw = np.zeros(step_kernels.K_LIST + 4 * m + n + 8, dtype=np.int64)
        self.x, self.scale, self.lu = np.array(problem.x0), np.abs(problem.x0), np.zeros(n * n)
        self.z = self._sets_at_start()
        self.s = self.z.copy()
        self.done = 0
        self.waiting: tuple[Array, Rows] | None = None
        keep = KEPT if options.save_events == "count" else None
        self.events = EventLog(system.surface_names, 1, n, keep)
        self.start_mode: Mode = _mode(self.z)
        self.states: list[Array] = [self.x[None, :].copy()]

    @property
    def t(self) -> float:
        """The time reached: exactly the end of the span after the last step."""
        return self._time(self.done)

    def _time(self, done: int) -> float:
        t0, t1 = self.problem.t_span
        return t1 if done == self.total else t0 + done * self.step

    def _sets_at_start(self) -> Array:
        """Signs of the guards; 0 on the surface, and the side of it for contacts."""
        t0, sides = self.problem.t_span[0], np.ones(self.m)
        h, g, gt = np.zeros(self.m), np.zeros(self.m * self.n), np.zeros(self.m)
        for _ in range(self.m + 1):  # sizes of earlier surfaces in later guards need their signs
            self.kernels("guards", t0, self.x, self.p, sides, h, self.ctx)
            last, sides = sides, np.where(h >= 0.0, 1.0, -1.0)
            if np.array_equal(last, sides):
                break
        self.kernels("gradients", t0, self.x, self.p, sides, g, gt, self.ctx)
        size = np.abs(g.reshape(self.m, self.n)) @ np.abs(self.x)
        for i, surface in enumerate(self.system.surfaces):
            if surface.reset is not None:
                sides[i] = 1.0 if surface.side == "+" else -1.0
            elif surface.kind == "switching" and abs(h[i]) <= AT_START * size[i]:
                sides[i] = 0.0
        return sides

    def chunk(self, count: int) -> int:
        """Take some steps and keep what they gave; returns the code at which they ended."""
        n, m = self.n, self.m
        states, modes = np.empty((count, n)), np.empty((count, m))
        signs, impacts = np.empty((count, m)), np.zeros((count, m))
        before, start = self.z.copy(), self.x.copy()
        code = self.kernels(
            "march", self.done, self.done + count, self.problem.t_span[0], self.step, self.theta, self.x,
            self.z, self.s, self.p, self.scale, self.lu, states, modes, signs, impacts, self.w, self.iw,
            self.ctx,
        )  # fmt: skip
        done = int(self.iw[step_kernels.K_LIST + 3 * m + n])
        rows = Rows(self.done, start, states[:done], modes[:done], signs[:done], impacts[:done])
        if self.done == 0 and done:
            # Where the state starts on a surface and leaves it, it has left it from the start.
            held = np.array([q.kind == "switching" for q in self.system.surfaces], dtype=bool)
            before = np.where((before == 0.0) & held, modes[0], before)
            self.start_mode = _mode(before)
        if self.waiting is not None:
            before, row = self.waiting
            rows = row.then(rows)
        self.done += done
        if self.options.dense_output:
            self.states.append(states[:done])
        last = code != 0 or self.done == self.total
        if len(rows.states):
            self._collect(before, rows, last)
            # Whether the last of them stays on its surface the next one tells.
            ahead = rows.modes[-2] if len(rows.states) > 1 else before
            self.waiting = None if last else (ahead, rows.last())
        return code

    def _collect(self, before: Array, rows: Rows, last: bool) -> None:
        """Changes of the sets as events at the ends of their steps; before: the sets ahead of the rows.

        A step that ends on a surface from which the next one leaves again is where the state goes through it.
        """
        modes = np.vstack([before[None, :], rows.modes])
        through = (modes[1:-1] == 0.0) & (modes[:-2] != 0.0) & (modes[2:] != 0.0)
        modes[1:-1][through] = modes[2:][through]
        changed = np.any(modes[1:] != modes[:-1], axis=1) | np.any(rows.impacts != 0.0, axis=1)
        if not last:
            changed[-1:] = False
        for row in np.flatnonzero(changed).tolist():
            now, target, first = _mode(modes[row]), _mode(modes[row + 1]), True
            kinds = [
                EventKind.RESET if rows.impacts[row, i] else _kind(now[i], target[i]) for i in range(self.m)
            ]
            # A surface is left from the start of the step, and landed on at its end.
            for i in sorted(range(self.m), key=lambda i: kinds[i] is not EventKind.EXIT):
                kind = kinds[i]
                if kind is None:
                    continue
                leaves = kind is EventKind.EXIT
                after = (*now[:i], target[i], *now[i + 1 :])
                multiplier = math.nan
                if leaves or kind is EventKind.ENTRY:
                    multiplier = float(rows.signs[row, i])
                t = self._time(rows.first + row + (not leaves))
                x = (rows.before if row == 0 else rows.states[row - 1]) if leaves else rows.states[row]
                x = x.copy()
                x.flags.writeable = False
                self.events.add(t, i, kind, now, after, x, multiplier, 0.0, NOTE, together=not first)
                now, first = after, False


def _mode(z: Array) -> Mode:
    return tuple(int(v) for v in z.tolist())


def _kind(before: int, after: int) -> EventKind | None:
    if before == after:
        return None
    if after == 0:
        return EventKind.ENTRY
    return EventKind.EXIT if before == 0 else EventKind.CROSSING


def march(
    problem: Problem, options: Options, progress: Callable[[float, float], None] | None, t_eval: Array | None
) -> Solution:
    """The solution by time stepping."""
    run = March(problem, options)
    begun, status, why = time.monotonic(), Status.SUCCESS, ""
    most = min(run.total, options.max_steps)
    try:
        while run.done < most and not why:
            if progress is not None:
                progress(run.t, problem.t_span[1])
            code = run.chunk(min(CHUNK, most - run.done))
            if code != 0:
                status, why = _ENDS[code]
            elif run.events.total > options.max_events:
                status, why = Status.MAX_EVENTS, f"{run.events.total} changes of signs"
            elif time.monotonic() - begun > options.max_time:
                status, why = Status.TIMEOUT, f"{options.max_time:g} s"
    except KeyboardInterrupt:
        status, why = Status.INTERRUPTED, "the keyboard"
    if not why and run.done < run.total:
        status, why = Status.MAX_STEPS, f"{run.done} of {run.total} steps"
    return finished(run, status, why, t_eval)


def finished(run: March, status: Status, why: str, t_eval: Array | None) -> Solution:
    """What a run has collected, as a solution."""
    problem, options, system = run.problem, run.options, run.system
    log = run.events
    log.place_of, log.states, log.names = system.surface_place, system.states, system.surface_names
    t0, end_mode = problem.t_span[0], _mode(run.z)
    dense = options.dense_output
    times: Array = np.asarray(t0 + run.step * np.arange(run.done + 1), dtype=np.float64)
    times[-1] = run.t
    sol, y = None, np.concatenate(run.states).T
    if dense:
        sol = _interpolant(times, y, (t0, run.t))
    else:
        times, y = np.array([t0, run.t])[: 1 + (run.done > 0)], np.stack([problem.x0, run.x], axis=1)
        y = y[:, : times.size]
    if t_eval is not None:
        assert sol is not None
        reached = t_eval[t_eval <= run.t]
        if run.t != problem.t_span[1] and (not len(reached) or reached[-1] != run.t):
            reached = np.append(reached, run.t)
        times, y = reached, sol(reached).reshape(run.n, len(reached))
    calls, jacobians, factors = run.iw[1], run.iw[2], run.iw[3]
    return Solution(
        problem=problem, options=options, status=status, message=_message(run, status, why), t=times, y=y,
        sol=sol, events=log, user_events=(), start_mode=run.start_mode, end_mode=end_mode, t_end=run.t,
        x_end=run.x.copy(), end_multipliers=run.s.copy(), nfev=int(calls), njev=int(jacobians),
        nlu=int(factors), steps=run.done, rejected=0,
    )  # fmt: skip


def _interpolant(times: Array, y: Array, span: tuple[float, float]) -> Interpolant:
    """The states joined by straight lines."""
    if times.size == 1:
        coef = np.zeros((1, 2, len(y)))
        coef[0, 0] = y[:, 0]
        return Interpolant(times.copy(), np.ones(1), coef, span)
    coef = np.stack([y[:, :-1].T, np.diff(y, axis=1).T], axis=1)
    return Interpolant(times[:-1].copy(), np.diff(times), coef, span)


def _message(run: March, status: Status, why: str) -> str:
    told = (
        f"Time stepping (theta = {run.theta:g}) in {run.done} steps of {run.step:.6g}: their error is not "
        "estimated; half the step shows it. Events are changes of signs, known to within a step."
    )
    if status is Status.SUCCESS:
        return f"{status.advice} {told}"
    at = f"at t = {run.t:.12g} in mode {mode_text(_mode(run.z))}"
    return f"stopped {at}: {why}. {told}"
