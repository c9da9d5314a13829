"""The solution of a run that has ended: what it collected, as a record."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from filippov.base.status import Status
from filippov.solving.resets.zeno import Accumulation
from filippov.solving.selection.ambiguity import Ambiguity
from filippov.solving.solution import Solution, jump_times, may_jump
from filippov.solving.state.events import Events, Mode
from filippov.solving.state.interpolant import Interpolant
from filippov.solving.state.problem import Problem
from filippov.solving.state.run import Run
from filippov.solving.state.watched import Watch

Array = npt.NDArray[np.float64]


def finished(
    problem: Problem, run: Run, watch: Watch, start_mode: Mode, status: Status, message: str,
    t_eval: Array | None, ambiguity: Ambiguity | None, accumulations: tuple[Accumulation, ...],
) -> Solution:  # fmt: skip
    """The solution of a run; t_eval: times at which it is wanted, None: at the ends of its steps."""
    events = watch.events(run)
    system = problem.system
    events.place_of, events.states = system.surface_place, system.states
    events.names = (*system.surface_names, *(event.name for event in system.time_events), *watch.names)
    jumps = jump_times(problem.system, events)
    sol = _interpolant(problem, run, jumps) if run.options.dense_output else None
    if sol is not None:
        t, y = _sampled(problem, run, events, sol, jumps, t_eval)
    else:
        t, y = _corners(problem, run) if may_jump(problem.system) else _ends(problem, run)
    njev, nlu = run.factorisations()
    if problem.backward:
        message += f" It ran backwards in time, from t = {problem.t_span[0]:.9g} to t = {run.t:.9g}."
    return Solution(
        problem=problem, options=run.options, status=status, message=message, t=t, y=y, sol=sol,
        events=events, user_events=watch.names, start_mode=start_mode[: watch.surfaces],
        end_mode=run.signs[: watch.surfaces], t_end=run.t, x_end=run.x.copy(),
        end_multipliers=_multipliers_at(run)[: watch.surfaces], nfev=run.calls(), njev=njev, nlu=nlu,
        steps=int(run.count.steps), rejected=int(run.count.rejected), ambiguity=ambiguity,
        accumulations=accumulations,
    )  # fmt: skip


def _multipliers_at(run: Run) -> Array:
    """The multipliers where the run stands: the loop leaves those of the last stage that it took."""
    if np.all(run.mode != 0.0):
        return run.lam.copy()
    code, _, lam, _ = run.machine.probe(run.t, 0.0, run.x, run.mode, run.lam)
    return lam if code == 0 else run.lam.copy()


def _still(t: float, x: Array, run: Run) -> tuple[Array, Array]:
    coef = np.zeros((1, *run.coef.shape[1:]))
    coef[0, 0] = x
    return np.array([[t, run.direction * np.finfo(float).tiny]]), coef


def _interpolant(problem: Problem, run: Run, jumps: Array) -> Interpolant:
    span = (problem.t_span[0], run.t)
    if not run.steps and not jumps.size:
        coef = np.zeros((1, 2, run.machine.n))
        coef[0, 0] = run.x
        return Interpolant(np.array([span[0]]), np.ones(1), coef, span)
    pieces = list(run.steps)
    # A jump at either end of the run lies between a state and no step: the state is kept as a step of 0.
    if span[0] in jumps:
        pieces.insert(0, _still(span[0], problem.x0, run))
    if span[1] in jumps:
        pieces.append(_still(span[1], run.x, run))
    table = np.concatenate([table for table, _ in pieces])
    coef = np.concatenate([coef for _, coef in pieces])
    return Interpolant(table[:, 0].copy(), table[:, 1].copy(), coef, span)


def _ends(problem: Problem, run: Run) -> tuple[Array, Array]:
    """Start, events and end, where no steps are kept."""
    t, x = run.events.table()
    times = np.concatenate(([problem.t_span[0]], t, [run.t]))
    x = x.reshape(len(t), len(problem.x0))
    states = np.concatenate((problem.x0[None, :], x, run.x[None, :]))
    keep = np.append(True, np.diff(times) != 0)
    return times[keep], states[keep].T.copy()


def _corners(problem: Problem, run: Run) -> tuple[Array, Array]:
    """The same with resets: a jump has the state before and the one after."""
    rows = [(problem.t_span[0], problem.x0)]
    for event in run.events:
        if event.t != rows[-1][0] or event.x_after is not None:
            if event.t == rows[-1][0] and len(rows) > 1 and rows[-2][0] == event.t:
                rows.pop()  # a second event of the same jump
            elif event.t != rows[-1][0]:
                rows.append((event.t, event.x))
            if event.x_after is not None:
                rows.append((event.t, event.x_after))
    if run.t != rows[-1][0]:
        rows.append((run.t, run.x))
    return np.array([t for t, _ in rows]), np.array([x for _, x in rows]).T.copy()


def _sampled(
    problem: Problem, run: Run, events: Events, sol: Interpolant, jumps: Array, t_eval: Array | None
) -> tuple[Array, Array]:
    """The dense output at the times wanted, else at the ends of the steps."""
    n = len(problem.x0)
    if t_eval is not None:
        reached = t_eval[(t_eval - run.t) * sol.direction <= 0]
        if run.t != problem.t_span[1] and (not len(reached) or reached[-1] != run.t):
            # A run that ends early ends at a point of its own.
            reached = np.append(reached, run.t)
        return reached, sol(reached).reshape(n, len(reached))
    # Where steps begin at one time, the last of them; its polynomial begins with the state there.
    last = np.append(sol.start[1:] != sol.start[:-1], sol.start[-1] != run.t)
    times = np.append(sol.start[last], run.t)
    states = np.vstack((sol.coef[last, 0], run.x)).T.copy()
    if jumps.size:
        at = np.searchsorted(times * sol.direction, jumps * sol.direction)
        first = {e.t: e.x for e in reversed(events) if e.x_after is not None}
        before = np.array([first[t] for t in jumps.tolist()]).T
        times, states = np.insert(times, at, jumps), np.insert(states, at, before, axis=1)
    return times, states
