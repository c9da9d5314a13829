"""Formulas of banks as sympy prints them: x' = formula from 0 to the time 1, against integrals by hand."""

from typing import Any

import pytest
import sympy

from filippov.app.bank import run_bank
from filippov.app.bank.notation import number
from filippov.base.errors import ModelError
from filippov.model.expression import parse_expression

INTEGRALS = {
    "Rational(1, 3)": "1/3",
    "E": "exp(1)",
    "E**t": "E - 1",
    "cbrt(t)": "3/4",
    "sec(t)": "log(sec(1) + tan(1))",
    "cot(1 + t)": "log(sin(2)/sin(1))",
    "csc(1 + t)": "log(tan(1)/tan(1/2))",
    "sgn(t - 1/4)": "1/2",
    "Piecewise((1, t < 1/2), (2, True))": "3/2",
    "Piecewise((1, x < 1/4), (2, x >= 1/4))": "7/4",
    "Piecewise((0, (t < 1/4) | (t > 3/4)), (4, True))": "2",
    "Piecewise((4, (t > 1/4) & ~(t > 3/4)), (0, True))": "2",
    "Piecewise((4, And(t > 1/4, Not(t > 3/4))), (0, True))": "2",
    "Piecewise((t, t < 1/2), (1 - t, t < 3/4), (1/4, True))": "1/8 + 3/32 + 1/16",
    "2*Piecewise((Piecewise((1, t < 1/4), (3, True)), t < 1/2), (0, True))": "2",
}


def case(rate: str, value: str, **more: Any) -> dict[str, Any]:
    return {
        "id": "integral", "states": ["x"], "h": ["x - 100"], "fields": {"+": ["0"], "-": [rate]}, "x0": ["0"],
        "t_span": ["0", "1"], "expected": [{"name": "x(1)", "value": value, "tol": "1e-9"}], **more,
    }  # fmt: skip


@pytest.mark.parametrize("rate", INTEGRALS)
def test_15_formulas_of_sympy_are_read(rate: str) -> None:
    for form in ({}, {"h": None, "fields": None, "smooth_field": [rate]}):
        (row,) = run_bank([case(rate, INTEGRALS[rate], **form)])
        assert row.passed, row.message
        assert row.evaluated == ("x(1)",)


LONGER = "Piecewise((t**2, (t > 0) & (t < 1)), (sin(t), t >= 1), (0, True))"


@pytest.mark.parametrize("text", [*INTEGRALS, LONGER])
def test_15_what_sympy_prints_means_the_same(text: str) -> None:
    t, x = sympy.symbols("t x", real=True)
    names = {"t": t, "x": x, "E": sympy.E}
    here = parse_expression(text, names)
    there = sympy.sympify(text.replace("sgn", "sign"), locals={"t": t, "x": x})
    for at in (0.1, 0.3, 0.6, 0.9, 1.4):
        point = {t: at, x: 1 - at}
        assert float(here.subs(point)) == pytest.approx(float(there.subs(point)), rel=1e-14)


@pytest.mark.parametrize(
    "text",
    [
        "Piecewise(1, 2)", "Piecewise()", "Piecewise((1, 2))", "Piecewise((1, t > 0, 3))", "Rational(1, 0)",
        "Piecewise((1, False))", "Piecewise((1, t == 0), (2, True))", "And(t > 0)", "Rational()",
        "Piecewise((1, And()), (2, True))",
        "Piecewise((1, t > 0 if t else t < 0), (2, True))", "Piecewise((1, __import__('os')), (2, True))",
        "Piecewise([(1, True)])", "Piecewise((1, Not(t > 0, t < 1)), (2, True))", "t > 0", "sec()",
        "Piecewise(" + "(1, t > 0), " * 40 + "(2, True))",
    ],
)  # fmt: skip
def test_15_what_is_no_formula_is_refused(text: str) -> None:
    with pytest.raises(ModelError):
        float(parse_expression(text, {}))


def test_15_a_parameter_named_e_is_no_constant() -> None:
    assert number("E*2", {"E": 3.0}) == 6
    (row,) = run_bank([case("E*t", "1", params={"E": "2"})])
    assert row.passed, row.message


def test_15_parameters_may_stand_in_any_order() -> None:
    (row,) = run_bank([case("c*t", "3", params={"c": "2 b + a", "b": "a", "a": "2"})])
    assert row.passed, row.message
    for params in ({"a": "b", "b": "a"}, {"a": "a"}, {"a": "q"}):
        (row,) = run_bank([case("a", "1", params=params)])
        assert row.status == "error"
        assert "unknown name" in row.message
    heat = [
        {"name": "on", "field": ["1"], "until": {"x": "b"}},
        {"name": "off", "field": ["-1"], "until": {"x": "-b"}},
    ]
    expected = [{"name": "period", "value": "4*b", "tol": "1e-9"}]
    system = {"id": "relay", "states": ["x"], "params": {"b": "a/2", "a": "1"}, "automaton": heat}
    (row,) = run_bank([{**system, "x0": ["0"], "t_span": ["0", "9"], "expected": expected}])
    assert row.passed, row.message
