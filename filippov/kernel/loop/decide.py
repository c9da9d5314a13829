"""An event that has been reached: simultaneous events, its kind, and the mode that follows."""

from filippov.kernel.language.primitives import NAN, inline, kernel, seldom, shift_indices
from filippov.kernel.loop.control import guard_state, guards_on, mark_triggers
from filippov.kernel.loop.corner_event import leave_corner, reach_corner, take_corner
from filippov.kernel.loop.event_cycle import fading, faint, settling, zeno_horizon, zeno_remaining
from filippov.kernel.loop.field import field
from filippov.kernel.loop.model import (
    COMPONENT,
    LINEAR,
    OBSERVED,
    RESET_FROM,
    RESETS,
    ROLE,
    ROOTS,
    WIDTH,
    M,
    N,
    radii,
)
from filippov.kernel.loop.record import count_down, record_event
from filippov.kernel.loop.reset import apply_reset, resets_from
from filippov.kernel.loop.resolve import (
    resolve_exit,
    resolve_root,
    resolve_touch,
    touch_or_root,
)
from filippov.kernel.loop.roots.locate import BOUND_TOLERANCE
from filippov.kernel.loop.simultaneous import (
    all_changed,
    decide_each,
    record_reset,
    set_observers_apart,
    take_observers,
)
from filippov.kernel.loop.state import Trajectory
from filippov.kernel.tables.codes import (
    AGAIN,
    CORNER,
    EXIT_DOWN,
    EXIT_UP,
    GENERAL,
    GRAZING,
    NONE,
    OBSERVER,
    RESET,
    ROOT,
    STOPPED,
    STOPS,
    TOUCH,
    USER_ERROR,
    ZENO,
)
from filippov.kernel.tables.layout import EPS


@inline
@kernel
def kind_of(run: Trajectory) -> int:
    """The kind of an event on one surface, with the mode after it; NONE if not simple, -1 on failure."""
    clock, x, m, order, p = run.clock, run.w.xe, run.m, run.order, run.p
    w, iw, ctx, now = run.w, run.iw, run.ctx, run.now
    te, surface, cause = now.t_end, now.surface, now.cause
    # A reset at the instant of a clock belongs to the same set of events.
    due = clock.same_instant > 0.0 and (clock.t_end - te) * w.direction <= clock.same_instant
    # Roots of a guard that is followed relative to itself are known to a part of the last cycle.
    cycle = max(abs(te - clock.fast_from), clock.fast_span) if clock.relative < 0.0 else 0.0
    told = cause == ROOT or clock.relative < 0.0  # elsewhere the mode after a tangency is the same
    if told and settling(run, faint(te, x, p, m, surface, te - now.t, clock.rtol * cycle, w, iw, ctx)):
        return NONE
    if fading(run):
        return NONE
    if cause == TOUCH:
        return resolve_touch(te, x, p, m, surface, w, iw, ctx)
    if cause == ROOT:
        if RESETS and RESET_FROM[surface] != 0 and (w.direction < 0.0 or due):
            return NONE
        if WIDTH[surface] > 0.0 and w.direction < 0.0:  # the sign before is not determined
            return NONE
        if RESETS and resets_from(surface, m[surface]):
            return apply_reset(te, x, p, m, order, surface, w, iw, ctx)
        # The sign of the surface acts on the multipliers of the surfaces coupled to it.
        if M > 1 and iw.coupled[COMPONENT[surface]] > 0:
            return reach_corner(run)
        rate = w.end[2 * surface + 1] * w.direction
        return resolve_root(te, x, p, m, order, surface, rate, w, iw, ctx)
    if now.residual <= BOUND_TOLERANCE * (abs(w.row[surface]) + abs(w.row[M + surface])):
        if M > 1 and iw.coupled[COMPONENT[surface]] > 1:
            return leave_corner(run)
        cycles = run.zeno[surface]
        lasted = abs(te - (cycles.last if cycles.interval[0] > 0.0 else clock.t_start))
        return resolve_exit(m, order, cause, surface, now.slope, lasted, w, iw)
    return NONE


@seldom
@kernel
def leave_it(run: Trajectory) -> int:
    """Leave the event to the classification."""
    for i in range(M):
        if run.trigger[i] != 0:
            run.w.grazed[i] = 1.0
    return GENERAL


@inline
@kernel
def decide(run: Trajectory) -> int:
    """Decide an event on `now.surface` at (now.t_end, w.xe) where it is simple, else GENERAL."""
    m, p, w, iw, ctx, now = run.m, run.p, run.w, run.iw, run.ctx, run.now
    t, te, xe, surface = now.t, now.t_end, w.xe, now.surface
    for i in range(M):
        w.before[i] = m[i]
    failed = field(te, xe, p, m, w.f, w, iw, ctx)
    if (
        failed == 1
        or guard_state(te, xe, p, m, w.f, w.end, w, ctx) != 0
        or (ROOTS and guards_on(te, xe, p, m, run.order, surface, w.f, w.end, w, ctx) != 0)
        or radii(te, xe, p, w.radius, ctx) != 0
    ):
        return USER_ERROR
    if now.cause == ROOT and m[surface] != 0.0 and te != t:
        now.cause = touch_or_root(surface, te - t, m, w)
    run.count.surface, run.count.cause = surface, now.cause
    triggered = mark_triggers(te, xe, m, run.order, now.cause, surface, now.step, run.trigger, w)
    now.observers = 0
    if OBSERVED:
        triggered = set_observers_apart(run, triggered)
        surface = now.surface
    now.multiplier = w.mult[surface].value if m[surface] == 0.0 else NAN
    kind = NONE
    if failed == 0 and triggered == 1:
        kind = kind_of(run)
    elif failed == 0 and M > 1:
        kind = decide_each(run)
    if now.observers > 0 and kind > NONE and kind != RESET and not all_changed(run):
        kind = NONE
    if kind == -1:
        return USER_ERROR
    run.clock.t = te
    for j in range(N):
        run.x[j] = xe[j]
    if kind == NONE:
        return leave_it(run)
    code = take_corner(run) if kind == CORNER else take(run, kind)
    return take_observers(run, code) if now.observers > 0 and kind != RESET and code != STOPPED else code


@inline
@kernel
def take(run: Trajectory, kind: int) -> int:
    """Record a decided event and go on in the mode after it, unless the run ends with it."""
    clock, x, m, order, w, now = run.clock, run.x, run.m, run.order, run.w, run.now
    t, te, surface = now.t, now.t_end, now.surface
    for i in range(M):
        if i != surface and m[i] != 0.0:
            order[i] = 0
    if kind == GRAZING:
        order[surface] = 2
        w.grazed[surface] = 1.0
    if m[surface] == 0.0:
        now.multiplier = w.mult[surface].value
        run.zeno[surface].widest = 0.0
    ended = -1
    if M > 1 and RESETS and kind == RESET:
        ended = record_reset(run)
    else:
        record_event(run, kind)
    if kind == RESET:
        for j in range(N):
            x[j] = w.jump[j]
    now.renew = 1
    clock.trend = 1e-300
    if kind == EXIT_UP or kind == EXIT_DOWN:  # noqa: PLR1714, SIM109 - the kernel language has no `in`
        # The step size of a slide says nothing about the solution that leaves it.
        clock.step = 0.0
    if LINEAR[surface] == 0 and abs(te - t) < 0.25 * abs(now.step):
        # A guard that varies faster than the solution: the next event is about as far away.
        clock.step = min(clock.step, 4.0 * abs(te - t) + 1e3 * EPS * abs(te))
    if clock.relative == -float(surface) - 1.0:
        clock.fast_span, clock.fast_from = abs(te - clock.fast_from), te
    clock.relative = min(clock.relative, 0.0)
    if count_down(shift_indices(run.stop, STOPS * surface), kind) != 0:
        return STOPPED
    if ended >= 0:
        run.count.surface = ended
        return STOPPED
    if ROLE[surface] != OBSERVER and kind != GRAZING:
        cycles = run.zeno[surface]
        horizon = zeno_horizon(te, clock.t_start, w.xe, surface, cycles, w)
        if zeno_remaining(cycles, te, horizon) >= 0.0:
            return ZENO
    return AGAIN
