"""A search for an orbit where there is none ends after a bounded number of attempts, by name."""

import numpy as np
import pytest

from filippov import SolveError, System, sign, states
from filippov.analysis.orbits.collocation_search import CollocationSearch
from filippov.analysis.orbits.orbit_search import find_orbit

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
