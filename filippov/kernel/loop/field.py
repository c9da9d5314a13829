"""The field of a mode: smooth off the surfaces, Filippov's blend of the vertex fields while sliding.

With k sliding surfaces the field is the multi-affine blend of the 2**k vertex fields f(s_Z = +-1) whose
multipliers solve dh_i/dt = 0 on every sliding surface (Filippov 1988, section 4; Dieci & Lopez 2012, section
3), for one surface here; `rules` has that of several, and two others. A multiplier outside [-1, 1] is no
error here: stiction sets are wider, and the bounds are events.
Multipliers of surfaces that are not coupled are solved apart, so that the cost grows with the number of
sliding surfaces and not with its cube (see `structure`).

The scratch `w` holds signs, gradients, vertex fields, their rates, a small matrix and vector, and for each
surface its multiplier, the multiplier's range over the stages, the rates at s = +1 and -1 and their largest
difference; `iw` lists the sliding surfaces component by component (see `state`).
"""

from filippov.kernel.language.primitives import Indices, Vector, inline, kernel, shift
from filippov.kernel.loop.dense import solve_or_least
from filippov.kernel.loop.gradients import add_gradient, gradient_product, rate, track
from filippov.kernel.loop.model import (
    AFFINE,
    BY_COMPONENT,
    COMPONENT,
    CONTACT,
    CONTACTS,
    RULE,
    SIDE,
    M,
    N,
    gradients,
    guards,
    pair,
    rhs,
)
from filippov.kernel.loop.rules import (
    MOMENTS,
    UTKIN,
    slide_affine,
    slide_moments,
    slide_multi_affine,
    slide_utkin,
)
from filippov.kernel.loop.state import Integers, Scratch
from filippov.kernel.tables.layout import EPS

# What hold_contacts found; |h| in terms of h that is none; steps onto contacts and their rates by turns.
MOVED, ROUNDING, ALTERNATIONS = 2, 4.0 * EPS, 12


@kernel
def set_mode(m: Vector, iw: Integers) -> None:
    """List the sliding surfaces of mode m in the scratch, component by component."""
    k, first = 0, 0
    for q in range(M):
        i = BY_COMPONENT[q]
        iw.coupled[q] = 0
        if m[i] == 0.0:
            iw.listed[k] = i
            iw.place[i] = k
            k += 1
    while first < k:
        last = first + 1
        here = COMPONENT[iw.listed[first]]
        while last < k and COMPONENT[iw.listed[last]] == here:
            last += 1
        for c in range(first, last):
            iw.group[c] = last
        iw.coupled[here] = last - first
        first = last
    iw.sliding = k


@kernel
def clear_ranges(w: Scratch, iw: Integers) -> None:
    """Forget the ranges of the multipliers before a new step."""
    for c in range(iw.sliding):
        mult = w.mult[iw.listed[c]]
        mult.least, mult.most, mult.slope = 1e300, -1e300, -1e300


@inline
@kernel
def take_out_one(i: int, h: float, out: Vector, w: Scratch) -> None:
    """Subtract from out the multiple of one gradient along which its linearised guard changes by h."""
    size = gradient_product(i, i, w)
    if size > 0.0:
        add_gradient(i, -h / size, out, w)


@kernel
def take_out(vector: Vector, h: Vector, out: Vector, w: Scratch, iw: Integers) -> None:
    """Subtract from out the combination of gradients along which the linearised guards change by h."""
    first = 0
    while first < iw.sliding:
        last = iw.group[first]
        if M == 1 or last == first + 1:
            take_out_one(iw.listed[first], h[iw.listed[first]], out, w)
        else:
            for again in range(2):
                for c in range(first, last):
                    vector[c - first] = h[iw.listed[c]]
                    for d in range(first, last):
                        product = gradient_product(iw.listed[c], iw.listed[d], w)
                        w.mat[(c - first) * SIDE + d - first] = product
                if solve_or_least(w.mat, vector, last - first, SIDE, again):
                    for c in range(first, last):
                        add_gradient(iw.listed[c], -vector[c - first], out, w)
                    break
        first = last


@inline
@kernel
def only_sliding(iw: Integers) -> int:
    """The surface of a solution that slides on one; known beforehand where there is no other."""
    return 0 if M == 1 else iw.listed[0]


@kernel
def remove_residual(out: Vector, w: Scratch, iw: Integers) -> None:
    """Remove the rounding errors of the field across the surfaces, so that h stays constant."""
    if M == 1 or iw.sliding == 1:
        i = only_sliding(iw)
        take_out_one(i, rate(i, out, w), out, w)
        return
    for c in range(iw.sliding):
        i = iw.listed[c]
        w.residual[i] = rate(i, out, w)
    take_out(w.vec, w.residual, out, w, iw)


# The rounding that remains of two velocities that cancel, relative to them.
CANCELLED = 1e-15


@kernel
def slide_one(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """One sliding surface: the convex combination of the two vertex fields that stays on it."""
    i, low, high = only_sliding(iw), w.vert, shift(w.vert, N)
    for j in range(M):
        w.s2[j] = w.s[j]
    w.s[i], w.s2[i] = -1.0, 1.0
    if pair(t, x, p, w.s, w.s2, m, low, high, ctx) != 0:
        return 1
    iw.calls += 2
    minus, plus = rate(i, low, w), rate(i, high, w)
    # Equal rates that are not zero: the sign does not act on the surface, nothing holds the solution on it.
    # A contact always holds it: its rates differ by 1, however large both are.
    if CONTACT[i] == 0 and abs(plus - minus) < 1e-9 * (abs(plus) + abs(minus)):
        return 2
    value, rest = w.mult[i].value, True
    if plus != minus:
        value, rest = -(plus + minus) / (plus - minus), False
    weight = 0.5 * (1.0 + value)
    for j in range(N):
        out[j] = low[j] + weight * (high[j] - low[j])
        # Rounding would lead away from rest at a two-fold.
        if rest and abs(out[j]) <= CANCELLED * (abs(low[j]) + abs(high[j])):
            out[j] = 0.0
    track(w, i, value, plus, minus)
    return 0


@kernel
def field(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """The field of mode m; 0, or 1 where the user's function failed, 2 where no multipliers were found."""
    k = iw.sliding
    if k == 0:
        iw.calls += 1
        return rhs(t, x, p, m, m, out, ctx)
    for i in range(M):
        w.s[i] = m[i]
    if gradients(t, x, p, m, w.g, w.gt, ctx) != 0:
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
    t: float, x: Vector, p: Vector, m: Vector, h: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """Put x on the surfaces it rests on: in contact the guard is their rate, which would let h drift.

    0 where x was on all of them, MOVED where it was not, 1 where a function failed.
    """
    moved = 0
    for c in range(iw.sliding):
        i = iw.listed[c]
        if CONTACT[i] != 0:
            m[i] = float(CONTACT[i])
            code = guards(t, x, p, m, h, ctx)
            code = max(code, gradients(t, x, p, m, w.g, w.gt, ctx))
            m[i] = 0.0
            if code != 0:
                return 1
            size, terms = gradient_product(i, i, w), abs(w.gt[i] * t)
            for j in range(N):
                terms += abs(w.g[i * N + j] * x[j])
            if abs(h[i]) > ROUNDING * terms:
                moved = MOVED
            if size > 0.0:
                add_gradient(i, -h[i] / size, x, w)
    return moved


@kernel
def project(
    t: float, x: Vector, p: Vector, m: Vector, h: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """Put x back on every sliding surface along the gradients; two Newton steps take |h| to rounding.

    A step along a rate moves x off its contact, and back, if their gradients are not orthogonal.
    """
    for number in range(ALTERNATIONS):
        held = 0
        if CONTACTS:
            held = hold_contacts(t, x, p, m, h, w, iw, ctx)
        if held == 1:
            return 1
        if number > 1 and held == 0:
            return 0
        if guards(t, x, p, m, h, ctx) != 0 or gradients(t, x, p, m, w.g, w.gt, ctx) != 0:
            return 1
        largest = 0.0
        for c in range(iw.sliding):
            largest = max(largest, abs(h[iw.listed[c]]))
        if largest == 0.0:
            return 0
        take_out(w.vec, h, x, w, iw)
    return 0
