"""A step of the loop: its length, its stages, and whether it is accepted."""

from filippov.kernel.language.primitives import NAN, Vector, apart, inline, kernel, seldom, shift, truncate
from filippov.kernel.loop.control import (
    at_rest,
    error_norm,
    finite,
    go_straight,
    guard_state,
    least_step,
    shrink_invalid,
    step_factor,
    uniform,
)
from filippov.kernel.loop.field import clear_ranges, field, project
from filippov.kernel.loop.land import project_on
from filippov.kernel.loop.model import AFFINE, END_IN_ERROR, IMPLICIT, STAGES, WIDTH, M, N, stages, unsolved
from filippov.kernel.loop.state import Trajectory
from filippov.kernel.tables.codes import (
    AGAIN,
    ARRIVED,
    GO_ON,
    MIN_STEP,
    NO_SLIDING,
    NOT_FINITE,
    NOTHING,
    ROOT,
    USER_ERROR,
)
from filippov.kernel.tables.layout import EPS
from filippov.kernel.tables.radau_tables import NOT_CONVERGED


@inline
@kernel
def choose_step(run: Trajectory) -> int:
    """The step that control proposes, cut at the end of the run; MIN_STEP where t cannot take it."""
    clock, now = run.clock, run.now
    t, remaining = now.t, clock.t_end - now.t
    step = run.w.direction * min(clock.step, clock.max_step)
    last = abs(step) >= abs(remaining) * (1.0 - 1e-12)
    if last:
        step = remaining
    elif abs(step) <= least_step(t, clock.t_start, clock.t_end):
        if run.count.rested != 0 or not at_rest(run.w):
            return MIN_STEP
        # The equilibrium of a non-Lipschitz field was reached by ever shorter steps; staying there needs
        # none.
        run.count.rested = 1
        clock.step = max(1024.0 * EPS * abs(t), 1e-12 * abs(remaining))
        return AGAIN
    elif now.taken == 0.0:
        # State and time must advance by the same step, also where t is large.
        step = (t + step) - t
    now.step, now.last = step, 1 if last else 0
    now.t_end = clock.t_end if last else t + step
    now.relative = truncate(abs(clock.relative)) - 1
    now.kept = 1 if clock.relative < 0.0 else 0
    now.slack = 1.0
    if now.kept != 0:
        now.slack = max(abs(t - clock.fast_from), clock.fast_span)
    elif now.relative >= 0:
        now.slack = max(1.0, clock.fast_span / abs(t + step - clock.fast_from))
    return GO_ON


@inline
@kernel
def error_of(run: Trajectory, step: float, y: Vector) -> float:
    """The square of the error of a step from x to y."""
    clock, now = run.clock, run.now
    return error_norm(
        run.x, y, step, clock.rtol, run.atol, now.relative, now.kept, now.slack, clock.start_noise, run.w
    )


@apart
@kernel
def keep_multipliers(run: Trajectory) -> None:
    """Remember the multipliers at the start of a step, from which Newton's method goes on."""
    for c in range(run.iw.sliding):
        i = run.iw.listed[c]
        run.lam[i] = run.w.mult[i].value


@apart
@kernel
def go_back(run: Trajectory) -> None:
    """Restore the multipliers of the start of a step: from those of a trial Newton's method may go astray."""
    if not AFFINE and run.iw.sliding > 1:
        for c in range(run.iw.sliding):
            i = run.iw.listed[c]
            run.w.mult[i].value = run.lam[i]


@kernel
def reject(run: Trajectory, length: float, error: float) -> int:
    """Shorten the step after one whose error is too large."""
    go_back(run)
    clock = run.clock
    run.count.rejected += 1
    clock.step = abs(length) * max(0.2, step_factor(error))
    clock.grow = 1.0
    return AGAIN


@inline
@kernel
def try_step(run: Trajectory) -> int:
    """Stages of the step and, if accepted, field and guards at its end; a lane's step is taken over."""
    x, m, p, w, iw, ctx, now = run.x, run.m, run.p, run.w, run.iw, run.ctx, run.now
    t, step, te, y, last_k = now.t, now.step, now.t_end, w.y, shift(w.k, (STAGES - 1) * N)
    failed, error, fresh = 0, now.taken, now.taken == 0.0
    if fresh:
        clear_ranges(w, iw)
        if not AFFINE and iw.sliding > 1:
            keep_multipliers(run)
        failed = stages(t, x, p, m, step, y, w, iw, ctx)
        error = NAN
    line = failed == 0 and not IMPLICIT and uniform(w)
    now.line = 1 if line else 0
    if fresh and line:
        go_straight(x, step, y, w)
    if fresh and failed == 0 and END_IN_ERROR:
        failed = field(t + step, y, p, m, last_k, w, iw, ctx)
    if fresh and failed == 0:
        error = error_of(run, step, y)
    if error > 1.0 and error < 1e300:
        return reject(run, step, error)
    if fresh and error <= 1.0:
        if iw.sliding > 0:
            failed = project(te, y, p, m, w.h, w, iw, ctx)
        if failed == 0 and (iw.sliding > 0 or not END_IN_ERROR):
            failed = field(te, y, p, m, last_k, w, iw, ctx)
        if IMPLICIT and failed == 0 and unsolved(te, y, p, m, step, last_k, w, iw, ctx):
            failed = NOT_CONVERGED
        if failed == 0:
            failed = guard_state(te, y, p, m, last_k, w.end, w, ctx)
    now.taken, now.error = 0.0, error
    now.cause, now.surface, now.theta, now.slope = NOTHING, -1, 2.0, 0.0
    now.length, now.dense_length, now.residual = step, step, 0.0
    if failed == 1:
        return USER_ERROR
    if failed == 0 and error <= 1.0 and finite(last_k, N) and finite(y, N) and finite(w.end, 2 * M):
        return GO_ON
    return shrink(run, failed)


@seldom
@kernel
def shrink(run: Trajectory, failed: int) -> int:
    """A shorter step after an invalid one; ARRIVED where a surface is one rounding away."""
    go_back(run)
    clock, now, w = run.clock, run.now, run.w
    run.count.rejected += 1
    length, surface = shrink_invalid(clock, run.m, run.order, now.step, w)
    clock.grow = 2.0
    clock.step = length
    if surface < 0:
        if length > least_step(now.t, clock.t_start, clock.t_end):
            return AGAIN
        return NO_SLIDING if failed == 2 else MIN_STEP if failed == NOT_CONVERGED else NOT_FINITE
    # The solution has arrived, without a step across.
    now.cause, now.surface = ROOT, surface
    clock.step = abs(now.step)
    now.t_end = now.t
    for j in range(N):
        w.xe[j] = run.x[j]
    if WIDTH[surface] != 0.0 or run.iw.sliding > 0:
        return ARRIVED
    failed = project_on(now.t, w.xe, run.p, run.m, surface, clock.rtol, run.atol, w, run.ctx)
    return USER_ERROR if failed != 0 else ARRIVED
