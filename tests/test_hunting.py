"""The reference loop: published figures, corner parameters, the same answers however the model is written.

Oracles: the figures in the docstrings are 40-digit Taylor integrations of the slip phase (Hensen & van de
Molengraft 2002 with the lost digits restored), another integrator in other variables, and closed forms.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from filippov import Surface, System, exp, parameters, sign, solve, states
from filippov.analysis.diagrams.bifurcation import bifurcation
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.analysis.steady.rest_map import rest_map
from filippov.models import get
from filippov.solving.state.events import Stop

MODEL = get("hunting")
SYSTEM = MODEL.build()
SECTION = Section.from_model(MODEL)
TABLE = {"m": 1, "P": 10, "D": 1, "I": 10, "Fs": 4, "Fc": 2, "vs": 0.1, "beta": 2, "b": 1}


def cycles(**values: float) -> list[float]:
    points = EventMap(SYSTEM, SECTION, parameters=values, order=2).fixed_points(0.0, 0.5)
    return [point.d for point in points if point.kind == "limit cycle"]


def test_fixed_points_of_the_reference() -> None:
    """0.003355834470, 0.252304806412 (beta = 2), 0.231364108104 (beta = 1), 0.1786 (beta = 0.5)."""
    assert cycles(beta=2) == pytest.approx([0.003355834470, 0.252304806412], abs=1e-10)
    assert cycles(beta=1) == pytest.approx([0.231364108104], abs=1e-10)
    assert cycles(beta=0.5) == pytest.approx([0.1786], abs=5e-5)


def test_two_tolerances_agree_on_ten_digits_at_beta_one_half() -> None:
    loose = EventMap(SYSTEM, SECTION, parameters={"beta": 0.5}, order=2, rtol=1e-11, atol=1e-13)
    tight = loose.remake(rtol=1e-13, atol=1e-15)
    d = cycles(beta=0.5)[0]
    assert abs(loose(d) - d) < 1e-10
    assert abs(tight(d) - d) < 1e-10


def map_in_root_of_speed(d: float) -> float:
    """R(d) for beta = 1/2 in w = sqrt|v|, in which the slip field is smooth, by scipy's DOP853.

    v = -w**2, w' = -v'/(2 w). The start is w = a t with 2 a**2 = c a + r (leading order of v' at break-away).
    """
    fs, fc, root_vs = 4.0, 2.0, 0.1**0.5

    def field(t: float, y: np.ndarray) -> list[float]:
        x, w, z = y
        v = -(w**2)
        g = fc + (fs - fc) * np.exp(-w / root_vs)
        return [v, (10 * (x + v + 10 * z) - g + v) / (2 * w), x]

    def stop(t: float, y: np.ndarray) -> float:
        # At w = 1e-7 the speed is 1e-14: what is left of the way is nothing.
        return y[1] - 1e-7 if t > 0.1 else 1.0

    stop.terminal = True  # type: ignore[attr-defined]
    c, r, t0 = (fs - fc) / root_vs, 100 * d, 1e-12
    start = [d, t0 * (c + np.sqrt(c**2 + 8 * r)) / 4, (fs / 10 - d) / 10 + d * t0]
    run = solve_ivp(field, (t0, 5.0), start, method="DOP853", rtol=1e-12, atol=1e-16, events=stop)
    return float(run.y[0, -1])


def test_beta_one_half_by_an_independent_method() -> None:
    """R(R(d)) = d where R(d) = -d: the map in w = sqrt|v| by another integrator."""
    d = cycles(beta=0.5)[0]
    assert map_in_root_of_speed(d) == pytest.approx(-d, abs=2e-10)


def test_fold_and_stability_change() -> None:
    """Fold near P = 21 (beta = 2); the set turns stable near P = 27 (beta = 1), at 26.6019490."""
    two = bifurcation(
        SYSTEM, SECTION, parameter="P", values=[20, 21, 22], interval=(0, 0.5), parameters={"beta": 2}
    )
    (value, d), *more = two.folds
    assert not more
    assert 20.5 < value < 21.5
    # The fold is where the two cycles meet: they are there just before it and gone just after.
    before = EventMap(SYSTEM, SECTION, parameters={"P": value - 1e-7}, order=2)
    near = [point.d for point in before.fixed_points(0.5 * d, 2 * d)]
    assert len(near) == 2
    assert near == pytest.approx([d, d], abs=1e-4)
    assert not EventMap(SYSTEM, SECTION, parameters={"P": value + 1e-7}, order=2).fixed_points(0.5 * d, 2 * d)
    one = bifurcation(
        SYSTEM, SECTION, parameter="P", values=[26, 27], interval=(0, 0.5), parameters={"beta": 1}
    )
    # Independent of the event map: the return map of the slip polynomial s^3 + (P - 18 - 1) s^2 + P s + 10 P.
    expected = brentq(lambda P: abs(rest_map([1, P - 19, P, 10 * P]).kappa) - 1, 26, 27, xtol=1e-12)
    assert one.stability_changes == pytest.approx([expected], abs=1e-8)


def test_stick_is_exact_to_the_last_bit() -> None:
    run = solve(SYSTEM, (0.1, 0, 0), (0, 20), rtol=1e-10, atol=1e-12)
    assert run.success
    for segment in run.segments:
        if segment.mode == (0,):
            inside = run.sol(np.linspace(segment.t0, segment.t1, 50)[1:-1])
            assert np.ptp(inside[0]) == 0.0
            assert np.max(np.abs(inside[1])) <= 1e-14


def test_symbolic_and_plain_functions_agree() -> None:
    def field(t, x, p, s):  # type: ignore[no-untyped-def]
        v = x[1]
        u = p.P * (x[0] + p.D * v + p.I * x[2])
        g = p.Fc + (p.Fs - p.Fc) * np.exp(-((abs(v) / p.vs) ** p.beta))
        return [v, (-u - g * s[0] - p.b * v) / p.m, x[0]]

    plain = System(
        field=field, surfaces=[Surface("velocity", lambda t, x, p: x[1])], states="x v z", parameters=TABLE
    )
    options = {"rtol": 1e-11, "atol": 1e-13}
    one = solve(SYSTEM, (0.1, 0, 0), (0, 6), **options)
    other = solve(plain, (0.1, 0, 0), (0, 6), **options)
    assert [e.kind for e in one.events] == [e.kind for e in other.events]
    assert other.events.t == pytest.approx(one.events.t, abs=1e-9)
    assert other.x_end == pytest.approx(one.x_end, abs=1e-9)


def test_order_of_surfaces() -> None:
    x, v, z = states("x v z")
    p = parameters(**TABLE)
    u = p.P * (x + p.D * v + p.I * z)
    g = p.Fc + (p.Fs - p.Fc) * exp(-((abs(v) / p.vs) ** p.beta))
    equations = {x: v, v: (-u - g * sign(v) - p.b * v - 1e-3 * sign(x)) / p.m, z: x}
    surfaces = [Surface("velocity", v), Surface("position", x)]
    runs = [
        solve(System(equations, surfaces=order), (0.1, 0, 0), (0, 10), rtol=1e-11, atol=1e-13)
        for order in (surfaces, surfaces[::-1])
    ]
    one, other = ([(event.surface, event.kind) for event in run.events] for run in runs)
    assert one == other
    assert runs[1].events.t == pytest.approx(runs[0].events.t, abs=1e-9)
    assert runs[1].x_end == pytest.approx(runs[0].x_end, abs=1e-9)


@pytest.mark.parametrize("beta", [0.5, 0.1, 1.0001])
def test_any_exponent(beta: float) -> None:
    ends = [
        solve(SYSTEM, (0.1, 0, 0), (0, 10), parameters={"beta": beta}, rtol=rtol, atol=rtol * 1e-2)
        for rtol in (1e-10, 1e-12)
    ]
    assert all(run.success for run in ends)
    assert ends[0].x_end == pytest.approx(ends[1].x_end, abs=1e-7)


def test_a_curve_a_micrometre_a_second_wide() -> None:
    """As vs -> 0 the Stribeck curve becomes static friction above Coulomb with its jump and wider set."""
    static = solve(get("hunting_static").build(), (0.1, 0, 0), (0, 10), rtol=1e-10, atol=1e-12)
    assert static.success
    gaps = []
    for vs in (1e-2, 1e-4, 1e-6):
        run = solve(SYSTEM, (0.1, 0, 0), (0, 10), parameters={"vs": vs}, rtol=1e-10, atol=1e-12)
        assert run.success
        assert len(run.events) == len(static.events)
        gaps.append(float(np.max(np.abs(run.x_end - static.x_end))))
    assert gaps[1] < 0.3 * gaps[0]
    assert gaps[2] < 0.3 * gaps[1]


def test_coulomb_friction_alone_has_no_cycle() -> None:
    """Armstrong-Helouvry & Amin 1996: every start goes to the set."""
    event_map = EventMap(get("hunting_coulomb").build(), Section.from_model(get("hunting_coulomb")), order=2)
    d = np.array([1e-3, 0.1, 0.5])
    assert np.all(np.abs(event_map(d)) < d)
    assert [q.kind for q in event_map.fixed_points(0, 0.5)] == ["equilibrium set"]


@pytest.mark.parametrize("gain", [10.0, 20.0, 31.0])
def test_static_friction_above_coulomb_always_cycles(gain: float) -> None:
    model = get("hunting_static")
    event_map = EventMap(model.build(), Section.from_model(model), order=2, parameters={"P": gain})
    kinds = [(q.kind, q.stable) for q in event_map.fixed_points(0, 0.5)]
    assert kinds == [("equilibrium set", False), ("limit cycle", True)]


@pytest.mark.parametrize("name", ["P", "I"])
def test_degenerate_gains_are_named(name: str) -> None:
    from filippov.models.mass import degeneracies

    assert any(sentence.startswith(f"{name} = 0") for sentence in degeneracies(SYSTEM, {name: 0.0}))
    run = solve(SYSTEM, (0.1, 0, 0), (0, 5), parameters={name: 0.0})
    assert run.success
    assert run.x_end[0] == 0.1


def test_start_in_stick_at_break_away_and_at_rest() -> None:
    stick = solve(SYSTEM, (0.1, 0, 0), (0, 1))
    assert stick.modes[0] == "0"
    # u = P (x + I z) reaches Fs at z = 0.03, with z' = 0.1: at t = 0.3.
    assert stick.events[0].t == pytest.approx(0.3, abs=1e-12)
    at_the_limit = solve(SYSTEM, (0.1, 0, 0.03), (0, 1))
    assert at_the_limit.modes[0] == "-"
    rest = solve(SYSTEM, (0, 0, 0.02), (0, 10))
    assert rest.success
    assert rest.modes == ("0",)
    assert rest.x_end == pytest.approx([0, 0, 0.02], abs=0)
    at_the_end = solve(SYSTEM, (0, 0, 0.04), (0, 10))
    assert at_the_end.x_end == pytest.approx([0, 0, 0.04], abs=1e-12)


def test_map_is_odd_and_slopes_are_exact() -> None:
    event_map = EventMap(SYSTEM, SECTION, rtol=1e-12, atol=1e-14)
    d = np.array([0.01, 0.1, 0.3])
    assert event_map(-d) == pytest.approx(-event_map(d), abs=1e-12)
    for value in d:
        reach = 1e-4 * value
        difference = (event_map(value + reach) - event_map(value - reach)) / (2 * reach)
        assert event_map.derivative(value) == pytest.approx(difference, rel=1e-6)


def test_terminal_event_counts() -> None:
    run = solve(SYSTEM, (0.1, 0, 0), (0, 20), stop=Stop("velocity", "sliding entry", 3))
    entries = run.events.of("velocity", "sliding entry")
    assert len(entries) == 3
    assert run.t_end == entries[-1].t
    assert all(a.t <= b.t for a, b in pairwise(run.events))
