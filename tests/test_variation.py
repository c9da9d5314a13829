"""Transition matrices of stiff modes against the matrix exponential; derivatives of a motion by parts of what
is known of it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from filippov import Surface, System, cos, parameters, sign, sin, solve, sqrt, states
from filippov import t as time
from filippov.analysis import find_orbit, flow_derivative
from filippov.analysis.sensitivity import saltation
from filippov.analysis.sensitivity.variation import mode_field, transitions

Q = states("q1 q2 q3")
P = parameters(**{f"a{i}{j}": 0.0 for i in range(3) for j in range(3)})
LINEAR = System({q: sum(P[f"a{i}{j}"] * r for j, r in enumerate(Q)) for i, q in enumerate(Q)})
# Eigenvalues of A times a step: one that decays fast, several of one size, a pair that turns, of two sizes.
STIFF = [
    (-280.0, -0.02, 0.1), (-70.0, -2.0, 0.5), (-31.0, -1.0, 0.0), (-20.0, 0.3, -0.1), (-6.0, -0.4, 1.0),
    (-120.0, -100.0, -0.3), (-150.0, -35.0, 0.2), (-0.2, 0.1, 0.25), (-1e4, -0.5, 0.0),
]  # fmt: skip


@pytest.mark.parametrize("count", [1, 5])
@pytest.mark.parametrize("z", STIFF)
def test_14_6_transition_of_a_stiff_mode_is_the_matrix_exponential(z: tuple[float, ...], count: int) -> None:
    draw = np.random.default_rng(int(-10 * z[0]))
    basis = np.linalg.qr(draw.standard_normal((3, 3)))[0] @ np.diag([1.0, 2.0, 0.5])
    h = 0.01
    a = basis @ np.diag(z) @ np.linalg.inv(basis) / h
    start = h * np.arange(count)
    ones = lambda t: np.ones((t.size, 3))  # noqa: E731
    spans = [(start, np.full(count, h))]
    got = transitions(mode_field(LINEAR, ()), spans, ones, a.ravel())[0][:3, :3]
    exact = expm(a * h * count)
    np.testing.assert_allclose(got, exact, atol=1e-11 * (1 + np.max(np.abs(exact))))


@pytest.mark.parametrize("step", [0.01, -0.01])
def test_14_6_transition_of_a_mode_that_turns_fast(step: float) -> None:
    a = np.array([[-1.0, 200.0, 0.0], [-200.0, -1.0, 3.0], [0.0, 0.0, -40.0]])
    ones = lambda t: np.ones((t.size, 3))  # noqa: E731
    spans = [(step * np.arange(3), np.full(3, step))]
    got = transitions(mode_field(LINEAR, ()), spans, ones, a.ravel())[0]
    np.testing.assert_allclose(got[:3, :3], expm(3 * step * a), rtol=1e-11, atol=1e-12)


def test_14_6_derivatives_by_fewer_parameters_are_parts_of_those_by_more() -> None:
    x, v = states("x v")
    p = parameters(k=1.0, d=0.1, F=0.2)
    system = System({x: v, v: -p.k * x - p.d * v - p.F * sign(v)})
    run = solve(system, (2.0, 0.0), (0.0, 9.0))
    whole = saltation.derivative_by_all(run, names=("F", "k"))
    for names in ((), ("k",), ("k", "F")):
        part = saltation.derivative_by_all(run, names=names)
        saltation._KEPT.clear()
        alone = saltation.derivative_by_all(run, names=names)
        np.testing.assert_allclose(part, alone, rtol=1e-13, atol=1e-14)
        saltation.derivative_by_all(run, names=("F", "k"))
    saltation._KEPT.clear()
    reach = 1e-6
    for k, (name, value) in enumerate((("F", 0.2), ("k", 1.0))):
        ends = [
            solve(system, (2.0, 0.0), (0.0, 9.0), parameters={name: value + side * reach}).x_end
            for side in (1.0, -1.0)
        ]
        np.testing.assert_allclose(whole[:2, 2 + k], (ends[0] - ends[1]) / (2 * reach), rtol=1e-4, atol=1e-5)


def _forced_mass() -> System:
    x, v, a = states("x v a")
    p = parameters(F=0.4)
    force = 0.9 * x + 0.6 * sin(a)
    return System({x: v, v: -force - p.F * sign(v), a: 1.3}, surfaces=[Surface("velocity", v)])


@pytest.mark.parametrize("span", [(0.0, 23.0), (23.0, 0.0)])
def test_14_6_intervals_of_a_solution_have_the_derivative_of_the_whole(span: tuple[float, float]) -> None:
    """Cut anywhere, at events too: the product of the intervals, and each against a solution of its own."""
    backward = span[1] < span[0]
    # Backwards through sliding solutions are not unique.
    smooth = System({Q[0]: Q[1], Q[1]: -Q[0] - 0.3 * sin(Q[2]), Q[2]: 1.0})
    system = smooth if backward else _forced_mass()
    run = solve(system, (2.0, 0.1, 0.0), span, rtol=1e-11, atol=1e-13, backward=backward)
    assert run.success
    draws = np.sort(np.random.default_rng(3).uniform(0.3, 22.7, 9))
    at = [*draws, *(e.t for e in run.events[:4] if e.t not in span)]
    cuts = [*(sorted(at, reverse=backward)), span[1]]
    found = saltation.flow_derivatives(run, cuts)
    assert not any(isinstance(part, saltation.NotDifferentiableError) for part in found)
    product = np.eye(3)
    for part in found:
        product = part @ product
    whole = saltation.flow_derivative(run)
    np.testing.assert_allclose(product, whole, rtol=0, atol=1e-9 * np.max(np.abs(whole)))
    begin = span[0]
    for end, part in zip(cuts, found, strict=True):
        if not any(abs(e.t - q) < 1e-6 for e in run.events for q in (begin, end)):
            alone = solve(system, run.sol(begin), (begin, end), rtol=1e-11, atol=1e-13, backward=backward)
            np.testing.assert_allclose(part, saltation.flow_derivative(alone), rtol=0, atol=1e-7)
        begin = end


def test_14_6_an_interval_without_a_derivative_leaves_the_others_theirs() -> None:
    """x and y reach 0 at once, at t = 2; what z does between depends on which is first."""
    x, y, z = states("x y z")
    system = System({x: 1 + 0 * x, y: 1 + 0 * y, z: sign(x) * sign(y) - z})
    run = solve(system, (-2.0, -2.0, 0.5), (0.0, 4.0))
    with pytest.raises(saltation.NotDifferentiableError, match="order"):
        saltation.flow_derivative(run)
    found = saltation.flow_derivatives(run, [1.0, 1.5, 2.5, 3.5])
    told = [isinstance(part, saltation.NotDifferentiableError) for part in found]
    assert told == [False, False, True, False]
    np.testing.assert_allclose(found[3], np.diag([1.0, 1.0, np.exp(-1.0)]), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("turns", "size"),
    [(0, 1.0), (160, 1.0), (500, 1.0), (5000, 1.0), (0, 1e-9), (0, 1e6)],
)
@pytest.mark.parametrize("derivative", ["dual", "difference"])
def test_derivatives_of_functions_that_vary_over_any_length(turns: int, size: float, derivative: str) -> None:
    """A pendulum with friction against a moving pivot after whole turns, and in other units of its angle.

    Its derivative is the same everywhere. Here it is that of the symbolic twin at 0.
    """
    q, w = states("q w")
    twin = System({q: w, w: -sin(q) - 0.3 * sign(w - 0.2 * sin(time)) - 0.1 * w + 0.2 * cos(3 * time)})
    exact = flow_derivative(solve(twin, (1.0, 0.3), (0, 6), rtol=1e-10, atol=1e-12))

    def field(t: float, x: Any, p: Any, s: Any) -> list[float]:
        if derivative == "difference":
            x = [float(v) for v in x]  # which takes no dual numbers
        acceleration = -math.sin(x[0] / size) - 0.3 * s[0] - 0.1 * x[1] / size + 0.2 * math.cos(3 * t)
        return [x[1], size * acceleration]

    pivot = Surface("pivot", lambda t, x, p: x[1] - 0.2 * size * math.sin(t))
    start = (size * (1.0 + 2 * math.pi * turns), 0.3 * size)
    system = System(field=field, surfaces=[pivot], states="q w")
    run = solve(system, start, (0, 6), rtol=1e-10, atol=1e-12 * size)
    np.testing.assert_allclose(flow_derivative(run), exact, atol=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_12_12_along_sliding_of_second_order_the_multiplier_carries_what_disturbs_it(seed: int) -> None:
    """Super-twisting holds x = z = 0 with s = q w/k2, w = w0 exp(-a t), and u' = -k2 s (1 + w)."""
    k1, k2, q, a, w0, end = np.random.default_rng(seed).uniform([1.5, 1.2, 0.2, 0.3, 0.3, 0.5], 2.0).round(3)
    x, z, w, u = states("x z w u")
    p = parameters(k1=k1, k2=k2, q=0.5 * q, a=a)
    pull = p.k2 * sign(x)
    held = {x: -p.k1 * sqrt(abs(x)) * sign(x) + z, z: p.q * w - pull}
    system = System({**held, w: -p.a * w, u: -pull * (1 + w)})
    run = solve(system, (0, 0, 0.5 * w0, 0), (0, end), rtol=1e-11, atol=1e-13)
    q, w0 = 0.5 * q, 0.5 * w0
    # u = -q (w0 E(a) + w0**2 E(2 a)), E(b) = (1 - exp(-b t))/b.
    once, twice = (-math.expm1(-b * end) / b for b in (a, 2 * a))
    assert run.x_end[3] == pytest.approx(-q * (w0 * once + w0**2 * twice), abs=1e-11)
    by_a = [(end * math.exp(-b * end) - e) / b for b, e in ((a, once), (2 * a, twice))]
    exact = [-q * (once + 2 * w0 * twice), 1.0, -w0 * once - w0**2 * twice, 0.0]
    exact.append(-q * (w0 * by_a[0] + 2 * w0**2 * by_a[1]))
    got = flow_derivative(run, parameters=("q", "k2", "a"))
    np.testing.assert_allclose(got[3, 2:], exact, atol=1e-9)


def test_12_12_where_two_signs_hold_one_rate_their_sum_carries_what_is_left() -> None:
    """Twisting at x = v = 0, disturbed by y: y' = x + v - y goes on by itself."""
    x, v, y = states("x v y")
    system = System({x: v, v: -2 * sign(x) - sign(v) - 0.3 * v + y / 10, y: x + v - y})
    run = solve(system, (0, 0, 1), (0, 1.5), rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(flow_derivative(run)[:, 2], [0.0, 0.0, math.exp(-1.5)], atol=1e-10)


def test_12_12_an_orbit_on_sliding_of_second_order_has_the_multipliers_of_what_moves_on_it() -> None:
    """x = z = 0 is held with 2 s = cos t, so that u' = -u - cos t, u = -(cos t + sin t)/2."""
    x, z, u = states("x z u")
    twist = {x: -1.5 * sqrt(abs(x)) * sign(x) + z, z: -2 * sign(x) + cos(time)}
    orbit = find_orbit(System({**twist, u: -u - 2 * sign(x)}), (0, 0, -0.3), period=2 * math.pi)
    assert orbit.x0 == pytest.approx([0, 0, -(math.cos(orbit.t0) + math.sin(orbit.t0)) / 2], abs=1e-9)
    assert orbit.multipliers == pytest.approx([math.exp(-2 * math.pi), 0, 0], abs=1e-9)
    assert orbit.stable
