"""Derivatives of plain functions by dual numbers against sympy, and what functions they refuse."""

from __future__ import annotations

import functools
import math
from math import sin as sine
from typing import Any

import numba
import numpy as np
import pytest
import sympy
from scipy.interpolate import CubicSpline

from filippov import Surface, System, solve
from filippov.kernel.derivative.exact import Exact, along
from filippov.kernel.derivative.overloaded import overloaded

X, Y, T = sympy.symbols("x y t", real=True)
ONE = (
    sympy.sin, sympy.cos, sympy.tan, sympy.atan, sympy.sinh, sympy.cosh, sympy.tanh, sympy.asinh, sympy.exp,
    sympy.erf, sympy.erfc, sympy.Abs,
    lambda e: sympy.sqrt(1 + e**2), lambda e: sympy.log(2 + e**2), lambda e: sympy.acosh(2 + e**2),
    lambda e: sympy.asin(e / sympy.sqrt(2 + e**2)), lambda e: sympy.acos(sympy.tanh(e) / 2),
    lambda e: sympy.atanh(sympy.tanh(e) / 3),
)  # fmt: skip
TWO = (
    lambda a, b: a + b, lambda a, b: a - 2 * b, lambda a, b: a * b, lambda a, b: a / (1 + b**2),
    lambda a, b: sympy.atan2(a, 2 + b), lambda a, b: (1 + a**2) ** (b / 3), sympy.Max,
    lambda a, b: sympy.Min(a, b + 1), lambda a, b: a**3 - b**2, lambda a, b: 2**a - b,
    lambda a, b: sympy.Piecewise((a, a > b), (b * a, True)),
)  # fmt: skip


def drawn(rng: np.random.Generator, depth: int) -> Any:
    """A random expression of x, y and t."""
    if depth == 0:
        return (X, Y, T, sympy.Float(round(float(rng.normal()), 3)))[rng.integers(4)]
    if rng.integers(2):
        return ONE[rng.integers(len(ONE))](drawn(rng, depth - 1) / 2)
    return TWO[rng.integers(len(TWO))](drawn(rng, depth - 1), drawn(rng, depth - 1))


@pytest.mark.parametrize("modules", ["math", ["numpy", "scipy"]], ids=["math", "numpy"])
def test_random_functions_against_sympy(modules: Any) -> None:
    """First derivatives, and slopes of rates along a field, to rounding of the terms; most are taken."""
    rng, taken, tried = np.random.default_rng(7), 0, 0
    for _ in range(60):
        h, f = drawn(rng, 3), (drawn(rng, 1), drawn(rng, 2))
        rate = sum(h.diff(v) * w for v, w in zip((X, Y, T), (*f, 1), strict=True))
        if rate.has(sympy.Derivative, sympy.DiracDelta) or h.has(sympy.zoo, sympy.nan):
            continue
        place = dict(zip((X, Y, T), (sympy.Float(v, 30) for v in rng.uniform(-1.5, 1.5, 3)), strict=True))
        plain = sympy.lambdify([(X, Y, T)], [h, *f], modules=modules)
        twin, point = overloaded(plain), np.array([float(v) for v in place.values()])

        def rates(numbers: Any, twin: Any = twin) -> list[Any]:
            return along(lambda at: twin(at)[:1], numbers, [*twin(numbers)[1:], 1.0])[1]

        exact = Exact(lambda v, plain=plain: np.array(plain(v), dtype=float), twin)
        found, tried = exact(point), tried + 1
        if found is None:
            continue
        taken += 1
        wanted = [float(h.diff(v).subs(place).evalf(30)) for v in (X, Y, T)]
        np.testing.assert_allclose(found[1][0], wanted, rtol=1e-11, atol=1e-12)
        told = float(rate.subs(place).evalf(30))
        second = Exact(lambda _, told=told: [told], rates)(point)
        if second is not None and not h.has(sympy.Abs, sympy.Max, sympy.Min):
            wanted = [float(rate.diff(v).subs(place).evalf(30)) for v in (X, Y, T)]
            np.testing.assert_allclose(second[1][0], wanted, rtol=1e-9, atol=1e-10)
    assert tried > 45
    # numpy's minimum of objects and functions of scipy take no dual numbers.
    assert taken > (0.9 if modules == "math" else 0.5) * tried


def helper(v: float) -> float:
    return math.exp(-abs(v)) + sine(v)


compiled = numba.njit(lambda v: v * math.cos(v))
LEVEL = 2.0


class Plant:
    gain = 3.0

    def __call__(self, v: Any) -> Any:
        return self.gain * math.tanh(v[0])

    def method(self, v: Any) -> Any:
        return self.gain * helper(v[0]) + LEVEL * v[1]


def _closure() -> Any:
    root, inner = math.sqrt, helper
    return lambda v: root(2 + v[0] * v[0]) * inner(v[1])


FORMS = {
    "names": lambda v: sine(v[0]) * math.hypot(v[0], v[1], 1.0) + math.pi,
    "helper": lambda v: helper(v[0]) * v[1],
    "closure": _closure(),
    "object": Plant(),
    "method": Plant().method,
    "partial": functools.partial(lambda a, v: a * math.log(2 + v[0] ** 2, 3), 2.0),
    "numba": lambda v: compiled(v[0]) - v[1],
    "norm": lambda v: np.linalg.norm(v) + v @ np.array([1.0, 2.0]),
    "matrix": lambda v: (np.array([[1.0, 2.0], [3.0, 4.0]]) @ v)[1] + np.sum(np.sin(v)),
    "choice": lambda v: max(v[0], v[1]) + (v[0] if v[1] > 0 else -v[0]),
    "steps": lambda v: math.floor(7 * v[0]) + v[1] % 0.7 + np.floor(3 * v[1]) * v[0] + math.fmod(v[0], 0.3),
    "angle": lambda v: math.atan2(v[1], v[0]) + np.arctan2(v[0], v[1]) + math.copysign(v[0], -1.0),
}


@pytest.mark.parametrize("name", FORMS)
def test_ways_to_write_a_function(name: str) -> None:
    """Whatever way it is written its derivative is that of differences, to their error."""
    function, point, step = FORMS[name], np.array([0.83, -0.47]), 1e-3
    found = Exact(lambda v: [function(v)], lambda v: [overloaded(function)(v)])(point)
    assert found is not None
    for j in range(2):
        values = [float(function(point + k * step * np.eye(2)[j])) for k in (-2, -1, 1, 2)]
        wanted = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12 * step)
        assert found[1][0, j] == pytest.approx(wanted, abs=1e-10)


def test_names_that_are_bound_anew_are_read_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    twin = overloaded(Plant().method)
    exact = Exact(lambda v: [Plant().method(v)], lambda v: [twin(v)])
    assert exact(np.array([0.3, 0.4]))[1][0, 1] == 2.0
    monkeypatch.setitem(globals(), "LEVEL", 5.0)
    assert exact(np.array([0.3, 0.4]))[1][0, 1] == 5.0
    # A function that stands for another since: the values differ, and nothing is said.
    monkeypatch.setitem(globals(), "helper", lambda v: 1.0 + v)
    assert exact(np.array([0.3, 0.4])) is None


@pytest.mark.parametrize(
    "function",
    [
        lambda v: np.interp(v[0], [0, 1, 2], [0, 1, 0]),
        lambda v: float(v[0]) ** 2,
        lambda v: CubicSpline([0, 1, 2, 3], [0, 1, 0, 2])(v[0]),
        lambda v: math.gamma(2 + v[0]),
        lambda v: np.heaviside(v[0], 0.5) * v[1],
    ],
    ids=["interp", "float", "spline", "gamma", "heaviside"],
)
def test_what_takes_no_dual_numbers_is_left_to_differences(function: Any) -> None:
    exact = Exact(lambda v: [function(v)], lambda v: [overloaded(function)(v)])
    assert exact(np.array([0.4, 0.5])) is None
    assert exact.refused


def test_no_derivative_is_none() -> None:
    root = Exact(lambda v: [math.sqrt(v[0])], lambda v: [overloaded(lambda u: math.sqrt(u[0]))(v)])
    assert root(np.array([0.0])) is None
    assert root(np.array([4.0]))[1][0, 0] == 0.25


def test_a_function_with_memory_is_not_believed() -> None:
    calls: list[Any] = []

    def h(v: Any) -> Any:
        calls.append(v)
        return v[0] * len(calls)

    assert Exact(lambda v: [h(v)], lambda v: [overloaded(h)(v)])(np.array([1.0])) is None


@pytest.mark.parametrize("place", [1.0, 1e3, 1e6])
def test_sliding_far_from_the_origin(place: float) -> None:
    """On x = tanh(z - c), z' = 1, x' = -2 s: s = -(1 - x^2)/2, and y' = s."""
    system = System(
        field=lambda t, x, p, s: [-2 * s[0], s[0], 1.0],
        surfaces=[Surface("h", lambda t, x, p: x[0] - math.tanh(x[2] - place))],
        states="x y z",
    )
    run = solve(system, (math.tanh(-2.0), 0.0, place - 2), (0, 4), rtol=1e-10)
    assert run.success
    assert run.x_end[1] == pytest.approx(-math.tanh(2.0), abs=1e-15 * place + 1e-8)


def test_many_states() -> None:
    """h = (x_1^2 + ... + x_n^2)/2 has the gradient x."""
    point = np.linspace(-1.0, 1.0, 700)
    found = Exact(lambda v: [v @ v / 2], lambda v: [v @ v / 2])(point)
    assert found is not None
    np.testing.assert_allclose(found[1][0], point, rtol=0, atol=1e-16)
