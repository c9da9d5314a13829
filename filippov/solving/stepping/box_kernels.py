"""The complementarity problem of one step: signs and guards at its end, in the kernel language.

    h = q + a s,   h_i > 0 and s_i = 1, or h_i < 0 and s_i = -1, or h_i = 0 and low_i <= s_i <= high_i

First by exchanging the sets of the surfaces that do not fit (principal pivoting: Cottle, Pang & Stone 1992,
section 4.2), from the sets of the step before; where the matrix is singular or that goes round, all sets of
a few surfaces in turn, then projected Gauss-Seidel sweeps (section 5.2 there). What is returned has been
checked.
"""

from filippov.kernel.language.primitives import Indices, Vector, kernel, shift
from filippov.kernel.methods.dense_lu import factor, substitute

NO_SOLUTION, SEVERAL = 11, 13
ON_SIGN, SINGULAR, OPEN = 1e-11, 1e-13, 1e200
MOST_SWEEPS, MOST_ENUMERATED = 20000, 5


@kernel
def rest_of(i: int, q: Vector, a: Vector, s: Vector, k: int) -> float:
    """The guard at the end of the step, q_i + sum_j a_ij s_j."""
    total = q[i]
    for j in range(k):
        total += a[i * k + j] * s[j]
    return float(total)


@kernel
def solve_held(q: Vector, a: Vector, s: Vector, z: Vector, k: int, w: Vector, iw: Indices) -> bool:
    """The s of the surfaces with z = 0 that keep their guards at 0; False where there are none."""
    count = 0
    for i in range(k):
        if z[i] == 0.0:
            iw[k + count] = i
            count += 1
    if count == 0:
        return True
    right = shift(w, k * k)
    for r in range(count):
        i = iw[k + r]
        total = q[i]
        for j in range(k):
            if z[j] != 0.0:
                total += a[i * k + j] * s[j]
        right[r] = -total
        for c in range(count):
            w[r * count + c] = a[i * k + iw[k + c]]
    largest = 0.0
    for r in range(count * count):
        largest = max(largest, abs(w[r]))
    if not factor(w, iw, count):
        return False
    for r in range(count):
        if abs(w[r * count + r]) < SINGULAR * largest:
            return False
    substitute(w, iw, right, count)
    for r in range(count):
        s[iw[k + r]] = right[r]
    return True


@kernel
def pivoting(
    q: Vector, a: Vector, low: Vector, high: Vector, small: Vector, s: Vector, z: Vector, k: int, w: Vector,
    iw: Indices,
) -> bool:  # fmt: skip
    """Exchange the sets of the surfaces that do not fit, all at once, later one by one, until all fit."""
    for trial in range(40 * k + 40):
        if not solve_held(q, a, s, z, k, w, iw):
            return False
        changed = 0
        for i in range(k):
            if changed > 0 and trial > 2 * k + 8:
                break
            if z[i] == 0.0:
                way = 1.0 if s[i] > high[i] + ON_SIGN else (-1.0 if s[i] < low[i] - ON_SIGN else 0.0)
                if way != 0.0:
                    # Where the sign drives the state away from the surface it is the other one that fits.
                    z[i] = way if a[i * k + i] <= 0.0 else -way
                    s[i] = z[i]
                    changed += 1
            elif z[i] * rest_of(i, q, a, s, k) < -small[i]:
                z[i] = 0.0
                changed += 1
        if changed == 0:
            return True
    return False


@kernel
def fits(
    q: Vector, a: Vector, low: Vector, high: Vector, small: Vector, s: Vector, z: Vector, k: int, w: Vector,
    iw: Indices,
) -> bool:  # fmt: skip
    """Whether the sets z solve the problem, with their s."""
    for i in range(k):
        if z[i] != 0.0:
            s[i] = z[i]
    if not solve_held(q, a, s, z, k, w, iw):
        return False
    for i in range(k):
        if z[i] == 0.0:
            if s[i] > high[i] + ON_SIGN or s[i] < low[i] - ON_SIGN:
                return False
        elif z[i] * rest_of(i, q, a, s, k) < -small[i] or (z[i] < 0.0 and low[i] < -OPEN):
            return False
    return True


@kernel
def numbered(number: int, z: Vector, k: int) -> None:
    """The sets by their number, 0 to 3**k - 1."""
    left = number
    for i in range(k):
        z[i] = float(left % 3 - 1)
        left = left // 3


@kernel
def sets_of(k: int) -> int:
    """How many there are to go through, 0 for many surfaces."""
    total = 1
    for _ in range(k):
        total *= 3
    return total if k <= MOST_ENUMERATED else 0


@kernel
def enumeration(
    q: Vector, a: Vector, low: Vector, high: Vector, small: Vector, s: Vector, z: Vector, k: int, w: Vector,
    iw: Indices,
) -> bool:  # fmt: skip
    """All sets of a few surfaces in turn; a sign at its end with nothing left over counts as held."""
    for number in range(sets_of(k)):
        numbered(number, z, k)
        if fits(q, a, low, high, small, s, z, k, w, iw):
            for i in range(k):
                if z[i] != 0.0 and abs(rest_of(i, q, a, s, k)) <= small[i]:
                    z[i] = 0.0
            return True
    return False


@kernel
def another(
    q: Vector, a: Vector, low: Vector, high: Vector, small: Vector, s: Vector, z: Vector, k: int, w: Vector,
    iw: Indices,
) -> bool:  # fmt: skip
    """Whether other sets of a few surfaces end the step elsewhere; of many the signs of the diagonal tell.

    Leaving a static set wider than [-1, 1] is no alternative to resting on it.
    """
    if sets_of(k) == 0:
        driven = 0
        for i in range(k):
            driven += 1 if z[i] == 0.0 and a[i * k + i] > 0.0 else 0
        return driven > 0
    trial, sets, inner = shift(w, 0), shift(w, k), shift(w, 2 * k)
    for number in range(sets_of(k)):
        numbered(number, sets, k)
        asked, left, taken = False, False, False
        for i in range(k):
            asked = asked or sets[i] != z[i]
            taken = taken or (sets[i] == 0.0 and z[i] != 0.0)
            wide = low[i] < -1.0 - ON_SIGN or high[i] > 1.0 + ON_SIGN
            left = left or (sets[i] != 0.0 and z[i] == 0.0 and wide and low[i] > -OPEN and high[i] < OPEN)
        if left and not taken:
            asked = False
        if asked and fits(q, a, low, high, small, trial, sets, k, inner, iw):
            for i in range(k):
                if abs(rest_of(i, q, a, trial, k) - rest_of(i, q, a, s, k)) > 100.0 * small[i]:
                    return True
    return False


@kernel
def relaxation(
    q: Vector, a: Vector, low: Vector, high: Vector, small: Vector, s: Vector, z: Vector, k: int
) -> bool:
    """Projected Gauss-Seidel sweeps, for signs that act on the guards in a fixed proportion."""
    for i in range(k):
        if not (a[i * k + i] < 0.0):
            return False
        s[i] = min(max(s[i], low[i]), high[i])
    for _ in range(MOST_SWEEPS):
        change = 0.0
        for i in range(k):
            now = s[i] - rest_of(i, q, a, s, k) / a[i * k + i]
            z[i] = 1.0 if now > high[i] else (-1.0 if now < low[i] else 0.0)
            if z[i] != 0.0:
                now = z[i]
            change = max(change, abs(now - s[i]) / max(1.0, abs(now)))
            s[i] = now
        if change <= 1e-14:
            for i in range(k):
                if z[i] == 0.0 and not (abs(rest_of(i, q, a, s, k)) <= 1e3 * small[i]):
                    return False
            return True
    return False


@kernel
def complementarity(
    q: Vector, a: Vector, low: Vector, high: Vector, small: Vector, s: Vector, z: Vector, k: int, w: Vector,
    iw: Indices,
) -> int:  # fmt: skip
    """s and z with q + a s > 0 and s = 1, < 0 and s = -1, or = 0 and low <= s <= high; z as far as possible.

    A static set wider than [-1, 1] holds what comes to rest and what rests; a surface left has s = +-1.
    """
    changes, held, sets = 0, 0, shift(w, k * k + 4 * k)
    for i in range(k):
        sets[i] = z[i]
        if z[i] != 0.0:
            s[i] = z[i]
    found = pivoting(q, a, low, high, small, s, z, k, w, iw)
    if not found:
        found = enumeration(q, a, low, high, small, s, z, k, w, iw)
    if not found:
        found = relaxation(q, a, low, high, small, s, z, k)
    if not found:
        return NO_SOLUTION
    for i in range(k):
        changes += 1 if sets[i] != z[i] else 0
        held += 1 if z[i] == 0.0 and a[i * k + i] > 0.0 else 0
    if changes + held > 0 and another(q, a, low, high, small, s, z, k, w, iw):
        return SEVERAL
    return 0
