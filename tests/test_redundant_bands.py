"""Switch and Karnopp where some frictions move with others: forces in stick are not unique, the motion is."""

import os
from itertools import count, islice
from typing import Any

import numpy as np
import pytest
import sympy

from filippov import (
    Karnopp,
    Parameter,
    Surface,
    Switch,
    System,
    TimeEvent,
    cos,
    parameters,
    sign,
    sin,
    solve,
    states,
    t,
)

KINDS = [Switch, Karnopp]
ETA = parameters(eta=Parameter(1e-3, lower=1e-12)).eta
SEEDS = {"ci": 10, "nightly": 40}.get(os.environ.get("FILIPPOV_PROFILE", ""), 2)
q0, q1, v, w = states("q0 q1 v w")


def bodies(n: int, more: int, rng: np.random.Generator, wall: bool = False) -> tuple[System, list[float]]:
    """Bodies on the ground and against each other: n + more frictions on n velocities, in any order.

    wall: the first strikes one, through the mass matrix, and all are kicked at three instants.
    """
    x, speed = (states(" ".join(f"{name}{i}" for i in range(n))) for name in "xv")
    root = rng.normal(size=(n, n))
    inverse = np.linalg.inv(root @ root.T / n + 0.5 * np.eye(n))
    rows = list(np.eye(n))
    while len(rows) < n + more:
        i, j = rng.choice(n, 2, replace=False)
        row = np.eye(n)[i] + rng.choice([-1, -1, 1, 0.5]) * np.eye(n)[j]
        if all(np.linalg.matrix_rank([row, other]) == 2 for other in rows):
            rows.append(row)
    shares = np.array(rows)[rng.permutation(n + more)]
    level = rng.uniform(0.1, 0.9, n + more) * 4 / (n + more)
    bounds = ((1, 4), (0, 0.3), (0.5, 1.8), (0.6, 2))
    k, c, u, o = (rng.uniform(low, high, n) for low, high in bounds)
    h = [sympy.Add(*(float(a) * s for a, s in zip(row, speed, strict=True) if a)) for row in shares]
    force = [
        -k[i] * x[i] - c[i] * speed[i] + u[i] * cos(o[i] * t)
        - sum(float(row[i] * f) * sign(q) for row, f, q in zip(shares, level, h, strict=True) if row[i])
        for i in range(n)
    ]  # fmt: skip
    rates = [sum(float(inverse[i, j]) * force[j] for j in range(n)) for i in range(n)]
    start = [*rng.uniform(-1, 1, n), *(rng.uniform(-1, 1, n) * (rng.random(n) < 0.6))]
    surfaces = [Surface(f"friction {i}", q) for i, q in enumerate(h)]
    kicks: list[TimeEvent] = []
    if wall:
        place = rng.uniform(0.1, 0.5)
        start[0] = min(start[0], place - 0.05)
        struck = {q: q - 1.9 * inverse[i, 0] / inverse[0, 0] * speed[0] for i, q in enumerate(speed)}
        surfaces.append(Surface("wall", place - x[0], reset=struck, side="-"))
        kicked = dict(zip(speed, speed + rng.uniform(-0.5, 0.5, n), strict=True))
        kicks.append(TimeEvent("kick", times=(1.3, 2.9, 4.4), reset=kicked))
    equations = dict(zip([*x, *speed], [*speed, *rates], strict=True))
    return System(equations, surfaces=surfaces, time_events=kicks), start


def run_of(system: System, start: Any, end: float, **options: Any) -> Any:
    whole = [*start, *[0.0] * (system.dimension - len(start))]
    run = solve(system, whole, (0, end), rtol=1e-10, atol=1e-13, **options)
    assert run.success, run.message
    return run.sol(np.linspace(0, end, 241))


def orders_of(exact: System, kind: Any, start: Any, end: float = 6, mean: bool = False) -> list[float]:
    """Orders of the largest (or mean) error of a state from one decade of widths to the next."""
    size = np.mean if mean else np.max
    frictions = [surface.name for surface in exact.surfaces if surface.reset is None]
    known, made = run_of(exact, start, end), exact.with_comparator(dict.fromkeys(frictions, kind(ETA)))
    errors = [
        float(size(np.abs(run_of(made, start, end, parameters={"eta": eta})[: exact.dimension] - known)))
        for eta in (1e-4, 1e-5, 1e-6)
    ]
    assert errors[-1] < 1e-5
    return [float(q) for q in -np.diff(np.log10(errors))]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("n", "more"), [(3, 1), (3, 3), (4, 2), (4, 5), (5, 1)])
def test_15_1_frictions_that_move_with_others_go_to_the_exact_solution(n: int, more: int, kind: Any) -> None:
    orders = []
    for seed in range(SEEDS):
        exact, start = bodies(n, more, np.random.default_rng(1000 * n + 100 * more + seed))
        orders += orders_of(exact, kind, start)
    assert min(orders) > 0.85
    assert np.median(orders) == pytest.approx(1, abs=0.03)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("n", "more"), [(2, 0), (3, 0), (2, 2), (3, 1), (4, 1)])
def test_15_1_bodies_that_strike_a_wall_and_are_kicked_go_to_the_exact_solution(
    n: int, more: int, kind: Any
) -> None:
    """Between impacts, so the error is the mean one: each impact comes a little later or earlier."""
    drawn = (bodies(n, more, np.random.default_rng(7000 * n + 100 * more + k), wall=True) for k in count())
    # Others come to rest at the wall.
    passing = (member for member in drawn if solve(*member, (0, 6)).success)
    for exact, start in islice(passing, SEEDS):
        assert min(orders_of(exact, kind, start, mean=True)) > 0.85


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("static", [1, 1.3])
@pytest.mark.parametrize("belt", [0, 0.3])
def test_15_1_shares_that_depend_on_places_go_to_the_exact_solution(
    belt: float, static: float, kind: Any
) -> None:
    """Two guides that turn with the places; belt: one moves by itself."""
    h = [v, w, v * cos(q0) + w * sin(q0), v - w, v + w * cos(q1) - belt * sin(t)]
    signs = [f * sign(q) for f, q in zip((0.3, 0.25, 0.2, 0.15, 0.1), h, strict=True)]
    held = [sum(s * sympy.diff(q, x) for s, q in zip(signs, h, strict=True)) for x in (v, w)]
    exact = System(
        {q0: v, q1: w, v: -q0 + 1.6 * cos(t) - 0.1 * v - held[0],
         w: (-1.5 * q1 + 1.3 * cos(1.4 * t) - 0.1 * w - held[1]) / 1.4},
        surfaces=[Surface(f"guide {i}", q, radius=static) for i, q in enumerate(h)],
    )  # fmt: skip
    assert min(orders_of(exact, kind, (1, -0.5, 0, 0.3), 8)) > 0.9


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("case", ["one factor", "of two", "belt"])
def test_15_1_a_velocity_may_have_factors_that_depend_on_places(case: str, kind: Any) -> None:
    """Alone (one friction) and coupled (two)."""
    slide = v * cos(q0) + w * sin(q0)
    exact = {
        "one factor": System({q0: v, v: -2 * q0 + 1.5 * cos(t) - 0.6 * (1 + q0**2) * sign(v + v * q0**2)},
                             surfaces=[Surface("slide", v + v * q0**2)]),
        "of two": System({
            q0: v, q1: w, v: -2 * q0 + 1.5 * cos(t) - 0.4 * cos(q0) * sign(slide),
            w: -q1 + cos(1.3 * t) - 0.4 * sin(q0) * sign(slide) - 0.3 * sign(w),
        }, surfaces=[Surface("slide", slide), Surface("ground", w)]),
        "belt": System({
            q0: v, v: -2 * q0 + 1.5 * cos(t) - 0.6 * cos(q0) * sign(v * cos(q0) - 0.2 * sin(2 * t)),
        }),
    }[case]  # fmt: skip
    start = (0.9, 0) if exact.dimension == 2 else (0.9, 0.2, 0, 0.1)
    assert min(orders_of(exact, kind, start)) > 0.9


@pytest.mark.parametrize("kind", KINDS)
def test_15_1_what_moves_with_others_has_no_state_and_forces_that_are_not_unique(kind: Any) -> None:
    """Three frictions hold two bodies: the sum of their forces is the load, and none of them slips."""
    h = [v, w, v - w, v + w]
    exact = System(
        {q0: v, q1: w, v: 0.3 * sin(t) - sign(h[0]) - sign(h[2]) - sign(h[3]),
         w: 0.2 * sin(2 * t) - sign(h[1]) + sign(h[2]) - sign(h[3])},
        surfaces=[Surface(f"f{i}", q) for i, q in enumerate(h)],
    )  # fmt: skip
    made = exact.with_comparator(kind(1e-3))
    assert made.states == (*exact.states, "e_f0", "e_f1")
    run = solve(made, (0.1, 0.2, 0.5, -0.3, 0, 0), (0, 6))
    assert run.success, run.message
    known = solve(exact, (0.1, 0.2, 0.5, -0.3), (0, 6))
    assert run.x_end[:2] == pytest.approx(known.x_end[:2], abs=2e-3)
    assert np.max(np.abs(run.x_end[2:])) < 1e-12
