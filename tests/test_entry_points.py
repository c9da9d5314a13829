"""The border between Python and machine code: read from the kernels, checked at every call."""

import ast
from pathlib import Path

import numpy as np
import pytest

import filippov.kernel as kernels
from filippov.kernel.codegen.entries import ARGUMENTS, ordered
from filippov.kernel.language.primitives import KernelError
from filippov.kernel.loop.state import Clock, Trajectories, Trajectory

FILES = sorted(Path(kernels.__path__[0]).rglob("*.py"))


def test_13_3_the_entry_points_are_the_kernels_marked_so() -> None:
    marked = {
        node.name
        for path in FILES
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef) and "entry" in map(ast.unparse, node.decorator_list)
    }
    assert marked == set(ARGUMENTS) >= {"advance", "ensemble", "lane_run", "rhs", "probe"}


@pytest.mark.parametrize("name", ARGUMENTS)
def test_13_3_the_description_is_that_of_the_kernel(name: str) -> None:
    """Names, kinds and order; those of a system are declared in `model`."""
    found = [
        [(a.arg, ast.unparse(a.annotation)) for a in node.args.args if a.annotation]
        for path in FILES
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef) and node.name == name and node.decorator_list
    ]
    assert found == [list(ARGUMENTS[name])]


def test_13_3_a_wrong_name_or_kind_is_refused() -> None:
    values = {
        "t": 0.0, "x": np.zeros(2), "p": np.zeros(1), "m": np.ones(1), "out": np.zeros(1),
        "ctx": np.zeros(8, dtype=np.int64),
    }  # fmt: skip
    assert ordered("guards", values, id) == [0.0, *(id(values[k]) for k in ("x", "p", "m", "out", "ctx"))]
    with pytest.raises(KernelError, match="s given too much or missing"):
        ordered("guards", values | {"s": np.ones(1)}, id)
    with pytest.raises(KernelError, match="ctx given too much or missing"):
        ordered("guards", {k: v for k, v in values.items() if k != "ctx"}, id)
    for name, wrong in (("x", np.zeros(2, dtype=np.int64)), ("ctx", np.zeros(8)), ("t", np.zeros(1))):
        with pytest.raises(KernelError, match=f"{name} is an array of"):
            ordered("guards", values | {name: wrong}, id)


def test_13_3_a_record_is_no_other_record_and_no_array() -> None:
    run = Trajectory.new()
    assert ordered("advance", {"run": run}, None) == [run]
    assert ordered("advance", {"run": run}, id) == [id(run.array)]
    for wrong in (Clock.new(), np.zeros(Trajectory.size, dtype=np.int64), 0):
        with pytest.raises(KernelError, match="run is a"):
            ordered("advance", {"run": wrong}, id)
    mine, batch = np.zeros(3, dtype=np.int64), Trajectories.new()
    values = {"steps": 1, "last": 2, "mine": mine, "batch": batch, "run": run}
    assert len(ordered("ensemble", values, id)) == 5
    with pytest.raises(KernelError, match="batch is a Trajectory, expected Trajectories"):
        ordered("ensemble", values | {"batch": run}, id)
