"""The results of diagrams and equations, and their accuracy."""

from __future__ import annotations

import math

from filippov.analysis.algebra.growth import Growth
from filippov.app.report.case import StudyRun
from filippov.app.report.part import NONE, Chapter, TextTable, Words, yes


def classification(run: StudyRun) -> Chapter:
    """The classification of each regime by the diagrams, over all values that were computed."""
    said = run.study.stated.classification if run.study.stated else {}
    found, rows = {}, []
    for c in run.cases:
        points = [row for diagram in c.diagrams for row in diagram.points]
        sets = [{q.verdict for q in row if q.kind == "equilibrium set"} for row in points]
        cycles = [{q.verdict for q in row if q.kind == "limit cycle"} for row in points]
        quiet = [a == {"stable"} and b <= {"unstable"} for a, b in zip(sets, cycles, strict=True)]
        told = {"equilibrium set": _set_words({s for row in sets for s in row}),
                "limit cycles": _cycle_words(cycles)}  # fmt: skip
        if run.study.goal:
            told[run.study.goal] = "yes" if any(quiet) else "never"
        regime = c.case.regime or c.label
        found[regime] = told
        for what, word in told.items():
            paper = said.get(regime, {}).get(what, NONE)
            rows.append((regime, what, word, paper, yes(word == paper)))
    values = [v for diagram in run.main.diagrams for v in diagram.values]
    subject = "set" if run.main.sets else "equilibria"
    proofs = [f"{c.case.regime or c.label}: {c.stability.items[0].answer}"
              for c in run.cases if c.stability.items]  # fmt: skip
    table = TextTable(
        "Classification", ("regime", "what", "computed", "paper", "same"), tuple(rows),
        f"Computed from the diagrams at {run.study.parameter} = {', '.join(f'{v:g}' for v in values)}, one "
        f"case per regime. The stability report, at the parameters of [[table parameters]], says of the "
        f"{subject}: {'; '.join(proofs)}.",
        f"bifurcation_*.csv, read by {__name__}.classification.", "classification",
    )  # fmt: skip
    return Chapter("classification", "Classification", [table], summary={"classification": found})


def stability(run: StudyRun) -> Chapter:
    """The complete stability report of the main case."""
    main = run.main
    text = (
        "Equilibria, one-sided linearisation, Routh arrays and conditions as the program derives them from "
        f"the equations, at {main.label}; it tells apart the cases of its parameters. Verdicts: "
        + "; ".join(f"{c.label}: {i.answer}" for c in run.cases for i in c.stability.items) + "."
    )  # fmt: skip
    source = f"Source: `filippov stability {run.given(main.case)} --solve-for {run.study.parameter}`"
    parts = [Words("p", text), Words("pre", main.stability.to_text()), Words("source", source)]
    return Chapter("stability", "Stability report", parts)


def checks(run: StudyRun) -> Chapter:
    """Each cycle by several methods, and quantities that should be exact along the responses."""
    rows = [
        (c.case.key, k, name, value)
        for c in run.cases for k, a in enumerate(c.agreements) for name, value in a.values.items()
    ]  # fmt: skip
    files = [("checks.csv", ("case", "cycle", "method", "d"), rows)]
    return Chapter("checks", "Independent checks", [_agreements(run), _exactness(run)], files=files)


def _set_words(seen: set[Growth]) -> str:
    return " or ".join(sorted(seen)) or "none"


def _cycle_words(cycles: list[set[Growth]]) -> str:
    seen = {verdict for row in cycles for verdict in row}
    if not seen:
        return "never"
    often = "always" if all(cycles) else "possible"
    only = " only" if often == "possible" and len(seen) == 1 else ""
    return f"{often}, {' and '.join(sorted(seen))}{only}"


def _agreements(run: StudyRun) -> TextTable:
    """Each cycle by several methods."""
    rows, why = [], ""
    for c in run.cases:
        for agreement in c.agreements:
            why = f" They do not apply here: {agreement.why}" if agreement.why else why
            best = [n for n in agreement.values if n.startswith(("event map", "collocation"))][1]
            for k, (name, value) in enumerate(agreement.values.items()):
                digits = NONE if k == 1 else f"{agreement.digits(best, name):.1f}"
                rows.append((c.label if k == 0 else "", name, f"{value:.14f}", digits))
            if agreement.reference:
                reference = float(agreement.reference)
                off = max(abs(agreement.values[best] - reference) / reference, 1e-16)
                name = "reference, 40-digit Taylor, 12 decimals"
                rows.append(("", name, agreement.reference, f"{-math.log10(off):.1f}"))
    return TextTable(
        "The cycles by independent methods",
        ("case", "method", f"d* [{run.study.unit}]", "digits shared"), tuple(rows),
        "Digits shared with the event map at the tight tolerance. Collocation solves the whole orbit as one "
        "boundary-value problem on the symbolic field, without a step or an event of the solver; solve_ivp "
        "is scipy's, with an event on the surface. Where the slope of the field at the surface is infinite "
        "an explicit method loses digits as it leaves the surface; that is why solve_ivp shares fewer there."
        + why,
        "filippov.analysis.comparisons.independent; checks.csv.", "agreements",
    )  # fmt: skip


def _exactness(run: StudyRun) -> TextTable:
    """Quantities that should be exact along the responses."""
    names = list(dict.fromkeys(n for c in run.cases for n in c.spreads))
    rows = tuple(
        (c.label, f"{c.height:.3g}", *(f"{c.spreads[n]:.3g}" for n in names), str(len(c.orbit)),
         f"{c.apart:.2g}", c.word or NONE)
        for c in run.cases
    )  # fmt: skip
    return TextTable(
        "The responses as solutions of an inclusion",
        ("case", f"largest |{run.section.surface}| while sliding", *(f"spread of {n}" for n in names),
         "rests", f"response - iterates [{run.study.unit}]", "mode word"),
        rows,
        "Twenty points of each sliding segment, in the units of the model. Response - iterates: largest "
        "distance between the positions at the events of the section in the response and the iterates of the "
        "event map from the first of them; the map starts each return anew from its coordinate alone, so "
        "this tests the section as well. "
        "Mode word: the modes that the end of the response repeats.",
        f"`filippov simulate {run.model.name} -p ...`.", "exactness",
    )  # fmt: skip
