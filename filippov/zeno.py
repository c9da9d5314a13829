"""Accumulation of events at a finite time: where it leads, from the geometric law of its intervals (E9)."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from filippov._kernels import codes
from filippov.machine import Array
from filippov.run import Run
from filippov.status import EventKind

LARGEST_CORNER = 6
NEAR_REST = 1e-7


@dataclass(frozen=True)
class Limit:
    """Limit of an accumulation: time, state on all surfaces that take part, error estimate of the time."""

    t: float
    x: Array
    surfaces: tuple[int, ...]
    error: float


def accumulation(run: Run) -> Limit:
    """The limit that the last events point to: t + d r / (1 - r) for intervals d shrinking by the ratio r.

    The state is extrapolated with the same law from the events of the same surface and put on the surfaces.
    """
    last = run.events[-1]
    same = [event for event in run.events if event.index == last.index][-4:]
    intervals = np.abs(np.diff([event.t for event in same]))
    ratio = intervals[-1] / intervals[-2]
    before = intervals[-2] / intervals[-3]
    remaining = intervals[-1] * ratio / (1.0 - ratio)
    error = abs(remaining - intervals[-1] * before / (1.0 - before)) + 4 * np.finfo(float).eps * abs(last.t)
    span = max(3 * len({event.index for event in run.events[-12:]}), 6)
    surfaces = tuple(
        sorted({event.index for event in run.events[-span:] if run.machine.roles[event.index] != "observer"})
    )
    x = same[-1].x + (same[-1].x - same[-2].x) * ratio / (1.0 - ratio)
    t = float(last.t + run.direction * remaining)
    return Limit(t, _onto(run, t, x, surfaces), surfaces, float(error))


def _onto(run: Run, t: float, x: Array, surfaces: tuple[int, ...]) -> Array:
    """The nearest point on all the surfaces (Gauss-Newton); at rest on those with a contact."""
    chosen = list(surfaces)
    resting = [i for i in surfaces if run.machine.contacts[i]]
    rest_mode = run.mode.copy()
    rest_mode[resting] = 0.0
    for _ in range(4):
        x = np.ascontiguousarray(x)
        h = run.machine.guards(t, x, run.mode)[chosen]
        g, _ = run.machine.gradients(t, x, run.mode)
        if resting:
            h = np.append(h, run.machine.guards(t, x, rest_mode)[resting])
            g = np.vstack([g[chosen], run.machine.gradients(t, x, rest_mode)[0][resting]])
        else:
            g = g[chosen]
        step, *_ = np.linalg.lstsq(g, h, rcond=None)
        x = x - step
    return np.ascontiguousarray(x)


SAMPLES = 16


def rests(run: Run, surfaces: tuple[int, ...]) -> bool:
    """Whether 0 is among the velocities of the inclusion at this point, now and until the end of the run.

    Where the signs do not act on the surfaces to first order (twisting, Fuller's problem) no multipliers
    follow from staying on them; a state at which 0 is a convex combination of the vertex fields is a
    solution all the same.
    """
    switching = [i for i in surfaces if run.machine.roles[i] == "switching"]
    if not 0 < len(switching) <= LARGEST_CORNER:
        return False
    mode = run.mode.copy()
    mode[list(surfaces)] = 0.0
    for t in np.linspace(run.t, float(run.clock[codes.T_END]), SAMPLES):
        h = np.abs(run.machine.guards(float(t), run.x, mode))[switching]
        fields = []
        for signs in itertools.product((-1.0, 1.0), repeat=len(switching)):
            corner = np.where(mode == 0.0, 1.0, mode)
            corner[switching] = signs
            fields.append(run.machine.rhs(float(t), run.x, corner, mode))
        velocities = np.array(fields).T
        size = float(np.max(np.abs(velocities))) + 1e-300
        combination = np.vstack([velocities / size, np.ones(velocities.shape[1])])
        _, gap = nnls(combination, np.append(np.zeros(len(run.x)), 1.0))
        if gap > NEAR_REST or np.any(h > NEAR_REST * (1.0 + np.max(np.abs(run.x)))):
            return False
    return True


def rest(run: Run, surfaces: tuple[int, ...]) -> None:
    """Stay where the run is until its end: every switching surface of the limit is slid on, nothing moves."""
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
    end = float(run.clock[codes.T_END])
    if run.options.dense_output:
        coef = np.zeros((1, *run.coef.shape[1:]))
        coef[0, 0] = run.x
        run.steps.append((np.array([[run.t, end - run.t]]), coef))
    run.clock[codes.T] = end
