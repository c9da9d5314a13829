"""The error of a series against the field inside a step, at several points side by side.

A finite, or apparently finite, series does not show a steep change or a peak of the field ahead, and far from
a peak its terms are all below the tolerance: the step is sampled as densely as by an explicit method.
"""

from filippov.kernel.language.primitives import (
    INF,
    Indices,
    Shared,
    Vector,
    contract,
    inline,
    kernel,
    lanes,
    shift,
)
from filippov.kernel.loop.field import field, only_sliding
from filippov.kernel.loop.model import (
    AFFINE,
    PER_POWER,
    RULE,
    STAGES,
    VECTORS,
    WIDE,
    M,
    N,
    P,
    rhs,
)
from filippov.kernel.loop.roots.points import X, prepare_points, sliding_beside
from filippov.kernel.loop.rules import UTKIN
from filippov.kernel.loop.state import Integers, Scratch
from filippov.kernel.tables.layout import LANES, LOOKS, MOST_LOOKS


@contract
@lanes
def polynomial_beside(theta: Vector, x: Shared, k: Shared, step: float, at: Vector, rates: Vector) -> None:
    """The polynomial and its rate at the points theta of the step."""
    u = theta[0]
    for j in range(N):
        place, rate = 0.0, 0.0
        for a in range(STAGES - 2, -1, -1):
            place = place * u + k[a * N + j] * PER_POWER[a]
            rate = rate * u + k[a * N + j]
        at[j] = x[j] + u * step * place
        rates[j] = rate


@contract
@lanes
def field_beside(
    theta: Vector, t: float, step: float, x: Vector, p: Vector, m: Vector, surface: int, known: float,
    out: Vector, room: Vector, ctx: Indices,
) -> int:  # fmt: skip
    """The field at the points, off all surfaces (-1) or sliding on one."""
    here = t + theta[0] * step
    if surface >= 0:
        return sliding_beside(here, x, p, m, surface, known, out, room, ctx)
    rhs(here, x, p, m, m, out, ctx)
    return 0


@inline
@kernel
def note_miss(j: int, found: float, rate: float, w: Scratch) -> None:
    """Note the largest error; one that is not finite counts as infinite."""
    gap = abs(found - rate)
    w.miss[j] = max(w.miss[j], min(INF, gap))


@inline
@kernel
def place_at(j: int, theta: float, x: Vector, step: float, w: Scratch) -> float:
    """Component j of the polynomial at a part theta of the step; of every lane too."""
    place = 0.0
    for a in range(STAGES - 2, -1, -1):
        place = place * theta + w.k[a * N + j] * PER_POWER[a]
    return float(x[j] + theta * step * place)


@inline
@kernel
def rate_at(j: int, theta: float, w: Scratch) -> float:
    """Component j of its rate there."""
    rate = 0.0
    for a in range(STAGES - 2, -1, -1):
        rate = rate * theta + w.k[a * N + j]
    return rate


@kernel
def look_beside(
    t: float, x: Vector, p: Vector, m: Vector, step: float, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """As `look_inside`, field and polynomial in lanes; for small systems (WIDE)."""
    at, rates, found = w.inside, shift(w.inside, N * LANES), shift(w.inside, 2 * N * LANES)
    polynomial_beside(LOOKS, x, w.k, step, at, rates)
    prepare_points(p, m, w)
    place_p = shift(w.wide, (X + N) * LANES)
    place_m = shift(place_p, P * LANES)
    room, surface, known = shift(place_m, M * LANES), -1, 0.0
    if iw.sliding > 0:
        surface = only_sliding(iw)
        known = w.mult[surface].value
    iw.calls += (2 if iw.sliding > 0 else 1) * LANES
    if field_beside(LOOKS, t, step, at, place_p, place_m, surface, known, found, room, ctx) != 0:
        return 2
    for j in range(N):
        for lane in range(LANES):
            note_miss(j, found[j * LANES + lane], rates[j * LANES + lane], w)
    return 0


@kernel
def look_in_turn(
    t: float, x: Vector, p: Vector, m: Vector, step: float, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """As `look_inside`, the polynomial in lanes, the field at one point after the other."""
    at, rates = w.inside, shift(w.inside, N * LANES)
    polynomial_beside(LOOKS, x, w.k, step, at, rates)
    for lane in range(LANES):
        for j in range(N):
            w.stage[j] = at[j * LANES + lane]
        code = field(t + LOOKS[lane] * step, w.stage, p, m, w.f, w, iw, ctx)
        if code != 0:
            return code
        for j in range(N):
            note_miss(j, w.f[j], rates[j * LANES + lane], w)
    return 0


@kernel
def look_inside(
    t: float, x: Vector, p: Vector, m: Vector, step: float, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """Compare field and polynomial inside a step."""
    w.checked = abs(step)
    for j in range(N):
        w.miss[j] = 0.0
    if WIDE:  # noqa: SIM102 - told apart when the unit is made
        if iw.sliding == 0 or (iw.sliding == 1 and (AFFINE or RULE != UTKIN)):
            return look_beside(t, x, p, m, step, w, iw, ctx)
    if VECTORS > 1:
        return look_in_turn(t, x, p, m, step, w, iw, ctx)
    at, f = w.stage, w.f
    for q in range(MOST_LOOKS):
        theta = LOOKS[q]
        for j in range(N):
            at[j] = place_at(j, theta, x, step, w)
        code = field(t + theta * step, at, p, m, f, w, iw, ctx)
        if code != 0:
            return code
        for j in range(N):
            note_miss(j, f[j], rate_at(j, theta, w), w)
    return 0
