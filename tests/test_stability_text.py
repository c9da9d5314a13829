"""What the stability report says and how: parts of sets, angles, real domains, numbers, LaTeX."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.mathtext import MathTextParser

from filippov import Abs, Max, Min, Surface, System, parameters, sign, sin, sqrt, states
from filippov.analysis.algebra.number_text import plain, tex, tex_name
from filippov.analysis.local_stability.stability import stability_report
from filippov.analysis.steady.equilibria import equilibria
from filippov.analysis.steady.linearisation import characteristic_polynomial
from filippov.models import registry

x, v, w = states("x v w")


# -- parts of a set ----------------------------------------------------------------------------------------


def test_12_2_a_kink_in_a_stick_set_is_no_end_of_it() -> None:
    """A spring stiffer on one side: slip begins at s = -1 and s = 1 only, with the stiffness there."""
    report = stability_report(System({x: v, v: -x - Max(x, 0) - sign(v)}))
    assert [i.equilibrium.mode for i in report.items] == ["+0", "-0"]
    for item in report.items:
        found = {side: case.polynomial[-1] for case in item.cases for side in case.sides}
        assert found == {"+": 1, "-": 2}  # v > 0 follows s = 1, that is x = -1
        assert all(all(j == 0 for j in case.linearisation.jump) for case in item.cases)
        assert item.answer == "asymptotically stable"


@pytest.mark.parametrize(("outer", "answer"), [(-3, "unstable"), (1, "asymptotically stable")])
def test_12_2_the_far_end_decides_for_both_parts(outer: int, answer: str) -> None:
    """For x > 0 the spring turns into one that pushes away: motions leave from the end there."""
    system = System({x: v, v: -2 * x + (2 - outer) * Max(x, 0) - sign(v)})
    assert {i.answer for i in stability_report(system).items} == {answer}


@settings(max_examples=6, deadline=None)
@given(side=st.sampled_from([-1, 1]), size=st.floats(0.1, 2))
def test_12_2_one_side_that_leaves_makes_the_set_unstable(side: int, size: float) -> None:
    """Friction that falls with an infinite slope for one sign of v only: v' >= C v^(1/2) from its end."""
    fall = round(size, 2) * sqrt(Abs(v)) * (side + sign(v)) / 2
    assert [i.answer for i in stability_report(System({x: v, v: -x - sign(v) + fall})).items] == ["unstable"]


# -- angles and real domains -------------------------------------------------------------------------------


def test_12_2_roots_beyond_one_turn_are_said() -> None:
    found = equilibria(System({x: sin(x) + 0.5}))
    assert [p.x[0] for p in found.points] == [-sympy.pi / 6, 7 * sympy.pi / 6]
    assert any("2*pi" in note and "one turn" in note for note in found.notes)
    assert not equilibria(System({x: -x})).notes


def test_12_2_a_set_is_listed_where_it_is_real() -> None:
    """The circle x^2 + v^2 = 1, at rest in v: both halves for |v| <= 1."""
    found = stability_report(System({x: 1 - x**2 - v**2, v: 0 * v}))
    assert sorted(i.equilibrium.bounds for i in found.items) == [((-1.0, 1.0),)] * 2
    for item in found.items:
        at = item.equilibrium.at(0.3)
        assert all(q.is_real for q in at)
        assert item.interior == ("asymptotically stable" if at[0] > 0 else "unstable")


def test_12_2_a_polynomial_of_roots() -> None:
    """det(s - A) where the entries are roots, which sympy cannot order."""
    q = sympy.sqrt(1 - v**2)
    A = sympy.Matrix([[-2 * q, 1, 0], [0, q, q], [1, 0, 0]])
    c = [e.subs(v, sympy.Rational(3, 5)) for e in characteristic_polynomial(A)]
    expected = np.poly(np.array(A.subs(v, sympy.Rational(3, 5)).tolist(), dtype=float))
    assert np.array(c, dtype=float) == pytest.approx(expected)


@pytest.mark.parametrize(("a", "b", "c"), [(9, 5, -2), (-3, 2, 0)])
def test_12_2_fields_undefined_beyond_a_surface_have_a_report(a: int, b: int, c: int) -> None:
    """A root of |x| beside a cubic, found numerically: 0 is an equilibrium with an infinite slope."""
    root = b * sqrt(Abs(x)) * sign(x) / 5
    second = c * v * Abs(v) / 5 + Abs(v) / 5 + 3 * Max(0, x) / 5
    system = System({x: -4 * v**3 / 5 + a * x / 5 - root, v: second})
    assert "Verdict: " in stability_report(system, budget=4.0).to_text()


def test_12_9_a_search_that_was_stopped_says_so_in_its_verdict() -> None:
    system = System({x: v, v: sin(3 * x) + x / 2 - v / 5 + 1})
    text = stability_report(system, budget=1e-3).to_text()
    assert "Verdict: no equilibrium was found. The search was stopped before its end." in text
    assert "stopped" not in stability_report(System({x: -x})).to_text()


RESTS = {
    "dh/dt depends on the sign": ({x: v + sign(w) / 10, v: -1, w: -w}, x, "+", {v: -v / 2}),
    "h has a kink": ({x: v, v: -x}, 1 - Abs(x), "+", {v: -v / 2}),
    "the reset depends on signs": ({x: v, v: -1, w: -w}, x, "+", {v: -v / 2, w: w - sign(w) * v}),
    "it acts on both sides": ({x: v, v: -1}, x, "both", {v: -v / 2}),
    "the field jumps across": ({x: v, v: -1 - sign(x)}, x, "+", {v: -v / 2}),
}
NO_RESTS = {
    "friction": ({x: v, v: -2 - sign(v)}, x, {v: -v / 2}),
    "a relay beside it": ({x: v, v: -2 - sign(w), w: -w}, x, {v: -v / 2}),
    "a reset that leaves the surface": ({x: 1 - x + sign(w), w: -w}, 1 - x, {x: 0}),
    "a switch": ({x: w - x, w: 0 * w}, x - 1, {w: -1}),
}


@pytest.mark.parametrize("why", RESTS)
def test_12_2_rest_on_a_surface_that_has_no_contact_is_not_searched_and_the_report_says_so(why: str) -> None:
    field, h, side, after = RESTS[why]
    report = stability_report(System(field, surfaces=[Surface("floor", h, side=side, reset=after)]))
    assert any(why in note and "'floor'" in note for note in report.notes)
    assert not report.complete
    assert report.to_dict()["complete"] is False
    assert "Not complete: see the notes" in report.to_text().splitlines()[3]


@pytest.mark.parametrize("case", NO_RESTS)
def test_12_2_a_derived_contact_and_resets_without_rest_need_no_such_note(case: str) -> None:
    field, h, after = NO_RESTS[case]
    report = stability_report(System(field, surfaces=[Surface("floor", h, reset=after)]))
    assert report.complete
    assert "complete" not in report.to_text()


def test_12_2_contacts_of_plain_functions_are_not_searched_and_the_result_says_so() -> None:
    floor = Surface("floor", lambda t, x, p: x[0], reset=lambda t, x, p: [x[0], -x[1] / 2], contact=True)
    found = equilibria(System(field=lambda t, x, p, s: [x[1], -1.0], surfaces=[floor], states="y v"))
    assert not found.complete
    assert "at rest on 'floor'" in found.notes[-1]


@pytest.mark.parametrize("imax", [2.0, -2.0])
def test_12_7_branches_that_the_assumed_signs_of_parameters_exclude_are_not_printed(imax: float) -> None:
    p = parameters(imax=imax, g=3, k=1)
    limited = {v: -p.k * w - v + Max(0, Min(p.imax, p.g * w)), w: -v}
    report = stability_report(System(limited))
    text = report.to_text() + report.to_latex()
    assert "Select" not in text
    assert f"imax {'>' if imax > 0 else '<'} 0" in text
    clipped = stability_report(System({x: -x + Max(0, p.imax)}))
    (item,) = clipped.items
    assert item.equilibrium.x == ((p.imax if imax > 0 else 0),)


def test_12_7_a_branch_that_signs_do_not_decide_is_printed_as_one() -> None:
    p = parameters(g=3, k=1)
    report = stability_report(System({x: -x + Max(p.g - p.k, 0)}))
    assert "Select" not in report.to_text() + report.to_latex() + report.to_markdown()
    assert "x = Piecewise((" in report.to_text()
    assert "True))" in report.to_text()
    assert r"\begin{cases}" in report.to_latex()


# -- numbers -----------------------------------------------------------------------------------------------


@given(st.integers(1, 9999), st.integers(0, 4))
def test_12_numbers_are_printed_as_they_were_written(digits: int, places: int) -> None:
    number = digits / 10**places
    text = plain(True)(sympy.Rational(repr(number)) * x)
    assert text in {f"{number}*x", f"{int(number)}*x", "x", "1.0*x"} or text == f"{number:g}*x"


def test_12_numbers_in_a_report() -> None:
    text = stability_report(System({x: v, v: -0.2 * x - 0.3 * v - 0.1 * sign(v)})).to_text()
    assert "p(lambda) = lambda**2 + 0.3*lambda + 0.2" in text
    fractions = stability_report(System({x: v, v: -x / 5 - 3 * v / 10})).to_text()
    assert "p(lambda) = lambda**2 + 3/10*lambda + 1/5" in fractions
    assert not re.search(r"\d{12,}", text + fractions)
    assert plain(False)(sympy.Rational(4330127018922193, 5000000000000000)) == "0.8660254038"
    assert plain(True)(sympy.sqrt(x) / 5) == "0.2*sqrt(x)"


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("x1", "x_{1}"), ("Fs", "F_{s}"), ("beta", r"\beta"), ("omega_n", r"\omega_{n}"), ("v", "v"),
        ("alpha2", r"\alpha_{2}"), ("x_1", "x_{1}"), ("mass", r"m_{\mathrm{ass}}"), ("k_12", "k_{12}"),
    ],
)  # fmt: skip
def test_12_names_have_subscripts(name: str, expected: str) -> None:
    assert tex_name(name) == expected
    assert tex(False)(2 * sympy.Symbol(name)) == f"2 {expected}"


def test_12_what_no_page_holds_is_counted() -> None:
    """(x + v + w + 1)^k has binomial(k + 3, 3) terms; what stands beside a large part is still printed."""
    small, large = (sympy.expand((x + v + w + 1) ** k) for k in (5, 20))
    assert "[formula of" not in plain(True)(small)
    both = sympy.And(x > 0, large > 0)
    for e in (large, sympy.Gt(x * large, 0), large**2 * v, both, sympy.Interval(0, large)):
        text, formula = plain(True)(e), tex(True)(e)
        assert text.count("[formula of ") == 1
        assert len(text) < 100
        assert not broken(f"${formula}$")
        leaves = int(text.split("[formula of ")[1].split()[0])
        assert str(leaves) in formula
        assert math.comb(23, 3) < leaves < 10 * math.comb(23, 3)
    assert "*x > 0" in plain(True)(x * large > 0)
    assert plain(True)(both).count(" > 0") == 2


# -- every model -------------------------------------------------------------------------------------------


def broken(document: str) -> list[str]:
    """What LaTeX would stop at: braces, dollars, environments, and formulas that mathtext cannot set."""
    out = []
    parser = MathTextParser("path")
    plain_part = re.sub(r"\\[{}$%&#_]", "", document)
    for opening, closing in (("{", "}"),):
        if plain_part.count(opening) != plain_part.count(closing):
            out.append(f"{opening}{closing}")
    if plain_part.count("$") % 2:
        out.append("$")
    begun, ended = (re.findall(rf"\\{word}{{(\w+\*?)}}", document) for word in ("begin", "end"))
    if sorted(begun) != sorted(ended):
        out.append(f"{begun} {ended}")
    text = re.sub(r"\\\[.*?\\\]", "", plain_part, flags=re.DOTALL)
    for k, part in enumerate(re.split(r"\$", text)):
        if k % 2 == 0:
            if re.search(r"(?<!\\)[_^]", part):
                out.append(f"outside a formula: {part[:60]!r}")
        elif r"\begin" not in part:
            try:
                parser.parse(f"${part}$")
            except ValueError as error:
                out.append(f"{part[:80]!r}: {str(error)[:80]}")
    return out


@pytest.mark.parametrize("name", registry.names())
def test_12_every_model_has_verdict_first_and_latex_that_compiles(name: str) -> None:
    report = stability_report(registry.get(name).build(), budget=5.0)
    assert "Verdict" in report.to_text() or not report.items
    lines = [line for line in report.to_text().splitlines() if line.strip("= ")]
    assert lines[0] == "Stability"
    assert lines[1].startswith("Verdict: ")
    document = report.to_latex()
    assert not broken(document)
    formulas = " ".join(re.findall(r"\$([^$]*)\$", document))
    letters = re.sub(r"\\[a-zA-Z]+", " ", formulas)
    assert not re.search(r"(?<![\\a-zA-Z{])[A-Za-z]{3,}(?![a-zA-Z]*[{}])", letters)
    assert not re.search(r"\d{13,}", report.to_text())
    assert max(len(line) for line in report.to_text().splitlines()) < 20_000


def test_12_the_check_of_latex_sees_what_is_broken() -> None:
    for bad in (r"$\frac{1}{2$", "a_b", r"\begin{array}", "$x", r"$\nosuchcommand{x}$"):
        assert broken(bad)
    assert not broken(r"\section{A\_b} $x_{1} + \frac{\beta}{2}$")


def test_12_the_file_of_latex_is_a_document() -> None:
    report = stability_report(registry.get("belt").build())
    head, body = report.to_latex(document=True).split("\\begin{document}\n")
    assert head.splitlines() == [r"\documentclass{article}", r"\usepackage{amsmath,amssymb}"]
    assert body == report.to_latex().rstrip() + "\n\\end{document}\n"


def test_12_names_of_states_are_formulas_in_latex() -> None:
    x1, x2 = states("x1 x2")
    p = parameters(Fs=2.0, k_p=3.0)
    document = stability_report(System({x1: x2, x2: -p.k_p * x1 - p.Fs * sign(x2)})).to_latex()
    assert "$x_{1}$ = " in document
    assert "F_{s}" in document
    assert "k_{p}" in document


def test_12_sets_of_one_kind_are_told_apart_and_s_is_the_multiplier_alone() -> None:
    """A pendulum with friction rests about 0 and about pi: one line tells which of the sets is stable."""
    q, w = states("q w")
    report = stability_report(System({q: w, w: -sympy.sin(q) - 0.1 * sign(w)}))
    line = next(part for part in report.to_text().splitlines() if part.startswith("Verdict: "))
    low, high = math.pi - math.asin(0.1), math.pi + math.asin(0.1)
    assert f"between ({low:.6g}, 0) and ({high:.6g}, 0): unstable" in line
    assert line.count("set of equilibria") == 2
    stable = re.findall(r"between \(([-.\d]+), 0\) and \(([-.\d]+), 0\): asymptotically stable", line)
    assert [sorted(map(float, ends)) for ends in stable] == [pytest.approx([-0.100167, 0.100167], abs=1e-6)]
    assert "s in [-1, 1]" in report.to_text()
    assert not re.search(r"p\(s\)|s\^\d|\bs\*\*", report.to_text())
