"""Order of both methods with fixed steps: smooth, across a crossing, through sliding entry and exit, along sliding."""

from typing import Any

import numpy as np
import pytest
from sympy import Rational, cos, exp, sin

from filippov import Surface, System, sign, solve, states, t

x, v = states("x v")
# Coulomb friction with forcing, its motion smooth and not polynomial in every mode.
FORCED = System({x: v, v: -x - x**3 / 5 + cos(2 * t) - Rational(2, 5) * sign(v)}, surfaces=[Surface("v", v)])
# Sliding on the circle of radius sqrt 2 with a non-linear field along it.
DISC = System.from_modes(
    [Surface("s", x**2 + v**2 - 2)], {"+": [1 - x, -1 - v], "-": [x - v + sin(v), v + x]}, [x, v]
)
# y' = 1 while y < 0; for y > 0 a fold that moves: sliding is left at x = 0.
FOLD = System.from_modes([Surface("y", v)], {"+": [1 + exp(-v) / 4, sin(x)], "-": [Rational(1, 2) * cos(x), 1]}, [x, v])
CASES: dict[str, tuple[System, tuple[float, float], float, str]] = {
    "smooth": (FORCED, (2.0, 1.0), 0.9, "+"),
    "crossing": (FORCED, (2.0, 1.0), 3.0, "+-"),
    "along sliding": (DISC, (1.0, 1.0), 1.5, "0"),
    "entry": (DISC, (-0.3, 0.4), 3.0, "-0"),
    "exit": (FOLD, (-1.0, 0.0), 3.0, "0+"),
}


def end_state(system: System, x0: tuple[float, float], end: float, method: str, steps: int) -> Any:
    width = end / steps
    got = solve(system, x0, (0, end), method=method, first_step=width, max_step=width, rtol=1e6, atol=1e6)
    assert got.success, got.message
    return got


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize(("method", "order", "steps"), [("DP5", 5, (12, 17, 24, 34, 48)), ("DOP853", 8, (5, 6, 8, 10, 12))])
def test_order(name: str, method: str, order: int, steps: tuple[int, ...]) -> None:
    system, x0, end, modes = CASES[name]
    reference = solve(system, x0, (0, end), rtol=1e-13, atol=1e-15)
    assert "".join(reference.modes) == modes
    runs = [end_state(system, x0, end, method, k) for k in steps]
    assert all(run.modes == reference.modes for run in runs)
    errors = np.array([np.max(np.abs(run.x_end - reference.x_end)) for run in runs])
    clear = errors > 1e-12
    assert np.sum(clear) >= 3, errors
    slope = -np.polyfit(np.log(np.array(steps)[clear]), np.log(errors[clear]), 1)[0]
    assert slope > order - 0.8, (slope, errors)


@pytest.mark.parametrize("name", ["crossing", "entry", "exit"])
@pytest.mark.parametrize(("method", "order", "steps"), [("DP5", 5, (24, 34, 48)), ("DOP853", 8, (6, 8, 10))])
def test_order_of_event_times(name: str, method: str, order: int, steps: tuple[int, ...]) -> None:
    system, x0, end, _ = CASES[name]
    reference = solve(system, x0, (0, end), rtol=1e-13, atol=1e-15).events[0].t
    errors = np.array([abs(end_state(system, x0, end, method, k).events[0].t - reference) for k in steps])
    if np.max(errors) > 1e-12:
        factor = errors[0] / max(errors[-1], 1e-15)
        assert factor > (steps[-1] / steps[0]) ** (order - 1), errors



@pytest.mark.parametrize("method", ["DP5", "DOP853"])
@pytest.mark.parametrize("name", CASES)
def test_error_follows_the_tolerance(name: str, method: str) -> None:
    system, x0, end, _ = CASES[name]
    reference = solve(system, x0, (0, end), rtol=1e-13, atol=1e-15).x_end
    for rtol in (1e-5, 1e-8, 1e-11):
        got = solve(system, x0, (0, end), method=method, rtol=rtol, atol=rtol)
        assert np.max(np.abs(got.x_end - reference)) < 100 * rtol
