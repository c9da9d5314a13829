"""Limit cycles, their branches, the curve on which they end and the regions they fill."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from filippov.analysis import Orbit, curve, regions
from filippov.analysis.bifurcations.branch import Branch, BranchPoint
from filippov.analysis.steady.rest_map import growth, rest_map, threshold
from filippov.app.report.case import CaseCycles, CaseResults, StudyRun
from filippov.app.report.part import NONE, Chapter, Picture, TextTable, answer, first, number
from filippov.base.arrays import Array
from filippov.plot import plot_branches, plot_regions
from filippov.plot.place import label_beside
from filippov.plot.style import GREY, INK, SERIES, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Points of the border at which the set changes stability, and of the scan for each.
BORDER, SCAN = 25, 40
# An end of a fold curve this near to a bound, relative to the range, is at it; cycles smaller than this,
# relative to the largest, are magnified.
NEAR, SMALL = 1e-4, 0.1
STATED = {"stable": "", "unstable": " (unstable)", "undecided": " (undecided)"}


def orbits(run: StudyRun) -> Chapter:
    """Period, amplitude, multipliers, word and margins of each cycle."""
    with run.stage("cycles and branches", run.until):
        for k, case in enumerate(run.cases):
            run.tell(k / len(run.cases), f"cycles and branches, {case.label}")
            run.cycles.append(CaseCycles(run, case))
    states, every = run.system.states, [(c.case, o) for c in run.cycles for o in c.orbits]
    rows = []
    for case, orbit in every:
        values = ", ".join(f"{v.real:.8g}" if v.imag == 0 else f"{v:.6g}" for v in orbit.multipliers)
        rows.append((
            case.label, answer(orbit.verdict), f"{orbit.period:.9f}",
            *(f"{orbit.amplitude[name]:.10g}" for name in states[:2]), values, orbit.word,
            f"{number(orbit.margin.distance, 4)}, {number(orbit.margin.sliding, 4)}",
            number(orbit.margin.transversality, 4),
        ))  # fmt: skip
    command = f"`filippov orbit {run.model.name} --x0 ...`"
    table = TextTable(
        "The limit cycles",
        ("case", "stable", "period [s]",
         *(run.headed(name, f"amplitude {name}") for name in states[:2]), "multipliers",
         "mode word", "margins", "speed"),
        tuple(rows),
        "At the parameters of [[table parameters]]. Floquet multipliers without the trivial one; 0 belongs "
        "to stick, which forgets how it was entered. "
        "Margins: least distance from the surface where the cycle turns back from it, ∞ where it nowhere "
        "does: then nothing grazes; and the same for the multiplier of the sliding mode. "
        "Speed: least speed at which the surface is reached, relative to |grad h| |f|, 0 at grazing.",
        f"{command}; cycles.csv.", "cycles",
    )  # fmt: skip
    columns = ("case", "stable", "period", *(f"amplitude {s}" for s in states), "largest multiplier", "word")
    return Chapter(
        "cycles", "Limit cycles",
        [Picture("cycles", "The limit cycles", command, lambda: _portraits(run)), table] if every else [],
        summary={"orbits": {c.case.case.key: [_orbit(o) for o in c.orbits] for c in run.cycles}},
        files=[("cycles.csv", columns, [
            (c.case.key, o.stable, o.period, *o.amplitude.values(), float(np.abs(o.multipliers[0])), o.word)
            for c, o in every
        ])],
    )  # fmt: skip


def branches(run: StudyRun) -> Chapter:
    """Special points of the branches, and all cycles at every value of the parameter."""
    name, cycles, special = run.study.parameter, run.cycles, []
    for c in cycles:
        label = c.case.label
        special += [(label, q.special, f"{q.value:.10f}", f"{first(q):.10f}") for q in c.special]
        special += [(label, "how the branch ends", branch.message, NONE) for branch in c.branches]
        digits = f"{-np.log10(max(c.spread, 1e-16)):.1f}" if c.pairs else NONE
        special.append((label, "digits that two tolerances share", digits, NONE))
    rows = []
    for value in run.study.values:
        told = [sorted((first(p), p.verdict) for p in c.at[value]) for c in cycles]
        words = ["; ".join(f"{d:.12f}{STATED[verdict]}" for d, verdict in row) or NONE for row in told]
        rows.append((f"{value:g}", *words))
    command, unit = f"`filippov continue {run.model.name} --parameter {name} ...`", run.study.unit
    shown = [(branch, c.case.label) for c in cycles for branch in c.branches]
    labels = {"parameter": run.label("parameter"), "coordinate": run.label("fixed points")}

    def draw() -> Figure:
        return plot_branches([b for b, _ in shown], names=[label for _, label in shown], labels=labels)

    return Chapter(
        "branches", f"Branches of cycles over {name}",
        [
            Picture("branches", f"Cycles over {name}, followed through the fold", command, draw),
            TextTable("Where the branches turn and end", ("case", "what", run.headed(name), f"d [{unit}]"),
                  tuple(special),
                  "The digits are the fewest over all cycles and special points, rtol 1e-12 against 1e-13.",
                  f"{command}; branches.csv.", "special"),
            TextTable(f"All cycles: d* [{unit}] over {name}",
                  (run.headed(name), *(c.label for c in run.cases)), tuple(rows),
                  "Solved for at each value on the branch.", f"{command}; branches.csv.",
                  "branches", long=True),
        ] if shown else [],
        summary={"branches": {
            c.case.case.key: {
                "special": [{"what": q.special, name: q.value, "d": first(q)} for q in c.special],
                "cycles": {f"{v:g}": sorted(first(p) for p in points) for v, points in c.at.items()},
                "largest_difference": c.spread,
            }
            for c in cycles
        }},
        files=[("branches.csv", ("case", "branch", name, "d", "multiplier", "stable", "special"), [
            (c.case.case.key, k, *row) for c in cycles for k, b in enumerate(c.branches) for row in rows_of(b)
        ])],
    )  # fmt: skip


def fold_curve(run: StudyRun) -> Chapter:
    """The curve of the main case's first fold over a second parameter."""
    assert run.study.ending is not None
    (second, bounds), name = run.study.ending, run.study.parameter
    with run.stage("fold curve", run.until):
        ending = _fold_curve(run, second, bounds)
    title = f"The fold over {second}"
    if ending is None or not ending.points:
        return Chapter("fold-curve", title)
    source, limit = "filippov.analysis.bifurcations.curve", _limit(run, ending, second, bounds)
    message = ending.message + (f"; its limit is at {second} = {limit.value:g}" if limit else "")
    if limit is not None:
        # A point that near to the limit, as a turn by rounding, is not a separate one.
        reach = NEAR * (bounds[1] - bounds[0])
        near = [abs(p.value - limit.value) <= reach for p in ending.points]
        ending.points[:] = [
            replace(p, special="") if q else p for p, q in zip(ending.points, near, strict=True)
        ] + [limit]
    height, points = ending.coordinate(name), ending.points
    least, count = int(np.argmin(height)), len(points)
    chosen = sorted({*range(0, count, max(1, count // 12)), least, count - 1})
    (other, *_) = [key for key in points[0].coordinates if key != name]
    table = TextTable(
        "The fold curve", (run.headed(second), run.headed(name), run.headed(other, f"{other} at the fold")),
        tuple((f"{p.value:.8f}", f"{p.coordinates[name]:.8f}", f"{p.coordinates[other]:.8f}")
              for p in (points[k] for k in chosen)),
        f"{count} points; {message}. The limit: the fold's cycle has shrunk into the equilibrium set, which "
        f"changes stability there by the linearised return map ([[table places]])." if limit else
        f"{count} points; {message}.", f"{source}; fold_curve.csv.", "fold-curve",
    )  # fmt: skip

    def draw() -> Figure:
        labels = {"parameter": run.label("ending", second), "coordinate": run.label("fold", name)}
        figure = plot_branches([ending], coordinate=name, labels=labels)
        ax = figure.axes[0]
        for line in ax.lines:  # the cycle of a fold is neither stable nor unstable
            line.set_linestyle("-" if line.get_linestyle() == "--" else line.get_linestyle())
        for label in ax.texts[:]:
            label.remove()
        ax.plot(points[least].value, height[least], "o", color=INK, markersize=4.5, label="least",
                linestyle="none")  # fmt: skip
        for point in (points[least], *ending.special):
            text = f"({point.value:.4g}, {point.coordinates[name]:.11g})"
            label_beside(ax, point.value, point.coordinates[name], text, INK)
        ax.legend(frameon=False)
        ax.set_ylim(float(height.min()) - 0.08 * float(np.ptp(height)), None)
        return figure

    picture = Picture("fold_curve", f"The fold in {name} and {second}", source, draw)
    return Chapter(
        "fold-curve", title, [picture, table],
        {"end_value": float(height[-1]), "end_parameter": float(ending.values[-1]),
         "least_value": float(height[least]), "least_parameter": float(ending.values[least])},
        {"fold_curve": {second: ending.values.tolist(), name: height.tolist(), "end": message}},
        [("fold_curve.csv", (second, name, "d"),
          [(p.value, p.coordinates[name], p.coordinates[run.section.coordinate]) for p in points])],
    )  # fmt: skip


def region_map(run: StudyRun) -> Chapter:
    """Cells over two parameters with their exact borders: the fold, and where the set changes stability."""
    assert run.study.plane is not None
    (up, across_range, up_range), across = run.study.plane, run.study.parameter
    with run.stage("regions", run.until):
        halves = [(_fold_curve(run, up, up_range, way), way) for way in (-1, 1)]
        rows = [np.column_stack([h.coordinate(across), h.values])[::way] for h, way in halves if h]
        borders: list[tuple[str, Array]] = [("fold of the two cycles", np.vstack(rows))] if rows else []
        change = _change(run.main, across, up, across_range, up_range)
        if change is not None:
            borders.append(("set changes stability", change))
        columns, lines = run.effort.cells
        found = regions(
            run.system, run.section, (across, np.linspace(*across_range, columns).tolist()),
            (up, np.linspace(*up_range, lines).tolist()), run.interval, parameters=run.main.case.parameters,
            order=run.study.order, points=32, borders=borders,
            progress=lambda done, total: run.tell(done / total, f"cells over {across}, {up}"),
        )  # fmt: skip

    def draw() -> Figure:
        figure = plot_regions(found)
        figure.axes[0].set(xlabel=run.label("parameter"), ylabel=run.label("plane", up))
        for cells in figure.axes[0].collections:  # drawn as shapes: a page without pictures loads nothing
            cells.set_rasterized(False)
        return figure

    command = f"`filippov regions {run.model.name} --over {across}=... --over {up}=...`"
    picture = Picture("regions", f"Number of cycles over {across} and {up}", command, draw)
    return Chapter(
        "regions", f"Regions of {across} and {up}", [picture], summary={"regions": found.to_dict()}
    )


def rows_of(branch: Branch, size: str = "") -> list[tuple[Any, ...]]:
    """Rows of a branch: value, coordinate, largest multiplier, stable, special."""
    heights = branch.coordinate(size) if size else branch.d
    return [
        (p.value, height, float(np.abs(p.multipliers[0])), p.stable, p.special)
        for p, height in zip(branch.points, heights.tolist(), strict=True)
    ]


def _fold_curve(
    run: StudyRun, parameter: str, bounds: tuple[float, float], direction: int | None = None
) -> Branch | None:
    found = next((r for r in run.cycles[0].runs if r.branch.folds), None)
    if found is None:
        return None
    way = direction or (-1 if found.branch.parameters[parameter] >= bounds[1] else 1)
    return curve(found, found.branch.folds[0], parameter=parameter, bounds=bounds, direction=way).run()


def _limit(run: StudyRun, ending: Branch, second: str, bounds: tuple[float, float]) -> BranchPoint | None:
    """The limit of a fold curve whose cycle shrinks into the equilibrium set at a bound; None for others.

    There the set changes stability, in the case whose value is the bound, at the value nearest to the curve.
    """
    point, name, own = ending.points[-1], run.study.parameter, run.section.coordinate
    bound = min(bounds, key=lambda end: abs(end - point.value))
    if "shrinks" not in point.special or abs(bound - point.value) > NEAR * (bounds[1] - bounds[0]):
        return None
    found = [v for c in run.cases if c.parameters[second] == bound for v in c.thresholds]
    if not found:
        return None
    value = min(found, key=lambda v: abs(v - point.coordinates[name]))
    return replace(point, value=bound, coordinates={**point.coordinates, name: value, own: 0.0})


def _change(
    case: CaseResults, across: str, up: str, low_high: tuple[float, float], span: tuple[float, float]
) -> Array | None:
    """Points (across, up) where the linearised return map of the set has modulus 1; None without one."""
    polynomials = [c.polynomial for c in case.applying if c.polynomial is not None]
    if not polynomials:
        return None
    used = sorted({s for row in polynomials for c in row for s in c.free_symbols}, key=str)
    coefficients = sympy.lambdify(used, [list(row) for row in polynomials], "math")

    def measure(x: float, y: float) -> float:
        values = {**case.parameters, across: x, up: y}
        return growth([rest_map(row) for row in coefficients(*(values[s.name] for s in used))])

    border = [
        (x, y)
        for y in np.linspace(*span, BORDER).tolist()
        for x in threshold(lambda x, y=y: measure(x, y), *low_high, points=SCAN)  # type: ignore[misc]
    ]
    return np.array(border) if border else None


def _portraits(run: StudyRun) -> Figure:
    """Phase portraits of every cycle, unstable ones dashed."""
    labels, (x_name, y_name) = run.study.labels, run.system.states[:2]
    with style():
        figure = new_figure(6.0, 4.2)
        ax, shown = figure.subplots(), []
        for k, found in enumerate(run.cycles):
            for orbit in found.orbits:
                once = orbit.solution()
                assert once.sol is not None
                x = once.sol(np.linspace(once.problem.t_span[0], once.t_end, 2000))
                look: dict[str, Any] = {"linestyle": "-" if orbit.stable else "--", "color": SERIES[k]}
                label = f"{found.case.label}, {orbit.verdict}, period {orbit.period:.4g} s"
                ax.plot(x[0], x[1], **look, label=label)
                shown.append((float(np.max(np.abs(x[0]))), x, look))
        small = [item for item in shown if item[0] < SMALL * max(size for size, _, _ in shown)]
        if small:
            inner = ax.inset_axes((0.37, 0.36, 0.28, 0.3))
            for _, x, look in small:
                inner.plot(x[0], x[1], **look)
            inner.margins(0.15)
            inner.locator_params(nbins=4)
            inner.tick_params(labelsize=7)
            inner.set_title("the centre magnified, same units", fontsize=7.5, color=GREY)
            ax.indicate_inset_zoom(inner, edgecolor=GREY)
        ax.set(xlabel=labels.get(x_name, x_name), ylabel=labels.get(y_name, y_name))
        ax.margins(0.06)
        ax.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=2)
    return figure


def _orbit(orbit: Orbit) -> dict[str, Any]:
    margin = {name: getattr(orbit.margin, name) for name in ("distance", "sliding", "transversality")}
    return {
        "period": orbit.period, "amplitude": orbit.amplitude, "stable": orbit.stable, "word": orbit.word,
        "multipliers": [[float(v.real), float(v.imag)] for v in orbit.multipliers], "margin": margin,
    }  # fmt: skip
