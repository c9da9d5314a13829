"""Where chunks are computed: the own processes, any executor of concurrent.futures, or dask."""

from __future__ import annotations

import importlib
import math
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import nullcontext, suppress
from typing import Any, Protocol

from filippov.base.arrays import Whole
from filippov.base.errors import SolveError, UsageError
from filippov.base.names import unknown
from filippov.solving.state.batch import cores
from filippov.sweep.processes import CONTEXTS, Processes
from filippov.sweep.rows import Work
from filippov.sweep.worker import ChunkOutcome, compute

EXECUTORS = ("processes", "dask")


class Engine(Protocol):
    """What the driver needs of it. slots: chunks in work at a time; pulse: seconds between two looks."""

    slots: int
    pulse: float

    def submit(
        self, index: Whole, folder: str, head: str, max_time: float | None, apart: bool
    ) -> Future[ChunkOutcome]:
        """Hand over a chunk, as `worker.compute` takes it."""

    def done(self, future: Future[Any]) -> None:
        """A chunk is done."""

    def lost(self, future: Future[Any], error: BaseException) -> bool:
        """After the loss of a chunk: whether the chunk may be to blame."""

    def fatal(self, error: BaseException) -> bool:
        """Whether an error ends the sweep."""

    def cause(self, future: Future[Any]) -> str:
        """How the worker of a chunk ended."""

    def kill(self, future: Future[Any]) -> None:
        """End the worker of a chunk, where that is possible."""

    def look(self) -> None:
        """Raise SolveError where chunks in work would never come back."""

    def close(self, at_once: bool) -> None:
        """End the workers."""


class Given:
    """An executor of the user's, which stays theirs: it is not shut down."""

    pulse = math.inf

    def __init__(self, work: Work, executor: Executor, jobs: int) -> None:
        self.work, self.executor, self.slots = work, executor, 2 * jobs
        self.flying: set[Future[Any]] = set()

    def submit(
        self, index: Whole, folder: str, head: str, max_time: float | None, apart: bool
    ) -> Future[ChunkOutcome]:
        """Hand over a chunk with the work: which process takes it, and what it knows, cannot be told."""
        future = self.executor.submit(compute, self.work, index, folder, head, max_time, apart)
        self.flying.add(future)
        future.add_done_callback(self.flying.discard)
        return future

    def done(self, future: Future[Any]) -> None:
        """A chunk is done."""

    def lost(self, future: Future[Any], error: BaseException) -> bool:
        """Raise SolveError for an executor that is broken; out of memory is the chunk's affair."""
        if isinstance(error, BrokenExecutor):
            raise SolveError(
                f"the executor that was given broke ({error}); the chunks that are done are kept. Resume "
                "with another executor; executor='processes' starts its workers again by itself."
            )
        return True

    def fatal(self, error: BaseException) -> bool:
        """Whether an error ends the sweep."""
        return not isinstance(error, BrokenExecutor | MemoryError)

    def cause(self, future: Future[Any]) -> str:
        """How the worker of a chunk ended."""
        return "running out of memory"

    def kill(self, future: Future[Any]) -> None:
        """Take the chunk back if it has not begun."""
        future.cancel()

    def look(self) -> None:
        """Nothing to see: an executor that breaks says so in its futures."""

    def close(self, at_once: bool) -> None:
        """Take back what has not begun."""
        for future in list(self.flying):
            future.cancel()


class Dask(Given):
    """dask.distributed: a scheduler somewhere, or a cluster of `jobs` processes on this machine."""

    pulse = 1.0

    def __init__(self, work: Work, scheduler: Any, jobs: int) -> None:
        try:
            self.distributed: Any = importlib.import_module("distributed")
        except ImportError:
            raise UsageError(
                "executor='dask' needs dask.distributed: pip install filippov[clusters]"
            ) from None
        self.own: list[Any] = []
        if isinstance(scheduler, self.distributed.Client):
            self.client = scheduler
        else:
            if scheduler is None:
                scheduler = self.distributed.LocalCluster(
                    n_workers=jobs, threads_per_worker=1, processes=True, dashboard_address=None
                )
                self.own.append(scheduler)
            try:
                self.client = self.distributed.Client(scheduler)
            except OSError as error:  # its TimeoutError is one
                raise SolveError(
                    f"dask's scheduler at {scheduler!r} does not answer ({error}). Start it, or give another "
                    "address."
                ) from None
            self.own.insert(0, self.client)
        workers = len(self.client.scheduler_info(n_workers=-1)["workers"])
        super().__init__(work, self.client.get_executor(pure=False), max(jobs, workers))

    def submit(
        self, index: Whole, folder: str, head: str, max_time: float | None, apart: bool
    ) -> Future[ChunkOutcome]:
        """Hand over a chunk. Raises SolveError where the scheduler is lost."""
        try:
            return super().submit(index, folder, head, max_time, apart)
        except Exception:
            self.look()
            raise

    def look(self) -> None:
        """Raise SolveError where the scheduler is lost: its futures stay as they are forever."""
        if self.client.status not in ("running", "connecting"):
            raise SolveError(
                f"dask's scheduler is lost (the client is {self.client.status}); the chunks that are done "
                "are kept. Start a scheduler and go on with resume=True (--resume)."
            )

    def lost(self, future: Future[Any], error: BaseException) -> bool:
        """Whether the chunk may be to blame: dask has tried it on several workers already."""
        self.look()
        return not (isinstance(error, CancelledError) or overtaken(error))

    def fatal(self, error: BaseException) -> bool:
        """Whether an error ends the sweep."""
        killed = importlib.import_module("distributed.scheduler").KilledWorker
        return not (isinstance(error, MemoryError | CancelledError | killed) or overtaken(error))

    def cause(self, future: Future[Any]) -> str:
        """How the workers of a chunk ended."""
        return str(future.exception()) if future.done() and not future.cancelled() else "a lost worker"

    def close(self, at_once: bool) -> None:
        """Leave the scheduler; end a cluster of one's own."""
        if self.client.status == "running":
            super().close(at_once)
        for item in self.own:
            with suppress(Exception) if at_once else nullcontext():  # what is lost cannot say goodbye
                item.close(timeout=1 if at_once else 10)


def overtaken(error: BaseException) -> bool:
    """Whether dask took a result for an error: it reads how a future ended after what came of it, and in
    between its worker may be lost."""
    return isinstance(error, TypeError) and ChunkOutcome.__name__ in str(error)


def engine_of(
    work: Work, executor: Any, jobs: int | None, scheduler: Any, context: str, max_memory: int | None
) -> Engine:
    """The engine that is asked for. Raises UsageError."""
    number = jobs or cores()
    if isinstance(executor, Executor):
        return Given(work, executor, number)
    if not isinstance(executor, str) or executor not in EXECUTORS:
        raise UsageError(f"{unknown('executor', executor, EXECUTORS)}; or an Executor of concurrent.futures.")
    if executor == "dask":
        return Dask(work, scheduler, number)
    if scheduler is not None:
        raise UsageError("scheduler belongs to executor='dask': add that, or leave scheduler out.")
    if context not in CONTEXTS:
        raise UsageError(unknown("context", context, CONTEXTS))
    return Processes(work, number, context, max_memory)
