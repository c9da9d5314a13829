"""What a worker does: compute a chunk and write it, so that it is kept whatever happens to anyone later."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import wait
from pathlib import Path

from filippov.status import Status
from filippov.sweep.chunk import FullError, write_chunk
from filippov.sweep.rows import Limits, Whole, Work, failed_row

LATE = 75  # exit code of a worker whose point did not return


@dataclass(frozen=True)
class Outcome:
    """What became of a chunk.

    trouble  why its file could not be written, "" for a file that is there; full: whether for want of room
    failed   rows that are no success; seconds: time it took
    """

    points: int
    failed: int = 0
    seconds: float = 0.0
    trouble: str = ""
    full: bool = False


def compute(
    work: Work, index: Whole, folder: str, key: str, max_time: float | None, apart: bool
) -> Outcome:
    """Compute the points with these numbers and write their chunk; `apart` as in Limits."""
    begun = time.monotonic()
    chunks = Path(folder)

    def late(point: int) -> None:
        # The point does not come back: its row is written beside it, and the process ends with it.
        said = f"the point did not come back within max_time = {max_time:g} s; its process was ended"
        with suppress(OSError):
            write_chunk(chunks, key, failed_row(point, len(work.columns), Status.TIMEOUT.value, said))
        os._exit(LATE)

    alone = multiprocessing.parent_process() is not None
    rows = work.compute(index, Limits(max_time, late if alone else None, apart))
    try:
        write_chunk(chunks, key, rows)
    except FullError as error:
        return Outcome(len(index), trouble=str(error), full=True)
    except OSError as error:
        said = f"cannot write a chunk into {folder!r}: {error.strerror or error}."
        return Outcome(len(index), trouble=said)
    return Outcome(len(index), rows.failed, time.monotonic() - begun)


_received: list[Work] = []


def hello(work: Work) -> int:
    """Receive the work, which imports all it needs, and keep it; the number of the process."""
    _received[:] = [work]
    return os.getpid()


def compute_received(
    index: Whole, folder: str, key: str, max_time: float | None, apart: bool
) -> Outcome:
    """`compute` of the work that this process has received: it may be large, and is sent once only."""
    return compute(_received[0], index, folder, key, max_time, apart)


def begin(max_memory: int | None) -> None:
    """Set up a process of the own pool: Ctrl-C is for the driver, and without the driver there is no work."""
    with suppress(ValueError):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    if max_memory is not None:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (max_memory, max_memory))
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_leave_with, args=(parent.sentinel,), daemon=True).start()


def _leave_with(sentinel: int) -> None:
    """End the process when the one that started it is gone."""
    wait([sentinel])
    os._exit(1)
