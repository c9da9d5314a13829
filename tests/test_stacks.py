"""Random stacks of 1 to 6 bodies: no gap below 0, energy does not grow, momentum balances at every impact."""

import os

import numpy as np
import pytest
from stacks import draw, faults, stack

from filippov import Status, solve

PROFILE = os.environ.get("FILIPPOV_PROFILE", "default")
# The more bodies, the longer a draw takes: 300 in all in "ci", 10,200 in "nightly".
DRAWS = {"default": (10,) * 6, "ci": (120, 100, 40, 20, 12, 8), "nightly": (1700,) * 6}[PROFILE]
# Impacts whose order rounding hides and whose result depends on it, and clusters of tens of thousands.
NAMED = (Status.NON_UNIQUE, Status.MAX_EVENTS)
# Part of the draws that may end so: those that start with such impacts are among them.
RARE = 0.1


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6])
def test_11_A_random_stacks_keep_the_laws_of_impact(n: int) -> None:
    random = np.random.default_rng(n)
    ends = []
    for k in range(DRAWS[n - 1]):
        start, values = draw(random, n)
        run = solve(stack(n), start, (0, 3), parameters=values, zeno="continue", max_events=20_000)
        ends.append(run.status)
        assert run.success or run.status in NAMED, (k, run.message)
        assert not faults(run, n, values), (k, start, values)
    named = sum(status is not Status.SUCCESS for status in ends)
    assert named <= max(2, RARE * len(ends)), ends


@pytest.mark.parametrize("n", [2, 3, 4])
def test_11_A_a_permutation_of_bodies_permutes_the_answer(n: int) -> None:
    random = np.random.default_rng(100 + n)
    compared = 0
    for k in range(max(DRAWS[n - 1] // 5, 10)):
        start, values = draw(random, n)
        order = tuple(random.permutation(n).tolist())
        moved = [*np.argsort(order), *(n + np.argsort(order))]
        runs = [
            solve(system, x, (0, 2), parameters=values, zeno="continue", max_events=20_000)
            for system, x in (
                (stack(n), start), (stack(n, order), start[moved]), (stack(n), start * (1 + 1e-11)),
            )
        ]  # fmt: skip
        first, other, beside = runs
        # Where rounding decides which of two impacts is first, nothing is claimed.
        if not all(run.success for run in runs) or len(first.events) != len(beside.events):
            continue
        compared += 1
        room = 1e-9 + 100 * np.max(np.abs(beside.x_end - first.x_end))
        assert np.max(np.abs(other.x_end - first.x_end[moved])) <= room, (k, start, values, order)
    assert compared > DRAWS[n - 1] // 10


@pytest.mark.parametrize(("n", "k"), [(3, 29), (4, 46), (4, 67), (4, 94)])
def test_11_2_clusters_of_impacts_leave_no_contact_on_its_far_side(n: int, k: int) -> None:
    random = np.random.default_rng(n)
    for _ in range(k + 1):
        start, values = draw(random, n)
    run = solve(stack(n), start, (0, 3), parameters=values, zeno="continue", max_events=50_000)
    assert run.success, run.message
    assert not faults(run, n, values)
