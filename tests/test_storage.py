"""Files: what is read is what was written, and nothing else is read."""

from __future__ import annotations

import dataclasses
import io
import json
import math
import os
import pickle
import sys
import types
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

from filippov.base.errors import ModelError, UsageError
from filippov.io.storage import load, save
from filippov.io.stored_system import system_data, system_of
from filippov.model.comparator import Band, Hysteresis, Smooth
from filippov.model.parameter import Parameter
from filippov.model.parameter_symbol import parameters
from filippov.model.surface import Surface
from filippov.model.symbols import states, t
from filippov.model.system import System
from filippov.solving.solution import Solution
from filippov.solving.solver import solve
from filippov.solving.state.events import Stop

x, v, z = states("x v z")


def friction() -> System:
    p = parameters(m=1, k=Parameter(0.1, unit="N/m", lower=0, upper=9, description="spring"), Fs=2, Fc=1)
    surface = Surface("velocity", v, radius=p.Fs / p.Fc)
    return System({x: v, v: (-p.k * x - p.Fc * sp.sign(v) + 3 * sp.sin(t)) / p.m}, surfaces=[surface])


def plain() -> System:
    return System(
        field=lambda t, x, p, s: [x[1], -x[0] - p.mu * s[0]], surfaces=[Surface("velocity", lambda t, x,
        p: x[1])],
        states="x v", parameters={"mu": 0.3},
    )  # fmt: skip


def same(first: Any, second: Any) -> bool:
    if isinstance(first, np.ndarray):
        return isinstance(second, np.ndarray) and np.array_equal(first, second, equal_nan=True)
    if isinstance(first, float) and math.isnan(first):
        return isinstance(second, float) and math.isnan(second)
    return bool(first == second) and type(first) is type(second)


def test_13_4_a_solution_is_a_record_with_one_constructor() -> None:
    solution = solve(friction(), (1.0, 0.0), (0, 3))
    assert all(hasattr(solution, item.name) for item in dataclasses.fields(Solution))
    with pytest.raises(dataclasses.FrozenInstanceError):
        solution.message = "mine"  # type: ignore[misc]
    made = Solution(**{item.name: getattr(solution, item.name) for item in dataclasses.fields(Solution)})
    assert_equal(made, solution)
    assert dataclasses.replace(solution, message="mine").message == "mine"


def assert_equal(first: Solution, second: Solution) -> None:
    cached = {"segments", "jumps"}
    assert vars(first).keys() - cached == vars(second).keys() - cached
    assert first.segments == second.segments
    for name in ("status", "message", "success", "start_mode", "end_mode", "t_end", "x_end", "nfev",
                 "end_multipliers", "steps", "rejected", "t", "y", "njev", "nlu", "modes"):  # fmt: skip
        assert same(getattr(first, name), getattr(second, name)), name
    assert len(first.events) == len(second.events)
    for one, two in zip(first.events, second.events, strict=True):
        assert all(same(a, b) for a, b in zip(one, two, strict=True))
    for name in ("x0", "t_span", "p", "parameters"):
        assert same(getattr(first.problem, name), getattr(second.problem, name)), name
    assert first.system == second.system
    for name, value in vars(first.options).items():
        assert same(value, getattr(second.options, name)), name
    assert (first.sol is None) == (second.sol is None)
    if first.sol is not None and second.sol is not None:
        times = np.linspace(first.problem.t_span[0], first.t_end, 57)
        assert np.array_equal(first.sol(times), second.sol(times))
        assert np.array_equal(first.sol(times, "+"), second.sol(times, "+"))


OPTIONS: list[dict[str, Any]] = [
    {},
    {"t_eval": [0, 0.5, 7], "parameters": {"k": 0.3}, "atol": np.array([1e-9, 1e-10])},
    {"dense_output": False, "method": "DP5", "max_time": 100.0},
    {"stop": Stop("velocity", "sliding entry", 2)},
    {"max_steps": 5},
]


@pytest.mark.parametrize("options", OPTIONS)
@pytest.mark.parametrize("span", [(0.0, 12.0), (1.0, 1.0)])
def test_round_trip(options: dict[str, Any], span: tuple[float, float], tmp_path: Path) -> None:
    if span[0] == span[1] and "t_eval" in options:
        options = {**options, "t_eval": [1.0]}
    solution = solve(friction(), (1.0, 0.0), span, **options)
    path = solution.save(tmp_path / "no suffix")
    assert path == tmp_path / "no suffix"
    assert_equal(solution, Solution.load(path))
    assert_equal(solution, load(path, friction()))


def test_what_is_loaded_works_on(tmp_path: Path) -> None:
    solution = solve(friction(), (1.0, 0.0), (0, 12))
    read = load(save(solution, tmp_path / "a.npz"))
    assert np.array_equal(
        read.multiplier("velocity", [0.1, 3.0]), solution.multiplier("velocity", [0.1, 3.0])
    )
    again = solve(read.problem)
    assert np.array_equal(again.x_end, solution.x_end)
    assert read.system.parameters["k"].unit == "N/m"
    with pytest.raises(ModelError, match="outside its bounds"):
        read.problem.remake(parameters={"k": 10})


def test_backwards_and_failed_runs(tmp_path: Path) -> None:
    system = System({x: x**2})
    for span in ((0, 5), (0, -5)):
        solution = solve(system, (1.0,), span, backward=span[1] < 0)
        assert_equal(solution, load(save(solution, tmp_path / "a")))


def test_all_that_is_said_of_what_can_follow_comes_back(tmp_path: Path) -> None:
    solution = solve(System({x: sp.sign(x) - 2 * sp.sign(v), v: 2 * sp.sign(x) + sp.sign(v)}), (0, 0), (0, 1))
    assert solution.ambiguity is not None
    named = tuple(dataclasses.replace(q, undetermined=(0,), along=(1,)) for q in solution.candidates)
    ambiguity = dataclasses.replace(solution.ambiguity, candidates=named)
    for one in (solution, dataclasses.replace(solution, ambiguity=ambiguity)):
        assert load(save(one, tmp_path / "a.npz")).ambiguity == one.ambiguity


def test_policy_as_a_function_is_named_as_forgotten(tmp_path: Path) -> None:
    solution = solve(friction(), (1.0, 0.0), (0, 3), nonunique=lambda found: found[0])
    policy = load(save(solution, tmp_path / "a")).options.nonunique
    assert callable(policy)
    with pytest.raises(UsageError, match="not stored"):
        policy([])


# -- systems ---------------------------------------------------------------------------------------------

q = parameters(m=2, c=0.1, n=Parameter(3, lower=1))
SYSTEMS: dict[str, Callable[[], System]] = {
    "products": lambda: System(
        {x: -sp.sign(x) * (v + 0.1) * q.c, v: sp.Rational(1, 10) * sp.sqrt(2) * v**q.n}
    ),
    "select": lambda: System({x: sp.Piecewise((1 - x, x > v), (sp.exp(-x), True)), v: sp.Max(x, -x / 3) - v}),
    "nested": lambda: System({x: -sp.sign(v + abs(x - 1)), v: sp.sign(x + sp.sign(v) / 2)}),
    "modes": lambda: System.from_modes(
        [x - t, v], {"+*": [v, -x], "--": [-1, 1], "-+": [sp.pi, sp.E]}, (x, v)
    ),
    "constants": lambda: System(
        {x: sp.Max(q.c, q.m) * sp.sign(q.c - 1) * x + sp.Piecewise((q.m, q.c > 1), (1, True))}
    ),
    "names": lambda: System({sp.Symbol("I", real=True): -sp.sign(sp.Symbol("I", real=True))}),
    "observer": lambda: System({x: v, v: -x}, surfaces=[Surface("watch", x - 1, kind="observer")]),
    "band": lambda: friction().with_comparator(Band(0.01)),
    "smooth": lambda: friction().with_comparator(Smooth(0.01)),
    "hysteresis": lambda: friction().with_comparator(Hysteresis(0.01)),
    "asymmetric": lambda: System({x: -sp.sign(x)}, surfaces=[Surface("a", 2 * x, radius=(-1.5, q.m))]),
    "unevaluated": lambda: System({x: sp.Mul(2, x + v, evaluate=False), v: sp.Add(x, x, evaluate=False)}),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_systems_come_back_exactly(name: str) -> None:
    system = SYSTEMS[name]()
    data = system_data(system)
    assert data is not None
    read = system_of(json.loads(json.dumps(data)))
    assert read == system
    assert read.digest == system.digest
    assert read.surfaces == system.surfaces
    assert read.symbolic == system.symbolic
    assert read.comparator == system.comparator


def test_unknown_function_needs_the_system(tmp_path: Path) -> None:
    system = System({x: -sp.zeta(x + 3) + v, v: -x})
    assert system_data(system) is None


def test_plain_functions_need_the_system(tmp_path: Path) -> None:
    solution = solve(plain(), (1.0, 0.0), (0, 9))
    path = solution.save(tmp_path / "a.npz")
    with pytest.raises(UsageError, match=r"plain functions\. Give it: load\(path, system=\.\.\.\)"):
        load(path)
    assert np.array_equal(load(path, plain()).y, solution.y)
    other = System(
        field=lambda t, x, p, s: [0.0], surfaces=[Surface("velocity", lambda t, x, p: x[0])], states="y"
    )
    with pytest.raises(UsageError, match="with states x, v; the given system has y"):
        load(path, other)
    with pytest.raises(UsageError, match="another system"):
        load(path, friction())


def test_another_system_is_refused(tmp_path: Path) -> None:
    path = solve(friction(), (1.0, 0.0), (0, 1)).save(tmp_path / "a.npz")
    with pytest.raises(UsageError, match="another system: its digest is"):
        load(path, friction().with_comparator(Band(0.1)))
    with pytest.raises(UsageError, match="expected a System"):
        load(path, "friction")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="expected a Solution"):
        save("x", path)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "tree",
    [
        ["open", ["int", "1"]], ["Symbol", "x"], ["int", 3], ["int", "9" * 3000], ["x", -1], ["x", 7],
        ["float", [0, "1", 10**9, 1], 53],
        ["constant", "sys"], [], "x", ["Pow", ["int", "1"]], [["x", 0]], ["x", True], {"x": 0}, None,
    ],
)  # fmt: skip
def test_strange_expressions_are_refused(tree: Any) -> None:
    data = json.loads(json.dumps(system_data(System({x: -x}))))
    data["field"] = [tree]
    with pytest.raises(ModelError):
        system_of(data)


def test_reading_evaluates_nothing() -> None:
    """exp(10**9 log 2) would be a number of a billion bits if it were made afresh."""
    tree: Any = ["exp", ["Mul", ["int", "1000000000"], ["log", ["int", "2"]]]]
    deep: Any = ["x", 0]
    for _ in range(500):
        deep = ["sin", deep]
    data = json.loads(json.dumps(system_data(System({x: -x}))))
    data["field"] = [tree]
    assert system_of(data).dimension == 1
    data["field"] = [deep]
    with pytest.raises(ModelError, match="deeper than"):
        system_of(data)


# -- files that are not ours -----------------------------------------------------------------------------


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return solve(friction(), (1.0, 0.0), (0, 3)).save(tmp_path / "a.npz")


class Bomb:
    def __reduce__(self) -> Any:
        return os.abort, ()


def entries(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def rewrite(path: Path, content: dict[str, bytes], method: int = zipfile.ZIP_STORED) -> None:
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, data in content.items():
            archive.writestr(name, data)


def npy(array: np.ndarray[Any, Any]) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=True)
    return stream.getvalue()


def change_header(path: Path, **changes: Any) -> None:
    """Change entries; the sha256 that would tell of it is left out, as by one who knows the format."""
    content = entries(path)
    header = json.loads(np.load(io.BytesIO(content["header.npy"])).tobytes()) | changes
    header.pop("sha256", None)
    content["header.npy"] = npy(np.frombuffer(json.dumps(header).encode(), dtype=np.uint8))
    rewrite(path, content)


def test_other_format_version_names_both(path: Path) -> None:
    change_header(path, version=7, filippov="9.9")
    with pytest.raises(
        UsageError, match=r"format version 7, written by filippov '9\.9'.*reads format version 1"
    ):
        load(path)


@pytest.mark.parametrize(
    "changes",
    [
        {"format": "else"}, {"digest": "0" * 64}, {"status": "fine"}, {"options": {}}, {"notes": 3},
        {"system": {}},
        {"system": []}, {"start_mode": "x"},
        {"parameters": {"k": 100.0}}, {"states": ["a", "b"]}, {"dense": False}, {"t_end": 99.0},
        {"t_end": "nan"}, {"start_mode": [0, 0]}, {"end_mode": [5]},
    ],
)  # fmt: skip
def test_changed_headers_are_refused(path: Path, changes: dict[str, Any]) -> None:
    change_header(path, **changes)
    with pytest.raises(UsageError, match=r"a\.npz' (is|has|holds|does not hold) "):
        load(path)


NUMBERS: list[tuple[str, int, float]] = [
    ("t", 0, 7.0), ("y", 3, np.nan), ("x_end", 0, 1.0), ("event_t", 0, -1.0), ("event_numbers", 0, -1),
    ("event_numbers", 1, 99), ("event_after", 0, 2), ("event_before", 0, -7), ("sol_start", 1, -1.0),
    ("sol_step", 1, 0.0), ("sol_coef", 4, 1e9), ("event_values", 0, 0.5),
]  # fmt: skip


@pytest.mark.parametrize(("name", "place", "value"), NUMBERS)
def test_a_number_that_was_altered_is_refused(path: Path, name: str, place: int, value: float) -> None:
    content = entries(path)
    array = np.load(io.BytesIO(content[f"{name}.npy"]))
    array.flat[place] = value
    rewrite(path, content | {f"{name}.npy": npy(array)})
    with pytest.raises(UsageError, match=r"a\.npz' was altered since it was written"):
        load(path)
    # Of a file that says no sha256, what cannot be.
    change_header(path)
    if name.startswith(("event_n", "event_a", "event_b", "sol_st")):
        with pytest.raises(UsageError, match=r"a\.npz' is incomplete or damaged"):
            load(path)


@pytest.mark.parametrize(
    "changes", [{"message": "all is well"}, {"nfev": 1}, {"parameters": {"k": 0.2}}, {"shaun": 1}]
)
def test_a_text_that_was_altered_is_refused(path: Path, changes: dict[str, Any]) -> None:
    content = entries(path)
    header = json.loads(np.load(io.BytesIO(content["header.npy"])).tobytes()) | changes
    content["header.npy"] = npy(np.frombuffer(json.dumps(header).encode(), dtype=np.uint8))
    rewrite(path, content)
    with pytest.raises(UsageError, match=r"a\.npz' was altered since it was written"):
        load(path)


def test_pickles_are_not_opened(path: Path) -> None:
    for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1):
        path.write_bytes(pickle.dumps(Bomb(), protocol))
        with pytest.raises(UsageError, match="is a pickle"):
            load(path)
    path.write_bytes(pickle.dumps(Bomb(), 0))
    with pytest.raises(UsageError, match="expected a zip archive"):
        load(path)


def test_object_arrays_are_not_unpickled(path: Path) -> None:
    good = entries(path)
    for name in ("header", "t", "event_values"):
        rewrite(path, good | {f"{name}.npy": npy(np.array([Bomb()], dtype=object))})
        with pytest.raises(UsageError, match=r"no plain array \(type '\|O'"):
            load(path)


def test_other_archives_are_refused(path: Path) -> None:
    good = entries(path)
    rewrite(path, {"readme.txt": b"hello"})
    with pytest.raises(UsageError, match="holds no 'header'"):
        load(path)
    np.savez(path, t=np.zeros(3))
    with pytest.raises(UsageError, match="holds no 'header'"):
        load(path)
    rewrite(path, good, zipfile.ZIP_DEFLATED)
    with pytest.raises(UsageError, match="compressed"):
        load(path)
    rewrite(path, good | {"more.npy": npy(np.zeros(1))})
    with pytest.raises(UsageError, match="more differ"):
        load(path)
    path.write_bytes(b"")
    with pytest.raises(UsageError, match="expected a zip archive"):
        load(path)
    with pytest.raises(FileNotFoundError):
        load(path.with_name("nothing"))


def test_array_headers_do_not_ask_for_memory(path: Path) -> None:
    good = entries(path)
    huge = io.BytesIO()
    np.lib.format.write_array_header_1_0(huge, {"descr": "<f8", "fortran_order": False, "shape": (10**14,)})
    rewrite(path, good | {"t.npy": huge.getvalue() + bytes(8)})
    with pytest.raises(UsageError, match="does not fit its 8 bytes"):
        load(path)
    rewrite(path, good | {"t.npy": npy(np.zeros(2))})
    change_header(path)
    with pytest.raises(UsageError, match="incomplete or damaged"):
        load(path)


def test_every_flipped_byte_of_data_is_noticed(path: Path) -> None:
    content = path.read_bytes()
    with zipfile.ZipFile(path) as archive:
        infos = [info for info in archive.infolist() if info.file_size > 200]
    for info in infos:
        place = info.header_offset + 30 + len(info.filename) + info.file_size // 2 + 40
        path.write_bytes(content[:place] + bytes([content[place] ^ 1]) + content[place + 1 :])
        with pytest.raises(UsageError, match="damaged"):
            load(path)
    path.write_bytes(content[: len(content) // 2])
    with pytest.raises(UsageError, match="damaged or cut off"):
        load(path)


def test_large_files_are_refused(path: Path) -> None:
    with pytest.raises(UsageError, match="more than max_bytes = 100"):
        load(path, max_bytes=100)


def test_a_write_that_fails_leaves_the_old_file(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = path.read_bytes()
    solution = solve(friction(), (1.0, 0.0), (0, 5))

    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left"):
        solution.save(path)
    assert path.read_bytes() == before
    assert [item.name for item in path.parent.iterdir()] == [path.name]


# -- xarray ----------------------------------------------------------------------------------------------


def test_without_xarray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(ImportError, match=r"pip install filippov\[tables\]"):
        solve(friction(), (1.0, 0.0), (0, 1)).to_xarray()


def test_what_xarray_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in = types.SimpleNamespace(Dataset=lambda variables, coords, attrs: (variables, coords, attrs))
    monkeypatch.setitem(sys.modules, "xarray", stand_in)
    solution = solve(friction(), (1.0, 0.0), (0, 12))
    variables, coordinates, attributes = solution.to_xarray()
    assert np.array_equal(variables["v"][1], solution.y[1])
    assert np.array_equal(coordinates["event_t"][1], solution.events.t)
    assert list(variables["event_kind"][1]) == [str(event.kind) for event in solution.events]
    assert attributes["unit_k"] == "N/m"
    assert attributes["parameter_k"] == 0.1
