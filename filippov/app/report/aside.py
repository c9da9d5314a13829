"""Parts of a study computed in other processes while the first one goes on."""

from __future__ import annotations

import multiprocessing
import signal
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from types import TracebackType
from typing import Any, Self, TypeVar

from filippov.app.report.effort import Effort
from filippov.models.studies import BUILT_IN, Study, get_study

T = TypeVar("T")
# A part: a function of a module, called with the study, the effort and a number.
Part = Callable[[Study, Effort, int], T]


class Aside:
    """Parts submitted to `jobs - 1` processes; a part not yet begun when it is needed is computed here.

    Only the package's own studies are submitted: another process must be able to import them.
    """

    def __init__(self, study: Study, effort: Effort, jobs: int = 1) -> None:
        self.study, self.effort = study, effort
        self._waiting: dict[tuple[Part[Any], int], Future[Any]] = {}
        self._others = set(multiprocessing.active_children())
        known = study.name in BUILT_IN and get_study(study.name) is study
        self._pool: ProcessPoolExecutor | None = None
        if known and jobs > 1:
            context = multiprocessing.get_context("spawn")
            self._pool = ProcessPoolExecutor(jobs - 1, mp_context=context, initializer=_begin)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._pool is None:
            return
        if kind is not None:
            for process in set(multiprocessing.active_children()) - self._others:
                process.kill()
        self._pool.shutdown(wait=kind is None, cancel_futures=True)

    def begin(self, part: Part[Any], numbers: Iterable[int]) -> None:
        """Submit parts to the other processes, in this order."""
        if self._pool is not None:
            for k in numbers:
                self._waiting[part, k] = self._pool.submit(_named, part, self.study.name, self.effort, k)

    def value(self, part: Part[T], k: int) -> T:
        """The result of a part."""
        future: Future[T] | None = self._waiting.pop((part, k), None)
        if future is not None and not future.cancel():
            try:
                return future.result()
            except BrokenProcessPool:  # the process was killed
                pass
        return part(self.study, self.effort, k)


def _begin() -> None:
    """Ignore an interrupt from the terminal, which the first process handles."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _named(part: Part[T], name: str, effort: Effort, k: int) -> T:
    return part(get_study(name), effort, k)
