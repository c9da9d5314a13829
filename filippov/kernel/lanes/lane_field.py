"""The field of a mode in lanes: every lane off all surfaces or sliding; see `field` for the formulas.

The lanes may be in different modes: the sliding surface of each is picked by masks, and lanes that do not
slide blend two equal fields. On several at once they slide only where no two surfaces of the system are
coupled. A lane without a multiplier gets NaN and is left to the plain loop.
"""

from filippov.kernel.language.primitives import NAN, Indices, Vector, contract, kernel, lanes, shift
from filippov.kernel.loop.gradients import add_gradient, gradient_product, rate
from filippov.kernel.loop.model import (
    AFFINE,
    COLOURS,
    LARGEST,
    OWNER,
    M,
    N,
    gradients,
    guards,
    pair,
    rhs,
)
from filippov.kernel.loop.state import Integers, Scratch


@lanes
def clear_ranges(w: Scratch, iw: Integers) -> None:
    """Forget the ranges of the multipliers before a new step."""
    if iw.sliding > 0:
        for i in range(M):
            mult = w.mult[i]
            mult.least, mult.most, mult.slope = 1e300, -1e300, -1e300


@lanes
def pick_gradient(m: Vector, w: Scratch) -> float:
    """Gradient of each lane's sliding surface into the scratch, 0 elsewhere; its square."""
    g = w.xm
    size = 0.0
    for j in range(N):
        picked = 0.0
        for i in range(M):
            picked = w.g[i * N + j] if m[i] == 0.0 else picked
        g[j] = picked
        size += picked * picked
    return size


@lanes
def track(i: int, w: Scratch, m: Vector, value: float, plus: float, minus: float) -> None:
    """Note the multiplier of surface i where lanes slide on it, with the rates that it comes from."""
    mult = w.mult[i]
    here = m[i] == 0.0
    mult.value = value if here else mult.value
    mult.rate_plus = plus if here else mult.rate_plus
    mult.rate_minus = minus if here else mult.rate_minus
    mult.least = min(mult.least, value) if here else mult.least
    mult.most = max(mult.most, value) if here else mult.most
    mult.slope = max(mult.slope, plus - minus) if here else mult.slope


@lanes
def multiplier(plus: float, minus: float, before: float) -> float:
    """The multiplier that holds a lane on a surface, NaN where none does."""
    value = -(plus + minus) / (plus - minus) if plus != minus else before
    # Where both rates are 0, as at rest on a two-fold, the plain loop decides what is rounding.
    held = abs(plus - minus) > 1e-9 * (abs(plus) + abs(minus))
    return value if held else NAN


@kernel
def uncoupled() -> int:
    """1 where each of several multipliers has its own equation, and no two signs act on one velocity."""
    return 1 if M > 1 and AFFINE and COLOURS == 1 and LARGEST == 1 else 0


@lanes
def vertex_fields(t: float, x: Vector, p: Vector, m: Vector, w: Scratch, ctx: Indices) -> None:
    """The gradients, and the fields with all sliding signs at the lower and at the upper end, in `vert`."""
    gradients(t, x, p, m, w.g, w.gt, ctx)
    for i in range(M):
        w.s[i] = -1.0 if m[i] == 0.0 else m[i]
        w.s2[i] = 1.0 if m[i] == 0.0 else m[i]
    pair(t, x, p, w.s, w.s2, m, w.vert, shift(w.vert, N), ctx)


@contract
@lanes
def slide_apart(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """Both fields with all sliding signs at one end of their sets, each velocity blended by its own sign."""
    low, high = w.vert, shift(w.vert, N)
    vertex_fields(t, x, p, m, w, ctx)
    for i in range(M):
        minus, plus = rate(i, low, w), rate(i, high, w)
        value = multiplier(plus, minus, w.mult[i].value)
        track(i, w, m, value, plus, minus)
        w.s[i] = 0.5 * (1.0 + value) if m[i] == 0.0 else 0.0
    for j in range(N):
        out[j] = low[j]
        if OWNER[j] >= 0:
            out[j] += w.s[OWNER[j]] * (high[j] - low[j])
    for i in range(M):
        w.s2[i] = rate(i, out, w)
    take_out(w.s2, m, out, w)
    return 0


@lanes
def take_out(off: Vector, m: Vector, out: Vector, w: Scratch) -> None:
    """Subtract from out, for every sliding surface, what changes its linearised guard by off[i]."""
    for i in range(M):
        size = gradient_product(i, i, w)
        add_gradient(i, -off[i] / size if m[i] == 0.0 and size > 0.0 else 0.0, out, w)


@contract
@lanes
def slide(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """Both vertex fields and their blend, without the rounding error across the surface."""
    g, low, high = w.xm, w.vert, shift(w.vert, N)
    vertex_fields(t, x, p, m, w, ctx)
    size = pick_gradient(m, w)
    drift, value, slides = 0.0, 0.0, 0.0
    for i in range(M):
        drift = w.gt[i] if m[i] == 0.0 else drift
        value = w.mult[i].value if m[i] == 0.0 else value
        slides = 1.0 if m[i] == 0.0 else slides
    minus, plus = drift, drift
    for j in range(N):
        minus += g[j] * low[j]
        plus += g[j] * high[j]
    value = multiplier(plus, minus, value)
    for i in range(M):
        track(i, w, m, value, plus, minus)
    weight = 0.5 * (1.0 + value) if slides > 0.0 else 0.0
    total = drift
    for j in range(N):
        out[j] = low[j] + weight * (high[j] - low[j])
        total += g[j] * out[j]
    total = total / size if size > 0.0 else 0.0
    for j in range(N):
        out[j] -= total * g[j]
    return 0


@lanes
def field(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """The field of each lane's mode; 0, as symbolic fields do not fail."""
    if iw.sliding > 0 and uncoupled() == 1:
        return slide_apart(t, x, p, m, out, w, iw, ctx)
    if iw.sliding > 0:
        return slide(t, x, p, m, out, w, iw, ctx)
    return rhs(t, x, p, m, m, out, ctx)


@lanes
def project(
    t: float, x: Vector, p: Vector, m: Vector, h: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """Put x back on each lane's sliding surfaces along their gradients: two Newton steps."""
    g = w.xm
    for _ in range(2):
        guards(t, x, p, m, h, ctx)
        gradients(t, x, p, m, w.g, w.gt, ctx)
        if uncoupled() == 1:
            take_out(h, m, x, w)
            continue
        size = pick_gradient(m, w)
        off = 0.0
        for i in range(M):
            off = h[i] if m[i] == 0.0 else off
        off = off / size if size > 0.0 else 0.0
        for j in range(N):
            x[j] -= off * g[j]
    return 0
