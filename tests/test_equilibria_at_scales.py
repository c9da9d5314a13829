"""Equilibria that are searched numerically, in any units of states and time."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from filippov import Surface, System, exp, sin, states
from filippov.analysis import equilibria


def plain(f: Any, names: str = "x", surfaces: Any = ()) -> System:
    return System(field=f, surfaces=list(surfaces), states=names)


@pytest.mark.parametrize("rate", [1e-12, 1.0, 1e8])
@pytest.mark.parametrize("size", [1e-9, 1e-6, 1.0])
def test_roots_of_a_field_in_any_units(size: float, rate: float) -> None:
    """x' = rate size prod (x/size - r): what is found are roots, no others, and hardly one is missed."""
    rng, missed = np.random.default_rng(5), 0
    for _ in range(3):
        roots = np.sort(rng.choice(np.arange(-8, 9), 3, replace=False) + rng.uniform(-0.3, 0.3, 3))

        def field(t: float, x: Any, p: Any, s: Any, roots: Any = roots) -> list[float]:
            return [rate * size * math.prod(x[0] / size - r for r in roots)]

        found = equilibria(plain(field))
        assert not found.sets
        values = np.sort([e.value[0] for e in found.points])
        nearest = roots[np.argmin(np.abs(values[:, None] / size - roots), axis=1)]
        np.testing.assert_allclose(values, size * nearest, rtol=1e-6)
        assert len(set(nearest)) == len(values)
        missed += 3 - len(values)
    assert missed <= 1


@pytest.mark.parametrize("rate", [1e-10, 1.0, 1e6])
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e3])
def test_a_stick_set_in_any_units(size: float, rate: float) -> None:
    """x'' = -x - size sgn(x'), in units of time: the block sticks on |x| <= size."""
    system = plain(
        lambda t, x, p, s: [x[1], rate**2 * (-x[0] - size * s[0]) - rate * x[1]],
        "x v",
        [Surface("v", lambda t, x, p: x[1])],
    )
    found = equilibria(system)
    assert not found.points
    (held,) = found.sets
    ends = sorted(end.value[0] for end in held.ends)
    np.testing.assert_allclose(ends, [-size, size], rtol=1e-6)
    assert all(abs(end.value[1]) <= 1e-9 * size for end in held.ends)


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e-3])
def test_small_equilibria_of_a_formula_that_has_no_solution_in_formulas(size: float) -> None:
    """x' = sin(x/size) exp(-x/size) + x/(10 size): 0, and three zeros below it within ten units."""
    x = states("x")[0]
    zeros = [-9.42485401310, -6.28201079871, -3.15504506080, 0.0]
    found = equilibria(System({x: sin(x / size) * exp(-x / size) + x / (10 * size)}))
    near = sorted(e.value[0] / size for e in found.points if abs(e.value[0]) < 9.9 * size)
    np.testing.assert_allclose(near, zeros, atol=1e-6)


def test_equilibria_of_different_sizes_in_one_field() -> None:
    """x' = x (x - 2e-8) (x - 5e-5) (x - 3): four orders apart each."""
    found = equilibria(plain(lambda t, x, p, s: [x[0] * (x[0] - 2e-8) * (x[0] - 5e-5) * (x[0] - 3)]))
    np.testing.assert_allclose(sorted(e.value[0] for e in found.points), [0, 2e-8, 5e-5, 3], rtol=1e-5)


@pytest.mark.parametrize("power", [2, 3, 5])
@pytest.mark.parametrize("place", [0.0, 1.5])
def test_multiple_zeros(power: int, place: float) -> None:
    found = equilibria(plain(lambda t, x, p, s: [-((x[0] - place) ** power)]))
    assert not found.sets
    (point,) = found.points
    assert point.value[0] == pytest.approx(place, abs=0.02 if power == 5 else 1e-4)


@pytest.mark.parametrize("rate", [1e-10, 1.0])
def test_a_field_that_only_fades_has_no_equilibrium(rate: float) -> None:
    """x' = exp(-x) falls below any level within the range, and is not 0."""
    found = equilibria(plain(lambda t, x, p, s: [rate * math.exp(-5 * x[0])]))
    assert len(found) == 0
