"""The sections of the report on a study's findings: (anchor, title, parts)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from filippov.app.report import finding_tables as tables
from filippov.app.report.facts import facts
from filippov.app.report.html import paragraph, table
from filippov.app.report.results import Results
from filippov.app.report.tables import Table

Drawn = Callable[[str, str, str, str, str], str]
Section = tuple[str, str, list[str]]


def cycle_sections(results: Results, drawn: Drawn) -> list[Section]:
    """Cycles, branches, their end, regions; a section that was not asked is empty."""
    name, parameter = results.model.name, results.study.parameter
    asked = results.study.questions
    second = asked.ending.parameter if asked.ending else ""
    up = asked.plane.parameter if asked.plane else ""
    return [
        _section(
            results, "cycles", "Limit cycles", tables.cycles(results),
            drawn("cycles", "The limit cycles", f"`filippov orbit {name} --x0 ...`", "", ""),
        ),
        _section(
            results, "branches", f"Branches of cycles over {parameter}", tables.branches(results),
            drawn("branches", f"Cycles over {parameter}, followed through the fold",
                  f"`filippov continue {name} --parameter {parameter} ...`", "", ""),
        ),
        _section(
            results, "fold_curve", f"The fold over {second}", tables.fold_curve(results),
            drawn(
                "fold_curve", f"The fold in {parameter} and {second}", "filippov.analysis.bifurcations.curve",
                "", "",
            ),
        ),
        _section(
            results, "regions", f"Regions of {parameter} and {up}", [],
            drawn("regions", f"Number of cycles over {parameter} and {up}",
                  f"`filippov regions {name} --x {parameter}=... --y {up}=...`", "", ""),
        ),
    ]  # fmt: skip


def design_sections(results: Results, drawn: Drawn) -> list[Section]:
    """Settings, predictions, the experiment."""
    name = results.model.name
    return [
        _section(
            results, "settings", "Settings without cycles", tables.settings(results),
            drawn("settings", "Largest ratio of successive excursions, best settings and their margin",
                  f"`filippov tune {name} --ranges ...`", "", ""),
        ),
        _section(
            results, "prediction", "Harmonic balance and algebra beside the exact cycles",
            tables.predictions(results),
            drawn("prediction", "Growth rate and frequency by harmonic balance, and the exact cycles",
                  f"`filippov describing-function {name}`", "", ""),
        ),
        _section(
            results, "experiment", "Parameters from a record", tables.experiment(results),
            drawn("experiment", "Record, fit, residual and the estimated curve",
                  "`filippov identify record.csv ...`", "", ""),
        ),
    ]  # fmt: skip


def relative_section(results: Results, drawn: Drawn) -> Section:
    """The smoother model."""
    asked = results.study.questions.relative
    name = asked.name if asked else ""
    return _section(
        results, "relative", f"{name} beside the inclusion", tables.relative(results),
        drawn("relative", f"Cycles of {name} over those of the inclusion",
              "filippov.analysis.bifurcations.continuation of an orbit of the model", "", ""),
    )  # fmt: skip


def _section(results: Results, anchor: str, title: str, content: Sequence[Table], picture: str) -> Section:
    known = facts(results)
    texts = [text.format_map(known) for text in results.study.questions.notes.get(anchor, ())]
    # A quick study does not compute all that a paragraph may speak of.
    told = [paragraph(text) for text in texts if "(not computed)" not in text]
    shown = [part for part in (picture, *(table(t) for t in content)) if part]
    return anchor.replace("_", "-"), title, [*told, *shown] if shown else []
