"""The woodpecker toy and the converter with dead time against the laws they are made of, set up anew here."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.integrate import quad

from filippov import models, solve, states

Array = npt.NDArray[np.float64]
approx = pytest.approx

# Glocker 1995: mass of the bird on arms of 10 and 15 mm, friction 0.3 at beak, lower and upper edge.
MASS = np.diag([3e-4, 5e-9, 7e-7]) + 4.5e-3 * np.outer([1, 0.01, 0.015], [1, 0.01, 0.015])
NORMAL = {"beak": [0, 0, -0.02], "lower": [0, 0.0058, 0], "upper": [0, -0.0058, 0]}
TANGENT = {"beak": [1, 0.01, 0.015 - 0.0201], "lower": [1, 0.0031, 0], "upper": [1, 0.0031, 0]}
GAP = {"beak": 0.0024, "lower": 0.0006, "upper": 0.0006}


def coulomb(normal: float, tangent: float, slip: float, scale: float) -> None:
    """Normal >= 0, |tangent| <= 0.3 normal, and against the slip where there is any."""
    assert normal > -1e-7 * scale
    assert abs(tangent) <= 0.3 * normal + 1e-7 * scale
    if abs(slip) > 1e-6:
        assert tangent == approx(-0.3 * normal * np.sign(slip), abs=1e-6 * scale)


def test_16_6_woodpecker_obeys_newton_and_coulomb() -> None:
    model = models.get("woodpecker")
    (b,) = states("b")
    run = solve(model.build(), model.x0, (0, 1), rtol=1e-10, atol=1e-13, events=[b + 0.2788])
    assert run.success, run.message
    hits = run.events.of(kind="reset")
    assert {event.surface for event in hits} == {"beak", "lower", "upper", "release"}
    for event in hits:
        before, after = event.x[3:6], event.x_after[3:6]
        if event.surface == "release":  # it moves nothing, but an impact may that comes with it
            assert np.array_equal(before, after) or [e.group for e in hits].count(event.group) == 2
            continue
        n, q = np.array(NORMAL[event.surface]), np.array(TANGENT[event.surface])
        impulse, *_ = np.linalg.lstsq(np.stack([n, q], axis=1), MASS @ (after - before), rcond=None)
        assert np.stack([n, q], axis=1) @ impulse == approx(MASS @ (after - before), abs=1e-12)
        restitution = 0.5 if event.surface == "beak" else 0
        assert n @ after == approx(-restitution * (n @ before), abs=1e-9)
        coulomb(*impulse, q @ after, scale=float(np.abs(impulse).max()))
    for segment in run.segments:
        for time in np.linspace(segment.t0, segment.t1, 9)[1:-1]:
            check_forces(run, time, 1e-5 * (segment.t1 - segment.t0))
    # Leine, Van Campen, Glocker: on the orbit vy, vb = (-0.3411, -7.4583) as the bird comes down to -0.2788.
    returns = [event for event in run.events.of(kind="user event") if event.x[5] < 0]
    assert returns[-1].x[[3, 5]] == approx([-0.3411, -7.4583], rel=6e-3)
    # Moreau's time stepping with dt = 1e-5 has a period of 0.146 s.
    assert np.diff([event.t for event in returns])[-3:] == approx(0.146, abs=2e-4)


def check_forces(run: Any, time: float, dt: float) -> None:
    """What M q'' leaves over is the contact's, and no gap is closed further."""
    x = run.sol(time)
    q, v, jam = x[:3], x[3:6], round(x[6])
    rate = (run.sol(time + dt) - run.sol(time - dt))[3:6] / (2 * dt)
    spring = 5.6e-3 * (q[2] - q[1])
    pull = np.array([-9.81 * 4.8e-3, spring - 9.81 * 4.5e-5, -spring - 9.81 * 4.5e-3 * 0.015])
    rest = MASS @ rate - pull
    for name, gap in GAP.items():
        assert gap + np.array(NORMAL[name]) @ q > -1e-12
    if jam == 0:
        assert rest == approx(np.zeros(3), abs=1e-6)
        return
    name = "lower" if jam < 0 else "upper"
    W = np.stack([NORMAL[name], TANGENT[name]], axis=1)
    force, *_ = np.linalg.lstsq(W, rest, rcond=None)
    assert W @ force == approx(rest, abs=1e-6)
    coulomb(force[0], force[1], W[:, 1] @ v, scale=1)


def test_16_6_dead_time_lowers_the_mean_output() -> None:
    """In a period the inductor's mean voltage is 0: v = duty Vin - (Vin + 2 Vd) dead/T where i > 0."""
    model = models.get("buck_dead_time")
    heavy = solve(model.build(), model.x0, (0, 3e-3), parameters={"R": 1.0}, rtol=1e-10)
    assert heavy.success, heavy.message
    assert heavy.segments[-1].mode == (1,)
    ticks = [2.99e-3 + k for k in (0, 0.8e-6, 5e-6, 5.8e-6, 1e-5)]
    area = sum(quad(lambda t: heavy.sol(t)[1], a, b)[0] for a, b in pairwise(ticks))
    assert area / 1e-5 == approx(6 - 13.4 * 0.08, abs=1e-6)


def test_16_6_the_current_waits_at_0_until_a_switch_closes() -> None:
    model = models.get("buck_dead_time")
    run = solve(model.build(), model.x0, model.t_span)
    wait = [segment for segment in run.segments if segment.mode == (0,)]
    assert [segment.t1 for segment in wait] == approx([8e-7 + 1e-5 * k for k in range(4)], rel=1e-12)
    for segment in wait:
        middle = (segment.t0 + segment.t1) / 2
        current, voltage, leg = run.sol(middle)
        assert current == leg == 0
        assert -0.7 < voltage < 12.7
        # s makes the inductor's voltage 0: 6 - 6.7 s = v.
        assert run.multiplier("current", middle) == approx((6 - voltage) / 6.7, rel=1e-9)
        decay = np.exp(-(segment.t1 - segment.t0) / (5 * 1e-4))
        assert run.sol(segment.t1)[1] == approx(run.sol(segment.t0)[1] * decay, rel=1e-9)
