"""One trajectory of an ensemble in the plain loop: its budget, and its events counted instead of kept."""

from filippov.kernel.language.primitives import Indices, Vector, kernel
from filippov.kernel.loop.advance import advance
from filippov.kernel.loop.model import M
from filippov.kernel.tables.codes import (
    CHUNK_DONE,
    EVENT_BUDGET,
    EVENT_ROOM,
    EVENTS,
    EVENTS_FULL,
    KINDS,
    STEP_BUDGET,
)

# Events that fit into the buffer of one call.
MOST_EVENTS = 64


@kernel
def count_events(count: Indices, kinds: Indices, marks: Indices) -> None:
    """Add the events of a call to the trajectory's numbers of each kind, and forget them.

    Behind the numbers stand the surface and the kind of the last event.
    """
    for q in range(count[EVENTS]):
        surface, kind = marks[q * (2 + 2 * M)], marks[q * (2 + 2 * M) + 1]
        kinds[surface * KINDS + kind] += 1
        kinds[M * KINDS], kinds[M * KINDS + 1] = surface, kind
    count[EVENT_BUDGET] -= count[EVENTS]
    count[EVENTS] = 0


@kernel
def turn(
    steps: int, clock: Vector, count: Indices, x: Vector, m: Vector, order: Indices, hit: Indices,
    lam: Vector, p: Vector, atol: Vector, stop: Indices, zeno: Vector, kinds: Indices, events: Vector,
    marks: Indices, w: Vector, iw: Indices, ctx: Indices,
) -> int:  # fmt: skip
    """At most `steps` steps; a code of `advance`, -1 where steps of the budget are left."""
    left = count[STEP_BUDGET]
    while True:
        give = min(steps, left)
        count[STEP_BUDGET] = give
        count[EVENT_ROOM] = min(MOST_EVENTS, count[EVENT_BUDGET]) + M
        code = advance(
            clock, count, x, m, order, hit, lam, p, atol, stop, zeno, w, w, events, marks, w, iw, ctx
        )
        full = code == EVENTS_FULL
        # How many steps a full buffer cut short is not known; the next call has its budget to itself.
        left = left if full else left - give
        count[STEP_BUDGET] = left
        count_events(count, kinds, marks)
        if not full or count[EVENT_BUDGET] <= 0:
            break
    return -1 if code == CHUNK_DONE and left > 0 else code
