"""At rest with frictions exactly at their levels: the load decides a moment later who slips."""

import os
from typing import Any

import numpy as np
import pytest

from filippov import Band, Karnopp, Surface, Switch, System, cos, parameters, sign, sin, solve, states, t

SEEDS = {"ci": 12, "nightly": 60}.get(os.environ.get("FILIPPOV_PROFILE", ""), 2)
OPTIONS: dict[str, Any] = {"rtol": 1e-10, "atol": 1e-13}


def held(n: int, chain: bool, rng: np.random.Generator) -> tuple[System, list[float]]:
    """n frictions at rest through a mass matrix, or bodies that carry each other; `scale` times the levels.

    Most of the loads are at the level, and grow or fall with time or with its square.
    """
    x, v = (states(" ".join(f"{name}{i}" for i in range(n))) for name in "xv")
    p = parameters(scale=1.0)
    root = rng.normal(size=(n, n))
    mass = np.diag(rng.uniform(0.5, 2, n)) if chain else root @ root.T / n + 0.5 * np.eye(n)
    inverse = np.linalg.inv(mass)
    level, k, c = (rng.uniform(*q, n).round(2) for q in ((0.3, 1), (0, 3), (0, 0.4)))
    place, side = rng.uniform(-1, 1, n).round(1), rng.choice([-1, 1], n)
    part = np.where(rng.random(n) < 0.8, 1, rng.uniform(-0.95, 0.95, n))
    o, u = rng.uniform(0.5, 2.5, n).round(2), rng.uniform(0.1, 1.5, n).round(2) * side
    h = [v[i] - v[i - 1] if chain and i else v[i] for i in range(n)]
    force = []
    for i, way in enumerate(rng.integers(0, 4, n)):
        start = side[i] * part[i] * level[i] + k[i] * place[i]
        wave = sin(o[i] * t) if way < 2 else cos(o[i] * t)
        up = u[i] if way in (0, 3) else -u[i]
        load = start - (up if way > 1 else 0) + up * wave
        force.append(load - k[i] * x[i] - c[i] * v[i] - p.scale * level[i] * sign(h[i]))
    total = [f - (force[i + 1] if chain and i + 1 < n else 0) for i, f in enumerate(force)]
    rates = [sum(float(inverse[i, j]) * total[j] for j in range(n) if inverse[i, j]) for i in range(n)]
    equations = dict(zip([*x, *v], [*v, *rates], strict=True))
    surfaces = [Surface(f"joint {i}", q) for i, q in enumerate(h)]
    return System(equations, surfaces=surfaces), [*place, *[0.0] * n]


@pytest.mark.parametrize("chain", [False, True])
@pytest.mark.parametrize("n", [2, 3, 4, 5, 6])
def test_u1_who_slips_at_break_away_is_the_limit_of_levels_beside_it(n: int, chain: bool) -> None:
    """Solutions depend on the levels continuously: those 1e-6 above and below stand on either side."""
    compared = 0
    for seed in range(SEEDS):
        exact, start = held(n, chain, np.random.default_rng(1000 * n + seed))
        near = [solve(exact, start, (0, 3), parameters={"scale": s}, **OPTIONS) for s in (1 - 1e-6, 1 + 1e-6)]
        if not all(run.success for run in near):
            continue
        compared += 1
        gap = float(np.max(np.abs(near[0].x_end - near[1].x_end)))
        for kind in (None, Switch(1e-4), Karnopp(1e-4), Band(1e-4)):
            made = exact.with_comparator(kind) if kind else exact
            run = solve(made, [*start, *[0.0] * (made.dimension - 2 * n)], (0, 3), **OPTIONS)
            assert run.success, (seed, kind, run.message)
            error = np.max(np.abs(run.x_end[: 2 * n] - near[0].x_end))
            assert error < gap + (2e-3 if kind else 1e-8), (seed, kind)
    assert compared > SEEDS // 2


def test_15_1_levels_in_which_the_states_weigh_nothing_move_no_state() -> None:
    """At rest, with all three at break-away, a level of Switch depends on time; its slope is rounding."""
    exact, start = held(3, True, np.random.default_rng(3005))
    known = solve(exact, start, (0, 1), **OPTIONS)
    run = solve(exact.with_comparator(Switch(1e-6)), start, (0, 1), **OPTIONS)
    assert run.success, run.message
    assert run.x_end == pytest.approx(known.x_end, abs=1e-5)
