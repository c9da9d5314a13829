"""The hunting loop integrated phase by phase in deviations from break-away, with a search of its own.

At break-away u = P (x + D v + I z) is Fs; with r = x + I z - Fs/P the slip in (x, v, r) holds no Fs but in
g(v) - Fs, which expm1 gives without cancellation: coordinates of 1e-100 keep their relative accuracy. A slip
that is over while |u| > Fs goes on the other way, mirrored. For beta < 1 the slip leaves v = 0 where its
field is not Lipschitz: an error of its start is one of the start's time, so a start at 1e-13 s is exact.
"""

import math
from collections.abc import Callable

import numba
import numpy as np
import numpy.typing as npt
import scipy.linalg
from scipy.optimize import brentq, minimize_scalar

NAMES = ("m", "P", "D", "I", "Fs", "Fc", "vs", "beta", "b")
Array = npt.NDArray[np.float64]

# Dormand & Prince 1980: nodes are not needed, the field does not depend on time.
A = np.array(
    [
        [0, 0, 0, 0, 0, 0],
        [1 / 5, 0, 0, 0, 0, 0],
        [3 / 40, 9 / 40, 0, 0, 0, 0],
        [44 / 45, -56 / 15, 32 / 9, 0, 0, 0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0, 0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0],
        [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
E = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
T_MAX, FINE = 100.0, 1e-11


@numba.njit
def field(y: Array, p: Array, out: Array) -> None:
    """Slip towards -v from the break-away at u = +Fs."""
    m, P, D, I, Fs, Fc, vs, beta, b = p
    x, v, r = y
    friction = (Fs - Fc) * math.expm1(-((max(-v, 0.0) / vs) ** beta))  # g(v) - Fs
    out[0], out[1], out[2] = v, (-P * (r + D * v) + friction - b * v) / m, v + I * x


@numba.njit
def slip(y: Array, p: Array, rtol: float, h: float, t: float) -> float:
    """Integrate (x, v, r) in place to where the velocity is 0 again; the time, NaN beyond T_MAX."""
    k, z = np.zeros((7, 3)), np.zeros(3)
    scale = np.abs(y)
    for _ in range(20_000):
        if t > T_MAX or abs(y[0]) > 1e6:
            return np.nan
        for i in range(7):
            z[:] = y
            for j in range(i):
                z += h * A[i, j] * k[j]
            field(z, p, k[i])
        error = 0.0
        for q in range(3):
            e = 0.0
            for j in range(7):
                e += h * E[j] * k[j, q]
            most = max(scale[q], abs(z[q]))
            error = max(error, abs(e) / (rtol * max(abs(z[q]), 1e-3 * most)))
        if not error <= 1.0:
            h *= max(0.2, 0.9 * error**-0.2) if error < 1e300 else 0.2
            continue
        if z[1] >= 0.0:
            # Newton in the step's length, to the root of v.
            if z[1] <= 1e-15 * scale[1]:
                y[:] = z
                return t + h
            h = h * y[1] / (y[1] - z[1])
            if h < 1e-14 * t:
                return t  # the state before the step is at the root to rounding
            continue
        for q in range(3):
            scale[q] = max(scale[q], abs(z[q]))
        y[:] = z
        t += h
        h *= min(4.0, 0.9 * (error + 1e-12) ** -0.2)
    return np.nan


@numba.njit
def turn(d: float, p: Array, rtol: float) -> float:
    """The next stick position after the one at d, which may be negative; NaN where none comes in T_MAX."""
    m, P, _, I, Fs, Fc, vs, beta, _ = p
    if d == 0.0:
        return 0.0
    sign = 1.0 if d > 0 else -1.0
    d = abs(d)
    # The leading terms of the slip from rest: pushed by the integral, and by the falling friction itself.
    t0 = 1e-13
    speed = 0.5 * P * I * d / m * t0 * t0
    if beta < 1.0:
        fall = (Fs - Fc) / m * vs**-beta
        speed = max(speed, ((1.0 - beta) * fall * t0) ** (1.0 / (1.0 - beta)))
    y = np.array([d, -speed, I * d * t0])
    t = slip(y, p, rtol, t0, t0)
    for _ in range(200):
        if not t < T_MAX:
            return np.nan
        u = P * y[2]  # less Fs
        if u >= -2.0 * Fs:
            return sign * y[0]
        # The slip goes on the other way with |u| > Fs: mirrored, with the deviation from there.
        push = (-u - 2.0 * Fs) / m
        sign = -sign
        y[0], y[2] = -y[0], -y[2] - 2.0 * Fs / P
        h = 1e-13
        y[1] = -push * h
        t = slip(y, p, rtol, h, t + h)
    return np.nan


@numba.njit
def turns(d: Array, p: Array, rtol: float) -> Array:
    """`turn` of many."""
    out = np.empty(d.size)
    for k in range(d.size):
        out[k] = turn(d[k], p, rtol)
    return out


def twice(d: float, p: Array) -> float:
    """R(R(d))."""
    return float(turn(turn(d, p, FINE), p, FINE))


def cycles(p: Array, least: float = 1e-11, most: float = 0.5, points: int = 400) -> tuple[Array, Array]:
    """Fixed points of R(R(d)) between two coordinates, by sign changes and extrema over log d, and slopes."""
    q = np.linspace(math.log(least), math.log(most), points)
    d = np.exp(q)
    gap = turns(turns(d, p, 1e-9), p, 1e-9) / d - 1.0

    def rest(at: float) -> float:
        return twice(math.exp(at), p) / math.exp(at) - 1.0

    pairs = [(q[k], q[k + 1]) for k in range(points - 1) if gap[k] * gap[k + 1] < 0]
    for k in range(1, points - 1):
        side = np.sign(gap[k])
        near = side * gap[k - 1 : k + 2]
        if np.all(near > 0) and near[1] <= min(near[0], near[2]) and near[1] < 0.5:
            found = minimize_scalar(
                lambda at, side=side: side * rest(at), bounds=(q[k - 1], q[k + 1]), method="bounded",
                options={"xatol": 1e-10},
            )  # fmt: skip
            if found.fun < 0:
                pairs += [(q[k - 1], found.x), (found.x, q[k + 1])]
    out: list[tuple[float, float]] = []
    for a, b in pairs:
        at = brentq(rest, a, b, xtol=1e-15)
        # A change of sign across a jump of the map is no cycle: what is left does not shrink.
        if abs(rest(at)) < 1e-6:
            out.append((math.exp(at), 1.0 + _slope(rest, at)))
    out.sort()
    return np.array([row[0] for row in out]), np.array([row[1] for row in out])


def _slope(rest: Callable[[float], float], at: float) -> float:
    """Derivative by differences, closer where it is steep."""
    e, found = 1e-4, 0.0
    for _ in range(12):
        before, side = found, [rest(at + k * e) for k in (-2, -1, 1, 2)]
        found = (8 * (side[2] - side[1]) - (side[3] - side[0])) / (12 * e)
        if abs(found - before) < 1e-5 * abs(found):
            break
        e *= 0.2
    return found


def set_slope(p: Array) -> float:
    """Slope of R(R(d)) at 0 in closed form: matrix exponentials of the slip linearised beside the set."""
    m, P, D, I, Fs, Fc, vs, beta, b = p
    if beta < 1:
        return math.inf
    damping = b - ((Fs - Fc) / vs if beta == 1 else 0.0)
    matrix = np.array([[0, 1, 0], [-P / m, -(P * D + damping) / m, -P * I / m], [1, 0, 0]])
    start = np.array([1.0, 0.0, -1.0 / I])

    def state(t: float) -> Array:
        return np.asarray(scipy.linalg.expm(matrix * t) @ start)

    step = 0.02 / max(np.abs(np.linalg.eigvals(matrix)))
    t = step
    while state(t)[1] < 0:
        t += step
        if np.max(np.abs(state(t))) > 1e12:
            return math.inf  # it runs away without turning
        if t > T_MAX:
            return math.nan
    t = brentq(lambda q: state(q)[1], max(t - step, 0.5 * step), t, xtol=1e-15)
    return float(state(t)[0]) ** 2


def law(seed: int, low: float = 0.3, high: float = 3.0) -> Array:
    """Random parameters with beta in [low, high] and a loop that hunts or not."""
    random = np.random.default_rng(seed)
    m, b = random.uniform(0.5, 2), random.uniform(0.2, 2)
    P, D, I = random.uniform(5, 30), random.uniform(0.5, 1.5), random.uniform(2, 12)
    Fs = random.uniform(1, 5)
    Fc, vs, beta = Fs * random.uniform(0.3, 0.95), random.uniform(0.03, 0.3), random.uniform(low, high)
    beta = 1.0 if low < 1 and seed % 10 == 9 else beta
    return np.array([m, P, D, I, Fs, Fc, vs, beta, b])
