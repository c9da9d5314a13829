"""Fixed points of the hunting map against slip integrated phase by phase (`hunting_oracle`)."""

import itertools
import os

import numpy as np
import pytest
from hunting_oracle import NAMES, cycles, law, set_slope, twice

from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.models import hunting

SECTION = Section("velocity", "sliding entry", "x", {"x": "d", "v": "0", "z": "(sign(d)*Fs/P - d)/I"})
# Near 1 from above and below, small cycles beside sets of both kinds, steep maps, two cycles; returns that
# rounding hides, one of two.
CHOSEN = (2, 11, 27, 33, 39, 85, 115, 120, 72, 175)
DRAWS = range(200) if os.environ.get("FILIPPOV_PROFILE") == "nightly" else CHOSEN
RESOLVED = 1.5e-11


def map_of(p: np.ndarray) -> EventMap:
    return EventMap(hunting(), SECTION, parameters=dict(zip(NAMES, p.tolist(), strict=True)), order=2)


@pytest.mark.parametrize("seed", DRAWS)
def test_12_a3_no_cycle_is_missed_or_invented(seed: int) -> None:
    p = law(seed)
    expected, slopes = cycles(p)
    at_set, *others = map_of(p).fixed_points(0, 0.5)
    found = [q for q in others if q.d > RESOLVED]
    kept = expected > RESOLVED
    assert len(found) == np.count_nonzero(kept), p
    for point, d, slope in zip(found, expected[kept], slopes[kept], strict=True):
        # Beside the rounding of z, which starts at Fs/(P I).
        assert point.d == pytest.approx(d, rel=1e-6 + 1e-14 / d), p
        assert point.slope == pytest.approx(slope, rel=1e-4 if slope < 1e3 else 1e-2), p
        assert point.stable == (slope < 1), p
    assert at_set.slope == pytest.approx(set_slope(p), rel=1e-9), p
    assert at_set.stable == (set_slope(p) < 1), p
    # What rounding hides is told: a set that is stable while motions next to it grow, and the reverse.
    grows = twice(at_set.hidden or RESOLVED, p) > (at_set.hidden or RESOLVED)
    if at_set.hidden:
        assert grows == at_set.stable, p
    else:
        stable = [point.stable for point in (at_set, *others)]
        assert all(a != b for a, b in itertools.pairwise(stable)), p


def test_12_a3_a_hidden_cycle_is_told_and_its_basin_left_open() -> None:
    """beta = 1.042: the unstable cycle lies at 3e-13, below the rounding of z = 0.02."""
    p = law(2)
    (hidden,), _ = cycles(p, 1e-18, 1e-11)
    at_set, outer = map_of(p).fixed_points(0, 0.5)
    assert at_set.stable
    assert hidden < at_set.hidden < 1e-11
    assert "unstable cycle between the set and" in at_set.note
    inner, rest = map_of(p).basins(0, 0.5)
    assert (inner.lo, inner.hi, inner.attractor) == (0.0, at_set.hidden, None)
    assert (rest.hi, rest.attractor) == (0.5, outer.d)


@pytest.mark.parametrize(("beta", "d"), [(1.3075, 2.332506917e-5), (1.2, 5.0666160e-7), (1.1, 9.0677e-12)])
def test_an_unstable_cycle_close_to_the_set(beta: float, d: float) -> None:
    p = np.array([1, 10, 1, 10, 4, 2, 0.1, beta, 1.0])
    smallest = cycles(p)[0][0] if beta > 1.15 else d
    event_map = EventMap(hunting(), SECTION, parameters={"beta": beta}, order=2)
    at_set, cycle, outer = event_map.fixed_points(0, 0.5)
    assert (at_set.stable, cycle.stable, outer.stable) == (True, False, True)
    assert cycle.d == pytest.approx(smallest, rel=1e-6 if beta > 1.15 else 1e-3)
    basins = event_map.basins(0, 0.5)
    assert [q.attractor for q in basins] == [0.0, outer.d]
