"""Published analyses with answers in closed form: maps of impacts, converters, threshold policies, thresholds
of circulation, harmonic balance, border collisions. No expected value comes from this package."""

from __future__ import annotations

from itertools import pairwise
from math import asin, pi, sqrt
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from filippov import (
    Heaviside,
    Max,
    Min,
    Surface,
    System,
    TimeEvent,
    UsageError,
    cos,
    parameters,
    sign,
    sin,
    states,
    t,
)
from filippov.analysis import (
    EventMap,
    Section,
    attractors,
    continuation,
    curve,
    describing_function,
    equilibria,
    find_homoclinic,
    find_orbit,
    switch,
)  # fmt: skip

x, y, z = states("x y z")


def named(branch: Any) -> dict[str, float]:
    """The special points by name, each of which occurs once."""
    assert len({point.special for point in branch.special}) == len(branch.special)
    return {point.special: point.value for point in branch.special}


# -- border collisions: x -> A x + mu e1, A by the sign of x1 (Simpson 2016, SIAM Review 58, (2.1)) ----------


@pytest.mark.parametrize("seed", range(3))
def test_border_collision_normal_form(seed: int) -> None:
    # Fixed points mu (I - A)^-1 e1: persistence where det(I - A_L) and det(I - A_R) have one sign.
    rng = np.random.default_rng(seed)
    (tl, tr), (dl, dr) = rng.uniform(-2, 2, 2), rng.uniform(-1.2, 1.2, 2)
    p = parameters(mu=-1.0)
    image = {x: tl * Min(x, 0) + tr * Max(x, 0) + y + p.mu, y: -dl * Min(x, 0) - dr * Max(x, 0)}
    system = System({x: 0 * x, y: 0 * y}, time_events=[TimeEvent("k", period=1.0, reset=image)], parameters=p)
    left, right = (np.eye(2) - [[a, 1], [-d, 0]] for a, d in ((tl, dl), (tr, dr)))
    fixed, beyond = (np.linalg.solve(m, [1, 0]) for m in (left, right))
    mu = -np.sign(fixed[0])
    orbit = find_orbit(system, mu * fixed, parameters={"mu": mu}, period=1.0)
    run = continuation(system, orbit, parameter="mu", bounds=(-1, 1), direction=int(-mu), max_step=0.5)
    branch = run.run()
    point = next(q for q in branch.special if q.special == "border collision")
    same = np.linalg.det(left) * np.linalg.det(right) > 0
    assert point.note.startswith("persistence; " if same else "non-smooth fold; ")
    assert abs(point.value) < 1e-7
    last = branch.points[-1]
    assert bool(last.value * mu > 0) != same
    assert abs(last.coordinates["max x"] - last.value * beyond[0]) < 1e-8


# -- converters and impacts ---------------------------------------------------------------------------------


def test_current_mode_control_doubles_its_period_at_half_duty() -> None:
    # Slopes m1 (on), -m2 (off), ramp mc: multiplier -(m2 - mc)/(m1 + mc) (Deane & Hamill 1990).
    i, q, w = states("i q w")
    p = parameters(m1=2.0, m2=1.0, mc=0.5)
    off = Surface("reference", i - 5 + p.mc * w, reset={q: 0}, side="-")
    clock = TimeEvent("clock", period=1.0, reset={q: 1, w: 0})
    fields = {i: q * p.m1 - (1 - q) * p.m2, q: 0 * q, w: 1 + 0 * w}
    system = System(fields, surfaces=[off], time_events=[clock], parameters=p)
    orbit = find_orbit(system, (4, 1, 0))
    assert abs(orbit.multipliers[0] + 0.2) < 1e-9
    doubled = named(continuation(system, orbit, parameter="m2", bounds=(1, 4), direction=1).run())
    assert abs(doubled.pop("period doubling") - 3) < 1e-8
    assert not doubled


def test_ball_on_a_moving_table() -> None:
    # Holmes 1982 with the exact table, A sin t: impacts once a period at A cos(phi) = pi g (1 - e)/(1 + e),
    # so for A above the right side; the map of impacts is iterated by itself.
    e, g = 0.5, 1.0
    least = (1 - e) / (1 + e) * pi * g

    def impact(phase: float, speed: float, A: float) -> np.ndarray:
        fall = brentq(
            lambda q: speed * q - g * q * q / 2 + A * (np.sin(phase) - np.sin(phase + q)), 5, 8, xtol=1e-15
        )
        table = A * np.cos(phase + fall)
        return np.array([phase + fall, table - e * (speed - g * fall - table)])

    def doubling(A: float) -> float:
        at, h = np.array([np.arccos(least / A), g * pi]), 1e-5
        steps = h * np.eye(2)
        slope = np.array([(impact(*(at + d), A) - impact(*(at - d), A)) / (2 * h) for d in steps]).T
        return float(np.linalg.det(np.eye(2) + slope))

    p = parameters(A=least + 0.1)
    table = Surface("table", x - p.A * sin(t), reset={y: -e * y + (1 + e) * p.A * cos(t)})
    system = System({x: y, y: -g + 0 * x}, surfaces=[table], parameters=p)
    phase = float(np.arccos(least / (least + 0.1)))
    start = ((least + 0.1) * np.sin(phase) + g * pi**2 / 2, 0)
    orbit = find_orbit(system, start, t0=phase + pi)
    run = continuation(system, orbit, parameter="A", bounds=(least - 0.1, 1.7), max_step=0.2)
    found: dict[str, float] = {}
    for point in run:
        if point.special:
            found.setdefault(point.special, point.value)
        if len(found) == 2:
            break
    assert abs(found["period doubling"] - brentq(doubling, least + 0.01, 3)) < 1e-7
    assert "fold" not in found or abs(found["fold"] - least) < 1e-8


@pytest.mark.parametrize("seed", range(2))
def test_period_doubling_of_the_impact_oscillator(seed: int) -> None:
    # Shaw & Holmes 1983: one impact a period, in closed form by matrix exponentials; the period as a number.
    rng = np.random.default_rng(seed + 100)
    c, e = 2 * rng.uniform(0.02, 0.15), rng.uniform(0.5, 0.9)
    A = np.array([[0, 1], [-1, -c]])

    def steady(w: float, at: float) -> np.ndarray:
        a, b = np.array([1 - w * w, c * w]) / ((1 - w * w) ** 2 + (c * w) ** 2)
        co, si = np.cos(w * at), np.sin(w * at)
        return np.array([a * co + b * si, w * (b * co - a * si)])

    def impacts(w: float) -> tuple[float, float, np.ndarray]:
        """Phase and speed of the impact, and the derivative of its map."""
        flow = expm(2 * pi / w * A)

        def parts(at: float) -> tuple[float, float]:
            s = steady(w, at)
            speed = (-s[0] + flow[0, 0] * s[0] + flow[0, 1] * s[1]) / (-e * flow[0, 1])
            return speed, -flow[1, 0] * s[0] - flow[1, 1] * (e * speed + s[1]) - speed + s[1]

        grid = np.linspace(0, 2 * pi / w, 200)
        for low, high in pairwise(grid):
            if parts(low)[1] * parts(high)[1] < 0:
                at = brentq(lambda q: parts(q)[1], low, high, xtol=1e-15)
                speed = parts(at)[0]
                if speed > 0:
                    before = np.array([speed, -c * speed + np.cos(w * at)])
                    after = np.array([-e * speed, c * e * speed + np.cos(w * at)])
                    law = np.diag([1, -e])
                    return at, speed, (law + np.outer(after - law @ before, [1, 0]) / speed) @ flow
        raise AssertionError

    p = parameters(w=2.0)
    stop = Surface("stop", x, reset={y: -e * y}, side="-")
    system = System({x: y, y: -x - c * y + cos(p.w * t)}, surfaces=[stop], parameters=p)
    at, speed, slope = impacts(2.0)
    middle = at + pi / 2
    start = expm(pi / 2 * A) @ (np.array([0, -e * speed]) - steady(2.0, at)) + steady(2.0, middle)
    orbit = find_orbit(system, start, t0=middle, period=pi)
    multipliers = np.sort_complex(np.linalg.eigvals(slope))
    assert np.allclose(np.sort_complex(orbit.multipliers), multipliers, rtol=0, atol=1e-7)
    found = named(continuation(system, orbit, parameter="w", bounds=(1.7, 3.5)).run())
    exact = brentq(lambda w: np.linalg.det(np.eye(2) + impacts(w)[2]), 2.5, 2.8, xtol=1e-13)
    assert abs(found.pop("period doubling") - exact) < 1e-7
    assert not found


# -- planar systems -----------------------------------------------------------------------------------------


def test_threshold_policy_of_a_predator() -> None:
    # Costa & Meza 2006: harvesting above y = T. Equilibria (1/4, 3/4) below, (1/2, 1/2) above, (1 - T, T).
    p = parameters(T=0.3)
    rest = {x: x * (1 - x) - x * y, y: y * (2 * x - 0.5) - y * Heaviside(y - p.T) / 2}
    system = System(rest, parameters=p)
    for T, mode, place in ((0.3, "+", (0.5, 0.5)), (0.6, "0", (0.4, 0.6)), (0.9, "-", (0.25, 0.75))):
        inside = [q for q in equilibria(system, {"T": T}).points if q.value[1] > 0]
        assert [(q.mode, pytest.approx(q.value)) for q in inside] == [(mode, place)]
    branch = continuation(system, {x: 0.5, y: 0.5}, parameter="T", bounds=(0.1, 0.95), mode="+").run()
    assert [q.special for q in branch.special] == 2 * ["boundary equilibrium"]
    assert np.allclose([q.value for q in branch.special], [0.5, 0.75], rtol=0, atol=1e-9)
    assert all("persistence" in q.note and "stable pseudo-node" in q.predicts for q in branch.special)


def test_welander_convection() -> None:
    # Welander 1982: mixing where S - T > eps; T = 1/2, S = 5/12 with it, T = 1, S = 5/4 without.
    # Folds meet at 0.
    T, S = states("T S")
    p = parameters(eps=-0.01)
    mixed = Heaviside(S - T - p.eps)
    system = System({T: 1 - T - mixed * T, S: (1.25 - S) / 2 - mixed * S}, parameters=p)
    (point,) = equilibria(system).points
    branch = continuation(system, point.value, parameter="eps", bounds=(-0.2, 0.4), mode="0").run()
    names = ["boundary equilibrium", "pseudo-Hopf", "boundary equilibrium"]
    assert [q.special for q in branch.special] == names
    assert np.allclose([q.value for q in branch.special], [-1 / 12, 0, 1 / 4], rtol=0, atol=1e-9)


def test_three_cycles_of_two_foci() -> None:
    # Llibre & Ponce 2012 after Huan & Yang 2012. Cycles by half-return maps in closed form.
    inner, outer = np.array([[1, -5], [0.377, -1.3]]), np.array([[0.38, -1], [1, 0.38]])

    def half(A: np.ndarray, height: float, side: int) -> float:
        growth = np.trace(A) / 2
        B = A - growth * np.eye(2)
        w = sqrt(np.linalg.det(B))

        def at(q: float) -> np.ndarray:
            return np.exp(growth * q) * (np.cos(w * q) * np.eye(2) + np.sin(w * q) / w * B) @ [1, height]

        grid = np.linspace(1e-3, 2 * pi / w, 100)
        over = np.array([side * (at(q)[0] - 1) for q in grid])
        k = int(np.flatnonzero((over[:-1] > 0) & (over[1:] <= 0))[0])
        return float(at(brentq(lambda q: at(q)[0] - 1, grid[k], grid[k + 1], xtol=1e-14))[1])

    grid = np.linspace(0.615, 2.0, 30)
    gaps = [half(outer, half(inner, d, -1), 1) - d for d in grid]
    exact = [
        brentq(lambda d: half(outer, half(inner, d, -1), 1) - d, grid[k], grid[k + 1], xtol=1e-12)
        for k in range(29) if gaps[k] * gaps[k + 1] < 0
    ]  # fmt: skip
    fields = {"-": list(inner @ [x, y]), "+": list(outer @ [x, y])}
    system = System.from_modes([x - 1], fields, [x, y])
    turn = EventMap(system, Section("x - 1", "crossing down", y, {x: "1", y: "d"}, t_max=60))
    found = turn.fixed_points(0.615, 2.0)
    assert np.allclose([q.d for q in found], exact, rtol=0, atol=1e-8)
    assert [q.verdict for q in found] == ["unstable", "stable", "unstable"]


def test_homoclinic_orbit_of_two_linear_zones() -> None:
    # Saddle at 0 for x < 1, focus at (2, 0) for x > 1: the flight between the saddle's lines by exp(A t).
    p, d = parameters(mu=-0.2), 0.1
    system = System.from_modes(
        [x - 1], {"-": [y, x + p.mu * y], "+": [y, 2 - x + d * y]}, [x, y],
        parameters=p,
    )  # fmt: skip
    A = np.array([[0, 1], [-1, d]])

    def miss(mu: float) -> float:
        up, down = (mu + sqrt(mu * mu + 4)) / 2, (mu - sqrt(mu * mu + 4)) / 2
        back = brentq(lambda q: (expm(A * q) @ [-1, up])[0] + 1, 2.5, 6.2, xtol=1e-14)
        return float((expm(A * back) @ [-1, up])[1] - down)

    loop = find_homoclinic(system, {x: 0, y: 0}, free="mu", mode="-")
    assert abs(loop.value - brentq(miss, -1, 0.2)) < 1e-9


def test_grazing_of_the_belt_over_two_parameters() -> None:
    # The velocity of the steady answer reaches the belt's: a = v0 sqrt((1 - w^2)^2 + (2 z w)^2)/w.
    p = parameters(a=0.5, w=0.7)
    system = System({x: y, y: -x - 0.2 * y + p.a * cos(p.w * t) - 0.2 * sign(y - 1)}, parameters=p)
    run = continuation(system, find_orbit(system, (0, 0)), parameter="a", bounds=(0.4, 0.8), direction=1)
    (point,) = run.run().special
    assert point.special == "grazing-sliding"
    border = curve(run, point, parameter="w", bounds=(0.62, 0.78)).run()
    w = border.values
    assert np.allclose(border.coordinate("a"), np.hypot(1 - w * w, 0.2 * w) / w, rtol=0, atol=1e-8)


def test_second_doubling_of_the_henon_map() -> None:
    # Doublings at 3 (1 - b)^2/4 and (1 - b)^2 + (1 + b)^2/4, b = 0.3: 0.3675 and 0.9125.
    p = parameters(a=0.1)
    tick = TimeEvent("k", period=1.0, reset={x: 1 - p.a * x**2 + y, y: 0.3 * x})
    system = System({x: 0 * x, y: 0 * y}, time_events=[tick], parameters=p)
    orbit = find_orbit(system, (0.9, 0.27))
    run = continuation(system, orbit, parameter="a", bounds=(0.1, 0.5), direction=1)
    first = named(run.run())
    assert abs(first["period doubling"] - 0.3675) < 1e-8
    twice = switch(run, run.branch.special[0], bounds=(0.3, 1.0), direction=1).run()
    assert any(q.special == "period doubling" and abs(q.value - 0.9125) < 1e-8 for q in twice.special)


# -- harmonic balance with several surfaces of one input ----------------------------------------------------


def plant(u: Any) -> System:
    """1/(s (s + 1)(s + 2)) under -u: the axis is crossed at w = sqrt(2), where the gain is 6."""
    return System({x: y, y: z, z: -2 * y - 3 * z - u})


def test_dead_zone_and_saturation_have_one_input() -> None:
    # Gelb & Vander Velde 1968: 4 K/(pi A) sqrt(1 - (D/A)^2) and 2 k/pi (asin(1/A) + sqrt(1 - 1/A^2)/A).
    D, K = 0.2, 4.0
    found = describing_function(plant(K * (sign(x - D) + sign(x + D)) / 2)).cycles
    relay = [
        brentq(lambda a: 4 * K / (pi * a) * sqrt(1 - (D / a) ** 2) - 6, *ends, xtol=1e-14)
        for ends in ((1.00001 * D, sqrt(2) * D), (sqrt(2) * D, 10))
    ]
    assert np.allclose([c.amplitude for c in found], relay, rtol=0, atol=1e-9)
    assert [c.stable for c in found] == [False, True]
    (cycle,) = describing_function(plant(10 * Max(Min(x, 1), -1))).cycles
    exact = brentq(lambda a: 20 / pi * (asin(1 / a) + sqrt(1 - 1 / a**2) / a) - 6, 1.0001, 10, xtol=1e-14)
    assert abs(cycle.amplitude - exact) < 1e-9
    assert abs(cycle.frequency - sqrt(2)) < 1e-9
    with pytest.raises(UsageError, match="name the input's surface"):
        describing_function(plant(sign(x) + sign(y)))
    with pytest.raises(UsageError, match="name the input's surface"):
        describing_function(plant(sign(x - 1) + sign(2 * x - 1)))


def test_states_are_named_by_symbol_everywhere() -> None:
    wells = System({x: y, y: x - x**3 - y})
    found = attractors(wells, {x: (0.5, 1.5), y: (-0.1, 0.1)}, samples=8)
    assert "equilibrium, at (1" in str(found)
    with pytest.raises(UsageError, match=r"here mode='' \(no surfaces\)"):
        continuation(System({x: parameters(a=1.0).a - x}), (1.0,), parameter="a", bounds=(0, 2))
