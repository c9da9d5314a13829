"""A computation that is stopped after a time, although it never asks for it."""

from __future__ import annotations

import ctypes
import sys
import threading
from collections.abc import Callable
from typing import TypeVar

from filippov.analysis.algebra.budget import OutOfBudgetError

T = TypeVar("T")

_stopping = threading.Lock()


class _StoppedError(BaseException):
    """Not an Exception, so that `except Exception` in the computation does not swallow it."""


def within(seconds: float, function: Callable[[], T]) -> T:
    """Return function(), or raise OutOfBudgetError if it takes longer than `seconds`.

    It runs in a thread of its own, which is stopped between two of its Python instructions. For pure
    computations only, such as sympy's: whatever the function had begun is left as it is.
    """
    result: list[T] = []
    failure: list[BaseException] = []
    over = threading.Event()

    def run() -> None:
        try:
            result.append(function())
        except _StoppedError:
            pass
        except BaseException as error:  # noqa: BLE001 (handed to the caller below)
            failure.append(error)
        over.set()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        thread.join(min(max(seconds, 0.0), threading.TIMEOUT_MAX))
    except BaseException:
        _stop(thread, over)
        raise
    if thread.is_alive():
        _stop(thread, over)
        if not result and not failure:
            raise OutOfBudgetError(f"more than {seconds:.3g} s")
    if failure:
        raise failure[0]
    if not result:
        raise OutOfBudgetError(f"more than {seconds:.3g} s")
    return result[0]


def _stop(thread: threading.Thread, over: threading.Event) -> None:
    """Raise _StoppedError in the thread until it ends, at most for a second.

    Where it arrives in a callback of a weak reference or of the garbage collector Python drops it with a
    word on stderr; the word is kept back and the exception raised again. So is the word about one that
    arrives when the thread is at its end.
    """
    with _stopping:
        shown, ended = sys.unraisablehook, threading.excepthook

        def hook(report: sys.UnraisableHookArgs) -> None:
            if report.exc_type is not _StoppedError:
                shown(report)

        def end(report: threading.ExceptHookArgs) -> None:
            if report.exc_type is not _StoppedError:
                ended(report)

        sys.unraisablehook, threading.excepthook = hook, end
        try:
            for _ in range(200):
                if over.is_set():
                    thread.join(1.0)
                    return
                stop = ctypes.py_object(_StoppedError)
                ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(thread.ident or 0), stop)
                thread.join(0.005)
                if not thread.is_alive():
                    return
        finally:
            sys.unraisablehook, threading.excepthook = shown, ended
