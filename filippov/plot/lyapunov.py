"""Figures of chaos: exponents as they settle, and diagrams by iteration."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.base.errors import UsageError
from filippov.base.keywords import keywords
from filippov.base.names import check_known
from filippov.plot.results import result_of
from filippov.plot.style import BLUE, GREEN, GREY, ORANGE, PURPLE, RED, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLORS = (BLUE, ORANGE, GREEN, PURPLE, RED)


@keywords(first=result_of("lyapunov", "exponents", "running", "labels"))
def plot_lyapunov(result: Any, *, title: str = "", figure: Figure | None = None) -> Figure:
    """The estimate of every exponent over the time that it rests on; those of minus infinity are left out.

    result  what `filippov.analysis.sensitivity.lyapunov.lyapunov` returned
    """
    with style():
        drawn = figure if figure is not None else new_figure(6.4, 3.6)
        ax = drawn.subplots()
        spent = np.asarray(result.t)[1:] - result.t[0]
        for k, value in enumerate(result.exponents):
            if np.isfinite(value):
                label = f"{value:.4g} ± {result.error[k]:.2g}"
                ax.plot(spent, result.running[:, k], color=COLORS[k % len(COLORS)], label=label)
        ax.axhline(0.0, color=GREY, linewidth=0.6, linestyle=":")
        ax.set(xlabel=result.labels["t"], ylabel=result.labels["exponents"], title=title)
        if ax.get_legend_handles_labels()[0]:
            ax.legend()
    return drawn


@keywords(first=result_of("brute_force", "parameter", "values", "d", "period"))
def plot_brute_force(
    result: Any, *, labels: Mapping[str, str] | None = None, title: str = "", figure: Figure | None = None
) -> Figure:
    """Iterates over the parameter, a dot each.

    result  what `filippov.analysis.diagrams.brute_force.brute_force` returned
    labels  {"parameter": "speed [m/s]", "d": "x at the stick [m]"}; default: those of the system
    """
    text = {"parameter": str(result.parameter), "d": "d", **result.labels}
    check_known("label", labels or {}, text, UsageError)
    text |= labels or {}
    with style():
        drawn = figure if figure is not None else new_figure(6.4, 3.8)
        ax = drawn.subplots()
        values = np.repeat(result.values, result.d.shape[1])
        ax.plot(values, result.d.ravel(), ".", color=BLUE, markersize=1.4, rasterized=True)
        ax.set(xlabel=text["parameter"], ylabel=text["d"], title=title)
    return drawn
