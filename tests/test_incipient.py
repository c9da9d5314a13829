"""Starts at the moment of break-away: the first power of time that does not vanish decides anywhere."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from filippov import Surface, System, cos, parameters, sign, solve, states, t
from filippov.kernel.tables.root_tables import POSITION
from filippov.models import get
from filippov.solving.state.leading import Terms, first_derivative

v, w, x = states("v w x")


@cache
def blocks(power: int, plain: bool) -> System:
    """Two bodies of mass 1 and m with friction F between them; the first is pulled by what just holds.

    m1 v' = F (1 + 1/m) + a tau**power - F s, m w' = F s, s = sign(v - w), tau = t - t0.
    """
    p = parameters(F=1.0, m=1.0, a=1.0, t0=0.0)
    if not plain:
        pull = p.F * (1 + 1 / p.m) + p.a * (t - p.t0) ** power
        return System({v: pull - p.F * sign(v - w), w: p.F * sign(v - w) / p.m})

    def field(time: float, y: Any, q: Any, s: Any) -> list[float]:
        return [q.F * (1 + 1 / q.m) + q.a * (time - q.t0) ** power - q.F * s[0], q.F * s[0] / q.m]

    slip = Surface("slip", lambda time, y, q: y[0] - y[1])
    return System(field=field, surfaces=[slip], states=["v", "w"], parameters=p)


@pytest.mark.parametrize("plain", [False, True])
@given(
    power=st.integers(1, 4),
    share=st.one_of(st.sampled_from([1.0, -1.0]), st.floats(-1.9, -0.05), st.floats(0.05, 3)),
    F=st.one_of(st.just(1.0), st.floats(0.1, 5)),
    m=st.one_of(st.just(1.0), st.floats(0.2, 5)),
    speed=st.sampled_from([0.0, 1.0, -0.3, 1e-9, 57.1]),
    t0=st.sampled_from([0.0, 1.0, 3.7, -20.3]),
)
def test_F1_F11_break_away_is_where_the_first_power_says(
    plain: bool, power: int, share: float, F: float, m: float, speed: float, t0: float
) -> None:
    """A growing pull: slip from the first moment, by a closed form; else both bodies go on as one."""
    T, a = 0.9, share * F * (1 + 1 / m)
    values = {"F": F, "m": m, "a": a, "t0": t0}
    run = solve(
        blocks(power, plain), (speed, speed), (t0, t0 + T), parameters=values, rtol=1e-10, atol=1e-12
    )
    assert run.success, run.message
    # At the end of its set a multiplier is known to its rounding, which no shorter pieces of a step resolve.
    assert run.nfev < 5000
    impulse = F * (1 + 1 / m) * T + a * T ** (power + 1) / (power + 1)
    if a > 0:
        expected = [speed + impulse - F * T, speed + F * T / m]
        assert run.end_mode == (1,)
    else:
        expected = [speed + impulse / (1 + m)] * 2
        assert run.end_mode == (0,)
    np.testing.assert_allclose(run.x_end, expected, rtol=1e-8, atol=1e-8)


def test_F1_pulled_blocks_slip_from_rest() -> None:
    for pull, impulse in ((t, 0.5), (t**2, 1 / 3), (t**3, 0.25), (cos(t) - 1 + t, np.sin(1) - 0.5)):
        run = solve(System({v: 2 + pull - sign(v - w), w: sign(v - w)}), (0, 0), (0, 1))
        assert run.success
        assert run.modes == ("+",)
        np.testing.assert_allclose(run.x_end, [1 + impulse, 1], rtol=1e-9)


def test_F1_a_spring_that_relaxes_keeps_them_together() -> None:
    """x'' = 1 - 0.15 x for both: the spring takes from the pull, and what the contact carries falls."""
    system = System({x: v, v: 2 - 0.3 * x - sign(v - w), w: sign(v - w)})
    run = solve(system, (0, 0, 0), (0, 1), rtol=1e-10, atol=1e-12)
    assert run.modes == ("0",)
    k = np.sqrt(0.15)
    np.testing.assert_allclose(
        run.x_end, [(1 - np.cos(k)) / 0.15, np.sin(k) / k, np.sin(k) / k], rtol=1e-9
    )


def test_12_6_the_first_power_does_not_depend_on_the_unit_of_the_guard() -> None:
    """A trial step of a stiff mode after a long rest may run to 1e160: no number is squared there."""
    rng = np.random.default_rng(6)
    theta = np.asarray(POSITION)
    for _ in range(300):
        values = sum(rng.normal() * 10 ** rng.uniform(-9, 0) * theta**k for k in range(1, 9))
        size, speed, step = (10 ** rng.uniform(-3, 3, 3)).tolist()
        tangent = bool(rng.integers(2))
        order, power = first_derivative(values, Terms(size, speed, tangent=tangent), step)
        for unit in (2.0**-300, 2.0**300, 2.0**530):
            terms = Terms(size * unit, speed * unit, tangent=tangent)
            assert first_derivative(values * unit, terms, step) == (order, power * unit)


def test_12_6_hunting_over_600_s_at_gains_that_rest_long() -> None:
    starts = np.random.default_rng(0).normal(size=(12, 3)) * 3
    gains = {"beta": 1.0, "P": 19.996, "I": 1.163, "D": 1.016}
    for x0 in starts:
        assert solve(get("hunting").build(), x0, (0, 600), parameters=gains).success
