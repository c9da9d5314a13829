"""A motion under its approximations: orders, closed forms, widths that an accuracy needs, faults in kind."""

import csv
import io
import json
import math
from pathlib import Path
from typing import Any

import pytest
import sympy as sp

from filippov import Surface, System, UsageError, parameters, sign, states
from filippov.analysis import Approximation, compare
from filippov.analysis.comparisons.approximation import under
from filippov.analysis.comparisons.motion_result import MotionComparison
from filippov.app.cli.main import main

MU, END, WIDTHS = 0.2, 12.0, (1e-2, 1e-3, 1e-4)
x, v = states("x v")
p = parameters(mu=MU)
# From 0.7 it turns at -0.3 after a time of pi and rests at 0.1 - 2 mu = -0.1 after 2 pi: |-0.1| < mu.
BLOCK = System({x: v, v: -x - p.mu * sign(v)}, surfaces=[Surface("slip", v)])
REST, RESTS = -0.1, 2 * math.pi
NAMES = ("switch", "karnopp", "band", "tanh")


@pytest.fixture(scope="module")
def block() -> MotionComparison:
    return compare(
        BLOCK, (0.7, 0), (0, END), against=NAMES, widths=WIDTHS, measures=["end(x)"], accuracy=3e-4,
        quantity="error_final",
    )  # fmt: skip


def test_15_4_the_exact_motion_is_the_closed_form(block: MotionComparison) -> None:
    row = block.rows[0]
    assert (row["model"], row["width"], row["ending"]) == ("exact", None, "rest")
    assert row["end(x)"] == pytest.approx(REST, abs=1e-9)
    assert row["stick"] == pytest.approx(END - RESTS, abs=1e-6)
    assert (row["entries"], row["drift"]) == ([1], 0.0)
    assert max(row["error_state"], row["error_times"]) < 1e-8


@pytest.mark.parametrize("model", NAMES)
def test_15_4_each_approximation_is_of_first_order(block: MotionComparison, model: str) -> None:
    """The band is entered width/|v'| early and left late, and nothing else differs."""
    for quantity in ("error_state", "error_times"):
        trend = block.trend(model, quantity)
        assert trend.vanishes is True
        assert trend.order == pytest.approx(1.0, abs=0.1), trend.sentence


def test_15_4_drift_in_stick_is_that_of_the_model(block: MotionComparison) -> None:
    assert [row["drift"] for row in block.of("switch")] == pytest.approx([w / 100 for w in WIDTHS], rel=1e-3)
    assert [row["drift"] for row in block.of("karnopp")] == pytest.approx([0, 0, 0], abs=1e-14)
    # A saturated line balances x with v = -w x/mu: x = REST exp(-w t/mu) from the stop on.
    for row in block.of("band"):
        creep = REST * math.exp(-row["width"] * (END - RESTS) / MU)
        assert row["end(x)"] == pytest.approx(creep, abs=0.02 * abs(creep - REST) + row["width"] ** 2)
    # tanh balances it with v = -w atanh(x/mu).
    rate = math.atanh(-REST / MU)
    for row in block.of("tanh")[1:]:
        assert row["end(x)"] - REST == pytest.approx(rate * row["width"] * (END - RESTS), rel=0.05)


def test_15_4_stiff_approximations_have_the_implicit_method(block: MotionComparison) -> None:
    assert {row["method"] for row in block.of("switch")} == {"DOP853"}
    assert {row["method"] for row in block.of("tanh")} == {"Radau"}
    assert all(row["jacobians"] > 0 for row in block.of("band"))


def test_15_4_what_is_wrong_in_kind_is_said(block: MotionComparison) -> None:
    assert len(block.faults) == 2
    for sentence, model in zip(block.faults, ("band", "tanh"), strict=True):
        assert sentence.startswith(f"{model} at width 0.0001 loses the rest state")
        assert "x creeps on" in sentence
        assert sentence in block.to_text()


def test_15_4_the_width_for_an_accuracy_is_solved_for_and_checked(block: MotionComparison) -> None:
    """The saturated line is off by 0.1 w (t - 2 pi)/mu over an extent of 1 at the end."""
    needed = {item.model: item for item in block.needed}
    assert set(needed) == set(NAMES)
    for item in needed.values():
        assert item.width is not None
        assert item.error <= 3e-4
    width = 3e-4 * MU / (0.1 * (END - RESTS))
    assert width / 3.2 < needed["band"].width < width * 1.01
    assert needed["band"].sentence in block.to_text()


def test_15_4_it_is_written_in_every_form(block: MotionComparison) -> None:
    data = json.loads(block.to_json())
    assert [row["model"] for row in data["rows"]] == [row["model"] for row in block.rows]
    table = list(csv.DictReader(io.StringIO(block.to_csv())))
    assert float(table[0]["end(x)"]) == block.rows[0]["end(x)"]
    page = block.to_html()
    assert page.count("<tr>") == len(block.rows) + 1
    assert "<svg" in page
    assert "<script" not in page
    figure = block.plot(state="v", title="block")
    assert [line.get_label().split(",")[0] for line in figure.axes[0].lines] == ["exact", *NAMES]
    import matplotlib.pyplot as plt

    plt.close(figure)


def test_15_4_a_build_that_does_not_converge_is_named() -> None:
    """With a friction 5 % too high it turns at -0.28 instead of -0.3."""
    made: Any = under(BLOCK, "switch").build(0.1)[0]  # type: ignore[index]
    found = compare(
        BLOCK, (0.7, 0), (0, 3), against={"wrong": lambda w: (made, {"width": w, "mu": 1.05 * MU})},
        widths=(1e-2, 1e-3),
    )  # fmt: skip
    trend = found.trend("wrong", "error_state")
    assert trend.vanishes is False
    assert "NOT" in trend.sentence
    assert found.of("wrong")[-1]["error_final"] == pytest.approx(0.02, rel=0.1)


def test_15_4_a_spent_budget_is_said_and_not_tried_again() -> None:
    found = compare(BLOCK, (0.7, 0), (0, 9), against="hysteresis", widths=(1e-2, 1e-5, 1e-6), max_events=2000)
    notes = [row["note"] for row in found.of("hysteresis")]
    assert not notes[0]
    assert "more than the events allowed" in notes[1]
    assert "not possible at width 1e-05" in notes[2]
    (fault,) = found.faults
    assert "goes to and fro" in fault or "in a cycle" in fault


def test_15_4_each_surface_has_what_fits_it() -> None:
    """Karnopp's model stands for the friction; a relay in the drive, which is no velocity, stays exact."""
    (y,) = states("y")
    drive = System(
        {x: v, v: y - x - p.mu * sign(v), y: -y - sign(y - x / 2)},
        surfaces=[Surface("slip", v), Surface("relay", y - x / 2)],
    )
    model = under(drive, "karnopp")
    assert set(model.without) == {"relay"}
    assert "holds 2 states" in model.without["relay"]
    made: Any = model.build(1e-3)[0]  # type: ignore[index]
    assert "relay" in made.surface_names
    assert "slip:upper" in made.surface_names


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"against": ["swich"]}, "did you mean 'switch'"),
        ({"against": []}, "at least one"),
        ({"against": [3]}, "a name of"),
        ({"against": ["tanh", "smooth"]}, "each once"),
        ({"widths": (0.0,)}, "all > 0"),
        ({"quantity": "error"}, "unknown quantity"),
        ({"accuracy": 0}, "a number > 0"),
        ({"measures": ["amplitud(x)"]}, "did you mean"),
        ({"against": {"other": lambda w: 1.0}}, "expected a System"),
        ({"against": [Approximation("other", lambda w: System({v: -v, x: -x}))]}, "those of the exact"),
    ],
)
def test_15_4_wrong_input_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        compare(BLOCK, (0.7, 0), (0, 1), **{"against": "switch", "widths": (1e-2,), **changes})
    with pytest.raises(UsageError, match="a Section, or x0 and t_span"):
        compare(BLOCK)
    with pytest.raises(UsageError, match="no switching surface"):
        compare(System({x: -sp.sin(x)}), (1,), (0, 1), against="band")


def test_15_4_the_command_compares_a_file_of_ones_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.py").write_text(
        "from filippov import Surface, System, parameters, sign, states\n"
        "x, v = states('x v')\np = parameters(mu=0.2)\n"
        "block = System({x: v, v: -x - p.mu*sign(v)}, surfaces=[Surface('slip', v)])\n"
    )
    words = [
        "compare", f"{tmp_path / 'mine.py'}:block", "--x0", "x=0.7,v=0", "--t-span", "0", "12", "--against",
        "switch,band", "--widths", "1e-2,1e-3", "--accuracy", "1e-3", "--measure", "end(x)",
    ]  # fmt: skip
    assert main([*words, "-o", str(tmp_path / "out"), "--json", "--quiet"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert data["rows"][0]["end(x)"] == pytest.approx(REST, abs=1e-9)
    assert [item["model"] for item in data["needed"]] == ["switch", "band"]
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written >= {f"comparison.{kind}" for kind in ("csv", "json", "txt", "html", "png")}
    assert main([*words[:-4], "--alphas", "1,2", "--quiet"]) == 2
