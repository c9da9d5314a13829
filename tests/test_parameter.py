"""Names and parameters: what is accepted, what is refused and in which words."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import sympy as sp

from filippov.base.errors import ModelError, UsageError
from filippov.base.names import check_known, check_name, closest, unknown
from filippov.model.parameter import Parameter, ParameterSet
from filippov.model.parameter_symbol import ParameterSymbol, parameters
from filippov.model.symbols import states
from filippov.model.system import System

x, v, z = states("x v z")


@pytest.mark.parametrize("name", ["E", "I", "S", "N", "pi", "mu_s", "μ", "Δx", "x1"])
def test_names_accepted(name: str) -> None:
    (symbol,) = states(name)
    p = parameters(k=2)
    system = System({symbol: -p.k * sp.sign(symbol)})
    assert system.states == (name,)
    assert system.symbolic is not None
    assert system.symbolic.at_mode("+") == (-p.k,)
    assert parameters(**{name: 1})[name].name == name


@pytest.mark.parametrize(
    "name", ["lambda", "class", "2x", "a b", "a-b", "", "_a", "__class__", "t", "x;y", "f()"]
)
def test_names_refused(name: str) -> None:
    with pytest.raises(ModelError, match="name"):
        parameters(**{name: 1})
    with pytest.raises(ModelError, match="name"):
        states([name])


def test_micro_sign_is_the_greek_letter() -> None:
    assert check_name("\u00b5", "state") == "\u03bc"
    assert parameters(µ=2).μ.parameter.default == 2


def test_states_text_and_duplicates() -> None:
    assert states("x, v ,z") == states(["x", "v", "z"]) == states(" x  v z ") == (x, v, z)
    assert all(q.is_real for q in states("a b"))
    with pytest.raises(ModelError, match="given twice"):
        states("x x")
    with pytest.raises(ModelError, match="at least one"):
        states("")
    with pytest.raises(ModelError, match="expected text"):
        states(3)  # type: ignore[arg-type]


def test_suggestions() -> None:
    assert unknown("parameter", "mus", ["m", "mu_s"]) == (
        "unknown parameter 'mus'; did you mean 'mu_s'? known: m, mu_s"
    )
    assert closest("fs", ["Fs", "Fc"]) == "did you mean 'Fs'?"
    assert closest("zzz", ["Fs", "Fc"]) == ""
    with pytest.raises(UsageError, match="did you mean 'rtol'"):
        check_known("option", ["rtoll"], ["rtol", "atol"], UsageError)


def test_parameter_values() -> None:
    values = ParameterSet({"m": 1, "mu_s": Parameter(0.5, unit="1", lower=0, upper=1)})
    assert list(values.resolve(None)) == [1, 0.5]
    assert list(values.resolve({"mu_s": np.float32(0.25)})) == [1, 0.25]
    assert list(values.resolve([3, 0])) == [3, 0]
    p = parameters(m=1, mu_s=0.5)
    assert list(values.resolve({p.m: sp.Rational(1, 4)})) == [0.25, 0.5]
    for wrong, words in (
        ({"mus": 1}, "did you mean 'mu_s'"),
        ({"mu_s": 2}, r"outside its bounds \[0, 1\]"),
        ({"m": float("nan")}, "finite"),
        ({"m": float("inf")}, "finite"),
        ({"m": 1j}, "real number"),
        ({"m": sp.I}, "real number"),
        ({"m": "1"}, "real number"),
        ({"m": None}, "real number"),
        ({"m": True}, "Write 1.0"),
        ([1.0], "1 parameter values were given, expected 2"),
        ([[1.0, 2.0]], "expected 2"),
        (np.ones((2, 1)), "shape"),
        ("m", "expected a dict"),
        (3, "expected a dict"),
    ):
        with pytest.raises(ModelError, match=words):
            values.resolve(wrong)  # type: ignore[arg-type, unused-ignore]


def test_parameter_declarations() -> None:
    for arguments, words in (
        ({"default": 3, "upper": 2}, "outside its bounds"),
        ({"default": 1, "lower": 2, "upper": 0}, "empty"),
        ({"default": "1"}, "real number"),
        ({"default": 1, "lower": float("nan")}, "finite"),
        ({"default": 1, "lower": float("inf")}, "admits no value"),
        ({"default": 1, "unit": 3}, "expected text"),
    ):
        with pytest.raises(ModelError, match=words):
            Parameter(**arguments)
    assert Parameter(1, lower=-np.inf).lower is None
    p = parameters(m=1)
    with pytest.raises(AttributeError, match="declared once"):
        p.m = 3
    with pytest.raises(AttributeError, match="did you mean 'm'"):
        _ = p.M
    assert list(p) == [p["m"]]


def test_parameter_symbols_differ_with_their_content() -> None:
    one, two = parameters(m=1).m, parameters(m=2).m
    assert one != two
    assert one == parameters(m=1).m
    assert one != sp.Symbol("m", real=True)
    assert {one, two, parameters(m=1).m} == {one, two}
    assert (one + two).subs(one, 5) == two + 5
    again = pickle.loads(pickle.dumps(one * x))  # noqa: S301
    assert again == one * x
    (symbol,) = (q for q in again.free_symbols if isinstance(q, ParameterSymbol))
    assert symbol.parameter == Parameter(1)
    bounded = parameters(k=Parameter(1, lower=0.5)).k
    assert abs(bounded * x) == bounded * abs(x)


def test_record_is_read_only_and_indexed_three_ways() -> None:
    values = ParameterSet({"m": 1, "k": 2})
    p = values.record(values.resolve({"k": 5}))
    assert p.k == p["k"] == p[1] == 5
    assert list(p) == [1, 5]
    assert np.asarray(p).tolist() == [1, 5]
    assert pickle.loads(pickle.dumps(p)) == p  # noqa: S301
    with pytest.raises(AttributeError, match="read-only"):
        p.k = 3
    with pytest.raises(AttributeError, match="unknown parameter 'q'"):
        _ = p.q
    with pytest.raises(KeyError, match="unknown parameter 'q'"):
        p["q"]
