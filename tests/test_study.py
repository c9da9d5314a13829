"""The hunting study end to end, and the parts of its report."""

import csv
import html
import json
import re
import xml.etree.ElementTree as ET
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from made import is_current
from scipy.integrate import solve_ivp

from filippov.app.report.effort import Effort
from filippov.app.report.study import ORDER, run_study
from filippov.base.errors import UsageError
from filippov.models.studies import Study, StudyCase, get_study

SET, CYCLE = "equilibrium set", "limit cycle"
# 40-digit Taylor integration; beta = 0.5: the four digits that are printed.
REFERENCE = {"2": (0.003355834470, 0.252304806412), "1": (0.231364108104,)}
VOID = {"meta", "br", "hr", "img", "link", "input"}


def made(name, out):
    """The summary of a study in a folder; its progress never falls, and ends at 1."""
    notes = []
    summary = run_study(name, out, quick=True, progress=lambda done, total, note: notes.append(done / total))
    assert notes[-1] == 1.0
    assert np.all(np.diff(notes) >= -1e-12)
    return summary


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What `make study` has made from the sources as they are, or a quick study of our own."""
    kept = Path(__file__).resolve().parent.parent / "results" / "hunting"
    if is_current(kept):
        return kept
    out = tmp_path_factory.mktemp("study") / "results"
    made("hunting", out)
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
        "comparison", "orbits", "branches", "fold_curve", "regions", "settings", "predictions", "experiment",
        "relative", "timing",
    ]  # fmt: skip
    assert list(summary["fixed_points"]) == list(summary["cycles"]) == ["2", "1", "0.5"]
    for points in summary["fixed_points"].values():
        for point in points:
            assert {"d", "kind", "stable", "slope"} <= set(point)
            assert point["kind"] in {SET, CYCLE}
            assert isinstance(point["stable"], bool)
            assert point["slope"] is not None or point["note"]
    for row in summary["comparison"]:
        assert {"model", "eta", "alpha", "error_R", "field_calls", "seconds"} <= set(row)
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
    stated = get_study("hunting").stated.classification
    assert summary["classification"] == {regime: dict(words) for regime, words in stated.items()}


def test_band_models_approach_the_inclusion(summary):
    for model in ("switch", "karnopp"):
        rows = [r for r in summary["comparison"] if r["model"] == model]
        widest, narrowest = max(rows, key=lambda r: r["eta"]), min(rows, key=lambda r: r["eta"])
        assert narrowest["error_R"] < 1e-3 * widest["error_R"]


def test_every_figure_is_there_as_svg_and_png(folder):
    names = {path.stem for path in folder.glob("*.svg")}
    assert names == {path.stem for path in folder.glob("*.png")}
    assert names == {
        "friction", "response_2", "phase_2", "map_2", "second_2", "second_1", "second_0_5", "bifurcation_2",
        "bifurcation_1", "bifurcation_0_5", "modes", "graph", "comparison", "cycles", "branches",
        "fold_curve", "regions", "settings", "prediction", "experiment", "relative",
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
    assert len(drawings) == 21
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


def test_every_section_is_there(page):
    anchors = (
        "cycles", "branches", "fold-curve", "regions", "relative", "settings", "prediction", "experiment",
    )  # fmt: skip
    for anchor in anchors:
        assert f'<section id="{anchor}">' in page
        assert f'<a href="#{anchor}">' in page


def test_orbits_are_the_cycles_with_their_multipliers(summary):
    for key, found in summary["orbits"].items():
        points = [q for q in summary["fixed_points"][key] if q["kind"] == CYCLE]
        for orbit, point in zip(found, points, strict=True):
            assert orbit["amplitude"]["x"] == pytest.approx(point["d"], rel=1e-9)
            # The map's slope at the cycle is its multiplier; stick adds one that is 0.
            assert orbit["multipliers"][0][0] == pytest.approx(point["slope"], rel=1e-6)
            assert orbit["multipliers"][1] == [0.0, 0.0]
            assert orbit["stable"] == point["stable"]
            assert orbit["word"] == "stick slip- stick slip+"
            assert orbit["margin"]["distance"] is None


def test_branches_go_through_the_fold_to_its_digits(summary):
    found = summary["branches"]
    (fold,) = found["2"]["special"]
    assert (fold["what"], fold["P"]) == ("fold", pytest.approx(21.0149797699, abs=1e-9))
    (end,) = found["1"]["special"]
    assert end["P"] == pytest.approx(26.601949038, abs=1e-8)
    assert abs(_return_at_the_end(end["P"])) == pytest.approx(1.0, abs=1e-7)
    for key, reference in REFERENCE.items():
        np.testing.assert_allclose(found[key]["cycles"]["10"], reference, rtol=0, atol=1e-11)
    for key, last in (("2", 21), ("1", 26), ("0.5", 31)):
        count = 2 if key == "2" else 1
        expected = [count if last >= P else 0 for P in range(10, 32)]
        assert [len(found[key]["cycles"][str(P)]) for P in range(10, 32)] == expected
        assert found[key]["largest_difference"] < 1e-10


def test_fold_curve_ends_where_the_set_changes_stability(summary):
    curve = summary["fold_curve"]
    assert curve["beta"][0] == 2.0
    assert curve["P"][0] == pytest.approx(21.0149797699, abs=1e-9)
    assert 1.0 < curve["beta"][-2] < 1.00001
    assert abs(curve["P"][-2] - 26.6019490377) < 2e-3
    # It is followed to beta = 1, where the set of beta = 1 changes stability.
    assert (curve["beta"][-1], curve["P"][-1]) == (1.0, pytest.approx(26.601949038, abs=1e-9))
    assert abs(_return_at_the_end(curve["P"][-1])) == pytest.approx(1.0, abs=1e-7)


def test_16_10_the_fold_curve_itself_points_at_its_limit(summary):
    """With e = beta - 1 the fold's cycle is of size e and P = P1 + e (a log e + b): P1 by least squares."""
    e, P = np.array(summary["fold_curve"]["beta"]) - 1, np.array(summary["fold_curve"]["P"])
    near = (e > 0) & (e < 1e-4)
    assert np.count_nonzero(near) > 3
    e, P = e[near], P[near]
    rows = np.column_stack([np.ones_like(e), e * np.log(e), e])
    size = np.abs(rows).max(axis=0)
    limit = (np.linalg.lstsq(rows / size, P, rcond=None)[0] / size)[0]
    assert limit == pytest.approx(summary["fold_curve"]["P"][-1], abs=1e-6)


def words_of(page, section):
    """The text of a section without its figures."""
    own = re.search(rf'<section id="{section}">(.*?)</section>', page, re.DOTALL)[1]
    return html.unescape(re.sub(r"<[^>]*>", " ", re.sub(r"<svg.*?</svg>", "", own, flags=re.DOTALL)))


def test_16_10_the_answer_comes_first_with_every_digit(page):
    answer = words_of(page, "summary")
    assert page.index('<section id="summary">') < page.index('<section id="model">')
    for question in ("Does it hunt?", "Which gains never hunt?", "What margin?", "stick band", "harmonic"):
        assert question in answer
    for text in ("21.014979770", "26.601949038", "0.0033558345", "P = 40", "factor of 2."):
        assert text in answer
    sections = "summary", "branches", "fold-curve", "relative", "differences"
    told = " ".join(words_of(page, name) for name in sections)
    assert "26.6014 " not in told
    assert "P = 26.601949038" in words_of(page, "fold-curve")
    own = page[page.index('<section id="fold-curve">') :].partition("</section>")[0]
    assert re.findall(r"\(1, 26\.\d+\)", own) == ["(1, 26.601949038)"]  # the one label at beta = 1


def test_16_10_one_letter_is_one_thing(page, folder):
    text = html.unescape(re.sub(r"<[^>]*>", " ", page))
    assert "R(R(d))" in text
    assert not re.search(r"P\((d|0|P)", text)
    symbols = page[page.index('<section id="model">') :]
    assert symbols.index("Symbols</caption>") < symbols.index("Parameters and their values</caption>")
    assert (folder / "map_2.csv").read_text(encoding="utf-8").startswith("d,R(d),R(R(d))")


@pytest.mark.parametrize("what", ["Figure", "Table", "Table A"])
def test_16_10_figures_and_tables_are_numbered_in_order(page, what):
    place = "figcaption" if what == "Figure" else "caption"
    found = re.findall(rf"<{place}><b>{what} ?(\d+)\.", page)
    assert [int(k) for k in found] == list(range(1, len(found) + 1))
    assert len(found) >= 3


def test_16_10_checks_come_before_details_and_long_tables_last(page):
    sections = "summary", "model", "checks", "response", "tables"
    places = [page.index(f'<section id="{name}">') for name in sections]
    assert places == sorted(places)
    longest = max(words_of(page, "branches").count("\n"), words_of(page, "comparison").count("\n"))
    assert words_of(page, "tables").count("\n") > longest


def test_regions_agree_with_their_borders(summary):
    found = summary["regions"]
    borders = {b["name"]: np.array(b["points"]) for b in found["borders"]}
    fold, change = borders["fold of the two cycles"], borders["set changes stability"]
    for y, cycles, calm in zip(found["y"], found["cycles"], found["set_stable"], strict=True):
        end = np.interp(y, fold[:, 1], fold[:, 0])
        edge = np.interp(y, change[:, 1], change[:, 0], left=-np.inf)
        for x, count, rests in zip(found["x"], cycles, calm, strict=True):
            # Left of the edge there is no cycle, or one beyond the interval.
            if min(abs(x - end), abs(x - edge)) > 0.2:
                assert (count > 0) == (x < end) or x < edge
            assert abs(x - edge) < 0.2 or rests == (x > edge)


def test_settings_exist_exactly_where_hunting_can_be_tuned_away(summary):
    found = summary["settings"]
    assert {name: t["best"] is not None for name, t in found.items()} == {
        "β = 2": True, "β = 1": True, "β = 0.5": False, "static + Coulomb": False,
    }  # fmt: skip
    for t in found.values():
        assert t["margin"] > 1.3 if t["best"] else "whatever its gains" in t["reason"]


def test_predictions_beside_exact_cycles(summary):
    found = summary["predictions"]
    assert not any(p["harmonic_balance"] for p in found.values())
    assert len(found["Stribeck, β = 2"]["exact"]) == 2
    assert found["Coulomb"]["exact"] == []
    assert found["Coulomb"]["ratio"] == pytest.approx([0.92562404933] * 2, abs=1e-10)
    (static,) = found["static + Coulomb"]["algebra"]
    assert static == pytest.approx(0.148514224058, abs=1e-11)
    assert found["static + Coulomb"]["exact"] == pytest.approx([static], abs=1e-9)


def test_the_record_gives_the_values_it_was_made_with(summary):
    found = summary["experiment"]
    for name, value in {"Fs": 4, "Fc": 2, "vs": 0.1, "b": 1}.items():
        assert abs(found["values"][name] - value) < 3.5 * found["errors"][name] < 0.01 * value
    assert found["limit"] == pytest.approx(21.0149797699, rel=2e-3)
    assert found["safe"] >= found["limit"]


def test_bristles_fold_early_and_rest(summary):
    found = summary["relative"]["2"]
    # Less than the inclusion's in both, and not by much: the bristles are stiff.
    assert 20.0 < found["fold"]["P"] < 21.0
    assert 0.9 * REFERENCE["2"][1] < found["amplitude"] < REFERENCE["2"][1]
    assert all(probe["rests"] for probe in found["small"])


@pytest.mark.parametrize("resolution", [0.0, 21.0, float("nan")])
def test_resolution_has_bounds(resolution):
    with pytest.raises(UsageError, match="resolution"):
        Effort().finer(resolution)


def test_13_6_every_text_of_a_study_stands_in_its_report(page):
    written = re.sub(r"</?code>", "`", page)
    shown = re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]*>", " ", written)))
    for section, texts in get_study("hunting").texts.items():
        assert section in ORDER or section.startswith("figure ")
        for title, text in texts:
            # The words before the first computed value and after the last one.
            ends = re.split(r"\{|\[\[", text)[0], re.split(r"\}|\]\]", text)[-1]
            missing = [words for words in (title, *ends) if words.strip() not in shown]
            # A quick study follows the smoother model in one case only.
            assert not missing or "relative_fold_1" in text
            assert shown.count(ends[0]) <= 1 or not ends[0]


# -- another study ---------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def belt(tmp_path_factory):
    out = tmp_path_factory.mktemp("belt")
    return made("belt", out), out


def test_13_6_the_belt_needs_a_declaration_of_a_few_lines_only():
    root = Path(__file__).resolve().parent.parent
    assert len((root / "models" / "study" / "belt.py").read_text(encoding="utf-8").splitlines()) < 25


def test_13_6_the_belt_sticks_where_its_slip_comes_back(belt):
    """Stick ends at k x = Fs; the slip from there to the belt's speed by scipy."""
    summary, out = belt
    (point,) = summary["fixed_points"]["1"]
    values = np.array([[v, d[0]] for v, d in summary["cycles"]["1"].items()], dtype=float)
    assert len(values) == 3
    for vb, d in [(0.2, point["d"]), *values.tolist()]:

        def slip(_, x, vb=vb):
            # Fs = 1, Fc = 0.5, vs = 0.1, beta = 1, b = 0.05, m = k = 1, d = 0; v < vb
            w = vb - x[1]
            return [x[1], -x[0] + 0.5 + 0.5 * np.exp(-w / 0.1) + 0.05 * w]

        def back(_, x, vb=vb):
            return x[1] - vb

        back.terminal, back.direction = True, 1
        start = [1.0, vb]
        one = solve_ivp(slip, (0, 40), start, "DOP853", rtol=1e-12, atol=1e-14, events=back, first_step=1e-4)
        assert d == pytest.approx(one.y_events[0][0][0], abs=1e-8)
    assert point["stable"]
    assert summary["orbits"]["1"][0]["amplitude"]["v"] > 0.2
    assert f"{point['d']:.6f}" in (out / "report.html").read_text(encoding="utf-8")


def test_13_6_the_belt_has_the_sections_that_it_asks_for(belt):
    summary, out = belt
    page = (out / "report.html").read_text(encoding="utf-8")
    found = re.findall(r'<section id="([\w-]+)">', page)
    assert found == [
        "summary", "model", "checks", "response", "map", "fixed-points", "bifurcation", "cycles", "branches",
        "classification", "graph", "tables", "stability", "versions",
    ]  # fmt: skip
    assert "They do not apply here" in page
    assert "paper" not in page
    # It has one equilibrium, where the field is smooth.
    assert "no linear part" not in page
    assert "No Routh-Hurwitz bound in vb was found" in page
    assert "says of the equilibria: β = 1: unstable" in page
    assert list(summary)[-1] == "timing"
    assert "experiment" not in summary


@pytest.mark.parametrize(("model", "why"), [("two_blocks", "several surfaces"), ("pendulum", "no section")])
def test_13_6_a_model_that_no_study_fits_is_refused(model, why, tmp_path):
    study = Study(
        name="other", title="t", source="s", model=model, cases=(StudyCase("1", {}, "1"),), parameter="vb",
        values=(0.1, 0.2),
    )  # fmt: skip
    with pytest.raises(UsageError, match=why):
        run_study(study, tmp_path / "out")
    assert not (tmp_path / "out").exists()
