"""The field of a mode: smooth off the surfaces, Filippov's blend of the vertex fields while sliding.

With k sliding surfaces the field is the multi-affine blend of the 2**k vertex fields f(s_Z = +-1) whose
multipliers solve dh_i/dt = 0 on every sliding surface (Filippov 1988, section 4; Dieci & Lopez 2012, section
3); `rules` has two others. A multiplier outside [-1, 1] is no error here: stiction sets are wider, and the
bounds are events.
Multipliers of surfaces that are not coupled are solved apart, so that the cost grows with the number of
sliding surfaces and not with its cube (see `structure`).

The scratch `w` (offsets W_... of `layout`) holds signs, gradients, vertex fields, their rates, a small matrix
and vector, and for each surface its multiplier, the multiplier's range over the stages, the rates at s = +1
and -1 and their largest difference. `iw` lists the sliding surfaces component by component, their number
first, the end of each one's group in the list, its place there, and how many slide in every component; it
counts the field calls.
"""

from filippov.kernel.language.primitives import Indices, Vector, inline, kernel, shift
from filippov.kernel.loop.dense import solve_or_least
from filippov.kernel.loop.model import (
    AFFINE,
    BY_COMPONENT,
    COLOUR,
    COLOURS,
    COMPONENT,
    CONTACT,
    CONTACTS,
    G_COLUMN,
    G_FIRST,
    I_CALLS,
    I_GROUP,
    I_LIST,
    I_PEERS,
    I_PLACE,
    I_SLIDING,
    OWNER,
    RULE,
    SIDE,
    W_G,
    W_GT,
    W_MAT,
    W_MULT,
    W_RATE,
    W_RESIDUAL,
    W_S,
    W_S2,
    W_SLOPE,
    W_VEC,
    W_VERT,
    M,
    N,
    gradients,
    guards,
    pair,
    rhs,
)
from filippov.kernel.loop.multiplier import track
from filippov.kernel.loop.rules import MOMENTS, UTKIN, slide_moments, slide_utkin
from filippov.kernel.tables.layout import COLUMNS, LEAST, MOST, MOST_ENUMERATED, MULTIPLIER, SLOPE


@kernel
def set_mode(m: Vector, iw: Indices) -> None:
    """List the sliding surfaces of mode m in the scratch, component by component."""
    k, first = 0, 0
    for q in range(M):
        i = BY_COMPONENT[q]
        iw[I_PEERS + q] = 0
        if m[i] == 0.0:
            iw[I_LIST + k] = i
            iw[I_PLACE + i] = k
            k += 1
    while first < k:
        last = first + 1
        here = COMPONENT[iw[I_LIST + first]]
        while last < k and COMPONENT[iw[I_LIST + last]] == here:
            last += 1
        for c in range(first, last):
            iw[I_GROUP + c] = last
        iw[I_PEERS + here] = last - first
        first = last
    iw[I_SLIDING] = k


@kernel
def rate(i: int, f: Vector, w: Vector) -> float:
    """d/dt h_i along the velocity f, from the gradient in the scratch."""
    total = w[W_GT + i]
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        total += w[W_G + i * N + G_COLUMN[a]] * f[G_COLUMN[a]]
    return float(total)


@kernel
def gradient_product(i: int, other: int, w: Vector) -> float:
    """The inner product of two gradients."""
    total = 0.0
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        j = G_COLUMN[a]
        total += w[W_G + i * N + j] * w[W_G + other * N + j]
    return total


@kernel
def add_gradient(i: int, factor: float, out: Vector, w: Vector) -> None:
    """Add a multiple of a gradient to a state or velocity."""
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        j = G_COLUMN[a]
        out[j] += factor * w[W_G + i * N + j]


@kernel
def clear_ranges(w: Vector, iw: Indices) -> None:
    """Forget the ranges of the multipliers before a new step."""
    for c in range(iw[I_SLIDING]):
        mult = shift(w, W_MULT + iw[I_LIST + c] * COLUMNS)
        mult[LEAST], mult[MOST], mult[SLOPE] = 1e300, -1e300, -1e300


@inline
@kernel
def take_out_one(i: int, h: float, out: Vector, w: Vector) -> None:
    """Subtract from out the multiple of one gradient along which its linearised guard changes by h."""
    size = gradient_product(i, i, w)
    if size > 0.0:
        add_gradient(i, -h / size, out, w)


@kernel
def take_out(vector: Vector, h: Vector, out: Vector, w: Vector, iw: Indices) -> None:
    """Subtract from out the combination of gradients along which the linearised guards change by h."""
    first = 0
    while first < iw[I_SLIDING]:
        last = iw[I_GROUP + first]
        if M == 1 or last == first + 1:
            take_out_one(iw[I_LIST + first], h[iw[I_LIST + first]], out, w)
        else:
            for again in range(2):
                for c in range(first, last):
                    vector[c - first] = h[iw[I_LIST + c]]
                    for d in range(first, last):
                        product = gradient_product(iw[I_LIST + c], iw[I_LIST + d], w)
                        w[W_MAT + (c - first) * SIDE + d - first] = product
                if solve_or_least(shift(w, W_MAT), vector, last - first, SIDE, again):
                    for c in range(first, last):
                        add_gradient(iw[I_LIST + c], -vector[c - first], out, w)
                    break
        first = last


@inline
@kernel
def only_sliding(iw: Indices) -> int:
    """The surface of a motion that slides on one; known beforehand where there is no other."""
    return 0 if M == 1 else iw[I_LIST]


@kernel
def remove_residual(out: Vector, w: Vector, iw: Indices) -> None:
    """Take out of the field what rounding left across the surfaces, so that h stays where it is."""
    if M == 1 or iw[I_SLIDING] == 1:
        i = only_sliding(iw)
        take_out_one(i, rate(i, out, w), out, w)
        return
    for c in range(iw[I_SLIDING]):
        i = iw[I_LIST + c]
        w[W_RESIDUAL + i] = rate(i, out, w)
    take_out(shift(w, W_VEC), shift(w, W_RESIDUAL), out, w, iw)


# What is left of two velocities that cancel, in parts of them.
CANCELLED = 1e-15


@kernel
def slide_one(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """One sliding surface: the convex combination of the two vertex fields that stays on it."""
    i, low, high = only_sliding(iw), shift(w, W_VERT), shift(w, W_VERT + N)
    for j in range(M):
        w[W_S2 + j] = w[W_S + j]
    w[W_S + i], w[W_S2 + i] = -1.0, 1.0
    if pair(t, x, p, shift(w, W_S), shift(w, W_S2), m, low, high, ctx) != 0:
        return 1
    iw[I_CALLS] += 2
    minus, plus = rate(i, low, w), rate(i, high, w)
    # Both rates alike and not zero: the sign does not act on the surface, nothing holds the motion on it.
    # A contact always holds it: its rates differ by 1, however large both are.
    if CONTACT[i] == 0 and abs(plus - minus) < 1e-9 * (abs(plus) + abs(minus)):
        return 2
    value, rest = w[W_MULT + i * COLUMNS + MULTIPLIER], True
    if plus != minus:
        value, rest = -(plus + minus) / (plus - minus), False
    weight = 0.5 * (1.0 + value)
    for j in range(N):
        out[j] = low[j] + weight * (high[j] - low[j])
        # A two-fold that is rested at would be left by a rounding.
        if rest and abs(out[j]) <= CANCELLED * (abs(low[j]) + abs(high[j])):
            out[j] = 0.0
    track(w, i, value, plus, minus)
    return 0


@kernel
def sign_derivatives(
    t: float, x: Vector, p: Vector, m: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """The field with every sliding sign at -1, then for every colour half of what its signs at +1 add."""
    k = iw[I_SLIDING]
    base = shift(w, W_VERT)
    for c in range(k):
        w[W_S + iw[I_LIST + c]] = -1.0
    if rhs(t, x, p, shift(w, W_S), m, base, ctx) != 0:
        return 1
    iw[I_CALLS] += 1
    for colour in range(COLOURS):
        used = 0
        for c in range(k):
            if COLOUR[iw[I_LIST + c]] == colour:
                w[W_S + iw[I_LIST + c]] = 1.0
                used += 1
        if used == 0:
            continue
        half = shift(w, W_VERT + (colour + 1) * N)
        if rhs(t, x, p, shift(w, W_S), m, half, ctx) != 0:
            return 1
        iw[I_CALLS] += 1
        for j in range(N):
            half[j] = 0.5 * (half[j] - base[j])
        for c in range(k):
            if COLOUR[iw[I_LIST + c]] == colour:
                w[W_S + iw[I_LIST + c]] = -1.0
    return 0


@kernel
def couple(first: int, last: int, m: Vector, w: Vector, iw: Indices) -> None:
    """Matrix and right-hand side of d/dt h = 0 in s + 1 for one group of the list of sliding surfaces."""
    for c in range(first, last):
        i, row = iw[I_LIST + c], W_MAT + (c - first) * SIDE
        w[W_VEC + c - first] = -rate(i, shift(w, W_VERT), w)
        for d in range(last - first):
            w[row + d] = 0.0
        for a in range(G_FIRST[i], G_FIRST[i + 1]):
            j = G_COLUMN[a]
            for colour in range(COLOURS):
                owner = OWNER[colour * N + j]
                if owner >= 0 and m[owner] == 0.0:
                    entry = w[W_G + i * N + j] * w[W_VERT + (colour + 1) * N + j]
                    w[row + iw[I_PLACE + owner] - first] += entry


@kernel
def slide_affine(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """Fields jointly affine in the signs: a field call a colour and one more, a linear solve a group."""
    if sign_derivatives(t, x, p, m, w, iw, ctx) != 0:
        return 1
    first = 0
    while first < iw[I_SLIDING]:
        last = iw[I_GROUP + first]
        size = last - first
        couple(first, last, m, w, iw)
        for c in range(size):
            w[W_SLOPE + c] = w[W_MAT + c * SIDE + c]
        if size == 1:
            i = iw[I_LIST + first]
            minus = -w[W_VEC]
            plus = minus + 2.0 * w[W_MAT]
            if CONTACT[i] == 0 and abs(plus - minus) < 1e-9 * (abs(plus) + abs(minus)):
                return 2
            value = w[W_MULT + i * COLUMNS + MULTIPLIER]
            if plus != minus:
                value = -(plus + minus) / (plus - minus)
            track(w, i, value, plus, minus)
        else:
            shift_by = 0.0
            if not solve_or_least(shift(w, W_MAT), shift(w, W_VEC), size, SIDE, 0):
                couple(first, last, m, w, iw)
                # Of many multipliers that hold the motion, those closest to the middle of their sets.
                for c in range(size):
                    for d in range(size):
                        w[W_VEC + c] -= w[W_MAT + c * SIDE + d]
                shift_by = 1.0
                if not solve_or_least(shift(w, W_MAT), shift(w, W_VEC), size, SIDE, 1):
                    return 2
            for c in range(size):
                value, slope = w[W_VEC + c] - 1.0 + shift_by, w[W_SLOPE + c]
                track(w, iw[I_LIST + first + c], value, slope * (1.0 - value), -slope * (1.0 + value))
        first = last
    for j in range(N):
        out[j] = w[W_VERT + j]
    for colour in range(COLOURS):
        for j in range(N):
            owner = OWNER[colour * N + j]
            if owner >= 0 and m[owner] == 0.0:
                weight = 1.0 + w[W_MULT + owner * COLUMNS + MULTIPLIER]
                out[j] += weight * w[W_VERT + (colour + 1) * N + j]
    return 0


@kernel
def slide_multi_affine(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """2**k vertex fields and Newton's method on the k multipliers, started from the last ones."""
    k = iw[I_SLIDING]
    if k > MOST_ENUMERATED:
        return 2
    vertices = 1 << k
    for v in range(vertices):
        for c in range(k):
            w[W_S + iw[I_LIST + c]] = 1.0 if (v >> c) & 1 else -1.0
        if rhs(t, x, p, shift(w, W_S), m, shift(w, W_VERT + v * N), ctx) != 0:
            return 1
        for c in range(k):
            i = iw[I_LIST + c]
            w[W_RATE + v * SIDE + c] = rate(i, shift(w, W_VERT + v * N), w)
    iw[I_CALLS] += vertices
    done, last = False, 1e300
    for _ in range(30):
        for c in range(k):
            w[W_VEC + c] = 0.0
            for d in range(k):
                w[W_MAT + c * SIDE + d] = 0.0
        for v in range(vertices):
            weight = 1.0
            for c in range(k):
                side = 1.0 if (v >> c) & 1 else -1.0
                weight *= 0.5 * (1.0 + side * w[W_MULT + iw[I_LIST + c] * COLUMNS + MULTIPLIER])
            for c in range(k):
                w[W_VEC + c] -= weight * w[W_RATE + v * SIDE + c]
            for d in range(k):
                slope = 1.0
                for c in range(k):
                    side = 1.0 if (v >> c) & 1 else -1.0
                    slope *= (
                        0.5 * side
                        if c == d
                        else 0.5 * (1.0 + side * w[W_MULT + iw[I_LIST + c] * COLUMNS + MULTIPLIER])
                    )
                for c in range(k):
                    w[W_MAT + c * SIDE + d] += slope * w[W_RATE + v * SIDE + c]
        if done:
            break
        for c in range(k):
            w[W_RATE + vertices * SIDE + c] = w[W_MAT + c * SIDE + c]
        if not solve_or_least(shift(w, W_MAT), shift(w, W_VEC), k, SIDE, 0):
            return 2
        largest = 0.0
        for c in range(k):
            w[W_MULT + iw[I_LIST + c] * COLUMNS + MULTIPLIER] += w[W_VEC + c]
            largest = max(largest, abs(w[W_VEC + c]))
        # Where the signs hardly act on the rates, rounding of these is more than rounding in the signs.
        done = largest <= 1e-14 or (largest < 1e-8 and largest >= 0.5 * last)
        last = largest
        if largest > 1e6:
            return 2
    if not done:
        return 2
    for j in range(N):
        out[j] = 0.0
    for v in range(vertices):
        weight = 1.0
        for c in range(k):
            side = 1.0 if (v >> c) & 1 else -1.0
            weight *= 0.5 * (1.0 + side * w[W_MULT + iw[I_LIST + c] * COLUMNS + MULTIPLIER])
        for j in range(N):
            out[j] += weight * w[W_VERT + v * N + j]
    for c in range(k):
        i = iw[I_LIST + c]
        value, slope = w[W_MULT + i * COLUMNS + MULTIPLIER], w[W_RATE + vertices * SIDE + c]
        track(w, i, value, slope * (1.0 - value), -slope * (1.0 + value))
    return 0


@kernel
def field(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """The field of mode m; 0, or 1 where the user's function failed, 2 where no multipliers were found."""
    k = iw[I_SLIDING]
    if k == 0:
        iw[I_CALLS] += 1
        return rhs(t, x, p, m, m, out, ctx)
    for i in range(M):
        w[W_S + i] = m[i]
    if gradients(t, x, p, m, shift(w, W_G), shift(w, W_GT), ctx) != 0:
        return 1
    if RULE == UTKIN and not AFFINE:
        code = slide_utkin(t, x, p, m, out, w, iw, ctx)
    elif M == 1 or k == 1:
        code = slide_one(t, x, p, m, out, w, iw, ctx)
    elif AFFINE:
        code = slide_affine(t, x, p, m, out, w, iw, ctx)
    elif RULE == MOMENTS:
        code = slide_moments(t, x, p, m, out, w, iw, ctx)
    else:
        code = slide_multi_affine(t, x, p, m, out, w, iw, ctx)
    if code == 0:
        remove_residual(out, w, iw)
    return code


@kernel
def hold_contacts(
    t: float, x: Vector, p: Vector, m: Vector, h: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """Put x on the surfaces it rests on: in contact the guard is their rate, which would let h drift."""
    for c in range(iw[I_SLIDING]):
        i = iw[I_LIST + c]
        if CONTACT[i] != 0:
            m[i] = float(CONTACT[i])
            code = guards(t, x, p, m, h, ctx)
            code = max(code, gradients(t, x, p, m, shift(w, W_G), shift(w, W_GT), ctx))
            m[i] = 0.0
            if code != 0:
                return 1
            size = gradient_product(i, i, w)
            if size > 0.0:
                add_gradient(i, -h[i] / size, x, w)
    return 0


@kernel
def project(
    t: float, x: Vector, p: Vector, m: Vector, h: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """Put x back on every sliding surface along the gradients; two Newton steps take |h| to rounding."""
    for _ in range(2):
        if CONTACTS and hold_contacts(t, x, p, m, h, w, iw, ctx) != 0:
            return 1
        if guards(t, x, p, m, h, ctx) != 0 or gradients(t, x, p, m, shift(w, W_G), shift(w, W_GT), ctx) != 0:
            return 1
        largest = 0.0
        for c in range(iw[I_SLIDING]):
            largest = max(largest, abs(h[iw[I_LIST + c]]))
        if largest == 0.0:
            return 0
        take_out(shift(w, W_VEC), h, x, w, iw)
    return 0
