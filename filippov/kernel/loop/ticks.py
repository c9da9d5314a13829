"""Time events: the next instants of clocks, and simple events at an instant.

Simple: forwards in time, at most one reset is due, no surface with a reset is near before or after it, and
after it every h is clearly nonzero, or only one surface is slid on, before and after, and its rates decide
whether the slide lasts. All else is left to the classification (`filippov.solving.resets.jumps`).
"""

from filippov.kernel.language.primitives import INF, NAN, Vector, kernel, rint, shift_indices
from filippov.kernel.loop.control import finite
from filippov.kernel.loop.field import field, set_mode
from filippov.kernel.loop.land import guard_scale
from filippov.kernel.loop.model import (
    CONTACT,
    G_COLUMN,
    G_FIRST,
    HELD,
    RESET_FROM,
    RESETS,
    ROLE,
    WIDTH,
    M,
    N,
    gradients,
    guards,
    resets,
    rhs,
)
from filippov.kernel.loop.record import count_down, record_event
from filippov.kernel.loop.start import on_one_surface
from filippov.kernel.loop.state import Scratch, Tick, Trajectory
from filippov.kernel.tables.codes import (
    AGAIN,
    CROSSING_DOWN,
    CROSSING_UP,
    EVENTS_FULL,
    EXIT_DOWN,
    EXIT_UP,
    OVER_DOWN,
    OVER_UP,
    REACHED,
    STOPPED,
    STOPS,
    SWITCHING,
    TIME,
    TIME_RESET,
)
from filippov.kernel.tables.layout import EPS

# Roundings within which instants are one; an event on a surface belongs to an instant this close to it,
# relative to the time run.
ONE_INSTANT, SAME = 32.0, 1e-12
# The rounding error of h, in EPS of its terms: twice what the classification counts as on the surface.
ON_IT = 128.0
# The code of `field` where no multipliers hold the solution on the surfaces.
LOOSE = 2
# The least distance of a multiplier from the ends of its set, relative to the set.
ROOM = 4e-6


@kernel
def same_time(t: float, start: float) -> float:
    """How close to t an instant counts as t, if it is not nearer to the next one of its clock."""
    return ONE_INSTANT * EPS * max(abs(t), abs(t - start))


@kernel
def located_time(t: float, start: float) -> float:
    """How close to an instant t an event on a surface counts as one of it: as it is located."""
    return SAME * abs(t - start) + same_time(t, start)


@kernel
def following(tick: Tick, instants: Vector, t: float) -> float:
    """The first instant of a time event after t, INF without one: start + k period, or one of a list."""
    if tick.listed > 0:
        low, high = tick.first, tick.first + tick.listed
        while low < high:
            middle = (low + high) // 2
            if instants[middle] <= t:
                low = middle + 1
            else:
                high = middle
        return instants[low] if low < tick.first + tick.listed else INF
    k = max(rint((t - tick.start) / tick.period) - 2.0, 0.0)
    while tick.start + k * tick.period <= t:
        # Numbers beyond 2**53 do not grow by 1.
        k += max(1.0, EPS * k)
    return tick.start + k * tick.period


@kernel
def preceding(tick: Tick, instants: Vector, t: float) -> float:
    """The last instant of a time event before t, -INF without one."""
    if tick.listed > 0:
        low, high = tick.first, tick.first + tick.listed
        while low < high:
            middle = (low + high) // 2
            if instants[middle] < t:
                low = middle + 1
            else:
                high = middle
        return instants[low - 1] if low > tick.first else -INF
    k = rint((t - tick.start) / tick.period) + 2.0
    while k >= 0.0 and tick.start + k * tick.period >= t:
        k -= max(1.0, EPS * k)
    return tick.start + k * tick.period if k >= 0.0 else -INF


@kernel
def aim(run: Trajectory) -> None:
    """Direct the loop to the next instant, or to the end of the run; note what is due there."""
    clock, count, ticks = run.clock, run.count, run.ticks
    slack, first = same_time(clock.t, clock.t_start), INF
    for i in range(count.ticks):
        ticks[i].next = following(ticks[i], run.instants, clock.t + min(slack, ticks[i].gap))
        first = min(first, ticks[i].next)
    slack, count.due = same_time(first, clock.t_start), 0
    within = first - clock.t_final <= same_time(clock.t_final, clock.t_start)
    for i in range(count.ticks):
        ticks[i].due = 1 if within and ticks[i].next - first <= min(slack, ticks[i].gap) else 0
        count.due += ticks[i].due
    clock.t_end = min(first, clock.t_final)
    clock.same_instant = located_time(first, clock.t_start) if count.due > 0 else 0.0
    clock.instant = clock.t_end if count.due > 0 else NAN


@kernel
def grain(i: int, t: float, x: Vector, start: float, w: Scratch) -> float:
    """The rounding error of h_i: that of its terms, and its rate times that of the time."""
    flow = abs(w.gt[i])
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        flow += abs(w.g[i * N + G_COLUMN[a]] * w.f[G_COLUMN[a]])
    return float(ON_IT * EPS * (guard_scale(i, t, x, w) + max(abs(t), abs(t - start)) * flow))


@kernel
def look(run: Trajectory, t: float, x: Vector) -> bool:
    """Field, guards and gradients of the present mode at a state; whether there are any.

    Where no multipliers hold the solution on its sliding surfaces, the field is that of the upper sides.
    """
    p, m, w, iw, ctx = run.p, run.m, run.w, run.iw, run.ctx
    set_mode(m, iw)
    failed = field(t, x, p, m, w.f, w, iw, ctx)
    if failed == LOOSE:
        for i in range(M):
            w.s[i] = m[i] if m[i] != 0.0 else 1.0
        iw.calls += 1
        failed = rhs(t, x, p, w.s, m, w.f, ctx)
    failed += guards(t, x, p, m, w.h, ctx) + gradients(t, x, p, m, w.g, w.gt, ctx)
    return failed == 0 and finite(w.f, N) and finite(w.h, M)


@kernel
def slid_on(m: Vector) -> int:
    """The only surface that is slid on, -1 for none, -2 where the case is not simple."""
    found = -1
    for i in range(M):
        if HELD[i] != 0:
            return -2
        if m[i] == 0.0:
            if found != -1 or CONTACT[i] != 0 or ROLE[i] != SWITCHING:
                return -2
            found = i
    return found


@kernel
def sides(run: Trajectory, t: float, y: Vector) -> int:
    """Signs of all surfaces at the state after a reset: -1 where all are clear, or the surface it is on.

    -2 where that is not simple.
    """
    start, m, w, on = run.clock.t_start, run.m, run.w, -1
    # Twice: the sizes |h| inside other guards follow the signs found first.
    for _ in range(2):
        if not look(run, t, y):
            return -2
        on = -1
        for i in range(M):
            if WIDTH[i] > 0.0:
                m[i] = -m[i] if m[i] * w.h[i] < -WIDTH[i] else m[i]
            elif abs(w.h[i]) > max(w.row[M + i], grain(i, t, y, start, w)):
                m[i] = 1.0 if w.h[i] > 0.0 else -1.0
                if RESETS and RESET_FROM[i] != 0 and m[i] != w.before[i]:
                    return -2
            elif w.before[i] == 0.0:
                m[i], on = 0.0, i
            else:
                return -2
    return on


@kernel
def jump(run: Trajectory, t: float, i: int) -> bool:
    """State after the reset of time event i into w.jump, and the mode there; False where it is not simple."""
    clock, x, p, m, order, w, ctx = run.clock, run.x, run.p, run.m, run.order, run.w, run.ctx
    y, lam = w.jump, w.row
    if slid_on(m) == -2 or not look(run, t, x):
        return False
    for j in range(M):
        w.row[M + j] = grain(j, t, x, clock.t_start, w)
        if RESETS and RESET_FROM[j] != 0 and not (m[j] * w.h[j] > w.row[M + j]):
            return False
    if resets(M + i, t, x, p, m, y, ctx) != 0 or not finite(y, N):
        return False
    on = sides(run, t, y)
    if on == -2:
        return False
    for j in range(M):
        order[j] = 0
    if on >= 0:
        m[on] = 1.0 if w.h[on] >= 0.0 else -1.0
        code = on_one_surface(run, t, y, lam, on)
        lo, hi = w.radius[2 * on], w.radius[2 * on + 1]
        room = min(lam[on] - lo, hi - lam[on])
        if m[on] != 0.0:
            # The step size of a slide says nothing about the solution that leaves it.
            clock.step = 0.0
        return code == REACHED and order[on] != 2 and (m[on] != 0.0 or room > ROOM * (hi - lo))
    return True


@kernel
def record_due(run: Trajectory, kind: int) -> None:
    """Record the events at an instant: one set with those just recorded (E5)."""
    together = abs(run.clock.event_t - run.now.t_end) <= run.clock.same_instant
    record_event(run, kind)
    run.marks[run.count.events * (3 + 2 * M) - 1] = 1 if together else 0


@kernel
def note_changes(run: Trajectory) -> int:
    """Record the signs that a reset has changed; STOPPED where the run is to end with one of them."""
    m, w, now, code = run.m, run.w, run.now, AGAIN
    for i in range(M):
        if m[i] == w.before[i]:
            continue
        up = m[i] > 0.0
        kind, counted = OVER_UP if up else OVER_DOWN, CROSSING_UP if up else CROSSING_DOWN
        if w.before[i] == 0.0:
            kind = counted = EXIT_UP if up else EXIT_DOWN
        now.surface, now.residual = i, abs(w.h[i])
        record_due(run, kind)
        if count_down(shift_indices(run.stop, STOPS * i), counted) != 0:
            run.count.surface, code = i, STOPPED
    return code


@kernel
def tick(run: Trajectory) -> int:
    """Carry out what is due at an instant, where simple; REACHED where the classification has to decide."""
    clock, count, x, m, w, now = run.clock, run.count, run.x, run.m, run.w, run.now
    if count.events + M >= count.event_room:
        return EVENTS_FULL
    t, moving = clock.t_end, -1
    for i in range(count.ticks):
        if run.ticks[i].due != 0 and run.ticks[i].moves != 0:
            if moving >= 0:
                return REACHED
            moving = i
    for i in range(M):
        w.before[i], run.lam[i] = m[i], w.mult[i].value
    code = AGAIN
    now.t_end, now.multiplier = t, NAN
    if moving >= 0:
        if not jump(run, t, moving):
            # Restored.
            for i in range(M):
                m[i] = w.before[i]
                w.mult[i].value = run.lam[i]
            return REACHED
        code = note_changes(run)
    for i in range(count.ticks):
        if run.ticks[i].due != 0:
            now.surface, now.residual = M + i, 0.0
            record_due(run, TIME_RESET if run.ticks[i].moves != 0 else TIME)
    clock.t, now.renew, run.count.rested = t, 1, 0
    if moving >= 0:
        for j in range(N):
            x[j] = w.jump[j]
        clock.trend, clock.grow, clock.relative = 1e-300, 10.0, min(clock.relative, 0.0)
    aim(run)
    return code
