"""Simple events, decided in the loop: one surface, rates clearly nonzero. Others go to the classification.

For a surface reached from side sigma with rates h'(+) and h'(-) of the two fields there: both carry on,
cross; both point to it, slide; a rate within CLEAR_RATE of zero on its own scale, a second surface, or one
that is coupled to a sliding one, is left to `filippov.solving.selection.modes`. Uncoupled sliding
surfaces do not matter: the rates of h do not depend on their signs.
"""

from filippov.kernel.language.primitives import Indices, Vector, kernel, seldom
from filippov.kernel.language.records import Rows
from filippov.kernel.loop.model import (
    COMPONENT,
    CONTACT,
    G_COLUMN,
    G_FIRST,
    HELD,
    ROLE,
    WIDTH,
    M,
    N,
    gradients,
    rhs,
)
from filippov.kernel.loop.state import EventCycles, Integers, Scratch
from filippov.kernel.tables.codes import (
    CROSSING_DOWN,
    CROSSING_UP,
    ENTRY,
    EXIT_DOWN,
    EXIT_UP,
    GRAZING,
    NONE,
    ROOT,
    SWITCHING,
    TOUCH,
    UPPER,
)

CLEAR_RATE = 1e-6
# Relative to the terms of a rate: the difference of two rates, and the value of one, that may be rounding.
NO_EFFECT, ROUNDING = 1e-15, 1e-12
# Relative to the duration of a slide: one that would reach a two-fold in less may be drawn into it.
NEAR_FOLD = 3e-2
# The depth of a tangency, relative to what cannot be told from one: forwards, and backwards in time.
SHALLOW, BACKWARDS = 1e-2, 10.0


@kernel
def side_rates(
    t: float, x: Vector, p: Vector, m: Vector, i: int, w: Scratch, iw: Integers, ctx: Indices
) -> tuple[int, float, float, float]:
    """h_i' in the direction of integration at s_i = +1 and -1: (code, +, -, scale of the terms)."""
    s, f = w.s, w.f
    before = m[i]
    m[i] = 0.0
    code = gradients(t, x, p, m, w.g, w.gt, ctx)
    plus, minus, scale = w.gt[i], w.gt[i], abs(w.gt[i])
    for side in range(2):
        for j in range(M):
            s[j] = m[j] if m[j] != 0.0 else 1.0
        s[i] = 1.0 if side == 0 else -1.0
        code = max(code, rhs(t, x, p, s, m, f, ctx))
        size = 0.0
        for a in range(G_FIRST[i], G_FIRST[i + 1]):
            term = w.g[i * N + G_COLUMN[a]] * f[G_COLUMN[a]]
            size += abs(term)
            if side == 0:
                plus += term
            else:
                minus += term
        scale = max(scale, size)
    m[i] = before
    iw.calls += 2
    return code, w.direction * plus, w.direction * minus, scale


@kernel
def resolve_root(
    t: float,
    x: Vector,
    p: Vector,
    m: Vector,
    order: Indices,
    i: int,
    rate: float,
    w: Scratch,
    iw: Integers,
    ctx: Indices,
) -> int:
    """Mode after reaching surface i alone; the kind of event, NONE if it is not simple, -1 on failure."""
    sigma = m[i]
    kind = CROSSING_DOWN if sigma * w.direction > 0.0 else CROSSING_UP
    if ROLE[i] != SWITCHING or WIDTH[i] > 0.0:
        size = abs(w.gt[i])
        for a in range(G_FIRST[i], G_FIRST[i + 1]):
            size += abs(w.g[i * N + G_COLUMN[a]] * w.f[G_COLUMN[a]])
        if not (-sigma * rate > CLEAR_RATE * size):
            return NONE
        m[i] = -sigma
        order[i] = 1 if WIDTH[i] == 0.0 else 0
        return kind
    code, plus, minus, scale = side_rates(t, x, p, m, i, w, iw, ctx)
    if code != 0:
        return -1
    clear = CLEAR_RATE * scale
    lo, hi = w.radius[2 * i], w.radius[2 * i + 1]
    at_hi = 0.5 * ((1.0 + hi) * plus + (1.0 - hi) * minus)
    at_lo = 0.5 * ((1.0 + lo) * plus + (1.0 - lo) * minus)
    here = plus if sigma > 0.0 else minus
    beyond = minus if sigma > 0.0 else plus
    if abs(plus - minus) <= NO_EFFECT * scale and -sigma * plus > ROUNDING * scale:
        # The sign does not act on this rate, which is the same on both sides, however small it is.
        m[i] = -sigma
        order[i] = 1
        return kind
    own = lo == -1.0 and hi == 1.0 and -sigma * here > clear
    if own and ROUNDING * scale < -sigma * beyond <= clear:
        led = leads_off(t, x, p, m, i, beyond, w, iw, ctx)
        if led == 1:
            m[i] = -sigma
            order[i] = 1
        if led != 0:
            return kind if led == 1 else -1
    if not (-sigma * here > clear) or abs(at_hi) <= clear or abs(at_lo) <= clear or not (abs(beyond) > clear):
        return NONE
    if at_hi < 0.0 and at_lo > 0.0:
        m[i] = 0.0
        order[i] = 0
        w.mult[i].value = -(plus + minus) / (plus - minus)
        return ENTRY
    if sigma * beyond < 0.0:
        m[i] = -sigma
        order[i] = 1
        return kind
    return NONE


@seldom
@kernel
def leads_off(
    t: float, x: Vector, p: Vector, m: Vector, i: int, rate: float, w: Scratch, iw: Integers, ctx: Indices
) -> int:  # fmt: skip
    """Whether the slow rate beyond surface i lasts until h is farther than a tangency is deep; -1: failure.

    It does in a layer in which the solution relaxes, and does not near a fold of the field beyond.
    """
    if iw.sliding > 0:
        return 0
    s, f, ahead, before = w.s, w.f, w.jump, m[i]
    span = w.direction * w.touch[i] / abs(rate)
    m[i] = -before
    for j in range(M):
        s[j] = m[j]
    code = rhs(t, x, p, s, m, f, ctx)
    for j in range(N):
        ahead[j] = x[j] + span * f[j]
    code = max(code, gradients(t + span, ahead, p, m, w.g, w.gt, ctx), rhs(t + span, ahead, p, s, m, f, ctx))
    later = w.gt[i]
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        later += w.g[i * N + G_COLUMN[a]] * f[G_COLUMN[a]]
    code = max(code, gradients(t, x, p, m, w.g, w.gt, ctx))
    m[i] = before
    iw.calls += 2
    if code != 0:
        return -1
    return 1 if w.direction * later * rate >= 0.5 * rate * rate else 0


@kernel
def touch_or_root(i: int, length: float, m: Vector, w: Scratch) -> int:
    """TOUCH where h turns back before it is noticeably beyond the surface, else ROOT.

    The depth is that of the parabola with the rate at the event and its mean change over the step.
    """
    rate = w.end[2 * i + 1]
    turn = (rate - w.start[2 * i + 1]) / length
    # Far below what the step resolves and below the height it came from, however loose the tolerance is;
    # written without squares, which would underflow in a guard of tiny values.
    shallow = min(SHALLOW * w.touch[i], 1e-6 * abs(w.start[2 * i]))
    # Backwards in time a slide that was left is reached in such a tangency, as deep as the integration error.
    if w.direction < 0.0:
        shallow = max(shallow, BACKWARDS * w.touch[i])
    if m[i] * turn > 0.0 and abs(rate) * abs(rate / turn) <= 2.0 * shallow:
        return TOUCH
    return ROOT


@kernel
def resolve_touch(
    t: float, x: Vector, p: Vector, m: Vector, i: int, w: Scratch, iw: Integers, ctx: Indices
) -> int:  # fmt: skip
    """GRAZING, or NONE where the other side leads away from surface i too: the solution is not unique."""
    if ROLE[i] == SWITCHING and WIDTH[i] == 0.0 and iw.coupled[COMPONENT[i]] == 0:
        code, plus, minus, scale = side_rates(t, x, p, m, i, w, iw, ctx)
        if code != 0:
            return -1
        # A rate that is a state itself has no scale of its own: its change in the step is one.
        scale = max(scale, abs(w.start[2 * i + 1]))
        if m[i] * (minus if m[i] > 0.0 else plus) < -CLEAR_RATE * scale:
            return NONE
    return GRAZING


@kernel
def widen(zeno: Rows[EventCycles], w: Scratch, iw: Integers) -> None:
    """Keep the largest difference of the rates on both sides of every sliding surface."""
    for c in range(iw.sliding):
        i = iw.listed[c]
        mult, cycles = w.mult[i], zeno[i]
        cycles.widest = max(cycles.widest, abs(mult.rate_minus - mult.rate_plus))


@kernel
def resolve_exit(
    m: Vector, order: Indices, cause: int, i: int, slope: float, lasted: float, w: Scratch, iw: Integers
) -> int:
    """Mode after a multiplier reached an end of its set; NONE where another surface coupled to it slides.

    NONE too where the rates on both sides are about to vanish together, at a two-fold: near it rounding would
    decide. lasted: a time that the slide has lasted, or more.
    """
    mult = w.mult[i]
    spread = w.attract[i] * (mult.rate_minus - mult.rate_plus)
    if iw.coupled[COMPONENT[i]] != 1 or not (spread > 0.0) or not (slope < -CLEAR_RATE * spread):
        return NONE
    if HELD[i] != 0:
        return NONE
    if CONTACT[i] == 0 and spread <= NEAR_FOLD * lasted * w.fall[i]:
        return NONE
    side = 1.0 if cause == UPPER else -1.0
    end = w.radius[2 * i + 1] if cause == UPPER else w.radius[2 * i]
    if abs(mult.value - end) > 1e-6 * (1.0 + abs(end)):
        return NONE
    m[i] = side
    # At the end of Filippov's own set the slip field starts tangent to the surface; beyond it, with a jump.
    order[i] = 2 if abs(end - side) <= 1e-12 else 1
    # A contact is left where the free acceleration passes zero: h, h' and h'' vanish there.
    if CONTACT[i] != 0:
        order[i] = 3
    return EXIT_UP if side > 0.0 else EXIT_DOWN
