"""The driven mass along a record: its trajectory in windows, and how it changes with all that goes in.

The trajectory is carried from node to node, each interval by the exact event-driven solver. Its derivatives
come from those of single intervals, by central differences, joined by the chain rule:

    X(k+1) = A(k) X(k) + B(k),   A = d end/d start,   B = d end/d (parameters, terms of the force)

So no difference step is carried through the whole trajectory, where it would grow or meet a jump.
Source: Bock 1983 (condensing of multiple shooting).
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from filippov.base.arrays import Array, Whole
from filippov.model.system import System
from filippov.solving.ensemble import Prepared
from filippov.solving.uncut import whole

TERMS = ("force", "change", "bend", "twist")
INPUT = (*TERMS, "interval")
# Relative step of the differences; its square is small beside the tolerance of one interval.
STEP = 1e-5


@dataclass(frozen=True)
class Pieces:
    """The applied force of a window, a cubic of tau in [0, 1] on each piece.

    length   of the pieces [s], (P,); terms: coefficients, (P, 4)
    sample   number of the sample of the window at whose time the piece starts, (P,)
    spread   terms = given + spread @ z with z ~ N(0, 1): what is not known of the force, (P, 4, r)
    known    whether the size of the spread is known, or only its shape
    """

    length: Array
    terms: Array
    sample: Whole
    spread: Array
    known: bool = True


@dataclass(frozen=True)
class DrivenTrajectory:
    """A window's trajectory: states at the starts of its parts and the end, (P + 1, n); nodes: at samples."""

    states: Array
    nodes: Whole
    good: bool

    @property
    def x(self) -> Array:
        """Position at the samples."""
        return np.asarray(self.states[self.nodes, 0])

    @property
    def v(self) -> Array:
        """Velocity at the samples."""
        return np.asarray(self.states[self.nodes, 1])


@dataclass(frozen=True)
class Slopes:
    """Derivatives of a window's positions at the samples.

    parameters   by each of `names`, (k, p); start: by the initial state, (k, 2)
    force        by all terms, (k, P, 4)
    """

    names: tuple[str, ...]
    parameters: Array
    start: Array
    force: Array


class DrivenRun:
    """Trajectories of a driven mass: `names` are the parameters that slopes are taken by."""

    def __init__(
        self, system: System, names: Sequence[str], fixed: Mapping[str, float], rtol: float, scale: float,
        speed: float,
    ) -> None:  # fmt: skip
        self.system, self.names, self.scale, self.speed = system, tuple(names), scale, speed
        known = system.parameters.names
        self.base = np.asarray(
            system.parameters.resolve({**fixed, "force": 0.0, "interval": 1.0}), dtype=float
        )
        self.places = [known.index(name) for name in self.names]
        self.inputs = [known.index(name) for name in INPUT]
        self.low = np.array(
            [-np.inf if q.lower is None else q.lower for q in (system.parameters[n] for n in self.names)]
        )
        # One by one: results are then the same on every processor.
        self.run = Prepared(
            system, (0.0, 1.0), lanes=1, rtol=rtol, atol=1e-3 * rtol * scale, first_step=1.0
        )  # fmt: skip

    def trajectories(self, windows: Sequence[Pieces], starts: Array, theta: Array) -> list[DrivenTrajectory]:
        """The trajectory of each window from its own start (w, 2); one that cannot go on is not `good`."""
        count = len(windows)
        longest = max(len(q.length) for q in windows)
        states = np.full((count, longest + 1, starts.shape[1]), 1e3 * self.scale)
        states[:, 0] = starts
        alive = np.ones(count, dtype=bool)
        values = np.tile(self.base, (count, 1))
        values[:, self.places] = theta
        for j in range(longest):
            at = np.array([w for w in range(count) if alive[w] and j < len(windows[w].length)], dtype=int)
            if not at.size:
                break
            rows = values[at]
            rows[:, self.inputs[:4]] = [windows[w].terms[j] for w in at]
            rows[:, self.inputs[4]] = [windows[w].length[j] for w in at]
            got = whole(self.run.run(states[at, j], rows))
            good = got.success
            states[at[good], j + 1] = got.x[good]
            alive[at[~good]] = False
        out = []
        for w, pieces in enumerate(windows):
            last = len(pieces.length)
            first = np.concatenate(([True], np.diff(pieces.sample) > 0))
            nodes = np.append(np.flatnonzero(first), last)
            out.append(DrivenTrajectory(states[w, : last + 1], nodes, bool(alive[w])))
        return out

    def slopes(
        self, windows: Sequence[Pieces], trajectories: Sequence[DrivenTrajectory], theta: Array,
        by_force: bool = True,
    ) -> list[Slopes]:
        """Derivatives of the positions at the samples along trajectories; without `by_force` those are 0."""
        n, p = trajectories[0].states.shape[1], len(self.names)
        steps = self._steps(theta)[: n + p + 4 * by_force]
        states = np.concatenate([m.states[:-1] for m in trajectories])
        terms = np.concatenate([np.column_stack((q.terms, q.length)) for q in windows])
        ends = self._ends(terms, states, theta, steps)
        slope = np.zeros((len(states), n, n + p + 4))
        for q, step in enumerate(steps):
            up, down = (ends[2 * q] - ends[-1]) / step, (ends[-1] - ends[2 * q + 1]) / step
            if 0 <= q - n < p and theta[q - n] - step < self.low[q - n]:
                slope[:, :, q] = up
                continue
            # Two sides that differ have a kink or a jump between them; the jump is no slope.
            kink = np.abs(up - down) > 0.1 * (np.abs(up) + np.abs(down))
            smaller = np.where(np.abs(up) < np.abs(down), up, down)
            slope[:, :, q] = np.where(kink, smaller, 0.5 * (up + down))
        places = np.cumsum([0, *(len(q.length) for q in windows)])
        return [
            self._joined(slope[a:b], trajectory.nodes, by_force)
            for (a, b), trajectory in zip(itertools.pairwise(places), trajectories, strict=True)
        ]

    def _joined(self, slope: Array, nodes: Whole, by_force: bool) -> Slopes:
        """Derivatives of a window by those of its pieces, (P, n, inputs)."""
        count, n, p = len(slope), slope.shape[1], len(self.names)
        parameters, start = np.zeros((len(nodes), p)), np.zeros((len(nodes), n))
        force = np.zeros((len(nodes), 4 * count))
        by_p, by_start, by_term = np.zeros((n, p)), np.eye(n), np.zeros((n, 4 * count))
        start[0, 0] = 1.0
        row = 1
        for k in range(count):
            a = slope[k, :, :n]
            by_p = a @ by_p + slope[k, :, n : n + p]
            by_start = a @ by_start
            if by_force:
                by_term[:, : 4 * k] = a @ by_term[:, : 4 * k]
                by_term[:, 4 * k : 4 * k + 4] = slope[k, :, n + p :]
            if k + 1 == nodes[row]:
                parameters[row], start[row], force[row] = by_p[0], by_start[0], by_term[0]
                row += 1
        return Slopes(self.names, parameters, start, force.reshape(len(nodes), count, 4))

    def ends(self, terms: Array, length: Array, states: Array, theta: Array) -> Array:
        """States at the ends of pieces with these terms and lengths from states, (k, n)."""
        values = np.tile(self.base, (len(states), 1))
        values[:, self.places] = theta
        values[:, self.inputs] = np.column_stack((terms, length))
        got = whole(self.run.run(states, values))
        return np.where(got.success[:, None], got.x, states)

    def _steps(self, theta: Array) -> Array:
        scale = np.array([self.scale, self.speed])
        load = np.full(4, max(1e-3, float(np.max(np.abs(theta), initial=0.0))))
        return STEP * np.concatenate((scale, np.maximum(np.abs(theta), 1e-3), load))

    def _ends(self, terms: Array, states: Array, theta: Array, steps: Array) -> Array:
        """Ends of pieces with terms and lengths (P, 5), inputs moved up and down, (2 inputs + 1, P, n)."""
        count, n, p = len(states), states.shape[1], len(self.names)
        copies = 2 * steps.size + 1
        rows = np.tile(states, (copies, 1, 1))
        values = np.tile(self.base, (copies, count, 1))
        values[:, :, self.places] = theta
        values[:, :, self.inputs] = terms
        columns = [*self.places, *self.inputs[:4]]
        for q, step in enumerate(steps):
            for side, c in ((1.0, 2 * q), (-1.0, 2 * q + 1)):
                if q < n:
                    rows[c, :, q] += side * step
                else:
                    values[c, :, columns[q - n]] += side * step
                    if q - n < p:
                        values[c, :, columns[q - n]] = np.maximum(
                            values[c, :, columns[q - n]], self.low[q - n]
                        )
        got = whole(self.run.run(rows.reshape(-1, n), values.reshape(copies * count, -1)))
        ends = got.x.reshape(copies, count, n)
        bad = ~got.success.reshape(copies, count)
        ends[bad] = np.broadcast_to(ends[-1], ends.shape)[bad]
        return ends
