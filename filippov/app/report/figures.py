"""The figures of a study, each drawn from its results."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.app.report.finding_figures import finding_figures
from filippov.app.report.results import CaseResult, Results, Samples
from filippov.plot.graph import plot_graph
from filippov.plot.maps import plot_diagram, plot_event_map, plot_iterates
from filippov.plot.solution import plot_phase, plot_solution
from filippov.plot.style import GREY, INK, SERIES, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Draw = Callable[[], "Figure"]
TITLE = 10.5


def figures(results: Results) -> dict[str, Draw]:
    """What draws each figure, by file name, in the order of the report."""
    main = results.main
    out: dict[str, Draw] = {
        results.study.curve_title[0]: lambda: curves(results),
        f"response_{main.case.slug}": lambda: response(results, main),
        f"phase_{main.case.slug}": lambda: phase(results, main),
        f"map_{main.case.slug}": lambda: iterates(results, main),
    }
    for case in results.cases:
        out[f"second_{case.case.slug}"] = lambda case=case: second(results, case)  # type: ignore[misc]
    for case in results.cases:
        out[f"bifurcation_{case.case.slug}"] = lambda case=case: bifurcation(results, case)  # type: ignore[misc]
    out["modes"] = lambda: modes(results)
    out["graph"] = lambda: possible(results)
    if results.comparison:
        out["comparison"] = lambda: comparison(results)
    return out | finding_figures(results)


def curves(results: Results) -> Figure:
    """The constitutive curve of every case, the whole and beside the set."""
    labels = results.study.labels
    with style():
        figure = new_figure(7.2, 3.4)
        axes = figure.subplots(1, 2)
        for k, case in enumerate(results.cases):
            curve = case.curve
            for ax in axes:
                ax.plot(curve.x, curve.y, color=SERIES[k], label=case.case.label)
        x0, low, high = results.main.curve.at
        for ax in axes:
            ax.plot(
                [x0, x0],
                [low, high],
                color=INK,
                linewidth=3,
                solid_capstyle="butt",
                label="set at rest",
                zorder=1,
            )
            ax.set_xlabel(labels["curve x"])
        reach = 0.04 * float(np.max(np.abs(results.main.curve.x)))
        axes[1].set_xlim(-0.06 * reach, reach)
        seen = [c.curve.y[(c.curve.x > 0) & (c.curve.x < reach)] for c in results.cases]
        margin = 0.06 * (high - min(float(np.min(y)) for y in seen))
        axes[1].set_ylim(min(float(np.min(y)) for y in seen) - margin, high + margin)
        axes[1].set_title("beside the set, magnified", loc="left", fontsize=TITLE)
        axes[0].set_ylabel(labels["curve y"])
        axes[0].set_title("whole", loc="left", fontsize=TITLE)
        axes[0].legend(loc="lower right")
    return figure


def response(results: Results, case: CaseResult) -> Figure:
    """States over time with sliding shaded, and the multiplier of the section's surface."""
    labels = results.study.labels
    named = {name: labels[name] for name in ("t", *results.system.states, "multiplier") if name in labels}
    surface = None if results.model.section is None else results.model.section.surface
    return plot_solution(case.solution, multiplier=surface, labels=named, points=3000)


def phase(results: Results, case: CaseResult) -> Figure:
    """The first state against the second, and the last against the first, with the equilibrium set."""
    states, labels = results.system.states, results.study.labels
    named = {name: labels[name] for name in states if name in labels}
    ends = equilibrium_ends(case)
    planes = [(states[0], states[1])] + ([(states[2], states[0])] if len(states) > 2 else [])
    with style():
        figure, top, parts = _beside(4.0 * len(planes), 4.2, len(planes))
        for part, (x, y) in zip(parts, planes, strict=True):
            shown = None if ends is None else (ends[:1] if _same(ends, states, x, y) else ends)
            plot_phase(case.solution, x, y, equilibrium=shown, labels=named, figure=part)
        _common_legend(top, parts)
    return figure


def equilibrium_ends(case: CaseResult) -> Any:
    """End points of the first equilibrium set, one row a state; None without one."""
    for item in case.stability.items:
        ends = getattr(item.equilibrium, "ends", ())
        if ends:
            return np.array([end.value for end in ends], dtype=float)
    return None


def _same(ends: Any, states: tuple[str, ...], x: str, y: str) -> bool:
    """Whether the ends are one point in this plane."""
    return bool(np.ptp(ends[:, [states.index(x), states.index(y)]], axis=0).max() == 0.0)


def iterates(results: Results, case: CaseResult) -> Figure:
    """The map with the cobweb of the response's rest positions."""
    labels = results.study.labels
    reach = 1.15 * float(np.max(np.abs(case.orbit)))
    return plot_iterates(
        case.event_map, float(case.orbit[0]), len(case.orbit) - 1, lo=-reach, hi=reach, points=600,
        labels={"d": labels["d"], "P": labels["P(d)"]},
    )  # fmt: skip


def second(results: Results, case: CaseResult) -> Figure:
    """The iterate with its fixed points, whole and with the origin magnified."""
    labels = {"d": results.study.labels["d"], "P": results.study.labels["P(P(d))"]}
    with style():
        figure, top, parts = _beside(8.0, 4.2, 2)
        for part, samples, title in zip(
            parts, (case.wide, case.small), ("whole", "origin magnified"), strict=True
        ):
            _second(case, part, samples, labels)
            part.axes[0].set_title(title, loc="left", fontsize=TITLE, color=GREY)
        _common_legend(top, parts, {"P(d) = d": "diagonal", "P(d)": "P(P(d))"})
    return figure


def _second(case: CaseResult, figure: Any, samples: Samples, labels: dict[str, str]) -> None:
    low, high = float(samples.d[0]), float(samples.d[-1])
    shown = [q for q in case.fixed if low <= q.d <= high]
    plot_event_map(
        case.power, low, high, samples=(samples.d, samples.power), fixed=shown, labels=labels, figure=figure
    )
    # A margin below the origin, so that marks on the axes are whole.
    margin = 0.03 * (high - low)
    figure.axes[0].set_xlim(low - margin, high)
    figure.axes[0].set_ylim(bottom=min(low - margin, figure.axes[0].get_ylim()[0]))


def bifurcation(results: Results, case: CaseResult) -> Figure:
    """Fixed points over the parameter, with the analytic bound."""
    labels = {"parameter": results.study.labels["parameter"], "d": results.study.labels["fixed points"]}
    low, high = case.diagram.values[0], case.diagram.values[-1]
    bound = case.bound
    shown = {} if bound is None or not low <= bound <= high else {"Routh-Hurwitz bound": bound}
    return plot_diagram(case.diagram, bounds=shown, labels=labels)


def modes(results: Results) -> Figure:
    """The transitions that the response made."""
    return plot_graph(results.main.graph, names=results.study.mode_names)


def possible(results: Results) -> Figure:
    """The transitions that the system can make."""
    return plot_graph(results.possible, names=results.study.mode_names)


def comparison(results: Results) -> Figure:
    """Errors of the band models against the width of the band, and their work."""
    assert results.comparison is not None
    drawn: Figure = results.comparison.plot()
    return drawn


def _beside(width: float, height: float, count: int) -> tuple[Figure, Any, list[Any]]:
    """A figure of parts beside each other under a strip for their common legend."""
    figure = new_figure(width, height)
    strips: Any = figure.subfigures(2, 1, height_ratios=(0.11, 1.0))
    top, lower = strips
    return figure, top, list(np.atleast_1d(np.asarray(lower.subfigures(1, count), dtype=object)))


def _common_legend(top: Any, parts: list[Any], words: dict[str, str] | None = None) -> None:
    """One legend for all parts, in place of their own."""
    handles: dict[str, Any] = {}
    for part in parts:
        for handle, name in zip(*part.axes[0].get_legend_handles_labels(), strict=True):
            handles.setdefault((words or {}).get(name, name), handle)
        part.axes[0].get_legend().remove()
    top.legend(
        list(handles.values()), list(handles), loc="center left", ncols=len(handles), handletextpad=0.4,
        columnspacing=1.4,
    )  # fmt: skip
