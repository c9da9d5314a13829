"""One trajectory of an ensemble in the plain loop: its budget, and its events counted instead of kept."""

from filippov.kernel.language.primitives import entry, kernel, shift_indices
from filippov.kernel.loop.advance import advance
from filippov.kernel.loop.decide import slide_close
from filippov.kernel.loop.limit import forget_cycles, remember, rest_in_limit
from filippov.kernel.loop.model import EVENT_SIZE, TICKS, M
from filippov.kernel.loop.record import count_down, record_event
from filippov.kernel.loop.state import Trajectory
from filippov.kernel.tables.codes import (
    AGAIN,
    CHUNK_DONE,
    CROSSING_DOWN,
    CROSSING_UP,
    ENTRY,
    EVENTS_FULL,
    GENERAL,
    GRAZING,
    KINDS,
    LIMIT,
    NONE,
    OVER_UP,
    REACHED,
    STOPPED,
    STOPS,
    ZENO,
)

# Events that fit into the buffer of one call.
MOST_EVENTS = 64


@kernel
def count_events(run: Trajectory) -> None:
    """Add the events of a call to the trajectory's numbers of each kind; only its past remembers them.

    Behind the numbers stand the surface and the kind of the last event.
    """
    count, kinds, marks = run.count, run.kinds, run.marks
    for q in range(count.events):
        surface, kind = marks[q * (3 + 2 * M)], marks[q * (3 + 2 * M) + 1]
        if run.past.room > 0:
            remember(run.past, run.events[q * EVENT_SIZE], surface, kind == GRAZING)
        if TICKS and kind >= KINDS:
            if surface >= M:
                continue
            kind = CROSSING_UP if kind == OVER_UP else CROSSING_DOWN
        kinds[surface * KINDS + kind] += 1
        kinds[M * KINDS], kinds[M * KINDS + 1] = surface, kind
    count.event_budget -= count.events
    count.events = 0


@kernel
def settle(run: Trajectory) -> int:
    """AGAIN, or how the run ends, where its events accumulate: at rest in their limit, or not there yet."""
    clock, now, i = run.clock, run.now, run.count.surface
    found = rest_in_limit(run)
    if found == NONE:
        forget_cycles(run)
        return AGAIN
    if found != ENTRY:
        return LIMIT if found == LIMIT else ZENO
    now.t_end, now.surface, now.residual, now.multiplier = clock.t, i, 0.0, run.lam[i]
    record_event(run, ENTRY)
    return STOPPED if count_down(shift_indices(run.stop, STOPS * i), ENTRY) != 0 else AGAIN


@entry
@kernel
def time_slice(steps: int, run: Trajectory) -> int:
    """At most `steps` steps; a code of `advance`, -1 where steps of the budget are left."""
    count = run.count
    left = count.step_budget
    while True:
        give = min(steps, left)
        count.step_budget = give
        count.event_room = min(MOST_EVENTS, count.event_budget) + M
        code = advance(run)
        if code == GENERAL:
            code = slide_close(run)
        if code == ZENO and run.past.room > 0:
            count_events(run)
            code = settle(run)
        if code == AGAIN:
            code = EVENTS_FULL  # it goes on as after a full buffer
        full = code == EVENTS_FULL
        # How many steps a full buffer cut short is not known; the next call has its budget to itself.
        left = left if full else left - give
        count.step_budget = left
        count_events(run)
        if not full or count.event_budget <= 0:
            break
    if TICKS and code == REACHED and count.due > 0:
        return GENERAL
    return -1 if code == CHUNK_DONE and left > 0 else code
