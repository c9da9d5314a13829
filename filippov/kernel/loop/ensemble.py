"""Many trajectories of one system in one call: initial mode, then the event loop, one after the other.

Each has its budget, and its events are counted instead of kept.
"""

from filippov.kernel.language.primitives import Indices, claim, entry, kernel, shift, shift_indices
from filippov.kernel.language.records import shift_rows
from filippov.kernel.loop.advance import advance
from filippov.kernel.loop.decide import take
from filippov.kernel.loop.land import guard_scale
from filippov.kernel.loop.limit import forget_cycles, remember, rest_in_limit
from filippov.kernel.loop.model import (
    COMPONENT,
    CONTACT,
    EVENT_SIZE,
    HELD,
    RESETS,
    ROLE,
    TICKS,
    WIDTH,
    M,
    N,
    P,
    derive,
)
from filippov.kernel.loop.record import count_down, record_event
from filippov.kernel.loop.resolve import CLEAR_RATE, side_rates
from filippov.kernel.loop.start import begin
from filippov.kernel.loop.state import Trajectories, Trajectory
from filippov.kernel.loop.ticks import aim
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
    ROOT,
    STOPPED,
    STOPS,
    SWITCHING,
    ZENO,
)

# Events that fit into the buffer of one call.
MOST_EVENTS = 64
# Relative to the terms of its rate, the least speed across a surface with which a slide is found to begin
# next to an end of its set; relative to the terms of the guard, the depth of an excursion that is rounding.
SLOWEST, NO_DEPTH = 1e-9, 1e-12


@kernel
def slide_close(run: Trajectory) -> int:
    """AGAIN, or how the run ends, where an event left to the classification begins sliding next to an end of
    Filippov's own set; else GENERAL.

    The solution approaches the surface almost tangentially, by more than rounding, and the field beyond leads
    back: no other mode is consistent. For runs that count their events; one that records them reports the
    margin of the decision (`filippov.solving.diagnosis`).
    """
    clock, m, w, iw, now = run.clock, run.m, run.w, run.iw, run.now
    i, te, length = run.count.surface, now.t_end, now.t_end - now.t
    if TICKS or i < 0 or i >= M:
        return GENERAL
    for j in range(M):
        if (run.trigger[j] != 0) != (j == i):
            return GENERAL
    simple = run.count.cause == ROOT and m[i] != 0.0 and length > 0.0 and iw.coupled[COMPONENT[i]] == 0
    simple = simple and ROLE[i] == SWITCHING and WIDTH[i] == 0.0 and CONTACT[i] == 0 and HELD[i] == 0
    # An event left undecided just now, not one decided before.
    simple = simple and clock.t == te and w.grazed[i] != 0.0
    simple = simple and w.radius[2 * i] == -1.0 and w.radius[2 * i + 1] == 1.0
    if not simple or clock.relative != 0.0 or clock.t_end - te <= clock.same_instant:
        return GENERAL
    code, plus, minus, scale = side_rates(te, w.xe, run.p, m, i, w, iw, run.ctx)
    run.count.field_calls += 2
    arrives = -plus if m[i] > 0.0 else minus
    returns = minus if m[i] > 0.0 else -plus
    turn = abs(w.end[2 * i + 1] - w.start[2 * i + 1]) / length
    # Deeper than an excursion that is rounding (`filippov.solving.state.leading`).
    deep = arrives * arrives > 8.0 * NO_DEPTH * guard_scale(i, te, w.xe, w) * turn
    if code != 0 or not (arrives > SLOWEST * scale and returns > CLEAR_RATE * scale and deep):
        return GENERAL
    run.trigger[i] = 0
    w.grazed[i] = 0.0
    m[i] = 0.0
    run.order[i] = 0
    w.mult[i].value = -(plus + minus) / (plus - minus)
    run.lam[i] = w.mult[i].value
    return take(run, ENTRY)


@kernel
def count_events(run: Trajectory) -> None:
    """Add the events of a call to the trajectory's counts of each kind; only its past keeps them.

    The counts are followed by the surface and the kind of the last event.
    """
    count, kinds, marks = run.count, run.kinds, run.marks
    for q in range(count.events):
        surface, kind = marks[q * (3 + 2 * M)], marks[q * (3 + 2 * M) + 1]
        if run.past.room > 0:
            remember(run.past, run.events[q * EVENT_SIZE], surface, kind == GRAZING)
        if (TICKS or RESETS) and kind >= KINDS:
            if surface >= M:
                continue
            kind = CROSSING_UP if kind == OVER_UP else CROSSING_DOWN
        kinds[surface * KINDS + kind] += 1
        kinds[M * KINDS], kinds[M * KINDS + 1] = surface, kind
    count.event_budget -= count.events
    count.events = 0


@kernel
def settle(run: Trajectory) -> int:
    """AGAIN, or the code of the end, where events accumulate: at rest in their limit, or before it."""
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
            code = EVENTS_FULL  # resumed as after a full buffer
        full = code == EVENTS_FULL
        # The number of steps cut short by a full buffer is not known; the next call has a budget of its own.
        left = left if full else left - give
        count.step_budget = left
        count_events(run)
        if not full or count.event_budget <= 0:
            break
    if TICKS and code == REACHED and count.due > 0:
        return GENERAL
    return -1 if code == CHUNK_DONE and left > 0 else code


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
    """Quantities derived from the parameters, the first instant of time events, the mode at the start."""
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

    Only the end of each is returned, nothing of its course is kept. A trajectory with an event that the
    compiled loop cannot decide ends there with GENERAL. Threads share the queue (see `another`), queue[1]
    counts the trajectories that are done. mine[0] is the one under way, -1 for none.
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
