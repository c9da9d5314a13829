"""Masses with dry friction that springs do not hold: rings and chains without a wall."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from scipy.linalg import eigh

from filippov import System, parameters, sign, solve, states
from filippov.analysis import equilibria, stability_report
from filippov.analysis.steady.linearisation import linearise


def ring(n: int, load: float = 0.0) -> System:
    """n masses, springs to both neighbours, friction on each; the first is pushed."""
    x = states(" ".join(f"x{i}" for i in range(n)))
    v = states(" ".join(f"v{i}" for i in range(n)))
    p = parameters(m=1, k=1, mu=0.1)
    rates = {x[i]: v[i] for i in range(n)}
    for i in range(n):
        force = p.k * (x[i - 1] - 2 * x[i] + x[(i + 1) % n]) - p.mu * sign(v[i])
        rates[v[i]] = (force + (sympy.Rational(str(load)) if i == 0 else 0)) / p.m
    return System(rates)


def loose_masses(rng: np.random.Generator) -> tuple[System, list[np.ndarray]]:
    """Masses with springs between them only, contacts and dampers to the ground and between them, a load."""
    m = int(rng.integers(2, 4))
    q, s = (states(" ".join(f"{name}{i}" for i in range(m))) for name in ("q", "s"))
    M, eye = rng.integers(1, 4, m), np.eye(m, dtype=int)
    K, C, contacts = np.zeros((m, m), dtype=int), np.zeros((m, m), dtype=int), []
    for i in range(m):
        if rng.random() < 0.5:
            contacts.append(eye[i])
        if rng.random() < 0.2:
            C += np.outer(eye[i], eye[i])
        for j in range(i):
            d = eye[i] - eye[j]
            K += int(rng.integers(1, 3)) * np.outer(d, d)
            if rng.random() < 0.3:
                contacts.append(d)
    if not contacts:
        contacts.append(eye[0])
    pushes, load = rng.integers(1, 4, len(contacts)), rng.integers(-2, 3, m)
    force = load - K @ np.array(q) - C @ np.array(s)
    for c, k in zip(contacts, pushes, strict=True):
        force = force - k * c * sign(sum(int(a) * b for a, b in zip(c, s, strict=True) if a))
    rows = dict(zip(q, s, strict=True)) | {b: f / int(k) for b, f, k in zip(s, force, M, strict=True)}
    return System(rows), [np.diag(M), K, C, np.array(contacts), pushes, load]


@pytest.mark.parametrize("seed", range(30))
def test_free_masses_come_to_rest_where_friction_outdoes_the_load(seed: int) -> None:
    """By hand: d = (1, ..., 1) stretches no spring, so friction must outdo the load along it."""
    system, (M, K, C, c, pushes, load) = loose_masses(np.random.default_rng(seed))
    items = stability_report(system, budget=60.0).items
    said = {item.answer for item in items if item.equilibrium.dimension}
    margin = float(pushes @ np.abs(c.sum(axis=1))) - abs(load.sum())
    if margin <= 0:
        assert not said & {"stable", "asymptotically stable"}
        return
    _, sizes, rows = np.linalg.svd(c)
    N, free = rows[int(np.sum(sizes > 1e-9)) :].T, 0
    if N.shape[1]:
        roots, modes = eigh(N.T @ K @ N, N.T @ M @ N)
        for root in np.unique(np.round(roots, 9)):
            space = N @ modes[:, np.abs(roots - root) < 1e-6]
            free += space.shape[1] - np.linalg.matrix_rank(C @ space, tol=1e-9)
    assert said == {"stable" if free else "asymptotically stable"}


@pytest.mark.parametrize("load", [0.0, 0.2])
def test_a_ring_comes_to_rest(load: float) -> None:
    """Three masses hold 0.3 in all; the solver's own runs stop."""
    system = ring(3, load)
    (item,) = stability_report(system).items
    assert item.answer == "asymptotically stable"
    rng = np.random.default_rng(1)
    for _ in range(3):
        end = solve(system, rng.uniform(-1, 1, 6), (0, 200)).x_end
        assert np.max(np.abs(end[3:])) < 1e-9


def test_a_ring_that_is_pushed_by_more_than_friction_holds_never_rests() -> None:
    assert not [i for i in stability_report(ring(3, 0.4)).items if "stable" in i.answer]
    assert solve(ring(3, 0.4), np.zeros(6), (0, 50)).x_end[3:].min() > 0


def test_twenty_masses() -> None:
    """3^20 modes, of which only that at rest can hold an equilibrium."""
    system = ring(20)
    found = equilibria(system)
    assert [e.mode for e in found] == ["0" * 20]
    assert found.notes == ()
    # 20 places less 0, and 20 multipliers less the one that balances the sum of all forces.
    (rest,) = found
    assert rest.dimension == 20
    for modes in (None, ["0" * 20]):
        report = stability_report(system, modes=modes)
        assert [item.answer for item in report.items] == ["asymptotically stable"]
        assert report.complete


def test_sides_of_a_linearisation_are_looked_at_alone() -> None:
    """Of 2^3 modes beside the set those that are named, in one order, and none that do not fit."""
    system = ring(3)
    (rest,) = equilibria(system)
    every = linearise(system, rest)
    assert len({part.mode for part in every.slip}) == 8
    some = linearise(system, rest, sides=["--+", "+-+", "0-+", "+"])
    assert [part.mode for part in some.slip] == ["+-+", "--+"]


def test_work_is_told_and_bounded() -> None:
    """What is done of the budget rises to the end, and a report that ends for it says so."""
    told: list[tuple[float, float]] = []
    stability_report(ring(8), budget=30.0, progress=lambda done, of: told.append((done, of)))
    assert len(told) > 10
    assert {of for _, of in told} == {30.0}
    assert [done for done, _ in told] == sorted(done for done, _ in told)
    assert told[-1][0] < 30.0
    short = stability_report(ring(20), budget=2.0)
    assert not short.complete
    assert any("Give a larger budget" in note for note in short.notes)
