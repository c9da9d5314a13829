"""The event loop: one trajectory, mode by mode, until its end or until something needs the general path.

Contract (clauses E1-E9 of docs/event-loop): the field of a segment is smooth, the mode is the memory; an
accepted step is searched for its first event; the event is landed on by a real step; simple ones are decided
in `resolve`, everything else returns GENERAL with the state at the event and the surfaces that are hit.
"""

from filippov.kernel.language.primitives import NAN, Indices, Vector, kernel, shift, shift_indices, truncate
from filippov.kernel.loop.control import (
    at_rest,
    error_norm,
    finite,
    first_step,
    go_straight,
    guard_state,
    hides_order,
    least_step,
    mark_grazed,
    mark_hits,
    other_stages,
    shrink_invalid,
    step_factor,
    suspicious,
    uniform,
)
from filippov.kernel.loop.field import clear_ranges, field, project, set_mode
from filippov.kernel.loop.land import EPS, guard_scale, land, reached_before
from filippov.kernel.loop.lap import faint, zeno_horizon, zeno_remaining
from filippov.kernel.loop.locate import BRUSH, NOISY, dense_output, guard_noise, locate, straight
from filippov.kernel.loop.model import (
    CLAMPED,
    END_IN_ERROR,
    I_CALLS,
    I_PIECES,
    I_SLIDING,
    IMPLICIT,
    LINEAR,
    RESET_FROM,
    RESETS,
    ROLE,
    STAGES,
    W_ATOL,
    W_BEFORE,
    W_COEF,
    W_DIRECTION,
    W_END,
    W_F,
    W_GRAZED,
    W_H,
    W_JUMP,
    W_K,
    W_MULT,
    W_RADIUS,
    W_ROW,
    W_RTOL,
    W_START,
    W_TOUCH,
    W_XE,
    W_Y,
    WIDTH,
    M,
    N,
    radii,
    stages,
)
from filippov.kernel.loop.record import count_down, record_event, store_step
from filippov.kernel.loop.reset import apply_reset, resets_from
from filippov.kernel.loop.resolve import (
    resolve_exit,
    resolve_root,
    resolve_touch,
    touch_or_root,
    widen,
)
from filippov.kernel.loop.segment import renew_state, rough_start
from filippov.kernel.tables.codes import (
    CAUSE,
    CHUNK_DONE,
    EVENT_ROOM,
    EVENTS,
    EVENTS_FULL,
    EXIT_DOWN,
    EXIT_UP,
    FIELD_CALLS,
    GENERAL,
    GRAZING,
    GROW,
    LOST,
    MAX_STEP,
    MIN_STEP,
    NO_SLIDING,
    NONE,
    NOT_FINITE,
    NOTHING,
    OBSERVER,
    REACHED,
    RECORD_ROOM,
    RECORDS,
    RECORDS_FULL,
    REJECTED,
    RELATIVE,
    RESET,
    ROOT,
    ROUGH_FROM,
    ROUGH_NOISE,
    ROUGH_SPAN,
    RTOL,
    SAME_INSTANT,
    STEP,
    STEP_BUDGET,
    STEPS,
    STOPPED,
    STOPS,
    STORE,
    SURFACE,
    T_END,
    T_START,
    TAKEN,
    TOUCH,
    TREND,
    USER_ERROR,
    WIDEST,
    ZENO,
    ZENO_ROOM,
    T,
)
from filippov.kernel.tables.layout import COLUMNS, MULTIPLIER
from filippov.kernel.tables.radau_tables import NOT_CONVERGED


@kernel
def event_at_end(
    t: float, x: Vector, p: Vector, start: float, m: Vector, order: Indices, w: Vector, ctx: Indices
) -> int:
    """The surface whose guard vanishes within rounding after the end of the run, -1 if none: clause E4."""
    for i in range(M):
        rate = m[i] * w[W_END + 2 * i + 1]
        if rate < 0.0 and order[i] == 0:
            wait = -(m[i] * w[W_END + 2 * i] + WIDTH[i]) / rate
            if wait <= 1e-12 * max(abs(t), abs(t - start)):
                if LINEAR[i] == 0 and abs(w[W_END + 2 * i]) <= NOISY * guard_noise(i, t, x, p, m, w, ctx):
                    continue
                return i
    return -1


GRAIN = 1e2  # what a guard that is followed relative to itself is known to, in roundings of its terms
SAME_END = 1e-11  # times so close to the end of the run, in parts of it, are the end
# Pieces into which the guards of a step may split it for steps to go on growing.
PIECES = 64


@kernel
def advance(
    clock: Vector, count: Indices, x: Vector, m: Vector, order: Indices, hit: Indices, lam: Vector, p: Vector,
    atol: Vector, stop: Indices, zeno: Vector, rec: Vector, rec_coef: Vector, events: Vector,
    marks: Indices, w: Vector, iw: Indices, ctx: Indices,
) -> int:  # fmt: skip
    """Run one trajectory from (clock[T], x, m) towards clock[T_END]; returns why it came back (see `codes`).

    Everything is updated in place. `order[i]`: how often guard i vanishes at the start; `lam`: multipliers of
    the sliding surfaces; `stop[i, kind]`: events until a terminal one; `hit`: the surfaces met where the
    general path is needed; `w`, `iw`: scratch (see `layout`).
    """
    y, xe, f, last_k = shift(w, W_Y), shift(w, W_XE), shift(w, W_F), shift(w, W_K + (STAGES - 1) * N)
    direction = 1.0 if clock[T_END] >= clock[T] else -1.0
    w[W_DIRECTION] = direction
    rtol = clock[RTOL]
    steps_left = count[STEP_BUDGET]
    taken = clock[TAKEN]
    clock[TAKEN] = 0.0
    renew = taken == 0.0
    if taken > 0.0:
        set_mode(m, iw)
    # Step control goes on where the last call left it: steps must not depend on how a run is cut into calls.
    grow = clock[GROW] if clock[GROW] > 0.0 else 10.0
    trend = clock[TREND] if clock[TREND] > 0.0 else 1e-300
    for i in range(M):
        w[W_MULT + i * COLUMNS + MULTIPLIER] = lam[i]
    iw[I_CALLS] = 0
    if IMPLICIT:
        w[W_RTOL] = rtol
        for j in range(N):
            w[W_ATOL + j] = atol[j]
    code, rested = REACHED, False
    while True:
        t = clock[T]
        remaining = clock[T_END] - t
        if remaining * direction <= clock[SAME_INSTANT]:
            break
        if count[EVENTS] + M >= count[EVENT_ROOM]:
            code = EVENTS_FULL
            break
        if count[STORE] != 0 and count[RECORDS] >= count[RECORD_ROOM]:
            code = RECORDS_FULL
            break
        if steps_left <= 0:
            code = CHUNK_DONE
            break
        steps_left -= 1
        if renew:
            code = renew_state(t, x, p, m, order, rtol, atol, w, iw, ctx)
            if code != REACHED:
                break
            renew = False
            widen(zeno, w, iw)
            if clock[RELATIVE] < 0.0:
                near = truncate(-clock[RELATIVE]) - 1
                w[W_TOUCH + near] = GRAIN * EPS * guard_scale(near, t, x, w)
            if t == clock[T_START]:
                mark_grazed(m, True, w)
            surface = rough_start(clock, t, x, p, m, order, direction, w, iw, ctx)
            if surface == -2:
                code = USER_ERROR
                break
            if surface >= 0:
                order[surface] = 0
                renew = True
                trend = 1e-300
                continue
        if clock[STEP] <= 0.0:
            limit = min(abs(remaining), clock[MAX_STEP])
            failed, length = first_step(t, x, p, m, shift(w, W_K), rtol, atol, limit, direction, w, iw, ctx)
            if failed == 1:
                code = USER_ERROR
                break
            clock[STEP] = length
        step = direction * min(clock[STEP], clock[MAX_STEP])
        last = abs(step) >= abs(remaining) * (1.0 - 1e-12)
        if last:
            step = remaining
        elif abs(step) <= least_step(t, clock[T_START], clock[T_END]):
            if rested or not at_rest(w):
                code = MIN_STEP
                break
            # The equilibrium of a rough field was reached by ever shorter steps; to stay there needs none.
            rested = True
            clock[STEP] = max(1024.0 * EPS * abs(t), 1e-12 * abs(remaining))
            continue
        elif taken == 0.0:
            # What is added to the state must be what is added to the time, also where t is large.
            step = (t + step) - t
        failed, error = 0, taken
        relative, kept = truncate(abs(clock[RELATIVE])) - 1, 1 if clock[RELATIVE] < 0.0 else 0
        if taken == 0.0:
            clear_ranges(w, iw)
            failed = stages(t, x, p, m, step, y, w, iw, ctx)
            error = NAN
        line = failed == 0 and not IMPLICIT and uniform(w)
        if line and taken == 0.0:
            go_straight(x, step, y, w)
        if taken == 0.0 and failed == 0 and END_IN_ERROR:
            failed = field(t + step, y, p, m, last_k, w, iw, ctx)
        slack = 1.0
        if kept != 0:
            slack = max(abs(t - clock[ROUGH_FROM]), clock[ROUGH_SPAN])
        elif relative >= 0:
            slack = max(1.0, clock[ROUGH_SPAN] / abs(t + step - clock[ROUGH_FROM]))
        if taken == 0.0 and failed == 0:
            error = error_norm(x, y, step, rtol, atol, relative, kept, slack, clock[ROUGH_NOISE], w)
        if error > 1.0 and error < 1e300:
            count[REJECTED] += 1
            clock[STEP] = abs(step) * max(0.2, step_factor(error))
            grow = 1.0
            continue
        te = clock[T_END] if last else t + step
        if taken == 0.0 and error <= 1.0:
            if iw[I_SLIDING] > 0:
                failed = project(te, y, p, m, shift(w, W_H), w, iw, ctx)
            if failed == 0 and (iw[I_SLIDING] > 0 or not END_IN_ERROR):
                failed = field(te, y, p, m, last_k, w, iw, ctx)
            if failed == 0:
                failed = guard_state(te, y, p, m, last_k, shift(w, W_END), w, ctx)
        taken = 0.0
        if failed == 1:
            code = USER_ERROR
            break
        cause, surface, theta, slope = NOTHING, -1, 2.0, 0.0
        length, dense_length, residual = step, step, 0.0
        if (
            failed != 0
            or not (error <= 1.0)
            or not finite(last_k, N)
            or not finite(y, N)
            or not finite(shift(w, W_END), 2 * M)
        ):
            count[REJECTED] += 1
            length, surface = shrink_invalid(clock, m, order, step, w)
            grow = 2.0
            clock[STEP] = length
            if surface < 0:
                if length <= least_step(t, clock[T_START], clock[T_END]):
                    code = NO_SLIDING if failed == 2 else MIN_STEP if failed == NOT_CONVERGED else NOT_FINITE
                    break
                continue
            # The surface is one rounding away: the motion has arrived, without a step across.
            cause = ROOT
            clock[STEP] = abs(step)
            te = t
            for j in range(N):
                xe[j] = x[j]
        else:
            factor = 10.0 if error == 0.0 else step_factor(error)
            # Gustafsson's prediction: an error that grows from step to step will go on growing.
            predicted = factor * factor * abs(step) / trend
            trend = abs(step) * min(factor, 3.0)
            factor = min(grow, factor, predicted)
            proposal = abs(step) * max(0.2, factor)
            clock[STEP] = max(clock[STEP], proposal) if last else proposal
            grow = 10.0
            count[STEPS] += 1
            look = suspicious(step, m, order, line, w, iw)
            if look or count[STORE] != 0:
                failed = other_stages(t, x, p, m, step, line, w, iw, ctx)
                if count[STORE] != 0 or not straight(iw):
                    dense_output(x, step, w)
                for j in range(N):
                    w[W_COEF + j] = x[j]
            if look and failed == 0:
                cause, surface, theta, slope = locate(t, p, m, order, step, w, iw, ctx)
            # Multipliers without a value somewhere in the step have left their sets before that.
            if cause <= LOST:
                count[REJECTED] += 1
                count[STEPS] -= 1
                clock[STEP] = 0.125 * abs(step)
                grow = 1.0
                continue
            if failed == 1 or cause == -1:
                code = USER_ERROR
                break
            if look and iw[I_PIECES] > PIECES:
                # Guards that turn faster than the motion: longer steps cost more and hide what happens.
                clock[STEP] = min(clock[STEP], abs(step) * float(PIECES) / float(iw[I_PIECES]))
            if RESETS and cause == NOTHING:
                surface, residual = reached_before(te, y, last_k, m, -1, w)
                if surface >= 0 and residual < abs(step):
                    cause, theta = ROOT, 1.0 - residual / abs(step)
            if cause == NOTHING and last:
                surface = event_at_end(te, y, p, clock[T_START], m, order, w, ctx)
                if surface >= 0:
                    cause, theta = ROOT, 1.0
            if cause == NOTHING:
                if count[STORE] != 0:
                    store_step(count, t, step, rec, rec_coef, w)
                widen(zeno, w, iw)
                for j in range(N):
                    x[j] = y[j]
                    w[W_K + j] = last_k[j]
                for i in range(M):
                    w[W_START + 2 * i] = w[W_END + 2 * i]
                    w[W_START + 2 * i + 1] = w[W_END + 2 * i + 1]
                    if m[i] != 0.0 or order[i] > 0:
                        order[i] = 0
                    elif order[i] <= -2:
                        order[i] = -1
                # Away from the surface, or on the way back to one, the ordinary tolerance is the right one.
                if relative >= 0 and kept == 0:
                    away = abs(te - clock[ROUGH_FROM]) > clock[ROUGH_SPAN]
                    if away or m[relative] * w[W_END + 2 * relative + 1] * direction <= 0.0:
                        clock[RELATIVE] = 0.0
                mark_grazed(m, False, w)
                clock[T] = te
                continue
            if cause == ROOT and hides_order(t, theta * abs(step), abs(step)):
                count[REJECTED] += 1
                count[STEPS] -= 1
                clock[STEP] = 4.0 * theta * abs(step)
                continue
            failed, length, dense_length, residual = land(
                t, x, p, m, cause, surface, step, theta, slope, line, xe, w, iw, ctx
            )
            for _ in range(M if RESETS and M > 1 else 0):
                if failed == 0:
                    failed = field(t + length, xe, p, m, f, w, iw, ctx)
                if failed == 0:
                    failed = guard_state(t + length, xe, p, m, f, shift(w, W_END), w, ctx)
                first, ago = reached_before(t + length, xe, f, m, surface, w)
                if failed != 0 or first < 0 or ago >= abs(length):
                    break
                cause, surface, theta = ROOT, first, (length - direction * ago) / step
                failed, length, dense_length, residual = land(
                    t, x, p, m, cause, surface, step, theta, 0.0, line, xe, w, iw, ctx
                )
            if failed == 1:
                code = USER_ERROR
                break
            if failed == NOT_CONVERGED:
                count[REJECTED] += 1
                clock[STEP] = 0.25 * abs(step)
                continue
            if CLAMPED and cause == ROOT and failed == 0 and not line:
                # In stages beyond the surface such a field stands still, and a step across may look exact.
                error = error_norm(x, xe, length, rtol, atol, relative, kept, slack, clock[ROUGH_NOISE], w)
                if error > 1.0:
                    count[REJECTED] += 1
                    count[STEPS] -= 1
                    clock[STEP] = abs(length) * max(0.2, step_factor(error))
                    grow = 1.0
                    continue
            # What was missed at the end of the run may have been long before it.
            there = abs(step - length) <= SAME_END * max(abs(clock[T_END]), abs(step))
            te = t + length
            if (last and theta >= 1.0 and there) or (te - clock[T_END]) * direction > 0.0:
                te = clock[T_END]
            if dense_length == 0.0:
                dense_length = length
            if count[STORE] != 0 and te != t:
                failed = field(t + dense_length, xe, p, m, last_k, w, iw, ctx)
                failed = other_stages(t, x, p, m, dense_length, line, w, iw, ctx)
                dense_output(x, dense_length, w)
                store_step(count, t, dense_length, rec, rec_coef, w)
        # An event on `surface` at (te, xe).
        for i in range(M):
            w[W_BEFORE + i] = m[i]
        failed = field(te, xe, p, m, f, w, iw, ctx)
        if (
            failed == 1
            or guard_state(te, xe, p, m, f, shift(w, W_END), w, ctx) != 0
            or radii(te, xe, p, shift(w, W_RADIUS), ctx) != 0
        ):
            code = USER_ERROR
            break
        if cause == ROOT and m[surface] != 0.0 and te != t:
            cause = touch_or_root(surface, te - t, m, w)
        count[SURFACE], count[CAUSE] = surface, cause
        hits = mark_hits(te, xe, m, order, cause, surface, step, hit, w)
        # A reset at the instant of a clock is one set with it.
        due = clock[SAME_INSTANT] > 0.0 and (clock[T_END] - te) * direction <= clock[SAME_INSTANT]
        multiplier = w[W_MULT + surface * COLUMNS + MULTIPLIER] if m[surface] == 0.0 else NAN
        kind = NONE
        # Of a guard that is followed relative to itself roots are known to a part of the last lap.
        lap = max(abs(te - clock[ROUGH_FROM]), clock[ROUGH_SPAN]) if clock[RELATIVE] < 0.0 else 0.0
        if failed == 0 and hits == 1:
            told = cause == ROOT or clock[RELATIVE] < 0.0  # a touching is its own answer elsewhere
            if told and faint(te, xe, p, m, surface, te - t, rtol * lap, w, iw, ctx):
                kind = NONE
            elif cause == TOUCH:
                kind = resolve_touch(te, xe, p, m, surface, w, iw, ctx)
            elif cause == ROOT and RESETS and RESET_FROM[surface] != 0 and (direction < 0.0 or due):
                kind = NONE
            elif cause == ROOT and RESETS and resets_from(surface, m[surface]):
                kind = apply_reset(te, xe, p, m, order, surface, w, iw, ctx)
            elif cause == ROOT:
                kind = resolve_root(
                    te, xe, p, m, order, surface, w[W_END + 2 * surface + 1] * direction, w, iw, ctx
                )
            elif residual <= BRUSH * (abs(w[W_ROW + surface]) + abs(w[W_ROW + M + surface])):
                row = shift(zeno, ZENO_ROOM * surface)
                lasted = abs(te - (row[0] if row[1] > 0.0 else clock[T_START]))
                kind = resolve_exit(m, order, cause, surface, slope, lasted, w, iw)
        if kind == -1:
            code = USER_ERROR
            break
        clock[T] = te
        for j in range(N):
            x[j] = xe[j]
        if kind == NONE:
            for i in range(M):
                if hit[i] != 0:
                    w[W_GRAZED + i] = 1.0
            code = GENERAL
            break
        for i in range(M):
            if i != surface and m[i] != 0.0:
                order[i] = 0
        if kind == GRAZING:
            order[surface] = 2
            w[W_GRAZED + surface] = 1.0
        if m[surface] == 0.0:
            multiplier = w[W_MULT + surface * COLUMNS + MULTIPLIER]
            zeno[ZENO_ROOM * surface + WIDEST] = 0.0
        record_event(events, marks, count, te, x, surface, kind, m, multiplier, residual, w)
        if kind == RESET:
            for j in range(N):
                x[j] = w[W_JUMP + j]
        renew = True
        trend = 1e-300
        if kind == EXIT_UP or kind == EXIT_DOWN:  # noqa: PLR1714, SIM109 - the kernel language has no `in`
            # The step of a slide says nothing about the motion that leaves it.
            clock[STEP] = 0.0
        if LINEAR[surface] == 0 and abs(te - t) < 0.25 * abs(step):
            # A guard that turns faster than the motion: the next event is about as far.
            clock[STEP] = min(clock[STEP], 4.0 * abs(te - t) + 1e3 * EPS * abs(te))
        if clock[RELATIVE] == -float(surface) - 1.0:
            clock[ROUGH_SPAN], clock[ROUGH_FROM] = abs(te - clock[ROUGH_FROM]), te
        clock[RELATIVE] = min(clock[RELATIVE], 0.0)
        if count_down(shift_indices(stop, STOPS * surface), kind) != 0:
            code = STOPPED
            break
        if ROLE[surface] != OBSERVER and kind != GRAZING:
            laps = shift(zeno, ZENO_ROOM * surface)
            horizon = zeno_horizon(te, clock[T_START], xe, surface, laps, w)
            if zeno_remaining(laps, te, horizon) >= 0.0:
                code = ZENO
                break
    count[FIELD_CALLS] += iw[I_CALLS]
    clock[GROW], clock[TREND] = grow, trend
    for i in range(M):
        lam[i] = w[W_MULT + i * COLUMNS + MULTIPLIER]
    return code
