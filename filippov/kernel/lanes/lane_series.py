"""Taylor's method in lanes: coefficients, step, stages and error of several trajectories; see `series`.

Steps end where the series behind the field still converge well, so that their ends show what the later terms
come to: the inside of a step is looked at only where a series says nothing of what is ahead.
"""

from filippov.kernel.language.primitives import (
    Indices,
    Vector,
    anywhere,
    from_bits,
    inline,
    lanes,
    shift,
    to_bits,
    truncate,
)
from filippov.kernel.loop.control import ONE_BITS
from filippov.kernel.loop.field import field
from filippov.kernel.loop.model import (
    DECAYING,
    JETS,
    LAST,
    ORDER,
    STAGES,
    TAILS,
    WIDTH,
    M,
    N,
    series_end,
)
from filippov.kernel.loop.series import (
    CONVERGES,
    GROWTH,
    INVISIBLE,
    LEAST_PART,
    SERIES_MISS,
    exponent,
    exponent_at,
    terms_growth,
)
from filippov.kernel.loop.state import Integers, Scratch
from filippov.kernel.methods.inside import note_miss, place_at, rate_at
from filippov.kernel.tables.layout import LOOKS, MOST_LOOKS

# Beside CONVERGES: the root by which a step is cut is known to some percent.
CUT = 0.8
# Enough for any length above 0.
HALVINGS = 2100


@inline
@lanes
def root_of_inverse(value: float, order: int) -> float:
    """value**(-1/order) to some percent; see `series.root_of_inverse`."""
    return from_bits(ONE_BITS - truncate(float(to_bits(value) - ONE_BITS) * (1.0 / float(order))))


@lanes
def last_growth(row: int, length: float, w: Scratch) -> float:
    """The last terms of a series relative to as many before; see `series.last_growth`."""
    growth = terms_growth(row, length, w)
    if row < DECAYING and anywhere(w.jet_room[exponent_at(row)] < INVISIBLE):
        growth = 0.0 if exponent(row, length, w) < INVISIBLE else growth
    return growth


@lanes
def before_visible(row: int, length: float, w: Scratch) -> float:
    """A step before which an exponential that cannot be seen from its start becomes one that can."""
    hidden = w.jet_room[exponent_at(row)] < 2.0 * INVISIBLE
    for _ in range(HALVINGS):
        reaches = hidden and exponent(row, length, w) >= INVISIBLE
        if not anywhere(reaches):
            return length
        length *= 0.5 if reaches else 1.0
    return length


@lanes
def series_length(x: Vector, rtol: float, atol: Vector, before: float, w: Scratch) -> float:
    """A step by the coefficients; see `series.series_step`."""
    last, earlier = 0.0, 0.0
    top, under = (STAGES - 2) * JETS, (STAGES - 3) * JETS
    for j in range(N):
        scale = 1.0 / (atol[j] + rtol * abs(x[j]) + 1e-300)
        last = max(last, abs(w.jet[top + j]) * scale)
        earlier = max(earlier, abs(w.jet[under + j]) * scale)
    length = GROWTH * before
    by_last = root_of_inverse(last * (1.0 / float(STAGES - 1)), STAGES - 1)
    by_earlier = root_of_inverse(earlier * (1.0 / float(STAGES - 2)), STAGES - 2)
    length = min(length, by_last if last > 0.0 else 1e300)
    length = min(length, by_earlier if earlier > 0.0 else 1e300)
    for row in range(TAILS):
        if row < DECAYING and anywhere(w.jet_room[exponent_at(row)] < 2.0 * INVISIBLE):
            length = before_visible(row, length, w)
        for _ in range(2):
            growth = last_growth(row, length, w)
            far = growth > CONVERGES and growth < 1e300
            cut = root_of_inverse(growth * (1.0 / (CUT * CONVERGES)), LAST) if far else 1.0
            length = max(length * cut, min(length, LEAST_PART * before))
    return length


@lanes
def look_inside(
    t: float, x: Vector, p: Vector, m: Vector, step: float, w: Scratch, iw: Integers, ctx: Indices
) -> None:
    """By how much the polynomial misses the field inside the step; see `inside.look_inside`."""
    for q in range(MOST_LOOKS):
        theta = LOOKS[q]
        for j in range(N):
            w.stage[j] = place_at(j, theta, x, step, w)
        field(t + theta * step, w.stage, p, m, w.f, w, iw, ctx)
        for j in range(N):
            note_miss(j, w.f[j], rate_at(j, theta, w), w)


@lanes
def series_stages(
    t: float, x: Vector, p: Vector, m: Vector, step: float, y: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> None:
    """The polynomial's end in y; where its series do not converge, its errors inside."""
    series_end(step, x, w.jet, w.k, y, w.jet_end)
    unsure = 0.0
    for row in range(TAILS):
        unsure = unsure if last_growth(row, abs(step), w) <= CONVERGES else 1.0
    for j in range(N):
        w.miss[j] = 0.0
    w.checked = 0.0
    if anywhere(unsure > 0.0):
        look_inside(t, x, p, m, step, w, iw, ctx)
        for j in range(N):
            w.miss[j] = w.miss[j] if unsure > 0.0 else 0.0
        w.checked = abs(step) if unsure > 0.0 else 0.0


@lanes
def series_error(x: Vector, y: Vector, step: float, rtol: float, atol: Vector, w: Scratch) -> float:
    """The square of the error's norm, from the next coefficient of every state; see `control.error_norm`."""
    last_k, square = shift(w.k, (STAGES - 1) * N), 0.0
    for i in range(N):
        miss = max(abs(last_k[i] - w.jet_end[i]), w.miss[i]) * (1.0 / float(ORDER))
        square += (miss / (atol[i] + rtol * max(abs(x[i]), abs(y[i])))) ** 2
    return step * step * square / float(N)


@lanes
def series_may_vanish(step: float, m: Vector, order: Vector, w: Scratch, iw: Integers) -> bool:
    """Where a guard may have vanished in the step; see `series.series_clear`."""
    doubt = 0.0
    for row in range(2 * M if iw.sliding > 0 else M):
        i = row if row < M else row - M
        off = m[i] != 0.0
        side, width = (m[i] if off else w.attract[i]), (WIDTH[i] if off else 0.0)
        total, rest, factor, size, first = width, 0.0, 1.0, 0.0, 0.0
        for k in range(STAGES - 1):
            term = side * w.jet[k * JETS + N + row] * factor
            total += term
            size += abs(term)
            first = term if order[i] == float(k) else first
            rest += abs(term) if order[i] < float(k) else 0.0
            factor *= step
        first += width if order[i] == 0.0 else 0.0
        slack = w.touch[i] if off and order[i] == 0.0 else 0.0
        clear = first > rest + slack and order[i] >= 0.0 and (off or order[i] == 0.0)
        same = abs(total - (side * w.end[2 * i] + width)) <= SERIES_MISS * (size + width)
        clear = clear and (same or not off)
        doubt = doubt if clear or (off and row >= M) else 1.0
    return doubt > 0.0
