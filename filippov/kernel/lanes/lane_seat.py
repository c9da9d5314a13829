"""A trajectory takes a lane and leaves it: its numbers go in and come back."""

from filippov.kernel.lanes.lane_step import CALLS, DONE, LEFT, REFUSED, TALLIES
from filippov.kernel.language.primitives import Indices, Vector, kernel, shift, truncate
from filippov.kernel.loop.model import (
    CONTACT,
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
from filippov.kernel.tables.codes import (
    CLOCK_SIZE,
    FIELD_CALLS,
    REJECTED,
    RELATIVE,
    STEP,
    STEP_BUDGET,
    STEPS,
    T_END,
    TAKEN,
    T,
)
from filippov.kernel.tables.layout import COLUMNS, LANES


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
    q: int, lane: int, clock: Vector, count: Indices, x: Vector, m: Vector, order: Indices, p: Vector,
    w: Vector, clock_l: Vector, tally_l: Vector, x_l: Vector, m_l: Vector, order_l: Vector, p_l: Vector,
    w_l: Vector, rows: Indices,
) -> None:  # fmt: skip
    """Put trajectory q, in the middle of a segment, into a lane, with its field and guards there."""
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
    rows[lane] = q
