"""Figures of what holds where: cells over two parameters, basins over two states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.base.errors import UsageError
from filippov.base.escape import figure_text
from filippov.base.keywords import keywords
from filippov.base.label import unit_of
from filippov.base.names import check_known
from filippov.plot.results import result_of
from filippov.plot.style import BLUE, GREEN, GREY, INK, ORANGE, PALE, PURPLE, RED, SKY, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RESTING = ("#e4f2e9", "#bcdff5", "#7fb8de", "#4a90c2")
# For readers and printers without colours.
HATCHES = {
    "stable": ("", "..", "xx", "++"), "unstable": ("//", "\\\\", "||", "--"),
    "undecided": ("o", "oo", "O", "OO"),
}  # fmt: skip
PALETTES = {
    "stable": RESTING, "unstable": ("#fbe3d6", "#f3b79b", "#e08a66", "#c85f3d"),
    "undecided": ("#f0f0f0", "#d6d6d6", "#b4b4b4", "#8c8c8c"),
}  # fmt: skip
REST = {"stable": "attracts", "unstable": "repels", "undecided": "undecided"}
HATCHED = "#9a9a9a"
BASINS = (SKY, ORANGE, GREEN, PURPLE, BLUE, RED)
LINES = (INK, RED, PURPLE, GREEN)


@keywords(first=result_of("regions", "names", "cycles", "set_verdict"))
def plot_regions(
    result: Any, *, labels: Mapping[str, str] | None = None, title: str = "", figure: Figure | None = None
) -> Figure:
    """Number of cycles in every cell by colour, and whether the set of equilibria attracts; borders as lines.

    result  what `filippov.analysis.diagrams.regions.regions` returned
    labels  labels with units, by name of parameter; default: those of the system
    """
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    with style():
        drawn = figure if figure is not None else new_figure(6.4, 4.2)
        ax = drawn.subplots()
        kinds, names, colors, hatches = _kinds(result)
        _colour_cells(ax, result, kinds, colors)
        for number, hatch in enumerate(hatches):
            if hatch:
                ax.pcolor(
                    result.x, result.y, np.ma.masked_not_equal(kinds, number), shading="nearest",
                    cmap=ListedColormap(["none"]), hatch=hatch, edgecolors=HATCHED, linewidth=0,
                    rasterized=True,
                )  # fmt: skip
        handles: list[Any] = [
            Patch(facecolor=c, edgecolor=HATCHED, linewidth=0, hatch=h, label=n)
            for c, n, h in zip(colors, names, hatches, strict=True)
        ]
        for k, (name, points) in enumerate(result.borders):
            (line,) = ax.plot(points[:, 0], points[:, 1], color=LINES[k % len(LINES)], label=name)
            handles.append(line)
        _name_axes(ax, result, labels)
        ax.set(title=title)
        ax.set(xlim=(result.x.min(), result.x.max()), ylim=(result.y.min(), result.y.max()))
        drawn.legend(handles=handles, loc="outside right upper")
    return drawn


@keywords(first=result_of("period_map", "names", "period"))
def plot_periods(
    result: Any, *, labels: Mapping[str, str] | None = None, title: str = "", figure: Figure | None = None
) -> Figure:
    """The period that the solution settles to in every cell, by colour.

    result  what `filippov.analysis.diagrams.period_map.period_map` returned
    labels  labels with units, by name of parameter; default: those of the system
    """
    from matplotlib.patches import Patch

    with style():
        drawn = figure if figure is not None else new_figure(6.4, 4.2)
        ax = drawn.subplots()
        values, kinds = np.unique(result.period, return_inverse=True)
        found = values.tolist()
        periods = [n for n in found if n > 0]
        tints = {0: ("no period found", GREY), -1: ("not computed", PALE)}
        for k, n in enumerate(periods[: len(BASINS)]):
            tints[n] = (f"period {n}", BASINS[k])
        for n in periods[len(BASINS) :]:
            tints[n] = (f"period above {periods[len(BASINS) - 1]}", INK)
        _colour_cells(ax, result, kinds.reshape(result.period.shape), [tints[n][1] for n in found])
        shown = dict.fromkeys(tints[n] for n in found)
        _name_axes(ax, result, labels)
        ax.set(title=title)
        drawn.legend(
            handles=[Patch(facecolor=tint, label=name) for name, tint in shown], loc="outside right upper"
        )
    return drawn


def _colour_cells(ax: Any, result: Any, kinds: Any, colors: Sequence[str]) -> None:
    """Cell by cell the colour of its kind, 0, 1, ..."""
    from matplotlib.colors import ListedColormap

    ax.pcolormesh(
        result.x, result.y, kinds, cmap=ListedColormap(colors), vmin=-0.5, vmax=len(colors) - 0.5,
        shading="nearest", rasterized=True,
    )  # fmt: skip


def _name_axes(ax: Any, result: Any, labels: Mapping[str, str] | None) -> None:
    check_known("label", labels or {}, result.names, UsageError)
    text = {name: name for name in result.names} | dict(result.labels) | dict(labels or {})
    ax.set(xlabel=text[result.names[0]], ylabel=text[result.names[1]])


def _kinds(result: Any) -> tuple[Any, list[str], list[str], list[str]]:
    kinds = np.zeros(result.cycles.shape, dtype=int)
    names: list[str] = []
    colors: list[str] = []
    hatches: list[str] = []
    parts = (result.cycles, result.stable, result.undecided, result.set_verdict)
    keys = sorted(set(zip(*(part.ravel().tolist() for part in parts), strict=True)))
    for number, (cycles, stable, left, verdict) in enumerate(keys):
        same = (result.cycles == cycles) & (result.stable == stable)
        same &= (result.undecided == left) & (result.set_verdict == verdict)
        kinds[same] = number
        if cycles < 0:
            names.append("not computed")
            colors.append(PALE)
            hatches.append("")
            continue
        word = "cycle" if cycles == 1 else "cycles"
        what = "no cycle" if cycles == 0 else f"{cycles} {word}, {stable} stable"
        what += f", {left} undecided" if left > 0 else ""
        names.append(f"{what}; rest {REST[verdict]}")
        palette = PALETTES[verdict]
        colors.append(palette[min(cycles, len(palette) - 1)])
        hatches.append(HATCHES[verdict][min(cycles, len(palette) - 1)])
    return kinds, names, colors, hatches


@keywords(first=result_of("basin", "names", "label", "attractors", "at"))
def plot_basin(
    result: Any, *, labels: Mapping[str, str] | None = None, title: str = "", figure: Figure | None = None
) -> Figure:
    """Colour of the attractor for every initial state of a plane.

    result  what `filippov.analysis.diagrams.basin.basin` returned
    labels  labels with units, by name of state; default: those of the system
    """
    from matplotlib.patches import Patch

    special = {-1: ("to none found", PALE), -2: ("beyond the interval", "#efefef"), -3: ("no event", GREY)}
    with style():
        drawn = figure if figure is not None else new_figure(6.4, 4.4)
        ax = drawn.subplots()
        kinds = np.zeros(result.label.shape, dtype=int)
        names, colors = [], []
        unit = unit_of(result.labels.get("d", ""))
        unit = figure_text(f" {unit}") if unit else ""
        for number, label in enumerate(np.unique(result.label).tolist()):
            kinds[result.label == label] = number
            if label < 0:
                name, color = special[label]
            else:
                d = result.attractors[label]
                name = "rest" if d == 0.0 else f"cycle, d = {d:.4g}{unit}"
                color = BASINS[label % len(BASINS)]
            names.append(name)
            colors.append(color)
        _colour_cells(ax, result, kinds, colors)
        held = ", ".join(f"{name} = {value:g}" for name, value in result.at.items())
        _name_axes(ax, result, labels)
        ax.set(title=title or held)
        handles = [Patch(color=c, label=n) for c, n in zip(colors, names, strict=True)]
        drawn.legend(handles=handles, loc="outside right upper", title="goes to")
    return drawn
