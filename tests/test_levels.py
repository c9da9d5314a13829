"""Static friction above the sliding one whose load depends on the acceleration, against the formulas of rest.

x'' = (F - mu g s)/(1 + mu k s): the load is g + k x''. At rest it is g, and what breaks away is F = Fs mu g,
whatever k is. The equilibria said so; solutions broke away at the multiplier Fs of the blend of both sides.
"""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from filippov import ModelError, Surface, System, parameters, sign, sin, solve, states, t
from filippov.analysis import equilibria, flow_derivative

x, v = states("x v")


def block(force, mu, g, k, level, **names):
    load = (force - mu * g * sign(v)) / (1 + mu * k * sign(v))
    return System({x: v, v: load}, surfaces=[Surface("v", v, radius=level)], **names)


def followed(a, w, c, mu, g, k, level, end):
    """The same block under a sin(w t) - c x, stop by stop, by scipy."""
    at, y, side, out = 0.0, np.zeros(2), 0, []

    def force(now, place):
        return a * np.sin(w * now) - c * place

    def field(now, Y, way, _):
        return [Y[1], (force(now, Y[0]) - mu * g * way) / (1 + mu * k * way)]

    def leaves(now, Y, *_):
        return level * mu * g - abs(force(now, Y[0]))

    def stops(now, Y, way, since):
        return way * Y[1] if since + 1e-6 < now else 1.0

    for event in (leaves, stops):
        event.terminal, event.direction = True, -1
    while True:
        given = {"args": (side, at), "max_step": 0.01, "rtol": 1e-12}
        if side == 0:
            run = solve_ivp(lambda now, Y, *_: [0, 0], (at, end), y, events=leaves, **given)
        else:
            run = solve_ivp(field, (at, end), y, "DOP853", events=stops, atol=1e-13, **given)
        at, y = run.t[-1], run.y[:, -1].copy()
        if run.status == 0:
            return np.array(out), y
        out.append(at)
        if side == 0:
            side = 1 if force(at, y[0]) > 0 else -1
        else:
            y[1] = 0.0
            side = 0 if abs(force(at, y[0])) < level * mu * g else (1 if force(at, y[0]) > 0 else -1)


@pytest.mark.parametrize("seed", range(8))
def test_blocks_whose_load_follows_the_acceleration(seed):
    draw = np.random.default_rng(seed)
    mu, g, k, level = draw.uniform(0.2, 0.6), 10.0, draw.uniform(-0.8, 0.8), draw.uniform(1.1, 1.9)
    a, w, c = draw.uniform(1.2, 2.5) * level * mu * g, draw.uniform(0.5, 1.5), draw.uniform(0, 1)
    names = parameters(level=level)
    run = solve(block(a * sin(w * t) - c * x, mu, g, k, names.level), (0, 0), (0, 12))
    times, last = followed(a, w, c, mu, g, k, level, 12)
    assert run.success
    assert len(times) > 2
    assert np.allclose(run.events.t, times, rtol=0, atol=1e-8)
    assert np.allclose(run.x_end, last, rtol=0, atol=1e-7)


@pytest.mark.parametrize("rule", ["filippov", "utkin", "moments"])
def test_every_rule_breaks_away_at_the_same_load(rule):
    run = solve(block(9 * sin(t), 0.5, 10, 0.6, 1.5), (0, 0), (0, 1.5), sliding=rule)
    assert abs(run.events[0].t - np.arcsin(7.5 / 9)) < 1e-12


def test_rest_is_where_the_equilibria_are():
    """x = 7 was an equilibrium, and left."""
    spring = block(-x - 0.1 * v, 0.5, 10, 0.6, 1.5)
    (rest,) = equilibria(spring).sets
    assert "[-7.5, 7.5]" in str(rest)
    for at in (7.49, -7.49, 5.5):
        assert solve(spring, (at, 0), (0, 1)).modes == ("0",)
    for at in (7.51, -7.51):
        assert solve(spring, (at, 0), (0, 1)).modes[0] == ("-" if at > 0 else "+")
    again = pickle.loads(pickle.dumps(spring))  # noqa: S301 - our own
    assert solve(again, (7.49, 0), (0, 1)).modes == ("0",)


def test_powers_of_a_sign_are_those_at_its_levels():
    """Friction 5 s + s^2, s in [-1.5, 1.5] at rest: the ends of rest are those of the formula."""
    spring = System({x: v, v: -x - 5 * sign(v) - sign(v) ** 2}, surfaces=[Surface("v", v, radius=1.5)])
    inside, outside = (-9.74, 5.24), (-9.76, 5.26)
    assert all(solve(spring, (at, 0), (0, 1)).modes == ("0",) for at in inside)
    assert all(solve(spring, (at, 0), (0, 1)).modes[0] != "0" for at in outside)


def test_derivative_by_the_level():
    """Force b t from rest: x(T) = b ((T^3 - t0^3)/6 - t0^2 (T - t0)/2) - c (T - t0)^2/2, over 1 + mu k."""
    p = parameters(level=1.5)
    mu, g, k, b, end = 0.5, 10.0, 0.6, 4.0, 3.0
    system = block(b * t, mu, g, k, p.level)
    t0 = 1.5 * mu * g / b
    run = solve(system, (0, 0), (0, end), rtol=1e-10)
    slope = flow_derivative(run, parameters=["level"])[:, -1]
    left = (b * t0 - mu * g) / (1 + mu * k)  # the acceleration with which it breaks away
    by_t0 = np.array([-left * (end - t0), -left])
    assert np.allclose(slope, by_t0 * mu * g / b, rtol=1e-8)


def test_what_is_refused():
    with pytest.raises(ModelError, match="jams"):
        block(-x, 0.5, 10, 0.6, 3.5)
    with pytest.raises(ModelError, match="no mixture"):
        System({x: v + sign(v) ** 2, v: -x - sign(v)}, surfaces=[Surface("v", v, radius=1.5)])
