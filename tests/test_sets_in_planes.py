"""Sets of rests of two and three masses, cut by kinks, relays and walls, against the inclusion at each place.

The oracle knows no modes: friction holds a mass where the force on it is within its level, a contact holds
one that is pressed against it. What is listed has to hold exactly these places, and no set may be empty.
"""

from __future__ import annotations

import itertools
import os
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pytest
import sympy

from filippov import Max, Surface, System, sign, solve, states
from filippov.analysis import equilibria, stability_report
from filippov.analysis.steady.equilibrium import EquilibriumSet

Array = npt.NDArray[np.float64]
Q, V = states("x y z"), states("u v w")
DRAWS = range({"nightly": 150}.get(os.environ.get("FILIPPOV_PROFILE", ""), 5))
CLOSE = 1e-6


@dataclass
class Masses:
    """M = 1, springs K, friction levels; a push of size `by` on mass 0 beyond x = `at`, or a wall there."""

    K: Array
    level: Array
    kind: str
    at: float
    by: float

    @classmethod
    def draw(cls, seed: int) -> Masses:
        rng = np.random.default_rng([77, seed])
        n = 2 if seed % 4 else 3
        half = np.round(rng.uniform(-1, 1, (n, n)), 1)
        K = half + half.T + 4 * np.eye(n)
        kind = ("kink", "relay", "wall", "wall behind", "far")[int(rng.integers(5))]
        at = 3.0 if kind == "far" else float(np.round(rng.uniform(-0.3, 0.3), 2))
        by = float(np.round(rng.uniform(-1.5, 1.5), 1))
        return cls(K, np.round(rng.uniform(0.3, 1.5, n), 1), kind, at, by)

    def system(self) -> System:
        n = len(self.level)
        x, at = Q[0], sympy.Rational(repr(self.at))
        by = sympy.Rational(repr(self.by))
        push = {"kink": by * Max(x - at, 0), "relay": by * sign(x - at) / 4}.get(self.kind, 0)
        force = [
            -sum(sympy.Rational(repr(float(k))) * q for k, q in zip(row, Q, strict=False))
            - sympy.Rational(repr(float(mu))) * sign(v)
            for row, mu, v in zip(self.K, self.level, V, strict=False)
        ]
        force[0] += push
        walls = []
        if self.kind in {"wall", "wall behind", "far"}:
            h = x - at if self.kind != "wall behind" else at - x
            walls = [Surface("wall", h, reset={V[0]: -V[0] / 2})]
        field = dict(zip(Q[:n], V[:n], strict=True))
        return System(field | dict(zip(V[:n], force, strict=True)), surfaces=walls)

    def rests(self, q: Array) -> bool:
        """Whether places off x = at are at rest."""
        force = -self.K @ q
        if self.kind == "kink":
            force[0] += self.by * max(q[0] - self.at, 0.0)
        if self.kind == "relay":
            force[0] += self.by * np.sign(q[0] - self.at) / 4
        return bool(np.all(np.abs(force) <= self.level))

    def rests_on(self, q: Array) -> bool:
        """The same at x = at, with what may hold it there: the relay's values, the wall's push."""
        low = high = -self.K @ q
        low, high = low - self.level, high + self.level
        if self.kind == "relay":
            low[0], high[0] = low[0] - abs(self.by) / 4, high[0] + abs(self.by) / 4
        if self.kind in {"wall", "far"}:
            high[0] = np.inf
        if self.kind == "wall behind":
            low[0] = -np.inf
        return bool(np.all(low <= 0) and np.all(high >= 0))


def holds(e: EquilibriumSet, q: Array) -> bool:
    """Whether a set with affine formulas holds these places."""
    n, k = len(q), len(e.free)
    place = sympy.lambdify(list(e.free), list(e.x)[:n])
    middle = np.array(place(*[0] * k), dtype=float)
    slopes = np.array([np.array(place(*one), dtype=float) - middle for one in np.eye(k)]).T
    c, *_ = np.linalg.lstsq(slopes, q - middle, rcond=None)
    if np.max(np.abs(slopes @ c + middle - q)) > CLOSE:
        return False
    # What a place leaves open, as shares of two contacts, is looked for along the null space.
    _, sizes, rows = np.linalg.svd(slopes)
    null = rows[np.sum(sizes > 1e-12) :]
    sides = [sympy.lambdify(list(e.free), g.gts - g.lts) for g in e.conditions]
    shares = itertools.product(np.linspace(-4, 4, 161), repeat=len(null))
    return any(
        all(g(*(c + np.array(share) @ null if len(null) else c)) >= -1e-9 for g in sides) for share in shares
    )


@pytest.mark.parametrize("seed", DRAWS)
def test_the_sets_hold_what_is_at_rest(seed: int) -> None:
    masses = Masses.draw(seed)
    n = len(masses.level)
    sets = [e for e in equilibria(masses.system()) if isinstance(e, EquilibriumSet)]
    rng = np.random.default_rng(seed)
    for _ in range(60):
        q = rng.uniform(-1, 1, n) * np.linalg.solve(masses.K, masses.level)
        margin = np.min(np.abs(np.abs(-masses.K @ q) - masses.level))
        if margin < 1e-3 or abs(q[0] - masses.at) < 1e-3:
            continue
        known = masses.rests(q)
        assert any(holds(e, q) for e in sets) == known, (q, masses)
    for _ in range(20):
        q = np.r_[masses.at, rng.uniform(-1, 1, n - 1)]
        known = [masses.rests_on(q + np.r_[0, d]) for d in (np.zeros(n - 1), 1e-3 + np.zeros(n - 1))]
        if known[0] == known[1] and masses.kind != "kink":
            assert any(holds(e, q) for e in sets) == known[0], (q, masses)
    for e in sets:
        # None is empty: what is inside is at rest.
        inside = dict(zip(e.free, e.inner, strict=True))
        q = np.array([s.subs(inside) for s in e.x[:n]], dtype=float)
        on = abs(q[0] - masses.at) < 1e-9
        assert masses.rests_on(q) if on else masses.rests(q), (e, masses)


@pytest.mark.parametrize("seed", DRAWS)
def test_a_plane_of_equilibria_is_cut_where_its_stability_changes(seed: int) -> None:
    """x' = g(y, z) x or x'' = g x' - k(y, z) x beside a plane of rests: verdicts place by place."""
    rng = np.random.default_rng([78, seed])
    x, y, z = Q
    u = V[0]
    a, b, c = (sympy.Rational(round(10 * q), 10) for q in rng.uniform(-1, 1, 3))
    g = [a + y - b * z, y**2 + z**2 - c**2 - sympy.Rational(1, 10), a + b * y**2 - z, -1 - y**2 + 0 * z][
        int(rng.integers(4))
    ]
    if rng.random() < 0.5:
        field, roots = {x: g * x, y: 0, z: 0}, (lambda q: [g.subs(q)])
    else:
        field = {x: u, u: g * u - (2 + z) * x, y: 0, z: 0}

        def roots(q: dict[sympy.Symbol, float]) -> list[complex]:
            return list(np.roots([1.0, -float(g.subs(q)), float(2 + q[z])]))

    items = [i for i in stability_report(System(field)).items if i.equilibrium.x[0] == 0]
    for _ in range(40):
        at = dict(zip((y, z), rng.uniform(-3, 3, 2), strict=True))
        real = max(complex(r).real for r in roots(at))
        if abs(real) < 1e-3 or abs(2 + at[z]) < 1e-3:
            continue
        holding = [i for i in items if all(bool(q.subs(at)) for q in i.equilibrium.conditions)]
        known = "unstable" if real > 0 else "asymptotically stable"
        assert holding, at
        for i in holding:
            # Where another set crosses this one, it attracts together with that one only, if that attracts.
            crossed = any("it touches" in q.text for q in i.statements)
            told = {"stable", "undecided"} if known != "unstable" and crossed else {known}
            assert i.answer in told, (at, i.answer, g)


def test_sliding_beside_a_plane_that_attracts_in_part() -> None:
    """Friction whose level is negative at some places: no verdict from one of them."""
    x, y, _z = Q
    u, v, _ = V
    level = y + sympy.Rational(1, 5)
    system = System({x: u, y: v, u: -2 * x + y - level * sign(u) / 2, v: -2 * y + x - sign(v) / 2})
    (item,) = stability_report(system).items
    assert item.answer == "undecided"
    # Beside y < -1/5 it is left, beside others it is not.
    for place, moves in ((-0.4, True), (0.1, False)):
        start = (place / 2, place, 1e-6, 0.0)
        run = solve(system, start, (0, 3), zeno="continue", throw=False)
        assert (np.max(np.abs(run["u"])) > 1e-3) == moves
