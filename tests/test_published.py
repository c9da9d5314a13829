"""Problems of the literature as a user writes them, against closed forms and matrix exponentials.

Each docstring names the source; nothing here is computed by the code under test but the answer.
"""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq, fsolve

from filippov import (
    Heaviside,
    Max,
    Piecewise,
    Status,
    Surface,
    System,
    TimeEvent,
    cos,
    exp,
    parameters,
    sign,
    sin,
    solve,
    sqrt,
    states,
    t,
)
from filippov.analysis import continuation, find_orbit, stability_report

approx = pytest.approx
x, v, w = states("x v w")


def test_brockett_integrator_is_held_on_z_0_after_a_finite_time() -> None:
    """Bloch & Drakunov 1996: z' = -(x^2 + y^2) sign z, while (x, y) turns and decays like exp(-t)."""
    y, z = states("y z")
    across, along = -x + y * sign(z), -y - x * sign(z)
    run = solve(System({x: across, y: along, z: x * along - y * across}), (1, 0.5, 0.4), (0, 5))
    hits = -0.5 * math.log(1 - 2 * 0.4 / 1.25)
    turned = complex(1, 0.5) * np.exp(-1j * hits - 5)
    assert run.modes == ("+", "0")
    assert run.events.t == approx([hits], rel=1e-9)
    assert run.x_end == approx([turned.real, turned.imag, 0], abs=1e-9)


def test_super_twisting_takes_its_time_from_linear_arcs() -> None:
    """Levant 1993: with q = sqrt|x| and dt = 2 q dtau each arc is linear; half turns shrink by a factor."""
    k1, k2 = 1.5, 1.1
    rate = np.array([[-k1, 1, 0], [-2 * k2, 0, 0], [2, 0, 0]])

    def arc(q: float, speed: float) -> tuple[float, float]:
        ends = next(s for s in np.arange(0.05, 20, 0.05) if (expm(rate * s) @ [q, speed, 0])[0] < 0)
        s = brentq(lambda s: (expm(rate * s) @ [q, speed, 0])[0], ends - 0.05, ends, xtol=1e-15)
        _, speed, time = expm(rate * s) @ [q, speed, 0]
        return speed, time

    speed, first = arc(1, 0)
    after, second = arc(1e-300, -speed)
    total = first + second / (1 - after / speed)
    run = solve(
        System({x: -k1 * sqrt(abs(x)) * sign(x) + w, w: -k2 * sign(x)}), (1, 0), (0, 5), zeno="continue"
    )
    assert run.success
    assert run.x_end == approx([0, 0], abs=1e-9)
    assert run.events.t[:2] == approx([first, first + second], rel=1e-8)
    assert run.zeno.t == approx(total, rel=1e-7)


@pytest.mark.parametrize("power", [0.5, 0.6])
def test_terminal_sliding_reaches_its_end_in_finite_time(power: float) -> None:
    """Venkataraman & Gulati 1993: v + |x|^a sign x = 0 slides to rest within x^(1-a)/(1-a)."""
    run = solve(System({x: v, v: -2 * sign(v + abs(x) ** power * sign(x))}), (1, 0), (0, 6))
    meets = brentq(lambda s: 2 * s - (1 - s * s) ** power, 0, 1, xtol=1e-15)
    rest = meets + (1 - meets**2) ** (1 - power) / (1 - power)
    assert run.success
    assert run.events.t == approx([meets, rest], rel=1e-8)
    assert run.x_end == approx([0, 0], abs=1e-12)


def test_relay_with_hysteresis_has_the_limit_cycle_of_its_closed_form() -> None:
    """Astrom 1995: C x(h) = width with x(h) = -x(0) for 1/(s + 1)^3."""
    y, u = states("y u")
    loop = System({x: y, y: u, u: -x - 3 * y - 3 * u - sign(x)}, surfaces=[Surface("relay", x, width=0.1)])
    A, B, C = np.array([[0, 1, 0], [0, 0, 1], [-1, -3, -3.0]]), np.array([0, 0, -1.0]), np.array([1.0, 0, 0])

    def start(h: float) -> np.ndarray:
        over = np.linalg.solve(A, (expm(A * h) - np.eye(3)) @ B)
        return np.asarray(-np.linalg.solve(np.eye(3) + expm(A * h), over))

    h = brentq(lambda h: start(h)[0] - 0.1, 1, 8, xtol=1e-14)
    speed = expm(A * h) @ (A @ start(h) + B)
    half = (np.eye(3) - np.outer(speed, C) / (C @ speed)) @ expm(A * h)
    orbit = find_orbit(loop, (0.5, 0, 0))
    assert orbit.period == approx(2 * h, rel=1e-10)
    largest = sorted(abs(np.linalg.eigvals(half)))[:0:-1]
    assert sorted(abs(orbit.multipliers))[::-1][:2] == approx(np.square(largest), rel=1e-6)


def test_three_gene_ring_has_the_period_of_the_golden_ratio() -> None:
    """Glass & Pasternack 1978: x' = -x - sign z and round the ring; the period is 6 ln((1 + sqrt 5)/2)."""
    a, b, c = states("a b c")
    ring = find_orbit(System({a: -a - sign(c), b: -b + sign(a), c: -c + sign(b)}), (0.5, 0.1, -0.2))
    assert ring.period == approx(6 * math.log((1 + math.sqrt(5)) / 2), rel=1e-10)
    assert ring.stable


def test_ice_line_has_two_climates_and_an_unstable_one_between() -> None:
    """Budyko 1969 with one temperature: albedo 0.62 below -10 degrees, 0.32 above."""
    T, = states("T")
    p = parameters(Q=342.0, A=202.0, B=1.9)
    albedo = Piecewise((0.62, T < -10), (0.32, True))
    found = stability_report(System({T: p.Q * (1 - albedo) - p.A - p.B * T})).items
    told = {item.equilibrium.mode: (item.equilibrium.value[0], item.answer) for item in found}
    assert told["+"] == (approx((342 * 0.68 - 202) / 1.9), "asymptotically stable")
    assert told["-"] == (approx((342 * 0.38 - 202) / 1.9), "asymptotically stable")
    assert told["0"] == (approx(-10), "unstable")


def test_threshold_policy_holds_the_stock_at_the_threshold() -> None:
    """Costa, Kaszkurewicz, Bhaya & Hsu 2000: x' = x (1 - x) - e x above the threshold 0.5."""
    run = solve(System({x: x * (1 - x) - 0.8 * x * Heaviside(x - 0.5)}), (0.9,), (0, 10))
    assert run.events.t == approx([5 * math.log((5 - 1 / 0.9) / 3)], rel=1e-9)
    assert run.modes == ("+", "0")
    assert (1 + run.multiplier("x - 0.5", 8)) / 2 == approx(0.5 / 0.8)


def test_forced_block_without_stops_has_den_hartogs_amplitude() -> None:
    """Den Hartog 1931: x0^2 = V^2 - (f U)^2, V = 1/(1 - w^2), U = sin(pi/w)/(w (1 + cos(pi/w)))."""
    f, omega = 0.3, 0.7
    swing = find_orbit(System({x: v, v: -x - f * sign(v) + cos(omega * t)}), (0, 0))
    V, U = 1 / (1 - omega**2), math.sin(math.pi / omega) / (omega * (1 + math.cos(math.pi / omega)))
    assert swing.amplitude["x"] == approx(math.sqrt(V**2 - (f * U) ** 2), rel=1e-9)


def test_grazing_of_an_impact_oscillator_is_where_its_amplitude_is_the_gap() -> None:
    """Nordmark 1991: without impacts the amplitude is 1/|1 - w^2 + 2 i zeta w|."""
    p = parameters(d=1.0, zeta=0.1, w=0.8, r=0.8)
    free = System(
        {x: v, v: -x - 2 * p.zeta * v + cos(p.w * t)},
        surfaces=[Surface("wall", p.d - x, reset={v: -p.r * v})], parameters=p,
    )  # fmt: skip
    size = 1 / abs(complex(1 - 0.8**2, 2 * 0.1 * 0.8))
    orbit = find_orbit(free, (0, 0), parameters={"d": 1.2 * size})
    branch = continuation(free, orbit, parameter="d", bounds=(0.9 * size, 1.3 * size), direction=-1).run()
    assert [point.special for point in branch.special] == ["C-bifurcation"]
    assert branch.special[0].value == approx(size, rel=1e-9)


def test_delta_sigma_modulator_gives_the_bits_of_its_recursion() -> None:
    """Norsworthy, Schreier & Temes 1997, first order: x+ = x + T (u - y), y = sign x at each clock."""
    y, = states("y")
    clock = TimeEvent("clock", period=0.1, reset={y: sign(x)})
    run = solve(System({x: 0.3 - y, y: 0 * y}, time_events=[clock]), (0.123, 1), (0, 20))
    level, bit, bits = 0.123, 1.0, []
    for _ in range(200):
        level += 0.1 * (0.3 - bit)
        bit = math.copysign(1, level)
        bits.append(bit)
    assert [event.x_after[1] for event in run.events.of("clock")] == bits
    assert run.x_end[0] == approx(level, abs=1e-10)


def test_resistor_behind_a_diode_is_switched_by_the_sign_of_the_voltage() -> None:
    """Acary & Brogliato 2008, an LC circuit whose resistor conducts for v > 0: matrix exponentials."""
    L, C, R = 1e-2, 1e-6, 1e3
    run = solve(System({v: -x / C - Max(v, 0) / (R * C), x: v / L}), (10, 0), (0, 2e-3))
    fields = [np.array([[-g / (R * C), -1 / C], [1 / L, 0]]) for g in (1, 0)]
    state, now = np.array([10.0, 0.0]), 0.0
    for k in range(len(run.events)):
        A, side = fields[k % 2], 1 - 2 * (k % 2)
        grid = np.arange(1, 80) * 1e-5
        last = next(s for s in grid if side * (expm(A * s) @ state)[0] < 0)
        dt = brentq(lambda s, A=A, state=state: (expm(A * s) @ state)[0], last - 1e-5, last, xtol=1e-20)
        state, now = expm(A * dt) @ state, now + dt
        assert run.events.t[k] == approx(now, rel=1e-8)
    assert len(run.events) >= 5
    assert run.x_end == approx(expm(fields[len(run.events) % 2] * (2e-3 - now)) @ state, rel=1e-7, abs=1e-9)


def test_curve_of_optimal_switching_by_plain_functions_is_not_searched_for_roots() -> None:
    """Pontryagin et al. 1962: x'' = -sign(x + v|v|/2) rests at t = 2; the curve is a solution of one side."""
    curve = Surface("curve", lambda t, x, p: x[0] + x[1] * abs(x[1]) / 2)
    plain = System(field=lambda t, x, p, s: [x[1], -s[0]], surfaces=[curve], states="x v")
    run = solve(plain, (1, 0), (0, 1.6))
    assert run.status is Status.SUCCESS
    assert run.x_end == approx([0.08, -0.4], abs=1e-9)
    assert run.events.t == approx([1], abs=1e-9)
    assert run.nfev < 2000
    assert solve(plain, (1, 0), (0, 5)).x_end == approx([0, 0], abs=1e-6)


def test_forced_stops_change_nowhere_but_where_the_orbit_does() -> None:
    """Rounding is no event: x'' + x = cos(t/3) - F sign x' has one word from F = 0.2 to 0.9."""
    p = parameters(F=0.4)
    block = System({x: v, v: -x - p.F * sign(v) + cos(t / 3)}, parameters=p)
    branch = continuation(block, find_orbit(block, (0, 0)), parameter="F", bounds=(0.2, 0.9)).run()
    assert not branch.special
    assert {point.word for point in branch.points} == {"stick slip- stick slip+"}


def test_disturbance_is_seen_in_the_mean_of_the_switching() -> None:
    """Utkin 1992: x' = 3 sin t - 2 sign x is held at 0 while |3 sin t| <= 2, with sign = 3/2 sin t."""
    run = solve(System({x: 3 * sin(t) - 2 * sign(x)}), (1,), (0, 20))
    lands = brentq(lambda s: 1 + 3 * (1 - math.cos(s)) - 2 * s, 3, 4, xtol=1e-15)
    leaves = math.asin(2 / 3)
    assert run.events.t[:2] == approx([lands, math.pi + leaves], rel=1e-10)
    assert run.multiplier("x", 3.6) == approx(1.5 * math.sin(3.6), abs=1e-9)


def test_a_clock_that_ends_a_slide_and_clocks_at_once_have_a_derivative() -> None:
    """Discontinuous conduction (Erickson & Maksimovic 2001, chapter 5), beside a count at the same clock.

    The current is 0 at the end of a period, so its map takes the voltage alone: by the matrix exponential of
    each part, where the time at which the diode blocks is a function of the voltage.
    """
    i, q, n = states("i q n")
    L, C, R, E, T, D = 2e-5, 1e-4, 50.0, 12.0, 2e-5, 0.3
    drive = (q * E - v) / L
    diode = Piecewise((drive, i > 0), (Max(drive, 0), True))
    clocks = [
        TimeEvent("on", period=T, reset={q: 1}),
        TimeEvent("off", period=T, start=D * T, reset={q: 0}),
        TimeEvent("count", period=T, reset={n: n / 2 + v}),
    ]
    system = System({i: diode, v: (i - v / R) / C, q: 0 * q, n: 0 * n}, time_events=clocks)

    def flow(x: np.ndarray, drive: float, dt: float) -> np.ndarray:
        rate = np.array([[0, -1 / L, drive / L], [1 / C, -1 / (R * C), 0], [0, 0, 0]])
        return np.asarray((expm(rate * dt) @ [*x, 1])[:2])

    def period(voltage: float) -> float:
        x = flow(np.array([0, voltage]), E, D * T)
        out = brentq(lambda dt: flow(x, 0, dt)[0], 0, (1 - D) * T, xtol=1e-20)
        return float(flow(x, 0, out)[1] * np.exp(-((1 - D) * T - out) / (R * C)))

    voltage = brentq(lambda u: period(u) - u, 5, 12, xtol=1e-13)
    slope = (period(voltage + 1e-3) - period(voltage - 1e-3)) / 2e-3
    orbit = find_orbit(system, (0, 8, 1, 0), period=T, transient=400 * T)
    at_clock = next(event.x[1] for event in orbit.events if event.surface == "on")
    assert at_clock == pytest.approx(voltage, rel=1e-8)
    assert orbit.multipliers[:2].real == pytest.approx([slope, 0.5], abs=1e-7)


def phase(
    f: Any, x: Any, g: Any, direction: int, start: float = 0.0, skip: float = 1e-4
) -> tuple[float, np.ndarray]:
    """The next time after `skip` at which g(t, x) passes 0 in a direction, by scipy, and the state there."""
    def stop(s: float, z: np.ndarray) -> float:
        return float(g(s, z))

    stop.terminal, stop.direction = True, direction  # type: ignore[attr-defined]
    fine: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-14}
    first = solve_ivp(f, (start, start + skip), x, **fine)
    run = solve_ivp(f, (start + skip, start + 50), first.y[:, -1], events=stop, max_step=0.05, **fine)
    assert run.status == 1
    return float(run.t[-1]), np.asarray(run.y[:, -1])


def slopes(f: Any, x: np.ndarray, step: float) -> np.ndarray:
    """The derivative of a map, by differences of order 4."""
    def slope(e: np.ndarray) -> np.ndarray:
        return np.asarray(8 * (f(x + e) - f(x - e)) - (f(x + 2 * e) - f(x - 2 * e))) / (12 * step)

    return np.array([slope(e) for e in step * np.eye(len(x))]).T


def test_simplest_walker_has_the_gait_of_its_paper() -> None:
    """Garcia, Chatterjee, Ruina & Coleman 1998, slope 0.009: the long gait; its foot scuffs on the way."""
    th, om, ph, rate = states("th om ph rate")
    fall = sin(th - 0.009)
    swing = fall + om**2 * sin(ph) - cos(th - 0.009) * sin(ph)
    struck = {th: -th, om: cos(2 * th) * om, ph: -2 * th, rate: cos(2 * th) * (1 - cos(2 * th)) * om}
    # The heel strikes behind the middle of the step: both arguments have to be negative.
    heel = Surface("heel", Max(2 * th - ph, th), reset=struck)
    walker = System({th: om, om: fall, ph: rate, rate: swing}, surfaces=[heel])

    def field(_: float, z: np.ndarray) -> list[float]:
        down = math.sin(z[0] - 0.009)
        return [z[1], down, z[3], down + z[1] ** 2 * math.sin(z[2]) - math.cos(z[0] - 0.009) * math.sin(z[2])]

    def step(u: np.ndarray) -> tuple[float, np.ndarray]:
        a, b = u
        start = [a, b, 2 * a, (1 - math.cos(2 * a)) * b]
        time, z = phase(field, start, lambda _, z: 2 * z[0] - z[2], -1, skip=1.0)
        return time, np.array([-z[0], math.cos(2 * z[0]) * z[1]])

    gait = fsolve(lambda u: step(u)[1] - u, [0.2, -0.2], xtol=1e-13)
    assert gait == pytest.approx([0.20031090, -0.19983247], abs=2e-7)
    a, b = gait
    orbit = find_orbit(walker, (a, b, 2 * a, (1 - math.cos(2 * a)) * b))
    assert orbit.period == pytest.approx(step(gait)[0], abs=1e-9)
    largest = np.abs(np.linalg.eigvals(slopes(lambda u: step(u)[1], gait, 1e-4)))
    assert np.sort(np.abs(orbit.multipliers))[-2:] == pytest.approx(np.sort(largest), abs=1e-6)


def test_two_tanks_are_empty_at_the_end_of_infinitely_many_switches() -> None:
    """Johansson, Egerstedt, Lygeros & Sastry 1999: the inflow goes to the tank that runs empty."""
    y, q = states("y q")
    rules = [Surface("first", x, reset={q: 1 + 0 * q}), Surface("second", y, reset={q: 0 * q})]
    tanks = System({x: 1.8 * q - 1, y: 1.8 * (1 - q) - 1.2, q: 0 * q}, surfaces=rules)
    run = solve(tanks, (1, 0.7, 1), (0, 6))
    a, b, filled, time, times = 1.0, 0.7, True, 0.0, []
    for _ in range(20):
        dt = b / 1.2 if filled else a
        a, b = (a + 0.8 * dt, 0.0) if filled else (0.0, b + 0.6 * dt)
        filled, time = not filled, time + dt
        times.append(time)
    assert run.status is Status.ZENO
    assert run.events.t[:20] == approx(times, rel=1e-12)
    assert run.zeno.t == approx(1.7 / (1 + 1.2 - 1.8), abs=1e-7)


def test_rocking_block_loses_speed_at_each_foot() -> None:
    """Housner 1963, Hogan 1989: x'' = x - sign x + b cos wt, the speed times r where x passes 0."""
    r, b, omega = 0.925, 0.2, 3.0
    foot = Surface("foot", x, reset={v: r * v}, side="both")
    run = solve(System({x: v, v: x - sign(x) + b * cos(omega * t)}, surfaces=[foot]), (0.5, 0), (0, 15))
    time, z, side, times = 0.0, np.array([0.5, 0.0]), 1.0, []
    for _ in range(8):
        def rates(s: float, z: np.ndarray, side: float = side) -> list[float]:
            return [z[1], z[0] - side + b * math.cos(omega * s)]

        time, z = phase(rates, z, lambda _, z: z[0], int(-side), time)
        times.append(time)
        z, side = np.array([0.0, r * z[1]]), -side
    assert [event.t for event in run.events if event.kind == "reset"][:8] == approx(times, abs=1e-8)


def test_current_mode_converter_doubles_its_period_at_half_duty() -> None:
    """Deane 1992: with a constant output voltage the multiplier is -D/(1 - D), D = 1 - E/V."""
    p, q = parameters(V=18.0, E=10.0, L=1e-3, T=1e-4), states("q")[0]
    peak = Surface("peak", x - 1, reset={q: 0 * q}, side="-")
    clock = TimeEvent("clock", period=p.T, reset={q: 1 + 0 * q})
    ramps = {x: (p.E - (1 - q) * p.V) / p.L, q: 0 * q}
    boost = System(ramps, surfaces=[peak], time_events=[clock], parameters=p)
    orbit = find_orbit(boost, (0.6, 1), period="T")
    assert orbit.multipliers.real == approx([-0.8, 0], abs=1e-9)
    special = continuation(boost, orbit, parameter="V", bounds=(12, 24)).run().special
    assert [(point.special, point.value) for point in special] == [("period doubling", approx(20, rel=1e-9))]


def test_neuron_fires_where_its_closed_form_reaches_the_threshold() -> None:
    """Keener, Hoppensteadt & Rinzel 1981: v' = -v + I + A cos wt, reset to 0 at 1."""
    fire = Surface("fire", v - 1, reset={v: 0 * v}, side="-")
    run = solve(System({v: -v + 1.2 + 0.3 * cos(3 * t)}, surfaces=[fire]), (0,), (0, 20))

    def level(s: float, start: float) -> float:
        def forced(s: float) -> float:
            return 1.2 + 0.03 * (math.cos(3 * s) + 3 * math.sin(3 * s))

        return forced(s) - forced(start) * math.exp(start - s)

    last = 0.0
    for event in run.events:
        grid = last + np.arange(1, 4000) * 2e-3
        k = next(k for k, s in enumerate(grid) if level(s, last) > 1)
        last = brentq(lambda s, last=last: level(s, last) - 1, grid[k - 1], grid[k], xtol=1e-14)
        assert event.t == approx(last, abs=1e-9)
    assert len(run.events) > 8
    assert run.x_end[0] == approx(level(20, last), abs=1e-8)


def test_cycle_of_stick_and_slip_ends_where_the_slip_grazes_the_belt() -> None:
    """Galvanetto & Bishop 1999: friction 0.6 + 0.4 exp(-2 |v - V|), damping; the largest V of the belt."""
    p = parameters(V=1.2)
    law = 0.6 + 0.4 * exp(-2 * abs(v - p.V))
    belt = System({x: v, v: -x - 0.1 * v - law * sign(v - p.V)}, parameters=p)
    branch = continuation(belt, find_orbit(belt, (0, 1.2)), parameter="V", bounds=(1.1, 1.8)).run()

    def missed(V: float) -> float:
        def slips(_: float, z: np.ndarray) -> list[float]:
            return [z[1], -z[0] - 0.1 * z[1] + 0.6 + 0.4 * math.exp(-2 * (V - z[1]))]

        _, z = phase(slips, [1 - 0.1 * V, V], lambda s, z: slips(s, z)[1], -1, skip=1.5)
        return float(z[1] - V)

    last = brentq(missed, 1.5, 1.6, xtol=1e-12)
    assert branch.special[0].special == "grazing-sliding"
    assert branch.special[0].value == approx(last, abs=1e-7)
