"""Step control: error norm, first step, and the tests that say whether a step needs a closer look."""

from filippov.kernel.language.primitives import (
    INF,
    Indices,
    Vector,
    from_bits,
    kernel,
    seldom,
    shift,
    sqrt,
    to_bits,
)  # fmt: skip
from filippov.kernel.loop.field import field
from filippov.kernel.loop.gradients import rate
from filippov.kernel.loop.land import guard_scale
from filippov.kernel.loop.model import (
    ALL_LINEAR,
    COMPONENT,
    CONTACT,
    EXTRA,
    G_COLUMN,
    G_FIRST,
    IMPLICIT,
    MOVING,
    ORDER,
    PER_NODE,
    RESET_FROM,
    RESETS,
    ROLE,
    ROOTED,
    ROOTS,
    SERIES,
    STAGES,
    STRAIGHT,
    WIDTH,
    M,
    N,
    error_terms,
    extra_stages,
    gradients,
    guards,
    rhs,
)
from filippov.kernel.loop.series import constant_series, series_clear
from filippov.kernel.loop.state import Clock, Integers, Scratch
from filippov.kernel.tables.codes import ALONG, LOWER, OBSERVER, ROOT, UPPER
from filippov.kernel.tables.layout import EPS
from filippov.kernel.tables.root_tables import GAUSS_A, GAUSS_B, GAUSS_C

# Bits of 1.0, moved by the mean error of reading a mantissa as a logarithm.
ONE_BITS = 4606988764016040477


# An error in which the field overflows, next to a pole, counts as large.
LARGEST_ERROR = 1e6


@kernel
def combine(square5: float, square3: float, step: float, n: float, rtol: float) -> float:
    """Square of the error's norm from its one or two estimates (Hairer, Norsett & Wanner 1993, II.10).

    The combination of both at order 8 can be far too small where a step enters a narrow peak of the field:
    e5**2 over a large e3. The bound of each by itself in an accepted step grows as the tolerance falls, by
    the difference of the orders: 10 rtol**(-1/4) and 10 rtol**(-1/2).
    """
    if ORDER == 8 and not SERIES:
        both = step * step * square5 * square5 / (square5 + 0.01 * square3 + 1e-300)
        alone = step * step * 0.01 * max(sqrt(rtol) * square5, rtol * square3)
        return max(both, min(alone, LARGEST_ERROR)) / n
    return step * step * square5 / n


@kernel
def least_step(t: float, start: float, end: float) -> float:
    """The step below which a run is stuck: the spacing of t, and around t = 0 what its squares keep apart."""
    least = max(1e-100 * max(abs(start), abs(end)), 1e-300)
    return max(4.0 * EPS * abs(t), least)


@kernel
def error_norm(
    x: Vector, y: Vector, step: float, rtol: float, atol: Vector, relative: int, kept: int, slack: float,
    noise: float, w: Scratch,
) -> float:  # fmt: skip
    """Mean square of the local error over atol + rtol |x|; of guard `relative` over rtol |h| slack too.

    kept (0 or 1): |h| is that of the guard itself, or its change in the time `slack` of a cycle, so that the
    next root is as accurate in time; else it is its change over the step.
    """
    square5, square3 = 0.0, 0.0
    guard5, guard3, rise, terms = 0.0, 0.0, 0.0, 0.0
    for i in range(N):
        e5, e3 = error_terms(i, w)
        if relative >= 0:
            guard5 += w.g[relative * N + i] * e5
            guard3 += w.g[relative * N + i] * e3
            rise += w.g[relative * N + i] * (y[i] - x[i])
            terms += abs(w.g[relative * N + i] * x[i])
        scale = 1.0 / (atol[i] + rtol * max(abs(x[i]), abs(y[i])))
        square5 += (e5 * scale) ** 2
        square3 += (e3 * scale) ** 2
    norm = combine(square5, square3, step, float(N), rtol)
    if relative >= 0:
        scale = rtol * slack * abs(rise) + noise * abs(step)
        if kept != 0:
            start = w.start[2 * relative]
            rise += w.gt[relative] * step
            far = max(abs(start), abs(start + rise)) + slack * abs(w.start[2 * relative + 1])
            scale = rtol * far + 16.0 * EPS * terms + 1e-300
        norm = max(norm, combine((guard5 / scale) ** 2, (guard3 / scale) ** 2, step, 1.0, rtol))
    return norm


@kernel
def step_factor(square: float) -> float:
    """0.9 error**(-1/order) from the square of the error, to half a percent.

    The exponent field of a double is its logarithm and the mantissa a linear bit of it, so the root is a
    division of the bits; an exact one would keep the next step waiting and choose it no better.
    """
    bits = ONE_BITS - (to_bits(square) - ONE_BITS) // (2 * ORDER)
    return 0.9 * from_bits(bits)


@kernel
def first_step(
    t: float, x: Vector, p: Vector, m: Vector, f: Vector, rtol: float, atol: Vector, limit: float,
    direction: float, w: Scratch, iw: Integers, ctx: Indices,
) -> tuple[int, float]:  # fmt: skip
    """A first step from two field values (Hairer, Norsett & Wanner 1993, section II.4)."""
    y, f1 = w.y, w.f
    d0, d1 = 0.0, 0.0
    for i in range(N):
        scale = atol[i] + rtol * abs(x[i])
        d0 += (x[i] / scale) ** 2
        d1 += (f[i] / scale) ** 2
    d0, d1 = sqrt(d0 / float(N)), sqrt(d1 / float(N))
    h0 = 1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1
    # A state that starts at 0 up to rounding must not ask for a step below the spacing of t.
    h0 = min(max(h0, 1e-12 * limit, 64.0 * EPS * abs(t)), limit)
    for i in range(N):
        y[i] = x[i] + direction * h0 * f[i]
    code = field(t + direction * h0, y, p, m, f1, w, iw, ctx)
    if code != 0:
        return code, h0
    d2 = 0.0
    for i in range(N):
        d2 += ((f1[i] - f[i]) / (atol[i] + rtol * abs(x[i]))) ** 2
    if d2 == 0.0:
        # A field that appears constant from here.
        return 0, limit
    d2 = sqrt(d2 / float(N)) / h0
    if not (d2 < 1e300):
        return 0, h0 * 1e-3
    h1 = max(1e-6, h0 * 1e-3)
    if d1 > 1e-15 or d2 > 1e-15:
        h1 = (0.01 / max(d1, d2)) ** (1.0 / float(ORDER))
    return 0, min(100.0 * h0, h1, limit)


@kernel
def at_rest(w: Scratch) -> bool:
    """Whether the field at the start of the step is 0."""
    fastest = 0.0
    for j in range(N):
        fastest = max(fastest, abs(w.k[j]))
    return fastest == 0.0


@kernel
def uniform(w: Scratch) -> bool:
    """Whether the field was the same in all stages: then the step is a straight line."""
    if SERIES:
        return constant_series(w)
    for r in range(1, STAGES - 1):
        for j in range(N):
            if w.k[r * N + j] != w.k[j]:
                return False
    return True


@kernel
def go_straight(x: Vector, step: float, y: Vector, w: Scratch) -> None:
    """The exact end of a step along a straight line, and the field there."""
    for j in range(N):
        y[j] = x[j] + step * w.k[j]
        w.k[(STAGES - 1) * N + j] = w.k[j]


@kernel
def other_stages(
    t: float, x: Vector, p: Vector, m: Vector, step: float, line: bool, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """The stages needed only by the dense output; on a straight line they are known."""
    if not line:
        return extra_stages(t, x, p, m, step, w, iw, ctx)
    for r in range(STAGES, STAGES + EXTRA):
        for j in range(N):
            w.k[r * N + j] = w.k[j]
    return 0


@kernel
def mark_grazed(m: Vector, start: bool, w: Scratch) -> None:
    """Keep a tangency from being reported twice: in between, the guard must depart from 0 (hysteresis)."""
    for i in range(M):
        clear = abs(w.end[2 * i]) > 1e3 * w.touch[i]
        if start:
            w.grazed[i] = 0.0 if abs(w.start[2 * i]) > 1e3 * w.touch[i] else 1.0
        elif clear:
            w.grazed[i] = 0.0


@kernel
def finite(x: Vector, n: int) -> bool:
    """Whether every entry is a number."""
    total = 0.0
    for i in range(n):
        total += x[i] * 0.0
    return total == 0.0


@kernel
def leaves(i: int, twice: bool, step: float, side: float, w: Scratch) -> bool:
    """Whether guard i, zero at the start of the step (twice: its rate too), grows all the way through it.

    Its rates along the stages, divided by theta where they start from zero, exceed their own range.
    """
    least, most = 1e300, -1e300
    for r in range(1, STAGES):
        growth = side * step * rate(i, shift(w.k, r * N), w)
        growth = growth * PER_NODE[r] if twice else growth
        least, most = min(least, growth), max(most, growth)
    return least > most - least


# So many stages that the range of a multiplier over them shows that it varies fast.
MANY_STAGES = 10


@kernel
def suspicious(step: float, m: Vector, order: Indices, line: bool, w: Scratch, iw: Integers) -> bool:
    """Whether a guard may vanish in the step: not if its distance from 0 exceeds its curvature.

    For linear guards the test is on the cubic through both ends of the step; it is skipped for others, which
    are always sampled. One that starts from 0 is clear if it grows throughout (see `leaves`). Multipliers are
    judged by their range over the stages, if these are many and the ends of their sets are constant: the
    multiplier may vary faster than the solution, which then takes long steps. On a straight line that is
    always possible, unless the rates are straight too.
    """
    if SERIES:
        return not series_clear(step, m, order, w, iw)
    for i in range(M):
        if m[i] == 0.0:
            if IMPLICIT or MOVING[i] != 0 or (line and iw.sliding > 1):
                return True
            if STRAIGHT[i] == 0 and (line or STAGES < MANY_STAGES):
                return True
            mult = w.mult[i]
            spread = mult.most - mult.least
            below, above = mult.least - spread, mult.most + spread
            if not (above < w.radius[2 * i + 1] and below > w.radius[2 * i]):
                return True
            if iw.coupled[COMPONENT[i]] == 1 and (w.attract[i] < 0.0 or not (mult.slope < 0.0)):
                return True
            continue
        if not ALL_LINEAR:
            return True
        if order[i] > 0:
            if IMPLICIT or WIDTH[i] > 0.0 or order[i] > 2 or not leaves(i, order[i] == 2, step, m[i], w):
                return True
            continue
        h0, h1 = m[i] * w.start[2 * i] + WIDTH[i], m[i] * w.end[2 * i] + WIDTH[i]
        d0, d1 = m[i] * w.start[2 * i + 1] * step, m[i] * w.end[2 * i + 1] * step
        bend = abs(h1 - h0 - d0) + abs(2.0 * (h1 - h0) - d0 - d1)
        least = min(h0, h1, h0 + d0 / 3.0, h1 - d1 / 3.0)
        if not (least > bend + w.touch[i]):
            return True
    return False


@kernel
def guard_state(
    t: float, x: Vector, p: Vector, m: Vector, f: Vector, state: Vector, w: Scratch, ctx: Indices
) -> int:
    """Guards and their rates along f, in turn, into `state`; 0 for a slope that a root has none of."""
    h = w.h
    if guards(t, x, p, m, h, ctx) != 0 or gradients(t, x, p, m, w.g, w.gt, ctx) != 0:
        return 1
    for i in range(M):
        if ROOTS:
            w.gt[i] = w.gt[i] if abs(w.gt[i]) < INF else 0.0
            for a in range(G_FIRST[i], G_FIRST[i + 1]):
                slope = w.g[i * N + G_COLUMN[a]]
                w.g[i * N + G_COLUMN[a]] = slope if abs(slope) < INF else 0.0
        state[2 * i], state[2 * i + 1] = h[i], rate(i, f, w)
    return 0


@seldom
@kernel
def guards_on(
    t: float, x: Vector, p: Vector, m: Vector, order: Indices, surface: int, f: Vector, state: Vector,
    w: Scratch, ctx: Indices,
) -> int:  # fmt: skip
    """`guard_state` of guards that contain roots, at a point on surfaces: there |h| counts as 0.

    surface: the one that was reached, -1 for none; a segment starts from those of positive order. The root of
    a rounding error would have an arbitrary slope; the true one is infinite and says nothing of the guard
    elsewhere.
    """
    g, gt = w.rooted, shift(w.rooted, M * N)
    for j in range(M):
        w.s[j] = 0.0 if CONTACT[j] == 0 and (j == surface or order[j] > 0) else m[j]
    if guards(t, x, p, w.s, w.h, ctx) != 0 or gradients(t, x, p, w.s, g, gt, ctx) != 0:
        return 1
    for i in range(M):
        if ROOTED[i] == 0:
            continue
        w.gt[i] = gt[i] if abs(gt[i]) < INF else 0.0
        for a in range(G_FIRST[i], G_FIRST[i + 1]):
            slope = g[i * N + G_COLUMN[a]]
            w.g[i * N + G_COLUMN[a]] = slope if abs(slope) < INF else 0.0
        state[2 * i], state[2 * i + 1] = w.h[i], rate(i, f, w)
    return 0


@kernel
def is_non_lipschitz(
    t: float, x: Vector, p: Vector, m: Vector, i: int, w: Scratch, iw: Integers, ctx: Indices
) -> bool:
    """Whether the field off surface i is not Lipschitz in h_i at 0 (a power below 1): clause E8."""
    y, f0, f1 = w.y, w.xm, w.f
    size = 0.0
    for j in range(N):
        size += w.g[i * N + j] ** 2
    if size == 0.0 or rhs(t, x, p, m, m, f0, ctx) != 0:
        return False
    iw.calls += 3
    near, far, noise = 0.0, 0.0, 0.0
    for q in range(2):
        reach = m[i] * (1e-7 if q == 0 else 1e-11) / size
        for j in range(N):
            y[j] = x[j] + reach * w.g[i * N + j]
        if rhs(t, y, p, m, m, f1, ctx) != 0:
            return False
        far = near
        near = 0.0
        for j in range(N):
            near = max(near, abs(w.g[i * N + j] * (f1[j] - f0[j])))
            noise = max(noise, EPS * abs(w.g[i * N + j] * f0[j]))
    # A Lipschitz field changes ten thousand times less over ten thousand times less.
    return near > 2e-4 * far + 1e2 * noise


@seldom
@kernel
def collocation_start(
    t: float, x: Vector, p: Vector, m: Vector, length: float, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """A first tiny step off a surface where the field is not Lipschitz: Picard iteration on 3 Gauss nodes.

    A relative error in h decays like 1/t from there on, so the step may be inaccurate as long as it is tiny;
    for the same reason `slack` lets the following steps be the less accurate the closer they are to the
    surface.
    """
    at, f = w.collocation, shift(w.collocation, 3 * N)
    for q in range(3):
        for j in range(N):
            at[q * N + j] = x[j]
    for _ in range(80):
        for q in range(3):
            code = field(t + GAUSS_C[q] * length, shift(at, q * N), p, m, shift(f, q * N), w, iw, ctx)
            if code != 0:
                return code
        for q in range(3):
            for j in range(N):
                total = 0.0
                for r in range(3):
                    total += GAUSS_A[3 * q + r] * f[r * N + j]
                at[q * N + j] = x[j] + length * total
    for j in range(N):
        for r in range(3):
            x[j] += length * GAUSS_B[r] * f[r * N + j]
    return 0


@seldom
@kernel
def time_to_surface(m: Vector, order: Indices, w: Scratch) -> tuple[float, int]:
    """Shortest time in which a guard reaches 0 at its present rate, and its surface (-1 for none).

    A surface from which the segment starts is behind, whatever the sign of a rounded rate.
    """
    best, surface = 1e300, -1
    for i in range(M):
        rate = m[i] * w.start[2 * i + 1]
        if rate < 0.0 and order[i] == 0:
            wait = -(m[i] * w.start[2 * i] + WIDTH[i]) / rate
            if wait < best:
                best, surface = max(wait, 0.0), i
    return best, surface


@seldom
@kernel
def shrink_invalid(clock: Clock, m: Vector, order: Indices, step: float, w: Scratch) -> tuple[float, int]:
    """Step after an invalid stage: towards the nearest surface ahead if there is one, else a quarter.

    The surface is returned where it is one rounding away, -1 otherwise.
    """
    wait, surface = time_to_surface(m, order, w)
    reach = max(abs(clock.t), 1e-3 * abs(clock.t_end - clock.t_start))
    if surface >= 0 and wait <= 16.0 * EPS * reach:
        return 0.0, surface
    if surface >= 0 and wait < 4.0 * abs(step):
        return min(0.5 * abs(step), 0.9 * wait), -1
    return 0.25 * abs(step), -1


@kernel
def hides_order(t: float, length: float, step: float) -> bool:
    """Whether a step is so long that rounding of its dense output may hide the order of two impacts."""
    return RESETS and M > 1 and length < 1e-3 * step and length > 1e3 * EPS * abs(t)


@kernel
def falls(j: int, m: Vector, w: Scratch) -> bool:
    """Whether the solution runs onto surface j, off which it ran at the start of the step."""
    speed = float(m[j] * w.end[2 * j + 1] * w.direction)
    return speed < 0.0


@kernel
def watches(i: int) -> bool:
    """Whether surface i resets the state or is an observer: neither is to be passed unseen."""
    return RESET_FROM[i] != 0 or ROLE[i] == OBSERVER


@kernel
def mark_triggers(
    t: float, x: Vector, m: Vector, order: Indices, cause: int, i: int, step: float, trigger: Indices,
    w: Scratch,
) -> int:
    """Mark every surface whose guard vanishes at the event within rounding, and return how many.

    A sliding surface counts where its multiplier is at an end of its set. One that others hold the solution
    on is not triggered, and counts: it may be left with them.
    """
    total = 0
    for j in range(M):
        trigger[j] = 0
        if j == i:
            trigger[j] = cause
        elif m[j] != 0.0 and order[j] == ALONG:
            total += 1
        elif m[j] != 0.0 and (order[j] == 0 or (watches(j) and falls(j, m, w))):
            near = 8.0 * EPS * guard_scale(j, t, x, w)
            near += abs(w.end[2 * j + 1]) * 32.0 * EPS * max(abs(t), abs(step))
            value = m[j] * w.end[2 * j] + WIDTH[j]
            # A reset is not to be missed where the interpolant took its surface for the later one.
            if abs(value) <= near or (RESET_FROM[j] != 0 and value < 0.0):
                trigger[j] = ROOT
        elif m[j] == 0.0 and abs(order[j]) < 2:
            mult = w.mult[j]
            lo, hi = w.radius[2 * j], w.radius[2 * j + 1]
            near = 64.0 * EPS * (1.0 + min(abs(lo), abs(hi)))
            near += abs(mult.most - mult.least) * 32.0 * EPS * max(abs(t) / abs(step), 1.0)
            if hi - mult.value <= near:
                trigger[j] = UPPER
            elif mult.value - lo <= near:
                trigger[j] = LOWER
        if trigger[j] != 0:
            total += 1
    return total
