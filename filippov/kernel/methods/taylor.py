"""The stages of Taylor's method, in place of those written out from a tableau (see `series`)."""

from filippov.kernel.language.primitives import Indices, Vector, contract, kernel, sqrt
from filippov.kernel.loop.model import (
    JETS,
    ORDER,
    STAGES,
    STAND_IN,
    STAND_IN_STAGES,
    M,
    N,
    explicit_error_terms,
    explicit_extra_stages,
    explicit_stages,
    jets,
    series_end,
)
from filippov.kernel.loop.series import series_converges
from filippov.kernel.loop.state import Integers, Scratch
from filippov.kernel.methods.inside import look_inside


@kernel
def taken_here(t: float, x: Vector, m: Vector, w: Scratch) -> bool:
    """Whether the coefficients in the scratch are those at (t, x) in mode m."""
    origin = w.origin
    if origin.t != t:
        return False
    for j in range(N):
        if origin.x[j] != x[j]:
            return False
    for i in range(M):  # noqa: SIM110 - the kernel language has no `all`
        if origin.m[i] != m[i]:
            return False
    return True


@kernel
def take_jets(t: float, x: Vector, p: Vector, m: Vector, w: Scratch, iw: Integers) -> None:
    """The coefficients at (t, x), unless they are there already; notes whether there are any."""
    if taken_here(t, x, m, w):
        return
    origin = w.origin
    w.checked = 0.0
    for j in range(N):
        w.miss[j] = 0.0
    origin.t = t
    for j in range(N):
        origin.x[j] = x[j]
    for i in range(M):
        origin.m[i] = m[i]
    code = jets(t, x, p, m, w.jet_room, w.jet, iw)
    iw.calls += STAGES - 1
    # A coefficient that is not finite spoils all later orders.
    total, top = 0.0, (STAGES - 2) * JETS
    for a in range(JETS):
        total += w.jet[top + a] * 0.0
    w.explicit = 0.0 if code == 0 and total == 0.0 else 1.0


@contract
def stages(
    t: float, x: Vector, p: Vector, m: Vector, step: float, y: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """Coefficients of the field times powers of the step, and the polynomial's end in y."""
    take_jets(t, x, p, m, w, iw)
    if w.explicit != 0.0:
        for j in range(N):
            w.rk[j] = w.k[j]
        return explicit_stages(t, x, p, m, step, y, w, iw, ctx)
    series_end(step, x, w.jet, w.k, y, w.jet_end)
    # Where the series behind the field converge its end shows what their later terms come to.
    if abs(step) != w.checked and not series_converges(step, w):
        return look_inside(t, x, p, m, step, w, iw, ctx)
    return 0


@kernel
def extra_stages(
    t: float, x: Vector, p: Vector, m: Vector, step: float, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """None for a series; else the interpolant of DOP853 as the coefficients of one."""
    if w.explicit == 0.0:
        return 0
    for j in range(N):
        w.rk[(STAND_IN_STAGES - 4) * N + j] = w.k[(STAGES - 1) * N + j]
    code = explicit_extra_stages(t, x, p, m, step, w, iw, ctx)
    for k in range(1, STAGES - 1):
        for j in range(N):
            total = 0.0
            if k < 7:
                for r in range(STAND_IN_STAGES):
                    total += STAND_IN[8 * r + k + 1] * w.rk[r * N + j]
            w.k[k * N + j] = total * float(k + 1)
    return code


@kernel
def error_terms(i: int, w: Scratch) -> tuple[float, float]:
    """The next coefficient of component i: the field at the end less the rate of the polynomial there."""
    if w.explicit != 0.0:
        e5, e3 = explicit_error_terms(i, w)
        size = e5 * e5 + 0.01 * e3 * e3
        return (e5 * e5 / sqrt(size) if size > 0.0 else 0.0), 0.0
    miss = max(abs(w.k[(STAGES - 1) * N + i] - w.jet_end[i]), w.miss[i])
    return miss * (1.0 / float(ORDER)), 0.0
