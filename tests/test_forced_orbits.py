"""Orbits of clocked and forced systems: their own period, the least one, subharmonics of the motion given."""

import math

import numpy as np
import pytest

from filippov import System, TimeEvent, parameters, sign, solve, states
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.analysis.steady.forcing import forcing_period, is_forced
from filippov.models import registry

x, v = states("x v")
CLOCK = 400e-6


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
