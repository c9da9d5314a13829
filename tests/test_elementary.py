"""Every elementary function wherever functions are known: formulas, files, kernels, lanes and backends."""

import math
from functools import cache
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy

from filippov import System, solve, solve_many, states
from filippov.base.elementary import ELEMENTARY, Elementary
from filippov.io.tree import HEADS
from filippov.model.expression import FUNCTIONS, parse_expression

X, Y, Z = states("x y z")
EVERY = pytest.mark.parametrize("f", ELEMENTARY, ids=[f.name for f in ELEMENTARY])


def value(f: Elementary, *at: float) -> float:
    name = {"ceiling": "ceil"}.get(f.name, f.name)
    return float(getattr(mpmath, name)(*at))


def arguments(f: Elementary) -> tuple[float, ...]:
    return (1.3 if f.library == "acosh" else 0.4,) + (0.7,) * (f.arguments - 1)


@cache
def in_lanes() -> dict[str, np.ndarray]:
    """Every function as in the test below, over a time of 1: one system, as lanes are compiled for each."""
    every = [f for f in ELEMENTARY if f.formula]
    inputs = {0.4: Y, 1.3: Z}
    fields = [getattr(sympy, f.symbolic)(inputs[arguments(f)[0]], *arguments(f)[1:]) for f in every]
    names = states(" ".join(f"x{i}" for i in range(len(every))))
    system = System({**dict(zip(names, fields, strict=True)), Y: 0 * Z, Z: 0 * Y})
    many = solve_many(system, np.tile([0.0] * len(every) + [0.4, 1.3], (70, 1)), (0, 1), lanes=8)
    return {f.name: many.x[:, i] for i, f in enumerate(every)}


@EVERY
def test_13_4_known_everywhere(f: Elementary, tmp_path: Path) -> None:
    at = arguments(f)
    assert HEADS[f.symbolic] is getattr(sympy, f.symbolic)
    if not f.formula:
        assert f.name not in FUNCTIONS
        return
    text = f"{f.name}({', '.join(map(str, at))})"
    assert float(parse_expression(text, {})) == pytest.approx(value(f, *at), rel=1e-15)
    # x' = f(y, ...) with y' = 0: the field of compiled code, of Python and of lanes, each after a time of 1.
    symbolic = getattr(sympy, f.symbolic)(Y, *at[1:])
    system = System({X: symbolic, Y: 0 * X})
    start = (0.0, at[0])
    for backend in ("compiled", "python"):
        run = solve(system, start, (0, 1), backend=backend)
        assert run.x_end[0] == pytest.approx(value(f, *at), rel=1e-14), backend
    np.testing.assert_allclose(in_lanes()[f.name], value(f, *at), rtol=1e-13)
    loaded = type(run).load(solve(system, start, (0, 1)).save(tmp_path / "run.npz"))
    assert loaded.system == system


def test_13_4_a_formula_that_jumps_is_refused_with_what_to_write() -> None:
    for text in ("floor(x)", "ceiling(x)"):
        with pytest.raises(Exception, match=text[:5]):
            parse_expression(text, {"x": X})
    assert math.isclose(float(parse_expression("erf(1/2)", {})), math.erf(0.5))


# Written as whole numbers of halves they need no pow; floats and quotients are the same exponents.
@pytest.mark.parametrize("exponent", [sympy.Rational(3, 2), 1.5, sympy.Rational(-3, 2), -1.5])
@pytest.mark.parametrize("base", [2.5e-180, 0.4, 3e60])
def test_13_4_powers_of_three_halves(base: float, exponent: Any) -> None:
    known = mpmath.mpf(base) ** (mpmath.mpf(3) / 2 * (1 if exponent > 0 else -1))
    scale = float(1 / known) if 0 < float(1 / known) < math.inf else 1.0
    system = System({X: scale * Y**exponent, Y: 0 * X})
    starts = (0.0, base)
    runs = [solve(system, starts, (0, 1), backend=backend).x_end[0] for backend in ("compiled", "python")]
    runs += [solve_many(system, np.tile(starts, (70, 1)), (0, 1), lanes=8).x[0, 0]]
    np.testing.assert_allclose(runs, float(scale * known), rtol=1e-14)
