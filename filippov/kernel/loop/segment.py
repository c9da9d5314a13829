"""The start of a segment: field, guards and tolerances there, a collocation start, the first step."""

from filippov.kernel.language.primitives import NAN, Indices, Vector, entry, kernel, truncate
from filippov.kernel.loop.control import (
    collocation_start,
    finite,
    first_step,
    guard_state,
    guards_on,
    is_non_lipschitz,
    least_step,
    mark_grazed,
)
from filippov.kernel.loop.field import field, set_mode
from filippov.kernel.loop.land import guard_scale
from filippov.kernel.loop.model import (
    G_COLUMN,
    G_FIRST,
    NON_LIPSCHITZ,
    ROLE,
    ROOTS,
    SERIES,
    WIDTH,
    M,
    N,
    radii,
)
from filippov.kernel.loop.resolve import BACKWARDS, side_rates, widen
from filippov.kernel.loop.state import Clock, Integers, Scratch, Trajectory
from filippov.kernel.tables.codes import (
    AGAIN,
    GO_ON,
    KINK,
    NO_SLIDING,
    NOT_FINITE,
    OBSERVER,
    REACHED,
    SWITCHING,
    USER_ERROR,
)
from filippov.kernel.tables.layout import EPS

GRAIN = 1e2  # the accuracy of a guard that is followed relative to itself, in roundings of its terms
IN_TIME = 16.0  # roundings of the terms in t that a guard may have


@kernel
def renew_state(
    t: float, x: Vector, p: Vector, m: Vector, order: Indices, rtol: float, atol: Vector, start: float,
    w: Scratch, iw: Integers, ctx: Indices,
) -> int:  # fmt: skip
    """Field, guards and bounds of multipliers at the start of a segment; REACHED, or a code of `advance`."""
    set_mode(m, iw)
    if SERIES:
        w.origin.t = NAN
    code = field(t, x, p, m, w.k, w, iw, ctx)
    if code == 0:
        code = guard_state(t, x, p, m, w.k, w.start, w, ctx)
    if ROOTS and code == 0:
        code = guards_on(t, x, p, m, order, -1, w.k, w.start, w, ctx)
    if code == 0:
        code = radii(t, x, p, w.radius, ctx)
    if code != 0:
        return NO_SLIDING if code == 2 else USER_ERROR
    if not finite(w.k, N) or not finite(w.start, 2 * M):
        return NOT_FINITE
    for i in range(M):
        # The driver marks sliding that repels in the direction of integration by a negative order.
        w.attract[i] = -w.direction if m[i] == 0.0 and order[i] < 0 else w.direction
    # A least value of a guard below the accuracy of the integration cannot be told from a tangency.
    for i in range(M):
        w.touch[i] = 0.0
        if ROLE[i] != KINK and WIDTH[i] == 0.0:
            # Of its terms in t what the run has gone through counts, however far the origin of time is.
            gone = min(abs(t), abs(t - start))
            w.touch[i] = abs(w.gt[i]) * (rtol * gone + IN_TIME * EPS * abs(t))
            for a in range(G_FIRST[i], G_FIRST[i + 1]):
                k = G_COLUMN[a]
                w.touch[i] += (rtol * abs(x[k]) + atol[k]) * abs(w.g[i * N + k])
            # Backwards in time a slide that was left is met in a tangency, whose h is as accurate as what the
            # motion has gone through, and not as it is itself where it starts.
            if w.direction < 0.0 and ROLE[i] == SWITCHING:
                w.touch[i] *= BACKWARDS
    return REACHED


@kernel
def non_lipschitz_start(
    clock: Clock, t: float, x: Vector, p: Vector, m: Vector, order: Indices, direction: float, w: Scratch,
    iw: Integers, ctx: Indices,
) -> int:  # fmt: skip
    """Leave a surface tangentially where the field is not Lipschitz: its number, -1: none, -2: failure."""
    if NON_LIPSCHITZ:
        for i in range(M):
            if clock.relative < 0.0:
                return -1
            leaves = order[i] >= 2 and m[i] != 0.0 and ROLE[i] != OBSERVER
            if leaves and is_non_lipschitz(t, x, p, m, i, w, iw, ctx):
                span = clock.step
                if span <= 0.0:
                    size, speed = 0.0, 1e-300
                    for j in range(N):
                        size = max(size, abs(x[j]))
                        speed = max(speed, abs(w.k[j]))
                    span = 0.1 * size / speed
                span = min(span, abs(clock.t_end - t))
                tiny = direction * 1e-8 * span
                # Rounding of the rates that cancel where the surface is left bounds the accuracy of every
                # step.
                _, plus, minus, scale = side_rates(t, x, p, m, i, w, iw, ctx)
                clock.start_noise = 16.0 * EPS * max(abs(plus), abs(minus), scale) + 1e-300
                if collocation_start(t, x, p, m, tiny, w, iw, ctx) != 0:
                    return -2
                clock.t = t + tiny
                clock.step = abs(tiny)
                clock.relative = float(i) + 1.0
                clock.fast_from, clock.fast_span = t, span
                return i
    return -1


@kernel
def first_length(run: Trajectory) -> int:
    """The length of the first step, where none is known."""
    clock, w = run.clock, run.w
    limit = min(abs(clock.t_end - clock.t), clock.max_step)
    failed, length = first_step(
        clock.t, run.x, run.p, run.m, w.k, clock.rtol, run.atol, limit, w.direction, w, run.iw, run.ctx
    )
    if failed == 1:
        return USER_ERROR
    clock.step = length
    return GO_ON


@entry
@kernel
def open_segment(run: Trajectory) -> int:
    """Field, guards, tolerances and first step at the start of a segment; AGAIN after a collocation start."""
    clock, x, p, m, order, w = run.clock, run.x, run.p, run.m, run.order, run.w
    t = clock.t
    clock.grow = clock.grow if clock.grow > 0.0 else 10.0
    clock.trend = clock.trend if clock.trend > 0.0 else 1e-300
    code = renew_state(t, x, p, m, order, clock.rtol, run.atol, clock.t_start, w, run.iw, run.ctx)
    if code != REACHED:
        return code
    widen(run.zeno, w, run.iw)
    if clock.relative < 0.0:
        near = truncate(-clock.relative) - 1
        w.touch[near] = GRAIN * EPS * guard_scale(near, t, x, w)
    if t == clock.t_start:
        mark_grazed(m, True, w)
    surface = non_lipschitz_start(clock, t, x, p, m, order, w.direction, w, run.iw, run.ctx)
    if surface == -2:
        return USER_ERROR
    if surface >= 0:
        order[surface] = 0
        clock.trend = 1e-300
        return AGAIN
    # The step of a segment that ended in less time than t can tell apart says nothing of the next one.
    cut, run.count.cut = run.count.cut, 0
    least = 0.0 if cut != 0 else least_step(t, clock.t_start, clock.t_end)
    return GO_ON if clock.step > least else first_length(run)
