"""Fixed points, folds and doublings of maps with known roots: the reset of a clock gives any map at all."""

import numpy as np
import pytest
from sympy import Rational

from filippov import Heaviside, Surface, System, UsageError, parameters, sign, states
from filippov.analysis.diagrams.bifurcation import bifurcation
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.gap_roots import Samples, brackets, coordinates, fixed_point_near, roots, split
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


@pytest.mark.parametrize("seed", range(12))
def test_12_2_three_and_more_cycles_within_one_cell(seed: int) -> None:
    """Roots that a cell of the grid (0.01 wide) holds, or two beside each other."""
    draw = np.random.default_rng([2, seed])
    known = draw.uniform(0.1, 2.0, 5)
    known[1:3] = known[0] + draw.choice([-1, 1], 2) * 10.0 ** draw.uniform(-3.3, -2.3, 2)
    if abs(known[1] - known[2]) < 2e-4:
        known[2] = 2 * known[0] - known[1]
    given = {"c": draw.uniform(0.3, 2), **dict(zip(ROOTS, known.tolist(), strict=True))}
    found = QUINTIC.remake(parameters=given).fixed_points(0.05, 2.1)
    known = np.sort(known)
    gaps = np.array([np.prod(r - np.delete(known, k)) for k, r in enumerate(known)])
    assert len(found) == 5
    assert np.all(np.abs([point.d for point in found] - known) < 1e-11 / np.abs(given["c"] * gaps))


def zigzag(draw: np.random.Generator, d: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Corners of a gap that is straight between them, its heights there, and its roots, all in one cell of d:
    piece j has the slope (-1)^j m[j] and root j."""
    k, count = int(draw.integers(3, d.size - 5)), int(draw.integers(1, 4))
    known = d[k] + (d[k + 1] - d[k]) * np.sort(draw.uniform(0.02, 0.98, count))
    m = draw.uniform(0.3, 4, count)
    inner = (m[:-1] * known[:-1] + m[1:] * known[1:]) / (m[:-1] + m[1:])
    at = np.concatenate([[d[0] - 1], inner, [d[-1] + 1]])
    height = np.append(m[0] * (at[0] - known[0]), (-1) ** np.arange(count) * m * (at[1:] - known))
    return at, height * draw.choice([-1, 1]), known


@pytest.mark.parametrize("points", [40, 400])
def test_12_2_straight_gaps_with_corners_and_up_to_three_roots_within_a_cell(points: int) -> None:
    draw = np.random.default_rng(points)
    d = coordinates(0.0, 2.0, points, 1e-5)
    members = [zigzag(draw, d) for _ in range(300)]

    def gap(at, which):
        return np.array([np.interp(q, *members[k][:2]) for q, k in zip(at, which, strict=True)])

    values = np.array([gap(d, np.full(d.size, k)) for k in range(300)])
    between = brackets(gap, split(gap, Samples.of(d, values), 0.0))
    found = roots(gap, between, rtol=1e-14, jump=1e-3, floor=0.0)
    assert np.all(found.fixed)
    for k, (*_, known) in enumerate(members):
        assert np.sort(found.d[between.map == k]) == pytest.approx(known, rel=1e-11)


def test_12_2_smooth_gaps_with_roots_close_together() -> None:
    """Roots of g = exp(a sin(3 d) + b d) (d - r0) ... (d - r4), three of them within a cell."""
    draw = np.random.default_rng(7)
    d, members = coordinates(0.05, 2.1, 400, 1e-5), []
    while len(members) < 100:
        r, (a, b) = draw.uniform(0.1, 2.0, 5), draw.uniform(-2, 2, 2)
        r[1:3] = r[0] + draw.uniform(-1, 1, 2) * 10.0 ** draw.uniform(-3, -2)
        gaps = np.diff(np.sort(r))
        if np.min(gaps) > 1e-4 and np.sum(gaps > 0.03) == 2:
            members.append((np.sort(r), a, b))

    def gap(at, which):
        r, a, b = (np.array([member[j] for member in members])[which] for j in range(3))
        return np.exp(a * np.sin(3 * at) + b * at) * np.prod(at[:, None] - r, axis=1)

    values = np.array([gap(d, np.full(d.size, k)) for k in range(100)])
    between = brackets(gap, split(gap, Samples.of(d, values), 1e-13))
    found = roots(gap, between, rtol=1e-14, jump=1e-3, floor=0.0)
    for k, (known, _, _) in enumerate(members):
        assert np.sort(found.d[between.map == k]) == pytest.approx(known, rel=1e-10)


def test_13_4_many_maps_at_once_have_the_roots_of_each() -> None:
    draw = np.random.default_rng(1)
    known = np.sort(draw.uniform(0.02, 0.98, (40, 3)))
    known[::4, 1] = known[::4, 0] + 1e-4

    def gap(d, which):
        return np.prod(d[:, None] - known[which], axis=1)

    d = coordinates(0.0, 1.0, 80, 1e-5)
    values = np.array([gap(d, np.full(d.size, k)) for k in range(40)])
    between = brackets(gap, Samples.of(d, values))
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
    between = brackets(gap, split(gap, Samples.of(d, values), 0.0))
    assert between.map.tolist() == [0]
    assert not np.any(roots(gap, between, rtol=1e-14, jump=1e-3, floor=0.0).fixed)


def stepped():
    """R(d) = a + b d + q d^2 with two steps, and without a value for d < c."""
    p = parameters(c=-9.0, a=0.1, b=1.0, q=0.0, r0=0.3, r1=0.6, j0=0.1, j1=0.1)
    image = p.a + p.b * x + p.q * x**2 + p.j0 * Heaviside(x - p.r0) + p.j1 * Heaviside(x - p.r1)
    tick = Surface("tick", z - 1, reset={x: image, z: 0 * z}, side="-")
    return System({x: 0 * x, z: Heaviside(x - p.c)}, surfaces=[tick], parameters=p)


STEPPED = EventMap(stepped(), SECTION)


@pytest.mark.parametrize("seed", range(20))
def test_12_6_jumps_of_a_map_are_found_also_small_ones_and_none_is_at_0_by_itself(seed: int) -> None:
    draw = np.random.default_rng([126, seed])
    lo = float(draw.choice([-1.0, 0.0, 0.1]))
    places = np.array([draw.uniform(lo + 0.02, 0.6), draw.uniform(0.65, 1.2)])
    heights = draw.choice([-1, 1], 2) * 10.0 ** draw.uniform(-2.7, 0, 2)
    least = float(draw.choice([-9.0, lo + 0.3 * (places[0] - lo)]))
    given = dict(zip(("a", "b", "q"), draw.normal(size=3) * [1, 1, seed % 2], strict=True))
    steps = {"r0": places[0], "r1": places[1], "j0": heights[0], "j1": heights[1], "c": least}
    found = STEPPED.remake(parameters={**given, **steps}).jumps(lo, 1.3)
    assert [jump.d for jump in found] == pytest.approx(places, abs=1e-9)
    assert [jump.above - jump.below for jump in found] == pytest.approx(heights, abs=1e-6)


def test_12_6_a_map_with_corners_and_a_cube_root_does_not_jump() -> None:
    continuous = clock(lambda u, p: 1 + abs(u - 0.31) + sign(u - 0.7) * abs(u - 0.7) ** Rational(1, 3))
    assert EventMap(continuous, SECTION).jumps(-1, 1.3) == ()


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


def test_12_6_a_diagram_has_its_values_to_rounding() -> None:
    system = clock(lambda u, p: u + p.r * (u - 0.3), r=0.1)
    values = np.linspace(-0.3, 0.3, 7)
    found = bifurcation(system, SECTION, parameter="r", values=values, interval=(0.1, 1), order=1)
    assert values[4] != 0.1
    assert [point.d for point in found.cycles(0.1)] == pytest.approx([0.3])
    with pytest.raises(UsageError, match="has no value"):
        found.cycles(0.15)


@pytest.mark.parametrize("seed", range(12))
def test_12_6_a_cycle_through_the_coordinate_0_is_no_set_of_rests(seed: int) -> None:
    draw = np.random.default_rng([128, seed])
    slope, bend = draw.uniform(-3, 3), draw.normal()
    given = {"a": 0.0, "b": slope, "q": bend, "j0": 0.0, "j1": 0.0}
    lo = float(draw.choice([-1.0, 0.0, -2e-5]))
    other = (1 - slope) / bend
    known = sorted([(0.0, slope), *([(other, slope + 2 * bend * other)] if lo < other < 1.3 else [])])
    found = STEPPED.remake(parameters=given).fixed_points(lo, 1.3)
    assert [(point.d, point.slope) for point in found] == [pytest.approx(pair, abs=1e-7) for pair in known]
    assert all(point.kind == "limit cycle" and point.period == 1 for point in found)
    assert [point.stable for point in found] == [abs(rate) < 1 for _, rate in known]


@pytest.mark.parametrize(("a", "b"), [(0.5, 0.3), (0.8, 1.0)])
def test_a_reset_that_jumps_over_a_surface_has_a_slope(a: float, b: float) -> None:
    """x+ = -a x - b sign x between +-b/(1 - a), where the second iterate has the slope a^2."""
    x, z = states("x z")
    tick = Surface("tick", z - 1, reset={x: -a * x - b * sign(x), z: 0 * z}, side="-")
    system = System({x: 0 * x, z: 1 + 0 * z}, surfaces=[tick])
    section = Section("tick", "reset", "x", {"x": "d", "z": 0}, t_max=5)
    assert EventMap(system, section).derivative(0.7) == pytest.approx(-a, abs=1e-12)
    below, above = EventMap(system, section, order=2).fixed_points(-8, 8)
    for point, known in ((below, -b / (1 - a)), (above, b / (1 - a))):
        assert point.d == pytest.approx(known, abs=1e-9)
        assert point.stable
        assert point.slope == pytest.approx(a * a, abs=1e-9)
