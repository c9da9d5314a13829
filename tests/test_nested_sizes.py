"""|.|, Min, Max and signs inside each other: the mode at a state, at the start and along the way.

Reference: the same expressions evaluated as they are written, and a solver with steps too short for kinks.
"""

import os

import numpy as np
import pytest
import sympy as sp
from scipy.integrate import solve_ivp

from filippov import Abs, Max, Min, System, sign, solve, solve_many, states
from filippov.analysis.orbits.oddness import is_odd
from filippov.analysis.orbits.saddle import _signs
from filippov.analysis.sensitivity.variation import signs_at

DRAWS = {"default": 8, "ci": 8}.get(os.environ.get("FILIPPOV_PROFILE", "default"), 400)
x, y = states("x y")


def _nested(random: np.random.Generator, depth: int) -> sp.Expr:
    """A continuous expression of kinks inside each other, with slopes of about 1."""
    if depth == 0:
        return random.choice([x, y, x + y, x - 2 * y]) + sp.Rational(int(random.integers(-8, 9)), 7)
    inner = _nested(random, depth - 1)
    kind = random.integers(4)
    shift = sp.Rational(int(random.integers(1, 16)), 9)
    if kind == 0:
        return Abs(inner) - shift
    if kind == 1:
        return Min(inner, shift - inner / 2, _nested(random, 0))
    return Max(inner - shift, -inner) if kind == 2 else Abs(inner - Abs(_nested(random, 0))) - shift


def _plain(expression: sp.Expr) -> object:
    return sp.lambdify((x, y), expression, "math")


@pytest.mark.parametrize("depth", [1, 2, 3, 4])
def test_the_mode_at_the_start_is_that_of_the_state(depth: int) -> None:
    random = np.random.default_rng(depth)
    for _ in range(DRAWS // 4):
        one, two = _nested(random, depth), _nested(random, depth)
        if one.is_number or two.is_number or not (one.free_symbols and two.free_symbols):
            continue
        system = System({x: one, y: sign(two)})
        f, g = _plain(one), _plain(two)
        for start in random.normal(size=(4, 2)) * 2:
            if abs(g(*start)) < 1e-3:
                continue
            span = 1e-6
            solution = solve(system, start, (0, span))
            rate = (solution.x_end - start) / span
            assert solution.success
            assert rate == pytest.approx([f(*start), np.sign(g(*start))], abs=1e-4), (one, two, start)
            given = np.zeros(0)
            h, signs = signs_at(system, np.zeros(1), start[None, :], given)
            written = [float(q.h.subs({x: start[0], y: start[1]})) for q in system.surfaces]
            # Where the terms of a surface cancel it is 0 to their rounding; others show how large they are.
            rounding = 1e-15 * max(1.0, *map(abs, written), *map(abs, h[0]))
            assert h[0] == pytest.approx(written, rel=1e-12, abs=1e-12 + rounding)
            near = 1e-9 * (1.0 + float(np.max(np.abs(start))))
            assert _signs(system, start, given, near) == tuple(signs[0])
        ends = solve_many(system, [start] * 3, (0, span))
        assert np.allclose((ends.x - start) / span, rate, atol=1e-4)


@pytest.mark.parametrize("depth", [2, 3])
def test_kinks_in_kinks_against_short_steps(depth: int) -> None:
    random = np.random.default_rng(10 + depth)
    for _ in range(DRAWS // 8):
        field = [_nested(random, depth) - x / 2, _nested(random, depth) - y / 2]
        f, g = (_plain(e) for e in field)
        start = random.normal(size=2) * 2
        exact = solve_ivp(
            lambda _, s, f=f, g=g: [f(*s), g(*s)], (0, 2), start, "RK45", rtol=1e-10, atol=1e-10,
            max_step=5e-4,
        )  # fmt: skip
        solution = solve(System(dict(zip((x, y), field, strict=True))), start, (0, 2), rtol=1e-10)
        assert solution.success
        assert solution.x_end == pytest.approx(exact.y[:, -1], abs=2e-5), (field, start)


def test_oddness_sees_sizes_inside_surfaces() -> None:
    """Odd is y' = -x - sgn(y (2 - |x|) + x ||y| - 1|); with |x| + x in the place of |x| it is not."""

    def odd(size: sp.Expr) -> bool:
        system = System({x: y, y: -x - sign(y * (2 - size) + x * Abs(Abs(y) - 1))})
        return is_odd(system, np.zeros(0), np.ones(2), 0.0, 0.0)

    assert odd(Abs(x))
    assert not odd(Abs(x) + x)
