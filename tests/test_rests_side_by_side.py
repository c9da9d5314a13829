"""No verdict "asymptotically stable" for what has other equilibria arbitrarily near: these do not come to it.

The oracle knows no modes: a mass with v' in F(x) + [-b, b] at v = 0 rests at x where 0 is in that interval.
"""

from __future__ import annotations

import os
from collections.abc import Callable

import numpy as np
import pytest
import sympy

from filippov import Max, Min, System, sign, states
from filippov.analysis import certify, equilibria, stability_report
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet

x, v, y = states("x v y")
AS, ST = "asymptotically stable", "stable"
DRAWS = range({"nightly": 300}.get(os.environ.get("FILIPPOV_PROFILE", ""), 4))
NEAR = (1e-4, 1e-6, 1e-8)
Span = tuple[float, float]
Equilibrium = EquilibriumPoint | EquilibriumSet


def span(e: Equilibrium) -> Span:
    """The places x of an equilibrium of one mass."""
    if isinstance(e, EquilibriumPoint):
        return e.value[0], e.value[0]
    (c,), ((low, high),) = e.free, e.bounds
    ends = [low, high] if c == x else [float(e.x[0].subs(c, q)) for q in (low, high)]
    return min(ends), max(ends)


def alone(spans: list[Span], rests: Callable[[float], bool]) -> bool:
    """Whether no rest outside of these places is arbitrarily near one of them."""
    for end in {q for pair in spans for q in pair if abs(q) < np.inf}:
        for d in (s * q for q in NEAR for s in (1, -1)):
            if rests(end + d) and not any(low - 1e-12 <= end + d <= high + 1e-12 for low, high in spans):
                return False
    return True


def told(system: System, rests: Callable[[float], bool]) -> dict[Span, str]:
    """The verdicts by place; fails where one is called asymptotically stable that cannot be."""
    report = stability_report(system)
    sets = [i.equilibrium for i in report.items if isinstance(i.equilibrium, EquilibriumSet)]
    for item in report.items:
        if item.answer == AS:
            union = [item.equilibrium, *(e for e in sets if e.mode in item.together)]
            assert alone([span(e) for e in union], rests), item
            assert not item.together or isinstance(item.equilibrium, EquilibriumSet)
        assert item.answer != "unstable" or not item.together
    return {span(i.equilibrium): i.answer for i in report.items}


def tenths(rng: np.random.Generator, low: float, high: float) -> sympy.Rational:
    return sympy.Rational(round(10 * rng.uniform(low, high)), 10)


def dry(a: sympy.Expr, b: sympy.Expr, c: sympy.Expr) -> Callable[[float], bool]:
    return lambda q: abs(c - a * np.sign(q)) <= b + 1e-12 if q else abs(c) <= abs(a) + b


@pytest.mark.parametrize("seed", DRAWS)
def test_a_relay_beside_dry_friction(seed: int) -> None:
    rng = np.random.default_rng([51, seed])
    a, b, c = tenths(rng, -1, 1.2), tenths(rng, 0.1, 1), tenths(rng, -1, 1)
    rests = dry(a, b, c)
    verdicts = told(System({x: v, v: -a * sign(x) - b * sign(v) + c}), rests)
    if (0.0, 0.0) in verdicts and a > abs(c):
        assert verdicts[0.0, 0.0] == (ST if rests(1e-9) or rests(-1e-9) else AS)


@pytest.mark.parametrize("seed", DRAWS)
def test_springs_with_gaps_and_stops_of_force(seed: int) -> None:
    """Lines of rest in gaps, half lines, with and without dry friction, and a follower beside it."""
    rng = np.random.default_rng([52, seed])
    (d1, d2), k1, k2 = (tenths(rng, 0, 1) for _ in range(2)), tenths(rng, 0, 2), tenths(rng, 0, 2)
    b, c, a = tenths(rng, 0, 0.6) * int(rng.integers(2)), tenths(rng, -0.5, 0.5), tenths(rng, 0, 0.6)
    a *= int(rng.integers(2))
    force = c - k1 * Max(x - d1, 0) - k2 * Min(x + d2, 0)

    def rests(q: float) -> bool:
        pull = float(c) - float(k1) * max(q - float(d1), 0) - float(k2) * min(q + float(d2), 0)
        low, high = pull - float(b), pull + float(b)
        sides = [np.sign(q)] if q else [-1, 1]
        return (
            min(low - float(a) * s for s in sides) <= 1e-15
            and max(high - float(a) * s for s in sides) >= -1e-15
        )

    told(System({x: v, v: force - v - b * sign(v) - a * sign(x)}), rests)


@pytest.mark.parametrize(
    ("a", "b", "c"),
    [("1", ".5", ".6"), (".3", ".5", "0"), ("1", ".5", "-.5"), ("1", "1", "0"), ("1", ".2", ".3")],
)
@pytest.mark.parametrize("sense", [1, -1])
def test_the_point_between_half_lines(a: str, b: str, c: str, sense: int) -> None:
    a, b, c = map(sympy.Rational, (a, b, c))
    system = System({x: sense * v, v: sense * (c - a * sign(x)) - b * sign(v)})
    rests, verdicts = dry(a, b, c), told(system, dry(a, b, c))
    near = rests(1e-9) or rests(-1e-9)
    assert verdicts[0.0, 0.0] == (ST if near else AS)
    for e, certificate in certify(system):
        if isinstance(e, EquilibriumPoint):
            assert certificate is not None
            assert (certificate.answer, certificate.reach) == (
                (ST, "local") if near else (AS, certificate.reach)
            )
    # The same where the half lines are not asked for.
    (item,) = stability_report(system, modes=["00"]).items
    assert item.answer == verdicts[0.0, 0.0]


def test_a_line_in_two_modes_is_one_set() -> None:
    report = stability_report(System({x: v, v: -sympy.Rational(3, 10) * sign(x) - sign(v) / 2}))
    lines = [item for item in report.items if isinstance(item.equilibrium, EquilibriumSet)]
    assert {(item.equilibrium.mode, item.together) for item in lines} == {("+0", ("-0",)), ("-0", ("+0",))}
    assert "asymptotically stable together with mode -0" in report.to_text()
    assert [e["together"] for e in report.to_dict()["equilibria"]].count([]) == 1


@pytest.mark.parametrize("k", [1, -1])
def test_lines_of_rest_that_cross(k: int) -> None:
    """x' = -x y^2, y' = -k y x^2: k x^2 - y^2 is kept, and for k = 1 they come to the cross, not a line."""
    report = stability_report(System({x: -x * y**2, y: -k * y * x**2}))
    for item in report.items:
        assert item.answer != AS or item.together
        assert k > 0 or item.answer != AS


def test_a_curve_beside_a_line() -> None:
    """y (x^2 + y^2 - 1) = 0: the circle and the axis cross at x = -1 and 1; the arcs attract, and it not."""
    report = stability_report(System({x: 0 * x, y: -y * (x**2 + y**2 - 1)}))
    assert len(report.items) >= 3
    assert not [i for i in report.items if i.answer == AS and not i.together]


def test_isolated_and_separate_ones_are_judged_as_before() -> None:
    mass = System({x: v, v: -x - sign(v) / 2})
    assert [i.answer for i in stability_report(mass).items] == [AS]
    two = System({x: v, v: x**2 - 1 - sign(v) / 2})
    report = stability_report(two)
    assert sorted(i.answer for i in report.items) == [AS, "unstable"]
    assert not any(i.together for i in report.items)
    assert len(equilibria(two)) == 2
