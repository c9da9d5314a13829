"""The files of a report: each appears whole or not at all."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.app.report.finding_facts import finding_files
from filippov.app.report.results import CaseResult, Results
from filippov.base.csv_text import csv_text
from filippov.base.status import mode_text
from filippov.base.whole_file import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Rows = Iterable[Iterable[Any]]
DPI = 160
MARGIN = 0.08  # inches


def write(path: Path, content: str | bytes) -> None:
    """Write a file, whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, content)


def write_csv(path: Path, columns: Sequence[str], rows: Rows) -> None:
    """Write a table; floats in the shortest form that reads back equal."""
    write(path, csv_text(columns, rows))


def save_figure(folder: Path, name: str, figure: Figure) -> str:
    """Write a figure as SVG and PNG, close it, and return the SVG text."""
    from matplotlib import pyplot as plt

    from filippov.plot.style import style

    vector, raster = io.StringIO(), io.BytesIO()
    try:
        with style():
            # Layout and extent are found once for both files.
            figure.draw_without_rendering()
            figure.set_layout_engine("none")
            box = figure.get_tightbbox().padded(MARGIN)
            figure.savefig(vector, format="svg", bbox_inches=box, metadata={"Date": None, "Creator": None})
            figure.savefig(raster, format="png", dpi=DPI, bbox_inches=box, metadata={"Software": None})
    finally:
        plt.close(figure)
    write(folder / f"{name}.svg", vector.getvalue())
    write(folder / f"{name}.png", raster.getvalue())
    return vector.getvalue()


def data_files(results: Results) -> Iterator[tuple[str, Sequence[str], Rows]]:
    """(name, columns, rows) of every CSV file."""
    parameter = results.study.parameter
    point = ("d", "kind", "stable", "slope", "residual", "period", "note")
    fixed = [(c.case.key, *_values(q, point)) for c in results.cases for q in c.fixed]
    yield "fixed_points.csv", ("case", *point), fixed
    yield (
        "checks.csv",
        ("case", "cycle", "method", "d"),
        [
            (a.case, k, name, value)
            for c in results.cases
            for k, a in enumerate(c.agreements)
            for name, value in a.values.items()
        ],
    )
    special = ("kind", "value", "d", "residual", "note")
    yield (
        "special_points.csv",
        ("case", *special),
        [(c.case.key, *_values(s, special)) for c in results.cases for s in c.diagram.special],
    )
    for case in results.cases:
        slug = case.case.slug
        yield f"curve_{slug}.csv", ("x", "y"), zip(case.curve.x, case.curve.y, strict=True)
        yield f"response_{slug}.csv", ("t", *results.system.states, "mode"), _response(case)
        yield (
            f"events_{slug}.csv",
            ("t", "surface", "kind", "before", "after", *results.system.states),
            [
                (e.t, e.surface, str(e.kind), mode_text(e.before), mode_text(e.after), *e.x.tolist())
                for e in case.solution.events
            ],
        )
        both = np.argsort(np.concatenate([case.wide.d, case.small.d]), kind="stable")
        columns = [
            np.concatenate([getattr(case.wide, name), getattr(case.small, name)])[both]
            for name in ("d", "once", "power")
        ]
        yield f"map_{slug}.csv", ("d", "P(d)", "P(P(d))"), zip(*columns, strict=True)
        yield f"iterates_{slug}.csv", ("k", "d"), enumerate(case.orbit.tolist())
        yield (
            f"bifurcation_{slug}.csv",
            (parameter, *point),
            [
                (value, *_values(q, point))
                for diagram in (case.diagram, case.beyond)
                for value, found in zip(diagram.values, diagram.points, strict=True)
                for q in found
            ],
        )
    if results.comparison is not None:
        rows = results.comparison.rows
        names = tuple(dict.fromkeys(key for row in rows for key in row))
        yield "comparison.csv", names, [[row.get(name) for name in names] for row in rows]
    yield from finding_files(results)


def _response(case: CaseResult) -> list[tuple[Any, ...]]:
    """Dense samples and the ends of every segment, with the mode."""
    solution, out = case.solution, []
    assert solution.sol is not None
    span = solution.t_end - solution.problem.t_span[0]
    for segment in solution.segments:
        t = np.linspace(segment.t0, segment.t1, max(4, int(2000 * segment.dwell / span)))
        x = np.column_stack([solution.sol(t[:1], side="+"), solution.sol(t[1:])])
        out += [(a, *b, mode_text(segment.mode)) for a, b in zip(t.tolist(), x.T.tolist(), strict=True)]
    return out


def _values(item: Any, names: Sequence[str]) -> list[Any]:
    return [getattr(item, name) for name in names]
