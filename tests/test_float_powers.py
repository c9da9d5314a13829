"""Fractional powers written as floats, x**(1/3): their reports end, and say what those of the fractions say.

The truth: with f and g odd and rising, x'' = -f(x) - g(x') comes to rest at 0, and x'' = c - f(x) - g(x')
where f(x) = c; without g, or with x' = -f(x), y' = -g(y), also by the first integral or the line.
"""

from __future__ import annotations

import math
import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

import numpy as np
import pytest
import sympy

from filippov import Abs, System, parameters, sign, states
from filippov.analysis import equilibria, stability_report
from filippov.analysis.algebra.polynomial import exact

x, v, y = states("x v y")
AS, ST = "asymptotically stable", "stable"
DRAWS = range({"nightly": 200}.get(os.environ.get("FILIPPOV_PROFILE", ""), 2))
# A report here takes less than a second; without the rule it takes hours and gigabytes.
SECONDS = 20


@contextmanager
def at_most(seconds: float) -> Iterator[None]:
    def over(number: int, frame: FrameType | None) -> None:
        raise AssertionError(f"more than {seconds} s")

    before = signal.signal(signal.SIGALRM, over)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def odd(q: sympy.Symbol, e: float) -> sympy.Expr:
    return Abs(q) ** e * sign(q)


def drawn(rng: np.random.Generator) -> float:
    """An exponent: p/q of small numbers as a float, a decimal, or any number."""
    kind = rng.integers(4)
    if kind < 2:
        return int(rng.integers(1, 12)) / int(rng.integers(2, 14))
    return round(float(rng.uniform(0.1, 2)), 3) if kind == 2 else float(rng.uniform(0.1, 2))


def answers(system: System, **more: float) -> list[tuple[tuple[float, ...], str]]:
    with at_most(SECONDS):
        return [(item.equilibrium.value, item.answer) for item in stability_report(system, **more).items]


@pytest.mark.parametrize("seed", DRAWS)
def test_a_spring_and_a_damper_with_any_powers(seed: int) -> None:
    rng = np.random.default_rng([31, seed])
    a, b = drawn(rng), drawn(rng)
    for field, known in (
        ({x: v, v: -odd(x, a) - odd(v, b)}, {AS, "undecided"}),
        ({x: v, v: -odd(x, a) - v}, {AS, "undecided"}),
        ({x: v, v: -odd(x, a)}, {ST, "undecided"}),
        ({x: -odd(x, a) + y, y: -odd(x, b)}, {AS, "undecided"}),
        ({x: -odd(x, a), y: -odd(y, b)}, {AS, "undecided"}),
    ):
        assert [said for _, said in answers(System(field))] in [[k] for k in known], (a, b, field)


@pytest.mark.parametrize("seed", DRAWS)
def test_a_load_is_borne_where_the_spring_bears_it(seed: int) -> None:
    rng = np.random.default_rng([32, seed])
    a, b = drawn(rng), drawn(rng)
    c = round(float(rng.uniform(0.3, 1.8)), 2) * int(rng.choice([-1, 1]))
    place = math.copysign(abs(c) ** (1 / a), c)
    system = System({x: v, v: c - odd(x, a) - odd(v, b)})
    with at_most(SECONDS):
        found = equilibria(system, box={"x": (-abs(place) - 10, abs(place) + 10)})
    at = [e.value[0] for e in found]
    if found.complete or at:
        assert at == pytest.approx([place], rel=1e-6), (a, b, c)


@pytest.mark.parametrize("seed", DRAWS)
def test_dry_friction_holds_such_a_spring_between_two_places(seed: int) -> None:
    rng = np.random.default_rng([34, seed])
    a, b = drawn(rng), drawn(rng)
    c = round(float(rng.uniform(0.3, 1.8)), 2)
    with at_most(SECONDS):
        report = stability_report(System({x: v, v: c - odd(x, a) - odd(v, b) - sign(v) / 5}))
    found = [e.value for item in report.items for e in item.equilibrium.ends]
    assert {item.answer for item in report.items} <= {AS, "undecided"}
    for bound in (c - 0.2, c + 0.2):
        near = [place for place, _ in found if place == pytest.approx(bound ** (1 / a), rel=1e-6)]
        assert near or not report.complete, (a, b, c)


@pytest.mark.parametrize("seed", DRAWS)
def test_a_float_says_what_its_fraction_says(seed: int) -> None:
    rng = np.random.default_rng([33, seed])
    p, q = int(rng.integers(1, 10)), int(rng.integers(2, 10))
    r, s = int(rng.integers(1, 10)), int(rng.integers(2, 10))
    (m,) = parameters(m=p / q)
    c = sympy.Rational(int(rng.integers(-20, 21)), 10)

    def field(e: object, g: object) -> System:
        return System({x: v, v: c - odd(x, e) - odd(v, g)})

    told = answers(field(p / q, r / s))
    right = answers(field(sympy.Rational(p, q), sympy.Rational(r, s)))
    assert [said for _, said in told] == [said for _, said in right]
    assert np.allclose([at for at, _ in told], [at for at, _ in right], atol=1e-9)
    named = answers(field(m, r / s))
    assert len(named) == len(told)
    for (at, said), (place, known) in zip(named, told, strict=True):
        assert np.allclose(at, place, atol=1e-7)
        assert said in {known, "undecided"}


def test_what_a_float_stands_for_in_an_exponent_and_elsewhere() -> None:
    z = sympy.Symbol("z")
    for p in range(1, 30):
        for q in range(1, 1000, 7):
            fraction = sympy.Rational(p, q)
            if not fraction.is_Integer:
                assert exact(z ** sympy.Float(p / q)).exp == fraction
    assert exact(z**0.123).exp == sympy.Rational(123, 1000)
    # No fraction: the float is kept, and 12**0.1234... is a number, not a product of powers of primes.
    assert exact(z**0.12345678901234).exp == sympy.Float(0.12345678901234)
    assert float(exact((12 * z) ** 0.12345678901234).subs(z, 2)) == pytest.approx(24**0.12345678901234)
    assert exact(sympy.Float(1 / 3) * z + z**0.5).coeff(z) == sympy.Rational(repr(1 / 3))


def test_powers_of_a_high_degree_are_not_factored() -> None:
    """x**(457/1000) beside x**(123/1000), and x**5000: nothing is of use as a polynomial."""
    for field in (
        {x: v, v: -odd(x, 0.123) - odd(x, 0.457) - v - odd(v, 0.789)},
        {x: v, v: -(x**5001) - x - v},
        {x: y - x**701, y: -(x**301) - y**501},
    ):
        for _, said in answers(System(field)):
            assert said in {AS, "undecided"}
