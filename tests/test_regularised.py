"""Random nonlinear systems against their regularisation: s = tanh(h/eps), integrated by scipy.

Where sliding attracts, the regularised motion tends to that of the inclusion like eps (Sotomayor & Teixeira
1996), whatever the solver thinks of modes and events. FILIPPOV_PROFILE=nightly looks at many more seeds.
"""

import os
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from sympy import Rational, Symbol, cos, sin

from filippov import Surface, System, sign, solve, states, t

EPS, END = 1e-5, 3.0
SEEDS = range(200 if os.environ.get("FILIPPOV_PROFILE") == "nightly" else 8)


def tenth(rng: np.random.Generator) -> Rational:
    return Rational(int(rng.integers(-20, 21)), 10)


def random_system(seed: int) -> tuple[list[Symbol], list[Any], list[Symbol], list[Any], list[float]]:
    """States, switching functions, their signs, the field in them, and a start."""
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(2, 5)), int(rng.integers(1, 4))
    x = list(states(" ".join(f"x{i}" for i in range(n))))

    def term() -> Any:
        a, b = rng.choice(n, 2)
        kinds = [x[a], x[a] / (1 + x[b] ** 2), sin(x[a]), cos(2 * t), sympy.Integer(1), cos(x[a]) * sin(x[b])]
        return kinds[rng.integers(0, len(kinds))]

    h = []
    for _ in range(m):
        a, b = rng.choice(n, 2, replace=False)
        line, circle = x[a] + tenth(rng) * x[b] - tenth(rng) / 4, x[a] ** 2 + x[b] ** 2 - 1
        h.append([x[a], line, circle, x[a] - sin(t) / 2][rng.integers(0, 4)])
    h = list(dict.fromkeys(h))
    s = list(sympy.symbols(f"s0:{len(h)}"))
    field = []
    for i in range(n):
        f = -x[i] / 2 + tenth(rng) * term() + tenth(rng) * term()
        for q, own in enumerate(s):
            # Pulled towards every surface, across which the other terms may still lead.
            f -= Rational(6, 5) * own * sympy.diff(h[q], x[i])
            f += tenth(rng) * own * (term() if rng.random() < 0.3 else 1)
        field.append(f)
    return x, h, s, field, rng.normal(size=n).round(2).tolist()


@pytest.mark.parametrize("seed", SEEDS)
def test_regularised_motion_tends_to_the_solution(seed: int) -> None:
    x, h, s, field, x0 = random_system(seed)
    written = {si: sign(hi) for si, hi in zip(s, h, strict=True)}
    surfaces = [Surface(f"h{q}", hq) for q, hq in enumerate(h)]
    system = System({xi: f.subs(written) for xi, f in zip(x, field, strict=True)}, surfaces=surfaces)
    exact = solve(system, x0, (0, END), rtol=1e-9, atol=1e-11)
    assert exact.success, exact.message
    guards, vertex = sympy.lambdify((t, x), h), sympy.lambdify((t, x, s), field)

    def smooth(time: float, y: np.ndarray) -> np.ndarray:
        return np.array(vertex(time, y, np.tanh(np.array(guards(time, y), float) / EPS)), float)

    times = np.linspace(0, END, 7)
    near = solve_ivp(smooth, (0, END), x0, method="LSODA", rtol=1e-8, atol=1e-10, t_eval=times)
    assert near.success
    assert np.max(np.abs(exact.sol(times) - near.y) / (1 + np.abs(near.y))) < 100 * EPS
