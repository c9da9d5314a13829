"""Verdicts do not depend on the units of states and time, and are exact where the numbers are.

Undamped masses, resonances and near resonances against the closed form of their linear field; kinks of the
plane and of space in scaled states against the same in plain ones.
"""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
import pytest
import sympy
from sympy import Expr, Rational

from filippov import Abs, Max, System, TimeEvent, sign, states
from filippov.analysis import stability_report

x, v, y, w = states("x v y w")
AS, ST, UN = "asymptotically stable", "stable", "unstable"
DRAWS = range({"nightly": 300}.get(os.environ.get("FILIPPOV_PROFILE", ""), 25))


def verdicts(system: System) -> list[str]:
    return [item.answer for item in stability_report(system).items]


def power(k: int) -> Rational:
    return Rational(10) ** k


def scaled(
    rows: Sequence[Expr], free: Sequence[sympy.Symbol], units: Sequence[Rational], time: Rational
) -> System:
    """The field x' = rows(x) in X = unit x and T = t / time."""
    plain = {q: q / u for q, u in zip(free, units, strict=True)}
    field = (u * time * sympy.S(row).xreplace(plain) for u, row in zip(units, rows, strict=True))
    return System(dict(zip(free, field, strict=True)))


@pytest.mark.parametrize("k", [-9, -6, -3, 0, 3, 6, 9])
def test_an_oscillator_is_stable(k: int) -> None:
    u = power(k)
    assert verdicts(System({x: v * u, v: -2 * x / u})) == [ST]
    assert verdicts(System({x: v, v: -(u**2) * x})) == [ST]
    assert verdicts(System({x: v * u, v: -2 * x / u - v / 10**7})) == [AS]
    assert verdicts(System({x: v * u, v: -2 * x / u + v / 10**7})) == [UN]


@pytest.mark.parametrize("k", [0, 1, 2, 3, 4, 5, 6, 7, 8])
def test_resonance_and_near_resonance(k: int) -> None:
    """Equal frequencies with a coupling, however weak, grow like t; different ones, however near, do not."""
    small = power(-k)
    assert verdicts(System({x: v, v: -x, y: w, w: -y + small * x})) == [UN]
    assert verdicts(System({x: v, v: -x, y: w, w: -(1 + small) * y + x})) == [ST]
    assert verdicts(System({x: v, v: -x, y: w, w: -y})) == [ST]


@pytest.mark.parametrize("k", [-6, -3, 0, 3, 6])
def test_beside_sliding(k: int) -> None:
    u = power(k)
    assert verdicts(System({x: -5 * sign(x), y: u * w, w: -Rational(19, 10) * y / u})) == [ST]
    assert verdicts(System({x: -5 * sign(x) + y, y: w, w: -(u**2) * y})) == [ST]


def test_roots_of_numbers() -> None:
    """Entries that are no fractions: what rounding leaves open is not said."""
    root = sympy.sqrt(2)
    assert verdicts(System({x: v, v: -root * x})) == [ST]
    assert verdicts(System({x: v, v: -root * x, y: w, w: -(root + 1) * y + x})) == [ST]
    assert verdicts(System({x: v, v: -root * x, y: w, w: -root * y + x}))[0] in {UN, "undecided"}


@pytest.mark.parametrize("seed", DRAWS)
def test_two_masses_in_any_units(seed: int) -> None:
    """M q'' = -K q with K positive definite, and with one direction in which it is not."""
    rng = np.random.default_rng([3, seed])
    free, units = (x, v, y, w), [power(int(k)) for k in rng.integers(-6, 7, 4)]
    a, b, c = (Rational(round(10 * q), 10) for q in rng.uniform(0.2, 2, 3))
    if a * b == c**2:
        c += Rational(1, 10)
    rows = [v, -a * x - c * y, w, -b * y - c * x]
    known = ST if a * b > c**2 else UN
    assert verdicts(scaled(rows, free, units, power(int(rng.integers(-5, 6))))) == [known]


@pytest.mark.parametrize("seed", DRAWS)
def test_kinks_in_any_units(seed: int) -> None:
    rng = np.random.default_rng([4, seed])
    n = 2 if seed % 3 else 3
    free = (x, v, y)[:n]

    def entries(*shape: int) -> np.ndarray:
        return np.vectorize(lambda q: Rational(round(10 * q), 10))(rng.uniform(-2, 2, shape))

    A, b, c = entries(n, n) - Rational(3, 5) * np.eye(n, dtype=int), entries(n), entries(n)
    h = sum(q * r for q, r in zip(free, c, strict=True))
    kink = Abs(h) if rng.random() < 0.5 else Max(h, 0)
    linear = [sum(q * r for q, r in zip(free, row, strict=True)) for row in A]
    rows = [e + s * kink for e, s in zip(linear, b, strict=True)]
    one = [power(0)] * n
    known = verdicts(scaled(rows, free, one, power(0)))
    for _ in range(3):
        units = [power(int(k)) for k in rng.integers(-5, 6, n)]
        told = verdicts(scaled(rows, free, units, power(int(rng.integers(-3, 4)))))
        assert len(told) == len(known)
        assert all(p == q or "undecided" in (p, q) for p, q in zip(sorted(known), sorted(told), strict=True))


@pytest.mark.parametrize(
    "rule",
    [x - x**3, x + x**3, -x + x**3, -x + x**2, -x - x**3, x / 2 + x**2, 2 * x, x + 1, x / 3 - x**3 + x**2],
)
def test_what_a_clock_keeps_of_a_line_of_rests(rule: Expr) -> None:
    """x' = 0 and x+ = rule: the fixed points of the rule, with its slope as multiplier."""
    clock = TimeEvent("tick", period=1, reset={x: rule})
    items = stability_report(System({x: 0 * x}, time_events=[clock])).items
    truth = [float(r) for r in sympy.real_roots(sympy.Poly(rule - x, x))] if rule != x + 1 else []
    assert sorted(item.equilibrium.value[0] for item in items) == pytest.approx(sorted(set(truth)))
    for item in items:
        slope = abs(float(rule.diff(x).subs(x, item.equilibrium.x[0])))
        if abs(slope - 1) > 1e-9:
            assert item.answer == (AS if slope < 1 else UN)


@pytest.mark.parametrize("seed", DRAWS[:12])
def test_exact_equilibria_are_told_apart_at_any_distance(seed: int) -> None:
    """x' = -(x - 1)(x - 1 - e) ...: an odd number of simple roots, outer ones stable, in turn."""
    rng = np.random.default_rng([seed, 97])
    e, count = Rational(1, 10 ** int(rng.integers(6, 14))), int(rng.choice([3, 5]))
    places = np.cumsum(rng.integers(1, 9, count)).tolist()
    about = int(rng.integers(0, 9))
    roots = [about + e * int(k) for k in places]
    report = stability_report(System({x: -sympy.prod([x - r for r in roots])}))
    told = sorted((item.equilibrium.value[0], item.answer) for item in report.items)
    assert [value for value, _ in told] == pytest.approx([float(r) for r in roots], rel=1e-15)
    assert [answer for _, answer in told] == [UN if k % 2 else AS for k in range(count)]
