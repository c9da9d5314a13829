"""All solutions of a search side by side, until each is at an attractor, has escaped, or is given up."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from filippov.analysis.invariant_sets.attractor import Attractor, AttractorKind
from filippov.analysis.invariant_sets.identify_attractor import NEAR, Identifier
from filippov.analysis.invariant_sets.recurrence import Grid, Past
from filippov.analysis.invariant_sets.rest_set import groups
from filippov.analysis.invariant_sets.search_file import EVERY, SearchFile
from filippov.analysis.invariant_sets.state_map import StateMap
from filippov.base.arrays import Array, Whole
from filippov.base.status import Status

LOST, ESCAPED, FAILED, UNSTABLE, UNIDENTIFIED = -1, -2, -3, -4, -5
# Iterates in a row within reach of an attractor that make a solution its own; without displacement, that are
# rest.
HOLD, STILL = 8, 3
# Objects that do not attract before nothing more is identified; a state that is thrown out so far has
# escaped.
MOST_UNSTABLE, FAR = 12, 10.0
# Looks in a row at which nothing was found before no more are taken: what is left is then slow.
MOST_VAIN = 12
# A recurrent solution within so many cells of a known attractor is given time, twice as long every time.
BESIDE, WAITS = 4.0, 4


class Search:
    """Labels of N solutions: numbers of `attractors`, or what became of the others.

    label     -1 still on its way, -2 escaped, -3 failed, -4 on an object that does not attract, -5 recurrent
              where nothing could be identified; failures: count by status
    """

    def __init__(
        self, flow: StateMap, x: Array, low: Array, size: Array, *, cells: int, recurrences: int, most: int,
        reach: float, escape: float, progress: Callable[[int, int], None] | None,
        file: SearchFile | None = None,
    ) -> None:  # fmt: skip
        self.flow, self.x, self.begin, self.low, self.size = flow, x.copy(), x.copy(), low, size
        self.recurrences, self.most, self.reach, self.escape = recurrences, most, reach, escape
        self.progress, self.file, self.grid = progress, file, Grid(low, size, cells)
        self.identify = Identifier(flow, self.grid, size)
        count = len(x)
        self.label = np.full(count, LOST)
        self.past = Past(count)
        self.still = np.zeros(count, dtype=np.int64)
        self.close = np.zeros((count, 0), dtype=np.int64)
        self.waited = np.zeros(count, dtype=np.int64)
        self.tried = np.zeros(count, dtype=np.int64)
        self.attractors: list[Attractor] = []
        self.unstable: list[Attractor] = []
        self.failures: dict[str, int] = {}
        self.rests: list[int] = []
        self.vain, self.looked = 0, np.zeros(0, dtype=np.uint64)
        self.complete = True
        self.iterates = 0
        if file is not None:
            file.read(self)

    def run(self) -> None:
        """Iterate until all is decided or `most` iterates are done; Ctrl-C ends it with what there is."""
        try:
            while self.iterates < self.most:
                rows = np.flatnonzero(self.label == LOST)
                if not rows.size:
                    break
                if self.file is not None and self.iterates % EVERY == 0:
                    self.file.write(self)
                self._iterate(rows)
                self.iterates += 1
                if self.progress is not None:
                    self.progress(int(np.sum(self.label != LOST)), len(self.label))
            if self.file is not None:
                self.file.write(self)
        except KeyboardInterrupt:
            self.complete = False
        self._rest()

    def _iterate(self, rows: Whole) -> None:
        before = self.x[rows]
        image, ends = self.flow(before)
        done = self.flow.done(ends)
        away = np.max(np.abs(image - self.low - 0.5 * self.size) / self.size, axis=1)
        gone = ~np.isfinite(away) | (away > self.escape)
        for k in np.flatnonzero(~done & ~gone).tolist():
            status = ends.status[k]
            if self.flow.kind == "section" and status is Status.SUCCESS:
                # No event within t_max: at rest, or a return that takes longer.
                if self.flow.resting(image[k : k + 1], 10 * NEAR * self.size)[0]:
                    self.x[rows[k]] = image[k]
                    self._at_rest(int(rows[k]))
                    continue
                status = Status.NO_RETURN
            elif away[k] > FAR and status in (Status.NOT_FINITE, Status.MIN_STEP, Status.MAX_STEPS):
                gone[k] = True
                continue
            self.label[rows[k]] = FAILED
            self.failures[status.value] = self.failures.get(status.value, 0) + 1
        self.label[rows[gone]] = ESCAPED
        good = np.flatnonzero(done & ~gone)
        rows, image, before = rows[good], image[good], before[good]
        self.x[rows] = image
        moved = np.max(np.abs(image - before) / self.size, axis=1)
        self.still[rows] = np.where(moved <= NEAR, self.still[rows] + 1, 0)
        self.past.add(rows, self.grid.names(image))
        self._assign(rows)
        self._settle(rows[self.still[rows] == STILL])
        while True:
            left = np.flatnonzero((self.label == LOST) & (self.past.streak >= self.recurrences))
            if not left.size:
                return
            self._look_at(int(left[0]))

    def _assign(self, rows: Whole, only: int | None = None) -> None:
        """Count the iterates of these solutions near the attractors, and label those that stay there."""
        for number, attractor in enumerate(self.attractors):
            if attractor.kind == "equilibrium set" or (only is not None and number != only):
                continue
            x = self.x[rows]
            if attractor.cells is not None:
                near, hold = np.isin(self.grid.names(x), attractor.cells), self.recurrences
            else:
                near = attractor.distance(x, self.size) <= self.reach
                hold = HOLD * (attractor.period or 1) if attractor.curve is None else HOLD
            self.close[rows, number] = np.where(near, self.close[rows, number] + 1, 0)
            mine = (self.close[rows, number] >= hold) & (self.label[rows] == LOST)
            self.label[rows[mine]] = number

    def _settle(self, rows: Whole) -> None:
        """Solutions that no longer move: at rest if at all times of a step, else on a fixed point."""
        rows = rows[self.label[rows] == LOST]
        if not rows.size or self.flow.kind == "section":
            return
        for row in rows[self.flow.resting(self.x[rows], 10 * NEAR * self.size)].tolist():
            self._at_rest(row)

    def _at_rest(self, row: int) -> None:
        """Keep a rest for `_rest`, where an equilibrium is not known there."""
        x = self.x[row : row + 1]
        for number, known in enumerate(self.attractors):
            if known.kind == "equilibrium" and known.distance(x, self.size)[0] <= self.reach:
                self.label[row] = number
                return
        self.rests.append(row)
        self.label[row] = UNIDENTIFIED

    def _look_at(self, row: int) -> None:
        """Identify what the solution is at; one that is found not to be near waits twice as long."""
        if self.waited[row] < WAITS and self._beside(row):
            self.waited[row] += 1
            self.past.streak[row] = -self.recurrences * 2 ** int(self.waited[row] - 1)
            return
        self.tried[row] += 1
        self.past.streak[row] = -self.recurrences * 2 ** int(self.tried[row])
        if self.vain >= MOST_VAIN:
            return
        if len(self.unstable) >= MOST_UNSTABLE:
            self.label[row] = UNIDENTIFIED
            return
        found = self.identify(self.x[row])
        self.looked = np.union1d(self.looked, self.identify.passed)
        if found is None:
            self.vain += 1
            here = self.grid.names(self.grid.around(self.x[row : row + 1]))
            self.looked = np.union1d(self.looked, here)
            return
        self.vain = 0
        if found.kind == "equilibrium set" or (found.kind == "equilibrium" and found.stable is None):
            # Drawn in ever more slowly: it will rest in the end, and what comes there too tells the rest.
            self.x[row] = found.states[0]
            self._at_rest(row)
            return
        if (found.stable is False and found.cells is None) or (found.stable is None and found.cells is None):
            known = self._known(found, self.unstable)
            if known is None:
                self.unstable.append(found)
            self.label[row] = UNSTABLE
            return
        known = self._known(found, self.attractors)
        if known is None:
            self.attractors.append(found)
            self.close = np.hstack([self.close, np.zeros((len(self.close), 1), dtype=np.int64)])
            known = len(self.attractors) - 1
        near = found.distance(self.x[row : row + 1], self.size)[0]
        if found.cells is not None or near <= self.reach:
            self.label[row] = known

    def _beside(self, row: int) -> bool:
        """Whether an attractor is near that may draw it in, or a place where a look was in vain."""
        x = self.x[row : row + 1]
        if np.isin(self.grid.names(x), self.looked)[0]:
            return True
        for known in self.attractors:
            if known.cells is not None:
                if np.isin(self.grid.names(x), known.cells)[0]:
                    return True
            elif known.distance(x, self.size)[0] <= BESIDE * float(np.max(self.grid.edge / self.size)):
                return True
        return False

    def _known(self, found: Attractor, among: list[Attractor]) -> int | None:
        """Number of the same object in a list."""
        for number, other in enumerate(among):
            if other.kind != found.kind or other.period != found.period:
                continue
            if found.cells is not None and other.cells is not None:
                # Two samples of one chaotic attractor share most of its cells.
                shared = np.isin(found.cells, other.cells).mean()
                if shared > 0.5:
                    return number
            elif np.max(other.distance(found.states, self.size)) <= min(self.reach, 1e-4):
                return number
        return None

    # -- sets of equilibria ------------------------------------------------------------------------------

    def _rest(self) -> None:
        """Order the rests into connected sets; those that drew no solution in do not attract."""
        if not self.rests:
            return
        rows = np.array(self.rests, dtype=np.int64)
        x = self.x[rows]
        part = groups(self.flow.timed(), x, self.size, NEAR, 0.5 * self.reach)
        for number in range(int(part.max()) + 1):
            mine = rows[part == number]
            states = self.x[mine]
            found = self.identify.at_rest(states[0])
            apart = np.max(np.ptp(states, axis=0) / self.size) > 1e-5
            kind: AttractorKind = "equilibrium set" if apart else "equilibrium"
            spread = np.unique(states[np.lexsort(states.T[::-1])], axis=0)
            keep = spread[np.unique(np.linspace(0, len(spread) - 1, 200).astype(int))]
            found = Attractor(
                kind, keep, multipliers=found.multipliers, low=states.min(axis=0), high=states.max(axis=0),
                note=found.note, drawn=found.drawn and not apart,
            )  # fmt: skip
            came = np.max(np.abs(states - self.begin[mine]) / self.size, axis=1) > 1e-6
            repels = np.any(np.abs(found.multipliers) > 1 + 1e-6)
            known = self._known(found, self.attractors) if kind == "equilibrium" else None
            if repels or (not came.any() and found.stable is not True):
                self.unstable.append(found)
                self.label[mine] = UNSTABLE
                continue
            if known is None:
                self.attractors.append(found)
                known = len(self.attractors) - 1
            self.label[mine] = known
