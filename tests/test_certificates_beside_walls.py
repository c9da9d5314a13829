"""Masses with friction and loops with one nonlinearity beside surfaces that reset, against solutions.

Certificates made from the field alone know nothing of resets: walls that give more than they take, that push
another mass, that turn a state round. What is called stable is followed from states near it, what holds for
all solutions from states far off.
"""

from __future__ import annotations

import os

import numpy as np
import numpy.typing as npt
import pytest
import sympy
from scipy.optimize import lsq_linear

from filippov import Max, Min, Surface, System, sign, solve, states
from filippov.analysis import certify, stability_report
from filippov.analysis.steady.equilibrium import EquilibriumPoint, EquilibriumSet

Array = npt.NDArray[np.float64]
Equilibrium = EquilibriumPoint | EquilibriumSet
x, v, y, w = states("x v y w")
AS, ST, UN = "asymptotically stable", "stable", "unstable"
DRAWS = range({"nightly": 300}.get(os.environ.get("FILIPPOV_PROFILE", ""), 3))
HALF = sympy.Rational(1, 2)
# Bounces from a height r have speeds of sqrt(r), so near is within some of these.
R, NEAR, FAR = 1e-5, 10.0, 4.0


def tenths(rng: np.random.Generator, low: float, high: float) -> sympy.Rational:
    return sympy.Rational(round(10 * rng.uniform(low, high)), 10)


def one_of(rng: np.random.Generator, *choices: object) -> object:
    return choices[int(rng.integers(len(choices)))]


def masses(rng: np.random.Generator) -> System:
    """One or two masses with springs and friction, and a wall in the rests, at their end, or off them."""
    k, b = tenths(rng, 0.5, 2), tenths(rng, 0, 0.6)
    e = one_of(rng, 0, HALF, 1, 3, 2)
    at = one_of(rng, 0, HALF / 2, -HALF / 2, HALF, 2)
    if rng.random() < 0.5:
        field = {x: v, v: -k * x - b * v - HALF * sign(v)}
        reset = one_of(rng, {v: -e * v}, {x: -x + 2 * at, v: -v}, {v: -e * v})
    else:
        c = tenths(rng, 0.3, 1)
        field = {
            x: v, y: w, v: -k * x - c * (x - y) - b * v - HALF * sign(v),
            w: -k * y - c * (y - x) - b * w - HALF * sign(w),
        }  # fmt: skip
        reset = one_of(
            rng, {v: -e * v}, {v: -e * v, w: w + 2 * v}, {w: 3 * w, v: -e * v},
            {v: (v + w) / 2, w: (v + w) / 2}, {v: w, w: v},
        )  # fmt: skip
    return System(field, surfaces=[Surface("wall", one_of(rng, 1, -1) * (x - at), reset=reset)])


def loop(rng: np.random.Generator) -> System:
    """A linear system with a nonlinearity in feedback, and a surface that resets one state."""
    n = int(rng.integers(2, 4))
    X = [x, y, w][:n]
    A = np.round(rng.uniform(-1, 1, (n, n)) - 1.3 * np.eye(n), 1)
    c = rng.integers(-1, 2, n)
    c[0] = c[0] if c.any() else 1
    out = sum(int(a) * q for a, q in zip(c, X, strict=True))
    into = [tenths(rng, -1, 1) for _ in X] if rng.random() < 0.5 else c.tolist()
    phi = one_of(rng, sign(out), Max(-1, Min(1, 2 * out)), out**3, Max(out - HALF, 0) + Min(out + HALF, 0))
    field = {
        q: sum(sympy.Rational(repr(float(a))) * p for a, p in zip(row, X, strict=True)) - g * phi
        for q, row, g in zip(X, A, into, strict=True)
    }
    i, j, at = int(rng.integers(n)), int(rng.integers(n)), one_of(rng, 0, 0, 1)
    grown = one_of(rng, -2, 2, -1, HALF, 3) * X[j]
    reset = {X[j]: grown if rng.random() < 0.7 else X[j] + 2 * X[(j + 1) % n]}
    h = X[i] - at + (X[(i + 1) % n] if rng.random() < 0.4 else 0)
    return System(field, surfaces=[Surface("wall", h, reset=reset)])


def distance(e: Equilibrium, rows: Array) -> Array:
    """How far states (k, n) are from an equilibrium, or from the box of a set that is affine."""
    if isinstance(e, EquilibriumPoint):
        return np.linalg.norm(rows - np.array(e.value), axis=1)
    place = sympy.lambdify(list(e.free), list(e.x))
    k = len(e.free)
    middle = np.array(place(*[0] * k), dtype=float)
    slopes = np.array([np.array(place(*one), dtype=float) - middle for one in np.eye(k)]).T
    low, high = np.array(e.bounds, dtype=float).T
    return np.array([
        np.linalg.norm(slopes @ lsq_linear(slopes, row - middle, (low, high)).x + middle - row)
        for row in rows
    ])  # fmt: skip


def one_rest(e: EquilibriumSet, rng: np.random.Generator) -> Array:
    """A state of a set, often at its border."""
    for _ in range(200):
        ends = [(max(low, -3.0), min(high, 3.0)) for low, high in e.bounds]
        share = rng.choice([0.0, 0.3, 0.8, 1.0, rng.random()], len(ends))
        c = [low + s * (high - low) for s, (low, high) in zip(share, ends, strict=True)]
        put = dict(zip(e.free, c, strict=True))
        if all(bool(q.subs(put)) for q in e.conditions):
            return np.array([q.subs(put) for q in e.x], dtype=float)
    return np.array(e.ends[int(rng.integers(len(e.ends)))].value)


def start(system: System, e: Equilibrium, reach: float, rng: np.random.Generator) -> Array:
    """A state so near to one of them, not beyond a surface on which it rests."""
    h = sympy.lambdify(list(system.symbolic.x), system.symbolic.h[0])
    at = np.array(e.value) if isinstance(e, EquilibriumPoint) else one_rest(e, rng)
    while True:
        z = at + reach * rng.uniform(-1, 1, len(at))
        if e.mode[0] != "0" or h(*z) >= 0:
            return z


def follow(
    system: System, e: Equilibrium, every: list[Equilibrium], reach: float, seed: int
) -> tuple[float, float]:
    """The largest distance from the equilibria in 6 solutions, and the largest at their ends."""
    rng = np.random.default_rng(seed)
    largest, last = 0.0, 0.0
    for _ in range(6):
        run = solve(
            system, start(system, e, reach, rng), (0, 60), zeno="continue", nonunique="stick", throw=False,
            max_events=4000,
        )  # fmt: skip
        some = run.y.T[:: max(1, run.y.shape[1] // 60)]
        away = np.min([distance(q, np.vstack([some, run.y.T[-1:]])) for q in every], axis=0)
        largest, last = max(largest, float(np.max(away))), max(last, float(away[-1]) if run.success else 0.0)
    return largest, last


@pytest.mark.parametrize("kind", [masses, loop])
@pytest.mark.parametrize("seed", DRAWS)
def test_what_is_called_stable_beside_a_wall_is(kind: object, seed: int) -> None:
    system = kind(np.random.default_rng([7, seed]))
    items = stability_report(system).items
    every = [item.equilibrium for item in items]
    for item in items:
        if item.answer in {AS, ST}:
            largest, last = follow(system, item.equilibrium, every, R, seed)
            assert largest <= NEAR * np.sqrt(R), (seed, item)
            assert item.answer == ST or last <= 0.5 * np.sqrt(R), (seed, item)
    for e, certificate in certify(system):
        if certificate is not None and certificate.reach == "global" and not e.behind:
            _, last = follow(system, e, every, FAR, seed)
            assert certificate.answer == ST or last <= 0.1 * FAR, (seed, certificate)


def test_walls_that_take_energy_leave_the_verdict_on_masses() -> None:
    """Newton's law with e <= 1 on one mass of two: the energy around each rest does not grow."""
    for e, known in ((0, AS), (HALF, AS), (1, AS), (2, "undecided")):
        field = {x: v, y: w, v: -2 * x + y - HALF * sign(v), w: -2 * y + x - HALF * sign(w)}
        system = System(field, surfaces=[Surface("wall", x - HALF / 4, reset={v: -e * v})])
        answers = {item.equilibrium.mode: item.answer for item in stability_report(system).items}
        assert answers["000"] == known, (e, answers)


def test_a_wall_off_the_rests_leaves_what_holds_near_them() -> None:
    field = {x: v, v: -x - HALF * sign(v)}
    system = System(field, surfaces=[Surface("wall", x - 2, reset={v: -3 * v})])
    found = {e.mode: certificate for e, certificate in certify(system)}
    assert found["-0"].answer == AS
    assert found["-0"].reach == "local"
    assert found.get("00") is None or found["00"].answer == UN
