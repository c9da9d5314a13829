"""Figures of a solution and of a mode graph; matplotlib is imported when the first is drawn.

Sliding phases are shaded or drawn thick, events are marked by kind. The functions return the figure;
`figure=` draws into an existing one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.base.arrays import Array
from filippov.base.errors import ModelError, UsageError
from filippov.base.escape import figure_text
from filippov.base.given import Amount
from filippov.base.keywords import keywords
from filippov.base.names import check_known
from filippov.plot.graph import plot_graph
from filippov.plot.pieces import output_pieces, pieces_of
from filippov.plot.sliding import Sliding, marks
from filippov.plot.style import (
    BLUE,
    GREY,
    INK,
    RED,
    SERIES,
    SLIDING,
    axis_label,
    column,
    new_figure,
    panel_label,
    style,
)
from filippov.solving.reading import expression_of
from filippov.solving.segments import Segment
from filippov.solving.solution import Solution

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["plot_graph", "plot_phase", "plot_solution"]

# Panels that are drawn where none is asked for.
MOST_PANELS = 12


@keywords()
def plot_solution(
    solution: Solution,
    states: Sequence[str] | str | None = None,
    *,
    multiplier: str | None = None,
    labels: Mapping[str, str] | None = None,
    events: bool = True,
    points: Amount = 2000,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """States and outputs over time, one panel each, sliding phases shaded and events marked.

    Where several surfaces slide a panel shows those of its own state, and a strip below which slides when if
    a colour for each does not.

    states      names of states, outputs and inputs, and formulas of them, to show; default all states and
                outputs, or the first 12 of them
    multiplier  name of a surface: a further panel with the value of its sign and the set it may take while
                sliding
    labels      labels with units, by name: {"t": "time [s]", "x": "position [m]", "multiplier": "friction"};
                default: those of the system
    points      samples over the span, at least 8 in every segment

    Raises UsageError for unknown names, ImportError without matplotlib.
    """
    names = _names(states, solution)
    if states is None and len(names) > MOST_PANELS:
        title = f"{title + ': ' if title else ''}the first {MOST_PANELS} of {len(names)}; plot([...]) chooses"
        names = names[:MOST_PANELS]
    if multiplier is not None:
        try:
            solution.system.surface_place(multiplier)
        except ModelError as error:
            raise UsageError(str(error)) from None
    own = solution.system.labels
    text = _labels(labels, ("t", *solution.system.states, *solution.system.outputs, *names, "multiplier"))
    pieces = list(pieces_of(solution, points))
    sliding = Sliding(solution, names)
    heights = [1.0] * (len(names) + (multiplier is not None)) + [sliding.strip_height] * sliding.strip
    with style():
        drawn = figure if figure is not None else new_figure(7.0, 1.0 + 1.55 * sum(heights))
        axes = column(drawn, len(heights), heights)
        for name, ax in zip(names, axes, strict=False):
            sliding.shade(ax, name)
            if name in solution.system.states:
                i = solution.system.states.index(name)
                t = np.concatenate([t for _, t, _ in pieces])
                ax.plot(t, np.concatenate([x[i] for _, _, x in pieces]), color=SERIES[0])
                at = [e.t for e in solution.events], [e.x[i] for e in solution.events]
                if events:
                    sliding.mark(ax, name, *at)
            else:
                ax.plot(*output_pieces(solution, name, pieces), color=SERIES[1])
                ax.margins(y=0.08)
            ax.set_ylabel(panel_label(text.get(name, axis_label(solution.system, name))))
        if multiplier is not None:
            ax = axes[len(names)]
            _multiplier(ax, solution, multiplier, pieces)
            ax.set_ylabel(panel_label(text.get("multiplier", figure_text(f"sign of {multiplier}"))))
        if sliding.strip:
            sliding.draw_strip(axes[-1])
        axes[-1].set_xlabel(text.get("t", own.get("t", "t")))
        low, high = sorted((solution.problem.t_span[0], solution.t_end))
        if low < high:
            axes[-1].set_xlim(low, high)
        _legend(axes[0], title, 5, axes)
    return drawn


@keywords()
def plot_phase(
    solution: Solution,
    x: str | None = None,
    y: str | None = None,
    *,
    equilibrium: Any = None,
    labels: Mapping[str, str] | None = None,
    events: bool = True,
    points: Amount = 4000,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Phase portrait of two states, sliding parts drawn thick.

    x, y         names of the states; default the first two
    equilibrium  states of the ends of an equilibrium set, a row of n numbers for each (or of the two
                 shown): drawn as a thick grey line, one row as a point
    """
    states = solution.system.states
    if len(states) < 2 and (x is None or y is None):
        raise UsageError("a phase portrait needs two states; this system has one. Use plot_solution.")
    pair = [x if x is not None else states[0], y if y is not None else states[1]]
    check_known("state", pair, states, UsageError)
    i, j = (states.index(name) for name in pair)
    text = _labels(labels, states)
    ends = None if equilibrium is None else _ends(equilibrium, len(states), i, j)
    with style():
        drawn = figure if figure is not None else new_figure(5.2, 4.2)
        ax = drawn.subplots()
        if ends is not None:
            ax.plot(
                ends[:, 0], ends[:, 1], color=GREY, linewidth=6, alpha=0.45, solid_capstyle="round", zorder=1,
                marker="o" if len(ends) == 1 else "", markersize=8, markeredgewidth=0, label="equilibria",
                linestyle="none" if len(ends) == 1 else "-",
            )  # fmt: skip
        for sliding, group in groupby(pieces_of(solution, points), key=lambda piece: 0 in piece[0].mode):
            line = np.concatenate([values[[i, j]] for _, _, values in group], axis=1)
            ax.plot(
                *line, color=SLIDING[0] if sliding else BLUE, linewidth=3.2 if sliding else 1.1,
                solid_capstyle="round", zorder=3 if sliding else 2,
                label=_once(ax, "sliding" if sliding else ""),
            )  # fmt: skip
        ax.plot(*solution.problem.x0[[i, j]], "s", color=INK, markersize=4.5, zorder=5, label="start")
        if events:
            at = [e.x for e in solution.events]
            marks(ax, solution, [v[i] for v in at], [v[j] for v in at], range(len(at)), str)
        ax.set_xlabel(text.get(pair[0], axis_label(solution.system, pair[0])))
        ax.set_ylabel(text.get(pair[1], axis_label(solution.system, pair[1])))
        ax.margins(0.06)
        ax.locator_params(nbins=6)
        _legend(ax, title, 3)
    return drawn


# -- pieces ----------------------------------------------------------------------------------------------


def _multiplier(
    ax: Any, solution: Solution, surface: str, pieces: Sequence[tuple[Segment, Array, Array]]
) -> None:
    times: list[Array] = []
    values: list[Array] = []
    gap = np.array([np.nan])
    for segment, t, _ in pieces:
        inner = segment.t0 + (t - segment.t0) * (1 - 1e-9) + 0.5e-9 * (segment.t1 - segment.t0)
        if 0 not in segment.mode:
            inner = inner[[0, -1]]
        times += [inner, gap]
        values += [solution.multiplier(surface, inner), gap]
    ax.axhline(1, color=GREY, linewidth=0.6, linestyle=":")
    ax.axhline(-1, color=GREY, linewidth=0.6, linestyle=":")
    ax.plot(np.concatenate(times), np.concatenate(values), color=RED)
    ax.margins(y=0.12)


def _legend(ax: Any, title: str, columns: int, panels: Sequence[Any] = ()) -> None:
    """The legend above the first panel, of what stands in all of them."""
    parts = [panel.get_legend_handles_labels() for panel in panels or [ax]]
    pairs = [pair for part in parts for pair in zip(*part, strict=True)]
    pairs.sort(key=lambda pair: not pair[1].startswith("sliding on"))
    handles, labels = [handle for handle, _ in pairs], [label for _, label in pairs]
    if title:
        ax.set_title(title, loc="left", pad=10 + 15 * -(-len(labels) // columns), fontsize=10.5)
    if handles:
        ax.legend(
            handles, labels, loc="lower left", bbox_to_anchor=(0, 1.0), ncols=min(len(labels), columns),
            borderpad=0.1, borderaxespad=0.3, handletextpad=0.4, columnspacing=1.2,
        )  # fmt: skip


def _once(ax: Any, label: str) -> str | None:
    return label if label and label not in ax.get_legend_handles_labels()[1] else None


def _names(given: Sequence[str] | str | None, solution: Solution) -> list[str]:
    system = solution.system
    outputs = system.outputs if solution.sol is not None or given is not None else ()
    wanted = (*system.states, *outputs) if given is None else given
    names = [wanted] if isinstance(wanted, str) else list(wanted)
    if not names:
        raise UsageError("no state was named, expected at least one.")
    known = (*system.states, *system.outputs, *(samples.name for samples in system.inputs))
    for name in names:
        if name.isidentifier() or system.symbolic is None:
            kind = "state or output" if system.outputs else "state"
            check_known(kind, [name], known, UsageError)
        else:
            expression_of(system, name)
    return names


def _labels(given: Mapping[str, str] | None, known: Sequence[str]) -> dict[str, str]:
    labels = dict(given or {})
    check_known("label", labels, known, UsageError)
    return labels


def _ends(equilibrium: Any, n: int, i: int, j: int) -> Array:
    try:
        rows = np.atleast_2d(np.asarray(equilibrium, dtype=float))
    except (TypeError, ValueError):
        raise UsageError(f"equilibrium is {equilibrium!r}, expected state vectors, one per row.") from None
    if rows.ndim != 2 or rows.shape[1] not in (2, n):
        raise UsageError(
            f"equilibrium has shape {rows.shape}, expected rows of {n} states, or of the two shown."
        )
    return rows[:, [i, j]] if rows.shape[1] == n else rows
