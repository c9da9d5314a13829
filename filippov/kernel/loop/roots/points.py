"""Guards of a solution off all surfaces or sliding on one, at several points of a step side by side.

The points of a sample are independent, so a vector takes LANES of them at once. Only small symbolic fields
are sampled in this way (WIDE); `sampling.sample` is the plain form.
"""

from filippov.kernel.language.primitives import (
    Indices,
    Shared,
    Vector,
    anywhere,
    contract,
    kernel,
    lanes,
    shift,
)
from filippov.kernel.loop.model import (
    CONTACT,
    DEGREE_DENSE,
    G_COLUMN,
    G_FIRST,
    WIDTH,
    M,
    N,
    P,
    gradients,
    guards,
    pair,
    radii,
)
from filippov.kernel.loop.state import Scratch
from filippov.kernel.tables.layout import LANES

# Offsets in `wide`, in vectors: times, states, parameters, modes, rows of guards, and the rest.
X = 1


@contract
@lanes
def guards_beside(
    theta: Vector, t: float, step: float, coef: Shared, x: Vector, p: Vector, m: Vector, rows: Vector,
    ctx: Indices,
) -> None:  # fmt: skip
    """As `sampling.guard_rows` at the points theta of the dense output, where nothing slides: rows 0 to M."""
    u = theta[0]
    for i in range(N):
        value = coef[DEGREE_DENSE * N + i]
        for j in range(DEGREE_DENSE - 1, -1, -1):
            value = value * u + coef[j * N + i]
        x[i] = value
    guards(t + u * step, x, p, m, rows, ctx)
    for i in range(M):
        rows[i] = m[i] * rows[i] + WIDTH[i]


@contract
@lanes
def rows_beside(
    times: Vector, x: Vector, p: Vector, m: Vector, i: int, attract: float, rows: Vector, room: Vector,
    ctx: Indices,
) -> int:  # fmt: skip
    """As `sampling.guard_rows`, of the only sliding surface i; 1 where its sign acts on it nowhere."""
    t = times[0]
    s, s2, h, ends = room, shift(room, M), shift(room, 2 * M), shift(room, 3 * M)
    gt, g = shift(room, 5 * M), shift(room, 6 * M)
    low, high = shift(room, 6 * M + M * N), shift(room, 6 * M + M * N + N)
    guards(t, x, p, m, h, ctx)
    gradients(t, x, p, m, g, gt, ctx)
    radii(t, x, p, ends, ctx)
    for j in range(M):
        s[j] = -1.0 if j == i else m[j]
        s2[j] = 1.0 if j == i else m[j]
    pair(t, x, p, s, s2, m, low, high, ctx)
    minus, plus = gt[i], gt[i]
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        j = G_COLUMN[a]
        minus += g[i * N + j] * low[j]
        plus += g[i * N + j] * high[j]
    for j in range(M):
        rows[j] = m[j] * h[j] + WIDTH[j]
        rows[M + j] = 1.0
    lo, hi = ends[2 * i], ends[2 * i + 1]
    rows[i] = -0.5 * attract * ((1.0 + hi) * plus + (1.0 - hi) * minus)
    rows[M + i] = 0.5 * attract * ((1.0 + lo) * plus + (1.0 - lo) * minus)
    return 1 if anywhere(abs(plus - minus) < 1e-9 * (abs(plus) + abs(minus))) else 0


@contract
@lanes
def sliding_beside(
    t: float, x: Vector, p: Vector, m: Vector, i: int, known: float, out: Vector, room: Vector, ctx: Indices
) -> int:
    """As `field.slide_one` on surface i; known: its multiplier where its sign does nothing."""
    s, s2, gt, g = room, shift(room, M), shift(room, 2 * M), shift(room, 3 * M)
    low, high = shift(room, 3 * M + M * N), shift(room, 3 * M + M * N + N)
    gradients(t, x, p, m, g, gt, ctx)
    for j in range(M):
        s[j] = -1.0 if j == i else m[j]
        s2[j] = 1.0 if j == i else m[j]
    pair(t, x, p, s, s2, m, low, high, ctx)
    minus, plus, size = gt[i], gt[i], 0.0
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        j = G_COLUMN[a]
        minus += g[i * N + j] * low[j]
        plus += g[i * N + j] * high[j]
        size += g[i * N + j] * g[i * N + j]
    apart = plus - minus
    if CONTACT[i] == 0 and anywhere(abs(apart) < 1e-9 * (abs(plus) + abs(minus))):
        return 1
    value = known if apart == 0.0 else -(plus + minus) / apart
    weight, left = 0.5 * (1.0 + value), gt[i]
    for j in range(N):
        out[j] = low[j] + weight * (high[j] - low[j])
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        left += g[i * N + G_COLUMN[a]] * out[G_COLUMN[a]]
    left = left / size if size > 0.0 else 0.0
    for a in range(G_FIRST[i], G_FIRST[i + 1]):
        out[G_COLUMN[a]] -= left * g[i * N + G_COLUMN[a]]
    return 0


@kernel
def same_everywhere(n: int, source: Vector, target: Vector) -> None:
    """A vector of equal numbers for each number."""
    for i in range(n):
        for lane in range(LANES):
            target[i * LANES + lane] = source[i]


@kernel
def prepare_points(p: Vector, m: Vector, w: Scratch) -> None:
    """Fill in what is the same at all points of a step."""
    room = w.wide
    same_everywhere(P, p, shift(room, (X + N) * LANES))
    same_everywhere(M, m, shift(room, (X + N + P) * LANES))


@kernel
def place_point(lane: int, t: float, x: Vector, w: Scratch) -> None:
    """Put a point into its lane."""
    w.wide[lane] = t
    for j in range(N):
        w.wide[(X + j) * LANES + lane] = x[j]


@kernel
def point_rows(i: int, attract: float, w: Scratch, ctx: Indices) -> int:
    """The guards at the points in the lanes; see `rows_beside`."""
    room = w.wide
    p = shift(room, (X + N) * LANES)
    m = shift(p, P * LANES)
    rows = shift(m, M * LANES)
    return rows_beside(room, shift(room, X * LANES), p, m, i, attract, rows, shift(rows, 2 * M * LANES), ctx)


@kernel
def open_rows(t: float, step: float, w: Scratch, ctx: Indices) -> None:
    """The guards at the places theta in the lanes, where nothing slides; see `guards_beside`."""
    x = shift(w.wide, X * LANES)
    p = shift(x, N * LANES)
    m = shift(p, P * LANES)
    guards_beside(w.wide, t, step, w.coef, x, p, m, shift(m, M * LANES), ctx)


@kernel
def take_rows(lane: int, out: Vector, w: Scratch) -> None:
    """Copy the guards at one lane's point."""
    rows = shift(w.wide, (X + N + P + M) * LANES)
    for j in range(2 * M):
        out[j] = rows[j * LANES + lane]
