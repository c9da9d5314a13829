"""What `find_orbit` returns is an orbit, however far its guess is from it, and whether or not it attracts."""

import numpy as np
import pytest
from sympy import Expr, Symbol

from filippov import Max, SolveError, System, cos, parameters, solve, states, t
from filippov.analysis.orbits.orbit_search import find_orbit
from filippov.base.arrays import Array


def member(seed: int) -> tuple[Array, Array, Array, Array, float, Array]:
    """A stable matrix, direction and normal of a kink, direction and frequency of the forcing, a guess."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    matrix = rng.normal(size=(n, n))
    matrix -= (np.linalg.eigvals(matrix).real.max() + rng.uniform(0.05, 0.3)) * np.eye(n)
    push, normal, forcing = rng.normal(size=(3, n))
    return matrix, push, normal, forcing, rng.uniform(0.5, 2), rng.normal(size=n) * 10 ** rng.uniform(-1, 12)


def linear(matrix: Array) -> dict[Symbol, Expr]:
    """A x, by state."""
    xs = states(" ".join(f"x{i}" for i in range(len(matrix))))
    rows = (sum(float(a) * x for a, x in zip(row, xs, strict=True)) for row in matrix)
    return dict(zip(xs, rows, strict=True))


@pytest.mark.parametrize("seed", range(12))
def test_a_linear_field_has_the_orbit_of_its_closed_form(seed: int) -> None:
    """x' = A x + e cos(w t), A with or without growing directions: x = Re (i w - A)^-1 e exp(i w t)."""
    matrix, _, _, forcing, w, guess = member(seed)
    n = len(matrix)
    matrix = matrix + (seed % 2) * 0.4 * np.eye(n)
    field = linear(matrix)
    system = System({x: field[x] + float(e) * cos(w * t) for x, e in zip(field, forcing, strict=True)})
    orbit = find_orbit(system, tuple(guess.tolist()))
    response = np.linalg.solve(1j * w * np.eye(n) - matrix, forcing)
    exact = (response * np.exp(1j * w * orbit.t0)).real
    assert abs(orbit.period - 2 * np.pi / w) < 1e-9
    np.testing.assert_allclose(orbit.x0, exact, rtol=0, atol=1e-8 * float(np.max(np.abs(response))))


@pytest.mark.parametrize("seed", range(16))
def test_an_orbit_across_a_kink_comes_back_or_is_refused(seed: int) -> None:
    """x' = A x - b k Max(c x - g, 0) + e cos(w t), beyond whose kink solutions may grow without bound."""
    matrix, push, normal, forcing, w, guess = member(100 + seed)
    p = parameters(k=2.0, w=w)
    field = linear(matrix)
    kink = p.k * Max(sum(float(c) * x for c, x in zip(normal, field, strict=True)) - 0.3, 0)
    parts = zip(field.items(), push, forcing, strict=True)
    system = System(
        {x: f - float(b) * kink + float(e) * cos(p.w * t) for (x, f), b, e in parts}, parameters=p
    )
    try:
        orbit = find_orbit(system, tuple(guess.tolist()))
    except SolveError:
        return
    span = (orbit.t0, orbit.t0 + orbit.period)
    back = solve(system, x0=orbit.x0, t_span=span, rtol=1e-12, atol=1e-13)
    growth = max(1.0, float(np.max(np.abs(orbit.multipliers))))
    assert back.success
    assert np.max(np.abs(back.x_end - orbit.x0)) < 1e-8 * growth * (1.0 + np.max(np.abs(orbit.x0)))
