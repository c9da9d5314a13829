"""Formulas that stand for endless work end in a result or a named refusal; long sums are no such thing."""

import math
import os
import random
from typing import Any

import hostile
import numpy as np
import pytest
import sympy

from filippov import System, sign, solve, states
from filippov.analysis.algebra import deadline
from filippov.analysis.algebra.budget import OutOfBudgetError
from filippov.app.bank import build
from filippov.app.bank.case import read_bank
from filippov.app.bank.migrate.rule import tolerance
from filippov.app.bank.run import run_bank
from filippov.base.errors import ModelError
from filippov.kernel.codegen import generate
from filippov.model import extract
from filippov.model.expression import parse_condition, parse_expression
from filippov.model.size import MOST_NODES, MOST_TERMS, Scale, expanded, terms
from filippov.model.table import vanishes

X, Y = (sympy.Symbol(name, real=True) for name in "xy")
NAMES = {"x": X, "y": Y}
TERMS = ("{a}*x", "{a}*y**2", "{a}*sin({b}*x)", "{a}*cos(y)/{b}", "{a}*x*y", "exp(-{b}*x)", "{a}")
MANY = {"nightly": 1000, "ci": 6}.get(os.environ.get("FILIPPOV_PROFILE", ""), 4)


def case(field: str, **more: Any) -> dict[str, Any]:
    entries = [{"name": "final_state", "value": [0.0, 0.0], "tol": 1e-6}]
    return {
        "id": "A", "states": ["x", "y"], "smooth_field": [field, "0"], "x0": [0.3, 0.7], "t_span": [0, 0.1],
        "expected": entries, **more,
    }  # fmt: skip


@pytest.mark.parametrize("count", [10, 61, 62, 200, 500])
def test_11_22_sums_of_ordinary_terms_are_right(count: int) -> None:
    draw = random.Random(count)  # noqa: S311
    pieces = [draw.choice(TERMS).format(a=draw.randint(1, 99), b=draw.randint(1, 9)) for _ in range(count)]
    signs = [draw.choice("+-") for _ in range(count - 1)]
    text = pieces[0] + "".join(f" {s} {p}" for s, p in zip(signs, pieces[1:], strict=True))
    found = parse_expression(text, NAMES)
    function = sympy.lambdify((X, Y), found, "math")
    plain = {"sin": math.sin, "cos": math.cos, "exp": math.exp}
    for _ in range(5):
        x, y = draw.uniform(-2, 2), draw.uniform(-2, 2)
        wanted = 0.0
        for op, piece in zip(["+", *signs], pieces, strict=True):
            head, _, rest = piece.partition("*")
            value = _by_hand(head, rest, x, y, plain)
            wanted += value if op == "+" else -value
        assert function(x, y) == pytest.approx(wanted, rel=1e-10, abs=1e-9)


def _by_hand(head: str, rest: str, x: float, y: float, plain: dict[str, Any]) -> float:
    """The terms above with Python's floats, without any parser."""
    if head.startswith("exp"):
        return math.exp(-int(head.removeprefix("exp(-")) * x)
    a = int(head)
    if rest.startswith(("sin", "cos")):
        name, inside = rest[:3], rest[4:]
        if name == "cos":
            return a * math.cos(y) / int(inside.removeprefix("y)/"))
        return a * plain[name](int(inside.removesuffix("*x)")) * x)
    return a * {"": 1.0, "x": x, "y**2": y * y, "x*y": x * y}[rest]


def test_11_22_a_long_sum_runs_in_compiled_code() -> None:
    count = 400
    (x,) = states("x")
    text = "+".join(f"sin({k}*x)/{k}" for k in range(1, count))
    field = parse_expression(text, {"x": x})
    found = solve(System({x: field}), (0.2,), (0, 0.5), rtol=1e-10)
    from scipy.integrate import solve_ivp

    ks = np.arange(1, count)
    peer = solve_ivp(lambda t, q: [np.sum(np.sin(ks * q[0]) / ks)], (0, 0.5), [0.2], rtol=1e-10, atol=1e-12)
    assert found.x_end[0] == pytest.approx(peer.y[0, -1], rel=1e-7)


def test_11_22_deep_formulas_are_written_in_steps() -> None:
    (x,) = states("x")
    nested: Any = x
    for _ in range(45):
        nested = sympy.sin(nested) + sympy.Rational(1, 2)
    with pytest.raises(ModelError, match="nested 180 deep, expected at most 100"):
        System({x: nested.subs(x, nested)})
    found = solve(System({x: nested}), (0.3,), (0, 1), rtol=1e-10)
    # The iteration has reached its fixed point c = sin c + 1/2, whatever x is.
    c = 1.0
    for _ in range(200):
        c = math.sin(c) + 0.5
    assert found.x_end[0] == pytest.approx(0.3 + c, rel=1e-8)


@pytest.mark.parametrize(
    ("text", "names", "why"),
    [
        ("Max(" + ",".join(f"x+{k}*y" for k in range(400)) + ")", {}, "400 arguments, expected at most"),
        ("x" + "+1" * 9_000, {}, "thousands of terms"),
        ("(" * 70 + "x" + ")" * 70, {}, None),
        ("sin(" * 61 + "x" + ")" * 61, {}, "nested deeper than 60"),
        ("((2**60)**60)**60", {}, "too large a number"),
        ("x/0", {}, "divided by"),
        ("x/(y-y)", {}, "divided by"),
    ],
)
def test_11_22_hostile_texts_are_refused_by_name(text: str, names: dict[str, Any], why: str | None) -> None:
    if why is None:
        assert parse_expression(text, NAMES | names) == X
        return
    with pytest.raises(ModelError, match=why):
        parse_expression(text, NAMES | names)


def test_11_22_names_that_double_are_refused() -> None:
    known: dict[str, Any] = dict(NAMES)

    def double() -> None:
        last = "x"
        for k in range(60):
            known[f"K{k}"] = parse_expression(f"{last}*({last}+1)", known)
            last = f"K{k}"

    with pytest.raises(ModelError, match=f"nodes, expected at most {MOST_NODES}"):
        double()
    assert len(known) < 20


def test_11_22_conditions_have_the_same_limits() -> None:
    with pytest.raises(ModelError, match="nested deeper"):
        parse_condition("not " * 61 + "x > 0", NAMES)
    assert parse_condition("+".join(["x"] * 100) + " > 1", NAMES) == (100 * X > 1)


def test_11_22_terms_are_counted_before_they_are_formed() -> None:
    big = (X + Y + 1) ** 64
    assert terms(big) == math.comb(66, 64)
    assert terms(big * big) > MOST_TERMS
    assert expanded(big * big) == big * big
    assert expanded((X + 1) ** 2) == X**2 + 2 * X + 1
    product = sympy.Mul(*[X + k for k in range(40)], evaluate=False)
    assert terms(product) == 2**39
    assert not vanishes(big * big - big * big * X)
    assert vanishes((big * (X + 1) * big) - sympy.Mul(big, big, X, evaluate=False) - big**2)
    assert vanishes((X + 1) ** 2 - X**2 - 2 * X - 1)
    assert not vanishes(sympy.log(-1 - X**2) * big * big)
    doubled: Any = X
    for _ in range(60):
        doubled = sympy.sin(doubled) * (doubled + 1)
    assert Scale().weigh(doubled)[0] > 2**60


def test_11_22_fields_are_not_multiplied_out(monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[int] = []
    expand = sympy.expand

    def counted(e: Any, *arguments: Any, **hints: Any) -> Any:
        seen.append(terms(e))
        return expand(e, *arguments, **hints)

    monkeypatch.setattr(sympy, "expand", counted)
    x, y = states("x y")
    from filippov.model.symbols import t

    big = (x + y + t + 1) ** 64
    system = System({x: -big * sign(x) * sign(y) - big * sign(x), y: sympy.Max(big, big * y, y) - sign(y)})
    generate.generate(system.symbolic, system.surfaces)
    assert max(seen, default=0) <= MOST_TERMS


def test_11_22_branches_that_unfold_without_end_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extract, "MOST_CASES", 50)
    x, y = states("x y")
    parts = [sympy.sin((k + 1) * x) + y**k for k in range(9)]
    with pytest.raises(ModelError, match="unfold into more than 50 cases"):
        System({x: sympy.Max(*parts, evaluate=False), y: 1})


def test_11_22_large_expressions_are_refused_by_name() -> None:
    (x,) = states("x")
    doubled: Any = x
    for _ in range(40):
        doubled = sympy.sin(doubled) * (doubled + 1)
    with pytest.raises(ModelError, match="nodes, expected at most 200000"):
        System({x: doubled})


@pytest.mark.parametrize("seed", range(MANY))
def test_11_22_hostile_cases_end_in_a_row(seed: int) -> None:
    """Built, or refused with a sentence; what is multiplied out or put together stays within its budget."""
    raw = hostile.case(random.Random(seed))  # noqa: S311

    def attempt() -> Any:
        return build.build(raw)

    try:
        built = deadline.within(4.0, attempt)
    except (ModelError, OutOfBudgetError):
        return
    nodes = sum(Scale().weigh(e)[0] for row in built.fields.values() for e in row)
    assert nodes <= 4096 * build.MOST_NODES
    assert len(built.system.surfaces) <= build.MOST_KINKS


def test_11_22_the_time_covers_evaluation_too(monkeypatch: pytest.MonkeyPatch) -> None:
    from filippov.app.bank.subjects import Subjects

    def endless(subjects: Subjects, entry: Any) -> Any:
        while True:
            pass

    monkeypatch.setattr(Subjects, "outcome", endless)
    (row,) = run_bank([case("-x")], max_time=2.0)
    assert row.status == "timeout"
    assert "more than 2 s" in row.message


def test_11_22_counts_are_not_built_as_lists() -> None:
    entry = {"name": "event_times", "value": "t_n = n, n=1..1000000000000", "tol": 1e-9}
    (row,) = run_bank([case("-x", expected=[entry])])
    assert row.status != "timeout"
    assert not row.passed
    tol = "+".join(["1"] * 1_000)
    (one,) = read_bank([case("-x", expected=[{"name": "a", "value": 1, "tol": tol}])])
    assert tolerance(one.expected[0].given) == 0.0


def test_11_22_cases_with_too_many_kinks_are_refused() -> None:
    (row,) = run_bank([case("+".join(f"Abs(x-{k})" for k in range(70)))])
    assert "70 different functions that jump or bend" in row.message


def test_11_22_a_stopped_computation_says_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    def endless() -> None:
        while True:
            pass

    for _ in range(5):
        with pytest.raises(OutOfBudgetError):
            deadline.within(0.02, endless)
    assert capsys.readouterr().err == ""
