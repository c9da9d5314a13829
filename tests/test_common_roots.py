"""Common roots of two polynomials and the equilibria that they are: all, against lines and a search."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import root
from verdict_draws import CUBE, RELAY, Draw, relays

from filippov.analysis.steady.common_roots import common_roots, real_roots
from filippov.analysis.steady.equilibria import equilibria

u, v = sympy.symbols("u v", real=True)
tenth = st.integers(-30, 30).map(lambda k: sympy.Rational(k, 10))
line = st.tuples(tenth, tenth, tenth).filter(lambda c: c[0] != 0 or c[1] != 0)


@settings(max_examples=60, deadline=None)
@given(first=st.lists(line, min_size=1, max_size=3), second=st.lists(line, min_size=1, max_size=3))
def test_12_3_products_of_lines_meet_where_their_lines_do(first: list, second: list) -> None:
    known = set()
    for (a, b, c), (d, e, f) in itertools.product(first, second):
        determinant = a * e - b * d
        if determinant == 0 and a * f - c * d == 0 and b * f - c * e == 0:
            known = None
            break
        if determinant != 0:
            known.add(((c * e - b * f) / determinant, (a * f - c * d) / determinant))
    products = [sympy.expand(sympy.prod([a * u + b * v - c for a, b, c in each])) for each in (first, second)]
    found = common_roots(*products, u, v)
    if known is None:
        assert found is None
        return
    exact = sorted((float(p), float(q)) for p, q in known)
    assert len(found) == len(exact)
    places = sorted((float(p), float(q)) for p, q in found)
    assert np.array(places) == pytest.approx(np.array(exact), abs=1e-9)


def test_12_3_what_are_no_polynomials_with_rational_coefficients_has_no_common_roots_here() -> None:
    assert common_roots(sympy.sin(u) - v, u - v, u, v) is None
    assert common_roots(u - 0.1 * v, u * v - 1, u, v) is None
    assert common_roots(u**2 + v**2 + 1, u - v, u, v) == []
    assert [float(r) for r in real_roots(sympy.Poly((u - 1) * (u - 2) * (u**2 + 1), u))] == [1.0, 2.0]


def at_rest(a: Draw) -> list[np.ndarray]:
    """Equilibria by Newton's method from 5 starts an axis in each mode: the states, each once."""
    n, found = len(a.A), []
    for mode in itertools.product((1, -1, 0), repeat=2):
        on = [j for j in range(2) if mode[j] == 0]

        def residual(y: np.ndarray, mode: tuple[int, ...] = mode, on: list[int] = on) -> np.ndarray:
            x, feed = y[:n], np.array([*map(float, mode), *(a.C[2:] @ y[:n]) ** 3])
            feed[on] = y[n:]
            return np.append(a.A @ x + a.g + a.B @ feed, a.C[on] @ x)

        axes = [np.linspace(-6, 6, 5)] * n + [[-0.7, 0.7]] * len(on)
        for start in itertools.product(*axes):
            solved = root(residual, start, tol=1e-13)
            y = solved.x
            inside = all(m * (c @ y[:n]) > 1e-9 for m, c in zip(mode, a.C, strict=False) if m)
            if not (np.max(np.abs(residual(y))) < 1e-10 and inside and np.all(np.abs(y[n:]) <= 1)):
                continue
            if all(np.max(np.abs(y[:n] - other)) > 1e-6 for other in found):
                found.append(y[:n])
    return found


@pytest.mark.parametrize("seed", [15, 75, 270])
def test_12_3_reports_on_cubes_and_relays_have_all_equilibria(seed: int) -> None:
    """Draws whose modes were searched numerically, or not at all as the budget was spent."""
    a = relays(np.random.default_rng([12, 6, seed]))
    assert a.phi[:2] == (RELAY, RELAY)
    assert set(a.phi[2:]) == {CUBE}
    found = equilibria(a.system(), budget=15.0)
    assert found.complete
    assert not found.sets
    places = [np.array(e.value) for e in found.points]
    assert all(min(np.max(np.abs(x - y)) for y in places) < 1e-7 for x in at_rest(a))
    form = a.system().symbolic
    for e in found.points:
        on = iter(e.s_value)
        put = dict(zip(form.x, e.value, strict=True))
        put |= {s: {"+": 1, "-": -1}.get(c) or next(on) for s, c in zip(form.s, e.mode, strict=True)}
        assert max(abs(float(f.subs(put))) for f in form.field) < 1e-9
