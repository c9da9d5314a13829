"""Random stacks of 1 to 6 bodies: no gap below 0, energy does not grow, momentum balances at every impact."""

import os

import numpy as np
import pytest
from stacks import draw, faults, split, stack

from filippov import Status, Surface, System, parameters, sign, solve, states, t

PROFILE = os.environ.get("FILIPPOV_PROFILE", "default")
# The more bodies, the longer a draw takes: 150 in all in "ci", 10,200 in "nightly".
DRAWS = {"default": (10,) * 6, "ci": (60, 50, 20, 10, 6, 4), "nightly": (1700,) * 6}[PROFILE]
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


# From rest at these heights, with these restitutions, the intervals of the contact shrink by a third three
# times, while each of them holds ten impacts on the floor.
BY_CHANCE = ([0.25, 0.30812798], (0.559344816966383, 0.5666148823210103, 0.524054521672256))


@pytest.mark.parametrize("n", [2, 3])
def test_11_A_bodies_dropped_on_each_other_come_to_rest(n: int) -> None:
    """No step to a limit that intervals point to by chance, and none that leaves another contact in between.

    Of 900 draws with three bodies 9 end NON_UNIQUE; 8 ended NO_CONTINUATION.
    """
    random = np.random.default_rng(77 + n)
    for k in range(max(DRAWS[n - 1] // 2, 20)):
        restitutions, masses = random.uniform(0.3, 0.8, n + 1), np.exp(random.uniform(-1, 1, n))
        heights = np.cumsum(random.uniform(0.02, 0.4, n))
        if k == 0 and n == len(BY_CHANCE[0]):
            heights, restitutions, masses = *map(np.array, BY_CHANCE), np.ones(n)
        values = {"g": 10.0, "a": 0.0, "c": 100.0}
        values |= {f"e{i}": float(e) for i, e in enumerate(restitutions)}
        values |= {f"m{i}": float(m) for i, m in enumerate(masses)}
        start = np.concatenate([heights, np.zeros(n)])
        run = solve(stack(n), start, (0, 3), parameters=values, zeno="continue", max_events=20_000)
        assert run.success or run.status in NAMED, (k, run.message)
        assert not faults(run, n, values), (k, start, values)


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


@pytest.mark.parametrize(("n", "heavy"), [(3, False), (3, True), (4, False), (5, False)])
def test_11_A_bodies_that_come_to_rest_on_each_other_fall_all_the_while(n: int, heavy: bool) -> None:
    """Their centre of mass falls freely, in the dense output and through accumulations of impacts too.

    Three equal bodies do where e < 7 - 4 sqrt(3) = 0.0718 (McNamara & Young 1992), the slower the closer.
    """
    random = np.random.default_rng(200 + n)
    held = 0
    for k in range(max(DRAWS[n - 1] // 5, 40 if heavy else 10)):
        values = {"g": 10.0, "a": 0.0, "c": 1000.0}
        y, v = 50 + np.cumsum(random.uniform(0.01, 0.1, n)), random.uniform(0, 0.2, n) - np.arange(n)
        if heavy:  # cycles that shrink slowly, or just do not
            restitutions, masses = random.uniform(0.115, 0.123, n + 1), np.array([4.3, 1.2, 1.14])
            v = np.array([1.0, 0.0, -random.uniform(0.2, 1)])
        else:
            restitutions, masses = random.uniform(0.02, 0.07, n + 1), np.exp(random.uniform(-0.3, 0.3, n))
        values |= {f"e{i}": float(e) for i, e in enumerate(restitutions)}
        values |= {f"m{i}": float(m) for i, m in enumerate(masses)}
        m = np.array(masses)
        start = np.concatenate([y, v])
        run = solve(stack(n), start, (0, 2), parameters=values, zeno="continue", max_events=20_000)
        if run.status in NAMED:
            continue
        assert run.success, (k, run.message)
        held += 0 in run.end_mode
        times = np.unique(np.concatenate([np.linspace(0, 2, 501), run.t]))
        heights, speeds = split(n, run.sol(times))
        fallen = m @ y + m @ v * times - m.sum() * 5 * times**2
        np.testing.assert_allclose(m @ heights, fallen, atol=1e-9 * fallen[0], err_msg=str(k))
        np.testing.assert_allclose(m @ speeds, m @ v - m.sum() * 10 * times, atol=1e-8, err_msg=str(k))
    assert held > 2


@pytest.mark.parametrize(("n", "k"), [(3, 29), (4, 46), (4, 67), (4, 94), (3, 1243), (6, 12)])
def test_11_2_clusters_of_impacts_leave_no_contact_on_its_far_side(n: int, k: int) -> None:
    """In 1243 a body falls onto an accumulation just before its limit; in 12 of 6 a chain fades slowly."""
    random = np.random.default_rng(n)
    for _ in range(k + 1):
        start, values = draw(random, n)
    run = solve(stack(n), start, (0, 3), parameters=values, zeno="continue", max_events=50_000)
    assert run.success, run.message
    assert not faults(run, n, values)


def test_11_A_what_touches_with_no_more_speed_than_rounding_falls_on_together() -> None:
    """Two bodies thrown up, the upper one reached at 1e-16 to 1e-13 of speed, at the start or on the way."""
    random, falling = np.random.default_rng(8), stack(2)
    for _ in range(100):
        begin, speed = random.uniform(0.5, 5.0), 10 ** random.uniform(-16, -13)
        wait = random.choice([0.0, 1e-9, 0.1]) * random.uniform(0.5, 1.0)
        rise = random.choice([0.0, 3.0]) * random.uniform(0.0, 1.0)
        start = [0.0, speed * wait, rise, rise - speed]
        values = {"g": 10.0, "a": -100.0, "c": 200.0, "e1": random.uniform(0.1, 1.0)}
        run = solve(falling, start, (begin, begin + 0.5), parameters=values, zeno="continue")
        assert run.success, (start, begin, run.message)
        expected = 0.5 * rise - 1.25, rise - 5.0
        assert np.all(np.abs(run.x_end - np.repeat(expected, 2)) < 1e-11)


@pytest.mark.parametrize("early", [1e-2, 1e-4, 1e-6, 1e-8])
@pytest.mark.parametrize("e", [0.3, 0.5, 0.8])
def test_11_A_what_comes_just_before_a_limit_is_not_bridged(e: float, early: float) -> None:
    """A ball dropped from 1 (g = 1) rests at sqrt(2) (1 + e)/(1 - e); a guard of time fires before that."""
    limit = np.sqrt(2) * (1 + e) / (1 - e)
    y, v, z = states("y v z")
    p = parameters(e=0.5, when=1.0)
    floor, bell = Surface("floor", y, reset={v: -p.e * v}), Surface("bell", t - p.when)
    bounced = System({y: v, v: -1, z: sign(t - p.when)}, surfaces=[floor, bell])
    when = limit - early
    run = solve(bounced, (1, 0, 0), (0, limit + 1), parameters={"e": e, "when": when}, zeno="continue")
    assert run.success, run.message
    (rung,) = run.events.of("bell")
    # Closer to the limit than this is known, it rings there.
    room = 1e-12 * when if early > 1e-7 else 4 * run.accumulations[0].error
    assert abs(rung.t - when) < room
    # Of the flights of lengths 2 sqrt(2) e^k those that have begun at this time.
    k = int(np.floor(np.log(early * (1 - e) / (2 * np.sqrt(2))) / np.log(e))) if early > 1e-7 else None
    if k is not None:
        into = 2 * np.sqrt(2) * e**k / (1 - e) - early
        speed = np.sqrt(2) * e**k
        assert rung.x[:2] == pytest.approx([speed * into - into**2 / 2, speed - into], abs=1e-8)
    assert np.all(np.abs(run.x_end - [0, 0, 1 + early - when]) < 1e-9 + 2 * room)


def test_11_A_a_body_that_arrives_next_to_the_limit_of_an_accumulation_is_not_passed() -> None:
    """Where the limit lies behind the surface above by less than its error, the cycles are followed further.

    The lower body, thrown up with v, would rest at t = 2 v/(g (1 - e0)); the upper one falls freely and is at
    height d then, which is little or below 0.
    """
    random = np.random.default_rng(11)
    for k in range({"default": 20, "ci": 40}.get(PROFILE, 500)):
        e, g, v = random.uniform(0.3, 0.8), 10.0, random.uniform(0.05, 0.5)
        last = 2 * v / (g * (1 - e))
        depth = float(random.choice([-1.0, 1.0]) * 10 ** random.uniform(-12, -6))
        speed = random.uniform(0, 0.01)  # at the limit, downwards
        start = np.array([0.0, depth + speed * last - g * last**2 / 2, v, g * last - speed])
        s = np.linspace(0, 0.9 * last, 50)
        if np.min(start[1] + start[3] * s - g * s**2 / 2) < v**2 / (2 * g):
            # It is to come from above the other one.
            start[1], start[3] = depth + last, g * last / 2 - 1.0
        values = {"g": g, "a": 0.0, "c": 100.0, "e0": float(e), "e1": float(random.uniform(0, 1)), "e2": 0.5}
        values |= {"m0": 1.0, "m1": float(np.exp(random.uniform(-1, 2)))}
        run = solve(stack(2), start, (0, 3), parameters=values, zeno="continue", max_events=20_000)
        # Nearer than that to each other rounding decides the order of impacts at the limit.
        assert run.success or (run.status in NAMED and abs(depth) < 1e-9), (k, depth, run.message)
        assert not faults(run, 2, values), (k, start, values)
