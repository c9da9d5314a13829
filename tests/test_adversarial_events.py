"""Inputs on which trusted event-driven solvers were wrong: one test a row, named by its id."""

import itertools
import math
from typing import Any

import numpy as np
import pytest
from sympy import Rational, floor, sqrt

from filippov import (
    EventKind,
    Heaviside,
    ModelError,
    Status,
    Surface,
    System,
    UsageError,
    parameters,
    sign,
    solve,
    states,
    t,
)
from filippov.solving.state.events import Stop

x, y, v = states("x y v")
TIGHT: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-14}


def observed(*guards: Any, field: Any = 1) -> System:
    """x' = field, watched by guards that change nothing."""
    return System({x: field}, surfaces=[Surface(f"s{i}", h, kind="observer") for i, h in enumerate(guards)])


def modes(h: Any, plus: list[Any], minus: list[Any], *symbols: Any) -> System:
    return System.from_modes([Surface("s", h)], {"+": plus, "-": minus}, symbols)


# x' = 1 toward 0 from both sides at unequal speed, x' = y on top: visible fold at y = 0.
FOLD = modes(y, [1, x], [0, 1], x, y)


def test_a1_several_roots_in_one_step() -> None:
    got = solve(observed(x, field=3 * t**2 + 12 * t - 4), (-120,), (-8, 4))
    np.testing.assert_allclose(got.events.t, [-6, -2, 2], atol=1e-12)
    assert [event.direction for event in got.events] == [1, -1, 1]


def test_a2_all_triples_of_sixteenths() -> None:
    q = parameters(a=0.1, b=0.2, c=0.3)
    system = observed((x - q.a) * (x - q.b) * (x - q.c))
    triples = list(itertools.combinations(np.arange(1, 16) / 16, 3))
    assert len(triples) == 455
    for triple in triples:
        got = solve(system, (0,), (0, 1), parameters=dict(zip("abc", triple, strict=True)), first_step=1.0)
        np.testing.assert_allclose(got.events.t, triple, atol=1e-14)


@pytest.mark.parametrize("depth", [1e-9, 1e-13])
def test_a3_close_pair(depth: float) -> None:
    system = observed(x, field=2 * (t - 1))
    for options in ({}, TIGHT):
        got = solve(system, (1 - depth,), (0, 2), **options)
        assert got.end_mode == (1,)
        if depth == 1e-13:
            # Less below 0 than the rounding of a step's interpolant: not told from a tangency.
            assert [event.kind for event in got.events] == [EventKind.GRAZING]
            assert got.events[0].t == pytest.approx(1, abs=1e-6)
        else:
            assert [event.kind for event in got.events] == [EventKind.CROSSING] * 2
            accuracy = 1e-15 / depth**0.5 if options else 1e-9
            np.testing.assert_allclose(got.events.t, [1 - depth**0.5, 1 + depth**0.5], atol=accuracy)


def test_a4_exact_tangency() -> None:
    system = observed(x, field=2 * (t - 1))
    got = solve(system, (1,), (0, 2))
    assert [event.kind for event in got.events] == [EventKind.GRAZING]
    assert got.events[0].t == pytest.approx(1, abs=1e-6)
    assert got.modes == ("+",)
    stopped = solve(system, (1,), (0, 2), on_graze="error")
    assert stopped.status is Status.GRAZING
    assert stopped.t_end == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize(
    ("plus", "minus", "mode", "end"), [(1, 1, "+", 1), (-1, -1, "-", -1), (-1, 1, "0", 0)]
)
def test_a5_start_on_a_surface(plus: int, minus: int, mode: str, end: float) -> None:
    got = solve(modes(x, [plus], [minus], x), (0,), (0, 1))
    assert len(got.events) == 0
    assert got.modes == (mode,)
    assert got.x_end[0] == pytest.approx(end, abs=1e-14)


def test_a5_start_on_a_repelling_surface() -> None:
    system = modes(x, [1], [-1], x)
    got = solve(system, (0,), (0, 1))
    assert got.status is Status.NON_UNIQUE
    assert all(text in got.message for text in ("+;", "-;", "'s'"))
    for mode, end in (((1,), 1), ((-1,), -1), ((0,), 0)):
        chosen = solve(system, (0,), (0, 1), nonunique=lambda c, m=mode: next(a for a in c if a.mode == m))
        assert chosen.x_end[0] == pytest.approx(end, abs=1e-13)


@pytest.mark.parametrize("power", range(1, 6))
def test_a6_higher_lie_derivatives_decide(power: int) -> None:
    got = solve(modes(x, [t**power], [t**power], x), (0,), (0, 1))
    assert got.modes == ("+",)
    assert got.x_end[0] == pytest.approx(1 / (power + 1), abs=1e-9)
    slid = solve(modes(x, [-(t**power)], [t**power], x), (0,), (0, 1))
    assert slid.modes == ("0",)
    assert slid.x_end[0] == 0


def test_a6_two_folds() -> None:
    visible = solve(modes(y, [1, x], [1, -x], x, y), (0, 0), (0, 1))
    assert visible.status is Status.NON_UNIQUE
    assert all(text in visible.message for text in ("t = 0", "two-fold", "'s'"))
    invisible = solve(modes(y, [1, -x], [1, x], x, y), (0, 0), (0, 1))
    assert invisible.modes == ("0",)
    np.testing.assert_allclose(invisible.x_end, [1, 0], atol=1e-10)


def test_a6_invisible_fold_at_the_start_slides() -> None:
    got = solve(modes(y, [1, -x], [0, 1], x, y), (0, 0), (0, 1), **TIGHT)
    assert got.modes == ("0",)
    # x' = 1/(1 + x)
    np.testing.assert_allclose(got.x_end, [np.sqrt(3) - 1, 0], atol=1e-12)


@pytest.mark.parametrize("terminal", [False, True])
@pytest.mark.parametrize("end", [1.0, 1 / 3, 7.0])
def test_a7_event_at_t_end(terminal: bool, end: float) -> None:
    q = parameters(a=1)
    system = observed(t - q.a)
    stop = {"stop": Stop("s0")} if terminal else {}
    got = solve(system, (0,), (0, end), parameters={"a": end}, **stop)
    assert list(got.events.t) == [end]
    assert got.t[-1] == got.t_end == end


def test_a8_event_at_an_output_time() -> None:
    system = modes(x, [-1], [-2], x)
    got = solve(system, (1,), (0, 2), t_eval=[0.5, 1, 1.5])
    assert len(got.events) == 1
    np.testing.assert_allclose(got.y[0], [0.5, 0, -1], atol=1e-13)
    for side in ("-", "+"):
        np.testing.assert_allclose(got.sol(1.0, side=side), 0, atol=1e-13)


def test_a9_restart_at_the_event_point() -> None:
    system = System({x: v, v: -x - Rational(1, 10) * sign(v)})
    rng = np.random.default_rng(9)
    for start in rng.uniform(-3, 3, (300, 2)):
        first = solve(system, start, (0, 20), stop=Stop("v", "crossing"), dense_output=False)
        if first.status is not Status.STOPPED:
            continue
        again = solve(system, first.x_end, (first.t_end, 20), stop=Stop("v", "crossing"), dense_output=False)
        centre = -0.1 * again.start_mode[0]
        if again.status is Status.STOPPED:
            assert again.t_end - first.t_end == pytest.approx(np.pi, abs=1e-7)
            assert again.x_end[0] == pytest.approx(2 * centre - first.x_end[0], abs=1e-7)


def test_a9_three_hundred_balls() -> None:
    """Thrown up or down, turned round at the floor by hand: 0 re-triggers, 0 fall-through."""
    ball = System({x: v, v: -1}, surfaces=[Surface("floor", x, kind="observer")])
    rng = np.random.default_rng(99)
    for height, speed, restitution in rng.uniform((0.1, -3, 0.1), (3, 3, 1), (300, 3)):
        first = solve(ball, (height, speed), (0, 20), stop=Stop("floor"), dense_output=False)
        assert first.t_end == pytest.approx(speed + np.sqrt(speed**2 + 2 * height), rel=1e-9)
        up = -restitution * first.x_end[1]
        again = solve(
            ball, (first.x_end[0], up), (first.t_end, 30), stop=Stop("floor"), dense_output=False
        )
        assert again.t_end - first.t_end == pytest.approx(2 * up, rel=1e-9)
        assert len(again.events) == 1


def test_a10_noise_across_the_surface() -> None:
    system = modes(x, [-1], [-1], x)
    for offset, events in ((1e-14, 1), (1e-17, 1), (0.0, 0), (-1e-17, 0), (-1e-14, 0)):
        got = solve(system, (offset,), (0, 1))
        assert len(got.events) == events
        assert got.end_mode == (-1,)


def test_a11_stationary_zero_while_another_guard_fires() -> None:
    system = System(
        {x: v, v: -x - 2 * sign(v), y: 1}, surfaces=[Surface("v", v), Surface("c", y - 10, kind="observer")]
    )
    got = solve(system, (1, 0, 0), (0, 20))
    assert [event.surface for event in got.events] == ["c"]
    assert got.events[0].t == pytest.approx(10, abs=1e-12)
    assert got.steps < 20
    assert tuple(got.x_end[:2]) == (1, 0)


@pytest.mark.parametrize("side", [1, -1])
def test_a12_stick_to_slip_on_the_right_side(side: int) -> None:
    system = System({x: v, v: side * (t - 1) - sign(v)}, surfaces=[Surface("v", v)])
    got = solve(system, (0, 0), (0, 4))
    assert [(event.kind, event.direction) for event in got.events] == [(EventKind.EXIT, side)]
    assert got.events[0].t == pytest.approx(2, abs=1e-12)
    np.testing.assert_allclose(got.x_end, [side * 4 / 3, side * 2], atol=1e-9)


@pytest.mark.parametrize("order", list(itertools.permutations(range(3))))
def test_a13_order_of_declaration(order: tuple[int, ...]) -> None:
    surfaces = [Surface("a", x), Surface("b", y), Surface("c", v)]
    system = System(
        {
            x: -2 * sign(x) + Rational(1, 2) * sign(y),
            y: -2 * sign(y) - Rational(1, 4) * sign(v),
            v: 1 - 3 * sign(v),
        },
        surfaces=[surfaces[i] for i in order],
        states="x y v",
    )
    got = solve(system, (1.5, -1.75, -4), (0, 2), **TIGHT)
    # While all three signs last: x' = -2.5, y' = 2.25, v' = 4.
    names = [surface.name for surface in system.surfaces]
    assert dict(zip(names, got.end_mode, strict=True)) == {"a": 0, "b": 0, "c": 0}
    assert sorted((round(event.t, 10), event.surface, str(event.kind)) for event in got.events) == [
        (0.6, "a", "sliding entry"),
        (round(1.75 / 2.25, 10), "b", "sliding entry"), (1.0, "c", "sliding entry"),
    ]  # fmt: skip


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a13_two_guards_at_the_same_time(order: tuple[int, int]) -> None:
    surfaces = [Surface("a", x), Surface("b", y)]
    system = System({x: -1 - sign(x) / 2, y: -1 + sign(y) / 2}, surfaces=[surfaces[i] for i in order])
    got = solve(system, (1.5, 0.5), (0, 2))
    assert {(event.surface, event.kind) for event in got.events} == {(n, EventKind.CROSSING) for n in "ab"}
    assert len({event.group for event in got.events}) == 1
    np.testing.assert_allclose(got.x_end, [-0.5, -1.5], atol=1e-12)


@pytest.mark.parametrize("gap", [1e-9, 1e-12])
def test_a14_close_events_in_order_both_ways(gap: float) -> None:
    q = parameters(gap=1)
    system = observed(x - 1, x - 1 - q.gap)
    forward = solve(system, (0,), (0, 2), parameters={"gap": gap})
    backward = solve(system, (2,), (2, 0), backward=True, parameters={"gap": gap})
    assert [event.surface for event in forward.events] == ["s0", "s1"]
    assert [event.surface for event in backward.events] == ["s1", "s0"]
    assert np.diff(forward.events.t)[0] == pytest.approx(gap, abs=2e-15)


def test_a17_attraction_costs_few_calls() -> None:
    got = solve(modes(x, [-1], [1], x), (1,), (0, 2), dense_output=False)
    assert got.modes == ("+", "0")
    assert got.x_end[0] == 0
    assert got.nfev < 50
    dense = solve(modes(x, [-1], [1], x), (1,), (0, 2))
    assert dense.nfev < 50
    assert dense.multiplier("s", 1.5) == pytest.approx(0, abs=1e-15)


def test_a17_line_at_constant_speed() -> None:
    """x' = -sign(x - y), y' = 1/2: on the line from t = 2/3, with multiplier -1/2."""
    system = System({x: -sign(x - y), y: Rational(1, 2)}, surfaces=[Surface("line", x - y)])
    got = solve(system, (1, 0), (0, 2))
    assert got.events.t == pytest.approx([2 / 3], abs=1e-14)
    np.testing.assert_allclose(got.x_end, [1, 1], atol=1e-14)
    assert got.multiplier("line", 1.5) == pytest.approx(-0.5, abs=1e-14)
    assert got.nfev < 50


def test_a17_attracting_line() -> None:
    system = System({x: -sign(x - y), y: -y})
    got = solve(system, (1, 2), (0, 5), **TIGHT)
    name = system.surfaces[0].name
    assert got.end_mode == (0,)
    np.testing.assert_allclose(got.x_end, 2 * np.exp(-5), atol=1e-11)
    # On x = y: -s = -y.
    assert abs(got.multiplier(name, 4.0)) == pytest.approx(2 * np.exp(-4), abs=1e-11)


def test_a18_spiral_into_a_corner() -> None:
    fields = {"++": [1, -3], "-+": [3, 1], "--": [-1, 3], "+-": [-3, -1]}
    system = System.from_modes([Surface("x", x), Surface("y", y)], fields, [x, y])
    got = solve(system, (1, 1), (0, 10))
    assert got.status is Status.ZENO
    assert got.t_end == pytest.approx(1, abs=1e-6)
    onward = solve(system, (1, 1), (0, 10), zeno="continue")
    assert onward.status is Status.SUCCESS
    assert onward.end_mode == (0, 0)
    np.testing.assert_array_equal(onward.x_end, 0)


def test_a19_exit_is_located_on_the_multiplier() -> None:
    got = solve(FOLD, (-1, 0), (0, 2.5), **TIGHT)
    assert [event.kind for event in got.events] == [EventKind.EXIT]
    assert got.events[0].t == pytest.approx(1.5, abs=1e-12)
    np.testing.assert_allclose(got.events[0].x, 0, atol=1e-12)
    assert got.events[0].multiplier == pytest.approx(1, abs=1e-11)
    np.testing.assert_allclose(got.x_end, [1, 0.5], atol=1e-11)


@pytest.mark.parametrize("offset", [-1e-10, -1e-13, 0.0, 1e-13, 1e-10])
def test_a20_grazing_sliding_is_continuous(offset: float) -> None:
    got = solve(FOLD, (-1.0, 0.5 + offset), (0, 2.5), **TIGHT)
    assert got.success, got.message
    assert np.all(np.isfinite(got.y))
    # From just below the sliding part is met at its very end; the two differ by no more than they started.
    np.testing.assert_allclose(got.x_end, [1.5, 1.125], atol=3 * abs(offset) + 1e-12)


@pytest.mark.parametrize(("beyond", "mode"), [(1e-12, (0,)), (-1e-12, (-1,)), (1.0, (0,)), (-1.0, (-1,))])
def test_a21_tiny_normal_speed(beyond: float, mode: tuple[int]) -> None:
    q = parameters(beyond=1)
    got = solve(modes(y, [1, -1e-12], [1, q.beyond], x, y), (0, 1e-13), (0, 1), parameters={"beyond": beyond})
    assert got.end_mode == mode
    assert got.events[0].t == pytest.approx(0.1, rel=1e-3)


@pytest.mark.parametrize(
    ("speed", "mode", "note"), [(1e-12, (0,), "decided by a margin of 1e-12"), (-1e-12, (-1,), "")]
)
def test_a21_margin_is_reported(speed: float, mode: tuple[int], note: str) -> None:
    """Towards the surface at speed 1, beyond it back to it at 1e-12; away from it that is its whole rate."""
    q = parameters(beyond=1)
    got = solve(modes(y, [1, -1], [1, q.beyond], x, y), (0, 0.5), (0, 1), parameters={"beyond": speed})
    assert got.end_mode == mode
    assert got.events[0].note == note


def test_a21_field_along_the_surface_beyond_it_keeps_the_motion_there() -> None:
    got = solve(modes(x, [-1], [0], x), (1,), (0, 3))
    assert got.success, got.message
    assert got.x_end[0] == 0
    assert got.events[0].t == pytest.approx(1, abs=1e-13)


@pytest.mark.parametrize("k", [3, 4])
def test_a22_many_surfaces_meeting(k: int) -> None:
    q = states("q1 q2 q3 q4")[:k]
    coupled = System({a: -sign(a) + sum(sign(b) for b in q if b != a) / 10 for a in q})
    for start in ([0.0] * k, [0.5] * k, [0.5, -0.25, 0.125, 0.0625][:k]):
        got = solve(coupled, start, (0, 4))
        assert got.success, got.message
        assert got.end_mode == (0,) * k
        np.testing.assert_array_equal(got.x_end, 0)
    repelling = solve(System({a: sign(a) for a in q}), [0.0] * k, (0, 1))
    assert repelling.status is Status.NON_UNIQUE
    assert all("".join(signs) in repelling.message for signs in itertools.product("+-", repeat=k))


def test_a23_redundant_surfaces() -> None:
    with pytest.raises(ModelError, match="'a' and 'b' are the same set"):
        System({x: sign(x), y: 1}, surfaces=[Surface("a", x), Surface("b", 2 * x)])

    def h(_: float, z: Any, __: Any) -> float:
        return float(z[0])

    with pytest.raises(ModelError, match="'a' and 'b' are the same set"):
        System(field=lambda *_: [1.0], surfaces=[Surface("a", h), Surface("b", h)], states="x")


def test_a26_guard_that_is_zero_but_for_noise() -> None:
    # x = 10 y forever; the difference of the two rounded states is noise.
    system = System({x: -x, y: -y}, surfaces=[Surface("s", x - 10 * y, kind="observer")])
    for start in ((0.3, 0.03), (0.7, 0.07), (1e3 / 3, 1e2 / 3)):
        got = solve(system, start, (0, 5))
        assert got.success
        assert len(got.events) == 0


ROUNDING = {
    "sum": lambda z: ((z + 1) - 1) - z,
    "product": lambda z: 3 * z / 7 * 7 / 3 - z,
    "circle": lambda z: math.sin(z) ** 2 + math.cos(z) ** 2 - 1,
    "root": lambda z: math.sqrt(z) ** 2 - z,
    "shifted": lambda z: (z - 1e3) + 1e3 - z,
}


@pytest.mark.parametrize("name", ROUNDING)
def test_a26_guard_of_rounding_alone(name: str) -> None:
    """Guards that are 0 but for rounding, on which neither the end of a run nor its events depend."""
    h = ROUNDING[name]
    guard = Surface("s", lambda _, z, __: h(float(z[0])), kind="observer")
    system = System(field=lambda *_: [1.0], surfaces=[guard], states="x")
    for start in [0.3, 0.25, 0.7, 1 / 3, *np.random.default_rng(26).uniform(0, 3, 40)]:
        got = solve(system, (start,), (0, 5))
        assert got.success, got.message
        assert len(got.events) <= 4
        assert got.x_end[0] == pytest.approx(start + 5, abs=1e-13)


@pytest.mark.parametrize("options", [{}, TIGHT, {"method": "DP5"}])
def test_a26_observed_first_integral_changes_nothing(options: dict[str, Any]) -> None:
    circle = System({x: v, v: -x}, surfaces=[Surface("s", x**2 + v**2 - 1, kind="observer")])
    got = solve(circle, (1, 0), (0, 100), **options)
    assert got.success
    assert len(got.events) == 0
    np.testing.assert_allclose(got.x_end, [np.cos(100), -np.sin(100)], atol=1e-6)


def test_a26_first_integral_on_a_surface_where_the_field_jumps_is_not_unique() -> None:
    system = System({x: v, v: -x, y: sign(x**2 + v**2 - 1)})
    assert solve(system, (1, 0, 0), (0, 1)).status is Status.NON_UNIQUE


@pytest.mark.parametrize("factor", [1e-166, 1e-300, 1e166])
def test_a27_guards_near_underflow(factor: float) -> None:
    def h(_: float, z: Any, __: Any) -> float:
        return float(factor * (z[0] - 1))

    system = System(field=lambda *_: [1.0], surfaces=[Surface("s", h, kind="observer")], states="x")
    np.testing.assert_allclose(solve(system, (0,), (0, 2)).events.t, [1], atol=1e-12)


def test_a28_guards_that_jump_are_refused() -> None:
    with pytest.raises(ModelError, match="condition"):
        Surface("s", x > 0)
    with pytest.raises(ModelError, match="jumps"):
        System({x: 1}, surfaces=[Surface("s", floor(t))])
    for h in (lambda _, z, __: z[0] > 1, lambda _, z, __: np.floor(z[0]) - 0.5):
        with pytest.raises(ModelError, match="'s'"):
            solve(System(field=lambda *_: [1.0], surfaces=[Surface("s", h)], states="x"), (0,), (0, 3))


def test_a30_field_undefined_beyond_the_surface() -> None:
    got = solve(System({x: -1 - sqrt(abs(x)) * Heaviside(x)}), (1,), (0, 3), **TIGHT)
    assert got.success, got.message
    reached = 2 * (1 - np.log(2))
    assert got.events.t == pytest.approx([reached], abs=1e-10)
    assert got.x_end[0] == pytest.approx(reached - 3, abs=1e-10)
    assert np.all(np.isfinite(got.y))


def test_a30_root_in_a_plain_function() -> None:
    def field(_: float, z: Any, __: Any, s: Any) -> list[float]:
        return [-1 - np.sqrt(z[0])] if s[0] > 0 else [-1.0]

    with np.errstate(invalid="ignore"):
        got = solve(
            System(field=field, surfaces=[Surface("x", lambda _, z, __: z[0])], states="x"), (1,), (0, 3)
        )
    assert got.x_end[0] == pytest.approx(2 * (1 - np.log(2)) - 3, abs=1e-8)


def test_stop_of_unknown_surface() -> None:
    with pytest.raises(UsageError, match="s0"):
        solve(observed(x), (0,), (0, 1), stop=Stop("s9"))
