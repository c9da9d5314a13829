"""Figure of a comparison of solutions: the solutions themselves, errors over the width, errors over the work.

What is drawn is asked only for its attributes: `rows` (dicts with model, width, error_state, field_calls; the
first one the exact solution), `models`, `exact` (a Solution), `solutions` (by model) and `trends`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.base.keywords import keywords
from filippov.plot.results import result_of
from filippov.plot.style import GREY, INK, SERIES, axis_label, log_ticks, new_figure, panel_label, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MARKS = "osD^v<>P"
SAMPLES = 1500


@keywords(first=result_of("compare", "exact", "rows", "solutions"))
def plot_solution_comparison(
    comparison: Any, *, state: Any = 0, title: str = "", quantity: str = "error_state",
    figure: Figure | None = None,
) -> Figure:  # fmt: skip
    """The state over time, exact and at each model's widest width; `quantity` over width and over work."""
    exact = comparison.exact
    k = state if isinstance(state, int) else exact.system.state_index(state)
    with style():
        drawn = figure if figure is not None else new_figure(10.5, 6.4)
        grid = drawn.add_gridspec(3, 2, height_ratios=(1.0, 0.7, 1.4))
        above, gaps = drawn.add_subplot(grid[0, :]), drawn.add_subplot(grid[1, :])
        left, right = drawn.add_subplot(grid[2, 0]), drawn.add_subplot(grid[2, 1])
        t = np.linspace(exact.problem.t_span[0], exact.t_end, SAMPLES)
        x = exact.sol(t)[k]
        above.plot(t, x, color=INK, linewidth=2.2, label="exact")
        widths = {q["model"]: q["width"] for q in reversed(comparison.rows) if q["entries"] is not None}
        for place, model in enumerate(comparison.models):
            look: dict[str, Any] = {"color": SERIES[place % len(SERIES)], "linewidth": 1.1}
            marker = _MARKS[place % len(_MARKS)]
            mark: dict[str, Any] = {"marker": marker, "markerfacecolor": "none", "markersize": 5.0}
            rows = [row for row in comparison.of(model) if row[quantity]]
            order = next(
                (q.order for q in comparison.trends if (q.model, q.quantity) == (model, quantity)), None
            )
            told = f"{model}, width {widths[model]:.0e}" if model in comparison.solutions else model
            label = told if order is None else f"{told}\norder {order:.2f}"
            if model in comparison.solutions:
                other = comparison.solutions[model].sol(t)[k]
                far = np.maximum(np.abs(other - x), 1e-18)
                gaps.plot(t, far, **look, **mark, markevery=(11 * place, 150))
            else:
                other = np.full(t.size, np.nan)
            above.plot(t, other, **look, **mark, markevery=(11 * place, 150), linestyle="--", label=label)
            left.plot([q["width"] for q in rows], [q[quantity] for q in rows], **look, **mark)
            right.plot([q["field_calls"] for q in rows], [q[quantity] for q in rows], **look, **mark)
        name = exact.system.states[k]
        label = axis_label(exact.system, name)
        above.set(ylabel=label, xlim=(t[0], t[-1]))
        above.tick_params(labelbottom=False)
        gaps.set(yscale="log", xlabel=axis_label(exact.system, "t"), xlim=(t[0], t[-1]))
        gaps.set_ylabel(f"|error of {name}|{chr(10) + label[label.index('[') :] if '[' in label else ''}")
        _floor(gaps)
        labels = getattr(comparison, "labels", {})
        what = labels.get(quantity, quantity.replace("_", " ").replace("error", "error of"))
        left.set(xscale="log", yscale="log", xlabel=labels.get("width", "width"), ylabel=panel_label(what))
        right.set(xscale="log", yscale="log", xlabel="field calls", ylabel=panel_label(what))
        left.invert_xaxis()
        _reference(left, right, comparison.rows[0], quantity)
        log_ticks(right.xaxis)
        handles, names = above.get_legend_handles_labels()
        drawn.legend(handles, names, loc="outside right upper")
        if title:
            drawn.suptitle(title, x=0.01, ha="left", fontsize=10.5)
    return drawn


plot_motions = plot_solution_comparison  # its earlier name


def _floor(axes: Any) -> None:
    low, high = axes.get_ylim()
    axes.set_ylim(max(low, 1e-12 * high), high)


def _reference(left: Any, right: Any, exact: Any, quantity: str) -> None:
    """What two tolerances of the exact solution differ by, and its work."""
    if exact[quantity]:
        for axes in (left, right):
            axes.axhline(exact[quantity], color=GREY, linestyle="--", linewidth=0.9, zorder=1)
        left.annotate(
            "exact: two tolerances differ", (0.02, exact[quantity]), xycoords=("axes fraction", "data"),
            xytext=(0, 4), color=INK, fontsize=7.5, textcoords="offset points",
        )  # fmt: skip
    right.axvline(exact["field_calls"], color=INK, linestyle=":", linewidth=1.0)
    right.annotate(
        "exact", (exact["field_calls"], 1.0), xycoords=("data", "axes fraction"), xytext=(0, 1), color=INK,
        fontsize=7.5, textcoords="offset points", ha="center", va="bottom",
    )  # fmt: skip
