"""Followers that rest on a cam for a part of each turn, after impacts that accumulate, run on in pieces."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from filippov import Surface, System, cos, sin, solve, states, t
from filippov.analysis import attractors, find_section

X, V, C, S = states("x v c s")


def cam_and_follower(w: float, e: float) -> System:
    """x'' = -1 above x = c, (c, s) on a limit cycle of radius 1 and frequency w, restitution e."""
    growth = 1 - C * C - S * S
    dc, ds = growth * C - w * S, growth * S + w * C
    cam = Surface("cam", X - C, reset={V: -e * V + (1 + e) * dc}, side="+")
    return System({X: V, V: -1 + 0 * X, C: dc, S: ds}, surfaces=[cam])


def leaves(w: float) -> float:
    """Phase w t in (-pi/2, 0) at which the cam falls away: (cos w t)'' = -1."""
    return -math.acos(1 / w**2)


def lands(w: float) -> float:
    """Phase at which the flight from there is back on the cam."""
    a = leaves(w)

    def gap(b: float) -> float:
        flight = (b - a) / w
        return math.cos(a) - w * math.sin(a) * flight - flight**2 / 2 - math.cos(b)

    return float(brentq(gap, a + 0.05, a + 2 * math.pi))


@pytest.mark.parametrize("seed", range(3))
def test_a_solution_in_contact_goes_on_from_its_end(seed: int) -> None:
    """The gradients of x = c and of its rate are not orthogonal: x was off by 1e-11, and fell through."""
    r = np.random.default_rng([1, seed])
    w = r.uniform(1.02, 1.06)
    system = cam_and_follower(w, r.uniform(0.1, 0.4))
    x = np.array([2.0, 0.0, 1.0, 0.0])
    for length in r.uniform(0.3, 0.7, 60):
        x = solve(system, x, (0, length), rtol=1e-8, zeno="continue").x_end
        assert x[0] > x[2] - 1e-9
    in_contact = -2 * math.pi + lands(w) + 1.0
    c, s = math.cos(in_contact), math.sin(in_contact)
    run = solve(system, (c, -w * s, c, s), (0, 2 * math.pi / w), zeno="continue")
    exits = [e for e in run.events if e.kind == "sliding exit"]
    assert exits[0].t == pytest.approx((leaves(w) - in_contact) / w, abs=1e-6)


@pytest.mark.parametrize("w", [1.03, 1.05])
def test_a_cycle_on_which_impacts_accumulate_is_an_attractor(w: float) -> None:
    """It was called aperiodic: Newton's method has no derivative, and what repeats was not asked."""
    cam = Surface("cam", X - cos(w * t), reset={V: -0.4 * V - 1.4 * w * sin(w * t)}, side="+")
    got = attractors(System({X: V, V: -1 + 0 * X}, surfaces=[cam]), {"x": (1.1, 3), "v": (-1, 1)}, samples=8)
    (one,) = got.attractors
    assert (one.kind, one.period, one.duration) == ("periodic", 1, pytest.approx(2 * math.pi / w))
    assert np.all(got.label == 0)
    # At t = 0 it is in flight since it left the cam.
    a, flight = leaves(w), -leaves(w) / w
    wanted = [math.cos(a) - w * math.sin(a) * flight - flight**2 / 2, -w * math.sin(a) - flight]
    assert one.states[0] == pytest.approx(wanted, abs=1e-6)
    assert "impacts accumulate" in one.note


def test_the_same_of_an_autonomous_system() -> None:
    system = cam_and_follower(1.05, 0.4)
    box = {"x": (2.0, 3.0), "v": (-1.0, 1.0), "c": (-1.0, 1.0), "s": (-1.0, 1.0)}
    got = attractors(system, box, samples=2, section=find_section(system, (2.5, 0, 1, 0)))
    (one,) = got.attractors
    assert (one.kind, one.duration) == ("periodic", pytest.approx(2 * math.pi / 1.05, abs=1e-6))
    assert one.high[0] < 1.01
