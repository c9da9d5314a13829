"""The compiler of the kernel language: same numbers as Python, root isolation."""

import ctypes
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from filippov.kernel.language.compiler import compile_unit, load_objects
from filippov.kernel.language.primitives import KernelError
from filippov.kernel.language.unit import Unit, add_kernels
from filippov.kernel.loop import dense
from filippov.kernel.loop.roots import bernstein
from filippov.kernel.tables import root_tables as tables

ROOM = tables.DEPTH + 3
WRAPPERS = """
@kernel
def value(c: Vector, out: Vector) -> int:
    out[0] = bernstein_value(c, truncate(out[1]), out[2], shift(out, 4))
    return 0

@kernel
def root(c: Vector, out: Vector) -> int:
    kind, u = first_root(c, truncate(out[1]), out[2], shift(out, 100), shift(out, 2000), shift(out, 4))
    out[0] = u
    return kind

@kernel
def divide(c: Vector, out: Vector) -> int:
    return deflate(c, truncate(out[1]))

@kernel
def linear(c: Vector, out: Vector) -> int:
    if solve_linear(c, out, 3, 3):
        return 1
    return 0
"""


def compiled(
    text: str, names: tuple[str, ...], constants: dict[str, Any] | None = None
) -> tuple[Any, dict[str, Any]]:
    unit = Unit()
    for module in (tables, dense):
        unit.constants.update(
            {k: v for k, v in vars(module).items() if k.isupper() and isinstance(v, int | float | list)}
        )
    add_kernels(unit, Path(bernstein.__file__).read_text(encoding="utf-8"))
    add_kernels(unit, Path(dense.__file__).read_text(encoding="utf-8"))
    add_kernels(unit, text)
    engine = load_objects(compile_unit(unit, constants or {}, names))
    kind = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_void_p, ctypes.c_void_p)
    return engine, {name: kind(engine.get_function_address(name)) for name in names}


ENGINE, KERNELS = compiled(WRAPPERS, ("value", "root", "divide", "linear"))
numbers = st.floats(-10, 10)
coefficients = st.lists(numbers, min_size=9, max_size=9)


def call(name: str, c: np.ndarray, *arguments: float) -> tuple[int, np.ndarray]:
    out = np.zeros(4000)
    out[1 : 1 + len(arguments)] = arguments
    return KERNELS[name](c.ctypes.data, out.ctypes.data), out


def scratch() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    return np.zeros(ROOM * tables.NODES), np.zeros(2 * ROOM), np.zeros(tables.NODES)


@given(coefficients, st.floats(0, 1))
def test_value_is_the_same_compiled(c: list[float], u: float) -> None:
    row = np.array(c)
    _, out = call("value", row, 8, u)
    assert out[0] == bernstein.bernstein_value(row, 8, u, np.zeros(9))


@given(coefficients, st.sampled_from([0.0, 1e-6]))
def test_first_root_is_the_same_compiled(c: list[float], touch: float) -> None:
    row = np.array(c)
    row[0] = abs(row[0]) + 1e-3
    kind, out = call("root", row, 8, touch)
    assert (kind, out[0]) == bernstein.first_root(row, 8, touch, *scratch())


@given(coefficients, st.integers(0, 4))
def test_deflation_divides_by_the_power(c: list[float], order: int) -> None:
    row = np.array(c)
    row[:order] = 0
    whole, u = row.copy(), 0.37
    other = row.copy()
    degree, _ = call("divide", row, order)
    assert degree == 8 - order == bernstein.deflate(other, order)
    np.testing.assert_array_equal(row[: degree + 1], other[: degree + 1])
    work = np.zeros(9)
    left = bernstein.bernstein_value(row, degree, u, work) * u**order
    assert left == pytest.approx(bernstein.bernstein_value(whole, 8, u, work), abs=1e-11)


@given(st.lists(numbers, min_size=9, max_size=9), st.lists(numbers, min_size=3, max_size=3))
def test_linear_solve_is_the_same_compiled(a: list[float], b: list[float]) -> None:
    one, two = np.array(a), np.array(a)
    out = np.zeros(4000)
    out[:3] = b
    right = np.array(b)
    done = bool(KERNELS["linear"](one.ctypes.data, out.ctypes.data))
    with np.errstate(all="ignore"):  # machine code has no warnings
        assert done == bool(dense.solve_linear(two, right, 3, 3))
    if done and np.linalg.cond(np.array(a).reshape(3, 3)) < 1e8:
        np.testing.assert_array_equal(out[:3], right)
        np.testing.assert_allclose(right, np.linalg.solve(np.array(a).reshape(3, 3), b), rtol=1e-6, atol=1e-8)


def to_bernstein(powers: list[Any]) -> np.ndarray:
    """Bernstein coefficients of degree 8 from power coefficients, in high precision."""
    full = powers + [mpmath.mpf(0)] * (9 - len(powers))
    return np.array(
        [
            float(sum(mpmath.binomial(j, k) / mpmath.binomial(8, k) * full[k] for k in range(j + 1)))
            for j in range(9)
        ]
    )


@given(st.lists(st.integers(1, 999), min_size=1, max_size=6, unique=True))
def test_first_root_of_known_roots(thousandths: list[int]) -> None:
    powers = [mpmath.mpf(1)]
    for k in thousandths:
        root = mpmath.mpf(k) / 1000
        powers = [
            (powers[i] if i < len(powers) else 0) - (powers[i - 1] / root if i else 0)
            for i in range(len(powers) + 1)
        ]
    kind, out = call("root", to_bernstein(powers), 8, 0.0)
    first = min(thousandths) / 1000
    slope = abs(float(mpmath.diff(lambda u: mpmath.polyval(powers[::-1], u), first)))
    size = float(sum(abs(p) for p in powers))
    if slope > 1e-6 * size:
        assert kind == tables.SIMPLE_ROOT
        assert out[0] == pytest.approx(first, abs=1e-13 * size / slope + 1e-14)


@given(coefficients)
@example([0.0] * 7 + [-1.0, 0.0])
def test_first_root_against_numpy(c: list[float]) -> None:
    row = np.array(c)
    row[0] = abs(row[0]) + 0.1
    kind, out = call("root", row, 8, 0.0)
    grid = np.linspace(0, 1, 4001)
    work = np.zeros(9)
    values = np.array([bernstein.bernstein_value(row, 8, u, work) for u in grid])
    below = np.flatnonzero(values < -1e-9)
    if kind == tables.NO_ROOT:
        assert len(below) == 0
    elif kind == tables.SIMPLE_ROOT:
        assert abs(bernstein.bernstein_value(row, 8, out[0], work)) < 1e-11 * np.max(np.abs(row))
        assert len(below) == 0 or out[0] <= grid[below[0]]
        assert np.all(values[grid < out[0] - 1e-6] > -1e-9)


@pytest.mark.parametrize("place", [0.123, 0.5, 0.75, 0.999])
def test_touching(place: float) -> None:
    m = mpmath.mpf(place)
    for height, wanted in ((1e-9, tables.TANGENT_ROOT), (1e-3, tables.NO_ROOT)):
        kind, out = call("root", to_bernstein([m * m + height, -2 * m, mpmath.mpf(1)]), 8, 1e-6)
        assert kind == wanted
        if wanted == tables.TANGENT_ROOT:
            assert out[0] == pytest.approx(place, abs=2e-6)


@pytest.mark.parametrize(
    ("body", "why"),
    [("return [1]", "List"), ("return unknown", "unknown name"), ("return x[0:1]", "Slice"),
     ("return foo(1)", "unknown function"),
     ("with x:\n        return 1", "With"), ("return 'a'", "only numbers")],
)  # fmt: skip
def test_what_is_outside_the_language_is_named(body: str, why: str) -> None:
    unit = Unit()

    def made() -> bytes:
        add_kernels(unit, f"@kernel\ndef f(x: Vector) -> int:\n    {body}\n")
        return compile_unit(unit, {}, ("f",))

    with pytest.raises(KernelError, match=why):
        made()


def test_annotations_are_demanded() -> None:
    with pytest.raises(KernelError, match="annotate"):
        compiled("@kernel\ndef f(x) -> int:\n    return 1\n", ("f",))
