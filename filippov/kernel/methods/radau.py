"""Radau IIA of order 5: the stages by simplified Newton iterations, its error estimate, its memory.

Z = step (A x I) F(x + Z) is solved for Z = (TO_Z x I) W (Hairer & Wanner 1996, section IV.8):

    (REAL/step - J) dW_1 = r_1,   ((PAIR - i SPIN)/step - J) (dW_2 + i dW_3) = r_2 + i r_3

J is the derivative of the mode's field, sliding included, by differences. It is kept from step to step while
the iteration converges fast, its LU factors while the step stays the same. The derivatives at the stages are
stored in w.k after the field at the start, so that dense output, event location and landing are those of
every method, and are followed by the field at the end of the step.

The iteration goes on to 3e-14 of the state, also where rtol is looser than 1e-9: the state at an event
depends on it. Where rounding ends it earlier, the accuracy of the tolerance is enough.
"""

from filippov.kernel.language.primitives import INF, NAN, Indices, Vector, kernel, shift, sqrt
from filippov.kernel.loop.model import M, N
from filippov.kernel.loop.state import Integers, Scratch
from filippov.kernel.methods.jacobian import (
    evaluate,
    factor_both,
    renew_jacobian,
    substitute_pair,
    substitute_real,
)
from filippov.kernel.tables.radau_tables import (
    A_INVERSE,
    BETWEEN,
    ERROR_Z,
    FAST,
    FROM_Z,
    GONE,
    MOST_ITERATIONS,
    NOT_CONVERGED,
    PAIR,
    REAL,
    SLOPE_Z,
    SPACING,
    SPIN,
    TO_W,
    TO_Z,
    UNDEFINED,
    VALUE_Z,
    C,
)


@kernel
def differences(one: Vector, other: Vector, n: int) -> int:
    """The number of entries, of n, in which two arrays differ."""
    total = 0
    for i in range(n):
        total += 1 if one[i] != other[i] else 0
    return total


@kernel
def guess(t: float, x: Vector, step: float, w: Scratch) -> None:
    """Z from the collocation polynomial of the accepted step that led to (t, x), 0 where there is none."""
    memory, z, past = w.memory, w.z, w.past
    for i in range(N):
        # The state has jumped.
        if abs(x[i] - w.reached[i]) > 1e3 * w.scale[i]:
            memory.last_step = 0.0
    if memory.last_step != 0.0 and abs(memory.last_end - t) <= 1e-9 * abs(memory.last_step):
        for q in range(3 * N):
            past[q] = z[q]
        memory.past_end, memory.past_step = t, memory.last_step
    memory.last_step = 0.0
    ratio = 0.0
    if memory.past_step != 0.0 and memory.past_end == t:
        ratio = step / memory.past_step
    for q in range(3):
        theta = 1.0 + ratio * C[q]
        for i in range(N):
            total = 0.0
            if 0.0 < ratio <= 8.0:
                total = -past[2 * N + i]
                for r in range(3):
                    weight = (FROM_Z[3 * r + 2] * theta + FROM_Z[3 * r + 1]) * theta + FROM_Z[3 * r]
                    total += weight * theta * past[r * N + i]
            z[q * N + i] = total


@kernel
def newton(
    t: float, x: Vector, p: Vector, m: Vector, step: float, fresh: bool, w: Scratch, iw: Integers,
    ctx: Indices,
) -> int:  # fmt: skip
    """Solve for Z from the guess in it: 0, a code of `field`, NOT_CONVERGED or UNDEFINED; stores its rate.

    Corrections by a Jacobian too steep for where the solution goes are small, and shrink no more: what is
    left is their geometric series. fresh: the Jacobian is that of the start of the step.
    """
    z, v, f, at = w.z, w.zw, w.diff, w.stage
    r1, r2, r3 = f, shift(f, N), shift(f, 2 * N)
    rtol = min(w.rtol, 1e-3)
    rounding = 10.0 * SPACING / rtol
    enough = max(rounding, min(0.03, sqrt(rtol)))
    tight = enough * min(1.0, 1e-9 / rtol)
    for q in range(3):
        for i in range(N):
            v[q * N + i] = TO_W[3 * q] * z[i] + TO_W[3 * q + 1] * z[N + i] + TO_W[3 * q + 2] * z[2 * N + i]
    last, rate = 0.0, 0.0
    for iteration in range(MOST_ITERATIONS):
        for q in range(3):
            for i in range(N):
                at[i] = x[i] + z[q * N + i]
            code = evaluate(t + C[q] * step, at, p, m, shift(f, q * N), w, iw, ctx)
            if code != 0:
                return code
        for i in range(N):
            f0, f1, f2 = f[i], f[N + i], f[2 * N + i]
            r1[i] = TO_W[0] * f0 + TO_W[1] * f1 + TO_W[2] * f2 - REAL / step * v[i]
            r2[i] = TO_W[3] * f0 + TO_W[4] * f1 + TO_W[5] * f2
            r2[i] -= (PAIR * v[N + i] + SPIN * v[2 * N + i]) / step
            r3[i] = TO_W[6] * f0 + TO_W[7] * f1 + TO_W[8] * f2
            r3[i] -= (PAIR * v[2 * N + i] - SPIN * v[N + i]) / step
        substitute_real(r1, w, iw)
        substitute_pair(r2, r3, w, iw)
        square = 0.0
        for q in range(3):
            for i in range(N):
                square += (f[q * N + i] / w.scale[i]) ** 2
                v[q * N + i] += f[q * N + i]
        for q in range(3):
            for i in range(N):
                z[q * N + i] = (
                    TO_Z[3 * q] * v[i] + TO_Z[3 * q + 1] * v[N + i] + TO_Z[3 * q + 2] * v[2 * N + i]
                )
        norm = sqrt(square / float(3 * N))
        if not (norm < 1e300):
            return UNDEFINED
        if norm == 0.0:
            return 0
        if iteration > 0:
            rate = norm / last
            if iteration == 1 or rate < 1.0:
                w.memory.rate = rate
            if rate >= 0.5 and norm <= rounding and fresh:
                return 0
            if rate >= 1.0:
                return NOT_CONVERGED
            left = norm * rate / (1.0 - rate)
            if left <= tight or (rate >= 0.5 and left <= enough):
                return 0
            ahead = float(MOST_ITERATIONS - 1 - iteration)
            if left * rate**ahead > enough:
                return NOT_CONVERGED
        last = norm
    return 0


@kernel
def filtered(error: Vector, step: float, w: Scratch, iw: Integers) -> float:
    """(REAL/step - J)^-1 error in place, and its mean square on the scale of the tolerance."""
    substitute_real(error, w, iw)
    square = 0.0
    for i in range(N):
        square += (error[i] / w.scale[i]) ** 2
        error[i] /= step
    return square


@kernel
def estimate(
    t: float, x: Vector, p: Vector, m: Vector, step: float, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """Error estimate of the step in w.error: that of its end or of the collocation polynomial inside.

    The end of a state that is fast beside the step is far more accurate than the polynomial, from which dense
    output and events are read. Its defect between the nodes, filtered as the estimate of the end is, is its
    error there for slow and for fast states. The estimate of the end is not filtered once more where it is
    large, as is done where only the end matters: that hides a transient shorter than the step.
    """
    z, error, f, at = w.z, w.error, w.diff, w.stage
    for i in range(N):
        at[i] = x[i] + (VALUE_Z[0] * z[i] + VALUE_Z[1] * z[N + i] + VALUE_Z[2] * z[2 * N + i])
    code = evaluate(t + BETWEEN * step, at, p, m, f, w, iw, ctx)
    if code != 0:
        return code
    for i in range(N):
        slope = SLOPE_Z[0] * z[i] + SLOPE_Z[1] * z[N + i] + SLOPE_Z[2] * z[2 * N + i]
        weighted = ERROR_Z[0] * z[i] + ERROR_Z[1] * z[N + i] + ERROR_Z[2] * z[2 * N + i]
        f[i] -= slope / step
        error[i] = w.k[i] + weighted / step
    if filtered(f, step, w, iw) > filtered(error, step, w, iw):
        for i in range(N):
            error[i] = f[i]
    return 0


@kernel
def still(
    t: float, x: Vector, p: Vector, m: Vector, step: float, y: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> bool:
    """Whether the constant x solves the stages; in a non-Lipschitz equilibrium no Jacobian would show it."""
    for i in range(N):
        if w.k[i] != 0.0:
            return False
    for q in range(3):
        at = shift(w.k, (q + 1) * N)
        if evaluate(t + C[q] * step, x, p, m, at, w, iw, ctx) != 0:
            return False
        for i in range(N):
            if at[i] != 0.0:
                return False
    for i in range(N):
        y[i], w.reached[i], w.error[i] = x[i], x[i], 0.0
    return True


@kernel
def stages(
    t: float, x: Vector, p: Vector, m: Vector, step: float, y: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """Derivatives at the three stages in w.k, the end in y; NOT_CONVERGED where Newton's iteration fails."""
    memory, z = w.memory, w.z
    if still(t, x, p, m, step, y, w, iw, ctx):
        memory.last_step, memory.past_step = 0.0, 0.0
        return 0
    if differences(w.jac_mode, m, M) > 0:
        iw.known = 0
        memory.last_step, memory.past_step = 0.0, 0.0
    rtol = min(w.rtol, 1e-3)
    for i in range(N):
        w.scale[i] = min(w.atol[i], 1e-3) + rtol * abs(x[i]) + 1e-300
    here = differences(w.jac_x, x, N) == 0
    if iw.known != 0 and not here and memory.rate > FAST:
        iw.known = 0
    code = NOT_CONVERGED
    for _ in range(2):
        if iw.known == 0:
            code = renew_jacobian(t, x, p, m, step, w, iw, ctx)
            if code != 0:
                return code
            here = True
        if memory.factored != step and not factor_both(step, w, iw):
            return NOT_CONVERGED
        guess(t, x, step, w)
        code = newton(t, x, p, m, step, here, w, iw, ctx)
        if code < NOT_CONVERGED or here:
            break
        iw.known = 0
    if code == UNDEFINED:
        for i in range(N):
            y[i], w.error[i] = NAN, NAN
        return 0
    if code != 0:
        return code
    memory.last_end, memory.last_step = t + step, step
    for q in range(3):
        for i in range(N):
            total = 0.0
            for r in range(3):
                total += A_INVERSE[3 * q + r] * z[r * N + i]
            w.k[(q + 1) * N + i] = total / step
    for i in range(N):
        y[i] = x[i] + z[2 * N + i]
        w.reached[i] = y[i]
    return estimate(t, x, p, m, step, w, iw, ctx)


@kernel
def unsolved(
    t: float, y: Vector, p: Vector, m: Vector, step: float, last_k: Vector, w: Scratch, iw: Integers,
    ctx: Indices,
) -> bool:  # fmt: skip
    """Whether the field at the end y of a step, last_k, is not that of its stages, by a stale Jacobian.

    Of a steep field the difference is that of a small error of y; it goes with a move of y as small. Where
    the field is no longer steep, corrections by the Jacobian of the start were small and led nowhere.
    """
    move, at, f = w.diff, w.stage, shift(w.diff, N)
    worst, most = -1, 1.0
    for i in range(N):
        move[i] = last_k[i] - w.k[3 * N + i]
        size = abs(step * move[i]) / w.scale[i]
        if size > most:
            worst, most = i, size
    if worst < 0 or not (most < INF):
        return False
    gap, largest = move[worst], 0.0
    substitute_real(move, w, iw)
    for i in range(N):
        largest = max(largest, abs(move[i]) / w.scale[i])
    if not (0.0 < largest < INF):
        return False
    for i in range(N):
        at[i] = y[i] + move[i] / largest
    if evaluate(t, at, p, m, f, w, iw, ctx) != 0:
        return False
    expected = (REAL / step * move[worst] - gap) / largest
    return float(abs(f[worst] - last_k[worst])) < GONE * float(abs(expected))


@kernel
def extra_stages(
    t: float, x: Vector, p: Vector, m: Vector, step: float, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """The collocation polynomial needs none."""
    return 0


@kernel
def error_terms(i: int, w: Scratch) -> tuple[float, float]:
    """The error estimate of component i, before the factor of the step."""
    return w.error[i], 0.0
