"""Surfaces along which a field runs that is not Lipschitz there: whether what comes to one may leave again.

h = x - w t + q y with h' = a |h|^p + b |h|^p sgn h: |h|^(1 - p) changes by (1 - p)(a + b) t above, by
(1 - p)(b - a) t below; h = 0 is a solution, others leave it upwards where a + b > 0, downwards where a < b.
"""

from functools import cache

import numpy as np
import pytest
import sympy

from filippov import Status, System, TimeEvent, parameters, sign, solve, solve_many, sqrt, states, t

X, Y = states("x y")
POWERS = (sympy.Rational(1, 3), sympy.Rational(1, 2), sympy.Rational(2, 3), sympy.Rational(3, 4))
DEPARTURE = "departure where the field is not Lipschitz"


@cache
def system(power: sympy.Rational) -> System:
    p = parameters(a=1.0, b=1.0, w=0.0, q=0.0)
    h = X - p.w * t + p.q * Y
    root = abs(h) ** power
    return System({X: p.a * root + p.b * root * sign(h) + p.w + p.q * Y, Y: -Y})


Drawn = tuple[sympy.Rational, dict[str, float], float]


def drawn(seed: int) -> Drawn:
    """Power, parameters and the first h; half of the draws have one side without a field."""
    rng = np.random.default_rng(seed)
    up, down = rng.choice([-1.0, 1.0], 2) * rng.uniform(0.3, 2, 2)  # h' = up |h|^p above, down |h|^p below
    given = {"a": (up + down) / 2, "b": (up - down) / 2, "w": 0.0, "q": 0.0}
    if rng.random() < 0.6:
        given |= {"w": float(rng.uniform(-2, 2)), "q": float(rng.uniform(-1, 1))}
    return POWERS[seed % 4], given, float(rng.choice([0.0, *rng.uniform(-1.5, 1.5, 2)]))


def start(h: float, given: dict[str, float]) -> np.ndarray:
    return np.array([h - given["q"], 1.0])


def height(x: np.ndarray, time: float, given: dict[str, float]) -> float:
    return float(x[0] - given["w"] * time + given["q"] * x[1])


def flown(h: float, rate: float, power: float, time: float) -> float:
    """|h| on one side, until 0."""
    left = abs(h) ** (1 - power) + (1 - power) * rate * time
    return float(max(left, 0.0) ** (1 / (1 - power)))


@pytest.mark.parametrize("seed", range(80))
def test_11_what_may_leave_again_is_not_unique_and_every_solution_is_found(seed: int) -> None:
    power, given, h0 = drawn(seed)
    p = float(power)
    rates = {1: given["a"] + given["b"], -1: given["b"] - given["a"]}  # of |h|
    off = [side for side, rate in rates.items() if rate > 0]
    side = int(np.sign(h0))
    falls = -rates[side] if side else 1.0
    comes = abs(h0) ** (1 - p) / ((1 - p) * falls) if falls > 0 else np.inf
    end = comes + 1.5 if np.isfinite(comes) else 1.5
    run = solve(system(power), start(h0, given), (0, end), parameters=given)
    if not off or not np.isfinite(comes):
        assert run.success, run.message
        expected = side * flown(h0, -falls, p, end) if side else 0.0
        assert height(run.x_end, end, given) == pytest.approx(expected, abs=1e-8)
        return
    # h is known as well as the states are: so late, or early, the surface may be reached.
    known = 1e-7 * (1 + abs(h0) + abs(given["w"]) * comes)
    late = known ** (1 - p) / ((1 - p) * falls) if side else 0.0
    assert run.status is Status.NON_UNIQUE, run.message
    assert run.ambiguity is not None
    assert run.ambiguity.name == DEPARTURE
    assert run.t_end == pytest.approx(comes, abs=late)
    lanes = solve_many(system(power), [start(h0, given)] * 8, (0, end), parameters=given, lanes=8)
    assert set(lanes.status) == {Status.NON_UNIQUE}
    stays = solve(system(power), start(h0, given), (0, end), parameters=given, nonunique="stick")
    assert stays.success, stays.message
    assert height(stays.x_end, end, given) == pytest.approx(0, abs=1e-12)
    tree = solve(system(power), start(h0, given), (0, end), parameters=given, nonunique="branch")
    ends = sorted(height(leaf.solution.x_end, end, given) for leaf in tree.leaves())
    gone = end - run.t_end
    exact = sorted([0.0, *(s * flown(0.0, rates[s], p, gone) for s in off)])
    assert ends == pytest.approx(exact, abs=1e-7), (power, given, h0)


def test_11_a_tank_that_runs_empty_is_unique_where_nothing_leads_below_0() -> None:
    laws = {-sqrt(sympy.Max(X, 0)): True, -sqrt(abs(X)) * sign(X): True, -sqrt(abs(X)): False}
    for law, unique in laws.items():
        run = solve(System({X: law}), (1,), (0, 4))
        assert run.success == unique, (law, run.message)
        assert run.x_end == pytest.approx([0], abs=1e-12)


def test_11_a_drift_across_is_unique() -> None:
    """h' = t + |h|^(2/3) from h = 0: no solution stays, and there is one only."""
    run = solve(System({X: t + abs(X) ** sympy.Rational(2, 3)}), (0,), (0, 1), rtol=1e-10)
    assert run.success, run.message
    assert run.x_end[0] > 0.5


@pytest.mark.parametrize("x0", [0.0, 0.3, -0.4])
@pytest.mark.parametrize("drift", [0, 1])
def test_11_a_kick_off_a_kink_is_not_lost(x0: float, drift: int) -> None:
    """From 1/2 off the surface |h|^(1/2) falls by 1 in a time of 1; a run that moves may end by name."""
    h = X - drift * t
    kick = TimeEvent("kick", times=[2], reset={X: X + sympy.Rational(1, 2)})
    kicked = System({X: drift - 2 * sqrt(abs(h)) * sign(h), Y: -Y}, time_events=[kick])
    run = solve(kicked, (x0, 1), (0, 2.3))
    lanes = solve_many(kicked, [(x0, 1)] * 8, (0, 2.3), lanes=8)
    assert run.success or (drift and run.status is Status.NO_CONTINUATION)
    expected = drift * 2.3 + (0.5**0.5 - 0.3) ** 2
    for status, x in ((run.status, run.x_end), *zip(lanes.status, lanes.x, strict=True)):
        assert status is not Status.SUCCESS or x[0] == pytest.approx(expected, abs=1e-7)


def test_11_what_holds_on_a_moving_kink_lets_go_where_a_sign_elsewhere_says_so() -> None:
    """x' = r' - |x - r|^(1/2) sgn(x - r) + (1 + sgn y)/2 with y = t - 2: x = r until then."""
    for rate in (0, 1):
        pull = -sqrt(abs(X - rate * t)) * sign(X - rate * t)
        run = solve(System({X: rate + pull + (1 + sign(Y)) / 2, Y: 1}), (0.25, -2), (0, 2.5))
        assert run.success or (rate and run.status is Status.NO_CONTINUATION)
        if run.success:
            # h' = 1 - sqrt(h) from 0: t = -2 (sqrt(h) + log(1 - sqrt(h))).
            root = np.sqrt(run.x_end[0] - rate * 2.5)
            assert -2 * (root + np.log(1 - root)) == pytest.approx(0.5, abs=1e-6)
