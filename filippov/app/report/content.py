"""The sections of the report, in order: text, figures and tables of the results."""

from __future__ import annotations

from collections.abc import Mapping

from filippov.app.report import tables
from filippov.app.report.facts import facts
from filippov.app.report.finding_sections import cycle_sections, design_sections, relative_section
from filippov.app.report.html import (
    definitions,
    figure,
    page,
    paragraph,
    preformatted,
    section,
    source,
    table,
)
from filippov.app.report.results import CaseResult, Results


def document(results: Results, drawings: Mapping[str, str]) -> str:
    """The whole page; `drawings` are SVG texts by name."""
    made = _Content(results, drawings)
    parts = [
        ("summary", "Summary", made.summary()),
        ("model", "The model", made.model()),
        ("response", "Time response and phase portrait", made.response()),
        ("map", "Event map and iterates", made.maps()),
        ("fixed-points", "Fixed points of the second iterate", made.fixed_points()),
        ("bifurcation", f"Bifurcation in {made.parameter}", made.bifurcation()),
        *cycle_sections(results, made.drawn),
        ("classification", "Classification", [table(tables.classes(results))]),
        ("stability", "Stability report", made.stability()),
        ("graph", "Modes and transitions", made.graph()),
        ("comparison", "Comparison with band models", made.comparison()),
        relative_section(results, made.drawn),
        *design_sections(results, made.drawn),
        ("checks", "Independent checks", [table(tables.checks(results)), table(tables.exactness(results))]),
        ("differences", "What differs from the paper, and why", [definitions(made.differences())]),
        (
            "versions",
            "Versions, machine, time",
            [table(tables.machine(results)), table(tables.timing(results))],
        ),
    ]
    built = [(anchor, title, section(anchor, title, content)) for anchor, title, content in parts if content]
    return page(results.study.title, f"After {results.study.source}", built)


class _Content:
    def __init__(self, results: Results, drawings: Mapping[str, str]) -> None:
        self.results, self.study, self.drawings = results, results.study, drawings
        self.facts = facts(results)
        self.name = results.model.name
        self.parameter = results.study.parameter

    def summary(self) -> list[str]:
        """What was found, in words, and where the files are."""
        told = [paragraph(text.format_map(self.facts)) for text in self.study.summary]
        files = (
            f"Source of everything on this page: `filippov study {self.study.name}`. The figures are beside "
            "it as SVG and PNG, the numbers as CSV and in summary.json."
        )
        return [*told, source(files)]

    def model(self) -> list[str]:
        """Parameters and the constitutive curve."""
        (name, title), made = self.study.curve_title, self.study.curve
        return [
            table(tables.parameters(self.results)),
            self.drawn(name, title, f"{made.__module__}.{made.__name__}, curve_*.csv."),
        ]

    def response(self) -> list[str]:
        """The response and the phase portrait of the main case."""
        main = self.results.main
        command = f"`filippov simulate {self.name} {self.given(main)} --rtol 1e-10`"
        start = ", ".join(f"{v:g}" for v in self.study.x0)
        return [
            self.drawn(
                f"response_{main.case.slug}",
                f"Time response from ({start}), {main.case.label}",
                command,
                "response",
            ),
            self.drawn(
                f"phase_{main.case.slug}",
                f"Phase portraits of the same response, {main.case.label}",
                command,
                "phase",
            ),
        ]

    def maps(self) -> list[str]:
        """The map with the iterates of the response."""
        main = self.results.main
        section = self.results.model.section
        lift = ", ".join(f"{k} = {v}" for k, v in section.lift.items()) if section else ""
        text = (
            f"P(d) is the {section.coordinate} of the next {section.kind} of a motion that starts on the "
            "section at d: "
            f"{lift}." if section else ""
        )  # fmt: skip
        caption = (
            f"The orbit starts at the first rest of the time response, d = {main.orbit[0]:.6f}; its "
            f"{len(main.orbit) - 1} iterates and the rests of the response differ by at most "
            f"{main.exactness.iterates:.1e}."
        )
        command = f"`filippov event-map {self.name} {self.given(main)} --start {main.orbit[0]:.12g}`"
        return [
            paragraph(text),
            self.drawn(
                f"map_{main.case.slug}", f"The event map and the iterates of the response, {main.case.label}",
                command, text=caption,
            ),
        ]  # fmt: skip

    def fixed_points(self) -> list[str]:
        """The second iterate of every case, and the tables."""
        shown = [
            self.drawn(
                f"second_{c.case.slug}", f"P(P(d)), {c.case.label}",
                f"`filippov event-map {self.name} {self.given(c)} --order {self.study.order}`",
                text=_in_words(c),
            )
            for c in self.results.cases
        ]  # fmt: skip
        return [*shown, table(tables.fixed_points(self.results)), table(tables.basins(self.results))]

    def bifurcation(self) -> list[str]:
        """The diagrams and where they change."""
        low, high = self.study.values[0], self.study.values[-1]
        shown = [
            self.drawn(
                f"bifurcation_{c.case.slug}", f"Fixed points over {self.parameter}, {c.case.label}",
                f"`filippov bifurcation {self.name} {self.given(c)} --parameter {self.parameter} --values "
                f"{low:g} {high:g} --count {len(c.diagram.values)}`",
                text=self.bound_in_words(c),
            )
            for c in self.results.cases
        ]  # fmt: skip
        return [*shown, table(tables.places(self.results))]

    def bound_in_words(self, case: CaseResult) -> str:
        """Where the analytic bound is."""
        if case.bound is None:
            return (
                "There is no Routh-Hurwitz bound: the field beside the set has no linear part at the surface."
            )
        low, high = case.diagram.values[0], case.diagram.values[-1]
        inside = "the dash-dotted line" if low <= case.bound <= high else "outside the range shown"
        return f"The Routh-Hurwitz bound is {self.parameter} = {case.bound:g}, {inside}."

    def stability(self) -> list[str]:
        """The report of the main case whole; it holds all regimes of the exponent."""
        main = self.results.main
        text = (
            "Equilibria, one-sided linearisation, Routh arrays and conditions as the program derives them "
            f"from the equations, at {main.case.label}; the cases of exponents are told apart by it. "
            "Verdicts: "
            + "; ".join(f"{c.case.label}: {i.answer}" for c in self.results.cases for i in c.stability.items)
            + "."
        )  # fmt: skip
        command = f"Source: `filippov stability {self.name} {self.given(main)} --solve-for {self.parameter}`"
        return [paragraph(text), preformatted(main.stability.to_text()), source(command)]

    def graph(self) -> list[str]:
        """What the system can do and what it did."""
        main = self.results.main
        word = f"Mode word of the end of the response: {main.word}." if main.word else ""
        return [
            self.drawn(
                "graph", "Transitions that the system can make, with their guards",
                f"`filippov graph {self.name}`",
            ),
            self.drawn("modes", f"Transitions that the response made, {main.case.label}",
                       f"`filippov graph {self.name} --kind observed {self.given(main)}`", text=word),
        ]  # fmt: skip

    def comparison(self) -> list[str]:
        """The band models; nothing where none was compared."""
        content = tables.comparison(self.results)
        if content is None or self.results.comparison is None:
            return []
        out = [
            self.drawn(
                "comparison", "Band models against the inclusion", content.source.removeprefix("Source: ")
            )
        ]
        trends = "\n".join(t.sentence for t in self.results.comparison.trends)
        return [
            *out,
            table(content),
            paragraph("How the differences go with the width of the band:"),
            preformatted(trends),
        ]

    def differences(self) -> list[tuple[str, str]]:
        """Titles with their texts."""
        return [(title, text.format_map(self.facts)) for title, text in self.study.differences]

    def given(self, case: CaseResult) -> str:
        """The case's parameters as flags."""
        return " ".join(f"-p {name}={value:g}" for name, value in case.case.parameters.items())

    def drawn(self, name: str, title: str, origin: str, caption: str = "", text: str = "") -> str:
        """A figure; nothing where it could not be drawn."""
        if name not in self.drawings:
            return ""
        words = text or self.study.captions.get(caption or name, "")
        return figure(name, self.drawings[name], title, words, f"Source: {origin}")


def _in_words(case: CaseResult) -> str:
    """The fixed points in a sentence."""
    found = [f"d = {q.d:.6g} ({'stable' if q.stable else 'unstable'} {q.kind})" for q in case.fixed]
    notes = [q.note for q in case.fixed if q.note]
    return f"Fixed points: {', '.join(found)}." + "".join(f" {n[0].upper()}{n[1:]}." for n in notes)
