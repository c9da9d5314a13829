"""Fixed points, folds and doublings of maps with known roots: the reset of a clock gives any map at all."""

import numpy as np
import pytest

from filippov import Surface, System, parameters, states
from filippov.analysis.diagrams.bifurcation import bifurcation
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.gap_roots import brackets, coordinates, fixed_point_near, roots
from filippov.analysis.maps.section import Section

x, z = states("x z")
ROOTS = [f"r{k}" for k in range(5)]
SECTION = Section("tick", "reset", "x", {"x": "d", "z": 0}, t_max=5)


def clock(image, **values):
    """x rests between the ticks of z' = 1 and jumps to image(x) at each: the map x -> image(x)."""
    p = parameters(**values)
    tick = Surface("tick", z - 1, reset={x: image(x, p), z: 0 * z}, side="-")
    return System({x: 0 * x, z: 1 + 0 * z}, surfaces=[tick], parameters=p)


def quintic():
    """R(d) = d - c (d - r0) ... (d - r4)."""

    def image(u, p):
        product = p.c
        for name in ROOTS:
            product = product * (u - getattr(p, name))
        return u - product

    return clock(image, c=1.0, **dict.fromkeys(ROOTS, 0.0))


QUINTIC = EventMap(quintic(), SECTION)


@pytest.mark.parametrize("seed", range(12))
def test_13_4_fixed_points_are_the_roots_also_two_between_points_of_the_grid(seed: int) -> None:
    draw = np.random.default_rng(seed)
    known = draw.uniform(0.1, 2.0, 5)
    if seed % 2:
        known[1] = known[0] + 10.0 ** draw.uniform(-3.5, -2)
    c = draw.uniform(0.3, 2) * draw.choice([-1, 1])
    given = {"c": c, **dict(zip(ROOTS, known.tolist(), strict=True))}
    found = QUINTIC.remake(parameters=given).fixed_points(0.05, 2.1)
    known = np.sort(known)
    gaps = np.array([np.prod(r - np.delete(known, k)) for k, r in enumerate(known)])
    assert [point.d for point in found] == pytest.approx(known, abs=1e-9 / np.min(np.abs(c * gaps)))
    assert [point.slope for point in found] == pytest.approx(1 - c * gaps, abs=1e-7)
    assert [point.stable for point in found] == [bool(abs(1 - c * gap) < 1) for gap in gaps]


def test_13_4_many_maps_at_once_have_the_roots_of_each() -> None:
    draw = np.random.default_rng(1)
    known = np.sort(draw.uniform(0.02, 0.98, (40, 3)))
    known[::4, 1] = known[::4, 0] + 1e-4

    def gap(d, which):
        return np.prod(d[:, None] - known[which], axis=1)

    d = coordinates(0.0, 1.0, 80, 1e-5)
    values = np.array([gap(d, np.full(d.size, k)) for k in range(40)])
    between = brackets(gap, d, values)
    found = roots(gap, between, rtol=1e-14, jump=1e-3, floor=0.0)
    assert np.all(found.fixed)
    for k in range(40):
        mine = np.sort(found.d[between.map == k])
        assert mine == pytest.approx(np.sort(known[k]), rel=1e-12)


def test_13_4_a_jump_is_no_root_and_nan_is_none() -> None:
    def gap(d, which):
        return np.where(which == 0, np.where(d < 0.3, -1.0, 1.0), np.where(d < 0.6, np.nan, d - 0.5))

    d = coordinates(0.0, 1.0, 20, 1e-5)
    values = np.array([gap(d, np.full(d.size, k)) for k in range(2)])
    between = brackets(gap, d, values)
    assert between.map.tolist() == [0]
    assert not np.any(roots(gap, between, rtol=1e-14, jump=1e-3, floor=0.0).fixed)


def test_13_4_the_fixed_point_next_to_a_coordinate() -> None:
    def image(d):
        return d + (d - 0.3) * (d - 2.0)

    assert fixed_point_near(image, 0.31, 1e-3) is None
    assert fixed_point_near(image, 0.31, 1e-3, 0.1) == pytest.approx(0.3, rel=1e-15)
    assert fixed_point_near(lambda d: float("nan"), 0.31, 1e-3, 1.0) is None


def test_13_4_folds_and_doublings_of_a_diagram_in_closed_form() -> None:
    # x -> x + mu - (x - a)^2: fold at mu = 0, x = a; its upper branch x = a + sqrt(mu) doubles at mu = 1.
    system = clock(lambda u, p: u + p.mu - (u - p.a) ** 2, mu=0.25, a=0.7)
    for a in (0.7, 3.0, -2.0):
        diagram = bifurcation(
            system, SECTION, parameter="mu", values=[-0.4, -0.1, 0.3, 0.7, 1.25], interval=(a - 1.4, a + 1.4),
            parameters={"a": a}, order=1, points=40,
        )  # fmt: skip
        assert [point.kind for point in diagram.special] == ["fold", "period doubling"]
        fold, doubling = diagram.special
        assert (fold.value, fold.d) == pytest.approx((0.0, a), abs=1e-6)
        assert abs(fold.value) < 1e-11
        assert (doubling.value, doubling.d) == pytest.approx((1.0, a + 1.0), abs=1e-8)
        assert max(fold.residual, doubling.residual) < 1e-5
