"""Root isolation of polynomials of degree 8 in Bernstein form.

All coefficients of one sign prove that there is no root, one change of sign proves exactly one (Lane &
Riesenfeld 1981); subdivision at the middle decides the rest, down to 2**-DEPTH of the interval.
"""

from filippov.kernel.language.primitives import Vector, inline, kernel, shift
from filippov.kernel.tables.root_tables import (
    BINOMIAL,
    DEGREE,
    DEPTH,
    NO_ROOT,
    NODES,
    RESOLUTION,
    SIMPLE_ROOT,
    TANGENT_ROOT,
)


@kernel
def bernstein_value(c: Vector, degree: int, u: float, work: Vector) -> float:
    """Value at u in [0, 1] by de Casteljau, which is stable up to both ends."""
    for j in range(degree + 1):
        work[j] = c[j]
    for r in range(degree):
        for j in range(degree - r):
            work[j] = (1.0 - u) * work[j] + u * work[j + 1]
    return float(work[0])


@kernel
def coefficient_range(c: Vector) -> tuple[float, float]:
    """Least and largest Bernstein coefficient: the guard stays between them."""
    least, most = float(c[0]), float(c[0])
    for a in range(1, NODES):
        least = min(least, c[a])
        most = max(most, c[a])
    return least, most


@kernel
def deflate(c: Vector, order: int) -> int:
    """Divide out a root of the given order at 0, in place; returns the degree that is left."""
    degree = DEGREE - order
    for j in range(degree + 1):
        c[j] = c[j + order] * BINOMIAL[DEGREE * NODES + j + order] / BINOMIAL[degree * NODES + j]
    return degree


@inline
@kernel
def newton_step(b: Vector, degree: int, u: float) -> tuple[float, float, float]:
    """p and p' at u in [0, 1], both up to positive factors, and p / p' there (0 where p' is).

    p = (1 - u)**n sum b_j q**j with q = u / (1 - u) where u is below 1/2, from the other end above (Schumaker
    & Volk 1986): as stable as de Casteljau, at a fraction of the work. b: the coefficients times binomials.
    Even and odd powers are summed separately, as two independent chains.
    """
    forward = u <= 0.5
    near = u if forward else 1.0 - u
    far = 1.0 - u if forward else u
    q = near / far
    square = q * q
    even, odd, even_slope, odd_slope = 0.0, 0.0, 0.0, 0.0
    for k in range(degree // 2 + 1):
        j = 2 * (degree // 2 - k)
        above = 0.0
        if j < degree:
            above = b[j + 1 if forward else degree - j - 1]
        even_slope, odd_slope = even_slope * square + even, odd_slope * square + odd
        even, odd = even * square + b[j if forward else degree - j], odd * square + above
    value = even + q * odd
    slope = 2.0 * q * (even_slope + q * odd_slope) + odd
    # p' up to the factor far, which is at least 1/2
    change = slope - float(degree) * far * value
    change = change if forward else -change
    return value, change, (value * far * far / change if change != 0.0 else 0.0)


@kernel
def bracketed_root(c: Vector, degree: int, work: Vector) -> float:
    """The only root of c in [0, 1], c[0] > 0 >= c[degree]: Newton's steps, or bisection."""
    lo, hi = 0.0, 1.0
    if c[degree] == 0.0:
        return 1.0
    for j in range(degree + 1):
        work[j] = BINOMIAL[degree * NODES + j] * c[j]
    u, before = float(c[0] / (c[0] - c[degree])), 0.0
    for iteration in range(80):
        value, slope, step = newton_step(work, degree, u)
        if value > 0.0:
            lo = u
        elif value < 0.0:
            hi = u
        else:
            return u
        following = u - step
        newton = slope < 0.0 and lo < following < hi and iteration % 8 != 7
        if not newton:
            following = 0.5 * (lo + hi)
        change = abs(following - u)
        u = following
        # Near a simple root each step is a constant times the square of the previous one.
        if hi - lo <= 1e-15 or change <= 1e-15 or (newton and change * change * change <= 1e-17 * before):
            break
        before = change * change if newton else 0.0
    return u


@kernel
def halve(row: Vector, right: Vector, left: Vector, degree: int, work: Vector) -> None:
    """de Casteljau at 1/2: both halves of a polynomial; `right` may be `row` itself."""
    for j in range(degree + 1):
        work[j] = row[j]
    left[0] = work[0]
    right[degree] = work[degree]
    for r in range(1, degree + 1):
        for j in range(degree - r + 1):
            work[j] = 0.5 * (work[j] + work[j + 1])
        left[r] = work[0]
        right[degree - r] = work[degree - r]


@kernel
def first_root(
    c: Vector, degree: int, touch: float, stack: Vector, bounds: Vector, work: Vector
) -> tuple[int, float]:
    """First place in [0, 1] where the polynomial c, positive at the start, stops being positive: (kind, u).

    SIMPLE_ROOT where it changes sign, TANGENT_ROOT where it has a least value in [0, touch] inside without
    changing sign at the resolution, NO_ROOT otherwise. Scratch: `stack` (DEPTH + 3) * NODES,
    `bounds` (DEPTH + 3) * 2.
    """
    for j in range(degree + 1):
        stack[j] = c[j]
    bounds[0], bounds[1] = 0.0, 1.0
    top = 1
    falling = False
    while top > 0:
        top -= 1
        row = shift(stack, top * NODES)
        lo, hi = bounds[2 * top], bounds[2 * top + 1]
        least = row[0]
        changes = 0
        for j in range(1, degree + 1):
            if row[j] < least:
                least = row[j]
            if (row[j] > 0.0) != (row[j - 1] > 0.0):
                changes += 1
        if least > touch:
            falling = False
            continue
        width = hi - lo
        if row[0] <= 0.0:
            return SIMPLE_ROOT, lo
        # Where the end is 0 exactly, one change of sign does not say that the root is there.
        if changes == 1 and (row[degree] < 0.0 or least >= 0.0):
            return SIMPLE_ROOT, lo + width * bracketed_root(row, degree, work)
        if least > 0.0 and width <= RESOLUTION:
            # No root here; a least value inside the piece, or where it joins the previous one, is a tangency.
            falls, rises = row[1] < row[0], row[degree] > row[degree - 1]
            if (falls or falling) and rises:
                # The vertex of the parabola with the slopes of both ends.
                fall, rise = row[0] - row[1], row[degree] - row[degree - 1]
                return TANGENT_ROOT, (lo + width * fall / (fall + rise) if falls else lo)
            falling = falls and row[degree] <= touch
            continue
        if top + 2 > DEPTH:
            return TANGENT_ROOT, 0.5 * (lo + hi)
        middle = 0.5 * (lo + hi)
        halve(row, row, shift(stack, (top + 1) * NODES), degree, work)
        bounds[2 * top], bounds[2 * top + 1] = middle, hi
        bounds[2 * top + 2], bounds[2 * top + 3] = lo, middle
        top += 2
    return NO_ROOT, 2.0
