"""Many trajectories in lanes: each enters one, and leaves it where it needs the plain loop.

What a lane cannot do (see `lane_step`) the plain loop does for its trajectory, a step or two at a time, until
the trajectory is in the middle of a segment again. There are two groups of lanes, for trajectories that slide
and for those that do not: sliding takes two field calls per stage, which the others would pay for. A
trajectory whose group is full waits; a free lane takes a waiting one, or the next from the queue. The result
of a trajectory is the same, to the last bit, whatever its neighbours are.
"""

from filippov.kernel.lanes.lane_slot import enter, leave, release, settled
from filippov.kernel.lanes.lane_step import FINISHED, lane_step
from filippov.kernel.language.primitives import (
    Indices,
    Vector,
    call_at,
    claim,
    entry,
    kernel,
    shift_indices,
)
from filippov.kernel.language.records import Rows
from filippov.kernel.loop.ensemble import another, take_row
from filippov.kernel.loop.model import TICKS, M
from filippov.kernel.loop.state import Entries, Group, Integers, Past, Trajectories, Trajectory
from filippov.kernel.tables.codes import GO_ON, REACHED
from filippov.kernel.tables.layout import LANES

# In `rows`: the rest of the trajectories that the thread has taken, the numbers waiting for either group, the
# one in each lane of both groups, and the waiting ones, with what they have grazed: room for 3 LANES each,
# since no more are under way when the queue is read only while fewer than LANES wait. Then the number of
# pasts in use and, from that place on, the free ones.
TAKEN_AT, WAITING_AT, LANES_AT = 0, 2, 4


@kernel
def drive(fresh: bool, entries: Entries, run: Trajectory) -> int:
    """Advance a trajectory by the plain loop to the middle of a segment: -1, or the code of its end."""
    ready = fresh
    if fresh:
        begun = call_at(entries.launch, run)
        if begun != REACHED:
            return begun
    while True:
        # A fresh trajectory may enter a lane at once; another needs a step of the plain loop first.
        if not ready:
            code = call_at(entries.time_slice, 1, run)
            if code != -1:
                return code
        ready = False
        opened = call_at(entries.open_segment, run)
        if opened >= 0:
            return opened
        if opened == GO_ON:
            # Its step is known from here on, however short: one that is stuck would begin again with a first
            # step, until its budget is used up.
            run.count.cut = 1
            if settled(run.clock, run.m, run.order):
                return -1


@kernel
def slides(m: Vector) -> int:
    """The group of a trajectory: 1 where it slides."""
    for i in range(M):
        if m[i] == 0.0:
            return 1
    return 0


@kernel
def place_of(group: int, number: int) -> int:
    """The place in `rows` of the n-th trajectory that waits for a group."""
    return LANES_AT + 2 * LANES + (group * 3 * LANES + number) * (1 + M)


@kernel
def wait(group: int, run: Trajectory, rows: Indices) -> None:
    """Let a trajectory wait for a lane of its group."""
    place = place_of(group, rows[WAITING_AT + group])
    rows[place] = run.number
    for i in range(M):
        rows[place + 1 + i] = 1 if run.w.grazed[i] > 0.0 else 0
    rows[WAITING_AT + group] += 1


@kernel
def take_up_row(q: int, pasts: Rows[Past], batch: Trajectories, run: Trajectory) -> None:
    """Let `run` be trajectory q, with its past."""
    take_row(q, batch, run)
    run.past = pasts[run.count.past]


@kernel
def begin_row(q: int, rows: Indices, pasts: Rows[Past], batch: Trajectories, run: Trajectory) -> None:
    """Let `run` be trajectory q, with an empty past of its own."""
    taken = place_of(2, 0)
    take_row(q, batch, run)
    run.count.past = rows[taken + 1 + rows[taken]]
    rows[taken] += 1
    run.past = pasts[run.count.past]
    run.past.count = 0


@kernel
def end_row(code: int, rows: Indices, batch: Trajectories, run: Trajectory) -> None:
    """Note the end of a trajectory."""
    taken = place_of(2, 0)
    rows[taken] -= 1
    rows[taken + 1 + rows[taken]] = run.count.past
    batch.codes[run.number] = code
    claim(batch.queue, 1)


@kernel
def recall(
    group: int, rows: Indices, entries: Entries, pasts: Rows[Past], batch: Trajectories, run: Trajectory
) -> None:  # fmt: skip
    """Resume the trajectory that has waited least for a group, with its field and its guards."""
    rows[WAITING_AT + group] -= 1
    place = place_of(group, rows[WAITING_AT + group])
    take_up_row(rows[place], pasts, batch, run)
    call_at(entries.open_segment, run)
    run.count.cut = 1
    for i in range(M):
        run.w.grazed[i] = 1.0 if rows[place + 1 + i] != 0 else 0.0


@kernel
def fetch(
    last: int, rows: Indices, entries: Entries, pasts: Rows[Past], batch: Trajectories, run: Trajectory
) -> int:  # fmt: skip
    """Take up the next trajectory that does not slide from the queue: 1, 0 (too many wait) or -1 (none)."""
    while rows[WAITING_AT + 1] < LANES:
        if not another(last, batch.queue, shift_indices(rows, TAKEN_AT)):
            return -1
        begin_row(rows[TAKEN_AT], rows, pasts, batch, run)
        code = drive(True, entries, run)
        if code != -1:
            end_row(code, rows, batch, run)
        elif slides(run.m) == 1:
            wait(1, run, rows)
        else:
            return 1
    return 0


@kernel
def fill(
    group: int, empty: int, last: int, rows: Indices, entries: Entries, lanes_of: Group, pasts: Rows[Past],
    batch: Trajectories, run: Trajectory,
) -> int:  # fmt: skip
    """Fill empty lanes of a group with waiting trajectories, or from the queue; how many remain.

    Negative: the queue is at its end, and -1 - result lanes remain empty.
    """
    own, lane, more = shift_indices(rows, LANES_AT + group * LANES), 0, last > 0
    while empty > 0:
        found = 0
        if rows[WAITING_AT + group] > 0:
            recall(group, rows, entries, pasts, batch, run)
            found = 1
        elif group == 0 and more:
            found = fetch(last, rows, entries, pasts, batch, run)
            more = found >= 0
        if found <= 0:
            break
        while own[lane] >= 0:
            lane += 1
        enter(lane, run, lanes_of, own)
        empty -= 1
    return empty if more else -1 - empty


@kernel
def empty_in(group: int, rows: Indices) -> int:
    """The number of empty lanes of a group."""
    empty = 0
    for lane in range(LANES):
        empty += 1 if rows[LANES_AT + group * LANES + lane] < 0 else 0
    return empty


@kernel
def put_off(
    group: int,
    masks: int,
    rows: Indices,
    entries: Entries,
    lanes_of: Group,
    pasts: Rows[Past],
    batch: Trajectories,
    run: Trajectory,
) -> int:
    """Take trajectories at their end, or in need of the plain loop, out of their lanes; how many."""
    own, left = shift_indices(rows, LANES_AT + group * LANES), 0
    for lane in range(LANES):
        q = own[lane]
        finished = (masks >> (FINISHED + lane)) & 1 != 0
        if q < 0 or not (finished or (masks >> lane) & 1 != 0):
            continue
        take_up_row(q, pasts, batch, run)
        leave(lane, run, lanes_of)
        code, next_group = REACHED, group
        # At an instant of time events the plain loop takes over.
        if not finished or (TICKS and run.count.due > 0):
            code = drive(False, entries, run)
            if code == -1:
                next_group = slides(run.m)
        if code == -1 and next_group == group:
            enter(lane, run, lanes_of, own)
            continue
        if code == -1:
            wait(next_group, run, rows)
        else:
            end_row(code, rows, batch, run)
        release(lane, lanes_of, own)
        left += 1
    return left


@entry
@kernel
def lane_run(
    last: int, steps: int, rows: Indices, entries: Entries, groups: Rows[Group], iw_l: Integers,
    pasts: Rows[Past], batch: Trajectories, run: Trajectory,
) -> int:  # fmt: skip
    """As `ensemble`, in lanes; the state between calls is in `rows`."""
    open_to, free, sliding = last, empty_in(0, rows), empty_in(1, rows)
    for _ in range(steps):
        if sliding > 0:
            sliding = fill(1, sliding, last, rows, entries, groups[1], pasts, batch, run)
        if free > 0:
            free = fill(0, free, open_to, rows, entries, groups[0], pasts, batch, run)
            if free < 0:
                open_to, free = 0, -1 - free
        if free == LANES and sliding == LANES and rows[WAITING_AT + 1] == 0:
            return 0
        # The group with more to do; a full one need not wait for more.
        group = 1 if sliding == 0 or sliding < free else 0
        iw_l.sliding = group
        masks = lane_step(groups[group], iw_l, run.ctx)
        if masks != 0:
            left = put_off(group, masks, rows, entries, groups[group], pasts, batch, run)
            sliding += left if group == 1 else 0
            free += left if group == 0 else 0
    return 1
