"""Equilibria on the border of a mode, with sliding roots on the axis, under clocks and forcing."""

import numpy as np
import pytest

from filippov import Surface, System, TimeEvent, cos, sign, states, t
from filippov.analysis import stability_report

x, y, z, w = states("x y z w")
AS, ST, UN = "asymptotically stable", "stable", "unstable"


def growth(a: float, c: float, d: float, length: float = 120.0, dt: float = 2e-3) -> float:
    """log |state| of x' = y - d x held at x >= 0, where it slides, y' = a y - z - c x, z' = y + a z."""
    q, total = np.random.default_rng(0).standard_normal((3, 20)), np.zeros(20)
    q[0] = abs(q[0])
    for k in range(int(length / dt)):
        u, v, r = q
        held = np.maximum(u + dt * (v - d * u), 0)
        q = np.array([held, v + dt * (a * v - r - c * u), r + dt * (v + a * r)])
        if k % 500 == 499:
            size = np.linalg.norm(q, axis=0)
            total, q = total + np.log(size), q / size
    return float(np.max(total))


@pytest.mark.parametrize(("a", "c", "d"), [(0.1, 2, 2), (0.1, 6, 2), (0.1, 0.5, 1), (0.1, 6, 0), (0.3, 1, 1)])
def test_12_11_a_multiplier_at_its_bound_and_roots_on_the_right(a: float, c: float, d: float) -> None:
    """What spirals out while it slides leaves the surface, and the field beside it may bring it back."""
    loop = System({x: 1 + y - sign(x) - d * x, y: a * y - z - c * x, z: y + a * z})
    (item,) = [i for i in stability_report(loop).items if i.equilibrium.mode == "0"]
    last = growth(a, c, d)
    assert abs(last) > 1
    assert item.answer not in ({UN} if last < 0 else {AS, ST})


def test_12_11_a_solution_that_leaves_inside_its_mode_decides_on_any_border() -> None:
    """A saddle at a wall: along (1, 1) nothing is hit. A spiral source there says nothing."""
    wall = Surface("wall", x, reset={y: -0.5 * y}, side="+")
    (item,) = stability_report(System({x: y, y: x}, surfaces=[wall])).items
    assert item.answer == UN
    spiral = System({x: y, y: -x + y / 10, z: -z}, surfaces=[wall])
    (item,) = stability_report(spiral).items  # half a turn times exp(0.05 pi / sqrt(1 - 1/400)), then 1/2
    assert item.answer != UN


@pytest.mark.parametrize(
    ("rows", "answer"),
    [
        ({y: z, z: -4 * y + x}, ST),
        ({y: z, z: -4 * y + x - y**3}, "undecided"),
        ({y: z, z: x}, UN),
        ({y: z, z: -y - z / 10 + x}, AS),
    ],
)
def test_12_12_a_linear_sliding_field_with_roots_on_the_axis(rows: dict, answer: str) -> None:
    """On x = 0, which attracts: an oscillator, one with a cube (energy is not asked), a body that drifts."""
    items = stability_report(System({x: y - sign(x), **rows})).items
    found = [i for i in items if i.equilibrium.mode == "0"]
    assert [i.answer for i in found] == [answer]


@pytest.mark.parametrize(("p", "q"), [(1, 1), (3, 2), (1, 3), (4, 3), (9, 4)])
def test_12_12_clocks_whose_period_is_commensurable_with_the_forcing(p: int, q: int) -> None:
    """x' = (cos t - 1/5) x, x+ = g x every P = 2 pi p/q: on average log|g|/P - 1/5."""
    period = 2 * np.pi * p / q
    for g in (0.9 * np.exp(period / 5), -1.1 * np.exp(period / 5)):
        clock = TimeEvent("clock", period=period, reset={x: g * x})
        (item,) = stability_report(System({x: (cos(t) - 0.2) * x}, time_events=[clock])).items
        assert item.answer == (AS if abs(g) < np.exp(period / 5) else UN)
