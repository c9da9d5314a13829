"""Homoclinic orbits against closed forms: sech, piecewise linear planar systems, a planar pseudo-saddle."""

from math import pi, sqrt

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from filippov import System, UsageError, parameters, sign, states
from filippov.analysis.orbits.homoclinic import find_homoclinic
from filippov.analysis.orbits.shooting import NoConvergenceError, ReturnError

x, v = states("x v")


@pytest.mark.parametrize("start", [0.03, -0.1])
def test_12_13_the_homoclinic_orbit_of_duffings_equation(start: float) -> None:
    """x'' = x - x^3 + mu x': mu = 0 and x = sqrt(2)/cosh(t)."""
    p = parameters(mu=0.0)
    found = find_homoclinic(
        System({x: v, v: x - x**3 + p.mu * v}), (0.01, 0.0), free="mu", parameters={"mu": start}, side=1
    )  # fmt: skip
    assert abs(found.value) < 1e-12
    assert found.saddle.x == pytest.approx([0, 0], abs=1e-14)
    assert found.saddle.eigenvalues.real == pytest.approx([1, -1], abs=1e-12)
    t = np.concatenate([np.linspace(*piece.problem.t_span, 40) for piece in found.pieces])
    y = np.hstack([piece.sol(np.linspace(*piece.problem.t_span, 40)) for piece in found.pieces])
    # Where x'/x = -tanh(t - middle) vanishes is the middle.
    middle = brentq(lambda at: np.interp(at, t, y[1]), t[np.argmax(y[0])] - 1, t[np.argmax(y[0])] + 1)
    exact = sqrt(2) / np.cosh(t - middle)
    assert np.max(np.abs(y[0] - exact)) < 1e-3
    assert np.max(np.abs(y[1] ** 2 - y[0] ** 2 + 0.5 * y[0] ** 4)) < 1e-7


def right(damping: float, stiffness: float, centre: float, start: float) -> float:
    """Speed at which x'' = -stiffness (x - centre) + damping x' comes back to x = 0 from (0, start)."""
    matrix = np.array([[0, 1], [-stiffness, damping]])

    def place(t: float) -> np.ndarray:
        return expm(matrix * t) @ [-centre, start]

    grid = np.linspace(0, 3 * pi / sqrt(stiffness), 400)[1:]
    signs = np.array([place(t)[0] + centre for t in grid])
    if not np.any(signs < 0):
        return 0.0
    k = int(np.flatnonzero(signs < 0)[0])
    t = brentq(lambda q: place(q)[0] + centre, grid[k - 1], grid[k], xtol=1e-15)
    return float(place(t)[1])


@pytest.mark.parametrize(
    ("c", "stiffness", "centre"), [(0.3, 1.0, 0.4), (-0.5, 2.0, 0.1), (0.1, 0.7, -0.2), (-0.2, 1.5, 0.9)]
)
def test_12_13_piecewise_linear_saddles(c: float, stiffness: float, centre: float) -> None:
    """A saddle at x = -1 in x < 0, a focus in x > 0: eigenvectors and matrix exponentials."""
    p = parameters(mu=0.0)
    left, side = x + 1 + c * v, sign(x)
    focus = -stiffness * (x - centre) + p.mu * v
    system = System({x: v, v: (1 - side) / 2 * left + (1 + side) / 2 * focus})
    out, back = 0.5 * c + sqrt(0.25 * c**2 + 1), 0.5 * c - sqrt(0.25 * c**2 + 1)
    known = brentq(lambda mu: right(mu, stiffness, centre, out) - back, -1.2, 1.2, xtol=1e-14)
    found = find_homoclinic(
        system, (-1.0, 0.0), free="mu", parameters={"mu": known + 0.03}, side=1
    )  # fmt: skip
    assert found.value == pytest.approx(known, abs=1e-9)
    assert found.modes == ("-", "+", "-")
    assert found.saddle.eigenvalues.real == pytest.approx([out, back], rel=1e-12)


def landing(mu: float, b: float) -> float:
    """Where the spiral from the fold of y = 0 about (1, b) lands on y = 0 again."""
    matrix = np.array([[mu, -1.0], [1.0, mu]])

    def place(t: float) -> np.ndarray:
        return expm(matrix * t) @ [mu * b, -b] + [1.0, b]

    grid = np.linspace(0.5, 2 * pi, 300)
    k = int(np.flatnonzero([place(t)[1] < 0 for t in grid])[0])
    t = brentq(lambda q: place(q)[1], grid[k - 1], grid[k], xtol=1e-15)
    return float(place(t)[0])


@pytest.mark.parametrize("start", [-0.1, -0.02, -0.005, 0.005, 0.02, 0.1])
def test_12_13_a_guess_that_is_nearest_to_the_saddle_beside_a_border(start: float) -> None:
    """x'' = x for x < 1, else 2 - x + mu x': with mu = 0 energy is kept, and the loop closes."""
    p = parameters(mu=0.0)
    loop = System({x: v, v: x + (2 - 2 * x) * (1 + sign(x - 1)) / 2 + p.mu * v})
    found = find_homoclinic(loop, (0, 0), free="mu", parameters={"mu": start}, mode="-")
    assert abs(found.value) < 1e-12


@pytest.mark.parametrize("b", [0.5, 0.8])
@pytest.mark.parametrize("beside", [-0.04, -0.031, -0.02, -0.01, 0.02])
def test_12_13_a_pseudo_saddle_of_a_planar_system(b: float, beside: float) -> None:
    """Out along the sliding motion, off at the fold, round, and down on the pseudo-saddle in finite time.

    On one side of the value the guess goes round a cycle, and lands at one place again and again.
    """
    p, (u, w) = parameters(mu=0.1), states("u w")
    above = (p.mu * (u - 1) - (w - b), (u - 1) + p.mu * (w - b))
    below, side = (-b + 0.5 * u, 1.0), sign(w)
    system = System(
        {q: (1 + side) / 2 * f + (1 - side) / 2 * g for q, f, g in zip((u, w), above, below, strict=True)}
    )

    def rest(mu: float) -> float:
        """Where the sliding motion stands still: both fields are parallel."""
        return brentq(
            lambda at: (mu * (at - 1) + b) * 1.0 - (-b + 0.5 * at) * (at - 1 - mu * b), -0.4, 0.6, xtol=1e-15
        )

    known = brentq(lambda mu: landing(mu, b) - rest(mu), 0.02, 0.6, xtol=1e-14)
    found = find_homoclinic(
        system, (rest(known), 0.0), free="mu", parameters={"mu": known + beside}, mode="0", side=1
    )  # fmt: skip
    assert found.value == pytest.approx(known, abs=1e-9)
    assert found.modes == ("0", "+")
    assert found.saddle.x == pytest.approx([rest(known), 0.0], abs=1e-9)
    assert len(found.saddle.eigenvalues) == 1


def test_12_13_what_is_no_saddle_or_does_not_return_is_told() -> None:
    p = parameters(mu=0.0)
    with pytest.raises(NoConvergenceError, match="expected a saddle"):
        find_homoclinic(System({x: v, v: -x + p.mu * v}), (0.01, 0.0), free="mu")
    with pytest.raises(ReturnError, match="does not come back"):
        find_homoclinic(System({x: v, v: x + p.mu * v}), (0.0, 0.0), free="mu", t_max=20.0)
    with pytest.raises(UsageError, match="mode"):
        find_homoclinic(System({x: v, v: x + p.mu * sign(v)}), (0.0, 0.0), free="mu", mode="+x")
    with pytest.raises(UsageError, match="side"):
        find_homoclinic(System({x: v, v: x + p.mu * v}), (0.0, 0.0), free="mu", side=2)


@pytest.mark.parametrize(("T", "D", "up", "c"), [(0.62, 0.34, 1.16, 0.16), (0.57, 0.45, 1.35, 0.66)])
def test_12_13_solutions_that_escape_or_shrink_into_two_folds_are_no_way_back(
    T: float, D: float, up: float, c: float
) -> None:
    """u' = T u - v, v' = up - D u, a saddle in u > 0: on u = 0 its lines are at v = u0 times its eigenvalues.

    Beside its orbit solutions from it escape to 1e300, or circle the folds at 0 in ever smaller cycles.
    """
    u = x
    p = parameters(m=0.0)
    side = (1 + sign(u)) / 2
    push = side * (up - D * u) + (1 - side) * (2 * u - c)
    system = System({u: (T * side + p.m * (1 - side)) * u - v, v: push})
    u0, eigenvalues = up / D, np.sort(np.roots([1, -T, -D]))

    def missed(m: float) -> float:
        matrix = np.array([[m, -1, 0], [2, 0, -c], [0, 0, 0]])
        out = np.array([0, u0 * eigenvalues[1], 1])
        grid = np.linspace(0, 3, 200)[1:]
        k = next(i for i, t in enumerate(grid) if (expm(matrix * t) @ out)[0] > 0)
        t = brentq(lambda q: (expm(matrix * q) @ out)[0], grid[k - 1], grid[k], xtol=1e-15)
        return float((expm(matrix * t) @ out)[1] - u0 * eigenvalues[0])

    value = brentq(missed, -1.2, -0.7, xtol=1e-14)
    found = find_homoclinic(system, (u0, T * u0), free="m", mode="+", parameters={"m": value + 0.01})
    assert abs(found.value - value) < 1e-10
