"""Corners of any number of surfaces whose rates are affine in their signs: what follows, where it is clear.

On the surfaces of a corner h' = r + C s. A choice of sides is consistent if the multipliers of the surfaces
slid on, with h'_i = 0, lie in their sets, and h'_i leads off the others to their sides. If -C is a P-matrix
(its principal minors all positive), one s solves the complementarity problem, found by principal pivoting.
It is one with a diagonal D > 0 such that -C D is symmetric and positive definite (friction: C = -G M^-1 G'
D^-1); solutions approach each other in the norm of its inverse. It is one too where D makes the diagonal of
D C exceed all else in its column together; they approach each other in the sum of their distances. Elsewhere
up to MOST_MINORS minors are computed. Surfaces at the end of a set wider than [-1, 1] are released: their
signs fall to +-1, and the others are found anew. For up to ENUMERATED surfaces of which this does not tell,
all choices are tried. What is not clear is left to `filippov.solving.selection.modes`.

Sources: Leine & Nijmeijer 2004, chapter 5; Cottle, Pang & Stone 1992, sections 3.3 and 4.2; Berman & Plemmons
1994, chapter 6 (M-matrices); Júdice & Pires 1994, Computers Oper. Res. 21 (all pivots at once, single ones
where these do not end).
"""

from filippov.kernel.language.primitives import Indices, Vector, apart, kernel, seldom
from filippov.kernel.loop.control import finite
from filippov.kernel.loop.corner import MINOR
from filippov.kernel.loop.dense import solve_linear
from filippov.kernel.loop.field import set_mode
from filippov.kernel.loop.model import COMPONENT, G_COLUMN, G_FIRST, SIDE, M, N, gradients
from filippov.kernel.loop.resolve import CLEAR_RATE
from filippov.kernel.loop.rules import couple, sign_derivatives
from filippov.kernel.loop.state import Integers, Scratch

# Surfaces of which all choices are tried, as by the classification of corners; whose minors are computed.
ENUMERATED, MOST_MINORS = 6, 8
# The least distance of a multiplier from the ends of its set; a set that is wider than Filippov's own.
OFF_ENDS, WIDER = 1e-5, 1.000000000001
# Rounding of what is symmetric, of its largest entry.
NOT_SYMMETRIC = 1e-9
# Pivots allowed besides one per surface; how often all at once may fail to lessen what is wrong.
MORE_PIVOTS, TRIES = 20, 5
# Sides of a surface besides 0 (slid on) and +-1 (at that end of its set): released there; what is no side.
RELEASED, NO_SIDE = 2.0, 3.0


@apart
@kernel
def coupled_rates(t: float, x: Vector, p: Vector, m: Vector, w: Scratch, iw: Integers, ctx: Indices) -> bool:
    """The field with all sliding signs at -1, and half its changes by each; False where it is not finite."""
    for i in range(M):
        w.s[i] = m[i]
    if gradients(t, x, p, m, w.g, w.gt, ctx) != 0 or sign_derivatives(t, x, p, m, w, iw, ctx) != 0:
        return False
    return finite(w.vert, N)


@apart
@kernel
def write_corner(first: int, k: int, m: Vector, w: Scratch, iw: Integers) -> bool:
    """C, r and scales of the rates of one group of the list of sliding surfaces; False if not finite."""
    sound = 0.0
    couple(first, first + k, m, w, iw)
    for c in range(k):
        i, r = iw.listed[first + c], -w.vec[c]
        iw.corner[c] = i
        size = abs(w.gt[i])
        for a in range(G_FIRST[i], G_FIRST[i + 1]):
            size += abs(w.g[i * N + G_COLUMN[a]] * w.vert[G_COLUMN[a]])
        for d in range(k):
            entry = w.mat[c * SIDE + d]
            w.coupling[c * SIDE + d] = entry
            r += entry
            size += 2.0 * abs(entry)
        w.coupled_rate[c], w.coupled_size[c] = r, size
        sound += 0.0 * size
    return sound == 0.0


@seldom
@kernel
def minor(chosen: int, k: int, w: Scratch) -> float:
    """The principal minor of -C whose rows are the bits of a number, in units of the largest of its rows."""
    size, a = 0, w.mat
    for c in range(k):
        if (chosen >> c) & 1:
            unit, q = 1e-300, 0
            for d in range(k):
                unit = max(unit, abs(w.coupling[c * SIDE + d]))
            for d in range(k):
                if (chosen >> d) & 1:
                    a[size * SIDE + q] = -w.coupling[c * SIDE + d] / unit
                    q += 1
            size += 1
    product = 1.0
    for q in range(size):
        pivot = q
        for c in range(q + 1, size):
            if abs(a[c * SIDE + q]) > abs(a[pivot * SIDE + q]):
                pivot = c
        if pivot != q:
            product = -product
            for d in range(q, size):
                held = a[q * SIDE + d]
                a[q * SIDE + d] = a[pivot * SIDE + d]
                a[pivot * SIDE + d] = held
        if a[q * SIDE + q] == 0.0:
            return 0.0
        product *= a[q * SIDE + q]
        for c in range(q + 1, size):
            factor = a[c * SIDE + q] / a[q * SIDE + q]
            for d in range(q + 1, size):
                a[c * SIDE + d] -= factor * a[q * SIDE + d]
    return product


@seldom
@kernel
def minors_positive(k: int, w: Scratch) -> bool:
    """Whether every principal minor of -C is positive, for the few surfaces for which they are computed."""
    if k > MOST_MINORS:
        return False
    least = 1.0
    for chosen in range(1, 1 << k):
        least = min(least, minor(chosen, k, w))
    return least > MINOR


@seldom
@kernel
def balance(k: int, scale: Vector, w: Scratch) -> None:
    """The diagonal that makes C times it symmetric, as far as there is one, from one entry to the next."""
    for c in range(k):
        scale[c] = 0.0
    for start in range(k):
        found = scale[start] == 0.0
        if found:
            scale[start] = 1.0
        while found:
            found = False
            for c in range(k):
                if scale[c] == 0.0:
                    continue
                for d in range(k):
                    forth, back = w.coupling[c * SIDE + d], w.coupling[d * SIDE + c]
                    if scale[d] == 0.0 and forth * back > 0.0:
                        scale[d] = scale[c] * back / forth
                        found = True


@apart
@kernel
def like_friction(k: int, w: Scratch) -> bool:
    """Whether -C times a positive diagonal is symmetric and positive definite."""
    a, scale, largest = w.mat, w.slope, 0.0
    balance(k, scale, w)
    for c in range(k):
        for d in range(k):
            a[c * SIDE + d] = -w.coupling[c * SIDE + d] * scale[d]
            largest = max(largest, abs(a[c * SIDE + d]))
    for c in range(k):
        for d in range(c):
            if not (abs(a[c * SIDE + d] - a[d * SIDE + c]) <= NOT_SYMMETRIC * largest):
                return False
    for q in range(k):
        # Each pivot beside its own diagonal entry: surfaces may have any units.
        whole = a[q * SIDE + q]
        for d in range(q):
            whole -= a[q * SIDE + d] * a[q * SIDE + d] * w.vec[d]
        if not (whole > MINOR * a[q * SIDE + q]):
            return False
        w.vec[q] = 1.0 / whole
        for c in range(q + 1, k):
            entry = a[c * SIDE + q]
            for d in range(q):
                entry -= a[c * SIDE + d] * a[q * SIDE + d] * w.vec[d]
            a[c * SIDE + q] = entry
    return True


@seldom
@kernel
def dominant(k: int, w: Scratch) -> bool:
    """Whether a positive diagonal makes the diagonal of -C exceed the sum of all else in each column.

    So it is where |C| with the signs of an M-matrix is one: elimination meets positive pivots only.
    """
    a = w.mat
    for c in range(k):
        for d in range(k):
            entry = w.coupling[c * SIDE + d]
            a[c * SIDE + d] = -entry if c == d else -abs(entry)
        w.slope[c] = a[c * SIDE + c]
    for q in range(k):
        pivot = a[q * SIDE + q]
        if not (w.slope[q] > 0.0 and pivot > MINOR * w.slope[q]):
            return False
        for c in range(q + 1, k):
            factor = a[c * SIDE + q] / pivot
            if factor != 0.0:
                for d in range(q + 1, k):
                    a[c * SIDE + d] -= factor * a[q * SIDE + d]
    return True


@seldom
@kernel
def one_choice(k: int, w: Scratch) -> bool:
    """Whether -C is known to be a P-matrix, so that one mode follows."""
    return like_friction(k, w) or dominant(k, w) or minors_positive(k, w)


@seldom
@kernel
def is_wide(i: int, w: Scratch) -> bool:
    """Whether the set at h_i = 0 is wider than [-1, 1]."""
    low, high = float(w.radius[2 * i]), float(w.radius[2 * i + 1])
    return max(-low, high) > WIDER


@apart
@kernel
def multipliers(k: int, w: Scratch, iw: Integers) -> bool:
    """The signs of a corner with these sides; False if no one multiplier fits the surfaces slid on."""
    s, side, q = w.coupled_sign, w.coupled_side, 0
    for c in range(k):
        i = iw.corner[c]
        s[c] = 1.0 if side[c] > 0.0 else -1.0
        if side[c] == 1.0 or side[c] == -1.0:
            s[c] = w.radius[2 * i + 1] if side[c] > 0.0 else w.radius[2 * i]
    for c in range(k):
        if side[c] != 0.0:
            continue
        w.vec[q] = -w.coupled_rate[c]
        r = 0
        for d in range(k):
            if side[d] != 0.0:
                w.vec[q] -= w.coupling[c * SIDE + d] * s[d]
            else:
                w.mat[q * SIDE + r] = w.coupling[c * SIDE + d]
                r += 1
        q += 1
    if not solve_linear(w.mat, w.vec, q, SIDE):
        return False
    q = 0
    for c in range(k):
        if side[c] == 0.0:
            s[c] = w.vec[q]
            q += 1
    return True


@apart
@kernel
def rate_of(c: int, k: int, w: Scratch) -> float:
    """The rate of one surface of the corner at the signs found."""
    rate = w.coupled_rate[c]
    for d in range(k):
        rate += w.coupling[c * SIDE + d] * w.coupled_sign[d]
    return float(rate)


@seldom
@kernel
def fit(k: int, w: Scratch, iw: Integers) -> int:
    """How the sides chosen fit, with the signs found: 1 clearly, 0 where that is not clear, -1 not at all."""
    answer = 1
    for c in range(k):
        side, i = w.coupled_side[c], iw.corner[c]
        if side == 0.0:
            low, high = w.radius[2 * i], w.radius[2 * i + 1]
            inside, least = min(w.coupled_sign[c] - low, high - w.coupled_sign[c]), OFF_ENDS
        else:
            inside = rate_of(c, k, w) * (1.0 if side > 0.0 else -1.0)
            least = CLEAR_RATE * w.coupled_size[c]
        if inside < -least:
            return -1
        if not (inside > least):
            answer = 0
    return answer


@seldom
@kernel
def precedes(one: int, other: int, i: int, k: int, w: Scratch, iw: Integers) -> bool:
    """Whether one choice keeps more sticking than another where sets are wider than [-1, 1].

    It differs only by that, or it releases fewer of those stuck to before surface i was reached or left.
    """
    sticks, fewer, more = True, False, False
    for c in range(k):
        here, there, wide = one % 3, other % 3, is_wide(iw.corner[c], w)
        sticks = sticks and (here == there or (here == 1 and wide))
        if wide and iw.corner[c] != i:
            fewer = fewer or (here == 1 and there != 1)
            more = more or (here != 1 and there == 1)
        one, other = one // 3, other // 3
    return sticks or (fewer and not more)


@seldom
@kernel
def choose_sides(choice: int, k: int, w: Scratch) -> None:
    """The sides whose digits to the base 3, less one, are those of a number."""
    for c in range(k):
        w.coupled_side[c] = RELEASED * float(choice % 3 - 1)
        choice //= 3


@seldom
@kernel
def fit_of(choice: int, k: int, w: Scratch, iw: Integers) -> int:
    """How a choice fits; 0 too where its multipliers are not unique."""
    choose_sides(choice, k, w)
    return fit(k, w, iw) if multipliers(k, w, iw) else 0


@seldom
@kernel
def try_all(i: int, k: int, left_out: int, w: Scratch, iw: Integers) -> bool:
    """The sides of the one choice that is consistent, but for one left out; False where that is not clear."""
    choices, found = 1, -1
    for _ in range(k):
        choices *= 3
    for choice in range(choices):
        if choice != left_out and fit_of(choice, k, w, iw) == 1:
            if found < 0 or precedes(choice, found, i, k, w, iw):
                found = choice
            elif not precedes(found, choice, i, k, w, iw):
                return False
    if found < 0:
        return False
    for choice in range(choices):
        if choice != left_out and not precedes(found, choice, i, k, w, iw) and fit_of(choice, k, w, iw) == 0:
            return False
    choose_sides(found, k, w)
    return True


@seldom
@kernel
def right_side(c: int, k: int, i: int, w: Scratch) -> float:
    """The side that one surface should have in place of its own, NO_SIDE where that is right."""
    value, side = w.coupled_sign[c], w.coupled_side[c]
    if side == 0.0:
        return 1.0 if value > w.radius[2 * i + 1] else (-1.0 if value < w.radius[2 * i] else NO_SIDE)
    if abs(side) == RELEASED or not (rate_of(c, k, w) * side < 0.0):
        return NO_SIDE
    return 0.0


@seldom
@kernel
def pivot_sides(k: int, w: Scratch, iw: Integers) -> bool:
    """Change the sides until none is wrong: they solve the complementarity problem; False if not found."""
    least, tries = k + 1, TRIES
    for _ in range(k + MORE_PIVOTS):
        if not multipliers(k, w, iw):
            return False
        wrong, last = 0, 0
        for c in range(k):
            w.slope[c] = right_side(c, k, iw.corner[c], w)
            if w.slope[c] != NO_SIDE:
                wrong, last = wrong + 1, c
        if wrong == 0:
            return True
        if wrong < least:
            least, tries = wrong, TRIES
        else:
            tries -= 1
        for c in range(k):
            if w.slope[c] != NO_SIDE and (tries > 0 or c == last):
                w.coupled_side[c] = w.slope[c]
    return False


@seldom
@kernel
def complement(i: int, k: int, w: Scratch, iw: Integers) -> bool:
    """The sides that solve the complementarity problem from those given, and clearly; False elsewhere."""
    wide = is_wide(i, w)
    for c in range(k):
        if is_wide(iw.corner[c], w) != wide:
            return False
    for _ in range(k + 1):
        if not pivot_sides(k, w, iw):
            return False
        released = 0
        for c in range(k):
            # Where the classification tries all choices several may be consistent.
            if wide and w.coupled_side[c] != 0.0 and iw.corner[c] != i and k <= ENUMERATED:
                return False
            if wide and abs(w.coupled_side[c]) == 1.0:
                w.coupled_side[c] *= RELEASED
                released += 1
        if released == 0:
            return fit(k, w, iw) == 1
    return False


@seldom
@kernel
def group_of(i: int, iw: Integers) -> int:
    """Where in the list of sliding surfaces those begin that are coupled to surface i."""
    first = 0
    while first < iw.sliding and COMPONENT[iw.listed[first]] != COMPONENT[i]:
        first = iw.group[first]
    return first


@seldom
@kernel
def connect(i: int, k: int, w: Scratch, iw: Integers) -> int:
    """Leave those in the corner that act on surface i or feel it, through others too; how many they are."""
    near = w.slope
    for c in range(k):
        near[c] = 1.0 if iw.corner[c] == i else 0.0
    again = True
    while again:
        again = False
        for c in range(k):
            for d in range(k):
                acts = w.coupling[c * SIDE + d] != 0.0 or w.coupling[d * SIDE + c] != 0.0
                if near[c] != 0.0 and near[d] == 0.0 and acts:
                    near[d], again = 1.0, True
    size = 0
    for c in range(k):
        if near[c] != 0.0:
            place = 0
            for d in range(k):
                if near[d] != 0.0:
                    w.coupling[size * SIDE + place] = w.coupling[c * SIDE + d]
                    place += 1
            iw.corner[size] = iw.corner[c]
            w.coupled_rate[size], w.coupled_size[size] = w.coupled_rate[c], w.coupled_size[c]
            size += 1
    return size


@seldom
@kernel
def find_sides(i: int, k: int, before: float, end: float, w: Scratch, iw: Integers) -> bool:
    """What follows where surface i is reached from the side `before`, or left at an end where that is 0."""
    for c in range(k):
        w.coupled_side[c] = 0.0
        if iw.corner[c] == i:
            w.coupled_side[c] = RELEASED * end if before == 0.0 else -before
    if one_choice(k, w) and complement(i, k, w, iw):
        return True
    stuck = 0
    for _ in range(k):
        stuck = 3 * stuck + 1
    return k <= ENUMERATED and try_all(i, k, stuck if before == 0.0 else -1, w, iw)


@seldom
@kernel
def follow_sides(
    t: float, x: Vector, p: Vector, m: Vector, i: int, end: float, w: Scratch, iw: Integers, ctx: Indices
) -> bool:
    """The mode after surface i is reached, or left at an end (+-1) of its set, into m; False if not clear."""
    before = m[i]
    m[i] = 0.0
    set_mode(m, iw)
    first = group_of(i, iw)
    k = iw.group[first] - first
    known = coupled_rates(t, x, p, m, w, iw, ctx) and write_corner(first, k, m, w, iw)
    if known:
        k = connect(i, k, w, iw)
        known = find_sides(i, k, before, end, w, iw)
    if not known:
        m[i] = before
        set_mode(m, iw)
        return False
    for c in range(k):
        side = w.coupled_side[c]
        m[iw.corner[c]] = 1.0 if side > 0.0 else (-1.0 if side < 0.0 else 0.0)
    return True
