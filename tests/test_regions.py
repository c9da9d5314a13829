"""Regions over two parameters and basins over two states, against what is known of the hunting loop."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command import summary
from scipy.optimize import brentq

from filippov import Surface, System, UsageError, parameters, solve, states
from filippov.analysis.diagrams.basin import basin
from filippov.analysis.diagrams.bifurcation import bifurcation
from filippov.analysis.diagrams.regions import regions
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.analysis.steady.rest_map import growth, rest_map
from filippov.models import get
from filippov.models.static_cycle import static_cycles
from filippov.plot import plot_regions

MODEL = get("hunting")
SYSTEM, SECTION = MODEL.build(), Section.from_model(MODEL)
FOLD, CHANGE = 21.0149797699, 26.6019490377


def test_cells_on_both_sides_of_the_known_borders() -> None:
    gains = [10.0, FOLD * 0.9999, FOLD * 1.0001, CHANGE * 0.998, CHANGE * 1.002, 31.0]
    found = regions(SYSTEM, SECTION, ("P", gains), ("beta", [0.5, 1.0, 2.0]), (0, 0.5))
    # beta = 2: two cycles up to the fold; beta = 1: one up to the change of stability; 0.5: always one.
    assert found.cycles.tolist() == [[1] * 6, [1, 1, 1, 1, 0, 0], [2, 2, 0, 0, 0, 0]]
    assert found.stable.tolist() == [[1] * 6, [1, 1, 1, 1, 0, 0], [1, 1, 0, 0, 0, 0]]
    assert found.set_stable.tolist() == [[False] * 6, [False] * 4 + [True] * 2, [True] * 6]
    # Fixed points at P = 10 from Gauss collocation and from scipy on the slip phase.
    wanted = [0.1785896912487, 0.231364108103, 0.252304806412]
    np.testing.assert_allclose(found.amplitude[:, 0], wanted, rtol=1e-7)
    assert found.complete
    assert found.text(2, 0) == "2 cycles, 1 stable; set of equilibria stable"


def test_static_friction_has_one_stable_cycle_of_the_algebraic_size() -> None:
    model = get("hunting_static")
    gains = [10.0, 20.0, 31.0]
    found = regions(model.build(), Section.from_model(model), ("P", gains), ("I", [10.0]), (0, 0.5))
    assert found.cycles.tolist() == found.stable.tolist() == [[1, 1, 1]]
    wanted = [static_cycles(m=1, P=g, D=1, I=10, Fs=4, Fc=2, b=1)[0].d for g in gains]
    np.testing.assert_allclose(found.amplitude[0], wanted, rtol=1e-6)
    assert not found.set_stable.any()


def test_12_5_what_lies_on_the_border_is_neither_stable_nor_unstable() -> None:
    """d -> k d + m (d - 1)(2 - d) d (d + 3): slopes in closed form at 0, 1 and 2, for k = 1."""
    u, z = states("u z")
    p = parameters(k=1, m=0.1)
    image = p.k * u + p.m * (u - 1) * (2 - u) * u * (u + 3)
    tick = Surface("tick", z - 1, reset={u: image, z: 0 * z}, side="-")
    system = System({u: 0 * u, z: 1 + 0 * z}, surfaces=[tick], parameters=p)
    section = Section("tick", "reset", "u", {"u": "d", "z": 0}, t_max=5)
    # Slopes at 1 and 2: 1 + 4 m and 1 - 10 m, which is -1 at m = 0.2; at 0: 1 - 6 m.
    m = [-0.4, 0.05, 0.1999, 0.2, 0.2001, 1 / 3, 0.3334]
    found = regions(system, section, ("m", m), ("k", [1.0, 1.0]), (0, 2.5), order=1)
    assert found.cycles[0].tolist() == [2] * 7
    assert found.stable[0].tolist() == [int(abs(1 + 4 * q) < 1) + int(-1e-9 < q < 0.2) for q in m]
    assert found.undecided[0].tolist() == [0, 0, 0, 1, 0, 0, 0]
    assert found.set_verdict[0].tolist() == [
        "unstable", "stable", "stable", "stable", "stable", "undecided", "unstable",
    ]  # fmt: skip
    assert found.text(0, 3) == "2 cycles, 0 stable, 1 undecided; set of equilibria stable"
    plot_regions(replace(found, y=np.array([1.0, 2.0])))


def test_rows_that_an_interrupt_left_out_are_marked() -> None:
    def stop(done: int, total: int) -> None:
        raise KeyboardInterrupt

    found = regions(SYSTEM, SECTION, ("P", [10.0]), ("I", [9.0, 10.0]), (0, 0.5), progress=stop)
    assert not found.complete
    assert found.cycles.tolist() == [[2], [-1]]
    assert found.text(1, 0) == "not computed"


def test_basin_labels_agree_with_long_runs() -> None:
    x, v = np.linspace(-0.3, 0.3, 7), np.linspace(-1.0, 1.0, 5)
    found = basin(SYSTEM, SECTION, ("x", x), ("v", v), (-0.6, 0.6), at={"z": 0.01})
    assert sorted(found.attractors) == pytest.approx([0.0, 0.252304806], abs=1e-9)
    for i, speed in enumerate(v):
        for j, place in enumerate(x):
            run = solve(SYSTEM, (place, speed, 0.01), (0, 120), rtol=1e-8)
            size = np.max(np.abs(run.sol(np.linspace(115, 120, 60))[0]))
            cycle = found.attractors[found.label[i, j]] > 0
            assert (size > 0.1) == cycle
    assert sum(found.shares.values()) == pytest.approx(1)


def test_states_on_their_way_to_rest() -> None:
    """In stick with |u| < Fs and x = 0 nothing moves again; inside the unstable cycle motion dies out."""
    found = basin(SYSTEM, SECTION, ("x", [-0.002, 0.002]), ("z", [0.0]), (-0.6, 0.6))
    assert [found.attractors[k] for k in found.label.ravel()] == [0.0, 0.0]


def test_the_map_has_the_symmetry_of_the_loop() -> None:
    x, v = np.linspace(-0.3, 0.3, 8), np.linspace(-1.5, 1.5, 6)
    found = basin(SYSTEM, SECTION, ("x", x), ("v", v), (-0.6, 0.6))
    np.testing.assert_array_equal(found.label, found.label[::-1, ::-1])
    np.testing.assert_allclose(found.d, -found.d[::-1, ::-1], atol=1e-7)


def test_the_engine_of_sweeps_gives_the_same_pictures(tmp_path: Path) -> None:
    gains, widths = [10.0, 20.0, 21.5, 27.0], [0.5, 1.0, 2.0]
    plain = regions(SYSTEM, SECTION, ("P", gains), ("beta", widths), (0, 0.5))
    states = (("x", np.linspace(-0.3, 0.3, 9)), ("v", np.linspace(-1, 1, 8)))
    flow = basin(SYSTEM, SECTION, *states, (-0.5, 0.5))
    with ThreadPoolExecutor(1) as pool:
        engine = {"folder": tmp_path / "regions", "executor": pool, "jobs": 1}
        stored = regions(SYSTEM, SECTION, ("P", gains), ("beta", widths), (0, 0.5), engine=engine)
        next((tmp_path / "regions/chunks").glob("*.npz")).unlink()
        again = regions(
            SYSTEM, SECTION, ("P", gains), ("beta", widths), (0, 0.5), engine={**engine, "resume": True}
        )
        kept = basin(SYSTEM, SECTION, *states, (-0.5, 0.5), engine={"executor": pool})
        setting = {"parameter": "P", "values": [18, 20, 22], "interval": (0.0, 0.5), "points": 100}
        diagram = bifurcation(SYSTEM, SECTION, **setting, engine={"executor": pool})  # type: ignore[arg-type]
    assert stored.cycles.tolist() == again.cycles.tolist() == plain.cycles.tolist()
    assert stored.stable.tolist() == plain.stable.tolist()
    assert stored.set_stable.tolist() == plain.set_stable.tolist()
    np.testing.assert_allclose(stored.amplitude, plain.amplitude, rtol=1e-7)
    np.testing.assert_array_equal(again.amplitude, stored.amplitude)
    np.testing.assert_array_equal(kept.label, flow.label)
    np.testing.assert_allclose(kept.d, flow.d, atol=1e-7)
    assert diagram == bifurcation(SYSTEM, SECTION, **setting)  # type: ignore[arg-type]


def test_bad_requests_are_named() -> None:
    with pytest.raises(UsageError, match="did you mean 'P'"):
        regions(SYSTEM, SECTION, ("p", [1.0]), ("I", [1.0]), (0, 0.5))
    with pytest.raises(UsageError, match="two parameters"):
        regions(SYSTEM, SECTION, ("P", [1.0]), ("P", [1.0]), (0, 0.5))
    with pytest.raises(UsageError, match="unknown state 'y'"):
        basin(SYSTEM, SECTION, ("x", [0.0]), ("y", [0.0]), (-0.5, 0.5))
    with pytest.raises(UsageError, match="two states"):
        basin(SYSTEM, SECTION, ("x", [0.0]), ("v", [0.0]), (-0.5, 0.5), at={"x": 1})


def test_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    common = ["--cells", "3", "-o", str(tmp_path / "r")]
    data = summary(capsys, "regions", "hunting", "--over", "P=10:30", "--over", "I=8:12", *common)
    assert data["cycles"][0][0] == 2
    common = ["--cells", "5", "-o", str(tmp_path / "b")]
    data = summary(capsys, "basin", "hunting", "--over", "x=-0.2:0.2", "--over", "v=-1:1", *common)
    assert data["shape"] == [5, 5]
    assert {p.name for p in (tmp_path / "r").iterdir()} == {"regions.json", "regions.csv", "regions.png"}
    assert {p.name for p in (tmp_path / "b").iterdir()} == {"basin.json", "basin.npz", "basin.png"}
    with np.load(tmp_path / "b" / "basin.npz", allow_pickle=False) as stored:
        assert stored["label"].shape == (5, 5)




def test_exact_borders_against_the_return_map_and_the_fold() -> None:
    def factor(P: float, I: float) -> float:
        return growth([rest_map([1.0, P + 1, P, P * I])]) - 1

    axes = ("P", np.linspace(4, 31, 7)), ("I", np.linspace(8, 12, 3))
    found = regions(SYSTEM, SECTION, *axes, (0, 0.5), points=16, borders="exact")
    (name, fold), (other, change) = found.borders
    assert (name, other) == ("fold of two cycles", "set changes stability")
    for P, I in change:
        assert abs(P - brentq(factor, 0.5, 25, args=(I,))) < 1e-7
    assert fold[0, 1] == 8
    assert fold[-1, 1] == 12
    second = EventMap(SYSTEM, SECTION, order=2, parameters={"I": float(fold[0, 1])})
    # On both sides of the fold: two cycles, and none.
    beside = [second.remake(parameters={"P": float(fold[0, 0]) + s}) for s in (-0.05, 0.05)]
    count = [len(side.fixed_points(1e-4, 0.2, 60)) for side in beside]
    assert count == [2, 0]
    with pytest.raises(UsageError, match="'exact' or curves"):
        regions(SYSTEM, SECTION, *axes, (0, 0.5), borders="all")
