"""What the general path asks of the compiled system: a mode's field, and its guards along a trial step."""

from filippov.kernel.language.primitives import Indices, Vector, kernel, shift
from filippov.kernel.loop.field import field, set_mode
from filippov.kernel.loop.locate import dense_output, sample
from filippov.kernel.loop.model import (
    STAGES,
    W_ATTRACT,
    W_G,
    W_GT,
    W_K,
    W_MULT,
    W_NODE,
    W_RADIUS,
    W_Y,
    M,
    N,
    extra_stages,
    gradients,
    radii,
    stages,
)
from filippov.kernel.tables.layout import COLUMNS, MULTIPLIER
from filippov.kernel.tables.root_tables import NODES


@kernel
def probe(
    t: float,
    step: float,
    x: Vector,
    m: Vector,
    p: Vector,
    lam: Vector,
    out: Vector,
    w: Vector,
    iw: Indices,
    ctx: Indices,
) -> int:
    """Guards (2 M rows each) at the Chebyshev points of a step of mode m, in out after its field.

    `lam` holds guesses of the multipliers and receives those at the start. Returns the code of `field`.
    """
    set_mode(m, iw)
    for i in range(M):
        w[W_MULT + i * COLUMNS + MULTIPLIER] = lam[i]
    code = gradients(t, x, p, m, shift(w, W_G), shift(w, W_GT), ctx)
    if code == 0:
        code = radii(t, x, p, shift(w, W_RADIUS), ctx)
    if code == 0:
        code = field(t, x, p, m, shift(w, W_K), w, iw, ctx)
    if code != 0:
        return code
    for j in range(N):
        out[j] = w[W_K + j]
    for i in range(M):
        lam[i] = w[W_MULT + i * COLUMNS + MULTIPLIER]
    if step == 0.0:
        return 0
    for i in range(M):
        w[W_ATTRACT + i] = 1.0 if step > 0.0 else -1.0
    y = shift(w, W_Y)
    code = stages(t, x, p, m, step, y, w, iw, ctx)
    if code == 0:
        code = field(t + step, y, p, m, shift(w, W_K + (STAGES - 1) * N), w, iw, ctx)
    if code == 0:
        code = extra_stages(t, x, p, m, step, w, iw, ctx)
    if code != 0:
        return code
    dense_output(x, step, w)
    code = sample(t, step, 0.0, 1.0, p, m, w, iw, ctx)
    for q in range(NODES * 2 * M):
        out[N + q] = w[W_NODE + q]
    return code
