"""The simple events, decided in the loop: one surface, rates clear of zero. All else is the general path's.

For a surface reached from side sigma with rates h'(+) and h'(-) of the two fields there: both carry on,
cross; both point to it, slide; a rate within CLEAR_RATE of zero on its own scale, a second surface, or one
that is coupled to a sliding one, is left to `filippov.modes`. What slides apart from it does not matter: the
rates of h do not depend on those signs.
"""

from filippov._kernels.codes import (
    CROSSING_DOWN,
    CROSSING_UP,
    ENTRY,
    EXIT_DOWN,
    EXIT_UP,
    GRAZING,
    NONE,
    SWITCHING,
    UPPER,
)
from filippov._kernels.language import Indices, Vector, kernel, shift
from filippov._kernels.layout import COLUMNS, MULTIPLIER, RATE_MINUS, RATE_PLUS
from filippov._kernels.model import (
    COMPONENT,
    CONTACT,
    G_COLUMN,
    G_FIRST,
    I_CALLS,
    I_PEERS,
    ROLE,
    W_ATTRACT,
    W_DIRECTION,
    W_F,
    W_G,
    W_GT,
    W_MULT,
    W_RADIUS,
    W_S,
    W_START,
    WIDTH,
    M,
    N,
    gradients,
    rhs,
)

CLEAR_RATE = 1e-6


@kernel
def side_rates(
    t: float, x: Vector, p: Vector, m: Vector, i: int, w: Vector, iw: Indices, ctx: Indices
) -> tuple[int, float, float, float]:
    """h_i' in the direction of integration at s_i = +1 and -1: (code, +, -, scale of the terms)."""
    s, f = shift(w, W_S), shift(w, W_F)
    before = m[i]
    m[i] = 0.0
    code = gradients(t, x, p, m, shift(w, W_G), shift(w, W_GT), ctx)
    plus, minus, scale = w[W_GT + i], w[W_GT + i], abs(w[W_GT + i])
    for side in range(2):
        for j in range(M):
            s[j] = m[j] if m[j] != 0.0 else 1.0
        s[i] = 1.0 if side == 0 else -1.0
        code = max(code, rhs(t, x, p, s, m, f, ctx))
        size = 0.0
        for a in range(G_FIRST[i], G_FIRST[i + 1]):
            term = w[W_G + i * N + G_COLUMN[a]] * f[G_COLUMN[a]]
            size += abs(term)
            if side == 0:
                plus += term
            else:
                minus += term
        scale = max(scale, size)
    m[i] = before
    iw[I_CALLS] += 2
    return code, w[W_DIRECTION] * plus, w[W_DIRECTION] * minus, scale


@kernel
def resolve_root(
    t: float,
    x: Vector,
    p: Vector,
    m: Vector,
    order: Indices,
    i: int,
    rate: float,
    w: Vector,
    iw: Indices,
    ctx: Indices,
) -> int:
    """Mode after reaching surface i alone; the kind of event, NONE if it is not simple, -1 on failure."""
    sigma = m[i]
    # The sign of i acts on the multipliers of what is coupled to it.
    if iw[I_PEERS + COMPONENT[i]] > 0:
        return NONE
    kind = CROSSING_DOWN if sigma * w[W_DIRECTION] > 0.0 else CROSSING_UP
    if ROLE[i] != SWITCHING or WIDTH[i] > 0.0:
        size = abs(w[W_GT + i])
        for a in range(G_FIRST[i], G_FIRST[i + 1]):
            size += abs(w[W_G + i * N + G_COLUMN[a]] * w[W_F + G_COLUMN[a]])
        if not (-sigma * rate > CLEAR_RATE * size):
            return NONE
        m[i] = -sigma
        order[i] = 1 if WIDTH[i] == 0.0 else 0
        return kind
    code, plus, minus, scale = side_rates(t, x, p, m, i, w, iw, ctx)
    if code != 0:
        return -1
    clear = CLEAR_RATE * scale
    lo, hi = w[W_RADIUS + 2 * i], w[W_RADIUS + 2 * i + 1]
    at_hi = 0.5 * ((1.0 + hi) * plus + (1.0 - hi) * minus)
    at_lo = 0.5 * ((1.0 + lo) * plus + (1.0 - lo) * minus)
    here = plus if sigma > 0.0 else minus
    beyond = minus if sigma > 0.0 else plus
    if not (-sigma * here > clear) or abs(at_hi) <= clear or abs(at_lo) <= clear or not (abs(beyond) > clear):
        return NONE
    if at_hi < 0.0 and at_lo > 0.0:
        m[i] = 0.0
        order[i] = 0
        w[W_MULT + i * COLUMNS + MULTIPLIER] = -(plus + minus) / (plus - minus)
        return ENTRY
    if sigma * beyond < 0.0:
        m[i] = -sigma
        order[i] = 1
        return kind
    return NONE


@kernel
def resolve_touch(
    t: float, x: Vector, p: Vector, m: Vector, i: int, w: Vector, iw: Indices, ctx: Indices
) -> int:  # fmt: skip
    """GRAZING, or NONE where the other side leads away from surface i too: then the motion is not unique."""
    if ROLE[i] == SWITCHING and WIDTH[i] == 0.0 and iw[I_PEERS + COMPONENT[i]] == 0:
        code, plus, minus, scale = side_rates(t, x, p, m, i, w, iw, ctx)
        if code != 0:
            return -1
        # A rate that is a state itself has no scale of its own: what it came down from is one.
        scale = max(scale, abs(w[W_START + 2 * i + 1]))
        if m[i] * (minus if m[i] > 0.0 else plus) < -CLEAR_RATE * scale:
            return NONE
    return GRAZING


@kernel
def resolve_exit(m: Vector, order: Indices, cause: int, i: int, slope: float, w: Vector, iw: Indices) -> int:
    """Mode after a multiplier reached an end of its set; NONE where another surface coupled to it slides."""
    mult = shift(w, W_MULT + i * COLUMNS)
    spread = w[W_ATTRACT + i] * (mult[RATE_MINUS] - mult[RATE_PLUS])
    if iw[I_PEERS + COMPONENT[i]] != 1 or not (spread > 0.0) or not (slope < -CLEAR_RATE * spread):
        return NONE
    side = 1.0 if cause == UPPER else -1.0
    end = w[W_RADIUS + 2 * i + 1] if cause == UPPER else w[W_RADIUS + 2 * i]
    if abs(mult[MULTIPLIER] - end) > 1e-6 * (1.0 + abs(end)):
        return NONE
    m[i] = side
    # At the end of Filippov's own set the slip field starts tangent to the surface; beyond it, with a jump.
    order[i] = 2 if abs(end - side) <= 1e-12 else 1
    # A contact is left where the free acceleration passes zero: h, h' and h'' vanish there.
    if CONTACT[i] != 0:
        order[i] = 3
    return EXIT_UP if side > 0.0 else EXIT_DOWN
