"""Root isolation: the first event of a step on the step's dense output.

Guards of surfaces off which the motion runs are h_i itself; a sliding surface has two, the rates at the ends
of its set of signs or, where another surface coupled to it slides too, the distance of its multiplier from
them. Each is written so that it is positive while the mode lasts; the event is where it stops being positive.

Resolution. Linear guards are polynomials of the dense output and are isolated on the whole step. Others are
sampled at 9 Chebyshev points, checked at two more, and the step is halved (at most SPLITS times) until the
polynomial stands for the guard to 1e-7 of its size: what is narrower than 2**-SPLITS of a step is not seen.
A guard that needs this in many places asks for a shorter step.
"""

from filippov.kernel.language.primitives import Indices, Vector, kernel, shift, sqrt
from filippov.kernel.loop.bernstein import bernstein_value, deflate, first_root
from filippov.kernel.loop.field import field, only_sliding
from filippov.kernel.loop.model import (
    AFFINE,
    ALL_LINEAR,
    COLOURS,
    COMPONENT,
    CONTACT,
    CONTACTS,
    DEGREE_DENSE,
    DENSE,
    DENSE_BERNSTEIN,
    EXTRA,
    G_COLUMN,
    G_FIRST,
    I_CALLS,
    I_LIST,
    I_PEERS,
    I_PIECES,
    I_SLIDING,
    IMPLICIT,
    LINEAR,
    OWNER,
    ROLE,
    RULE,
    STAGES,
    W_ATTRACT,
    W_BOUNDS,
    W_C,
    W_CHECK,
    W_COEF,
    W_END,
    W_F,
    W_FALL,
    W_G,
    W_GRAZED,
    W_GT,
    W_H,
    W_K,
    W_MULT,
    W_NODE,
    W_PIECES,
    W_RADIUS,
    W_STACK,
    W_STAGE,
    W_START,
    W_TOUCH,
    W_VERT,
    W_WORK,
    W_XM,
    W_Y,
    WIDE,
    WIDTH,
    M,
    N,
    guards,
    radii,
)
from filippov.kernel.loop.points import place_point, point_rows, prepare_points, take_rows
from filippov.kernel.loop.rules import UTKIN
from filippov.kernel.tables.codes import LOWER, NOTHING, OBSERVER, ROOT, TOUCH, UNRESOLVED, UPPER
from filippov.kernel.tables.layout import CHECKS, COLUMNS, LANES, MULTIPLIER, RATE_MINUS, RATE_PLUS, SPLITS
from filippov.kernel.tables.root_tables import DEGREE, NODES, POSITION, TO_BERNSTEIN, TOUCHING

CHECK_FIRST, CHECK_APART = 0.3137, 0.4218
NOISY, NEIGHBOUR = 64.0, 1.2345e-10
LEAVES = 16
# Of the rates on both sides of a sliding surface: an excess of the multiplier that is rounding.
BRUSH = 1e-10
EPS = 2.220446049250313e-16
OPEN = 1e299


@kernel
def dense_output(x: Vector, step: float, w: Vector) -> None:
    """x(theta) = sum_j coef[j] theta**j on the step, theta in [0, 1], from the stages in the scratch."""
    for i in range(N):
        w[W_COEF + i] = x[i]
    for j in range(1, DEGREE_DENSE + 1):
        for i in range(N):
            total = 0.0
            for r in range(STAGES + EXTRA):
                total += DENSE[r * (DEGREE_DENSE + 1) + j] * w[W_K + r * N + i]
            w[W_COEF + j * N + i] = step * total


@kernel
def straight(iw: Indices) -> bool:
    """Whether every guard is linear in the state, so that its polynomial comes straight from the stages."""
    return ALL_LINEAR and not IMPLICIT and iw[I_SLIDING] == 0


@kernel
def guard_polynomial(i: int, step: float, m: Vector, w: Vector) -> None:
    """Bernstein coefficients of a linear guard on the step, from its rates along the stages."""
    c = shift(w, W_C)
    for a in range(NODES):
        c[a] = 0.0
    for r in range(STAGES + EXTRA):
        rate = 0.0
        for b in range(G_FIRST[i], G_FIRST[i + 1]):
            rate += w[W_G + i * N + G_COLUMN[b]] * w[W_K + r * N + G_COLUMN[b]]
        for a in range(1, DEGREE):
            c[a] += DENSE_BERNSTEIN[r * NODES + a] * rate
    # The ends are samples themselves: rounding in the sums must not move them off zero.
    c[0] = m[i] * w[W_START + 2 * i] + WIDTH[i]
    c[DEGREE] = m[i] * w[W_END + 2 * i] + WIDTH[i]
    for a in range(1, DEGREE):
        c[a] = c[0] + m[i] * step * (c[a] + w[W_GT + i] * float(a) / float(DEGREE))


@kernel
def dense_value(theta: float, out: Vector, w: Vector) -> None:
    """The dense output at theta (Horner)."""
    for i in range(N):
        value = w[W_COEF + DEGREE_DENSE * N + i]
        for j in range(DEGREE_DENSE - 1, -1, -1):
            value = value * theta + w[W_COEF + j * N + i]
        out[i] = value


@kernel
def sliding_guards(out: Vector, w: Vector, iw: Indices) -> None:
    """Rows i and M + i of out: positive while the multiplier of sliding surface i stays inside its set."""
    for c in range(iw[I_SLIDING]):
        i = iw[I_LIST + c]
        lo, hi = w[W_RADIUS + 2 * i], w[W_RADIUS + 2 * i + 1]
        mult = shift(w, W_MULT + i * COLUMNS)
        if iw[I_PEERS + COMPONENT[i]] == 1:
            plus, minus = w[W_ATTRACT + i] * mult[RATE_PLUS], w[W_ATTRACT + i] * mult[RATE_MINUS]
            out[i] = -0.5 * ((1.0 + hi) * plus + (1.0 - hi) * minus)
            out[M + i] = 0.5 * ((1.0 + lo) * plus + (1.0 - lo) * minus)
        else:
            out[i] = hi - mult[MULTIPLIER]
            out[M + i] = mult[MULTIPLIER] - lo
        # A contact has one end: the other side of its set is open, and further off than that end, whose row
        # may be as negative as it likes.
        if CONTACTS and hi > OPEN:
            out[i] = sqrt(1.0 + out[M + i] * out[M + i])
        if CONTACTS and lo < -OPEN:
            out[M + i] = sqrt(1.0 + out[i] * out[i])


@kernel
def guard_rows(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """All guards at one point, positive while the mode lasts."""
    h = shift(w, W_H)
    if guards(t, x, p, m, h, ctx) != 0:
        return 1
    for i in range(M):
        out[i] = m[i] * h[i] + WIDTH[i]
        out[M + i] = 1.0
    if iw[I_SLIDING] > 0:
        code = field(t, x, p, m, shift(w, W_F), w, iw, ctx)
        if code != 0:
            return code
        if radii(t, x, p, shift(w, W_RADIUS), ctx) != 0:
            return 1
        sliding_guards(out, w, iw)
    return 0


@kernel
def sample_in_lanes(
    t: float, step: float, lo: float, width: float, p: Vector, m: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """As `sample`, for a motion that slides on one surface of a small symbolic system."""
    i, first, x = only_sliding(iw), 0, shift(w, W_XM)
    prepare_points(p, m, w)
    while first < NODES + CHECKS:
        # Lanes that are left over in the last round keep their points.
        filled = min(LANES, NODES + CHECKS - first)
        for lane in range(filled):
            q = first + lane
            at = POSITION[q] if q < NODES else CHECK_FIRST + CHECK_APART * (q - NODES)
            theta = lo + width * at
            dense_value(theta, x, w)
            for j in range(N):
                x[j] = w[W_Y + j] if theta == 1.0 else x[j]
            place_point(lane, t + theta * step, x, w)
        if point_rows(i, w[W_ATTRACT + i], w, ctx) != 0:
            return 2
        for lane in range(filled):
            q = first + lane
            take_rows(lane, shift(w, W_NODE + q * 2 * M if q < NODES else W_CHECK + (q - NODES) * 2 * M), w)
        first += LANES
    iw[I_CALLS] += 2 * (NODES + CHECKS)
    return 0


@kernel
def sample(
    t: float, step: float, lo: float, width: float, p: Vector, m: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """Guards on one piece of the step: at the Chebyshev points, and where they are to be checked."""
    if WIDE:  # noqa: SIM102 - told apart when the unit is made
        if iw[I_SLIDING] == 1 and CONTACT[only_sliding(iw)] == 0 and (AFFINE or RULE != UTKIN):
            return sample_in_lanes(t, step, lo, width, p, m, w, iw, ctx)
    x = shift(w, W_XM)
    for q in range(NODES):
        theta = lo + width * POSITION[q]
        dense_value(theta, x, w)
        if theta == 1.0:
            # The step's own end: what is 0 there is 0 here.
            for j in range(N):
                x[j] = w[W_Y + j]
        code = guard_rows(t + theta * step, x, p, m, shift(w, W_NODE + q * 2 * M), w, iw, ctx)
        if code != 0:
            return code
    if not ALL_LINEAR or iw[I_SLIDING] > 0:
        for q in range(CHECKS):
            theta = lo + width * (CHECK_FIRST + CHECK_APART * q)
            dense_value(theta, x, w)
            code = guard_rows(t + theta * step, x, p, m, shift(w, W_CHECK + q * 2 * M), w, iw, ctx)
            if code != 0:
                return code
    return 0


@kernel
def guard_noise(i: int, t: float, x: Vector, p: Vector, m: Vector, w: Vector, ctx: Indices) -> float:
    """The noise of guard i near (t, x): its second differences over a few neighbouring points.

    A smooth function has next to none so close; what is left is rounding inside h, which its gradient does
    not show (More & Wild 2011). 0 where h cannot be evaluated.
    """
    y, h = shift(w, W_STAGE), shift(w, W_H)
    noise, one, two = 0.0, 0.0, 0.0
    for q in range(7):
        factor = 1.0 + NEIGHBOUR * float(q)
        for j in range(N):
            y[j] = x[j] * factor
        if guards(t * factor, y, p, m, h, ctx) != 0:
            return 0.0
        if q >= 2:
            noise = max(noise, abs(h[i] - 2.0 * one + two))
        two, one = one, h[i]
    return noise


@kernel
def coefficient_range(c: Vector) -> tuple[float, float]:
    """Least and largest Bernstein coefficient: the guard stays between them."""
    least, most = float(c[0]), float(c[0])
    for a in range(1, NODES):
        least = min(least, c[a])
        most = max(most, c[a])
    return least, most


@kernel
def sampled_range(row: int, w: Vector) -> tuple[float, float]:
    """Least and largest sample of a guard: between Chebyshev points a polynomial does not go far beyond."""
    least, most = float(w[W_NODE + row]), float(w[W_NODE + row])
    for a in range(1, NODES):
        least = min(least, w[W_NODE + a * 2 * M + row])
        most = max(most, w[W_NODE + a * 2 * M + row])
    return least, most


@kernel
def to_polynomial(row: int, judged: bool, noise: float, brush: float, w: Vector) -> bool:
    """Bernstein coefficients of one guard on the sampled piece; False where they do not stand for it.

    brush: where it is not negative, the guard is asked for its sign as well, if it is not as small as this.
    """
    c = shift(w, W_C)
    largest, worst = 0.0, 0.0
    for a in range(NODES):
        total = 0.0
        for b in range(NODES):
            total += TO_BERNSTEIN[a * NODES + b] * w[W_NODE + b * 2 * M + row]
        c[a] = total
        largest = max(largest, abs(w[W_NODE + a * 2 * M + row]))
    # The ends are samples themselves: rounding in the transform must not move them off zero.
    c[0] = w[W_NODE + row]
    c[DEGREE] = w[W_NODE + DEGREE * 2 * M + row]
    if judged:
        for q in range(CHECKS):
            u = CHECK_FIRST + CHECK_APART * q
            miss = bernstein_value(c, DEGREE, u, shift(w, W_WORK)) - w[W_CHECK + q * 2 * M + row]
            if abs(miss) > 1e-7 * largest + NOISY * noise:
                return False
            worst = max(worst, abs(miss))
    if brush >= 0.0 and worst > brush:
        bound, _ = coefficient_range(c)
        least, _ = sampled_range(row, w)
        return bound > 4.0 * worst or least < -4.0 * worst
    return True


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


@kernel
def balanced_terms(j: int, m: Vector, w: Vector, iw: Indices) -> float:
    """The size of the fields that the multipliers balance in velocity j: what its rounding is part of."""
    total = abs(w[W_VERT + j])
    if AFFINE and M > 1 and iw[I_SLIDING] > 1:
        for colour in range(COLOURS):
            owner = OWNER[colour * N + j]
            if owner >= 0 and m[owner] == 0.0:
                total += 2.0 * abs(w[W_VERT + (colour + 1) * N + j])
    else:
        total += abs(w[W_VERT + N + j])
    return float(total)


@kernel
def rounding(t: float, step: float, i: int, m: Vector, w: Vector, iw: Indices) -> float:
    """What guard i cannot be told from 0 by on this step: the rounding of the dense output in its terms.

    While others slide their multipliers balance vertex fields, whose rounding is left in the velocity.
    """
    total = abs(w[W_GT + i]) * max(abs(t), abs(t + step))
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        j = G_COLUMN[a]
        moved = 0.0
        if iw[I_SLIDING] > 0:
            moved = abs(step) * balanced_terms(j, m, w, iw)
        total += abs(w[W_G + i * N + j]) * (max(abs(w[W_COEF + j]), abs(w[W_Y + j])) + moved)
    return float(1024.0 * EPS * total)


@kernel
def stands_still(least: float, most: float, touch: float, step: float, i: int, w: Vector) -> bool:
    """Whether guard i stays within `touch` of 0 while its terms move: a first integral but for errors."""
    moved = float(abs(w[W_GT + i] * step))
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        j = G_COLUMN[a]
        moved += abs(w[W_G + i * N + j] * (w[W_Y + j] - w[W_COEF + j]))
    return most <= touch and least >= -touch and most - least <= 1e-6 * moved


@kernel
def locate(
    t: float, p: Vector, m: Vector, order: Indices, step: float, w: Vector, iw: Indices, ctx: Indices
) -> tuple[int, int, float, float]:
    """The first event in (0, 1] of the step: (cause, surface, theta, slope of the guard by theta).

    order[i]: how often guard i vanishes at the start of the step (the root it starts from is divided out);
    for a sliding surface +-2 says that its multiplier starts at an end of its set, +-3 that the rates of both
    sides vanish at the start. A least value of a guard below W_TOUCH is a touching. Cause -1: the user's code
    failed; -2: no sliding; UNRESOLVED: the step is too long for its guards. iw[I_PIECES] counts the pieces on
    which a guard was no polynomial, however small; what is no more than rounding is not counted.
    """
    c, work, pieces = shift(w, W_C), shift(w, W_WORK), shift(w, W_PIECES)
    pieces[0], pieces[1], pieces[2] = 0.0, 1.0, 0.0
    waiting, direct, unresolved = 1, straight(iw), 0
    iw[I_PIECES] = 0
    while waiting > 0:
        waiting -= 1
        piece = shift(pieces, 3 * waiting)
        lo, hi, depth = piece[0], piece[1], piece[2]
        width = hi - lo
        code = 0 if direct else sample(t, step, lo, width, p, m, w, iw, ctx)
        if code != 0:
            return -code, 0, 0.0, 0.0
        resolved = True
        best, surface, cause, slope = 2.0, -1, NOTHING, 0.0
        for row in range(2 * M):
            i = row if row < M else row - M
            if row >= M and m[i] != 0.0:
                continue
            judged = m[i] == 0.0 or LINEAR[i] == 0
            noise, brush = -1.0, -1.0
            if m[i] == 0.0:
                brush = BRUSH * (abs(w[W_NODE + i]) + abs(w[W_NODE + M + i]))
            if direct:
                guard_polynomial(i, step, m, w)
            elif not to_polynomial(row, judged, 0.0, brush, w):
                if m[i] != 0.0:
                    dense_value(lo + 0.5 * width, shift(w, W_XM), w)
                    noise = guard_noise(i, t + (lo + 0.5 * width) * step, shift(w, W_XM), p, m, w, ctx)
                if noise <= 0.0 or not to_polynomial(row, judged, noise, brush, w):
                    low, high = sampled_range(row, w)
                    known = 1e3 * (w[W_TOUCH + i] if m[i] != 0.0 else brush)
                    iw[I_PIECES] += 1 if high - low > known else 0
                    if depth < SPLITS:
                        resolved = False
                        break
                    if max(-low, high) > known:
                        unresolved += 1
                        if unresolved > LEAVES:
                            return UNRESOLVED, 0, 0.0, 0.0
            degree = DEGREE
            dip = 0.0
            allowed = w[W_TOUCH + i] if m[i] != 0.0 else 0.0
            touch = allowed if w[W_GRAZED + i] == 0.0 else 0.0
            # Hysteresis: what never got clear of 0 since it was last there has to go clearly below it.
            low, high = coefficient_range(c) if direct else sampled_range(row, w)
            if ROLE[i] == OBSERVER and w[W_GRAZED + i] != 0.0 and low >= -16.0 * allowed:
                continue
            if lo == 0.0 and m[i] != 0.0 and order[i] > 0:
                degree = deflate(c, order[i])
                allowed, touch = 0.0, 0.0
            elif lo == 0.0 and m[i] == 0.0 and (abs(order[i]) > 2 or (abs(order[i]) == 2 and c[0] < -brush)):
                # At a two-fold (3) both rates vanish: their size at the start is rounding.
                spread = abs(w[W_NODE + i]) + abs(w[W_NODE + M + i]) if abs(order[i]) == 2 else 1e300
                degree = deflate(c, order_at_start(c, spread))
            elif allowed > 0.0:
                # A dip below 0 no deeper than rounding is a touching, not two crossings.
                if stands_still(low, high, allowed, step, i, w):
                    continue
                dip = rounding(t, step, i, m, w, iw)
                touch += dip if touch > 0.0 else 0.0
                allowed += dip
                # A root at the very end of a clear descent is none of these.
                at_end = c[DEGREE] <= 0.0 and c[DEGREE - 1] > 2.0 * dip
                for a in range(DEGREE if at_end else NODES):
                    c[a] += dip
            elif m[i] == 0.0:
                # A multiplier that comes to the end of its set and turns back, does not leave it.
                dip = brush
                for a in range(NODES):
                    c[a] += dip
            least, most = c[0], c[0]
            for a in range(1, degree + 1):
                least = min(least, c[a])
                most = max(most, c[a])
            # A guard that is zero throughout says nothing: its surface is a first integral of the motion.
            if least > allowed or (least >= 0.0 and most <= 2.0 * dip):
                continue
            if m[i] != 0.0 and LINEAR[i] == 0 and degree == DEGREE:
                if noise < 0.0:
                    dense_value(lo + 0.5 * width, shift(w, W_XM), w)
                    noise = guard_noise(i, t + (lo + 0.5 * width) * step, shift(w, W_XM), p, m, w, ctx)
                # A guard that is nothing but rounding says nothing.
                if high <= NOISY * noise and low >= -NOISY * noise:
                    continue
            kind, u = first_root(c, degree, touch, shift(w, W_STACK), shift(w, W_BOUNDS), work)
            if kind == 0 or u >= best or (kind == TOUCHING and most <= allowed):
                continue
            best, surface = u, i
            if kind == TOUCHING:
                cause = TOUCH
            elif m[i] != 0.0:
                cause = ROOT
            else:
                cause = UPPER if row < M else LOWER
                upper, lower = min(1.0, u + 1e-4), max(0.0, u - 1e-4)
                slope = bernstein_value(c, degree, upper, work) - bernstein_value(c, degree, lower, work)
                slope /= (upper - lower) * width
                # How fast the rates on both sides come together.
                end = W_NODE + DEGREE * 2 * M + i
                w[W_FALL + i] = (w[W_NODE + i] + w[W_NODE + M + i] - w[end] - w[end + M]) / abs(width * step)
        if not resolved:
            middle = 0.5 * (lo + hi)
            piece[0], piece[1], piece[2] = middle, hi, depth + 1.0
            piece[3], piece[4], piece[5] = lo, middle, depth + 1.0
            waiting += 2
        elif cause != NOTHING:
            return cause, surface, lo + width * best, slope
    return NOTHING, -1, 2.0, 0.0
