"""Sliders in series with springs (Jenkins 1962; Iwan 1966): forces that grow up to a level."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

from filippov import Abs, Heaviside, System, cos, solve, states, t
from filippov.analysis import find_orbit, flow_derivative

X, V = states("x v")


def elements(
    form: str, stiffness: tuple[float, ...], levels: tuple[float, ...]
) -> dict[sympy.Expr, sympy.Expr]:
    """F' = k v where |F| is below its level or falls, for each element."""
    rows = {}
    for i, (k, level) in enumerate(zip(stiffness, levels, strict=True)):
        (force,) = states([f"F{i}"])
        up, down = Heaviside(force - level), Heaviside(-force - level)
        rows[force] = {
            "switched": k * V * (1 - up * Heaviside(V) - down * Heaviside(-V)),
            "pushed back": k * V - 2 * k * Abs(V) * (up - down),
            "projected": k * V - 100 * (up - down),
        }[form]
    return rows


@pytest.mark.parametrize("form", ["switched", "pushed back", "projected"])
@pytest.mark.parametrize("number", [1, 2])
def test_sliders_that_stop_at_once_have_a_derivative(form: str, number: int) -> None:
    """Slip about -sum of levels until v = 0 at x1, then the springs of all: x'' = -x - level - k (x - x1)."""
    stiffness, levels = (1.7, 0.6)[:number], (0.4, 0.3)[:number]
    k, level, end = sum(stiffness), sum(levels), 1.2
    rows = elements(form, stiffness, levels)
    system = System({X: V, V: -X - sum(rows), **rows})
    run = solve(system, (0.5, 0.8, *levels), (0, end), rtol=1e-12, atol=1e-14)

    def place(x: complex, v: complex) -> complex:
        stop = np.arctan(v / (x + level))
        far = np.sqrt((x + level) ** 2 + v**2) - level
        middle = (k * far - level) / (1 + k)
        return complex(middle + (far - middle) * np.cos(np.sqrt(1 + k) * (end - stop)))

    assert run.x_end[0] == pytest.approx(place(0.5, 0.8).real, abs=1e-9)
    wanted = [place(0.5 + 1e-30j, 0.8).imag / 1e-30, place(0.5, 0.8 + 1e-30j).imag / 1e-30]
    assert flow_derivative(run)[0, :2] == pytest.approx(wanted, abs=1e-8)


def test_orbits_of_sliders_are_those_of_their_projection() -> None:
    found = []
    for form in ("projected", "switched", "pushed back"):
        rows = elements(form, (1.7,), (0.4,))
        system = System({X: V, V: -0.05 * V - X - sum(rows) + 1.3 * cos(1.2 * t), **rows})
        found.append(find_orbit(system, (0, 0, 0), transient=300))
    for orbit in found[1:]:
        assert orbit.multipliers == pytest.approx(found[0].multipliers, abs=1e-9)
        assert orbit.amplitude["x"] == pytest.approx(found[0].amplitude["x"], abs=1e-8)
        assert orbit.margin.transversality > 0.1
