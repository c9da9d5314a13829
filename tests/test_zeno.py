"""Accumulating events: the limit is named, and the motion goes on in it where it is asked to (clause E9)."""

import re

import numpy as np
import pytest

from filippov import Status, System, sign, solve, sqrt, states

X, V = states("x v")
A, B = states("a b")
C = sqrt((sqrt(33) - 1) / 24)
CASES = {
    # Levant 1993: 10/13 + v/7 + v (1/13 + 1/sqrt(91))/(1 - q), v**2 = 14 (10 + 50/13), q**2 = 7/13.
    "twisting": (System({X: V, V: -10 * sign(X) - 3 * sign(V)}), (10, 10), 12.264208764653927),
    # Fuller 1960: 1 + v + v (1 + q)/(1 - q), v = 1/sqrt(1 + 2 C), q = sqrt((1 - 2 C)/(1 + 2 C)).
    "fuller": (System({X: V, V: -sign(X + C * V * abs(V))}), (0, 1), 2.9199324627794872),
    # Filippov 1988: d/dt (|a| + |b|) = -2.
    "spiral": (System({A: -sign(A) + 2 * sign(B), B: -2 * sign(A) - sign(B)}), (0, 1), 0.5),
}


@pytest.mark.parametrize("name", CASES)
def test_limit_is_named(name: str) -> None:
    system, x0, limit = CASES[name]
    run = solve(system, x0, (0, 2 * limit), rtol=1e-10, atol=1e-12)
    assert run.status is Status.ZENO
    named = re.search(r"accumulate at t = ([0-9.]+)", run.message)
    assert named is not None
    assert float(named[1]) == pytest.approx(limit, rel=1e-8)
    assert run.t_end == pytest.approx(limit, rel=1e-6)


@pytest.mark.parametrize("name", CASES)
def test_motion_rests_in_the_limit(name: str) -> None:
    system, x0, limit = CASES[name]
    run = solve(system, x0, (0, 2 * limit), rtol=1e-10, atol=1e-12, zeno="continue")
    assert run.status is Status.SUCCESS
    assert run.t_end == 2 * limit
    rest = run.segments[-1]
    assert 0 in rest.mode
    assert rest.t0 == pytest.approx(limit, abs=1e-6)
    assert np.max(np.abs(run.sol(np.linspace(limit * 1.001, 2 * limit, 7)))) < 1e-8


def test_limit_that_cannot_be_rested_in_is_no_rest() -> None:
    """With a push of 20 on v the relays cannot hold: 0 is not in the hull of the velocities."""
    run = solve(System({X: V, V: -10 * sign(X) - 3 * sign(V) + 20}), (1, 0), (0, 1), zeno="continue")
    assert run.status is Status.SUCCESS
    assert run.x_end[1] > 1
