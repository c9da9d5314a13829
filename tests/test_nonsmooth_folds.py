"""Branches of orbits across non-smooth folds, against scipy: belts and stops drawn at random."""

import math
import os

import fold_draws
import pytest

from filippov import Surface, System, cos, exp, parameters, sign, sin, states, t
from filippov.analysis import continuation, find_orbit

DRAWS = {"ci": 8, "nightly": 100}.get(os.environ.get("FILIPPOV_PROFILE", ""), 2)
X, V = states("x v")
# Slip orbit that grazes the belt's speed, by scipy; Hopf point where the force falls as the damping grows.
GRAZING, HOPF = 0.97331525, 0.1 * math.log(40)


def belt() -> System:
    p = parameters(vb=0.2)
    s = V - p.vb
    return System({X: V, V: -100 * X - (6 + 4 * exp(-abs(s) / 0.1)) * sign(s) - s}, parameters=p)


def ball() -> System:
    p = parameters(A=0.0013)
    table, speed = p.A * sin(100 * t), 100 * p.A * cos(100 * t)
    return System({X: V, V: -9.81}, surfaces=[Surface("table", X - table, reset={V: -0.5 * V + 1.5 * speed})],
                  parameters=p)  # fmt: skip


@pytest.mark.parametrize("seed", range(DRAWS))
def test_belts_under_falling_friction(seed: int) -> None:
    member = fold_draws.Belt.draw(seed)
    for branch in member.branches():
        assert not list(member.faults(branch)), (member, branch.message)


@pytest.mark.parametrize("seed", [*range(DRAWS), 119])
def test_oscillators_with_a_stop(seed: int) -> None:
    member = fold_draws.Stop.draw(seed)
    for branch in member.branches():
        assert not list(member.faults(branch)), (member, branch.message)


def test_stick_slip_goes_over_its_fold_to_the_slip_orbits_and_down_to_the_hopf_point() -> None:
    system = belt()
    start = find_orbit(system, (0, 0))
    branch = continuation(system, start, parameter="vb", bounds=(0.05, 2), direction=1).run()
    fold, end = branch.special
    assert fold.special == "grazing-sliding"
    assert fold.note.startswith("non-smooth fold")
    assert fold.value == pytest.approx(GRAZING, abs=2e-8)
    assert fold.coefficients["multiplier"] == pytest.approx(15.59, abs=0.01)
    assert end.value == pytest.approx(HOPF, abs=1e-10)
    assert max(branch.values) < GRAZING + 1e-8
    words = [point.word for point in branch.points if not point.special]
    assert words == sorted(words, reverse=True)


@pytest.mark.parametrize("way", [1, -1])
def test_slip_orbits_from_one_of_them(way: int) -> None:
    system = belt()
    x0 = (6 + 4 * math.exp(-0.2) + 0.02) / 100, 0.86795 - 0.02
    start = find_orbit(system, x0, parameters={"vb": 0.86795})
    branch = continuation(system, start, parameter="vb", bounds=(0.05, 2), direction=way).run()
    (special,) = branch.special
    assert special.value == pytest.approx(GRAZING if way > 0 else HOPF, abs=2e-8)
    assert branch.values[-1] == pytest.approx(0.05 if way > 0 else HOPF, abs=1e-10)


def test_a_grazing_ball_grazes_to_second_order_only() -> None:
    """H'' = A w^2 sin(w t) - g where the ball passes the table: 13.70 by scipy."""
    system = ball()
    start = find_orbit(system, (0.004, 0.2))
    run = continuation(system, start, parameter="A", bounds=(0.0005, 0.003), direction=1)
    grazing = next(point for point in run if point.special)
    assert grazing.value == pytest.approx(0.00245671825, abs=1e-10)
    assert grazing.coefficients["bend"] == pytest.approx(13.70, abs=0.01)
    # Beyond it no orbit is one of those before.
    later = [next(run, None) for _ in range(6)]
    assert all(point is None or "2 resets" in point.word for point in later)


def test_an_orbit_beside_one_stop_is_not_followed_by_halves() -> None:
    """x'' + 0.4 x' + x = a cos 2t with a stop at 1 alone, or at -1 too: then halves are alike."""
    for both in (False, True):
        stops = [Surface("right", X - 1, reset={V: -0.5 * V}, side="-")]
        stops += [Surface("left", X + 1, reset={V: -0.5 * V})] * both
        system = System({X: V, V: -X - 0.4 * V + 2 * cos(2 * t)}, surfaces=stops)
        assert find_orbit(system, (0, 0)).symmetric is both
