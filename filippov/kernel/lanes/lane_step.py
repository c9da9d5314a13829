"""One step of several trajectories side by side, each with its own time, step, mode and tolerance.

A lane advances where its step is accepted and no guard can have vanished in it; its step is shortened where
it is rejected. Everything else (an event, or what may be one; an invalid stage; a step too small) is reported
to the caller, and the lane is left as it was.
"""

from filippov.kernel.lanes.lane_field import uncoupled
from filippov.kernel.lanes.lane_series import (
    root_of_inverse,
    series_error,
    series_length,
    series_may_vanish,
    series_stages,
)
from filippov.kernel.language.primitives import (
    Indices,
    Vector,
    anywhere,
    lanes,
    mask_bits,
    shift,
)
from filippov.kernel.language.records import side_by_side
from filippov.kernel.loop.control import (
    MANY_STAGES,
    error_norm,
    finite,
    guard_state,
    least_step,
    leaves,
)
from filippov.kernel.loop.field import clear_ranges, field, project
from filippov.kernel.loop.model import (
    ALL_LINEAR,
    END_IN_ERROR,
    G_COLUMN,
    G_FIRST,
    LINEAR,
    MOVING,
    ORDER,
    SERIES,
    STAGES,
    STRAIGHT,
    WIDTH,
    M,
    N,
    free_stages,
    lane_jets,
    sliding_stages,
)
from filippov.kernel.loop.search import FALLING, LATE, ROUNDED
from filippov.kernel.loop.state import Group, Integers, Scratch
from filippov.kernel.tables.layout import EPS

# The second mask of the result is above the first.
FINISHED = 32
THIRD = 0.3333333333333333


@lanes
def step_factor(square: float) -> float:
    """0.9 error**(-1/order) from the square of the error; see `control.step_factor`."""
    return 0.9 * root_of_inverse(square, 2 * ORDER)


@lanes
def bent(w: Scratch) -> bool:
    """Where the field differs between the stages; see `control.uniform`."""
    change = 0.0
    for a in range(N, (STAGES - 1) * N):
        change = max(change, abs(w.k[a] - w.k[a % N]))
    return change > 0.0


@lanes
def may_vanish(step: float, m: Vector, order: Vector, w: Scratch, iw: Integers) -> bool:
    """Where a guard may have vanished in the step; see `control.suspicious`."""
    doubt, several, line = 0.0, 0.0, 0.0
    if iw.sliding > 0 and uncoupled() == 1:
        for i in range(M):
            several += 1.0 if m[i] == 0.0 else 0.0
        line = 0.0 if bent(w) else 1.0
    for i in range(M):
        h0, h1 = m[i] * w.start[2 * i] + WIDTH[i], m[i] * w.end[2 * i] + WIDTH[i]
        d0, d1 = m[i] * w.start[2 * i + 1] * step, m[i] * w.end[2 * i + 1] * step
        bend = abs(h1 - h0 - d0) + abs(2.0 * (h1 - h0) - d0 - d1)
        least = min(h0, h1, h0 + d0 * THIRD, h1 - d1 * THIRD)
        clear = least > bend + w.touch[i] and order[i] == 0.0
        if anywhere(order[i] > 0.0):
            grows = leaves(i, order[i] == 2.0, step, m[i], w)
            started = order[i] == 1.0 or order[i] == 2.0
            clear = clear or (started and grows and WIDTH[i] == 0.0)
        if not ALL_LINEAR:
            clear = False
        if iw.sliding > 0:
            mult = w.mult[i]
            spread = mult.most - mult.least
            below, above = mult.least - spread, mult.most + spread
            inside = above < w.radius[2 * i + 1] and below > w.radius[2 * i]
            inside = inside and MOVING[i] == 0 and not (several > 1.0 and line > 0.0)
            if STRAIGHT[i] == 0:
                inside = inside and bent(w) and STAGES >= MANY_STAGES
            holds = inside and w.attract[i] > 0.0 and mult.slope < 0.0
            clear = (holds and m[i] == 0.0) or (clear and m[i] != 0.0)
        doubt = doubt if clear else 1.0
    return doubt > 0.0


@lanes
def ends_at_surface(t: float, start: float, m: Vector, order: Vector, w: Scratch) -> bool:
    """Where a guard vanishes within rounding after the end of the run; see `search.event_at_end`."""
    reached, last_k = 0.0, shift(w.k, (STAGES - 1) * N)
    for i in range(M):
        rate, terms = m[i] * w.end[2 * i + 1] * w.direction, abs(w.gt[i])
        for a in range(G_FIRST[i], G_FIRST[i + 1]):
            terms += abs(w.g[i * N + G_COLUMN[a]] * last_k[G_COLUMN[a]])
        wait = -(m[i] * w.end[2 * i] + WIDTH[i]) / rate
        falls = rate < (0.0 if order[i] == 0.0 else -FALLING * terms)
        if LINEAR[i] == 0:
            falls = falls and order[i] == 0.0
        near = falls and not (wait > ROUNDED * abs(t - start) + LATE * EPS * abs(t))
        reached = 1.0 if near else reached
    return reached > 0.0


@lanes
def lane_step(group: Group, iw: Integers, ctx: Indices) -> int:
    """A step of every lane; the lanes left to the caller and, above FINISHED, those at their end."""
    clock, tally, w = side_by_side(group.clock), side_by_side(group.tally), side_by_side(group.w)
    x, p, m, order, atol = group.x, group.p, group.m, group.order, group.atol
    t, y, last_k = clock.t, w.y, shift(w.k, (STAGES - 1) * N)
    remaining = clock.t_end - t
    if SERIES:
        # Where they are no numbers, the error is none, and the lane is left to the plain loop.
        lane_jets(t, x, p, m, w.jet_room, w.jet, w.spare, iw)
        # After a rejected step the shorter one is kept.
        length = series_length(x, clock.rtol, atol, clock.step, w)
        clock.step = clock.step if clock.grow == 1.0 else length
    step = w.direction * min(clock.step, clock.max_step)
    last = abs(step) >= abs(remaining) * (1.0 - 1e-12)
    step = remaining if last else step
    size = abs(step)
    stuck = tally.left <= 0.0 or (not last and size <= least_step(t, clock.t_start, clock.t_end))
    te = clock.t_end if last else t + step
    clear_ranges(w, iw)
    if SERIES:
        series_stages(t, x, p, m, step, y, w, iw, ctx)
    elif iw.sliding > 0:
        sliding_stages(t, x, p, m, step, y, w, iw, ctx)
    else:
        free_stages(t, x, p, m, step, y, w, iw, ctx)
    if END_IN_ERROR:
        field(t + step, y, p, m, last_k, w, iw, ctx)
    if SERIES:
        error = series_error(x, y, step, clock.rtol, atol, w)
    else:
        error = error_norm(x, y, step, clock.rtol, atol, -1, 0, 1.0, 0.0, w)
    calls = float(STAGES - 1)
    if iw.sliding > 0:
        project(te, y, p, m, w.h, w, iw, ctx)
        for i in range(M):
            calls = 2.0 * float(STAGES - 1) if m[i] == 0.0 else calls
    if iw.sliding > 0 or not END_IN_ERROR:
        field(te, y, p, m, last_k, w, iw, ctx)
    guard_state(te, y, p, m, last_k, w.end, w, ctx)
    refused = error > 1.0 and error < 1e300 and not stuck
    valid = error <= 1.0 and finite(last_k, N) and finite(y, N) and finite(w.end, 2 * M)
    valid = valid and not stuck
    if SERIES:
        good = valid and not series_may_vanish(step, m, order, w, iw)
        # A series shows that a multiplier stays in its set, but not that it reaches the end of it.
        good = good and not (last and iw.sliding > 0)
    else:
        good = valid and not may_vanish(step, m, order, w, iw)
    if anywhere(last):
        good = good and not (last and ends_at_surface(te, clock.t_start, m, order, w))
    factor = 10.0 if error == 0.0 else step_factor(error)
    predicted = factor * factor * size / clock.trend
    proposal = size * max(0.2, min(clock.grow, factor, predicted))
    proposal = max(clock.step, proposal) if last else proposal
    clock.step = proposal if good else (size * max(0.2, factor) if refused else clock.step)
    clock.trend = size * min(factor, 3.0) if good else clock.trend
    clock.grow = 10.0 if good else (1.0 if refused else clock.grow)
    clock.t = te if good else t
    clock.taken = max(error, 1e-300) if valid and not good else 0.0
    tally.left -= 1.0 if good or refused else 0.0
    tally.calls += calls if valid or refused else 0.0
    tally.done += 1.0 if good else 0.0
    tally.refused += 1.0 if refused else 0.0
    for j in range(N):
        x[j] = y[j] if good else x[j]
        w.k[j] = last_k[j] if good else w.k[j]
    for i in range(M):
        order[i] = 0.0 if good else order[i]
        clear = abs(w.end[2 * i]) > 1e3 * w.touch[i]
        w.grazed[i] = 0.0 if good and clear else w.grazed[i]
    for i in range(2 * M):
        w.start[i] = w.end[i] if good else w.start[i]
    return mask_bits(not good and not refused) + (mask_bits(good and last) << FINISHED)
