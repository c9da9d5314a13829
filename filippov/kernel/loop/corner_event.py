"""Corners that a solution reaches, slides on and leaves, where the rates of their surfaces decide clearly.

A surface is reached while others that are coupled to it are slid on; while several are slid on, each step
asks whether that is still the only solution; a multiplier reaches the end of its set. Two surfaces may act
on each other in any way, more of them where the field is affine in their signs. All else is left to
`filippov.solving.selection.modes`.
"""

from filippov.kernel.language.primitives import NAN, Vector, apart, kernel, seldom, shift_indices
from filippov.kernel.loop.control import finite
from filippov.kernel.loop.corner import corner_rates, followed, one_solution, turns_out
from filippov.kernel.loop.coupled_corner import (
    OFF_ENDS,
    WIDER,
    coupled_rates,
    follow_sides,
    group_of,
    is_wide,
    one_choice,
    write_corner,
)
from filippov.kernel.loop.event_cycle import zeno_horizon, zeno_remaining
from filippov.kernel.loop.field import field, set_mode
from filippov.kernel.loop.land import guard_scale
from filippov.kernel.loop.model import (
    COMPONENT,
    CONTACT,
    COUPLED,
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

# Cycles as short, relative to the time run, may accumulate.
SHORT_CYCLE = 1e-6


@kernel
def switches_only(i: int) -> bool:
    """Whether surface i only switches the field, and may be slid on."""
    simple = ROLE[i] == SWITCHING and WIDTH[i] == 0.0 and CONTACT[i] == 0 and HELD[i] == 0
    return simple and RESET_FROM[i] == 0


@kernel
def plain_surface(i: int, w: Scratch) -> bool:
    """Whether surface i only switches the field, between Filippov's own ends."""
    return switches_only(i) and w.radius[2 * i] == -1.0 and w.radius[2 * i + 1] == 1.0


@seldom
@kernel
def reached_alone(run: Trajectory) -> bool:
    """Whether a surface that only switches is reached, off an accumulation and others but those slid on."""
    m, w, clock, i = run.m, run.w, run.clock, run.now.surface
    t, cycles = run.now.t_end, run.zeno[run.now.surface]
    if RULE != FILIPPOV or w.direction < 0.0 or clock.relative != 0.0 or not switches_only(i):
        return False
    if cycles.interval[0] > 0.0 and abs(t - cycles.last) <= SHORT_CYCLE * abs(t - clock.t_start):
        return False
    for k in range(M):
        if m[k] != 0.0:
            if k != i and WIDTH[k] == 0.0 and abs(w.end[2 * k]) <= 8.0 * EPS * guard_scale(k, t, w.xe, w):
                return False
        elif CONTACT[k] != 0 or HELD[k] != 0:
            return False
        if m[k] == 0.0 and COMPONENT[k] == COMPONENT[i] and not (switches_only(k) and run.order[k] == 0):
            return False
    return True


@seldom
@kernel
def partner(run: Trajectory) -> int:
    """The surface slid on that forms a plain corner of two with the one reached; -1 for none."""
    w, iw, i, found = run.w, run.iw, run.now.surface, -1
    for c in range(iw.sliding):
        k = iw.listed[c]
        if iw.coupled[COMPONENT[k]] != 1:
            return -1
        if COMPONENT[k] == COMPONENT[i]:
            found = k
    return found if found >= 0 and plain_surface(i, w) and plain_surface(found, w) else -1


@apart
@kernel
def holds(run: Trajectory) -> bool:
    """Whether the multipliers of the mode chosen on a corner are clear of the ends of their sets."""
    m, w, iw, corner = run.m, run.w, run.iw, COMPONENT[run.now.surface]
    set_mode(m, iw)
    for k in range(M):
        if m[k] == 0.0 and COMPONENT[k] == corner:
            w.mult[k].value = 0.0
    if field(run.now.t_end, w.xe, run.p, m, w.f, w, iw, run.ctx) != 0 or not finite(w.f, N):
        return False
    for c in range(iw.sliding):
        k = iw.listed[c]
        inside = min(w.mult[k].value - w.radius[2 * k], w.radius[2 * k + 1] - w.mult[k].value)
        if COMPONENT[k] == corner and not (inside > OFF_ENDS):
            return False
    return True


@seldom
@kernel
def note_multipliers(run: Trajectory) -> None:
    """Remember the multipliers before an event."""
    for k in range(M):
        run.w.kept[k] = run.w.mult[k].value


@seldom
@kernel
def put_back(run: Trajectory) -> int:
    """NONE, with mode and multipliers as they were before the event."""
    for k in range(M):
        run.m[k], run.w.mult[k].value = run.w.before[k], run.w.kept[k]
    set_mode(run.m, run.iw)
    return NONE


@seldom
@kernel
def accept(run: Trajectory, left: int) -> int:
    """CORNER, with how often the guards of surfaces that have changed vanish: `left` times off those left."""
    for k in range(M):
        if run.m[k] != run.w.before[k]:
            run.order[k] = left if run.m[k] != 0.0 else 0
    run.count.pair = 1
    return CORNER


@seldom
@kernel
def spirals(run: Trajectory) -> bool:
    """Whether exactly two surfaces of the corner decided are slid on, and a cycle round them leads away."""
    m, w, iw, i, j = run.m, run.w, run.iw, -1, -1
    if iw.coupled[COMPONENT[run.now.surface]] != 2:
        return False
    for c in range(iw.sliding):
        if COMPONENT[iw.listed[c]] == COMPONENT[run.now.surface]:
            i, j = j, iw.listed[c]
    code = corner_rates(run.now.t_end, w.xe, run.p, m, i, j, w, iw, run.ctx)
    return code != 0 or turns_out(w.corner)


@kernel
def reach_pair(run: Trajectory, j: int) -> int:
    """CORNER with the mode after a surface reached while only j, coupled to it, is slid on; or NONE."""
    m, w, i = run.m, run.w, run.now.surface
    code = corner_rates(run.now.t_end, w.xe, run.p, m, i, j, w, run.iw, run.ctx)
    if code != 0 or not finite(w.corner, 10):
        return NONE
    found = followed(w.corner)
    if found < 0 or (found == 4 and turns_out(w.corner)) or float(found // 3 - 1) == m[i]:
        return NONE
    m[i], m[j] = float(found // 3 - 1), float(found - 3 * (found // 3) - 1)
    return accept(run, 1) if holds(run) else put_back(run)


@seldom
@kernel
def go_to_sides(run: Trajectory, end: float) -> int:
    """CORNER with the mode after a surface reached, or left at an end of its set, and others slid on."""
    m, w, now = run.m, run.w, run.now
    if not follow_sides(now.t_end, w.xe, run.p, m, now.surface, end, w, run.iw, run.ctx):
        return NONE
    if m[now.surface] != w.before[now.surface] and holds(run) and not spirals(run):
        return accept(run, 1)
    return put_back(run)


@apart
@kernel
def reach_corner(run: Trajectory) -> int:
    """CORNER with the mode after a surface reached while coupled ones are slid on; NONE if not clear."""
    if not reached_alone(run):
        return NONE
    note_multipliers(run)
    j, found = partner(run), NONE
    if j >= 0:
        found = reach_pair(run, j)
    return go_to_sides(run, 0.0) if COUPLED and found == NONE else found


@apart
@kernel
def leave_corner(run: Trajectory) -> int:
    """CORNER with the mode after a multiplier of a corner has clearly reached an end of its set; else NONE.

    From Filippov's own set, where there is one solution, it goes on outwards: the solution leaves the surface
    tangentially and slides on the others. From a wider one the sign falls, and the others follow.
    """
    m, w, iw, now, i = run.m, run.w, run.iw, run.now, run.now.surface
    mult, place = w.mult[i], 2 * i + (1 if now.cause == UPPER else 0)
    spread = w.attract[i] * (mult.rate_minus - mult.rate_plus)
    if not (spread > 0.0) or not (now.slope < -CLEAR_RATE * spread) or w.direction < 0.0 or RULE != FILIPPOV:
        return NONE
    plain, first, end = True, group_of(i, iw), 1.0 if now.cause == UPPER else -1.0
    for c in range(first, iw.group[first]):
        plain = plain and plain_surface(iw.listed[c], w)
        if not switches_only(iw.listed[c]) or run.order[iw.listed[c]] < 0:
            return NONE
    if abs(mult.value - w.radius[place]) > CLEAR_RATE:
        return NONE
    note_multipliers(run)
    if not plain:
        return go_to_sides(run, end) if COUPLED and is_wide(i, w) and w.radius[place] * end > WIDER else NONE
    if not only_solution(run, w.xe, first):
        return NONE
    m[i] = end
    return accept(run, 2) if holds(run) and not spirals(run) else put_back(run)


@apart
@kernel
def only_solution(run: Trajectory, x: Vector, first: int) -> bool:
    """Whether one mode is known to follow on one group of the list of sliding surfaces."""
    w, iw, k = run.w, run.iw, run.iw.group[first] - first
    t, p, m, ctx = run.now.t_end, run.p, run.m, run.ctx
    if k == 2:
        code = corner_rates(t, x, p, m, iw.listed[first], iw.listed[first + 1], w, iw, ctx)
        return code == 0 and one_solution(w.corner)
    if not COUPLED or not coupled_rates(t, x, p, m, w, iw, ctx):
        return False
    return write_corner(first, k, m, w, iw) and one_choice(k, w)


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
    """GO_ON while no other solution leaves the corners that the loop has decided to slide on, else GENERAL.

    Then the step is discarded, and `count.pair` is 2: other modes may follow, or a spiral may lead away.
    """
    m, w, iw, first, corners, one = run.m, run.w, run.iw, 0, 0, True
    while first < iw.sliding and one:
        if iw.group[first] > first + 1:
            corners += 1
            one = only_solution(run, w.y, first)
        first = iw.group[first]
    if corners == 0:
        run.count.pair = 0
        return GO_ON
    # The search for an event goes on with the gradients at the end of the step.
    code = gradients(run.now.t_end, w.y, run.p, m, w.g, w.gt, run.ctx)
    if code == 0 and one:
        return GO_ON
    for k in range(M):
        run.trigger[k] = 0
    run.count.pair = 2
    return USER_ERROR if code != 0 else GENERAL
