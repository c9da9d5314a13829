"""Conditions of stability in symbols: exact for laws with exponentials and powers, solved, short."""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy

from filippov import Parameter, Surface, System, cos, exp, log, parameters, sign, sqrt, states, tanh
from filippov.analysis import stability_report
from filippov.analysis.algebra.routh_hurwitz import routh_hurwitz

x, v, y, w = states("x v y w")
p = parameters(m=1, k=100, Fs=10, Fc=6, vs=0.1, b=1, vb=0.2, n=Parameter(1.5, lower=1), M=2, kappa=30, d=0.3)

NAMES = ["m", "k", "Fs", "Fc", "vs", "b", "vb", "n", "M", "kappa", "d"]
# F(s) of the slip speed s > 0, and its slope, derived by hand.
LAWS = {
    "Stribeck": (
        lambda s: p.Fc + (p.Fs - p.Fc) * exp(-s / p.vs) + p.b * s,
        lambda s, q: -(q["Fs"] - q["Fc"]) / q["vs"] * math.exp(-s / q["vs"]) + q["b"],
    ),
    "Gauss": (
        lambda s: p.Fc + (p.Fs - p.Fc) * exp(-((s / p.vs) ** 2)) + p.b * s,
        lambda s, q: -2 * s / q["vs"] ** 2 * (q["Fs"] - q["Fc"]) * math.exp(-((s / q["vs"]) ** 2)) + q["b"],
    ),
    "tanh": (
        lambda s: p.Fs - (p.Fs - p.Fc) * tanh(s / p.vs) + p.b * s,
        lambda s, q: -(q["Fs"] - q["Fc"]) / q["vs"] / math.cosh(s / q["vs"]) ** 2 + q["b"],
    ),
    "root": (
        lambda s: p.Fs - (p.Fs - p.Fc) * s / sqrt(s**2 + p.vs**2) + p.b * s,
        lambda s, q: -(q["Fs"] - q["Fc"]) * q["vs"] ** 2 / math.hypot(s, q["vs"]) ** 3 + q["b"],
    ),
    "power": (
        lambda s: p.Fs - (p.Fs - p.Fc) * (s / p.vs) ** p.n + p.b * s**2,
        lambda s, q: -(q["Fs"] - q["Fc"]) * q["n"] / q["vs"] * (s / q["vs"]) ** (q["n"] - 1) + 2 * q["b"] * s,
    ),
    "logarithm": (
        lambda s: p.Fs - p.Fc * log(1 + s / p.vs) + p.b * s,
        lambda s, q: -q["Fc"] / (q["vs"] + s) + q["b"],
    ),
    "cosine": (
        lambda s: p.Fs + p.Fc * cos(s / p.vs) + p.b * s,
        lambda s, q: -q["Fc"] / q["vs"] * math.sin(s / q["vs"]) + q["b"],
    ),
}


def drawn(rng: np.random.Generator) -> dict[str, float]:
    """Positive values in a decade around 1, Fs above Fc."""
    q = {name: float(10 ** rng.uniform(-0.5, 0.5)) for name in NAMES}
    q["Fs"] += q["Fc"]
    q["n"] += 1.0
    return q


def held(report, q: dict[str, float]) -> bool:
    """Whether the printed conditions hold at these values."""
    (item,) = [i for i in report.items if "0" not in i.equilibrium.mode]
    assert item.routh is not None
    assert item.routh.status == "complete"
    values = {s: sympy.Float(q[s.name], 30) for c in item.routh.conditions for s in sympy.S(c).free_symbols}
    return all(bool(sympy.S(c).subs(values)) for c in item.routh.conditions)


def block(law) -> System:
    slip = v - p.vb
    return System({x: v, v: (-p.k * x - law(abs(slip)) * sign(slip)) / p.m}, surfaces=[Surface("belt", slip)])


@pytest.mark.parametrize("name", LAWS)
def test_a_block_on_a_belt_is_stable_where_its_friction_rises(name: str) -> None:
    """m x'' - F'(vb) x' + k x: for all values of the parameters, not at those of the report."""
    law, slope = LAWS[name]
    report = stability_report(block(law))
    rng = np.random.default_rng(3)
    seen = set()
    for _ in range(40):
        q = drawn(rng)
        rises = slope(q["vb"], q) > 0
        assert held(report, q) == rises, q
        seen.add(rises)
    assert seen == {True, False}


@pytest.mark.parametrize("name", ["Stribeck", "Gauss", "power"])
def test_two_masses_on_a_belt_against_the_roots(name: str) -> None:
    """Four states; the roots come from numpy at each draw, with slopes derived by hand."""
    law, slope = LAWS[name]
    slip, rates = v - p.vb, {}
    rates |= {x: v, v: (-p.k * x - p.kappa * (x - y) - p.d * (v - w) - law(abs(slip)) * sign(slip)) / p.m}
    rates |= {y: w, w: (p.kappa * (x - y) + p.d * (v - w)) / p.M}
    report = stability_report(System(rates, surfaces=[Surface("belt", slip)]))
    rng = np.random.default_rng(4)
    seen = set()
    for _ in range(40):
        q = drawn(rng)
        f = slope(q["vb"], q)
        a = np.array(
            [
                [0, 1, 0, 0],
                [
                    -(q["k"] + q["kappa"]) / q["m"],
                    -(q["d"] + f) / q["m"],
                    q["kappa"] / q["m"],
                    q["d"] / q["m"],
                ],
                [0, 0, 0, 1],
                [q["kappa"] / q["M"], q["d"] / q["M"], -q["kappa"] / q["M"], -q["d"] / q["M"]],
            ]
        )
        largest = np.linalg.eigvals(a).real.max()
        if abs(largest) < 1e-6:
            continue
        assert held(report, q) == (largest < 0), q
        seen.add(bool(largest < 0))
    assert seen == {True, False}


def test_no_number_stands_in_a_condition_that_the_model_does_not_have() -> None:
    text = stability_report(block(LAWS["Stribeck"][0])).to_text()
    assert "asymptotically stable if and only if Fc - Fs + b*vs*exp(vb/vs) > 0\n" in text


def test_solved_for_what_stands_in_an_exponential() -> None:
    """vb = vs ln((Fs - Fc)/(b vs)), 0.36889 here; all vb where Fs <= Fc."""
    report = stability_report(block(LAWS["Stribeck"][0]), solve_for="vb")
    (item,) = report.items
    assert item.solved is not None
    edge = 0.1 * math.log(40)
    assert "vb > log(40)/10" in report.to_text()
    assert f"{edge:.10g}" in report.to_text()
    rng = np.random.default_rng(5)
    for _ in range(40):
        q = drawn(rng)
        q["Fs"] -= q["Fc"] * rng.integers(2) * 1.9
        at = {s: sympy.Float(q[s.name], 30) for s in item.solved.formula.free_symbols}
        rises = LAWS["Stribeck"][1](q["vb"], q) > 0
        assert bool(item.solved.formula.subs(at)) == rises, q


def test_what_is_not_solved_says_why() -> None:
    law = LAWS["Stribeck"][0]
    text = stability_report(block(law), solve_for="vs").to_text()
    assert "neither linear in vs nor in one exponential of it is left as it stands" in text
    text = stability_report(block(lambda s: p.Fs + p.b * s), solve_for="Fs").to_text()
    assert "not solved for Fs: Fs does not occur in the characteristic polynomial" in text


def test_numbers_that_are_rounded_in_a_condition_are_said_to_be() -> None:
    """a > 1/(3*1.23456789012345) is no ratio of few digits; a > 5/3 is."""
    for factor, said in ((sympy.Float("1.23456789012345"), True), (sympy.Float("0.2"), False)):
        q = parameters(a=1)
        rate = -(q.a * factor - sympy.Rational(1, 3)) * v - x
        text = stability_report(System({x: v, v: rate}, parameters=q)).to_text()
        assert "p(lambda) = lambda**2 + (" in text
        assert ("(numbers to 10 digits)" in text) == said, text


def test_the_last_entry_of_the_array_is_the_last_coefficient() -> None:
    """It is b_n/b_(n-1) with a thousand terms each, and a_n whatever the others are."""
    s = sympy.Symbol("s")
    a = sympy.symbols("a0:5", positive=True)
    b = sympy.symbols("b0:5", positive=True)
    given = [1, a[0] * b[0] + a[1] - b[2], a[1] * b[1] + a[2] - b[3], a[2] * b[2] - a[3] + b[4], a[3] / b[0]]
    result = routh_hurwitz(given, s, budget=20)
    assert result.array[4][0] == a[3] / b[0]
    assert result.array[2][1] == a[3] / b[0]
    rng = np.random.default_rng(1)
    at = {q: sympy.Rational(int(rng.integers(1, 50)), int(rng.integers(1, 50))) for q in (*a, *b)}
    c = [sympy.S(e).subs(at) for e in given]
    second = (c[1] * c[2] - c[0] * c[3]) / c[1]
    third = (second * c[3] - c[1] * c[4]) / second
    assert [e.subs(at) for e in result.first_column[2:4]] == [second, third]
