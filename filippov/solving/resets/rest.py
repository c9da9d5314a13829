"""States of rest: where 0 is a velocity of the inclusion, and a solution that comes to one stays."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from filippov.base.arrays import Array
from filippov.base.status import EventKind
from filippov.model.system import System
from filippov.solving.resets.zeno import LARGEST_CORNER, onto
from filippov.solving.selection.ambiguity import point_of
from filippov.solving.selection.modes import leading_off
from filippov.solving.state.run import Run, near_within

NEAR_REST = 1e-7
SAMPLES = 16
# Where t may act: so many instants at least, and at most; by how much of the way they are skew.
OFTEN, MOST_SAMPLES, SKEW = 1024, 32_768, 0.3
# In tolerances: as close to where it stays as a run comes, and so much farther away it is to have begun;
# events in a row so close to it, by which it is not led out again.
CLOSE, FAR, CIRCLED = 10.0, 1e2, 6
# Moves of all states at once, by which a field is seen to be far from 0; by so many times too little at most.
# Beyond so many states eigenvalues take longer than the run.
MOVES, TOO_LITTLE, MOST_STATES = 8, 30.0, 1000


def holds_still(velocities: Array) -> bool:
    """Whether 0 is a convex combination of velocities, one per row."""
    from scipy.optimize import nnls

    if not np.all(np.isfinite(velocities)):
        return False
    size = float(np.max(np.abs(velocities))) + 1e-300
    combination = np.vstack([velocities.T / size, np.ones(len(velocities))])
    _, gap = nnls(combination, np.append(np.zeros(velocities.shape[1]), 1.0))
    return bool(gap <= NEAR_REST)


def rests(run: Run, surfaces: Sequence[int]) -> bool:
    """Whether 0 is among the velocities of the inclusion at this point, now and until the end of the run.

    Where the signs do not act on the surfaces to first order (twisting, Fuller's problem) no multipliers
    follow from staying on them; a state at which 0 is a convex combination of the vertex fields is a solution
    nevertheless.
    """
    switching = [i for i in surfaces if run.machine.roles[i] == "switching"]
    if not 0 < len(switching) <= LARGEST_CORNER:
        return False
    mode = run.mode.copy()
    mode[list(surfaces)] = 0.0
    known = None
    for t in _instants(run):
        h = np.abs(run.machine.guards(float(t), run.x, mode))[switching]
        fields = []
        for signs in itertools.product((-1.0, 1.0), repeat=len(switching)):
            corner = np.where(mode == 0.0, 1.0, mode)
            corner[switching] = signs
            fields.append(run.machine.rhs(float(t), run.x, corner, mode))
        changed = known is None or not np.array_equal(known, fields)
        known = np.array(fields)
        if (changed and not holds_still(known)) or np.any(h > NEAR_REST * (1.0 + np.max(np.abs(run.x)))):
            return False
    return True


def _instants(run: Run) -> Array:
    """Times until the end of the run at which a rest is looked at; where t may act, as steps are bounded.

    Not at equal distances, which may be the period of what acts.
    """
    start, length = run.t, float(run.clock.t_end) - run.t
    system = run.machine.system
    if system.symbolic is not None and not _depends_on_time(system):
        return np.linspace(start, start + length, SAMPLES)
    steps = min(abs(length) / run.options.max_step, float(MOST_SAMPLES))
    part = np.linspace(0.0, 1.0, max(OFTEN, 2 + int(2.0 * steps)))
    return np.asarray(start + length * (part + SKEW * part * (1.0 - part)))


def come_to_rest(run: Run, slid: Sequence[int], within: float = 0.0) -> list[int]:
    """The surfaces on which a slide has come to rest as closely as the run is accurate; [] where it has not.

    Nothing leads off them, and what the signs do not hold moves by less than the tolerance in the time left.
    The run is moved onto them, no farther than that, or than `within` on the scale of the state.
    """
    size, roles = float(np.max(np.abs(run.x), initial=0.0)), run.machine.roles
    slack = 1e2 * (run.atol + run.options.rtol * np.abs(run.x)) + within * (1.0 + size)
    near = near_within(run, run.x, slack, run.mode)
    switching = [i for i in near if roles[i] == "switching"]
    if not 0 < len(switching) <= LARGEST_CORNER or not set(slid) & set(near):
        return []
    start, mode = run.x.copy(), run.mode.copy()
    run.mode[near] = 0.0
    run.x[:] = onto(run, run.t, run.x, tuple(near))
    still = bool(np.all(np.abs(run.x - start) <= slack)) and _still(run, switching, slack)
    left = abs(float(run.clock.t_end) - run.t)

    def stays(field: Array) -> bool:
        return bool(np.all(left * np.abs(field) <= slack))

    still = still and not leading_off(point_of(run), tuple(map(int, mode)), near, stays)
    # A slide passes no point at which all fields vanish: beyond it the steps are rounding.
    still = still and (all(map(stays, _vertex_fields(run, switching))) or rests(run, near))
    run.mode[:] = mode
    if not still:
        run.x[:] = start
    return near if still else []


def _still(run: Run, switching: Sequence[int], slack: Array) -> bool:
    """Whether the signs hold all but what moves by less than `slack` until the end of the run.

    And whether they hold the same all the while: what depends on time may end the rest between two samples.
    """
    left = abs(float(run.clock.t_end) - run.t)
    fields = [left * field for field in _vertex_fields(run, switching)]
    for t in np.linspace(run.t, float(run.clock.t_end), SAMPLES):
        if np.any(left * np.array(_vertex_fields(run, switching, float(t))) != fields):
            return False
    return bool(np.all(np.min(fields, axis=0) <= slack) and np.all(np.max(fields, axis=0) >= -slack))


def _vertex_fields(run: Run, switching: Sequence[int], t: float | None = None) -> list[Array]:
    """The field for all signs of these surfaces where the run stands, now or at another time."""
    corner, fields = np.where(run.mode == 0.0, 1.0, run.mode), []
    for signs in itertools.product((-1.0, 1.0), repeat=len(switching)):
        corner[list(switching)] = signs
        fields.append(np.array(run.machine.rhs(run.t if t is None else t, run.x, corner, run.mode)))
    return fields


def faded(run: Run, close: float = CLOSE) -> list[int]:
    """The surfaces through an equilibrium of all fields beside it, to which the run has come; [] if none.

    Each of the fields attracts, and the run cannot be told from the equilibrium by so many tolerances: where
    it goes is rounding. The run is moved onto the surfaces. A field that is not Lipschitz may get there, and
    its arrival is an event.
    """
    slack = close * (run.atol + run.options.rtol * np.abs(run.x))
    near, machine = near_within(run, run.x, slack, run.mode), run.machine
    able = 0 < len(near) <= LARGEST_CORNER and not any(machine.resets_from[i] for i in near)
    able = able and run.direction > 0 and not machine.constants["NON_LIPSCHITZ"]
    able = able and len(slack) <= MOST_STATES and not _depends_on_time(machine.system)
    if not able or np.all(np.abs(run.begun - run.x) <= FAR * slack):
        return []
    corner, moves = np.where(run.mode == 0.0, 1.0, run.mode), np.diag(FAR * slack)
    for signs in itertools.product((-1.0, 1.0), repeat=len(near)):
        corner[near] = signs
        if not _nearly_still(run, corner, slack):
            return []
        beside = np.array([machine.rhs(run.t, run.x + move, corner, corner) for move in (*moves, *-moves)])
        slope = (beside[: len(slack)] - beside[len(slack) :]).T / (2 * FAR * slack)
        if not np.all(np.isfinite(slope)) or np.max(np.linalg.eigvals(slope).real) >= 0.0:
            return []
        times = np.linspace(run.t, float(run.clock.t_end), SAMPLES)
        fields = [np.array(machine.rhs(float(t), run.x, corner, corner)) for t in times]
        if np.any(np.abs(np.linalg.solve(slope, np.transpose(fields))) > slack[:, None]):
            return []
    run.x[:] = onto(run, run.t, run.x, tuple(i for i in near if machine.roles[i] == "switching"))
    return near


def _nearly_still(run: Run, corner: Array, slack: Array) -> bool:
    """Whether a field may vanish within the slack of the run: no more of it than moves of that size make.

    What they make of a component of it adds up to less than the sum of its terms, by chance: rarely by more
    than the root of their number, and next to never by TOO_LITTLE times as much in all of MOVES.
    """
    rng, here = np.random.default_rng(0), np.array(run.machine.rhs(run.t, run.x, corner, corner))
    made = np.zeros(len(slack))
    for _ in range(MOVES):
        move = rng.choice([-1.0, 1.0], len(slack)) * rng.uniform(0.5, 1.0, len(slack))
        there = np.array(run.machine.rhs(run.t, run.x + FAR * slack * move, corner, corner))
        made = np.maximum(made, np.abs(there - here) / FAR)
    return bool(np.all(np.abs(here) <= TOO_LITTLE * np.sqrt(len(slack)) * made))


@lru_cache(maxsize=128)
def _depends_on_time(system: System) -> bool:
    """Whether t stands in the formulas of a system; of plain functions that is asked at SAMPLES times."""
    from filippov.model.symbols import t  # takes longer to import than all else

    form = system.symbolic
    return form is not None and any(t in expression.free_symbols for expression in form.expressions())


def on_equilibrium(run: Run, triggered: Sequence[int]) -> bool:
    """Move a run that has come from afar onto the equilibrium on kinks from which it cannot be told.

    A field that is not Lipschitz reaches it in finite time; that several events found the run within the
    tolerance of it says that nothing leads off.
    """
    machine = run.machine
    if run.direction < 0 or not triggered or any(machine.roles[i] != "kink" for i in triggered):
        return False
    slack = CLOSE * (run.atol + run.options.rtol * np.abs(run.x))
    near = near_within(run, run.x, slack, run.mode)
    if not set(triggered) <= set(near) or any(machine.roles[i] != "kink" for i in near):
        return False
    x = onto(run, run.t, run.x, tuple(near))
    known = np.vstack([run.x, run.events.past(CIRCLED).x])
    if len(known) <= CIRCLED or np.any(np.abs(known - x) > slack):
        return False
    if np.all(np.abs(run.begun - x) <= FAR * slack):
        return False
    for t in np.linspace(run.t, float(run.clock.t_end), SAMPLES):
        code, field, _, _ = machine.probe(float(t), 0.0, x, run.mode, run.lam)
        if code != 0 or np.any(field):
            return False
    run.x[:] = x
    return True


def rest(run: Run, surfaces: Sequence[int]) -> None:
    """Stay in the present state until the end of the run, sliding on every switching surface of the limit."""
    before = run.signs
    for i in surfaces:
        if run.machine.roles[i] == "switching":
            run.mode[i] = 0.0
    after, together = run.signs, False
    for i in surfaces:
        if before[i] != after[i]:
            x, note = run.x.copy(), "rest in the limit"
            run.add_event(run.t, i, EventKind.ENTRY, before, after, x, float("nan"), 0.0, note, together)
            together = True
    end = float(run.clock.t_end)
    if run.options.dense_output:
        coef = np.zeros((1, *run.coef.shape[1:]))
        coef[0, 0] = run.x
        run.steps.append((np.array([[run.t, end - run.t]]), coef))
    run.clock.t = end
