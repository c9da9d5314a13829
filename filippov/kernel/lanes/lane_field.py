"""The field of a mode in lanes: every lane off all surfaces or sliding on one; see `field` for the formulas.

The lanes may be in different modes: the sliding surface of each is picked by masks, and lanes that do not
slide blend two equal fields. A lane without a multiplier gets NaN and is left to the plain loop.
"""

from filippov.kernel.language.primitives import NAN, Indices, Vector, contract, lanes, shift
from filippov.kernel.loop.model import (
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
def track(w: Scratch, m: Vector, value: float, plus: float, minus: float) -> None:
    """Note the multipliers of the sliding lanes with the rates they come from."""
    for i in range(M):
        mult = w.mult[i]
        here = m[i] == 0.0
        mult.value = value if here else mult.value
        mult.rate_plus = plus if here else mult.rate_plus
        mult.rate_minus = minus if here else mult.rate_minus
        mult.least = min(mult.least, value) if here else mult.least
        mult.most = max(mult.most, value) if here else mult.most
        mult.slope = max(mult.slope, plus - minus) if here else mult.slope


@contract
@lanes
def slide(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """Both vertex fields and their blend, with what rounding left across the surface taken out."""
    g, low, high = w.xm, w.vert, shift(w.vert, N)
    gradients(t, x, p, m, w.g, w.gt, ctx)
    for i in range(M):
        w.s[i] = -1.0 if m[i] == 0.0 else m[i]
        w.s2[i] = 1.0 if m[i] == 0.0 else m[i]
    pair(t, x, p, w.s, w.s2, m, low, high, ctx)
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
    value = -(plus + minus) / (plus - minus) if plus != minus else value
    # Where both rates are 0, as at rest on a two-fold, the plain form decides what is rounding.
    held = abs(plus - minus) > 1e-9 * (abs(plus) + abs(minus))
    value = value if held else NAN
    track(w, m, value, plus, minus)
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
    if iw.sliding > 0:
        return slide(t, x, p, m, out, w, iw, ctx)
    return rhs(t, x, p, m, m, out, ctx)


@lanes
def project(
    t: float, x: Vector, p: Vector, m: Vector, h: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """Put x back on each lane's sliding surface along its gradient: two Newton steps."""
    g = w.xm
    for _ in range(2):
        guards(t, x, p, m, h, ctx)
        gradients(t, x, p, m, w.g, w.gt, ctx)
        size = pick_gradient(m, w)
        off = 0.0
        for i in range(M):
            off = h[i] if m[i] == 0.0 else off
        off = off / size if size > 0.0 else 0.0
        for j in range(N):
            x[j] -= off * g[j]
    return 0
