"""Bounds of equilibria are compared exactly where the numbers are: at any size of the rates and states."""

from __future__ import annotations

import pytest

from filippov import Surface, System, sign, states
from filippov.analysis import equilibria


@pytest.mark.parametrize("rate", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("force", [0.3, -0.3])
def test_a_body_rests_at_a_wall_only_where_the_force_leads_to_it(rate: float, force: float) -> None:
    """At (0, 0) the acceleration is rate * force; with 0.3 it leads away from the wall x >= 0 at any rate."""
    x, v = states("x v")
    wall = Surface("w", x, reset={"v": -0.7 * v})
    found = equilibria(System({x: rate * v, v: rate * (force - v)}, surfaces=[wall]))
    assert not found.sets
    assert len(found.points) == (1 if force < 0 else 0)
    for point in found.points:
        assert point.kind == "resting contact"
        assert point.value == (0.0, 0.0)


@pytest.mark.parametrize("over", [1e-3, 1e-8, 1e-11])
def test_a_relay_holds_what_is_no_stronger_than_it(over: float) -> None:
    """x' = g - 1024 sgn(x) - x: x = g - 1024 for g > 1024, else 0 with the multiplier g/1024."""
    x = states("x")[0]
    for excess, value, kind in (
        (over, over, "equilibrium"),
        (0.0, 0.0, "boundary equilibrium"),
        (-over, 0.0, "pseudo-equilibrium"),
    ):
        (point,) = equilibria(System({x: 1024 + (excess - 1024 * sign(x) - x)})).points
        assert point.kind == kind
        assert point.value[0] == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize("gap", [1e-4, 1e-8])
def test_a_root_of_a_square_that_stays_above_zero_is_none(gap: float) -> None:
    """x' = x**2 + gap**2 > 0 at every real x."""
    x = states("x")[0]
    assert len(equilibria(System({x: x**2 + gap**2}))) == 0
    assert len(equilibria(System({x: x**2 - gap**2}))) == 2


@pytest.mark.parametrize("shift", [1e-6, 1e-11, 1e-14])
def test_a_point_beside_a_switching_surface_is_on_its_own_side(shift: float) -> None:
    """x' = shift - x, y' = -y + y sgn(x)/2: the point x = shift lies beside the surface."""
    x, y = states("x y")
    found = equilibria(System({x: shift - x, y: -y + y * sign(x) / 2}))
    assert not found.sets
    (point,) = found.points
    assert point.mode == "+"
    assert point.value == pytest.approx((shift, 0.0), rel=1e-12)
