"""Resets x+ = r(t, x, p) at a surface reached from an active side: simple ones, decided in the loop.

Simple: one surface, nothing slides, and after the jump every other h, but of observers of the surface, is
clearly nonzero; where it leads over a surface without a reset, the sign of that changes. The direction from
x+ follows from h there and, on the surface itself, from its rate: back to the side it came from, through, or,
with a vanishing rate, into a resting contact; where the field jumps there, from the rates on both sides. All
else is left to the classification.
"""

from filippov.kernel.language.primitives import Indices, Vector, kernel
from filippov.kernel.loop.control import finite
from filippov.kernel.loop.field import project, set_mode
from filippov.kernel.loop.land import NO_RATE, guard_scale
from filippov.kernel.loop.model import (
    CONTACT,
    HELD,
    RESET_FROM,
    ROLE,
    SAME_AS,
    WIDTH,
    M,
    N,
    gradients,
    guards,
    radii,
    resets,
    rhs,
)
from filippov.kernel.loop.resolve import CLEAR_RATE, side_rates
from filippov.kernel.loop.state import Integers, Scratch
from filippov.kernel.tables.codes import NONE, RESET, RESETTING, SWITCHING
from filippov.kernel.tables.layout import EPS

# The error of the time of an event, over |t|.
INSTANT = 1.42e-14


@kernel
def noise(i: int, t: float, x: Vector, w: Scratch) -> float:
    """The rounding error of h_i at an event: that of its terms, and its rate times the error of the time."""
    return float(8.0 * EPS * guard_scale(i, t, x, w) + INSTANT * abs(t * w.end[2 * i + 1]))


@kernel
def resets_from(i: int, side: float) -> bool:
    """Whether surface i resets the state when it is reached from this side."""
    return RESET_FROM[i] == 2 or (side != 0.0 and float(RESET_FROM[i]) == side)


@kernel
def rest(
    t: float, y: Vector, p: Vector, m: Vector, order: Indices, i: int, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """The mode at rest on surface i: contact where the free acceleration presses, off where it lifts."""
    side = float(CONTACT[i])
    code, plus, minus, scale = side_rates(t, y, p, m, i, w, iw, ctx)
    if code != 0:
        return -1
    free = side * (plus if side > 0.0 else minus)
    if free > CLEAR_RATE * scale:
        order[i] = 2
        return RESET
    if not (free < -CLEAR_RATE * scale):
        return NONE
    m[i] = 0.0
    order[i] = 0
    w.mult[i].value = -(plus + minus) / (plus - minus)
    set_mode(m, iw)
    return RESET if project(t, y, p, m, w.h, w, iw, ctx) == 0 else -1


@kernel
def goes_off(
    t: float, y: Vector, p: Vector, m: Vector, order: Indices, i: int, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """The mode off surface i, across which the field jumps, where the rates on both sides agree on a side."""
    code, plus, minus, scale = side_rates(t, y, p, m, i, w, iw, ctx)
    if code != 0 or radii(t, y, p, w.radius, ctx) != 0:
        return -1
    lo, hi = w.radius[2 * i], w.radius[2 * i + 1]
    at_hi = 0.5 * ((1.0 + hi) * plus + (1.0 - hi) * minus)
    at_lo = 0.5 * ((1.0 + lo) * plus + (1.0 - lo) * minus)
    if min(plus, minus, at_hi, at_lo) > CLEAR_RATE * scale:
        m[i] = 1.0
    elif max(plus, minus, at_hi, at_lo) < -CLEAR_RATE * scale:
        m[i] = -1.0
    else:
        return NONE
    order[i] = 1
    return RESET


@kernel
def lands(t: float, y: Vector, p: Vector, m: Vector, i: int, w: Scratch, ctx: Indices) -> int:
    """0 where the signs after the reset of surface i are clear, and in m: its own is left. Else 1, or -1."""
    for attempt in range(2):
        if guards(t, y, p, m, w.h, ctx) != 0 or gradients(t, y, p, m, w.g, w.gt, ctx) != 0:
            return -1
        over = False
        for j in range(M):
            value, near = m[j] * w.h[j], noise(j, t, y, w)
            if j == i or abs(SAME_AS[j]) == i + 1 or value + WIDTH[j] > near:
                continue
            if RESET_FROM[j] != 0 or HELD[j] != 0 or attempt == 1 or not (value + WIDTH[j] < -near):
                return 1
            m[j] = -m[j]
            over = True
        # Sizes |h| inside other guards follow the signs.
        if not over:
            return 0
    return 1


@kernel
def reset_state(
    t: float, x: Vector, p: Vector, m: Vector, order: Indices, i: int, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """As `apply_reset`, but that signs may have been changed where it is not simple."""
    y, h, f = w.jump, w.h, w.f
    jumps = ROLE[i] == SWITCHING and WIDTH[i] == 0.0
    if iw.sliding > 0 or not (jumps or ROLE[i] == RESETTING):
        return NONE
    size = abs(w.gt[i])
    for j in range(N):
        size += abs(w.g[i * N + j] * f[j])
    # By rounding, the surface just left may be reached again; only a solution that runs onto it is reset.
    if not (-m[i] * w.end[2 * i + 1] * w.direction > NO_RATE * size):
        return NONE
    if resets(i, t, x, p, m, y, ctx) != 0:
        return -1
    if not finite(y, N):
        return NONE
    code = lands(t, y, p, m, i, w, ctx)
    if code != 0:
        return -1 if code < 0 else NONE
    side = m[i]
    # The residual h of the location says nothing of the side on which the state is put.
    if abs(h[i]) > max(64.0 * EPS * guard_scale(i, t, y, w), 2.0 * abs(w.end[2 * i])):
        if jumps and abs(h[i]) <= 8.0 * noise(i, t, y, w):
            return NONE
        m[i] = 1.0 if h[i] > 0.0 else -1.0
        order[i] = 0
        return RESET
    if jumps:
        return goes_off(t, y, p, m, order, i, w, iw, ctx)
    iw.calls += 1
    if rhs(t, y, p, m, m, f, ctx) != 0:
        return -1
    rate, size = w.gt[i], size + abs(w.gt[i])
    for j in range(N):
        rate += w.g[i * N + j] * f[j]
        size += abs(w.g[i * N + j] * f[j])
    if abs(rate) <= NO_RATE * size:
        return rest(t, y, p, m, order, i, w, iw, ctx) if float(CONTACT[i]) == side else NONE
    if CONTACT[i] != 0 and float(CONTACT[i]) == side and side * rate > 0.0:
        # A flight within rounding of h = 0 cannot be followed.
        reach = noise(i, t, y, w) + INSTANT * abs(t) * size
        code, plus, minus, _ = side_rates(t, y, p, m, i, w, iw, ctx)
        if code != 0:
            return -1
        if rate * rate <= -2.0 * side * (plus if side > 0.0 else minus) * reach:
            return NONE
    m[i] = 1.0 if rate > 0.0 else -1.0
    order[i] = 1
    return RESET


@kernel
def apply_reset(
    t: float, x: Vector, p: Vector, m: Vector, order: Indices, i: int, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """State and mode after reaching surface i: RESET with x+ in w.jump, NONE if it is not simple.

    -1: the user's code failed. The mode before is in w.before.
    """
    kind = reset_state(t, x, p, m, order, i, w, iw, ctx)
    if kind != RESET:
        for j in range(M):
            m[j] = w.before[j]
    return kind
