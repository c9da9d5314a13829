"""Root isolation: the first event of a step on the step's dense output.

Each guard is written so that it is positive while the mode lasts (see `sampling`); the event is where it
stops being positive.

Resolution. Linear guards are polynomials of the dense output and are isolated on the whole step. Others are
sampled at 9 Chebyshev points, checked at two more, and the step is halved (at most SPLITS times) until the
polynomial stands for the guard to 1e-7 of its size, and where its sign hangs on more, to `touch` or rounding:
what is narrower than 2**-SPLITS of a step is not seen.
A guard that needs this in many places asks for a shorter step.
"""

from filippov.kernel.language.primitives import Indices, Vector, inline, kernel, seldom, shift
from filippov.kernel.loop.land import guard_scale
from filippov.kernel.loop.model import (
    AFFINE,
    COLOURS,
    G_COLUMN,
    G_FIRST,
    KINKED,
    LINEAR,
    OWNER,
    ROLE,
    ROOTED,
    ROOTS,
    WIDTH,
    M,
    N,
)
from filippov.kernel.loop.roots.bernstein import bernstein_value, coefficient_range, deflate, first_root
from filippov.kernel.loop.roots.sampling import (
    CHECK_APART,
    CHECK_FIRST,
    dense_value,
    guard_noise,
    guard_polynomial,
    sample,
    straight,
)
from filippov.kernel.loop.state import Integers, Scratch
from filippov.kernel.tables.codes import ALONG, KINK, LOWER, NOTHING, OBSERVER, ROOT, TOUCH, UNRESOLVED, UPPER
from filippov.kernel.tables.layout import CHECKS, EPS, SPLITS
from filippov.kernel.tables.root_tables import DEGREE, NO_ROOT, NODES, TANGENT_ROOT, TO_BERNSTEIN

NOISY = 64.0
# The rounding of a guard that is linear, in those of its terms.
PLANE = 4.0
LEAVES = 16
# The largest rounding of a guard that contains a root, relative to its magnitude on the step.
STEEP = 1e-9
# Relative to the rates on both sides of a sliding surface: an excess of the multiplier that is rounding.
BOUND_TOLERANCE = 1e-10
# The least value of a tangency, as a part of the largest on the piece.
FLAT = 0.01
# The rounding of differences over 2e-3 of an argument, relative to that of what they differ.
DIFFERENCED = 1e3


@kernel
def sampled_range(row: int, w: Scratch) -> tuple[float, float]:
    """Least and largest sample of a guard, which a polynomial hardly exceeds between Chebyshev points."""
    least, most = float(w.node[row]), float(w.node[row])
    for a in range(1, NODES):
        least = min(least, w.node[a * 2 * M + row])
        most = max(most, w.node[a * 2 * M + row])
    return least, most


@kernel
def at_end_throughout(row: int, tolerance: float, w: Scratch) -> bool:
    """Whether a multiplier is at an end of its set up to rounding on the whole piece, which is no polynomial.

    So it is where a surface is a solution of the field on one side, as a curve of optimal switching.
    """
    least, most = sampled_range(row, w)
    return least >= -tolerance and most <= tolerance


@seldom
@kernel
def stays_within(row: int, most: float, w: Scratch) -> bool:
    """Whether no sample of a guard is farther from 0 than this."""
    low, high = sampled_range(row, w)
    return max(-low, high) <= most


@kernel
def rises(row: int, w: Scratch) -> bool:
    """Whether all samples of a guard except the first are positive: it may begin like a root of time."""
    least = float(w.node[2 * M + row])
    for a in range(2, NODES):
        least = min(least, w.node[a * 2 * M + row])
    return least > 0.0


@kernel
def to_polynomial(row: int, judged: bool, noise: float, tolerance: float, w: Scratch) -> bool:
    """Bernstein coefficients of one guard on the sampled piece; False where they do not stand for it.

    tolerance: unless negative, the sign of the guard is compared as well, where it is larger than this.
    """
    c = w.c
    largest, worst = 0.0, 0.0
    for a in range(NODES):
        total = 0.0
        for b in range(NODES):
            total += TO_BERNSTEIN[a * NODES + b] * w.node[b * 2 * M + row]
        c[a] = total
        largest = max(largest, abs(w.node[a * 2 * M + row]))
    # The ends are samples themselves: rounding in the transform must not move them off zero.
    c[0] = w.node[row]
    c[DEGREE] = w.node[DEGREE * 2 * M + row]
    if judged:
        for q in range(CHECKS):
            u = CHECK_FIRST + CHECK_APART * q
            miss = bernstein_value(c, DEGREE, u, w.work) - w.check[q * 2 * M + row]
            if abs(miss) > 1e-7 * largest + NOISY * noise:
                return False
            worst = max(worst, abs(miss))
    if tolerance >= 0.0 and worst > max(tolerance, NOISY * (EPS * largest + noise)):
        bound, _ = coefficient_range(c)
        least, _ = sampled_range(row, w)
        return bound > 4.0 * worst or least < -4.0 * worst
    return True


@seldom
@kernel
def order_at_start(c: Vector, spread: float) -> int:
    """How often a multiplier's guard vanishes at the start of its segment: 0 where it is inside its set."""
    if abs(c[0]) > 1e-6 * spread:
        return 0
    largest = 0.0
    for a in range(1, NODES):
        largest = max(largest, abs(c[a]))
    order = 1
    while order < DEGREE - 1 and abs(c[order]) <= 1e-9 * largest:
        order += 1
    return order


@seldom
@kernel
def balanced_terms(j: int, m: Vector, w: Scratch, iw: Integers) -> float:
    """The magnitude of the fields that the multipliers balance in velocity j: the scale of its rounding."""
    total = abs(w.vert[j])
    if AFFINE and M > 1 and iw.sliding > 1:
        for colour in range(COLOURS):
            owner = OWNER[colour * N + j]
            if owner >= 0 and m[owner] == 0.0:
                total += 2.0 * abs(w.vert[(colour + 1) * N + j])
    else:
        total += abs(w.vert[N + j])
    return float(total)


@kernel
def rounding(t: float, step: float, i: int, m: Vector, w: Scratch, iw: Integers) -> float:
    """Below this magnitude guard i cannot be told from 0 on this step: the rounding of its terms.

    While others slide their multipliers balance vertex fields, whose rounding is left in the velocity.
    """
    total = abs(w.gt[i]) * max(abs(t), abs(t + step))
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        j = G_COLUMN[a]
        moved = 0.0
        if iw.sliding > 0:
            moved = abs(step) * balanced_terms(j, m, w, iw)
        total += abs(w.g[i * N + j]) * (max(abs(w.coef[j]), abs(w.y[j])) + moved)
    return float(1024.0 * EPS * total)


@kernel
def stands_still(
    least: float, most: float, touch: float, error: float, step: float, i: int, w: Scratch
) -> bool:
    """Whether guard i moves by no more than `error` of its terms, not below -touch: a first integral."""
    moved = float(abs(w.gt[i] * step))
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        j = G_COLUMN[a]
        moved += abs(w.g[i * N + j] * (w.y[j] - w.coef[j]))
    return least >= -touch and most - least <= error * moved


@kernel
def noise_in(
    i: int, t: float, step: float, theta: float, p: Vector, m: Vector, w: Scratch, ctx: Indices
) -> float:
    """The noise of guard i at theta of the step.

    Never less than the rounding of its terms: differences may happen to be exact, as those of y - y are.
    """
    dense_value(theta, w.xm, w)
    now = t + theta * step
    return max(guard_noise(i, now, step, w.xm, p, m, w, ctx), EPS * guard_scale(i, now, w.xm, w))


@kernel
def multiplier_noise(i: int, w: Scratch) -> float:
    """The rounding of the guards of sliding surface i, which the multiplier's distances from its ends are.

    Near an end one of them is small beside the other and has the rounding of both; gradients may be those
    of differences.
    """
    lost = 1.0 if LINEAR[i] != 0 else DIFFERENCED
    return float(lost * EPS * (abs(w.node[i]) + abs(w.node[M + i])))


@inline
@kernel
def row_polynomial(
    row: int, t: float, step: float, lo: float, width: float, tolerance: float, p: Vector, m: Vector,
    order: Indices, w: Scratch, iw: Integers, ctx: Indices,
) -> tuple[int, float]:  # fmt: skip
    """One sampled guard in Bernstein form, in w.c: (0 where that stands for it, noise of the guard).

    Else 1, or -1 where the guard does not exceed what may be noise. The noise is -1 if not computed.
    """
    i = row if row < M else row - M
    judged, noise = m[i] == 0.0 or LINEAR[i] == 0, -1.0
    if m[i] != 0.0 and judged and ROLE[i] != KINK and (lo > 0.0 or order[i] <= 0):
        tolerance = w.touch[i]
    if to_polynomial(row, judged, 0.0, tolerance, w):
        return 0, noise
    noise = multiplier_noise(i, w)
    if m[i] != 0.0:
        noise = noise_in(i, t, step, lo + 0.5 * width, p, m, w, ctx)
    if noise > 0.0 and to_polynomial(row, judged, noise, tolerance, w):
        return 0, noise
    low, high = sampled_range(row, w)
    known = 1e3 * (w.touch[i] if m[i] != 0.0 else tolerance)
    iw.pieces += 1 if high - low > known else 0
    return (1 if max(-low, high) > known else -1), noise


@kernel
def hardly_moves(low: float, high: float, w: Scratch) -> bool:
    """Whether a guard stays so near 0 on the step that its rounding is to be looked at."""
    size = 0.0
    for j in range(N):
        size = max(size, abs(w.coef[j]))
    return max(high, -low) <= 1e-10 * size


@inline
@kernel
def row_root(
    row: int, t: float, step: float, lo: float, width: float, tolerance: float, noise: float, p: Vector,
    m: Vector, order: Indices, w: Scratch, iw: Integers, ctx: Indices,
) -> tuple[int, float, int]:  # fmt: skip
    """First place on the piece where the guard in w.c stops being positive: (kind of root, u, degree).

    A guard that only touches 0 within rounding, is constant there, or is all rounding, has none.
    """
    c, i, degree, dip = w.c, row if row < M else row - M, DEGREE, 0.0
    allowed = w.touch[i] if m[i] != 0.0 else 0.0
    touch = allowed if w.grazed[i] == 0.0 else 0.0
    # Hysteresis: a guard that has not departed from 0 since its last root has to go clearly below it.
    low, high = coefficient_range(c) if straight(iw) else sampled_range(row, w)
    # A guard is known to rounding at best, also where its terms vanish, as those of a function of time.
    known = m[i] != 0.0 and ((ROLE[i] != KINK and WIDTH[i] == 0.0) or iw.sliding > 0)
    if known and (lo > 0.0 or order[i] <= 0 or ROLE[i] == OBSERVER):
        dip = max(rounding(t, step, i, m, w, iw), NOISY * EPS * max(-low, high))
        if ROOTS and ROOTED[i] != 0:
            # A guard that contains a root is steepest where that vanishes, and nowhere else on the step.
            dip = min(dip, STEEP * max(-low, high))
    still = 16.0 * allowed + dip
    # Below 0 at the end it has crossed, unless it is a first integral.
    again = ROLE[i] == OBSERVER and w.grazed[i] != 0.0 and low >= -still
    if again and (c[DEGREE] >= -dip or stands_still(low, high, still, 1e-2, step, i, w)):
        return NO_ROOT, 2.0, degree
    if lo == 0.0 and m[i] != 0.0 and order[i] > 0:
        degree = deflate(c, order[i])
        allowed, touch, dip = 0.0, 0.0, 0.0
    elif lo == 0.0 and m[i] == 0.0 and (abs(order[i]) > 2 or (abs(order[i]) == 2 and c[0] < -tolerance)):
        # At a two-fold (3) both rates vanish: their size at the start is rounding.
        spread = abs(w.node[i]) + abs(w.node[M + i]) if abs(order[i]) == 2 else 1e300
        degree = deflate(c, order_at_start(c, spread))
    elif known:
        # A dip below 0 no deeper than rounding is a tangency, not two crossings.
        if high <= allowed and stands_still(low, high, allowed, 1e-6, step, i, w):
            return NO_ROOT, 2.0, degree
        # So is a least value above 0 by no more than that: a guard of time has no other tolerance.
        touch += 2.0 * dip if w.grazed[i] == 0.0 and ROLE[i] != KINK and WIDTH[i] == 0.0 else 0.0
        allowed += dip
        # Except for a root at the very end of a clear descent.
        at_end = c[DEGREE] <= 0.0 and c[DEGREE - 1] > 2.0 * dip
        for a in range(DEGREE if at_end else NODES):
            c[a] += dip
    elif m[i] == 0.0:
        # A multiplier that only touches the end of its set does not leave it.
        dip = tolerance
        for a in range(NODES):
            c[a] += dip
    least, most = c[0], c[0]
    for a in range(1, degree + 1):
        least = min(least, c[a])
        most = max(most, c[a])
    # A guard that is zero throughout has no events: its surface is a first integral of the solution.
    if least > allowed or (least >= 0.0 and most <= 2.0 * dip):
        return NO_ROOT, 2.0, degree
    if m[i] != 0.0 and LINEAR[i] == 0:
        grain = noise if noise >= 0.0 else noise_in(i, t, step, lo + 0.5 * width, p, m, w, ctx)
        # A guard that is all rounding has no events.
        if high <= NOISY * grain and low >= -NOISY * grain:
            return NO_ROOT, 2.0, degree
    elif m[i] != 0.0 and (KINKED or degree < DEGREE) and hardly_moves(low, high, w):
        # A plane that is left so slowly that the step moves the terms of its guard by rounding only, or
        # a guard that is 0 in a whole region, where its terms cancel and show no scale.
        grain = PLANE * EPS * guard_scale(i, t, w.coef, w) if degree < DEGREE else 0.0
        if KINKED:
            grain = max(grain, NOISY * guard_noise(i, t, step, w.coef, p, m, w, ctx))
        if high <= grain and low >= -grain:
            return NO_ROOT, 2.0, degree
    # What the tolerance was where the segment began is no tangency of a guard that has decayed since.
    touch = min(touch, FLAT * most)
    kind, u = first_root(c, degree, touch, w.stack, w.bounds, w.work)
    if m[i] == 0.0 and kind != NO_ROOT and c[0] > 2.0 * dip > 0.0:
        end = DEGREE * 2 * M + i
        # Where the rates come together, at a two-fold, the place at which they do is but rounding.
        if w.node[end] + w.node[end + M] > 0.5 * (w.node[i] + w.node[M + i]):
            # It does leave: where it passes the end of its set, not where it is clearly beyond.
            for a in range(NODES):
                c[a] -= dip
            kind, u = first_root(c, degree, touch, w.stack, w.bounds, w.work)
    return (NO_ROOT if kind == TANGENT_ROOT and most <= allowed else kind), u, degree


@inline
@kernel
def slope_at_end(i: int, degree: int, u: float, width: float, step: float, w: Scratch) -> float:
    """Slope by theta of a multiplier's guard at u of a piece; notes how fast both rates come together."""
    upper, lower = min(1.0, u + 1e-4), max(0.0, u - 1e-4)
    slope = bernstein_value(w.c, degree, upper, w.work) - bernstein_value(w.c, degree, lower, w.work)
    end = DEGREE * 2 * M + i
    w.fall[i] = (w.node[i] + w.node[M + i] - w.node[end] - w.node[end + M]) / abs(width * step)
    return slope / ((upper - lower) * width)


@inline
@kernel
def first_on_piece(
    t: float, p: Vector, m: Vector, order: Indices, step: float, lo: float, width: float, halve_more: bool,
    w: Scratch, iw: Integers, ctx: Indices,
) -> tuple[int, int, float, float]:  # fmt: skip
    """The first event on a piece of the step: as `locate`; cause UNRESOLVED where the piece is too long."""
    best, surface, cause, slope = 2.0, -1, NOTHING, 0.0
    for row in range(2 * M):
        i = row if row < M else row - M
        if row >= M and m[i] != 0.0:
            continue
        tolerance, noise = -1.0, -1.0
        if m[i] == 0.0:
            tolerance = BOUND_TOLERANCE * (abs(w.node[i]) + abs(w.node[M + i]))
            if abs(order[i]) <= 2 and at_end_throughout(row, tolerance, w):
                continue
        if m[i] != 0.0 and order[i] == ALONG and stays_within(row, w.touch[i], w):
            continue
        if straight(iw):
            guard_polynomial(i, step, m, w)
        else:
            off, noise = row_polynomial(row, t, step, lo, width, tolerance, p, m, order, w, iw, ctx)
            if off != 0 and halve_more:
                return UNRESOLVED, 0, 0.0, 0.0
            iw.unresolved += 1 if off > 0 else 0
            if iw.unresolved > LEAVES:
                return UNRESOLVED, 0, 0.0, 0.0
            if ROOTS and off != 0 and lo == 0.0 and m[i] != 0.0 and order[i] > 0 and rises(row, w):
                continue
        kind, u, degree = row_root(row, t, step, lo, width, tolerance, noise, p, m, order, w, iw, ctx)
        if kind == NO_ROOT or u >= best:
            continue
        best, surface = u, i
        if kind == TANGENT_ROOT:
            cause = TOUCH
        elif m[i] != 0.0:
            cause = ROOT
        else:
            cause = UPPER if row < M else LOWER
            slope = slope_at_end(i, degree, u, width, step, w)
    return cause, surface, lo + width * best, slope


@kernel
def locate(
    t: float, p: Vector, m: Vector, order: Indices, step: float, w: Scratch, iw: Integers, ctx: Indices
) -> tuple[int, int, float, float]:
    """The first event in (0, 1] of the step: (cause, surface, theta, slope of the guard by theta).

    order[i]: the order of the zero of guard i at the start of the step (it is divided out); for a sliding
    surface +-2 says that its multiplier starts at an end of its set, +-3 that the rates of both sides vanish
    at the start. A least value of a guard below w.touch is a tangency. Cause -1: the user's code failed; -2:
    no sliding; UNRESOLVED: the step is too long for its guards. iw.pieces counts the pieces, however small,
    on which a guard was not a polynomial, apart from rounding.
    """
    pieces = w.pieces
    pieces[0], pieces[1], pieces[2] = 0.0, 1.0, 0.0
    waiting, direct = 1, straight(iw)
    iw.pieces, iw.unresolved = 0, 0
    while waiting > 0:
        waiting -= 1
        piece = shift(pieces, 3 * waiting)
        lo, hi, depth = piece[0], piece[1], piece[2]
        width = hi - lo
        code = 0 if direct else sample(t, step, lo, width, p, m, w, iw, ctx)
        if code != 0:
            return -code, 0, 0.0, 0.0
        halve_more = depth < SPLITS
        cause, surface, theta, slope = first_on_piece(t, p, m, order, step, lo, width, halve_more, w, iw, ctx)
        if cause == UNRESOLVED and not halve_more:
            return UNRESOLVED, 0, 0.0, 0.0
        if cause == UNRESOLVED:
            middle = 0.5 * (lo + hi)
            piece[0], piece[1], piece[2] = middle, hi, depth + 1.0
            piece[3], piece[4], piece[5] = lo, middle, depth + 1.0
            waiting += 2
        elif cause != NOTHING:
            return cause, surface, theta, slope
    return NOTHING, -1, 2.0, 0.0
