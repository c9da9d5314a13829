"""Band models against the exact inclusion: orders in the width, drift in stick, what does not converge."""

import json
import math

import numpy as np
import pytest

from filippov import Surface, System, exp, models, sign, states
from filippov.analysis.comparisons.band_model import BandModel
from filippov.analysis.comparisons.comparison import compare
from filippov.analysis.comparisons.comparison_result import Comparison
from filippov.analysis.maps.section import Section
from filippov.base.errors import UsageError

SECTION = Section(
    "velocity", "sliding entry", "x", {"x": "d", "v": "0", "z": "(sign(d)*Fs/P - d)/I"}, t_max=100.0
)
STICK = {"band upper": "-", "band lower": "+", "effort upper": "-", "effort lower": "+"}
BELT = Section("belt", "sliding entry", "x", lambda d, p: (d, p.vb), t_max=50.0)
# The cycles of reference/hunting.md, from Taylor integration with 40 digits.
CYCLES = (0.003355834470, 0.252304806412)
WIDTHS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)


def ride(t: float, x: object, p: object) -> float:
    """Place on the belt."""
    return float(x[0] - p.vb * t)  # type: ignore[index, attr-defined]


@pytest.fixture(scope="module")
def hunting() -> Comparison:
    switch, karnopp = models.get("hunting_switch").build(), models.get("hunting_karnopp").build()
    bands = [
        BandModel(
            "switch", lambda w, alpha: (switch, {"eta": w, "alpha": alpha}), STICK, {"alpha": (10, 100)}
        ),
        BandModel("karnopp", lambda w: (karnopp, {"DV": w}), STICK),
    ]
    return compare(
        models.get("hunting").build(), SECTION, bands, widths=WIDTHS, comparators=(),
        coordinates=(0.1, 0.3, 0.5), interval=(0.0, 0.5), x0=(0.1, 0.0, 0.0), repeats=1,
    )  # fmt: skip


@pytest.fixture(scope="module")
def belt() -> Comparison:
    return compare(
        models.get("belt").build(), BELT, widths=(1e-2, 1e-3, 1e-4), coordinates=(0.0,),
        interval=(-0.95, 0.95), order=1, x0=(0.0, 0.2), events=4, position=ride, repeats=1,
    )  # fmt: skip


def rows_of(comparison: Comparison, model: str, **options: float) -> list[dict[str, object]]:
    return [r for r in comparison.rows if r["model"] == model and all(r[k] == v for k, v in options.items())]


def test_the_exact_row_has_the_known_cycles_and_no_drift(hunting: Comparison) -> None:
    exact = hunting.rows[0]
    assert exact["model"] == "exact"
    assert exact["drift"] == 0.0
    assert exact["fixed_points"] == pytest.approx(CYCLES, abs=1e-10)
    assert max(exact["error_R"], exact["error_times"], *exact["error_fixed_points"]) < 1e-10


@pytest.mark.parametrize("alpha", [10, 100])
def test_switch_drifts_by_the_way_that_its_velocity_takes_to_decay(hunting: Comparison, alpha: float) -> None:
    # v' = -alpha v from v = eta: x moves by (eta/alpha) (1 - exp(-alpha T)), T the longest stay, 0.456 s.
    for row in rows_of(hunting, "switch", alpha=alpha):
        low = row["width"] / alpha * (1 - math.exp(-alpha * 0.45))
        assert low * (1 - 1e-4) - 1e-12 < row["drift"] < row["width"] / alpha * (1 + 1e-7) + 1e-12


@pytest.mark.parametrize("alpha", [10, 100])
def test_switch_is_of_first_order_in_times_drift_and_cycles(hunting: Comparison, alpha: float) -> None:
    # A band of eta is entered eta/|v'| early and left late; R(d) itself, from break-away on, does better.
    for quantity in ("error_times", "drift", "error_fixed_points"):
        trend = hunting.trend("switch", quantity, alpha=alpha)
        assert trend.vanishes is True
        assert trend.order == pytest.approx(1.0, abs=0.15), trend.sentence


@pytest.mark.parametrize("model", ["switch", "karnopp"])
def test_the_map_of_a_band_model_converges_faster_than_first_order(hunting: Comparison, model: str) -> None:
    # In the band the static level stands for the slip law: the speed is off by b eta t, with eta ~ t^2 there.
    trend = hunting.trend(model, "error_R")
    assert trend.order == pytest.approx(1.5, abs=0.15)
    errors = [row["error_R"] for row in rows_of(hunting, model) if row["model"] == model]
    assert errors[len(WIDTHS) - 1] < 1e-10 < errors[0]


def test_karnopp_does_not_drift(hunting: Comparison) -> None:
    # x' = 0 in its band: that is what the model is made for.
    assert [row["drift"] for row in rows_of(hunting, "karnopp")] == [0.0] * len(WIDTHS)


def test_every_row_is_measured_and_written(hunting: Comparison) -> None:
    assert len(hunting.rows) == 1 + 3 * len(WIDTHS)
    for row in hunting.rows:
        assert row["field_calls"] > 1000
        assert row["seconds"] > 0
        assert row["calls_ratio"] > 0
    written = json.loads(hunting.to_json())
    assert written["rows"] == list(hunting.rows)
    assert len(written["trends"]) == 3 * 4
    text = hunting.to_text()
    assert all(trend.sentence in text for trend in hunting.trends)
    assert hunting.remaining == ()


def test_belt_with_a_saturated_line_and_with_tanh(belt: Comparison) -> None:
    # The exact block rides with the belt: x - vb t is kept to the rounding of v = vb.
    assert belt.rows[0]["drift"] < 1e-12
    for model in ("band", "smooth"):
        for quantity in ("error_times", "error_R", "error_fixed_points"):
            trend = belt.trend(model, quantity)
            assert trend.vanishes is True
            assert 0.8 < trend.order < 1.3, trend.sentence
        drifts = [row["drift"] for row in rows_of(belt, model)]
        assert np.all(np.diff(drifts) < 0)
        assert drifts[-1] > 1e-5  # it creeps by width for about a second


def test_a_model_that_does_not_converge_is_named() -> None:
    # A saturated line has no static level: Fc stands at break-away too. The exact block leaves at x = 1,
    # slips on the circle (x - 1/2)^2 + v^2 = 1/4 + vb^2 and sticks at x = 0; the line lets it go at x = 1/2.
    result = compare(
        models.get("belt_static").build(), BELT, widths=(1e-2, 1e-3, 1e-4), comparators=("band",),
        coordinates=(-0.2, 0.2), x0=(0.0, 0.2), events=3, position=ride, repeats=1,
    )  # fmt: skip
    trend = result.trend("band", "error_times")
    assert trend.vanishes is False
    assert "NOT" in trend.sentence
    assert trend.sentence in result.remaining
    assert trend.sentence in result.to_text()


def test_a_wrong_level_keeps_its_difference() -> None:
    # A band model whose static level is 1 % too high: break-away comes late by 0.01 Fs/(P I d).
    switch = models.get("hunting_switch").build()
    wrong = BandModel("wrong", lambda w: (switch, {"eta": w, "Fs": 4.04}), STICK)
    result = compare(
        models.get("hunting").build(), SECTION, [wrong], widths=(1e-4, 1e-5, 1e-6), comparators=(),
        coordinates=(0.2,), x0=(0.1, 0.0, 0.0), events=1, repeats=1,
    )  # fmt: skip
    trend = result.trend("wrong", "error_times")
    assert trend.vanishes is False
    assert rows_of(result, "wrong")[-1]["error_times"] == pytest.approx(0.04 / (10 * 10 * 0.1), rel=1e-6)


def test_a_spent_budget_is_said_and_not_tried_again() -> None:
    result = compare(
        models.get("hunting").build(), SECTION, widths=(1e-3, 1e-7, 1e-8), comparators=("band",),
        coordinates=(0.2,), events=2, repeats=1, max_steps=3000,
    )  # fmt: skip
    notes = [row["note"] for row in rows_of(result, "band")]
    assert not notes[0]
    assert "more than 3000 steps" in notes[1]
    assert "not enough at width 1e-07" in notes[2]
    assert result.trend("band", "error_R").vanishes is None


def test_the_stick_of_a_plain_function_is_read_by_layer(hunting: Comparison) -> None:
    # The same Switch model without naming its stick: the layer |v| <= eta where the exact system attracts.
    switch = models.get("hunting_switch").build()
    result = compare(
        models.get("hunting").build(), SECTION, {"switch": lambda w: (switch, {"eta": w})},
        widths=(1e-3, 1e-4), comparators=(), coordinates=(0.1, 0.3, 0.5), x0=(0.1, 0.0, 0.0), repeats=1,
    )  # fmt: skip
    named = rows_of(hunting, "switch", alpha=100)
    for row, other in zip(rows_of(result, "switch"), named, strict=False):
        assert row["error_R"] == pytest.approx(other["error_R"], rel=1e-4)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"comparators": ("bend",)}, "did you mean 'band'"),
        ({"widths": (0.0,)}, "numbers > 0"),
        ({"coordinates": ()}, "one number or more"),
        ({"bands": [1]}, "or a BandModel"),
        ({"order": 0}, "at least 1"),
        (
            {"bands": [BandModel("switch", models.get("hunting_switch").build, {"band uper": "-"})]},
            "band upper",
        ),
        ({"bands": {"belt": lambda w: models.get("belt").build()}}, "expected those of the exact system"),
        ({"bands": {"number": lambda w: 1.0}}, "expected a System"),
    ],
)
def test_wrong_input_is_refused(changes: dict[str, object], message: str) -> None:
    given = {
        "bands": (),
        "widths": (1e-3,),
        "comparators": (),
        "coordinates": (0.2,),
        "repeats": 1,
        **changes,
    }
    if isinstance(given["bands"], list) and isinstance(given["bands"][0], BandModel):
        band = given["bands"][0]
        given["bands"] = [BandModel(band.name, lambda w: band.build(eta=w), band.stick)]
    with pytest.raises(UsageError, match=message):
        compare(models.get("hunting").build(), SECTION, **given)  # type: ignore[arg-type]


def test_a_sign_of_stick_is_checked() -> None:
    with pytest.raises(UsageError, match=r"expected '\+' or '-'"):
        BandModel("switch", models.get("hunting_switch").build, {"band upper": "0"})


def test_figure_has_a_line_for_every_family(hunting: Comparison) -> None:
    figure = hunting.plot(title="hunting")
    panels = figure.axes
    assert [ax.get_xscale() for ax in panels] == ["log"] * 3
    for ax in panels:
        labels = [line.get_label() for line in ax.lines if not line.get_label().startswith("_")]
        assert labels == ["switch (alpha 10)", "switch (alpha 100)", "karnopp"]
    import matplotlib.pyplot as plt

    plt.close(figure)


def test_15_4_drift_on_a_belt_is_the_way_slipped_on_it() -> None:
    """The belt carries the block 0.18 in stick; on it the exact one does not slip, a band's by its width."""
    x, v = states("x v")
    rel = v - 0.3
    block = System(
        {x: v, v: -25 * x - 2 * (1 + exp(-abs(rel) / 0.1)) * sign(rel)}, surfaces=[Surface("belt", rel)]
    )
    section = Section("belt", "sliding entry", "x", {"x": "d", "v": "0.3"})
    table = compare(
        block, section, widths=(1e-3, 1e-4), interval=(-0.15, 0.1), comparators=("band",), repeats=1
    )
    assert table.rows[0]["drift"] < 1e-14
    wide, narrow = (row["drift"] for row in table.rows[1:])
    assert narrow < 1e-4
    assert wide / narrow == pytest.approx(10, rel=0.1)
