"""The random kinds of tests/campaigns.py, as many as fit into CI; the script runs them by the thousand."""

import os

import pytest
from campaigns import part

PROFILE = os.environ.get("FILIPPOV_PROFILE", "default")
PARTS = 4
DRAWS = {"linear": 1000, "resets": 400, "metamorphic": 120}
SHARE = {"default": 0.1, "ci": 1.0, "nightly": 10.0}[PROFILE]


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("number", range(PARTS))
@pytest.mark.parametrize("kind", DRAWS)
def test_11_random_systems_against_their_oracles(kind: str, number: int) -> None:
    size = int(DRAWS[kind] * SHARE) // PARTS
    found = part(kind, range(number * size, (number + 1) * size))
    wrong = {seed: fault for seed, fault in found if fault}
    assert not wrong, wrong
    # An oracle that judges next to nothing would prove nothing.
    assert size < 20 or sum(fault is None for _, fault in found) > 0.25 * size
