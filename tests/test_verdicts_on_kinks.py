"""Verdicts on kinks: in the plane, while sliding, along sets, forced and clocked, against closed forms.

A Jacobian is that of one side; none of these verdicts may rest on it alone.
"""

from __future__ import annotations

import math
import os

import numpy as np
import pytest
import sympy

from filippov import Abs, Max, System, TimeEvent, cos, sign, sin, states, t
from filippov.analysis.local_stability.stability import StabilityReport, stability_report
from filippov.analysis.steady.equilibrium import EquilibriumSet

x, y, z, w = states("x y z w")
AS, UN = "asymptotically stable", "unstable"
DRAWS = range({"nightly": 60}.get(os.environ.get("FILIPPOV_PROFILE", ""), 4))


def tenths(rng: np.random.Generator, low: float, high: float) -> sympy.Rational:
    return sympy.Rational(round(10 * rng.uniform(low, high)), 10)


def answers(system: System) -> set[str]:
    return {item.answer for item in stability_report(system).items}


def said_at(report: StabilityReport, at: float) -> set[str]:
    """The verdicts of the parts of a set over x in which x = at lies."""
    found = [(i.equilibrium, i.answer) for i in report.items if isinstance(i.equilibrium, EquilibriumSet)]
    return {answer for e, answer in found if e.free == (x,) and e.bounds[0][0] < at < e.bounds[0][1]}


def half_turns(a: float, b: float) -> float:
    """log of the factor of a turn of y' = a y + b |y| + z, z' = -y: traces a + b and a - b."""
    return sum(math.pi * tr / math.sqrt(4 - tr**2) for tr in (a + b, a - b))


@pytest.mark.parametrize("seed", DRAWS)
@pytest.mark.parametrize("beside", ["a relay", "a set"])
def test_12_2_a_planar_kink_is_judged_by_both_sides_also_beside_a_relay_and_across_a_set(
    seed: int, beside: str
) -> None:
    rng = np.random.default_rng([2, seed])
    a, b, c = tenths(rng, -0.6, 0.4), tenths(rng, -0.9, 0.9), tenths(rng, -1, 1)
    growth = half_turns(float(a), float(b))
    if abs(growth) < 0.05:
        return
    first = c * y - sign(x) if beside == "a relay" else c * y
    assert answers(System({x: first, y: a * y + b * Abs(y) + z, z: -y})) == {AS if growth < 0 else UN}


def test_12_2_a_stick_set_on_a_kink_is_not_judged_by_one_side() -> None:
    """The planar kink of y and z beside dry friction of x: never the verdict of one side."""
    for a, b in ((-0.4, 0.6), (0.1, 0.6)):
        spring = {x: y, y: -x - sign(y), z: sympy.Rational(str(a)) * z + sympy.Rational(str(b)) * Abs(z) + w}
        expected = {AS, "undecided"} if half_turns(a, b) < 0 else {UN, "undecided"}
        assert answers(System({**spring, w: -z})) <= expected
    assert answers(System({x: y, y: -x - sign(y), z: -z - 2 * Abs(z)})) == {UN}


@pytest.mark.parametrize("seed", DRAWS)
def test_12_2_a_set_on_a_kink_is_cut_at_the_borders_of_both_sides(seed: int) -> None:
    """y' = p(x) y + q(x) |y|: y > 0 has the rate p + q, y < 0 the rate p - q."""
    rng = np.random.default_rng([3, seed])
    (a, b), (c, d) = ([tenths(rng, -1, 1) for _ in range(2)] for _ in range(2))
    report = stability_report(System({x: tenths(rng, -1, 1) * y, y: (a + b * x) * y + (c + d * x) * Abs(y)}))
    for at in np.linspace(-2.97, 3.03, 13):
        rates = [float(a + b * at + side * (c + d * at)) for side in (1, -1)]
        if abs(max(rates)) > 1e-3:
            assert said_at(report, at) == {AS if max(rates) < 0 else UN}, (at, rates)


@pytest.mark.parametrize("k", [-1, 1])
@pytest.mark.parametrize("more", [{}, {z: -z}])
def test_12_2_the_end_of_a_half_line_counts(k: int, more: dict) -> None:
    """x'' = k max(x, 0) - x': rest for x <= 0, and beyond 0 the roots of s^2 + s - k."""
    report = stability_report(System({x: y, y: k * Max(x, 0) - y, **more}))
    (said,) = said_at(report, -1.0)
    assert said in ({UN} if k > 0 else {AS, "undecided"} if more else {AS})


def test_12_2_the_border_of_a_plane_of_equilibria_is_not_passed_over() -> None:
    """The half plane x <= 0 of a field that leads away beyond it."""
    report = stability_report(System({x: y, y: Max(x, 0) - y, z: 0 * z}))
    found = [item.answer for item in report.items if isinstance(item.equilibrium, EquilibriumSet)]
    assert set(found) <= {UN, "undecided"}


@pytest.mark.parametrize("seed", DRAWS)
def test_12_2_one_state_on_a_kink_forced_and_clocked(seed: int) -> None:
    """The sides have the factors exp(2 pi (a + b)), exp(2 pi (a - b)), then x+ = r x + q |x|."""
    rng = np.random.default_rng([4, seed])
    a, b, r, q = tenths(rng, -0.3, 0.2), tenths(rng, -0.3, 0.3), tenths(rng, -1.5, 1.5), tenths(rng, -1, 1)
    wave = {0: cos(t), 1: sin(t)}[seed % 2]
    field = {x: a * x + b * (1 + wave) * Abs(x) + tenths(rng, -2, 2) * wave * x}
    clock = [TimeEvent("clock", period=2 * sympy.pi, start=2 * sympy.pi, reset={x: r * x + q * Abs(x)})]
    factor = {side: math.exp(2 * math.pi * float(a + side * b)) for side in (1, -1)}
    assert answers(System(field)) == {AS if max(factor.values()) < 1 else UN} or max(factor.values()) == 1
    signed = {side: (side * float(r) + float(q)) * factor[side] for side in (1, -1)}
    # Where each side comes after a period, and after two.
    grown = [abs(v) for side, v in signed.items() if v * side > 0]
    if not grown:
        grown = [math.sqrt(abs(signed[1] * signed[-1]))] if signed[1] < 0 < signed[-1] else [0.0]
    if abs(max(grown) - 1) > 1e-3:
        assert answers(System(field, time_events=clock)) == {AS if max(grown) < 1 else UN}


def rate(A: np.ndarray, b: np.ndarray, c: np.ndarray, turns: int = 12, steps: int = 800) -> float:
    """The largest growth of x' = A x + b |c x| cos t in the last half of the turns, from 48 directions."""
    angles = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    X, size, dt = np.array([np.cos(angles), np.sin(angles)]), np.zeros(48), 2 * np.pi / steps
    for k in range(turns * steps):
        middle = X + 0.5 * dt * (A @ X + np.outer(b, np.abs(c @ X)) * math.cos(k * dt))
        X = X + dt * (A @ middle + np.outer(b, np.abs(c @ middle)) * math.cos((k + 0.5) * dt))
        length = np.hypot(*X)
        X = X / length
        size += np.log(length) * (k >= turns * steps // 2)
    return float(np.max(size)) / (np.pi * turns)


@pytest.mark.parametrize("seed", DRAWS)
def test_12_2_forced_kinks_in_the_plane_follow_their_motions(seed: int) -> None:
    rng = np.random.default_rng([5, seed])
    A, b, c = (np.round(rng.uniform(-1.2, 1.0, shape), 1) for shape in ((2, 2), 2, 2))
    A, c = A - 0.2 * np.eye(2), c if np.any(c) else np.ones(2)
    h = sum(sympy.Rational(str(q)) * s for q, s in zip(c, (x, y), strict=True))
    field = {
        s: sum(sympy.Rational(str(round(q, 1))) * e for q, e in zip(A[i], (x, y), strict=True))
        + sympy.Rational(str(b[i])) * Abs(h) * cos(t)
        for i, s in enumerate((x, y))
    }
    grows = rate(A, b, c)
    if abs(grows) > 0.02:
        assert answers(System(field)) <= {AS if grows < 0 else UN, "undecided"}


def test_12_2_a_kink_beside_forced_sliding_is_left_open() -> None:
    field = {x: -(2 + sin(t)) * sign(x), y: (-y - 2 * Abs(y)) * (1 + sin(t) / 2)}
    assert answers(System(field)) <= {UN, "undecided"}
