"""Dry friction whose level and load depend on the place: x'' = L(x) - F(x) sgn(x'), held where |L| <= F.

The oracle knows no multipliers: it samples |L| <= F. An end at which L leads away from the set loses what
starts beyond it; at any other end the mass is driven back, or slides into the set and rests there.
"""

import itertools

import numpy as np
import pytest
import sympy

from filippov import Abs, System, exp, sign, sin, states
from filippov.analysis import equilibria, stability_report
from filippov.analysis.steady.equilibrium import EquilibriumSet

x, v, y = states("x v y")
AS, UN = "asymptotically stable", "unstable"
FAR = 40.0


def mass(load: sympy.Expr, level: sympy.Expr, sense: int = 1) -> System:
    """In the states x and x', or x and -x'."""
    return System({x: sense * v, v: sense * load - level * sign(v)})


def known(load: sympy.Expr, level: sympy.Expr) -> list[tuple[float, float, str]]:
    """Intervals of the set in [-FAR, FAR], infinite where they reach that far, and the verdict on each."""
    places = np.linspace(-FAR, FAR, 400_001)
    L, F = (np.broadcast_to(sympy.lambdify(x, e)(places), places.shape) for e in (load, level))
    assert np.all(F > 0)
    held = np.abs(L) <= F
    edges = np.flatnonzero(np.diff(held.astype(int))) + 1
    borders = [0, *edges, len(places)]
    out = []
    for a, b in itertools.pairwise(borders):
        if held[a]:
            away = (a > 0 and L[a] < 0) or (b < len(places) and L[b - 1] > 0)
            low, high = (places[a] if a else -np.inf), (places[b - 1] if b < len(places) else np.inf)
            out.append((float(low), float(high), UN if away else AS))
    return out


def told(system: System) -> list[tuple[float, float, str]]:
    """The same by the report, with neighbours that a kink divides as one."""
    found = []
    for item in stability_report(system).items:
        e = item.equilibrium
        assert isinstance(e, EquilibriumSet), e
        (c,), ((low, high),) = e.free, e.bounds
        ends = [low, high] if c == x else [float(e.x[0].subs(c, q)) for q in (low, high)]
        found.append((*sorted(ends), item.answer))
    joined: list[tuple[float, float, str]] = []
    for low, high, answer in sorted(found):
        if joined and abs(joined[-1][1] - low) < 1e-9:
            assert joined[-1][2] == answer
            joined[-1] = (joined[-1][0], high, answer)
        else:
            joined.append((low, high, answer))
    return joined


def compared(load: sympy.Expr, level: sympy.Expr, sense: int) -> None:
    right, found = known(load, level), told(mass(load, level, sense))
    assert [row[2] for row in found] == [row[2] for row in right], (load, level, found, right)
    for a, b in zip(found, right, strict=True):
        assert np.allclose(a[:2], b[:2], atol=1e-3), (load, level, found, right)


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize(
    ("load", "level"),
    [
        (-x, 1 + x**2), (-x, sympy.Rational(1, 5) + x**2), (1 - x**2, sympy.Integer(2)),
        (x**2 - 1, sympy.Rational(1, 2)), (-sympy.Integer(1), Abs(x) + sympy.Rational(1, 2)),
        (-exp(x), sympy.Rational(1, 2)), (-x / (1 + x**2), sympy.Rational(2, 5)),
        (2 * sin(x) - x, sympy.Rational(3, 10)), (exp(-(x**2)) - x, sympy.Rational(2, 5)),
        (-981 * sin(x) / 100, sympy.Integer(12)), (x - x**3, sympy.Rational(1, 10)),
        (-5 * (Abs(x - 1) + x - 1) / 2, sympy.Rational(1, 5)),
    ],
)  # fmt: skip
def test_what_friction_holds_is_where_the_load_is_below_its_level(
    load: sympy.Expr, level: sympy.Expr, sense: int
) -> None:
    compared(load, level, sense)


@pytest.mark.parametrize("seed", range(8))
def test_random_loads_and_levels(seed: int) -> None:
    rng = np.random.default_rng([19, seed])
    tenths = [sympy.Rational(int(k), 10) for k in rng.integers(-20, 21, 4)]
    a, b = (sympy.Rational(int(k), 10) for k in rng.integers(1, 15, 2))
    load = tenths[0] + tenths[1] * x + tenths[2] * x**2
    compared(load, a + b * x**2 * int(rng.integers(0, 2)), int(rng.choice([-1, 1])))


def test_a_level_that_changes_its_sign_divides_the_set() -> None:
    """What holds for x < 1/2 drives beyond: v' = -(1/2 - x) sgn v."""
    answers = {}
    for item in stability_report(System({x: v, v: -(sympy.Rational(1, 2) - x) * sign(v)})).items:
        answers[item.equilibrium.bounds[0]] = item.answer
    assert answers.keys() == {(-np.inf, 0.5), (0.5, np.inf)}
    assert answers[(0.5, np.inf)] == UN
    assert answers[(-np.inf, 0.5)] != UN


def test_what_moves_along_a_set_is_not_judged_at_one_of_its_points() -> None:
    """y' = (x - 3/10) y beside a mass that friction holds at |x| <= 1: it grows where x > 3/10."""
    report = stability_report(System({x: v, v: -x - sign(v), y: (x - sympy.Rational(3, 10)) * y}))
    parts = {
        tuple(sorted(float(-b) for b in item.equilibrium.bounds[0])): item.answer
        for item in report.items
        if isinstance(item.equilibrium, EquilibriumSet) and str(item.equilibrium.free[0]) == "s"
    }
    assert parts[(0.3, 1.0)] == UN
    assert parts[(-1.0, 0.3)] != UN


def test_borders_without_a_formula_are_searched_and_that_is_said() -> None:
    found = equilibria(mass(2 * sin(x) - x, sympy.Rational(3, 10)))
    assert not found.complete
    assert any("borders of a set were searched numerically in x in [-10, 10]" in note for note in found.notes)


def test_the_end_of_a_half_line_is_no_equilibrium_of_its_own() -> None:
    (item,) = stability_report(System({x: v, v: -(Abs(x) + x) / 2 - sympy.Rational(3, 10) * v})).items
    assert item.answer == AS
    assert [end.value for end in item.equilibrium.ends] == [(0.0, 0.0)]
