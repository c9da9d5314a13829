"""Attractors and basins of planar systems whose borders are known: members of tests/basin_draws.py.

`tests/campaigns.py planes` draws them at will.
"""

from __future__ import annotations

import os

import basin_draws
import pytest

DRAWS = {"nightly": 30}.get(os.environ.get("FILIPPOV_PROFILE", ""), 1)


@pytest.mark.parametrize("seed", range(DRAWS))
@pytest.mark.parametrize("kind", basin_draws.KINDS)
def test_12_13_basins_of_planar_systems_with_known_borders(kind: str, seed: int) -> None:
    assert not basin_draws.basins(kind, seed)
