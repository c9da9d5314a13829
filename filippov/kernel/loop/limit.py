"""Impacts on one contact that accumulate: their limit in time and state, and rest there (E9).

The last events are in `Past`: `ensemble` keeps them where there is no other record, Python copies those of
its log. Accumulations that involve several surfaces, or do not end at rest, are left to
`filippov.solving.settling`, which decides by the same law.
"""

from filippov.kernel.language.primitives import Indices, Vector, entry, kernel, truncate
from filippov.kernel.loop.control import finite
from filippov.kernel.loop.event_cycle import CHOSEN, cycle_limit, distant
from filippov.kernel.loop.field import field, set_mode
from filippov.kernel.loop.land import guard_scale, project_on
from filippov.kernel.loop.model import CONTACT, ROLE, WIDTH, M, N, gradients, guards, resets, rhs
from filippov.kernel.loop.reset import rest
from filippov.kernel.loop.state import Past, Scratch, Trajectory
from filippov.kernel.tables.codes import ENTRY, GENERAL, LIMIT, NONE, OBSERVER, RESET
from filippov.kernel.tables.layout import EPS

# Errors of the many steps of a non-Lipschitz field, in tolerances of one.
GLOBAL = 4.0
# The largest relative change of a state by an impact at rest: beyond it there is no limit.
KEPT = 1e-6
# The accuracy of a guard between impacts, in roundings of its terms.
ROUNDINGS = 16.0


@kernel
def remember(past: Past, t: float, surface: int, grazing: bool) -> None:
    """Append an event; of a full past the latter half is kept."""
    half = past.room // 2
    if past.count >= past.room:
        for q in range(half):
            past.times[q], past.reached[q] = past.times[half + q], past.reached[half + q]
        past.count = half
    past.times[past.count] = t
    past.reached[past.count] = -1 - surface if grazing else surface
    past.count += 1


@kernel
def forget_cycles(run: Trajectory) -> None:
    """Start the search for accumulations anew."""
    for i in range(M):
        cycles = run.zeno[i]
        cycles.last, cycles.widest, cycles.slow = 0.0, 0.0, 0.0
        cycles.faint, cycles.ask = 0.0, 0.0
        for lag in range(3):
            cycles.interval[lag], cycles.streak[lag] = 0.0, 0.0


@kernel
def reached_in(past: Past, q: int) -> int:
    """The surface of a past event; one that was only grazed is written as -1 - i."""
    # |i + 1/2| is the same for both.
    return truncate(abs(past.reached[q] + 0.5))


@kernel
def last_law(run: Trajectory) -> int:
    """The law of the events on the surface reached last, into `past.law` (see `cycle_limit`); 0 for none."""
    past = run.past
    first, number, recent, i = max(past.count - 2 * past.most, 0), 0, 0, reached_in(past, past.count - 1)
    for q in range(first, past.count):
        if past.reached[q] == i:
            past.same[number] = past.times[q]
            number += 1
            recent += 1 if q >= past.count - past.most else 0
    past.alike = number
    rtol = run.clock.rtol * (GLOBAL if run.clock.relative < 0.0 else 1.0)
    return cycle_limit(past.same, number, recent, run.w.direction, run.clock.t_start, rtol, past.law)


@kernel
def takes_part(past: Past, i: int) -> bool:
    """Whether a surface was reached in both of the last two cycles; what is crossed on the way was not."""
    if ROLE[i] == OBSERVER:
        return False
    last, latest, now = past.alike - 1, truncate(past.law[6]), past.times[past.count - 1]
    middle = abs(past.same[last] - past.same[last - latest])
    first = abs(past.same[last] - past.same[last - 2 * latest])
    in_last, in_other = False, False
    for q in range(max(past.count - past.most, 0), past.count):
        if reached_in(past, q) == i:
            ago = abs(past.times[q] - now)
            in_last = in_last or ago < middle
            in_other = in_other or (middle <= ago < first)
    return in_last and in_other


@kernel
def fall(run: Trajectory, t: float, out: Vector, bend: Vector) -> int:
    """The state at t without further impacts, and its deviation from a straight line.

    Bodies coming to rest on each other may fall together meanwhile: a step of the classical order 4.
    """
    w, begin, dt, stage, mean, f = run.w, run.clock.t, t - run.clock.t, run.w.stage, run.w.xm, run.w.f
    code = field(begin, run.x, run.p, run.m, f, w, run.iw, run.ctx)
    for j in range(N):
        bend[j], mean[j] = f[j], f[j] / 6.0
    for q in range(3):
        part = 1.0 if q == 2 else 0.5
        for j in range(N):
            stage[j] = run.x[j] + part * dt * f[j]
        code = max(code, field(begin + part * dt, stage, run.p, run.m, f, w, run.iw, run.ctx))
        for j in range(N):
            mean[j] += f[j] / (6.0 if q == 2 else 3.0)
    for j in range(N):
        out[j] = run.x[j] + dt * mean[j]
        bend[j] = dt * (mean[j] - bend[j])
    return code


@kernel
def still_on(t: float, x: Vector, p: Vector, m: Vector, i: int, w: Scratch, ctx: Indices) -> int:
    """Remove the speed across contact i from x, along the direction of its reaction."""
    side, code, push = m[i], 0, 0.0
    m[i] = 0.0
    for j in range(M):
        w.s[j] = m[j]
    w.s[i] = side
    code = rhs(t, x, p, w.s, m, w.xm, ctx)
    w.s[i] = -side
    code = max(code, rhs(t, x, p, w.s, m, w.f, ctx))
    code = max(code, guards(t, x, p, m, w.h, ctx), gradients(t, x, p, m, w.g, w.gt, ctx))
    for j in range(N):
        push += w.g[i * N + j] * (w.f[j] - w.xm[j])
    for j in range(N):
        x[j] -= w.h[i] / push * (w.f[j] - w.xm[j])
    m[i] = side
    return code


@kernel
def clear_way(run: Trajectory, t: float, y: Vector, i: int, x_error: float, error: float) -> int:
    """ENTRY where no other surface is reached on the way to the limit, NONE where one is, else GENERAL."""
    clock, m, p, w, ctx, answer = run.clock, run.m, run.p, run.w, run.ctx, ENTRY
    if guards(clock.t, run.x, p, m, w.h, ctx) != 0:
        return GENERAL
    for j in range(M):
        w.row[j] = m[j] * w.h[j]
    if guards(t, y, p, m, w.h, ctx) != 0 or gradients(t, y, p, m, w.g, w.gt, ctx) != 0:
        return GENERAL
    length = abs(t - clock.t) + EPS * abs(t)
    for j in range(M):
        if j == i:
            continue
        known = abs(w.gt[j]) * error
        for k in range(N):
            known += abs(w.g[j * N + k]) * x_error
        change = abs(m[j] * w.h[j] - w.row[j]) * abs(t) / length
        known = CHOSEN * min(known, ROUNDINGS * EPS * (guard_scale(j, t, y, w) + change))
        value = m[j] * w.h[j] + WIDTH[j]
        if value < -known:
            return NONE
        if not (value > known):
            answer = GENERAL
    return answer


@kernel
def changes_nothing(run: Trajectory, y: Vector, i: int) -> bool:
    """Whether an impact at rest leaves the state as it is."""
    after = run.w.stage
    same = resets(i, run.clock.t, y, run.p, run.m, after, run.ctx) == 0
    for j in range(N):
        known = KEPT * (abs(y[j]) + abs(after[j])) + run.atol[j]
        same = same and abs(after[j] - y[j]) <= known
    return same


@kernel
def limit_of(run: Trajectory, i: int) -> int:
    """State of the limit into w.jump, its errors and its bend into `past`; ENTRY, NONE or GENERAL."""
    clock, past, w, m, y = run.clock, run.past, run.w, run.m, run.w.jump
    error, t = past.law[5] * past.law[1], past.law[0]
    if (t - clock.t_end) * w.direction > 0.0:
        if abs(t - clock.t_end) > error:
            return NONE
        t = clock.t_end
    # The depth of cycles of one event was looked at when they were found to accumulate.
    left, speed, scale = abs(past.law[0] - clock.t), abs(w.end[2 * i + 1]), guard_scale(i, clock.t, run.x, w)
    if past.law[6] > 1.0 and distant(clock.t, clock.t_start, left, past.law[2], speed, scale, 0.0) != 0:
        return NONE
    code = fall(run, t, y, past.bend)
    code = max(code, project_on(t, y, run.p, m, i, clock.rtol, run.atol, w, run.ctx))
    code = max(code, still_on(t, y, run.p, m, i, w, run.ctx))
    code = max(code, field(clock.t, y, run.p, m, w.f, w, run.iw, run.ctx))
    if code != 0 or not finite(y, N):
        return GENERAL
    past.t, past.error, past.x_error, speed = t, error, 0.0, 0.0
    for j in range(N):
        past.x_error = max(past.x_error, run.atol[j] + clock.rtol * abs(y[j]))
        speed = max(speed, abs(w.f[j]))
    past.x_error += speed * error
    return clear_way(run, t, y, i, past.x_error, error)


@entry
@kernel
def rest_in_limit(run: Trajectory) -> int:
    """Where the last events are impacts on one contact that accumulate: go to their limit and rest there.

    ENTRY: done, the event is to be recorded; NONE: it is no accumulation, or something comes before its
    limit; LIMIT: the limit of an accumulation at which the trajectory stops is known; GENERAL: the
    classification has to decide what it is, or how the solution goes on.
    """
    clock, past, m, w, i = run.clock, run.past, run.m, run.w, reached_in(run.past, run.past.count - 1)
    if i >= M or w.direction < 0.0:
        return GENERAL
    set_mode(m, run.iw)
    if CONTACT[i] == 0 or m[i] != float(CONTACT[i]) or run.iw.sliding > 0:
        return GENERAL
    if last_law(run) == 0:
        return NONE
    for j in range(M):
        if takes_part(past, j) != (j == i):
            return GENERAL
    found = limit_of(run, i)
    if found != ENTRY:
        return found
    if past.stops != 0:
        run.limit[0], run.limit[1], run.limit[2] = past.t, past.error, past.x_error
        for j in range(N):
            run.limit[3 + j] = w.jump[j]
        return LIMIT
    if not changes_nothing(run, w.jump, i):
        return GENERAL
    side, kept = m[i], run.order[i]
    if rest(past.t, w.jump, run.p, m, run.order, i, w, run.iw, run.ctx) != RESET or m[i] != 0.0:
        m[i], run.order[i] = side, kept
        return GENERAL
    for j in range(M):
        w.before[j] = m[j]
        run.order[j] = 0
    w.before[i] = side
    forget_cycles(run)
    for j in range(N):
        run.x[j] = w.jump[j]
    # A limit that the law places before the last event, by less than its error, is that event.
    clock.t = past.t if (past.t - clock.t) * w.direction > 0.0 else clock.t
    clock.trend, clock.grow, clock.relative = 0.0, 0.0, min(clock.relative, 0.0)
    run.lam[i] = w.mult[i].value
    return ENTRY
