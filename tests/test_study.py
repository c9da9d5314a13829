"""The hunting study end to end, and the parts of its report."""

import csv
import json
import math
import re
import xml.etree.ElementTree as ET
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from filippov.errors import UsageError
from filippov.models.studies import BUILT_IN, get_study, study_names
from filippov.report.facts import Facts
from filippov.report.html import escape, inline_svg, preformatted
from filippov.report.independent import Rule
from filippov.report.study import run_study

SET, CYCLE = "equilibrium set", "limit cycle"
# 40-digit Taylor integration; beta = 0.5: the four digits that are printed.
REFERENCE = {"2": (0.003355834470, 0.252304806412), "1": (0.231364108104,)}
VOID = {"meta", "br", "hr", "img", "link", "input"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("study") / "results"
    notes = []
    run_study("hunting", out, quick=True, progress=lambda done, total, note: notes.append(done / total))
    assert notes[-1] == 1.0
    assert np.all(np.diff(notes) >= -1e-12)
    return out


@pytest.fixture(scope="module")
def summary(folder):
    def refuse(name):
        raise AssertionError(f"{name} is no JSON")

    return json.loads((folder / "summary.json").read_text(encoding="utf-8"), parse_constant=refuse)


@pytest.fixture(scope="module")
def page(folder):
    return (folder / "report.html").read_text(encoding="utf-8")


def test_summary_has_the_stated_structure(summary):
    assert list(summary) == [
        "fixed_points", "folds", "set_stability_change", "routh_hurwitz_bound", "cycles", "classification",
        "comparison", "timing",
    ]  # fmt: skip
    assert list(summary["fixed_points"]) == list(summary["cycles"]) == ["2", "1", "0.5"]
    for points in summary["fixed_points"].values():
        for point in points:
            assert {"d", "kind", "stable", "slope"} <= set(point)
            assert point["kind"] in {SET, CYCLE}
            assert isinstance(point["stable"], bool)
            assert point["slope"] is not None or point["note"]
    for row in summary["comparison"]:
        assert {"model", "eta", "alpha", "error_P", "field_calls", "seconds"} <= set(row)
    assert {"exact", "switch", "karnopp"} == {row["model"] for row in summary["comparison"]}
    assert summary["timing"]["total"] > 0


@pytest.mark.parametrize("key", ["2", "1"])
def test_cycles_are_those_of_the_reference(summary, key):
    cycles = [q["d"] for q in summary["fixed_points"][key] if q["kind"] == CYCLE]
    np.testing.assert_allclose(cycles, REFERENCE[key], rtol=0, atol=1e-10)
    assert summary["cycles"][key]["10"] == cycles


def test_cycle_at_beta_one_half(summary):
    (cycle,) = [q["d"] for q in summary["fixed_points"]["0.5"] if q["kind"] == CYCLE]
    assert f"{cycle:.4f}" == "0.1786"


def test_kinds_and_stability_are_those_of_the_paper(summary):
    points = summary["fixed_points"]
    found = {key: [(q["kind"], q["stable"]) for q in points[key]] for key in points}
    assert found == {
        "2": [(SET, True), (CYCLE, False), (CYCLE, True)],
        "1": [(SET, False), (CYCLE, True)],
        "0.5": [(SET, False), (CYCLE, True)],
    }


def test_infinite_slope_is_null_with_a_note(summary):
    point = summary["fixed_points"]["0.5"][0]
    assert point["slope"] is None
    assert "jumps" in point["note"]


def test_fold_change_of_stability_and_bound(summary):
    (fold,) = summary["folds"]["2"]
    assert abs(fold["P"] - 21) < 0.1
    assert 0 < fold["d"] < 0.1
    (change,) = summary["set_stability_change"]["1"]
    # The linearised slip s^3 + a s^2 + (P/m) s + P I/m, a = P D + b - (Fs - Fc)/vs, from rest at the end of
    # the set: |y| = 1 at the first y' = 0. Solved here by its roots.
    assert abs(_return_at_the_end(change["P"])) == pytest.approx(1.0, abs=1e-7)
    assert summary["routh_hurwitz_bound"]["1"] == pytest.approx(29.0, abs=1e-12)
    assert set(summary["folds"]) == {"2"}
    assert set(summary["set_stability_change"]) == {"1"}


def _return_at_the_end(P):
    a = P + 1 - 20
    roots = np.roots([1, a, P, 10 * P])
    weights = np.linalg.solve(np.vander(roots, 3, increasing=True).T, [1, 0, 0])

    def y(t, order=0):
        return float(np.real(np.sum(weights * roots**order * np.exp(roots * t))))

    t = np.linspace(1e-3, 4, 40001)
    rate = np.array([y(s, 1) for s in t])
    k = int(np.argmax((rate[:-1] < 0) & (rate[1:] >= 0)))
    low, high = t[k], t[k + 1]
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if y(middle, 1) < 0 else (low, middle)
    return y(low)


def test_table_4_comes_out(summary):
    stated = get_study("hunting").stated_classification
    assert summary["classification"] == {regime: dict(words) for regime, words in stated.items()}


def test_band_models_approach_the_inclusion(summary):
    for model in ("switch", "karnopp"):
        rows = [r for r in summary["comparison"] if r["model"] == model]
        widest, narrowest = max(rows, key=lambda r: r["eta"]), min(rows, key=lambda r: r["eta"])
        assert narrowest["error_P"] < 1e-3 * widest["error_P"]


def test_every_figure_is_there_as_svg_and_png(folder):
    names = {path.stem for path in folder.glob("*.svg")}
    assert names == {path.stem for path in folder.glob("*.png")}
    assert names == {
        "friction", "response_2", "phase_2", "map_2", "second_2", "second_1", "second_0_5", "bifurcation_2",
        "bifurcation_1", "bifurcation_0_5", "modes", "graph", "comparison",
    }  # fmt: skip
    for path in folder.glob("*.png"):
        assert path.read_bytes().startswith(b"\x89PNG")
    for path in folder.glob("*.svg"):
        assert ET.parse(path).getroot().tag.endswith("svg")  # noqa: S314


def test_no_unfinished_files_are_left(folder):
    assert not [path for path in folder.iterdir() if path.name.startswith(".")]


class Page(HTMLParser):
    def __init__(self):
        super().__init__()
        self.open, self.ids, self.links, self.tags = [], [], [], set()

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        values = dict(attrs)
        self.ids += [values["id"]] if "id" in values else []
        self.links += [values[k] for k in ("href", "src", "xlink:href", "data", "action") if k in values]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_page_is_self_contained_and_well_formed(page):
    found = Page()
    found.feed(page)
    found.close()
    assert found.open == []
    assert len(found.ids) == len(set(found.ids))
    assert all(link.startswith("#") for link in found.links)
    assert {link[1:] for link in found.links} <= set(found.ids)
    assert set(re.findall(r"url\(#([^)]+)\)", page)) <= set(found.ids)
    assert not {"script", "link", "img", "iframe", "object"} & found.tags
    assert not re.search(r"(?:https?:)?//[a-z]", page)
    assert "@import" not in page


def test_every_inline_figure_is_well_formed_xml(page):
    drawings = re.findall(r"<svg.*?</svg>", page, re.DOTALL)
    assert len(drawings) == 13
    for drawing in drawings:
        assert ET.fromstring(drawing).get("aria-label")  # noqa: S314


def test_page_tells_what_was_computed(page):
    computed = ("0.003355834470", "0.252304806412", "0.1785896912", "21.01497977", "26.60194904")
    for text in (*computed, "P &gt; 29"):
        assert text in page
    assert "(not computed)" not in page
    assert "nan" not in re.sub(r"<[^>]*>", " ", page).lower().split()


def test_csv_files_agree_with_the_summary(folder, summary):
    with (folder / "fixed_points.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for key, points in summary["fixed_points"].items():
        assert [float(r["d"]) for r in rows if r["case"] == key] == [q["d"] for q in points]
    with (folder / "response_2.csv").open(encoding="utf-8", newline="") as file:
        response = list(csv.DictReader(file))
    assert [float(response[0][k]) for k in ("t", "x", "v", "z")] == [0.0, 0.1, 0.0, 0.0]
    assert all(float(r["v"]) == 0.0 for r in response if r["mode"] == "0")


def test_independent_methods_agree(folder):
    with (folder / "checks.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    cycles = {(r["case"], r["cycle"]) for r in rows}
    assert len(cycles) == 4
    for case, cycle in cycles:
        own = {r["method"]: float(r["d"]) for r in rows if (r["case"], r["cycle"]) == (case, cycle)}
        event_map = [v for k, v in own.items() if k.startswith("event map")]
        collocation = [v for k, v in own.items() if k.startswith("collocation")]
        # The coarser of each only shows that it converges.
        assert event_map[-1] == pytest.approx(collocation[-1], rel=2e-11)


# -- the parts -------------------------------------------------------------------------------------------


def test_studies_are_found_by_name():
    assert set(BUILT_IN) <= set(study_names())
    assert get_study("hunting").model == "hunting"
    with pytest.raises(UsageError, match="did you mean 'hunting'"):
        get_study("huntin")


def test_unknown_facts_say_so():
    assert "P = {fold_7:.3f}".format_map(Facts()) == "P = (not computed)"


def test_gauss_rule_integrates_exactly():
    rule = Rule.of(9)
    c = 1.0 - np.sqrt(1.0 - rule.time)
    for k in range(9):
        np.testing.assert_allclose(rule.inner @ c**k, c ** (k + 1) / (k + 1), atol=1e-14)
        assert rule.weights @ c**k == pytest.approx(1 / (k + 1), abs=1e-14)


def test_inline_svg_has_names_of_its_own():
    svg = '<?xml version="1.0"?><svg xmlns="http://www.w3.org/2000/svg"><g id="a" clip-path="url(#b)"/></svg>'
    assert inline_svg(svg, "f", 'x "y"') == (
        '<svg role="img" aria-label="x &quot;y&quot;"><g id="f-a" clip-path="url(#f-b)"/></svg>'
    )


def test_text_is_escaped_and_wrapped():
    assert escape("a < b & c") == "a &lt; b &amp; c"
    wrapped = preformatted("  - " + "word " * 40, width=50)
    assert all(line.startswith("    word") for line in wrapped.splitlines()[1:])
    assert max(map(len, wrapped.splitlines())) <= 60
    assert math.isfinite(len(wrapped))


def test_report_knows_no_model():
    root = Path(__file__).resolve().parent.parent / "filippov" / "report"
    for path in root.glob("*.py"):
        words = set(re.findall(r"[a-z]+", path.read_text(encoding="utf-8").lower()))
        assert not words & {"hunting", "friction", "stribeck", "beta", "gain", "karnopp", "switch"}, path
