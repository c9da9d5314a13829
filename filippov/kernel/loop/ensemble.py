"""Many trajectories of one system in one call: initial mode, then the event loop, one after the other."""

from filippov.kernel.language.primitives import Indices, claim, entry, kernel, shift, shift_indices
from filippov.kernel.language.records import shift_rows
from filippov.kernel.loop.model import TICKS, M, N, P, derive
from filippov.kernel.loop.start import begin
from filippov.kernel.loop.state import Trajectories, Trajectory
from filippov.kernel.loop.ticks import aim
from filippov.kernel.loop.time_slice import time_slice
from filippov.kernel.tables.codes import KINDS, REACHED, STOPS


@kernel
def take_row(q: int, batch: Trajectories, run: Trajectory) -> None:
    """Let `run` be trajectory q of a batch; scratch, tolerances and buffers are its own."""
    run.number = q
    run.clock, run.count = batch.clocks[q], batch.counts[q]
    run.x, run.m, run.order = (
        shift(batch.xs, q * N),
        shift(batch.ms, q * M),
        shift_indices(batch.orders, q * M),
    )
    run.trigger, run.lam, run.p = (
        shift_indices(batch.triggers, q * M),
        shift(batch.lams, q * M),
        shift(batch.ps, q * P),
    )
    run.stop, run.zeno = shift_indices(batch.stops, q * M * STOPS), shift_rows(batch.zenos, q * M)
    run.kinds = shift_indices(batch.kinds, q * (M * KINDS + 2))
    run.limit = shift(batch.limits, q * (3 + N))
    if TICKS:
        run.ticks = shift_rows(batch.ticks, q * run.count.ticks)


@entry
@kernel
def launch(run: Trajectory) -> int:
    """What the field takes from the parameters, the first instant, and the mode at the start."""
    derive(run.p)
    if TICKS:
        aim(run)
    return begin(run)


@kernel
def another(last: int, queue: Indices, mine: Indices) -> bool:
    """Whether one of `last` trajectories is left: mine[0] is its number.

    A thread takes queue[2] of them at a time, neighbours in memory: on a cache line that two threads write to
    each waits for the other. queue[0] counts what has been taken, mine[1] is the end of its part.
    """
    mine[0] += 1
    if mine[0] >= mine[1]:
        mine[0] = claim(queue, 0) * queue[2]
        mine[1] = min(mine[0] + queue[2], last)
    return float(mine[1] - mine[0]) > 0.0


@entry
@kernel
def ensemble(last: int, steps: int, mine: Indices, batch: Trajectories, run: Trajectory) -> int:
    """Run trajectories from the queue until it is empty or about `steps` steps are done; 1 if some are left.

    Of each only how it ended is told, nothing is kept of the way there. A trajectory that the compiled path
    cannot decide ends with GENERAL at the place where it cannot. Threads share the queue (see `another`),
    queue[1] counts the trajectories that are done. mine[0] is the one under way, -1 for none.
    """
    left, queue = steps, batch.queue
    while left > 0:
        q = mine[0]
        fresh = q < 0
        if fresh:
            if not another(last, queue, shift_indices(mine, 1)):
                return 0
            q = mine[1]
            mine[0] = q
        take_row(q, batch, run)
        code, before = REACHED, run.count.steps + run.count.rejected
        if fresh:
            run.past.count = 0
            code = launch(run)
        if code == REACHED:
            code = time_slice(left, run)
        left -= run.count.steps + run.count.rejected - before + 1
        if code != -1:
            batch.codes[q] = code
            mine[0] = -1
            claim(queue, 1)
    return 1
