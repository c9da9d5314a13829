"""The figures of a study's findings."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.app.report.results import Results
from filippov.plot.branch import plot_branches
from filippov.plot.describing import plot_describing_function
from filippov.plot.identification import plot_identification
from filippov.plot.regions import plot_regions
from filippov.plot.style import GREY, INK, SERIES, new_figure, style
from filippov.plot.tuning import plot_gain_maps as plot_ratio_maps

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Draw = Callable[[], "Figure"]


def finding_figures(results: Results) -> dict[str, Draw]:
    """What draws each figure, by file name; only those of what was asked."""
    found = results.findings
    out: dict[str, Draw] = {}
    if any(c.orbits for c in found.cycles):
        out["cycles"] = lambda: cycles(results)
    if any(c.branches for c in found.cycles):
        out["branches"] = lambda: branches(results)
    if found.ending is not None and found.ending.points:
        out["fold_curve"] = lambda: fold_curve(results)
    if found.regions is not None:
        out["regions"] = lambda: region_map(results)
    if found.settings is not None:
        out["settings"] = lambda: settings(results)
    if found.predictions:
        out["prediction"] = lambda: prediction(results)
    if found.measured is not None:
        out["experiment"] = lambda: experiment(results)
    if found.relative:
        out["relative"] = lambda: relative(results)
    return out


def cycles(results: Results) -> Figure:
    """Phase portraits of every cycle, unstable ones dashed."""
    labels, states = results.study.labels, results.system.states
    with style():
        figure = new_figure(6.0, 4.2)
        ax = figure.subplots()
        for k, case in enumerate(results.cases):
            found = results.findings.of(case.case.key)
            for orbit in found.orbits if found else ():
                motion = orbit.solution()
                assert motion.sol is not None
                x = motion.sol(np.linspace(motion.problem.t_span[0], motion.t_end, 2000))
                word = "stable" if orbit.stable else "unstable"
                ax.plot(
                    x[0], x[1], "-" if orbit.stable else "--", color=SERIES[k],
                    label=f"{case.case.label}, {word}, period {orbit.period:.4g} s",
                )  # fmt: skip
        ax.set(xlabel=labels.get(states[0], states[0]), ylabel=labels.get(states[1], states[1]))
        ax.margins(0.06)
        ax.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=2)
    return figure


def branches(results: Results) -> Figure:
    """The branches of all cases over the parameter, special points marked."""
    shown = [
        (branch, case.case.label)
        for case in results.cases
        for branch in getattr(results.findings.of(case.case.key), "branches", ())
    ]
    known = results.study.labels
    labels = {"parameter": known["parameter"], "coordinate": known["fixed points"]}
    return plot_branches([b for b, _ in shown], names=[name for _, name in shown], labels=labels)


def fold_curve(results: Results) -> Figure:
    """The parameter at the fold over the second one."""
    ending, asked = results.findings.ending, results.study.questions.ending
    assert ending is not None
    assert asked is not None
    labels = results.study.labels
    figure = plot_branches(
        [ending], coordinate=results.study.parameter,
        labels={"parameter": labels["ending"], "coordinate": labels["fold"]},
    )  # fmt: skip
    ax = figure.axes[0]
    for line in ax.lines:  # the cycle of a fold is neither stable nor unstable
        line.set_linestyle("-")
    height = ending.coordinate(results.study.parameter)
    for text, point in zip(ax.texts, ending.special, strict=True):
        text.set_text(f"({point.value:.4g}, {point.coordinates[results.study.parameter]:.6g})")
    ax.set_ylim(float(height.min()) - 0.08 * float(np.ptp(height)), None)
    return figure


def region_map(results: Results) -> Figure:
    """Cells over two parameters, and their exact borders."""
    found = results.findings.regions
    figure = plot_regions(found)
    labels = results.study.labels
    figure.axes[0].set(xlabel=labels["parameter"], ylabel=labels["plane"])
    for cells in figure.axes[0].collections:  # drawn as shapes: a page without pictures loads nothing
        cells.set_rasterized(False)
    return figure


def settings(results: Results) -> Figure:
    """The contraction ratio over two settings, the best settings and their margin."""
    found = results.findings.settings
    assert found is not None
    asked, tuning = found.tunings[0]
    figure = plot_ratio_maps([found.ratio_map], tuning=tuning, title=asked.label)
    labels = results.study.labels
    figure.axes[0].set(xlabel=labels["parameter"], ylabel=labels["plane"])
    return figure


def prediction(results: Results) -> Figure:
    """Harmonic balance for the first law with the exact cycles."""
    first = results.findings.predictions[0]
    return plot_describing_function(
        first.harmonic, exact=first.inputs, labels={"amplitude": results.study.labels["input"]}
    )


def experiment(results: Results) -> Figure:
    """The record, the fit, its residual, and the estimated curve."""
    found, asked = results.findings.measured, results.study.questions.experiment
    assert found is not None
    assert asked is not None
    return plot_identification(
        found.found, lambda x, values: asked.curve(x, {**asked.fixed, **values})
    )


def relative(results: Results) -> Figure:
    """The branches of the smoother model over the exact ones, on a linear and on a logarithmic scale."""
    asked, labels = results.study.questions.relative, results.study.labels
    assert asked is not None
    size = f"amplitude {asked.build().states[0]}"
    with style():
        figure = new_figure(8.6, 4.2)
        linear, log = figure.subplots(1, 2)
        log.set_yscale("log")
        for k, case in enumerate(results.cases):
            exact, label = results.findings.of(case.case.key), case.case.label
            smooth = [f.branch for f in results.findings.relative if f.key == case.case.key]
            for ax in (linear, log):
                for branch in exact.branches if exact else ():
                    _line(ax, branch, branch.d, SERIES[k], f"inclusion, {label}", 3.2, 0.3)
                for branch in smooth:
                    height = branch.coordinate(size)
                    _line(ax, branch, height, SERIES[k], f"{asked.name}, {label}", 1.4, 1.0)
                    for q in branch.folds:
                        ax.plot(q.value, q.coordinates[size], "D", color=INK, markersize=4, zorder=5)
        linear.set(xlabel=labels["parameter"], ylabel=labels["amplitude"])
        log.set(xlabel=labels["parameter"])
        log.set_title("logarithmic; folds marked", loc="left", fontsize=9.5, color=GREY)
        linear.set_title("stable solid, unstable dashed", loc="left", fontsize=9.5, color=GREY)
        linear.legend(loc="upper right")
        least = min(float(np.min(f.branch.coordinate(size))) for f in results.findings.relative)
        log.set_ylim(bottom=0.3 * least)
    return figure


def _line(ax: Any, branch: Any, height: Any, colour: str, name: str, width: float, alpha: float) -> None:
    """A branch: stable solid, unstable dashed; a stretch is drawn as its first point is."""
    stable = branch.stable
    for kind, line in ((True, "-"), (False, "--")):
        part = np.where((stable == kind) | np.append(False, stable[:-1] == kind), height, np.nan)
        if np.any(np.isfinite(part)):
            ax.plot(
                branch.values, part, line, color=colour, linewidth=width, alpha=alpha,
                label=name if kind == bool(stable[0]) else None,
            )  # fmt: skip
