"""Radau where a field ceases to be stiff within a step: corrections by a steep Jacobian are small there.

x' = 1, y' = -k g(x) (y - c) + a cos 3x with a gate g that falls from 1 to 0 at x = 1 over a width w: y stays
at c before it and goes with the integral of a cos 3x after it. Reference: scipy's Radau in short steps.
"""

import os
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import expit
from sympy import Expr

from filippov import System, cos, exp, parameters, solve, states

x, y = states("x y")
p = parameters(k=1e6, w=1e-2, c=0.0, a=1.0)
u = (x - 1) / p.w
DRAWS = {"nightly": 300}.get(os.environ.get("FILIPPOV_PROFILE", ""), 25)
GATES: dict[str, tuple[Expr, Callable[[float], float]]] = {
    "exponential": (1 / (1 + exp(u)), lambda u: float(expit(-u))),
    "power": (1 / (1 + ((x + abs(x)) / (2 * p.w)) ** 4), lambda u: 1 / (1 + max(u, 0.0) ** 4)),
}


@pytest.mark.parametrize("name", GATES)
def test_a_solution_goes_on_where_its_field_ceases_to_be_stiff(name: str) -> None:
    gate, value = GATES[name]
    # The power falls from x = 0 on.
    at = 1.0 if name == "exponential" else 0.0
    system = System({x: 1 + 0 * x, y: -p.k * gate * (y - p.c) + p.a * cos(3 * x)})
    draw = np.random.default_rng(5)
    for _ in range(DRAWS):
        given = {
            "k": 10 ** draw.uniform(2, 9), "w": 10 ** draw.uniform(-3, -0.5), "c": draw.normal(),
            "a": 10 ** draw.uniform(-1, 1),
        }  # fmt: skip
        rtol = 10 ** draw.uniform(-9, -4)

        def field(t: float, z: np.ndarray, given: dict[str, float] = given) -> list[float]:
            steep = given["k"] * value((t - at) / given["w"])
            return [-steep * (z[0] - given["c"]) + given["a"] * np.cos(3 * t)]

        known = solve_ivp(field, (-1, 4), [given["c"]], method="Radau", rtol=1e-11, atol=1e-13, max_step=0.02)
        run = solve(
            system, (-1, given["c"]), (-1, 4), parameters=given, method="Radau", rtol=rtol, atol=1e-2 * rtol
        )
        assert run.success
        size = 1 + abs(given["c"]) + given["a"]
        assert abs(run.x_end[1] - known.y[0, -1]) < 3e3 * rtol * size, (given, rtol)
