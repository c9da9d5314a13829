"""Floquet verdicts on surfaces: families whose multipliers are known in closed form, and motions."""

from __future__ import annotations

import math
import os

import numpy as np
import pytest
import sympy

from filippov import System, TimeEvent, cos, sign, sin, solve, states, t
from filippov.analysis.local_stability.stability import stability_report

DRAWS = {"nightly": 60, "ci": 5}.get(os.environ.get("FILIPPOV_PROFILE", ""), 3)
NAMES = states("x y z")
AS, UN = "asymptotically stable", "unstable"


def verdict(system: System) -> tuple[str, str]:
    """The verdict on x = 0 and its first sentence."""
    for item in stability_report(system, budget=60.0).items:
        value = getattr(item.equilibrium, "value", None)
        if value is not None and max(map(abs, value)) < 1e-9:
            return item.answer, item.statements[0].text
    return "missing", ""


def tenths(rng: np.random.Generator, low: float, high: float, shape: tuple[int, ...]) -> sympy.Matrix:
    values = rng.integers(round(10 * low), round(10 * high) + 1, shape)
    return sympy.Matrix(shape[0], shape[1], [sympy.Rational(int(e), 10) for e in values.ravel()])


def family(seed: int, forced: bool, clock: bool) -> tuple[System, float]:
    """(system, modulus of the largest multiplier): surfaces u_i = 0, other states w, in other coordinates.

    u' = -N s + forces, w' = a(t) w + D s: on u = 0 w' = (a(t) + D N^-1 E) w with the forces E w. A reset u+ =
    g w, w+ = q w brings w to (q + D N^-1 g) w on the surfaces.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 4))
    k = int(rng.integers(1, n)) if n > 2 else 1
    m = n - k
    N = (
        tenths(rng, 0.5, 2, (k, k))
        if k == 1
        else sympy.Matrix([[2, 0.5], [-0.5, 2]]).applyfunc(sympy.nsimplify)
    )
    E, D, g = tenths(rng, -1, 1, (k, m)), tenths(rng, -1, 1, (m, k)), tenths(rng, -1, 1, (k, m))
    q = sympy.Rational(int(rng.integers(-15, 16)), 10) * sympy.eye(m) if clock else sympy.eye(m)
    rate = sympy.Rational(int(rng.integers(-8, 9)), 10)
    T = sympy.eye(n)
    T[0, n - 1] = sympy.Rational(int(rng.integers(-2, 3)), 2)
    T[n - 1, 0] = sympy.Rational(int(rng.integers(-1, 2)), 2)
    x = sympy.Matrix(NAMES[:n])
    old = T.inv() * x
    u, w = old[:k, :], old[k:, :]
    s = sympy.Matrix([sign(sympy.expand(e)) for e in u])
    wave = (rate + (cos(t) if forced else 0)) * sympy.eye(m)
    load = sympy.Matrix([sin(t) / 10 if forced and i == 0 else 0 for i in range(k)])
    # The load is borne by s = N^-1 load, whose share of w' is taken out again.
    rows = T * sympy.Matrix.vstack(load + E * w - N * s, wave * w + D * s - D * N.inv() * load)
    period = 2 * sympy.pi if forced else sympy.S.One
    events = []
    if clock:
        kept = T * sympy.Matrix.vstack(g * w, q * w)
        reset = {str(a): sympy.expand(b) for a, b in zip(x, kept, strict=True)}
        events = [TimeEvent("clock", period=period if not forced else float(period), reset=reset)]
    system = System(dict(zip(x, rows, strict=True)), time_events=events)
    N, E, D, g, q = (np.array(e.tolist(), dtype=float) for e in (N, E, D, g, q))
    slope = float(rate) * np.eye(m) + D @ np.linalg.solve(N, E)
    from scipy.linalg import expm

    flow = expm(slope * float(period))
    if clock:
        flow = (q + D @ np.linalg.solve(N, g)) @ flow
    return system, float(np.max(np.abs(np.linalg.eigvals(flow))))


@pytest.mark.parametrize(("forced", "clock"), [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize("seed", range(DRAWS))
def test_12_12_multipliers_on_surfaces_are_those_of_the_sliding_field(
    seed: int, forced: bool, clock: bool
) -> None:
    system, largest = family(seed, forced, clock)
    said, text = verdict(system)
    assert said == (AS if largest < 1 else UN)
    assert math.isclose(float(text.split("up to ")[1].split()[0]), largest, rel_tol=1e-4)


def test_12_12_motions_follow_the_multiplier() -> None:
    """x' = -sign x + y/2, y' = 0.3 y + sign(x)/2, each second x+ = g y, y+ = q y: followed by events."""
    x, y = NAMES[:2]
    for q, g in ((0.4, 0.5), (0.4, -1.0), (0.9, 0.5)):
        clock = TimeEvent("clock", period=1, reset={"x": g * y, "y": q * y})
        system = System({x: -sign(x) + y / 2, y: 0.3 * y + sign(x) / 2}, time_events=[clock])
        said, text = verdict(system)
        largest = float(text.split("up to ")[1].split()[0])
        run = solve(system, (0, 1e-3), (0, 4.5))
        per_turn = (abs(float(run.sol(4.5)[1])) / abs(float(run.sol(1.5)[1]))) ** (1 / 3)
        assert math.isclose(per_turn, largest, rel_tol=1e-2)
        assert said == (AS if per_turn < 1 else UN)


def test_12_12_surfaces_that_repel_for_a_while_are_left_open() -> None:
    """The load beats the relay at times: the point is none, or no verdict is given."""
    x, y = NAMES[:2]
    said, _ = verdict(System({x: -(0.5 + cos(t)) * sign(x), y: -y}))
    assert said in {"undecided", "missing"}
    said, _ = verdict(System({x: -sign(x) + 2 * sin(t), y: -y}))
    assert said in {"undecided", "missing"}
