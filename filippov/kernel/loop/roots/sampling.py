"""The dense output of a step and the guards at points of it, in which `locate` finds events.

Guards of surfaces off which the solution runs are h_i itself; a sliding surface has two, the rates at the
ends of its set of signs or, where another surface coupled to it slides too, the distance of its multiplier
from them. Each is written so that it is positive while the mode lasts.
"""

from filippov.kernel.language.primitives import Indices, Vector, kernel, shift, sqrt
from filippov.kernel.loop.field import field, only_sliding
from filippov.kernel.loop.model import (
    AFFINE,
    ALL_LINEAR,
    COMPONENT,
    CONTACT,
    CONTACTS,
    DEGREE_DENSE,
    DENSE,
    DENSE_BERNSTEIN,
    G_COLUMN,
    G_FIRST,
    IMPLICIT,
    RULE,
    SERIES,
    WEIGHTED,
    WEIGHTED_STAGES,
    WIDE,
    WIDTH,
    M,
    N,
    P,
    guards,
    radii,
)
from filippov.kernel.loop.roots.points import open_rows, place_point, point_rows, prepare_points, take_rows
from filippov.kernel.loop.rules import UTKIN
from filippov.kernel.loop.series import has_series, series_dense, series_sample, series_value
from filippov.kernel.loop.state import Integers, Scratch
from filippov.kernel.tables.layout import CHECKS, EPS, LANES
from filippov.kernel.tables.root_tables import DEGREE, NODES, POSITION

CHECK_FIRST, CHECK_APART = 0.3137, 0.4218
NEIGHBOUR = 1.2345e-10
# The same in time: a part of the step, and so many roundings of t at least.
IN_STEP, BESIDE = 1.2345e-6, 5.0
OPEN = 1e299
# The largest error of a guard's series, relative to its magnitude.
HOLDS = 1e-7


@kernel
def dense_output(x: Vector, step: float, w: Scratch) -> None:
    """x(theta) = sum_j coef[j] theta**j on the step, theta in [0, 1], from the stages in the scratch."""
    if SERIES:
        series_dense(x, step, w)
        return
    for i in range(N):
        w.coef[i] = x[i]
    for j in range(1, DEGREE_DENSE + 1):
        for i in range(N):
            total = 0.0
            for q in range(WEIGHTED_STAGES):
                r = WEIGHTED[q]
                total += DENSE[r * (DEGREE_DENSE + 1) + j] * w.k[r * N + i]
            w.coef[j * N + i] = step * total


@kernel
def straight(iw: Integers) -> bool:
    """Whether every guard is linear in the state, so that its polynomial comes straight from the stages."""
    return ALL_LINEAR and not IMPLICIT and iw.sliding == 0


@kernel
def guard_polynomial(i: int, step: float, m: Vector, w: Scratch) -> None:
    """Bernstein coefficients of a linear guard on the step, from its rates along the stages."""
    c = w.c
    for a in range(NODES):
        c[a] = 0.0
    for q in range(WEIGHTED_STAGES):
        r, rate = WEIGHTED[q], 0.0
        for b in range(G_FIRST[i], G_FIRST[i + 1]):
            rate += w.g[i * N + G_COLUMN[b]] * w.k[r * N + G_COLUMN[b]]
        for a in range(1, DEGREE):
            c[a] += DENSE_BERNSTEIN[r * NODES + a] * rate
    # The ends are samples: rounding in the sums must not move them off zero.
    c[0] = m[i] * w.start[2 * i] + WIDTH[i]
    c[DEGREE] = m[i] * w.end[2 * i] + WIDTH[i]
    for a in range(1, DEGREE):
        c[a] = c[0] + m[i] * step * (c[a] + w.gt[i] * float(a) / float(DEGREE))


@kernel
def dense_value(theta: float, out: Vector, w: Scratch) -> None:
    """The dense output at theta (Horner)."""
    for i in range(N):
        value = w.coef[DEGREE_DENSE * N + i]
        for j in range(DEGREE_DENSE - 1, -1, -1):
            value = value * theta + w.coef[j * N + i]
        out[i] = value


@kernel
def sliding_guards(out: Vector, w: Scratch, iw: Integers) -> None:
    """Rows i and M + i of out: positive while the multiplier of sliding surface i stays inside its set."""
    for c in range(iw.sliding):
        i = iw.listed[c]
        lo, hi = w.radius[2 * i], w.radius[2 * i + 1]
        mult = w.mult[i]
        if iw.coupled[COMPONENT[i]] == 1:
            plus, minus = w.attract[i] * mult.rate_plus, w.attract[i] * mult.rate_minus
            out[i] = -0.5 * ((1.0 + hi) * plus + (1.0 - hi) * minus)
            out[M + i] = 0.5 * ((1.0 + lo) * plus + (1.0 - lo) * minus)
        else:
            out[i] = hi - mult.value
            out[M + i] = mult.value - lo
        # The set of a contact has one end: it is open on the other side, and the row of that side
        # may be as negative as it likes.
        if CONTACTS and hi > OPEN:
            out[i] = sqrt(1.0 + out[M + i] * out[M + i])
        if CONTACTS and lo < -OPEN:
            out[M + i] = sqrt(1.0 + out[i] * out[i])


@kernel
def guard_rows(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """All guards at one point, positive while the mode lasts."""
    h = w.h
    if guards(t, x, p, m, h, ctx) != 0:
        return 1
    for i in range(M):
        out[i] = m[i] * h[i] + WIDTH[i]
        out[M + i] = 1.0
    if iw.sliding > 0:
        code = field(t, x, p, m, w.f, w, iw, ctx)
        if code != 0:
            return code
        if radii(t, x, p, w.radius, ctx) != 0:
            return 1
        sliding_guards(out, w, iw)
    return 0


@kernel
def sample_in_lanes(
    t: float,
    step: float,
    lo: float,
    width: float,
    p: Vector,
    m: Vector,
    w: Scratch,
    iw: Integers,
    ctx: Indices,
) -> int:
    """As `sample`, for a solution that slides on one surface of a small symbolic system."""
    i, first, x = only_sliding(iw), 0, w.xm
    prepare_points(p, m, w)
    while first < NODES + CHECKS:
        # Unused lanes in the last round keep their points.
        filled = min(LANES, NODES + CHECKS - first)
        for lane in range(filled):
            q = first + lane
            at = POSITION[q] if q < NODES else CHECK_FIRST + CHECK_APART * (q - NODES)
            theta = lo + width * at
            dense_value(theta, x, w)
            for j in range(N):
                x[j] = w.y[j] if theta == 1.0 else x[j]
            place_point(lane, t + theta * step, x, w)
        if point_rows(i, w.attract[i], w, ctx) != 0:
            return 2
        for lane in range(filled):
            q = first + lane
            if q < NODES:
                take_rows(lane, shift(w.node, q * 2 * M), w)
            else:
                take_rows(lane, shift(w.check, (q - NODES) * 2 * M), w)
        first += LANES
    iw.calls += 2 * (NODES + CHECKS)
    return 0


@kernel
def sample_open(
    t: float, step: float, lo: float, width: float, p: Vector, m: Vector, w: Scratch, iw: Integers,
    ctx: Indices,
) -> int:  # fmt: skip
    """As `sample`, for a solution of a small symbolic system off all its surfaces."""
    first, rows = 0, shift(w.wide, (1 + N + P + M) * LANES)
    prepare_points(p, m, w)
    while first < NODES + CHECKS:
        for lane in range(LANES):
            # Unused lanes in the last round repeat its last point.
            q = min(first + lane, NODES + CHECKS - 1)
            at = POSITION[q] if q < NODES else CHECK_FIRST + CHECK_APART * (q - NODES)
            w.wide[lane] = lo + width * at
        open_rows(t, step, w, ctx)
        for lane in range(min(LANES, NODES + CHECKS - first)):
            q = first + lane
            inside = q < NODES
            out = shift(w.node, q * 2 * M) if inside else shift(w.check, (q - NODES) * 2 * M)
            for i in range(M):
                out[i], out[M + i] = rows[i * LANES + lane], 1.0
        first += LANES
    # A guard that is 0 at an end of the step is 0 here.
    code = 0
    if lo == 0.0:
        code = guard_rows(t, w.coef, p, m, w.node, w, iw, ctx)
    if lo + width == 1.0 and code == 0:
        code = guard_rows(t + step, w.y, p, m, shift(w.node, (NODES - 1) * 2 * M), w, iw, ctx)
    return code


@kernel
def series_holds(
    t: float, step: float, p: Vector, m: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> bool:
    """Whether the series of the guards give what these are at the end of the step, and inside it."""
    x, row = w.xm, w.row
    for q in range(2):
        theta = 1.0 if q == 0 else CHECK_FIRST + CHECK_APART
        dense_value(theta, x, w)
        if guard_rows(t + theta * step, x, p, m, row, w, iw, ctx) != 0:
            return False
        for r in range(2 * M):
            known = HOLDS * max(abs(row[r]), abs(series_value(r, 0.0, m, w)))
            known += w.touch[r if r < M else r - M]
            if not (abs(row[r] - series_value(r, theta * step, m, w)) <= known):
                return False
    return True


@kernel
def sample(
    t: float,
    step: float,
    lo: float,
    width: float,
    p: Vector,
    m: Vector,
    w: Scratch,
    iw: Integers,
    ctx: Indices,
) -> int:
    """Guards on one piece of the step: at the Chebyshev points, and where they are to be checked."""
    if SERIES and lo == 0.0 and width == 1.0 and has_series(m, w):  # noqa: SIM102 - as below
        if series_holds(t, step, p, m, w, iw, ctx):
            series_sample(step, CHECK_FIRST, CHECK_APART, m, w)
            return 0
    if WIDE:
        if iw.sliding == 1 and CONTACT[only_sliding(iw)] == 0 and (AFFINE or RULE != UTKIN):
            return sample_in_lanes(t, step, lo, width, p, m, w, iw, ctx)
        if iw.sliding == 0:
            return sample_open(t, step, lo, width, p, m, w, iw, ctx)
    x = w.xm
    for q in range(NODES):
        theta = lo + width * POSITION[q]
        dense_value(theta, x, w)
        if theta == 1.0:
            # The end of the step itself: a guard that is 0 there is 0 here.
            for j in range(N):
                x[j] = w.y[j]
        code = guard_rows(t + theta * step, x, p, m, shift(w.node, q * 2 * M), w, iw, ctx)
        if code != 0:
            return code
    if not ALL_LINEAR or iw.sliding > 0:
        for q in range(CHECKS):
            theta = lo + width * (CHECK_FIRST + CHECK_APART * q)
            dense_value(theta, x, w)
            code = guard_rows(t + theta * step, x, p, m, shift(w.check, q * 2 * M), w, iw, ctx)
            if code != 0:
                return code
    return 0


@kernel
def guard_noise(
    i: int, t: float, step: float, x: Vector, p: Vector, m: Vector, w: Scratch, ctx: Indices
) -> float:  # fmt: skip
    """The noise of guard i near (t, x): its second differences over a few neighbouring points.

    Over such distances those of a smooth function almost vanish; the rest is rounding inside h, which its
    gradient does not show (More & Wild 2011). 0 where h cannot be evaluated.
    """
    y, h = w.stage, w.h
    noise, one, two = 0.0, 0.0, 0.0
    # States are known no better than this. Time is exact, and may be much longer than anything takes.
    later = max(min(NEIGHBOUR * abs(t), IN_STEP * abs(step)), BESIDE * EPS * abs(t))
    for q in range(7):
        factor = 1.0 + NEIGHBOUR * float(q)
        for j in range(N):
            y[j] = x[j] * factor
        if guards(t + later * float(q), y, p, m, h, ctx) != 0:
            return 0.0
        if q >= 2:
            noise = max(noise, abs(h[i] - 2.0 * one + two))
        two, one = one, h[i]
    return noise
