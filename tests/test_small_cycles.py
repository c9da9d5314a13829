"""Fixed points of the hunting map against slip integrated phase by phase in deviations from break-away.

At break-away u = P (x + D v + I z) is Fs; with z = Fs/(P I) + w the slip in (x, v, w) holds no Fs but in
g(v) - Fs, which expm1 gives without cancellation: coordinates of 1e-13 keep their relative accuracy.
"""

import itertools
import math
import os

import numba
import numpy as np
import numpy.typing as npt
import pytest
from scipy.optimize import brentq

from filippov.analysis.event_map import EventMap
from filippov.analysis.section import Section
from filippov.models import hunting

SECTION = Section("velocity", "sliding entry", "x", {"x": "d", "v": "0", "z": "(sign(d)*Fs/P - d)/I"})
NAMES = ("m", "P", "D", "I", "Fs", "Fc", "vs", "beta", "b")
DRAWS = {"nightly": 200}.get(os.environ.get("FILIPPOV_PROFILE", "default"), 6)

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


@numba.njit
def field(y: npt.NDArray[np.float64], p: npt.NDArray[np.float64], out: npt.NDArray[np.float64]) -> None:
    """Slip towards -v from the break-away at u = +Fs, w the deviation of z."""
    m, P, D, I, Fs, Fc, vs, beta, b = p
    x, v, w = y
    friction = (Fs - Fc) * math.expm1(-(max(-v, 0.0) / vs) ** beta)  # g(v) - Fs
    out[0], out[1], out[2] = v, (-P * (x + D * v + I * w) + friction - b * v) / m, x


@numba.njit
def slip(d: float, p: npt.NDArray[np.float64], rtol: float) -> npt.NDArray[np.float64]:
    """(x, v, w) where the velocity is 0 again, from break-away at x = d > 0."""
    y = np.array([d, 0.0, -d / p[3]])
    k, z = np.zeros((7, 3)), np.zeros(3)
    h, scale = 1e-4, np.array([d, d, d])
    for _ in range(200_000):
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
            scale[q] = max(scale[q], abs(z[q]))
            error = max(error, abs(e) / (rtol * max(abs(z[q]), 1e-3 * scale[q])))
        if error > 1.0:
            h *= max(0.2, 0.9 * error**-0.2)
            continue
        if z[1] >= 0.0 and y[1] < 0.0:
            # Newton in the step's length, to the root of v.
            if abs(z[1]) <= 1e-15 * scale[1] or h < 1e-15:
                return z
            h = h * y[1] / (y[1] - z[1])
            if h < 1e-13:
                return z
            continue
        y[:] = z
        h *= min(4.0, 0.9 * (error + 1e-12) ** -0.2)
    return np.full(3, np.nan)


def turn(d: float, p: npt.NDArray[np.float64]) -> float:
    """Next stick position, from a stick position d > 0; NaN where the mass does not stick at once."""
    _, P, _, I, Fs, *_ = p
    x, _, w = slip(d, p, 1e-11)
    u = P * (x + I * w) + Fs
    return x if -Fs <= u <= Fs else math.nan


def second_iterate_of(p: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Roots of |P(d)| = d on (1e-11, 0.5), on a logarithmic grid: P is odd and turns every slip round."""

    def gap(q: float) -> float:
        return -turn(math.exp(q), p) / math.exp(q) - 1.0

    grid = np.linspace(math.log(1e-11), math.log(0.5), 240)
    values = np.array([gap(q) for q in grid])
    pairs = [k for k in range(len(grid) - 1) if values[k] * values[k + 1] < 0]
    return np.array([math.exp(brentq(gap, grid[k], grid[k + 1], xtol=1e-13)) for k in pairs])


def law(seed: int) -> npt.NDArray[np.float64]:
    """Random parameters with beta in [1.08, 3] and a loop that hunts or not."""
    random = np.random.default_rng(seed)
    m, b = random.uniform(0.5, 2), random.uniform(0.2, 2)
    P, D, I = random.uniform(5, 30), random.uniform(0.5, 1.5), random.uniform(2, 12)
    Fs = random.uniform(1, 5)
    Fc, vs, beta = Fs * random.uniform(0.3, 0.95), random.uniform(0.03, 0.3), random.uniform(1.08, 3)
    return np.array([m, P, D, I, Fs, Fc, vs, beta, b])


@pytest.mark.parametrize("seed", range(DRAWS))
def test_no_cycle_is_missed_or_invented(seed: int) -> None:
    p = law(seed)
    expected = second_iterate_of(p)
    event_map = EventMap(hunting(), SECTION, parameters=dict(zip(NAMES, p, strict=True)), order=2)
    found = [q for q in event_map.fixed_points(0, 0.5) if q.kind == "limit cycle" and q.d > 1e-11]
    assert [q.d for q in found] == pytest.approx(expected, rel=1e-6), p
    # Neighbours differ in stability, the set at 0 among them.
    stable = [q.stable for q in event_map.fixed_points(0, 0.5)]
    assert all(a != b for a, b in itertools.pairwise(stable)), p


@pytest.mark.parametrize(("beta", "d"), [(1.3075, 2.332506917e-5), (1.2, 5.0666160e-7), (1.1, 9.0677e-12)])
def test_an_unstable_cycle_close_to_the_set(beta: float, d: float) -> None:
    p = np.array([1, 10, 1, 10, 4, 2, 0.1, beta, 1.0])
    ((smallest, *_),) = [second_iterate_of(p)] if beta > 1.15 else [[d]]
    event_map = EventMap(hunting(), SECTION, parameters={"beta": beta}, order=2)
    at_set, cycle, outer = event_map.fixed_points(0, 0.5)
    assert (at_set.stable, cycle.stable, outer.stable) == (True, False, True)
    assert cycle.d == pytest.approx(smallest, rel=1e-6 if beta > 1.15 else 1e-3)
    basins = event_map.basins(0, 0.5)
    assert [q.attractor for q in basins] == [0.0, outer.d]
