"""Boundary equilibria of the plane at their critical value, by a rule in closed form and solutions by hand.

f = A x on h > 0 vanishes on the surface, b on h < 0 leads onto it (Filippov 1988, section 19; boundary focus
and node of Kuznetsov, Rinaldi & Gragnani 2003, 3.1-3.2, at alpha = 0). On the surface the sliding field is
sigma y with sigma = a22 - a12 b2/b1; an eigenvalue > 0 of A leads away; else every solution comes to the
half line that slides.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

from filippov import Surface, System, cos, states, t
from filippov.analysis import stability_report

X, Y = states("x y")
Array = np.ndarray[Any, Any]


def drawn(seed: int) -> tuple[Array, Array] | None:
    """A and b, clear of the borders of the rule."""
    r = np.random.default_rng([1, seed])
    a, b = np.round(r.normal(size=(2, 2)), 2), np.round(r.normal(size=2), 2)
    b[0] = abs(b[0]) + 0.01
    values = np.linalg.eigvals(a)
    turns = abs(values[0].imag) > 0.02
    real = abs(values[0].imag) == 0 and np.min(np.abs(values)) > 0.02
    clear = abs(slide(a, b)) > 0.02 and abs(a[0, 1]) > 0.05 and (turns or real)
    return (a, b) if clear else None


def slide(a: Array, b: Array) -> float:
    return float(a[1, 1] - a[0, 1] * b[1] / b[0])


def rule(a: Array, b: Array) -> str:
    values = np.linalg.eigvals(a)
    away = abs(values[0].imag) == 0 and np.max(values.real) > 0
    return "unstable" if away or slide(a, b) > 0 else "asymptotically stable"


def system(a: Array, b: Array, turn: Array, size: float = 1.0, more: tuple[Any, Any] = (0, 0)) -> System:
    """In coordinates z = turn x, sides exchanged where the determinant of turn is negative."""
    x = sympy.Matrix(np.linalg.inv(turn)) * sympy.Matrix([X, Y])
    above = sympy.Matrix(turn) * (sympy.Matrix(a) * x + sympy.Matrix(more))
    below = sympy.Matrix(turn @ b * size)
    h = x[0] if np.linalg.det(turn) > 0 else -x[0]
    fields = {"+": list(above), "-": list(below)} if h == x[0] else {"-": list(above), "+": list(below)}
    return System.from_modes([Surface("edge", h)], fields, [X, Y])


def answer(found: System) -> tuple[str, str]:
    """Of the point at 0, with the statements."""
    (item,) = [
        i for i in stability_report(found).items if max(abs(float(v)) for v in i.equilibrium.value) < 1e-9
    ]
    return item.answer, " | ".join(s.text for s in item.statements)


@pytest.mark.parametrize("start", range(0, 160, 40))
def test_random_points_have_the_verdict_of_the_rule(start: int) -> None:
    seen = []
    for seed in range(start, start + 40):
        given = drawn(seed)
        if given is not None:
            seen.append(rule(*given))
            assert answer(system(*given, np.eye(2)))[0] == seen[-1], (seed, given)
    assert {"asymptotically stable", "unstable"} == set(seen)


TURNS = [[[0, 1], [-1, 0]], [[-1, 0], [0, 1]], [[1, 0.5], [0.25, 1]], [[1e3, 0], [0, 1e-3]]]


@pytest.mark.parametrize("turn", TURNS)
def test_in_other_coordinates_and_units(turn: list[list[float]]) -> None:
    for seed in range(12):
        given = drawn(seed)
        if given is not None:
            assert answer(system(*given, np.array(turn)))[0] == rule(*given), seed


def by_hand(a: Array, b: Array, bend: float, start: Array) -> float:
    """The distance from 0 after a time 60/|sigma|: f above, then the sliding field, one after the other."""
    def above(t: float, x: Array) -> Array:
        return np.asarray(a @ x + [0, bend * x[0] ** 2])

    def slides(t: float, x: Array) -> Array:
        f, g = above(t, np.array([0, x[1]])), b
        share = g[0] / (g[0] - f[0])
        return np.array([0.0, share * f[1] + (1 - share) * g[1]])

    def met(t: float, x: Array) -> float:
        return float(x[0])

    met.terminal, met.direction = True, -1.0  # type: ignore[attr-defined]
    end, options = 60 / abs(slide(a, b)), {"rtol": 1e-11, "atol": 1e-16}
    run = solve_ivp(above, (0, end), start, events=met, **options)
    if run.t_events[0].size:
        run = solve_ivp(slides, (run.t[-1], end), run.y[:, -1], **options)
    return float(np.linalg.norm(run.y[:, -1]))


@pytest.mark.parametrize("growth", [-0.3, 0.0, 0.4, 2.0])
@pytest.mark.parametrize("sigma", [-0.5, 0.5])
def test_a_focus_of_any_growth_attracts_where_the_sliding_field_does(growth: float, sigma: float) -> None:
    a, b = np.array([[growth, -1.0], [1.0, growth]]), np.array([1.0, sigma - growth])
    found, why = answer(system(a, b, np.eye(2), more=(0, 0.3 * X**2)))
    assert slide(a, b) == pytest.approx(sigma)
    assert found == ("asymptotically stable" if sigma < 0 else "unstable"), why
    ends = [by_hand(a, b, 0.3, 1e-4 * np.array([np.cos(q), np.sin(q)])) for q in (-1.5, -0.7, 0, 0.7, 1.5)]
    assert (max(ends) < 1e-8) == (sigma < 0)


def test_what_the_rule_does_not_hold_for_has_another_reason() -> None:
    """A field that moves with time, one that is not differentiable at the point, a line along the surface."""
    below = {"-": [1, -2]}
    above = [-Y * (2 + cos(3 * t)), X - Y]
    assert "turns solutions" not in answer(System.from_modes([X], {"+": above} | below, [X, Y]))[1]
    above = [-Y, X - sympy.sign(Y) * sympy.sqrt(abs(Y))]
    assert "turns solutions" not in answer(System.from_modes([X], {"+": above} | below, [X, Y]))[1]
    assert "slide to it" not in answer(System.from_modes([X], {"+": [-X, X - Y]} | below, [X, Y]))[1]
