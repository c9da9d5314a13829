"""Analyses of maps and periodic orbits against closed forms: members of tests/map_draws.py.

`tests/campaigns.py maps` draws them at will.
"""

from __future__ import annotations

import os

import map_draws
import pytest

DRAWS = {"nightly": 60, "ci": 6}.get(os.environ.get("FILIPPOV_PROFILE", ""), 3)
MORE = range(3 * DRAWS)


@pytest.mark.parametrize("seed", range(DRAWS))
def test_12_6_basins_of_increasing_maps(seed: int) -> None:
    assert not map_draws.basins(seed)


@pytest.mark.parametrize("seed", MORE)
def test_12_6_cycles_over_two_parameters(seed: int) -> None:
    assert not map_draws.cells(seed)


@pytest.mark.parametrize("seed", range(DRAWS))
def test_12_6_exponents_of_skew_tents_and_of_lozi_maps(seed: int) -> None:
    assert not map_draws.exponents(seed)


@pytest.mark.parametrize("seed", MORE)
def test_12_6_multipliers_of_affine_systems_with_a_clock(seed: int) -> None:
    assert not map_draws.multipliers(seed)


@pytest.mark.parametrize("seed", MORE)
def test_12_6_gains_of_a_map_in_closed_form(seed: int) -> None:
    assert not map_draws.gains(seed)


@pytest.mark.parametrize("seed", MORE)
def test_12_6_cycles_of_several_returns_count_once(seed: int) -> None:
    assert not map_draws.iterates(seed)


@pytest.mark.parametrize("seed", range(DRAWS))
def test_12_6_gains_of_maps_with_peaks_within_bounds(seed: int) -> None:
    assert not map_draws.peaks(seed)


@pytest.mark.parametrize("seed", MORE)
def test_12_6_basins_of_maps_that_fold(seed: int) -> None:
    assert not map_draws.folded_basins(seed)
