"""What a worker does: compute a chunk and write it, so that it is kept whatever happens to anyone later."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import wait
from pathlib import Path

from filippov.base.arrays import Whole
from filippov.base.errors import UsageError
from filippov.base.failure import failure
from filippov.base.status import Status
from filippov.sweep.chunk import FullError, write_chunk
from filippov.sweep.rows import ERROR, Limits, Rows, Work, failed_row, joined

LATE = 75  # exit code of a worker whose point did not return


@dataclass(frozen=True)
class ChunkOutcome:
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
    work: Work, index: Whole, folder: str, head: str, max_time: float | None, apart: bool
) -> ChunkOutcome:
    """Compute the points with these numbers and write their chunk.

    head   as in `write_chunk`; apart: as in Limits
    """
    begun = time.monotonic()
    chunks = Path(folder)

    def late(point: int) -> None:
        # The point does not come back: its row is written beside it, and the process ends with it.
        said = f"the point did not come back within max_time = {max_time:g} s; its process was ended"
        with suppress(OSError):
            write_chunk(chunks, head, failed_row(point, len(work.columns), Status.TIMEOUT.value, said))
        os._exit(LATE)

    alone = multiprocessing.parent_process() is not None
    rows = _computed(work, index, Limits(max_time, late if alone else None, apart))
    try:
        write_chunk(chunks, head, rows)
    except FullError as error:
        return ChunkOutcome(len(index), trouble=str(error), full=True)
    except OSError as error:
        said = f"cannot write a chunk into {folder!r}: {error.strerror or error}."
        return ChunkOutcome(len(index), trouble=said)
    return ChunkOutcome(len(index), rows.failed, time.monotonic() - begun)


def _computed(work: Work, index: Whole, limits: Limits) -> Rows:
    """Rows of the points; where they raise they are halved until the point is found that does."""
    try:
        return work.compute(index, limits)
    except MemoryError:
        raise
    except BaseException as error:  # noqa: BLE001  # of a function of the user's, or of what it was given
        said = failure(error)
    if len(index) == 1:
        return failed_row(int(index[0]), len(work.columns), ERROR, said)
    half, alone = len(index) // 2, replace(limits, apart=True)
    return joined([_computed(work, part, alone) for part in (index[:half], index[half:])])


_received: list[Work] = []


def hello(work: Work) -> int:
    """Receive the work, which imports all it needs, and keep it; the number of the process."""
    _received[:] = [work]
    return os.getpid()


def compute_received(
    index: Whole, folder: str, head: str, max_time: float | None, apart: bool
) -> ChunkOutcome:
    """`compute` of the work that this process has received: it may be large, and is sent once only."""
    return compute(_received[0], index, folder, head, max_time, apart)


def begin(max_memory: int | None) -> None:
    """Set up a process of the own pool: Ctrl-C is for the driver, and without the driver there is no work."""
    with suppress(ValueError):
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    if max_memory is not None:
        limit_memory(max_memory)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_leave_with, args=(parent.sentinel,), daemon=True).start()


def limit_memory(most: int) -> None:
    """Let this process have at most so many bytes of address space, or fewer where fewer were allowed it."""
    import resource

    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


def check_memory_limit(most: int | None) -> None:
    """Raise UsageError for a limit on a system that keeps none."""
    if most is None:
        return
    system: str = sys.platform
    try:
        import resource  # noqa: F401
    except ImportError:
        missing = f"{system} has no limit on the memory of a process"
    else:
        if system != "darwin":
            return
        missing = "macOS does not keep the limit on the address space of a process"
    raise UsageError(f"max_memory is {most}, but {missing}. Leave it out, and take fewer jobs.")


def _leave_with(sentinel: int) -> None:
    """End the process when the one that started it is gone."""
    wait([sentinel])
    os._exit(1)
