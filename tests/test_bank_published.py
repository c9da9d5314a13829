"""Published runs with LuGre friction and chattering relays pass; their values are those of other methods."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
from typing import Any

import published_oracle as oracle
import pytest
from sign_vector_oracle import follow

from filippov.app.bank import run_bank
from filippov.app.bank.notation import number

FILE = Path(__file__).parent / "data" / "published_cases.json"
CASES = {case["id"]: case for case in json.loads(FILE.read_text(encoding="utf-8"))["cases"]}


def values(name: str) -> list[float]:
    """All expected numbers of a case, in order."""
    stored = [entry["value"] for entry in CASES[name]["expected"]]
    return [float(q) for value in stored for q in (value if isinstance(value, list) else [value])]


@pytest.mark.parametrize("name", CASES)
def test_15_published_runs_pass(name: str) -> None:
    (row,) = run_bank([CASES[name]])
    assert row.passed, row.message
    assert len(row.evaluated) == len(CASES[name]["expected"])


@pytest.mark.parametrize("name", CASES)
def test_15_wrong_values_of_them_fail(name: str) -> None:
    def wrong(value: Any) -> Any:
        return [wrong(q) for q in value] if isinstance(value, list) else f"1.002*({value})"

    changed = [{**entry, "value": wrong(entry["value"])} for entry in CASES[name]["expected"]]
    (row,) = run_bank([{**CASES[name], "expected": changed}])
    failed = {piece.split(":")[0] for piece in row.message.split("; ")}
    assert failed >= {entry["name"] for entry in changed}


def test_15_stored_values_are_those_of_other_methods() -> None:
    positions = [float(f"{x:.10e}") for x in oracle.presliding()]
    assert values("L01_lugre_presliding") == pytest.approx(positions, rel=1e-9)
    forces = [oracle.break_away(rate) for rate in (1, 10, 50)]
    assert values("L02_lugre_break_away") == pytest.approx(forces, abs=2e-9)
    lags = [q for omega in (1, 10, 25) for q in oracle.lag(omega)]
    assert values("L03_lugre_frictional_lag") == pytest.approx(lags, abs=1e-11)
    times, end = oracle.hysteresis_switches(0.01, 4.0)
    assert values("C02_relay_oscillator_with_hysteresis") == pytest.approx([*times, *end], abs=1e-11)
    stored = values("C03_fast_switches")
    assert stored == pytest.approx(list(itertools.islice(oracle.fast_switches(1.0), len(stored))), abs=1e-11)


@pytest.mark.parametrize("name", [name for name in CASES if name.startswith("D")])
def test_15_stored_values_of_sign_vectors_are_those_of_scipy(name: str) -> None:
    case = CASES[name]
    # scipy needs fields that are defined beyond their surface as well.
    for power in ("(-wl/ws)", "(wl/ws)"):
        table = case["fields"].items()
        rows = {key: [text.replace(power, "(Abs(wl)/ws)") for text in row] for key, row in table}
        case = {**case, "fields": rows}
    begin, end = (number(text, {}) for text in case["t_span"])
    times, last = follow(case, [number(text, {}) for text in case["x0"]], (begin, end))
    assert values(name) == pytest.approx([*times, *last], abs=1e-9)


def test_15_break_away_falls_with_the_rate_as_published() -> None:
    """Fig. 4: from just below Fs towards Fc; before it a deflection of -(Fs/s0) ln(1 - u/Fs)."""
    slow, middle, fast = values("L02_lugre_break_away")
    assert oracle.FS > slow > middle > fast > oracle.FC
    assert values("L01_lugre_presliding")[0] == pytest.approx(1.5e-5 * 2.995732, rel=2e-3)


def test_15_values_are_read_in_the_notation_of_the_page() -> None:
    assert number("2 k^2 - ln 1", {"k": 3}) == 18
