"""The solution of a run that has ended; the arrays of its way are made when they are asked for."""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.base.arrays import Array
from filippov.base.status import Status
from filippov.solving.resets.zeno import Accumulation
from filippov.solving.scale import of_little_scale
from filippov.solving.selection.ambiguity import Ambiguity
from filippov.solving.solution import Solution, may_jump
from filippov.solving.state.events import Mode
from filippov.solving.state.interpolant import Interpolant
from filippov.solving.state.options import exchanged
from filippov.solving.state.problem import Problem
from filippov.solving.state.run import Run
from filippov.solving.state.watched import Watch


def finished(
    run: Run, watch: Watch, course: Course, start_mode: Mode, status: Status, ambiguity: Ambiguity | None,
    accumulations: tuple[Accumulation, ...],
) -> Solution:  # fmt: skip
    """The solution of a run. Nothing of it lies in the arrays of the run."""
    problem, events = course.problem, watch.events(run)
    system = problem.system
    events.place_of, events.states = system.surface_place, system.states
    if watch.users:  # the loop has them before the time events
        events.names = (*system.surface_names, *(event.name for event in system.time_events), *watch.names)
    njev, nlu = run.factorisations()
    return Solution.made_of(
        course, problem=problem, options=run.options, status=status, events=events, user_events=watch.names,
        start_mode=start_mode[: watch.surfaces], end_mode=run.signs[: watch.surfaces], t_end=run.t,
        x_end=run.x.copy(), end_multipliers=run.multipliers()[: watch.surfaces], nfev=run.calls(),
        njev=njev, nlu=nlu, steps=int(run.count.steps), rejected=int(run.count.rejected),
        ambiguity=ambiguity, accumulations=accumulations,
    )  # fmt: skip


class Course:
    """What a run leaves of its way: steps with their polynomials, events; a sentence on how it ended.

    t_eval   times at which the solution is wanted; None: at the ends of its steps
    scaled   whether the message says where atol decides the accuracy (see `filippov.solving.scale`)
    """

    def __init__(self, problem: Problem, run: Run, t_eval: Array | None, message: str, scaled: bool) -> None:
        self.problem, self.t_eval, self.message, self.scaled = problem, t_eval, message, scaled
        self.steps, self.log, self.shape = run.steps, run.events, run.coef.shape[1:]
        self.t, self.x = run.t, run.x.copy()

    def made(self, name: str, solution: Solution) -> dict[str, Any]:
        """What is asked for, and what is made with it: t, y, sol or message."""
        if name == "message":
            return {"message": self._told(solution)}
        if name == "sol":
            return {"sol": self._interpolant(solution) if solution.options.dense_output else None}
        if solution.sol is not None:
            t, y = self._sampled(solution, solution.sol)
        else:
            t, y = self._corners() if may_jump(self.problem.system) else self._ends()
        return {"t": t, "y": y}

    def _told(self, solution: Solution) -> str:
        text, start = self.message, self.problem.t_span[0]
        if self.problem.backward:
            text += f" It ran backwards in time, from t = {start:.9g} to t = {self.t:.9g}."
        if self.problem.t_span[1] == start:
            # It may be meant, so the run is made.
            text += " t_span has no length." + exchanged(self.problem.x0, self.problem.t_span)
        return text + (of_little_scale(solution) if self.scaled else "")

    def _still(self, t: float, x: Array) -> tuple[Array, Array]:
        coef = np.zeros((1, *self.shape))
        coef[0, 0] = x
        direction = -1.0 if self.problem.backward else 1.0
        return np.array([[t, direction * np.finfo(float).tiny]]), coef

    def _interpolant(self, solution: Solution) -> Interpolant:
        jumps, span = solution.jumps, (self.problem.t_span[0], self.t)
        pieces = list(self.steps)
        if not pieces and not jumps.size:
            coef = np.zeros((1, 2, len(self.x)))
            coef[0, 0] = self.x
            return Interpolant(np.array([span[0]]), np.ones(1), coef, span)
        # A jump at either end of the run lies between a state and no step: the state is kept as a step of 0.
        if span[0] in jumps:
            pieces.insert(0, self._still(span[0], self.problem.x0))
        if span[1] in jumps:
            pieces.append(self._still(span[1], self.x))
        table, coef = pieces[0]
        if len(pieces) > 1:
            table, coef = map(np.concatenate, zip(*pieces, strict=True))
        return Interpolant(table[:, 0].copy(), table[:, 1].copy(), coef, span)

    def _ends(self) -> tuple[Array, Array]:
        """Start, events and end, where no steps are kept."""
        problem = self.problem
        t, x = self.log.table()
        times = np.concatenate(([problem.t_span[0]], t, [self.t]))
        x = x.reshape(len(t), len(problem.x0))
        states = np.concatenate((problem.x0[None, :], x, self.x[None, :]))
        keep = np.append(True, np.diff(times) != 0)
        return times[keep], states[keep].T.copy()

    def _corners(self) -> tuple[Array, Array]:
        """The same with resets: a jump has the state before and the one after."""
        rows = [(self.problem.t_span[0], self.problem.x0)]
        for event in self.log:
            if event.t != rows[-1][0] or event.x_after is not None:
                if event.t == rows[-1][0] and len(rows) > 1 and rows[-2][0] == event.t:
                    rows.pop()  # a second event of the same jump
                elif event.t != rows[-1][0]:
                    rows.append((event.t, event.x))
                if event.x_after is not None:
                    rows.append((event.t, event.x_after))
        if self.t != rows[-1][0]:
            rows.append((self.t, self.x))
        return np.array([t for t, _ in rows]), np.array([x for _, x in rows]).T.copy()

    def _sampled(self, solution: Solution, sol: Interpolant) -> tuple[Array, Array]:
        """The dense output at the times wanted, else at the ends of the steps."""
        end, jumps, n = self.t, solution.jumps, len(self.x)
        direction = -1.0 if self.problem.backward else 1.0  # of no length, sol has none of its own
        if self.t_eval is not None:
            reached = self.t_eval[(self.t_eval - end) * direction <= 0]
            if end != self.problem.t_span[1] and (not len(reached) or reached[-1] != end):
                # A run that ends early ends at a point of its own.
                reached = np.append(reached, end)
            return reached, sol(reached).reshape(n, len(reached))
        # Where steps begin at one time, the last of them; its polynomial begins with the state there.
        last = np.append(sol.start[1:] != sol.start[:-1], sol.start[-1] != end)
        times = np.append(sol.start[last], end)
        states = np.vstack((sol.coef[last, 0], self.x)).T.copy()
        if jumps.size:
            at = np.searchsorted(times * direction, jumps * direction)
            first = {e.t: e.x for e in reversed(solution.events) if e.x_after is not None}
            before = np.array([first[t] for t in jumps.tolist()]).T
            times, states = np.insert(times, at, jumps), np.insert(states, at, before, axis=1)
        return times, states
