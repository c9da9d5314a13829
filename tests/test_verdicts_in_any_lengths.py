"""Equilibria, sets and verdicts do not depend on the unit of length, from picometres to 1e6 of it.

What is told in plain units is known in closed form here; the same system in other units has to be told alike.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from sympy import Expr, Max, Min, Rational, S, Symbol, sin
from test_verdicts_in_any_units import power, scaled

from filippov import Abs, sign, states
from filippov.analysis import stability_report
from filippov.analysis.steady.equilibrium import EquilibriumPoint

x, v = states("x v")
POWERS = {"nightly": [-12, -10, -6, -3, 0, 3, 6]}.get(os.environ.get("FILIPPOV_PROFILE", ""), [-10, 6])
AS, UN = "asymptotically stable", "unstable"
R = Rational
# x + x**3 = 1; the roots of x - x**3 = +-1/10; those of x = 2 sin x and of x - 2 = 2 sin x.
CUBIC, INNER, NEAR, FAR = 0.6823278038280193, 0.10103126, 0.94564928, 1.04668053
WAVE, SECOND = 1.895494267033981, 2.754673754246286

CASES: dict[str, tuple[Expr, list[tuple[Any, str]]]] = {
    "a spring that hardens": (-x - x**3 - v / 5 - sign(v), [((-CUBIC, CUBIC), AS)]),
    "two wells with friction": (
        x - x**3 - v / 5 - sign(v) / 10, [((-FAR, -NEAR), AS), ((-INNER, INNER), UN), ((NEAR, FAR), AS)],
    ),
    "two wells": (x - x**3 - v / 5, [(-1, AS), (0, UN), (1, AS)]),
    "a kink": (1 - Abs(x) - v, [(-1, UN), (1, AS)]),
    "a relay": (-x - v + 2 * sign(x - R(1, 2)), [(-2, AS), (R(1, 2), UN), (2, AS)]),
    "a dead zone": (-Max(x - 1, 0) - Min(x + 1, 0) - v, [((-1, 1), AS)]),
    "a corrugated surface": (-(x - 1) + 2 * sin(x) - v - sign(v), [((-WAVE, 0), UN), ((WAVE, SECOND), AS)]),
}  # fmt: skip


def told(row: Expr, free: Sequence[Symbol], unit: Rational) -> list[tuple[Any, str]]:
    out: list[tuple[Any, str]] = []
    for item in stability_report(scaled([v, row], free, [unit] * 2, S.One)).items:
        e = item.equilibrium
        ends = [e.value[0]] if isinstance(e, EquilibriumPoint) else sorted(end.value[0] for end in e.ends)
        out.append(([end / float(unit) for end in ends], item.answer))
    return sorted(out)


def test_a_corrugated_surface_in_a_unit_that_is_tiny() -> None:
    row, expected = CASES["a corrugated surface"]
    assert [answer for _, answer in told(row, (x, v), power(10))] == [answer for _, answer in expected]


@pytest.mark.parametrize("k", POWERS)
@pytest.mark.parametrize("name", CASES)
def test_equilibria_and_verdicts_in_any_length(name: str, k: int) -> None:
    row, expected = CASES[name]
    found = told(row, (x, v), power(k))
    assert [answer for _, answer in found] == [answer for _, answer in expected]
    for (ends, _), (known, _) in zip(found, expected, strict=True):
        np.testing.assert_allclose(ends, np.atleast_1d(np.array(known, float)), rtol=1e-7, atol=1e-12)
