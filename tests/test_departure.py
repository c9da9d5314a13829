"""Points at rest on surfaces whose sets are wider than [-1, 1], or that act on each other: what attracts, and
what solutions leave with a speed. Expected: the solutions themselves, and rates written out."""

import numpy as np
import pytest

from filippov import Surface, System, parameters, sign, solve, states
from filippov.analysis import continuation, stability_report
from filippov.analysis.algebra.attraction import attraction

x, v, z = states("x v z")
p = parameters(F=0.5)


def held(F: float, c: float = 0.1) -> System:
    """A block under a force F on a contact that holds 2 and rubs with 1, beside a state that decays."""
    return System({x: -x, v: F - sign(v) - c * v}, surfaces=[Surface("contact", v, radius=2.0)])


@pytest.mark.parametrize(
    ("F", "answer"), [(-1.5, "unstable"), (0.5, "asymptotically stable"), (1.5, "unstable")]
)
def test_what_static_friction_alone_holds_is_unstable(F: float, answer: str) -> None:
    (found,) = [item for item in stability_report(held(F)).items if item.equilibrium.mode == "0"]
    assert found.answer == answer
    moved = solve(held(F), (0, np.sign(F) * 1e-9), (0, 100)).x_end[1]
    assert abs(moved - (np.sign(F) * (abs(F) - 1) / 0.1 if abs(F) > 1 else 0.0)) < 1e-3


def test_a_multiplier_of_one_inside_a_wider_set_is_left_open() -> None:
    (found,) = [item for item in stability_report(held(1.0)).items if item.equilibrium.mode == "0"]
    assert found.answer == "undecided"


def test_a_line_of_rests_and_one_with_a_part_beyond_sliding_friction() -> None:
    contact = Surface("contact", v, radius=2.0)
    for F, answer in ((0.5, "asymptotically stable"), (1.5, "unstable")):
        system = System({x: v, v: F - sign(v) - 0.3 * v}, surfaces=[contact])
        assert [item.answer for item in stability_report(system).items] == [answer]
    # Held by a spring on the way: of abs(x) <= 2 the part with abs(x) > 1 is left at once.
    spring = System({x: v, v: -x - sign(v) - 0.3 * v}, surfaces=[contact])
    assert [item.answer for item in stability_report(spring).items] == ["unstable"]


@pytest.mark.parametrize("seed", range(12))
def test_reports_of_random_points_on_wider_sets(seed: int) -> None:
    """sigma dh/dt = sigma C B (sigma - s) beside a point with the multiplier s."""
    rng = np.random.default_rng(seed)
    A, C = np.round(rng.normal(size=(2, 2)), 2) - 2 * np.eye(2), np.round(rng.normal(size=2), 2)
    B = -np.round(C / (C @ C), 2)
    s, place = rng.uniform(-2, 2), rng.normal(size=2)
    b, level = -(A @ place + B * s), -float(C @ place)
    h = float(C[0]) * x + float(C[1]) * v + level
    rows = [float(A[i, 0]) * x + float(A[i, 1]) * v + float(b[i]) + float(B[i]) * sign(h) for i in (0, 1)]
    system = System({x: rows[0], v: rows[1]}, surfaces=[Surface("h", h, radius=2.0)])
    along = np.array([-C[1], C[0]])
    decays = along @ (A - np.outer(B, C @ A) / (C @ B)) @ along < 0
    leaves = max(side * float(C @ B) * (side - s) for side in (1, -1)) > 0
    (found,) = [item for item in stability_report(system).items if item.equilibrium.mode == "0"]
    assert found.answer == ("unstable" if leaves or not decays else "asymptotically stable")
    assert leaves is bool(abs(s) > 1)


def test_a_branch_is_unstable_beyond_sliding_friction_and_ends_at_break_away() -> None:
    system = System({x: -x, v: p.F - sign(v) - 0.1 * v}, surfaces=[Surface("contact", v, radius=2.0)])
    run = continuation(system, (0, 0), mode="0", parameter="F", bounds=(0, 2.5), direction=1)
    branch = run.run()
    for point in branch.points[:-1]:
        assert point.stable is (point.value < 1.0)
    last = branch.points[-1]
    assert last.special == "boundary equilibrium"
    assert abs(last.value - 2.0) < 1e-9
    assert branch.message == "boundary equilibrium at 2"
    assert len(branch.special) == 1


@pytest.mark.parametrize(
    ("G", "verdict"),
    [
        ([[1, 0], [0, 1]], "unstable"), ([[-1, 0], [0, -1]], "stable"), ([[-1, -3], [2, -1]], "stable"),
        ([[-1, 5], [-5, 4]], "undecided"), ([[-1, -3], [0, -1]], "stable"),
    ],
)  # fmt: skip
def test_branches_on_two_surfaces(G: list[list[float]], verdict: str) -> None:
    """Two that both repel have the determinant of two that attract."""
    rows = [g[0] * sign(x) + g[1] * sign(v) for g in G]
    system = System({x: rows[0] + 0.1 * p.F, v: rows[1]}, parameters=p)
    run = continuation(system, (0, 0), mode="00", parameter="F", bounds=(0, 1))
    assert {point.verdict for point in run.run().points} == {verdict}


@pytest.mark.parametrize("seed", range(30))
def test_attraction_is_that_of_the_solutions(seed: int) -> None:
    """h' = G (s - m): where it attracts all come to 0, where it is left some go away from however near."""
    rng = np.random.default_rng(seed)
    k = int(rng.integers(2, 4))
    G = rng.normal(size=(k, k)) - rng.choice([0.0, 1.5]) * np.eye(k)
    m, wide = rng.uniform(-1.2, 1.2, size=k), np.full((k, 2), [-1.3, 1.3])
    told = attraction(-G @ m, G, m, wide)
    h = (x, v, z)[:k]
    field = {h[i]: sum(float(G[i, j]) * (sign(h[j]) - float(m[j])) for j in range(k)) for i in range(k)}
    system = System(field, surfaces=[Surface(f"h{i}", h[i], radius=1.3) for i in range(k)])
    ends = []
    for start in rng.normal(size=(40, k)):
        run = solve(system, 1e-3 * start, (0, 20.0), nonunique="stick", zeno="continue")
        ends.append(float(np.max(np.abs(run.x_end))) if run.success else np.nan)
    if told == "stable":
        assert np.nanmax(ends) < 1e-2
        assert np.sum(np.isfinite(ends)) > 20
    elif told == "unstable":
        assert np.nanmax(ends) > 1e-2
