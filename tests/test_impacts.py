"""Impacts at one instant, chains through resting contacts, clocks beside impacts: closed forms."""

import itertools
import math
import os
from functools import cache

import numpy as np
import pytest

from filippov import (
    ModelError,
    Status,
    Surface,
    System,
    TimeEvent,
    UsageError,
    cos,
    parameters,
    sign,
    sin,
    solve,
    states,
    t,
)
from filippov.model.comparator import Hysteresis
from filippov.solving.solution import Solution

G = 9.81
DRAWS = {"default": 20, "ci": 60, "nightly": 2000}[os.environ.get("FILIPPOV_PROFILE", "default")]


def fall(height: float, e: float, end: float) -> float:
    """Height at `end` of a ball let go at rest."""
    flight, speed, begin, y = math.sqrt(2 * height / G), 0.0, 0.0, height
    while end > begin + flight:
        begin += flight
        speed = e * (speed if y == 0.0 else math.sqrt(2 * G * height))
        y, flight = 0.0, 2 * speed / G
        if flight < 1e-12:
            return 0.0
    return y + speed * (end - begin) - G * (end - begin) ** 2 / 2


@cache
def balls(n: int) -> System:
    """n balls side by side over one floor at a."""
    y, v = states(" ".join(f"y{i}" for i in range(n))), states(" ".join(f"v{i}" for i in range(n)))
    p = parameters(e=0.7, a=0.0)
    floors = [Surface(f"floor {i}", y[i] - p.a, reset={v[i]: -p.e * v[i]}) for i in range(n)]
    return System(dict(zip(y, v, strict=True)) | dict.fromkeys(v, -G), surfaces=floors)


@pytest.mark.parametrize("n", [2, 3])
def test_11_1_identical_balls_land_together_wherever_the_floor_is(n: int) -> None:
    random = np.random.default_rng(n)
    for floor in (0.0, 0.1, -1.0, *random.uniform(-10, 10, DRAWS // 4)):
        height, e, end = random.uniform(0.5, 2), random.uniform(0.2, 0.9), random.uniform(1, 6)
        start = [floor + height] * n + [0.0] * n
        run = solve(balls(n), start, (0, end), parameters={"e": e, "a": floor}, zeno="continue")
        assert run.success
        assert run.x_end[:n] - floor == pytest.approx([fall(height, e, end)] * n, abs=1e-8), (floor, e, end)
        assert np.min(run.sol(np.linspace(0, end, 801))[:n]) > floor - 1e-9


def test_11_1_equal_bodies_in_another_order_give_the_answer_in_that_order() -> None:
    random = np.random.default_rng(5)
    for _ in range(DRAWS // 4):
        y, v = random.choice([0.3, 0.7, random.uniform(0.1, 1)], 3), random.choice([0.0, -1.0, 2.0], 3)
        turned = random.permutation(3)
        ends = [
            solve(balls(3), (*y[k], *v[k]), (0, 2.5), zeno="continue").x_end
            for k in (np.arange(3), turned)
        ]
        assert ends[1] == pytest.approx(np.concatenate([ends[0][:3][turned], ends[0][3:][turned]]), abs=1e-7)


@cache
def kicked() -> System:
    """A ball on a floor whose velocity a clock changes by u at t = 1."""
    y, v = states("y v")
    p = parameters(e=0.5, u=1.0)
    return System(
        {y: v, v: -G + 0 * y},
        surfaces=[Surface("floor", y, reset={v: -p.e * v})],
        time_events=[TimeEvent("kick", times=(1.0,), reset={v: v + p.u})],
    )


def test_F5_a_resting_ball_that_is_kicked_leaves_or_strikes_the_floor() -> None:
    run = solve(kicked(), (0, 0), (0, 1.15))
    assert run.x_end == pytest.approx([0.15 - G * 0.15**2 / 2, 1 - 0.15 * G], abs=1e-12)
    random = np.random.default_rng(1)
    for _ in range(DRAWS):
        e, u = random.uniform(0, 1), random.uniform(-3, 3)
        up = u if u > 0 else -e * u
        flight = 2 * up / G
        s = random.uniform(0, 1) * flight
        run = solve(kicked(), (0, 0), (0, 1 + s), parameters={"e": e, "u": u})
        assert run.success
        assert run.x_end == pytest.approx([up * s - G * s**2 / 2, up - G * s], abs=1e-9)
        assert [event.surface for event in run.events][:2] == ["floor", "kick"]


def test_F7_an_impact_and_a_clock_at_one_instant_that_do_not_commute_are_named() -> None:
    height = G / 2
    run = solve(kicked(), (height, 0), (0, 2))
    assert run.status is Status.NON_UNIQUE
    assert run.t_end == 1
    assert "'floor'" in run.message
    assert "'kick'" in run.message
    assert solve(kicked(), (height, 0), (0, 1.1), parameters={"u": 0}).success


@cache
def row(n: int) -> System:
    """n bodies on a line without gravity; masses m0 ..., restitution e."""
    y, v = states(" ".join(f"y{i}" for i in range(n))), states(" ".join(f"v{i}" for i in range(n)))
    p = parameters(e=1.0, **{f"m{i}": 1.0 for i in range(n)})
    contacts = []
    for i in range(1, n):
        low, high = v[i - 1], v[i]
        a, b = getattr(p, f"m{i - 1}"), getattr(p, f"m{i}")
        after = {
            low: low - (1 + p.e) * b * (low - high) / (a + b),
            high: high + (1 + p.e) * a * (low - high) / (a + b),
        }
        contacts.append(Surface(f"contact {i}", y[i] - y[i - 1], reset=after))
    return System(dict(zip(y, v, strict=True)) | dict.fromkeys(v, 0 * y[0]), surfaces=contacts)


def test_11_4_the_touching_cradle_hands_its_motion_on() -> None:
    for law in ("raise", "sequential"):
        run = solve(row(3), (-1, 0, 0, 1, 0, 0), (0, 2), simultaneous=law)
        assert run.x_end[3:] == pytest.approx([0, 0, 1], abs=1e-12)
    # All contacts at once: L+ = -L of the first, L+ = 0 of the second.
    run = solve(row(3), (-1, 0, 0, 1, 0, 0), (0, 2))
    assert {e.surface for e in run.events.of(kind="reset")} == {"contact 1", "contact 2"}


def test_11_4_a_body_struck_from_both_sides() -> None:
    start = (-1, 0, 1, 1, 0, -1)
    named = solve(row(3), start, (0, 2))
    assert named.status is Status.NON_UNIQUE
    assert named.t_end == pytest.approx(1, abs=1e-14)
    assert "simultaneous=" in named.message
    for law in ("sequential", "generalised Newton"):
        run = solve(row(3), start, (0, 2), simultaneous=law)
        assert run.x_end == pytest.approx([-1, 0, 1, -1, 0, 1], abs=1e-12)
    uneven = {"m0": 1.0, "m1": 0.5, "m2": 1.5}
    run = solve(row(3), start, (0, 2), parameters=uneven, simultaneous="generalised Newton")
    # Elastic: both gaps open as fast as they closed; momentum -0.5 stays.
    assert np.diff(run.x_end[3:]) == pytest.approx([1, 1], abs=1e-12)
    assert run.x_end[3:] @ [1, 0.5, 1.5] == pytest.approx(-0.5, abs=1e-12)
    assert run.x_end[3:] ** 2 @ [1, 0.5, 1.5] == pytest.approx(2.5, abs=1e-12)
    # Both are struck as fast. The order decides, but for masses whose wedge has an angle pi/k: here pi/4.
    assert solve(row(3), start, (0, 2), parameters=uneven, simultaneous="sequential").success
    other = solve(row(3), start, (0, 2), parameters=uneven | {"m2": 1.7}, simultaneous="sequential")
    assert other.status is Status.NON_UNIQUE
    faster = solve(row(3), (-2, 0, 1, 2, 0, -1), (0, 2), parameters=uneven, simultaneous="sequential")
    assert faster.success
    assert faster.x_end[3:] @ [1, 0.5, 1.5] == pytest.approx(0.5, abs=1e-12)
    assert faster.x_end[3:] ** 2 @ [1, 0.5, 1.5] == pytest.approx(5.5, abs=1e-12)
    with pytest.raises(UsageError, match="simultaneous"):
        solve(row(3), start, (0, 2), simultaneous="newton")


def test_11_4_a_jump_over_a_threshold_fires_it() -> None:
    u, w = states("u w")
    p = parameters(kick=1.3)
    neuron = System(
        {u: 1 + 0 * u, w: 0 * u},
        surfaces=[Surface("threshold", u - 1, side="-", reset={u: 0, w: w + 1})],
        time_events=[TimeEvent("kick", times=(0.5,), reset={u: u + p.kick})],
    )
    random = np.random.default_rng(3)
    for kick in (1.8, *random.uniform(-1, 3, DRAWS // 4)):
        run = solve(neuron, (0, 0), (0, 1.4), parameters={"kick": kick})
        after = 0.0 if 0.5 + kick > 1 else 0.5 + kick
        count, u_end = float(0.5 + kick > 1), after + 0.9
        if u_end > 1:
            count, u_end = count + 1, u_end - 1
        assert run.x_end == pytest.approx([u_end, count], abs=1e-12), kick


def test_11_4_resets_without_end_are_named() -> None:
    u, w = states("u w")
    loop = System(
        {u: 1 + 0 * u, w: 1 + 0 * u},
        surfaces=[
            Surface("up", u - 1, side="-", reset={u: -1, w: w + 2}),
            Surface("over", w - 2, side="-", reset={w: 0, u: u + 3}),
        ],
    )
    run = solve(loop, (0, 0), (0, 5))
    assert run.status is Status.NO_CONTINUATION
    assert "follow each other" in run.message


def test_11_5_rest_on_a_surface_without_contact_is_named() -> None:
    y, v = states("y v")
    bare = System({y: v, v: -G + 0 * y}, surfaces=[Surface("floor", y, reset={v: -v / 2}, contact=False)])
    run = solve(bare, (0, 0), (0, 1))
    assert run.status is Status.ZENO
    assert run.t_end == 0
    assert "'floor'" in run.message
    plain = System(
        field=lambda t, x, p, s: [x[1], -G],
        surfaces=[Surface("floor", lambda t, x, p: x[0], reset=lambda t, x, p: [x[0], -x[1] / 2])],
        states="y v",
    )
    assert solve(plain, (0, 0), (0, 1)).status is Status.ZENO
    # A surface that the motion runs through with rate 0 resets it all the same: h = -t**3.
    a, c = states("a c")
    gate = System({a: -3 * t**2 + 0 * a, c: 0 * a}, surfaces=[Surface("gate", a, reset={c: c + 1})])
    run = solve(gate, (1, 0), (-1, 1))
    assert run.success
    assert run.x_end == pytest.approx([-1, 1], abs=1e-9)


def test_F6_a_nearly_plastic_ball_stays_above_its_moving_table() -> None:
    y, v = states("y v")
    p = parameters(e=0.05, a=2.02, d=0.01, w=2.0)
    speed = p.w * cos(p.w * t)
    table = System(
        {y: v, v: p.a * cos(p.w * t) - p.d * v},
        surfaces=[Surface("table", y - sin(p.w * t), reset={v: speed - p.e * (v - speed)})],
    )
    near = {"w": 2.0, "a": 2.02, "d": 0.01}
    known = [
        ((1.7762366413183597, -1.0965222863307025), 0.013330915877693066),
        ((1.7908335512636762, -1.320046194122349), 0.015831739041670748),
        ((1.4549040416359618, -0.9570325829851645), 0.04972240199891928),
    ]
    for start, e in known:
        run = solve(table, start, (0, 20), parameters={"e": e, **near}, zeno="continue")
        assert run.success, (start, e, run.message)
        assert np.min(run.sol(at := np.linspace(0, 20, 4001))[0] - np.sin(2 * at)) > -1e-9, (start, e)
    random = np.random.default_rng(6)
    for _ in range(2 * DRAWS):
        e, w = float(np.exp(random.uniform(math.log(1e-3), math.log(0.1)))), random.uniform(1, 3)
        start = (random.uniform(0.0, 1.0), random.uniform(-2, 2))
        values = {"e": e, "w": w, "a": random.uniform(0.5, 3), "d": random.choice([0.0, 0.01])}
        run = solve(table, start, (0, 10), parameters=values, zeno="continue")
        assert run.success, (start, values, run.message)
        above = run.sol(at := np.linspace(0, 10, 2001))[0] - np.sin(w * at)
        assert np.min(above) > -1e-9, (start, values)


def dropped(e0: float, e1: float, speed: float) -> list[float]:
    """Velocities of two equal balls, the lower one resting on a floor, after the upper one strikes it."""
    v = [0.0, -speed]
    for _ in range(100_000):
        if v[1] < v[0] - 1e-13 * speed:
            mean, part = (v[0] + v[1]) / 2, e1 * (v[0] - v[1]) / 2
            v = [mean - part, mean + part]
        elif v[0] < -1e-13 * speed:
            v[0] *= -e0
        else:
            break
    return v


def test_11_2_a_ball_dropped_on_a_resting_ball_drives_it_off_the_floor() -> None:
    from stacks import stack

    random = np.random.default_rng(2)
    speed = math.sqrt(2 * 10.0)
    for k in range(DRAWS // 2):
        e0, e1 = random.uniform(0, 1, 2) if k else (0.5, 0.5)
        values = {"e0": e0, "e1": e1}
        run = solve(stack(2), (0, 1, 0, 0), (0, speed / 10 + 1e-6), parameters=values, zeno="continue")
        first = run.events.of("contact 1", "reset")[0]
        for v, exact in zip(first.x_after[2:], dropped(e0, e1, speed), strict=True):
            # A flight v**2 / (2 g) that is no higher than a hundred roundings of the heights may be none.
            none = abs(v) < 1e-12 and exact**2 < 2 * 10.0 * 100 * np.finfo(float).eps
            assert none or v == pytest.approx(exact, abs=1e-8), (e0, e1)


def plain_twin(e0: float, e1: float) -> Solution:
    """The stack of two as plain functions."""
    system = System(
        field=lambda t, x, p, s: [x[2], x[3], -10.0, -10.0],
        surfaces=[
            Surface("floor", lambda t, x, p: x[0], reset=lambda t, x, p: [x[0], x[1], -e0 * x[2], x[3]]),
            Surface(
                "contact 1",
                lambda t, x, p: x[1] - x[0],
                reset=lambda t, x, p: [
                    x[0], x[1],
                    (x[2] + x[3]) / 2 - e1 * (x[2] - x[3]) / 2, (x[2] + x[3]) / 2 + e1 * (x[2] - x[3]) / 2,
                ],
            ),
        ],
        states="y0 y1 v0 v1",
    )  # fmt: skip
    return solve(system, (0.5, 1, -1, 0), (0, 0.5))


def test_11_2_plain_functions_bounce_alike() -> None:
    from stacks import stack

    random = np.random.default_rng(8)
    for _ in range(3):
        e0, e1 = random.uniform(0.6, 1, 2)
        run = solve(stack(2), (0.5, 1, -1, 0), (0, 0.5), parameters={"e0": e0, "e1": e1})
        twin = plain_twin(e0, e1)
        assert twin.status is run.status
        assert twin.x_end == pytest.approx(run.x_end, abs=1e-7)


@cache
def landing() -> System:
    """A body that lands with restitution e: the speed u along the floor is multiplied by k, n counts."""
    y, v, u, n = states("y v u n")
    p = parameters(e=0.0, k=0.5)
    floor = Surface("floor", y, reset={v: -p.e * v, u: p.k * u + 0.1 * v, n: n + 1})
    return System({y: v, v: -G + 0 * y, u: 0 * u, n: 0 * n}, surfaces=[floor])


def test_11_3_a_landing_that_changes_other_states_keeps_its_contact() -> None:
    assert landing().surfaces[0].contact is True
    random = np.random.default_rng(9)
    for _ in range(DRAWS // 4):
        height, u, k = random.uniform(0.2, 2), random.uniform(-3, 3), random.uniform(0, 1)
        run = solve(landing(), (height, 0, u, 0), (0, 3), parameters={"k": k})
        fallen = math.sqrt(2 * height / G)
        assert run.success
        assert run.end_mode == (0,)
        # The floor pushes along the direction of its impacts: with dv goes -0.1 dv of u.
        after = k * u - 0.1 * G * fallen - 0.1 * G * (3 - fallen)
        assert run.x_end == pytest.approx([0, 0, after, 1], abs=1e-8)
    counted = solve(landing(), (1, 0, 0, 0), (0, 3), parameters={"e": 0.5}, zeno="continue")
    assert counted.status is Status.ZENO
    assert "'n'" in counted.message
    held = solve(landing(), (1, 0, 0, 0), (0, 0.6), parameters={"e": 0.5})
    assert held.x_end[3] == 1


def test_11_3_a_landing_without_contact_is_named_with_its_reason() -> None:
    y, v = states("y v")
    mud = Surface("mud", y, reset={v: 0}, contact=False)
    sunk = System({y: v, v: -G + 0 * y}, surfaces=[mud])
    run = solve(sunk, (1, 0), (0, 3))
    assert run.status is Status.ZENO
    assert run.t_end == pytest.approx(math.sqrt(2 / G), abs=1e-9)
    assert "contact=False" in run.message


def test_F15_a_ball_between_closing_walls_ends_where_they_meet() -> None:
    y, v = states("y v")
    p = parameters(c=0.2)
    low = Surface("low", y + 1 - p.c * t, reset={v: 2 * p.c - v})
    high = Surface("high", y - 1 + p.c * t, side="-", reset={v: -2 * p.c - v})
    press = System({y: v, v: 0 * y}, surfaces=[low, high])
    random = np.random.default_rng(15)
    drawn = [(random.uniform(-0.9, 0.9, 2), random.uniform(0.1, 1)) for _ in range(4)]
    for start, c in (((0.1, 0.5), 0.2), *drawn):
        run = solve(press, start, (0, 2 / c), parameters={"c": c}, max_events=4000)
        assert run.status is Status.ZENO
        assert run.zeno is not None
        assert run.zeno.t == pytest.approx(1 / c, rel=1e-3)
        assert abs(run.zeno.t - 1 / c) <= run.zeno.error
        # What is watched has no part in the law: half of the events here, and of the budget.
        watched = solve(
            press, start, (0, 2 / c), parameters={"c": c}, max_events=8000, events=[y, y - 0.3 * v]
        )
        assert watched.status is Status.ZENO
        assert watched.zeno is not None
        assert abs(watched.zeno.t - 1 / c) <= watched.zeno.error <= 1e-2 / c
        assert set(watched.zeno.surfaces) == {0, 1}
    slow = solve(press, (0.1, 0.5), (0, 1e9), parameters={"c": 1e-12}, max_events=4000)
    assert slow.status is Status.MAX_EVENTS  # a regular sequence is no accumulation


def test_11_5_counted_events_keep_those_of_the_user() -> None:
    y, v = states("y v")
    run = solve(System({y: v, v: -y}), (1, 0), (0, 2000), events=[y - 0.5, v], save_events="count")
    turns = 2 * math.pi * np.arange(320)
    falls, rises = turns + math.pi / 3, turns - math.pi / 3
    expected = np.sort(np.concatenate([falls, rises]))
    expected = expected[(expected > 0) & (expected < 2000)]
    assert run.t_events[0] == pytest.approx(expected, abs=1e-6)
    assert run.t_events[1] == pytest.approx(math.pi * np.arange(1, 637), abs=1e-6)


def test_14_it_must_show_counted_events_are_the_last_of_all() -> None:
    y, v = states("y v")
    observed = System({y: v, v: -y}, surfaces=[Surface("y", y, kind="observer")])
    relay = System({y: v, v: -y - 0.3 * sign(v)}).with_comparator(Hysteresis(1e-2))
    for system, end in ((observed, 9e3), (relay, 50)):
        every, counted = (solve(system, (1, 0), (0, end), save_events=kept) for kept in ("all", "count"))
        last = every.events[-len(counted.events) :]
        assert 60 <= len(counted.events) < len(every.events)
        assert counted.event_counts == every.event_counts
        assert [(e.t, e.kind, e.group) for e in counted.events] == [(e.t, e.kind, e.group) for e in last]


def test_11_6_roots_closer_than_rounding_are_all_found_or_named() -> None:
    y, v = states("y v")
    eps = float(np.finfo(float).eps)
    line = System({y: 1 + 0 * y, v: 0 * y})
    places = [1 + 20 * k * eps for k in range(5)]
    run = solve(line, (0, 0), (0, 2), events=[y - place for place in places])
    assert [len(times) for times in run.t_events] == [1] * 5
    assert np.concatenate(run.t_events) == pytest.approx(places, rel=100 * eps)
    h = math.prod(y - place for place in places)
    run = solve(line, (0, 0), (0, 2), events=[h])
    assert run.t_events[0] == pytest.approx([1], abs=1e-9)
    assert "not resolved" in run.events[-1].note
    for apart, size in itertools.product((1, 5, 20, 100, 1e4), (1.0, 3.0, 1e-3)):
        places = [1 + apart * k * eps for k in range(5)]
        h = lambda t, x: size * math.prod(x[0] - q for q in places)  # noqa: B023, E731
        run = solve(line, (0, 0), (0, 2), events=[h])
        assert run.t_events[0] == pytest.approx([1], abs=1e-9)
        assert "not resolved" in run.events[-1].note
        # One that takes no dual numbers is differenced, and its order is noise.
        try:
            run = solve(line, (0, 0), (0, 2), events=[lambda t, x: h(t, [float(x[0])])])  # noqa: B023
        except ModelError as error:
            assert "factors apart" in str(error)  # noqa: PT017 - it may be found as well
        else:
            assert run.t_events[0] == pytest.approx([1], abs=1e-9)
            assert "not resolved" in run.events[-1].note


def test_11_6_a_root_of_a_plain_function_is_near_or_refused() -> None:
    """Three or five roots in one place of functions that are differenced: Newton's steps to them may stop."""
    y, v = states("y v")
    line, eps, rng = System({y: 1 + 0 * y, v: 0 * y}), float(np.finfo(float).eps), np.random.default_rng(1)
    for _ in range(60):
        count, apart, size = int(rng.choice([3, 5])), 10 ** rng.uniform(0, 5), 10 ** rng.uniform(-6, 6)
        places = [float(rng.uniform(0.3, 1.7))] * count + eps * apart * np.arange(count)
        h = lambda t, x: size * math.prod(float(x[0]) - q for q in places)  # noqa: B023, E731
        try:
            found = solve(line, (0, 0), (0, 2), events=[h]).t_events[0]
        except ModelError as error:
            assert "factors apart" in str(error)  # noqa: PT017 - it may be found as well
        else:
            assert found == pytest.approx([places[0]], abs=1e-9)
