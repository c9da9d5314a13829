"""Equilibria of systems with lookup tables, against the zeros of the broken line.

Beyond its ends a table holds its value: no slope is left there that would meet zero far away.
"""

from __future__ import annotations

import os
from itertools import pairwise

import numpy as np
import pytest
import sympy

from filippov import System, Table, states
from filippov.analysis import equilibria, stability_report

x, v = states("x v")
DRAWS = range({"nightly": 300}.get(os.environ.get("FILIPPOV_PROFILE", ""), 20))


def points(seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng([9, seed])
    n = int(rng.integers(3, 9))
    places = np.cumsum(rng.uniform(0.1, 0.8, n)) - 1.5
    values = rng.uniform(-1, 1, n)
    return (np.round(places, 2), np.round(values, 2)) if seed % 2 else (places, values)


@pytest.mark.parametrize("seed", DRAWS)
def test_each_zero_once_and_none_far_away(seed: int) -> None:
    places, values = points(seed)
    truth = []
    for (a, b), (p, q) in zip(pairwise(places), pairwise(values), strict=True):
        if p * q < 0:
            truth.append((a - p * (b - a) / (q - p), "asymptotically stable" if q > p else "unstable"))
    force = Table(places, values)
    system = System({x: -force(x)}) if seed % 3 else System({x: v, v: -0.7 * v - force(x)})
    found = sorted((i.equilibrium.value[0], i.answer) for i in stability_report(system).items)
    assert [place for place, _ in found] == pytest.approx([place for place, _ in truth], abs=1e-9)
    assert [answer for _, answer in found] == [answer for _, answer in truth]


@pytest.mark.parametrize("outside", ["hold", "extend"])
@pytest.mark.parametrize("seed", DRAWS)
def test_the_expression_is_the_line(seed: int, outside: str) -> None:
    places, values = points(seed)
    table = Table(places, values * 10.0 ** (seed % 7 - 3), outside=outside)
    at = np.linspace(places[0] - 3, places[-1] + 3, 200)
    curve = sympy.lambdify(x, table(x))(at)
    steepest = np.max(np.abs(np.diff(table.y) / np.diff(table.x)))
    assert np.max(np.abs(curve - table.values(at))) <= 1e-14 * (6 * steepest + np.max(np.abs(table.y)))


def test_a_dead_zone_is_a_line_of_rests() -> None:
    """0 between -0.3 and 0.7, whatever the slopes outside."""
    force = Table([-1.1, -0.3, 0.7, 1.3], [-0.7, 0, 0, 0.7])
    (found,) = equilibria(System({x: -force(x)}))
    assert found.bounds == ((-0.3, 0.7),)


def test_thirty_knots_have_thirty_one_modes() -> None:
    """Knots lie in order, so that 2**30 signs of them are 31 modes, all of which are searched."""
    places = np.round(np.linspace(-3, 3, 30), 3)
    force = Table(places, np.sin(2 * places))
    found = equilibria(System({x: -force(x)}))
    zeros = [round(e.value[0], 2) for e in found]
    assert len(zeros) == 3
    assert not found.notes
