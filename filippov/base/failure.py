"""What a row of many says where a function of the user's raised instead of returning."""

from __future__ import annotations

import multiprocessing
import threading

from filippov.base.errors import ModelError, SolveError, UsageError
from filippov.base.user_file import placed


def failure(error: BaseException) -> str:
    """The sentence of a row for an exception of its own, SystemExit among them.

    Raises the error itself where it is not the row's: an interrupt from the terminal, which reaches the first
    thread of a process that nobody has started as a worker, and what is no Exception by its class, with which
    a caller further up (a time limit, a budget) ends the whole.
    """
    first = threading.current_thread() is threading.main_thread() and multiprocessing.parent_process() is None
    if isinstance(error, KeyboardInterrupt) and first:
        raise error
    if not isinstance(error, Exception | SystemExit | KeyboardInterrupt):
        raise error
    if isinstance(error, SystemExit):
        return f"SystemExit: a function of the user's ended the program with sys.exit({error.code!r})"
    own = isinstance(error, ModelError | UsageError | SolveError)
    return str(error) if own else placed(error)
