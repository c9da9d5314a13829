"""Figures of periodic orbits: the phase portrait and the time series of one period."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.base.arrays import Array
from filippov.base.errors import UsageError
from filippov.base.keywords import keywords
from filippov.base.names import check_known, unknown
from filippov.base.status import mode_text
from filippov.plot.pieces import pieces_of
from filippov.plot.results import result_of
from filippov.plot.style import BLUE, GREY, INK, MARKS, ORANGE, axis_label, new_figure, panel_label, style
from filippov.solving.segments import Segment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Samples over a period.
_POINTS = 1000


@keywords(first=result_of("find_orbit", "system", "pieces", "period", "word"))
def plot_orbit(
    orbit: Any,
    *,
    axes: Sequence[str] | None = None,
    states: Sequence[str] | None = None,
    labels: Mapping[str, str] | None = None,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """One period: the phase portrait on the left, the states over time on the right; sliding is orange.

    orbit   has system, pieces, period, multipliers, word, verdict
    axes    the two states of the phase portrait; default the first two (one state: over time only)
    states  those drawn over time; default all, at most four
    labels  axis labels by state, and "t"; default: those of the system
    """
    names = orbit.system.states
    shown = list(states or names[:4])
    pair = list(axes or names[:2])
    for name in (*shown, *pair):
        if name not in names:
            raise UsageError(unknown("state", name, names))
    check_known("state", labels or {}, ("t", *names), UsageError)
    if axes is not None and len(pair) != 2:
        raise UsageError(f"axes names {len(pair)} states, expected two.")
    text = {name: axis_label(orbit.system, name) for name in ("t", *names)} | dict(labels or {})
    with style():
        drawn = figure if figure is not None else new_figure(8.2, 0.9 + 1.25 * max(2, len(shown)))
        grid = drawn.add_gridspec(len(shown), 2 if len(pair) == 2 else 1, wspace=0.08)
        below = None
        panels = []
        for row in range(len(shown)):
            below = drawn.add_subplot(grid[row, -1], sharex=below)
            panels.append(below)
        left = drawn.add_subplot(grid[:, 0]) if len(pair) == 2 else None
        for piece in orbit.pieces:
            for segment, t, x in pieces_of(piece, _POINTS):
                _segment(segment, t, dict(zip(names, x, strict=True)), pair, shown, left, panels)
        kinds: set[str] = set()
        for event in (event for piece in orbit.pieces for event in piece.events):
            mark, colour = MARKS.get(event.kind, ("|", GREY))
            at = dict(zip(names, event.x, strict=True))
            if left is not None:
                left.plot(at[pair[0]], at[pair[1]], mark, color=colour, markersize=4, zorder=4)
            for name, ax in zip(shown, panels, strict=True):
                once = str(event.kind) if ax is panels[0] and str(event.kind) not in kinds else None
                ax.plot(event.t, at[name], mark, color=colour, markersize=3.5, zorder=4, label=once)
            kinds.add(str(event.kind))
        if left is not None:
            left.set(xlabel=text[pair[0]], ylabel=text[pair[1]])
        _legend(panels[0], any("0" in mode_text(s.mode) for piece in orbit.pieces for s in piece.segments))
        for name, ax in zip(shown, panels, strict=True):
            ax.set_ylabel(panel_label(text[name]))
            if ax is not panels[-1]:
                ax.tick_params(labelbottom=False)
        panels[-1].set_xlabel(text["t"])
        drawn.align_ylabels(panels)
        drawn.suptitle(title or _caption(orbit), x=0.01, ha="left", fontsize=10, color=INK)
    return drawn


def _segment(
    segment: Segment, t: Array, x: Mapping[str, Array], pair: Sequence[str], shown: Sequence[str], left: Any,
    panels: Sequence[Any],
) -> None:  # fmt: skip
    """Draw one segment of one mode; a reset within it is a jump."""
    colour = ORANGE if "0" in mode_text(segment.mode) else BLUE
    if left is not None:
        left.plot(x[pair[0]], x[pair[1]], color=colour)
    for name, ax in zip(shown, panels, strict=True):
        ax.plot(t, x[name], color=colour)


def _legend(ax: Any, slides: bool) -> None:
    """Sliding and the kinds of events, above the uppermost panel."""
    if slides:
        ax.plot([], [], color=ORANGE, label="sliding")
    if ax.get_legend_handles_labels()[1]:
        ax.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=3, borderpad=0.1, borderaxespad=0.3,
                  handletextpad=0.4, columnspacing=1.2)  # fmt: skip


def _caption(orbit: Any) -> str:
    kind = "neutral to first order" if orbit.verdict == "undecided" else orbit.verdict
    largest = float(np.max(np.abs(orbit.multipliers), initial=0.0))
    return f"{kind}, period {orbit.period:.8g}, largest |multiplier| {largest:.4g}\n{orbit.word}"


