"""The field of a mode in lanes: every lane off all surfaces or sliding on one; see `field` for the formulas.

The lanes may be in different modes: the sliding surface of each is picked by masks, and lanes that do not
slide blend two equal fields. A lane without a multiplier gets NaN and is left to the plain loop.
"""

from filippov.kernel.language.primitives import NAN, Indices, Vector, contract, lanes, shift
from filippov.kernel.loop.model import (
    I_SLIDING,
    W_G,
    W_GT,
    W_MULT,
    W_S,
    W_S2,
    W_VERT,
    W_XM,
    M,
    N,
    gradients,
    guards,
    pair,
    rhs,
)
from filippov.kernel.tables.layout import COLUMNS, LEAST, MOST, MULTIPLIER, RATE_MINUS, RATE_PLUS, SLOPE


@lanes
def clear_ranges(w: Vector, iw: Indices) -> None:
    """Forget the ranges of the multipliers before a new step."""
    if iw[I_SLIDING] > 0:
        for i in range(M):
            mult = shift(w, W_MULT + i * COLUMNS)
            mult[LEAST], mult[MOST], mult[SLOPE] = 1e300, -1e300, -1e300


@lanes
def pick_gradient(m: Vector, w: Vector) -> float:
    """Gradient of each lane's sliding surface into the scratch, 0 elsewhere; its square."""
    g = shift(w, W_XM)
    size = 0.0
    for j in range(N):
        picked = 0.0
        for i in range(M):
            picked = w[W_G + i * N + j] if m[i] == 0.0 else picked
        g[j] = picked
        size += picked * picked
    return size


@lanes
def track(w: Vector, m: Vector, value: float, plus: float, minus: float) -> None:
    """Note the multipliers of the sliding lanes with the rates they come from."""
    for i in range(M):
        mult = shift(w, W_MULT + i * COLUMNS)
        here = m[i] == 0.0
        mult[MULTIPLIER] = value if here else mult[MULTIPLIER]
        mult[RATE_PLUS] = plus if here else mult[RATE_PLUS]
        mult[RATE_MINUS] = minus if here else mult[RATE_MINUS]
        mult[LEAST] = min(mult[LEAST], value) if here else mult[LEAST]
        mult[MOST] = max(mult[MOST], value) if here else mult[MOST]
        mult[SLOPE] = max(mult[SLOPE], plus - minus) if here else mult[SLOPE]


@contract
@lanes
def slide(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """Both vertex fields and their blend, with what rounding left across the surface taken out."""
    g, low, high = shift(w, W_XM), shift(w, W_VERT), shift(w, W_VERT + N)
    gradients(t, x, p, m, shift(w, W_G), shift(w, W_GT), ctx)
    for i in range(M):
        w[W_S + i] = -1.0 if m[i] == 0.0 else m[i]
        w[W_S2 + i] = 1.0 if m[i] == 0.0 else m[i]
    pair(t, x, p, shift(w, W_S), shift(w, W_S2), m, low, high, ctx)
    size = pick_gradient(m, w)
    drift, value, slides = 0.0, 0.0, 0.0
    for i in range(M):
        drift = w[W_GT + i] if m[i] == 0.0 else drift
        value = w[W_MULT + i * COLUMNS + MULTIPLIER] if m[i] == 0.0 else value
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
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """The field of each lane's mode; 0, as symbolic fields do not fail."""
    if iw[I_SLIDING] > 0:
        return slide(t, x, p, m, out, w, iw, ctx)
    return rhs(t, x, p, m, m, out, ctx)


@lanes
def project(
    t: float, x: Vector, p: Vector, m: Vector, h: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """Put x back on each lane's sliding surface along its gradient: two Newton steps."""
    g = shift(w, W_XM)
    for _ in range(2):
        guards(t, x, p, m, h, ctx)
        gradients(t, x, p, m, shift(w, W_G), shift(w, W_GT), ctx)
        size = pick_gradient(m, w)
        off = 0.0
        for i in range(M):
            off = h[i] if m[i] == 0.0 else off
        off = off / size if size > 0.0 else 0.0
        for j in range(N):
            x[j] -= off * g[j]
    return 0
