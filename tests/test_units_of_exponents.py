"""Lyapunov exponents in any units, over any interval, against the eigenvalues of linear maps and fields."""

from __future__ import annotations

import os

import numpy as np
import pytest
from scipy.linalg import expm

from filippov import System, TimeEvent, sign, states
from filippov.analysis import lyapunov

DRAWS = 300 if os.environ.get("FILIPPOV_PROFILE") == "nightly" else 10


@pytest.mark.parametrize("seed", range(DRAWS))
def test_exponents_of_a_clock_do_not_depend_on_units_and_interval(seed: int) -> None:
    """x' = A x, and R x + c at each tick: the logarithms of the eigenvalues of R exp(A T)."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    xs = list(states(" ".join("abc"[:n]) + ("," if n == 1 else "")))
    A, R, c = rng.normal(size=(n, n)).round(2), rng.normal(size=(n, n)).round(2), rng.normal(size=n).round(2)
    A = np.diag(np.diag(A)) if rng.random() < 0.3 else A
    R = np.diag(rng.choice([0.5, -0.7, 0.0, 2.0], n)) if rng.random() < 0.3 else R
    fast = float(rng.choice([0.0, 30.0]))
    A = A - fast * np.diag(np.arange(n) == n - 1)
    time, sizes = float(10 ** rng.uniform(-6, 6)), 10 ** rng.uniform(-6, 6, n)
    with np.errstate(divide="ignore"):
        exact = np.sort(np.log(np.abs(np.linalg.eigvals(R @ expm(A)))))[::-1]
    ratio = sizes[:, None] / sizes
    field, reset = (ratio * A / time) @ xs, (ratio * R) @ xs + sizes * c
    system = System(
        dict(zip(xs, field, strict=True)),
        time_events=[TimeEvent("tick", period=time, reset=dict(zip(xs, reset, strict=True)))],
    )
    found = lyapunov(
        system, tuple(sizes * rng.normal(size=n)), 150 * time, t0=0.37 * time,
        interval=float(rng.choice([1.0, 0.7, 3.0, 10.0])) * time,
    )  # fmt: skip
    assert found.message == ""
    lost = exact < -30.0 - fast
    assert np.array_equal(found.exponents == -np.inf, lost)
    # A pair of eigenvalues turns its directions, whose growth returns to its mean after a turn.
    assert np.allclose((found.exponents * time)[~lost], exact[~lost], rtol=0, atol=0.08)
    assert np.sum((found.exponents * time)[~lost]) == pytest.approx(np.sum(exact[~lost]), abs=0.08)


@pytest.mark.parametrize("interval", [0.1, 1.0, 5.0])
def test_fast_directions_are_not_lost(interval: float) -> None:
    x, y, z = states("x y z")
    chain = System({x: -x, y: -100 * y + x, z: -40 * z + y})
    found = lyapunov(chain, (1, 1, 1), 50, interval=interval)
    assert np.allclose(found.exponents, (-1, -40, -100), rtol=0, atol=1e-6)
    # The relay slides on x = 0 with s = y/2: y' = -y/4. One direction is lost in sliding, and no other.
    relay = System({x: -sign(x) + 0.5 * y, y: -0.3 * y + 0.1 * sign(x), z: -50 * z})
    for number in (3, 2):
        slid = lyapunov(relay, (0.1, 0.1, 1), 50, interval=interval, number=number)
        assert np.allclose(slid.exponents, (-0.25, -50.0, -np.inf)[:number], rtol=0, atol=1e-6)
