"""The mode at an initial state in simple cases: off all surfaces, or on one with decisive rates."""

from filippov.kernel.language.primitives import Indices, Vector, entry, kernel, seldom
from filippov.kernel.loop.land import guard_scale
from filippov.kernel.loop.model import (
    G_COLUMN,
    G_FIRST,
    ROLE,
    WIDTH,
    M,
    N,
    gradients,
    guards,
    radii,
    rhs,
)
from filippov.kernel.loop.resolve import CLEAR_RATE, side_rates
from filippov.kernel.loop.state import Integers, Scratch, Trajectory
from filippov.kernel.tables.codes import GENERAL, REACHED, SWITCHING, USER_ERROR
from filippov.kernel.tables.layout import EPS

# A nudge of a state or of the time by this part of it shows the terms that it has in the field.
NUDGE = 1e-6
# Weights of the moves that differ: changes of states that are equal or opposite do not cancel.
PER_STATE, LATER = 0.37, 0.83


@seldom
@kernel
def second_rate(
    t: float, x: Vector, p: Vector, m: Vector, i: int, side: float, w: Scratch, iw: Integers, ctx: Indices
) -> tuple[int, float]:
    """Sign of h_i'' along the field at s_i = side, where h_i' = 0: (code, -1, 0 or 1), 0 if not clear."""
    f, y = w.f, w.xm
    size, speed = 0.0, 1e-300
    m[i] = side
    code = rhs(t, x, p, m, m, f, ctx)
    for j in range(N):
        size = max(size, abs(x[j]))
        speed = max(speed, abs(f[j]))
    longest = w.direction * 1e-6 * (size + 1e-6) / speed
    whole, half = 0.0, 0.0
    for part in range(2):
        length = longest if part == 0 else 0.5 * longest
        for j in range(N):
            y[j] = x[j] + length * f[j]
        m[i] = 0.0
        failed, plus, minus, scale = side_rates(t + length, y, p, m, i, w, iw, ctx)
        m[i] = side
        if code != 0 or failed != 0:
            return 1, 0.0
        # side_rates has f in its scratch.
        if part == 0 and rhs(t, x, p, m, m, f, ctx) != 0:
            return 1, 0.0
        rate = plus if side > 0.0 else minus
        if abs(rate) <= 1e4 * EPS * scale:
            return 0, 0.0
        if part == 0:
            whole = rate
        else:
            half = rate
    # A rate that does not grow like the time has a zero of higher order, which the classification finds.
    if abs(whole - 2.0 * half) > 0.1 * abs(whole):
        return 0, 0.0
    return 0, 1.0 if whole > 0.0 else -1.0


@seldom
@kernel
def is_rounding(run: Trajectory, t: float, x: Vector, i: int, plus: float, minus: float) -> bool:
    """Whether both rates of surface i are rounding of the time and of the states, as at a two-fold.

    The field is asked beside the state only where the rates move the guard by less than it is known.
    """
    clock, w, y = run.clock, run.w, run.w.xm
    known = 0.0
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        k = G_COLUMN[a]
        known += (clock.rtol * abs(x[k]) + run.atol[k]) * abs(w.g[i * N + k])
    if not (max(abs(plus), abs(minus)) * abs(clock.t_final - t) <= known):
        return False
    for j in range(N):
        y[j] = x[j] * (1.0 + NUDGE * (1.0 + PER_STATE * (j % 5)))
    later = t * (1.0 + LATER * NUDGE)
    code, above, below, _ = side_rates(later, y, run.p, run.m, i, w, run.iw, run.ctx)
    least = 64.0 * EPS / NUDGE
    return code == 0 and abs(plus) <= least * abs(above - plus) and abs(minus) <= least * abs(below - minus)


@seldom
@kernel
def on_one_surface(run: Trajectory, t: float, x: Vector, lam: Vector, i: int) -> int:
    """Mode on surface i alone: slide, leave, or leave along a tangency decided by the second derivative."""
    p, m, order, w, iw, ctx = run.p, run.m, run.order, run.w, run.iw, run.ctx
    code, plus, minus, scale = side_rates(t, x, p, m, i, w, iw, ctx)
    if code != 0 or radii(t, x, p, w.radius, ctx) != 0:
        return USER_ERROR
    if is_rounding(run, t, x, i, plus, minus):
        return GENERAL
    lo, hi = w.radius[2 * i], w.radius[2 * i + 1]
    clear = CLEAR_RATE * scale
    at_hi = 0.5 * ((1.0 + hi) * plus + (1.0 - hi) * minus)
    at_lo = 0.5 * ((1.0 + lo) * plus + (1.0 - lo) * minus)
    if at_hi < -clear and at_lo > clear:
        m[i] = 0.0
    elif plus > clear and minus > clear and at_lo > clear and at_hi > clear:
        m[i] = 1.0
        order[i] = 1
    elif plus < -clear and minus < -clear and at_lo < -clear and at_hi < -clear:
        m[i] = -1.0
        order[i] = 1
    elif hi != 1.0 or lo != -1.0:
        return GENERAL
    elif abs(plus) <= clear and minus > clear:
        failed, sign = second_rate(t, x, p, m, i, 1.0, w, iw, ctx)
        if failed != 0 or sign == 0.0:
            return USER_ERROR if failed != 0 else GENERAL
        m[i] = 1.0 if sign > 0.0 else 0.0
        order[i] = 2
    elif abs(minus) <= clear and plus < -clear:
        failed, sign = second_rate(t, x, p, m, i, -1.0, w, iw, ctx)
        if failed != 0 or sign == 0.0:
            return USER_ERROR if failed != 0 else GENERAL
        m[i] = -1.0 if sign < 0.0 else 0.0
        order[i] = 2
    else:
        return GENERAL
    if m[i] == 0.0:
        lam[i] = -(plus + minus) / (plus - minus)
        w.mult[i].value = lam[i]
    return REACHED


@entry
@kernel
def begin(run: Trajectory) -> int:
    """Mode at the start: REACHED where it is found, GENERAL where the classification has to decide."""
    clock, x, p, m, order, lam, w, ctx = run.clock, run.x, run.p, run.m, run.order, run.lam, run.w, run.ctx
    t, h = clock.t, w.h
    w.direction = 1.0 if clock.t_end >= t else -1.0
    run.iw.known = 0
    for i in range(M):
        m[i] = 1.0
        order[i] = 0
        lam[i] = 0.0
    # The sizes |h| inside other guards follow the signs found before, as deep as they are nested.
    for _ in range(M + 1):
        if guards(t, x, p, m, h, ctx) != 0:
            return USER_ERROR
        changed = False
        for i in range(M):
            side = -1.0 if h[i] < 0.0 else 1.0
            changed = changed or side != m[i]
            m[i] = side
        if not changed:
            break
    if gradients(t, x, p, m, w.g, w.gt, ctx) != 0:
        return USER_ERROR
    reached, total = -1, 0
    for i in range(M):
        # A relay with hysteresis is inside its band there; h = 0 is not special.
        if WIDTH[i] == 0.0 and not (abs(h[i]) > 8.0 * EPS * guard_scale(i, t, x, w)):
            reached = i
            total += 1
    if total == 0:
        return REACHED
    if total > 1 or ROLE[reached] != SWITCHING:
        return GENERAL
    return on_one_surface(run, t, x, lam, reached)
