"""Several relays and kinks around one plant: constructed members, and motions by small steps."""

from __future__ import annotations

import os

import numpy as np
import pytest
import sympy
from scipy.linalg import expm

from filippov import Abs, System, sign, states
from filippov.analysis.local_stability.stability import certify, stability_report

DRAWS = {"nightly": 40, "ci": 4}.get(os.environ.get("FILIPPOV_PROFILE", ""), 2)
NAMES = states("x y z w")


def exact(a: np.ndarray) -> sympy.Matrix:
    return sympy.Matrix(a.shape[0], a.shape[1], [sympy.Rational(str(e)) for e in a.ravel()])


def loop(A: np.ndarray, B: np.ndarray, C: np.ndarray, kinks: list[bool]) -> System:
    """x' = A x + B w, w_k = sign(c_k x) or |c_k x|."""
    x = sympy.Matrix(NAMES[: len(A)])
    y = exact(C) * x
    w = sympy.Matrix([Abs(q) if kink else sign(q) for q, kink in zip(y, kinks, strict=True)])
    return System(dict(zip(x, exact(A) * x + exact(B) * w, strict=True)))


def told(system: System) -> bool:
    """Whether x = 0 has this certificate."""
    return any(
        c is not None and c.reach == "global" and "integrals of the feedbacks" in c.theorem
        for _, c in certify(system)
    )


def ends(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, kinks: list[bool], dt: float, length: int = 40
) -> float:
    """The largest |x| of 4 motions at the end, from states of size 5."""
    n, m = B.shape
    big = np.zeros((n + m, n + m))
    big[:n] = np.hstack([A, B]) * dt
    step = expm(big)
    rng = np.random.default_rng(0)
    q = rng.uniform(-5, 5, (n, 4))
    kink = np.array(kinks)[:, None]
    for _ in range(int(length / dt)):
        y = C @ q
        q = step[:n, :n] @ q + step[:n, n:] @ np.where(kink, np.abs(y), np.sign(y))
    return float(np.max(np.abs(q)))


@pytest.mark.parametrize("seed", range(DRAWS))
def test_12_11_two_feedbacks_certified_for_all_motions_decay(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    A = np.round(rng.uniform(-1, 1, (n, n)) - rng.uniform(0.5, 1.5) * np.eye(n), 1)
    C = np.round(rng.uniform(-1, 1, (2, n)), 1)
    C[[0, 1], [0, 1]] = 1.0
    B = np.round(-C.T * rng.uniform(0.3, 1.5, 2) + rng.uniform(-0.5, 0.5, (n, 2)), 1)
    kinks = [bool(e) for e in rng.random(2) < 0.5]
    B[:, kinks] *= 0.5
    B = np.round(B, 2)
    if told(loop(A, B, C, kinks)):
        last = ends(A, B, C, kinks, 4e-3)
        # What is left is the chatter of held signs, or decays slowly.
        later, finer = ends(A, B, C, kinks, 4e-3, 80), ends(A, B, C, kinks, 5e-4)
        assert last < 0.05 or min(later, finer) < 0.5 * last


@pytest.mark.parametrize("seed", range(DRAWS))
def test_12_11_passive_plants_with_two_relays_are_certified(seed: int) -> None:
    """B = -P^-1 C^T with A^T P + P A < 0: V = x . P x falls whatever the strength of the relays."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    L = np.tril(rng.integers(-1, 2, (n, n)), -1) + np.eye(n, dtype=int)
    inverse = np.linalg.inv(L @ L.T).round().astype(int)  # whole numbers: det L = 1
    J = np.triu(rng.integers(-2, 3, (n, n)), 1)
    A = inverse @ (J - J.T - np.diag(rng.integers(1, 3, n)))
    C = rng.integers(-2, 3, (2, n))
    C[[0, 1], [0, 1]] += 3
    assert told(loop(A, -inverse @ C.T, C, [False, False]))


def test_12_11_relays_of_order_two_tie_the_function() -> None:
    """C B = 0 for both: relays on the positions of two damped oscillators, coupled without symmetry."""
    A = np.array([[0, 1, 0, 0], [-1, -1, 0, 0.2], [0, 0, 0, 1], [0, -0.2, -2, -1]])
    B = np.array([[0, 0], [-1, 0], [0, 0], [0, -1]])
    C = np.array([[1, 0, 0, 0], [0, 0, 1, 0]])
    assert told(loop(A, B, C, [False, False]))
    assert ends(A, B.astype(float), C.astype(float), [False, False], 1e-3) < 0.1


def test_12_11_a_repelling_relay_is_not_certified() -> None:
    A, C = -np.eye(2), np.eye(2)
    assert not told(loop(A, np.array([[1, 0], [0, -1]]), C, [False, False]))


def lossy(seed: int, masses: int, more: int) -> tuple[System, np.ndarray]:
    """Damped masses with friction on springs, and relaxing states that they drive: (system, signs' columns).

    Any J - J^T with positive R has the energy |x|^2/2 falling; a spring's q' = v makes one direction of rest.
    """
    rng = np.random.default_rng(seed)
    n = 2 * masses + more
    J = np.triu(rng.integers(-2, 3, (n, n)), 1)
    J[:masses] = 0
    R = np.diag(np.append(np.zeros(masses), rng.integers(1, 3, n - masses)))
    J[np.arange(masses), np.arange(masses, 2 * masses)] = 1
    A = J - J.T - R
    C = np.eye(n, dtype=int)[masses : 2 * masses]
    B = -C.T * rng.integers(1, 4, masses)
    x = sympy.Matrix(states("q1 q2 v1 v2 w1 w2")[:n] if masses == 2 else states("q1 v1 w1 w2 w3")[:n])
    w = sympy.Matrix([sign(e) for e in sympy.Matrix(C) * x])
    return System(dict(zip(x, sympy.Matrix(A) * x + sympy.Matrix(B) * w, strict=True))), A


@pytest.mark.parametrize(("masses", "more"), [(1, 2), (1, 3), (2, 1), (2, 2)])
@pytest.mark.parametrize("seed", range(DRAWS))
def test_12_12_sets_on_several_surfaces_and_in_high_dimension(seed: int, masses: int, more: int) -> None:
    """By construction every motion comes to rest; the report says so of the whole set."""
    system, _ = lossy(seed, masses, more)
    held = [i for i in stability_report(system, budget=60.0).items if i.equilibrium.dimension == masses]
    assert [i.answer for i in held] == ["asymptotically stable"]


def test_12_12_a_set_from_which_a_state_runs_away_is_not_certified() -> None:
    q, v, p, u, w = states("q v p u w")
    rows = {q: v, v: -q - v - sign(v) + w, p: u, u: -p - u - sign(u), w: w / 2 - v}
    assert all(i.answer != "asymptotically stable" for i in stability_report(System(rows)).items)
