"""The start of a segment: field, guards and tolerances there, a rough field crept off, the first step."""

from filippov.kernel.language.primitives import Indices, Vector, kernel, shift
from filippov.kernel.loop.control import creep_off, finite, first_step, guard_state, is_rough, mark_grazed
from filippov.kernel.loop.field import field, set_mode
from filippov.kernel.loop.land import EPS, guard_scale
from filippov.kernel.loop.model import (
    G_COLUMN,
    G_FIRST,
    ROLE,
    ROUGH,
    W_ATTRACT,
    W_DIRECTION,
    W_G,
    W_K,
    W_RADIUS,
    W_START,
    W_TOUCH,
    WIDTH,
    M,
    N,
    radii,
)
from filippov.kernel.loop.resolve import side_rates
from filippov.kernel.tables.codes import (
    GROW,
    KINK,
    MAX_STEP,
    NO_SLIDING,
    NOT_FINITE,
    OBSERVER,
    REACHED,
    RELATIVE,
    ROUGH_FROM,
    ROUGH_NOISE,
    ROUGH_SPAN,
    RTOL,
    STEP,
    T_END,
    T_START,
    TREND,
    USER_ERROR,
    T,
)


@kernel
def renew_state(
    t: float, x: Vector, p: Vector, m: Vector, order: Indices, rtol: float, atol: Vector, w: Vector,
    iw: Indices, ctx: Indices,
) -> int:  # fmt: skip
    """Field, guards and radii at the start of a segment; a code of `advance`, REACHED where all is well."""
    set_mode(m, iw)
    code = field(t, x, p, m, shift(w, W_K), w, iw, ctx)
    if code == 0:
        code = guard_state(t, x, p, m, shift(w, W_K), shift(w, W_START), w, ctx)
    if code == 0:
        code = radii(t, x, p, shift(w, W_RADIUS), ctx)
    if code != 0:
        return NO_SLIDING if code == 2 else USER_ERROR
    if not finite(shift(w, W_K), N) or not finite(shift(w, W_START), 2 * M):
        return NOT_FINITE
    for i in range(M):
        # The driver marks sliding that repels in the direction of integration by a negative order.
        w[W_ATTRACT + i] = -w[W_DIRECTION] if m[i] == 0.0 and order[i] < 0 else w[W_DIRECTION]
    # Closer to 0 than the integration is accurate, a least value of a guard cannot be told from a touching.
    for i in range(M):
        w[W_TOUCH + i] = 0.0
        if ROLE[i] != KINK and WIDTH[i] == 0.0:
            w[W_TOUCH + i] = rtol * guard_scale(i, t, x, w)
            for a in range(G_FIRST[i], G_FIRST[i + 1]):
                w[W_TOUCH + i] += atol[G_COLUMN[a]] * abs(w[W_G + i * N + G_COLUMN[a]])
    return REACHED


@kernel
def rough_start(
    clock: Vector, t: float, x: Vector, p: Vector, m: Vector, order: Indices, direction: float, w: Vector,
    iw: Indices, ctx: Indices,
) -> int:  # fmt: skip
    """Creep off a surface left tangentially where the field is rough: which, -1 for none, -2 at failure."""
    if ROUGH:
        for i in range(M):
            if clock[RELATIVE] < 0.0:
                return -1
            leaves = order[i] >= 2 and m[i] != 0.0 and ROLE[i] != OBSERVER
            if leaves and is_rough(t, x, p, m, i, w, iw, ctx):
                span = clock[STEP]
                if span <= 0.0:
                    size, speed = 0.0, 1e-300
                    for j in range(N):
                        size = max(size, abs(x[j]))
                        speed = max(speed, abs(w[W_K + j]))
                    span = 0.1 * size / speed
                span = min(span, abs(clock[T_END] - t))
                tiny = direction * 1e-8 * span
                # Rounding of the rates that cancel where the surface is left: no step can do better.
                _, plus, minus, scale = side_rates(t, x, p, m, i, w, iw, ctx)
                clock[ROUGH_NOISE] = 16.0 * EPS * max(abs(plus), abs(minus), scale) + 1e-300
                if creep_off(t, x, p, m, tiny, w, iw, ctx) != 0:
                    return -2
                clock[T] = t + tiny
                clock[STEP] = abs(tiny)
                clock[RELATIVE] = float(i) + 1.0
                clock[ROUGH_FROM], clock[ROUGH_SPAN] = t, span
                return i
    return -1


@kernel
def open_segment(
    clock: Vector, x: Vector, p: Vector, m: Vector, order: Indices, atol: Vector, w: Vector, iw: Indices,
    ctx: Indices,
) -> int:  # fmt: skip
    """What `advance` does before the first step of a segment; a code of it, REACHED where all is well."""
    t, direction = clock[T], w[W_DIRECTION]
    clock[GROW] = clock[GROW] if clock[GROW] > 0.0 else 10.0
    clock[TREND] = clock[TREND] if clock[TREND] > 0.0 else 1e-300
    code = renew_state(t, x, p, m, order, clock[RTOL], atol, w, iw, ctx)
    if code != REACHED:
        return code
    if t == clock[T_START]:
        mark_grazed(m, True, w)
    surface = -1
    if clock[RELATIVE] == 0.0:
        surface = rough_start(clock, t, x, p, m, order, direction, w, iw, ctx)
    if surface == -2:
        return USER_ERROR
    if surface >= 0:
        order[surface] = 0
        clock[TREND] = 1e-300
    elif clock[STEP] <= 0.0:
        limit = min(abs(clock[T_END] - t), clock[MAX_STEP])
        failed, length = first_step(
            t, x, p, m, shift(w, W_K), clock[RTOL], atol, limit, direction, w, iw, ctx
        )
        if failed == 1:
            return USER_ERROR
        clock[STEP] = length
    return REACHED
