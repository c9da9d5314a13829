"""Work and size that a symbolic computation may take, counted in calls, so that no clock decides a result.

Inside a function that is `counted` every call of a Python function is counted, in machine code where that can
be (`filippov.analysis.algebra.call_counter`), else by the interpreter's trace hook, which also ends what is
beyond its limit. A budget is in millions of calls, of which sympy makes about two a second.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from functools import wraps
from inspect import CO_GENERATOR
from types import FrameType
from typing import Any, ParamSpec, TypeVar

from filippov.analysis.algebra.call_counter import CALLS as DONE
from filippov.analysis.algebra.call_counter import LIMIT, NEVER, CallCounter, call_counter, cells

P = ParamSpec("P")
T = TypeVar("T")
MOST_TERMS = 100_000
CALLS = 1_000_000
# What a step is charged beside the calls that it makes.
STEP = 20
# Code that runs in callbacks of the garbage collector, where Python drops exceptions.
_CALLBACKS = ("__del__", "remove", "_remove", "_commit_removals")


class OutOfBudgetError(Exception):
    """The work or the size that was allowed is used up."""


class _StoppedError(BaseException):
    """Not an Exception, so that `except Exception` in the computation does not swallow it."""


class _Count:
    """Calls of a thread so far, the count at which a computation is stopped, and how deep counting is."""

    __slots__ = ("cells", "counter", "depth")

    def __init__(self) -> None:
        self.cells, self.depth = cells(), 0
        self.counter: CallCounter | None = None

    def stop_at(self, limit: float) -> None:
        self.cells[LIMIT] = int(min(limit, NEVER))
        if self.counter is not None:
            self.counter.again()


class _Counts(threading.local):
    """The count of this thread: looked up once, since the hook runs at every call."""

    def __init__(self) -> None:
        self.own = _Count()


_counts = _Counts()


def counted(function: Callable[P, T]) -> Callable[P, T]:
    """The function with its calls counted while it runs. A trace hook that is there goes on working."""

    @wraps(function)
    def run(*args: P.args, **kwargs: P.kwargs) -> T:
        count = _counts.own
        if count.depth:
            return function(*args, **kwargs)
        before, counter = sys.gettrace(), call_counter()
        count.depth = 1
        hook = _hook(count, before)
        if counter is not None and before is None and counter.start(count.cells, lambda: sys.settrace(hook)):
            count.counter = counter
        else:
            sys.settrace(hook)
        try:
            return function(*args, **kwargs)
        finally:
            sys.settrace(before)
            if count.counter is not None:
                count.counter.stop()
                count.counter = None
            count.depth = 0

    return run


def _hook(count: _Count, before: Any) -> Callable[[FrameType, str, Any], Any]:
    own = count.cells

    def hook(frame: FrameType, event: str, arg: Any) -> Any:
        own[DONE] += 1
        if own[DONE] > own[LIMIT] and not _held(frame):
            raise _StoppedError
        return None if before is None else before(frame, event, arg)

    return hook


def _held(frame: FrameType) -> bool:
    """Whether an exception would be lost here: where a generator is closed, and below a callback."""
    if frame.f_code.co_flags & CO_GENERATOR:
        return True
    at: FrameType | None = frame
    while at is not None:
        if at.f_code.co_name in _CALLBACKS:
            return True
        at = at.f_back
    return False


class Clock:
    """Work that a computation may take: asked between its steps, or counted while it runs.

    budget    in millions of calls
    progress  called with what is done of it, and it, whenever the clock is asked
    """

    def __init__(self, budget: float, progress: Callable[[float, float], object] | None = None) -> None:
        self.budget, self.started, self.progress = budget, int(_counts.own.cells[DONE]), progress

    def check(self, terms: int = 0) -> None:
        """Raise OutOfBudgetError if the work is over or a product of that many terms would be formed."""
        if terms > MOST_TERMS:
            raise OutOfBudgetError(f"a product of {terms} terms")
        own = _counts.own.cells
        own[DONE] += STEP
        if self.progress is not None:
            self.progress((own[DONE] - self.started) / CALLS, self.budget)
        if own[DONE] - self.started > self.budget * CALLS:
            raise OutOfBudgetError(self._said(self.budget))

    def remaining(self) -> float:
        """What is left; raises OutOfBudgetError where there is nothing."""
        self.check()
        return self.budget - (int(_counts.own.cells[DONE]) - self.started) / CALLS

    def within(self, function: Callable[[], T], most: float = float("inf")) -> T:
        """Return function(), or raise OutOfBudgetError if it takes more than is left, or than `most`.

        For pure computations only, such as sympy's: whatever the function had begun is left as it is. A loop
        that calls nothing is not stopped.
        """
        allowed = min(self.remaining(), most)
        count, hook = _counts.own, sys.gettrace()
        outer = count.cells[LIMIT]
        count.stop_at(min(outer, count.cells[DONE] + allowed * CALLS))
        mine = count.cells[LIMIT] < outer
        try:
            return counted(function)()
        except _StoppedError:
            if not mine:
                raise
            raise OutOfBudgetError(self._said(min(self.budget, most))) from None
        finally:
            count.stop_at(outer)
            # The interpreter takes away a hook that raised.
            sys.settrace(hook)

    @staticmethod
    def _said(budget: float) -> str:
        return f"more than a budget of {budget:.3g} (million calls)"
