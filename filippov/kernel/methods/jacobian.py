"""The Jacobian of a mode's field by differences, and Newton's matrices of an implicit method made of it.

Where every component of the field depends on few states, the states are put in an order in which the
matrices are bands (see `filippov.kernel.codegen.newton_band`). States of which no component feels two change
together (Curtis, Powell & Reid 1974), so that a Jacobian takes 2 BAND + 1 field calls, if none is repeated.
"""

from filippov.kernel.language.primitives import INF, NAN, Indices, Vector, kernel, shift
from filippov.kernel.loop.field import clear_ranges, field
from filippov.kernel.loop.model import BAND, IN_BAND, M, N, rhs
from filippov.kernel.loop.state import Integers, Scratch
from filippov.kernel.methods.band_lu import (
    factor_band,
    factor_band_complex,
    substitute_band,
    substitute_band_complex,
)
from filippov.kernel.methods.dense_lu import factor, factor_complex, substitute, substitute_complex
from filippov.kernel.tables.radau_tables import LEAST_CHANGE, PAIR, REAL, ROOT_SPACING, SPIN


@kernel
def evaluate(
    t: float, x: Vector, p: Vector, m: Vector, out: Vector, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """The field of the mode, counted."""
    if iw.sliding == 0:
        iw.calls += 1
        return rhs(t, x, p, m, m, out, ctx)
    return field(t, x, p, m, out, w, iw, ctx)


@kernel
def difference(
    t: float, x: Vector, p: Vector, m: Vector, j: int, delta: float, w: Scratch, iw: Integers, ctx: Indices
) -> tuple[int, float]:
    """Column j of J from a step delta: (code, largest change on the scale of the field, NaN if undefined)."""
    f0, f1, at = w.k, w.diff, w.stage
    at[j] = x[j] + delta
    width = at[j] - x[j]
    code = evaluate(t, at, p, m, f1, w, iw, ctx)
    at[j] = x[j]
    if code != 0:
        return code, NAN
    change, size, sound = 0.0, 0.0, 0.0
    for i in range(N):
        change = max(change, abs(f1[i] - f0[i]))
        size = max(size, abs(f1[i]), abs(f0[i]))
        sound += 0.0 * f1[i]
        w.jac[i * N + j] = (f1[i] - f0[i]) / width
    return 0, change / (size + 1e-300) + sound


@kernel
def first_delta(x: float, speed: float, scale: float) -> float:
    """The step of a difference: 1.5e-8 of a state, its change or tolerance, the way it goes."""
    delta = ROOT_SPACING * max(abs(x), abs(speed), scale, 1e-290)
    return -delta if speed < 0.0 else delta


@kernel
def dense_jacobian(
    t: float, x: Vector, p: Vector, m: Vector, step: float, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """J state by state."""
    for j in range(N):
        delta = first_delta(x[j], step * w.k[j], w.scale[j])
        for trial in range(4):
            code, change = difference(t, x, p, m, j, delta, w, iw, ctx)
            if code == 1:
                return code
            if code == 0 and change >= LEAST_CHANGE:
                break
            if code != 0 or not (change >= 0.0):
                delta = -delta
                if trial > 0:
                    for i in range(N):
                        w.jac[i * N + j] = 0.0
                    break
            else:
                delta *= 1e3
    return 0


@kernel
def band_column(k: int, code: int, width: float, size: float, w: Scratch) -> float:
    """The column at place k of the band from a difference; its largest change by size, NaN if undefined."""
    f0, f1, change, sound = w.k, w.diff, 0.0, 0.0
    for q in range(max(k - BAND, 0), min(k + BAND, N - 1) + 1):
        i, place = IN_BAND[q], q * (3 * BAND + 1) + k - q + BAND
        if code != 0:
            w.jac[place] = 0.0
            continue
        change = max(change, abs(f1[i] - f0[i]))
        sound += 0.0 * f1[i]
        w.jac[place] = (f1[i] - f0[i]) / width
    return NAN if code != 0 else change / (size + 1e-300) + sound


@kernel
def band_jacobian(
    t: float, x: Vector, p: Vector, m: Vector, step: float, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """J in its band: one difference for all states that no component of the field feels two of."""
    at, f0, f1, delta = w.stage, w.k, w.diff, w.in_band
    apart = 2 * BAND + 1
    for first in range(min(apart, N)):
        count = (N - 1 - first) // apart + 1
        for c in range(count):
            j = IN_BAND[first + c * apart]
            delta[j] = first_delta(x[j], step * w.k[j], w.scale[j])
        waiting = count
        for trial in range(4):
            if waiting == 0:
                break
            for c in range(count):
                j = IN_BAND[first + c * apart]
                at[j] = x[j] + delta[j]
            code, size = evaluate(t, at, p, m, f1, w, iw, ctx), 0.0
            if code == 1:
                return code
            for i in range(N):
                largest = max(abs(f1[i]), abs(f0[i]))
                size = largest if size < largest < INF else size
            waiting = 0
            for c in range(count):
                j = IN_BAND[first + c * apart]
                width = at[j] - x[j]
                at[j] = x[j]
                if delta[j] == 0.0:
                    continue
                change = band_column(first + c * apart, code, width, size, w)
                if change >= LEAST_CHANGE:
                    delta[j] = 0.0
                elif change >= 0.0:
                    delta[j] *= 1e3
                else:
                    delta[j] = -delta[j] if trial == 0 else 0.0
                    band_column(first + c * apart, 2, width, size, w)
                waiting += 1 if delta[j] != 0.0 else 0
    return 0


@kernel
def renew_jacobian(
    t: float, x: Vector, p: Vector, m: Vector, step: float, w: Scratch, iw: Integers, ctx: Indices
) -> int:
    """J at (t, x) by forward differences of 1.5e-8 of a state, its change or tolerance; larger where lost.

    A difference below 1e-12 of the field is repeated with a thousand times its step. Where the field is not
    defined ahead, the difference is taken backwards; where it is not defined there either, the column is 0.
    """
    for j in range(N):
        w.stage[j] = x[j]
    if BAND > 0:
        code = band_jacobian(t, x, p, m, step, w, iw, ctx)
    else:
        code = dense_jacobian(t, x, p, m, step, w, iw, ctx)
    if code != 0:
        return code
    for j in range(N):
        w.jac_x[j] = x[j]
    for i in range(M):
        w.jac_mode[i] = m[i]
    iw.jacobians += 1
    iw.known = 1
    w.memory.factored = 0.0
    clear_ranges(w, iw)
    return 0


@kernel
def factor_both(step: float, w: Scratch, iw: Integers) -> bool:
    """LU factors of the real and of the complex matrix at this step."""
    lu, re, im = w.lu, w.real, w.imag
    row = 3 * BAND + 1 if BAND > 0 else N
    for q in range(N * row):
        lu[q], re[q], im[q] = -w.jac[q], -w.jac[q], 0.0
    for i in range(N):
        place = i * row + (BAND if BAND > 0 else i)
        lu[place] += REAL / step
        re[place] += PAIR / step
        im[place] = -SPIN / step
    iw.factors += 2
    w.memory.factored = step
    if BAND > 0:
        sound = factor_band(lu, iw.pivots, N, BAND)
        return sound and factor_band_complex(re, im, iw.twins, N, BAND)
    if not factor(lu, iw.pivots, N):
        return False
    return factor_complex(re, im, iw.twins, N)


@kernel
def substitute_real(b: Vector, w: Scratch, iw: Integers) -> None:
    """(REAL/step - J)^-1 b, in place."""
    if BAND == 0:
        substitute(w.lu, iw.pivots, b, N)
        return
    for q in range(N):
        w.in_band[q] = b[IN_BAND[q]]
    substitute_band(w.lu, iw.pivots, w.in_band, N, BAND)
    for q in range(N):
        b[IN_BAND[q]] = w.in_band[q]


@kernel
def substitute_pair(b: Vector, c: Vector, w: Scratch, iw: Integers) -> None:
    """((PAIR - i SPIN)/step - J)^-1 (b + i c), in place."""
    if BAND == 0:
        substitute_complex(w.real, w.imag, iw.twins, b, c, N)
        return
    one, other = w.in_band, shift(w.in_band, N)
    for q in range(N):
        one[q], other[q] = b[IN_BAND[q]], c[IN_BAND[q]]
    substitute_band_complex(w.real, w.imag, iw.twins, one, other, N, BAND)
    for q in range(N):
        b[IN_BAND[q]], c[IN_BAND[q]] = one[q], other[q]
