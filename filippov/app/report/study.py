"""Run a study: compute, write data and figures, the report and its summary."""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from filippov.analysis.comparisons.band_model import BandModel
from filippov.analysis.comparisons.comparison import compare
from filippov.analysis.comparisons.comparison_result import Comparison
from filippov.app.report.compute import Subject, case_result
from filippov.app.report.content import document
from filippov.app.report.effort import Effort
from filippov.app.report.facts import summary
from filippov.app.report.figures import figures
from filippov.app.report.files import data_files, save_figure, write, write_csv
from filippov.app.report.questions import findings
from filippov.app.report.results import Results
from filippov.base.json_text import json_text
from filippov.graphs.graph import possible_graph
from filippov.models import registry
from filippov.models.studies import Study, get_study
from filippov.plot.style import style

Progress = Callable[..., object]
# Shares of the whole: cases, comparison, questions; the rest is writing.
CASES, COMPARED, ASKED = 0.25, 0.4, 0.85
PACKAGES = ("filippov", "numpy", "scipy", "sympy", "networkx", "llvmlite", "matplotlib")


def run_study(
    name: str, output: str | Path, *, progress: Progress | None = None, quick: bool = False,
    resolution: float = 1.0,
) -> dict[str, Any]:  # fmt: skip
    """Run a study into a folder and return its summary.

    progress  called with (done, all, what)
    quick     coarser, to see whether it works
    resolution   factor of the number of points in maps, diagrams, searches, 0.1 to 20

    Writes report.html, summary.json, figures as SVG and PNG, data as CSV. Raises UsageError for an
    unknown name, ImportError without matplotlib.
    """
    since, folder = time.perf_counter(), Path(output)
    tell = _teller(progress)
    os.environ.setdefault("MPLBACKEND", "Agg")
    with style():  # without matplotlib this is the time to say so, not the end
        pass
    study = get_study(name)
    effort = (Effort.quick() if quick else Effort()).finer(resolution)
    results = compute(study, effort, tell)
    folder.mkdir(parents=True, exist_ok=True)
    for file, columns, rows in data_files(results):
        write_csv(folder / file, columns, rows)
    drawings, begun = {}, time.perf_counter()
    todo = figures(results)
    for k, (file, draw) in enumerate(todo.items()):
        tell(ASKED + (1 - ASKED) * k / len(todo), f"figure {file}")
        drawings[file] = save_figure(folder, file, draw())
    results.timing["figures"] = time.perf_counter() - begun
    results.timing["total"] = time.perf_counter() - since
    found = summary(results)
    write(folder / "summary.json", json_text(found))
    write(folder / "report.html", document(results, drawings))
    tell(1.0, "done")
    return found


def compute(study: Study, effort: Effort, tell: Callable[[float, str], None]) -> Results:
    """Everything that is computed; the cases one after the other, then the comparison."""
    model = registry.get(study.model)
    subject = Subject.of(study, model)
    timing: dict[str, float] = {}
    cases = []
    for k, case in enumerate(study.cases):
        low, share = CASES * k / len(study.cases), CASES / len(study.cases)

        def within(fraction: float, what: str, low: float = low, share: float = share) -> None:
            tell(low + share * fraction, what)

        cases.append(case_result(subject, case, effort, within, timing, time.perf_counter))
    begun = time.perf_counter()
    graph = possible_graph(subject.system)
    timing["possible transitions"] = time.perf_counter() - begun
    begun = time.perf_counter()
    compared = _compared(subject, effort, tell)
    if compared is not None:
        timing["comparison"] = time.perf_counter() - begun
    def asking(fraction: float, what: str) -> None:
        tell(COMPARED + (ASKED - COMPARED) * fraction, what)

    found = findings(subject, cases, effort, asking, timing)
    return Results(study, model, subject.system, tuple(cases), graph, compared, timing, _machine(), found)


def _compared(subject: Subject, effort: Effort, tell: Callable[[float, str], None]) -> Comparison | None:
    study = subject.study
    if not study.variants:
        return None

    def within(done: int, total: int, what: str = "") -> None:
        tell(CASES + (COMPARED - CASES) * done / total, f"comparison: {what}")

    few = slice(None) if effort.widths == 1 else slice(1)
    bands = [
        BandModel(v.name, v.build, v.stick, {k: values[few] for k, values in v.options.items()})
        for v in study.variants
    ]
    return compare(
        subject.system, subject.section, bands, widths=study.widths[:: effort.widths], comparators=(),
        interval=subject.interval, order=study.order, x0=study.x0, parameters=study.cases[0].parameters,
        repeats=1 if effort.widths > 1 else 3,
        progress=within,
    )  # fmt: skip


def _teller(progress: Progress | None) -> Callable[[float, str], None]:
    def tell(fraction: float, what: str) -> None:
        if progress is not None:
            progress(fraction, 1.0, what)

    return tell


def _machine() -> dict[str, str]:
    out = {
        "Python": platform.python_version(), "system": platform.platform(), "processor": _processor(),
        "cores": str(os.cpu_count()),
    }  # fmt: skip
    for name in PACKAGES:
        try:
            out[name] = version(name)
        except PackageNotFoundError:
            out[name] = "not installed"
    return out


def _processor() -> str:
    """The processor's name where the system tells it."""
    try:
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()
