"""Figure of a describing-function analysis: growth rate and frequency over the amplitude of the input."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from filippov.base.errors import UsageError
from filippov.base.keywords import keywords
from filippov.base.names import check_known
from filippov.plot.results import result_of
from filippov.plot.style import BLUE, GREY, INK, PALE, RED, column, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@keywords(first=result_of("describing_function", "amplitude", "growth", "labels"))
def plot_describing_function(
    prediction: Any,
    *,
    exact: Iterable[tuple[float, float]] = (),
    labels: Mapping[str, str] | None = None,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Growth rate and frequency of the quasi-linear loop; a cycle is predicted where the growth is 0.

    prediction  what `describing_function` returned
    exact       (amplitude of the input, frequency) of cycles computed exactly, drawn as crosses
    labels      {"amplitude": "...", "growth": "...", "frequency": "..."}; default: those of the system
    """
    text = dict(prediction.labels)
    check_known("label", dict(labels or {}), tuple(text), UsageError)
    text |= labels or {}
    with style():
        drawn = figure if figure is not None else new_figure(5.2, 4.6)
        top, bottom = column(drawn, 2)
        top.axhline(0, color=PALE, linewidth=0.8)
        top.semilogx(prediction.amplitude, prediction.growth, color=BLUE, label="harmonic balance")
        bottom.loglog(prediction.amplitude, prediction.frequency, color=BLUE, label="harmonic balance")
        for cycle in prediction.cycles:
            face = BLUE if cycle.stable else "white"
            style_of = {"color": BLUE, "markerfacecolor": face, "linestyle": "none", "marker": "o"}
            word = "stable" if cycle.stable else "unstable"
            top.plot([cycle.amplitude], [0.0], label=f"predicted, {word}", **style_of)
            bottom.plot([cycle.amplitude], [cycle.frequency], **style_of)
        for k, (amplitude, frequency) in enumerate(exact):
            label = "exact cycle" if k == 0 else None
            bottom.plot([amplitude], [frequency], "x", color=RED, markersize=8, label=label)
        if not prediction.cycles:
            top.text(0.02, 0.05, "no cycle predicted", transform=top.transAxes, color=GREY)
        top.set_ylabel(text["growth"])
        bottom.set(ylabel=text["frequency"], xlabel=text["amplitude"])
        for ax in (top, bottom):
            if ax.get_legend_handles_labels()[0]:
                ax.legend(loc="best")
        if title:
            top.set_title(title, color=INK, fontsize=10)
    return drawn
