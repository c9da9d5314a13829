"""Many trajectories in lanes: each is led into one, and out of it where it needs the plain loop.

What a lane cannot do (see `lane_step`) the plain loop does for its trajectory, a step or two at a time, until
the trajectory is in the middle of a segment again. There are two groups of lanes, for trajectories that slide
and for those that do not: sliding takes two fields a stage, and the others would pay for it. A trajectory
whose group is full waits; a lane that is left takes one that waits, or the next from the queue. So a
trajectory goes the same way, to the last bit, whoever its neighbours are.
"""

from filippov.kernel.lanes.lane_seat import enter, leave, settled, vacate
from filippov.kernel.lanes.lane_step import FINISHED, lane_step
from filippov.kernel.language.primitives import Indices, Vector, call_at, claim, kernel, shift, shift_indices
from filippov.kernel.loop.ensemble import another
from filippov.kernel.loop.model import I_SLIDING, W_GRAZED, M, N, P
from filippov.kernel.tables.codes import CLOCK_SIZE, COUNT_SIZE, KINDS, REACHED, STOPS, ZENO_ROOM
from filippov.kernel.tables.layout import LANES

# Plain kernels by their addresses: they belong to a unit of their own. Behind them the size of a group.
LAUNCH_AT, TURN_AT, OPEN_AT, STRIDE_AT = 0, 1, 2, 3
# In `rows`: what is left of the trajectories that the thread has taken, how many wait for either group, the
# one in each lane of both groups, and the ones that wait, with what they have grazed: room for 3 LANES each,
# since no more are under way when the queue is asked only while fewer than LANES wait.
TAKEN_AT, WAITING_AT, LANES_AT = 0, 2, 4


@kernel
def drive(
    q: int, fresh: bool, entries: Indices, clocks: Vector, counts: Indices, xs: Vector, ms: Vector,
    orders: Indices, hits: Indices, lams: Vector, ps: Vector, atol: Vector, stops: Indices, zenos: Vector,
    kinds: Indices, events: Vector, marks: Indices, w: Vector, iw: Indices, ctx: Indices,
) -> int:  # fmt: skip
    """Take trajectory q by the plain loop to the middle of a segment: -1, or the code of its end."""
    clock, count = shift(clocks, q * CLOCK_SIZE), shift_indices(counts, q * COUNT_SIZE)
    x, m, order = shift(xs, q * N), shift(ms, q * M), shift_indices(orders, q * M)
    lam, p = shift(lams, q * M), shift(ps, q * P)
    ready = fresh
    if fresh:
        begun = call_at(entries[LAUNCH_AT], clock, x, m, order, lam, p, w, iw, ctx)
        if begun != REACHED:
            return begun
    while True:
        # A fresh trajectory may go into a lane at once; another has a step of the plain loop to do.
        if not ready:
            code = call_at(
                entries[TURN_AT], 1, clock, count, x, m, order, shift_indices(hits, q * M), lam, p, atol,
                shift_indices(stops, q * M * STOPS), shift(zenos, q * M * ZENO_ROOM),
                shift_indices(kinds, q * (M * KINDS + 2)), events, marks, w, iw, ctx,
            )  # fmt: skip
            if code != -1:
                return code
        ready = False
        opened = call_at(entries[OPEN_AT], clock, x, p, m, order, atol, w, iw, ctx)
        if opened != REACHED:
            return opened
        if settled(clock, m, order):
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
    """Where in `rows` the one stands that waits for a group under a number."""
    return LANES_AT + 2 * LANES + (group * 3 * LANES + number) * (1 + M)


@kernel
def wait(q: int, group: int, w: Vector, rows: Indices) -> None:
    """Trajectory q waits for a lane of its group."""
    place = place_of(group, rows[WAITING_AT + group])
    rows[place] = q
    for i in range(M):
        rows[place + 1 + i] = 1 if w[W_GRAZED + i] > 0.0 else 0
    rows[WAITING_AT + group] += 1


@kernel
def reopen(
    q: int, grazed: Indices, entries: Indices, clocks: Vector, xs: Vector, ms: Vector, orders: Indices,
    ps: Vector, atol: Vector, w: Vector, iw: Indices, ctx: Indices,
) -> None:  # fmt: skip
    """The field and the guards of trajectory q where it has waited."""
    call_at(
        entries[OPEN_AT], shift(clocks, q * CLOCK_SIZE), shift(xs, q * N), shift(ps, q * P),
        shift(ms, q * M), shift_indices(orders, q * M), atol, w, iw, ctx,
    )  # fmt: skip
    for i in range(M):
        w[W_GRAZED + i] = 1.0 if grazed[i] != 0 else 0.0


@kernel
def lane_run(
    last: int, steps: int, queue: Indices, rows: Indices, entries: Indices, clock_l: Vector, tally_l: Vector,
    x_l: Vector, m_l: Vector, order_l: Vector, p_l: Vector, atol_l: Vector, w_l: Vector, iw_l: Indices,
    clocks: Vector, counts: Indices, xs: Vector, ms: Vector, orders: Indices, hits: Indices, lams: Vector,
    ps: Vector, atol: Vector, stops: Indices, zenos: Vector, kinds: Indices, events: Vector, marks: Indices,
    codes: Indices, w: Vector, iw: Indices, ctx: Indices,
) -> int:  # fmt: skip
    """As `ensemble`, in lanes; what is under way outlives the call in `rows`."""
    stride, more = entries[STRIDE_AT], True
    free, sliding = 0, 0
    for lane in range(LANES):
        free += 1 if rows[LANES_AT + lane] < 0 else 0
        sliding += 1 if rows[LANES_AT + LANES + lane] < 0 else 0
    for _ in range(steps):
        # Empty lanes are filled: those of sliding trajectories by who waits, the others also from the queue.
        for turn_of in range(2):
            group = 1 - turn_of
            empty = sliding if group == 1 else free
            shifted, lane, own = group * stride, 0, shift_indices(rows, LANES_AT + group * LANES)
            while empty > 0:
                if rows[WAITING_AT + group] > 0:
                    rows[WAITING_AT + group] -= 1
                    place = place_of(group, rows[WAITING_AT + group])
                    q, grazed = rows[place], shift_indices(rows, place + 1)
                    reopen(q, grazed, entries, clocks, xs, ms, orders, ps, atol, w, iw, ctx)
                elif group == 0 and more and rows[WAITING_AT + 1] < LANES:
                    more = another(last, queue, shift_indices(rows, TAKEN_AT))
                    if not more:
                        break
                    q = rows[TAKEN_AT]
                    code = drive(
                        q, True, entries, clocks, counts, xs, ms, orders, hits, lams, ps, atol, stops, zenos,
                        kinds, events, marks, w, iw, ctx,
                    )  # fmt: skip
                    if code != -1:
                        codes[q] = code
                        claim(queue, 1)
                        continue
                    if slides(shift(ms, q * M)) == 1:
                        wait(q, 1, w, rows)
                        continue
                else:
                    break
                while own[lane] >= 0:
                    lane += 1
                enter(
                    q, lane, shift(clocks, q * CLOCK_SIZE), shift_indices(counts, q * COUNT_SIZE),
                    shift(xs, q * N), shift(ms, q * M), shift_indices(orders, q * M), shift(ps, q * P), w,
                    shift(clock_l, shifted), shift(tally_l, shifted), shift(x_l, shifted),
                    shift(m_l, shifted), shift(order_l, shifted), shift(p_l, shifted), shift(w_l, shifted),
                    own,
                )  # fmt: skip
                empty -= 1
            if group == 1:
                sliding = empty
            else:
                free = empty
        if free == LANES and sliding == LANES and rows[WAITING_AT + 1] == 0:
            return 0
        # The group that has more to do; one that is full need not wait for more.
        group = 1 if sliding == 0 or sliding < free else 0
        iw_l[I_SLIDING] = group
        shifted = group * stride
        clock_g, tally_g, x_g = shift(clock_l, shifted), shift(tally_l, shifted), shift(x_l, shifted)
        m_g, order_g, w_g = shift(m_l, shifted), shift(order_l, shifted), shift(w_l, shifted)
        p_g, own = shift(p_l, shifted), shift_indices(rows, LANES_AT + group * LANES)
        masks = lane_step(
            clock_g, tally_g, x_g, p_g, m_g, order_g, shift(atol_l, shifted), w_g, iw_l, ctx
        )
        left = 0
        for lane in range(LANES):
            q = own[lane]
            finished = (masks >> (FINISHED + lane)) & 1 != 0
            if q < 0 or not (finished or (masks >> lane) & 1 != 0):
                continue
            leave(
                lane, shift(clocks, q * CLOCK_SIZE), shift_indices(counts, q * COUNT_SIZE), shift(xs, q * N),
                shift_indices(orders, q * M), shift(lams, q * M), w, clock_g, tally_g, x_g, order_g, w_g,
            )  # fmt: skip
            code, next_group = REACHED, group
            if not finished:
                code = drive(
                    q, False, entries, clocks, counts, xs, ms, orders, hits, lams, ps, atol, stops, zenos,
                    kinds, events, marks, w, iw, ctx,
                )  # fmt: skip
                if code == -1:
                    next_group = slides(shift(ms, q * M))
            if code == -1 and next_group == group:
                enter(
                    q, lane, shift(clocks, q * CLOCK_SIZE), shift_indices(counts, q * COUNT_SIZE),
                    shift(xs, q * N), shift(ms, q * M), shift_indices(orders, q * M), shift(ps, q * P), w,
                    clock_g, tally_g, x_g, m_g, order_g, p_g, w_g, own,
                )  # fmt: skip
                continue
            if code == -1:
                wait(q, next_group, w, rows)
            else:
                codes[q] = code
                claim(queue, 1)
            vacate(lane, clock_g, m_g, own)
            left += 1
        if group == 1:
            sliding += left
        else:
            free += left
    return 1
