"""Stability against the reference figures, closed forms, and motions integrated by the solver."""

import json
import math

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

from filippov import Abs, ModelError, Surface, System, exp, parameters, sign, sin, solve, states
from filippov.analysis.algebra.exponents import exponent_cases, size_powers
from filippov.analysis.local_stability.stability import StabilityReport, stability_report
from filippov.analysis.local_stability.stability_result import SetEvidence
from filippov.analysis.steady.equilibria import equilibria
from filippov.analysis.steady.linearisation import characteristic_polynomial, linearise
from filippov.analysis.steady.rest_map import growth, rest_map, threshold

x, v, z = states("x v z")
p = parameters(m=1, P=10, D=1, I=10, Fs=4, Fc=2, vs=0.1, beta=2, b=1)
s = sympy.Symbol("s")


def hunting() -> System:
    u = p.P * (x + p.D * v + p.I * z)
    g = p.Fc + (p.Fs - p.Fc) * exp(-((Abs(v) / p.vs) ** p.beta))
    return System({x: v, v: (-u - g * sign(v) - p.b * v) / p.m, z: x})


@pytest.fixture(scope="module")
def report() -> StabilityReport:
    return stability_report(hunting(), solve_for="P")


def case_of(report: StabilityReport, beta: float):
    (item,) = report.items
    (found,) = [c for c in item.cases if c.linearisation.case.holds({p.beta: sympy.Rational(str(beta))})]
    return found


def as_expression(coefficients: tuple) -> sympy.Expr:
    n = len(coefficients) - 1
    return sum(c * s ** (n - k) for k, c in enumerate(coefficients))


# -- the reference figures ---------------------------------------------------------------------------------


@pytest.mark.parametrize(("beta", "viscous"), [(2, p.b), (1.0001, p.b), (1, p.b - (p.Fs - p.Fc) / p.vs)])
def test_slip_polynomial(report: StabilityReport, beta: float, viscous: sympy.Expr) -> None:
    expected = s**3 + (p.P * p.D + viscous) / p.m * s**2 + p.P / p.m * s + p.P * p.I / p.m
    found = case_of(report, beta)
    assert found.sides == ("+", "-")
    assert sympy.simplify(as_expression(found.polynomial) - expected) == 0


def test_cases_are_told_apart_by_the_slope_at_the_surface(report: StabilityReport) -> None:
    (item,) = report.items
    assert [c.linearisation.case.slopes[0] for c in item.cases] == ["zero", "finite", "infinite"]
    assert [c.applies for c in item.cases] == [True, False, False]
    assert item.cases[0].condition == (p.beta > 1)
    assert item.cases[1].condition == sympy.Eq(p.beta, 1)
    assert case_of(report, 0.5).polynomial is None
    assert case_of(report, 0.5).routh is None


@pytest.mark.parametrize(("beta", "drop"), [(2, 0), (1, (p.Fs - p.Fc) / p.vs)])
def test_routh_hurwitz_conditions(report: StabilityReport, beta: float, drop: sympy.Expr) -> None:
    found = case_of(report, beta)
    (condition,) = (c for c in found.routh.conditions if c.has(p.D))
    reference = (p.P * p.D + p.b - drop) / p.m - p.I
    ratio = sympy.simplify((condition.gts - condition.lts) / reference)
    assert ratio.subs({q: q.parameter.default for q in p}) > 0
    assert not ratio.has(p.P, p.D, p.I, p.b, p.Fs, p.Fc)
    (bound,) = (c for c in sympy.And.make_args(found.solved.formula) if c.has(p.D))
    assert sympy.simplify(bound.gts - p.P) == 0
    assert sympy.simplify(bound.lts - (drop / p.D + p.m * p.I / p.D - p.b / p.D)) == 0


def test_gain_above_29_at_exponent_1(report: StabilityReport) -> None:
    found = case_of(report, 1)
    assert found.solved.numeric.as_set() == sympy.Interval.open(29, sympy.oo)
    assert found.hurwitz is False  # 1 > 20 at P = 10
    assert found.criterion == "sufficient"
    assert case_of(report, 2).solved.numeric.as_set() == sympy.Interval.open(9, sympy.oo)
    assert case_of(report, 2).hurwitz is True


def test_classification(report: StabilityReport) -> None:  # table 4, and figure 7 for the gain
    assert [case_of(report, b).answer for b in (2, 1, 0.5)] == [
        "asymptotically stable",
        "unstable",
        "unstable",
    ]
    assert report.items[0].answer == "asymptotically stable"
    assert stability_report(hunting(), {"beta": 0.5}).items[0].answer == "unstable"
    answers = {P: stability_report(hunting(), {"beta": 1, "P": P}).items[0].answer for P in (10, 26, 28, 31)}
    assert answers == {
        10: "unstable",
        26: "unstable",
        28: "asymptotically stable",
        31: "asymptotically stable",
    }


def test_set_changes_stability_before_routh_hurwitz_says_so(report: StabilityReport) -> None:  # near P = 27
    (found,) = case_of(report, 1).solved.threshold
    assert 26.5 < found < 27.4
    assert found < 29


def test_jump_part_and_drift(report: StabilityReport) -> None:
    (item,) = report.items
    assert item.drift
    assert item.polynomial == (1, 0, 0)
    (segment,) = equilibria(hunting()).sets
    (multiplier,) = segment.free
    plus = linearise(hunting(), segment, sides=["+"]).slip[0]
    assert sympy.simplify(plus.jump[1] - p.Fs * (multiplier - 1) / p.m) == 0


# -- the return map --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "viscous"),
    [
        ({"beta": 1, "P": 28}, -19),
        ({"beta": 1, "P": 25}, -19),
        ({"beta": 2, "P": 10}, 1),
        ({"beta": 2, "P": 7}, 1),
    ],
)
def test_return_map_is_the_slope_of_the_exact_one(values: dict, viscous: float) -> None:
    P, d = values["P"], 1e-6
    expected = rest_map([1, P + viscous, P, P * 10]).kappa
    start = (d, 0.0, 4 / (P * 10) - 1.5 * d / 10)
    solution = solve(hunting(), start, (0, 3), parameters=values, rtol=1e-12, atol=1e-18)
    slope = solution.x_end[0] / d
    assert slope == pytest.approx(expected, abs=2e-4)


rates = st.floats(0.05, 20)


@settings(max_examples=100, deadline=None)
@given(a2=rates, r=rates, more=st.floats(1e-3, 20))
def test_routh_hurwitz_is_sufficient_for_the_return_map(a2: float, r: float, more: float) -> None:
    found = rest_map([1, a2, r + more, a2 * r])  # a1 > a0/a2
    assert abs(found.kappa) < 1
    assert growth([found]) < 1


def test_return_map_against_the_differential_equation() -> None:
    from scipy.integrate import solve_ivp

    a = [1.0, 2.0, 30.0, 90.0]
    stop = lambda t, y: y[1] if t > 0.01 else -1.0  # noqa: E731
    stop.terminal, stop.direction = True, 1
    run = solve_ivp(
        lambda t, y: [y[1], y[2], -a[3] * y[0] - a[2] * y[1] - a[1] * y[2]],
        (0, 10), [1.0, 0.0, 0.0], events=stop, rtol=1e-11, atol=1e-13, method="DOP853",
    )  # fmt: skip
    found = rest_map(a)
    assert found.duration == pytest.approx(run.t[-1], rel=1e-7)
    assert found.kappa == pytest.approx(run.y[0, -1], rel=1e-7)


def test_return_map_of_real_roots() -> None:
    assert rest_map(np.poly([-1, -2, -3])).outcome == "converges"
    for least in (0.0, 1e-18, -1e-18, 1e-14):  # a root that is 0 to rounding says neither
        border = rest_map([1, 2, 1, least])
        assert border.outcome == "undecided"
        assert np.isnan(growth([border]))
    assert rest_map(np.poly([1, -2, -3])).outcome == "leaves"
    assert rest_map(np.poly([-1, -2])).outcome == "converges"
    assert rest_map([1, 0, 4]).kappa == pytest.approx(-1)
    assert growth([rest_map(np.poly([1, -2, -3]))]) > 1


def test_threshold_of_a_known_measure() -> None:
    assert threshold(lambda q: q / 3, 0.1, 100) == pytest.approx((3.0,), rel=1e-12)


# -- other systems -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("c", "stable"), [(0.2, True), (-0.2, True), (-5.0, False)])
def test_coulomb_oscillator_rests_even_with_some_negative_damping(c: float, stable: bool) -> None:
    q = parameters(m=1, c=c, k=2, Fc=3)
    system = System({x: v, v: (-q.c * v - q.k * x - q.Fc * sign(v)) / q.m})
    (item,) = stability_report(system).items
    assert item.interior == "stable"
    assert item.answer == ("asymptotically stable" if stable else "unstable")
    # From just beyond the end of the segment |x| <= 1.5 the motion stops on it, or not.
    end = solve(system, (1.5 + 1e-4, 0), (0, 8)).x_end
    assert bool(abs(end[0]) <= 1.5 and end[1] == 0) is stable


def test_jump_at_break_away_makes_the_set_unstable() -> None:
    q = parameters(P=10, I=10, Fs=4, Fc=2)
    surface = Surface("velocity", v, radius=q.Fs / q.Fc)
    system = System({x: v, v: -q.P * (x + v + q.I * z) - q.Fc * sign(v) - v, z: x}, surfaces=[surface])
    (item,) = stability_report(system).items
    assert item.answer == "unstable"
    assert "wider" in item.cases[0].statements[0].text
    (equal,) = stability_report(system, {"Fs": 2}).items  # Coulomb alone: no hunting
    assert equal.answer == "asymptotically stable"


@pytest.mark.parametrize("zero", ["P", "I"])
def test_degenerate_gains_are_named(zero: str) -> None:
    (item,) = stability_report(hunting(), {zero: 0}).items
    texts = [st.text for st in item.statements]
    assert f"degenerate: {zero} = 0" in texts
    assert any("unbounded" in text for text in texts)
    assert any("root that is 0" in st.text for st in item.cases[0].statements)
    assert item.answer == "undecided"


def test_infinite_slope_without_a_coefficient_is_none() -> None:  # Fs = Fc: Coulomb friction whatever beta is
    (item,) = stability_report(hunting(), {"Fs": 2, "beta": 0.5}).items
    assert item.answer == "asymptotically stable"


def test_pendulum_at_its_two_rests() -> None:
    system = System({x: v, v: -0.5 * sign(v) - 9.81 * sin(x)})
    answers = {
        round(sum(e.value[0] for e in i.equilibrium.ends) / 2): i.answer
        for i in stability_report(system).items
    }
    assert answers == {0: "asymptotically stable", 3: "unstable"}


@pytest.mark.parametrize(("k", "answer"), [(1, "asymptotically stable"), (-1, "unstable")])
def test_attraction_of_the_surface_decides(k: float, answer: str) -> None:
    q = parameters(k=k)
    (item,) = (
        i for i in stability_report(System({x: -q.k * sign(x), v: -v})).items if i.equilibrium.mode == "0"
    )
    assert item.answer == answer


@pytest.mark.parametrize(("zeta", "answer"), [(1, "asymptotically stable"), (-1, "unstable")])
def test_zeros_of_a_relay_plant_are_the_sliding_roots(zeta: float, answer: str) -> None:
    q = parameters(zeta=zeta, r=2)
    system = System({x: v - sign(x), v: z - 2 * q.zeta * q.r * sign(x), z: -(q.r**2) * sign(x)})
    (item,) = (i for i in stability_report(system, solve_for="zeta").items if i.equilibrium.mode == "0")
    assert sympy.simplify(as_expression(item.polynomial) - (s**2 + 2 * q.zeta * q.r * s + q.r**2)) == 0
    assert item.answer == answer


def test_smooth_equilibrium_with_a_solved_parameter() -> None:
    q = parameters(c=1, k=3)
    (item,) = stability_report(System({x: v, v: -q.c * v - q.k * x}), solve_for=q.c).items
    assert item.answer == "asymptotically stable"
    assert item.solved.numeric.as_set() == sympy.Interval.open(0, sympy.oo)
    assert item.solved.formula == (q.c > 0)
    assert stability_report(System({x: v, v: -q.c * v - q.k * x}), {"c": 0}).items[0].answer == "stable"
    assert stability_report(System({x: v, v: -q.c * v - q.k * x}), {"c": -1}).items[0].answer == "unstable"


def test_hook_decides_where_the_linear_part_does_not() -> None:
    y, w = states("y w")
    # The forces between the two are not those of a spring, so no energy decides.
    chain = {x: v, v: -2 * x + y - sign(v), y: w, w: -x - y - 0.1 * w}
    asked = []

    def hook(system, found, values):
        asked.append(found)
        return SetEvidence(0.5, "test")

    without = [i for i in stability_report(System(chain)).items if i.equilibrium.dimension == 1]
    with_hook = [i for i in stability_report(System(chain), hook=hook).items if i.equilibrium.dimension == 1]
    assert [i.answer for i in without] == ["undecided"]
    assert [i.answer for i in with_hook] == ["asymptotically stable"]
    assert len(asked) == 1


def test_plain_functions_are_refused() -> None:
    system = System(field=lambda t, y, p, s: [-y[0]], states="x")
    with pytest.raises(ModelError, match="expressions"):
        stability_report(system)
    (point,) = equilibria(system).points
    with pytest.raises(ModelError, match="expressions"):
        linearise(system, point)


def test_exponent_just_above_1_says_how_narrow_its_case_is() -> None:
    (item,) = stability_report(hunting(), {"beta": 1.0001}).items
    (case,) = (c for c in item.cases if c.applies)
    assert case.polynomial == (1, (p.D * p.P + p.b) / p.m, p.P / p.m, p.I * p.P / p.m)
    assert any("near 1" in st.text for st in case.statements)


def test_unknown_parameter_gets_a_suggestion() -> None:
    with pytest.raises(ModelError, match="did you mean 'beta'"):
        stability_report(hunting(), solve_for="bta")


# -- exponents ---------------------------------------------------------------------------------------------


def test_exponents_of_powers_of_a_size() -> None:
    a, e, c = sympy.Dummy("a", positive=True), sympy.Symbol("e", real=True), sympy.Symbol("c", positive=True)
    (power,) = size_powers([sympy.exp(-((a**2 / c) ** e))], [a])
    assert power.exponent == 2 * e
    assert sympy.simplify(power.scale - sympy.sqrt(c)) == 0
    cases = exponent_cases([power])
    assert [case.holds({e: sympy.Rational(n, 10)}) for case in cases for n in (7, 5, 2)] == [
        True, False, False, False, True, False, False, False, True,
    ]  # fmt: skip
    assert dict(cases[1].put) == {e: sympy.Rational(1, 2)}
    assert size_powers([(1 + a) ** e, a**2], [a]) == []
    assert [c.slopes for c in exponent_cases(size_powers([sympy.sqrt(a)], [a]))] == [("infinite",)]


def test_finite_slope_by_other_curves() -> None:
    q = parameters(gamma=3, k=1)
    system = System({x: v, v: -q.k * x - sign(v) / (1 + q.gamma * Abs(v))})
    (segment,) = equilibria(system).sets
    for slip in linearise(system, segment).slip:
        assert sympy.simplify(slip.matrix[1, 1] - q.gamma) == 0  # d/dv of -1/(1 + gamma v) at 0


# -- renderings --------------------------------------------------------------------------------------------


def test_renderings_say_the_same(report: StabilityReport) -> None:
    text, markdown, latex = report.to_text(), report.to_markdown(), report.to_latex()
    for words in ("Stability", "Set of equilibria", "asymptotically stable", "sufficient", "26.60"):
        assert words in text
        assert words in markdown
        assert words in latex
    assert "P > 29" in text
    assert r"\section{Stability}" in latex
    assert latex.count("$") % 2 == 0
    assert json.loads(report.to_json()) == report.to_dict()
    assert not any(math.isinf(e) for e in report.to_dict()["equilibria"][0]["ends"][0])


def test_polynomial_of_a_matrix() -> None:
    assert characteristic_polynomial(sympy.Matrix([[0, 1], [-p.P, -p.b]])) == (1, p.b, p.P)
