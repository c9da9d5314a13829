"""Resting contact whose impacts change other states too: infinitely many impacts end in finite time.

The truth is the sequence of impacts in closed form: on x' = v, v' = -g, with v+ = -e v, w+ = M w + c v and
w' = A w between, and what is left of w at its end, from where w' = A w - c g/(1 + e) goes on in contact.
"""

from __future__ import annotations

import os

import numpy as np
import numpy.typing as npt
import pytest
import sympy
from scipy.linalg import expm

from filippov import Abs, Surface, System, parameters, solve, states
from filippov.analysis import stability_report

Array = npt.NDArray[np.float64]
x, v, y, z = states("x v y z")
AS, ST, UN = "asymptotically stable", "stable", "unstable"
DRAWS = range({"nightly": 400}.get(os.environ.get("FILIPPOV_PROFILE", ""), 40))
MOST, SLOW, G = 3000, 1e-290, 1.0


def truth(e: float, M: Array, c: Array, A: Array) -> str:
    """The verdict on the contact, "open" where solutions end because w has no limit."""
    n = len(M)
    rest = np.linalg.solve(A, c / (1 + e) * G)
    largest, settled = 0.0, True
    for r in (1e-3, 1e-5):
        rng = np.random.default_rng(3)
        for _ in range(6):
            w, L = rest + r * rng.uniform(-1, 1, n), -r
            recent: list[Array] = []
            for _ in range(MOST):
                L, w = -e * L, M @ w + c * L
                recent = [*recent[-8:], w]
                largest = max(largest, float(np.max(np.abs(w - rest))) / r)
                if largest > 1e6 or L < SLOW:
                    break
                flight = 2 * L / G
                w, L = expm(A * flight) @ w, -L
            if largest > 100:
                return UN
            settled &= e == 0 or all(np.max(np.abs(q - w)) <= 1e-6 * r + 1e-3 * r for q in recent)
    # What starts in contact has no impact.
    if np.any(np.linalg.eigvals(A).real > 0):
        return UN
    return AS if settled else "open"


def system(e: float, M: Array, c: Array, A: Array) -> System:
    w = (y, z)[: len(M)]

    def row(a: Array) -> sympy.Expr:
        return sum((sympy.Rational(repr(float(q))) * s for q, s in zip(a, w, strict=True)), sympy.S.Zero)

    reset = {v: -sympy.Rational(repr(e)) * v}
    reset |= {s: row(M[k]) + sympy.Rational(repr(float(c[k]))) * v for k, s in enumerate(w)}
    field = {x: v, v: -sympy.S.One, **{s: row(A[k]) for k, s in enumerate(w)}}
    return System(field, surfaces=[Surface("floor", x, reset=reset)])


def drawn(seed: int) -> tuple[float, Array, Array, Array]:
    rng = np.random.default_rng([41, seed])
    n = int(rng.integers(1, 3))
    kind = rng.integers(7)
    angle = rng.uniform(0, np.pi)
    turn = np.array([[0, -1.0], [1, 0]]) if n == 2 else np.array([[-1.0]])
    M = [
        np.eye(n),
        rng.uniform(-1.6, 1.6, (n, n)),
        np.diag(rng.choice([1, 0.5, -0.5, -1, 0, 1.3], n)),
        turn,
        np.eye(n) + (np.array([[0, 1], [0, 0]]) if n == 2 else 0.0),
        rng.uniform(0.2, 0.9) * (np.cos(angle) * np.eye(n) + np.sin(angle) * turn),
        np.diag([1.0, 0.4][:n]),
    ][kind]
    e = float(rng.choice([0, 0.3, 0.5, 0.8]))
    c = np.round(rng.uniform(-1, 1, n), 1) * (rng.random() < 0.3)
    A = rng.uniform(-1, 1, (n, n)) - (1.5 if rng.random() < 0.8 else 0.0) * np.eye(n)
    return e, np.round(M, 1), c, np.round(A, 1)


@pytest.mark.parametrize("seed", DRAWS)
def test_what_impacts_do_to_other_states_is_done_infinitely_often(seed: int) -> None:
    e, M, c, A = drawn(seed)
    if abs(np.linalg.det(A)) < 0.05 or np.min(np.abs(np.linalg.eigvals(A).real)) < 0.02:
        return
    answers = [item.answer for item in stability_report(system(e, M, c, A)).items]
    known = truth(e, M, c, A)
    assert len(answers) == 1
    assert answers[0] in {known, "undecided"}, (answers, known, e, M, c, A)
    plain = np.array_equal(M, np.eye(len(M))) or np.max(np.abs(np.linalg.eigvals(M))) < 0.95 or e == 0
    if plain or np.max(np.abs(np.linalg.eigvals(M))) > 1.05:
        assert answers[0] != "undecided", (known, e, M, c, A)


@pytest.mark.parametrize(
    ("reset", "rate", "known"),
    [
        ({v: -v / 2, y: 2 * y}, -1, {UN}),
        ({v: -v / 2, y: sympy.Rational(6, 5) * y}, -1, {UN}),
        ({v: -v / 2, y: 3 * y}, -100, {UN}),
        ({v: -v / 2, y: -y}, -1, {"undecided"}),
        ({v: -v / 2, y: y + 1}, -1, {UN}),  # it counts
        ({v: 0, y: y + 1}, -1, {UN}),
        ({v: 0, y: 3 * y}, -1, {AS}),  # one impact, and no other
        ({v: -(v**2), y: 3 * y}, -1, {UN}),  # e = 0 to first order, and yet infinitely many
        ({v: -(v**2), y: y / 3}, -1, {AS}),
        ({v: -v / 2, y: y + y * v}, -1, {AS}),  # the product of all (1 + v_k) is finite
        ({v: -v / 2, y: y + Abs(v) / 3 + v / 3}, -1, {AS}),
        ({v: -v / 2, y: y + v**2}, -1, {AS}),
        ({v: -v / 2, y: y + Abs(v) * y}, -1, {AS}),
        ({v: -v / 2, y: 2 * y + Abs(v) * y}, -1, {UN}),
        ({v: -v / 2, y: y / 2 + Abs(v) * y}, -1, {AS}),
        ({v: -v / 2, y: y + y**2}, -1, {UN, "undecided"}),  # y_k + y_k**2 runs off
        ({v: -v / 2, y: y - y**3}, -1, {AS, "undecided"}),
        ({v: -v / 2, y: 0}, -1, {AS}),
        ({v: -v / 2, y: 0}, 1, {UN}),
    ],
)
def test_other_laws_of_a_second_state(reset: dict, rate: int, known: set[str]) -> None:
    floor = Surface("floor", x, reset=reset)
    (item,) = stability_report(System({x: v, v: -1, y: rate * y}, surfaces=[floor])).items
    assert item.answer in known


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("tilt", [0, 1])
def test_the_same_in_other_coordinates(side: int, tilt: int) -> None:
    """The floor h = side x + tilt y**2 / 3 with h'' = -1, whatever y does."""
    h = side * x + tilt * y**2 / 3
    for factor, known in ((1, AS), (sympy.Rational(1, 2), AS), (sympy.Rational(3, 2), UN)):
        L = side * v - 2 * tilt * y**2 / 3
        L_dot = 4 * tilt * y**2 / 3
        field = {x: v, v: side * (-1 - L_dot), y: -y}
        # y+ = factor y keeps h at y = 0 only, so that x is carried along.
        after = factor * y
        reset = {
            y: after, x: side * (h - tilt * after**2 / 3), v: side * (-L / 2 + 2 * tilt * after**2 / 3),
        }  # fmt: skip
        (item,) = stability_report(System(field, surfaces=[Surface("floor", h, reset=reset)])).items
        assert item.answer in {known, "undecided"}
        assert tilt or item.answer == known


def test_a_factor_given_as_a_parameter() -> None:
    (r,) = parameters(r=0.9)
    ball = System({x: v, v: -1, y: -y}, surfaces=[Surface("floor", x, reset={v: -v / 2, y: r * y})])
    assert [stability_report(ball, {"r": q}).items[0].answer for q in (0.9, 1, 1.1)] == [AS, AS, UN]


@pytest.mark.parametrize(("factor", "known"), [(2.0, UN), (0.5, AS), (1.0, AS)])
def test_the_solver_sees_it_too(factor: float, known: str) -> None:
    ball = System({x: v, v: -1, y: -y}, surfaces=[Surface("floor", x, reset={v: -v / 2, y: factor * y})])
    run = solve(ball, x0=(1e-3, 0, 1e-3), t_span=(0, 5), zeno="continue", throw=False)
    assert (stability_report(ball).items[0].answer == UN) == (known == UN)
    assert (np.abs(run["y"]).max() > 1) == (known == UN)
    assert known == UN or abs(run["y"][-1]) < 1e-4
