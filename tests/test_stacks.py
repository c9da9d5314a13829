"""Random stacks of 1 to 6 bodies: no gap below 0, energy does not grow, momentum balances at every impact."""

import os

import numpy as np
import pytest
from stacks import draw, faults, stack

from filippov import Status, solve

PROFILE = os.environ.get("FILIPPOV_PROFILE", "default")
# The more bodies, the longer a draw takes: 300 in all in "ci", 10,200 in "nightly".
DRAWS = {"default": (10,) * 6, "ci": (120, 100, 40, 20, 12, 8), "nightly": (1700,) * 6}[PROFILE]
NAMED = (Status.NON_UNIQUE, Status.MAX_EVENTS, Status.ZENO, Status.NO_CONTINUATION)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6])
def test_11_A_random_stacks_keep_the_laws_of_impact(n: int) -> None:
    random = np.random.default_rng(n)
    ends = []
    for k in range(DRAWS[n - 1]):
        start, values = draw(random, n)
        run = solve(stack(n), start, (0, 3), parameters=values, zeno="continue", max_events=5000)
        ends.append(run.status)
        assert run.success or run.status in NAMED, (k, run.message)
        # A run that says that it went wrong is no answer; every other one keeps the laws to its end.
        assert run.status is Status.NO_CONTINUATION or not faults(run, n, values), (k, start, values)
    # What is named instead of answered must stay the exception.
    assert sum(status is Status.SUCCESS for status in ends) >= 0.8 * len(ends), ends
