"""Verdicts beside kinks, impacts, clocks and forcing, each kind against motions or products of matrices."""

import math

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from filippov import Abs, Piecewise, Surface, System, TimeEvent, cos, parameters, sin, states, t
from filippov.analysis.algebra.routh_hurwitz import routh_hurwitz
from filippov.analysis.local_stability.planar_cone import planar_cone
from filippov.analysis.local_stability.stability import stability_report
from filippov.analysis.steady.equilibria import equilibria

x, v, y, w = states("x v y w")
p = parameters(e=0.5, k=1.0, c=0.4, a=1.5, q=2.0, b=0.5, g=1.0)
coefficient = st.floats(-2, 2).map(lambda q: round(q, 3))


def verdicts(system: System, **options: float) -> list[str]:
    return [item.answer for item in stability_report(system, options or None).items]


# -- kinks -------------------------------------------------------------------------------------------------


def motion(sides: dict[bool, np.ndarray], length: float = 40.0) -> float:
    """Largest log |y| at the end, over 8 directions of start, of y' = A y with A by the sign of y[0]."""
    ends = []
    for angle in np.linspace(0.1, 0.1 + 2 * np.pi, 8):
        found = solve_ivp(
            lambda _, z: sides[bool(z[0] >= 0)] @ z[:2], (0, length), [np.cos(angle), np.sin(angle)],
            rtol=1e-6, atol=1e-300, method="DOP853",
        )  # fmt: skip
        ends.append(0.5 * math.log(float(np.sum(found.y[:, -1] ** 2)) + 1e-300))
    return max(ends)


@given(a=coefficient, b=coefficient, c=coefficient, d=coefficient, e=coefficient, f=coefficient)
def test_planar_kinks_follow_their_motions(
    a: float, b: float, c: float, d: float, e: float, f: float
) -> None:
    """x' = A+ x for x >= 0 and A- x below, continuous: the second column is common to both."""
    sides = {True: np.array([[a, b], [c, d]]), False: np.array([[e, b], [f, d]])}
    decided = planar_cone(lambda z: sides[bool(z[0] >= 0)])
    if decided is None:
        return
    end = motion(sides)
    if abs(end) > 5.0:  # slower ones are not told by a motion of this length
        assert decided == (end < 0)


def test_a_kink_with_one_unstable_side() -> None:
    """Half turns of growth exp(pi tr/sqrt(4 - tr^2)), tr = 0.2 and -1, then 0.7 and -0.5."""
    assert verdicts(System({x: -0.4 * x + 0.6 * Abs(x) + v, v: -x})) == ["asymptotically stable"]
    assert verdicts(System({x: 0.1 * x + 0.6 * Abs(x) + v, v: -x})) == ["unstable"]


@pytest.mark.parametrize(("slopes", "answer"), [((1, 2), "asymptotically stable"), ((-1, 2), "unstable")])
def test_a_kink_on_the_line(slopes: tuple[float, float], answer: str) -> None:
    below, above = slopes
    assert verdicts(System({x: Piecewise((-above * x, x > 0), (-below * x, True))})) == [answer]


# -- sets of smooth modes ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("outside", "answer"), [(1, "unstable"), (-1, "asymptotically stable")])
def test_the_ends_of_a_dead_zone_count(outside: int, answer: str) -> None:
    dead = Piecewise((x - 1, x > 1), (x + 1, x < -1), (0, True))
    assert verdicts(System({x: v, v: outside * dead - v})) == [answer]


def test_a_set_whose_parts_differ_is_cut_by_a_formula() -> None:
    """SIR: at y = 0 the infected grow like b x - g, so the border is x = g/b."""
    first, second = stability_report(System({x: -p.b * x * y, y: p.b * x * y - p.g * y})).items
    assert (first.answer, second.answer) == ("asymptotically stable", "unstable")
    border = first.equilibrium.domain[0][1]
    assert sympy.simplify(border - p.g / p.b) == 0
    assert second.equilibrium.domain[0] == (border, sympy.oo)


# -- time and clocks ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(("a", "answer"), [(0.9, "asymptotically stable"), (1.5, "unstable")])
def test_markus_yamabe_is_not_judged_by_frozen_eigenvalues(a: float, answer: str) -> None:
    """Multipliers exp(2 pi (a - 1)), exp(-2 pi); the eigenvalues of A(t) have the real part (a - 2)/2 < 0."""
    system = System(
        {
            x: (-1 + p.a * cos(t) ** 2) * x + (1 - p.a * sin(t) * cos(t)) * v,
            v: (-1 - p.a * sin(t) * cos(t)) * x + (-1 + p.a * sin(t) ** 2) * v,
        }
    )
    (item,) = stability_report(system, {"a": a}).items
    assert item.answer == answer
    assert "multipliers" in item.statements[0].text
    (frozen,) = stability_report(system, {"a": a}, t=0.0).items
    assert "frozen" in frozen.statements[-1].text


def test_time_without_a_period_is_undecided() -> None:
    assert verdicts(System({x: -x * (1 - 2 / (1 + t**2))})) == ["undecided"]
    assert verdicts(System({x: -x * (1 + 1 / (1 + t**2))})) == ["asymptotically stable"]


@given(entries=st.tuples(*[coefficient] * 8), period=st.sampled_from([0.3, 1.0, 2.5]))
def test_clocks_follow_the_product_of_flow_and_reset(entries: tuple[float, ...], period: float) -> None:
    A, R = np.reshape(entries[:4], (2, 2)), np.reshape(entries[4:], (2, 2))
    if abs(np.linalg.det(A)) < 1e-2:
        return
    system = System(
        {x: A[0, 0] * x + A[0, 1] * v, v: A[1, 0] * x + A[1, 1] * v},
        time_events=[
            TimeEvent(
                "clock",
                period=period,
                reset={x: R[0, 0] * x + R[0, 1] * v, v: R[1, 0] * x + R[1, 1] * v},
            )
        ],
    )
    largest = max(abs(np.linalg.eigvals(R @ expm(A * period))))
    (answer,) = verdicts(system)
    if abs(largest - 1) > 1e-4:
        assert answer == ("asymptotically stable" if largest < 1 else "unstable")


def test_two_clocks_and_a_forced_field() -> None:
    """x' = (sin t - c) x, halved every pi and multiplied by q every 2 pi: exp(-2 pi c) q/4 a period."""
    system = System(
        {x: (sin(t) - p.c) * x},
        parameters=p,
        time_events=[
            TimeEvent("half", period=math.pi, reset={x: x / 2}),
            TimeEvent("grow", period=2 * math.pi, start=1.0, reset={x: p.q * x}),
        ],
    )
    border = 4 * math.exp(2 * math.pi * 0.4)
    assert verdicts(system, q=0.99 * border) == ["asymptotically stable"]
    assert verdicts(system, q=1.01 * border) == ["unstable"]


def test_what_a_clock_moves_is_no_equilibrium() -> None:
    found = equilibria(System({x: -x}, time_events=[TimeEvent("kick", period=1, reset={x: x + 1})]))
    assert not len(found)
    assert "kick" in found.notes[0]


# -- impacts -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("c", "e", "answer"),
    [
        (0.4, 0.5, "asymptotically stable"),
        (-0.4, 0.5, "unstable"),
        (0.4, 1.0, "undecided"),
        (0.4, 1.2, "unstable"),
    ],
)
def test_a_body_on_a_floor_that_slides_on_a_spring(c: float, e: float, answer: str) -> None:
    """w' = -k x - c w along the floor, gravity across it: roots of s^2 + c s + k, restitution e."""
    system = System(
        {x: w, w: -p.k * x - p.c * w, y: v, v: -p.g},
        surfaces=[Surface("floor", y, reset={v: -p.e * v})],
        parameters=p,
    )
    (item,) = stability_report(system, {"c": c, "e": e}).items
    assert item.equilibrium.kind == "resting contact"
    assert item.equilibrium.value == pytest.approx((0, 0, 0, 0))
    assert item.answer == answer
    if item.polynomial is not None and answer != "undecided":
        assert [float(q.subs({p.k: 1, p.c: c})) for q in item.polynomial] == pytest.approx([1, c, 1])


def test_a_force_that_pulls_leaves_no_contact() -> None:
    system = System({y: v, v: p.g}, surfaces=[Surface("floor", y, reset={v: -p.e * v})], parameters=p)
    assert not len(equilibria(system))


# -- Routh-Hurwitz -----------------------------------------------------------------------------------------


def test_a_condition_that_is_false_and_coefficients_that_vanish_together() -> None:
    K, m = sympy.symbols("K m", real=True)
    assert routh_hurwitz([1, 0, K]).solve_for(K) == sympy.false
    assert routh_hurwitz([K**2, K, 0]).solve_for(K) == sympy.false
    assert routh_hurwitz([K, 2 * K]).solve_for(K, as_set=True) == sympy.Complement(
        sympy.S.Reals, sympy.FiniteSet(0)
    )
    assert routh_hurwitz([1, -m, K]).solve_for(K, {m: 1}) == sympy.false
