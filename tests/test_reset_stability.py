"""Equilibria on surfaces with resets in dimension 3 and 4: against motions followed reset by reset."""

from __future__ import annotations

import os

import numpy as np
import pytest
import sympy
from scipy.linalg import expm

from filippov import Surface, System, TimeEvent, parameters, states
from filippov.analysis.local_stability.stability import certify, stability_report

DRAWS = {"nightly": 40, "ci": 3}.get(os.environ.get("FILIPPOV_PROFILE", ""), 2)
NAMES = states("q v w u")
AS, UN = "asymptotically stable", "unstable"


def grown(A: np.ndarray, R: np.ndarray, one_sided: bool, length: float = 120.0) -> float:
    """Largest log |x| of x' = A x, x+ = R x where x_1 changes its sign (or falls below 0), from 6 states."""
    dt = 2e-3
    E = expm(A * dt)
    rng = np.random.default_rng(0)
    out = []
    for _ in range(6):
        x = rng.standard_normal(len(A))
        x[0] = abs(x[0])
        total = 0.0
        for k in range(int(length / dt)):
            y = E @ x
            if x[0] * y[0] < 0 or (one_sided and y[0] < 0):
                # Linear between the ends of the step: where x_1 = 0.
                part = x[0] / (x[0] - y[0]) if x[0] != y[0] else 0.0
                at = x + part * (y - x)
                at[0] = 0.0
                y = expm(A * dt * (1 - part)) @ (R @ at)
                if one_sided and y[0] < 0:
                    # Pressed onto the wall: x_1 and its rate stay 0 for this step.
                    y[0] = y[1] = 0.0
            x = y
            if k % 200 == 0:
                size = float(np.linalg.norm(x))
                if size < 1e-200:
                    return -np.inf
                total, x = total + np.log(size), x / size
        out.append(total)
    return max(out)


def exact(a: np.ndarray) -> sympy.Matrix:
    return sympy.Matrix(a.shape[0], a.shape[1], [sympy.Rational(str(e)) for e in a.ravel()])


def family(seed: int, wall: bool) -> tuple[System, np.ndarray, np.ndarray]:
    """A linear field with a surface x_1 = 0: a wall with restitution, or a state that is set to 0 there."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 5))
    A = np.round(rng.uniform(-1, 1, (n, n)) - rng.uniform(0.2, 1.0) * np.eye(n), 1)
    A[0] = 0.0
    A[0, 1] = 1.0
    if wall:
        A[1, 0] = -round(float(rng.uniform(0.5, 3)), 1)
    else:
        A[0, 0], A[0, -1] = -0.5, 1.0
    R = np.eye(n)
    e = round(float(rng.uniform(0, 0.9)), 1)
    if wall:
        R[1, 1] = -e
    else:
        R[-1, -1] = 0.0
    x = sympy.Matrix(NAMES[:n])
    reset = {NAMES[1]: -sympy.Rational(str(e)) * NAMES[1]} if wall else {NAMES[n - 1]: 0}
    surface = Surface("zero", NAMES[0], reset=reset, side="+" if wall else "both")
    return System(dict(zip(x, exact(A) * x, strict=True)), surfaces=[surface]), A, R


def verdict(system: System) -> str:
    for item in stability_report(system, budget=60.0).items:
        value = getattr(item.equilibrium, "value", None)
        if value is not None and max(map(abs, value)) < 1e-9:
            return item.answer
    return "missing"


@pytest.mark.parametrize("wall", [True, False])
@pytest.mark.parametrize("seed", range(DRAWS))
def test_12_12_what_no_reset_raises_decays(seed: int, wall: bool) -> None:
    system, A, R = family(seed, wall)
    slowest = -float(np.max(np.linalg.eigvals(A).real))
    if slowest > 0.05 and verdict(system) == AS:
        assert grown(A, R, wall) < 0


def test_12_12_first_order_reset_element_around_an_oscillator() -> None:
    """A lag that is set to 0 at zero error, around 1/(s^2 + s + 1), as in Beker et al. 2004."""
    q, v, w = NAMES[:3]
    rows = {q: v, v: -q - v - w / 2, w: q - w}
    surface = Surface("error", q, reset={w: 0}, side="both")
    assert np.max(np.linalg.eigvals(np.array([[0, 1, 0], [-1, -1, -0.5], [1, 0, -1.0]])).real) < 0
    found = [c for _, c in certify(System(rows, surfaces=[surface])) if c is not None]
    assert [c.answer for c in found] == [AS]
    assert "reset" in found[0].theorem


def test_12_12_resets_that_raise_the_state_have_no_such_function() -> None:
    q, v, w = NAMES[:3]
    rows = {q: v, v: -q - v / 5, w: -w}
    system = System(rows, surfaces=[Surface("kick", q, reset={v: 2 * v}, side="both")])
    assert verdict(system) != AS
    A = np.array([[0, 1, 0], [-1, -0.2, 0], [0, 0, -1.0]])
    assert grown(A, np.diag([1.0, 2.0, 1.0]), one_sided=False) > 0


@pytest.mark.parametrize("e", [0.3, 0.9, 1.1])
def test_12_12_a_reset_with_a_kink_where_it_rests(e: float) -> None:
    """v+ = e |v| is v+ = -e v at every impact on a floor."""
    q = sympy.Rational(str(e))
    y, v = states("y v")
    floor = Surface("floor", y, reset={v: q * sympy.Abs(v)})
    (item,) = stability_report(System({y: v, v: -9}, surfaces=[floor])).items
    assert item.answer == ("asymptotically stable" if e < 1 else "unstable")


@pytest.mark.parametrize("factor", [-1.4, -0.6, 0.7, 1.3])
def test_12_12_a_clock_with_a_kink_at_the_equilibrium(factor: float) -> None:
    """x+ = a |x| after x' = -x/100: from either side it goes to that of a, and its size changes by |a|."""
    a = sympy.Rational(str(factor))
    y, v = states("y v")
    clock = [TimeEvent("clock", period=1, reset={y: a * sympy.Abs(y)})]
    (item,) = stability_report(System({y: -y / 100}, time_events=clock)).items
    assert item.answer == ("unstable" if abs(factor) > 1 else "asymptotically stable")
    (item,) = stability_report(System({y: -y / 100, v: -v}, time_events=clock)).items
    assert item.answer == "undecided"


@pytest.mark.parametrize("duty", [1.0, 0.5, 0.0, -1.0])
@pytest.mark.parametrize("ratio", [1, "parameter"])
def test_a_clock_that_holds_a_switch_where_nothing_balances(duty: float, ratio: object) -> None:
    """x' = E - (r - q) a x with q = duty after every tick: x = E/(a (r - duty)), none where duty is r."""
    p = parameters(E=2.0, a=3.0, r=1.0)
    x, q = states("x q")
    r = p.r if ratio == "parameter" else 1
    clock = TimeEvent("clock", period=0.1, reset={q: duty})
    system = System({x: p.E - (r - q) * p.a * x, q: 0 * q}, parameters=p, time_events=[clock])
    found = stability_report(system)
    at = [item.equilibrium.value for item in found.items]
    assert at == ([] if duty == 1.0 else [pytest.approx((2 / (3 * (1 - duty)), duty))])
