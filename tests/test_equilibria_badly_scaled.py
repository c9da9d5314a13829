"""States of sizes that are powers of 10 apart: the zeros are those of the system in plain coordinates."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from scipy.optimize import fsolve

from filippov import Surface, System, sign, states
from filippov.analysis import equilibria
from filippov.analysis.steady.equilibrium import Equilibria

Array = npt.NDArray[np.float64]
SCALES = [(1e-2, 1e2, 1e6), (1e-5, 1e-1, 1e5), (10.0, 1e-3, 1e6), (1e4, 1e6, 10.0), (1e-4, 1e3, 1e5)]
Draw = tuple[Array, Array, Array, float]


def draw(seed: int) -> Draw:
    """A, b, c, offset of X' = A X - b (h**3 + |h|), h = c X - offset."""
    rng = np.random.default_rng(seed)
    A = np.round(rng.normal(size=(3, 3)) - 0.5 * np.eye(3), 1)
    b, c = np.round(rng.normal(size=(2, 3)), 1)
    return A, b, c, 0.5 * (seed % 2)


def zeros(of: Draw) -> Array:
    """The zeros from many starts of fsolve, each once, in plain coordinates."""
    A, b, c, offset = of
    found: list[Array] = []
    rng = np.random.default_rng(0)
    for m in (1.0, -1.0):

        def f(x: Array, m: float = m) -> Array:
            h = c @ x - offset
            return np.asarray(A @ x - b * (h**3 + m * h))

        for start in 4.0 * rng.normal(size=(60, 3)):
            x, _, ier, _ = fsolve(f, start, full_output=True, xtol=1e-13)
            good = ier == 1 and np.max(np.abs(f(x))) < 1e-10 and m * (c @ x - offset) > -1e-9
            if good and not any(np.allclose(x, y, atol=1e-7) for y in found):
                found.append(x)
    return np.array(found).reshape(-1, 3)


def formula(of: Draw, sc: tuple[float, ...], rate: float) -> System:
    A, b, c, offset = of
    x = states("x0 x1 x2")
    X = [q / s for q, s in zip(x, sc, strict=True)]
    h = sum(float(w) * q for w, q in zip(c, X, strict=True)) - offset
    return System(
        {
            x[i]: rate
            * sc[i]
            * (sum(float(a) * q for a, q in zip(A[i], X, strict=True)) - float(b[i]) * (h**3 + sign(h) * h))
            for i in range(3)
        }
    )


def functions(of: Draw, sc: tuple[float, ...], rate: float) -> System:
    A, b, c, offset = of
    size = np.array(sc)

    def field(t: float, x: Any, p: Any, s: Any) -> Any:
        h = c @ (x / size) - offset
        return rate * size * (A @ (x / size) - b * (h**3 + s[0] * h))

    surface = Surface("h", lambda t, x, p: float(c @ (x / size) - offset))
    return System(field=field, surfaces=[surface], states=["x0", "x1", "x2"])


def check(found: Equilibria, of: Draw, sc: tuple[float, ...], all_of: bool = True) -> None:
    """Each point is a zero and, with all_of, each zero is a point."""
    truth = zeros(of)
    assert not found.sets
    got = np.array([e.value for e in found.points]).reshape(-1, 3) / np.array(sc)
    for place in got:
        assert np.min(np.max(np.abs(truth - place), axis=1)) <= 1e-6 * (1 + np.max(np.abs(place)))
    if all_of:
        assert len(got) == len(truth)


@pytest.mark.parametrize("sc", SCALES)
@pytest.mark.parametrize("seed", range(3))
def test_zeros_of_formulas_in_any_units(seed: int, sc: tuple[float, ...]) -> None:
    rate = [1.0, 1e-3, 1e4][seed % 3]
    check(equilibria(formula(draw(seed), sc, rate), budget=40.0), draw(seed), sc)


@pytest.mark.parametrize("sc", SCALES)
@pytest.mark.parametrize("seed", [1, 3])
def test_zeros_of_functions_in_any_units(seed: int, sc: tuple[float, ...]) -> None:
    """With the default range they may lie outside; what is found is one of them, and no line."""
    of = draw(seed)
    modes = ["+", "-"]
    check(equilibria(functions(of, sc, 1.0), modes=modes, budget=40.0), of, sc, all_of=False)
    box = {f"x{i}": (-10 * s, 10 * s) for i, s in enumerate(sc)}
    check(equilibria(functions(of, sc, 1.0), modes=modes, box=box, budget=40.0), of, sc)


@pytest.mark.parametrize("sc", [(1e-2, 1e2, 1e6), (1e-5, 1e-1, 1e5), (10.0, 1e-3, 1e6)])
def test_no_half_lines_are_invented(sc: tuple[float, ...]) -> None:
    """0 and one more zero; two half lines were reported."""
    A = np.array([[0.1, 0.3, -1.3], [-0.6, 1.2, -1.3], [-0.8, -0.2, 0.3]])
    of = A, np.array([0.3, 0.7, -1.1]), np.array([0.9, 0.6, -1.6]), 0.0
    assert len(zeros(of)) == 2
    check(equilibria(formula(of, sc, 1.0), budget=40.0), of, sc)
