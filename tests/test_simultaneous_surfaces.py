"""Several surfaces at one instant that need no classification: observers of one, and blocks side by side."""

import math
import random

import numpy as np
import pytest

from filippov import EventKind, Solution, Surface, System, UserEvent, solve
from filippov.model.symbols import Abs, Expr, sign, sin, states, t

KINDS = ("friction", "belt", "relay", "plane", "kink", "hysteresis")


def block(kind: str, x: Expr, v: Expr, rng: random.Random) -> tuple[dict[Expr, Expr], Expr]:
    """An oscillator with a jump, and the function of the surface across which it is."""
    force, omega, mu = rng.choice([0.5, 1.2, 2.0]), rng.uniform(0.3, 2), rng.choice([0.1, 0.3, 0.6])
    pull = force * sin(omega * t)
    if kind in ("friction", "belt"):
        speed = v if kind == "friction" else v - 0.2
        return {x: v, v: -x - mu * sign(speed) + pull}, speed
    if kind == "relay":
        return {x: v, v: -x - 0.4 * v - sign(x + 0.3 * v)}, x + 0.3 * v
    if kind == "plane":
        return {x: v - 0.2 * sign(x), v: -x - mu * sign(v) + pull}, v
    if kind == "kink":
        return {x: v, v: -x - 0.1 * v - Abs(x - 0.2) + pull}, x - 0.2
    return {x: v, v: -x - 0.2 * v - sign(x - 0.1) + pull}, x - 0.1


def built(kind: str, count: int, seed: int) -> tuple[System, list[Expr]]:
    """So many equal blocks side by side; the functions of their surfaces."""
    symbols = states(" ".join(f"x{i} v{i}" for i in range(count)))
    equations: dict[Expr, Expr] = {}
    functions = []
    for x, v in zip(symbols[::2], symbols[1::2], strict=True):
        own, h = block(kind, x, v, random.Random(seed))  # noqa: S311
        equations |= own
        functions.append(h)
    surfaces = [Surface(f"h{i}", h, width=0.05) for i, h in enumerate(functions)]
    return System(equations, surfaces=surfaces if kind == "hysteresis" else []), functions


def passed(run: Solution, surface: int) -> list[float]:
    """When h comes to 0, by a crossing or onto a slide, and when it goes back from there."""
    times, side = [], 0
    for e in run.events:
        if e.index != surface or e.kind is EventKind.GRAZING:
            continue
        before, after = e.before[surface], e.after[surface]
        if before != 0:
            times.append(e.t)
            side = before
        elif after == side:
            times.append(e.t)
    return times


@pytest.mark.parametrize("kind", KINDS[:5])
@pytest.mark.parametrize("seed", range(4))
def test_a_user_event_on_a_surface_is_where_that_is_reached(kind: str, seed: int) -> None:
    """g = h, -h or 2 h: the same solution, and an event wherever h comes to 0; none while it stays there."""
    system, (h,) = built(kind, 1, seed)
    start = [random.Random(seed).uniform(-1.5, 1.5), 0.9]  # noqa: S311
    plain = solve(system, start, (0, 40))
    run = solve(system, start, (0, 40), events=[h, -h, 2 * h])
    m = len(system.surfaces)
    number = next(i for i, s in enumerate(system.surfaces) if s.h == h)
    assert run.success
    own = [(e.t, e.index, e.kind, str(e.before)) for e in run.events if e.index < m]
    expected = [(e.t, e.index, e.kind, str(e.before)) for e in plain.events]
    assert [e[1:] for e in own] == [e[1:] for e in expected]
    assert [e[0] for e in own] == pytest.approx([e[0] for e in expected], abs=1e-8)
    assert run.x_end == pytest.approx(plain.x_end, abs=1e-7)
    for times in run.t_events[m:]:
        assert times == pytest.approx(passed(run, number), abs=1e-12)
    groups = {e.t: e.group for e in run.events if e.index == number}
    assert all(e.group == groups[e.t] for e in run.events if e.index >= m)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_equal_blocks_side_by_side_move_as_one_does(kind: str, seed: int) -> None:
    start = [random.Random(seed).uniform(-1.5, 1.5), 0.9]  # noqa: S311
    one, many = built(kind, 1, seed)[0], built(kind, 5, seed)[0]
    alone, run = solve(one, start, (0, 40)), solve(many, start * 5, (0, 40))
    assert run.success
    assert len(run.events) == 5 * len(alone.events)
    times = sorted(e.t for e in alone.events)
    assert sorted(e.t for e in run.events) == pytest.approx(np.repeat(times, 5), abs=1e-7)
    assert np.reshape(run.x_end, (5, 2)) == pytest.approx(np.tile(alone.x_end, (5, 1)), abs=1e-6)
    assert np.ptp(np.reshape(run.x_end, (5, 2)), axis=0) == pytest.approx([0, 0], abs=1e-12)


def test_what_decays_along_a_slide_comes_to_zero_once_at_most() -> None:
    """x' = -x/0.3 on x + 0.3 x' = 0: after 30 times 0.3 what is left of x and x' is rounding."""
    x, v = states("x v")
    system = System({x: v, v: -x - 0.4 * v - sign(x + 0.3 * v)})
    run = solve(system, [0.5, -1.0], (0, 40), events=[x, v, x + 0.3 * v])
    t1 = next(e.t for e in run.events if e.kind is EventKind.ENTRY)
    assert run.t_events[3][-1] == t1
    for times in run.t_events[1:3]:
        late = times[times > t1]
        assert len(late) <= 1
        assert all(late > t1 + 30 * 0.3)


def test_a_terminal_event_on_a_surface_ends_the_run_there() -> None:
    """x = 2 - (t - 1)^2/2 from rest of the pull: x'' = -1 until v = 0, where it sticks."""
    x, v = states("x v")
    run = solve(System({x: v, v: -2 * sign(v) + 1}), [0.0, 1.0], (0, 5), events=[UserEvent(v, terminal=True)])
    assert run.t_end == pytest.approx(1.0, abs=1e-12)
    assert run.x_end == pytest.approx([0.5, 0.0], abs=1e-12)
    again = solve(System({x: v, v: -2 * sign(v) + 1}), [0.0, 1.0], (0, 5), events=[UserEvent(v, terminal=2)])
    assert again.t_end == 5.0
    assert again.t_events[1] == pytest.approx([1.0], abs=1e-12)


def impacts(e: float, until: float) -> tuple[list[float], list[float]]:
    """Times of impacts and of the tops between them, of a ball that falls from 1 with x'' = -1."""
    speed, now, hits, tops = math.sqrt(2.0), math.sqrt(2.0), [], []
    while now < until:
        hits.append(now)
        speed *= e
        tops.append(now + speed)
        now += 2 * speed
    return hits, [top for top in tops if top < until]


@pytest.mark.parametrize("drag", [False, True])
@pytest.mark.parametrize("function", [False, True])
def test_an_impact_is_an_event_of_a_function_that_is_zero_there(drag: bool, function: bool) -> None:
    """y = 0 is reached with a speed at every impact; y' jumps over 0 there and has a root at every top."""
    y, v, z = states("y v z")
    floor = Surface("floor", y, reset={v: -0.8 * v})
    # A sign of y' that acts on z alone: the surface over which each impact leads.
    equations = {y: v, v: -1 + 0 * y, z: sign(v) if drag else v}
    called = [lambda t, x: x[0], lambda t, x: -2 * x[0], lambda t, x: x[1]]
    events = called if function else [y, -2 * y, v]
    system = System(equations, surfaces=[floor])
    run = solve(system, [1.0, 0.0, 0.0], (0, 9), events=events)
    hits, tops = impacts(0.8, 9.0)
    first = len(run.t_events) - 3
    assert run.t_events[first] == pytest.approx(hits, abs=1e-11)
    assert run.t_events[first + 1] == pytest.approx(hits, abs=1e-11)
    assert run.t_events[first + 2] == pytest.approx(sorted([*hits, *tops]), abs=1e-11)
    # z' = sgn y': up from each impact to the top, and down from there.
    last = min([*hits, *tops], key=lambda at: 9.0 - at)
    ups = sum(top - hit for hit, top in zip(hits, tops, strict=False))
    downs = sum(at - top for at, top in zip(hits[1:], tops, strict=False)) + hits[0]
    rest = 9.0 - last
    expected = ups - downs + (rest if last in hits else -rest)
    if drag:
        assert run.x_end[2] == pytest.approx(expected, abs=1e-10)
    falling = UserEvent(events[0], direction=-1, terminal=3)
    assert solve(system, [1, 0, 0], (0, 9), events=falling).t_end == pytest.approx(hits[2])
    rising = UserEvent(events[0], direction=1)
    assert not len(solve(system, [1, 0, 0], (0, 9), events=rising).t_events[-1])


@pytest.mark.parametrize("seed", range(6))
def test_neurons_that_fire_over_thresholds_of_others(seed: int) -> None:
    """x' = c - x, reset to 0 at 1: spikes at multiples of ln(c/(c - 1)); z' = sgn(x - 1/2)."""
    c = random.Random(seed).uniform(1.1, 2.0)  # noqa: S311
    x, z = states("x z")
    system = System({x: c - x, z: sign(x - 0.5)}, surfaces=[Surface("fire", 1 - x, reset={x: 0 * x})])
    run = solve(system, [0.0, 0.0], (0, 12), events=[1 - x, x - 0.5, x], rtol=1e-12, atol=1e-13)
    period, half = math.log(c / (c - 1)), math.log(c / (c - 0.5))
    spikes = period * np.arange(1, int(12 / period) + 1)
    assert run.t_events[-3] == pytest.approx(spikes, abs=1e-10)
    halves = np.arange(0, 12, period) + half
    assert run.t_events[-2] == pytest.approx(np.sort([*halves[halves < 12], *spikes]), abs=1e-10)
    cycles, left = divmod(12, period)
    rest = -min(left, half) + max(left - half, 0)
    assert run.x_end[1] == pytest.approx(cycles * (period - 2 * half) + rest, abs=1e-9)
