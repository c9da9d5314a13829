"""The driver: distributes chunks, ensures a row for every point, quarantines points that end their worker."""

from __future__ import annotations

import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from filippov.base.arrays import Whole
from filippov.base.errors import SolveError, UsageError
from filippov.base.failure import failure
from filippov.base.given import Count, Positive, check_count, positive
from filippov.base.keywords import keywords
from filippov.sweep.chunk import FullError
from filippov.sweep.engine import Engine, engine_of
from filippov.sweep.lock import Lock
from filippov.sweep.processes import check_main
from filippov.sweep.rows import QUARANTINED, Work, failed_row
from filippov.sweep.store import Store, missing, try_folder
from filippov.sweep.table import SweepTable
from filippov.sweep.worker import ChunkOutcome

TARGET, LARGEST = 1.0, 8192  # seconds and points of a chunk
KILLS, PASSES = 2, 3
GRACE = 10.0


@keywords(answers=dict.fromkeys(
    ("workers", "n_workers", "max_workers", "processes", "nproc"),
    "worker processes are jobs here: jobs=4.",
))  # fmt: skip
def run(
    work: Work,
    folder: str | Path | None = None,
    *,
    jobs: Count | None = None,
    executor: Any = "processes",
    scheduler: Any = None,
    resume: bool = False,
    fresh: bool = False,
    trust: bool = False,
    max_time: Positive | None = None,
    max_memory: Count | None = None,
    chunk: Count | None = None,
    context: str = "spawn",
    progress: Callable[[int, int], object] | None = None,
) -> SweepTable:
    """Compute every point of a work and return the table.

    folder      where the chunks are written; None: a temporary one, removed at the end
    jobs        worker processes, default all cores; of an executor that is given: how many it has
    executor    "processes", "dask" or any concurrent.futures.Executor
    scheduler   of dask: address, Client or cluster; default a cluster of `jobs` processes on this machine
    resume      go on with what the folder holds; fresh: remove what the sweep that it holds has written
    trust       resume although user functions depend on what cannot be seen (see
                `filippov.sweep.dependence`): you confirm that none of it has changed
    max_time    seconds for each point; a point that takes longer has status "timeout"
    max_memory  bytes of address space of each worker process
    chunk       points in a chunk; default: as many as take about a second
    context     "spawn" or "forkserver": how processes start
    progress    called with (points done, points)

    If a worker dies, only its chunk is lost and computed again; a chunk that ends its worker twice is halved
    until the responsible point is found, which gets the status "quarantined" and the cause. At Ctrl-C the
    rows that are done are returned; `complete` is False then. Raises UsageError, SolveError where the sweep
    cannot go on, FullError where the disk is full.
    """
    check_main()
    for name, value in (("jobs", jobs), ("chunk", chunk), ("max_memory", max_memory)):
        if value is not None:
            check_count(name, value)
    if max_time is not None:
        positive("max_time", max_time)
    if resume and fresh:
        raise UsageError("resume and fresh exclude each other: go on, or begin afresh.")
    if folder is not None and not str(folder):
        raise UsageError("folder is '', expected the name of a folder; the current one is '.'.")
    with ExitStack() as stack:
        if folder is None:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="filippov-sweep-"))
        place = Path(folder).absolute()
        try_folder(place)
        stack.enter_context(Lock(place))
        engine = engine_of(work, executor, jobs, scheduler, context, max_memory)
        driver = _Driver(work, Store(place, work), engine, max_time, chunk, progress)
        at_once = [True]
        stack.callback(lambda: engine.close(at_once[0]))
        driver.store.begin(resume, fresh, trust)
        try:
            table = driver.run()
            at_once[0] = False
        except KeyboardInterrupt:
            engine.close(at_once=True)
            table = driver.store.read()
        return replace(table, damaged=tuple(driver.store.damaged))


class _Driver:
    """Chunks waiting and chunks in work.

    Beside each chunk stands how often its worker ended, and whether it is a part of one that did so twice.
    """

    def __init__(
        self, work: Work, store: Store, engine: Engine, max_time: float | None, chunk: int | None,
        progress: Callable[[int, int], object] | None,
    ) -> None:  # fmt: skip
        self.work, self.store, self.engine = work, store, engine
        self.max_time, self.chunk, self.progress = max_time, chunk, progress
        self.size = chunk or work.first
        self.rest: Whole = np.zeros(0, dtype=np.int64)
        self.again: deque[tuple[Whole, int, bool]] = deque()
        self.flying: dict[Future[Any], tuple[Whole, int, bool, float]] = {}
        self.done = 0

    def run(self) -> SweepTable:
        """Compute everything that is missing."""
        for _ in range(PASSES):
            table = self.store.read()
            self.rest, self.done = missing(table), int(table.known.sum())
            self._tell(0)
            if not self.rest.size:
                return table
            self._pass()
        table = self.store.read()
        if not table.complete:
            raise SolveError(
                f"{missing(table).size} points were computed {PASSES} times and their chunks are not in "
                f"{str(self.store.chunks)!r}. Does every worker see this folder under this name?"
            )
        return table

    def _pass(self) -> None:
        while self.rest.size or self.again or self.flying:
            while (self.rest.size or self.again) and len(self.flying) < self.engine.slots:
                self._submit(*self._next())
            deadline = min((end for *_, end in self.flying.values()), default=np.inf)
            left = min(self.engine.pulse, max(0.0, deadline - time.monotonic()))
            longest = None if left > threading.TIMEOUT_MAX else left
            ready, _ = wait(self.flying, timeout=longest, return_when=FIRST_COMPLETED)
            self.engine.look()
            for future in ready:
                self._finish(future)
            for future, (index, blame, apart, end) in list(self.flying.items()):
                if time.monotonic() > end:
                    self.engine.kill(future)
                    self.flying[future] = index, blame, apart, np.inf

    def _next(self) -> tuple[Whole, int, bool]:
        if self.again:
            return self.again.popleft()
        # Towards the end chunks get smaller, so that no worker waits long for another's last one; few points
        # side by side would not fill the lanes.
        workers = self.engine.slots
        share = self.rest.size if workers == 1 else -(-self.rest.size // (2 * workers))
        size = min(self.chunk or max(1, min(self.size, max(share, self.work.first))), self.rest.size)
        # To the end of a block: the points of one are computed together in any case.
        grain = self.work.grain
        size = int(np.searchsorted(self.rest, (self.rest[size - 1] // grain + 1) * grain))
        part, self.rest = self.rest[:size], self.rest[size:]
        return part, 0, False

    def _submit(self, index: Whole, blame: int, apart: bool) -> None:
        end = np.inf
        if self.max_time is not None:
            end = time.monotonic() + 2 * len(index) * self.max_time + GRACE
        head = self.store.manifest.text
        future = self.engine.submit(index, str(self.store.chunks), head, self.max_time, apart)
        self.flying[future] = index, blame, apart, end

    def _finish(self, future: Future[Any]) -> None:
        index, blame, apart, _ = self.flying.pop(future)
        error = CancelledError() if future.cancelled() else future.exception()
        if error is None:
            self.engine.done(future)
            self._written(future.result())
            return
        if self.engine.fatal(error):
            if isinstance(error, Exception):
                raise error
            raise SolveError(f"a worker ended the sweep ({failure(error)}); what is done is kept.") from None
        cause = "running out of memory" if isinstance(error, MemoryError) else self.engine.cause(future)
        guilty = self.engine.lost(future, error)
        left = np.array([point for point in index.tolist() if not self.store.has(point)], dtype=np.int64)
        self._tell(len(index) - len(left))
        if len(left) < len(index):  # the point that did it has told so itself
            blame = 0
        elif guilty:
            blame += 1
        if not left.size:
            return
        if blame < KILLS:
            self.again.append((left, blame, apart))
        elif left.size > 1:
            half = left.size // 2
            self.again.extend(((left[:half], blame - 1, True), (left[half:], blame - 1, True)))
        else:
            self._set_aside(int(left[0]), cause, blame)

    def _written(self, outcome: ChunkOutcome) -> None:
        if outcome.trouble:
            raise (FullError if outcome.full else SolveError)(outcome.trouble)
        self._tell(outcome.points)
        rate = max(outcome.seconds, 1e-3) / outcome.points
        self.size = int(min(max(1, TARGET / rate), 4 * max(self.size, 1), LARGEST))

    def _set_aside(self, point: int, cause: str, times: int) -> None:
        said = (
            f"the point ended its worker {times} times ({cause}). Common causes: a function of the user's "
            "that crashes, or too little memory (fewer jobs, or measures that need the ends only)"
        )
        self.store.quarantine(failed_row(point, len(self.work.columns), QUARANTINED, said))
        self._tell(1)

    def _tell(self, more: int) -> None:
        self.done += more
        if self.progress is not None:
            self.progress(min(self.done, self.store.size), self.store.size)
