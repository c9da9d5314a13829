"""A band for any number of frictions on one rate: sliding on h_i = e_i, where e_i' = -alpha e_i in the band.

e_i is set to h_i where the band |h_i| <= eta is entered, and the inclusion decides there which of all stick:
three surfaces a friction, where levels in the field of Switch and Karnopp grow like 3^n (they take three).
"""

from typing import Any

import numpy as np
import pytest

from filippov import Surface, Switch, System, cos, sign, solve, states, t

ALPHA = 100.0


def joints(n: int, rng: np.random.Generator, eta: float) -> tuple[System, list[float]]:
    """Springs, dampers, drives and frictions through any mass matrix, and where it starts; eta = 0: exact."""
    x, v, e = (states(" ".join(f"{name}{i}" for i in range(n))) for name in "xve")
    root = rng.normal(size=(n, n))
    inverse = np.linalg.inv(root @ root.T / n + 0.5 * np.eye(n))
    k, c, u, o, f = (
        rng.uniform(low, high, n).tolist()
        for low, high in ((1, 4), (0, 0.3), (0.5, 1.6), (0.6, 2), (0.3, 0.9))
    )
    h = [v[i] - e[i] if eta else v[i] for i in range(n)]
    force = [-k[i] * x[i] - c[i] * v[i] + u[i] * cos(o[i] * t) - f[i] * sign(h[i]) for i in range(n)]
    rates = [sum(float(inverse[i, j]) * force[j] for j in range(n)) for i in range(n)]
    equations = dict(zip([*x, *v], [*v, *rates], strict=True))
    surfaces = [Surface(f"joint {i}", h[i]) for i in range(n)]
    if eta:
        equations |= {q: -ALPHA * q for q in e}
        for i in range(n):
            for side, word in ((1, "+"), (-1, "-")):
                edge = Surface(f"edge {i}{word}", v[i] - side * eta, reset={e[i]: side * eta}, side=word)
                surfaces.append(edge)
    start = [*rng.uniform(-1, 1, n), *(rng.uniform(-1, 1, n) * (rng.random(n) < 0.6))]
    return System(equations, surfaces=surfaces), [*start, *([0.0] * n if eta else [])]


def run_of(system: System, x0: Any, **options: Any) -> Any:
    run = solve(system, x0, (0, 6), rtol=1e-10, atol=1e-13, **options)
    assert run.success, run.message
    return run.sol(np.linspace(0, 6, 241))


@pytest.mark.parametrize("n", [2, 3, 4, 5, 6])
def test_15_1_bands_of_many_frictions_go_to_the_exact_solution(n: int) -> None:
    """The error is of first order in the width, for random joints."""
    orders = []
    for seed in range(3):
        found = [run_of(*joints(n, np.random.default_rng(100 * n + seed), eta)) for eta in (0, 1e-4, 1e-5)]
        wide, narrow = (float(np.max(np.abs(q[: 2 * n] - found[0]))) for q in found[1:])
        assert narrow < 5e-5
        orders.append(np.log10(wide / narrow))
    assert min(orders) > 0.9
    assert np.median(orders) == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("n", [2, 3])
def test_15_1_bands_of_many_are_those_of_switch_to_first_order(n: int) -> None:
    for eta in (1e-4, 1e-5):
        exact, start = joints(n, np.random.default_rng(100 * n), 0)
        made, longer = joints(n, np.random.default_rng(100 * n), eta)
        switch = run_of(exact.with_comparator(Switch(eta, ALPHA)), start)
        assert np.max(np.abs(switch - run_of(made, longer)[: 2 * n])) < 2 * eta
