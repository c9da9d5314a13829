"""A computation that is stopped after a time, although it never asks for it."""

from __future__ import annotations

import ctypes
import gc
import sys
import threading
from collections.abc import Callable
from typing import TypeVar

from filippov.analysis.budget import OutOfBudgetError

T = TypeVar("T")


class _StoppedError(BaseException):
    """Not an Exception, so that `except Exception` in the computation does not swallow it."""


def within(seconds: float, function: Callable[[], T]) -> T:
    """Return function(), or raise OutOfBudgetError if it takes longer than `seconds`.

    It runs in a thread of its own, which is stopped between two of its Python instructions. For pure
    computations only, such as sympy's: whatever the function had begun is left as it is.
    """
    result: list[T] = []
    failure: list[BaseException] = []

    def run() -> None:
        try:
            result.append(function())
        except _StoppedError:
            pass
        except BaseException as error:  # noqa: BLE001 (handed to the caller below)
            failure.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    thread.join(max(seconds, 0.0))
    if thread.is_alive():
        _stop(thread)
        if not result and not failure:
            raise OutOfBudgetError(f"more than {seconds:.3g} s")
    if failure:
        raise failure[0]
    if not result:
        raise OutOfBudgetError(f"more than {seconds:.3g} s")
    return result[0]


def _stop(thread: threading.Thread) -> None:
    """Raise _StoppedError in the thread until it ends, at most for a second.

    Never inside a callback of the garbage collector, where an exception is printed and lost: none starts
    while the collector is off, and one that is running is waited for.
    """
    collecting = gc.isenabled()
    gc.disable()
    try:
        for _ in range(200):
            frame = sys._current_frames().get(thread.ident or 0)
            callbacks = {getattr(callback, "__code__", None) for callback in gc.callbacks}
            if frame is None or frame.f_code not in callbacks:
                stop = ctypes.py_object(_StoppedError)
                ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident or 0), stop)
            del frame
            thread.join(0.005)
            if not thread.is_alive():
                return
    finally:
        if collecting:
            gc.enable()
