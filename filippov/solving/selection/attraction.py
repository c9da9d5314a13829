"""Whether sliding on several surfaces at once is the only solution, while it lasts (U2).

A corner that is slid on can be left where another mode becomes consistent, or where what goes round it
spirals outwards; the multipliers of the slide show nothing of it. With the rates h' = F(s) of its surfaces
there is one solution if -F is a P-function of s on the box of the signs: if every principal minor of its
derivative is positive there (More & Rheinboldt 1973), or for F = r + C s if -C times a positive diagonal is
symmetric and positive semidefinite (friction) or has a dominant diagonal (see
`filippov.kernel.loop.coupled_corner`). Where none shows it all modes are tried, step by step.

Sources: Gale & Nikaido 1965, Math. Annalen 159; More & Rheinboldt 1973, Linear Algebra Appl. 6; Dieci & Lopez
2012, section 3.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array
from filippov.kernel.loop.corner import MINOR, ONE_SOLUTION
from filippov.kernel.loop.coupled_corner import MOST_MINORS
from filippov.kernel.tables import codes
from filippov.solving.selection.ambiguity import point_of, spirals_out
from filippov.solving.selection.corner import coupling
from filippov.solving.selection.modes import successors
from filippov.solving.state.events import Mode
from filippov.solving.state.point import Point
from filippov.solving.state.run import Run

# What `Attraction.advance` returns where the corner stops being the only solution.
LOST = 100
FLAT, LEVEL = 1e-9, 1e-12
MOST_VERTICES = 4
# How much of a step that ends in an event is looked at; how closely a loss is located, in times of the run.
INSIDE, CLOSE = 0.999, 1e-13
BISECTIONS = 60


def corner_groups(point: Point, mode: Mode) -> list[list[int]]:
    """The surfaces slid on together, corner by corner, where there are two or more."""
    machine = point.machine
    groups: dict[int, list[int]] = {}
    for i, sign in enumerate(mode):
        if sign == 0 and machine.roles[i] == "switching" and not machine.contacts[i]:
            groups.setdefault(machine.component[i], []).append(i)
    return [group for group in groups.values() if len(group) > 1]


def _minors_positive(matrix: Array) -> bool:
    k = len(matrix)
    chosen = (c for size in range(1, k + 1) for c in itertools.combinations(range(k), size))
    return all(float(np.linalg.det(matrix[np.ix_(c, c)])) > MINOR for c in map(list, chosen))


def _friction(matrix: Array) -> bool:
    """Whether matrix times a positive diagonal is symmetric and positive semidefinite."""
    k = len(matrix)
    scale = np.zeros(k)
    for start in range(k):
        if scale[start] != 0.0:
            continue
        scale[start], waiting = 1.0, [start]
        while waiting:
            i = waiting.pop()
            for j in range(k):
                if scale[j] == 0.0 and matrix[i, j] * matrix[j, i] > 0.0:
                    scale[j] = scale[i] * matrix[j, i] / matrix[i, j]
                    waiting.append(j)
    product = matrix * scale[None, :]
    size = float(np.max(np.abs(product))) + 1e-300
    if np.any(scale <= 0.0) or np.max(np.abs(product - product.T)) > FLAT * size:
        return False
    return bool(np.min(np.linalg.eigvalsh(product)) > -LEVEL * size)


def _dominant(matrix: Array) -> bool:
    """Whether the diagonal exceeds all else in each column together after scaling: an H-matrix."""
    sizes = -np.abs(matrix)
    np.fill_diagonal(sizes, np.diag(matrix))
    whole = np.diag(sizes).copy()
    for q in range(len(sizes)):
        if not (whole[q] > 0.0 and sizes[q, q] > MINOR * whole[q]):
            return False
        sizes[q + 1 :, q + 1 :] -= np.outer(sizes[q + 1 :, q] / sizes[q, q], sizes[q, q + 1 :])
    return True


def _derivatives(point: Point, mode: Array, group: Sequence[int]) -> Array | None:
    """-dF/ds in units of its rows, where it is one for the whole box; None where that is not known."""
    k, machine = len(group), point.machine
    if machine.affine:
        _, C, _ = coupling(point, mode, group)
        return _in_rows(-point.direction * C)
    if not 2 < k <= MOST_VERTICES:
        return None
    sizes = mode.copy()
    g, gt = point.gradients(sizes)
    rates: dict[tuple[int, ...], Array] = {}
    for signs in itertools.product((-1, 1), repeat=k):
        vertex = np.where(mode == 0.0, 1.0, mode)
        vertex[list(group)] = signs
        velocity = point.rhs(vertex, sizes)
        rates[signs] = point.direction * np.array([machine.rate(i, g, velocity) + gt[i] for i in group])
    out = []
    for signs, rate in rates.items():
        columns = []
        for c in range(k):
            other = (*signs[:c], -signs[c], *signs[c + 1 :])
            columns.append((rate - rates[other]) * signs[c] / 2)
        out.append(-np.array(columns).T)
    spread = max(float(np.max(np.abs(matrix - out[0]))) for matrix in out)
    return None if spread > FLAT * float(np.max(np.abs(out[0]))) else _in_rows(out[0])


def _in_rows(matrix: Array) -> Array:
    size = np.max(np.abs(matrix), axis=1, keepdims=True)
    return np.asarray(matrix / np.where(size > 0.0, size, 1.0))


def surely_one(point: Point, mode: Mode, group: Sequence[int]) -> bool:
    """Whether the rates show that the corner has one solution; False where they leave it open."""
    at = np.array(mode, dtype=float)
    if len(group) == 2 and point.corner_kind(at, group) & ONE_SOLUTION:
        return True
    matrix = _derivatives(point, at, group)
    if matrix is None or not np.all(np.isfinite(matrix)):
        return False
    return _friction(matrix) or _dominant(matrix) or (len(group) <= MOST_MINORS and _minors_positive(matrix))


def _constant(point: Point, mode: Mode, group: Sequence[int]) -> bool:
    """Whether the signs act on the rates in the same way everywhere: told for formulas, at two places."""
    if not point.machine.affine or point.machine.system.field is not None:
        return False
    at = np.array(mode, dtype=float)
    _, here, _ = coupling(point, at, group)
    for seed in range(2):
        shift = np.random.default_rng(seed).uniform(0.05, 0.2, len(point.x) + 1)
        there = Point(
            point.machine, point.t + float(shift[-1]) * (1.0 + abs(point.t)),
            point.x + shift[:-1] * (1.0 + np.abs(point.x)), point.direction, point.step, point.guess,
        )  # fmt: skip
        _, other, _ = coupling(there, at, group)
        if not np.allclose(other, here, rtol=1e-12, atol=0.0):
            return False
    return True


class Attraction:
    """Advances a run; while it slides on a corner of which other modes may follow, step by step.

    group  the surfaces of the corner that has stopped being the only solution
    """

    def __init__(self) -> None:
        self.group: list[int] = []
        self.known: dict[Mode, list[list[int]]] = {}
        self.mode: Mode | None = None
        self.given_up: Mode | None = None

    def advance(self, run: Run, steps: int) -> int:
        """A code of the loop, or LOST with the run at the moment from which more than one mode follows."""
        mode = run.signs
        if mode.count(0) < 2 or run.count.pair != 0:
            self.mode = None
            code = run.advance(steps)
            if code != codes.GENERAL or run.count.pair != 2:
                return code
            # A corner on which the loop has begun to slide by itself.
            run.count.pair, mode = 0, run.signs
        if mode not in self.known:
            point = point_of(run)
            self.known[mode] = [
                group
                for group in corner_groups(point, mode)
                if not (surely_one(point, mode, group) and _constant(point, mode, group))
            ]
        if not self.known[mode]:
            return run.advance(steps)
        if mode != self.mode:
            # Where a slide begins, all that may follow has been looked at.
            self.mode = mode
            self.given_up = None if self._one(run, mode) else mode
        # A step that is looked at once more must not lead over an instant of time events.
        ticks, run.count.ticks = run.count.ticks, 0
        try:
            return self._step(run, mode)
        finally:
            run.count.ticks = ticks

    def _step(self, run: Run, mode: Mode) -> int:
        start, t0, end = _Saved(run, len(run.steps)), run.t, float(run.clock.t_end)
        code = run.advance(1)
        if run.t == t0 or code in (codes.USER_ERROR, codes.NOT_FINITE, codes.MIN_STEP):
            return code
        quiet = run.signs == mode and code != codes.GENERAL
        stopped, done = run.t, _Saved(run, start.kept)
        if not quiet:
            self._go(run, start, t0 + INSIDE * (stopped - t0), end)
        one = self._one(run, mode)
        if one or self.given_up == mode:
            # What was gone on in as one of several solutions is looked at anew once it is the only one.
            self.given_up = None if one else self.given_up
            if not quiet:
                done.restore(run)
            return code
        low, high = t0, run.t
        for _ in range(BISECTIONS):
            if abs(high - low) <= CLOSE * (abs(high) + abs(high - float(run.clock.t_start))):
                break
            middle = 0.5 * (low + high)
            self._go(run, start, middle, end)
            reached = run.t == middle and self._one(run, mode)
            low, high = (middle, high) if reached else (low, middle)
        self._go(run, start, high, end)
        self.given_up = mode
        return LOST

    def _go(self, run: Run, start: _Saved, t: float, end: float) -> None:
        start.restore(run)
        run.clock.t_end = t
        while run.advance(100) in (codes.CHUNK_DONE, codes.RECORDS_FULL, codes.EVENTS_FULL):
            pass
        run.clock.t_end = end

    def _one(self, run: Run, mode: Mode) -> bool:
        """Whether the slide is the only solution from here on; else `group` is the corner that tells."""
        point = point_of(run)
        for group in self.known[mode]:
            if surely_one(point, mode, group):
                continue
            found = successors(point, mode, group)
            if len(found) > 1 or spirals_out(point, mode, group):
                self.group = group
                return False
        return True


class _Saved:
    """The state of a run between two steps, with the steps that it has stored from one on."""

    def __init__(self, run: Run, kept: int) -> None:
        self.arrays = [array.copy() for array in self._arrays(run)]
        self.kept, self.steps = kept, run.steps[kept:]
        log: dict[str, Any] = run.events.__dict__
        self.log = {key: value.copy() for key, value in log.items() if isinstance(value, (list, Counter))}
        self.waiting = log["_waiting"]

    @staticmethod
    def _arrays(run: Run) -> list[npt.NDArray[Any]]:
        state: list[npt.NDArray[Any]] = [run.x, run.mode, run.order, run.trigger, run.lam]
        records = (run.clock, run.count, run.zeno, run.machine.w, run.machine.iw)
        return [*state, run.stop, *(record.array for record in records)]

    def restore(self, run: Run) -> None:
        """Put the run back; what it has done since counts as work."""
        count, work = run.count, (run.count.field_calls, run.count.steps, run.count.rejected)
        for array, saved in zip(self._arrays(run), self.arrays, strict=True):
            array[:] = saved
        count.field_calls, count.steps, count.rejected = work
        run.steps[self.kept :] = self.steps
        run.events.__dict__.update({key: value.copy() for key, value in self.log.items()})
        run.events.__dict__["_waiting"] = self.waiting
