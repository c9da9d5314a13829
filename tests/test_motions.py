"""A motion under its approximations: orders, closed forms, widths that an accuracy needs, faults in kind."""

import csv
import io
import json
import math
from pathlib import Path
from typing import Any

import pytest
import sympy as sp

from filippov import Solution, Surface, System, TimeEvent, UsageError, parameters, sign, states, t
from filippov.analysis import Approximation, compare
from filippov.analysis.comparisons.approximation import under
from filippov.analysis.comparisons.solution_result import SolutionComparison
from filippov.app.cli.main import main

MU, END, WIDTHS = 0.2, 12.0, (1e-2, 1e-3, 1e-4)
x, v = states("x v")
p = parameters(mu=MU)
# From 0.7 it turns at -0.3 after a time of pi and rests at 0.1 - 2 mu = -0.1 after 2 pi: |-0.1| < mu.
BLOCK = System({x: v, v: -x - p.mu * sign(v)}, surfaces=[Surface("slip", v)])
REST, RESTS = -0.1, 2 * math.pi
NAMES = ("switch", "karnopp", "band", "tanh")


@pytest.fixture(scope="module")
def block() -> SolutionComparison:
    return compare(
        BLOCK, (0.7, 0), (0, END), against=NAMES, widths=WIDTHS, measures=["end(x)"], accuracy=3e-4,
        quantity="error_final",
    )  # fmt: skip


def test_15_4_the_exact_motion_is_the_closed_form(block: SolutionComparison) -> None:
    row = block.rows[0]
    assert (row["model"], row["width"], row["ending"]) == ("exact", None, "rest")
    assert row["end(x)"] == pytest.approx(REST, abs=1e-9)
    assert row["stick"] == pytest.approx(END - RESTS, abs=1e-6)
    assert (row["entries"], row["drift"]) == ([1], 0.0)
    assert max(row["error_state"], row["error_times"]) < 1e-8


@pytest.mark.parametrize("model", NAMES)
def test_15_4_each_approximation_is_of_first_order(block: SolutionComparison, model: str) -> None:
    """The band is entered width/|v'| early and left late, and nothing else differs."""
    for quantity in ("error_state", "error_times"):
        trend = block.trend(model, quantity)
        assert trend.vanishes is True
        assert trend.order == pytest.approx(1.0, abs=0.1), trend.sentence


def test_15_4_drift_in_stick_is_that_of_the_model(block: SolutionComparison) -> None:
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


def test_15_4_stiff_approximations_have_the_implicit_method(block: SolutionComparison) -> None:
    assert {row["method"] for row in block.of("switch")} == {"DOP853"}
    assert {row["method"] for row in block.of("tanh")} == {"Radau"}
    assert all(row["jacobians"] > 0 for row in block.of("band"))


def test_15_4_what_is_wrong_in_kind_is_said(block: SolutionComparison) -> None:
    assert len(block.faults) == 2
    for sentence, model in zip(block.faults, ("band", "tanh"), strict=True):
        assert sentence.startswith(f"{model} at width 0.0001 loses the rest state")
        assert "x creeps on" in sentence
        assert sentence in block.to_text()


def test_15_4_the_width_for_an_accuracy_is_solved_for_and_checked(block: SolutionComparison) -> None:
    """The saturated line is off by 0.1 w (t - 2 pi)/mu over an extent of 1 at the end."""
    needed = {item.model: item for item in block.needed}
    assert set(needed) == set(NAMES)
    for item in needed.values():
        assert item.width is not None
        assert item.error <= 3e-4
    width = 3e-4 * MU / (0.1 * (END - RESTS))
    assert width / 3.2 < needed["band"].width < width * 1.01
    assert needed["band"].sentence in block.to_text()


def test_15_4_it_is_written_in_every_form(block: SolutionComparison) -> None:
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


def test_15_4_stick_in_a_layer_that_is_entered_where_nothing_attracts_is_no_lost_stick() -> None:
    """From 0.65 it turns at -0.25, where the spring is stronger, and rests at -0.15 after a push of 0.05."""
    found = compare(BLOCK, (0.65, 0), (0, END), against=["tanh", "band"], widths=(1e-2, 1e-3))
    assert {tuple(row["entries"]) for row in found.rows} == {(1,)}
    assert not any("stick" in sentence for sentence in found.faults)


REST_ELSEWHERE = "goes to another state of rest: x = 0.1, where the exact solution rests at -0.1."
CYCLE_ELSEWHERE = (
    "goes into another cycle: x from -0.1 to 0.7, where the exact solution goes from -0.7 to 0.7."
)
PUSHED = System({x: v, v: parameters(F=0.0).F - x - p.mu * sign(v)}, surfaces=[Surface("slip", v)])


@pytest.mark.parametrize(
    ("exact", "other", "said"),
    [
        # Half a period takes 2 mu: with 0.15 it turns at -0.4 and rests at 0.1.
        ({"mu": 0.2}, {"mu": 0.15}, REST_ELSEWHERE),
        ({"mu": 0.2}, {"mu": 0.199}, ""),
        ({"mu": 0.0}, {"mu": 0.0, "F": 0.3}, CYCLE_ELSEWHERE),
        ({"mu": 0.0}, {"mu": 0.005}, "loses the cycle of amplitude 0.7."),
        ({"mu": 0.005}, {"mu": 0.0}, "invents a cycle of amplitude 0.7: the exact solution has none."),
        ({"mu": 0.0}, {"mu": 0.0, "F": 1e-3}, ""),
        ({"mu": 0.0}, {"mu": 0.2}, "invents a state of rest: the exact solution goes on."),
    ],
)
def test_15_4_another_basin_and_another_kind_are_said(
    exact: dict[str, float], other: dict[str, float], said: str
) -> None:
    made = {"other": lambda _: (PUSHED, other)}
    found = compare(PUSHED, (0.7, 0), (0, 100), parameters=exact, against=made, widths=(1.0,))
    sentences = [q for q in found.faults if "stick" not in q]
    assert sentences == ([f"other at width 1 {said}"] if said else [])


def test_15_4_errors_of_a_motion_at_rest_are_over_its_size() -> None:
    """x = 0.1 and v = 0 forever, and a model that creeps by 1e-3 t: 0.01 of x, and 1e-3 of v itself."""
    def energy(solution: Solution) -> float:
        return float(solution.x_end[0]) ** 2 / 2

    creep, measures = System({x: v + 1e-3, v: -v}), [energy]
    found = compare(
        BLOCK, (0.1, 0), (0, 1), against={"creep": lambda _: creep}, widths=(1.0,), measures=measures
    )  # fmt: skip
    assert [row["energy"] for row in found.rows] == pytest.approx([0.1**2 / 2, 0.101**2 / 2], rel=1e-9)
    assert found.of("creep")[0]["error_state"] == pytest.approx(0.01, rel=1e-9)
    assert "x creeps on at 0.01 of its extent in a unit of time" in found.faults[0]


def test_15_4_a_spent_budget_is_said_and_not_tried_again() -> None:
    found = compare(BLOCK, (0.7, 0), (0, 9), against="hysteresis", widths=(1e-2, 1e-5, 1e-6), max_events=2000)
    notes = [row["note"] for row in found.of("hysteresis")]
    assert not notes[0]
    assert "more than the events allowed" in notes[1]
    assert "not possible at width 1e-05" in notes[2]
    (fault,) = found.faults
    assert "goes back and forth" in fault or "in a cycle" in fault


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


# x is no velocity, and time stepping knows no clock.
CLOCKED = System({x: -sign(x - sp.sin(t)), v: 1 - v}, time_events=[TimeEvent("clock", 1, 1, reset={v: 0})])


def test_15_4_what_does_not_apply_is_a_row_that_says_why(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    found = compare(
        CLOCKED, (0.5, 0), (0, 3), against=["karnopp", "band", "moreau", "tanh"], widths=(1e-2, 1e-3),
        accuracy=1e-2,
    )  # fmt: skip
    names = [(row["model"], row["width"]) for row in found.rows]
    assert names == [
        ("exact", None), ("karnopp", None), ("band", 1e-2), ("band", 1e-3), ("moreau", None), ("tanh", 1e-2),
        ("tanh", 1e-3),
    ]  # fmt: skip
    assert found.models == ("band", "tanh")
    for row in (found.rows[1], found.rows[4]):
        assert row["note"].startswith("does not apply: "), row
        assert f"{row['model']}: {row['note'].removeprefix('does not apply: ')}" in found.to_text()
        assert row["entries"] is None
    assert "it is no velocity" in found.rows[1]["note"]
    assert "time events ('clock')" in found.rows[4]["note"]
    assert [item.model for item in found.needed] == ["band", "tanh"]
    assert found.trend("band", "error_state").order == pytest.approx(1.0, abs=0.15)
    assert found.to_html().count("<tr>") == len(names) + 1
    found.plot()
    ball = System({x: v, v: -1}, surfaces=[Surface("floor", x, reset={v: -v / 2}, contact=True)])
    tried = compare(ball, (1, 0), (0, 2), against=["switch", "lugre", "moreau"], widths=(1e-2, 1e-3))
    assert tried.models == ("moreau",)
    assert [row["note"].split(":")[0] for row in tried.rows[1:3]] == ["does not apply"] * 2
    with pytest.raises(UsageError, match=r"no approximation applies.*switch, lugre: the system has no"):
        compare(ball, (1, 0), (0, 2), against=("switch", "lugre"))
    file = tmp_path / "mine.py"
    file.write_text(
        "from filippov import System, sign, states\nx, = states('x')\nrelay = System({x: -sign(x)})\n"
    )
    words = ["compare", f"{file}:relay", "--x0", "x=1", "--t-span", "0", "2", "--widths", "1e-2", "--quiet"]
    assert main([*words, "--against", "karnopp,band", "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [row["note"].split(":")[0] for row in rows[1:]] == ["does not apply", ""]
    assert main([*words, "--against", "karnopp"]) == 2
    assert "it is no velocity" in capsys.readouterr().err


def test_15_4_a_friction_model_leaves_exact_what_is_no_friction() -> None:
    """A relay with hysteresis beside friction: the friction has the bristles, the relay stays."""
    (y,) = states("y")
    loop = System(
        {x: v, v: y - x - p.mu * sign(v), y: -y - sign(y - x / 2)},
        surfaces=[Surface("slip", v), Surface("relay", y - x / 2, width=0.05)],
    )
    found = compare(loop, (0.7, 0, 0), (0, 2), against=["lugre"], widths=(1e-3, 1e-4))
    assert found.models == ("lugre",)
    assert len(found.left) == 1
    assert found.left[0].startswith("lugre leaves 'relay' exact: ")
    assert found.trend("lugre", "error_state").vanishes is True


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"against": ["swich"]}, "did you mean 'switch'"),
        ({"against": []}, "at least one"),
        ({"against": [3]}, "a name of"),
        ({"against": ["tanh", "smooth"]}, "each once"),
        ({"widths": (0.0,)}, "all > 0"),
        ({"quantity": "error"}, "unknown quantity"),
        ({"accuracy": 0}, "number > 0"),
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
        "from filippov import Solution, Surface, System, parameters, sign, states\n"
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


def test_13_7_earlier_names_lead_to_those_of_today(block: SolutionComparison) -> None:
    from filippov import analysis, plot
    from filippov.analysis.comparisons.motion_result import MotionComparison

    assert analysis.compare_motions is analysis.compare_solutions
    assert MotionComparison is SolutionComparison
    assert plot.plot_motions is plot.plot_solution_comparison
    assert block.motions is block.solutions
