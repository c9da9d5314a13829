"""Many trajectories of one system in one call: initial mode, then the event loop, one after the other."""

from filippov._kernels.advance import advance
from filippov._kernels.codes import (
    CLOCK_SIZE,
    COUNT_SIZE,
    EVENT_BUDGET,
    EVENTS,
    EVENTS_FULL,
    KINDS,
    REACHED,
    T_END,
    ZENO_ROOM,
    T,
)
from filippov._kernels.language import Indices, Vector, kernel, shift, shift_indices
from filippov._kernels.model import M, N, P, derive
from filippov._kernels.start import begin


@kernel
def ensemble(
    first: int, last: int, clocks: Vector, counts: Indices, xs: Vector, ms: Vector, orders: Indices,
    hits: Indices, lams: Vector, ps: Vector, atol: Vector, stops: Indices, zenos: Vector, events: Vector,
    marks: Indices, codes: Indices, w: Vector, iw: Indices, ctx: Indices,
) -> int:  # fmt: skip
    """Run trajectories first ... last - 1; codes[q] says how each ended, nothing is kept of the way there.

    A trajectory that the compiled path cannot decide ends with GENERAL at the place where it cannot.
    """
    for q in range(first, last):
        clock, count = shift(clocks, q * CLOCK_SIZE), shift_indices(counts, q * COUNT_SIZE)
        x, m, order = shift(xs, q * N), shift(ms, q * M), shift_indices(orders, q * M)
        lam, p = shift(lams, q * M), shift(ps, q * P)
        derive(p)
        direction = 1.0 if clock[T_END] >= clock[T] else -1.0
        code = begin(clock[T], direction, x, p, m, order, lam, w, iw, ctx)
        if code == REACHED:
            code = EVENTS_FULL
        while code == EVENTS_FULL:
            code = advance(
                clock, count, x, m, order, shift_indices(hits, q * M), lam, p, atol,
                shift_indices(stops, q * M * KINDS), shift(zenos, q * M * ZENO_ROOM), w, w, events, marks, w,
                iw, ctx,
            )  # fmt: skip
            if code == EVENTS_FULL:
                count[EVENT_BUDGET] -= count[EVENTS]
                count[EVENTS] = 0
                if count[EVENT_BUDGET] <= 0:
                    break
        codes[q] = code
    return 0
