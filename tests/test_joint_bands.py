"""Karnopp and Switch on joints that a mass matrix couples: inertia by the places, and three frictions."""

import os
from itertools import combinations, product
from typing import Any

import numpy as np
import pytest
import sympy

from filippov import (
    EventKind,
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
from filippov.model.comparators.unique_stick import unique

x1, v1, x2, v2, x3, v3 = states("x1 v1 x2 v2 x3 v3")
KINDS = [Switch, Karnopp]
MATRICES = {"ci": 100, "nightly": 100}.get(os.environ.get("FILIPPOV_PROFILE", ""), 30)
ETA = parameters(eta=Parameter(1e-3, lower=1e-12)).eta
# A two-link arm: inertia, coupling, that of the second link, weight, friction, drives.
ARM = {"a": 3.0, "b": 0.5, "d": 0.9, "g": 0.3, "f1": 0.9, "f2": 0.6, "u1": 2.5, "u2": 1.2}


def arm() -> System:
    """Its full equations, solved for the accelerations; the parameters have no bounds."""
    p = parameters(**ARM)
    m11, m12 = p.a + 2 * p.b * cos(x2), p.d + p.b * cos(x2)
    first = p.b * sin(x2) * (2 * v1 + v2) * v2 - p.g * sin(x1) + p.u1 * cos(1.3 * t) - p.f1 * sign(v1)
    second = -p.b * sin(x2) * v1**2 - p.g * sin(x1 + x2) + p.u2 * cos(2.1 * t) - p.f2 * sign(v2)
    det = m11 * p.d - m12**2
    return System({
        x1: v1, v1: (p.d * first - m12 * second) / det, x2: v2, v2: (m11 * second - m12 * first) / det,
    })  # fmt: skip


def chain(n: int) -> System:
    """Joints on springs with dampers and drives; w is the inverse of any mass matrix."""
    words = {f"w{i}{j}": float(i == j) for i in range(n) for j in range(i, n)}
    for i in range(n):
        words |= {f"k{i}": 1.0, f"c{i}": 0.1, f"u{i}": 1.0, f"o{i}": 1.0, f"f{i}": 0.5}
    p = parameters(**words)
    x, v = (x1, x2, x3)[:n], (v1, v2, v3)[:n]
    force = [
        -p[f"k{i}"] * x[i] - p[f"c{i}"] * v[i] + p[f"u{i}"] * cos(p[f"o{i}"] * t) - p[f"f{i}"] * sign(v[i])
        for i in range(n)
    ]
    rates = [sum(p[f"w{min(i, j)}{max(i, j)}"] * force[j] for j in range(n)) for i in range(n)]
    return System(dict(zip([*x, *v], [*v, *rates], strict=True)))


def drawn(rng: np.random.Generator, n: int) -> tuple[dict[str, float], np.ndarray]:
    """Parameters of `chain` with a mass matrix at random, and its inverse."""
    root = rng.normal(size=(n, n))
    inverse = np.linalg.inv(root @ root.T + 0.1 * np.eye(n))
    given = {f"w{i}{j}": float(inverse[i, j]) for i in range(n) for j in range(i, n)}
    for i in range(n):
        for word, low, high in (("k", 1, 4), ("c", 0, 0.3), ("u", 0.5, 1.6), ("o", 0.6, 2), ("f", 0.3, 0.9)):
            given[f"{word}{i}"] = float(rng.uniform(low, high))
    return given, inverse


def karnopp(
    inverse: Any, force: Any, v: Any, level: Any, eta: float, alpha: float, seen: bool
) -> tuple[Any, Any, float]:
    """Karnopp's rule by all cases: the velocities that the places see, dv/dt, and how clear the case is.

    Within |v| <= eta velocities count as 0, the others as after the impulse that stops these; friction there
    is what holds them, or its level against the force. force: of the velocities. Not `seen` for Switch.
    """
    n = len(v)
    inside = np.abs(v) <= eta
    stop = np.zeros(n)
    if inside.any():
        stop = inverse[:, inside] @ np.linalg.solve(inverse[np.ix_(inside, inside)], v[inside])
    rest = force(v - stop)
    there = v - stop if seen else v
    moving = force(there)
    for case in product((-1, 0, 1), repeat=n):
        stuck = inside & (np.array(case) == 0)
        if any(case[i] != np.sign(v[i]) for i in range(n) if not inside[i]):
            continue
        s = np.array(case, dtype=float)
        part, given = inverse[np.ix_(stuck, stuck)], s * level
        balance = given.copy()
        balance[stuck] = np.linalg.solve(part, (inverse @ (rest - given))[stuck])
        rate = inverse @ (rest - balance)
        clear = [level[i] - abs(balance[i]) if stuck[i] else s[i] * rate[i] for i in range(n) if inside[i]]
        if all(q > 0 for q in clear):
            held = given.copy()
            held[stuck] = np.linalg.solve(part, (inverse @ (moving - given))[stuck] + alpha * v[stuck])
            return there, inverse @ (moving - held), min([*clear, 1.0])
    return there, np.full(n, np.nan), 0.0


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [2, 3])
def test_15_1_the_stick_through_any_mass_matrix_is_the_one_of_all_its_cases(kind: Any, n: int) -> None:
    """Over a first moment of runs, at random states, by a hundred mass matrices."""
    eta, alpha, short = 0.3, 7.0, 1e-7
    made = chain(n).with_comparator(kind(eta, alpha))
    rng = np.random.default_rng(n)
    sets, compared = set(), 0
    for _ in range(150):
        given, inverse = drawn(rng, n)
        x, v = rng.uniform(-0.5, 0.5, n), rng.uniform(-0.6, 0.6, n)
        k, c, u, f = (np.array([given[f"{word}{i}"] for i in range(n)]) for word in "kcuf")
        seen, rate, clear = karnopp(
            inverse, lambda w, x=x, k=k, c=c, u=u: u - k * x - c * w, v, f, eta, alpha, kind is Karnopp
        )
        if clear < 1e-3:
            continue
        run = solve(made, [*x, *v], (0, short), parameters=given, rtol=1e-12, atol=1e-15)
        got = (run.x_end - [*x, *v]) / short
        size = 1 + np.abs(inverse).max()
        assert got == pytest.approx([*seen, *rate], abs=1e-4 * size), (x, v, given)
        sets.add(tuple(np.abs(v) <= eta))
        compared += 1
    assert compared > 100
    assert len(sets) == 2**n


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [2, 3])
def test_15_1_many_mass_matrices_go_to_the_exact_solution(kind: Any, n: int) -> None:
    """The error is of first order in the width."""
    exact = chain(n)
    made = exact.with_comparator(kind(ETA))
    times, orders = np.linspace(0, 8, 321), []
    for seed in range(MATRICES):
        rng = np.random.default_rng(seed)
        given, _ = drawn(rng, n)
        x0 = [*rng.uniform(-1, 1, n), *(rng.uniform(-1, 1, n) * (rng.random(n) < 0.6))]
        known = solve(exact, x0, (0, 8), parameters=given, rtol=1e-11, atol=1e-13)
        assert known.sol is not None
        errors = []
        for eta in (1e-4, 1e-5):
            run = solve(made, x0, (0, 8), parameters=given | {"eta": eta}, rtol=1e-10, atol=1e-13)
            assert run.success, (seed, eta, run.message)
            assert run.sol is not None
            errors.append(float(np.max(np.abs(known.sol(times) - run.sol(times)))))
        assert errors[-1] < 1e-4, (seed, errors)
        if errors[-1] > 1e-8:
            orders.append(np.log10(errors[0] / errors[1]))
    assert len(orders) > 0.9 * MATRICES
    assert min(orders) > 0.8
    assert np.median(orders) == pytest.approx(1, abs=0.03)


@pytest.mark.parametrize("seed", [174, 252, 267])
def test_15_1_the_edge_of_a_narrow_band_is_not_passed_on_the_way_to_a_level_beside_it(seed: int) -> None:
    """Of 300 draws those that ended so: a level's root just beyond the edge seemed to come before it."""
    rng = np.random.default_rng(seed)
    given, _ = drawn(rng, 3)
    x0 = [*rng.uniform(-1, 1, 3), *(rng.uniform(-1, 1, 3) * (rng.random(3) < 0.6))]
    exact = chain(3)
    known = solve(exact, x0, (0, 8), parameters=given, rtol=1e-11, atol=1e-13).x_end
    made, narrow = exact.with_comparator(Karnopp(ETA)), given | {"eta": 1e-6}
    run = solve(made, x0, (0, 8), parameters=narrow, rtol=1e-10, atol=1e-13)
    assert run.success, run.message
    assert run.x_end == pytest.approx(known, abs=1e-5)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("kind", ["switch", "karnopp"])
def test_15_1_a_two_link_arm_goes_to_the_exact_one(kind: str, seed: int) -> None:
    """Its inertia depends on the places. With no weight, b = 0 or at rest levels depend on time alone."""
    rng = np.random.default_rng(seed)
    b, g = rng.uniform(-0.6, 0.6), rng.uniform(0, 0.5) * (seed > 0)
    given = dict(ARM, b=float(b), g=float(g), u1=float(rng.uniform(1, 3)), f1=float(rng.uniform(0.3, 1)))
    x0 = (1, 0, 0.3, 0) if seed == 0 else rng.uniform(-1, 1, 4)
    table = compare(arm(), x0, (0, 10), parameters=given, against=[kind], widths=(1e-3, 1e-4, 1e-5))
    assert sum(table.rows[0]["entries"]) > 2
    _, wide, narrow = table.of(kind)
    assert narrow["error_state"] < 1e-4
    assert wide["error_state"] / narrow["error_state"] == pytest.approx(10, rel=0.1)
    if kind == "karnopp":
        assert narrow["drift"] < 1e-10


def test_15_1_a_two_link_arm_under_karnopp_is_the_rule_in_small_steps() -> None:
    """Against explicit steps under the rule itself, for a band so wide that it is far from exact."""
    eta, alpha, step, end = 0.1, 20.0, 2.5e-4, 3.0
    q = ARM

    def field(time: float, x: Any, v: Any) -> tuple[Any, Any]:
        m12 = q["d"] + q["b"] * np.cos(x[1])
        inverse = np.linalg.inv([[q["a"] + 2 * q["b"] * np.cos(x[1]), m12], [m12, q["d"]]])

        def force(w: Any) -> Any:
            return np.array([
                q["b"] * np.sin(x[1]) * (2 * w[0] + w[1]) * w[1] - q["g"] * np.sin(x[0])
                + q["u1"] * np.cos(1.3 * time),
                -q["b"] * np.sin(x[1]) * w[0] ** 2 - q["g"] * np.sin(x[0] + x[1])
                + q["u2"] * np.cos(2.1 * time),
            ])  # fmt: skip

        return karnopp(inverse, force, v, np.array([q["f1"], q["f2"]]), eta, alpha, True)[:2]

    x, v = np.array([0.5, 0.8]), np.array([0.3, -0.4])
    start = [0.5, 0.3, 0.8, -0.4]
    for k in range(round(end / step)):
        dx, dv = field(k * step, x, v)
        more_x, more_v = field((k + 1) * step, x + step * dx, v + step * dv)
        x, v = x + step * (dx + more_x) / 2, v + step * (dv + more_v) / 2
    system = arm()
    made = solve(system.with_comparator(Karnopp(eta, alpha)), start, (0, end), rtol=1e-9, atol=1e-11)
    own = np.array([x[0], v[0], x[1], v[1]])
    assert np.max(np.abs(made.x_end - own)) < 2e-3
    assert np.max(np.abs(solve(system, start, (0, end)).x_end - own)) > 0.02


def stack_of_three() -> System:
    """A body on the ground, a second one on it, and a third on that."""
    ground, low, high = 0.6 * sign(v1), 0.4 * sign(v1 - v2), 0.3 * sign(v2 - v3)
    return System(
        {
            x1: v1, v1: -x1 - ground - low + 1.8 * cos(t), x2: v2, v2: (low - high - 0.2 * x2) / 1.3,
            x3: v3, v3: (high - 0.3 * x3) / 0.8,
        },
        surfaces=[Surface("ground", v1), Surface("low", v1 - v2), Surface("high", v2 - v3)],
    )  # fmt: skip


def stack_at_a_wall() -> System:
    """Two bodies with friction between them and each on its own ground: three signs, two velocities."""
    between = 0.4 * sign(v1 - v2)
    return System({
        x1: v1, v1: -x1 - 0.5 * sign(v1) - between + 1.2 * cos(t),
        x2: v2, v2: (between - 0.3 * sign(v2) - 0.2 * x2) / 1.3,
    })  # fmt: skip


def three_belts() -> System:
    """A body held by three belts, two of which turn back and forth."""
    first, second = 0.2 * cos(0.5 * t), 0.3 * sin(0.7 * t)
    held = 0.3 * sign(v1) + 0.25 * sign(v1 - first) + 0.2 * sign(v1 - second)
    return System({x1: v1, v1: -x1 - held})


def falling() -> System:
    """Two bodies whose friction falls with the speed: its formula has poles beyond the bands."""
    ground, between = (0.5 + 0.3 / (1 + abs(v1))) * sign(v1), (0.3 + 0.2 / (1 + abs(v1 - v2))) * sign(v1 - v2)
    return System({
        x1: v1, v1: -x1 - ground - between + 1.9 * cos(t), x2: v2, v2: between - 0.3 * x2 - 0.1 * v2,
    })  # fmt: skip


@pytest.mark.parametrize("kind", ["switch", "karnopp"])
@pytest.mark.parametrize(
    ("make", "x0", "errors"),
    [
        (stack_of_three, (1, 0, 0.3, 0, 0, 0), ("error_state", "error_times")),
        (falling, (1, 0.5, 0.3, -0.4), ("error_state", "error_times")),
        # Here one stick ends where another begins: within both bands their order is another one.
        (stack_at_a_wall, (0.5, -0.5, 0.3, 1.5), ("error_state",)),
        (three_belts, (1.5, 0), ("error_state",)),
    ],
)
def test_15_1_three_frictions_go_to_the_exact_solution(make: Any, x0: Any, errors: Any, kind: str) -> None:
    """States and the times of stick are of first order in the width; under Karnopp no place drifts."""
    table = compare(make(), x0, (0, 10), against=[kind], widths=(1e-4, 1e-5))
    assert sum(table.rows[0]["entries"]) > 0
    wide, narrow = table.of(kind)
    for error in errors:
        assert narrow[error] < 1e-3
        assert wide[error] / narrow[error] == pytest.approx(10, rel=0.1), error
    assert narrow["drift"] < (1.1e-5 / 100 if kind == "switch" else 1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_15_1_no_stick_is_left_in_the_dense_output_of_a_long_step(kind: Any) -> None:
    """The layer of a stick relaxes within a part of a step: its edge is not reached in one."""
    exact = stack_of_three()
    x0 = (1, 0, 0.3, 0, 0, 0)
    end = solve(exact, x0, (0, 10), rtol=1e-12, atol=1e-14).x_end
    made = exact.with_comparator(kind(ETA))
    errors = []
    for eta in (1e-6, 1e-7):
        run = solve(made, x0, (0, 10), parameters={"eta": eta}, rtol=1e-10, atol=1e-13)
        assert run.success, run.message
        assert all(event.kind is EventKind.CROSSING for event in run.events), run.events
        errors.append(float(np.max(np.abs(run.x_end - end))))
    assert errors[0] / errors[1] == pytest.approx(10, rel=0.05)


@pytest.mark.parametrize("kind", ["switch", "karnopp"])
def test_15_1_what_lasts_as_long_as_a_band_is_passed_is_no_fault_in_kind(kind: str) -> None:
    """Three belts at one speed for an instant: which of them holds the body there is a matter of the band."""
    table = compare(three_belts(), (1.5, 0), (0, 10), against=[kind], widths=(1e-5, 1e-6, 1e-7))
    assert not table.faults


def inverse_of(matrix: sympy.Matrix) -> sympy.Matrix:
    return matrix.adjugate() / matrix.det()


def test_15_1_a_mass_matrix_has_one_stick_and_that_is_proved() -> None:
    """M(x)^-1 diag(f) for two joints and three, with all signs of the coupling, and numbers."""
    sets = {n: [k for size in range(1, n + 1) for k in combinations(range(n), size)] for n in (2, 3)}
    b, c = cos(x2), cos(x2 - x3)
    two = sympy.Matrix([[3 + b, 0.9 + 0.5 * b], [0.9 + 0.5 * b, 0.9]])
    three = sympy.Matrix([[2, 0.7 * b, 0.1], [0.7 * b, 1.5, 0.6 * c], [0.1, 0.6 * c, 1.2]])
    for matrix, friction in ((two, (0.3, 2)), (three, (0.9, 0.2, 3)), (sympy.Matrix(np.eye(3)), (1, 2, 3))):
        held = unique(inverse_of(matrix) * sympy.diag(*friction), sets[matrix.rows])
        assert held.proved


def test_15_1_one_place_in_ten_thousand_without_a_unique_stick_is_found() -> None:
    """1 - c(x)^2 is negative for |x - 2| < 0.0003 only, where no sample lies; just positive is proved."""
    for peak, proved in ((1.0 + 1e-7, False), (0.9, True)):
        couple = peak * (1 + cos(x1 - 2)) / 2
        matrix = sympy.Matrix([[1, couple], [couple, 1]])
        held = unique(matrix.xreplace({x1: x1 + 2}), [(0,), (1,), (0, 1)])
        assert held.proved is proved
        shifted = unique(matrix, [(0,), (1,), (0, 1)])
        assert shifted.proved is proved
    # A function of another kind is left to samples.
    assert not unique(sympy.Matrix([[1 + x1**2]]), [(0,)]).proved


def test_15_1_joints_that_drive_each_other_at_a_few_places_are_refused_there() -> None:
    couple = 1.05 * ((1 + cos(x1)) / 2) ** 60
    system = System({
        x1: v1, v1: -x1 - sign(v1) - couple * sign(v2), x2: v2, v2: -x2 - sign(v2) - couple * sign(v1),
    })  # fmt: skip
    with pytest.raises(ModelError, match=r"where x1 = .*so that the stick of all is unique"):
        system.with_comparator(Switch(0.1))
