"""The picture of a diagnosis: both solutions, and the calls that each has spent."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.base.keywords import keywords
from filippov.plot.results import result_of
from filippov.plot.style import BLUE, GREY, PALE, RED, column, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_STATES = 4


@keywords(first=result_of("diagnose", "run", "solution", "findings"))
def plot_diagnosis(diagnosis: Any, *, title: str = "", figure: Figure | None = None) -> Figure:
    """The first states over time, the solution of the inclusion behind scipy's steps; below, calls of f.

    Shaded is where the solution slides.
    """
    run, solution = diagnosis.run, diagnosis.solution
    names = diagnosis.system.states if diagnosis.system is not None else [f"y{i}" for i in range(len(run.y))]
    count = min(len(run.y), MOST_STATES)
    with style():
        drawn = figure if figure is not None else new_figure(7.5, 1.6 * (count + 1) + 0.6)
        axes = column(drawn, count + 1)
        if solution is not None:
            t = np.unique(
                np.concatenate([np.linspace(solution.problem.t_span[0], solution.t_end, 1000), solution.t])
            )
            x = np.atleast_2d(solution.sol(t))
            for segment in solution.segments:
                if 0 in segment.mode:
                    for ax in axes:
                        ax.axvspan(segment.t0, segment.t1, color=PALE, alpha=0.5, linewidth=0)
        for i, ax in enumerate(axes[:count]):
            if solution is not None:
                ax.plot(t, x[i], color=BLUE, linewidth=2.2, label="the inclusion")
            ax.plot(run.t, run.y[i], ".", color=RED, markersize=3, label=f"scipy's {run.method}")
            ax.set_ylabel(names[i])
        handles, labels = axes[0].get_legend_handles_labels()
        drawn.legend(handles, labels, loc="outside upper right", ncols=2)
        low = axes[count]
        low.step(run.t, run.spent, color=RED, where="post")
        low.set(ylabel="calls of f", xlabel="t")
        if solution is not None:
            low.plot([run.t[0], solution.t_end], [0, solution.nfev], color=BLUE, linestyle="--")
            low.annotate(
                f"{solution.nfev}",
                (solution.t_end, solution.nfev),
                color=BLUE,
                ha="right",
                va="bottom",
                fontsize=8,
            )
        low.annotate(
            f"{run.nfev}", (run.t[-1], run.spent[-1]), color=RED, ha="right", va="bottom", fontsize=8
        )
        if run.ended:
            for ax in axes:
                ax.axvline(run.t[-1], color=GREY, linestyle=":", linewidth=1)
        drawn.suptitle(title or f"{diagnosis.name}", x=0.01, ha="left", fontsize=10.5)
    return drawn
