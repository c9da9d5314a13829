"""For the classification: a mode's field, and its guards along a trial step."""

from filippov.kernel.language.primitives import Indices, Vector, entry, kernel, seldom, shift
from filippov.kernel.loop.field import field, set_mode
from filippov.kernel.loop.model import (
    STAGES,
    M,
    N,
    extra_stages,
    gradients,
    radii,
    stages,
)
from filippov.kernel.loop.roots.sampling import dense_output, sample
from filippov.kernel.loop.state import Integers, Scratch
from filippov.kernel.tables.root_tables import NODES


@seldom
@entry
@kernel
def probe(
    t: float,
    step: float,
    x: Vector,
    m: Vector,
    p: Vector,
    lam: Vector,
    out: Vector,
    w: Scratch,
    iw: Integers,
    ctx: Indices,
) -> int:
    """Guards (2 M rows each) at the Chebyshev points of a step of mode m, in out after its field.

    `lam` holds guesses of the multipliers and receives those at the start. Returns the code of `field`.
    """
    set_mode(m, iw)
    for i in range(M):
        w.mult[i].value = lam[i]
    code = gradients(t, x, p, m, w.g, w.gt, ctx)
    if code == 0:
        code = radii(t, x, p, w.radius, ctx)
    if code == 0:
        code = field(t, x, p, m, w.k, w, iw, ctx)
    if code != 0:
        return code
    for j in range(N):
        out[j] = w.k[j]
    for i in range(M):
        lam[i] = w.mult[i].value
    if step == 0.0:
        return 0
    for i in range(M):
        w.attract[i] = 1.0 if step > 0.0 else -1.0
    y = w.y
    code = stages(t, x, p, m, step, y, w, iw, ctx)
    if code == 0:
        code = field(t + step, y, p, m, shift(w.k, (STAGES - 1) * N), w, iw, ctx)
    if code == 0:
        code = extra_stages(t, x, p, m, step, w, iw, ctx)
    if code != 0:
        return code
    dense_output(x, step, w)
    code = sample(t, step, 0.0, 1.0, p, m, w, iw, ctx)
    for q in range(NODES * 2 * M):
        out[N + q] = w.node[q]
    return code
