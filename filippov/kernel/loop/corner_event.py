"""Corners of two surfaces that a trajectory reaches, slides on and leaves, where their rates decide clearly.

A surface is reached while one that is coupled to it is slid on; while both are slid on, each step asks
whether that is still the only solution; a multiplier reaches the end of its set. All else is left to
`filippov.solving.selection.modes`.
"""

from filippov.kernel.language.primitives import NAN, apart, kernel, shift_indices
from filippov.kernel.loop.control import finite
from filippov.kernel.loop.corner import corner_rates, followed, one_solution, turns_out
from filippov.kernel.loop.event_cycle import zeno_horizon, zeno_remaining
from filippov.kernel.loop.field import field, set_mode
from filippov.kernel.loop.land import guard_scale
from filippov.kernel.loop.model import (
    COMPONENT,
    CONTACT,
    HELD,
    RESET_FROM,
    ROLE,
    RULE,
    WIDTH,
    M,
    N,
    gradients,
)
from filippov.kernel.loop.record import count_down, record_event
from filippov.kernel.loop.resolve import CLEAR_RATE
from filippov.kernel.loop.rules import FILIPPOV
from filippov.kernel.loop.state import Scratch, Trajectory
from filippov.kernel.tables.codes import (
    AGAIN,
    CORNER,
    CROSSING_DOWN,
    CROSSING_UP,
    ENTRY,
    EXIT_DOWN,
    EXIT_UP,
    GENERAL,
    GO_ON,
    NONE,
    STOPPED,
    STOPS,
    SWITCHING,
    UPPER,
    USER_ERROR,
    ZENO,
)
from filippov.kernel.tables.layout import EPS

# The least distance of a multiplier from the ends of its set; cycles as short, relative to the time run, may
# accumulate.
OFF_ENDS, SHORT_CYCLE = 1e-5, 1e-6


@kernel
def plain_surface(i: int, w: Scratch) -> bool:
    """Whether surface i only switches the field, between Filippov's own ends."""
    simple = ROLE[i] == SWITCHING and WIDTH[i] == 0.0 and CONTACT[i] == 0 and HELD[i] == 0
    return simple and RESET_FROM[i] == 0 and w.radius[2 * i] == -1.0 and w.radius[2 * i + 1] == 1.0


@kernel
def partner(run: Trajectory) -> int:
    """The surface slid on that forms a plain corner of two with the one reached; -1 for none."""
    m, w, clock, i, found = run.m, run.w, run.clock, run.now.surface, -1
    t, cycles = run.now.t_end, run.zeno[run.now.surface]
    if RULE != FILIPPOV or w.direction < 0.0 or clock.relative != 0.0:
        return -1
    if cycles.interval[0] > 0.0 and abs(t - cycles.last) <= SHORT_CYCLE * abs(t - clock.t_start):
        return -1
    if run.iw.coupled[COMPONENT[i]] != 1 or not plain_surface(i, w):
        return -1
    for k in range(M):
        if m[k] != 0.0:
            if k != i and WIDTH[k] == 0.0 and abs(w.end[2 * k]) <= 8.0 * EPS * guard_scale(k, t, w.xe, w):
                return -1
        elif CONTACT[k] != 0 or HELD[k] != 0 or run.iw.coupled[COMPONENT[k]] != 1:
            return -1
        elif COMPONENT[k] == COMPONENT[i]:
            found = k
    return found if plain_surface(found, w) and run.order[found] == 0 else -1


@kernel
def holds(run: Trajectory, j: int) -> bool:
    """Whether the multipliers of the mode chosen on both surfaces are clear of the ends of their sets."""
    m, w, i = run.m, run.w, run.now.surface
    set_mode(m, run.iw)
    if m[i] == 0.0:
        w.mult[i].value = 0.0
    if m[j] == 0.0:
        w.mult[j].value = 0.0
    if field(run.now.t_end, w.xe, run.p, m, w.f, w, run.iw, run.ctx) != 0 or not finite(w.f, N):
        return False
    for side in range(2):
        k = i if side == 0 else j
        if m[k] == 0.0 and not (abs(w.mult[k].value) < 1.0 - OFF_ENDS):
            return False
    return True


@apart
@kernel
def reach_corner(run: Trajectory) -> int:
    """CORNER with the mode after a surface reached while a coupled one is slid on; NONE if not clear."""
    m, w, iw, i = run.m, run.w, run.iw, run.now.surface
    j = partner(run)
    if j < 0:
        return NONE
    te, xe, before, kept_i, kept_j = run.now.t_end, w.xe, m[i], w.mult[i].value, w.mult[j].value
    if corner_rates(te, xe, run.p, m, i, j, w, iw, run.ctx) != 0 or not finite(w.corner, 10):
        return NONE
    found = followed(w.corner)
    if found < 0 or (found == 4 and turns_out(w.corner)) or float(found // 3 - 1) == before:
        return NONE
    m[i], m[j] = float(found // 3 - 1), float(found - 3 * (found // 3) - 1)
    if holds(run, j):
        run.order[i] = 1 if m[i] != 0.0 else 0
        run.order[j] = 1 if m[j] != 0.0 else 0
        run.count.pair = 1 if found == 4 else 0
        return CORNER
    m[i], m[j] = before, 0.0
    w.mult[i].value, w.mult[j].value = kept_i, kept_j
    set_mode(m, iw)
    return NONE


@apart
@kernel
def leave_corner(run: Trajectory) -> int:
    """CORNER with the mode after a multiplier of a corner has clearly reached an end of its set; else NONE.

    There is one solution, and the multiplier goes on outwards: the solution leaves the surface tangentially
    and slides on the other.
    """
    m, w, iw, now, i, j = run.m, run.w, run.iw, run.now, run.now.surface, -1
    for c in range(iw.sliding):
        if iw.listed[c] != i and COMPONENT[iw.listed[c]] == COMPONENT[i]:
            j = iw.listed[c]
    mult, end = w.mult[i], 1.0 if now.cause == UPPER else -1.0
    spread = w.attract[i] * (mult.rate_minus - mult.rate_plus)
    if not (spread > 0.0) or not (now.slope < -CLEAR_RATE * spread) or w.direction < 0.0:
        return NONE
    if abs(mult.value - end) > CLEAR_RATE or not plain_surface(i, w) or not plain_surface(j, w):
        return NONE
    kept_i, kept_j = mult.value, w.mult[j].value
    if corner_rates(now.t_end, w.xe, run.p, m, i, j, w, iw, run.ctx) != 0 or not one_solution(w.corner):
        return NONE
    m[i] = end
    if holds(run, j):
        run.order[i], run.count.pair = 2, 0
        return CORNER
    m[i] = 0.0
    w.mult[i].value, w.mult[j].value = kept_i, kept_j
    set_mode(m, iw)
    return NONE


@kernel
def change_kind(before: float, after: float) -> int:
    """The kind of an event by the sign before and after it; NONE where it stays."""
    if before == after:
        return NONE
    if after == 0.0:
        return ENTRY
    if before == 0.0:
        return EXIT_UP if after > 0.0 else EXIT_DOWN
    return CROSSING_UP if after > 0.0 else CROSSING_DOWN


@apart
@kernel
def take_corner(run: Trajectory) -> int:
    """Record what a corner has changed, as one set of events, and go on in the mode after it."""
    clock, m, order, w, now = run.clock, run.m, run.order, run.w, run.now
    reached, stopped, first = now.surface, -1, True
    for k in range(M):
        kind = change_kind(w.before[k], m[k])
        if kind == NONE:
            order[k] = 0 if m[k] != 0.0 else order[k]
            continue
        now.surface, now.residual = k, abs(w.end[2 * k])
        now.multiplier = w.mult[k].value if m[k] == 0.0 else NAN
        record_event(run, kind)
        if not first:
            run.marks[run.count.events * (3 + 2 * M) - 1] = 1
        first = False
        if w.before[k] == 0.0:
            # The step size of a slide says nothing about the solution that leaves it.
            clock.step = 0.0
        if count_down(shift_indices(run.stop, STOPS * k), kind) != 0:
            stopped = k
    now.surface, now.renew, run.count.rested = reached, 1, 0
    clock.trend, clock.grow = 1e-300, 10.0
    run.zeno[reached].widest = 0.0
    if stopped >= 0:
        run.count.surface = stopped
        return STOPPED
    cycles = run.zeno[reached]
    horizon = zeno_horizon(now.t_end, clock.t_start, w.xe, reached, cycles, w)
    return ZENO if zeno_remaining(cycles, now.t_end, horizon) >= 0.0 else AGAIN


@apart
@kernel
def look_at_corner(run: Trajectory) -> int:
    """GO_ON while no other solution leaves the corner that the loop has decided to slide on, else GENERAL.

    Then the step is discarded, and `count.pair` is 2: other modes may follow, or a spiral may lead away.
    """
    m, w, iw, i, j = run.m, run.w, run.iw, -1, -1
    for c in range(iw.sliding):
        k = iw.listed[c]
        if iw.coupled[COMPONENT[k]] == 2:
            if i < 0:
                i = k
            else:
                j = k
    if j < 0:
        run.count.pair = 0
        return GO_ON
    if corner_rates(run.now.t_end, w.y, run.p, m, i, j, w, iw, run.ctx) != 0:
        return USER_ERROR
    # The search for an event goes on with the gradients at the end of the step.
    code = gradients(run.now.t_end, w.y, run.p, m, w.g, w.gt, run.ctx)
    if code == 0 and one_solution(w.corner):
        return GO_ON
    for k in range(M):
        run.trigger[k] = 0
    run.count.pair = 2
    return USER_ERROR if code != 0 else GENERAL
