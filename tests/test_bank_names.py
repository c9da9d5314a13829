"""Names of expectations against closed forms: the cases of more_cases.json, and those with wrong values."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import Any

import pytest

from filippov.app.bank import run_bank

CASES = json.loads((Path(__file__).parent / "data" / "more_cases.json").read_text(encoding="utf-8"))["cases"]
NAMES = [case["id"] for case in CASES]
RELAY: dict[str, Any] = {
    "id": "relay", "states": ["x"], "params": {"k": "2"}, "h": ["x"], "fields": {"+": ["-k"], "-": ["k"]},
    "x0": ["1"], "t_span": ["0", "1"], "expected": [{"name": "t_enter", "value": "1/2", "tol": "1e-12"}],
}  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=NAMES)
def test_closed_forms(case: dict[str, Any]) -> None:
    (row,) = run_bank([case])
    assert row.passed, row.message
    assert row.not_evaluated == ()
    assert len(row.evaluated) == len(case["expected"])


def wrong(value: Any) -> Any:
    """A value that is off by more than any tolerance; None where the text is no number."""
    if isinstance(value, list):
        rows = [wrong(item) for item in value]
        return None if None in rows else rows
    if value in ("true", "false"):
        return "false" if value == "true" else "true"
    plain = not any(c in value for c in "=<,: ")
    return f"1.0123*({value})+0.0123" if plain else None


@pytest.mark.parametrize("case", CASES, ids=NAMES)
def test_wrong_values_fail(case: dict[str, Any]) -> None:
    changed = [
        {**e, "value": "-" * len(e["value"]) if "mode" in e["name"] else wrong(e["value"])}
        for e in case["expected"]
    ]
    changed = [e for e in changed if e["value"] is not None]
    (row,) = run_bank([{**case, "expected": changed}])
    failed = [piece.split(":")[0] for piece in row.message.split("; ")]
    assert not {e["name"] for e in changed} - set(failed)


BAD: list[Any] = [
    None, True, 7, -1.5, "", "x +", "t(", [], {}, [[]], [None], [{}], {"a": None}, {"+": None}, {"": [""]},
    "1e999", ["nan"], {"name": ["x"]}, [["0", "1"]], "\u0000", {"x": {"y": 1}},
]  # fmt: skip
KEYS = (
    *RELAY, "event_functions", "smooth_field", "hybrid", "time_events", "parts", "polynomial", "n_events",
    "more",
)  # fmt: skip


@pytest.mark.parametrize("key", KEYS)
def test_a_key_of_any_kind_is_a_row(key: str) -> None:
    rows = run_bank([{**RELAY, key: bad} for bad in BAD], max_time=20.0)
    assert len(rows) == len(BAD)
    assert all(not row.passed or row.evaluated for row in rows)


@pytest.mark.parametrize("missing", [*RELAY, "id states", "fields h", "x0 t_span expected"])
def test_a_missing_key_is_a_row(missing: str) -> None:
    (row,) = run_bank([{key: value for key, value in RELAY.items() if key not in missing.split()}])
    assert row.passed == (missing in ("id", "h", "params") and row.evaluated != ())


@pytest.mark.parametrize("field", ["name", "value", "tol", "t"])
def test_an_expectation_of_any_kind_is_a_row(field: str) -> None:
    for name, bad in itertools.product(("t_enter", "final_state", "events", "x(1)", "period"), BAD):
        entry = {"name": name, "value": "1/2", "tol": "1e-9", field: bad}
        (row,) = run_bank([{**RELAY, "expected": [entry]}])
        assert len(row.evaluated) + len(row.not_evaluated) == 1
        assert not row.passed or row.evaluated


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ({"period": "0"}, "period"), ({"period": "1", "reset": {"z": "1"}}, "unknown state"),
        ({"times": "1"}, "times"), ({"perod": "1"}, "did you mean 'period'"),
        ({"period": "1", "reset": 3}, "reset"),
    ],
)  # fmt: skip
def test_time_events_are_checked(entry: dict[str, Any], said: str) -> None:
    (row,) = run_bank([{**RELAY, "time_events": [entry]}])
    assert row.status == "error"
    assert said in row.message


def test_time_events_of_a_list_of_times() -> None:
    clock = {"name": "kick", "times": ["1/4", "k/4"], "reset": {"x": "x+3"}}
    expected = [
        {"name": "events", "tol": "1e-12", "value": [
            {"t": "1/4", "type": "time", "surface": "kick", "state": ["1/2"]}, {"t": "1/2", "type": "time"},
        ]},
        {"name": "x(1)", "value": "5", "tol": "1e-12"},
    ]  # fmt: skip
    (row,) = run_bank([{**RELAY, "time_events": clock, "expected": expected}])
    assert row.passed, row.message
