"""Sliding fields on several surfaces, affine in the signs and multi-affine, and by two other rules.

moments  weights lambda_v >= 0 of the 2**k vertex fields f(sigma_v) with

             sum_v lambda_v = 1,    sum_v lambda_v w_v,i = 0 for every sliding surface i,
             sum_v lambda_v |w_v,S| prod_{i in S} sigma_v,i = 0 for every set S of two or more,

         w_v,i the rate of h_i under f(sigma_v) over |grad h_i|, w_v,S those of the surfaces in S. For k = 2
         Dieci & Difonzo 2015a; in 2015b they extend it to more. A convex combination: a Filippov solution.
utkin    f as it is written at signs s with dh_i/dt = 0: the equivalent control (Utkin 1992, chapter 2).

Both equal Filippov's where f is a constant plus a sum of terms in one sign each.
"""

from filippov.kernel.language.primitives import Indices, Vector, kernel, shift, sqrt
from filippov.kernel.loop.dense import solve_linear, solve_or_least
from filippov.kernel.loop.gradients import gradient_product, rate, track
from filippov.kernel.loop.model import (
    COLOUR,
    COLOURS,
    CONTACT,
    G_COLUMN,
    G_FIRST,
    OWNER,
    SIDE,
    N,
    rhs,
)
from filippov.kernel.loop.state import Integers, Scratch
from filippov.kernel.tables.layout import MOST_ENUMERATED

FILIPPOV, MOMENTS, UTKIN = 0, 1, 2
DELTA, ENOUGH = 1e-6, 1e-14


@kernel
def sign_derivatives(
    t: float, x: Vector, p: Vector, m: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """The field with every sliding sign at -1, then for every colour half the change by its signs at +1."""
    k = iw.sliding
    base = w.vert
    for c in range(k):
        w.s[iw.listed[c]] = -1.0
    if rhs(t, x, p, w.s, m, base, ctx) != 0:
        return 1
    iw.calls += 1
    for colour in range(COLOURS):
        used = 0
        for c in range(k):
            if COLOUR[iw.listed[c]] == colour:
                w.s[iw.listed[c]] = 1.0
                used += 1
        if used == 0:
            continue
        half = shift(w.vert, (colour + 1) * N)
        if rhs(t, x, p, w.s, m, half, ctx) != 0:
            return 1
        iw.calls += 1
        for j in range(N):
            half[j] = 0.5 * (half[j] - base[j])
        for c in range(k):
            if COLOUR[iw.listed[c]] == colour:
                w.s[iw.listed[c]] = -1.0
    return 0


@kernel
def couple(first: int, last: int, m: Vector, w: Scratch, iw: Integers) -> None:
    """Matrix and right-hand side of d/dt h = 0 in s + 1 for one group of the list of sliding surfaces."""
    for c in range(first, last):
        i, row = iw.listed[c], (c - first) * SIDE
        w.vec[c - first] = -rate(i, w.vert, w)
        for d in range(last - first):
            w.mat[row + d] = 0.0
        for a in range(G_FIRST[i], G_FIRST[i + 1]):
            j = G_COLUMN[a]
            for colour in range(COLOURS):
                owner = OWNER[colour * N + j]
                if owner >= 0 and m[owner] == 0.0:
                    entry = w.g[i * N + j] * w.vert[(colour + 1) * N + j]
                    w.mat[row + iw.place[owner] - first] += entry


@kernel
def slide_affine(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """Fields jointly affine in the signs: a field call per colour and one more, a linear solve per group."""
    if sign_derivatives(t, x, p, m, w, iw, ctx) != 0:
        return 1
    first = 0
    while first < iw.sliding:
        last = iw.group[first]
        size = last - first
        couple(first, last, m, w, iw)
        for c in range(size):
            w.slope[c] = w.mat[c * SIDE + c]
        if size == 1:
            i = iw.listed[first]
            minus = -w.vec[0]
            plus = minus + 2.0 * w.mat[0]
            if CONTACT[i] == 0 and abs(plus - minus) < 1e-9 * (abs(plus) + abs(minus)):
                return 2
            value = w.mult[i].value
            if plus != minus:
                value = -(plus + minus) / (plus - minus)
            track(w, i, value, plus, minus)
        else:
            shift_by = 0.0
            if not solve_or_least(w.mat, w.vec, size, SIDE, 0):
                couple(first, last, m, w, iw)
                # Of all multipliers that hold the solution, those closest to the middle of their sets.
                for c in range(size):
                    for d in range(size):
                        w.vec[c] -= w.mat[c * SIDE + d]
                shift_by = 1.0
                if not solve_or_least(w.mat, w.vec, size, SIDE, 1):
                    return 2
            for c in range(size):
                value, slope = w.vec[c] - 1.0 + shift_by, w.slope[c]
                track(w, iw.listed[first + c], value, slope * (1.0 - value), -slope * (1.0 + value))
        first = last
    for j in range(N):
        out[j] = w.vert[j]
    for colour in range(COLOURS):
        for j in range(N):
            owner = OWNER[colour * N + j]
            if owner >= 0 and m[owner] == 0.0:
                weight = 1.0 + w.mult[owner].value
                out[j] += weight * w.vert[(colour + 1) * N + j]
    return 0


@kernel
def vertex_fields(t: float, x: Vector, p: Vector, m: Vector, w: Scratch, iw: Integers, ctx: Indices) -> int:
    """The fields at the 2**k vertices of the signs, and the rates of the sliding surfaces under each.

    Bit c of a vertex's number tells the side of the c-th of the listed surfaces. A code of `field`.
    """
    if iw.sliding > MOST_ENUMERATED:
        return 2
    k, vertices = iw.sliding, 1 << iw.sliding
    for v in range(vertices):
        for c in range(k):
            w.s[iw.listed[c]] = 1.0 if (v >> c) & 1 else -1.0
        f = shift(w.vert, v * N)
        if rhs(t, x, p, w.s, m, f, ctx) != 0:
            return 1
        for c in range(k):
            w.rate[v * SIDE + c] = rate(iw.listed[c], f, w)
    iw.calls += vertices
    return 0


@kernel
def vertex_weight(v: int, d: int, w: Scratch, iw: Integers) -> float:
    """The weight of vertex v at the multipliers, or its derivative by the d-th of these where d >= 0."""
    weight = 1.0
    for c in range(iw.sliding):
        side = 1.0 if (v >> c) & 1 else -1.0
        weight *= 0.5 * side if c == d else 0.5 * (1.0 + side * w.mult[iw.listed[c]].value)
    return weight


@kernel
def slide_multi_affine(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """2**k vertex fields and Newton's method on the k multipliers, started from the last ones."""
    code = vertex_fields(t, x, p, m, w, iw, ctx)
    if code != 0:
        return code
    k, vertices = iw.sliding, 1 << iw.sliding
    done, last = False, 1e300
    for _ in range(30):
        for c in range(k):
            w.vec[c] = 0.0
            for d in range(k):
                w.mat[c * SIDE + d] = 0.0
        for v in range(vertices):
            weight = vertex_weight(v, -1, w, iw)
            for c in range(k):
                w.vec[c] -= weight * w.rate[v * SIDE + c]
            for d in range(k):
                slope = vertex_weight(v, d, w, iw)
                for c in range(k):
                    w.mat[c * SIDE + d] += slope * w.rate[v * SIDE + c]
        if done:
            break
        for c in range(k):
            w.rate[vertices * SIDE + c] = w.mat[c * SIDE + c]
        if not solve_or_least(w.mat, w.vec, k, SIDE, 0):
            return 2
        largest = 0.0
        for c in range(k):
            w.mult[iw.listed[c]].value += w.vec[c]
            largest = max(largest, abs(w.vec[c]))
        # Where the signs hardly act on the rates, rounding of the rates exceeds that of the signs.
        done = largest <= 1e-14 or (largest < 1e-8 and largest >= 0.5 * last)
        last = largest
        if largest > 1e6:
            return 2
    if not done:
        return 2
    for j in range(N):
        out[j] = 0.0
    for v in range(vertices):
        weight = vertex_weight(v, -1, w, iw)
        for j in range(N):
            out[j] += weight * w.vert[v * N + j]
    for c in range(k):
        i = iw.listed[c]
        value, slope = w.mult[i].value, w.rate[vertices * SIDE + c]
        track(w, i, value, slope * (1.0 - value), -slope * (1.0 + value))
    return 0


@kernel
def slide_moments(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """2**k vertex fields and one linear system for their weights."""
    code = vertex_fields(t, x, p, m, w, iw, ctx)
    if code != 0:
        return code
    k, vertices = iw.sliding, 1 << iw.sliding
    for c in range(k):
        norm = sqrt(gradient_product(iw.listed[c], iw.listed[c], w) + 1e-300)
        for v in range(vertices):
            w.rate[v * SIDE + c] /= norm
    a, weights = w.moments, shift(w.moments, vertices * vertices)
    for chosen in range(vertices):
        for v in range(vertices):
            sign, square, count, rate = 1.0, 0.0, 0, 1.0
            for c in range(k):
                if (chosen >> c) & 1 == 1:
                    rate = w.rate[v * SIDE + c]
                    square += rate**2
                    sign *= 1.0 if (v >> c) & 1 else -1.0
                    count += 1
            a[chosen * vertices + v] = rate if count < 2 else sign * sqrt(square)
        weights[chosen] = 1.0 if chosen == 0 else 0.0
    if not solve_linear(a, weights, vertices, vertices):
        return 2
    for j in range(N):
        total = 0.0
        for v in range(vertices):
            total += weights[v] * w.vert[v * N + j]
        out[j] = total
    for c in range(k):
        value = 0.0
        for v in range(vertices):
            value += weights[v] if (v >> c) & 1 else -weights[v]
        track(w, iw.listed[c], value, value - 1.0, value + 1.0)
    return 0


@kernel
def rates_at(
    t: float,
    x: Vector,
    p: Vector,
    m: Vector,
    f: Vector,
    rates: Vector,
    w: Scratch,
    iw: Integers,
    ctx: Indices,
) -> int:
    """The field at the signs in the scratch, and with it the rates of the sliding surfaces."""
    if rhs(t, x, p, w.s, m, f, ctx) != 0:
        return 1
    iw.calls += 1
    for c in range(iw.sliding):
        rates[c] = rate(iw.listed[c], f, w)
    return 0


@kernel
def bisect(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """A sign between -1 and 1 at which the rate of the only sliding surface vanishes: 2 if there is none."""
    i, rate = iw.listed[0], w.vec
    low, high = -1.0, 1.0
    w.s[i] = low
    if rates_at(t, x, p, m, out, rate, w, iw, ctx) != 0:
        return 1
    at_low = rate[0]
    w.s[i] = high
    if rates_at(t, x, p, m, out, rate, w, iw, ctx) != 0:
        return 1
    if not (at_low * rate[0] < 0.0):
        return 2
    for _ in range(54):
        w.s[i] = 0.5 * (low + high)
        if rates_at(t, x, p, m, out, rate, w, iw, ctx) != 0:
            return 1
        if at_low * rate[0] > 0.0:
            low = w.s[i]
        else:
            high = w.s[i]
    return 0


@kernel
def slide_utkin(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """Newton's method on the signs, slopes by differences, from the last ones; bisection for one surface."""
    k = iw.sliding
    f, rate, moved = w.vert, w.vec, w.rate
    for c in range(k):
        i = iw.listed[c]
        w.s[i] = max(-1.0, min(1.0, w.mult[i].value))
    done, last, bisected = False, 1e300, False
    for iteration in range(40):
        if rates_at(t, x, p, m, out, rate, w, iw, ctx) != 0:
            return 1
        for d in range(k):
            i = iw.listed[d]
            held = w.s[i]
            delta = -DELTA if held > 0.0 else DELTA
            w.s[i] = held + delta
            if rates_at(t, x, p, m, f, moved, w, iw, ctx) != 0:
                return 1
            w.s[i] = held
            for c in range(k):
                w.mat[c * SIDE + d] = (moved[c] - rate[c]) / delta
        for c in range(k):
            moved[SIDE + c] = w.mat[c * SIDE + c]
            rate[c] = -rate[c]
        if done:
            break
        largest = 1e300
        if solve_linear(w.mat, rate, k, SIDE):
            largest = 0.0
            for c in range(k):
                w.s[iw.listed[c]] += rate[c]
                largest = max(largest, abs(rate[c]))
        # Diverged, or cycling: for one surface there is a bracket to fall back on.
        if not (largest < 1e3) or iteration == 30:
            if k > 1 or bisected:
                return 2
            code = bisect(t, x, p, m, out, w, iw, ctx)
            if code != 0:
                return code
            bisected = True
            done = True
        else:
            done = largest <= ENOUGH or (largest < 1e-10 and largest >= last)
        last = largest
    if not done:
        return 2
    for c in range(k):
        i = iw.listed[c]
        value, slope = w.s[i], moved[SIDE + c]
        if k == 1 and slope == 0.0:
            return 2
        track(w, i, value, slope * (1.0 - value), -slope * (1.0 + value))
    return 0
