"""The parts of a study's report."""

import re
from pathlib import Path

import numpy as np
import pytest

from filippov.analysis.comparisons.independent import Rule
from filippov.app.report.facts import Facts, Numbers
from filippov.app.report.page import inline_svg, wrapped
from filippov.app.report.part import Chapter, TextTable
from filippov.base.errors import UsageError
from filippov.models.studies import BUILT_IN, get_study, study_names


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


def test_text_is_wrapped():
    text = wrapped("  - " + "word " * 40, width=50)
    assert all(line.startswith("    word") for line in text.splitlines()[1:])
    assert max(map(len, text.splitlines())) <= 50


def test_report_knows_no_model():
    root = Path(__file__).resolve().parent.parent / "filippov" / "app" / "report"
    for path in (*root.glob("*.py"), root / "page.html"):
        # Analyses may be imported whatever they are called.
        lines = path.read_text(encoding="utf-8").splitlines()
        told = "\n".join(line for line in lines if not line.startswith("from filippov."))
        words = set(re.findall(r"[a-z]+", told.lower()))
        assert not words & {"hunting", "friction", "stribeck", "beta", "gain", "karnopp", "switch"}, path


def test_16_10_texts_name_figures_and_tables_by_their_numbers():
    tables = [TextTable("one", ("a",), (), label="one"), TextTable("two", ("a",), (), label="two")]
    numbers = Numbers([Chapter("first", "First", tables)], [Chapter("more", "More", tables[:1])])
    assert numbers["table two"] == ("table 2", "table-two")
    shown = str(numbers.coded("[[Table two]] < `x`"))
    assert shown == '<a href="#table-two">Table 2</a> &lt; <code>x</code>'
    assert ">Table A1</a>" in str(Numbers([], [Chapter("more", "More", tables)]).linked("[[Table one]]"))
    assert numbers["section more"] == ("appendix A", "more")
    assert str(numbers.linked("[[table none]] `x`")) == "[[table none]] `x`"
    texts = ("", "see [[table two]]"), ("", "see [[figure none]]"), ("", "P = {fold_2:.2f}")
    told = numbers.told(texts, Facts())
    assert told == [("", "see [[table two]]")]
