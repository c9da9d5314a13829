"""Time events: instants met to the last bit, coincidences, pulses, sampled systems."""

import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from filippov import (
    Heaviside,
    ModelError,
    Status,
    Surface,
    System,
    TimeEvent,
    models,
    parameters,
    sign,
    sin,
    solve,
    states,
    t,
)
from filippov.solving.solution import Solution

y, z, n = states("y z n")


def sawtooth(**options) -> System:
    p = parameters(T=0.1)
    clock = TimeEvent("clock", period=p.T, reset={y: 0}, **options)
    return System({y: 1 + 0 * y, z: y}, time_events=[clock])


def test_a_clock_does_not_drift() -> None:
    run = solve(sawtooth(), (0, 0), (0, 100))
    assert run.success
    assert [e.t for e in run.events] == [k * 0.1 for k in range(1, 1001)]
    assert {e.kind for e in run.events} == {"time event"}
    assert {e.surface for e in run.events} == {"clock"}
    assert run.t_events[0].tolist() == run.events.t.tolist()
    assert run.events[7].x == pytest.approx([0.1, 8 * 0.005], rel=1e-12)
    assert run.events[7].x_after[0] == 0
    assert run.x_end == pytest.approx([0, 5], rel=1e-11)
    assert run.jumps.tolist() == run.events.t.tolist()


def test_instants_are_half_open() -> None:
    one = solve(sawtooth(), (0, 0), (0, 1))
    parts = [solve(sawtooth(), (0, 0), (0, 0.5))]
    parts.append(solve(sawtooth(), parts[0].x_end, (0.5, 1)))
    assert [e.t for q in parts for e in q.events] == one.events.t.tolist()
    assert parts[1].x_end == pytest.approx(one.x_end, abs=1e-13)
    late = solve(sawtooth(start=0.25), (0, 0), (0, 0.5))
    assert late.events.t.tolist() == [0.25, 0.35, 0.25 + 2 * 0.1]


def test_two_clocks_that_collide_are_one_set() -> None:
    clocks = [TimeEvent("a", period=0.1, reset={y: 0}), TimeEvent("b", period=0.3, reset={n: n + 1})]
    for order in (clocks, clocks[::-1]):
        run = solve(System({y: 1 + 0 * y, n: 0 * n}, time_events=order), (0, 0), (0, 1))
        sets = {}
        for event in run.events:
            sets.setdefault(event.group, set()).add(event.surface)
        assert [len(q) for q in sets.values()] == [1, 1, 2, 1, 1, 2, 1, 1, 2, 1]
        assert run.x_end == pytest.approx([0, 3], abs=1e-13)
        assert np.min(np.diff(np.unique(run.t))) > 1e-6  # no micro-step


def test_two_clocks_whose_resets_do_not_commute_are_named() -> None:
    clocks = [TimeEvent("a", period=1, reset={y: 2 * y}), TimeEvent("b", times=(1,), reset={y: y + 1})]
    run = solve(System({y: 0 * y}, time_events=clocks), (1,), (0, 3))
    assert run.status is Status.NON_UNIQUE
    assert "'a'" in run.message
    assert "'b'" in run.message


def test_a15_state_event_and_clock_at_one_instant_are_one_set() -> None:
    full = Surface("full", z - 1, reset={n: n + 1}, side="-")
    system = System(
        {z: 1 + 0 * z, n: 0 * z}, surfaces=[full], time_events=[TimeEvent("clock", period=1.0, reset={z: 0})]
    )
    run = solve(system, (0, 0), (0, 5.5))
    assert run.x_end == pytest.approx([0.5, 5], abs=1e-13)
    assert len({e.group for e in run.events}) == 5
    assert run.events.of("full", "reset").t == pytest.approx(range(1, 6), rel=1e-14)
    assert run.events.of("clock").t.tolist() == [1, 2, 3, 4, 5]
    assert run.steps < 20


def test_a15_pwm_with_a_duty_that_ends_on_the_clock() -> None:
    """On while z < duty; z is set to 0 by the clock: y' = 1 on, 0 off, duty 1 is always on."""
    p = parameters(duty=0.5)
    system = System(
        {z: 1 + 0 * z, y: Heaviside(p.duty - z)}, time_events=[TimeEvent("clock", period=1, reset={z: 0})]
    )
    for duty in (0.25, 0.5, 1.0):
        run = solve(system, (0, 0), (0, 10), parameters={"duty": duty})
        assert run.success
        assert run.x_end[1] == pytest.approx(10 * duty, rel=1e-12)


def test_a28_steps_in_time_are_refused_and_time_events_named() -> None:
    import sympy

    for jump in (sympy.floor(t), sympy.ceiling(t), sympy.Mod(t, 1), sympy.frac(t)):
        with pytest.raises(ModelError, match="TimeEvent"):
            System({y: jump})
        with pytest.raises(ModelError, match="TimeEvent"):
            System({y: 0 * y}, surfaces=[Surface("step", y - jump, kind="observer")])
    with pytest.raises(ModelError, match="difference of its two sides"):
        Surface("logical", y > 0)


PULSE = 1e3 * (1 - math.exp(-1e-3))


def pulse(t, x, p, s):
    assert t != 50, "called at an instant"
    assert t != 50.001, "called at an instant"
    return [-x[0] + (1e3 if 50 <= t < 50.001 else 0)]


def test_a29_pulse_between_declared_instants() -> None:
    system = System(field=pulse, states="y", time_events=[TimeEvent("pulse", times=(50, 50.001))])
    run = solve(system, (0,), (0, 100))
    assert run.success
    assert run.events.t.tolist() == [50, 50.001]
    assert run.sol(50.5)[0] == pytest.approx(PULSE * math.exp(-0.499), rel=1e-9)
    assert run.sol(50.5)[0] == pytest.approx(0.607, abs=1e-3)
    assert np.all(run.sol(np.linspace(0, 50, 101)) == 0)
    back = solve(system, run.sol(50.5), (50.5, 49), backward=True)
    assert back.success
    assert back.x_end[0] == pytest.approx(0, abs=1e-8)


def test_a29_pulse_of_heaviside_surfaces() -> None:
    system = System({y: -y + 1e3 * (Heaviside(t - 50) - Heaviside(t - 50.001))})
    run = solve(system, (0,), (0, 100))
    assert run.sol(50.5)[0] == pytest.approx(PULSE * math.exp(-0.499), rel=1e-9)


def test_a29_undeclared_pulse_with_max_step() -> None:
    def hidden(t, x, p, s):
        return [-x[0] + (1e3 if 50 <= t < 50.001 else 0)]

    run = solve(System(field=hidden, states="y"), (0,), (49, 51), max_step=1e-3)
    # It is met, and named; without max_step the steps of the field at rest go past it.
    assert run.status is Status.MIN_STEP
    assert run.t_end == pytest.approx(50, rel=1e-12)
    assert "discontinuous where no surface is declared" in run.message


def test_square_waves_in_the_field_stay_surfaces() -> None:
    run = solve(System({y: sign(sin(t))}), (0,), (0, 7.5 * math.pi))
    assert run.x_end[0] == pytest.approx(math.pi / 2, rel=1e-10)
    assert run.events.t == pytest.approx(math.pi * np.arange(1, 8), rel=1e-13)


def test_sliding_is_looked_at_again_at_an_instant() -> None:
    """y' = push(t) - sign(y): held while |push| < 1; the push jumps to 3 at t = 1 and back at 2."""
    push = TimeEvent("push", times=(1, 2))

    def field(t, x, p, s):
        return [(3.0 if 1 <= t < 2 else 0.0) - s[0]]

    system = System(
        field=field, surfaces=[Surface("y", lambda t, x, p: x[0])], states="y", time_events=[push]
    )
    run = solve(system, (0,), (0, 5))
    assert [(str(e.kind), e.surface) for e in run.events] == [
        ("sliding exit", "y"), ("time event", "push"), ("time event", "push"), ("sliding entry", "y"),
    ]  # fmt: skip
    assert run.events.t == pytest.approx([1, 1, 2, 4], rel=1e-12)
    assert run.end_mode == (0,)


def test_backwards_a_reset_is_not_undone() -> None:
    run = solve(sawtooth(), (0.05, 0), (0.25, 0), backward=True)
    assert run.status is Status.NON_UNIQUE
    assert run.t_end == 0.2
    assert "'clock'" in run.message


def test_round_trip_of_a_file(tmp_path) -> None:
    run = solve(models.get("buck_pwm").build(), (12, 0.55, 3.8), (0, 2e-3))
    back = Solution.load(run.save(tmp_path / "run.npz"))
    assert back.system == run.system
    assert back.system.time_events == run.system.time_events
    assert back.t_events[1].tolist() == run.t_events[1].tolist()
    assert np.array_equal(solve(back.system, (12, 0.55, 3.8), (0, 2e-3)).x_end, run.x_end)


def buck_turn(x: np.ndarray, Vin: float) -> np.ndarray:
    """One clock period by matrix exponentials and a bracketed root (v, i; the ramp follows the time)."""
    L, C, R, a, Vref, VL, VU, T = 20e-3, 47e-6, 22.0, 8.4, 11.3, 3.8, 8.2, 400e-6
    A = np.array([[-1 / (R * C), 1 / C, 0], [-1 / L, 0, 1 / L], [0, 0, 0]])

    def flow(x, u, dt):
        return (expm(A * dt) @ np.append(x, Vin * u))[:2]

    def excess(x, at):
        return a * (x[0] - Vref) - (VL + (VU - VL) * at / T)

    at, on = 0.0, excess(x, 0.0) < 0
    while at < T:
        grid = np.linspace(at, T, 400)[1:]
        values = [excess(flow(x, on, q - at), q) * (-1 if on else 1) for q in grid]
        beyond = next((k for k, value in enumerate(values) if value < 0 and k > 0), None)
        if beyond is None:
            return flow(x, on, T - at)
        root = brentq(lambda q: excess(flow(x, on, q - at), q), grid[beyond - 1], grid[beyond], xtol=1e-18)  # noqa: B023
        x, at, on = flow(x, on, root - at), root, not on
    return x


@pytest.mark.parametrize(("Vin", "period"), [(22.0, 1), (25.0, 2)])
def test_buck_converter_against_matrix_exponentials(Vin, period) -> None:
    """di Bernardo et al. 1998: period 1 below Vin = 24.5, period 2 above."""
    system = models.get("buck_pwm").build()
    run = solve(system, (12, 0.55, 3.8), (0, 0.08), parameters={"Vin": Vin}, rtol=1e-11)
    strobe = run.events.of("clock").x
    x = np.array([12, 0.55])
    for k in range(12):
        x = buck_turn(x, Vin)
        assert strobe[k, :2] == pytest.approx(x, rel=1e-8)
    assert strobe[-1] == pytest.approx(strobe[-1 - period], rel=1e-6)
    if period == 2:
        assert abs(strobe[-1, 0] - strobe[-2, 0]) > 5e-3


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: TimeEvent("", period=1), "expected non-empty text"),
        (lambda: TimeEvent("c"), "neither was given"),
        (lambda: TimeEvent("c", period=1, times=(1,)), "both was given"),
        (lambda: TimeEvent("c", period=0), "expected a number > 0"),
        (lambda: TimeEvent("c", times=(2, 1)), "increasing"),
        (lambda: TimeEvent("c", times="12"), "sequence"),
        (lambda: System({y: 0 * y}, time_events=[3]), "time_events holds 3"),
        (lambda: System({y: 0 * y}, time_events=[TimeEvent("c", period=y)]), "depends on the state"),
        (
            lambda: System({y: 0 * y}, time_events=[TimeEvent("c", period=1, reset={"w": 0})]),
            "unknown state 'w'",
        ),
        (lambda: System({y: 0 * y}, time_events=TimeEvent("c", period=lambda p: 1)), "has a function"),
        (
            lambda: System(field=pulse, states="y", time_events=[TimeEvent("c", period=1, reset={y: 0})]),
            "expression",
        ),
        (
            lambda: System({y: 0 * y}, time_events=[TimeEvent("c", period=1), TimeEvent("c", period=2)]),
            "named 'c'",
        ),
    ],
    ids=range(12),
)
def test_declarations_are_checked(make, message) -> None:
    with pytest.raises(ModelError, match=message):
        make()
