"""The own pool: one ProcessPoolExecutor for each worker, so that a worker that dies takes nothing with it
but its own chunk, and it is known which chunk that was."""

from __future__ import annotations

import math
import multiprocessing
import re
import signal
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.process import BaseProcess
from multiprocessing.reduction import ForkingPickler
from pathlib import Path
from typing import Any

from filippov.base.arrays import Whole
from filippov.base.errors import SolveError, UsageError
from filippov.sweep import worker
from filippov.sweep.rows import Work
from filippov.sweep.worker import ChunkOutcome

CONTEXTS = ("spawn", "forkserver")
MOST_FAILED_STARTS = 3
GUARD = (
    "the script that starts the sweep has no guard: workers import it and would start the sweep again. Put "
    'what it does under `if __name__ == "__main__":`'
)


class _Lane:
    """One worker: its executor, its process, and what it is working on."""

    def __init__(self, jobs: Callable[[], ProcessPoolExecutor], work: Work) -> None:
        before = set(multiprocessing.active_children())
        self.executor = jobs()
        self.hello: Future[int] = self.executor.submit(worker.hello, work)
        started = set(multiprocessing.active_children()) - before
        self.process: BaseProcess | None = next(iter(started), None)

    @property
    def began(self) -> bool:
        """Whether its process ever came so far as to take the work."""
        return self.hello.done() and not self.hello.cancelled() and self.hello.exception() is None

    def end(self, at_once: bool) -> None:
        if at_once and self.process is not None and self.process.is_alive():
            self.process.kill()
        self.executor.shutdown(wait=not at_once, cancel_futures=True)


class Processes:
    """Engine of `jobs` processes on this machine.

    context     "spawn" or "forkserver"
    max_memory  bytes of address space of a worker, None for no limit

    Raises UsageError for work that cannot be sent to another process.
    """

    pulse = math.inf

    def __init__(
        self, work: Work, jobs: int, context: str = "spawn", max_memory: int | None = None
    ) -> None:
        worker.check_memory_limit(max_memory)
        if context not in multiprocessing.get_all_start_methods():
            raise UsageError(f"context is {context!r}, which {sys.platform} does not have; leave it out.")
        check_sendable(work)
        self.work, self.slots = work, jobs
        self.context, self.max_memory = multiprocessing.get_context(context), max_memory
        # All of them: one that an interrupt caught between idle and busy is to be ended as well.
        self.lanes: list[_Lane] = []
        self.idle: list[_Lane] = []
        self.busy: dict[Future[Any], _Lane] = {}
        self.failed_starts = 0

    def submit(
        self, index: Whole, folder: str, head: str, max_time: float | None, apart: bool
    ) -> Future[ChunkOutcome]:
        """Hand a chunk to a worker that has none; the work it received at its start."""
        if not self.idle:
            with _no_interrupt():
                self.lanes.append(_Lane(self._executor, self.work))
            self.idle.append(self.lanes[-1])
        lane = self.idle.pop()
        chunk = index, folder, head, max_time, apart
        try:
            future = lane.executor.submit(worker.compute_received, *chunk)
        except BrokenProcessPool as error:  # it died since its last chunk
            future = Future()
            future.set_exception(error)
        self.busy[future] = lane
        return future

    def done(self, future: Future[Any]) -> None:
        """The worker of a chunk is free for another."""
        self.idle.append(self.busy.pop(future))

    def lost(self, future: Future[Any], error: BaseException) -> bool:
        """Whether the worker died over the chunk; its place is free for another. False: it never began.

        Raises SolveError where workers end before they can begin, again and again.
        """
        lane = self.busy.pop(future)
        if isinstance(error, MemoryError):
            self.idle.append(lane)
            return True
        lane.end(at_once=True)
        self.lanes.remove(lane)
        if lane.began:
            self.failed_starts = 0
            return True
        self.failed_starts += 1
        if self.failed_starts >= MOST_FAILED_STARTS:
            raise SolveError(
                f"{self.failed_starts} workers in a row ended before they could begin; what they wrote is on "
                f"stderr. Common causes: {GUARD}; the model is defined where a worker cannot import it "
                "(define it in a module); max_memory is too small for the interpreter."
            )
        return False

    def fatal(self, error: BaseException) -> bool:
        """Whether an error ends the sweep."""
        return not isinstance(error, BrokenProcessPool | MemoryError)

    def cause(self, future: Future[Any]) -> str:
        """How the worker of a chunk ended, for people."""
        process, code = self.busy[future].process, None
        if process is not None:
            # The executor waits for it too: whoever is told how it ended tells the other a moment later.
            until = time.monotonic() + 1.0
            while (code := process.exitcode) is None and time.monotonic() < until:
                time.sleep(0.01)
        if code is not None and code < 0:
            return _signal_name(-code)
        return "an exit of its own" if code is None else f"exit code {code}"

    def kill(self, future: Future[Any]) -> None:
        """End the worker of a chunk."""
        process = self.busy[future].process
        if process is not None:
            process.kill()

    def look(self) -> None:
        """Nothing to see: a worker that ends says so in its future."""

    def close(self, at_once: bool) -> None:
        """End the workers."""
        for lane in self.lanes:
            lane.end(at_once)
        self.lanes.clear()
        self.idle.clear()
        self.busy.clear()

    def _executor(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(
            1, mp_context=self.context, initializer=worker.begin, initargs=(self.max_memory,)
        )


def check_main() -> None:
    """Raise UsageError in a worker that runs the script which starts the sweep."""
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise UsageError(f"a sweep is started while a worker process starts: {GUARD}.")


def check_sendable(work: Work) -> None:
    """Raise UsageError for work that another process cannot receive: lambdas, functions of a notebook."""
    advice = (
        "Define the model and its measures in a module (a file that can be imported), or use "
        "executor='dask', which sends functions by value (cloudpickle), or an executor of threads."
    )
    try:
        content = ForkingPickler.dumps(work)
    except Exception as error:  # noqa: BLE001  # a user's object may raise anything when it is pickled
        raise UsageError(
            f"the sweep cannot be sent to a worker process ({type(error).__name__}: {error}); lambdas and "
            f"functions inside functions cannot. {advice}"
        ) from None
    import __main__

    file = getattr(__main__, "__file__", None)
    if re.search(b"__main__", content) and (file is None or not Path(file).is_file()):
        raise UsageError(
            "the model or a measure is defined in a notebook or at the prompt, which a worker process "
            f"cannot import. {advice}"
        )


def _signal_name(number: int) -> str:
    known = {item.value: item.name for item in signal.Signals}
    return f"signal {known.get(number, number)}"


@contextmanager
def _no_interrupt() -> Iterator[None]:
    """Processes started meanwhile do not hear Ctrl-C, which the terminal sends to all of them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
