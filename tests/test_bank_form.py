"""The typed form of a bank: every quantity against closed forms, what is refused, schema, migration."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path
from typing import Any

import pytest
from bank import CASES, FILE
from jsonschema import Draft202012Validator

from filippov.app.bank import migrate_bank, run_bank, schema
from filippov.app.bank.build import build
from filippov.app.bank.case import read_bank
from filippov.app.bank.case_runs import CaseRuns, Settings
from filippov.app.bank.quantities import GROUPS, QUANTITIES
from filippov.app.bank.subjects import Subjects
from filippov.app.bank.typed_json import written
from filippov.app.cli.main import main
from filippov.solving.state.options import Options

MORE = json.loads(FILE.with_name("more_cases.json").read_text(encoding="utf-8"))["cases"]
OLD = {**CASES, **{case["id"]: case for case in MORE}}
SCHEMA = Draft202012Validator(schema())
# x' = -2 sgn x from 1: at x = 0 from t = 1/2 on.
RELAY: dict[str, Any] = {
    "id": "relay", "states": ["x"], "params": {"k": "2"}, "h": ["x"], "fields": {"+": ["-k"], "-": ["k"]},
    "x0": ["1"], "t_span": ["0", "1"], "expected": [],
}  # fmt: skip
# x'' = -sgn x from 1: parabolas, zeros of x at sqrt 2 (1 + 2 n), period 4 sqrt 2.
PARABOLAS = {
    **RELAY, "states": ["x", "v"], "fields": {"+": ["v", "-1"], "-": ["v", "1"]}, "x0": ["1", "0"],
    "t_span": ["0", "30"],
}  # fmt: skip
# A cycle of radius^2 (1 + sqrt(1 + 4 mu))/2, and an unstable one inside it, meet at mu = -1/4.
RADIAL = "(mu+(x^2+y^2)-(x^2+y^2)^2)"
CYCLES = {
    **RELAY, "states": ["x", "y"], "params": {"mu": "-1/10"}, "h": [{"h": "y", "kind": "observer"}],
    "fields": {"*": [f"-y+x*{RADIAL}", f"x+y*{RADIAL}"]}, "x0": ["0.94", "0.01"], "t_span": ["0", "20"],
}  # fmt: skip
SADDLES = {**RELAY, "params": {"mu": "-1"}, "h": ["x-5"], "fields": {"*": ["mu+x^2"]}, "x0": ["-1"]}


def row_of(case: dict[str, Any], measure: dict[str, Any], **compare: Any) -> Any:
    entry = {"name": "it", "measure": measure, **({"value": 0} if not compare else {}), **compare}
    SCHEMA.validate({"cases": [{**case, "expected": [entry]}]})
    (row,) = run_bank([{**case, "expected": [entry]}])
    return row


X_AT = {"quantity": "state", "component": "x", "t": "1/4"}


@pytest.mark.parametrize(
    ("case", "measure", "compare"),
    [
        (RELAY, X_AT, {"value": "1/k", "atol": 1e-9}),
        (RELAY, X_AT, {"value": 0.5, "rtol": 1e-9}),
        (RELAY, X_AT, {"sign": "+"}),
        (RELAY, {"quantity": "state", "component": "x"}, {"sign": "0", "atol": 1e-9}),
        (RELAY, X_AT, {"least": 0.4, "most": "1/k", "atol": 1e-9}),
        (RELAY, {"quantity": "mode"}, {"text": "0"}),
        (RELAY, {"quantity": "segments"}, {"text": ["+", "0"]}),
        (RELAY, {"quantity": "end"}, {"text": "success"}),
        (RELAY, {"quantity": "events", "take": "kind"}, {"text": ["slide"]}),
        (RELAY, {"quantity": "event", "take": "surface"}, {"value": 0}),
        (RELAY, {"quantity": "formula", "formula": "a-k*b", "where": {
            "a": {"quantity": "state", "t": {"quantity": "event"}}, "b": {"quantity": "event"},
        }}, {"value": [-1], "atol": 1e-9}),
        (PARABOLAS, {"quantity": "events", "first": 3},
         {"value": "sqrt(2)*(1+2*n)", "n": [0, 2], "atol": 1e-7}),
        (PARABOLAS, {"quantity": "events"}, {"value": "sqrt(2)*(1+2*n)", "n": [0, None], "atol": 1e-6}),
        (PARABOLAS, {"quantity": "events", "take": "v", "first": 2, "direction": "-"},
         {"value": "-sqrt(2)", "each": True, "atol": 1e-7}),
        (PARABOLAS, {"quantity": "events", "first": 2, "take": "v"},
         {"value": ["sqrt(2)", "-sqrt(2)"], "order": "any", "atol": 1e-7}),
        (PARABOLAS, {"quantity": "orbit", "take": "period"}, {"value": "4*sqrt(2)", "atol": 1e-7}),
        (PARABOLAS, {"quantity": "along", "formula": "v^2/2+Abs(x)", "take": "spread"},
         {"value": 0, "atol": 1e-7}),
        (PARABOLAS, {"quantity": "along", "formula": "x", "take": "max", "over": ["3", "8"]},
         {"value": 1, "atol": 1e-7}),
        (CYCLES, {"quantity": "fold", "parameter": "mu", "between": [-0.3, -0.05]},
         {"value": "-1/4", "atol": 1e-8}),
        (SADDLES, {"quantity": "fold", "parameter": "mu", "between": [-2, 1], "mode": "-"},
         {"value": 0, "atol": 1e-8}),
        ({**RELAY, "params": {"a": "1/5"}, "h": ["x-1/4"], "fields": {"*": ["a*cos(t)"]}, "x0": ["0"],
          "t_span": ["0", "20"]},
         {"quantity": "threshold", "parameter": "a", "between": [0.2, 0.4], "width": 1e-6},
         {"value": 0.25, "atol": 1e-6}),
    ],
)  # fmt: skip
def test_13_5_quantities_and_comparisons(case: Any, measure: Any, compare: Any) -> None:
    row = row_of(case, measure, **compare)
    assert row.passed, row.message
    assert row.evaluated == ("it",)
    wrong = {"value": "0.0123+1.01*(7/3)", "text": "-", "sign": "-", "least": 3}
    (key,) = set(compare) & set(wrong)
    other = {k: v for k, v in compare.items() if k not in ("most", "n", "each", "order")} | {key: wrong[key]}
    assert not row_of(case, measure, **other).passed


def test_13_5_options_are_the_solvers_defaults_unless_the_case_says_otherwise() -> None:
    def options(**case: Any) -> Any:
        entry = {"name": "it", "measure": X_AT, "value": "1/2", "atol": 1e-9}
        (one,) = read_bank([{**RELAY, **case, "expected": [entry]}])
        subject = Subjects(one, Settings())()
        assert isinstance(subject, CaseRuns)
        return subject.main.options

    found, default = options(), Options()
    assert (found.rtol, found.method, found.max_step) == (default.rtol, default.method, default.max_step)
    other = options(options={"rtol": 1e-6, "method": "DP5", "max_step": "1/k"})
    assert (other.rtol, other.method, other.max_step) == (1e-6, "DP5", 0.5)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"measure": {"quantity": "evnt"}}, "did you mean 'event'"),
        ({"measure": {"quantity": "event", "kindd": "slide"}}, "did you mean 'kind'"),
        ({"measure": {"quantity": "event", "kind": "slid"}}, "did you mean 'slide'"),
        ({"measure": {"quantity": "event", "number": "1"}}, "expected a whole number"),
        ({"measure": {"quantity": "event"}, "tol": 1}, "unknown key"),
        ({"measure": {"quantity": "event"}, "text": "0"}, "2 things to compare with"),
        ({"measure": {"quantity": "event"}, "value": None}, "0 things to compare with"),
        ({"measure": {"quantity": "roots"}}, "a quantity of a polynomial"),
        ({"measure": {"quantity": "state", "component": "y"}}, "unknown state 'y'"),
        ({"measure": {"quantity": "event", "surface": "g"}}, "unknown surface 'g'"),
        ({"measure": {"quantity": "event", "number": 0}}, "number is 0"),
        ({"measure": {"quantity": "formula", "formula": "x"}}, "has no value here"),
        ({"measure": {"quantity": "event"}, "part": "F2"}, "part"),
        ({"measure": {"quantity": "events"}, "value": [[1, 2], 3]}, "the lists are of different lengths"),
    ],
)
def test_13_5_what_is_wrong_is_refused_by_name(change: dict[str, Any], said: str) -> None:
    entry = {"name": "it", "value": 1, "atol": 1, **change}
    (row,) = run_bank([{**RELAY, "expected": [entry]}])
    assert not row.passed
    assert said in row.message
    (row,) = run_bank([{**RELAY, "n_events": 1, "expected": [{"name": "it", "measure": X_AT, "value": 1}]}])
    assert "unknown key of the case: 'n_events'" in row.message


LOOSE = {
    "states": ["x, v", "x v"], "h": ["v", {"h": "v"}], "t_span": [3], "x0": [{"v": 0, "x": "1"}],
    "time_events": [{"period": 1, "reset": {"v": "-v"}}], "event_functions": ["x"],
}
STRICT = {
    "states": ["x", "v"], "h": ["v"], "fields": {"+": ["v", "-x-1"], "-": ["v", "-x+1"]}, "x0": ["1", 0],
    "t_span": [0, 3], "time_events": [{"period": 1, "reset": {"v": "-v"}}], "event_functions": ["x"],
}


@pytest.mark.parametrize(("key", "value"), [(key, value) for key, row in LOOSE.items() for value in row])
def test_13_5_loose_notation_is_the_same_system(key: str, value: Any) -> None:
    strict, loose = build(STRICT), build({**STRICT, key: value})
    assert (loose.x0, loose.t_span, loose.declared) == (strict.x0, strict.t_span, strict.declared)
    assert loose.fields == strict.fields
    assert [(s.h, s.kind) for s in loose.system.surfaces] == [(s.h, s.kind) for s in strict.system.surfaces]


def test_13_5_one_field_holds_on_every_side() -> None:
    rows = [build({**STRICT, "fields": fields}).fields for fields in (["v", "-x"], {"*": ["v", "-x"]})]
    assert rows[0] == rows[1]
    assert set(rows[0]) == {"+", "-"}


@pytest.mark.parametrize(
    ("key", "value", "where"),
    [
        ("h", [True], "h[0]"), ("h", [{"h": "v", "width": []}], "h[0].width"), ("states", 5, "states"),
        ("fields", {"+": ["v", None]}, "fields.+[1]"), ("x0", ["1", {}], "x0[1]"),
        ("t_span", [0, [3]], "t_span[1]"),
        ("time_events", [{"period": 1, "times": "1 2"}], "time_events[0].times"), ("options", [], "options"),
        ("event_functions", [["x"]], "event_functions[0]"), ("params", ["k"], "params"),
    ],
)  # fmt: skip
def test_13_5_a_wrong_part_of_the_system_is_refused_with_its_place(key: str, value: Any, where: str) -> None:
    for name in ({"name": "x_end", "value": 1, "tol": 1}, {"name": "it", "measure": X_AT, "value": 1}):
        (row,) = run_bank([{"id": "wrong", **STRICT, key: value, "expected": [name]}])
        assert row.status == "error"
        assert f"the case.{where} is" in row.message


def test_13_5_automaton_resets_and_static_friction_are_fields() -> None:
    heat = {
        "id": "heat", "states": ["T"], "params": {"up": "2"}, "x0": [0], "t_span": [0, 9], "automaton": [
            {"name": "heat", "field": ["1"], "until": {"T": "up"}},
            {"name": "cool", "field": [-2], "until": {"T": -1}},
        ],
    }  # fmt: skip
    row = row_of(heat, {"quantity": "events"}, value=[2, 3.5, 6.5, 8], atol=1e-7)
    assert row.passed, row.message
    both = {**heat, "h": ["T"], "fields": {"*": ["1"]}}
    for wrong, said in ((both, "not both"), ({**heat, "automaton": heat["automaton"][:1]}, "2")):
        entry = {"name": "a", "measure": {"quantity": "end"}, "text": "success"}
        (row,) = run_bank([{**wrong, "expected": [entry]}])
        assert said in row.message


@pytest.mark.parametrize("name", OLD)
def test_13_5_a_migrated_case_is_valid_and_passes(name: str) -> None:
    bank, said = migrate_bank([OLD[name]])
    text = json.dumps(bank)
    SCHEMA.validate(json.loads(text))
    (row,) = run_bank(json.loads(text))
    assert row.passed, row.message
    assert row.not_evaluated == ()
    lost = [line for line in said if "not carried over" in line]
    names = {entry["name"] for entry in OLD[name]["expected"]}
    assert len({one.partition(" #")[0] for one in row.evaluated} & names) + len(lost) == len(names)


def test_13_5_the_vocabulary_is_closed_and_described() -> None:
    used = set(re.findall(r'"quantity": "(\w+)"', Path(__file__).read_text(encoding="utf-8")))
    for case in read_bank(list(OLD.values())):
        text = json.dumps(written(Subjects(case, Settings()).expectations()))
        used |= set(re.findall(r'"quantity": "(\w+)"', text))
    assert set(QUANTITIES) <= used
    assert {kind.__module__ for kind in QUANTITIES.values()} - {group.__name__ for group in GROUPS} == {
        "filippov.app.bank.quantities.quantity"
    }
    for kind in QUANTITIES.values():
        assert kind.__doc__
        assert not kind.__doc__.startswith(f"{kind.__name__}(")
        assert dataclasses.is_dataclass(kind)
    Draft202012Validator.check_schema(schema())


@pytest.mark.parametrize("broken", [{"cases": [{"id": 3, "expected": []}]}, {"cases": [{"id": "a"}]}, {}])
def test_13_5_the_schema_refuses(broken: Any) -> None:
    assert not SCHEMA.is_valid(broken)


def test_13_5_the_command_migrates_and_prints_the_schema(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bank", "schema"]) == 0
    assert json.loads(capsys.readouterr().out) == schema()
    old, new = tmp_path / "old.json", tmp_path / "new.json"
    enter, prose = {"name": "t_enter", "value": "1/2", "tol": "1e-9"}, {"name": "remark", "value": "it stops"}
    old.write_text(json.dumps([{**RELAY, "expected": [enter, prose]}]))
    assert main(["bank", "migrate", str(old), "--json", str(new)]) == 0
    assert "relay: remark: not carried over" in capsys.readouterr().err
    (case,) = json.loads(new.read_text(encoding="utf-8"))["cases"]
    measure = {"quantity": "event", "kind": "slide"}
    assert case["expected"] == [{"name": "t_enter", "measure": measure, "value": "1/2", "atol": 1e-9}]
    assert case["about"]["not_carried_over"] == [prose]
    assert main(["bank", "run", str(new)]) == 0
    assert "earlier form" not in capsys.readouterr().err
    assert main(["bank", "run", str(old)]) == 0
    assert "1 of 1 cases are of the earlier form" in capsys.readouterr().err
