"""A search for an orbit where there is none ends after a bounded number of attempts, by name."""

from math import pi

import numpy as np
import pytest

from filippov import SolveError, Surface, System, cos, sign, solve, states, t
from filippov.analysis import find_section, returns
from filippov.analysis.orbits.collocation_search import CollocationSearch
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.analysis.orbits.search_start import rests
from filippov.analysis.sensitivity.saltation import NotDifferentiableError

x, v = states("x v")


@pytest.mark.parametrize("seed", range(4))
def test_a_search_without_an_orbit_is_bounded_work_and_says_so(seed, monkeypatch):
    """x' = g x + v, v' = -x + g v + b sign(x) has no orbit: from x = 0, v0 > 0 the spiral about the focus
    on the right, (c, -g c) with c = b/(1 + g^2), comes back to x = 0 with |v1| - g c >= v0 + g c."""
    runs = []
    own = CollocationSearch.orbit
    monkeypatch.setattr(CollocationSearch, "orbit", lambda self, given: runs.append(1) or own(self, given))
    rng = np.random.default_rng(seed)
    grows, push = rng.uniform(0.1, 0.3), rng.uniform(0.5, 1.5)
    system = System({x: grows * x + v, v: -x + grows * v + push * sign(x)})
    with pytest.raises(SolveError) as raised:
        find_orbit(system, (3.0, 0.4), t_max=200.0)
    assert len(runs) <= 3
    assert "tried" in str(raised.value) or len(runs) < 3


def test_a_solution_that_grows_to_the_largest_numbers_ends_by_name():
    with pytest.raises(SolveError, match="ended early"):
        find_orbit(System({x: 1.2 * x + v, v: 2.1 * v - sign(x)}), (0.7, 0.4))


@pytest.mark.parametrize("rate", [1.0, 1e2, 1e4, 1e6])
def test_a_fast_orbit_is_found_from_a_slow_start(rate):
    """x'' = -rate^2 x - F Sgn(v - vb), twice F in stick: it sticks over 2 a and slips along an arc of pi + 2
    atan(b/a), a = F/rate^2 and b = vb/rate. The start rides with the belt, at 0.2 in every unit of time."""
    force, belt = 0.1 * rate, 0.2
    a, b = force / rate**2, belt / rate
    period = 2 * a / belt + (np.pi + 2 * np.arctan2(b, a)) / rate
    slip = Surface("slip", v - belt, radius=2)
    system = System({x: v, v: -(rate**2) * x - force * sign(v - belt)}, surfaces=[slip])
    orbit = find_orbit(system, (0, belt))
    assert abs(orbit.period / period - 1) < 1e-9
    assert orbit.stable


def test_rest_is_seen_whatever_the_rounding_of_the_last_segments_ends():
    """x' = -sign(x) is at 0 from t = x0 on; x0 + (T - x0) may be the number after T."""
    system, rng, beyond = System({x: -sign(x)}), np.random.default_rng(2), 0
    for _ in range(60):
        start = rng.uniform(0.1, 10)
        run = solve(system, (start,), (0, start * rng.uniform(1.2, 9)))
        last = run.segments[-1]
        beyond += last.t0 + last.dwell > run.t_end
        assert rests(run)
    assert beyond


def test_an_orbit_without_derivative_is_refused_with_the_way_round() -> None:
    """Impacts of a ball on a table that shakes accumulate in each period; the cure finds it resting there."""
    shaken = {x: v, v: -1 + 1.3 * cos(t - pi / 2)}
    ball = System(shaken, surfaces=[Surface("floor", x, reset={v: -v / 2})])
    with pytest.raises(NotDifferentiableError) as caught:
        find_orbit(ball, (1.0, 0.0))
    message = str(caught.value)
    assert "impacts accumulate on 'floor'" in message
    assert "another guess, or transient=50" in message
    assert message.count("Newton's method") == 1
    assert "returns(system, find_section(system, x0), x0, 100)" in message
    settled = returns(ball, find_section(ball, (1.0, 0.0)), (1.0, 0.0), 100)
    assert np.ptp(settled.d[-3:]) < 1e-9
