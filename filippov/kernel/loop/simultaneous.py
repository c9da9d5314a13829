"""Several surfaces at one instant: observers of one that also switches, and surfaces that do not interact.

An observer, or a user event, whose function is that of a surface which switches the field (h, but for a
factor) is reached where that is: what happens there is decided as if it were not there, and it follows.
Surfaces whose signs do not act on each other's rates are decided one by one. All else is left to
`filippov.solving.selection`.
"""

from filippov.kernel.language.primitives import NAN, apart, kernel, seldom, shift_indices
from filippov.kernel.loop.corner_event import SHORT_CYCLE, change_kind, note_multipliers, put_back
from filippov.kernel.loop.event_cycle import faint
from filippov.kernel.loop.model import (
    COMPONENT,
    EVENT_SIZE,
    NON_LIPSCHITZ,
    RESET_FROM,
    ROLE,
    SAME_AS,
    WIDTH,
    M,
    N,
)
from filippov.kernel.loop.record import count_down, record_event
from filippov.kernel.loop.resolve import resolve_root
from filippov.kernel.loop.state import Trajectory
from filippov.kernel.tables.codes import (
    CORNER,
    CROSSING_DOWN,
    CROSSING_UP,
    GRAZING,
    KINK,
    NONE,
    OVER_DOWN,
    OVER_UP,
    RESET,
    ROOT,
    STOPPED,
    STOPS,
    TOUCH,
)


@kernel
def observed(i: int) -> int:
    """The surface whose function observer i has, -1 for none."""
    return abs(SAME_AS[i]) - 1


@apart
@seldom
@kernel
def set_observers_apart(run: Trajectory, triggered: int) -> int:
    """How many of the surfaces triggered are left to decide without those that only observe others.

    The surface located becomes the one that switches; `now.observers` is the number of observers that follow
    one of these. Others are not reached: those of surfaces that are slid on, and stay so.
    """
    now, seen, left = run.now, 0, triggered
    if now.cause == TOUCH:
        return triggered
    for i in range(M):
        if SAME_AS[i] == 0:
            continue
        k = observed(i)
        if run.trigger[k] != 0:
            # Also where the observer has not been seen off 0 since it was reached last.
            left += 1 if run.trigger[i] == 0 else 0
            run.trigger[i] = ROOT
            seen += 1
        elif run.trigger[i] != 0 and (run.m[k] != 0.0 or i == now.surface):
            return left
    for i in range(M):
        if SAME_AS[i] != 0 and run.trigger[i] != 0:
            left -= 1
            run.trigger[i] = ROOT if run.trigger[observed(i)] != 0 else 0
    if seen > 0:
        note_multipliers(run)
        if SAME_AS[now.surface] != 0:
            now.surface = observed(now.surface)
            run.count.surface = now.surface
    now.observers = seen
    return left


@seldom
@kernel
def plain_root(run: Trajectory, i: int) -> bool:
    """Whether surface i is reached as by itself: no reset, no accumulation, nothing slid on acts on it."""
    w, iw, te, cycles = run.w, run.iw, run.now.t_end, run.zeno[i]
    if run.trigger[i] != ROOT or RESET_FROM[i] != 0 or cycles.slow != 0.0 or iw.coupled[COMPONENT[i]] > 0:
        return False
    if ROLE[i] > KINK or (WIDTH[i] > 0.0 and w.direction < 0.0):
        return False
    for k in range(i):
        if run.trigger[k] != 0 and SAME_AS[k] == 0 and COMPONENT[k] == COMPONENT[i]:
            return False
    if cycles.interval[0] > 0.0 and abs(te - cycles.last) <= SHORT_CYCLE * abs(te - run.clock.t_start):
        return False
    return not faint(te, w.xe, run.p, run.m, i, te - run.now.t, 0.0, w, iw, run.ctx)


@apart
@seldom
@kernel
def decide_each(run: Trajectory) -> int:
    """CORNER with the mode after several surfaces reached at once that do not act on each other, or NONE."""
    m, w, now = run.m, run.w, run.now
    if NON_LIPSCHITZ or run.clock.relative != 0.0 or now.cause != ROOT:
        return NONE
    for i in range(M):
        follows = SAME_AS[i] != 0 and run.trigger[observed(i)] != 0 and now.observers > 0
        if run.trigger[i] != 0 and not follows and not plain_root(run, i):
            return NONE
    note_multipliers(run)
    for i in range(M):
        if run.trigger[i] == 0 or SAME_AS[i] != 0:
            continue
        rate = w.end[2 * i + 1] * w.direction
        kind = resolve_root(now.t_end, w.xe, run.p, m, run.order, i, rate, w, run.iw, run.ctx)
        if kind == -1:
            return -1
        if kind == NONE:
            return put_back(run)
    return CORNER


@apart
@seldom
@kernel
def all_changed(run: Trajectory) -> bool:
    """Whether every surface that is observed has changed its mode; else what was decided is put back."""
    for i in range(M):
        if SAME_AS[i] != 0 and run.trigger[i] == ROOT and run.m[observed(i)] == run.w.before[observed(i)]:
            put_back(run)
            return False
    return True


@seldom
@kernel
def record_observer(run: Trajectory, i: int) -> int:
    """Record that observer i is reached, as part of the set; 1 where the run is to end."""
    now, w, kind = run.now, run.w, change_kind(run.w.before[i], run.m[i])
    kind = GRAZING if kind == NONE else kind
    now.surface, now.multiplier, now.residual = i, NAN, abs(w.end[2 * i])
    record_event(run, kind)
    run.marks[run.count.events * (3 + 2 * M) - 1] = 1
    return count_down(shift_indices(run.stop, STOPS * i), kind)


@apart
@kernel
def record_reset(run: Trajectory) -> int:
    """Record a reset and what it changes besides, as one set; a surface that ends the run with it, or -1.

    An observer of the surface has been reached, by the way of the solution to it. What the state has jumped
    over has changed its sign.
    """
    m, w, now, reset, found, first = run.m, run.w, run.now, run.now.surface, -1, True
    residual, multiplier = now.residual, now.multiplier
    for i in range(M):
        follows = SAME_AS[i] != 0 and now.observers > 0 and observed(i) == reset
        if follows:
            m[i] = -w.before[i]
        if i != reset and m[i] == w.before[i]:
            continue
        up = m[i] > 0.0
        counted = CROSSING_UP if up else CROSSING_DOWN
        kind = counted if follows else (OVER_UP if up else OVER_DOWN)
        now.surface, now.residual, now.multiplier = i, abs(w.end[2 * i]), NAN
        if i == reset:
            kind, now.residual, now.multiplier = RESET, residual, multiplier
        record_event(run, kind)
        for j in range(N):
            run.events[run.count.events * EVENT_SIZE - N + j] = w.jump[j]
        if not first:
            run.marks[run.count.events * (3 + 2 * M) - 1] = 1
        first = False
        if i != reset and count_down(shift_indices(run.stop, STOPS * i), counted) != 0:
            found = i
        if follows:
            # From where the state is put it goes on as the surface itself, or stays.
            sign = m[reset] if SAME_AS[i] > 0 else -m[reset]
            w.grazed[i] = 1.0 if sign == 0.0 else 0.0
            m[i] = m[i] if sign == 0.0 else sign
            run.order[i] = run.order[reset] if sign != 0.0 else 0
    now.surface, now.residual, now.multiplier = reset, residual, multiplier
    return found


@apart
@seldom
@kernel
def take_observers(run: Trajectory, code: int) -> int:
    """Record the observers of the surfaces that have changed, as part of the set; how the loop goes on.

    One on which the solution stays, as it slides there, has been reached: it has the other sign.
    """
    m, order, w, now = run.m, run.order, run.w, run.now
    reached, stopped = now.surface, -1
    for i in range(M):
        if SAME_AS[i] != 0 and run.trigger[i] == ROOT:
            k = observed(i)
            w.grazed[i] = 1.0
            side = m[k] if SAME_AS[i] > 0 else -m[k]
            m[i] = -m[i] if side == 0.0 else side
            order[i] = 0 if side == 0.0 else order[k]
    for i in range(M):
        if SAME_AS[i] != 0 and run.trigger[i] == ROOT:
            stopped = i if record_observer(run, i) != 0 else stopped
    now.surface = reached
    if stopped >= 0:
        run.count.surface = stopped
        return STOPPED
    return code
