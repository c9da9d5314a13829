"""Order of the methods with fixed steps: smooth, crossing, along sliding, through its entry and exit."""

from typing import Any

import numpy as np
import pytest
from sympy import Rational, cos, sin

from filippov import Surface, System, sign, solve, states, t

x, v = states("x v")
# Coulomb friction with forcing, its motion smooth and not polynomial in every mode.
FORCED = System({x: v, v: -x - x**3 / 5 + cos(2 * t) - Rational(2, 5) * sign(v)}, surfaces=[Surface("v", v)])
# Sliding on the circle of radius sqrt 2 with a non-linear field along it.
DISC = System.from_modes(
    [Surface("s", x**2 + v**2 - 2)], {"+": [1 - x, -1 - v], "-": [x - v + sin(v), v + x]}, [x, v]
)
# x' = 1/(1 - x) while sliding, left at x = 0, t = 3/2: for an odd number of steps in the middle of one.
FOLD = System.from_modes([Surface("y", v)], {"+": [1, x], "-": [0, 1]}, [x, v])
CASES: dict[str, tuple[System, tuple[float, float], float, str]] = {
    "smooth": (FORCED, (-2.0, 0.5), 1.2, "+"),
    "crossing": (FORCED, (2.0, 1.0), 2.5, "+-"),
    "along sliding": (DISC, (1.0, 1.0), 1.5, "0"),
    "entry": (DISC, (-0.3, 0.4), 3.0, "-0"),
    "exit": (FOLD, (-1.0, 0.0), 3.0, "0+"),
}


def end_state(system: System, x0: tuple[float, float], end: float, method: str, steps: int) -> Any:
    width = end / steps
    got = solve(system, x0, (0, end), method=method, first_step=width, max_step=width, rtol=1e6, atol=1e6)
    assert got.success, got.message
    return got


STEPS: dict[tuple[str, str], tuple[int, ...]] = {
    ("DP5", "smooth"): (14, 20, 28, 40, 56),
    ("DP5", "crossing"): (14, 20, 28, 40, 56),
    ("DP5", "along sliding"): (4, 5, 7, 10),
    ("DP5", "entry"): (14, 20, 28, 40, 56),
    ("DP5", "exit"): (13, 19, 27, 39, 55),
    ("DOP853", "smooth"): (4, 5, 6, 7, 8),
    ("DOP853", "crossing"): (10, 14, 20, 28, 40),
    ("DOP853", "along sliding"): (2, 3, 4),
    ("DOP853", "entry"): (10, 14, 20, 28),
    ("Radau", "smooth"): (14, 20, 28, 40, 56),
    ("Radau", "crossing"): (14, 20, 28, 40, 56),
    ("Radau", "along sliding"): (4, 5, 7, 10, 14),
    ("Radau", "entry"): (14, 20, 28, 40, 56),
    ("Radau", "exit"): (49, 57, 67, 79, 93),
}


@pytest.mark.parametrize(("method", "name"), STEPS)
def test_order(method: str, name: str) -> None:
    system, x0, end, modes = CASES[name]
    reference = solve(system, x0, (0, end), rtol=1e-13, atol=1e-15)
    assert "".join(reference.modes) == modes
    steps = STEPS[method, name]
    runs = [end_state(system, x0, end, method, k) for k in steps]
    assert all(run.modes == reference.modes for run in runs)
    errors = [np.max(np.abs(run.x_end - reference.x_end)) for run in runs]
    slope = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope > {"DP5": 5, "DOP853": 8, "Radau": 5}[method] - 0.9, (slope, errors)


@pytest.mark.parametrize("method", ["DP5", "DOP853", "Radau"])
@pytest.mark.parametrize("name", CASES)
def test_error_follows_the_tolerance(name: str, method: str) -> None:
    system, x0, end, _ = CASES[name]
    reference = solve(system, x0, (0, end), rtol=1e-13, atol=1e-15).x_end
    for rtol in (1e-5, 1e-8, 1e-11):
        got = solve(system, x0, (0, end), method=method, rtol=rtol, atol=rtol)
        assert np.max(np.abs(got.x_end - reference)) < 100 * rtol
