"""Equilibria of systems whose field jumps at instants: signs of the time alone, such as sign(sin(t)).

The oracle multiplies the exponentials of the two halves of the period.
"""

import numpy as np
import pytest
import sympy
from scipy.linalg import expm

from filippov import Abs, System, cos, sign, sin, states, t
from filippov.analysis import certify, equilibria, linearise, stability_report

x, v, y = states("x v y")
AS, UN = "asymptotically stable", "unstable"


def verdict(size: float) -> str:
    return AS if size < 1 else UN


@pytest.mark.parametrize("seed", range(12))
def test_the_multipliers_of_two_halves(seed: int) -> None:
    rng = np.random.default_rng([23, seed])
    n = 1 + seed % 3
    mean, jump = np.round(rng.uniform(-1, 1, (2, n, n)), 1) - 0.2 * np.eye(n)
    names, w = (x, v, y)[:n], int(rng.integers(1, 4))
    square = sign((sin, cos)[seed % 2](w * t))
    rational = np.vectorize(lambda q: sympy.Rational(repr(round(float(q), 1))))
    rows = sympy.Matrix(rational(mean)) + square * sympy.Matrix(rational(jump))
    system = System(dict(zip(names, rows * sympy.Matrix(names), strict=True)))
    product = expm((mean - jump) * np.pi / w) @ expm((mean + jump) * np.pi / w)
    (item,) = stability_report(system).items
    assert item.answer == verdict(float(np.max(np.abs(np.linalg.eigvals(product)))))


@pytest.mark.parametrize(("mean", "answer"), [(-0.4, AS), (-0.2, UN)])
def test_a_kink_under_a_square_wave(mean: float, answer: str) -> None:
    """Each side has its own factor over the period, exp(2 pi (mean -+ 3/10))."""
    rate = sympy.Rational(repr(mean)) + sign(cos(t))
    (item,) = stability_report(System({x: rate * x - sympy.Rational(3, 10) * Abs(x)})).items
    assert item.answer == answer


def test_a_rate_that_is_zero_half_of_the_time() -> None:
    for square in (sign(sin(t)), sign(cos(3 * t)), -sign(sin(t))):
        (item,) = stability_report(System({x: -(1 + square) * x})).items
        assert item.answer == AS


def test_relays_whose_strength_or_load_is_a_square_wave() -> None:
    for field in (-(2 + sign(cos(t))) * sign(x), sign(sin(3 * t)) / 2 - sign(x)):
        (item,) = stability_report(System({x: field})).items
        assert item.answer == AS
        assert item.equilibrium.value == (0.0,)


def test_a_sign_that_balances_nothing_leaves_no_equilibrium_and_that_is_said() -> None:
    report = stability_report(System({x: v, v: -x - v + sign(sin(t))}))
    assert not report.items
    assert "moves with the time" in report.to_text()


def test_modes_have_the_signs_of_all_surfaces() -> None:
    system = System({x: -(2 + sign(cos(t))) * sign(x), v: -v})
    found = list(equilibria(system))
    assert found
    assert all(len(e.mode) == len(system.surfaces) for e in found)
    assert all(len(e.mode) == len(system.surfaces) for e, _ in certify(system))
    assert len(equilibria(system, modes=[found[0].mode])) == 1
    assert linearise(system, found[0]).sliding


def test_one_jump_is_no_period() -> None:
    (item,) = stability_report(System({x: -x - 2 * x * sign(t - 5)})).items
    assert item.answer == "undecided"
