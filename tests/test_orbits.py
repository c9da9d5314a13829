"""Periodic orbits and the derivative of the flow, against the bank, closed forms and central differences."""

from math import atan, cos, exp, pi, sin, sqrt
from pathlib import Path

import bank
import numpy as np
import pytest
from bank import case, number
from scipy.optimize import brentq

from filippov import (
    ModelError,
    Status,
    Surface,
    System,
    UsageError,
    parameters,
    sign,
    solve,
    states,
)
from filippov import cos as cosine
from filippov import t as time
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.analysis.orbits.orbit import Orbit
from filippov.analysis.orbits.orbit_search import find_orbit, refine
from filippov.analysis.orbits.shooting import NoConvergenceError, ReturnError
from filippov.analysis.sensitivity.saltation import NotDifferentiableError, flow_derivative
from filippov.analysis.steady.forcing import depends_on_time, forcing_period
from filippov.model.symbols import Abs
from filippov.model.symbols import exp as exponential
from filippov.models import hunting
from filippov.models.registry import get

x, v, z = states("x v z")
TIGHT = {"rtol": 1e-13, "atol": 1e-15}


def differences(system, x0, span, values=None, names=(), step=1e-4):
    """Central differences of fourth order of x(t_end), one column per state and named parameter."""
    values = dict(values or {})

    def end(moved, q):
        options = {"zeno": "continue", "nonunique": "stick", **TIGHT}
        run = solve(system, moved, span, parameters={**values, **q}, **options)
        assert run.success
        return run.x_end

    weights = ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12))
    columns = []
    for j in range(len(x0)):
        unit = step * np.eye(len(x0))[j]
        columns.append(sum(w * end(np.asarray(x0) + k * unit, {}) for k, w in weights) / step)
    base = dict(zip(system.parameters.names, system.parameters.resolve(values), strict=True))
    columns += [
        sum(w * end(x0, {name: base[name] + k * step}) for k, w in weights) / step for name in names
    ]
    return np.array(columns).T


# -- derivative of the flow ------------------------------------------------------------------------------


def test_derivative_through_stick_and_slip_with_parameters():
    run = solve(hunting(), (0.1, 0.01, 0.2), (0, 4), **TIGHT)
    kinds = {str(event.kind) for event in run.events}
    assert {"sliding entry", "sliding exit"} <= kinds
    exact = flow_derivative(run, parameters=("P", "Fc", "vs", "beta"))
    assert exact.shape == (3, 7)
    numeric = differences(hunting(), (0.1, 0.01, 0.2), (0, 4), {}, ("P", "Fc", "vs", "beta"), 1e-5)
    assert np.max(np.abs(exact - numeric)) < 1e-6 * np.max(np.abs(numeric))


def test_derivative_of_two_blocks_that_slide_on_two_surfaces():
    system = get("two_blocks").build()
    run = solve(system, (0, 0, 0.5, 0), (0, 9), **TIGHT)
    assert "00" in run.modes
    assert len(run.events) > 4
    numeric = differences(system, (0, 0, 0.5, 0), (0, 9), step=1e-5)
    assert np.max(np.abs(flow_derivative(run) - numeric)) < 1e-6 * max(1, np.max(np.abs(numeric)))


def test_corner_entered_on_both_surfaces_at_once_loses_both_ranks():
    a, b, c = states("a b c")
    system = System({a: -sign(a) + 0.5 * sign(b), b: -sign(b), c: a + b + sign(b) - c})
    run = solve(system, (0.5, 1, 1), (0, 2), **TIGHT)
    assert len({event.group for event in run.events}) == 1
    assert run.end_mode == (0, 0)
    exact = flow_derivative(run)
    assert np.linalg.matrix_rank(exact, tol=1e-12) == 1
    # Before the corner a = (1 - t)/2, b = 1 - t; the flow is once differentiable there, differences are of
    # first order.
    assert abs(exact[2, 2] - exp(-2)) < 1e-12
    assert np.max(np.abs(exact - differences(system, (0.5, 1, 1), (0, 2), step=1e-6))) < 1e-6


def test_corner_whose_order_matters_is_refused():
    system = System({x: -1 + 0.5 * sign(v), v: -1 + 0.2 * sign(x), z: sign(x) * sign(v)})
    run = solve(system, (1.0, 1.6, 0), (0, 4), **TIGHT)
    together = [event for event in run.events if event.group == run.events[0].group]
    assert len(together) == 2
    with pytest.raises(NotDifferentiableError, match="order"):
        flow_derivative(run)


@pytest.mark.parametrize("supplied", [False, True])
def test_plain_functions_differentiate_as_expressions_do(supplied):
    def field(t, y, p, s):
        return [y[1], (-p.k * y[0] - s[0] * p.mu / (1 + y[1] * s[0]) + 0.2 * np.cos(t)) / p.m]

    def jacobian(t, y, p, s):
        return [[0, 1], [-p.k / p.m, p.mu / (1 + y[1] * s[0]) ** 2 / p.m]]

    values = {"k": 1.0, "mu": 0.3, "m": 1.2}
    pivot = Surface("v", lambda t, y, p: y[1])
    plain = System(field=field, surfaces=[pivot], states="x v", parameters=values)
    p = parameters(**values)
    friction = p.mu * sign(v) / (1 + Abs(v))
    same = System({x: v, v: (-p.k * x - friction + 0.2 * cosine(time)) / p.m})
    runs = [solve(system, (1.5, 0.1), (0, 12), **TIGHT) for system in (plain, same)]
    assert len(runs[0].events) == len(runs[1].events) > 2
    first = flow_derivative(runs[0], parameters=("mu",), jacobian=jacobian if supplied else None)
    second = flow_derivative(runs[1], parameters=("mu",))
    assert np.max(np.abs(first - second)) < 1e-7


def test_wrong_jacobian_is_named():
    plain = System(field=lambda t, y, p, s: [-y[0]], states="x")
    with pytest.raises(ModelError, match="jacobian returned the shape"):
        flow_derivative(solve(plain, (1.0,), (0, 1)), jacobian=lambda t, y, p, s: [1, 2])


def test_c6_no_derivative_at_grazing():
    y, w = states("y w")
    system = System({y: w, w: 2 + (1 - sign(y)) / 2}, surfaces=[Surface("wall", y)])
    run = solve(system, (1, -2), (0, 3))  # y = (t - 1)^2
    assert "grazing" in {str(event.kind) for event in run.events}
    assert np.max(np.abs(run.events.t - 1)) < 1e-7
    with pytest.raises(NotDifferentiableError, match=r"not differentiable at t = 1: .*'wall'"):
        flow_derivative(run)


def test_dense_output_is_needed():
    run = solve(hunting(), (0.1, 0, 0), (0, 1), dense_output=False)
    with pytest.raises(UsageError, match="dense"):
        flow_derivative(run)


# -- orbits of the bank ------------------------------------------------------------------------------------

ORBITS = {
    "F05_dieci_lopez_stick_slip": {},
    "F06_leine_alternate_friction": {},
    "F10_two_stop_forced": {},
    "R03_relay_single_sliding": {"symmetry": "odd"},
    "R04_relay_two_slides": {},
    "R05_relay_oscillator_no_sliding": {},
    "B02_pseudo_hopf": {},
}
_found: dict[str, Orbit] = {}


def orbit_of(name):
    if name not in _found:
        item = case(name)
        _found[name] = find_orbit(item.system, item.x0, **ORBITS[name])
    return _found[name]


def expected(name, entry):
    value = bank.expected(name)[entry]["value"]
    return [number(v) for v in value] if isinstance(value, list) else number(value)


@pytest.mark.parametrize(
    ("name", "entry"),
    [
        ("F05_dieci_lopez_stick_slip", "limit_cycle_period"),
        ("F06_leine_alternate_friction", "limit_cycle_period"),
        ("F10_two_stop_forced", "period"),
        ("R03_relay_single_sliding", "limit_cycle_period"),
        ("R04_relay_two_slides", "limit_cycle_period"),
        ("R05_relay_oscillator_no_sliding", "limit_cycle_period"),
        ("B02_pseudo_hopf", "period"),
    ],
)
def test_period(name, entry):
    assert abs(orbit_of(name).period - expected(name, entry)) < 1e-9


@pytest.mark.parametrize("name", sorted(ORBITS))
def test_orbit_closes_and_multipliers_agree_with_differences(name):
    orbit = orbit_of(name)
    assert orbit.residual < 1e-10
    end = orbit.solution()
    assert np.max(np.abs(end.x_end - orbit.x0)) < 1e-9
    span = (orbit.t0, orbit.t0 + orbit.period)
    numeric = np.linalg.eigvals(differences(orbit.system, orbit.x0, span))
    found = list(orbit.multipliers) + ([] if orbit.trivial is None else [orbit.trivial])
    for value in found:
        k = int(np.argmin(np.abs(numeric - value)))
        assert abs(numeric[k] - value) < 1e-6
        numeric = np.delete(numeric, k)
    assert not numeric.size


@pytest.mark.parametrize("name", ["F05_dieci_lopez_stick_slip", "F06_leine_alternate_friction"])
def test_a_stick_cycle_has_multipliers_one_and_zero(name):
    orbit = orbit_of(name)
    assert orbit.word == "stick slip-"
    assert orbit.stable
    assert orbit.multipliers[0] == 0.0
    assert abs(orbit.trivial - 1.0) < 1e-8


def test_12_13_orbits_of_a_centre_are_neither_stable_nor_unstable():
    rows = {x: v, v: -2 * x}
    for more, start in ({}, (1, 0)), ({z: -z}, (1, 0, 0)), ({z: x}, (1, 0, 0)):
        orbit = find_orbit(System({**rows, **more}), start)
        assert orbit.verdict == "undecided"
        assert not orbit.stable
        assert "undecided" in repr(orbit)
    model = get("switching_predator")  # slides along closed curves
    assert find_orbit(model.build(), model.x0).verdict == "undecided"
    for damping in (1e-7, -1e-7):  # the multipliers exp(-2 pi d +- ...) are told apart from 1
        shaken = System({x: v, v: -2 * x - 2 * damping * v + cosine(time)})
        assert find_orbit(shaken, (1, 0), period=2 * pi).verdict == ("stable" if damping > 0 else "unstable")


def test_f05_and_f06_sticks():
    sticks = {"F05_dieci_lopez_stick_slip": "restick_x1", "F06_leine_alternate_friction": "restick_x"}
    for name, entry in sticks.items():
        entries = [event for event in orbit_of(name).events if str(event.kind) == "sliding entry"]
        assert abs(entries[0].x[0] - expected(name, entry)) < 1e-9
    orbit = orbit_of("F06_leine_alternate_friction")
    dwell = orbit.solution().dwell_times()["0"]
    assert abs(dwell - expected("F06_leine_alternate_friction", "stick_duration")) < 1e-8


def test_f10_two_stops():
    orbit = orbit_of("F10_two_stop_forced")
    assert orbit.symmetric
    assert orbit.word == "stick slip- stick slip+"
    assert abs(orbit.amplitude["x"] - expected("F10_two_stop_forced", "stick_position")) < 1e-9
    stick = orbit.solution().dwell_times()["0"] / 2
    assert abs(stick - expected("F10_two_stop_forced", "stick_duration")) < 1e-8
    # In slip x + S - c cos(W t) is a free oscillation, c = 1/(1 - W^2); the stick ends where -x + cos = S.
    # Half map d -> d' of the stick position, differentiated in closed form: the slip lasts T, v(T) = 0.
    w, s = 0.6, 0.6
    c = 1 / (1 - w * w)

    def half(d):
        t0 = np.arccos(-s + d) / w
        a, b = d - s - c * cos(w * t0), c * w * sin(w * t0)

        def speed(q):
            return -a * sin(q) + b * cos(q) - c * w * sin(w * (t0 + q))

        end = brentq(speed, 2.0, 2 * pi, xtol=1e-14)
        return -(s + a * cos(end) + b * sin(end) + c * cos(w * (t0 + end)))

    d = orbit.amplitude["x"]
    assert abs(half(d) - d) < 1e-10
    slope = (half(d + 1e-5) - half(d - 1e-5)) / 2e-5
    assert abs(orbit.half_multipliers[0] - slope) < 1e-7
    assert orbit.half_multipliers[1] == 0.0
    assert abs(orbit.multipliers[0] - slope**2) < 1e-7
    assert orbit.multipliers[1] == 0.0


@pytest.mark.parametrize(
    ("name", "entry", "slides"),
    [
        ("R03_relay_single_sliding", "half_map_multiplier", 1),
        ("R04_relay_two_slides", "signed_half_map_multiplier", 2),
    ],
)
def test_relay_half_map(name, entry, slides):
    orbit = orbit_of(name)
    assert orbit.symmetric
    assert abs(orbit.half_multipliers[0] - expected(name, entry)) < 1e-8
    assert orbit.half_multipliers[1] == 0.0
    assert orbit.word.split().count("0") == 2 * slides


def test_r03_exit_and_r05_switch_state():
    exits = [e for e in orbit_of("R03_relay_single_sliding").events if str(e.kind) == "sliding exit"]
    assert abs(max(abs(e.x[2]) for e in exits) - abs(expected("R03_relay_single_sliding", "exit_x3"))) < 1e-8
    switch = [e for e in orbit_of("R05_relay_oscillator_no_sliding").events if e.direction > 0]
    value = np.array(expected("R05_relay_oscillator_no_sliding", "switch_state"))
    assert len(switch) == 1
    assert np.max(np.abs(switch[0].x - value)) < 1e-9


def test_b02_multiplier_and_crossings():
    orbit = orbit_of("B02_pseudo_hopf")
    assert abs(orbit.multipliers[0] - expected("B02_pseudo_hopf", "multiplier")) < 1e-9
    crossings = sorted(event.x[0] for event in orbit.events)
    assert np.max(np.abs(np.array(crossings) - expected("B02_pseudo_hopf", "cycle_crossings_x"))) < 1e-9
    # y(x) on both sides in closed form: between crossings a < b above, and back below.
    a, b = crossings
    assert abs(-(b * b - a * a) / 2 - (b**3 - a**3) / 3) < 1e-9
    assert abs((b - a) * (b + a + 2 * 0.05) / 2) < 1e-9
    assert abs(orbit.period - 2 * (b - a)) < 1e-9


def test_an_orbit_that_leaves_the_surface_in_tiny_steps_has_margins():
    # beta = 0.5: the friction curve has an infinite slope at rest, and slip begins with steps near rounding.
    half = EventMap(hunting(), Section.from_model(get("hunting")), parameters={"beta": 0.5})
    start = half.bound.start(0.178589691249, half.p)[0]
    orbit = find_orbit(hunting(), start, symmetry="odd", parameters={"beta": 0.5})
    assert abs(orbit.amplitude["x"] + half(orbit.amplitude["x"])) < 1e-9
    assert orbit.margin.distance == float("inf")  # it nowhere turns back from v = 0
    assert 0 < orbit.margin.transversality < 1
    d, h = orbit.amplitude["x"], 1e-5
    slope = float((half(d + h) - half(d - h)) / (2 * h))
    assert orbit.multipliers[0].real == pytest.approx(slope**2, abs=1e-7)


def test_b05_grazing_amplitude_is_where_the_margin_vanishes():
    item = case("B05_grazing_sliding_belt")
    orbit = find_orbit(item.system, item.x0)
    w, zeta, a = 0.5, 0.05, 1.5
    gain = w / sqrt((1 - w * w) ** 2 + (2 * zeta * w) ** 2)
    # v has the amplitude a gain; the belt is left below by 1 - a gain; h = v - 1.
    assert abs(orbit.margin.distance - (1 - a * gain)) < 1e-9
    assert abs(a / (1 - orbit.margin.distance) - expected("B05_grazing_sliding_belt", "a_grazing")) < 1e-8
    # Multipliers of the linear oscillator: exp of its eigenvalues times the period.
    eigenvalues = np.roots([1, 2 * zeta, 1])
    exact = np.exp(eigenvalues * orbit.period)
    assert np.max(np.abs(np.sort_complex(orbit.multipliers) - np.sort_complex(exact))) < 1e-9


def test_a01_sliding_centre_keeps_both_multipliers():
    item = case("A01_krivan_switching_predator")
    orbit = find_orbit(item.system, item.x0, transient=10)
    assert orbit.word == "0"
    assert orbit.multipliers[-1] == 0.0
    assert abs(orbit.multipliers[0] - 1) < 1e-3
    assert abs(orbit.trivial - 1) < 1e-3


def test_a04_thermostat_period():
    orbit = find_orbit(get("thermostat").build(), get("thermostat").x0)
    assert abs(orbit.period - (10 * np.log(11 / 8) + 10 * np.log(32 / 29))) < 1e-10
    assert orbit.multipliers.size == 0
    assert abs(orbit.trivial - 1) < 1e-9


def test_f13_static_friction_on_a_belt():
    orbit = find_orbit(get("belt_static").build(), (0, 0))
    assert abs(orbit.period - (5 + 2 * pi - 2 * atan(2.5))) < 1e-9
    assert orbit.multipliers[0] == 0.0


def test_p03_lugre_stick_slip():
    y, w, q = states("y w q")
    # Stiff: rates up to sigma0 |v| = 2e4 in slip.
    stiffness = 100000
    curve = 1 + exponential(-((w / 0.001) ** 2)) / 2
    rate = w - q * Abs(w) * stiffness / curve
    # y = 0.1 t - x, so that the pulled block is autonomous.
    system = System({y: 0.1 - w, w: 2 * y - (stiffness * q + sqrt(stiffness) * rate + 0.4 * w), q: rate})
    orbit = find_orbit(system, (0, 0, 0), rtol=1e-8, atol=1e-11)
    assert abs(orbit.period - 6.36271982) < 1e-6
    assert np.max(np.abs(orbit.multipliers)) < 1e-9


def test_two_blocks_multipliers_agree_with_differences():
    system = get("two_blocks").build()
    orbit = find_orbit(system, (0, 0, 0.5, 0))
    numeric = np.linalg.eigvals(differences(system, orbit.x0, (0, orbit.period), step=1e-5))
    for value in (*orbit.multipliers, orbit.trivial):
        assert np.min(np.abs(numeric - value)) < 1e-6


# -- the hunting loop ------------------------------------------------------------------------------------


def test_hunting_cycles_stable_and_unstable():
    system = hunting()
    second = EventMap(system, Section.from_model(get("hunting")), order=2)
    for d in (0.252304806412, 0.003355834470):
        start = second.bound.start(np.array([d]), second.p)[0]
        slope = second.derivative(d)
        orbit = find_orbit(system, start, symmetry="odd")
        assert abs(orbit.amplitude["x"] - d) < 1e-9
        assert abs(orbit.multipliers[0] - slope) < 1e-6
        assert orbit.stable == (slope < 1)
        assert orbit.word == "stick slip- stick slip+"
        assert orbit.multipliers[1] == 0.0
        assert orbit.symmetric


def test_refine_follows_parameters():
    orbit = find_orbit(hunting(), (0.1, 0, 0))
    moved = refine(orbit, {"P": 11.0})
    direct = find_orbit(hunting(), (0.2, 0, 0), parameters={"P": 11.0})
    assert abs(moved.period - direct.period) < 1e-8
    assert abs(moved.amplitude["x"] - direct.amplitude["x"]) < 1e-8


def test_several_nodes_give_the_same_orbit():
    item = case("R04_relay_two_slides")
    orbit = find_orbit(item.system, item.x0, nodes=4, symmetry="odd")
    assert abs(orbit.period - orbit_of("R04_relay_two_slides").period) < 1e-9
    assert abs(orbit.half_multipliers[0] - orbit_of("R04_relay_two_slides").half_multipliers[0]) < 1e-7


def test_strongly_unstable_orbit_by_multiple_shooting():
    # r' = 4 r (r - 1) about the circle r = 1, whose multiplier is exp(8 pi).
    y, w = states("y w")
    r = (y * y + w * w) ** 0.5
    system = System({y: -w + 4 * y * (r - 1), w: y + 4 * w * (r - 1)})
    angle = 2 * pi * np.arange(8) / 8
    orbit = find_orbit(system, np.column_stack([1.02 * np.cos(angle), 0.97 * np.sin(angle)]), period=6.2)
    assert abs(orbit.period - 2 * pi) < 1e-9
    assert not orbit.stable
    assert abs(orbit.multipliers[0] / exp(8 * pi) - 1) < 1e-6


# -- failures, files, command ------------------------------------------------------------------------------


def test_c7_motions_that_never_return():
    with pytest.raises(ReturnError, match=r"NO_RETURN.*rest") as caught:
        find_orbit(System({x: v, v: -x - 0.3 * sign(v)}), (2, 0))
    assert caught.value.status is Status.NO_RETURN
    assert caught.value.t > 0
    assert caught.value.solution is not None
    with pytest.raises(ReturnError, match=r"NO_RETURN.*t = 5"):
        find_orbit(System({x: 1 + 0 * x, v: -v}), (0, 1), t_max=5)
    section = Section("v", "crossing up", "x", {"x": "-d", "v": "0"}, t_max=50)
    turn = EventMap(System({x: v, v: -x - 0.3 * sign(v)}), section)
    values, ended = turn.returns([0.2, 2.0])
    assert np.isnan(values[0])
    assert ended == (Status.NO_RETURN, Status.STOPPED)


def test_wrong_arguments_are_named():
    system = case("B02_pseudo_hopf").system
    for options, words in (
        ({"nodes": 0}, "nodes"),
        ({"period": -1.0}, "period"),
        ({"symmetry": "even"}, "symmetry"),
        ({"symmetry": [[0, 1], [2, 0]]}, "powers"),
        ({"symmetry": [[1]]}, "shape"),
    ):
        with pytest.raises(UsageError, match=words):
            find_orbit(system, (0.3, 0), **options)
    with pytest.raises(UsageError, match="guess"):
        find_orbit(system)


def test_period_of_the_forcing():
    from filippov import sin as sine
    p = parameters(omega=2.0, a=1.0)
    system = System({x: v, v: -x + p.a * cosine(p.omega * time) + sine(3 * p.omega * time / 2)}, parameters=p)
    assert depends_on_time(system)
    assert not depends_on_time(hunting())
    assert abs(float(forcing_period(system).subs(p.omega, 2.0)) - 2 * pi) < 1e-12
    with pytest.raises(UsageError, match="period"):
        find_orbit(System({x: -x + time}), (0,))


def test_no_orbit_of_a_forced_system_that_grows():
    with pytest.raises(NoConvergenceError):
        find_orbit(System({x: 1 + cosine(time) / 5}), (1,))


def test_save_and_load(tmp_path: Path):
    orbit = orbit_of("F10_two_stop_forced")
    read = Orbit.load(orbit.save(tmp_path / "orbit.json"))
    assert repr(read.to_dict()) == repr(orbit.to_dict())
    assert read.system == orbit.system
    assert read.signature == orbit.signature
    with pytest.raises(UsageError, match="not the one"):
        Orbit.load(tmp_path / "orbit.json", hunting())
    (tmp_path / "bad.json").write_text('{"format": "filippov orbit", "version": 9}')
    with pytest.raises(UsageError, match="version 9"):
        Orbit.load(tmp_path / "bad.json")
    (tmp_path / "none.json").write_text("[1]")
    with pytest.raises(UsageError, match="no filippov orbit"):
        Orbit.load(tmp_path / "none.json")


def test_picture(tmp_path: Path):
    figure = orbit_of("F05_dieci_lopez_stick_slip").plot()
    figure.savefig(tmp_path / "orbit.png")
    assert len(figure.axes) == 3
    with pytest.raises(UsageError, match="unknown state"):
        orbit_of("F05_dieci_lopez_stick_slip").plot(axes=("x1", "speed"))
