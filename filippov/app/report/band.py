"""Models with a band in place of the surface, compared with the inclusion."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from filippov.analysis.comparisons.band_model import BandModel
from filippov.analysis.comparisons.comparison import compare_sections
from filippov.analysis.comparisons.comparison_result import Comparison, label, largest, options_of
from filippov.app.report.case import StudyRun
from filippov.app.report.context import Context
from filippov.app.report.effort import Effort
from filippov.app.report.part import NONE, Chapter, Picture, TextTable, Words, number
from filippov.models.studies import Study

ERRORS = ("error_R", "error_times", "error_fixed_points", "drift")


def compared(study: Study, effort: Effort, k: int) -> Comparison:
    """The models with a band compared with the inclusion, in case k."""
    about, coarse = Context(study, effort), effort.widths
    bands = [
        BandModel(v.name, v.build, v.stick, {k: o[:1] if coarse > 1 else o for k, o in v.options.items()})
        for v in study.variants
    ]
    return compare_sections(
        about.system, about.section, bands, widths=study.widths[::coarse], comparators=(),
        interval=about.interval, order=study.order, x0=about.x0, parameters=study.cases[k].parameters,
        repeats=1 if coarse > 1 else 3,
    )  # fmt: skip


def comparison(run: StudyRun) -> Chapter:
    """The section of errors and work over the width of the band."""
    study = run.study
    with run.stage("comparison", run.until):
        found = run.aside.value(compared, 0)
    names = tuple(dict.fromkeys(name for row in found.rows for name in options_of(row)))
    rows, notes = [], []
    for row in found.rows:
        width = NONE if row["width"] is None else f"{row['width']:.0e}"
        milli = None if row["seconds"] is None else 1e3 * row["seconds"]
        rows.append((
            row["model"], *(number(row.get(name)) for name in names), width,
            *(_scientific(largest(row[key])) for key in ERRORS),
            number(row["field_calls"], 7), number(milli, 3), number(row["time_ratio"], 3),
        ))  # fmt: skip
        if row["note"] and row["width"] is not None:
            notes.append(f"{label(row['model'], options_of(row))} at {width}: {row['note']}.")
    where, unit = ", ".join(f"{d:g}" for d in found.coordinates), study.unit
    source = f"filippov.analysis.comparisons.comparison, rtol {found.rtol:g}; comparison.csv."
    table = TextTable(
        "Band models beside the inclusion",
        ("model", *names, run.label("width", "half-width"), f"Δ{study.letter}(d) [{unit}]", "Δt [s]",
         f"Δd* [{unit}]", f"drift [{unit}]", "field calls", "ms", "time ratio"),
        tuple(rows),
        f"Largest differences from the inclusion: of {study.letter}(d) at d = {where} {unit}, of the event "
        "times of the response, of the fixed points; drift: of the position during the stay in the band. "
        "Field calls and median times of the same solutions; ratio to the inclusion run beside it. Row "
        "exact: how far two tolerances of the inclusion differ. " + " ".join(notes),
        source, "comparison", long=True,
    )  # fmt: skip
    letter = study.letter
    labels = {"width": run.label("width", "half-width"), "error_R": f"error of {letter}(d) [{unit}]",
              "drift": f"drift during stick [{unit}]", "field_calls": "calls of the field [-]"}  # fmt: skip
    columns: Sequence[str] = tuple(dict.fromkeys(key for row in found.rows for key in row))
    return Chapter(
        "comparison", "Comparison with band models",
        [Picture("comparison", "Band models against the inclusion", source,
                 lambda: found.plot(labels=labels)), table,
         Words("p", "How the differences go with the width of the band:"),
         Words("pre", run.lettered("\n".join(t.sentence for t in found.trends)))],
        _facts(found.rows),
        summary={"comparison": [
            {"model": row["model"], "eta": row["width"], "alpha": row.get("alpha")}
            | {name: value for name, value in row.items() if name not in {"model", "width", "alpha"}}
            for row in found.rows
        ]},
        files=[("comparison.csv", columns, [[row.get(name) for name in columns] for row in found.rows])],
    )  # fmt: skip


COLUMNS = {
    "plant": "plant", "model": "model", "method": "integrator", "width": "width", "error_state": "error",
    "drift": "drift", "calls_ratio": "calls", "order": "order", "theory": "theory", "said": "wrong in kind",
}  # fmt: skip


def approximations(run: StudyRun) -> Chapter:
    """Other plants under the approximations of the inclusion, from the rows stored with the study."""
    rows = run.study.approximated
    source = "filippov.app.approximations.table_of_approximations, kept with the package; approximations.csv."
    table = TextTable(
        "Approximations of several plants", tuple(COLUMNS.values()),
        tuple(tuple(row[name] or NONE for name in COLUMNS) for row in rows),
        "At the narrowest of three widths each (where time is stepped: of three steps). Error: the largest "
        "of a state over the extent of the states; drift: the way slipped in stick; calls of the field over "
        "those of the exact run; order: of the error over the widths, beside that of the theory.",
        source, "approximations", long=True,
    )  # fmt: skip
    facts = {
        "plants": float(len({row["plant"] for row in rows})),
        "orders": float(sum(bool(row["order"]) for row in rows)),
        "slower": float(sum(row["said"].startswith("order") for row in rows)),
    }
    return Chapter(
        "approximations", "Other plants", [Words("source", f"Source: {source}"), table], facts,
        files=[("approximations.csv", tuple(rows[0]), [list(row.values()) for row in rows])],
    )  # fmt: skip


def _facts(rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """The largest errors of the widest and the narrowest band."""
    bands = [row for row in rows if row["width"] is not None]
    wide, narrow = max(row["width"] for row in bands), min(row["width"] for row in bands)
    widest = [row for row in bands if row["width"] == wide]
    errors = [largest(row["error_fixed_points"]) for row in bands if row["width"] == narrow]
    known = [error for error in errors if error is not None]
    facts = {"width": wide, "drift": max(row["drift"] or 0.0 for row in widest), "narrow": narrow}
    if all("is lost" in row["note"] for row in widest):
        facts["lost"] = float(len(widest))
    return facts | ({"narrow_error": max(known)} if known else {})


def _scientific(value: float | None) -> str:
    return NONE if value is None or math.isnan(value) else "0" if value == 0 else f"{value:.1e}"
