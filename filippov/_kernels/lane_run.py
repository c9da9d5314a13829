"""Many trajectories in lanes: each is led into one, and out of it where it needs the plain loop.

What a lane cannot do (see `lane_step`) the plain loop does for its trajectory, a step or two at a time, until
the trajectory is in the middle of a segment again. A lane whose trajectory has ended takes the next one.
"""

from filippov._kernels.codes import (
    CLOCK_SIZE,
    COUNT_SIZE,
    FIELD_CALLS,
    KINDS,
    REACHED,
    REJECTED,
    RELATIVE,
    STEP,
    STEP_BUDGET,
    STEPS,
    STOPS,
    T_END,
    TAKEN,
    ZENO_ROOM,
    T,
)
from filippov._kernels.ensemble import another
from filippov._kernels.lane_step import CALLS, DONE, FINISHED, LEFT, REFUSED, TALLIES, lane_step
from filippov._kernels.language import (
    Indices,
    Vector,
    call_at,
    claim,
    kernel,
    shift,
    shift_indices,
    truncate,
)
from filippov._kernels.layout import COLUMNS, LANES
from filippov._kernels.model import (
    CONTACT,
    I_SLIDING,
    STAGES,
    W_ATTRACT,
    W_DIRECTION,
    W_END,
    W_G,
    W_GRAZED,
    W_GT,
    W_K,
    W_MULT,
    W_RADIUS,
    W_START,
    W_TOUCH,
    W_Y,
    M,
    N,
    P,
)

# Plain kernels by their addresses: they belong to a unit of their own.
LAUNCH_AT, TURN_AT, OPEN_AT = 0, 1, 2


@kernel
def spread_out(lane: int, n: int, source: Vector, target: Vector) -> None:
    """Numbers of one trajectory into their lane."""
    for i in range(n):
        target[i * LANES + lane] = source[i]


@kernel
def draw_in(lane: int, n: int, source: Vector, target: Vector) -> None:
    """Numbers of one lane into its trajectory."""
    for i in range(n):
        target[i] = source[i * LANES + lane]


@kernel
def settled(clock: Vector, m: Vector, order: Indices) -> bool:
    """Whether a trajectory is in the middle of a segment that lanes can follow."""
    sliding = 0
    for i in range(M):
        if m[i] == 0.0:
            if order[i] != 0:
                return False
            # The guard of a resting contact is its rate: another field than a lane's.
            if CONTACT[i] != 0:
                return False
            sliding += 1
    return sliding <= 1 and clock[RELATIVE] == 0.0 and clock[STEP] > 0.0


@kernel
def vacate(lane: int, clock_l: Vector, m_l: Vector, rows: Indices) -> None:
    """An empty lane goes through the motions with a step of 0."""
    rows[lane] = -1
    clock_l[T_END * LANES + lane] = clock_l[T * LANES + lane]
    for i in range(M):
        m_l[i * LANES + lane] = 1.0 if m_l[i * LANES + lane] == 0.0 else m_l[i * LANES + lane]


@kernel
def leave(
    lane: int, clock: Vector, count: Indices, x: Vector, order: Indices, lam: Vector, w: Vector,
    clock_l: Vector, tally_l: Vector, x_l: Vector, order_l: Vector, w_l: Vector,
) -> None:  # fmt: skip
    """Hand a lane's state and counts back to its trajectory."""
    draw_in(lane, CLOCK_SIZE, clock_l, clock)
    draw_in(lane, N, x_l, x)
    count[FIELD_CALLS] += truncate(tally_l[CALLS * LANES + lane])
    count[STEPS] += truncate(tally_l[DONE * LANES + lane])
    count[REJECTED] += truncate(tally_l[REFUSED * LANES + lane])
    count[STEP_BUDGET] = truncate(tally_l[LEFT * LANES + lane])
    for i in range(M):
        lam[i] = w_l[(W_MULT + i * COLUMNS) * LANES + lane]
        order[i] = truncate(order_l[i * LANES + lane])
    draw_in(lane, M, shift(w_l, W_GRAZED * LANES), shift(w, W_GRAZED))
    if clock[TAKEN] > 0.0:
        # The step is done but for a guard that may have vanished in it.
        draw_in(lane, STAGES * N, shift(w_l, W_K * LANES), shift(w, W_K))
        draw_in(lane, N, shift(w_l, W_Y * LANES), shift(w, W_Y))
        draw_in(lane, M * N, shift(w_l, W_G * LANES), shift(w, W_G))
        draw_in(lane, M, shift(w_l, W_GT * LANES), shift(w, W_GT))
        draw_in(lane, 2 * M, shift(w_l, W_START * LANES), shift(w, W_START))
        draw_in(lane, 2 * M, shift(w_l, W_END * LANES), shift(w, W_END))
        draw_in(lane, 2 * M, shift(w_l, W_RADIUS * LANES), shift(w, W_RADIUS))
        draw_in(lane, M, shift(w_l, W_TOUCH * LANES), shift(w, W_TOUCH))
        draw_in(lane, M, shift(w_l, W_ATTRACT * LANES), shift(w, W_ATTRACT))
        draw_in(lane, M * COLUMNS, shift(w_l, W_MULT * LANES), shift(w, W_MULT))


@kernel
def enter(
    lane: int, clock: Vector, count: Indices, x: Vector, m: Vector, order: Indices, p: Vector, w: Vector,
    clock_l: Vector, tally_l: Vector, x_l: Vector, m_l: Vector, order_l: Vector, p_l: Vector, w_l: Vector,
    rows: Indices,
) -> None:  # fmt: skip
    """Put a trajectory in the middle of a segment into a lane, with its field and guards there."""
    spread_out(lane, CLOCK_SIZE, clock, clock_l)
    spread_out(lane, M, m, m_l)
    for i in range(M):
        order_l[i * LANES + lane] = float(order[i])
    for other in range(LANES):
        # Empty lanes get numbers that the field is at ease with.
        if other == lane or rows[other] < 0:
            spread_out(other, N, x, x_l)
            spread_out(other, P, p, p_l)
    for i in range(TALLIES):
        tally_l[i * LANES + lane] = 0.0
    tally_l[LEFT * LANES + lane] = float(count[STEP_BUDGET])
    spread_out(lane, N, shift(w, W_K), shift(w_l, W_K * LANES))
    spread_out(lane, 2 * M, shift(w, W_START), shift(w_l, W_START * LANES))
    spread_out(lane, 2 * M, shift(w, W_RADIUS), shift(w_l, W_RADIUS * LANES))
    spread_out(lane, M, shift(w, W_TOUCH), shift(w_l, W_TOUCH * LANES))
    spread_out(lane, M, shift(w, W_GRAZED), shift(w_l, W_GRAZED * LANES))
    spread_out(lane, M, shift(w, W_ATTRACT), shift(w_l, W_ATTRACT * LANES))
    spread_out(lane, M * COLUMNS, shift(w, W_MULT), shift(w_l, W_MULT * LANES))
    w_l[W_DIRECTION * LANES + lane] = w[W_DIRECTION]


@kernel
def lane_run(
    last: int, steps: int, queue: Indices, rows: Indices, entries: Indices, clock_l: Vector, tally_l: Vector,
    x_l: Vector, m_l: Vector, order_l: Vector, p_l: Vector, atol_l: Vector, w_l: Vector, iw_l: Indices,
    clocks: Vector, counts: Indices, xs: Vector, ms: Vector, orders: Indices, hits: Indices, lams: Vector,
    ps: Vector, atol: Vector, stops: Indices, zenos: Vector, kinds: Indices, events: Vector, marks: Indices,
    codes: Indices, w: Vector, iw: Indices, ctx: Indices,
) -> int:  # fmt: skip
    """As `ensemble`, in lanes: rows[l] is the trajectory of lane l, -1 for none; it outlives the call.

    Behind them stands what is left of the rows that this thread has taken.
    """
    todo, more = 0, True
    for lane in range(LANES):
        if rows[lane] < 0:
            todo += 1 << lane
    for _ in range(steps):
        for lane in range(LANES):
            if (todo >> lane) & 1 == 0:
                continue
            while True:
                q = rows[lane]
                fresh = q < 0
                if fresh:
                    if more:
                        more = another(last, queue, shift_indices(rows, LANES))
                        q = rows[LANES]
                    if not more:
                        break
                clock, count = shift(clocks, q * CLOCK_SIZE), shift_indices(counts, q * COUNT_SIZE)
                x, m, order = shift(xs, q * N), shift(ms, q * M), shift_indices(orders, q * M)
                lam, p = shift(lams, q * M), shift(ps, q * P)
                code = REACHED
                if fresh:
                    code = call_at(entries[LAUNCH_AT], clock, x, m, order, lam, p, w, iw, ctx)
                else:
                    leave(
                        lane, clock, count, x, order, lam, w, clock_l, tally_l, x_l, order_l, w_l
                    )
                # A fresh trajectory may go into its lane at once; another has a step of the plain loop to do.
                ready, led = fresh and code == REACHED, False
                while code == REACHED:
                    if ready:
                        code = call_at(entries[OPEN_AT], clock, x, p, m, order, atol, w, iw, ctx)
                        led = code == REACHED and settled(clock, m, order)
                        if led or code != REACHED:
                            break
                    ready = True
                    code = call_at(
                        entries[TURN_AT], 1, clock, count, x, m, order, shift_indices(hits, q * M), lam, p,
                        atol, shift_indices(stops, q * M * STOPS), shift(zenos, q * M * ZENO_ROOM),
                        shift_indices(kinds, q * (M * KINDS + 2)), events, marks, w, iw, ctx,
                    )  # fmt: skip
                    if code != -1:
                        break
                    code = REACHED
                if led:
                    enter(
                        lane, clock, count, x, m, order, p, w, clock_l, tally_l, x_l, m_l, order_l, p_l, w_l,
                        rows,
                    )  # fmt: skip
                    rows[lane] = q
                    break
                codes[q] = code
                vacate(lane, clock_l, m_l, rows)
                claim(queue, 1)
        active, sliding = 0, 0
        for lane in range(LANES):
            active += 1 if rows[lane] >= 0 else 0
        for i in range(M * LANES):
            sliding += 1 if m_l[i] == 0.0 else 0
        iw_l[I_SLIDING] = min(sliding, 1)
        if active == 0:
            return 0
        masks = lane_step(clock_l, tally_l, x_l, p_l, m_l, order_l, atol_l, w_l, iw_l, ctx)
        todo = 0
        for lane in range(LANES):
            if rows[lane] < 0:
                todo += 1 << lane if more else 0
            elif (masks >> (FINISHED + lane)) & 1 != 0:
                q = rows[lane]
                leave(
                    lane, shift(clocks, q * CLOCK_SIZE), shift_indices(counts, q * COUNT_SIZE),
                    shift(xs, q * N), shift_indices(orders, q * M), shift(lams, q * M), w, clock_l, tally_l,
                    x_l, order_l, w_l,
                )  # fmt: skip
                codes[q] = REACHED
                vacate(lane, clock_l, m_l, rows)
                claim(queue, 1)
                todo += 1 << lane
            elif (masks >> lane) & 1 != 0:
                todo += 1 << lane
    return 1
