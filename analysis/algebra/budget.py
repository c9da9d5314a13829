"""Work and size that a symbolic computation may take, counted in calls, so that no clock decides a result.

Inside a function that is `counted` every call of a Python function is counted by the interpreter's trace
hook. A budget is in millions of calls, of which sympy makes about one a second.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from functools import wraps
from inspect import CO_GENERATOR
from types import FrameType
from typing import Any, ParamSpec, TypeVar

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


class _Count(threading.local):
    """Calls of this thread so far, the count at which a computation is stopped, and how deep counting is."""

    calls = 0
    limit = float("inf")
    depth = 0


_count = _Count()


def counted(function: Callable[P, T]) -> Callable[P, T]:
    """The function with its calls counted while it runs. A trace hook that is there goes on working."""

    @wraps(function)
    def run(*args: P.args, **kwargs: P.kwargs) -> T:
        if _count.depth:
            return function(*args, **kwargs)
        before = sys.gettrace()
        _count.depth = 1
        sys.settrace(_hook(before))
        try:
            return function(*args, **kwargs)
        finally:
            sys.settrace(before)
            _count.depth = 0

    return run


def _hook(before: Any) -> Callable[[FrameType, str, Any], Any]:
    def hook(frame: FrameType, event: str, arg: Any) -> Any:
        _count.calls += 1
        code = frame.f_code
        # A generator may be entered to be closed, where an exception would be lost; what it calls is stopped.
        held = code.co_flags & CO_GENERATOR or code.co_name in _CALLBACKS
        if _count.calls > _count.limit and not held:
            raise _StoppedError
        return None if before is None else before(frame, event, arg)

    return hook


class Clock:
    """Work that a computation may take: asked between its steps, or counted while it runs.

    budget  in millions of calls
    """

    def __init__(self, budget: float) -> None:
        self.budget, self.started = budget, _count.calls

    def check(self, terms: int = 0) -> None:
        """Raise OutOfBudgetError if the work is over or a product of that many terms would be formed."""
        if terms > MOST_TERMS:
            raise OutOfBudgetError(f"a product of {terms} terms")
        _count.calls += STEP
        if _count.calls - self.started > self.budget * CALLS:
            raise OutOfBudgetError(self._said(self.budget))

    def remaining(self) -> float:
        """What is left; raises OutOfBudgetError where there is nothing."""
        self.check()
        return self.budget - (_count.calls - self.started) / CALLS

    def within(self, function: Callable[[], T], most: float = float("inf")) -> T:
        """Return function(), or raise OutOfBudgetError if it takes more than is left, or than `most`.

        For pure computations only, such as sympy's: whatever the function had begun is left as it is. A loop
        that calls nothing is not stopped.
        """
        allowed = min(self.remaining(), most)
        outer, hook = _count.limit, sys.gettrace()
        _count.limit = min(outer, _count.calls + allowed * CALLS)
        mine = _count.limit < outer
        try:
            return counted(function)()
        except _StoppedError:
            if not mine:
                raise
            raise OutOfBudgetError(self._said(min(self.budget, most))) from None
        finally:
            _count.limit = outer
            # The interpreter takes away a hook that raised.
            sys.settrace(hook)

    @staticmethod
    def _said(budget: float) -> str:
        return f"more than a budget of {budget:.3g} (million calls)"
