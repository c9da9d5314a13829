"""A run that goes on from the state after a reset, also where the reset leads across its surface."""

import math

import numpy as np
import pytest

from filippov import Surface, System, cos, parameters, sin, solve, states, t
from filippov.analysis import EventMap, Section, find_orbit

# Garcia, Chatterjee, Ruina & Coleman 1998: the simplest walker on a slope of 0.009, just after a heel strike.
WALKS = (0.200310900544287, -0.199832473004977)


def walker():
    a, da, b, db = states("a da b db")
    p = parameters(slope=0.009)
    c = cos(2 * a)
    leg = sin(a - p.slope)
    strike = {a: -a, da: c * da, b: -2 * a, db: c * (1 - c) * da}
    field = {a: da, da: leg, b: db, db: leg + (da**2 - cos(a - p.slope)) * sin(b)}
    return System(field, surfaces=[Surface("strike", b - 2 * a, side="-", reset=strike)])


def after_strike(a, da):
    return (a, da, 2 * a, (1 - math.cos(2 * a)) * da)


def test_walker_from_its_published_state_walks_on():
    run = solve(walker(), after_strike(*WALKS), (0, 12), rtol=1e-11, atol=1e-13)
    strikes = run.events.of("strike", kind="reset")
    assert len(strikes) == 3
    assert abs(strikes[0].t - 3.88246375285) < 1e-8
    assert max(abs(event.x_after - after_strike(*WALKS)).max() for event in strikes) < 1e-7


def test_walker_just_before_a_strike_strikes():
    a, da = WALKS
    run = solve(walker(), (-a, da / math.cos(2 * a), -2 * a, 0.1), (0, 5), rtol=1e-11)
    strikes = run.events.of("strike", kind="reset")
    assert strikes[0].t == 0
    assert abs(strikes[0].x_after - after_strike(a, da)).max() < 1e-12
    assert abs(strikes[1].t - 3.88246375285) < 1e-8


def test_map_and_orbit_of_the_walker():
    a, da = WALKS
    start = {"a": "d", "da": f"{da / a!r}*d", "b": "2*d", "db": f"(1 - cos(2*d))*{da / a!r}*d"}
    strides = EventMap(walker(), Section("strike", "reset", "a", start))
    assert abs(strides(a) - a) < 1e-7
    orbit = find_orbit(walker(), after_strike(*WALKS))
    assert abs(orbit.multipliers[0] - (-0.190099841 + 0.557598778j)) < 1e-6
    assert abs(orbit.multipliers[2]) < 1e-9


@pytest.mark.parametrize("seed", range(12))
def test_restart_after_resets_that_lead_across(seed):
    rng = np.random.default_rng(seed)
    x, v, z = states("x v z")
    k, e, c, d = rng.uniform(0.5, 1.5, 4)
    side = "+-"[seed % 2]
    reset = {v: e * v, z: [c * z, d * v, z + c * v][seed % 3]}
    gate = Surface("gate", x, side=side, reset=reset)
    system = System({x: v, v: -k * x + 0.1 * z, z: 0.3 * x - z}, surfaces=[gate])
    whole = solve(system, (1, 0.2, 0.5), (0, 15), rtol=1e-11, atol=1e-13)
    resets = whole.events.of("gate", kind="reset")
    assert len(resets) >= 1
    for event in resets:
        half = solve(system, (1, 0.2, 0.5), (0, event.t), rtol=1e-11, atol=1e-13)
        rest = solve(system, half.x_end, (event.t, 15), rtol=1e-11, atol=1e-13)
        assert abs(rest.x_end - whole.x_end).max() < 1e-8
        assert len(half.events) + len(rest.events) == len(whole.events)


def supported(rng, kind):
    """A body on a moving table, on wavy ground, pressed onto a floor, or under a ceiling; a start off it."""
    x, v, y, w = states("x v y w")
    size, rate, e, u = rng.uniform((0.05, 1, 0, 0.5), (0.3, 4, 0.5, 1.5))
    at, g = rng.choice([0, 1.0, 50.0, -3.0]), 9.81
    motion, field, x0 = 0 * y, {y: w, w: -g}, (at + 1, 0)
    h = y - at
    if kind == 0:
        h, motion = h - size * sin(rate * t), size * rate * cos(rate * t)
    elif kind == 1:
        h, motion = h - size * sin(rate * x), size * rate * v * cos(rate * x)
        field, x0 = {x: v, v: 0 * x, y: w, w: -g}, (0, u, at + 1, 0)
    elif kind == 2:
        field = {y: w, w: -g + 3 * sin(rate * t)}
    else:
        h, field, x0 = at - y, {y: w, w: g - 0.5 * w + 3 * cos(rate * t) - y + at}, (at - 1, 0)
    return System(field, surfaces=[Surface("floor", h, reset={w: -e * w + (1 + e) * motion})]), x0


@pytest.mark.parametrize("seed", range(24))
def test_states_of_the_dense_output_rest_as_the_solution_does(seed):
    rng = np.random.default_rng(seed)
    system, x0 = supported(rng, seed % 4)
    whole = solve(system, x0, (0, 8), zeno="continue")
    if whole.modes[-1] != "0":
        return  # the table throws it off
    for at in rng.uniform(whole.segments[-1].t0, 8, 4):
        for zeno in ("stop", "continue"):
            rest = solve(system, whole.sol(at), (at, 8), zeno=zeno)
            assert rest.modes == ("0",), rest.message
            assert np.allclose(rest.x_end, whole.x_end, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("depth", [0, 1e-13, 1e-11])
def test_state_behind_a_floor_by_rounding_bounces(depth):
    y, w = states("y w")
    ball = System({y: w, w: -9.81 + 0 * y}, surfaces=[Surface("floor", y - 1, reset={w: -0.5 * w})])
    down = solve(ball, (1 - depth, -2), (0, 0.1))
    assert down.events[0].kind == "reset"
    assert abs(down.x_end - [1 + 0.1 - 4.905 * 0.01, 1 - 0.981]).max() < 1e-10
    up = solve(ball, (1 - depth, 2), (0, 0.1))
    assert abs(up.x_end - [1 + 0.2 - 4.905 * 0.01, 2 - 0.981]).max() < 1e-10
    deep = solve(ball, (0.9, -2), (0, 0.1))
    assert deep.modes == ("-",)
