"""Symbolics, stability, maps and continuation where trusted tools fail: one test a row, named by its id."""

from math import exp
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.linalg import expm
from sympy import Eq, Heaviside, Piecewise

from filippov import ModelError, Surface, System, parameters, sign, solve, states
from filippov.analysis.algebra.polynomial import Verdict
from filippov.analysis.algebra.routh_hurwitz import routh_hurwitz
from filippov.analysis.comparisons.comparison import compare
from filippov.analysis.local_stability.stability import stability_report
from filippov.analysis.maps.event_map import EventMap
from filippov.analysis.maps.section import Section
from filippov.analysis.sensitivity.saltation import NotDifferentiableError, flow_derivative
from filippov.base.status import Status
from filippov.models import get
from filippov.models.karnopp import hunting_karnopp
from filippov.models.lugre import hunting_lugre
from filippov.models.switch import hunting_switch
from filippov.plot.maps import plot_event_map

x, v = states("x v")


@pytest.mark.parametrize(
    ("polynomial", "axis", "rows", "verdict"),
    [
        ([1, 0, 2, 0, 1], ((2, 2),), [("zero row", 3), ("zero row", 1)], Verdict.UNSTABLE),
        ([1, 1, 1, 1], ((1, 2),), [("zero row", 1)], Verdict.MARGINALLY_STABLE),
        ([1, 1, 2, 2, 3], (), [("zero pivot", 2)], Verdict.UNSTABLE),
        ([1, 1, 3, 3, 3, 2, 1], ((1, 2),), [("zero pivot", 4)], Verdict.UNSTABLE),
    ],
    ids=["repeated-pair", "pair", "pivot", "both"],
)
def test_c01_routh_array_with_zero_pivot_or_zero_row(
    polynomial: list[int], axis: tuple[tuple[int, int], ...], rows: list[tuple[str, int]], verdict: Verdict
) -> None:
    found = routh_hurwitz(polynomial)
    assert found.counts is not None
    roots = np.roots(polynomial)
    near = 1e-6  # numpy has a double root to half the digits
    told = (found.counts.rhp, found.counts.axis, found.counts.lhp)
    assert told == tuple(int(np.sum(part)) for part in (
        roots.real > near, np.abs(roots.real) <= near, roots.real < -near
    ))  # fmt: skip
    assert found.counts.axis_multiplicities == axis
    assert found.verdict is verdict
    assert [(case.kind, case.power) for case in found.special] == rows


def test_c01_marginal_and_repeated_in_the_report_of_a_system() -> None:
    a, b, c, d = states("a b c d")
    # (s^2 + 1)^2 with and without a Jordan block; s^2 + 1 and s^2 + 2. exp(A t) at t = 1000 tells.
    for coupled, last in ((1, 1), (0, 1), (0, 2)):
        (item,) = stability_report(System({a: b, b: -a + coupled * c, c: d, d: -last * c})).items
        A = np.array([[0, 1, 0, 0], [-1, 0, coupled, 0], [0, 0, 0, 1], [0, 0, -last, 0]])
        assert item.answer == ("stable" if np.max(np.abs(expm(1000.0 * A))) < 10 else "unstable")
    # A repeated root on the axis decides nothing of a field that is not linear: other terms do.
    (item,) = stability_report(System({a: b, b: -(a**3)})).items
    assert item.answer == "stable"  # a**4/4 + b**2/2 is kept
    (item,) = stability_report(System({a: b, b: a**3})).items
    assert item.answer in ("unstable", "undecided")  # it leaves along b = a**2/sqrt(2)


def test_c02_long_coefficients_end_with_a_partial_table() -> None:
    q = sympy.symbols("q0:9", real=True)
    long = [sympy.Add(*q, k) ** (3 + k % 3) for k in range(7)]
    found = routh_hurwitz(long, budget=1.0)
    assert found.status == "timeout"
    assert 2 <= len(found.array) < 7
    assert found.degree == 6
    assert "stopped" in found.to_text()
    assert "necessary" in found.to_text()
    # Coefficients that are names are no difficulty: the last minor times a_6 bounds them all.
    plain = routh_hurwitz([1, *sympy.symbols("a1:7", positive=True)])
    assert plain.status == "complete"
    assert len(plain.array) == 7


def test_c03_leading_coefficient_that_vanishes_is_a_case_of_its_own() -> None:
    m, K = sympy.symbols("m K", real=True)
    found = routh_hurwitz([m, 1, K])
    (whole, reduced) = found.cases
    assert whole.condition == sympy.Ne(m, 0)
    assert reduced.condition == sympy.Eq(m, 0)
    assert reduced.reduced is not None
    assert reduced.reduced.degree == 1
    assert reduced.reduced.stable_when == (K > 0)
    for text in (found.to_text(), found.to_markdown()):
        assert "m" in text
    for mass, gain in ((2.0, 1.0), (-2.0, 1.0), (0.0, 1.0), (0.0, -1.0)):
        stable = bool(np.all(np.roots([mass, 1, gain]).real < 0))
        put = {"m": mass, "K": gain}
        assert (found.at(put).verdict is Verdict.ASYMPTOTICALLY_STABLE) is stable
    assert found.solve_for("m", {"K": 1}, as_set=True) == sympy.Interval(0, sympy.oo)


@pytest.mark.parametrize(
    "jump",
    [
        sign(x), 2 * Heaviside(x) - 1, Piecewise((1, x > 0), (-1, True)), Piecewise((1, x >= 0), (-1, True)),
        2 * Heaviside(x, 0) - 1,
    ],
    ids=["sign", "heaviside", "piecewise", "piecewise-closed", "heaviside-0"],
)  # fmt: skip
def test_c04_modes_of_a_jump_and_the_set_at_zero(jump: Any) -> None:
    # x' = 1/2 - jump: from both sides to 0, where the value of the jump is 1/2 and no one's choice.
    system = System({x: sympy.Rational(1, 2) - jump})
    assert len(system.surfaces) == 1
    for start, when in ((1.0, 2.0), (-3.0, 2.0)):
        run = solve(system, (start,), (0, 5))
        (entry,) = run.events
        assert str(entry.kind) == "sliding entry"
        assert entry.t == pytest.approx(when, abs=1e-12)
        assert run.x_end[0] == 0.0
        assert run.segments[-1].mode == (0,)
        assert entry.multiplier == pytest.approx(0.5, abs=1e-12)


def test_c04_a_value_chosen_at_zero_has_no_effect_or_is_refused() -> None:
    for given in (Heaviside(x, v), Heaviside(x, 7), Piecewise((1, x > 0), (-1, x < 0))):
        run = solve(System({x: -given, v: -v}), (1.0, 5.0), (0, 3))
        assert [str(event.kind) for event in run.events] == ["sliding entry"]
        assert run.x_end[0] == 0.0
    with pytest.raises(ModelError, match=r"values on a surface itself are set by the inclusion"):
        System({x: -Piecewise((1, x > 0), (0, Eq(x, 0)), (-1, True))})


@pytest.mark.parametrize("name", ["E", "I", "S", "N", "mu", "μ", "beta", "zeta", "Q", "pi_"])
def test_c05_names_that_mean_something_to_sympy(name: str) -> None:
    p = parameters(**{name: 2.0})
    rate = getattr(p, name)
    system = System({x: -rate * x, v: 1 - sign(v - 3)}, parameters=p)
    run = solve(system, (1, 0), (0, 1), rtol=1e-12)
    assert run.x_end[0] == pytest.approx(exp(-2), abs=1e-12)
    (state,) = states(name)
    assert solve(System({state: -2 * state}), (1,), (0, 1), rtol=1e-12).x_end[0] == pytest.approx(exp(-2))
    found = routh_hurwitz([1, rate, 1])
    assert found.symbols == (rate,)
    assert found.stable_when == (rate > 0)


def test_c05_a_keyword_is_refused_with_another_name() -> None:
    for make in (lambda: parameters(**{"lambda": 1.0}), lambda: states("lambda")):
        with pytest.raises(ModelError, match=r"keyword.*lambda_"):
            make()
    p = parameters(mu=1.0)
    with pytest.raises(ModelError, match="did you mean 'mu'"):
        solve(System({x: -p.mu * x}, parameters=p), (1,), (0, 1), parameters={"Mu": 1})


def test_c06_no_derivative_of_a_map_at_grazing() -> None:
    # y = (t - 1)^2 touches y = 0 on the way to the section.
    y, w = states("y w")
    surfaces = [Surface("wall", y), Surface("gate", w - 1, kind="observer")]
    system = System({y: w, w: 2 + (1 - sign(y)) / 2}, surfaces=surfaces)
    turn = EventMap(system, Section("gate", "crossing up", "y", {"y": "d", "w": "-2"}))
    assert np.isfinite(turn(1.1))
    assert np.isfinite(turn.derivative(1.1))
    with pytest.raises(NotDifferentiableError, match=r"not differentiable at t = 1: .*'wall'"):
        turn.derivative(1.0)
    with pytest.raises(NotDifferentiableError, match=r"graz|touch"):
        flow_derivative(solve(system, (1, -2), (0, 3)))


def test_c07_a_map_whose_motion_never_returns_says_so() -> None:
    section = Section("v", "crossing up", "x", {"x": "-d", "v": "0"}, t_max=50)
    turn = EventMap(System({x: v, v: -x - 0.3 * sign(v)}), section)
    values, ended = turn.returns([0.2, 2.0])
    assert np.isnan(values[0])
    assert ended == (Status.NO_RETURN, Status.STOPPED)
    assert np.isnan(turn.derivative(0.2))
    (motion,) = turn.orbit(0.2)
    assert motion.t_end == 50.0  # the time reached
    plot_event_map(turn, 0.0, 2.0, points=9)


WIDTHS = (1e-3, 1e-4, 1e-5)


@pytest.mark.parametrize(
    ("build", "order"), [(lambda w: hunting_switch(eta=w), 1.0), (lambda w: hunting_karnopp(DV=w), 1.0)],
    ids=["switch", "karnopp"],
)  # fmt: skip
def test_c10_band_models_go_to_the_exact_one_with_the_band(build: Any, order: float) -> None:
    model = get("hunting")
    found = compare(
        model.build(), Section.from_model(model), {"band": build}, widths=WIDTHS, comparators=(),
        coordinates=(0.1,), x0=(0.1, 0.0, 0.0), repeats=1, max_steps=20_000,
    )  # fmt: skip
    trend = found.trend("band", "error_times")
    assert trend.vanishes is True
    assert trend.order == pytest.approx(order, abs=0.15), trend.sentence


def test_c10_lugre_goes_to_the_exact_one_with_the_root_of_its_stiffness() -> None:
    exact = solve(get("hunting").build(), (0.1, 0, 0), (0, 2), rtol=1e-11, atol=1e-13)
    assert exact.sol is not None
    t = np.linspace(0, 2, 201)
    lugre, gaps = hunting_lugre(), []
    stiffness = np.array([1e5, 1e6, 1e7, 1e8])
    for sigma0 in stiffness:
        run = solve(
            lugre, (0.1, 0, 0, 0), (0, 2), method="Radau", rtol=1e-8, atol=1e-12,
            parameters={"sigma0": sigma0, "sigma1": sigma0**0.5},
        )  # fmt: skip
        assert run.success
        assert run.sol is not None
        gaps.append(np.max(np.abs(run.sol(t)[:3] - exact.sol(t))))
    slope = np.polyfit(np.log(stiffness), np.log(gaps), 1)[0]
    assert slope == pytest.approx(-0.5, abs=0.05)
    assert gaps[-1] < 1e-3

