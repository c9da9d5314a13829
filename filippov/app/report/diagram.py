"""Fixed points of the map, and their changes with the parameter."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from filippov.app.report.case import CaseResults, Samples, StudyRun
from filippov.app.report.part import NONE, Chapter, Picture, TextTable, answer, number, yes
from filippov.app.report.response import TITLE, beside, common_legend
from filippov.plot.maps import plot_diagram, plot_event_map
from filippov.plot.style import GREY, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POINT = ("d", "kind", "stable", "slope", "residual", "period", "note")
SPECIAL = ("kind", "value", "d", "residual", "note")


def fixed_points(run: StudyRun) -> Chapter:
    """The iterate of every case, its fixed points and their basins."""
    iterate = run.iterate
    ordinal = {1: "first", 2: "second"}.get(run.study.order, f"{run.study.order}th")
    pictures = [
        Picture(
            f"second_{c.slug}", f"{iterate}, {c.label}",
            f"`filippov event-map {run.given(c.case)} --order {run.study.order}`",
            lambda c=c: _iterate(run, c), run.lettered(_in_words(c)),  # type: ignore[misc]
        )
        for c in run.cases
    ]  # fmt: skip
    facts = {f"cycle_{c.slug}_{k}": q.d for c in run.cases for k, q in enumerate(c.cycles, start=1)}
    facts |= {f"jump_{c.slug}": jump.above for c in run.cases for jump in c.jumps if jump.d == 0}
    rows = [(c.case.key, *attrgetter(*POINT)(q)) for c in run.cases for q in c.fixed]
    return Chapter(
        "fixed-points", f"Fixed points of the {ordinal} iterate",
        [*pictures, _points_table(run, ordinal), _basins(run)], facts,
        {"fixed_points": {c.case.key: [_point(q) for q in c.fixed] for c in run.cases}},
        [("fixed_points.csv", ("case", *POINT), rows)],
    )  # fmt: skip


def bifurcation(run: StudyRun) -> Chapter:
    """The diagrams and the points where they change."""
    name, cases = run.study.parameter, run.cases
    low, high = run.study.values[0], run.study.values[-1]
    pictures = [
        Picture(
            f"bifurcation_{c.slug}", f"Fixed points over {name}, {c.label}",
            f"`filippov bifurcation {run.given(c.case)} --parameter {name} --values {low:g} {high:g} "
            f"--count {len(c.diagram.values)}`",
            lambda c=c: _diagram(run, c), _bound_in_words(name, c),  # type: ignore[misc]
        )
        for c in cases
    ]  # fmt: skip
    facts = {f"fold_{c.slug}": value for c in cases for value, _ in c.diagram.folds}
    facts |= {f"change_{c.slug}": value for c in cases for value in c.diagram.stability_changes}
    facts |= {f"change_rest_{c.slug}": value for c in cases for value in c.thresholds}
    facts |= {f"bound_{c.slug}": c.bound for c in cases if c.bound is not None}
    summary = {
        "folds": {
            c.case.key: [{name: v, "d": d} for v, d in c.diagram.folds] for c in cases if c.diagram.folds
        },
        "set_stability_change": {
            c.case.key: [{name: v} for v in c.diagram.stability_changes]
            for c in cases if c.diagram.stability_changes
        },
        "routh_hurwitz_bound": {c.case.key: c.bound for c in cases if c.bound is not None},
        "cycles": {c.case.key: {
            f"{value:g}": [q.d for q in points if q.kind == "limit cycle"]
            for value, points in zip(c.diagram.values, c.diagram.points, strict=True)
        } for c in cases},
    }  # fmt: skip
    special = [(c.case.key, *attrgetter(*SPECIAL)(s)) for c in cases for s in c.diagram.special]
    files: list[Any] = [("special_points.csv", ("case", *SPECIAL), special)]
    for c in cases:
        rows = [
            (value, *attrgetter(*POINT)(q)) for diagram in c.diagrams
            for value, found in zip(diagram.values, diagram.points, strict=True) for q in found
        ]  # fmt: skip
        files.append((f"bifurcation_{c.slug}.csv", (name, *POINT), rows))
    return Chapter("bifurcation", f"Bifurcation in {name}", [*pictures, _places(run)], facts, summary, files)


def _iterate(run: StudyRun, case: CaseResults) -> Figure:
    """The iterate with its fixed points, whole and with the origin magnified."""
    shown = [(case.wide, "whole"), (case.small, "origin magnified")] if case.small else [(case.wide, "")]
    with style():
        figure, top, parts = beside(4.0 * len(shown), 4.2, len(shown))
        for part, (samples, title) in zip(parts, shown, strict=True):
            _panel(run, case, part, samples)
            part.axes[0].set_title(title, loc="left", fontsize=TITLE, color=GREY)
        common_legend(top, parts)
    return figure


def _panel(run: StudyRun, case: CaseResults, figure: Any, samples: Samples) -> None:
    low, high = float(samples.d[0]), float(samples.d[-1])
    shown = [q for q in case.fixed if low <= q.d <= high]
    plot_event_map(
        case.power, low, high, samples=(samples.d, samples.power), fixed=shown, figure=figure,
        labels={"d": run.label("d"), "image": run.label("iterate"), "map": run.iterate},
    )  # fmt: skip
    # A margin below the origin, so that marks on the axes are whole.
    margin, axes = 0.03 * (high - low), figure.axes[0]
    axes.set_xlim(low - margin, high)
    axes.set_ylim(bottom=min(low - margin, axes.get_ylim()[0]))


def _diagram(run: StudyRun, case: CaseResults) -> Figure:
    """Fixed points over the parameter, with the analytic bound."""
    bound, values = case.bound, case.diagram.values
    shown = {} if bound is None or not values[0] <= bound <= values[-1] else {"Routh-Hurwitz bound": bound}
    labels = {"parameter": run.label("parameter"), "d": run.label("fixed points")}
    return plot_diagram(case.diagram, bounds=shown, labels=labels, inset=True)


def _in_words(case: CaseResults) -> str:
    """The fixed points in a sentence."""
    found = [f"d = {q.d:.6g} ({q.verdict} {q.kind})" for q in case.fixed]
    notes = [q.note for q in case.fixed if q.note]
    words = f"Fixed points: {', '.join(found)}." if found else "No fixed point on the interval."
    return words + "".join(f" {n[0].upper()}{n[1:]}." for n in notes)


def _bound_in_words(name: str, case: CaseResults) -> str:
    """Where the analytic bound is."""
    if case.bound is None and case.without == "none found":
        return f"No Routh-Hurwitz bound in {name} was found."
    if case.bound is None:
        return "There is no Routh-Hurwitz bound: the field beside the set has no linear part at the surface."
    inside = case.diagram.values[0] <= case.bound <= case.diagram.values[-1]
    where = "the dash-dotted line" if inside else "outside the range shown"
    return f"The Routh-Hurwitz bound is {name} = {case.bound:g}, {where}."


def _points_table(run: StudyRun, ordinal: str) -> TextTable:
    """Fixed points of the iterate beside the source's."""
    study, unit, rows = run.study, run.study.unit, []
    for c in run.cases:
        said: Sequence[Any] = study.stated.points.get(c.case.key, ()) if study.stated else ()
        for k, q in enumerate(c.fixed):
            s = said[k] if len(said) == len(c.fixed) else None
            paper = NONE if s is None else s.d + (f" ({s.reference})" if s.reference else "")
            rows.append((
                c.label, "0" if q.d == 0 else f"{q.d:.12f}", paper, q.kind, answer(q.verdict),
                NONE if s is None else yes(s.stable), number(q.slope, 8),
                NONE if q.period == 0 else f"{q.period:.8f}",
            ))  # fmt: skip
    notes = [run.lettered(f"{c.label}: {q.note}.") for c in run.cases for q in c.fixed if q.note]
    return TextTable(
        f"Fixed points of the {ordinal} iterate and their stability",
        ("case", f"d* here [{unit}]", f"paper (reference) [{unit}]", "kind", "stable", "paper", "slope",
         "time [s]"),
        tuple(rows),
        f"Slope: of the {ordinal} iterate at the point, from saltation matrices, at the set its limit for "
        "d → 0+; stable means |slope| < 1. Time: of the returns of one orbit, from the start of each to its "
        "end on the section. " + " ".join(notes),
        f"`filippov event-map {run.model.name} --order {study.order} -p ...`, fixed_points.csv.",
        "points",
    )  # fmt: skip


def _basins(run: StudyRun) -> TextTable:
    """Intervals of the initial coordinate by their attractor."""
    rows = []
    for c in run.cases:
        for basin in c.basins:
            goes = "no fixed point" if basin.attractor is None else f"d* = {basin.attractor:.10g}"
            goes = "the equilibrium set" if basin.attractor == 0 else goes
            rows.append((c.label, f"{basin.lo:.10g} < d < {basin.hi:.10g}", goes))
    return TextTable(
        "Basins on the interval", ("case", run.label("d"), "goes to"), tuple(rows),
        "Borders are the unstable fixed points; the middle of each interval was iterated until it arrived.",
        label="basins",
    )  # fmt: skip


def _places(run: StudyRun) -> TextTable:
    """Folds, changes of stability and bounds beside the source's."""
    name, stated, rows = run.study.parameter, run.study.stated, []
    for c in run.cases:
        fold, change = stated.places.get(c.case.key, (NONE, NONE)) if stated else (NONE, NONE)
        bound = f"{name} > {c.bound:g}" if c.bound is not None else c.without
        folds = "; ".join(f"{name} = {v:.10f}, d = {d:.10f}" for v, d in c.diagram.folds)
        changes = "; ".join(f"{name} = {v:.10f}" for v in c.diagram.stability_changes)
        rest = "; ".join(f"{name} = {v:.10f}" for v in c.thresholds)
        said = stated.bounds.get(c.case.key, NONE) if stated else NONE
        rows += [
            (c.label, "fold of the two cycles", folds or "none", fold),
            (c.label, "the set changes stability (event map)", changes or _never(c), change),
            (c.label, "the same by the linearised return map", rest or c.without, NONE),
            (c.label, "Routh-Hurwitz (sufficient)", bound, said),
        ]
    worst = max((s.residual for c in run.cases for s in c.diagram.special), default=0.0)
    return TextTable(
        "Where the diagrams change", ("case", "what", "here", "paper"), tuple(rows),
        f"Roots of {run.iterate} = d with slope 1 (fold) and of |slope| = 1 at the set, in the parameter; "
        f"largest residual {worst:.1g}. The linearised return map takes the whole line of {name}, the "
        "diagrams only its range.",
        f"`filippov bifurcation {run.model.name} --parameter {name} ...`, `filippov stability "
        f"{run.model.name} --solve-for {name} ...`.", "places",
    )  # fmt: skip


def _never(case: CaseResults) -> str:
    seen = {q.verdict for points in case.diagram.points for q in points if q.kind == "equilibrium set"}
    if not seen:
        return "no set among the fixed points"
    return f"never, {' or '.join(sorted(seen))} at every value computed"


def _point(q: Any) -> dict[str, Any]:
    out = {"d": float(q.d), "kind": q.kind, "stable": bool(q.stable), "verdict": q.verdict, "slope": q.slope}
    if q.note or not math.isfinite(q.slope):
        out["note"] = q.note or f"the slope is {q.slope}"
    return out
