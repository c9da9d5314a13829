"""Neurons whose upstroke is shorter than t can tell apart, against closed forms.

u' = a exp(b u) comes from r to its threshold in (exp(-b r) - exp(-b threshold))/(a b); adaptive exponential
neurons (Brette & Gerstner 2005) do where a spike is cut at +20 mV. y' = -y, y -> y + 1 at every spike.
"""

import numpy as np
import pytest

from filippov import Solution, Surface, System, exp, parameters, solve, solve_many, states
from filippov.analysis import find_orbit
from filippov.analysis.sensitivity.saltation import flow_derivative

U, Y = states("u y")
P = parameters(a=1.0, b=1.0, low=0.0, top=1.0)
SPIKE = Surface("spike", P.top - U, reset={U: P.low, Y: Y + 1}, contact=False)
NEURON = System({U: P.a * exp(P.b * U), Y: -Y}, surfaces=[SPIKE])
SLOPE = 0.463500955


def drawn(seed: int) -> tuple[dict[str, float], float, float]:
    """Values, the period, and the end of the run."""
    rng = np.random.default_rng(seed)
    q = {"a": 10 ** rng.uniform(-2, 2), "b": 10 ** rng.uniform(-1, 1), "low": rng.uniform(-1, 1)}
    q["top"] = q["low"] + rng.uniform(5, 300) / q["b"]
    period = (np.exp(-q["b"] * q["low"]) - np.exp(-q["b"] * q["top"])) / (q["a"] * q["b"])
    return {k: float(v) for k, v in q.items()}, float(period), float(period * (3 + rng.uniform(0.1, 0.9)))


def expected(q: dict[str, float], period: float, end: float) -> tuple[float, float]:
    since = end - 3 * period
    u = -np.log(np.exp(-q["b"] * q["low"]) - q["a"] * q["b"] * since) / q["b"]
    return u, float(np.sum(np.exp(-(end - period * np.arange(1, 4)))))


@pytest.mark.parametrize("seed", range(40))
def test_11_4_a_spike_that_takes_no_time_resets(seed: int) -> None:
    q, period, end = drawn(seed)
    run: Solution = solve(NEURON, (q["low"], 0), (0, end), parameters=q, rtol=1e-10)
    assert run.success, (q, run.message)
    assert run.t_events[0] == pytest.approx(period * np.arange(1, 4), rel=1e-8)
    assert run.x_end == pytest.approx(expected(q, period, end), rel=1e-6, abs=1e-6)


def test_11_4_lanes_and_functions_spike_likewise() -> None:
    rows = [drawn(seed) for seed in range(16)]
    columns = {name: [q[name] for q, _, _ in rows] for name in rows[0][0]}
    end = min(end for *_, end in rows)
    ends = solve_many(NEURON, [(q["low"], 0) for q, *_ in rows], (0, end), parameters=columns, lanes=8)
    assert ends.success.all(), ends.message
    for (q, period, _), x in zip(rows, ends.x, strict=True):
        if end < period:
            assert x[0] == pytest.approx(-np.log(np.exp(-q["b"] * q["low"]) - q["a"] * q["b"] * end) / q["b"])
    q, period, end = drawn(3)
    spike = Surface(
        "spike", lambda t, x, p: q["top"] - x[0], reset=lambda t, x, p: [q["low"], x[1] + 1], contact=False
    )
    plain = System(
        field=lambda t, x, p, s: [q["a"] * np.exp(q["b"] * x[0]), -x[1]], surfaces=[spike], states="u y"
    )
    run = solve(plain, (q["low"], 0), (0, end), rtol=1e-10)
    assert run.success, run.message
    assert run.x_end == pytest.approx(expected(q, period, end), rel=1e-6, abs=1e-6)


def test_a_solution_without_bound_ends_by_name() -> None:
    """Without a threshold that is a number the same solution has no end."""
    run = solve(System({U: exp(U), Y: -Y}), (0, 0), (0, 2))
    assert not run.success
    assert run.t_end == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize("seed", range(40))
def test_derivatives_go_through_spikes_that_take_no_time(seed: int) -> None:
    """All spikes move with the first: dt/du0 = -exp(-b u0)/a. The rounding of t is any part of a spike."""
    q, period, end = drawn(seed)
    run = solve(NEURON, (q["low"], 0.5), (0, end), parameters=q, rtol=1e-10)
    u, _ = expected(q, period, end)
    later = -np.exp(-q["b"] * q["low"]) / q["a"]
    pull = float(np.sum(np.exp(-(end - period * np.arange(1, 4)))))
    exact = [[-later * q["a"] * np.exp(q["b"] * u), 0], [later * pull, np.exp(-end)]]
    found = flow_derivative(run)
    np.testing.assert_allclose(found, exact, rtol=1e-6, atol=1e-6 * np.max(np.abs(exact)))


UNITS = [(1, 1, 1), (1e3, 1e3, 1e9), (1e3, 1, 1e12), (1e6, 1e3, 1)]


@pytest.mark.parametrize("millivolts", [-20, 20])
@pytest.mark.parametrize(("volt", "second", "ampere"), UNITS)
def test_an_adaptive_neuron_has_its_multiplier_in_any_units(
    volt: float, second: float, ampere: float, millivolts: int
) -> None:
    # C v' = -g (v - E) + g d exp((v - V)/d) - w + I, tau w' = a (v - E) - w; w + b at the cut. From -20 mV to
    # +20 mV it takes 2e-9 s: more of a spike than there are roundings of t in it.
    # In SI units a state of volts beside one of 1e-10 A took 0.4 % of the multiplier.
    siemens, farad = ampere / volt, ampere * second / volt
    v, w = states("v w")
    C, g, a = 281e-12 * farad, 30e-9 * siemens, 4e-9 * siemens
    E, V, d, cut = (volt * value for value in (-70.6e-3, -50.4e-3, 2e-3, millivolts * 1e-3))
    tau, b, current = 144e-3 * second, 0.0805e-9 * ampere, 1e-9 * ampere
    spike = Surface("spike", cut - v, reset={v: E, w: w + b})
    neuron = System(
        {v: (-g * (v - E) + g * d * exp((v - V) / d) - w + current) / C, w: (a * (v - E) - w) / tau},
        surfaces=[spike],
    )
    orbit = find_orbit(neuron, (E, 0), t_max=second)
    # The slope of w after one spike by w after the last, by differences of scipy's DOP853 in mV, ms and nA.
    assert orbit.period / second == pytest.approx(0.03608094961598, rel=1e-9 if millivolts < 0 else 1e-7)
    assert orbit.multipliers[0].real == pytest.approx(SLOPE, rel=2e-7)
    assert abs(orbit.trivial - 1) < 1e-7
