"""Friction written with a direction, v/|v| and the like, in place of a sign."""

from typing import Any

import numpy as np
import pytest
from sympy import Rational, sqrt

from filippov import System, parameters, sign, solve, states
from filippov.model.directions import with_signs

x, v, w = states("x v w")
size = abs(v)
WRITTEN = [
    v / size, size / v, v / sqrt(v**2), 3 * v / abs(3 * v), v**3 / size**3, v**2 / (size * v), size**3 / v**3,
    (2 * v - 0.0) / (2 * size), -v / abs(-v) * -1,
]  # fmt: skip


@pytest.mark.parametrize("direction", WRITTEN, ids=str)
def test_a_direction_is_a_sign(direction: Any) -> None:
    """x'' = -x - mu sgn(x') from (1, 0) loses 2 mu a swing: -0.4, then -0.2, and rests there."""
    mu = parameters(mu=0.3).mu
    run = solve(System({x: v, v: -x - mu * direction}), (1, 0), (0, 8))
    assert run.success, run.message
    assert [event.t for event in run.events] == pytest.approx([np.pi, 2 * np.pi], abs=1e-9)
    assert run.x_end == pytest.approx([-0.2, 0], abs=1e-9)


def test_a_direction_against_a_belt_is_a_sign() -> None:
    """A body that a belt of speed 1/2 carries: v' = mu until they go together, at t = 1/(2 mu)."""
    run = solve(System({v: -0.25 * (v - 0.5) / abs(v - 0.5)}), (0,), (0, 4))
    assert run.success, run.message
    assert [event.t for event in run.events] == pytest.approx([2.0], abs=1e-9)
    assert run.x_end == pytest.approx([0.5], abs=1e-12)


def test_a_drag_with_a_power_below_one_stops() -> None:
    """v' = -v |v|**(-1/2) from 1 is (1 - t/2)**2 until t = 2."""
    run = solve(System({v: -v / size ** Rational(1, 2)}), (1,), (0, 1.5))
    assert run.success, run.message
    assert run.x_end == pytest.approx([0.0625], rel=1e-8)


def test_products_have_the_values_that_they_had() -> None:
    rng = np.random.default_rng(2)
    g, p = v - 2 * w, parameters(p=2).p
    for _ in range(60):
        n, m = (int(q) for q in rng.integers(-3, 4, 2))
        e = Rational(int(rng.integers(-6, 7)), 2)
        before = (p * g) ** n * abs(g) ** e * (w + 1) ** m * x * abs(w) ** Rational(1, 2)
        after = with_signs(before)
        at = {v: rng.normal(), w: rng.normal(), x: rng.normal(), p: 2.0}
        values = [complex(q.subs(at).evalf()) for q in (before, after)]
        assert values[0] == pytest.approx(values[1], rel=1e-10)
    assert with_signs(v / abs(v)) == sign(v)
    assert with_signs(v * abs(v)) == v * abs(v)
    assert with_signs(v / abs(w)) == v / abs(w)
