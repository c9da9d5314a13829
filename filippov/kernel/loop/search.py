"""An accepted step: the length of the next one, the first event in this one, and the landing on it."""

from filippov.kernel.language.primitives import Indices, Vector, inline, kernel, seldom, shift
from filippov.kernel.loop.attempt import error_of, go_back, reject
from filippov.kernel.loop.control import (
    guard_state,
    hides_order,
    mark_grazed,
    other_stages,
    step_factor,
    suspicious,
)
from filippov.kernel.loop.field import field
from filippov.kernel.loop.land import land, reached_before
from filippov.kernel.loop.model import (
    AFFINE,
    CLAMPED,
    CONTACT,
    END_IN_ERROR,
    G_COLUMN,
    G_FIRST,
    LINEAR,
    RESETS,
    ROOTED,
    ROOTS,
    SERIES,
    STAGES,
    WIDTH,
    M,
    N,
    guards,
)
from filippov.kernel.loop.record import store_step
from filippov.kernel.loop.resolve import widen
from filippov.kernel.loop.roots.locate import NOISY, locate
from filippov.kernel.loop.roots.sampling import dense_output, dense_value, guard_noise, guard_rows, straight
from filippov.kernel.loop.state import Scratch, Trajectory
from filippov.kernel.tables.codes import (
    AGAIN,
    ALONG,
    ARRIVED,
    GO_ON,
    LOST,
    LOWER,
    NOTHING,
    ROOT,
    UPPER,
    USER_ERROR,
)
from filippov.kernel.tables.layout import EPS
from filippov.kernel.tables.radau_tables import NOT_CONVERGED

SAME_END = 1e-11  # times so close to the end of the run, relative to it, are the end
# Events so little later than the end, relative to the time run, or by so many roundings, are at the end.
ROUNDED, LATE = 1e-12, 32.0
BEYOND_END = 1e-9  # landings by so much later than the end of the run, relative to it, have failed
FALLING = 1e-6  # relative to the terms of its rate: a guard that falls by more than rounding
BEFORE_END = 1e-3  # the distance, relative to the step, for the slope of a multiplier's guard at the end
# The most pieces into which the guards of a step may divide it while steps go on growing.
PIECES = 64


@kernel
def turns(
    i: int, t: float, x: Vector, length: float, p: Vector, m: Vector, w: Scratch, ctx: Indices
) -> bool:
    """Whether guard i is negative a time later along the field at the end of the step."""
    last_k = shift(w.k, (STAGES - 1) * N)
    for j in range(N):
        w.xm[j] = x[j] + length * last_k[j]
    return guards(t + length, w.xm, p, m, w.h, ctx) == 0 and m[i] * w.h[i] + WIDTH[i] < 0.0


@seldom
@kernel
def event_at_end(
    t: float, x: Vector, p: Vector, start: float, m: Vector, order: Indices, w: Scratch, ctx: Indices
) -> int:
    """The surface whose guard vanishes within rounding after the end of the run, -1 if none: clause E4."""
    last_k = shift(w.k, (STAGES - 1) * N)
    for i in range(M):
        if order[i] == ALONG:
            continue
        rate, terms = m[i] * w.end[2 * i + 1] * w.direction, abs(w.gt[i])
        for a in range(G_FIRST[i], G_FIRST[i + 1]):
            terms += abs(w.g[i * N + G_COLUMN[a]] * last_k[G_COLUMN[a]])
        # A guard from which the segment starts has come back only where it clearly falls; differences of a
        # function may be rounding, however large.
        if rate < (0.0 if order[i] == 0 else -FALLING * terms) and (order[i] == 0 or LINEAR[i] != 0):
            wait = -(m[i] * w.end[2 * i] + WIDTH[i]) / rate
            if wait <= ROUNDED * abs(t - start) + LATE * EPS * abs(t):
                value = abs(w.end[2 * i])
                if LINEAR[i] == 0 and value <= NOISY * guard_noise(i, t, t - start, x, p, m, w, ctx):
                    continue
                if ROOTS and ROOTED[i] != 0 and not turns(i, t, x, 2.0 * w.direction * wait, p, m, w, ctx):
                    continue
                return i
    return -1


@seldom
@kernel
def exit_at_end(run: Trajectory) -> tuple[int, int, float]:
    """The sliding surface whose multiplier leaves its set within rounding after the end: clause E4.

    Returns as `locate` does (cause, surface, slope of the guard by theta); NOTHING where there is none. The
    dense output is known.
    """
    now, w, iw = run.now, run.w, run.iw
    t, step, te, past = now.t, now.step, now.t_end, shift(w.row, 2 * M)
    dense_value(1.0 - BEFORE_END, w.xm, w)
    failed = guard_rows(t + (1.0 - BEFORE_END) * step, w.xm, run.p, run.m, w.row, w, iw, run.ctx)
    for row in range(2 * M):
        past[row] = w.row[row]
    if failed != 0 or guard_rows(te, w.y, run.p, run.m, w.row, w, iw, run.ctx) != 0:
        return NOTHING, -1, 0.0
    for row in range(2 * M):
        i = row if row < M else row - M
        slope = (w.row[row] - past[row]) / BEFORE_END
        if run.m[i] != 0.0 or not (slope < 0.0) or abs(run.order[i]) > 1:
            continue
        wait = -w.row[row] / slope * abs(step)
        if wait <= ROUNDED * abs(te - run.clock.t_start) + LATE * EPS * abs(te):
            return UPPER if row < M else LOWER, i, slope
    return NOTHING, -1, 0.0


@inline
@kernel
def propose(run: Trajectory) -> None:
    """The next step, from the error of this one and of the one before."""
    clock, now = run.clock, run.now
    size = abs(now.step)
    factor = 10.0 if now.error == 0.0 else step_factor(now.error)
    # Gustafsson's prediction: an error that grows from step to step goes on growing.
    predicted = factor * factor * size / clock.trend
    clock.trend = size * min(factor, 3.0)
    factor = min(clock.grow, factor, predicted)
    proposal = size * max(0.2, factor)
    clock.step = max(clock.step, proposal) if now.last != 0 else proposal
    clock.grow = 10.0


@inline
@kernel
def carry_on(run: Trajectory) -> int:
    """Accept a step without events: its end becomes the state."""
    clock, m, order, w, now = run.clock, run.m, run.order, run.w, run.now
    if run.count.store != 0:
        store_step(run.count, now.t, now.step, run.rec, run.rec_coef, w)
    widen(run.zeno, w, run.iw)
    x, last_k = run.x, shift(w.k, (STAGES - 1) * N)
    for j in range(N):
        x[j] = w.y[j]
        w.k[j] = last_k[j]
    for i in range(M):
        w.start[2 * i] = w.end[2 * i]
        w.start[2 * i + 1] = w.end[2 * i + 1]
        if m[i] != 0.0 or order[i] > 0:
            held = order[i] == ALONG and abs(w.end[2 * i]) <= w.touch[i]
            order[i] = ALONG if held else 0
        elif order[i] <= -2:
            order[i] = -1
    # Away from the surface, or on the way back to one, the ordinary tolerance applies.
    relative = now.relative
    if relative >= 0 and now.kept == 0:
        away = abs(now.t_end - clock.fast_from) > clock.fast_span
        if away or m[relative] * w.end[2 * relative + 1] * w.direction <= 0.0:
            clock.relative = 0.0
    mark_grazed(m, False, w)
    clock.t = now.t_end
    return AGAIN


@inline
@kernel
def search(run: Trajectory) -> int:
    """The first event of the step; the step is carried on where it has none."""
    clock, count, x, m, order, p = run.clock, run.count, run.x, run.m, run.order, run.p
    w, iw, ctx, now = run.w, run.iw, run.ctx, run.now
    t, step, te, failed = now.t, now.step, now.t_end, 0
    propose(run)
    count.steps += 1
    look = suspicious(step, m, order, now.line != 0, w, iw)
    if SERIES and now.last != 0 and iw.sliding > 0:
        # A series shows that a multiplier stays in its set, but not that it reaches the end of it.
        look = True
    if look or count.store != 0:
        failed = other_stages(t, x, p, m, step, now.line != 0, w, iw, ctx)
        if count.store != 0 or not straight(iw):
            dense_output(x, step, w)
        for j in range(N):
            w.coef[j] = x[j]
    cause, surface, theta, slope = NOTHING, -1, 2.0, 0.0
    if look and failed == 0:
        cause, surface, theta, slope = locate(t, p, m, order, step, w, iw, ctx)
    if cause <= LOST or failed == 2:
        # Multipliers without a value somewhere in the step have left their sets before that.
        clock.grow = 1.0
        return shorten(run, 0.125 * abs(step))
    if failed == 1 or cause == -1:
        return USER_ERROR
    if look and iw.pieces > PIECES:
        # Guards that vary faster than the solution: longer steps cost more and hide events.
        clock.step = min(clock.step, abs(step) * float(PIECES) / float(iw.pieces))
    if RESETS and cause == NOTHING:
        surface, ago = reached_before(te, w.y, shift(w.k, (STAGES - 1) * N), m, order, -1, w)
        if surface >= 0 and ago < abs(step):
            cause, theta = ROOT, 1.0 - ago / abs(step)
    if cause == NOTHING and now.last != 0:
        surface = event_at_end(te, w.y, p, clock.t_start, m, order, w, ctx)
        if surface >= 0:
            cause, theta = ROOT, 1.0
        elif look and iw.sliding > 0:
            cause, surface, slope = exit_at_end(run)
            theta = 1.0
    if cause == NOTHING:
        return carry_on(run)
    if cause == ROOT and hides_order(t, theta * abs(step), abs(step)):
        return shorten(run, 4.0 * theta * abs(step))
    now.cause, now.surface, now.theta, now.slope = cause, surface, theta, slope
    return GO_ON


@seldom
@kernel
def shorten(run: Trajectory, length: float) -> int:
    """Take another step instead of one that was accepted."""
    go_back(run)
    run.count.rejected += 1
    run.count.steps -= 1
    run.clock.step = length
    return AGAIN


@inline
@kernel
def land_here(run: Trajectory, slope: float) -> int:
    """Land on the event that was found."""
    now = run.now
    failed, now.length, now.dense_length, now.residual = land(
        now.t, run.x, run.p, run.m, now.cause, now.surface, now.step, now.theta, slope, now.line != 0,
        run.w.xe, run.clock.rtol, run.atol, run.w, run.iw, run.ctx,
    )  # fmt: skip
    return failed


@inline
@kernel
def land_first(run: Trajectory) -> int:
    """Land on the event, or on one that was passed on the way; the code of `land`."""
    p, m, w, iw, ctx, now = run.p, run.m, run.w, run.iw, run.ctx, run.now
    failed = land_here(run, now.slope)
    for _ in range(M if M > 1 and (RESETS or LINEAR[now.surface] == 0) else 0):
        t = now.t + now.length
        if failed == 0:
            failed = field(t, w.xe, p, m, w.f, w, iw, ctx)
        if failed == 0:
            failed = guard_state(t, w.xe, p, m, w.f, w.end, w, ctx)
        first, ago = reached_before(t, w.xe, w.f, m, run.order, now.surface, w)
        if failed != 0 or first < 0 or ago >= abs(now.length):
            break
        now.cause, now.surface, now.theta = ROOT, first, (now.length - w.direction * ago) / now.step
        failed = land_here(run, 0.0)
    return failed


# The largest distance from the end of its set of a multiplier that should have reached it.
ASTRAY_FROM_END = 1e-3


@seldom
@kernel
def astray(run: Trajectory) -> bool:
    """Whether a landing on the end of a multiplier's set has led to another root of the multipliers."""
    now, w, i = run.now, run.w, run.now.surface
    if now.cause != UPPER and now.cause != LOWER:  # noqa: PLR1714 - the kernel language has no `in`
        return False
    end = w.radius[2 * i + 1] if now.cause == UPPER else w.radius[2 * i]
    return not (abs(w.mult[i].value - end) <= ASTRAY_FROM_END * (1.0 + abs(end)))


# How far beyond 0 a guard that contains a root is at an event after its own, relative to its value before.
SKIPPED = 1e-6


@seldom
@kernel
def skipped(run: Trajectory) -> bool:
    """Whether a guard that contains a root changed its sign on the way to the surface where that vanishes.

    It may do so in less time than the step resolves.
    """
    w, now = run.w, run.now
    for j in range(M):
        w.s[j] = 0.0 if j == now.surface and CONTACT[j] == 0 else run.m[j]
    if guards(now.t + now.length, w.xe, run.p, w.s, w.h, run.ctx) != 0:
        return False
    for j in range(M):
        off = ROOTED[j] != 0 and run.m[j] != 0.0 and j != now.surface and run.order[j] == 0
        if off and run.m[j] * w.h[j] < -SKIPPED * abs(w.start[2 * j]):
            return True
    return False


@inline
@kernel
def arrive(run: Trajectory) -> int:
    """Land on the event, and store the dense output up to it."""
    clock, count, now, w = run.clock, run.count, run.now, run.w
    t, step = now.t, now.step
    go_back(run)
    failed = land_first(run)
    if failed == 1:
        return USER_ERROR
    if not AFFINE and run.iw.sliding > 1 and failed == 0 and astray(run):
        failed = NOT_CONVERGED
    if ROOTS and now.cause == ROOT and failed == 0 and skipped(run):
        failed = NOT_CONVERGED
    # A landing beyond the end of the run by more than the accuracy of events is none: the state is not there.
    late = (t + now.length - clock.t_end) * w.direction
    if failed == 0 and late > BEYOND_END * max(abs(clock.t_end), abs(step)):
        failed = NOT_CONVERGED
    if failed == NOT_CONVERGED:
        go_back(run)
        count.rejected += 1
        clock.step = 0.25 * abs(step)
        return AGAIN
    length, last_k = now.length, shift(w.k, (STAGES - 1) * N)
    # The end of the method's step, not of what was corrected since.
    dense = now.dense_length if now.dense_length != 0.0 else length
    for j in range(N):
        w.xd[j] = w.xe[j] if dense == length else w.xd[j]
    if CLAMPED and now.cause == ROOT and failed == 0 and now.line == 0:
        # Such a field is clamped in stages beyond the surface, and a step across may look exact.
        if END_IN_ERROR:
            field(t + dense, w.xd, run.p, run.m, last_k, w, run.iw, run.ctx)
        error = error_of(run, dense, w.xd)
        if error > 1.0:
            count.steps -= 1
            return reject(run, length, error)
    # An event that was missed at the end of the run may have been long before it.
    there = abs(step - length) <= SAME_END * max(abs(clock.t_end), abs(step))
    te = t + length
    if (now.last != 0 and now.theta >= 1.0 and there) or (te - clock.t_end) * w.direction > 0.0:
        te = clock.t_end
    now.t_end = te
    now.dense_length = dense
    if count.store != 0 and te != t:
        field(t + dense, w.xd, run.p, run.m, last_k, w, run.iw, run.ctx)
        other_stages(t, run.x, run.p, run.m, dense, now.line != 0, w, run.iw, run.ctx)
        dense_output(run.x, dense, w)
        store_step(count, t, dense, run.rec, run.rec_coef, w)
    return ARRIVED
