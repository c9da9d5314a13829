"""Figure of gains with and without limit cycles: rho over two gains, with the best gains and their margin."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.base.errors import UsageError
from filippov.base.keywords import keywords
from filippov.base.names import check_known
from filippov.plot.results import result_of
from filippov.plot.style import INK, ORANGE, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GROWING = "#f3d9c4"
LEVELS = (0.0, 0.25, 0.5, 0.75, 1.0)


@keywords(first=result_of("gain_map", "names", "ratio", several=True))
def plot_gain_maps(
    maps: Sequence[Any],
    *,
    tuning: Any = None,
    labels: Mapping[str, str] | None = None,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Largest ratio of successive excursions over pairs of gains: below 1 there is no cycle.

    maps    what `gain_map` returned, one panel each
    tuning  what `tune` returned: its best gains as a star, its margin as a box
    labels  labels with units, by name of gain; default: those of the system
    """
    from matplotlib import colormaps

    if not maps:
        raise UsageError("there is no map to draw; give at least one, what gain_map(...) returned.")
    text = {name: label for item in maps for name, label in item.labels.items()} | dict(labels or {})
    check_known("label", text, {name for item in maps for name in item.names}, UsageError)
    with style():
        drawn = figure if figure is not None else new_figure(4.6 * len(maps) + 0.6, 3.9)
        axes = np.ravel(drawn.subplots(1, len(maps), squeeze=False))
        filled = None
        colors = colormaps["Blues_r"].with_extremes(over=GROWING)
        for ax, item in zip(axes, maps, strict=True):
            ratio = np.where(np.isfinite(item.ratio), item.ratio, 1e3)
            filled = ax.contourf(item.x, item.y, ratio, levels=LEVELS, cmap=colors, extend="max",
                                 hatches=(*[None] * (len(LEVELS) - 1), "//"))  # fmt: skip
            if np.min(ratio) < 1 < np.max(ratio):
                ax.contour(item.x, item.y, ratio, levels=[1.0], colors=[ORANGE], linewidths=1.6)
            if tuning is not None and tuning.best is not None:
                _mark(ax, item, tuning)
            across, up = item.names
            ax.set(xlabel=text.get(across, across), ylabel=text.get(up, up))
            ax.set(xlim=item.x[[0, -1]], ylim=item.y[[0, -1]])
        if tuning is not None and tuning.best is not None:
            drawn.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
        if filled is not None:
            bar = drawn.colorbar(filled, ax=list(axes), ticks=LEVELS)
            bar.set_label("largest |next stick / stick|;\nabove 1 (line): excursions grow")
        if title:
            drawn.suptitle(title, color=INK, fontsize=10)
    return drawn


def _mark(ax: Any, item: Any, tuning: Any) -> None:
    a, b = (tuning.best[name] for name in item.names)
    s = tuning.margin
    ax.plot([a], [b], "*", color=INK, markersize=10, clip_on=False, linestyle="none", label="best gains")
    box = [(a / s, b / s), (a * s, b / s), (a * s, b * s), (a / s, b * s), (a / s, b / s)]
    name = f"margin, factor {s:.3g}"
    ax.plot(*zip(*box, strict=True), color=INK, linewidth=0.9, linestyle="--", label=name)
