"""Accumulating events: the limit is named, and the motion goes on in it where it is asked to (clause E9)."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from bank import case, expected, number
from friction_trees import examine

from filippov import Solution, Status, Surface, System, pi, sign, sin, solve, sqrt, states, t

X, V = states("x v")
A, B = states("a b")
C = sqrt((sqrt(33) - 1) / 24)
CASES = {
    # Levant 1993: 10/13 + v/7 + v (1/13 + 1/sqrt(91))/(1 - q), v**2 = 14 (10 + 50/13), q**2 = 7/13.
    "twisting": (System({X: V, V: -10 * sign(X) - 3 * sign(V)}), (10, 10), 12.264208764653927),
    # Fuller 1960: 1 + v + v (1 + q)/(1 - q), v = 1/sqrt(1 + 2 C), q = sqrt((1 - 2 C)/(1 + 2 C)).
    "fuller": (System({X: V, V: -sign(X + C * V * abs(V))}), (0, 1), 2.9199324627794872),
    # Filippov 1988: d/dt (|a| + |b|) = -2.
    "spiral": (System({A: -sign(A) + 2 * sign(B), B: -2 * sign(A) - sign(B)}), (0, 1), 0.5),
}


@pytest.mark.parametrize("name", CASES)
def test_limit_is_named(name: str) -> None:
    system, x0, limit = CASES[name]
    run = solve(system, x0, (0, 2 * limit), rtol=1e-10, atol=1e-12)
    assert run.status is Status.ZENO
    named = re.search(r"accumulate at t = ([0-9.]+)", run.message)
    assert named is not None
    assert float(named[1]) == pytest.approx(limit, rel=1e-8)
    assert run.t_end == pytest.approx(limit, rel=1e-6)


@pytest.mark.parametrize("name", CASES)
def test_motion_rests_in_the_limit(name: str) -> None:
    system, x0, limit = CASES[name]
    run = solve(system, x0, (0, 2 * limit), rtol=1e-10, atol=1e-12, zeno="continue")
    assert run.status is Status.SUCCESS
    assert run.t_end == 2 * limit
    rest = run.segments[-1]
    assert 0 in rest.mode
    assert rest.t0 == pytest.approx(limit, abs=1e-6)
    assert np.max(np.abs(run.sol(np.linspace(limit * 1.001, 2 * limit, 7)))) < 1e-8


def test_limit_that_cannot_be_rested_in_is_no_rest() -> None:
    """With a push of 20 on v the relays cannot hold: 0 is not in the hull of the velocities."""
    run = solve(System({X: V, V: -10 * sign(X) - 3 * sign(V) + 20}), (1, 0), (0, 1), zeno="continue")
    assert run.status is Status.SUCCESS
    assert run.x_end[1] > 1


@pytest.mark.parametrize("rtol", [1e-11, 1e-9, 1e-6])
@pytest.mark.parametrize(
    "name", ["R07_twisting", "R09_fuller", "R10_filippov_spiral", "R11_siconos_filippov", "R13_helical"]
)
def test_error_estimate_holds(name: str, rtol: float) -> None:
    item, limit = case(name), number(expected(name)["t_converge"]["value"])
    run = solve(item.system, item.x0, (0, 2 * limit), rtol=rtol, atol=rtol / 100)
    assert run.status is Status.ZENO
    found = run.zeno
    assert found is not None
    assert abs(found.t - limit) <= 10 * found.error
    assert found.error < 100 * rtol * (1 + limit)
    assert np.max(np.abs(found.x[:2])) <= 10 * found.x_error
    assert found.surfaces == (0, 1)


@pytest.mark.parametrize("e", [0.5, 0.7, 0.9, 0.99])
def test_error_estimate_holds_for_the_ball(e: float) -> None:
    g = 9.81
    ball = System({X: V, V: -g + 0 * X}, surfaces=[Surface("floor", X, reset={V: -e * V}, contact=True)])
    limit = math.sqrt(2 / g) * (1 + e) / (1 - e)
    run = solve(ball, (1, 0), (0, 2 * limit))
    assert run.status is Status.ZENO
    assert run.zeno is not None
    assert abs(run.zeno.t - limit) <= 10 * run.zeno.error
    assert run.zeno.error < 1e-7
    assert run.zeno.ratio == pytest.approx(e, rel=1e-6)
    assert np.max(np.abs(run.zeno.x)) <= 10 * run.zeno.x_error


def test_laps_of_unequal_halves() -> None:
    """Twisting with gains 10 above and 20 below: up at 13, down at 7, below at 23 and 17; v0 = 1."""
    system = System.from_modes(
        h=[Surface("x", X), Surface("v", V)],
        fields={"++": [V, -13], "+-": [V, -7], "-+": [V, 17], "--": [V, 23]},
        states=[X, V],
    )
    v1 = math.sqrt(7 / 13)
    v2 = v1 * math.sqrt(17 / 23)
    limit = (1 / 13 + v1 / 7 + v1 / 23 + v2 / 17) / (1 - v2)
    run = solve(system, (0, 1), (0, 2 * limit))
    assert run.status is Status.ZENO
    assert run.zeno is not None
    assert abs(run.zeno.t - limit) <= 10 * run.zeno.error < 1e-6
    assert run.zeno.ratio == pytest.approx(v2, rel=1e-6)
    assert run.zeno.t == pytest.approx(limit, rel=1e-11)


def wheel() -> tuple[System, float]:
    """Six sectors between three lines through 0, the field turned by 60 degrees from each to the next.

    In the sector 0 < angle < 60 (degrees) the velocity is u = (cos 130, sin 130); from (1, 0) the ray at 60
    is met at distance q after the time sin 60/sin 70, so the limit is reached after that time/(1 - q).
    """
    normals = [(math.sin(a), -math.cos(a)) for a in (0.0, math.pi / 3, 2 * math.pi / 3)]
    surfaces = [Surface(f"line{k}", n[0] * A + n[1] * B) for k, n in enumerate(normals)]
    fields = {}
    for k in range(6):
        middle = math.radians(30 + 60 * k)
        signs = "".join(
            "+" if n[0] * math.cos(middle) + n[1] * math.sin(middle) > 0 else "-" for n in normals
        )
        angle = math.radians(130 + 60 * k)
        fields[signs] = [math.cos(angle), math.sin(angle)]
    for impossible in {f"{a}{b}{c}" for a in "+-" for b in "+-" for c in "+-"} - set(fields):
        fields[impossible] = [1.0, 0.0]
    # (1, 0) + time u on the ray at 60 degrees: sin(60) + time sin(60 - 130) = 0.
    time = math.sin(math.radians(60)) / math.sin(math.radians(70))
    q = (1 + time * math.cos(math.radians(130))) / math.cos(math.radians(60))
    return System.from_modes(h=surfaces, fields=fields, states=[A, B]), time / (1 - q)


def test_chattering_on_three_surfaces() -> None:
    system, limit = wheel()
    run = solve(system, (1, 1e-300), (0, 2 * limit))
    assert run.status is Status.ZENO, run.message
    assert run.zeno is not None
    assert run.zeno.surfaces == (0, 1, 2)
    assert abs(run.zeno.t - limit) <= 10 * run.zeno.error < 1e-6
    on = solve(system, (1, 1e-300), (0, 2 * limit), zeno="continue")
    assert on.success, on.message
    assert np.max(np.abs(on.x_end)) < 1e-8


def test_intervals_that_shrink_without_an_end_are_none() -> None:
    """x'' = -t x: Airy's function, intervals pi/sqrt(t)."""
    run = solve(System({X: V, V: -t * X - 1e-3 * sign(X)}), (1, 0), (1, 60))
    assert run.success, run.message
    assert run.zeno is None
    assert len(run.events) > 80


@pytest.mark.parametrize("shortest", [1e-2, 1e-3])
def test_intervals_that_shrink_to_one_above_zero_are_none(shortest: float) -> None:
    """The phase a crosses whole numbers in intervals of about shortest + exp(-3 t)."""
    system = System(
        {X: sign(sin(pi * A)), A: 1 / (shortest + B), B: -3 * B}, surfaces=[Surface("relay", sin(pi * A))]
    )
    run = solve(system, (0, 0.5, 1), (0, 4))
    assert run.success, run.message
    assert run.zeno is None
    assert len(run.events) > 1 / shortest


def test_event_storms_end_in_a_named_budget() -> None:
    relay = System({X: -sign(X)}, surfaces=[Surface("x", X, width=1e-12)])
    assert solve(relay, (1,), (0, 3), max_events=500).status is Status.MAX_EVENTS
    assert solve(relay, (1,), (0, 3), max_time=0.2).status in {Status.TIMEOUT, Status.MAX_EVENTS}
    slow = System(
        field=lambda _, __, ___, s: [-s[0]],
        surfaces=[Surface("x", lambda _, x, __: x[0], width=1e-9)],
        states="x",
    )
    assert solve(slow, (1,), (0, 3), max_time=0.2).status in {Status.TIMEOUT, Status.MAX_EVENTS}
    # A ball that loses 1e-5 of its speed: its 1e6 impacts are more than the budget.
    ball = System({X: V, V: -9.81 + 0 * X}, surfaces=[Surface("floor", X, reset={V: -0.99999 * V})])
    assert solve(ball, (1, 0), (0, 1e6), max_events=2000).status is Status.MAX_EVENTS


def test_limits_are_kept_with_the_solution(tmp_path: Path) -> None:
    system, x0, limit = CASES["spiral"]
    run = solve(system, x0, (0, 2 * limit), zeno="continue")
    assert len(run.accumulations) == 1
    assert run.accumulations[0] == run.zeno
    back = Solution.load(run.save(tmp_path / "run.npz"))
    assert back.accumulations == run.accumulations
    assert solve(system, x0, (0, limit / 2)).zeno is None


def test_E9_what_else_comes_to_rest_in_the_limit_of_impacts_is_decided_there() -> None:
    # Three bodies that stick to each other bounce without loss on a wall: friction on the ground, and between
    # them as they strike, brings all to rest at once.
    assert examine(300128) == []


@pytest.mark.parametrize("seed", [800001, 800057])
def test_E9_a_contact_that_acts_on_no_rate_is_left_as_it_is(seed: int) -> None:
    # Bodies that stick to each other rest on a wall, in ever shorter steps.
    assert examine(seed) == []


@pytest.mark.parametrize("seed", [810019, 810266, 820000])
def test_E9_at_the_limit_of_impacts_rounding_leads_nowhere_and_slides_may_end(seed: int) -> None:
    # Bodies come to rest at speeds of 1e-76; another friction contact that they slid on is overloaded there.
    assert examine(seed) == []
