"""Run a study: compute its sections one after the other, write data and figures, the report, its summary."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from filippov.app.report import band, checks, cycles, design, diagram, response, smoother
from filippov.app.report.aside import Aside
from filippov.app.report.case import CaseResults, StudyRun, diagrams
from filippov.app.report.context import Progress
from filippov.app.report.effort import Effort
from filippov.app.report.files import rendered, write
from filippov.app.report.page import document, environment, machine
from filippov.app.report.part import Chapter, Picture, TextTable, Words
from filippov.base.csv_text import csv_text
from filippov.base.given import check_count
from filippov.base.json_text import finite, json_text
from filippov.models.studies import Study, get_study
from filippov.plot.style import style

# Fractions of the whole at which the cases, and all sections, are computed; the rest is drawing.
CASES, COMPUTED = 0.25, 0.85
# Every section in the order of summary.json: its function, the entry of the study that requests it ("" for
# always), and its time, as a fraction of the whole.
SECTIONS: tuple[tuple[Callable[[StudyRun], Chapter], str, float], ...] = (
    (response.model, "", 0), (response.response, "", 0), (response.event_map, "", 0),
    (diagram.fixed_points, "", 0), (diagram.bifurcation, "", 0), (checks.classification, "", 0),
    (checks.stability, "", 0), (response.modes, "", 0.01), (band.comparison, "variants", 0.2),
    (band.approximations, "approximated", 0),
    (cycles.orbits, "", 0.05), (cycles.branches, "", 0), (cycles.fold_curve, "ending", 0.1),
    (cycles.region_map, "plane", 0.08), (design.settings, "tuned", 0.15), (design.prediction, "laws", 0.05),
    (design.experiment, "experiment", 0.05), (smoother.relative, "relative", 0.3), (checks.checks, "", 0),
)  # fmt: skip
# Sections made from parts that another process may still be computing when the others are done.
LATE = (design.settings, design.experiment, smoother.relative)
# The order of the sections in the report, and those of the appendix.
ORDER = (
    "summary", "model", "checks", "settings", "comparison", "approximations", "relative", "prediction",
    "experiment", "response", "map", "fixed-points", "bifurcation", "cycles", "branches", "fold-curve",
    "regions", "classification", "graph", "differences",
)  # fmt: skip
APPENDIX = ("stability", "versions")


def run_study(
    study: str | Study, output: str | Path, *, progress: Progress | None = None, quick: bool = False,
    resolution: float = 1.0, jobs: int = 1,
) -> dict[str, Any]:  # fmt: skip
    """Run a study, a name or a declaration, into a folder and return its summary.

    progress  called with (done, all, what)
    quick     coarser, for a trial run
    resolution   factor of the number of points in maps, diagrams, searches, 0.1 to 20
    jobs      processes that a study of the package is computed with; a script that asks for more than one
              needs the guard `if __name__ == "__main__":`

    Writes report.html, summary.json, figures as SVG and PNG, data as CSV. Raises UsageError for an
    unknown name, ImportError without matplotlib or jinja2.
    """
    since, folder = time.perf_counter(), Path(output)
    os.environ.setdefault("MPLBACKEND", "Agg")
    environment()  # without jinja2 or matplotlib, fail now and not at the end
    with style():
        pass
    asked = get_study(study) if isinstance(study, str) else study
    effort = (Effort.quick() if quick else Effort()).finer(resolution)
    with Aside(asked, effort, check_count("jobs", jobs)) as aside:
        run = StudyRun(asked, effort, progress, aside)
        aside.begin(diagrams, range(1, len(asked.cases)))
        aside.begin(band.compared, range(1 if asked.variants else 0))
        aside.begin(smoother.followed, range(len(asked.cases[: effort.relatives]) if asked.relative else 0))
        aside.begin(design.estimated, range(1 if asked.experiment else 0))
        aside.begin(design.tuned, range(len(asked.tuned)))
        sections, pictures = compute(run)
    folder.mkdir(parents=True, exist_ok=True)
    for section in sections:
        for file, columns, rows in section.files:
            write(folder / file, csv_text(columns, rows))
    for name, (vector, raster) in pictures.items():
        write(folder / f"{name}.svg", vector)
        write(folder / f"{name}.png", raster)
    run.timing["total"] = time.perf_counter() - since
    summary = {name: entry for section in sections for name, entry in section.summary.items()}
    summary["timing"] = {name: round(seconds, 4) for name, seconds in run.timing.items()}
    plain: dict[str, Any] = finite(summary)
    write(folder / "summary.json", json_text(plain))
    known = {section.anchor: section for section in [*sections, *_frame(run)]}
    main, appendix = ([known[name] for name in names if name in known] for names in (ORDER, APPENDIX))
    drawings = {name: vector for name, (vector, _) in pictures.items()}
    page = document(asked.title, f"After {asked.source}", main, asked.texts, drawings, appendix)
    write(folder / "report.html", page)
    run.tell(1.0, "done")
    return plain


def compute(run: StudyRun) -> tuple[list[Chapter], dict[str, tuple[str, bytes]]]:
    """Every section that the study requests, in order, and their figures by name.

    Figures are drawn while another process computes the data of the last sections.
    """
    share = CASES / len(run.study.cases)
    for k, case in enumerate(run.study.cases):
        run.cases.append(CaseResults(run, case, k * share, (k + 1) * share))
    asked = [(make, part) for make, name, part in SECTIONS if not name or getattr(run.study, name)]
    whole, done = sum(part for _, part in asked), 0.0
    made: dict[Callable[[StudyRun], Chapter], Chapter] = {}
    pictures: dict[str, tuple[str, bytes]] = {}
    for late in (False, True):
        for make, part in asked:
            if (make in LATE) == late:
                done += part
                run.until = CASES + (COMPUTED - CASES) * done / whole
                made[make] = make(run)
        with run.stage("figures", 1.0 if late else run.until):
            for section in made.values():
                for picture in section.parts:
                    if isinstance(picture, Picture) and picture.name not in pictures:
                        run.tell(0.0, f"figure {picture.name}")
                        pictures[picture.name] = rendered(picture.draw())
    out = [made[make] for make, _ in asked]
    if not run.study.stated:
        out = [
            replace(section, parts=[p.unstated() if isinstance(p, TextTable) else p for p in section.parts])
            for section in out
        ]
    return out, pictures


def _frame(run: StudyRun) -> list[Chapter]:
    """The sections around the computed ones: what was found, what differs from the source, versions."""
    files = Words("source", (
        f"Source of everything on this page: `filippov study {run.study.name}`. The figures are beside it as "
        "SVG and PNG, the numbers as CSV and in summary.json."
    ))  # fmt: skip
    seconds = tuple((name, f"{value:.2f}") for name, value in run.timing.items())
    return [
        Chapter("summary", "The answer", [files]),
        Chapter("differences", "What differs from the paper, and why"),
        Chapter("versions", "Versions, machine, time", [
            TextTable("Versions and machine", ("what", "value"), tuple(machine().items()), label="machine"),
            TextTable("Time", ("stage", "seconds"), seconds, label="time"),
        ]),
    ]  # fmt: skip
