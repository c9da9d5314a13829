"""Taylor coefficients of every function of the language, against mpmath, written out and as loops."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from filippov.base.elementary import ELEMENTARY, LIBRARY
from filippov.kernel.codegen import jets
from filippov.kernel.codegen.generate import KernelPrinter
from filippov.kernel.codegen.jet_graph import JetGraph
from filippov.kernel.codegen.jet_groups import GroupedLoops
from filippov.kernel.language import primitives
from filippov.kernel.loop import elementary
from filippov.kernel.methods import recurrences
from filippov.model.symbolic import Select
from filippov.model.symbols import t

X, Y, P = sympy.symbols("x y p", real=True)
ORDER = 16
EXAMPLES = settings(max_examples=20, deadline=None)
# Functions of one argument, each at a place inside its domain.
PLACES = {"acosh": 1.7}
SMOOTH = [f for f in ELEMENTARY if f.arguments == 1 and f.formula]


def coefficients(field: list[sympy.Expr], x0: list[float], p: float, loops: bool) -> np.ndarray:
    """Rows of coefficients of the field along its motion from (0.3, x0), by the generated statements."""
    printer = KernelPrinter({X: "x[0]", Y: "x[1]", P: "p[0]", t: "t"}, set())
    graph = JetGraph(printer._print, {X: 0, Y: 1}, t, {})
    results = [graph(f) for f in field]
    writer = GroupedLoops if loops else jets._WrittenOut
    made = writer(graph, results, ORDER, jets._used(graph, results))
    lines = made.lines()
    names: dict[str, Any] = {k: v for k, v in vars(primitives).items() if callable(v)}
    names |= {k: partial(primitives.each, k) for k in LIBRARY} | {"fabs": abs}
    names |= {k: v for m in (recurrences, elementary) for k, v in vars(m).items() if callable(v)}
    exec("def made(t, x, p, s, m, work, out):\n" + "\n".join(lines), names)  # noqa: S102 - our own text
    # In Python a vector holds one number.
    names["VECTORS"] = 1
    out, work = np.zeros(ORDER * len(field)), np.full(getattr(made, "room", 0), np.nan)
    with np.errstate(all="ignore"):
        names["made"](0.3, np.array(x0), np.array([p]), None, None, work, out)
    return out.reshape(ORDER, len(field))


def told(f: Callable[[Any], Any], at: float) -> np.ndarray:
    with mpmath.workdps(60):
        return np.array([float(c) for c in mpmath.taylor(f, mpmath.mpf(at), ORDER - 1)])


def compare(found: np.ndarray, known: np.ndarray, tolerance: float = 1e-12) -> None:
    # The terms of a coefficient are as large as the radius of convergence lets them be.
    size = np.maximum.accumulate(abs(known[::-1]))[::-1]
    np.testing.assert_allclose(found, known, rtol=0, atol=tolerance * np.max(size + abs(known)))
    assert np.max(abs(found - known) / (abs(known) + 1e-6 * size.max())) < 1e4 * tolerance


@pytest.mark.parametrize("loops", [False, True], ids=["written out", "loops"])
@pytest.mark.parametrize("f", SMOOTH, ids=[f.name for f in SMOOTH])
def test_14_2_coefficients_of_every_function(f: Any, loops: bool) -> None:
    at = PLACES.get(f.name, 0.4)
    found = coefficients([sympy.S.One, getattr(sympy, f.symbolic)(X)], [at, 0.0], 1.0, loops)
    compare(found[:, 1], told(getattr(mpmath, f.name), at))


CASES: dict[str, tuple[sympy.Expr, Callable[[Any], Any]]] = {
    "atan2": (sympy.atan2(X**2, X + 1), lambda x: mpmath.atan2(x**2, x + 1)),
    "quotient": (sympy.exp(X) / (1 + X**2), lambda x: mpmath.exp(x) / (1 + x**2)),
    "power": ((1 + X**2) ** P, lambda x: (1 + x**2) ** mpmath.mpf("1.3")),
    "number power": ((2 - X) ** sympy.Rational(-7, 3), lambda x: (2 - x) ** (-mpmath.mpf(7) / 3)),
    "root": (sympy.sqrt(1 + X) / sympy.sqrt(2 - X), lambda x: mpmath.sqrt((1 + x) / (2 - x))),
    "whole power": (X**7 - X**-3, lambda x: x**7 - x**-3),
    "both vary": ((1 + X) ** sympy.sin(X), lambda x: (1 + x) ** mpmath.sin(x)),
    "time": (sympy.cos(3 * t) * X, lambda x: mpmath.cos(3 * (x - mpmath.mpf(0.4) + mpmath.mpf(0.3))) * x),
    "nested": (
        sympy.tanh(sympy.exp(-X) * sympy.sin(5 * X)),
        lambda x: mpmath.tanh(mpmath.exp(-x) * mpmath.sin(5 * x)),
    ),
    "least": (sympy.Min(X, X**2, 3), lambda x: x**2),
    "most": (sympy.Max(X, X**2), lambda x: x),
    "size": (sympy.Abs(X - 1), lambda x: 1 - x),
    "select": (Select(X - 2, sympy.log(X - 2), X**2), lambda x: x**2),
    "steps": (sympy.floor(3 * X) * X + sympy.sign(X - 1), lambda x: x - 1),
}


@pytest.mark.parametrize("loops", [False, True], ids=["written out", "loops"])
@pytest.mark.parametrize("name", CASES)
def test_14_2_coefficients_of_expressions(name: str, loops: bool) -> None:
    expression, known = CASES[name]
    found = coefficients([sympy.S.One, expression], [0.4, 0.0], 1.3, loops)
    compare(found[:, 1], told(known, 0.4))


@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_14_2_a_whole_exponent_among_the_parameters_at_a_base_of_0(exponent: float) -> None:
    for loops in (False, True):
        found = coefficients([sympy.S.One, (X + 0) ** P], [0.0, 0.0], exponent, loops)
        printer = KernelPrinter({X: "x[0]", P: "p[0]"}, set())
        assert "power" in printer._print(X**P)
        expected = np.zeros(ORDER)
        expected[int(exponent)] = 1.0
        np.testing.assert_array_equal(found[:, 1], expected)


LEAVES = st.sampled_from([X, Y, t, P, sympy.Float(0.7), X * Y, X - Y])
UNARY = st.sampled_from([sympy.sin, sympy.cos, sympy.tanh, sympy.atan, sympy.erf, sympy.asinh])


@st.composite
def expressions(draw: Callable[..., Any], depth: int = 2) -> sympy.Expr:
    if depth == 0:
        return draw(LEAVES)
    kind = draw(st.integers(0, 4))
    a = draw(expressions(depth - 1))
    if kind == 0:
        return draw(UNARY)(a)
    b = draw(expressions(depth - 1))
    return [a + b, a * b, a / (2 + b**2), sympy.sqrt(1 + a**2) * b][kind - 1]


@EXAMPLES
@given(expressions(), expressions())
def test_14_2_a_series_is_the_motion_whatever_the_field(f: sympy.Expr, g: sympy.Expr) -> None:
    """x'' from the series is the field's derivative along itself, order by order, by sympy."""
    x0, p = [0.6, -0.3], 1.3
    found = coefficients([f, g], x0, p, False)
    np.testing.assert_allclose(coefficients([f, g], x0, p, True), found, rtol=1e-9, atol=1e-9)
    for i, rate in enumerate((f, g)):
        for k in range(2):
            value = float(sympy.lambdify([X, Y, P, t], rate, "mpmath")(*x0, p, 0.3))
            assert found[k, i] * math.factorial(k) == pytest.approx(value, rel=1e-10, abs=1e-10)
            rate = sympy.diff(rate, X) * f + sympy.diff(rate, Y) * g + sympy.diff(rate, t)  # noqa: PLW2901
