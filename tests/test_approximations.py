"""The table of approximations of docs/comparison.md: its orders, and a part of it computed again."""

import csv
from pathlib import Path
from types import SimpleNamespace

import pytest

from filippov import UsageError
from filippov.app.approximations import COLUMNS, MODELS, table_of_approximations
from filippov.app.report.band import approximations
from filippov.app.report.page import document
from filippov.models.approximated import PLANTS
from filippov.models.studies import get_study

TABLE = Path(__file__).resolve().parent.parent / "models" / "approximations.csv"
ROWS = list(csv.DictReader(TABLE.read_text(encoding="utf-8").splitlines()))


def test_15_table_has_every_plant_under_every_model() -> None:
    assert tuple(ROWS[0]) == COLUMNS
    found = {(row["plant"], row["model"]) for row in ROWS}
    assert found == {(plant, model) for plant in PLANTS for model in (*MODELS, "exact")}
    for row in ROWS:
        assert row["error_state"] or row["said"].startswith("does not apply: "), row


def test_15_each_approximation_has_the_order_of_its_theory_or_the_table_says_so() -> None:
    slower = set()
    for row in ROWS:
        if not row["order"]:
            continue
        if float(row["order"]) < float(row["theory"]) - 0.25:
            assert row["said"].startswith(f"order {float(row['order']):.2f}, below"), row
            slower.add((row["plant"], row["model"]))
    assert slower == {("drive", "tanh"), ("drive", "lugre"), ("drive", "dahl")}


def test_15_a_part_of_the_table_computed_again() -> None:
    made = table_of_approximations(["belt"], ["switch", "moreau"])
    made += table_of_approximations(["ball"], ["tanh"])
    for row in made:
        (known,) = (q for q in ROWS if (q["plant"], q["model"]) == (row["plant"], row["model"]))
        assert row["said"] == known["said"]
        if row["model"] in ("switch", "moreau") and row["error_state"] is not None:
            assert row["error_state"] == pytest.approx(float(known["error_state"]), rel=0.1)
            assert row["order"] == pytest.approx(float(known["order"]), abs=0.05)
            assert row["calls_ratio"] == pytest.approx(float(known["calls_ratio"]), rel=0.1)


def test_15_the_study_of_the_hunting_loop_shows_the_table() -> None:
    """Kept with the package, as it takes minutes; its words count what is slower than theory."""
    study = get_study("hunting")
    assert study.approximated == tuple(ROWS)
    section = approximations(SimpleNamespace(study=study))  # type: ignore[arg-type]  # a run that has a study
    assert section.facts == {"plants": 6, "orders": sum(bool(row["order"]) for row in ROWS), "slower": 3}
    assert len(section.parts[1].rows) == len(ROWS)  # type: ignore[union-attr]  # the table
    page = document("", "", [section], study.texts, {})
    assert "Of 35 approximations 3 have not the order" in page


def test_15_names_that_are_not_in_the_table_are_refused() -> None:
    with pytest.raises(UsageError, match="did you mean 'belt'"):
        table_of_approximations(["bel"])
    with pytest.raises(UsageError, match="moreau"):
        table_of_approximations(["belt"], ["morau"])
