"""Points of a sweep: a grid is an array that is made where it is read; ten million take little memory."""

from __future__ import annotations

import math
import pickle
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import qmc
from sweep_case import decay, serial

from filippov import Problem, Sweep, System, parameters, states
from filippov.sweep.dataset import load_table, to_xarray
from filippov.sweep.manifest import Manifest
from filippov.sweep.points import Grid, digest_of, extremes
from filippov.sweep.samples import sample
from filippov.sweep.store import Store
from filippov.sweep.table import SweepTable

AXES = st.lists(st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=5), min_size=1, max_size=4)


def product(axes: list[list[float]]) -> Any:
    """All combinations, the last axis fastest, by numpy."""
    return np.column_stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")])


@given(axes=AXES, data=st.data())
def test_a_grid_reads_as_the_array_of_all_combinations(axes: list[list[float]], data: Any) -> None:
    grid, whole = Grid(tuple(np.array(axis) for axis in axes)), product(axes)
    count, width = whole.shape
    assert (grid.shape, len(grid)) == (whole.shape, count)
    rows = st.integers(-count, count - 1)
    index = np.array(data.draw(st.lists(rows, max_size=9)), dtype=np.int64)
    k, one, cut = data.draw(st.integers(0, width - 1)), data.draw(rows), data.draw(st.slices(count))
    for key in (one, index, cut, (slice(None), k), (index, k), (one, k), (cut, k), whole[:, 0] > 0):
        assert np.array_equal(grid[key], whole[key])
    assert np.array_equal(np.asarray(grid), whole)
    assert grid.tolist() == whole.tolist()
    for k in range(width):
        assert extremes(grid, k) == extremes(whole, k) == (whole[:, k].min(), whole[:, k].max())
    for outside in (count, -count - 1):
        with pytest.raises(IndexError):
            grid[outside]


@given(axes=AXES, other=AXES)
def test_other_points_have_another_digest(axes: list[list[float]], other: list[list[float]]) -> None:
    one, two = (Grid(tuple(np.array(axis) for axis in a)) for a in (axes, other))
    same = [np.array(a).tobytes() for a in axes] == [np.array(a).tobytes() for a in other]
    assert (digest_of(one) == digest_of(two)) == same


@settings(max_examples=20)
@given(n=st.integers(1, 3000), dimension=st.integers(1, 4), seed=st.integers(0, 99))
def test_drawn_points_are_those_of_scipy(n: int, dimension: int, seed: int) -> None:
    box = {f"p{k}": (-k - 1.0, 2.0 * k + 1) for k in range(dimension)}
    ends = np.array(list(box.values()))
    power = math.ceil(math.log2(n))
    of = {
        "sobol": qmc.Sobol(dimension, rng=np.random.default_rng(seed)).random_base2(power)[:n],
        "latin_hypercube": qmc.LatinHypercube(dimension, rng=np.random.default_rng(seed)).random(n),
    }
    for name, u in of.items():
        assert np.array_equal(sample(box, name, n, seed), ends[:, 0] + (ends[:, 1] - ends[:, 0]) * u)


def peak(call: Any) -> tuple[Any, float]:
    """What a call returns, and the most memory it had at a time, in MB."""
    tracemalloc.start()
    try:
        return call(), tracemalloc.get_traced_memory()[1] / 1e6
    finally:
        tracemalloc.stop()


def plane() -> Problem:
    x, v = states("x v")
    p = parameters(a=1.0, b=1.0, c=1.0)
    return Problem(System({x: v, v: -p.a * x - p.b * v - p.c}), (1.0, 0.0), (0, 1))


def test_11_22_ten_million_points_are_planned_in_little_memory(tmp_path: Path) -> None:
    a, b, c = np.linspace(1, 2, 1000), np.linspace(1, 2, 1000), np.linspace(1, 2, 10)
    plane()

    def planned() -> tuple[Sweep, Manifest]:
        sweep = Sweep(plane(), {"a": a, "b": b, "c": c}, measure=["end"])
        return sweep, Manifest.of(sweep)

    (sweep, manifest), most = peak(planned)
    assert manifest.size == len(sweep.points) == 10_000_000
    assert most < 50
    assert len(pickle.dumps(sweep)) < 1_000_000  # what each worker is sent
    store = Store(tmp_path, sweep)
    _, most = peak(lambda: store.begin(False, False))
    assert most < 50
    assert (tmp_path / "points.npz").stat().st_size < 100_000
    # Its rows: two columns of results, one status and one mark each.
    table, most = peak(store.read)
    assert most < 300
    assert isinstance(table, SweepTable)
    rows = np.array([0, 12_345, 9_999_999])
    assert np.array_equal(sweep.points[rows, 1], b[rows // 10 % 1000])


@pytest.mark.parametrize("samples", ["sobol", "latin_hypercube"])
def test_11_22_ten_million_drawn_points_are_little_more_than_themselves(samples: str) -> None:
    box = {"k": (1, 2), "x0.x": (1, 2)}  # 160 MB

    def planned() -> str:
        return Manifest.of(Sweep(decay(), box, samples, n=10_000_000)).points

    planned_, most = peak(planned)
    assert len(planned_) == 64
    assert most < 300


def test_a_table_read_back_knows_the_shape_of_its_grid(tmp_path: Path) -> None:
    table = serial(Sweep(decay(), {"k": [1, 2, 3], "x0.x": [1, 2]}), tmp_path)
    kept = load_table(tmp_path)
    assert kept.shape == table.shape == (3, 2)
    assert kept.content_hash == table.content_hash
    if pytest.importorskip("xarray"):
        assert dict(to_xarray(kept).sizes) == {"k": 3, "x0.x": 2}
