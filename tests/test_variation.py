"""Transition matrices of stiff modes against the matrix exponential; derivatives of a motion by parts of what
is known of it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from filippov import System, parameters, sign, solve, states
from filippov.analysis.sensitivity import saltation
from filippov.analysis.sensitivity.variation import mode_field, transition

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
    got = transition(
        mode_field(LINEAR, ()), start, np.full(count, h), lambda t: np.ones((t.size, 3)), a.ravel()
    )[:3, :3]
    exact = expm(a * h * count)
    np.testing.assert_allclose(got, exact, atol=1e-11 * (1 + np.max(np.abs(exact))))


@pytest.mark.parametrize("step", [0.01, -0.01])
def test_14_6_transition_of_a_mode_that_turns_fast(step: float) -> None:
    a = np.array([[-1.0, 200.0, 0.0], [-200.0, -1.0, 3.0], [0.0, 0.0, -40.0]])
    ones = lambda t: np.ones((t.size, 3))  # noqa: E731
    got = transition(mode_field(LINEAR, ()), step * np.arange(3), np.full(3, step), ones, a.ravel())
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
