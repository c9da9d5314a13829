"""Floquet multipliers of random forced oscillators with clocks, impacts and sliding (tests/forced_draws.py).

`tests/campaigns.py forced` draws them at will.
"""

from __future__ import annotations

import os

import pytest
from forced_draws import multipliers

DRAWS = {"nightly": 600, "ci": 24}.get(os.environ.get("FILIPPOV_PROFILE", ""), 8)


def test_12_12_multipliers_are_products_of_exponentials_and_saltation_matrices() -> None:
    found = {seed: multipliers(seed) for seed in range(DRAWS)}
    assert not {seed: fault for seed, fault in found.items() if fault}
    assert sum(fault == "" for fault in found.values()) > 0.5 * DRAWS


@pytest.mark.parametrize("seed", [52, 106, 121])
def test_12_12_a_clock_that_moves_a_slide_off_its_surface_has_a_derivative(seed: int) -> None:
    assert multipliers(seed) == ""
