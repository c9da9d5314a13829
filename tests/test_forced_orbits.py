"""Orbits of clocked and forced systems: their own period, the least one, subharmonics of the motion given."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from filippov import Max, Piecewise, System, TimeEvent, cos, parameters, sign, solve, states, t
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.analysis.steady.forcing import forcing_period, is_forced
from filippov.models import registry

x, v = states("x v")
CLOCK = 400e-6
q = parameters(z=0.1, w=1.0, K=10.0, s=0.0)
BILINEAR = System(
    {x: v, v: cos(q.w * t) - 2 * q.z * v - x - (q.K - 1) * Max(x - q.s, 0)}, parameters=q
)


@pytest.mark.parametrize(
    ("supply", "period", "turns"), [(20.0, None, 1), (20.0, "4*T", 1), (25.5, None, 2), (25.5, "4*T", 2)]
)
def test_a_clocked_converter_has_the_least_period_of_its_motion(
    supply: float, period: str | None, turns: int
) -> None:
    """Period doubling at 24.5 V (di Bernardo, Garofalo, Glielmo, Vasca 1998)."""
    model = registry.get("buck_pwm")
    system = model.build()
    orbit = find_orbit(system, model.x0, parameters={"Vin": supply}, period=period, transient=0.4)
    assert orbit.period == pytest.approx(turns * CLOCK, rel=1e-12)
    assert orbit.stable
    span = (orbit.t0, orbit.t0 + turns * CLOCK)
    again = solve(system, orbit.x0, span, parameters={"Vin": supply}, rtol=1e-11, atol=1e-13)
    assert again.x_end == pytest.approx(orbit.x0, rel=1e-8)
    if turns == 2:
        half = solve(system, orbit.x0, (span[0], span[0] + CLOCK), parameters={"Vin": supply})
        assert np.max(np.abs(half.x_end - orbit.x0)) > 1e-3


def test_the_unstable_orbit_of_one_period_is_found_when_it_is_asked_for() -> None:
    model = registry.get("buck_pwm")
    orbit = find_orbit(model.build(), model.x0, parameters={"Vin": 25.5}, period="T", transient=0.4)
    assert orbit.period == pytest.approx(CLOCK, rel=1e-12)
    assert not orbit.stable


def test_a_clock_alone_forces() -> None:
    """x' = -c x + 1, x set to x + q every T: x after the clock is q/(1 - E) + 1/c with E = exp(-c T)."""
    p = parameters(c=0.5, q=2.0, T=1.5)
    dose = TimeEvent("dose", period=p.T, reset={x: x + p.q})
    system = System({x: 1 - p.c * x}, parameters=p, time_events=[dose])
    assert is_forced(system)
    assert forcing_period(system).subs({p.T: 3}) == 3
    orbit = find_orbit(system, (1.0,))
    decay = math.exp(-0.5 * 1.5)
    top = 2.0 + 2.0 * decay / (1 - decay) + 2.0
    assert orbit.period == pytest.approx(1.5, rel=1e-12)
    assert orbit.high[0] == pytest.approx(top, rel=1e-9)
    assert abs(orbit.multipliers[0]) == pytest.approx(decay, rel=1e-9)


def test_an_alternating_kick_has_twice_the_period_of_its_clock() -> None:
    """v -> -v at every tick, so that the motion comes back after two of them."""
    system = System(
        {x: v - 0.5 * sign(x) - x, v: 0 * x}, time_events=[TimeEvent("turn", period=1.0, reset={v: -v})]
    )
    orbit = find_orbit(system, (0.3, 2.0), transient=40.0)
    assert orbit.period == pytest.approx(2.0, rel=1e-12)


@pytest.mark.parametrize(
    ("turns", "values", "guess"),
    [
        (2, {"z": 0.077, "w": 2.548, "K": 10.0, "s": -0.133}, (-0.58, 0.064)),
        (2, {"z": 0.084, "w": 4.124, "K": 10.0, "s": -0.028}, (-1.0, -0.2)),
        (6, {"z": 0.022, "w": 2.827, "K": 10.0, "s": -0.064}, (-1.0, -0.2)),
    ],
)
def test_12_4_a_motion_on_its_way_to_a_subharmonic_is_followed(
    turns: int, values: dict[str, float], guess: tuple[float, float]
) -> None:
    """A bilinear spring under cos(w t): not yet settled, it is back after its own number of periods."""
    z, w, K, s = values.values()
    T = 2 * math.pi / w

    def rate(time: float, q: np.ndarray) -> list[float]:
        return [q[1], math.cos(w * time) - 2 * z * q[1] - q[0] - (K - 1) * max(q[0] - s, 0.0)]

    count = math.ceil(14 / (z * T))  # perturbations fall to exp(-14)
    found = solve_ivp(rate, (0, count * T), guess, rtol=1e-7, atol=1e-9, max_step=T / 20, method="DOP853",
                      t_eval=T * np.arange(count - 2 * turns, count + 1))  # fmt: skip
    settled = found.y.T
    back = [float(np.max(np.abs(settled[k:] - settled[:-k]))) for k in range(1, turns + 1)]
    assert min(back[:-1]) > 1e-2
    assert back[-1] < 1e-4
    for seed in range(2):
        start = settled[-1] + 1e-3 * np.random.default_rng(seed).uniform(-1, 1, 2)
        orbit = find_orbit(BILINEAR, start, parameters=values, transient=20 * T)
        assert orbit.period == pytest.approx(turns * T, rel=1e-9)
        assert orbit.stable


@pytest.mark.parametrize("seed", [0, 3, 6, 8, 9, 11])
def test_a_motion_that_takes_long_to_a_subharmonic_is_followed(seed: int) -> None:
    """x+ = a x + 1 or a x - c, each beyond 0: no fixed point, and a cycle of k with the multiplier a**k."""
    rng = np.random.default_rng(seed)
    a, T, c = float(rng.uniform(0.9, 0.995)), float(rng.uniform(0.2, 3)), float(rng.uniform(0.2, 1.5))
    kick = TimeEvent("kick", period=T, reset={x: x + Piecewise((1.0, x < 0), (-c, True))})
    system = System({x: math.log(a) / T * x, v: x - v}, time_events=[kick])
    start = float(rng.uniform(-50, 50))
    cycle = [start]
    for _ in range(5000):
        cycle.append(a * cycle[-1] + (1.0 if cycle[-1] < 0 else -c))
    k = next(k for k in range(1, 64) if abs(cycle[-1] - cycle[-1 - k]) < 1e-9)
    orbit = find_orbit(system, (start, 0.0))
    assert orbit.stable
    assert orbit.period == pytest.approx(k * T, rel=1e-12)
    assert orbit.multipliers[0] == pytest.approx(a**k, rel=1e-6)
