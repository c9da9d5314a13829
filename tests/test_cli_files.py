"""What the commands compute and write."""

import json
import sys
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import networkx as nx
import numpy as np
import pytest
from command import SECTION, strict, summary, table, write_own
from matplotlib import pyplot as plt

from filippov.app.cli.main import main
from filippov.solving.solution import Solution


@pytest.fixture
def own(tmp_path: Path) -> Path:
    return write_own(tmp_path)


def test_simulate_writes_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "new" / "run"
    found = summary(capsys, "simulate", "hunting", "--t-span", "0", "5", "-o", str(out), "--points", "101")
    assert {path.name for path in out.iterdir()} == {
        "events.csv", "trajectory.csv", "solution.npz", "summary.json", "response.png",
    }  # fmt: skip
    solution = Solution.load(out / "solution.npz")
    assert solution.t_end == 5.0
    events = table(out / "events.csv")
    assert [float(row["t"]) for row in events] == [event.t for event in solution.events]
    assert [float(row["t"]) for row in events] == [event["t"] for event in found["events"]]
    rows = table(out / "trajectory.csv")
    assert len(rows) == 101
    sampled = np.array([[float(row[name]) for name in ("x", "v", "z")] for row in rows])
    assert np.array_equal(sampled, solution.sol(np.linspace(0, 5, 101)).T)
    written = strict((out / "summary.json").read_text(encoding="utf-8"))
    assert written == {key: value for key, value in found.items() if key != "events"}
    assert (out / "response.png").read_bytes().startswith(b"\x89PNG")


def test_a_run_that_ends_early_fails_with_its_cause_and_keeps_what_there_is(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["simulate", "hunting", "--max-steps", "30", "-o", str(tmp_path), "--json"]
    assert main(words) == 1
    out, err = capsys.readouterr()
    assert "max_steps: stopped at t = " in err
    assert strict(out)["success"] is False
    assert 0 < strict((tmp_path / "summary.json").read_text(encoding="utf-8"))["t_end"] < 20


def test_a_quiet_command_says_why_it_did_not_succeed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["ensemble", "hunting", "--over", "P=10:20:2", "--max-steps", "30", "--quiet"]
    assert main(words) == 3
    assert capsys.readouterr().err == "filippov: trajectory 0: max_steps\nfilippov: trajectory 1: max_steps\n"
    points = [0.1, 0.2, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0]  # 1 + v/4: nothing of it falls with the speed
    curve = tmp_path / "curve.csv"
    curve.write_text("v,friction\n" + "".join(f"{v},{1 + 0.25 * v}\n" for v in points))
    assert main(["identify", str(curve), "--quiet"]) == 3
    assert "filippov: not converged: the data do not determine Fs, vs, beta" in capsys.readouterr().err


def test_the_output_is_tried_before_the_work(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "file"
    file.touch()
    assert main(["simulate", "hunting", "-o", str(file)]) == 2
    assert "is a file; name a folder" in capsys.readouterr().err
    assert main(["simulate", "hunting", "-o", str(file / "below")]) == 2
    assert "nothing can be written" in capsys.readouterr().err


def test_11_23_what_stands_in_the_place_of_other_files_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["simulate", "hunting", "--t-span", "0", "1", "-o", str(tmp_path)]
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    (tmp_path / "events.csv").write_text("mine", encoding="utf-8")
    assert main(words) == 0
    assert "in place of the events.csv that was there" in capsys.readouterr().err
    assert main(words) == 0
    said = capsys.readouterr().err
    for path in tmp_path.iterdir():
        assert (path.name in said.partition("in place of")[2]) == (path.name != "notes.txt")
    assert (tmp_path / "notes.txt").read_text(encoding="utf-8") == "mine"


def test_graph_writes_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = summary(capsys, "graph", "hunting", "-o", str(tmp_path))
    names = {"graph.dot", "graph.graphml", "graph.json", "graph.png"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert {node["id"] for node in found["nodes"]} == {"-", "0", "+"}
    assert set(nx.read_graphml(tmp_path / "graph.graphml").nodes) == {"-", "0", "+"}
    seen = summary(capsys, "graph", "hunting", "--kind", "observed", "--t-span", "0", "3", "--recurrent")
    assert sum(edge["count"] for edge in seen["edges"]) > 0


def test_graph_of_plain_functions_says_what_to_do(own: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["graph", f"{own}:plain"]) == 1
    assert "--kind observed" in capsys.readouterr().err


def test_event_map_writes_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["event-map", "hunting", *SECTION, "--interval", "0.1", "0.4", "--points", "20", "--start", "0.3"]
    found = summary(capsys, *words, "--iterates", "3", "-o", str(tmp_path))
    assert {path.name for path in tmp_path.iterdir()} == {"map.csv", "fixed_points.json", "map.png"}
    rows = table(tmp_path / "map.csv")
    assert [float(row["R"]) for row in rows] == found["R"]
    assert found["orbit"][0] == 0.3
    assert len(found["orbit"]) == 4
    # The reference value of the stable cycle's half: R maps its stick position to the opposite one.
    d = 0.252304806412
    assert np.interp(d, found["d"], found["R"]) == pytest.approx(-d, abs=1e-3)


def test_a_model_without_a_section_says_what_to_give(own: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["event-map", f"{own}:plain", "--surface", "v", "--interval", "0", "1"]) == 2
    assert "proposes no section; give --event, --coordinate, --parametrisation" in capsys.readouterr().err


def test_bifurcation_writes_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["bifurcation", "hunting", *SECTION, "--interval", "0.1", "0.4", "--points", "16"]
    over = ["--parameter", "P", "--values", "10", "11", "--count", "2"]
    found = summary(capsys, *words, *over, "-o", str(tmp_path))
    names = {"bifurcation.csv", "bifurcation.json", "bifurcation.png"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert [entry["value"] for entry in found["values"]] == [10.0, 11.0]
    (cycle,) = found["values"][0]["fixed_points"]
    assert cycle["d"] == pytest.approx(0.252304806412, abs=1e-9)
    assert float(table(tmp_path / "bifurcation.csv")[0]["d"]) == cycle["d"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "which parameter?"),
        (["--parameter", "p"], "did you mean 'P'?"),
        (["--parameter", "P"], "over which values of P?"),
        (["--parameter", "m", "--values", "-1", "1"], "outside its bounds"),
    ],
)
def test_wrong_usage_of_bifurcation(
    words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["bifurcation", "hunting", *words, *SECTION, "--interval", "0", "1"]) == 2
    assert said in capsys.readouterr().err


def test_stability_writes_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    summary(capsys, "stability", "hunting", "-p", "beta=1", "--solve-for", "P", "-o", str(tmp_path))
    assert {path.name for path in tmp_path.iterdir()} == {f"report.{s}" for s in ("txt", "md", "tex", "json")}
    assert "P > 29" in (tmp_path / "report.txt").read_text(encoding="utf-8")
    strict((tmp_path / "report.json").read_text(encoding="utf-8"))


def test_12_11_stability_writes_certificates(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The reference system with its friction curve has none; a row is there all the same."""
    summary(capsys, "stability", "hunting", "--certify", "-o", str(tmp_path))
    (row,) = json.loads((tmp_path / "certificates.json").read_text(encoding="utf-8"))
    assert row["mode"] == "0"
    assert set(row) == {"mode", "x", "answer", "reach", "theorem", "source", "checked"}


def fake(monkeypatch: pytest.MonkeyPatch, name: str, **content: Any) -> None:
    module = ModuleType(name)
    module.__spec__ = ModuleSpec(name, None)
    vars(module).update(content)
    monkeypatch.setitem(sys.modules, name, module)


def test_compare_hands_over_and_writes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def compare(system: Any, section: Any, bands: Any, **options: Any) -> Any:
        assert system.states == ("x", "v", "z")
        assert section.surface == "velocity"
        assert (options["widths"], options["parameters"]["P"]) == ([0.01, 1e-4], 20.0)
        assert {band.name: band.options for band in bands} == {
            "switch": {"alpha": (5.0,)},
            "karnopp": {"alpha": (5.0,)},
        }
        rows = [{"model": "switch", "error": float("nan")}, {"model": "karnopp", "calls": 3}]
        told = {"parameters": options["parameters"], "rows": rows}
        return SimpleNamespace(rows=rows, to_dict=lambda: told, to_text=lambda: "the table", plot=plt.figure)

    fake(monkeypatch, "filippov.analysis.comparisons.comparison", compare=compare)
    words = ["compare", "hunting", *SECTION, "-p", "P=20", "--widths", "1e-2,1e-4", "--alphas", "5"]
    assert main([*words, "-o", str(tmp_path), "--json"]) == 0
    out, err = capsys.readouterr()
    assert "the table" in err
    assert strict(out)["rows"][0] == {"model": "switch", "error": None}
    assert [row["calls"] for row in table(tmp_path / "comparison.csv")] == ["", "3"]
    assert (tmp_path / "comparison.png").is_file()


def test_study_hands_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def run_study(
        name: str, output: Path, progress: Any, quick: bool, resolution: float, jobs: int
    ) -> dict[str, Any]:
        assert (name, resolution) == ("hunting", 1.0)
        assert jobs in (1, 2)
        assert output.is_dir()
        progress("friction curves")
        progress(1, 3)
        progress(2, 3, "maps")
        return {"quick": quick, "bound": float("inf")}

    fake(monkeypatch, "filippov.app.report")
    fake(monkeypatch, "filippov.app.report.study", run_study=run_study)
    out = tmp_path / "report"
    assert summary(capsys, "study", "hunting", "--quick", "-o", str(out)) == {"quick": True, "bound": None}
    assert main(["study", "huntin"]) == 2
    assert "did you mean 'hunting'?" in capsys.readouterr().err


def test_ctrl_c_keeps_the_part_of_a_map(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from filippov.analysis.maps.event_map import EventMap

    whole, calls = EventMap.returns, []

    def returns(self: EventMap, d: Any) -> Any:
        calls.append(d)
        if len(calls) > 1:
            raise KeyboardInterrupt
        return whole(self, d)

    monkeypatch.setattr(EventMap, "returns", returns)
    words = ["event-map", "hunting", *SECTION, "--interval", "0.1", "0.4", "--points", "200"]
    assert main([*words, "-o", str(tmp_path), "--json"]) == 130
    out, err = capsys.readouterr()
    assert "64 of 200 points" in err
    assert strict(out)["complete"] is False
    assert len(table(tmp_path / "map.csv")) == 64


def test_continue_takes_its_parameter_as_the_other_commands_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """--over P=10:12 is --parameter P --from 10 --to 12; half of it, or both, is answered."""
    common = ["continue", "hunting", "--start", "0.25", "--max-points", "4"]
    one = summary(capsys, *common, "--over", "P=10:12", "-o", str(tmp_path / "one"))
    apart = ["--parameter", "P", "--from", "10", "--to", "12"]
    other = summary(capsys, *common, *apart, "-o", str(tmp_path / "two"))
    assert one == other
    assert one["points"][0]["value"] == 10.0
    for words, said in (
        ([], "give --over NAME=LOW:HIGH"), (["--parameter", "P"], "give --over P=LOW:HIGH"),
        (["--over", "P=10:12", "--to", "12"], "give one or the other"),
        (["--over", "Q=1:2"], "unknown parameter 'Q'"),
    ):  # fmt: skip
        assert main([*common, *words]) == 2
        assert said in capsys.readouterr().err
