"""Land on a located event: a real step of the integrator to it, then Newton steps short enough to be exact.

The dense output only gives the time; the state at the event comes from the method itself, so |h| there is at
rounding level, not at that of the interpolant.
"""

from filippov.kernel.language.primitives import INF, Indices, Vector, kernel
from filippov.kernel.loop.field import field, project
from filippov.kernel.loop.gradients import add_gradient, gradient_product, rate
from filippov.kernel.loop.model import (
    CLAMPED,
    G_COLUMN,
    G_FIRST,
    IMPLICIT,
    LINEAR,
    NON_LIPSCHITZ,
    RESET_FROM,
    ROLE,
    ROOTED,
    ROOTS,
    WIDTH,
    M,
    N,
    gradients,
    guards,
    stages,
)
from filippov.kernel.loop.roots.sampling import guard_rows
from filippov.kernel.loop.state import Integers, Scratch
from filippov.kernel.tables.codes import ALONG, ROOT, SWITCHING, TOUCH, UPPER
from filippov.kernel.tables.layout import EPS
from filippov.kernel.tables.radau_tables import NOT_CONVERGED

# The largest |guard| at an event, in roundings of its terms, where the integration is that accurate.
ASTRAY = 1e4
# The largest distance of a curved guard's zero, in tolerances of a step.
KNOWN = 1e3
# A number that is larger is none that a guard has.
HUGE = 1e300
# The part of the states in the rate of a guard that time moves.
TIMED = 1e-3
# A rate smaller than this, relative to its terms, is rounding: the state is at rest relative to the surface.
NO_RATE = 1e-12


@kernel
def guard_scale(i: int, t: float, x: Vector, w: Scratch) -> float:
    """The magnitude of the terms of h_i, from its gradient: the scale of rounding in h_i."""
    total = float(abs(w.gt[i] * t))
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        total += abs(w.g[i * N + G_COLUMN[a]] * x[G_COLUMN[a]])
    return total


@kernel
def project_on(
    t: float, x: Vector, p: Vector, m: Vector, i: int, rtol: float, atol: Vector, w: Scratch, ctx: Indices
) -> int:  # fmt: skip
    """Newton steps along the gradient onto one surface; w.f is a field beside it.

    Where time moves h and the states next to nothing, rounding of its terms in t would lead anywhere: these
    move no state by more than it is known.
    """
    h = w.h
    for _ in range(2):
        if guards(t, x, p, m, h, ctx) != 0 or gradients(t, x, p, m, w.g, w.gt, ctx) != 0:
            return 1
        size = gradient_product(i, i, w)
        if h[i] == 0.0 or not (0.0 < size < 1e300):
            return 0
        known, moved = 0.0, 0.0
        for a in range(G_FIRST[i], G_FIRST[i + 1]):
            j = G_COLUMN[a]
            known += (rtol * abs(x[j]) + atol[j]) * abs(w.g[i * N + j])
            moved += abs(w.g[i * N + j] * w.f[j])
        if abs(h[i]) > known and moved < TIMED * abs(w.gt[i]):
            return 0
        add_gradient(i, -h[i] / size, x, w)
    return guards(t, x, p, m, h, ctx)


@kernel
def go(
    t: float, x: Vector, p: Vector, m: Vector, length: float, line: bool, xe: Vector, w: Scratch,
    iw: Integers, ctx: Indices,
) -> int:  # fmt: skip
    """A step of the method from (t, x), its end in xe; along a straight line no field is evaluated."""
    if not line:
        return stages(t, x, p, m, length, xe, w, iw, ctx)
    for j in range(N):
        xe[j] = x[j] + length * w.k[j]
    return 0


@kernel
def reached_before(
    t: float, x: Vector, f: Vector, m: Vector, order: Indices, i: int, w: Scratch
) -> tuple[int, float]:
    """Of the surfaces that the solution has passed, the earliest: (number, time since then); (-1, 0.0): none.

    Of those with resets, and of all where the guard of the surface i landed on is not linear: between its
    samples its root may seem to come before theirs. The guards and their rates at (t, x) are those in w.end,
    f is the field; surface i is left out. The dense output shows roots, and their order, to its rounding; a
    step shows them to that of x.
    """
    first, longest = -1, 0.0
    for j in range(M):
        value, speed = m[j] * w.end[2 * j] + WIDTH[j], m[j] * w.end[2 * j + 1] * w.direction
        if value < 0.0 and speed < 0.0 and j != i and m[j] != 0.0 and order[j] != ALONG:
            if RESET_FROM[j] == 0 and (i < 0 or LINEAR[i] != 0):
                continue
            if RESET_FROM[j] != 0 and RESET_FROM[j] != 2 and float(RESET_FROM[j]) != m[j]:
                continue
            size = abs(w.gt[j])
            for a in range(N):
                size += abs(w.g[j * N + a] * f[a])
            near = 8.0 * EPS * guard_scale(j, t, x, w) - 32.0 * EPS * abs(t) * speed
            if value < -near and speed < -NO_RATE * size and value / speed > longest:
                first, longest = j, value / speed
    return first, longest


# How far beyond its located place an event may be, relative to the step, without another search, and how far
# beyond its set a multiplier may be there.
PAST, BEYOND = 0.05, 1e-6


@kernel
def passed(
    t: float, x: Vector, p: Vector, m: Vector, landed: int, w: Scratch, iw: Integers, ctx: Indices
) -> bool:
    """Whether a landing went past another event: then a guard is negative, or a multiplier outside its set.

    On a guard that is all rounding Newton's method may lead anywhere on the step.
    """
    h, f = w.h, w.f
    if guards(t, x, p, m, h, ctx) != 0 or field(t, x, p, m, f, w, iw, ctx) != 0:
        return True
    for i in range(M):
        value = w.mult[i].value
        size = 1.0 + abs(value)
        if m[i] == 0.0:
            if value > w.radius[2 * i + 1] + BEYOND * size or value < w.radius[2 * i] - BEYOND * size:
                return True
        elif i != landed and m[i] * h[i] + WIDTH[i] < -w.touch[i]:
            return True
    return False


@kernel
def misses(t: float, length: float, xe: Vector, i: int, value: float, w: Scratch) -> bool:
    """Whether a landing is farther off than the accuracy of the integration: then it has failed.

    A field that vanishes beyond the surface leads Newton's method off. Moved onto the surface the state would
    be another one.
    """
    went = (abs(t) + abs(length)) * (abs(w.start[2 * i + 1]) + abs(rate(i, w.f, w)))
    terms = guard_scale(i, t + length, xe, w) + went + WIDTH[i]
    return abs(value) > float(max(w.touch[i], ASTRAY * EPS * terms if terms <= HUGE else 0.0))


@kernel
def apart(t: float, x: Vector, i: int, value: float, rtol: float, atol: Vector, w: Scratch) -> bool:
    """Whether the next zero of h_i, by its gradient, is farther from x than x is known."""
    known = ASTRAY * EPS * guard_scale(i, t, x, w)
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        j = G_COLUMN[a]
        known += KNOWN * (rtol * abs(x[j]) + atol[j]) * abs(w.g[i * N + j])
    return not (abs(value) <= known)


@kernel
def land(
    t: float, x: Vector, p: Vector, m: Vector, cause: int, i: int, step: float, theta: float, slope: float,
    line: bool, xe: Vector, rtol: float, atol: Vector, w: Scratch, iw: Integers, ctx: Indices,
) -> tuple[int, float, float, float]:  # fmt: skip
    """Step from (t, x) to the event on surface i near theta; its state goes to xe.

    Where that is corrected after the last step of the method, the end of this step goes to w.xd.

    Returns (code, step taken to the event, step of its dense output, |guard| left).
    """
    h, f, xm, row = w.h, w.f, w.xm, w.row
    length = theta * step
    dense_length = length
    code = go(t, x, p, m, length, line, xe, w, iw, ctx)
    value, change, last = 0.0, 0.0, 1e300
    # The bracket of the zero of a guard that contains a root, which may send Newton's steps anywhere.
    bent, before, behind = ROOTS and cause == ROOT and ROOTED[i] != 0, 0.0, INF
    curved = cause == ROOT and LINEAR[i] == 0 and WIDTH[i] == 0.0
    for attempt in range(48):
        if code != 0 or cause == TOUCH:
            break
        te = t + length
        if cause == ROOT:
            if guards(te, xe, p, m, h, ctx) != 0 or gradients(te, xe, p, m, w.g, w.gt, ctx) != 0:
                return 1, length, dense_length, value
            value = h[i] + m[i] * WIDTH[i]
            # Beyond its surface the slope of a root may be infinite: that says nothing about the value.
            scale = guard_scale(i, te, xe, w)
            if scale <= HUGE and abs(value) <= EPS * scale:
                break
            code = field(te, xe, p, m, f, w, iw, ctx)
            change = rate(i, f, w)
            if bent and not abs(change) <= HUGE:
                change = INF
        else:
            code = guard_rows(te, xe, p, m, row, w, iw, ctx)
            value = row[i] if cause == UPPER else row[M + i]
            change = slope / step
        if code != 0 or not (0.0 < abs(value) < 1e300 and abs(change) > 0.0):
            break
        delta = -value / change
        # Newton's steps must not leave the step by more than the slope can be trusted.
        if (length + delta) / step > 1.001:
            delta = step - length
        if (length + delta) / step < 0.0:
            delta = -0.5 * length
        if bent or curved:
            before = max(before, length / step) if m[i] * value > 0.0 else before
            behind = min(behind, length / step) if m[i] * value < 0.0 else behind
        away = (length + delta) / step <= before or (attempt > 2 and abs(value) >= last)
        if curved and away and not bent and misses(t, length, xe, i, value, w):
            # Newton's steps lead away, as from a pole: to the end of the step, then into the bracket.
            bent = True
            delta = step - length if behind == INF else delta
        if bent and behind < INF and not (before < (length + delta) / step < behind):
            delta = 0.5 * (before + behind) * step - length
        if abs(delta) <= 2.0 * EPS * abs(te) or (attempt > 2 and abs(value) >= last and not bent):
            break
        last = abs(value)
        # An explicit correction of a stiff field is not small.
        if IMPLICIT or abs(delta) > 1e-5 * abs(step):
            length += delta
            dense_length = length
            code = go(t, x, p, m, length, line, xe, w, iw, ctx)
            continue
        for j in range(N):
            w.xd[j] = xe[j] if length == dense_length else w.xd[j]
            xm[j] = xe[j] + 0.5 * delta * f[j]
        code = field(te + 0.5 * delta, xm, p, m, f, w, iw, ctx)
        for j in range(N):
            xe[j] += delta * f[j]
        length += delta
    # The state may be where the field, or a guard, is undefined.
    sound = abs(value) < 1e300 and abs(change) <= INF
    # A step that is long beside a layer in which the solution relaxes has roots in its dense output that the
    # solution has not. Of a linear guard what is left is the error of that; others may jump.
    # Where a power of h ends at it the solution is steeper than any step sees.
    unseen = LINEAR[i] != 0 and WIDTH[i] == 0.0 and not (IMPLICIT or NON_LIPSCHITZ)
    switching = (CLAMPED or (bent and not curved)) and ROLE[i] == SWITCHING
    if code == 0 and sound and cause == ROOT and (unseen or switching):
        code = NOT_CONVERGED if misses(t, length, xe, i, value, w) else 0
    if code == 0 and sound:
        # At a pole or a jump of h there is no place near by where it is 0: the state stays where it is.
        off = curved and apart(t + length, xe, i, value, rtol, atol, w)
        if cause == ROOT and WIDTH[i] == 0.0 and not off:
            code = project_on(t + length, xe, p, m, i, rtol, atol, w, ctx)
            value = h[i]
        if iw.sliding > 0 and project(t + length, xe, p, m, h, w, iw, ctx) != 0:
            code = 1
    if code == 0 and sound and cause == ROOT and length / step > theta + PAST:
        code = NOT_CONVERGED if passed(t + length, xe, p, m, i, w, iw, ctx) else 0
    for j in range(N):
        sound = sound and abs(xe[j]) < 1e300
    if code == 0 and not sound:
        code = NOT_CONVERGED
    return code, length, dense_length, abs(value)
