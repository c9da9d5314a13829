"""Many trajectories of one system in one call: initial mode, then the event loop, one after the other."""

from filippov.kernel.language.primitives import Indices, Vector, claim, kernel, shift, shift_indices
from filippov.kernel.loop.model import M, N, P, derive
from filippov.kernel.loop.start import begin
from filippov.kernel.loop.turn import turn
from filippov.kernel.tables.codes import (
    CLOCK_SIZE,
    COUNT_SIZE,
    KINDS,
    REACHED,
    REJECTED,
    STEPS,
    STOPS,
    T_END,
    ZENO_ROOM,
    T,
)


@kernel
def launch(
    clock: Vector, x: Vector, m: Vector, order: Indices, lam: Vector, p: Vector, w: Vector, iw: Indices,
    ctx: Indices,
) -> int:  # fmt: skip
    """What the field takes from the parameters, and the mode at the start of a trajectory."""
    derive(p)
    direction = 1.0 if clock[T_END] >= clock[T] else -1.0
    return begin(clock[T], direction, x, p, m, order, lam, w, iw, ctx)


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


@kernel
def ensemble(
    last: int, steps: int, queue: Indices, mine: Indices, clocks: Vector, counts: Indices, xs: Vector,
    ms: Vector, orders: Indices, hits: Indices, lams: Vector, ps: Vector, atol: Vector, stops: Indices,
    zenos: Vector, kinds: Indices, events: Vector, marks: Indices, codes: Indices, w: Vector, iw: Indices,
    ctx: Indices,
) -> int:  # fmt: skip
    """Run trajectories from the queue until it is empty or about `steps` steps are done; 1 if some are left.

    codes[q] says how each ended, nothing is kept of the way there. A trajectory that the compiled path cannot
    decide ends with GENERAL at the place where it cannot. Threads share the queue (see `another`), queue[1]
    counts the trajectories that are done. mine[0] is the one under way, -1 for none.
    """
    left = steps
    while left > 0:
        q = mine[0]
        fresh = q < 0
        if fresh:
            if not another(last, queue, shift_indices(mine, 1)):
                return 0
            q = mine[1]
            mine[0] = q
        clock, count = shift(clocks, q * CLOCK_SIZE), shift_indices(counts, q * COUNT_SIZE)
        x, m, order = shift(xs, q * N), shift(ms, q * M), shift_indices(orders, q * M)
        lam, p = shift(lams, q * M), shift(ps, q * P)
        code, before = REACHED, count[STEPS] + count[REJECTED]
        if fresh:
            code = launch(clock, x, m, order, lam, p, w, iw, ctx)
        if code == REACHED:
            code = turn(
                left, clock, count, x, m, order, shift_indices(hits, q * M), lam, p, atol,
                shift_indices(stops, q * M * STOPS), shift(zenos, q * M * ZENO_ROOM),
                shift_indices(kinds, q * (M * KINDS + 2)), events, marks, w, iw, ctx,
            )  # fmt: skip
        left -= count[STEPS] + count[REJECTED] - before + 1
        if code != -1:
            codes[q] = code
            mine[0] = -1
            claim(queue, 1)
    return 1
