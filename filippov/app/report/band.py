"""Models with a band in place of the surface, beside the inclusion."""

from __future__ import annotations

import math
from collections.abc import Sequence

from filippov.analysis.comparisons.band_model import BandModel
from filippov.analysis.comparisons.comparison import compare
from filippov.analysis.comparisons.comparison_result import label, options_of, size
from filippov.app.report.part import NONE, Picture, Section, Table, Words, number
from filippov.app.report.run import Run

ERRORS = ("error_P", "error_times", "error_fixed_points", "drift")


def comparison(run: Run) -> Section:
    """Errors and work over the width of the band."""
    study, coarse = run.study, run.effort.widths
    bands = [
        BandModel(v.name, v.build, v.stick, {k: o[:1] if coarse > 1 else o for k, o in v.options.items()})
        for v in study.variants
    ]
    with run.stage("comparison", run.until):
        found = compare(
            run.system, run.section, bands, widths=study.widths[::coarse], comparators=(),
            interval=run.interval, order=study.order, x0=run.x0, parameters=run.main.case.parameters,
            repeats=1 if coarse > 1 else 3,
            progress=lambda done, total, what="": run.tell(done / total, f"comparison: {what}"),
        )  # fmt: skip
    names = tuple(dict.fromkeys(name for row in found.rows for name in options_of(row)))
    rows, notes = [], []
    for row in found.rows:
        width = NONE if row["width"] is None else f"{row['width']:.0e}"
        milli = None if row["seconds"] is None else 1e3 * row["seconds"]
        rows.append((
            row["model"], *(number(row.get(name)) for name in names), width,
            *(_scientific(size(row[key])) for key in ERRORS),
            number(row["field_calls"], 7), number(milli, 3), number(row["time_ratio"], 3),
        ))  # fmt: skip
        if row["note"] and row["width"] is not None:
            notes.append(f"{label(row['model'], options_of(row))} at {width}: {row['note']}.")
    where, unit = ", ".join(f"{d:g}" for d in found.coordinates), study.unit
    source = f"filippov.analysis.comparisons.comparison, rtol {found.rtol:g}; comparison.csv."
    table = Table(
        "Band models beside the inclusion",
        ("model", *names, run.label("width", "half-width"), f"ΔP(d) [{unit}]", "Δt [s]", f"Δd* [{unit}]",
         f"drift [{unit}]", "field calls", "ms", "time ratio"),
        tuple(rows),
        f"Largest differences from the inclusion: of P(d) at d = {where} {unit}, of the event times of the "
        "response, of the fixed points; drift: of the position during the stay in the band. Field calls and "
        "median times of the same motions; ratio to the inclusion run beside it. Row exact: how far two "
        "tolerances of the inclusion differ. " + " ".join(notes),
        source,
    )  # fmt: skip
    columns: Sequence[str] = tuple(dict.fromkeys(key for row in found.rows for key in row))
    return Section(
        "comparison", "Comparison with band models",
        [Picture("comparison", "Band models against the inclusion", source, found.plot), table,
         Words("p", "How the differences go with the width of the band:"),
         Words("pre", "\n".join(t.sentence for t in found.trends))],
        summary={"comparison": [
            {"model": row["model"], "eta": row["width"], "alpha": row.get("alpha")}
            | {name: value for name, value in row.items() if name not in {"model", "width", "alpha"}}
            for row in found.rows
        ]},
        files=[("comparison.csv", columns, [[row.get(name) for name in columns] for row in found.rows])],
    )  # fmt: skip


def _scientific(value: float | None) -> str:
    return NONE if value is None or math.isnan(value) else "0" if value == 0 else f"{value:.1e}"
