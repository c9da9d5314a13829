"""A rule that is written for lanes too says of each lane what its plain form says of the trajectory in it."""

import ctypes
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filippov import System, sign, states
from filippov.kernel.codegen import build
from filippov.kernel.codegen.generate import generate
from filippov.kernel.language.compiler import compile_unit, load_objects
from filippov.kernel.language.unit import add_kernels
from filippov.kernel.loop.state import Clock, Group, Multiplier, Tally
from filippov.kernel.tables.layout import LANES

X, V, Y, U = states("x v y u")
SYSTEM = System({X: V, V: -X - sign(V) - 0.3 * X * V * sign(X - 0.5)})
# No two surfaces are coupled: lanes slide on both at once.
APART = System({X: V, V: Y - X - sign(V), Y: U, U: X - Y - (2 + Y**2) * sign(U - 0.1 * Y)})

# Plain forms one lane after the other, with the lane's numbers in plain arrays; then the lane form of all.
TEXT = """
@kernel
def take_lane(lane: int, group: Group, w: Scratch, x: Vector, m: Vector, order: Indices) -> None:
    draw_in(lane, size_of(w), all_of(group.w), all_of(w))
    draw_in(lane, N, group.x, x)
    draw_in(lane, M, group.m, m)
    for i in range(M):
        order[i] = truncate(group.order[i * LANES + lane])

@lanes
def lane_factor(a: Vector, out: Vector) -> int:
    out[0] = step_factor(a[0])
    return 0

@kernel
def both_factor(
    group: Group, w: Scratch, iw: Integers, x: Vector, m: Vector, order: Indices, p: Vector, ctx: Indices,
    a: Vector, out: Vector,
) -> int:
    for lane in range(LANES):
        out[lane] = step_factor(a[lane])
    return lane_factor(a, shift(out, 64 * LANES))

@lanes
def lane_doubt(group: Group, iw: Integers, a: Vector, out: Vector) -> int:
    w = side_by_side(group.w)
    out[0] = 1.0 if may_vanish(a[0], group.m, group.order, w, iw) else 0.0
    return 0

@kernel
def both_doubt(
    group: Group, w: Scratch, iw: Integers, x: Vector, m: Vector, order: Indices, p: Vector, ctx: Indices,
    a: Vector, out: Vector,
) -> int:
    lane_doubt(group, iw, a, shift(out, 64 * LANES))
    for lane in range(LANES):
        take_lane(lane, group, w, x, m, order)
        set_mode(m, iw)
        out[lane] = 1.0 if suspicious(a[lane], m, order, uniform(w), w, iw) else 0.0
    return 0

@lanes
def lane_end(group: Group, a: Vector, out: Vector) -> int:
    met = ends_at_surface(a[0], 0.25, group.m, group.order, side_by_side(group.w))
    out[0] = 1.0 if met else 0.0
    return 0

@kernel
def both_end(
    group: Group, w: Scratch, iw: Integers, x: Vector, m: Vector, order: Indices, p: Vector, ctx: Indices,
    a: Vector, out: Vector,
) -> int:
    lane_end(group, a, shift(out, 64 * LANES))
    for lane in range(LANES):
        take_lane(lane, group, w, x, m, order)
        out[lane] = 1.0 if event_at_end(a[lane], x, p, 0.25, m, order, w, ctx) >= 0 else 0.0
    return 0

@lanes
def lane_velocity(group: Group, iw: Integers, ctx: Indices, a: Vector, out: Vector) -> int:
    w, x = side_by_side(group.w), group.x
    clear_ranges(w, iw)
    field(a[0], x, group.p, group.m, out, w, iw, ctx)
    for i in range(M):
        out[N + i] = w.mult[i].value
        out[N + M + i] = w.mult[i].most - w.mult[i].least
        out[N + 2 * M + i] = w.mult[i].slope
    project(a[0], x, group.p, group.m, w.h, w, iw, ctx)
    for j in range(N):
        out[N + 3 * M + j] = x[j]
    return 0

@kernel
def both_velocity(
    group: Group, w: Scratch, iw: Integers, x: Vector, m: Vector, order: Indices, p: Vector, ctx: Indices,
    a: Vector, out: Vector,
) -> int:
    for lane in range(LANES):
        take_lane(lane, group, w, x, m, order)
        set_mode(m, iw)
        clear_ranges(w, iw)
        code = field(a[lane], x, p, m, w.f, w, iw, ctx)
        for j in range(N):
            out[j * LANES + lane] = w.f[j] if code == 0 else NAN
        for i in range(M):
            out[(N + i) * LANES + lane] = w.mult[i].value
            out[(N + M + i) * LANES + lane] = w.mult[i].most - w.mult[i].least
            out[(N + 2 * M + i) * LANES + lane] = w.mult[i].slope
        if project(a[lane], x, p, m, w.h, w, iw, ctx) != 0:
            return 1
        for j in range(N):
            out[(N + 3 * M + j) * LANES + lane] = x[j]
    iw.sliding = 1
    return lane_velocity(group, iw, ctx, a, shift(out, 64 * LANES))

@kernel
def both_rows(
    group: Group, w: Scratch, iw: Integers, x: Vector, m: Vector, order: Indices, p: Vector, ctx: Indices,
    a: Vector, out: Vector,
) -> int:
    take_lane(0, group, w, x, m, order)
    set_mode(m, iw)
    prepare_points(p, m, w)
    for lane in range(LANES):
        draw_in(lane, N, group.x, x)
        place_point(lane, a[lane], x, w)
        if guard_rows(a[lane], x, p, m, w.row, w, iw, ctx) != 0:
            return 1
        for q in range(2 * M):
            out[q * LANES + lane] = w.row[q]
    if point_rows(only_sliding(iw), w.attract[only_sliding(iw)], w, ctx) != 0:
        return 1
    for lane in range(LANES):
        take_rows(lane, w.row, w)
        for q in range(2 * M):
            out[(64 + q) * LANES + lane] = w.row[q]
    return 0
"""
NAMES = ("both_factor", "both_doubt", "both_end", "both_velocity", "both_rows")


class Compiled:
    """Both forms compiled for a system, with its numbers of states and surfaces and its records."""

    def __init__(self, system: System) -> None:
        assert system.symbolic is not None
        self.n, self.m = system.dimension, len(system.surfaces)
        made = generate(system.symbolic, system.surfaces)
        constants = made.constants | {"RULE": 0}
        self.coupled = constants["LARGEST"] != 1 or constants["COLOURS"] != 1
        self.sizes = build._sizes(constants, "DOP853")
        self.records = build._sized(self.sizes)
        unit = build._unit(made.source, constants, "DOP853", self.sizes, LANES)
        add_kernels(unit, TEXT, "pairs.py")
        self.engine = load_objects(compile_unit(unit, {}, NAMES))
        kind = ctypes.CFUNCTYPE(ctypes.c_int64, *[ctypes.c_void_p] * 10)
        self.both = {name: kind(self.engine.get_function_address(name)) for name in NAMES}


ONE, TWO = Compiled(SYSTEM), Compiled(APART)
assert (ONE.coupled, TWO.coupled) == (True, False)


def draw(seed: int, orders: tuple[int, ...], sliding: bool, of: Compiled = ONE) -> dict[str, Any]:
    """Lanes in random states; where some slide, each slides on v = 0 or on nothing, with ordinary rates.

    Where surfaces are not coupled, on either, both or none.
    """
    rng, scratch, n, m_all = np.random.default_rng(seed), of.records["Scratch"], of.n, of.m
    size = scratch.size
    room = build_room(size, of)
    w = room["w"]
    w[:] = rng.normal(size=w.shape)
    m = rng.choice([-1.0, 1.0], (m_all, LANES))
    order = rng.choice(orders, (m_all, LANES)).astype(float)
    for i in range((1 if of is ONE else m_all) if sliding else 0):
        m[i] = np.where(rng.random(LANES) < 0.7, 0.0, m[i])
        order[i] = np.where(m[i] == 0.0, 0.0, order[i])
    # Kernels of gradients write what is not always 0.
    for name, value in (("touch", 1e-3), ("attract", 1.0), ("grazed", 0.0), ("g", 0.0)):
        place = scratch.places[name]
        w[place.offset : place.offset + place.size] = value
    w[scratch.places["direction"].offset] = 1.0
    ends = w[scratch.places["radius"].offset :][: 2 * m_all]
    ends[:] = np.array([-1.0, 1.0] * m_all)[:, None]
    mult = w[scratch.places["mult"].offset :][: m_all * Multiplier.size]
    mult = mult.reshape(m_all, Multiplier.size, LANES)
    mult[:, 0] = rng.uniform(-0.9, 0.9, (m_all, LANES))
    mult[:, 1], mult[:, 2] = mult[:, 0] - 0.3 * rng.random((m_all, LANES)), mult[:, 0]
    mult[:, 5] = -rng.random((m_all, LANES))
    # Guards clear of 0 by little or much, with rates that turn now and then.
    for name in ("start", "end"):
        rows = w[scratch.places[name].offset :][: 2 * m_all].reshape(m_all, 2, LANES)
        rows[:, 0] = m * rng.uniform(0.0, 3.0, (m_all, LANES))
    room["m"][:], room["order"][:] = m, order
    room["x"][:] = rng.normal(size=(n, LANES))
    return room


def build_room(size: int, of: Compiled = ONE) -> dict[str, Any]:
    counts = {
        "clock": Clock.size, "tally": Tally.size, "x": of.n, "m": of.m, "order": of.m,
        "p": of.sizes.points or 1, "atol": of.n, "w": size,
    }  # fmt: skip
    return {name: aligned(count) for name, count in counts.items()}


def aligned(count: int) -> np.ndarray:
    room = np.zeros(count * LANES + 8)
    first = (-room.ctypes.data // 8) % 8
    return room[first : first + count * LANES].reshape(count, LANES)


def both(
    name: str, room: dict[str, Any], a: np.ndarray, of: Compiled = ONE
) -> tuple[np.ndarray, np.ndarray]:
    """What the plain and the lane form give, a row a number and a column a lane."""
    group = Group.new()
    group.refer(**room)
    w, iw = of.records["Scratch"].new(), of.records["Integers"].new()
    plain = [np.zeros(of.n), np.zeros(of.m), np.zeros(of.m, dtype=np.int64), np.zeros(4)]
    plain.append(np.zeros(16, dtype=np.int64))
    given = aligned(1)
    given[0] = a
    out = aligned(128)
    iw.sliding = int(np.any(room["m"] == 0.0))  # type: ignore[attr-defined]
    arrays = [group.array, w.array, iw.array, *plain, given, out]
    assert of.both[name](*[array.ctypes.data for array in arrays]) == 0
    return out[:64], out[64:]


seeds = st.integers(0, 2**32)


@given(st.lists(st.floats(1e-12, 1e6), min_size=LANES, max_size=LANES))
def test_13_4_the_factor_of_a_step(a: list[float]) -> None:
    one, two = both("both_factor", build_room(ONE.records["Scratch"].size), np.array(a))
    # Half a percent is all that either promises of the root; rounding down or to 0 is a unit of the bits.
    np.testing.assert_allclose(one[0], two[0], rtol=1e-15)


@pytest.mark.parametrize("sliding", [False, True])
@pytest.mark.parametrize("orders", [(0,), (0, 1, 2), (-1, 0, 1, 2, 3)])
@given(seeds)
def test_13_4_what_may_vanish_in_a_step(sliding: bool, orders: tuple[int, ...], seed: int) -> None:
    room = draw(seed, orders, sliding)
    one, two = both("both_doubt", room, 0.3 * np.random.default_rng(seed + 1).random(LANES))
    assert np.all(two[0] >= one[0]), "a lane goes past what the plain form looks at"
    if min(orders) >= 0:
        np.testing.assert_array_equal(one[0], two[0])


@given(seeds, st.booleans())
def test_13_4_what_vanishes_right_after_the_end(seed: int, sliding: bool) -> None:
    room = draw(seed, (0, 1), sliding)
    rng, place = np.random.default_rng(seed), ONE.records["Scratch"].places["end"]
    rows = room["w"][place.offset :][: 2 * ONE.m].reshape(ONE.m, 2, LANES)
    rows[:, 0] *= 10.0 ** rng.uniform(-16, -8, (ONE.m, LANES))
    one, two = both("both_end", room, rng.uniform(0.5, 3.0, LANES))
    np.testing.assert_array_equal(one[0], two[0])


@given(seeds)
def test_13_4_the_field_multipliers_and_projection(seed: int) -> None:
    room = draw(seed, (0,), True)
    room["x"][1] = np.where(room["m"][0] == 0.0, 1e-4 * room["x"][1], room["x"][1])
    slides = room["m"][0] == 0.0
    one, two = both("both_velocity", room, np.zeros(LANES))
    assert_one_velocity(one, two, np.array([slides, np.zeros(LANES, dtype=bool)]), ONE)


def assert_one_velocity(one: np.ndarray, two: np.ndarray, slides: np.ndarray, of: Compiled) -> None:
    n, m = of.n, of.m
    np.testing.assert_allclose(one[:n], two[:n], rtol=1e-13, atol=1e-13)
    # Multiplier, range and slope of sliding surfaces; those of lanes that do not slide are nobody's.
    for row in (n, n + m, n + 2 * m):
        np.testing.assert_allclose(one[row:][:m][slides], two[row:][:m][slides], rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(one[n + 3 * m :][:n], two[n + 3 * m :][:n], rtol=1e-13, atol=1e-13)


@given(seeds)
def test_14_it_must_show_lanes_that_slide_on_several_surfaces(seed: int) -> None:
    room = draw(seed, (0,), True, TWO)
    slides = room["m"] == 0.0
    room["x"][1] = np.where(slides[0], 1e-4 * room["x"][1], room["x"][1])
    room["x"][3] = np.where(slides[1], 0.1 * room["x"][2] + 1e-4 * room["x"][3], room["x"][3])
    one, two = both("both_velocity", room, np.zeros(LANES), TWO)
    assert_one_velocity(one, two, slides, TWO)
    room = draw(seed, (0,), True, TWO)
    if seed % 2:
        # All stages alike: the step is a straight line.
        place = TWO.records["Scratch"].places["k"]
        rows = room["w"][place.offset :][: place.size].reshape(-1, TWO.n, LANES)
        rows[:] = rows[0]
    one, two = both("both_doubt", room, 0.3 * np.random.default_rng(seed + 1).random(LANES), TWO)
    np.testing.assert_array_equal(one[0], two[0])


@given(seeds)
def test_13_4_the_guards_of_a_sample(seed: int) -> None:
    room = draw(seed, (0,), False)
    room["m"][:] = room["m"][:, :1]
    room["m"][0] = 0.0
    one, two = both("both_rows", room, np.zeros(LANES))
    np.testing.assert_allclose(one[: 2 * ONE.m], two[: 2 * ONE.m], rtol=1e-12, atol=1e-13)
