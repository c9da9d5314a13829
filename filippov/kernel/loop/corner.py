"""Corners of two surfaces: their rates in the four quadrants, and which of the nine modes these say follow.

Where all four fields lead across one surface, the rates of the other beyond it decide; elsewhere there is one
mode where minus the rates are a P-function of the signs (see `filippov.solving.selection.attraction`).

Sources: Filippov 1988, section 10; More & Rheinboldt 1973; Dieci & Lopez 2012, section 3.
"""

from filippov.kernel.language.primitives import Indices, Vector, entry, kernel
from filippov.kernel.loop.control import finite
from filippov.kernel.loop.model import G_COLUMN, G_FIRST, M, N, gradients, rhs
from filippov.kernel.loop.resolve import CLEAR_RATE
from filippov.kernel.loop.state import Integers, Scratch

# Relative to its rows, the least positive principal minor; also the least growth of a cycle round the corner.
MINOR, NEUTRAL = 1e-9, 1e-9
# Properties of a corner, as bits.
ONE_SOLUTION, TURNS_OUT = 1, 2


@kernel
def corner_rates(
    t: float, x: Vector, p: Vector, m: Vector, i: int, j: int, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """h_i' and h_j' in the direction of integration by quadrant, into w.corner, then their scales.

    Quadrant q: s_i = +1 where q is odd, s_j = +1 where it is 2 or 3.
    """
    s, f, corner = w.s, w.f, w.corner
    before_i, before_j = m[i], m[j]
    m[i], m[j] = 0.0, 0.0
    code = gradients(t, x, p, m, w.g, w.gt, ctx)
    corner[8], corner[9] = abs(w.gt[i]), abs(w.gt[j])
    for q in range(4):
        for k in range(M):
            s[k] = m[k] if m[k] != 0.0 else 1.0
        s[i] = 1.0 if q & 1 == 1 else -1.0
        s[j] = 1.0 if q > 1 else -1.0
        code = max(code, rhs(t, x, p, s, m, f, ctx))
        for side in range(2):
            k = i if side == 0 else j
            rate, size = w.gt[k], abs(w.gt[k])
            for a in range(G_FIRST[k], G_FIRST[k + 1]):
                term = w.g[k * N + G_COLUMN[a]] * f[G_COLUMN[a]]
                rate += term
                size += abs(term)
            corner[2 * q + side] = w.direction * rate
            corner[8 + side] = max(corner[8 + side], size)
    m[i], m[j] = before_i, before_j
    iw.calls += 4
    return code


@kernel
def one_solution(corner: Vector) -> bool:
    """Whether minus the rates are a P-function of both signs: positive principal minors in each quadrant."""
    for q in range(4):
        odd, low = q & 1, q & 2
        # Derivatives by s_i at this s_j, and by s_j at this s_i.
        a_i = corner[2 * low] - corner[2 * low + 2]
        b_i = corner[2 * low + 1] - corner[2 * low + 3]
        a_j = corner[2 * odd] - corner[2 * odd + 4]
        b_j = corner[2 * odd + 1] - corner[2 * odd + 5]
        row_i, row_j = max(abs(a_i), abs(a_j)), max(abs(b_i), abs(b_j))
        if not (a_i > MINOR * row_i and b_j > MINOR * row_j):
            return False
        if not (a_i * b_j - a_j * b_i > MINOR * row_i * row_j):
            return False
    return True


@kernel
def turns_out(corner: Vector) -> bool:
    """Whether the fields rotate around the corner, and a cycle leads away from it.

    With h' constant in each quadrant a cycle maps a distance d from the corner to rho d; rho is the product
    of the four ratios of the rates. Beyond 1 the corner is left backwards along an infinite number of cycles.
    """
    # Each quadrant is left across one surface while the distance from the other grows, in either sense.
    for first in range(2):
        rho = 1.0
        for turn in range(4):
            # Quadrants in turn: ++, -+, --, +-.
            q = 3 - turn if turn < 2 else turn - 2
            side = (turn + first) & 1
            leaving, growing = corner[2 * q + side], corner[2 * q + 1 - side]
            leaving *= 1.0 if (q >> side) & 1 == 1 else -1.0
            growing *= 1.0 if (q >> (1 - side)) & 1 == 1 else -1.0
            rho = rho * growing / -leaving if leaving < 0.0 < growing else 0.0
        if rho > 1.0 + NEUTRAL:
            return True
    return False


@entry
@kernel
def corner_kind(
    t: float, x: Vector, p: Vector, m: Vector, i: int, j: int, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """The properties of the corner of surfaces i and j, as bits; 0 too where a rate is not finite."""
    if corner_rates(t, x, p, m, i, j, w, iw, ctx) != 0 or not finite(w.corner, 8):
        return 0
    return (ONE_SOLUTION if one_solution(w.corner) else 0) + (TURNS_OUT if turns_out(w.corner) else 0)


@kernel
def side_of(below: float, above: float, clear: float) -> int:
    """Where the rates below and above a surface lead: 1, -1, 0 along it, 2 where that is not clear."""
    if abs(below) > clear and abs(above) > clear:
        if below * above > 0.0:
            return 1 if above > 0.0 else -1
        return 0 if above < 0.0 else 2
    return 2


@kernel
def fits(side: int, sign: int, corner: Vector) -> int:
    """Whether a slide on one surface (0: i, 1: j) leaves the other to a side: 1, -1 for no, 0 for unclear."""
    other = 1 - side
    # The quadrants below and above the surface that is slid on.
    low = (1 if sign > 0 else 0) << other
    high = low + (1 << side)
    below, above = corner[2 * low + side], corner[2 * high + side]
    found = side_of(below, above, CLEAR_RATE * corner[8 + side])
    if found != 0:
        return 0 if found == 2 else -1
    rate = (below * corner[2 * high + other] - above * corner[2 * low + other]) / (below - above)
    if abs(rate) <= CLEAR_RATE * corner[8 + other]:
        return 0
    return 1 if rate * float(sign) > 0.0 else -1


@kernel
def quadrant_fits(q: int, corner: Vector) -> int:
    """Whether the field of a quadrant leads into it: 1, -1 for no, 0 where that is not clear."""
    answer = 1
    for side in range(2):
        outwards = corner[2 * q + side] * (1.0 if (q >> side) & 1 == 1 else -1.0)
        if outwards < -CLEAR_RATE * corner[8 + side]:
            return -1
        if outwards <= CLEAR_RATE * corner[8 + side]:
            answer = 0
    return answer


@kernel
def followed(corner: Vector) -> int:
    """The only mode that follows, 3 (s_i + 1) + s_j + 1; -1 where the rates do not say it clearly."""
    for side in range(2):
        # A surface that is passed in all quadrants.
        clear, other = CLEAR_RATE * corner[8 + side], 1 - side
        for sign in range(-1, 2, 2):
            least = 1e300
            for q in range(4):
                least = min(least, corner[2 * q + side] * float(sign))
            if least > clear:
                low = (1 if sign > 0 else 0) << side
                high = low + (1 << other)
                below, above = corner[2 * low + other], corner[2 * high + other]
                rest = side_of(below, above, CLEAR_RATE * corner[8 + other])
                if rest == 2:
                    return -1
                return 3 * (sign + 1) + rest + 1 if side == 0 else 3 * (rest + 1) + sign + 1
    if not one_solution(corner):
        return -1
    clear_of_all = True
    for q in range(4):
        answer = quadrant_fits(q, corner)
        if answer == 1:
            return 6 * (q & 1) + (q & 2)
        clear_of_all = clear_of_all and answer < 0
    for side in range(2):
        for sign in range(-1, 2, 2):
            answer = fits(side, sign, corner)
            if answer == 1:
                return 3 + sign + 1 if side == 0 else 3 * (sign + 1) + 1
            clear_of_all = clear_of_all and answer < 0
    return 4 if clear_of_all else -1
