"""The tables of a study's findings."""

from __future__ import annotations

import numpy as np

from filippov.app.report.results import Results
from filippov.app.report.tables import NONE, Table, number, yes

Tables = list[Table]


def cycles(results: Results) -> Tables:
    """Period, amplitude, multipliers, word and margins of each cycle."""
    rows = []
    states = results.system.states
    for case in results.cases:
        found = results.findings.of(case.case.key)
        for orbit in found.orbits if found else ():
            values = ", ".join(f"{v.real:.8g}" if v.imag == 0 else f"{v:.6g}" for v in orbit.multipliers)
            rows.append((
                case.case.label, yes(orbit.stable), f"{orbit.period:.9f}",
                *(f"{orbit.amplitude[name]:.10g}" for name in states[:2]), values, orbit.word,
                f"{number(orbit.margin.distance, 4)}, {number(orbit.margin.sliding, 4)}",
                number(orbit.margin.transversality, 4),
            ))  # fmt: skip
    return [Table(
        "Limit cycles at the parameters of table 1",
        ("case", "stable", "period [s]", *(f"amplitude {name}" for name in states[:2]), "multipliers",
         "mode word", "margins", "speed"),
        tuple(rows),
        "Floquet multipliers without the trivial one; 0 belongs to stick, which forgets how it was entered. "
        "Margins: least distance from the surface where the cycle turns back from it, ∞ where it nowhere "
        "does: then nothing grazes; and the same for the multiplier of the sliding mode. "
        "Speed: least speed at which the surface is met, relative to |grad h| |f|, 0 at grazing.",
        f"Source: `filippov orbit {results.model.name} --x0 ...`; cycles.csv.",
    )]  # fmt: skip


def branches(results: Results) -> Tables:
    """Special points of the branches, and all cycles at every value of the parameter."""
    name = results.study.parameter
    rows, special = [], []
    for case in results.cases:
        found = results.findings.of(case.case.key)
        if found is None:
            continue
        for q in found.special:
            d = next(iter(q.coordinates.values()))
            special.append((case.case.label, q.special, f"{q.value:.10f}", f"{d:.10f}"))
        label = case.case.label
        special += [(label, "how the branch ends", branch.message, NONE) for branch in found.branches]
        digits = NONE if not found.count else f"{-np.log10(max(found.spread, 1e-16)):.1f}"
        special.append((case.case.label, "digits that two tolerances share", digits, NONE))
    for k, value in enumerate(results.study.values):
        row = [f"{value:g}"]
        for case in results.cases:
            found = results.findings.of(case.case.key)
            points = found.at[k][1] if found else ()
            told = sorted((next(iter(p.coordinates.values())), p.stable) for p in points)
            row.append("; ".join(f"{d:.12f}{'' if stable else ' (unstable)'}" for d, stable in told) or NONE)
        rows.append(tuple(row))
    origin = f"Source: `filippov continue {results.model.name} --parameter {name} ...`; branches.csv."
    return [
        Table(
            "Where the branches turn and end", ("case", "what", name, "d [m]"), tuple(special),
            "The digits are the fewest over all cycles and special points, rtol 1e-12 against 1e-13.", origin,
        ),
        Table(
            f"All cycles: d* [m] over {name}", (name, *(c.case.label for c in results.cases)), tuple(rows),
            "Solved for at each value on the branch.", origin,
        ),
    ]  # fmt: skip


def fold_curve(results: Results) -> Tables:
    """A choice of points of the fold curve."""
    ending, name = results.findings.ending, results.study.parameter
    if ending is None or not ending.points:
        return []
    count = len(ending.points)
    least = int(np.argmin(ending.coordinate(name)))
    chosen = sorted({*range(0, count, max(1, count // 12)), least, count - 1})
    points = [ending.points[k] for k in chosen]
    other = [key for key in ending.points[0].coordinates if key != name]
    return [Table(
        "The fold curve", (ending.parameter, name, f"{other[0]} at the fold"),
        tuple((f"{p.value:.8f}", f"{p.coordinates[name]:.8f}", f"{p.coordinates[other[0]]:.8f}")
              for p in points),
        f"{count} points; {ending.message}.", "Source: filippov.analysis.bifurcations.curve; fold_curve.csv.",
    )]  # fmt: skip


def settings(results: Results) -> Tables:
    """What the search for settings found under each law."""
    found = results.findings.settings
    if found is None:
        return []
    rows = []
    for asked, t in found.tunings:
        if t.best is None:
            rows.append((asked.label, "none", NONE, NONE, NONE, t.reason))
            continue
        best = ", ".join(f"{name} = {value:.4g}" for name, value in t.best.items())
        borders = "; ".join(
            f"{limit.name} > {limit.lower:.5g}" for limit in t.limits if limit.lower is not None
        )
        rows.append((
            asked.label, best, f"{t.margin:.3f}", f"{t.best_ratio:.3f}", f"{100 * t.share:.1f} %",
            f"alone, the others at the best: {borders}" if borders else "",
        ))  # fmt: skip
    ranges = ", ".join(f"{n} = {a:g} ... {b:g}" for n, (a, b) in results.study.questions.ranges.items())
    return [Table(
        "Settings without cycles",
        ("law", "best settings", "margin", "ratio", "share", "borders, or why there are none"), tuple(rows),
        f"Searched in {ranges}. Margin: the factor by which every setting may change at once, in any "
        "combination, up or down. Ratio: the largest |P(d)/d| at the best settings. Share: of the samples "
        "that have no cycle.",
        f"Source: `filippov tune {results.model.name} --ranges ...`.",
    )]  # fmt: skip


def predictions(results: Results) -> Tables:
    """Harmonic balance, algebra and exact cycles for each law."""
    rows = []
    for p in results.findings.predictions:
        exact = "; ".join(f"d = {d:.12f} ({'stable' if s else 'unstable'})" for d, _, s in p.exact) or "none"
        said = "; ".join(f"amplitude {c.amplitude:.6g}, period {c.period:.6g} s" for c in p.harmonic.cycles)
        algebra = NONE
        if p.ratio is not None:
            algebra = f"none: ratio of successive |d| {p.ratio[0]:.12f} (event map: {p.ratio[1]:.12f})"
        if p.law.algebra == "cycles":
            algebra = "; ".join(f"d = {c.d:.12f}" for c in p.algebraic) or "none"
        right = bool(p.harmonic.cycles) == bool(p.exact)
        rows.append((p.law.label, said or "no cycle", algebra, exact, yes(right)))
    if not rows:
        return []
    return [Table(
        "What is predicted, and what there is",
        ("law", "harmonic balance", "algebra of the slip", "event map: d [m]", "harmonic balance right"),
        tuple(rows), "",
        f"Source: `filippov describing-function {results.model.name}`, "
        "filippov.analysis.harmonic.static_cycle.",
    )]  # fmt: skip


def experiment(results: Results) -> Tables:
    """Estimates beside the values that the record was made with."""
    measured, asked = results.findings.measured, results.study.questions.experiment
    if measured is None or asked is None:
        return []
    found, name = measured.found, results.study.parameter
    rows = [
        (key, number(measured.truth[key], 8), f"{found.values[key]:.7g}", f"{found.errors[key]:.2g}",
         f"{found.intervals[key][0]:.6g} ... {found.intervals[key][1]:.6g}",
         f"{(found.values[key] - measured.truth[key]) / found.errors[key]:+.2f}")
        for key in found.errors
    ]  # fmt: skip
    return [Table(
        "Estimated from the record",
        ("parameter", "made with", "estimate", "standard error", f"{100 * found.level:g} % interval",
         "off, in errors"),
        tuple(rows),
        f"{asked.samples} samples over {asked.t_end:g} s, noise {asked.noise:g} m (seed {asked.seed}); "
        f"residual standard deviation {found.sigma:.3g} m with {found.degrees} degrees of freedom. No cycles "
        f"above {name} = {number(measured.limit, 7)} for the estimate, above {number(measured.safe, 7)} for "
        "the ends of every interval as well.",
        "Source: filippov.analysis.estimation.identification; "
        "`filippov identify record.csv ...`; record.csv.",
    )]  # fmt: skip


def relative(results: Results) -> Tables:
    """Where the smoother model is right, and where not."""
    asked, name = results.study.questions.relative, results.study.parameter
    if asked is None or not results.findings.relative:
        return []
    size = f"amplitude {results.system.states[0]}"
    rows = []
    for found in results.findings.relative:
        case, exact = results.case(found.key), results.findings.of(found.key)
        sizes = [next(iter(p.coordinates.values())) for p in (exact.at[0][1] if exact else ())]
        largest = max(sizes, default=None)
        ends = [f"{q.special}, {name} = {q.value:.6f}" for q in (exact.special if exact else [])]
        fold = f"fold, {name} = {found.fold.value:.6f}" if found.fold else "no end found"
        own = found.branch.points[0].coordinates[size]
        change = NONE if largest is None else f"{100 * (own / largest - 1):+.1f} %"
        repels = [not q.stable for q in case.fixed if q.d == 0]
        rests = all(rests for _, rests, _ in found.small)
        rows.append((
            case.case.label, number(largest, 7), number(own, 7), change, "; ".join(ends) or "never", fold,
            "repels" if any(repels) else "attracts", "attracts" if rests else "repels",
        ))  # fmt: skip
    starts = ", ".join(f"{start:g}" for start in asked.small)
    return [Table(
        f"{asked.name} beside the inclusion",
        ("case", "amplitude, inclusion [m]", f"{asked.name} [m]", "change", "cycles end, inclusion",
         f"cycles end, {asked.name}", "rest, inclusion", f"rest, {asked.name}"),
        tuple(rows),
        f"Amplitudes at {name} = {results.study.values[0]:g}. Rest of {asked.name}: motions from {starts} "
        f"m at this value, {asked.settle:g} s long.",
        "Source: filippov.analysis.bifurcations.continuation of an orbit of the model, relative.csv.",
    )]  # fmt: skip
