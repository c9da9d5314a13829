"""The fitted trajectory between its samples: what a controller that feeds it back makes of it.

A force with feedback of position and velocity has the kinks of the trajectory: where the mass stops its
acceleration jumps, and the force's slope with it; where it breaks away the second derivative does. The model
knows the trajectory between samples, events included, so the force is taken as

    u = g_z z + g_x x + g_v v + sum_j c_j dv/dp_j + rest,   z' = x

with a rest that is smooth throughout (a reference, whatever else), in place of a force with unknown kinks.
The derivatives of v by what is estimated (parameters, initial velocities) stand for its errors, which move
the kinks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from filippov.analysis.algebra import linalg
from filippov.analysis.estimation.driven_run import DrivenRun, DrivenTrajectory, Pieces
from filippov.base.arrays import Array

# Gauss and Lobatto's points: the cubic through them has the integral of the trajectory up to the sixth order.
LOBATTO = np.array([0.0, 0.5 - np.sqrt(0.05), 0.5 + np.sqrt(0.05), 1.0])
LOBATTO_WEIGHTS = np.array([1.0, 5.0, 5.0, 1.0]) / 12
TO_TERMS = linalg.inv(np.vander(LOBATTO, 4, increasing=True))
# Halvings of an interval in search of an event in it.
HALVINGS = 12
# Parts of a piece with an event at one end, between which a derivative is linear; at the event it jumps.
INNER = np.array([0.1, 0.9])
# Step of the derivatives, in parts of the sizes of what is estimated. What changes by less than the second
# part of a step is the same.
STEP, SAME = 1e-4, 1e-4


@dataclass(frozen=True)
class Feedback:
    """A window's trajectory as columns: integral of the position, position, velocity, derivatives of this.

    samples   at the samples, (k, c); terms: as cubics of tau in [0, 1] on each piece, (P, 4, c)
    edges     times of the pieces' ends, (P + 1,): the samples and the events
    """

    samples: Array
    edges: Array
    terms: Array


@dataclass(frozen=True)
class Course:
    """A trajectory at any time of its window: what `pieces` make of its states at their ends."""

    run: DrivenRun
    pieces: Pieces
    trajectory: DrivenTrajectory
    values: Array
    t: Array

    def states(self, at: Array) -> Array:
        """States at times in the window, (k, n)."""
        if not at.size:
            return np.empty((0, self.trajectory.states.shape[1]))
        starts = self.t[0] + np.concatenate(([0.0], np.cumsum(self.pieces.length)))[:-1]
        k = np.clip(np.searchsorted(starts, at, side="right") - 1, 0, len(starts) - 1)
        part = np.clip((at - starts[k]) / self.pieces.length[k], 1e-9, 1.0)
        terms = self.pieces.terms[k] * part[:, None] ** np.arange(4)
        return self.run.ends(terms, self.pieces.length[k] * part, self.trajectory.states[k], self.values)

    def edges(self) -> tuple[Array, npt.NDArray[np.bool_]]:
        """The samples and the events between them, and which of them are samples."""
        t, v = self.t, np.sign(self.trajectory.v)
        changed = np.flatnonzero(v[1:] != v[:-1])
        if not changed.size:
            return t, np.ones(len(t), dtype=bool)
        # The end of the old direction, and the start of the new one: two events where it rests between them.
        side = np.concatenate((v[changed], v[changed + 1]))
        old = np.repeat([True, False], len(changed))
        low, high = np.tile(t[changed], 2), np.tile(t[changed + 1], 2)
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            before = (np.sign(self.states(middle)[:, 1]) == side) == old
            low, high = np.where(before, middle, low), np.where(before, high, middle)
        events = np.unique(0.5 * (low + high))
        # Two that are the same but for rounding are one; a sample is never left out.
        least = 1e-5 * float(np.min(np.diff(t)))
        events = events[np.min(np.abs(events[:, None] - t), axis=1) > least]
        events = events[np.diff(events, prepend=-np.inf) > least]
        edges = np.sort(np.concatenate((t, events)))
        return edges, np.isin(edges, t)


def feedback(
    run: DrivenRun, windows: Sequence[Pieces], trajectories: Sequence[DrivenTrajectory], starts: Array,
    values: Array, free: int, times: Sequence[Array],
) -> tuple[Feedback, ...]:  # fmt: skip
    """Of each window's trajectory from its start (w, 2); the first `free` of the values are estimated.

    times   of the samples of each window
    """
    number = len(windows)
    steps = STEP * np.append(np.maximum(np.abs(values[:free]), 1e-3), run.speed)
    moved = np.repeat(starts[None], len(steps), axis=0)
    moved[free, :, 1] += steps[free]
    given = np.tile(values, (len(steps), number, 1))
    for j, step in enumerate(steps[:free]):
        given[j, :, j] += step
    rows = given.reshape(-1, len(values))
    others = run.trajectories(list(windows) * len(steps), moved.reshape(-1, 2), rows)
    made = []
    for w in range(number):
        near = [Course(run, windows[w], others[q], rows[q], times[w]) for q in range(w, len(others), number)]
        made.append(_of_window(Course(run, windows[w], trajectories[w], values, times[w]), near))
    return _joined(made, SAME * STEP * run.speed)


def _joined(made: Sequence[Feedback], least: float) -> tuple[Feedback, ...]:
    """The same columns for all windows: the last of each window, by its initial velocity, is its alone."""
    number, shared = len(made), made[0].samples.shape[1] - 1
    wide = []
    for w, own in enumerate(made):
        samples = np.zeros((len(own.samples), shared + number))
        terms = np.zeros((len(own.terms), 4, shared + number))
        places = [*range(shared), shared + w]
        samples[:, places], terms[:, :, places] = own.samples, own.terms
        wide.append(Feedback(samples, own.edges, terms))
    # What moves nothing has no gain.
    told = np.max([np.max(np.abs(q.samples), axis=0) for q in wide], axis=0) > least
    return tuple(Feedback(q.samples[:, told], q.edges, q.terms[:, :, told]) for q in wide)


def _of_window(own: Course, near: Sequence[Course]) -> Feedback:
    """The columns of one window; near: trajectories beside its own, each with one of the estimates moved."""
    edges, sampled = own.edges()
    h = np.diff(edges)
    x, v = _at_lobatto(own, edges, sampled)
    terms = np.zeros((len(h), 4, 3 + len(near)))
    terms[:, :, 1], terms[:, :, 2] = x @ TO_TERMS.T, v @ TO_TERMS.T
    # The integral of the position by Lobatto's rule; between, as a cubic with its slopes at both ends.
    area = h * (x @ LOBATTO_WEIGHTS)
    level = np.concatenate(([0.0], np.cumsum(area)))
    low, high = h * x[:, 0], h * x[:, 3]
    terms[:, :, 0] = np.column_stack((level[:-1], low, 3 * area - 2 * low - high, low + high - 2 * area))
    states = own.trajectory.states[own.trajectory.nodes]
    changes = [q.trajectory.v - states[:, 1] for q in near]
    samples = np.column_stack((level[sampled], states[:, 0], states[:, 1], *changes))
    beside = np.flatnonzero(~(sampled[:-1] & sampled[1:]))
    at = (edges[beside, None] + h[beside, None] * INNER).ravel()
    here = own.states(at)[:, 1]
    first = np.flatnonzero(sampled)
    for j, other in enumerate(near, 3):
        ends = np.interp(edges, edges[first], samples[:, j])
        two = np.stack((ends[:-1], ends[1:]), axis=1)
        inner = (other.states(at)[:, 1] - here).reshape(-1, 2)
        slope = (inner[:, 1] - inner[:, 0]) / (INNER[1] - INNER[0])
        two[beside, 0] = inner[:, 0] - INNER[0] * slope
        two[beside, 1] = two[beside, 0] + slope
        terms[:, 0, j], terms[:, 1, j] = two[:, 0], two[:, 1] - two[:, 0]
    # A gain on what is constant is the rest's.
    middle = np.mean(samples, axis=0)
    terms[:, 0] -= middle
    return Feedback(samples - middle, edges, terms)


def _at_lobatto(own: Course, edges: Array, sampled: npt.NDArray[np.bool_]) -> tuple[Array, Array]:
    """Position and velocity at Lobatto's points of the pieces, (P, 4) each."""
    whole = np.empty((len(edges), 2))
    whole[sampled] = own.trajectory.states[own.trajectory.nodes, :2]
    if not np.all(sampled):
        whole[~sampled] = own.states(edges[~sampled])[:, :2]
    h = np.diff(edges)
    inner = own.states((edges[:-1, None] + h[:, None] * LOBATTO[1:3]).ravel())[:, :2].reshape(len(h), 2, 2)
    values = np.stack((whole[:-1], inner[:, 0], inner[:, 1], whole[1:]), axis=1)
    return values[:, :, 0], values[:, :, 1]
