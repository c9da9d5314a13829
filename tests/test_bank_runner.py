"""The runner of banks: what it reads, what it refuses, what it keeps when something goes wrong."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bank import FILE

from filippov import UsageError
from filippov.app.bank import Row, read_bank, rows_json, rows_text, run_bank
from filippov.app.bank.compare import OUTCOMES, compare_bank, read_solvers, solvers_json, solvers_text
from filippov.app.bank.notation import formula, strict
from filippov.app.bank.reference.process import SolverProcess
from filippov.app.bank.reference.solver import Limits, whole_and_parts
from filippov.app.cli.main import main
from filippov.base.errors import ModelError
from filippov.model.expression import parse_condition, parse_expression
from filippov.model.symbols import states

RELAY: dict[str, Any] = {
    "id": "relay", "states": ["x"], "params": {"k": "2"}, "h": ["x"], "fields": {"+": ["-k"], "-": ["k"]},
    "x0": ["1"], "t_span": ["0", "1"],
    "expected": [
        {"name": "t_enter", "value": "1/2", "tol": "1e-12"},
        {"name": "final_state", "t": "1", "value": ["0"], "sliding_on": [0], "tol": "1e-12"},
        {"name": "a text of people", "value": "it stops", "tol": "0"},
    ],
}  # fmt: skip
KEYS = ["id", "passed", "max_error", "tolerance", "evaluated", "not_evaluated", "status", "seconds"]


def run_one(**changes: Any) -> Row:
    return run_bank([{**RELAY, **changes}])[0]


def expecting(name: str, value: Any, tol: str = "1e-9", **changes: Any) -> Row:
    return run_one(expected=[{"name": name, "value": value, "tol": tol}], **changes)


def test_row_as_json() -> None:
    (data,) = json.loads(rows_json([run_one()]))
    assert list(data)[: len(KEYS)] == KEYS
    assert data["id"] == "relay"
    assert data["passed"] is True
    assert 0 <= data["max_error"] <= data["tolerance"] == 1e-12
    assert data["evaluated"] == ["t_enter", "final_state"]
    assert data["not_evaluated"] == ["a text of people"]
    assert data["status"] == "success"
    assert data["seconds"] >= 0
    assert data["field_calls"] > 0


def test_wrong_value_fails_with_its_error() -> None:
    row = expecting("t_enter", "0.6", "1e-3")
    assert not row.passed
    assert row.max_error == pytest.approx(0.1, abs=1e-12)
    assert row.tolerance == 1e-3
    assert "t_enter" in row.message


def test_what_is_not_evaluated_is_not_passed() -> None:
    row = expecting("solutions", "it stops")
    assert not row.passed
    assert row.evaluated == ()
    assert row.not_evaluated == ("solutions",)


@pytest.mark.parametrize(
    "changes",
    [
        {"h": ["__import__('os').system('touch /tmp/hacked')"]},
        {"fields": {"+": ["().__class__.__bases__"], "-": ["1"]}},
        {"x0": ["__import__('os').getpid()"]},
        {"t_span": ["0", "open('/etc/passwd')"]},
        {"params": {"k": "lambda: 1"}},
        {"params": {"k); import os; (": "1"}},
        {"states": ["x; import os"]},
    ],
)
def test_nothing_in_a_file_is_run_as_code(changes: dict[str, Any]) -> None:
    row = run_one(**changes)
    assert row.status == "error"
    assert "ModelError" in row.message


def test_values_are_not_run_as_code() -> None:
    row = expecting("t_enter", "__import__('os').getpid()")
    assert not row.passed
    assert row.not_evaluated == ("t_enter",)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"fields": None}, "no fields"),
        ({"fields": None, "feilds": {}, "vector_fields": {"+": ["1"]}}, "did you mean"),
        ({"fields": {"+": ["1", "2"], "-": ["1"]}}, "expected 1 formulas"),
        ({"fields": {"++": ["1"]}}, "sign vector '++'"),
        ({"x0": None}, "x0"),
        ({"x0": ["1", "2"]}, "x0"),
        ({"x0": ["x"]}, "real number"),
        ({"t_span": ["0"]}, "t_span"),
        ({"t_span": None}, "t_span"),
        ({"states": []}, "states"),
        ({"states": ["x", "x"]}, "x"),
        ({"h": [{"h": "x", "radious": "2"}]}, "did you mean 'radius'"),
        ({"h": ["y"]}, "unknown name 'y'"),
        ({"h": ["frobnicate(x)"]}, "unknown function"),
        ({"expected": "all"}, "expected"),
        ({"h": ["x/0"]}, "zero"),
        ({"params": {"k": "9**9**9"}}, "exponent"),
    ],
)
def test_malformed_case_is_a_row_that_says_why(changes: dict[str, Any], said: str) -> None:
    row = run_one(**changes)
    assert not row.passed
    assert row.status == "error"
    assert said in row.message


def test_one_broken_case_does_not_stop_the_rest() -> None:
    rows = run_bank([RELAY, 7, {"id": "empty"}, {**RELAY, "fields": {"+": ["1/x"], "-": ["1"]}}, RELAY])
    assert [row.passed for row in rows] == [True, False, False, False, True]
    assert rows[2].status == "error"
    assert "1 of 5" not in rows_text(rows)
    assert "2 of 5 cases passed" in rows_text(rows)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "not JSON"),
        ('{"a": 1}', "list of cases"),
        ('"text"', "list of cases"),
        ("[" * 100_000, "not JSON"),
    ],
)
def test_file_that_is_no_bank(content: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "bank.json"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(UsageError, match=said):
        read_bank(path)


def test_options_are_checked() -> None:
    with pytest.raises(UsageError, match="unknown case 'rely'; did you mean 'relay'"):
        run_bank([RELAY], only=["rely"])
    with pytest.raises(UsageError, match="rtol"):
        run_bank([RELAY], rtol=-1.0)
    with pytest.raises(UsageError, match="jobs"):
        run_bank([RELAY], jobs=0)


def test_time_limit_is_a_row() -> None:
    fast = {"fields": {"+": ["-1e7*sin(1e6*t)-1e-3"], "-": ["1e7*cos(1e6*t)"]}, "h": ["x-1e9"]}
    started = time.monotonic()
    row = run_bank([{**RELAY, **fast, "t_span": ["0", "1e9"]}], max_time=0.5)[0]
    assert row.status == "timeout"
    assert not row.passed
    assert time.monotonic() - started < 60


def test_two_processes_give_the_same_rows() -> None:
    cases = [{**RELAY, "id": f"relay {k}", "params": {"k": str(k)}} for k in (1, 2, 3)]
    one, two = run_bank(cases), run_bank(cases, jobs=2)
    assert [(r.id, r.passed, r.max_error) for r in one] == [(r.id, r.passed, r.max_error) for r in two]


def test_exit_codes_and_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bank, out = tmp_path / "bank.json", tmp_path / "rows.json"
    wrong = {**RELAY, "id": "wrong", "expected": [{"name": "t_enter", "value": "3", "tol": "1e-6"}]}
    bank.write_text(json.dumps({"cases": [RELAY, wrong]}), encoding="utf-8")
    assert main(["bank", "run", str(bank), "--json", str(out), "--quiet"]) == 3
    assert [row["passed"] for row in json.loads(out.read_text(encoding="utf-8"))] == [True, False]
    assert capsys.readouterr().err == "filippov: 1 of 2 cases did not pass: wrong\n"
    assert main(["bank", "run", str(bank), "--only", "relay", "--json"]) == 0
    captured = capsys.readouterr()
    assert [row["id"] for row in json.loads(captured.out)] == ["relay"]
    assert "1 of 1 cases passed" in captured.err
    assert main(["bank", "run", str(bank), "--only", "nobody"]) == 2
    assert main(["bank", "run", str(tmp_path / "none.json")]) == 2
    assert main(["bank", "run"]) == 2
    assert main(["bank", "walk", str(bank)]) == 2


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_interrupt_keeps_the_rows(tmp_path: Path) -> None:
    slow = {
        **RELAY,
        "id": "slow",
        "h": ["x-1e9"],
        "fields": {"+": ["1"], "-": ["1e7*cos(1e6*t)"]},
        "t_span": ["0", "1e9"],
    }
    bank, out = tmp_path / "bank.json", tmp_path / "rows.json"
    bank.write_text(json.dumps([RELAY, slow]), encoding="utf-8")
    root = str(Path(__file__).resolve().parent.parent)
    words = ["-m", "filippov", "bank", "run", str(bank), "--json", str(out)]
    environment = {**os.environ, "PYTHONPATH": root}
    with subprocess.Popen(
        [sys.executable, *words], cwd=root, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        assert process.stderr is not None
        for line in process.stderr:
            if line.startswith("relay"):
                break
        process.send_signal(signal.SIGINT)
        process.stderr.read()
        assert process.wait(60) == 130
    assert [row["id"] for row in json.loads(out.read_text(encoding="utf-8"))] == ["relay"]


# -- notation ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2 t", "2*t"), ("x^2/2", "x**2/2"), ("1.5(t-x)", "1.5*(t-x)"), ("ln x1", "log(x1)"),
        ("sin(2t)", "sin(2*t)"), ("e1 l1 x - m ln x", "e1*l1*x - m*log(x)"), ("(1+x)(1-x)", "(1+x)*(1-x)"),
        ("3^{-2}", "3**(-2)"),
        ("1e-3 x", "1e-3*x"), ("x (1+t)", "x*(1+t)"), ("-0.9 v", "-0.9*v"),
    ],
)  # fmt: skip
def test_loose_notation(text: str, value: str) -> None:
    names = {symbol.name: symbol for symbol in states("x x1 v e1 l1 m")}
    assert formula(text, names) == parse_expression(value, names)


def test_notation_is_no_way_around_the_reader() -> None:
    for text in ("__import__('os')", "x.__class__", "[1]", "x if x else 1", "lambda: 1"):
        with pytest.raises(ModelError):
            formula(text, {"x": states("x")[0]})
    assert strict("a b", ["a", "b"]) == "a*b"


def test_conditions() -> None:
    (k,) = states("K")
    between = parse_condition("0<K<1386", {"K": k})
    found = [bool(between.subs(k, value)) for value in (-1, 0, 1, 1385, 1386)]
    assert found == [False, False, True, True, False]
    assert bool(parse_condition("not 1 > 2 and (1 < 2 or 2 < 1)"))
    for text in ("K", "K == 1", "__import__('os') < 1", "K in 3", "K <"):
        with pytest.raises(ModelError):
            parse_condition(text, {"K": k})


# -- what names mean -----------------------------------------------------------------------------------

BALL_FREE = {"states": ["x", "v"], "params": {}, "h": ["x"], "x0": ["0", "0"], "t_span": ["0", "10"]}
OSCILLATOR = {
    **BALL_FREE, "h": ["v"], "fields": {"+": ["v", "-x-1/5"], "-": ["v", "-x+1/5"]}, "x0": ["2", "0"],
    "t_span": ["0", "15"],
}  # fmt: skip
# x(t) = 0.2 + 1.8 cos t, then -0.2 + 1.4 cos t, ...: turns 2, -1.6, 1.2, -0.8, 0.4, 0 at multiples of pi.


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("turning_points", ["2", "-1.6", "1.2", "-0.8", "0.4"]), ("turning_times", "n*pi, n=0..4"),
        ("first_turn_x", "-1.6"), ("first_turn_t", "pi"), ("x(pi/2)", "0.2"), ("x_at_pi", "-1.6"),
        ("state_at_pi", ["-1.6", "0"]), ("x_at_[pi/2,pi]", ["0.2", "-1.6"]), ("v_at_t=pi/2", "-1.8"),
        ("min_x", "-1.6"), ("max_v", "1.4"), ("max_abs_v", "1.8"), ("t_cross", "pi"),
        ("t_second_cross", "2*pi"), ("t_cross_2", "2*pi"), ("event_times", "n*pi, n=1..4"),
        ("switch_2", "2*pi"), ("t_x=0.2", "pi/2"),
        ("t_stop", "5*pi"), ("point_first_crossing", ["-1.6", "0"]), ("x_cross", "-1.6"),
    ],
)  # fmt: skip
def test_names_of_quantities(name: str, value: Any) -> None:
    row = expecting(name, value, **{**OSCILLATOR, "t_span": ["0", "16"]})
    assert row.evaluated == (name,), row.reasons
    if name == "t_stop":  # at 5 pi the block turns at x = 0 exactly, where it stays
        assert row.max_error == pytest.approx(0, abs=1e-8)
    assert row.passed, row.message


def test_symmetry_free_cycle_of_a_relay_with_hysteresis() -> None:
    relay = {
        "states": ["x"], "params": {"a": "1"}, "h": [{"h": "x", "width": "1/2"}],
        "fields": {"+": ["-a"], "-": ["a"]}, "x0": ["0"], "t_span": ["0", "10"],
    }  # fmt: skip
    row = run_one(
        **relay,
        expected=[
            {"name": "period", "value": "2", "tol": "1e-9"},
            {"name": "amplitude", "value": "0.5", "tol": "1e-9"},
            {"name": "crossings_per_period", "value": "2", "tol": "0"},
            {"name": "a", "value": "1", "tol": "0"},
        ],
    )
    assert row.passed, row.message
    assert len(row.evaluated) == 4


def test_automaton_text() -> None:
    text = {
        "states": ["T"], "params": {}, "h": None, "fields": None, "x0": ["0"], "t_span": ["0", "9"],
        "hybrid": "heat: T'=1 until 2; cool: T'=-2 until -1",
    }  # fmt: skip
    row = run_one(
        **text, expected=[{"name": "switch_times", "value": ["2", "3.5", "6.5", "8"], "tol": "1e-9"}]
    )
    assert row.passed, row.message


def test_parts_are_cases_of_their_own() -> None:
    whole = {
        "params": {"k": "2"}, "more": "F3: x'=t, x(0)=0",
        "parts": {"F2": {"states": ["y"], "smooth_field": ["k*y"], "x0": ["1"], "t_span": ["0", "1"]}},
    }  # fmt: skip
    names = {"F1_x_at_1": "0", "F2_y(1)": "exp(2)", "F3_x(1)": "1/2"}
    row = run_one(**whole, expected=[{"name": k, "value": v, "tol": "1e-9"} for k, v in names.items()])
    assert row.passed, row.message
    assert row.evaluated == ("F1_x_at_1", "F2_y(1)")
    assert row.not_evaluated == ("F3_x(1)",)


@pytest.mark.parametrize(("value", "passed"), [("0.25", True), ("0.2500001", False)])
def test_grazing_value_of_a_parameter(value: str, passed: bool) -> None:
    forced = {
        "states": ["x"], "params": {"a": "0.2"}, "h": ["x-1/4"], "x0": ["0"], "t_span": ["0", "20"],
        "fields": {"+": ["a*cos(t)"], "-": ["a*cos(t)"]},
    }  # fmt: skip
    row = expecting("a_grazing", value, "1e-8", **forced)
    assert row.passed is passed
    assert row.evaluated == ("a_grazing",)


def test_peers_are_compared_naively() -> None:
    table = compare_bank([RELAY], solvers=["scipy"], max_calls=3_000)
    outcome = {row.solver: row for row in table.rows}
    assert outcome["filippov"].outcome == "right"
    assert outcome["filippov"].reported
    solvers = {"filippov", "filippov Radau", "scipy RK45", "scipy LSODA", "scipy Radau"}
    assert set(outcome) == solvers
    assert all(row.outcome in OUTCOMES for row in table.rows)
    smooth = {**RELAY, "h": ["x-5"]}
    smooth["expected"] = [{"name": "x_at_1", "value": "3", "tol": "1e-9"}]
    right = compare_bank([smooth], solvers=["scipy"])
    assert [row.outcome for row in right.rows] == ["right"] * 5
    assert json.loads(solvers_json(table))["rows"][0]["outcome"] == "right"
    assert "scipy RK45" in solvers_text(table)
    with pytest.raises(UsageError, match="did you mean 'scipy'"):
        compare_bank([RELAY], solvers=["scipi"])


def test_committed_table_of_solvers(tmp_path: Path) -> None:
    path = Path(__file__).resolve().parent.parent / "docs" / "_static" / "solvers.json"
    table = read_solvers(path)
    earlier = tmp_path / "peers.json"
    earlier.write_text(path.read_text(encoding="utf-8").replace('"solver":', '"peer":'), encoding="utf-8")
    assert read_solvers(earlier) == table
    motions = [case for case in read_bank(FILE) if case.raw.get("polynomial") is None]
    assert set(table.cases) == {part.id for case in motions for part in whole_and_parts(case)}
    # Stiff bristles are for the implicit method, within the field calls that every solver is allowed.
    left = [row.id for row in table.rows if row.solver == "filippov" and row.outcome != "right"]
    assert left == ["P03_lugre_stick_slip"]
    stiff = [row for row in table.rows if row.solver == "filippov Radau" and row.id in left]
    assert [row.outcome for row in stiff] == ["right"]


def test_peers_say_what_cannot_be_stated_and_who_is_silent() -> None:
    several = {**RELAY, "states": ["x"], "h": ["x"], "fields": {"+": ["1"], "-": ["-1"]}, "x0": ["0"]}
    several["expected"] = [{"name": "must_report", "value": "non-unique"}]
    ball = {**several, "h": [{"h": "x", "reset": {"x": "1"}}], "fields": {"*": ["-1"]}, "x0": ["1"]}
    ball["expected"] = [{"name": "x_at_1/2", "value": "1/2", "tol": "1e-9"}]
    table = compare_bank([{**several, "id": "several"}, {**ball, "id": "ball"}], solvers=["scipy"])
    found = {(row.id, row.solver): row.outcome for row in table.rows}
    assert found["several", "filippov"] == found["ball", "filippov"] == "right"
    assert found["several", "scipy RK45"] == "silent"
    assert found["ball", "scipy RK45"] == "cannot"
    assert "cannot be stated: ball: a reset" in solvers_text(table)


def test_a_solver_that_hangs_or_dies_is_an_outcome(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    case, limits = read_bank([{**RELAY, "expected": []}])[0], Limits(1e-8, 1e-10, 1000, 0.2)
    outcomes, python = [], sys.executable
    monkeypatch.setattr("filippov.app.bank.reference.process.GRACE", 0.0)
    for does in ("import time; print('ready', flush=True); time.sleep(600)",
                 "print('ready', flush=True); input(); import os; os._exit(7)"):  # fmt: skip
        program = tmp_path / "solver"
        program.write_text(f"#!{python}\n{does}\n")
        program.chmod(0o755)
        monkeypatch.setattr("sys.executable", str(program))
        process = SolverProcess("any")
        outcomes.append(process.run(case, limits, 1e-6))
        process.close()
    assert [row.outcome for row in outcomes] == ["hang", "error"]
    assert "exit code 7" in outcomes[1].message


def test_nothing_known_is_lost() -> None:
    """Each expectation of the bank is either evaluated or listed."""
    for case, row in zip(read_bank(FILE)[:3], run_bank(FILE, only=["S01", "S02", "S03"]), strict=True):
        names = {entry.name for entry in case.expected}
        assert names <= {*row.evaluated, *row.not_evaluated}
        assert not np.isnan(row.max_error or 0.0)


def test_a_hybrid_text_beside_fields_is_named() -> None:
    """The ball fell through the floor, as the reset in the text was left out without a word."""
    ball = {
        "id": "ball", "states": ["x", "v"], "h": ["x"], "fields": {"+": ["v", "-10"], "-": ["v", "-10"]},
        "x0": ["5", "0"], "t_span": ["0", "2"], "hybrid": "at x=0 with v<0: v -> -0.5*v",
        "expected": [{"name": "impact_times", "value": ["1", "2"], "tol": "1e-9"}],
    }  # fmt: skip
    (row,) = run_bank([ball])
    assert not row.passed
    assert "`hybrid` text" in row.message
    assert run_bank([{key: value for key, value in ball.items() if key != "hybrid"}])[0].status == "success"
