"""The tables of a study: computed figures beside those of the source."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from filippov.analysis.comparisons.comparison_result import label, options_of, size
from filippov.app.report.facts import classification
from filippov.app.report.results import CaseResult, Results

NONE = "—"
ERRORS = ("error_P", "error_times", "error_fixed_points", "drift")


@dataclass(frozen=True)
class Table:
    """Rows of text under columns, with a note and the command or method that gives them."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    source: str = ""


def number(value: Any, digits: int = 6) -> str:
    """A number as text: infinities as a sign, nothing as a dash."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return NONE
    if isinstance(value, str):
        return value
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    return f"{value:.{digits}g}"


def scientific(value: float | None) -> str:
    """An error as text."""
    return NONE if value is None else "0" if value == 0 else f"{value:.1e}"


def yes(value: bool) -> str:
    """yes or no."""
    return "yes" if value else "no"


def parameters(results: Results) -> Table:
    """Table 1: parameters of the system beside the source's."""
    stated, system = results.study.stated_parameters, results.system
    rows = []
    for name in system.parameters:
        p = system.parameters[name]
        given = stated.get(name, NONE)
        same = NONE if given == NONE else yes(float(given) == p.default)
        rows.append((name, p.description, number(p.default), given, p.unit or "1", same))
    return Table(
        "Table 1. Parameters", ("symbol", "what it is", "here", "paper", "unit", "same"), tuple(rows),
        source=f"Source: the model's own defaults, `filippov models describe {results.model.name}`.",
    )  # fmt: skip


def fixed_points(results: Results) -> Table:
    """Fixed points of the iterate beside the source's."""
    rows = []
    for result in results.cases:
        stated = results.study.stated_points.get(result.case.key, ())
        for k, q in enumerate(result.fixed):
            s = stated[k] if len(stated) == len(result.fixed) else None
            paper = NONE if s is None else s.d + (f" ({s.reference})" if s.reference else "")
            said = NONE if s is None else yes(s.stable)
            rows.append((
                result.case.label, "0" if q.d == 0 else f"{q.d:.12f}", paper, q.kind, yes(q.stable), said,
                number(q.slope, 8), NONE if q.period == 0 else f"{q.period:.8f}",
            ))  # fmt: skip
    turns = "second" if results.study.order == 2 else f"{results.study.order}th"
    notes = [f"{r.case.label}: {q.note}." for r in results.cases for q in r.fixed if q.note]
    return Table(
        f"Table 2. Fixed points of the {turns} iterate and their stability",
        ("case", "d* here [m]", "paper (reference) [m]", "kind", "stable", "paper", "slope", "time [s]"),
        tuple(rows),
        "Slope: of the second iterate at the point, from saltation matrices, at the set its limit for d → "
        "0+; stable means |slope| < 1. Time: of the turns of one orbit, from the start of each to its end "
        "on the section. "
        + " ".join(notes),
        f"Source: `filippov event-map {results.model.name} --order {results.study.order} -p ...`, "
        "fixed_points.csv.",
    )


def basins(results: Results) -> Table:
    """Intervals of the start by where they lead."""
    rows = []
    for result in results.cases:
        for basin in result.basins:
            goes = "no fixed point" if basin.attractor is None else f"d* = {basin.attractor:.10g}"
            if basin.attractor == 0:
                goes = "the equilibrium set"
            rows.append((result.case.label, f"{basin.lo:.10g} < d < {basin.hi:.10g}", goes))
    return Table(
        "Basins on the interval", ("case", "rest position d [m]", "goes to"), tuple(rows),
        "Borders are the unstable fixed points; the middle of each interval was iterated until it arrived.",
    )  # fmt: skip


def places(results: Results) -> Table:
    """Table 3: folds, changes of stability and bounds beside the source's."""
    name = results.study.parameter
    rows = []
    for result in results.cases:
        said = results.study.stated_places.get(result.case.key, {})
        fold = "; ".join(f"{name} = {v:.10f}, d = {d:.10f}" for v, d in result.diagram.folds) or "none"
        change = "; ".join(f"{name} = {v:.10f}" for v in result.diagram.stability_changes) or _never(result)
        rest = "; ".join(f"{name} = {v:.10f}" for v in result.thresholds) or "no linear part"
        bound = f"{name} > {result.bound:g}" if result.bound is not None else "no linear part"
        paper = list(said.values())
        rows += [
            (result.case.label, "fold of the two cycles", fold, paper[0] if paper else NONE),
            (
                result.case.label,
                "the set changes stability (event map)",
                change,
                paper[1] if len(paper) > 1 else NONE,
            ),
            (result.case.label, "the same by the linearised return map", rest, NONE),
            (result.case.label, "Routh-Hurwitz (sufficient)", bound, _bound_said(results, result)),
        ]
    worst = max((s.residual for r in results.cases for s in r.diagram.special), default=0.0)
    return Table(
        "Table 3. Where the diagrams change", ("case", "what", "here", "paper"), tuple(rows),
        "Roots of P(P(d)) = d with slope 1 (fold) and of |slope| = 1 at the set, in the parameter; largest "
        f"residual {worst:.1g}. The linearised return map takes the whole line of {name}, the diagrams only "
        "its range.",
        f"Source: `filippov bifurcation {results.model.name} --parameter {name} ...`, `filippov stability "
        f"{results.model.name} --solve-for {name} ...`.",
    )  # fmt: skip


def _never(result: CaseResult) -> str:
    stable = {q.stable for points in result.diagram.points for q in points if q.kind == "equilibrium set"}
    return f"never, {'stable' if stable == {True} else 'unstable'} at every value computed"


def _bound_said(results: Results, result: CaseResult) -> str:
    said = results.study.stated_bounds.get(result.case.key)
    return NONE if said is None else said


def classes(results: Results) -> Table:
    """Table 4: the classification that follows from the diagrams, beside the source's."""
    stated, rows = results.study.stated_classification, []
    for regime, found in classification(results).items():
        for what, said in found.items():
            paper = stated.get(regime, {}).get(what, NONE)
            rows.append((regime, what, said, paper, yes(said == paper)))
    main, name = results.main, results.study.parameter
    values = [*main.diagram.values, *main.beyond.values]
    proofs = [f"{r.case.regime}: {r.stability.items[0].answer}" for r in results.cases if r.stability.items]
    return Table(
        "Table 4. Classification", ("regime", "what", "computed", "paper", "same"), tuple(rows),
        f"Computed from the diagrams at {name} = {', '.join(f'{v:g}' for v in values)}, one exponent a "
        f"regime. The stability report, at the parameters of table 1, says of the set: {'; '.join(proofs)}.",
        "Source: bifurcation_*.csv, read by filippov.app.report.facts.classification.",
    )  # fmt: skip


def checks(results: Results) -> Table:
    """Each cycle by several methods."""
    rows = []
    for result in results.cases:
        for agreement in result.agreements:
            best = [n for n in agreement.values if n.startswith(("event map", "collocation"))]
            for k, (name, value) in enumerate(agreement.values.items()):
                digits = f"{agreement.digits(best[1], name):.1f}" if len(best) > 1 and k != 1 else NONE
                rows.append((result.case.label if k == 0 else "", name, f"{value:.14f}", digits))
            if agreement.reference:
                reference = float(agreement.reference)
                own = agreement.values[best[1]] if len(best) > 1 else next(iter(agreement.values.values()))
                apart = -math.log10(max(abs(own - reference) / reference, 1e-16))
                rows.append(
                    ("", "reference, 40-digit Taylor, 12 decimals", agreement.reference, f"{apart:.1f}")
                )
    return Table(
        "The cycles by independent methods", ("case", "method", "d* [m]", "digits shared"), tuple(rows),
        "Digits shared with the event map at the tight tolerance. Collocation solves the whole orbit as "
        "one boundary-value problem on the symbolic field, without a step or an event of the solver; "
        "solve_ivp is scipy's, with an event on the surface. Where the slope of the field at the surface "
        "is infinite an explicit method loses digits as it leaves the surface; that is why solve_ivp "
        "shares fewer there.",
        "Source: filippov.app.report.independent; checks.csv.",
    )  # fmt: skip


def exactness(results: Results) -> Table:
    """What should be exact along the responses."""
    names = list(dict.fromkeys(n for r in results.cases for n in r.exactness.spreads))
    surface = results.model.section.surface if results.model.section else "the surface"
    rows = []
    for r in results.cases:
        e = r.exactness
        spread = [f"{e.spreads[n]:.3g}" for n in names]
        rows.append(
            (r.case.label, f"{e.height:.3g}", *spread, str(e.count), f"{e.iterates:.2g}", r.word or NONE)
        )
    return Table(
        "The responses as motions of an inclusion",
        ("case", f"largest |{surface}| while sliding", *(f"spread of {n}" for n in names), "rests",
         "response - iterates [m]", "mode word"),
        tuple(rows),
        "Twenty points of each sliding segment. Response - iterates: largest distance between the "
        "positions at the events of the section in the response and the iterates of the event map from the "
        "first of them; the map starts each turn anew at its lift, so this tests the lift as well. Mode "
        "word: the modes that the end of the response repeats.",
        f"Source: `filippov simulate {results.model.name} -p ...`.",
    )  # fmt: skip


def comparison(results: Results) -> Table | None:
    """The band models beside the inclusion; None where nothing was compared."""
    found = results.comparison
    if found is None:
        return None
    names = tuple(dict.fromkeys(name for row in found.rows for name in options_of(row)))
    rows, notes = [], []
    for row in found.rows:
        width = NONE if row["width"] is None else f"{row['width']:.0e}"
        milli = None if row["seconds"] is None else 1e3 * row["seconds"]
        rows.append((
            row["model"], *(number(row.get(name)) for name in names), width,
            *(scientific(size(row[key])) for key in ERRORS),
            number(row["field_calls"], 7), number(milli, 3), number(row["time_ratio"], 3),
        ))  # fmt: skip
        if row["note"] and row["width"] is not None:
            notes.append(f"{label(row['model'], options_of(row))} at {width}: {row['note']}.")
    where = ", ".join(f"{d:g}" for d in found.coordinates)
    return Table(
        "Band models beside the inclusion",
        ("model", *names, "half-width [m/s]", "ΔP(d) [m]", "Δt [s]", "Δd* [m]", "drift [m]", "field calls",
         "ms", "time ratio"),
        tuple(rows),
        f"Largest differences from the inclusion: of P(d) at d = {where} m, of the event times of the "
        "response, of the fixed points; drift: of the position during the stay in the band. Field calls "
        "and median times of the same motions; ratio to the inclusion run beside it. Row exact: how far "
        "two tolerances of the inclusion differ. "
        + " ".join(notes),
        f"Source: filippov.analysis.comparisons.comparison, rtol {found.rtol:g}; comparison.csv.",
    )  # fmt: skip


def machine(results: Results) -> Table:
    """Versions and the machine."""
    return Table("Versions and machine", ("what", "value"), tuple(results.machine.items()))


def timing(results: Results) -> Table:
    """Seconds a stage."""
    rows = tuple((name, f"{seconds:.2f}") for name, seconds in results.timing.items())
    return Table("Time", ("stage", "seconds"), rows)
