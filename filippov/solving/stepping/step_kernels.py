"""Steps of the theta scheme of `filippov.solving.stepping`, in the kernel language: see there for the scheme.

z_i is the set of surface i: +1 and -1 off it (its sign is the same), 0 where the step ends on it. Matrices
are flat, row by row; b is (N, M). Scratch is handed on from kernel to kernel, behind what the caller uses.
"""

from filippov.kernel.language.primitives import Indices, Vector, kernel, shift, shift_indices
from filippov.kernel.loop.model import (
    COLOUR,
    CONTACT,
    OWNER,
    ROLE,
    gradients,
    guards,
    radii,
    resets,
    rhs,
)
from filippov.kernel.methods.dense_lu import factor, substitute
from filippov.solving.stepping.box_kernels import complementarity

# What a step can end with, besides 0 and the codes of `complementarity` and of user code.
NO_CONVERGENCE, NOT_DEFINED = 12, 14
MOST_ITERATIONS, SLOW, SETTLED, ROUNDED, ON_SURFACE = 60, 0.05, 1e-13, 1e-9, 1e-13
SWITCHING = 0
# Numbers of states, surfaces and colours of signs: a table of the system, so that these kernels serve all.
SIZES: list[int] = [1, 1, 1]
# Places in the integers: how many surfaces are solved for, counters, then their list and the pivots.
K_ACTIVE, K_CALLS, K_JACOBIANS, K_FACTORS, K_KNOWN, K_ITERATIONS, K_LIST = 0, 1, 2, 3, 4, 5, 6


@kernel
def affine_parts(
    t: float, x: Vector, p: Vector, m: Vector, f: Vector, b: Vector, w: Vector, iw: Indices, ctx: Indices
) -> int:
    """x' = f + b s of the surfaces solved for, b an array (N, M); the other signs are those of m.

    Signs that share no component of the field are separated by one call: they have one colour.
    """
    n, surfaces = SIZES[0], SIZES[1]
    s, f1 = shift(w, 0), shift(w, surfaces)
    for i in range(surfaces):
        s[i] = m[i]
    for k in range(iw[K_ACTIVE]):
        s[iw[K_LIST + k]] = 1.0
    iw[K_CALLS] += 1
    code = rhs(t, x, p, s, m, f, ctx)
    if code != 0:
        return code
    for j in range(n * surfaces):
        b[j] = 0.0
    for c in range(SIZES[2]):
        flipped = 0
        for k in range(iw[K_ACTIVE]):
            i = iw[K_LIST + k]
            if COLOUR[i] == c:
                s[i] = -1.0
                flipped += 1
        if flipped == 0:
            continue
        iw[K_CALLS] += 1
        code = rhs(t, x, p, s, m, f1, ctx)
        if code != 0:
            return code
        for j in range(n):
            i = OWNER[c * n + j]
            if i >= 0 and s[i] == -1.0:
                b[j * surfaces + i] = 0.5 * (f[j] - f1[j])
        for k in range(iw[K_ACTIVE]):
            i = iw[K_LIST + k]
            if COLOUR[i] == c:
                s[i] = 1.0
    for k in range(iw[K_ACTIVE]):
        i = iw[K_LIST + k]
        for j in range(n):
            f[j] -= b[j * surfaces + i]
    return 0


@kernel
def velocity(
    t: float, x: Vector, p: Vector, m: Vector, s: Vector, out: Vector, b: Vector, w: Vector, iw: Indices,
    ctx: Indices,
) -> int:  # fmt: skip
    """f + b s."""
    n, surfaces = SIZES[0], SIZES[1]
    code = affine_parts(t, x, p, m, out, b, w, iw, ctx)
    for k in range(iw[K_ACTIVE]):
        i = iw[K_LIST + k]
        for j in range(n):
            out[j] += b[j * surfaces + i] * s[i]
    return code


@kernel
def factor_step(
    t: float, x: Vector, p: Vector, m: Vector, s: Vector, weight: float, scale: Vector, lu: Vector, w: Vector,
    iw: Indices, ctx: Indices,
) -> int:  # fmt: skip
    """LU factors of 1 - weight J, J the derivative of the field at held signs, by differences."""
    n, surfaces = SIZES[0], SIZES[1]
    f0, f1, at, b = shift(w, 0), shift(w, n), shift(w, 2 * n), shift(w, 3 * n)
    inner = shift(w, 3 * n + n * surfaces)
    code = velocity(t, x, p, m, s, f0, b, inner, iw, ctx)
    if code != 0:
        return code
    for j in range(n):
        at[j] = x[j]
    for j in range(n):
        at[j] = x[j] + 1.5e-8 * max(scale[j], abs(x[j]), 1e-12)
        width = at[j] - x[j]
        code = velocity(t, at, p, m, s, f1, b, inner, iw, ctx)
        if code != 0:
            return code
        at[j] = x[j]
        for i in range(n):
            slope = (f1[i] - f0[i]) / width
            lu[i * n + j] = (1.0 if i == j else 0.0) - weight * slope
    iw[K_JACOBIANS] += 1
    iw[K_FACTORS] += 1
    if not factor(lu, shift_indices(iw, K_LIST + surfaces), n):
        return NO_CONVERGENCE
    return 0


@kernel
def take_part(
    t: float, step: float, x: Vector, p: Vector, z: Vector, m: Vector, target: Vector, w: Vector, iw: Indices,
    ctx: Indices,
) -> int:  # fmt: skip
    """The surfaces to be solved for, the mode m at the start, and of contacts dh/dt after their impacts.

    A contact takes part where its rate closes it within half a step (Acary & Brogliato 2008, section 10.1).
    """
    surfaces = SIZES[1]
    gap, rates, after = shift(w, 0), shift(w, surfaces), shift(w, 2 * surfaces)
    rested, landed = shift(w, 3 * surfaces), shift(w, 4 * surfaces)
    for i in range(surfaces):
        m[i] = float(CONTACT[i]) if CONTACT[i] != 0 else z[i]
        rested[i] = 0.0 if CONTACT[i] != 0 else m[i]
    code = guards(t, x, p, m, gap, ctx)
    for i in range(surfaces):
        if CONTACT[i] == 0 and ROLE[i] != SWITCHING:
            m[i] = 1.0 if gap[i] > 0.0 else -1.0
            rested[i] = m[i]
    code += guards(t, x, p, m, gap, ctx) + guards(t, x, p, rested, rates, ctx)
    impacts = 0
    for i in range(surfaces):
        target[i] = 0.0
        side = float(CONTACT[i])
        if side != 0.0 and side * (gap[i] + 0.5 * step * rates[i]) <= 0.0 and side * rates[i] < 0.0:
            code += resets(i, t, x, p, m, landed, ctx) + guards(t, landed, p, rested, after, ctx)
            target[i] = after[i]
            impacts += 1 if side * after[i] > 0.0 else 0
    iw[K_ACTIVE] = 0
    for i in range(surfaces):
        takes = ROLE[i] == SWITCHING
        if CONTACT[i] != 0:
            side = float(CONTACT[i])
            takes = side * (gap[i] + 0.5 * step * rates[i]) <= 0.0
            # Held to it, what separates would be thrown by the impact of another contact and gain energy.
            if impacts > 0 and side * rates[i] > 0.0:
                takes = False
        if takes:
            iw[K_LIST + iw[K_ACTIVE]] = i
            iw[K_ACTIVE] += 1
    for k in range(iw[K_ACTIVE]):
        i = iw[K_LIST + k]
        if CONTACT[i] != 0:
            m[i] = 0.0
    return code


@kernel
def linearise(
    step: float, theta: float, start: Vector, columns: Vector, x: Vector, f: Vector, b: Vector, h: Vector,
    g: Vector, target: Vector, d: Vector, c: Vector, q: Vector, a: Vector, lu: Vector, iw: Indices,
) -> None:  # fmt: skip
    """The change of the state d + c s that solves the linearised step, and the guards q + a s after it.

    start: x + (1 - theta) step f of the start, columns: (1 - theta) step b of it.
    """
    n, surfaces = SIZES[0], SIZES[1]
    count, pivots = iw[K_ACTIVE], shift_indices(iw, K_LIST + surfaces)
    for j in range(n):
        d[j] = start[j] + theta * step * f[j] - x[j]
    substitute(lu, pivots, d, n)
    for k in range(count):
        i = iw[K_LIST + k]
        column = shift(c, k * n)
        for j in range(n):
            column[j] = columns[j * surfaces + i] + theta * step * b[j * surfaces + i]
        substitute(lu, pivots, column, n)
    for k in range(count):
        i = iw[K_LIST + k]
        total = h[i] - target[i]
        for j in range(n):
            total += g[i * n + j] * d[j]
        q[k] = total
        for r in range(count):
            total = 0.0
            for j in range(n):
                total += g[i * n + j] * c[r * n + j]
            a[k * count + r] = total


@kernel
def step_once(
    t: float, step: float, theta: float, x: Vector, z: Vector, s: Vector, p: Vector, scale: Vector,
    lu: Vector, impacts: Vector, w: Vector, iw: Indices, ctx: Indices,
) -> int:  # fmt: skip
    """One step, in place of x, z and s; impacts: which contacts had an impact in it."""
    n, surfaces = SIZES[0], SIZES[1]
    end = t + step
    m, target, low, high = shift(w, 0), shift(w, surfaces), shift(w, 2 * surfaces), shift(w, 3 * surfaces)
    q, small = shift(w, 4 * surfaces), shift(w, 5 * surfaces)
    own, sets = shift(w, 6 * surfaces), shift(w, 7 * surfaces)
    h, gt, ends = shift(w, 8 * surfaces), shift(w, 9 * surfaces), shift(w, 10 * surfaces)
    at = shift(w, 12 * surfaces)
    start, f, d = shift(at, n), shift(at, 2 * n), shift(at, 3 * n)
    columns = shift(at, 4 * n)
    b, c, g = shift(columns, n * surfaces), shift(columns, 2 * n * surfaces), shift(columns, 3 * n * surfaces)
    a = shift(columns, 4 * n * surfaces)
    inner = shift(a, surfaces * surfaces)
    code = take_part(t, step, x, p, z, m, target, inner, iw, ctx)
    if code == 0:
        code = affine_parts(t, x, p, m, f, columns, inner, iw, ctx)
    if code != 0:
        return code
    count, rest = iw[K_ACTIVE], (1.0 - theta) * step
    for j in range(n):
        start[j] = x[j] + rest * f[j]
        at[j] = x[j]
    for j in range(n * surfaces):
        columns[j] *= rest
    for k in range(count):
        i = iw[K_LIST + k]
        # A contact that closes is taken for closed first; one at rest stays what it is.
        sets[k] = z[i] if CONTACT[i] == 0 else 0.0
        own[k] = s[i]
    before = 1e300
    for trial in range(MOST_ITERATIONS):
        iw[K_ITERATIONS] += 1
        code = guards(end, at, p, m, h, ctx)
        changed = 0
        for i in range(surfaces):
            if CONTACT[i] == 0 and ROLE[i] != SWITCHING:
                side = 1.0 if h[i] > 0.0 else -1.0
                changed += 1 if side != m[i] else 0
                m[i] = side
        if changed > 0:
            code += guards(end, at, p, m, h, ctx)
        if code == 0:
            code = affine_parts(end, at, p, m, f, b, inner, iw, ctx)
        if code == 0:
            code = gradients(end, at, p, m, g, gt, ctx) + radii(end, at, p, ends, ctx)
        if code != 0:
            return code
        if iw[K_KNOWN] == 0:
            code = factor_step(end, at, p, m, s, theta * step, scale, lu, inner, iw, ctx)
            if code != 0:
                return code
            iw[K_KNOWN] = 1
        linearise(step, theta, start, columns, at, f, b, h, g, target, d, c, q, a, lu, iw)
        for k in range(count):
            i = iw[K_LIST + k]
            low[k], high[k] = ends[2 * i], ends[2 * i + 1]
            size = 0.0
            for j in range(n):
                size += abs(g[i * n + j]) * scale[j]
            small[k] = ON_SURFACE * size
        places = shift_indices(iw, K_LIST + surfaces + n)
        code = complementarity(q, a, low, high, small, own, sets, count, inner, places)
        if code != 0:
            return code
        size = 0.0
        for j in range(n):
            change, parts = d[j], abs(d[j])
            for k in range(count):
                change += c[k * n + j] * own[k]
                parts += abs(c[k * n + j] * own[k])
            at[j] += change
            # What a sign holds back is lost in the rounding of both.
            size = max(size, abs(change) / max(scale[j], abs(at[j]), 0.1 * parts, 1e-290))
            if not (abs(at[j]) < 1e300):
                return NOT_DEFINED
        same = changed == 0
        for k in range(count):
            i = iw[K_LIST + k]
            s[i] = own[k]
            if ROLE[i] == SWITCHING and m[i] != sets[k]:
                m[i] = sets[k]
                same = False
        if same and (size <= SETTLED or (size <= ROUNDED and size > 0.3 * before)):
            return finish(x, z, s, m, at, sets, target, scale, impacts, iw)
        if trial > 0 and size > SLOW * before:
            iw[K_KNOWN] = 0
        before = size
    return NO_CONVERGENCE


@kernel
def finish(
    x: Vector, z: Vector, s: Vector, m: Vector, at: Vector, sets: Vector, target: Vector, scale: Vector,
    impacts: Vector, iw: Indices,
) -> int:  # fmt: skip
    """Take over the state at the end of a step, its sets and signs."""
    n, surfaces = SIZES[0], SIZES[1]
    for i in range(surfaces):
        impacts[i] = 0.0
        if CONTACT[i] != 0:
            z[i] = float(CONTACT[i])
        elif ROLE[i] != SWITCHING:
            z[i] = m[i]
        else:
            continue
        s[i] = s[i] if m[i] == 0.0 else z[i]
    for k in range(iw[K_ACTIVE]):
        i = iw[K_LIST + k]
        z[i] = sets[k]
        if CONTACT[i] != 0 and sets[k] == 0.0 and float(CONTACT[i]) * target[i] > 0.0:
            impacts[i], z[i], s[i] = 1.0, float(CONTACT[i]), float(CONTACT[i])
    for j in range(n):
        x[j] = at[j]
        scale[j] = max(scale[j], abs(at[j]))
    return 0


@kernel
def march(
    first: int, last: int, t0: float, step: float, theta: float, x: Vector, z: Vector, s: Vector, p: Vector,
    scale: Vector, lu: Vector, states: Vector, modes: Vector, signs: Vector, impacts: Vector, w: Vector,
    iw: Indices, ctx: Indices,
) -> int:  # fmt: skip
    """Steps first to last - 1 of equal length, a row each; how many were done is put behind the lists."""
    n, surfaces = SIZES[0], SIZES[1]
    done = K_LIST + 3 * surfaces + n
    iw[done] = 0
    for number in range(first, last):
        row, t = number - first, t0 + float(number) * step
        code = step_once(
            t, step, theta, x, z, s, p, scale, lu, shift(impacts, row * surfaces), w, iw, ctx
        )  # fmt: skip
        if code != 0:
            return code
        for j in range(n):
            states[row * n + j] = x[j]
        for i in range(surfaces):
            modes[row * surfaces + i] = z[i]
            signs[row * surfaces + i] = s[i]
        iw[done] = row + 1
    return 0
