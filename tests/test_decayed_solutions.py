"""Piecewise linear fields, run on long after they have decayed below the tolerances."""

from __future__ import annotations

import os
from types import SimpleNamespace

import numpy as np
import pytest
from sympy import Abs

from filippov import Status, System, TimeEvent, exp, sign, solve, states, t
from filippov.solving.resets.rest import _nearly_still

NAMES = states("x y z")
DRAWS = 60 if os.environ.get("FILIPPOV_PROFILE") == "ci" else 6


def drawn(r: np.random.Generator, n: int) -> System:
    """x' = A x + b |c . x| with complex roots on both sides; |x| falls on both."""
    while True:
        a, b, c = (r.integers(-8, 9, size) / 4 for size in ((n, n), n, n))
        sides = [a + s * np.outer(b, c) for s in (1, -1)]
        falls = all(np.linalg.eigvalsh(side + side.T).max() < -0.2 for side in sides)
        if falls and c.any() and all(np.iscomplex(np.linalg.eigvals(side)).any() for side in sides):
            break
    x = NAMES[:n]
    kink = Abs(sum(v * q for v, q in zip(c, x, strict=True)))
    return System({x[i]: sum(a[i, j] * x[j] for j in range(n)) + b[i] * kink for i in range(n)})


@pytest.mark.parametrize("n", [2, 3])
@pytest.mark.parametrize("seed", range(DRAWS))
def test_what_has_decayed_goes_on(n: int, seed: int) -> None:
    """Steps long beside a turn had roots that led back to the kink, and "events do not leave the state"."""
    r = np.random.default_rng([n, seed])
    run = solve(drawn(r, n), r.normal(size=n), (0, 120))
    assert run.success, run.message
    assert np.max(np.abs(run.x_end)) < 1e-4
    assert {str(e.kind) for e in run.events if np.max(np.abs(e.x)) > 1e-6} <= {"crossing"}


@pytest.mark.parametrize("seed", range(DRAWS))
def test_what_has_decayed_under_switching_goes_on(seed: int) -> None:
    """x' = A x + B x sgn(c . x), |x| falls on both sides. Beyond rest a slide may repel, which is named."""
    r = np.random.default_rng([5, seed])
    while True:
        a, b, c = (r.integers(-8, 9, size) / 4 for size in ((2, 2), (2, 2), 2))
        if c.any() and all(np.linalg.eigvalsh(a + s * b + (a + s * b).T).max() < -0.2 for s in (1, -1)):
            break
    x = NAMES[:2]
    switch = sign(c[0] * x[0] + c[1] * x[1])
    rates = {x[i]: sum((a[i, j] + b[i, j] * switch) * x[j] for j in range(2)) for i in range(2)}
    run = solve(System(rates), r.normal(size=2), (0, 120), zeno="continue")
    assert run.status in (Status.SUCCESS, Status.NON_UNIQUE), run.message
    assert np.max(np.abs(run.x_end)) < 1e-4


@pytest.mark.parametrize("rate", [0.3, 0.5, 2.0])
def test_a_slide_that_decays_to_an_equilibrium_stays(rate: float) -> None:
    """x = exp(-rate t) on y = 0, which attracts for x > 0 alone: rounding led beyond 0, where it repels."""
    x, y, _ = NAMES
    run = solve(System({x: -rate * x, y: -y - sign(y) * x}), (1, 0.2), (0, 200))
    assert run.success, run.message
    assert run.end_mode == (0,)
    times = np.linspace(2, 200, 50)
    assert run.sol(times)[0] == pytest.approx(np.exp(-rate * times), abs=1e-8)
    grows = solve(System({x: 0.1 + 0 * x, y: y - sign(y) * x}), (-1, 0), (0, 20))
    assert grows.status is Status.NON_UNIQUE


@pytest.mark.parametrize("seed", range(4 * DRAWS))
def test_what_has_decayed_under_fields_that_attract_rests(seed: int) -> None:
    """Two stable linear fields switched on a plane through their centre: from the tolerances on it rests."""
    r = np.random.default_rng([7, seed])
    n, centre = 2 + seed % 2, r.normal(size=3) * (seed % 4 > 1)
    sides = []
    while len(sides) < 2:
        side = r.normal(size=(n, n)) - 1.5 * np.eye(n)
        sides += [side] if np.linalg.eigvals(side).real.max() < -0.3 else []
    half, rest, c = (sides[0] + sides[1]) / 2, (sides[0] - sides[1]) / 2, r.normal(size=n)
    x = [NAMES[i] - float(centre[i]) for i in range(n)]
    switch = sign(sum(float(c[i]) * x[i] for i in range(n)))
    rates = [sum((float(half[i, j]) + float(rest[i, j]) * switch) * x[j] for j in range(n)) for i in range(n)]
    run = solve(System(dict(zip(NAMES, rates, strict=False))), centre[:n] + r.normal(size=n), (0, 150))
    assert run.success, run.message
    left = np.max(np.abs(run.x_end - centre[:n]))
    assert left < 1e-8 or left > 1  # what switching makes grow


def test_what_leads_off_does_not_rest() -> None:
    """x and z spiral in, and y grows from below the tolerances."""
    x, y, z = NAMES
    run = solve(System({x: 3 * z - x, z: -3 * x - z - sign(x) * z, y: y / 10}), (1, 0, 1e-14), (0, 400))
    assert run.x_end[2] == pytest.approx(1e-14 * np.exp(40), rel=1e-6)


def test_a_pulse_that_is_to_come_is_waited_for() -> None:
    """What has decayed below the tolerances is moved again by a short pulse, and by a clock."""
    x, y, _ = NAMES
    swing = {x: 3 * y - x, y: -3 * x - y - sign(x) * y}
    pulse = {**swing, y: swing[y] + exp(-(((t - 150) / 2) ** 2))}
    run = solve(System(pulse), (1, 0), (0, 170), max_step=1)
    assert np.max(np.abs(run.sol(np.linspace(148, 152, 41)))) > 0.1
    kick = TimeEvent("kick", times=(100,), reset={x: 1, y: 0})
    kicked = solve(System(swing, time_events=[kick]), (1, 0), (0, 105))
    assert kicked.x_end == pytest.approx(solve(System(swing), (1, 0), (0, 5)).x_end, abs=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_a_field_that_vanishes_within_the_tolerance_is_always_looked_at(seed: int) -> None:
    """Fields A (x - c), with rows that cancel: c within the slack is found, one far away is not."""
    rng = np.random.default_rng(seed)
    for _ in range(100):
        n = int(rng.integers(1, 40))
        a = rng.choice([-1.0, 0.0, 1.0, 1e-6, 1e6], (n, n), p=[0.2, 0.4, 0.2, 0.1, 0.1]) - 3.0 * np.eye(n)
        x, slack = rng.normal(size=n), 10.0 ** rng.uniform(-12, -6, n)
        for far in (1.0, 1e6):
            centre = x - far * slack * rng.choice([-1.0, 1.0], n)
            machine = SimpleNamespace(rhs=lambda t, x, s, m, a=a, c=centre: a @ (x - c))
            run = SimpleNamespace(machine=machine, t=0.0, x=x)
            assert _nearly_still(run, np.zeros(0), slack) == (far == 1.0)
