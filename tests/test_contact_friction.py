"""Resting contacts with Coulomb's law at their impacts: slip, stick, break-away, lift-off, in closed form."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from filippov import Max, Min, ModelError, Smooth, Surface, Switch, System, parameters, sin, solve, states, t
from filippov.solving.ensemble import solve_many

G = 9.81
WAYS = ({"method": "DOP853"}, {"method": "Taylor"}, {"backend": "python"})
y, v, x, u = states("y v x u")


def block(side: str = "+", size: Any = abs, *, slip: bool = False) -> System:
    """A mass point above (side +) or below (side -) a rough table, with a force a along it."""
    p = parameters(g=G, e=0.5, mu=0.2, a=0.0)
    up = 1 if side == "+" else -1
    most = p.mu * (1 + p.e) * size(v)
    reset = {v: -p.e * v, u: u - Min(Max(u, -most), most)}
    floor = Surface("floor", y, side=side, reset=reset)
    own = (Surface("slip", -2 * u),) if slip else ()
    return System({y: v, v: -up * p.g, x: u, u: p.a}, surfaces=[floor, *own], parameters=p)


@pytest.mark.parametrize("way", WAYS, ids=str)
@pytest.mark.parametrize("side", ["+", "-"])
@pytest.mark.parametrize("size", [abs, lambda w: Max(w, -w)])
def test_friction_slows_a_body_that_rests_on_either_side_of_a_table(side: str, size: Any, way: Any) -> None:
    system, up = block(side, size), 1 if side == "+" else -1
    for u0 in (10.0, -10.0):
        for height in (0.0, 1.0):
            # Whether it bounces or rests, the impulse of the table is that of the weight.
            run = solve(system, (up * height, 0, 0, u0), (0, 4), zeno="continue", **way)
            assert run.success
            assert abs(run.x_end[3] - np.sign(u0) * (10 - 0.2 * G * 4)) < 1e-9


@pytest.mark.parametrize("way", WAYS, ids=str)
@pytest.mark.parametrize("side", ["+", "-"])
def test_the_slip_ends_and_the_body_sticks_until_the_force_exceeds_the_law(side: str, way: Any) -> None:
    system, u0 = block(side), 2.0
    for a in (0.0, 1.0, -1.5):
        run = solve(system, (0, 0, 0, u0), (0, 6), zeno="continue", parameters={"a": a}, **way)
        stop = u0 / (0.2 * G - a)
        assert run.success
        assert abs(run.events[-1].t - stop) < 1e-9
        assert np.allclose(run.x_end, [0, 0, u0 * stop / 2, 0], atol=1e-9)
    run = solve(system, (0, 0, 0, -u0), (0, 6), zeno="continue", parameters={"a": 3.0}, **way)
    turn = u0 / (3.0 + 0.2 * G)
    assert abs(run.x_end[3] - (3.0 - 0.2 * G) * (6 - turn)) < 1e-9


def test_a_surface_declared_where_the_contact_slips_is_that_surface() -> None:
    system = block(slip=True)
    assert system.surface_names == ("floor", "slip")
    assert block().surface_names == ("floor", "u")
    run = solve(system, (0, 0, 0, 2.0), (0, 3), zeno="continue")
    assert run.events[-1].surface == "slip"
    assert abs(run.events[-1].t - 2 / (0.2 * G)) < 1e-10


def test_rows_of_an_ensemble_end_as_alone() -> None:
    starts = np.array([[h, 0, 0, w] for h in (0.0, 0.5) for w in (-2.0, 0.0, 1.0, 12.0)])
    ends = solve_many(block(), starts, (0, 5), zeno="continue").x
    alone = [solve(block(), start, (0, 5), zeno="continue").x_end for start in starts]
    assert np.allclose(ends, alone, atol=1e-8)


@pytest.mark.parametrize("b", [-0.5, 0.5])
def test_where_normal_and_tangent_are_coupled_the_friction_changes_the_load(b: float) -> None:
    p = parameters(a=1.5, b=b, c=1.2, mu=0.4, e=0.3, g=5.0, F=0.0)
    load = -(1 + p.e) * v / p.a
    stop = -(u + p.b * load) / (p.c - p.b**2 / p.a)
    T = Min(Max(stop, -p.mu * load / (1 - p.mu * p.b / p.a)), p.mu * load / (1 + p.mu * p.b / p.a))
    floor = Surface("floor", y, reset={v: -p.e * v, u: u + p.b * (load - p.b / p.a * T) + p.c * T})
    system = System({y: v, v: -p.a * p.g + p.b * p.F, x: u, u: -p.b * p.g + p.c * p.F}, surfaces=[floor])
    inverse = np.array([[1.5, b], [b, 1.2]])
    for u0, F in ((3.0, 0.0), (-3.0, 0.0), (0.0, 1.0), (0.0, 4.0)):
        s = np.sign(u0) or np.sign(F)
        load_slip = (5.0 * 1.5 - b * F) / (1.5 - b * 0.4 * s)
        rate = (inverse @ [load_slip - 5.0, F - 0.4 * s * load_slip])[1]
        stick = u0 == 0 and abs(F) <= 0.4 * 5.0
        run = solve(system, (0, 0, 0, u0), (0, 0.5), zeno="continue", parameters={"F": F})
        assert run.success
        assert abs(run.x_end[3] - (0.0 if stick else u0 + 0.5 * rate)) < 1e-9


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_break_away_is_found_in_a_step_in_which_the_load_vanishes_later(way: Any) -> None:
    A, w, phase, B, w2, mu, g = 5.683, 3.147, 4.757, 3.686, 2.618, 0.212, 5.67
    p = parameters(mu=mu)
    most = p.mu * 1.2 * abs(v)
    floor = Surface("floor", y, reset={v: -0.2 * v, u: u - Min(Max(u, -most), most)})
    system = System({y: v, v: A * sin(w * t + phase) - g, x: u, u: B * sin(w2 * t)}, surfaces=[floor])

    def spare(at: float) -> float:
        return mu * (g - A * np.sin(w * at + phase)) - B * np.sin(w2 * at)

    leaves = brentq(spare, 2.44, 2.6, xtol=1e-14)
    lifts = brentq(lambda at: g - A * np.sin(w * at + phase), 2.8, 2.97, xtol=1e-14)
    for end in (2.97, 2.99, 2.995):
        run = solve(system, (0, 0, 0, 0), (2.44, end), zeno="continue", rtol=1e-10, atol=1e-12, **way)
        assert np.allclose(run.events.t, [leaves, lifts], rtol=0, atol=1e-8)


def test_a_smooth_sign_stands_for_that_of_the_slip_and_a_band_without_one_is_refused() -> None:
    smooth = block().with_comparator({"u": Smooth(1e-5)})
    run = solve(smooth, (0, 0, 0, 2.0), (0, 3), zeno="continue", method="Radau")
    assert run.success
    assert abs(run.x_end[2] - 4 / (2 * 0.2 * G)) < 1e-4
    with pytest.raises(ModelError, match="Choose Band or Smooth"):
        block().with_comparator({"u": Switch(1e-3)})
