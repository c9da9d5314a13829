"""Saddles beside a surface, and on it, in other units of length: which of both is not told by a distance."""

from __future__ import annotations

import numpy as np
import pytest

from filippov import System, sign, states
from filippov.analysis.invariant_sets.manifold import manifold

x, y = states("x y")
UNITS = (1e-9, 1e-6, 1.0, 1e6)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("length", UNITS)
def test_12_13_a_saddle_beside_a_surface_in_any_unit_of_length(seed: int, length: float) -> None:
    # x'' = k (x + l) for x < 0, else c l - k x: the unstable line y = r (x + l), r^2 = k.
    k, at, c = np.random.default_rng([seed, 61]).uniform(0.3, 3, 3)
    at = at * length
    side = (1 + sign(x)) / 2
    system = System({x: y, y: (1 - side) * k * (x + at) + side * (c * at - k * x)})
    found = manifold(system, (-at, 0.0), "unstable", length=0.5 * at)
    assert found.of == "saddle"
    assert found.x == pytest.approx([-at, 0], abs=1e-12 * length)
    for branch in found.branches:
        place, speed = branch.x[-1]
        assert speed == pytest.approx(np.sqrt(k) * (place + at), rel=1e-6)
        assert np.hypot(place + at, speed) == pytest.approx(0.5 * at, rel=1e-6)


@pytest.mark.parametrize("length", UNITS)
@pytest.mark.parametrize("error", [0.0, 1e-9])
def test_12_13_a_pseudo_saddle_in_any_unit_of_length(length: float, error: float) -> None:
    # On y = 0 x' = x; both sides point to it. Off the surface x' = x, y' = -+1 has no equilibrium.
    system = System({x: x, y: -length * sign(y)})
    found = manifold(system, (0.0, error * min(length, 1.0)), "unstable", length=length)
    assert found.of == "pseudo-saddle"
    ends = sorted(float(branch.x[-1, 0]) / length for branch in found.branches)
    assert ends == pytest.approx([-1, 1], rel=1e-5)
