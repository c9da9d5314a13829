"""Taylor's method: the step, its error and its guards from the coefficients of field and guards at its start.

x(t + step) = sum_k x_k step**k, the x_k by recurrences that are written for the system (`jets`). Steps are
those of Jorba & Zou 2005 (Experimental Mathematics 14, section 3): the last two coefficients are as large as
the tolerance. What coefficients cannot show, a steep change of the field ahead, shows at the end of the
step, where the polynomial's rate is compared with the field; the difference is the next coefficient.

Coefficients are kept with the point at which they were computed, so that a shorter step from there and the
landing on an event need no others. Where there are none (several surfaces slide together, a power is singular
there), DOP853 takes the step, and its interpolant is written as such a polynomial.
"""

from filippov.kernel.language.primitives import Indices, Vector, from_bits, inline, kernel, to_bits
from filippov.kernel.loop.model import (
    CONTACT,
    CONTACTS,
    DECAYING,
    DEGREE_DENSE,
    JETS,
    LAST,
    STAGES,
    TAILS,
    WIDTH,
    M,
    N,
    take_jets,
    taken_here,
)
from filippov.kernel.loop.state import Integers, Scratch
from filippov.kernel.tables.layout import CHECKS
from filippov.kernel.tables.root_tables import NODES, POSITION

# Bits of 1.0, moved by the mean error of reading a mantissa as a logarithm.
ONE_BITS = 4606988764016040477
GROWTH = 10.0
# The least part of the last step that a singularity is found to allow.
LEAST_PART = 0.05
# The largest error of a guard's series at the end of a step, relative to its terms.
SERIES_MISS = 1e-9


@inline
@kernel
def root_of_inverse(value: float, order: int) -> float:
    """value**(-1/order) to about a percent, by a division of the bits (see `step_factor`)."""
    return from_bits(ONE_BITS - (to_bits(value) - ONE_BITS) // order)


@kernel
def series_step(
    t: float, x: Vector, p: Vector, m: Vector, rtol: float, atol: Vector, before: float, w: Scratch,
    iw: Integers,
) -> float:  # fmt: skip
    """A step by the coefficients at (t, x), or `before` where that one was tried or there are none.

    It is at most `GROWTH` times what the last step suggests, for what the coefficients cannot show, and ends
    before the nearest singularity of what the field is made of, and before an exponential that cannot be seen
    from its start becomes one that can. A singularity cuts it to no less than LEAST_PART of the last step.
    """
    if taken_here(t, x, m, w):
        return before
    take_jets(t, x, p, m, w, iw)
    if w.explicit != 0.0:
        return before
    last, earlier = 0.0, 0.0
    top, under = (STAGES - 2) * JETS, (STAGES - 3) * JETS
    for j in range(N):
        scale = atol[j] + rtol * abs(x[j]) + 1e-300
        last = max(last, abs(w.jet[top + j]) / scale)
        earlier = max(earlier, abs(w.jet[under + j]) / scale)
    length = 1e300
    if last > 0.0:
        length = min(length, root_of_inverse(last / float(STAGES - 1), STAGES - 1))
    if earlier > 0.0:
        length = min(length, root_of_inverse(earlier / float(STAGES - 2), STAGES - 2))
    length = min(length, GROWTH * before)
    for row in range(TAILS):
        if row < DECAYING and w.jet_room[exponent_at(row)] < 2.0 * INVISIBLE:
            while length > 0.0 and exponent(row, length, w) >= INVISIBLE:
                length *= 0.5
        growth = last_growth(row, length, w)
        if growth > REACHES and growth < 1e300:
            # What comes nearer does so step by step; where the terms are rounding they say anything.
            shorter = length * root_of_inverse(growth / REACHES, LAST)
            length = max(shorter, min(length, LEAST_PART * before))
    return length


# The exponent of an exponential that no field shows: exp(-100) is 4e-44.
INVISIBLE = -100.0


@inline
@kernel
def exponent_at(row: int) -> int:
    """The place of the exponent's coefficients."""
    return 2 * LAST * TAILS + row * (STAGES - 1)


@kernel
def exponent(row: int, length: float, w: Scratch) -> float:
    """A bound of the exponent of an exponential in a step, from all of its terms."""
    first, rise = exponent_at(row), 0.0
    for k in range(STAGES - 2, 0, -1):
        rise = (rise + abs(w.jet_room[first + k])) * length
    return float(w.jet_room[first] + rise)


# The last terms of the series of a part of the field, relative to as many before them: with less it converges
# well enough for its end to show what the later terms come to, with more the step would reach beyond the
# nearest singularity, behind which there may be anything.
CONVERGES, REACHES = 0.1, 0.8


@inline
@kernel
def terms_growth(row: int, length: float, w: Scratch) -> float:
    """The last terms of a series relative to as many before, 1e300 where these are 0; of every lane too."""
    early, late, power = 0.0, 0.0, 1.0
    for q in range(row * 2 * LAST, (row * 2 + 1) * LAST):
        early = max(early, abs(w.jet_room[q]) * power)
        power *= length
    for q in range((row * 2 + 1) * LAST, (row * 2 + 2) * LAST):
        late = max(late, abs(w.jet_room[q]) * power)
        power *= length
    return late / early if early > 0.0 else 1e300


@kernel
def last_growth(row: int, length: float, w: Scratch) -> float:
    """The last terms of the series of a part of the field, relative to as many before; 1e300: not known.

    A polynomial part says nothing of what is ahead, and a peak or a bend far away has terms below the
    rounding of the field, but not below those before them. A part that has none, since it is below the least
    number or jumps, is not known.
    """
    if row < DECAYING and w.jet_room[exponent_at(row)] < INVISIBLE and exponent(row, length, w) < INVISIBLE:
        return 0.0
    return terms_growth(row, length, w)


@kernel
def series_converges(step: float, w: Scratch) -> bool:
    """Whether the series of all parts of the field are known to converge on the step."""
    if TAILS < 0:
        return False
    for row in range(TAILS):  # noqa: SIM110 - the kernel language has no `all`
        if not (last_growth(row, abs(step), w) <= CONVERGES):
            return False
    return True


@kernel
def constant_series(w: Scratch) -> bool:
    """Whether the field is constant along the step by its coefficients."""
    if w.explicit != 0.0:
        return False
    for a in range(N, (STAGES - 1) * N):  # noqa: SIM110 - the kernel language has no `all`
        if w.k[a] != 0.0:
            return False
    return True


@kernel
def series_dense(x: Vector, step: float, w: Scratch) -> None:
    """x(theta) = sum_k coef[k] theta**k on the step."""
    for i in range(N):
        w.coef[i] = x[i]
    for k in range(1, DEGREE_DENSE + 1):
        for i in range(N):
            w.coef[k * N + i] = step * w.k[(k - 1) * N + i] / float(k)


@kernel
def has_series(m: Vector, w: Scratch) -> bool:
    """Whether the coefficients of the guards are those of this mode: a contact has one end only."""
    if w.explicit != 0.0:
        return False
    for i in range(M):  # noqa: SIM110 - the kernel language has no `all`
        if CONTACTS and m[i] == 0.0 and CONTACT[i] != 0:
            return False
    return True


@kernel
def guard_side(row: int, m: Vector, w: Scratch) -> float:
    """The factor that makes the series of a row of `jets` positive while the mode lasts."""
    i = row if row < M else row - M
    if m[i] != 0.0:
        return float(m[i])
    return float(w.attract[i])


@kernel
def series_value(row: int, time: float, m: Vector, w: Scratch) -> float:
    """The guard of a row, a time after the point of the coefficients; 1 for an unused row."""
    i = row if row < M else row - M
    if row >= M and m[i] != 0.0:
        return 1.0
    total = 0.0
    for k in range(STAGES - 2, -1, -1):
        total = total * time + w.jet[k * JETS + N + row]
    total *= guard_side(row, m, w)
    return total + WIDTH[i] if m[i] != 0.0 else total


@kernel
def series_sample(step: float, first: float, apart: float, m: Vector, w: Scratch) -> None:
    """The guards' series where `sample` evaluates the guards."""
    for row in range(2 * M):
        for q in range(NODES):
            w.node[q * 2 * M + row] = series_value(row, POSITION[q] * step, m, w)
        for q in range(CHECKS):
            w.check[q * 2 * M + row] = series_value(row, (first + apart * q) * step, m, w)


@kernel
def series_clear(step: float, m: Vector, order: Indices, w: Scratch, iw: Integers) -> bool:
    """Whether no guard can vanish in the step: its first coefficient outweighs all later ones together.

    One that vanishes at the start is divided by the power of time with which it does. A series that misses
    the guard at the end of the step proves nothing.
    """
    if not has_series(m, w):
        return False
    for row in range(2 * M):
        i = row if row < M else row - M
        if row >= M and m[i] != 0.0:
            continue
        if order[i] < 0 or (m[i] == 0.0 and order[i] != 0):
            return False
        side = guard_side(row, m, w)
        from_here = order[i]
        total, rest, factor, size = 0.0, 0.0, 1.0, 0.0
        first = 0.0
        for k in range(STAGES - 1):
            term = side * w.jet[k * JETS + N + row] * factor
            if k == 0 and m[i] != 0.0:
                term += WIDTH[i]
            total += term
            size += abs(term)
            if k == from_here:
                first = term
            elif k > from_here:
                rest += abs(term)
            factor *= step
        slack = w.touch[i] if m[i] != 0.0 and from_here == 0 else 0.0
        if not (first > rest + slack):
            return False
        if m[i] != 0.0 and abs(total - (side * w.end[2 * i] + WIDTH[i])) > SERIES_MISS * size:
            return False
    return True
