"""Starts where both rates vanish, each with an order of its own: what follows, in closed form.

x' = a u^p for x > 0 and x' = b u^q for x < 0 from x = 0 where u = 0, u' = 1: the first power decides on
either side (Filippov 1988, section 10), x = a u^(p + 1)/(p + 1) where it leaves upwards.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest

from filippov import Status, Surface, System, solve, states, t

DRAWS = {"nightly": 400, "ci": 16}.get(os.environ.get("FILIPPOV_PROFILE", ""), 8)
x, u = states("x u")


@pytest.mark.parametrize(
    "signs", [(-1, 1), (1, 1), (-1, -1), (1, -1)], ids=["slides", "up", "down", "either"]
)
def test_the_first_power_on_each_side_decides(signs: tuple[int, int]) -> None:
    rng = np.random.default_rng([57, signs[0] + 1, signs[1] + 1])
    for _ in range(DRAWS):
        p, q = (int(k) for k in rng.integers(1, 7, 2))
        a, b = (sign * round(float(rng.uniform(0.3, 3)), 2) for sign in signs)
        start = round(float(rng.uniform(-2, 2)), 1) if rng.random() < 0.5 else 0.0
        if rng.random() < 0.5:
            clock = t - start
            system = System.from_modes([Surface("s", x)], {"+": [a * clock**p], "-": [b * clock**q]}, [x])
            got = solve(system, (0,), (start, start + 1))
        else:
            sides = {"+": [a * u**p, 1], "-": [b * u**q, 1]}
            system = System.from_modes([Surface("s", x)], sides, [x, u])
            got = solve(system, (0, 0), (start, start + 1))
        told = f"{p}, {q}, {a}, {b} from {start}: {got}"
        if signs == (1, -1):
            assert got.status is Status.NON_UNIQUE, told
            continue
        known = {(-1, 1): 0.0, (1, 1): a / (p + 1), (-1, -1): b / (q + 1)}[signs]
        assert got.status is Status.SUCCESS, told
        assert got.x_end[0] == pytest.approx(known, abs=1e-9), told
        assert got.steps < 200, told


@pytest.mark.parametrize("compiled", [True, False])
def test_functions_are_not_asked_beside_the_start(compiled: bool) -> None:
    """A field without values where x > 1, from x = 1 on a surface: x' = -1 - 2 s, y' = 1."""

    def field(t: float, z: Any, p: Any, s: Any) -> list[float]:
        if z[0] > 1.0:
            raise ValueError("no value there")
        return [-1.0 - 2.0 * s[0], 1.0]

    surface = Surface("half", lambda t, z, p: z[1] - 0.5)
    system = System(field=field, surfaces=[surface], states="x u")
    got = solve(system, (1.0, 0.5), (0, 0.3), backend="compiled" if compiled else "python")
    assert got.status is Status.SUCCESS
    assert got.x_end == pytest.approx([0.1, 0.8], abs=1e-12)
