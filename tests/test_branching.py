"""Trees of solutions against closed forms: each mode that can follow is followed (U1, U2)."""

import json
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from bank import case
from scipy.integrate import solve_ivp

from filippov import Status, Surface, System, UsageError, sign, solve, states
from filippov.app.cli.main import main
from filippov.io.storage import ambiguity_data, ambiguity_of
from filippov.solving.selection.ambiguity import CORNER, REPELLING, VISIBLE
from filippov.solving.solution_tree import SolutionTree
from filippov.solving.state.events import Stop

mpl.use("Agg")
X, Y, Z = states("x y z")
TIGHT = {"rtol": 1e-11, "atol": 1e-13}


def tree_of(name: str, **options: Any) -> SolutionTree:
    item = case(name)
    options = {"t_span": item.t_span} | options
    return solve(item.system, item.x0, nonunique="branch", **TIGHT, **options)


def test_n01_three_solutions_and_the_interval_between_them() -> None:
    tree = tree_of("N01_sign_from_zero", release_times=4)
    assert tree.status is Status.SUCCESS
    assert len(tree.paths()) == 3 + 2 * 4
    assert {branch.ambiguity.name for branch in tree.branches if branch.ambiguity} == {REPELLING}
    for path in tree.paths():
        release = next((s.t0 for s in path.segments if s.mode != (0,)), 1.0)
        side = path.end_mode[0]
        times = np.linspace(0, 1, 21)
        np.testing.assert_allclose(path.sol(times)[0], side * np.maximum(times - release, 0), atol=1e-12)
    reached = tree.reachable(1)
    assert reached.complete
    assert (reached.low[0], reached.high[0]) == pytest.approx((-1, 1), abs=1e-12)
    np.testing.assert_allclose(np.sort(reached.x[:, 0]), np.linspace(-1, 1, 11), atol=1e-12)


def test_n02_two_fold_at_the_end_of_sliding() -> None:
    tree = tree_of("N02_visible_visible_two_fold", release_times=[1.25, 1.5])
    assert tree.root.t1 == pytest.approx(1, abs=1e-12)
    assert tree.root.solution.status is Status.NON_UNIQUE
    assert tree.root.solution.ambiguity.name == VISIBLE
    assert [c.mode for c in tree.root.solution.candidates] == [(1,), (-1,), (0,)]
    assert len(tree.paths()) == 7
    for path in tree.paths():
        tau = path.segments[-1].t0 - 1 if path.end_mode != (0,) else 1.0
        x, y = path.sol(np.linspace(0, 2, 21))
        np.testing.assert_allclose(x, np.linspace(-1, 1, 21), atol=1e-12)
        off = np.maximum(x**2 - tau**2, 0) * (x > 0) / 2
        np.testing.assert_allclose(y, path.end_mode[0] * off, atol=1e-9)
    at_two = tree.reachable(2)
    assert (at_two.low[1], at_two.high[1]) == pytest.approx((-0.5, 0.5), abs=1e-8)
    first = tree.path(1).events[0]
    assert (first.kind, first.direction, first.t) == ("sliding exit", 1, pytest.approx(1, abs=1e-12))
    assert first.note.startswith("visible two-fold, one of 3: +; -; 0")


def test_n04_reachable_states_lie_on_two_segments() -> None:
    tree = tree_of("N04_repelling_plane", release_times=5)
    x, y = tree.reachable(3).x.T
    tau = np.where(x > 0, 3 - 2 * x, 3 + x)
    np.testing.assert_allclose(y, np.where(x > 0, tau / 3 + (3 - tau), tau / 3 - (3 - tau)), atol=1e-9)
    np.testing.assert_allclose(np.unique(tau.round(9)), np.linspace(0, 3, 7), atol=1e-8)
    ends = {tuple(np.round(row, 8) + 0.0) for row in tree.reachable(3).x}
    assert {(0.0, 1.0), (1.5, 3.0), (-3.0, -3.0)} <= ends


def test_n05_all_three_after_the_two_fold_in_time() -> None:
    """Off x = 0: x' = -1000 (x - cos t) above, 1000 (x - cos t) below, both linear."""
    tree = tree_of("N05_time_dependent_two_fold", t_span=(0, 4.73))
    start, end = 1.5 * np.pi, 4.73
    assert tree.root.t1 == pytest.approx(start, abs=1e-10)
    assert tree.success
    a = 1000.0

    def linear(k: float) -> float:
        """x' = -k (x - cos t) from x(start) = 0."""
        forced = [k * (k * np.cos(u) + np.sin(u)) / (k * k + 1) for u in (start, end)]
        return float(forced[1] - forced[0] * np.exp(-k * (end - start)))

    leaves = {leaf.mode: leaf.solution.x_end[0] for leaf in tree.leaves()}
    assert leaves["0"] == 0
    assert leaves["+"] == pytest.approx(linear(a), rel=1e-7)
    assert leaves["-"] == pytest.approx(linear(-a), rel=1e-6)


def test_n05_staying_goes_on_to_the_end() -> None:
    item = case("N05_time_dependent_two_fold")
    got = solve(item.system, item.x0, item.t_span, nonunique="stick", **TIGHT)
    assert got.success
    assert len(got.events) == 1
    assert got.x_end[0] == 0


@pytest.mark.parametrize("name", ["N06_codim2_ambiguous_exit", "C05_two_codim2_sliding_modes"])
def test_n06_c05_two_corner_slidings_and_an_exit(name: str) -> None:
    tree = tree_of(name, t_span=(0, 1))
    assert [leaf.mode for leaf in tree.leaves()] == ["++", "00", "00"]
    assert tree.root.solution.ambiguity.name == CORNER
    ends = np.array(sorted(leaf.solution.x_end.tolist() for leaf in tree.leaves()))
    np.testing.assert_allclose(ends, [[0, 0, -1], [0, 0, 1], [0.75, 0.15, 2]], atol=1e-10)


def test_order_of_surfaces_is_irrelevant() -> None:
    ends = []
    for pair in ((X, Y), (Y, X)):
        surfaces = [Surface(str(q), q) for q in pair]
        system = System({X: sign(X), Y: 2 * sign(Y)}, surfaces=surfaces)
        tree = solve(system, (0, 0), (0, 1), nonunique="branch")
        ends.append(sorted(tuple(np.round(leaf.solution.x_end, 9) + 0.0) for leaf in tree.leaves()))
    assert ends[0] == ends[1]
    assert ends[0] == sorted((float(a), 2.0 * b) for a in (-1, 0, 1) for b in (-1, 0, 1))


def test_a_unique_solution_is_a_tree_without_branches() -> None:
    system = System({X: Y, Y: -X - 0.3 * sign(Y)})
    tree = solve(system, (2, 0), (0, 10), nonunique="branch")
    one = solve(system, (2, 0), (0, 10))
    assert tree.unique
    assert tree.success
    np.testing.assert_array_equal(tree.paths()[0].t, one.t)
    np.testing.assert_array_equal(tree.paths()[0].y, one.y)
    assert tree.paths()[0].modes == one.modes


def test_bounds_are_named() -> None:
    """x' = sign(x) sign(cos t): attracting and repelling in turn, a branching point every period."""
    system = System({X: sign(X) * sign(Y), Y: Z, Z: -Y}, surfaces=[Surface("x", X), Surface("clock", Y)])
    start = (0, 1, 0)
    few = solve(system, start, (0, 20), nonunique="branch", max_branches=4, max_depth=50)
    assert few.status is Status.BRANCHES
    assert not few.success
    assert len(few.leaves()) <= 4
    assert "max_branches = 4" in few.message
    assert "Raise max_branches" in few.message
    shallow = solve(system, start, (0, 20), nonunique="branch", max_depth=1)
    assert shallow.status is Status.BRANCHES
    assert "max_depth = 1" in shallow.message
    assert max(branch.depth for branch in shallow.branches) == 1
    cut = [leaf for leaf in shallow.leaves() if leaf.solution.status is Status.NON_UNIQUE]
    assert cut
    assert all(len(leaf.solution.candidates) == 3 for leaf in cut)


def test_budget_of_time_holds_for_the_tree() -> None:
    tree = solve(System({X: sign(X)}), (0,), (0, 1), nonunique="branch", release_times=20, max_time=1e-9)
    assert tree.status is Status.TIMEOUT or tree.success


@pytest.mark.parametrize(
    ("bad", "text"),
    [({"max_branches": 0}, "max_branches"), ({"max_depth": 1.5}, "max_depth"), ({"release_times": 0}, "rel"),
     ({"release_times": [0.5, 2]}, "release_times"), ({"release_times": "x"}, "release_times"),
     ({"t_eval": [0, 1]}, "t_eval"), ({"max_brnches": 3}, "max_branches")],
)  # fmt: skip
def test_bad_options_are_named(bad: dict[str, Any], text: str) -> None:
    with pytest.raises(UsageError, match=text):
        solve(System({X: sign(X)}), (0,), (0, 1), nonunique="branch", **bad)


def test_tree_options_need_the_tree() -> None:
    with pytest.raises(UsageError, match="need nonunique='branch'"):
        solve(System({X: sign(X)}), (0,), (0, 1), max_branches=3)


def test_policies() -> None:
    system = System({X: sign(X)})
    assert solve(system, (0,), (0, 1), nonunique="stick").x_end[0] == 0
    assert solve(system, (0,), (0, 1), nonunique=["-", "+"]).x_end[0] == pytest.approx(-1)
    assert solve(system, (0,), (0, 1), nonunique=("0", "+")).x_end[0] == 0
    # Two motions are equally far from sliding.
    assert solve(system, (0,), (0, 1), nonunique="slip").status is Status.NON_UNIQUE
    farthest = solve(system, (0,), (0, 1), nonunique=lambda found: max(found, key=lambda c: c.field[0]))
    assert farthest.x_end[0] == pytest.approx(1)
    assert solve(system, (0,), (0, 1), nonunique=lambda _: None).status is Status.NON_UNIQUE
    item = case("C05_two_codim2_sliding_modes")
    leave = solve(item.system, item.x0, (0, 1), nonunique="slip")
    np.testing.assert_allclose(leave.x_end, [0.75, 0.15, 2], atol=1e-10)
    # Two candidates have the mode 00: its name does not choose between them.
    assert solve(item.system, item.x0, (0, 1), nonunique=["00"]).status is Status.NON_UNIQUE
    assert solve(item.system, item.x0, (0, 1), nonunique=["++"]).success
    for bad in ("stik", ["+", "x"], ["++"], [], 3, [1]):
        with pytest.raises(UsageError, match="nonunique"):
            solve(system, (0,), (0, 1), nonunique=bad)


def test_terminal_events_count_along_a_path() -> None:
    """From x = 0 the clock y = sin(t) is crossed on every path; its second fall ends each."""
    system = System(
        {X: sign(X), Y: Z, Z: -Y}, surfaces=[Surface("x", X), Surface("clock", Y, kind="observer")]
    )
    tree = solve(
        system, (0, 0.5, 0), (0, 20), nonunique="branch", release_times=[3.0],
        stop=Stop("clock", "crossing down", 2),
    )  # fmt: skip
    assert tree.success
    assert {leaf.solution.status for leaf in tree.leaves()} == {Status.STOPPED}
    for path in tree.paths():
        assert path.t_end == pytest.approx(2.5 * np.pi, abs=1e-9)
        assert len(path.events.of("clock")) == 3


def test_path_joins_its_pieces() -> None:
    tree = tree_of("N02_visible_visible_two_fold", release_times=[1.5])
    path = next(p for p in tree.paths() if p.segments[-1].t0 == 1.5 and p.end_mode == (1,))
    assert path.modes == ("0", "+")
    assert np.all(np.diff(path.t) > 0)
    assert path.t[-1] == 2
    # The states at events are landed on by a step, the dense output is its polynomial: alike to rtol.
    np.testing.assert_allclose(path.y, path.sol(path.t), atol=1e-12)
    assert [event.group for event in path.events] == sorted({event.group for event in path.events})
    assert sum(segment.dwell for segment in path.segments) == pytest.approx(2, abs=1e-14)
    with pytest.raises(UsageError, match="outside"):
        path.sol(2.1)
    with pytest.raises(UsageError, match="no branch"):
        tree.reachable(2.1)


def test_a_repelling_line_with_a_drift_agrees_with_scipy_off_the_line() -> None:
    tree = solve(System({X: sign(X) + 0.5 * Y, Y: 0 * X - 1}), (0, 1), (0, 1), nonunique="branch")
    for leaf in tree.leaves():
        if leaf.mode == "0":
            continue
        s = leaf.chosen.mode[0]
        oracle = solve_ivp(lambda _, q, s=s: [s + 0.5 * q[1], -1.0], (0, 1), (0, 1), rtol=1e-11, atol=1e-13)
        np.testing.assert_allclose(leaf.solution.x_end, oracle.y[:, -1], atol=1e-8)


def test_graph_repr_and_files(tmp_path: Path) -> None:
    tree = tree_of("N04_repelling_plane", release_times=2)
    graph = tree.graph()
    assert sorted(graph.nodes) == list(range(len(tree.branches)))
    assert sum(1 for node in graph if graph.out_degree(node) == 0) == len(tree.leaves()) == 7
    assert graph.edges[0, 1] == {"t": 0.0, "at": "repelling sliding", "mode": "+"}
    assert repr(tree).splitlines()[0] == "SolutionTree(success; 7 solutions, 10 branches)"
    tree.save(tmp_path / "tree.npz")
    back = SolutionTree.load(tmp_path / "tree.npz")
    assert repr(back) == repr(tree)
    np.testing.assert_array_equal(back.reachable(2.2).x, tree.reachable(2.2).x)
    assert [b.ambiguity for b in back.branches] == [b.ambiguity for b in tree.branches]
    tree.root.solution.save(tmp_path / "root.npz")
    root = type(tree.root.solution).load(tmp_path / "root.npz")
    assert root.candidates == tree.root.solution.candidates
    with pytest.raises(UsageError, match="is no tree of solutions"):
        SolutionTree.load(tmp_path / "root.npz")
    with pytest.raises(UsageError, match="is no solution"):
        type(root).load(tmp_path / "tree.npz")
    cut = (tmp_path / "tree.npz").read_bytes()[:-2000]
    (tmp_path / "cut.npz").write_bytes(cut)
    with pytest.raises(UsageError, match="damaged"):
        SolutionTree.load(tmp_path / "cut.npz")


def test_ambiguities_that_were_written_with_their_earlier_name_are_read() -> None:
    point = tree_of("N04_repelling_plane", release_times=2).root.solution.ambiguity
    data = ambiguity_data(point)
    data["hit"] = data.pop("triggered")
    assert ambiguity_of(data) == point
    assert point.hit == point.triggered


def test_plots_show_every_branch() -> None:
    tree = tree_of("N02_visible_visible_two_fold", release_times=2)
    figure = tree.plot(states="y", title="two-fold")
    lines = figure.axes[0].lines
    assert len([line for line in lines if line.get_marker() in {"", "None"}]) == len(tree.branches)
    shown = tree.plot_tree()
    assert len(shown.axes[0].texts) == len(tree.branches)
    with pytest.raises(UsageError, match="unknown state"):
        tree.plot(states="w")
    mpl.pyplot.close("all")


def test_command_writes_the_tree(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "model.py"
    model.write_text(
        "from filippov import Problem, System, sign, states\n"
        "(x,) = states('x')\nleave = Problem(System({x: sign(x)}), x0=(0,), t_span=(0, 1))\n",
        encoding="utf-8",
    )
    base = ["simulate", f"{model}:leave"]
    out = tmp_path / "out"
    assert main([*base, "--nonunique", "branch", "--release-times", "1", "--json", "-o", str(out)]) == 0
    shown = capsys.readouterr()
    data = json.loads(shown.out)
    assert sorted(row["x_end"]["x"] for row in data["solutions"]) == pytest.approx([-1, -0.5, 0, 0.5, 1])
    assert "3: repelling sliding, 0 [0, 0.5]" in shown.err
    assert {p.name for p in out.iterdir()} == {
        "solutions.csv", "tree.json", "tree.npz", "branches.png", "tree.png"
    }  # fmt: skip
    assert len((out / "solutions.csv").read_text(encoding="utf-8").splitlines()) == 6
    assert len(SolutionTree.load(out / "tree.npz").leaves()) == 5
    assert main([*base, "--nonunique", "branch", "--max-branches", "2", "--quiet"]) == 1
    assert "branches: " in capsys.readouterr().err
    assert main([*base, "--nonunique=-,+", "--quiet"]) == 0
    assert main([*base, "--max-depth", "2"]) == 2
    assert "--max-depth needs --nonunique branch" in capsys.readouterr().err
    assert main([*base, "--nonunique", "slp"]) == 2
    assert "did you mean 'slip'" in capsys.readouterr().err
