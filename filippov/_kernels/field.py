"""The field of a mode: smooth off the surfaces, Filippov's blend of the vertex fields while sliding.

With k sliding surfaces the field is the multi-affine blend of the 2**k vertex fields f(s_Z = +-1) whose
multipliers solve dh_i/dt = 0 on every sliding surface (Filippov 1988, section 4; Dieci & Lopez 2012, section
3); `rules` has two others. A multiplier outside [-1, 1] is no error here: stiction sets are wider, and the
bounds are events.

The scratch `w` (offsets W_... of `layout`) holds signs, gradients, vertex fields, their rates, a small matrix
and vector, and for each surface its multiplier, the multiplier's range over the stages, the rates at s = +1
and -1 and their largest difference. `iw` lists the sliding surfaces, their number first, and counts the field
calls.
"""

from filippov._kernels.bernstein import solve_linear
from filippov._kernels.language import Indices, Vector, kernel, shift
from filippov._kernels.layout import COLUMNS, LEAST, MOST, MULTIPLIER, RATE_MINUS, SLOPE
from filippov._kernels.model import (
    AFFINE,
    CONTACT,
    CONTACTS,
    I_CALLS,
    I_LIST,
    I_SLIDING,
    RULE,
    SIDE,
    W_G,
    W_GT,
    W_MAT,
    W_MULT,
    W_RATE,
    W_S,
    W_VEC,
    W_VERT,
    M,
    N,
    gradients,
    guards,
    rhs,
)
from filippov._kernels.multiplier import track
from filippov._kernels.rules import MOMENTS, UTKIN, slide_moments, slide_utkin


@kernel
def set_mode(m: Vector, iw: Indices) -> None:
    """List the sliding surfaces of mode m in the scratch."""
    k = 0
    for i in range(M):
        if m[i] == 0.0:
            k += 1
            iw[I_LIST + k - 1] = i
    iw[I_SLIDING] = k


@kernel
def clear_ranges(w: Vector, iw: Indices) -> None:
    """Forget the ranges of the multipliers before a new step."""
    for c in range(iw[I_SLIDING]):
        mult = shift(w, W_MULT + iw[I_LIST + c] * COLUMNS)
        mult[LEAST], mult[MOST], mult[SLOPE] = 1e300, -1e300, -1e300


@kernel
def remove_residual(out: Vector, w: Vector, iw: Indices) -> None:
    """Take out of the field what rounding left across the surfaces, so that h stays where it is."""
    k = iw[I_SLIDING]
    for c in range(k):
        i = iw[I_LIST + c]
        total = w[W_GT + i]
        for j in range(N):
            total += w[W_G + i * N + j] * out[j]
        w[W_VEC + c] = total
        for d in range(k):
            other = iw[I_LIST + d]
            total = 0.0
            for j in range(N):
                total += w[W_G + i * N + j] * w[W_G + other * N + j]
            w[W_MAT + c * SIDE + d] = total
    if k == 1:
        if w[W_MAT] > 0.0:
            w[W_VEC] /= w[W_MAT]
        else:
            return
    elif not solve_linear(shift(w, W_MAT), shift(w, W_VEC), k, SIDE):
        return
    for c in range(k):
        i = iw[I_LIST + c]
        for j in range(N):
            if w[W_G + i * N + j] != 0.0:
                out[j] -= w[W_VEC + c] * w[W_G + i * N + j]


@kernel
def slide_one(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """One sliding surface: the convex combination of the two vertex fields that stays on it."""
    i = iw[I_LIST]
    w[W_S + i] = -1.0
    if rhs(t, x, p, shift(w, W_S), m, shift(w, W_VERT), ctx) != 0:
        return 1
    w[W_S + i] = 1.0
    if rhs(t, x, p, shift(w, W_S), m, shift(w, W_VERT + N), ctx) != 0:
        return 1
    iw[I_CALLS] += 2
    minus, plus = w[W_GT + i], w[W_GT + i]
    for j in range(N):
        minus += w[W_G + i * N + j] * w[W_VERT + j]
        plus += w[W_G + i * N + j] * w[W_VERT + N + j]
    # Both rates alike and not zero: the sign does not act on the surface, nothing holds the motion on it.
    # A contact always holds it: its rates differ by 1, however large both are.
    if CONTACT[i] == 0 and abs(plus - minus) < 1e-9 * (abs(plus) + abs(minus)):
        return 2
    value = w[W_MULT + i * COLUMNS + MULTIPLIER]
    if plus != minus:
        value = -(plus + minus) / (plus - minus)
    weight = 0.5 * (1.0 + value)
    for j in range(N):
        out[j] = w[W_VERT + j] + weight * (w[W_VERT + N + j] - w[W_VERT + j])
    track(w, i, value, plus, minus)
    return 0


@kernel
def slide_affine(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """k + 1 field calls and one linear solve, for fields jointly affine in the sliding signs."""
    k = iw[I_SLIDING]
    for c in range(k):
        w[W_S + iw[I_LIST + c]] = -1.0
    for v in range(k + 1):
        if v > 0:
            w[W_S + iw[I_LIST + v - 1]] = 1.0
        if rhs(t, x, p, shift(w, W_S), m, shift(w, W_VERT + v * N), ctx) != 0:
            return 1
        if v > 0:
            w[W_S + iw[I_LIST + v - 1]] = -1.0
    iw[I_CALLS] += k + 1
    for c in range(k):
        i = iw[I_LIST + c]
        base = w[W_GT + i]
        for j in range(N):
            base += w[W_G + i * N + j] * w[W_VERT + j]
        w[W_VEC + c] = -base
        for v in range(k):
            total = 0.0
            for j in range(N):
                total += w[W_G + i * N + j] * (w[W_VERT + (v + 1) * N + j] - w[W_VERT + j])
            w[W_MAT + c * SIDE + v] = 0.5 * total
            if c == v:
                w[W_MULT + i * COLUMNS + RATE_MINUS] = total
    if not solve_linear(shift(w, W_MAT), shift(w, W_VEC), k, SIDE):
        return 2
    for j in range(N):
        total = w[W_VERT + j]
        for v in range(k):
            total += 0.5 * w[W_VEC + v] * (w[W_VERT + (v + 1) * N + j] - w[W_VERT + j])
        out[j] = total
    for c in range(k):
        i = iw[I_LIST + c]
        slope = 0.5 * w[W_MULT + i * COLUMNS + RATE_MINUS]
        value = w[W_VEC + c] - 1.0
        track(w, i, value, slope * (1.0 - value), -slope * (1.0 + value))
    return 0


@kernel
def slide_multi_affine(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """2**k vertex fields and Newton's method on the k multipliers, started from the last ones."""
    k = iw[I_SLIDING]
    vertices = 1 << k
    for v in range(vertices):
        for c in range(k):
            w[W_S + iw[I_LIST + c]] = 1.0 if (v >> c) & 1 else -1.0
        if rhs(t, x, p, shift(w, W_S), m, shift(w, W_VERT + v * N), ctx) != 0:
            return 1
        for c in range(k):
            i = iw[I_LIST + c]
            total = w[W_GT + i]
            for j in range(N):
                total += w[W_G + i * N + j] * w[W_VERT + v * N + j]
            w[W_RATE + v * SIDE + c] = total
    iw[I_CALLS] += vertices
    done = False
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
        if not solve_linear(shift(w, W_MAT), shift(w, W_VEC), k, SIDE):
            return 2
        largest = 0.0
        for c in range(k):
            w[W_MULT + iw[I_LIST + c] * COLUMNS + MULTIPLIER] += w[W_VEC + c]
            largest = max(largest, abs(w[W_VEC + c]))
        done = largest <= 1e-14
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
    elif k == 1:
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
            size = 0.0
            for j in range(N):
                size += w[W_G + i * N + j] ** 2
            if size > 0.0:
                for j in range(N):
                    x[j] -= h[i] * w[W_G + i * N + j] / size
    return 0


@kernel
def project(
    t: float, x: Vector, p: Vector, m: Vector, h: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """Put x back on every sliding surface along the gradients; two Newton steps take |h| to rounding."""
    k = iw[I_SLIDING]
    for _ in range(2):
        if CONTACTS and hold_contacts(t, x, p, m, h, w, iw, ctx) != 0:
            return 1
        if guards(t, x, p, m, h, ctx) != 0 or gradients(t, x, p, m, shift(w, W_G), shift(w, W_GT), ctx) != 0:
            return 1
        largest = 0.0
        for c in range(k):
            i = iw[I_LIST + c]
            w[W_VEC + c] = h[i]
            largest = max(largest, abs(h[i]))
            for d in range(k):
                total = 0.0
                for j in range(N):
                    total += w[W_G + i * N + j] * w[W_G + iw[I_LIST + d] * N + j]
                w[W_MAT + c * SIDE + d] = total
        if largest == 0.0:
            return 0
        if not solve_linear(shift(w, W_MAT), shift(w, W_VEC), k, SIDE):
            return 0
        for c in range(k):
            for j in range(N):
                x[j] -= w[W_VEC + c] * w[W_G + iw[I_LIST + c] * N + j]
    return 0
