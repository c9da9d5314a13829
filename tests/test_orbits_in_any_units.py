"""Periodic orbits, their multipliers and branches in any units of each state and of time.

Oracles: the closed form of a quadratic map that a clock applies, and the amplitude of the hunting cycle by a
40-digit Taylor integration.
"""

from __future__ import annotations

import os
from math import sqrt

import numpy as np
import pytest
from test_maps_in_any_units import Loop

from filippov import Surface, System, cos, parameters, sign, states
from filippov import t as time
from filippov.analysis.bifurcations.continuation import continuation
from filippov.analysis.orbits.margin import nearest_pass
from filippov.analysis.orbits.orbit_search import find_orbit

x, y, z = states("x y z")
PER_DRAW = 200 if os.environ.get("FILIPPOV_PROFILE") == "nightly" else 3


@pytest.mark.parametrize("seed", range(PER_DRAW))
def test_12_13_orbits_held_by_a_clock_and_their_branch_in_any_units(seed: int) -> None:
    # (x, y) -> (y, m - d x - y^2): y = (-(1 + d) + root)/2, trace -2 y, determinant d; fold m = -(1 + d)^2/4.
    rng = np.random.default_rng([seed, 83])
    length, period, height, unit = (float(v) for v in 10.0 ** rng.integers(-9, 10, 4))
    d, m, rate = float(rng.uniform(0.1, 0.5)), float(rng.uniform(0.1, 0.4)), height / period
    p = parameters(m=m * unit)
    jump = {x: y, y: length * p.m / unit - d * x - y**2 / length, z: 0 * z}
    tick = Surface("tick", z - height, reset=jump, side="-")
    system = System({x: 0 * x, y: 0 * y, z: rate + 0 * z}, surfaces=[tick])
    at = (-(1 + d) + sqrt((1 + d) ** 2 + 4 * m)) / 2
    orbit = find_orbit(system, (at * length, at * length, 0.3 * height), period=period)
    assert orbit.x0[:2] / length == pytest.approx([at, at], rel=1e-9)
    known = sorted(np.abs(np.roots([1, 2 * at, d])))
    assert sorted(np.abs(orbit.multipliers)) == pytest.approx(known, rel=1e-8)
    bounds = (-0.6 * unit, 0.45 * unit)
    run = continuation(system, orbit, parameter="m", bounds=bounds, direction=-1, step=0.1, max_step=0.3)
    (fold,) = (q for q in run.run().special if q.special == "fold")
    assert fold.value / unit == pytest.approx(-((1 + d) ** 2) / 4, rel=1e-7)


@pytest.mark.parametrize("seed", range(PER_DRAW))
def test_12_13_the_hunting_orbit_in_any_units(seed: int) -> None:
    loop = Loop(seed)
    start = np.array([0.25 * loop.x, 0.0, 0.015 * loop.z])
    orbit = find_orbit(loop.system, start, period=2.07 * loop.t)
    assert orbit.high[0] / loop.x == pytest.approx(0.252304806412, rel=1e-9)
    assert orbit.low[0] / loop.x == pytest.approx(-0.252304806412, rel=1e-9)
    # The slope of the second return: of the published map, to its digits.
    assert max(abs(orbit.multipliers)) == pytest.approx(0.7829069, rel=1e-6)


@pytest.mark.parametrize("seed", range(PER_DRAW))
def test_12_13_coefficients_of_grazing_in_any_units(seed: int) -> None:
    # Below a stop at x = 1 with impacts -e v: H'' = w^2, v -> v - (1 + e) sqrt(2) w sqrt(z), at a = gain.
    rng = np.random.default_rng([seed, 89])
    length, speed, long = (float(v) for v in 10.0 ** rng.integers(-9, 10, 3))
    w, c, e = float(rng.uniform(1.4, 3)), float(rng.uniform(0.1, 0.7)), float(rng.uniform(0.4, 0.9))
    gain = sqrt((1 - w * w) ** 2 + (c * w) ** 2)
    p = parameters(a=0.97 * gain * length)
    stop = Surface("stop", x - length, reset={y: -e * y}, side="-")
    force = -x / length - c * y / speed + p.a / length * cos(w / long * time)
    system = System({x: y / speed * length / long, y: speed / long * force}, surfaces=[stop])
    bounds = (0.97 * gain * length, 1.02 * gain * length)
    start = np.array([length * (1 - w * w), speed * c * w * w]) * 0.97 / gain
    run = continuation(
        system, find_orbit(system, start), parameter="a", bounds=bounds, direction=1, max_points=6,
        step=0.1, max_step=0.3,
    )  # fmt: skip
    point = next(q for q in run.run().special if q.special == "C-bifurcation")
    assert point.value / length == pytest.approx(gain, rel=1e-8)
    assert point.coefficients["bend"] * long**2 / length == pytest.approx(w * w, rel=1e-7)
    vector = point.coefficients["vector y"] / speed * sqrt(length)
    assert vector == pytest.approx(-(1 + e) * sqrt(2) * w, rel=1e-7)


@pytest.mark.parametrize("seed", range(PER_DRAW))
def test_12_13_how_near_a_surface_is_passed_in_any_units(seed: int) -> None:
    """x'' + 0.4 x' + x = cos 1.3 t - 0.2: x + x'/2 - 3 goes from -3.2 - R to -3.2 + R, R by the gain."""
    length, speed, long = (float(v) for v in 10.0 ** np.random.default_rng([seed, 97]).integers(-9, 10, 3))
    q, w = x / length, y / speed
    pull = -q - 0.4 * w + cos(1.3 / long * time) + sign(q + w / 2 - 3) / 5
    far = Surface("far", q + w / 2 - 3)
    system = System({x: y / speed * length / long, y: speed / long * pull}, surfaces=[far])
    orbit = find_orbit(system, (0.1 * length, 0.0))
    gain = abs(complex(1, 1.3 / 2)) / abs(complex(1 - 1.3**2, 0.4 * 1.3))
    share, _, surface = nearest_pass(orbit.pieces)
    assert surface == "far"
    assert share == pytest.approx((3.2 - gain) / (3.2 + gain), rel=1e-3)
