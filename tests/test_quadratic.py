"""Quadratic Lyapunov functions by linear matrix inequalities: against motions, and examples from papers."""

from __future__ import annotations

import itertools
import os

import numpy as np
import pytest
import sympy
from scipy.linalg import expm

from filippov import Abs, Surface, System, sign, states
from filippov.analysis.local_stability.certificates import decide, quadratic
from filippov.analysis.local_stability.certificates.matrix_inequality import positive_definite, rounded
from filippov.analysis.local_stability.stability import stability_report

DRAWS = {"nightly": 60, "ci": 4}.get(os.environ.get("FILIPPOV_PROFILE", ""), 2)
NAMES = states("x y z")
AS = "asymptotically stable"


def growth(matrices: dict[tuple[int, ...], np.ndarray], c: np.ndarray, length: float = 60.0) -> float:
    """Largest logarithm of the growth of motions of x' = A x, A by the signs of c x, from 8 starts."""
    dt = 2e-3
    order = list(matrices)
    steps = np.array([expm(matrices[s] * dt) for s in order])
    place = np.zeros((2,) * len(c), dtype=int)
    for k, signs in enumerate(order):
        place[tuple((q + 1) // 2 for q in signs)] = k
    rng = np.random.default_rng(0)
    q = rng.standard_normal((8, c.shape[1]))
    total = -np.log(np.linalg.norm(q, axis=1)) * 0
    for k in range(int(length / dt)):
        on = (q @ c.T >= 0).astype(int)
        q = np.einsum("sij,sj->si", steps[place[tuple(on.T)]], q)
        if k % 100 == 0:
            size = np.linalg.norm(q, axis=1)
            total, q = total + np.log(size), q / size[:, None]
    return float(np.max(total))


def random_cones(rng: np.random.Generator, kind: str) -> tuple[System, dict, np.ndarray]:
    """x' = (A + sum of B_k sign(c_k x)) x in the plane or in space; of kinks B_k = b_k c_k."""
    n, m = int(rng.integers(2, 4)), int(rng.integers(1, 3))
    x = sympy.Matrix(NAMES[:n])
    A = np.round(rng.uniform(-1.5, 1.5, (n, n)) - rng.uniform(0.3, 1.5) * np.eye(n), 1)
    c = np.round(rng.uniform(-1, 1, (m, n)), 1)
    c[np.arange(m), rng.permutation(n)[:m]] = 1.0
    B = []
    rows = exact(A) * x
    for k in range(m):
        h = (exact(c[k : k + 1]) * x)[0]
        if kind == "kinks":
            b = np.round(rng.uniform(-1, 1, (n, 1)), 1)
            B.append(b @ c[k : k + 1])
            rows += exact(b) * Abs(h)
        else:
            B.append(np.round(rng.uniform(-0.7, 0.7, (n, n)), 1))
            rows += exact(B[-1]) * x * sign(h)
    cells = itertools.product((1, -1), repeat=m)
    matrices = {s: A + sum((q * e for q, e in zip(s, B, strict=True)), np.zeros((n, n))) for s in cells}
    return System(dict(zip(x, rows, strict=True))), matrices, c


def exact(a: np.ndarray) -> sympy.Matrix:
    return sympy.Matrix(a.shape[0], a.shape[1], [sympy.Rational(str(e)) for e in a.ravel()])


def alone(system: System, monkeypatch: pytest.MonkeyPatch) -> str:
    """The verdict on x = 0 by this certificate and by nothing else."""
    told: list[str] = []

    def asked(found):
        certificate = quadratic.quadratic(found)
        told.append("" if certificate is None else certificate.answer)
        return certificate

    monkeypatch.setattr(decide, "POINTS", (asked,))
    for item in stability_report(system, budget=60.0).items:
        value = getattr(item.equilibrium, "value", None)
        if value is not None and max(map(abs, value)) < 1e-9:
            return told[-1] if told else item.answer
    return "missing"


@pytest.mark.parametrize("kind", ["kinks", "sides"])
@pytest.mark.parametrize("seed", range(DRAWS))
def test_12_11_what_has_a_quadratic_function_decays(
    kind: str, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    system, matrices, c = random_cones(np.random.default_rng(seed), kind)
    if alone(system, monkeypatch) == AS:
        assert growth(matrices, c) < 0


def test_12_11_flower(monkeypatch: pytest.MonkeyPatch) -> None:
    """Johansson & Rantzer 1998: no common quadratic function, but one by pieces."""
    x, y = states("x y")
    tall, flat = {x: -0.1 * x + y, y: -5 * x - 0.1 * y}, {x: -0.1 * x + 5 * y, y: -x - 0.1 * y}
    fields = {"++": tall, "--": tall, "+-": flat, "-+": flat}
    assert (
        alone(System.from_modes([Surface("a", x - y), Surface("b", x + y)], fields, [x, y]), monkeypatch)
        == AS
    )
    other = {"++": flat, "--": flat, "+-": tall, "-+": tall}  # its mirror: each side is left the long way
    said = alone(System.from_modes([Surface("a", x - y), Surface("b", x + y)], other, [x, y]), monkeypatch)
    A = {s: np.array([[-0.1, 5.0], [-1.0, -0.1]] if s[0] == s[1] else [[-0.1, 1.0], [-5.0, -0.1]])
         for s in itertools.product((1, -1), repeat=2)}  # fmt: skip
    assert said == (AS if growth(A, np.array([[1.0, -1.0], [1.0, 1.0]])) < 0 else "")


def test_12_11_sliding_away_between_two_stable_fields_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """Both fields are Hurwitz and both press on y = 0, where the mean of the two grows: no V may exist."""
    x, y = states("x y")
    plus, minus = sympy.Matrix([[1, 6], [-1, -2]]), sympy.Matrix([[1, -6], [1, -2]])
    for A in (plus, minus):
        assert np.max(np.linalg.eigvals(np.array(A.tolist(), dtype=float)).real) < 0
    column = sympy.Matrix([x, y])
    # For x > 0 y = 0 attracts, and on it x' = x.
    fields = {"+": dict(zip((x, y), plus * column, strict=True)),
              "-": dict(zip((x, y), minus * column, strict=True))}  # fmt: skip
    assert alone(System.from_modes([Surface("a", y)], fields, [x, y]), monkeypatch) != AS


def test_12_11_without_the_solver_the_report_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    system, _, _ = random_cones(np.random.default_rng(3), "sides")
    monkeypatch.setattr(decide, "POINTS", (quadratic.quadratic,))
    for module in (decide, quadratic):
        monkeypatch.setattr(module, "available", lambda: False)
    (item,) = [i for i in stability_report(system).items if not i.equilibrium.dimension]
    assert item.answer == "undecided"
    assert any("filippov[certificates]" in s.text for s in item.statements)


def test_12_11_pivots_decide_as_roots_do() -> None:
    rng = np.random.default_rng(1)
    for _ in range(100):
        n = int(rng.integers(1, 6))
        q = rng.integers(-3, 4, (n, n))
        m = sympy.Matrix(q + q.T + int(rng.integers(0, 8)) * np.eye(n, dtype=int))
        least = np.min(np.linalg.eigvalsh(np.array(m.tolist(), dtype=float)))
        if abs(least) > 1e-9:
            assert positive_definite(m) == (least > 0)
    assert not positive_definite(sympy.Matrix([[1, 1], [1, 1]]))
    assert rounded(np.array([[1 / 3]]), 3) == sympy.Matrix([[sympy.Rational(333, 1000)]])
