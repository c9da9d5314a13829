"""The random kinds of tests/campaigns.py, as many as fit into CI; the script runs them by the thousand."""

import os

import pytest
from campaigns import part

PROFILE = os.environ.get("FILIPPOV_PROFILE", "default")
PARTS = 4
CI = {"linear": 600, "resets": 240, "metamorphic": 80, "trees": 8}
NIGHTLY = {"linear": 100_000, "resets": 10_000, "metamorphic": 10_000, "trees": 400}
DRAWS = NIGHTLY if PROFILE == "nightly" else CI
SHARE = 0.1 if PROFILE == "default" else 1.0


@pytest.mark.timeout(36000 if PROFILE == "nightly" else 3600)
@pytest.mark.parametrize("number", range(PARTS))
@pytest.mark.parametrize("kind", DRAWS)
def test_11_random_systems_against_their_oracles(kind: str, number: int) -> None:
    size = max(int(DRAWS[kind] * SHARE) // PARTS, 1)
    found = part(kind, range(number * size, (number + 1) * size))
    wrong = {seed: fault for seed, fault in found if fault}
    assert not wrong, wrong
    # An oracle that judges next to nothing would prove nothing.
    assert size < 20 or sum(fault is None for _, fault in found) > 0.25 * size
