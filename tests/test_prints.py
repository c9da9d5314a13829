"""Every result of an analysis is printed as a text to read, the one that the command prints."""

from __future__ import annotations

import math

import numpy as np
import pytest

from filippov import solve_many
from filippov.analysis import (
    EventMap,
    Section,
    basin,
    bifurcation,
    brute_force,
    compare,
    continuation,
    describing_function,
    equilibria,
    find_orbit,
    regions,
    routh_hurwitz,
    stability_report,
)
from filippov.models import get

BELT, HUNTING = get("belt"), get("hunting")
SECTION = Section.from_model(HUNTING)
X = (-0.3, 0, 0.3)
PLANE = (SECTION, ("x", X), ("v", X), (-0.5, 0.5))


def _results():
    belt, hunting = BELT.build(), HUNTING.build()
    yield "stability_report", lambda: stability_report(belt)
    yield "routh_hurwitz", lambda: routh_hurwitz([1, 2, 3])
    yield "equilibria", lambda: equilibria(get("oscillator").build())
    yield "equilibria of a smooth mode", lambda: equilibria(belt)
    yield "find_orbit", lambda: find_orbit(belt, (0, 0))
    yield "compare", lambda: compare(belt, x0=(0, 0), t_span=(0, 2), against=["switch"], widths=(1e-2, 1e-3))
    yield "compare over a section", lambda: compare(
        hunting, SECTION, [], widths=(1e-2,), comparators=("band",), interval=(0.2, 0.3), repeats=1
    )
    follow = {"parameter": "vb", "bounds": (0.19, 0.21)}
    yield "continuation", lambda: continuation(belt, find_orbit(belt, (0, 0)), **follow)
    yield "branch", lambda: continuation(belt, find_orbit(belt, (0, 0)), **follow).run()
    yield "regions", lambda: regions(hunting, SECTION, ("P", (18, 20)), ("I", (8, 10)), (0, 0.5), points=8)
    yield "basin", lambda: basin(hunting, *PLANE, points=50)
    yield "EventMap", lambda: EventMap(hunting, SECTION, order=2)
    yield "bifurcation", lambda: bifurcation(
        hunting, SECTION, parameter="P", values=(18, 20), interval=(0, 0.5)
    )
    yield "brute_force", lambda: brute_force(hunting, SECTION, "P", (18, 20), 0.2, transient=10, keep=8)
    yield "describing_function", lambda: describing_function(get("relay").build())
    yield "solve_many", lambda: solve_many(belt, [(0, 0), (1, 0)], (0, 5))


@pytest.mark.parametrize("result", [pytest.param(make, id=name) for name, make in _results()])
def test_a_result_is_printed_as_text_to_read(result):
    text = str(result())
    for raw in ("array(", "=(", "object at 0x", "dtype", "mappingproxy"):
        assert raw not in text
    assert text == text.rstrip() != ""
    assert len(text.splitlines()) < 60


def test_printed_equilibria_name_the_held_interval_and_its_mode():
    text = str(equilibria(get("oscillator").build()))
    assert "equilibrium set, mode 0" in text
    assert "in [-1, 1]" in text


def test_a_printed_basin_has_shares_that_add_up_to_all():
    shares = str(basin(HUNTING.build(), *PLANE, points=50))
    assert math.isclose(sum(float(line.split(" %")[0]) for line in shares.splitlines()), 100, rel_tol=1e-3)


def test_an_ensemble_counts_its_ends():
    ends = solve_many(BELT.build(), np.zeros((3, 2)), (0, 1))
    assert str(ends) == "Ensemble(3 success)"
