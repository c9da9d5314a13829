"""Harmonic balance and the algebra of hunting, against closed forms and the exact maps."""

import math

import control
import numpy as np
import pytest
from bank import CASES, case, number
from scipy.optimize import brentq

from filippov import ModelError, Surface, System, TimeEvent, UsageError, parameters, solve, states
from filippov.analysis.harmonic.control_link import linear_plant, relay_loop
from filippov.analysis.harmonic.describing_function import describing_function
from filippov.analysis.harmonic.quasi_linear import lure
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.model.comparator import Hysteresis
from filippov.model.symbols import Abs, Max, Min, sign
from filippov.model.symbols import t as time
from filippov.models import get
from filippov.models.static_cycle import coulomb_ratio, static_cycles

RELAY = "R05_relay_oscillator_no_sliding"


def test_relay_period_of_the_bank() -> None:
    (cycle,) = describing_function(case(RELAY).system).cycles
    entry = next(e for e in CASES[RELAY]["expected"] if e["name"] == "describing_function_period")
    assert cycle.period == pytest.approx(number(entry["value"]), abs=number(entry["tol"]))
    assert cycle.stable
    # The exact period is 0.95 % longer; the third harmonic is 1.5 % of the input.
    exact = next(e for e in CASES[RELAY]["expected"] if e["name"] == "limit_cycle_period")
    assert number(exact["value"]) / cycle.period - 1 == pytest.approx(0.0095, abs=5e-5)


def test_relay_on_three_lags() -> None:
    """1/(s + 1)^3 under a relay: omega = sqrt(3), A = 4/(8 pi) (Khalil 2002)."""
    loop = relay_loop(control.tf([1], [1, 3, 3, 1]))
    (cycle,) = describing_function(loop).cycles
    assert cycle.frequency == pytest.approx(math.sqrt(3), rel=1e-12)
    assert cycle.amplitude == pytest.approx(4 / (8 * math.pi), rel=1e-12)
    third = abs(1 / (3j * math.sqrt(3) + 1) ** 3) * 4 / (3 * math.pi)
    assert cycle.distortion == pytest.approx(third / cycle.amplitude, rel=1e-9)


def test_gain_of_saturation() -> None:
    """N(A) = 2/pi (asin(1/A) + sqrt(1 - 1/A^2)/A) for A > 1 (Khalil 2002)."""
    x, y = states("x y")
    loop = System({x: y, y: -x - Max(-1, Min(1, y))})
    split = lure(loop, loop.surfaces[0].name)
    for amplitude in (0.5, 2.0, 7.3):
        share = min(1.0, 1 / amplitude)
        gain = 2 / math.pi * (math.asin(share) + share * math.sqrt(1 - share**2))
        offset = split.offset
        size = amplitude * split.row[1]
        got = split.matrix[1, 1] + split.row[1] * split.harmonic(offset, size)[1] / size
        assert got == pytest.approx(-gain, abs=1e-12)


def test_relay_with_hysteresis() -> None:
    """On 1/(s (s + 1)): -1/N = -pi/4 (sqrt(A^2 - w^2) + j w), balanced where Im G = -pi w/4."""
    width = 0.1
    plain = relay_loop(control.tf([1], [1, 1, 0]))
    (cycle,) = describing_function(plain.with_comparator(Hysteresis(width))).cycles
    omega, amplitude = cycle.frequency, cycle.amplitude
    transfer = 1 / (1j * omega * (1j * omega + 1))
    wanted = -math.pi / 4 * complex(math.sqrt(amplitude**2 - width**2), width)
    assert abs(transfer - wanted) < 1e-12
    exact = solve(plain.with_comparator(Hysteresis(width)), (0.0, 0.3), (0, 200), rtol=1e-10)
    period = 2 * float(exact.events.t[-1] - exact.events.t[-2])
    assert cycle.period == pytest.approx(period, rel=0.03)


@pytest.mark.parametrize("seed", range(15))
def test_12_6_cycles_of_random_loops_in_closed_form(seed: int) -> None:
    """x'' = -w^2 x + a v - b v |v| + c v^3: a - 8 b A/(3 pi) + 3 c A^2/4 = 0 for y = v; 1/(s (s + p) (s + q))
    under a relay of height b: omega^2 = p q, A = 4 b/(pi p q (p + q)); v under a saturation of slope n: the
    root of a = n N(A)."""
    draw = np.random.default_rng([6, seed])
    w, a, b, c = draw.uniform(0.5, 3), draw.uniform(0.1, 1), draw.uniform(0.5, 3), draw.uniform(-0.4, 0.6)
    kind, x, v, z = seed % 3, *states("x v z")
    if kind == 0:
        system = System({x: v, v: -(w**2) * x + a * v - b * v * Abs(v) + c * v**3})
        sizes = np.roots([3 * c / 4, -8 * b / (3 * math.pi), a])
        sizes = np.sort(sizes[(sizes.imag == 0) & (sizes.real > 0)].real)
        known = [(q, w, -8 * b / (3 * math.pi) + 3 * c * q / 2 < 0) for q in sizes]
    elif kind == 1:
        p, q = draw.uniform(0.3, 3, 2)
        system = System({x: v, v: z, z: -p * q * v - (p + q) * z - b * sign(x)})
        known = [(4 * b / (math.pi * p * q * (p + q)), math.sqrt(p * q), True)]
    else:
        slope = a + c
        system = System({x: v, v: -(w**2) * x + a * v - slope * Max(-1, Min(1, v))})
        angle = np.linspace(1e-9, 1 - 1e-9, 1001)

        def gain(s: np.ndarray) -> np.ndarray:
            return 2 / math.pi * (np.arcsin(s) + s * np.sqrt(1 - s**2))

        known = [] if c <= 0 else [(1 / np.interp(a / slope, gain(angle), angle), w, False)]
    found = describing_function(system, system.surfaces[0].name, amplitudes=(1e-3, 1e2)).cycles
    assert len(found) == len(known)
    for cycle, (size, omega, falls) in zip(found, known, strict=True):
        assert cycle.amplitude == pytest.approx(size, rel=1e-4 if kind == 2 else 1e-10)
        assert cycle.frequency == pytest.approx(omega, rel=1e-10)
        assert cycle.stable == falls


@pytest.mark.parametrize("seed", range(6))
def test_12_5_no_cycle_is_told_from_the_rounding_of_a_growth_rate(seed: int) -> None:
    """Springs without damping, and damping that begins at |v| = d: closed orbits, and no limit cycle."""
    draw = np.random.default_rng([5, seed])
    k, b, d = draw.uniform(0.3, 4), draw.uniform(0.1, 2), draw.uniform(0.5, 2)
    x, v = states("x v")
    dead = Max(v - d, 0) + Min(v + d, 0)
    force = [b * sign(x), b * (Max(x - d, 0) + Min(x + d, 0)), b * dead][seed % 3]
    system = System({x: v, v: -k * x - force})
    found = describing_function(system, system.surfaces[0].name, amplitudes=(1e-3, 1e2))
    assert not found.cycles
    (low, high), = found.neutral
    assert low == 1e-3
    assert high == pytest.approx(100.0 if seed % 3 < 2 else d, rel=0.08)
    assert "does not decide" in str(found)


def test_bias_is_balanced() -> None:
    """A relay of unequal levels: the mean of the input is where the constant terms cancel."""
    a, b, c = states("a b c")
    loop = System({a: b, b: c, c: -3 * c - 3 * b - a - sign(a) + 0.2}, surfaces=[Surface("a", a)])
    (cycle,) = describing_function(loop, amplitudes=(1e-3, 10)).cycles
    theta = np.linspace(0, 2 * np.pi, 400_001)
    y = cycle.mean + cycle.amplitude * np.sin(theta)
    assert np.trapezoid(-y - np.sign(y) + 0.2, theta) == pytest.approx(0, abs=1e-4)


@pytest.mark.parametrize("name", ["hunting", "hunting_static", "hunting_coulomb"])
def test_no_cycle_is_predicted_for_friction(name: str) -> None:
    """Friction only takes energy from a sine, so the first harmonic sees no hunting."""
    assert describing_function(get(name).build()).cycles == ()


def test_what_has_no_such_form_is_refused() -> None:
    x, y = states("x y")
    with pytest.raises(ModelError, match="nonlinear in"):
        describing_function(System({x: y, y: -(x**3) - sign(y)}))
    with pytest.raises(ModelError, match="autonomous"):
        describing_function(System({x: y, y: time - sign(y)}))
    with pytest.raises(UsageError, match="name the input"):
        describing_function(System({x: -sign(x), y: -sign(y)}))
    with pytest.raises(UsageError, match="lowest, highest"):
        describing_function(System({x: -sign(x)}), amplitudes=(1.0, 0.1))


REFERENCE = {"m": 1.0, "D": 1.0, "I": 10.0, "b": 1.0}


@pytest.mark.parametrize("gain", [10.0, 15.0, 20.0, 31.0])
def test_static_friction_always_hunts(gain: float) -> None:
    (cycle,) = static_cycles(P=gain, Fs=4, Fc=2, **REFERENCE)
    model = get("hunting_static")
    section = Section.from_model(model)
    exact = EventMap(model.build(), section, parameters={"P": gain}, rtol=1e-12, atol=1e-14)
    assert -exact(cycle.d) == pytest.approx(cycle.d, rel=1e-11)
    start = (cycle.d, 0.0, (4 / gain - cycle.d) / REFERENCE["I"])
    run = solve(model.build(), start, (0, 5), parameters={"P": gain}, rtol=1e-12, atol=1e-14)
    entries = run.events.of(kind="sliding entry").t
    exits = run.events.of(kind="sliding exit").t
    assert entries[0] == pytest.approx(cycle.slip, rel=1e-9)
    assert exits[1] - exits[0] == pytest.approx(cycle.period / 2, rel=1e-9)
    assert exact.derivative(cycle.d) == pytest.approx(-cycle.multiplier, rel=1e-7)
    assert cycle.stable


def test_static_cycle_scales_with_the_jump() -> None:
    (one,) = static_cycles(P=10, Fs=4, Fc=2, **REFERENCE)
    (two,) = static_cycles(P=10, Fs=2.2, Fc=2, **REFERENCE)
    assert two.d == pytest.approx(0.1 * one.d, rel=1e-12)
    assert two.slip == pytest.approx(one.slip, rel=1e-12)


def test_coulomb_friction_never_hunts() -> None:
    model = get("hunting_coulomb")
    exact = EventMap(model.build(), Section.from_model(model), rtol=1e-11, atol=1e-14)
    ratio = coulomb_ratio(P=10, **REFERENCE)
    assert ratio is not None
    assert 0 < ratio < 1
    assert -exact(0.1) / 0.1 == pytest.approx(ratio, rel=1e-9)
    with pytest.raises(UsageError, match="coulomb_ratio"):
        static_cycles(P=10, Fs=2, Fc=2, **REFERENCE)
    with pytest.raises(UsageError, match="Routh-Hurwitz"):
        static_cycles(P=1, Fs=4, Fc=2, m=1, D=1, I=10)


@pytest.mark.parametrize(
    ("above", "below"), [([2], [1, 3, 3, 1]), ([1, -0.5], [1, 2, 5, 0]), ([2], [1, 1, 0])]
)
def test_c12_control_round_trip(above: list[float], below: list[float]) -> None:
    plant = control.tf(above, below)
    back = linear_plant(relay_loop(plant), "output")
    wanted, got = control.margin(plant), control.margin(control.ss2tf(back))
    np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-9)


def test_c12_improper_plants_are_named() -> None:
    with pytest.raises(ModelError, match="not strictly proper"):
        relay_loop(control.tf([1, 2, 3], [1, 1]))
    with pytest.raises(ModelError, match="feed-through"):
        relay_loop(control.ss([[-1]], [[1]], [[1]], [[0.5]]))
    with pytest.raises(ModelError, match="sampled"):
        relay_loop(control.tf([1], [1, 0.5], 0.1))
    with pytest.raises(ModelError, match="expected a TransferFunction"):
        relay_loop("1/s")


@pytest.mark.parametrize("size", [1.0, 1e-6, 1e6])
def test_a_prediction_of_none_names_the_amplitudes_that_were_searched(size: float) -> None:
    """The cycle of 1/((s + 1)(s + 2)(s + 3)) under a relay of height h: A = 4 h/(60 pi)."""
    x, y, z = states("x y z")
    loop = System({x: -3 * x + y, y: -2 * y + z, z: -z - size * sign(x)})
    found = describing_function(loop)
    assert found.to_dict()["searched"] == pytest.approx([1e-4, 1e3])
    if size == 1.0:
        assert len(found.cycles) == 1
    else:
        assert str(found).endswith("predicts no limit cycle with A from 0.0001 to 1000.")
    (cycle,) = describing_function(loop, amplitudes=(1e-4 * size, 1e3 * size)).cycles
    assert cycle.amplitude == pytest.approx(4 * size / (60 * np.pi), rel=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_relays_under_a_bias(seed: int) -> None:
    """1/((s + a)(s + b)(s + c)) under -sgn(x) + bias, c = 0 in half of them: mean m and A in closed form.

    The mean of sgn(m + A sin) is 2/pi asin(m/A), its gain 4/(pi A) sqrt(1 - m^2/A^2) (Gelb & Vander Velde
    1968). Beyond the level of the relay nothing balances, or the mean lies outside of the oscillation.
    """
    rng = np.random.default_rng([61, seed])
    a, b, c = *rng.uniform(0.5, 2, 2), rng.uniform(0.5, 2) * (seed % 2)
    bias = (rng.uniform(0.1, 0.9) if seed % 4 < 2 else rng.uniform(1.2, 4)) * rng.choice([-1, 1])
    unit = 10.0 ** rng.integers(-3, 3)
    x, y, z = states("x y z")
    loop = System({x: y - a * x, y: z - b * y, z: -c * z - unit * sign(x) + unit * bias})
    found = describing_function(loop, amplitudes=(1e-4 * unit, 1e2 * unit))
    if abs(bias) > 1:
        assert not found.cycles
        assert bool(found.unbalanced) == (c == 0)
        return
    gain = (a + b) * (b + c) * (a + c)

    def size(share: float) -> float:
        return 4 / (math.pi * gain) * math.sqrt(1 - share**2)

    share = brentq(
        lambda q: a * b * c * q * size(q) + 2 / math.pi * math.asin(q) - bias, -1 + 1e-12, 1 - 1e-12
    )
    (cycle,) = found.cycles
    assert cycle.frequency == pytest.approx(math.sqrt(a * b + b * c + a * c), rel=1e-8)
    assert cycle.amplitude == pytest.approx(unit * size(share), rel=1e-8)
    assert cycle.mean == pytest.approx(share * cycle.amplitude, rel=1e-7)
    assert not found.unbalanced


@pytest.mark.parametrize("d", [0.01, 0.1, 0.3])
def test_the_amplitude_does_not_depend_on_how_the_width_is_written(d: float) -> None:
    """Of x'' + x' = -sgn with a band of half-width d, in closed form.

    The Nyquist curve of 1/(s^2 + s) meets -1/N(A) = -pi/4 (sqrt(A^2 - d^2) + j d) where
    1/(1 + w^2) = pi/4 sqrt(A^2 - d^2) and 1/(w (1 + w^2)) = pi/4 d.
    """
    x, v = states("x v")
    p = parameters(d=0.5, offset=0.0)
    written, number = (
        System({x: v, v: -v - sign(x)}, surfaces=[Surface("relay", x, width=width)]) for width in (p.d, d)
    )
    w = brentq(lambda w: 1 / (w * (1 + w * w)) - np.pi * d / 4, 1e-2, 1e2)
    wanted = np.hypot(4 / np.pi / (1 + w * w), d)
    found = describing_function(written, parameters={"d": d})
    (cycle,), (plain,) = found.cycles, describing_function(number).cycles
    assert (cycle.amplitude, cycle.frequency) == pytest.approx((wanted, w), rel=1e-8)
    assert cycle.amplitudes == pytest.approx(plain.amplitudes, rel=1e-8)
    assert cycle.distortion == pytest.approx(plain.distortion, rel=1e-8)
    assert found.to_dict()["searched"] == pytest.approx(describing_function(number).to_dict()["searched"])
    k = int(np.argmin(np.abs(found.amplitude - 2)))
    at = found.amplitude[k]
    assert found.gain[1, k] == pytest.approx(-4 / np.pi / at**2 * (np.sqrt(at**2 - d**2) - 1j * d), rel=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_cycles_close_beside_each_other_are_both_found(seed: int) -> None:
    """1/((s + a)(s + b)(s + c)) under a relay with dead zone d: N = 4 k/(pi A) sqrt(1 - (d/A)^2), largest at
    A = sqrt(2) d, is critical on both sides of it; the levels of the search lie 10 % apart."""
    rng = np.random.default_rng([91, seed])
    a, b, c = *rng.uniform(0.2, 2, 2), rng.uniform(0.2, 2) * (seed % 2)
    d, above = 10.0 ** rng.uniform(-2, 2), 10.0 ** rng.uniform(-4, 0.5)
    critical = (a + b) * (b + c) * (a + c)
    k = (1 + above) * critical * math.pi * d / 2
    x, y, z = states("x y z")
    relay = sign(x - d) + sign(x + d)
    loop = System({x: y - a * x, y: z - b * y, z: -c * z - k / 2 * relay})
    found = describing_function(loop, amplitudes=(1e-3 * d, 1e3 * d)).cycles
    # A^2 = q: critical pi/(4 k) q = sqrt(q - d^2).
    q = np.sort(np.roots([(critical * math.pi / (4 * k)) ** 2, -1, d**2]).real)
    assert [cycle.amplitude for cycle in found] == pytest.approx(np.sqrt(q), rel=1e-6)
    assert [cycle.stable for cycle in found] == [False, True]


def test_gain_of_relays_whose_hysteresis_is_not_about_the_mean() -> None:
    """sgn(y - c) of half-width w: 4/(pi A^2) ((sqrt(A^2 - (c + w)^2) + sqrt(A^2 - (c - w)^2))/2 - j w)
    from A = c + w on, and 0 before: inside its band it keeps the sign it had."""
    x, v = states("x v")
    c, w = 1.0, 0.3
    field = {x: v, v: -v - sign(x - c) - sign(x + c)}
    system = System(field, surfaces=[Surface("up", x - c, width=w), Surface("down", x + c, width=w)])
    found = describing_function(system, "up", amplitudes=(0.1, 10))
    a = found.amplitude.astype(complex)
    roots = np.sqrt(a**2 - (c + w) ** 2) + np.sqrt(a**2 - (c - w) ** 2)
    wanted = np.where(found.amplitude < c + w, 0, -4 / np.pi / a**2 * (roots - 2j * w))
    assert found.gain[1] == pytest.approx(wanted, abs=1e-5)


def test_a_cycle_is_not_stable_beside_an_eigenvalue_that_grows() -> None:
    x, y, z, w = states("x y z w")
    field = {x: y, y: z - y, z: -z - sign(x)}
    for rate in (-1, 1):
        system = System({**field, w: rate * w + x}, surfaces=[Surface("s", x)])
        (cycle,) = describing_function(system).cycles
        assert cycle.amplitude == pytest.approx(2 / math.pi, rel=1e-10)
        assert cycle.stable == (rate < 0)


def test_states_that_jump_are_refused() -> None:
    x, y, z = states("x y z")
    field = {x: y, y: z - y, z: -z - sign(x)}
    reset = Surface("stop", x - 0.1, reset={y: -y}, side="-")
    with pytest.raises(ModelError, match=r"the state jumps at surface 'stop'.*find_orbit"):
        describing_function(System(field, surfaces=[Surface("s", x), reset]), "s")
    kick = TimeEvent("kick", period=1, reset={y: -y})
    with pytest.raises(ModelError, match=r"the state jumps at time event 'kick'.*find_orbit"):
        describing_function(System(field, surfaces=[Surface("s", x)], time_events=[kick]), "s")


def test_rounding_of_coefficients_is_no_second_input() -> None:
    """-1 = N(a) C (j w - A)^-1 B for plants with coefficients of all digits: 3 of 10 were refused.

    Of sgn(y - c) under m + a sin the gain is 4/(pi a) sqrt(1 - q^2), the mean -2/pi asin(q), q = (c - m)/a.
    """
    rng = np.random.default_rng(1)
    x = states("x0 x1 x2")
    for k in range(12):
        lags, row, d = np.poly(-rng.uniform(0.2, 3, 3)), rng.uniform(-1.5, 1.5, 3), rng.uniform(0.1, 0.3)
        y = sum(float(c) * q for c, q in zip(row, x, strict=True))
        control_law = sign(y) if k % 2 else (sign(y - d) + sign(y + d)) / 2
        last = -sum(float(a) * q for a, q in zip(lags[:0:-1], x, strict=True)) - control_law
        loop = System({x[0]: x[1], x[1]: x[2], x[2]: last})
        for cycle in describing_function(loop, surface=loop.surface_names[0]).cycles:
            s, a = 1j * cycle.frequency, cycle.amplitude
            mean = cycle.mean + (0 if k % 2 else d)  # of y; the input is y - d
            share = np.clip((np.array([0.0] if k % 2 else [-d, d]) - mean) / a, -1, 1)
            gain = 4 / (math.pi * a) * np.mean(np.sqrt(1 - share**2))
            assert gain * np.polyval(row[::-1], s) / np.polyval(lags, s) == pytest.approx(-1, abs=1e-9)
            level = np.mean(-2 / math.pi * np.arcsin(share))
            assert mean == pytest.approx(-level * row[0] / lags[-1], abs=1e-9 * a)


@pytest.mark.parametrize("seed", range(4))
def test_cycles_about_each_equilibrium(seed: int) -> None:
    """x''' + a x'' + b x' - c x + x^3 = e sgn(x - q), with the sign where the cycles do not reach it.

    About m: m (m^2 + 3/2 A^2 - c) = -e sgn q; a pair on the axis at w^2 = b where 3 m^2 + 3/4 A^2 - c = a b
    (Genesio & Tesi 1992). About the middle there is one more, unstable; only that was found.
    """
    rng = np.random.default_rng([92, seed])
    unit, a, b = 10.0 ** rng.integers(-1, 2), rng.uniform(0.5, 1.5), rng.uniform(0.5, 2)
    c = a * b * rng.uniform(0.55, 0.7)
    x, v, w = states("x v w")
    e, q = 0.02 * c, 3.0
    field = {x: v, v: w, w: -a * w - b * v + c * x - x**3 / unit**2 + unit * e * sign(x - unit * q)}
    found = describing_function(System(field), amplitudes=(1e-3 * unit, 20 * unit))
    means = np.roots([-5, 0, 2 * a * b + c, e])  # with A^2 = 4/3 (a b + c - 3 m^2)
    known = sorted((4 / 3 * (a * b + c - 3 * m**2), m) for m in means.real if 3 * m**2 < a * b + c)
    assert len(found.cycles) == len(known) == 3
    for cycle, (square, mean) in zip(found.cycles, known, strict=True):
        assert cycle.amplitude == pytest.approx(unit * math.sqrt(square), rel=1e-8)
        assert cycle.mean + unit * q == pytest.approx(unit * mean, rel=1e-7, abs=1e-7 * unit)
        assert cycle.frequency == pytest.approx(math.sqrt(b), rel=1e-8)
        assert cycle.stable == (abs(mean) > 0.1)
    assert str(found).count(" about ") == 3


def test_the_second_harmonic_is_part_of_the_distortion() -> None:
    """x''' + a x'' + b x' + x - x^2 = e sgn(x + 9): A^2 (1 - cos 2 theta)/2 has no third harmonic, but of
    the second A/2/|s^3 + a s^2 + b s| is fed back, s = 2 j w; 0 % was told."""
    a, b, e = 0.9, 0.8, 1e-3
    x, v, w = states("x v w")
    system = System({x: v, v: w, w: -a * w - b * v - x + x**2 + e * sign(x + 9)})
    (cycle,) = describing_function(system, amplitudes=(1e-3, 5)).cycles
    mean = (1 - a * b) / 2
    assert cycle.mean - 9 == pytest.approx(mean, rel=1e-8)
    assert cycle.amplitude == pytest.approx(math.sqrt(2 * (mean - mean**2 - e)), rel=1e-8)
    back = abs(np.polyval([1, a, b, 0], 2j * math.sqrt(b)))
    assert cycle.distortion == pytest.approx(cycle.amplitude / 2 / back, rel=1e-8)


def test_a_cycle_beside_the_end_of_a_branch_of_means() -> None:
    """x''' + a x'' + b x' + d + c1 x + c2 x^2 + c3 x^3 = 0: two means meet at A = 0.89, a cycle is at 0.88.

    Mean: d + c1 m + c2 (m^2 + A^2/2) + c3 (m^3 + 3/2 m A^2) = 0; gain c1 + 2 c2 m + 3 c3 (m^2 + A^2/4) = a b.
    """
    a, b, c1, c2, c3, d = 0.915, 0.797, 1.843, 1.269, -1.055, -0.432
    x, v, w = states("x v w")
    force = d + c1 * x + c2 * x**2 + c3 * x**3 - 1e-9 * sign(x - 40)
    system = System({x: v, v: w, w: -a * w - b * v - force})
    (cycle,) = describing_function(system, amplitudes=(1e-3, 30)).cycles
    square = np.poly1d([-3 * c3, -2 * c2, a * b - c1]) / (0.75 * c3)
    balance = np.poly1d([c3, c2, c1, d]) + square * np.poly1d([1.5 * c3, c2 / 2])
    (mean,) = [m.real for m in balance.roots if abs(m.imag) < 1e-9 and square(m.real) > 0]
    assert cycle.mean + 40 == pytest.approx(mean, abs=1e-6)
    assert cycle.amplitude == pytest.approx(math.sqrt(square(mean)), rel=1e-6)
