"""One step of several trajectories side by side, each with its own time, step, mode and tolerance.

A lane is carried on where its step is accepted and no guard can have vanished in it, and shortened where it
is rejected. Everything else (an event, or what may be one; an invalid stage; a step too small) is told to the
caller, the lane left as it was.
"""

from filippov.kernel.language.primitives import (
    Indices,
    Vector,
    anywhere,
    from_bits,
    lanes,
    mask_bits,
    shift,
    to_bits,
    truncate,
)
from filippov.kernel.loop.control import (
    MANY_STAGES,
    ONE_BITS,
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
    I_SLIDING,
    MOVING,
    ORDER,
    STAGES,
    STRAIGHT,
    W_ATTRACT,
    W_DIRECTION,
    W_END,
    W_GRAZED,
    W_H,
    W_K,
    W_MULT,
    W_RADIUS,
    W_START,
    W_TOUCH,
    W_Y,
    WIDTH,
    M,
    N,
    free_stages,
    sliding_stages,
)
from filippov.kernel.tables.codes import GROW, MAX_STEP, RTOL, STEP, T_END, T_START, TAKEN, TREND, T
from filippov.kernel.tables.layout import COLUMNS, LEAST, MOST, SLOPE

# Positions in `tally`, what every lane counts: steps it may still try, field calls, steps done and refused.
LEFT, CALLS, DONE, REFUSED, TALLIES = 0, 1, 2, 3, 4
# The second mask of the result stands above the first.
FINISHED = 32
THIRD = 0.3333333333333333


@lanes
def step_factor(square: float) -> float:
    """0.9 error**(-1/order) from the square of the error; see `control.step_factor`."""
    bits = ONE_BITS - truncate(float(to_bits(square) - ONE_BITS) * (0.5 / float(ORDER)))
    return 0.9 * from_bits(bits)


@lanes
def bent(w: Vector) -> bool:
    """Where the stages met different fields; see `control.uniform`."""
    change = 0.0
    for a in range(N, (STAGES - 1) * N):
        change = max(change, abs(w[W_K + a] - w[W_K + a % N]))
    return change > 0.0


@lanes
def may_vanish(step: float, m: Vector, order: Vector, w: Vector, iw: Indices) -> bool:
    """Where a guard may have vanished in the step; see `control.suspicious`."""
    doubt = 0.0
    for i in range(M):
        h0, h1 = m[i] * w[W_START + 2 * i] + WIDTH[i], m[i] * w[W_END + 2 * i] + WIDTH[i]
        d0, d1 = m[i] * w[W_START + 2 * i + 1] * step, m[i] * w[W_END + 2 * i + 1] * step
        bend = abs(h1 - h0 - d0) + abs(2.0 * (h1 - h0) - d0 - d1)
        least = min(h0, h1, h0 + d0 * THIRD, h1 - d1 * THIRD)
        clear = least > bend + w[W_TOUCH + i] and order[i] == 0.0
        if anywhere(order[i] > 0.0):
            grows = leaves(i, order[i] == 2.0, step, m[i], w)
            started = order[i] == 1.0 or order[i] == 2.0
            clear = clear or (started and grows and WIDTH[i] == 0.0)
        if not ALL_LINEAR:
            clear = False
        if iw[I_SLIDING] > 0:
            mult = shift(w, W_MULT + i * COLUMNS)
            spread = mult[MOST] - mult[LEAST]
            below, above = mult[LEAST] - spread, mult[MOST] + spread
            inside = above < w[W_RADIUS + 2 * i + 1] and below > w[W_RADIUS + 2 * i]
            inside = inside and MOVING[i] == 0
            if STRAIGHT[i] == 0:
                inside = inside and bent(w) and STAGES >= MANY_STAGES
            holds = inside and w[W_ATTRACT + i] > 0.0 and mult[SLOPE] < 0.0
            clear = (holds and m[i] == 0.0) or (clear and m[i] != 0.0)
        doubt = doubt if clear else 1.0
    return doubt > 0.0


@lanes
def ends_at_surface(t: float, start: float, m: Vector, order: Vector, w: Vector) -> bool:
    """Where a guard vanishes within rounding after the end of the run; see `advance.event_at_end`."""
    met = 0.0
    for i in range(M):
        rate = m[i] * w[W_END + 2 * i + 1]
        wait = -(m[i] * w[W_END + 2 * i] + WIDTH[i]) / rate
        near = rate < 0.0 and order[i] == 0.0 and not (wait > 1e-12 * max(abs(t), abs(t - start)))
        met = 1.0 if near else met
    return met > 0.0


@lanes
def lane_step(
    clock: Vector, tally: Vector, x: Vector, p: Vector, m: Vector, order: Vector, atol: Vector, w: Vector,
    iw: Indices, ctx: Indices,
) -> int:  # fmt: skip
    """A step of every lane; the lanes left to the caller and, above FINISHED, those that are at their end."""
    t, y, last_k = clock[T], shift(w, W_Y), shift(w, W_K + (STAGES - 1) * N)
    remaining = clock[T_END] - t
    step = w[W_DIRECTION] * min(clock[STEP], clock[MAX_STEP])
    last = abs(step) >= abs(remaining) * (1.0 - 1e-12)
    step = remaining if last else step
    size = abs(step)
    stuck = tally[LEFT] <= 0.0 or (not last and size <= least_step(t, clock[T_START], clock[T_END]))
    te = clock[T_END] if last else t + step
    clear_ranges(w, iw)
    if iw[I_SLIDING] > 0:
        sliding_stages(t, x, p, m, step, y, w, iw, ctx)
    else:
        free_stages(t, x, p, m, step, y, w, iw, ctx)
    if END_IN_ERROR:
        field(t + step, y, p, m, last_k, w, iw, ctx)
    error = error_norm(x, y, step, clock[RTOL], atol, -1, 0, 1.0, 0.0, w)
    calls = float(STAGES - 1)
    if iw[I_SLIDING] > 0:
        project(te, y, p, m, shift(w, W_H), w, iw, ctx)
        for i in range(M):
            calls = 2.0 * float(STAGES - 1) if m[i] == 0.0 else calls
    if iw[I_SLIDING] > 0 or not END_IN_ERROR:
        field(te, y, p, m, last_k, w, iw, ctx)
    guard_state(te, y, p, m, last_k, shift(w, W_END), w, ctx)
    refused = error > 1.0 and error < 1e300 and not stuck
    valid = error <= 1.0 and finite(last_k, N) and finite(y, N) and finite(shift(w, W_END), 2 * M)
    valid = valid and not stuck
    good = valid and not may_vanish(step, m, order, w, iw)
    if anywhere(last):
        good = good and not (last and ends_at_surface(te, clock[T_START], m, order, w))
    factor = 10.0 if error == 0.0 else step_factor(error)
    predicted = factor * factor * size / clock[TREND]
    proposal = size * max(0.2, min(clock[GROW], factor, predicted))
    proposal = max(clock[STEP], proposal) if last else proposal
    clock[STEP] = proposal if good else (size * max(0.2, factor) if refused else clock[STEP])
    clock[TREND] = size * min(factor, 3.0) if good else clock[TREND]
    clock[GROW] = 10.0 if good else (1.0 if refused else clock[GROW])
    clock[T] = te if good else t
    clock[TAKEN] = max(error, 1e-300) if valid and not good else 0.0
    tally[LEFT] -= 1.0 if good or refused else 0.0
    tally[CALLS] += calls if valid or refused else 0.0
    tally[DONE] += 1.0 if good else 0.0
    tally[REFUSED] += 1.0 if refused else 0.0
    for j in range(N):
        x[j] = y[j] if good else x[j]
        w[W_K + j] = last_k[j] if good else w[W_K + j]
    for i in range(M):
        order[i] = 0.0 if good else order[i]
        clear = abs(w[W_END + 2 * i]) > 1e3 * w[W_TOUCH + i]
        w[W_GRAZED + i] = 0.0 if good and clear else w[W_GRAZED + i]
    for i in range(2 * M):
        w[W_START + i] = w[W_END + i] if good else w[W_START + i]
    return mask_bits(not good and not refused) + (mask_bits(good and last) << FINISHED)
