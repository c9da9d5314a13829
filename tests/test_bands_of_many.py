"""Switch and Karnopp for any number of frictions on one rate: sliding on h_i = e_i, where e_i' = -alpha e_i.

e_i is set to h_i where the band |h_i| <= eta is entered, and the inclusion decides there which of all stick:
three surfaces a friction, where levels in the field grow like 3^n (two and three frictions take these).
"""

import json
import os
from itertools import product
from typing import Any

import numpy as np
import pytest
import sympy

from filippov import (
    Karnopp,
    ModelError,
    Parameter,
    Surface,
    Switch,
    System,
    cos,
    parameters,
    sign,
    sin,
    solve,
    states,
    t,
)  # fmt: skip
from filippov.analysis import compare
from filippov.app.explorer.explorer import Explorer
from filippov.io.stored_system import system_data, system_of

ALPHA = 100.0
KINDS = [Switch, Karnopp]
ETA = parameters(eta=Parameter(1e-3, lower=1e-12)).eta
SEEDS = {"ci": 10, "nightly": 25}.get(os.environ.get("FILIPPOV_PROFILE", ""), 2)
x0, x1, x2, x3, v0, v1, v2, v3 = states("x0 x1 x2 x3 v0 v1 v2 v3")
X, V = (x0, x1, x2, x3), (v0, v1, v2, v3)
FOUR = np.array([[3, 0.5, 0.2, 0.1], [0.5, 2, 0.4, 0.2], [0.2, 0.4, 1.5, 0.3], [0.1, 0.2, 0.3, 1.2]])


def numbers(n: int, rng: np.random.Generator) -> tuple[Any, ...]:
    """The inverse of a mass matrix, springs, dampers, drives with their rates, and frictions."""
    root = rng.normal(size=(n, n))
    inverse = np.linalg.inv(root @ root.T / n + 0.5 * np.eye(n))
    bounds = ((1, 4), (0, 0.3), (0.5, 1.6), (0.6, 2), (0.3, 0.9))
    return inverse, *(rng.uniform(low, high, n).tolist() for low, high in bounds)


def joints(n: int, rng: np.random.Generator, eta: float) -> tuple[System, list[float]]:
    """Springs, dampers, drives and frictions through any mass matrix, and where it starts.

    eta = 0: exact; otherwise the bands are written out, with edges that are passed inwards.
    """
    x, v, e = (states(" ".join(f"{name}{i}" for i in range(n))) for name in "xve")
    inverse, k, c, u, o, f = numbers(n, rng)
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


def run_of(system: System, start: Any, end: float = 6, **options: Any) -> Any:
    whole = [*start, *[0.0] * (system.dimension - len(start))]
    run = solve(system, whole, (0, end), rtol=1e-10, atol=1e-13, **options)
    assert run.success, run.message
    return run.sol(np.linspace(0, end, 241))


def orders_of(exact: System, made: System, start: Any, end: float = 6) -> list[float]:
    """Orders of the largest error of a state of the exact system from one decade of widths to the next."""
    known = run_of(exact, start, end)
    errors = []
    for eta in (1e-4, 1e-5, 1e-6):
        found = run_of(made, start, end, parameters={"eta": eta})
        errors.append(float(np.max(np.abs(found[: exact.dimension] - known))))
    assert errors[-1] < 1e-5
    return [float(q) for q in -np.diff(np.log10(errors))]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [4, 5, 6])
def test_15_1_bands_of_many_frictions_go_to_the_exact_solution(n: int, kind: Any) -> None:
    """The error is of first order in the width, for random joints."""
    orders = []
    for seed in range(SEEDS):
        exact, start = joints(n, np.random.default_rng(100 * n + seed), 0)
        orders += orders_of(exact, exact.with_comparator(kind(ETA)), start)
    assert min(orders) > 0.9
    assert np.median(orders) == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("n", [2, 3, 4])
def test_15_1_bands_of_many_are_those_of_switch_to_first_order(n: int) -> None:
    """Written out by hand, beside levels in the field (2 and 3), and beside the same made from the system."""
    for eta in (1e-4, 1e-5):
        exact, start = joints(n, np.random.default_rng(100 * n), 0)
        made, longer = joints(n, np.random.default_rng(100 * n), eta)
        switch = run_of(exact.with_comparator(Switch(eta, ALPHA)), start)
        assert np.max(np.abs(switch[: 2 * n] - run_of(made, longer)[: 2 * n])) < 2 * eta


def held(inverse: Any, force: Any, e: Any, within: Any, side: Any, level: Any, alpha: float) -> Any:
    """The rates of velocities by trying all cases of who sticks, and how clear the case is.

    Within: v = e, where a stick has dv/dt = -alpha e; a slip goes to the side of its sign.
    """
    n = len(e)
    for case in product((-1, 0, 1), repeat=n):
        stuck = np.array([c == 0 for c in case])
        if any(case[i] != side[i] for i in range(n) if not within[i]):
            continue
        s = np.array(case, dtype=float)
        friction = s * level
        wanted = -alpha * e - inverse @ (force - friction)
        friction[stuck] = -np.linalg.solve(inverse[np.ix_(stuck, stuck)], wanted[stuck])
        rate = inverse @ (force - friction)
        clear = [
            level[i] - abs(friction[i]) if stuck[i] else s[i] * (rate[i] + alpha * e[i])
            for i in range(n) if within[i]
        ]  # fmt: skip
        if all(q > 0 for q in clear):
            return rate, min([*clear, 1.0])
    return None, 0.0


@pytest.mark.parametrize("kind", KINDS)
def test_15_1_the_stick_of_many_is_the_one_of_all_its_cases(kind: Any) -> None:
    """Over a first moment of runs from random states; Karnopp takes places and forces at v - e."""
    n, eta, alpha, short = 4, 0.3, 7.0, 1e-7
    made_of = {}
    rng = np.random.default_rng(8)
    seen, compared = set(), 0
    for seed in range(8):
        inverse, k, c, u, _, f = numbers(n, np.random.default_rng(400 + seed))
        exact, _ = joints(n, np.random.default_rng(400 + seed), 0)
        made_of[seed] = exact.with_comparator(kind(eta, alpha))
        for _ in range(12):
            x, within = rng.uniform(-0.5, 0.5, n), rng.random(n) < 0.6
            side = np.where(rng.random(n) < 0.5, -1, 1)
            e = np.where(within, rng.uniform(-0.9, 0.9, n) * eta, 0)
            v = np.where(within, e, side * rng.uniform(1.1, 2, n) * eta)
            w = v - e if kind is Karnopp else v
            force = np.array(u) - np.array(k) * x - np.array(c) * w
            rate, clear = held(inverse, force, e, within, side, np.array(f), alpha)
            if clear < 1e-3:
                continue
            run = solve(made_of[seed], [*x, *v, *e], (0, short), rtol=1e-12, atol=1e-15)
            got = (run.x_end - [*x, *v, *e]) / short
            assert got == pytest.approx([*w, *rate, *(-alpha * e)], abs=1e-4 * (1 + np.abs(inverse).max()))
            seen.add(tuple(within))
            compared += 1
    assert compared > 60
    assert len(seen) > 12


def stack(falling: bool = False) -> System:
    """A body on the ground, and three on top of each other; falling: friction falls with the speed."""
    def friction(level: float, speed: Any) -> Any:
        return level * (1 + 0.5 / (1 + abs(speed)) if falling else 1) * sign(speed)

    ground, a = friction(0.5, v0), friction(0.3, v0 - v1)
    b, c = friction(0.25, v1 - v2), friction(0.2, v2 - v3)
    return System({
        x0: v0, v0: -x0 - ground - a + 2.2 * cos(t), x1: v1, v1: (a - b - 0.2 * x1) / 1.3,
        x2: v2, v2: (b - c - 0.3 * x2) / 0.8, x3: v3, v3: (c - 0.4 * x3) / 0.7,
    })  # fmt: skip


def belts() -> System:
    """A body held by four belts, three of which turn back and forth: one velocity, four frictions."""
    moved = (0, 0.2 * cos(0.5 * t), 0.3 * sin(0.7 * t), 0.25 * sin(1.1 * t + 1))
    held = [f * sign(v0 - u) for f, u in zip((0.3, 0.25, 0.2, 0.15), moved, strict=True)]
    return System({x0: v0, v0: -x0 - sum(held)})


def robot(static: float = 1, wall: bool = False, bent: float = 0) -> System:
    """Four joints; static: the level at rest over that of slip; bent: how the places change the inertia."""
    matrix = sympy.Matrix(FOUR)
    matrix[0, 0] += bent * cos(x1)
    matrix[0, 2] += bent / 3 * cos(x1)
    matrix[2, 0] = matrix[0, 2]
    inverse = matrix.adjugate() / matrix.det() if bent else sympy.Matrix(np.linalg.inv(FOUR))
    force = [
        -(1 + 0.3 * i) * X[i] - 0.1 * V[i] + (1.1 + 0.1 * i) * cos((0.8 + 0.3 * i) * t)
        - (0.5 + 0.05 * i) * sign(V[i])
        for i in range(4)
    ]  # fmt: skip
    surfaces = [Surface(f"joint {i}", V[i], radius=static) for i in range(4)]
    surfaces += [Surface("wall", x0 + 0.2, reset={v0: -0.5 * v0})] if wall else []
    rates = inverse * sympy.Matrix(force)
    return System(dict(zip([*X, *V], [*V, *rates], strict=True)), surfaces=surfaces)


RESTING = (1, 0.3, 0, 0.1, 0, 0, 0, 0)
MOVING = (1, -0.5, 0.3, 0.8, 0, 0.2, 0, -0.1)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("make", "start"),
    [
        (stack, {x0: 1, v0: 0, x1: 0.3, v1: 0, x2: 0, v2: 0, x3: 0.1, v3: 0}),
        (lambda: stack(True), {x0: 1, v0: 0, x1: 0.3, v1: 0, x2: 0, v2: 0, x3: 0.1, v3: 0}),
        (belts, {x0: 1.5, v0: 0}),
        (lambda: robot(1.3), MOVING),
        (lambda: robot(bent=0.9), MOVING),
        (lambda: robot(wall=True), MOVING),
    ],
    ids=["stack", "falling", "belts", "static level", "inertia by the places", "impacts"],
)
def test_15_1_any_velocities_with_many_frictions_go_to_the_exact_solution(
    make: Any, start: Any, kind: Any
) -> None:
    exact = make()
    given = [start[q] for q in exact.symbolic.x] if isinstance(start, dict) else start
    assert min(orders_of(exact, exact.with_comparator(kind(ETA)), given, 8)) > 0.85


@pytest.mark.parametrize("kind", ["switch", "karnopp"])
def test_15_1_compare_reads_the_stays_of_many(kind: str) -> None:
    """In a stay the places of Switch drift by eta/alpha; those of Karnopp do not."""
    table = compare(stack(), (1, 0, 0.3, 0, 0, 0, 0.1, 0), (0, 8), against=[kind], widths=(1e-4, 1e-5))
    assert not table.faults
    assert sum(table.rows[0]["entries"]) > 2
    wide, narrow = table.of(kind)
    for error in ("error_state", "error_times"):
        assert narrow[error] < 1e-4
        assert wide[error] / narrow[error] == pytest.approx(10, rel=0.15)
    assert narrow["drift"] < (1.1e-5 / ALPHA if kind == "switch" else 1e-12)
    assert narrow["entries"] == table.rows[0]["entries"]


@pytest.mark.parametrize("kind", KINDS)
def test_15_1_with_no_return_to_the_surface_a_stick_creeps_on_at_the_edge(kind: Any) -> None:
    """alpha = 0: of first order still, and under Karnopp places stand."""
    exact = robot()
    errors = [
        np.max(np.abs(run_of(exact.with_comparator(kind(eta, 0)), MOVING)[:8] - run_of(exact, MOVING)))
        for eta in (1e-4, 1e-6)
    ]
    assert np.log10(errors[0] / errors[1]) / 2 == pytest.approx(1, abs=0.1)


def test_15_1_many_bands_have_states_of_their_own_last() -> None:
    """They are stored with the system, and the explorer begins them at 0."""
    exact = robot()
    first, *others = exact.surface_names
    made = exact.with_comparator({first: Switch(1e-3), **dict.fromkeys(others, Karnopp(1e-3))})
    assert made.states == (*exact.states, "e_joint_0", "e_joint_1", "e_joint_2", "e_joint_3")
    assert made.exact == exact
    read = system_of(json.loads(json.dumps(system_data(made))))
    assert read == made
    assert read.states == made.states
    shown = Explorer(exact, MOVING, (0, 3))
    other = shown.solutions.other(shown.view({"against": "Switch", "width": 1e-3}))
    shown.close()
    assert other is not None
    known = run_of(exact.with_comparator(Switch(1e-3)), MOVING, 3)
    assert other.x_end[:8] == pytest.approx(known[:8, -1], abs=1e-5)


def test_15_1_what_bands_of_many_cannot_stand_for_is_refused() -> None:
    loaded = System({
        x0: v0, v0: -x0 - (1 + v0**2) * sign(v0 - v1), x1: v1, v1: sign(v0 - v1) - sign(v1 - v2),
        x2: v2, v2: sign(v1 - v2) - sign(v2 - v3), x3: v3, v3: sign(v2 - v3) - 0.2 * sign(v3),
    })  # fmt: skip
    with pytest.raises(ModelError, match="in a ratio that none of these changes"):
        loaded.with_comparator(Karnopp(0.1))
    force = [-X[i] - sign(V[i]) - sum(V) / 9 for i in range(4)]
    rates = np.linalg.inv(FOUR) @ force
    named = System(dict(zip([*X, *V], [*V, *rates], strict=True)), outputs={"e_v0": x0})
    with pytest.raises(ModelError, match="the output 'e_v0' has the name of a state"):
        named.with_comparator(Switch(0.1))
