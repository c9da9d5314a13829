"""Routh-Hurwitz against published cases, numpy.roots and polynomials built from their roots."""

import json
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import sympy
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from filippov.analysis.algebra.polynomial import Verdict, coefficients, count_roots, exact, sign_changes
from filippov.analysis.algebra.routh_array import signs_at_zero
from filippov.analysis.algebra.routh_hurwitz import RouthHurwitz, routh_hurwitz
from filippov.base.errors import UsageError

DATA = Path(__file__).parent / "data" / "routh_hurwitz.json"
CASES = json.loads(DATA.read_text(encoding="utf-8"))["cases"]
NUMERIC = [c for c in CASES if c["expected"][0]["name"] == "rhp_axis_lhp"]
K, T, kp, kv, ki, m, b, c, P, D, I = sympy.symbols("K T kp kv ki m b c P D I", real=True)
quick = settings(max_examples=60, deadline=None)


def located(roots: np.ndarray) -> tuple[int, int, int]:
    """Counts from rounded roots; drops the example where rounding could decide."""
    assume(not np.any(np.abs(roots.real) < 1e-5))
    return int(np.sum(roots.real > 0)), 0, int(np.sum(roots.real < 0))


def triple(result: RouthHurwitz) -> tuple[int, int, int]:
    assert result.counts is not None
    return result.counts.rhp, result.counts.axis, result.counts.lhp


@pytest.mark.parametrize("case", NUMERIC, ids=lambda case: case["id"])
def test_published_polynomials(case: dict) -> None:
    result = routh_hurwitz([int(a) for a in case["polynomial"]])
    expected = {e["name"]: e["value"] for e in case["expected"]}
    assert list(triple(result)) == expected["rhp_axis_lhp"]
    # Each of these has a first column that changes its sign once for each root on the right.
    assert sign_changes(signs_at_zero(result.first_column)) == expected["rhp_axis_lhp"][0]
    axis = [complex(float(x), float(y)) for x, y in expected["roots"] if float(x) == 0]
    repeated = len(set(axis)) < len(axis)
    right, on_axis, _ = expected["rhp_axis_lhp"]
    if right or repeated:
        assert result.verdict is Verdict.UNSTABLE
    else:
        assert result.verdict is (Verdict.MARGINALLY_STABLE if on_axis else Verdict.ASYMPTOTICALLY_STABLE)


def test_gain_range_of_a_cubic() -> None:  # H13
    result = routh_hurwitz([1, 18, 77, K])
    assert result.array == ((1, 77), (18, K), (77 - K / 18,), (K,))
    assert result.solve_for(K, as_set=True) == sympy.Interval.open(0, 1386)
    assert str(result.solve_for("K")) == "(0 < K) & (K < 1386)"
    limit = result.at({"K": 1386})
    assert triple(limit) == (0, 2, 1)
    assert limit.verdict is Verdict.MARGINALLY_STABLE
    assert [(x.kind, x.power) for x in limit.special] == [("zero row", 1)]
    (auxiliary,) = (x.auxiliary for x in limit.special)
    assert set(sympy.roots(auxiliary, result.s)) == {sympy.sqrt(77) * sympy.I, -sympy.sqrt(77) * sympy.I}


def test_proportional_integral_loop_in_two_parameters() -> None:  # H14
    result = routh_hurwitz([1, 3, 2 + K, K / T])
    for k, t, verdict in [
        (1, 1, Verdict.ASYMPTOTICALLY_STABLE),
        (1, 0.1, Verdict.UNSTABLE),
        (1, Fraction(1, 9), Verdict.MARGINALLY_STABLE),
        (-3, -1, Verdict.UNSTABLE),
    ]:
        at = result.at({K: k, T: t})
        assert at.verdict is verdict
        assert bool(result.stable_when.subs({K: exact(k), T: exact(t)})) is (
            verdict is Verdict.ASYMPTOTICALLY_STABLE
        )
    assert result.solve_for(T, {"K": 1}, as_set=True) == sympy.Interval.open(sympy.Rational(1, 9), sympy.oo)


def test_pid_on_a_mass() -> None:  # H15
    result = routh_hurwitz([1, kv, kp, ki])
    assert result.stable_when == sympy.And(kv > 0, ki > 0, kp * kv - ki > 0)
    assert result.solve_for(ki) == sympy.And(kv > 0, ki > 0, ki < kp * kv)
    limit = result.at({ki: 6, kp: 3, kv: 2})
    assert triple(limit) == (0, 2, 1)
    found = set(sympy.roots(limit.special[0].auxiliary, limit.s))
    assert found == {sympy.sqrt(3) * sympy.I, -sympy.sqrt(3) * sympy.I}


def test_hunting_mass_with_friction_at_the_surface() -> None:
    vs, Fs, Fc = sympy.symbols("vs Fs Fc", positive=True)
    slope = b - (Fs - Fc) / vs
    polynomial = [1, (P * D + slope) / m, P / m, P * I / m]
    numbers = {"m": 1, "D": 1, "b": 1, "I": 10, "vs": 0.1, "Fs": 4, "Fc": 2}
    free = routh_hurwitz(polynomial)
    assert free.solve_for(P, numbers, as_set=True) == sympy.Interval.open(29, sympy.oo)
    positive = routh_hurwitz(polynomial, assume=[m > 0, D > 0, P > 0, I > 0])
    (condition,) = positive.conditions
    bound = positive.solve_for(P)
    assert sympy.simplify(bound.gts - P) == 0 or bound.gts == P
    assert sympy.simplify(bound.lts - ((Fs - Fc) / (D * vs) + m * I / D - b / D)) == 0
    assert bool(condition.subs({x: exact(numbers[x.name]) for x in condition.free_symbols - {P}}).subs(P, 30))


@quick
@given(
    st.lists(st.fractions(-4, 4, max_denominator=6), max_size=4),
    st.lists(st.tuples(st.integers(-2, 2), st.integers(1, 5)), max_size=3),
)
def test_counts_of_polynomials_built_from_roots(real: list[Fraction], pairs: list[tuple[int, int]]) -> None:
    polynomial = sympy.Poly(3, sympy.Symbol("s"))
    s = polynomial.gen
    for r in real:
        polynomial *= sympy.Poly(s - sympy.Rational(r.numerator, r.denominator), s)
    for x, y in pairs:
        polynomial *= sympy.Poly((s - x) ** 2 + y**2, s)
    parts = [*real, *(x for x, _ in pairs for _ in (0, 1))]
    counts = count_roots(polynomial)
    assert (counts.rhp, counts.axis, counts.lhp) == (
        sum(x > 0 for x in parts), sum(x == 0 for x in parts), sum(x < 0 for x in parts)
    )  # fmt: skip
    on_axis = [0 for r in real if r == 0] + [y for x, y in pairs if x == 0]
    lone = {y: on_axis.count(y) for y in set(on_axis)}
    expected: dict[int, int] = {}
    for y, multiplicity in lone.items():
        expected[multiplicity] = expected.get(multiplicity, 0) + (2 if y else 1)
    assert dict(counts.axis_multiplicities) == expected


@quick
@given(st.lists(st.integers(-5, 5), min_size=2, max_size=8))
def test_counts_and_column_agree_with_numpy(integers: list[int]) -> None:
    assume(integers[0] != 0 and integers[-1] != 0)
    expected = located(np.roots(integers))
    result = routh_hurwitz(integers)
    assert triple(result) == expected
    # Without roots on the axis the column counts too, with epsilon and auxiliary polynomials.
    assert sign_changes(signs_at_zero(result.first_column)) == expected[0]


@quick
@given(st.lists(st.floats(0.01, 9) | st.floats(-9, -0.01), min_size=3, max_size=6))
def test_float_coefficients_agree_with_numpy(floats: list[float]) -> None:
    assert triple(routh_hurwitz(floats)) == located(np.roots(floats))


GENERIC = {n: routh_hurwitz(sympy.symbols(f"a0:{n + 1}", real=True)) for n in (1, 2, 3, 4, 5)}


@quick
@given(st.sampled_from(sorted(GENERIC)), st.data())
def test_symbolic_conditions_are_necessary_and_sufficient(n: int, data: st.DataObject) -> None:
    signed = st.integers(-3, 6).filter(bool)
    values = data.draw(st.lists(signed, min_size=n + 1, max_size=n + 1))
    if data.draw(st.booleans()):  # otherwise nearly every polynomial is unstable
        values = np.poly([-abs(v) for v in values[1:]]).round().astype(int).tolist()
    symbols = GENERIC[n].coefficients
    told = bool(GENERIC[n].stable_when.subs(dict(zip(symbols, values, strict=True))))
    assert told is (count_roots(values).verdict is Verdict.ASYMPTOTICALLY_STABLE)


@pytest.mark.parametrize(
    ("given_", "counts", "verdict", "rows"),
    [
        ([1, 0, 2, 0, 1], (0, 4, 0), Verdict.UNSTABLE, [3, 1]),
        ([1, 1, 1, 1], (0, 2, 1), Verdict.MARGINALLY_STABLE, [1]),
        ([1, 0, 3, 0, 3, 0, 1], (0, 6, 0), Verdict.UNSTABLE, [5, 3, 1]),
        ([1, 0, 0], (0, 2, 0), Verdict.UNSTABLE, [1, 0]),
        ([1, 1, 0], (0, 1, 1), Verdict.MARGINALLY_STABLE, [0]),
    ],
)
def test_zero_rows(
    given_: list[int], counts: tuple[int, int, int], verdict: Verdict, rows: list[int]
) -> None:
    result = routh_hurwitz(given_)
    assert triple(result) == counts
    assert result.verdict is verdict
    assert [(x.kind, x.power) for x in result.special] == [("zero row", power) for power in rows]


def test_epsilon_with_roots_on_the_axis_is_said() -> None:
    # (s^2 + 1)(s^4 + s^3 + 2 s^2 + 2 s + 1): epsilon moves the roots +-i, the counts do not depend on it.
    result = routh_hurwitz([1, 1, 3, 3, 3, 2, 1])
    roots = np.roots([1, 1, 2, 2, 1])
    assert triple(result) == (int(np.sum(roots.real > 0)), 2, int(np.sum(roots.real < 0)))
    assert "epsilon" in result.message


def test_a_users_epsilon_is_another_symbol() -> None:
    epsilon = sympy.Symbol("epsilon", positive=True)
    result = routh_hurwitz([1, epsilon, 2, 2 * epsilon, 1])
    assert [x.kind for x in result.special] == ["zero pivot"]
    assert result.stable_when == sympy.false
    assert len([x for x in result.array[2][0].free_symbols if x != epsilon]) == 1


def test_a_pivot_that_vanishes_only_after_simplification() -> None:
    root = sympy.sqrt(2)
    result = routh_hurwitz([1, root * K, root, 2 * K])
    assert [x.kind for x in result.special] == ["zero row"]
    assert result.stable_when == sympy.false
    assert triple(routh_hurwitz([1, root, root, 2])) == (0, 2, 1)


def test_leading_coefficient_that_may_vanish() -> None:
    result = routh_hurwitz([1 - K, 2, K + 1])
    assert [case.condition for case in result.cases] == [sympy.Ne(K - 1, 0), sympy.Eq(K - 1, 0)]
    reduced = result.cases[1].reduced
    assert reduced is not None
    assert reduced.coefficients == (2, 2)
    assert reduced.verdict is Verdict.ASYMPTOTICALLY_STABLE
    assert result.solve_for(K, as_set=True) == sympy.Interval.Lopen(-1, 1)
    assert routh_hurwitz([m, b, c], assume=[m > 0]).cases == ()
    nested = routh_hurwitz([m, b, c])
    assert nested.cases[1].reduced is not None
    assert nested.cases[1].reduced.stable_when == (c / b > 0)


def test_sign_of_the_leading_coefficient_is_normalised() -> None:
    assert triple(routh_hurwitz([-1, -2, -3])) == (0, 0, 2)
    negative = sympy.Symbol("n", negative=True)
    assert routh_hurwitz([negative, K, -1]).stable_when == (K < 0)


def test_conditions_that_contradict_each_other_stay() -> None:
    result = routh_hurwitz([1, K - 1, -1 - K])
    assert result.solve_for(K, as_set=True) == sympy.EmptySet
    assert result.solve_for(K) == sympy.false


def test_budget_ends_with_the_rows_so_far() -> None:
    x = sympy.symbols("x0:8", real=True)
    long = [sympy.Add(*x, k) ** (3 + k % 2) for k in range(7)]
    result = routh_hurwitz(long, budget=5)
    assert result.status == "timeout"
    assert 2 <= len(result.array) < 7
    assert "necessary" in result.to_text()
    with pytest.raises(UsageError, match="budget"):
        result.solve_for(x[0])
    assert routh_hurwitz([1, (x[0] + x[1]) ** 99999, 1]).status == "timeout"
    assert routh_hurwitz([1, K, 2, 3], budget=1e-9).status == "timeout"


def test_floats_stand_for_their_decimal() -> None:
    assert coefficients([0.1, np.float64(2.5), 3]) == (sympy.Rational(1, 10), sympy.Rational(5, 2), 3)
    assert coefficients([1, 0.1 * K]) == (1, K / 10)


def test_forms_in_which_a_polynomial_is_given() -> None:
    s, z = sympy.symbols("s z")
    assert coefficients(s**2 + K * s + 1) == (1, K, 1)
    assert coefficients(z**2 + K * z + 1, z) == (1, K, 1)
    assert coefficients(sympy.Poly(z**2 + 3, z)) == (1, 0, 3)
    assert coefficients(np.array([0, 0, 2, 1])) == (2, 1)
    assert routh_hurwitz(z**2 + K * z + 1, z).to_text().startswith("p(z) = z**2 + K*z + 1")


@pytest.mark.parametrize(
    ("polynomial", "match"),
    [
        ("s**2 + 1", "give coefficients"),
        (["1", 2], "expected a real number"),
        ([1, float("nan")], "not finite"),
        ([1, 2 + 1j], "expected a real number"),
        ([1, sympy.I], "finite real"),
        ([0, 0], "zero"),
        ([], "zero"),
        ([1, None], "expected a real number"),
        (sympy.exp(sympy.Symbol("s")), "not a polynomial"),
        (K * T + 1, "which one is the variable"),
        ([1, sympy.pi], "rational, algebraic"),
    ],
)
def test_what_is_no_polynomial_is_refused(polynomial: object, match: str) -> None:
    with pytest.raises(UsageError, match=match):
        routh_hurwitz(polynomial)


def test_unknown_names_and_wrong_values_are_refused() -> None:
    result = routh_hurwitz([1, kv, kp, ki])
    with pytest.raises(UsageError, match="did you mean 'kp'"):
        result.at({"Kp": 1})
    with pytest.raises(UsageError, match="known: ki, kp, kv"):
        result.solve_for("gain")
    with pytest.raises(UsageError, match="give values"):
        result.solve_for(ki, as_set=True)
    with pytest.raises(UsageError, match="contradict"):
        routh_hurwitz([m, b], assume=[m > 0]).at({m: -1})
    with pytest.raises(UsageError, match="budget"):
        routh_hurwitz([1, 2], budget=0)
    with pytest.raises(UsageError, match="expected inequalities"):
        routh_hurwitz([m, b], assume=["m > 0"])


@pytest.mark.parametrize(
    "given_", [[1, 18, 77, K], [1, 1, 2, 2, 1, 1], [1, 2, 3, 6, 5, 3], [m, b, c], [5], [1, 0]]
)
def test_renderings(given_: list) -> None:
    result = routh_hurwitz(given_)
    held = json.loads(result.to_json())
    assert held == result.to_dict()
    assert held["first_column"] == [str(x) for x in result.first_column]
    assert held["verdict"] == (result.verdict.value if result.verdict else None)
    text, markdown, latex = result.to_text(), result.to_markdown(), result.to_latex()
    for power in range(result.degree + 1):
        assert f"s^{power} |" in text
        assert f"$s^{{{power}}}$ |" in markdown
        assert f"s^{{{power}}} &" in latex
    assert latex.count("\\begin{array}") == latex.count("\\end{array}") >= 1
    outside = latex.replace("\\[", "$").replace("\\]", "$").split("$")[::2]
    assert not any(mark in part for part in outside for mark in "_^{}\\")
    if result.verdict:
        assert all(f"verdict: {result.verdict.value}" in x for x in (text, markdown, latex))


@pytest.mark.parametrize("seed", range(12))
def test_12_8_counts_with_square_roots_of_long_decimals(seed: int) -> None:
    """Up to three roots of 15-digit numbers, against numpy: some took minutes, and one crashed."""
    draw = np.random.default_rng([8, seed])
    n, m = int(draw.integers(2, 6)), int(draw.integers(1, 4))
    radicals = [sympy.sqrt(sympy.Rational(repr(abs(float(q))))) for q in draw.standard_normal(m)]
    rows = zip(draw.standard_normal(n + 1), draw.integers(-2, 3, (n + 1, m)), strict=True)
    given = [
        sympy.Rational(repr(float(a))) + sum(int(q) * r for q, r in zip(row, radicals, strict=True))
        for a, row in rows
    ]
    found, roots = count_roots(given), np.roots([float(c) for c in given])
    assert (found.rhp, found.axis, found.lhp) == (np.sum(roots.real > 0), 0, np.sum(roots.real < 0))


def test_12_8_more_roots_than_a_field_can_hold_are_named() -> None:
    with pytest.raises(UsageError, match="4 different roots"):
        count_roots([sympy.sqrt(q) for q in (2, 3, 5, 7)])
