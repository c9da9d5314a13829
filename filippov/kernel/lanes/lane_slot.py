"""Entering and leaving a lane: copying the numbers of a trajectory."""

from filippov.kernel.lanes.lane_field import uncoupled
from filippov.kernel.language.primitives import Indices, Vector, kernel, truncate
from filippov.kernel.language.records import Lanes, all_of, size_of
from filippov.kernel.loop.model import CONTACT, DECAYING, JETS, LAST, SERIES, STAGES, TAILS, M, N, P
from filippov.kernel.loop.state import Clock, Group, Scratch, Trajectory
from filippov.kernel.tables.layout import LANES


@kernel
def spread_out(lane: int, n: int, source: Vector, target: Vector) -> None:
    """Copy numbers of one trajectory into its lane."""
    for i in range(n):
        target[i * LANES + lane] = source[i]


@kernel
def draw_in(lane: int, n: int, source: Vector, target: Vector) -> None:
    """Copy numbers of one lane into its trajectory."""
    for i in range(n):
        target[i] = source[i * LANES + lane]


@kernel
def settled(clock: Clock, m: Vector, order: Indices) -> bool:
    """Whether a trajectory is in the middle of a segment that lanes can follow."""
    sliding = 0
    for i in range(M):
        if m[i] == 0.0:
            if order[i] != 0:
                return False
            # The guard of a resting contact is its rate, which lanes do not compute.
            if CONTACT[i] != 0:
                return False
            sliding += 1
    several = sliding > 1 and (SERIES or uncoupled() == 0)
    return not several and clock.relative == 0.0 and clock.step > 0.0


@kernel
def release(lane: int, group: Group, rows: Indices) -> None:
    """Mark a lane as empty: it takes steps of length 0."""
    clock, m = group.clock, group.m
    rows[lane] = -1
    clock.t_end[lane] = clock.t[lane]
    for i in range(M):
        m[i * LANES + lane] = 1.0 if m[i * LANES + lane] == 0.0 else m[i * LANES + lane]


@kernel
def leave_series(lane: int, run: Trajectory, w_l: Lanes[Scratch]) -> None:
    """Hand over the coefficients of a lane's step, and where they were taken."""
    w, origin = run.w, run.w.origin
    draw_in(lane, (STAGES - 1) * JETS, w_l.jet, w.jet)
    if TAILS > 0:
        draw_in(lane, 2 * LAST * TAILS + DECAYING * (STAGES - 1), w_l.jet_room, w.jet_room)
    draw_in(lane, N, w_l.jet_end, w.jet_end)
    draw_in(lane, N, w_l.miss, w.miss)
    w.checked, w.explicit = w_l.checked[lane], 0.0
    origin.t = run.clock.t
    for j in range(N):
        origin.x[j] = run.x[j]
    for i in range(M):
        origin.m[i] = run.m[i]


@kernel
def leave(lane: int, run: Trajectory, group: Group) -> None:
    """Hand a lane's state and counts back to its trajectory."""
    clock, count, w, tally, w_l = run.clock, run.count, run.w, group.tally, group.w
    draw_in(lane, size_of(clock), all_of(group.clock), all_of(clock))
    draw_in(lane, N, group.x, run.x)
    count.field_calls += truncate(tally.calls[lane])
    count.steps += truncate(tally.done[lane])
    count.rejected += truncate(tally.refused[lane])
    count.step_budget = truncate(tally.left[lane])
    for i in range(M):
        run.lam[i] = w_l.mult[i].value[lane]
        run.order[i] = truncate(group.order[i * LANES + lane])
    draw_in(lane, M, w_l.grazed, w.grazed)
    if clock.taken > 0.0:
        # The step is complete except for a guard that may have vanished in it.
        draw_in(lane, STAGES * N, w_l.k, w.k)
        draw_in(lane, N, w_l.y, w.y)
        draw_in(lane, M * N, w_l.g, w.g)
        draw_in(lane, M, w_l.gt, w.gt)
        draw_in(lane, 2 * M, w_l.start, w.start)
        draw_in(lane, 2 * M, w_l.end, w.end)
        draw_in(lane, 2 * M, w_l.radius, w.radius)
        draw_in(lane, M, w_l.touch, w.touch)
        draw_in(lane, M, w_l.attract, w.attract)
        if SERIES:
            leave_series(lane, run, w_l)
        for i in range(M):
            draw_in(lane, size_of(w.mult[i]), all_of(w_l.mult[i]), all_of(w.mult[i]))


@kernel
def enter(lane: int, run: Trajectory, group: Group, rows: Indices) -> None:
    """Put a trajectory, in the middle of a segment, into a lane, with its field and guards there."""
    w, tally, w_l = run.w, group.tally, group.w
    spread_out(lane, size_of(run.clock), all_of(run.clock), all_of(group.clock))
    spread_out(lane, M, run.m, group.m)
    for i in range(M):
        group.order[i * LANES + lane] = float(run.order[i])
    spread_out(lane, N, run.x, group.x)
    if rows[lane] != run.number:
        spread_out(lane, P, run.p, group.p)
        for other in range(LANES):
            # Empty lanes get numbers at which the field is defined.
            if rows[other] < 0:
                spread_out(other, N, run.x, group.x)
                spread_out(other, P, run.p, group.p)
    tally.left[lane] = float(run.count.step_budget)
    tally.calls[lane], tally.done[lane], tally.refused[lane] = 0.0, 0.0, 0.0
    spread_out(lane, N, w.k, w_l.k)
    spread_out(lane, 2 * M, w.start, w_l.start)
    spread_out(lane, 2 * M, w.radius, w_l.radius)
    spread_out(lane, M, w.touch, w_l.touch)
    spread_out(lane, M, w.grazed, w_l.grazed)
    spread_out(lane, M, w.attract, w_l.attract)
    for i in range(M):
        spread_out(lane, size_of(w.mult[i]), all_of(w.mult[i]), all_of(w_l.mult[i]))
    w_l.direction[lane] = w.direction
    rows[lane] = run.number
