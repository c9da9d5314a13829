"""Floquet multipliers of random forced oscillators with clocks, impacts and sliding (tests/forced_draws.py).

`tests/campaigns.py forced` draws them at will.
"""

from __future__ import annotations

import os

import numpy as np
import pytest
from forced_draws import Oscillator, judged, multipliers

DRAWS = {"nightly": 600, "ci": 24}.get(os.environ.get("FILIPPOV_PROFILE", ""), 8)


def test_12_12_multipliers_are_products_of_exponentials_and_saltation_matrices() -> None:
    found = {seed: multipliers(seed) for seed in range(DRAWS)}
    assert not {seed: fault for seed, fault in found.items() if fault}
    assert sum(fault == "" for fault in found.values()) > 0.5 * DRAWS


@pytest.mark.parametrize("seed", [52, 106, 121])
def test_12_12_a_clock_that_moves_a_slide_off_its_surface_has_a_derivative(seed: int) -> None:
    assert multipliers(seed) == ""


@pytest.mark.parametrize(
    ("stiffness", "damping", "load", "F", "w", "relay", "c", "d", "stop"),
    [
        (1.84, 0.222, 0.438, (-1.68, 1.59), 1.39, 1.74, 0.595, -1.04, (-0.766, 0.588)),
        (1.44, 0.605, -0.313, (1.6, -1.54), 1.19, 1.89, 0.993, -1.2, (-0.483, 0.884)),
    ],
)
def test_12_12_an_impact_that_moves_a_slide_off_its_surface_has_a_derivative(
    stiffness: float, damping: float, load: float, F: tuple[float, float], w: float, relay: float, c: float,
    d: float, stop: tuple[float, float],
) -> None:  # fmt: skip
    A, push = np.array([[0, 1], [-stiffness, -damping]]), np.array([0, -relay])
    forcing = np.array([(0, 0), F])
    a = Oscillator(A, np.array([0, load]), forcing, w, push, np.array([1, c]), d, None, stop)
    assert judged(a, np.array([stop[0] + 1, 0]), 0) == ""
