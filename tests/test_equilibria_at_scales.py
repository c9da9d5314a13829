"""Equilibria that are searched numerically: in any units, multiple zeros, fields that only fade."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from filippov import Surface, System, exp, sin, states
from filippov.analysis import equilibria


def plain(f: Any, names: str = "x", surfaces: Any = ()) -> System:
    return System(field=f, surfaces=list(surfaces), states=names)


@pytest.mark.parametrize("rate", [1e-12, 1e-6, 1.0, 1e8])
@pytest.mark.parametrize("size", [1e-9, 1e-6, 1.0])
def test_roots_of_a_field_in_any_units(size: float, rate: float) -> None:
    """x' = rate size prod (x/size - r): what is found are roots, each once, and hardly one is missed."""
    rng, missed = np.random.default_rng(5), 0
    for _ in range(5):
        roots = np.sort(rng.choice(np.arange(-8, 9), 3, replace=False) + rng.uniform(-0.3, 0.3, 3))

        def field(t: float, x: Any, p: Any, s: Any, roots: Any = roots) -> list[float]:
            return [rate * size * math.prod(x[0] / size - r for r in roots)]

        found = equilibria(plain(field), box={"x": (-10 * size, 10 * size)})
        assert not found.sets
        values = np.sort([e.value[0] for e in found.points])
        nearest = roots[np.argmin(np.abs(values[:, None] / size - roots), axis=1)]
        np.testing.assert_allclose(values, size * nearest, rtol=1e-9)
        assert len(set(nearest)) == len(values)
        missed += 3 - len(values)
    assert missed <= 1


@pytest.mark.parametrize("rate", [1e-10, 1e6])
@pytest.mark.parametrize("size", [1e-9, 1.0, 1e3])
def test_a_stick_set_in_any_units(size: float, rate: float) -> None:
    """x'' = -x - size sgn(x'), in units of time: the block sticks on |x| <= size."""
    system = plain(
        lambda t, x, p, s: [x[1], rate**2 * (-x[0] - size * s[0]) - rate * x[1]],
        "x v",
        [Surface("v", lambda t, x, p: x[1])],
    )
    found = equilibria(system, box={"x": (-10 * size, 10 * size), "v": (-10 * size * rate, 10 * size * rate)})
    assert not found.points
    (held,) = found.sets
    ends = sorted(end.value[0] for end in held.ends)
    np.testing.assert_allclose(ends, [-size, size], rtol=1e-6)
    assert all(abs(end.value[1]) <= 1e-9 * size * rate for end in held.ends)


@pytest.mark.parametrize("size", [1e-9, 1e-6, 1e-3])
def test_small_equilibria_of_a_formula_that_has_no_solution_in_formulas(size: float) -> None:
    """x' = sin(x/size) exp(-x/size) + x/(10 size): 0, and three zeros below it within ten units."""
    x = states("x")[0]
    zeros = [-9.42485401310, -6.28201079871, -3.15504506080, 0.0]
    system = System({x: sin(x / size) * exp(-x / size) + x / (10 * size)})
    found = equilibria(system, box={"x": (-10 * size, 10 * size)})
    near = sorted(e.value[0] / size for e in found.points if abs(e.value[0]) < 9.9 * size)
    np.testing.assert_allclose(near, zeros, atol=1e-6)


@pytest.mark.parametrize("power", [2, 3, 5])
@pytest.mark.parametrize("place", [0.0, -7.0])
@pytest.mark.parametrize("rate", [1e-8, 1.0])
def test_a_multiple_zero_is_found_once(power: int, place: float, rate: float) -> None:
    found = equilibria(plain(lambda t, x, p, s: [-rate * (x[0] - place) ** power]))
    assert not found.sets
    (point,) = found.points
    assert point.value[0] == pytest.approx(place, abs=1e-4)


@pytest.mark.parametrize("seed", range(10))
def test_a_degenerate_zero_of_several_states_is_found_once(seed: int) -> None:
    """x' = A x - (x_1^3, ...) with A of rank 2 among 3 states: no other zero lies near 0."""
    rng = np.random.default_rng(seed)
    left, right = rng.normal(size=(3, 2)), rng.normal(size=(2, 3))
    A = left @ right
    found = equilibria(plain(lambda t, x, p, s: list(A @ x - np.asarray(x) ** 3), "x y z"))
    near = [e for e in found.points if max(map(abs, e.value)) < 1e-3]
    assert len(near) == 1


@pytest.mark.parametrize("rate", [1e-10, 1.0])
@pytest.mark.parametrize(
    "fades", [lambda x: math.exp(-5 * x), lambda x: math.exp(-x * x), lambda x: (2 + x) ** -12.0]
)
def test_a_field_that_only_fades_has_no_equilibrium(rate: float, fades: Any) -> None:
    """It falls below any level within the range, and is not 0."""
    found = equilibria(plain(lambda t, x, p, s: [rate * fades(x[0])]), box={"x": (0, 10)})
    assert len(found) == 0


def test_a_curve_of_equilibria_is_named() -> None:
    """x' = x**2 + y**2 - 4 = y': a circle, and no isolated points."""
    found = equilibria(plain(lambda t, x, p, s: [x[0] ** 2 + x[1] ** 2 - 4] * 2, "x y"))
    assert "lies on a set of dimension 1, which is not traced" in str(found)
    assert len(found.points) == 1
