"""Starts at corners of many kinks: the field is continuous, so there is one solution (Picard-Lindelof)."""

import os
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

from filippov import Max, Min, System, solve, states, t

SEEDS = {"ci": 40, "nightly": 300}.get(os.environ.get("FILIPPOV_PROFILE", ""), 15)
x, y, z = states("x y z")


def nested(rng: np.random.Generator, many: int) -> Any:
    """Largest and least of some affine functions that are all 0 at 0."""
    parts = [
        sympy.Add(
            *(
                sympy.Rational(int(c), 8) * q
                for c, q in zip(rng.integers(-8, 9, 4), (x, y, z, t), strict=True)
            )
        )
        for _ in range(many)
    ]
    while len(parts) > 1:
        one, two = (parts.pop(int(rng.integers(len(parts)))) for _ in range(2))
        parts.append((Max if rng.random() < 0.5 else Min)(one, two))
    return parts[0]


@pytest.mark.parametrize("base", [0, 1])
def test_u1_corners_of_up_to_twenty_kinks_are_left_as_the_field_says(base: int) -> None:
    """base: x' = 1 there, or all rates vanish."""
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        made = [nested(rng, int(rng.integers(2, 6))) for _ in range(3)]
        made[0] += base
        field = sympy.lambdify((t, x, y, z), made, modules=[{"Max": max, "Min": min}])
        run = solve(System(dict(zip((x, y, z), made, strict=True))), (0, 0, 0), (0, 2))
        assert run.success, (seed, run.message)
        known = solve_ivp(
            lambda time, at, field=field: [float(q) for q in field(time, *at)], (0, 2), [0, 0, 0], "DOP853",
            rtol=1e-10, atol=1e-13, max_step=0.01,
        )  # fmt: skip
        assert run.x_end == pytest.approx(known.y[:, -1], rel=1e-7, abs=1e-7), seed
