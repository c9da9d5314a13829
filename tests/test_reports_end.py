"""Reports of stability that end: exponentials of long decimals, and places in nested roots.

The reports took a minute and more, in factors and minimal polynomials of high degree, of which a call takes
long. Each must end within the default budget, with the sets and the verdicts that motions have.
"""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from sympy import Expr, Rational

from filippov import System, exp, log, parameters, sign, solve, states
from filippov.analysis import equilibria, stability_report
from filippov.analysis.algebra.budget import Clock
from filippov.analysis.algebra.polynomial import in_large_field
from filippov.analysis.local_stability.stability_result import StabilityResult
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet
from filippov.analysis.steady.linearisation import characteristic_polynomial

x, y, v = states("x y v")
AS = "asymptotically stable"
WORK = 15.0  # million calls, about half of what a report may take

# v' with one mass, and the ends of the set where it sticks.
MASSES: dict[str, tuple[Expr, tuple[float, float]]] = {
    "Stribeck and a slope": (
        -0.6 * v - 0.8 * x - 0.5 * (1 - 0.1 * x) * (1 + 0.2 * exp(-15.21 * v**2)) * sign(v),
        (-0.6 / 0.74, 0.6 / 0.86),
    ),
    "Stribeck and a factor": (
        -0.1 * v - 0.4 * x - 0.5 * (1 + 0.1 * exp(-23.04 * v**2)) * (0.1 * x + 1) * sign(v),
        (-0.55 / 0.455, 0.55 / 0.345),
    ),
    "a cubic spring": (
        -1.0 * v - 0.7 * x**3 - 1.3 * x - (0.3 * x**2 + 1) * (0.6 * sign(v) + 0.1) + 1.9,
        (0.6795279877, 1.1603209711),
    ),
    "a cubic spring and negative damping": (
        0.6 * v - 0.8 * x**3 - 1.3 * x - 1.2 * (1 - 0.4 * x) * sign(v),
        (-0.8545643791, 0.5844380810),
    ),
}


def report(system: System) -> StabilityResult:
    """The report in the default budget, with less work than WORK."""
    found = Clock(WORK).within(lambda: stability_report(system))
    assert not found.notes
    return found


@pytest.mark.timeout(100)
@pytest.mark.parametrize("name", MASSES)
def test_reports_of_one_mass_end(name: str) -> None:
    acceleration, ends = MASSES[name]
    system = System({x: v, v: acceleration})
    (item,) = report(system).items
    found = item.equilibrium
    assert isinstance(found, EquilibriumSet)
    assert found.exact
    assert item.answer == AS
    np.testing.assert_allclose(found.bounds, [ends], atol=1e-8)
    stick = [float(acceleration.subs({v: 0, x: q})) for q in ends]
    assert stick[0] > 0 > stick[1]
    for start in (ends[0] - 0.02, ends[1] + 0.02, sum(ends) / 2):
        for speed in (-0.02, 0.02):
            motion = solve(system, [start, speed], (0.0, 60.0))
            assert abs(motion["v"][-1]) < 1e-6
            assert ends[0] - 1e-6 < motion["x"][-1] < ends[1] + 1e-6


@pytest.mark.timeout(100)
def test_the_belt_with_a_bell_ends_in_formulas() -> None:
    """Away from the belt's speed 1.8 x = 1.1 (1 + 0.1 exp(-15.21/4)) + 0.1."""
    bell = 1 + 0.1 * exp(-15.21 * (v - 0.5) ** 2)
    (item,) = report(System({x: v, v: 0.3 * v - 1.8 * x - 1.1 * bell * sign(v - 0.5) + 0.1})).items
    assert item.answer == "unstable"
    assert item.equilibrium.exact
    place = (1.2 + 0.11 * np.exp(-15.21 / 4)) / 1.8
    assert isinstance(item.equilibrium, EquilibriumPoint)
    np.testing.assert_allclose(item.equilibrium.value, [place, 0.0])
    # d(v')/dv = 0.3 and more: the bell rises with v below the belt's speed, where the sign is -1.
    assert 0.3 + 1.1 * 0.1 * 15.21 * np.exp(-15.21 / 4) > 0


@pytest.mark.timeout(100)
def test_a_pseudo_equilibrium_in_nested_roots_ends() -> None:
    """Beside roots of the Jacobians, by numpy; the far pseudo-equilibrium is where both fields lead away."""
    above = [
        0.6 * x**2 - 1.5 * x - 2.5 * y + 0.5,
        0.6 * x**2 - 1.3 * x * y + 2.5 * x - 1.0 * y,
    ]
    below = [
        -0.3 * x**2 - 0.8 * x - 0.5 * y - 1.0,
        -0.2 * x**2 + 0.3 * x * y + 0.5 * x - 0.4 * y,
    ]
    system = System.from_modes(h=[y], fields={"+": above, "-": below}, states=[x, y])
    found = report(system)
    answers = []
    for item in found.items:
        assert isinstance(item.equilibrium, EquilibriumPoint)
        answers.append((item.equilibrium.mode, item.answer))
        place = dict(zip((x, y), item.equilibrium.value, strict=True))
        if item.equilibrium.mode == "0":
            up, down = (float(f[1].subs(place)) for f in (above, below))
            assert item.answer == "unstable"
            assert abs(place[x]) < 1e-12 or up > 0 > down
            continue
        field = sympy.Matrix(above if item.equilibrium.mode == "+" else below)
        np.testing.assert_allclose(np.array(field.subs(place), dtype=float), 0, atol=1e-9)
        jacobian = np.array(field.jacobian([x, y]).subs(place), dtype=float)
        largest = np.linalg.eigvals(jacobian).real.max()
        assert item.answer == (AS if largest < 0 else "unstable")
    assert sorted(answers) == sorted(
        [("+", "unstable"), ("+", AS), ("+", "unstable"), ("-", AS), ("-", "unstable"), ("-", "unstable")]
        + [("0", "unstable")] * 2
    )


@pytest.mark.timeout(100)
def test_polynomials_of_numbers_in_large_fields() -> None:
    c = sympy.cbrt(sympy.sqrt(66223001) / 60492 + Rational(10403641, 77308776))
    c += Rational(4213, 181476) / c
    q = (c + sympy.sqrt(Rational(50753, 213) + 322 * c - 491 * c**2)) / (c - Rational(161, 71))
    matrix = sympy.Matrix([[q / (1 + q), (1 + q) / (2 + q)], [q**2 / (3 + q), (2 - q) / (1 + q**2)]])
    assert in_large_field(matrix)
    assert not in_large_field([sympy.sqrt(2), sympy.cbrt(3)])
    polynomial = Clock(1.0).within(lambda: characteristic_polynomial(matrix))
    expected = np.poly(np.array(matrix.evalf(30), dtype=float))
    np.testing.assert_allclose(np.array([c.evalf(30) for c in polynomial], dtype=float), expected, atol=1e-10)


@pytest.mark.timeout(100)
def test_equilibria_with_an_exponential_of_a_long_decimal() -> None:
    """A diode: 0.5 = 0.1 exp(x/0.0259)."""
    p = parameters(k=0.5)
    for system, place in (
        (System({x: 0.5 - 0.1 * exp(x / 0.0259)}), 0.0259 * np.log(5)),
        (System({x: 0.5 - 0.1 * exp(x / 0.0259) - 0.2 * sign(x)}), 0.0259 * np.log(3)),
        (System({x: v, v: p.k - 0.1 * exp(x / 0.0259) - v}, parameters=p), 0.0259 * np.log(5)),
    ):
        found = equilibria(system, budget=3.0)
        assert not found.notes
        (point,) = found.points
        assert point.x[0].has(log)
        np.testing.assert_allclose(point.value[0], place)
    none = equilibria(System({x: 0.5 + 0.1 * exp(x / 0.0259)}), budget=3.0)
    assert not none.points
    assert not none.notes
