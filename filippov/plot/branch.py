"""Figures of branches: a coordinate over the parameter, stable solid, unstable dashed, special marked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.base.errors import UsageError
from filippov.base.keywords import keywords
from filippov.base.names import check_known
from filippov.plot.place import label_beside
from filippov.plot.results import result_of
from filippov.plot.style import GREEN, INK, ORANGE, PURPLE, RED, SERIES, SKY, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# A coordinate that varies by less than this part of itself is the same.
SAME = 1e-9
_MARKS = {
    "fold": ("D", RED), "period doubling": ("X", GREEN), "Neimark-Sacker": ("P", PURPLE),
    "branch point": ("s", ORANGE), "symmetry breaking": ("s", SKY), "Hopf": ("p", PURPLE),
    "pseudo-Hopf": ("p", RED), "boundary equilibrium": ("h", ORANGE),
}  # fmt: skip
# Codimension-2 points of curves, by a part of their names.
_MEETINGS = (
    ("cusp", ("^", RED)), ("generalized period doubling", ("d", GREEN)), ("resonance", ("*", PURPLE)),
    ("Takens", ("o", RED)), ("Bautin", ("o", PURPLE)), ("double grazing", ("*", SKY)),
    ("degenerate", ("*", GREEN)),
    ("grazing-", ("v", SKY)), ("boundary", ("H", ORANGE)), ("fold-", ("D", ORANGE)), ("flip-", ("X", ORANGE)),
)  # fmt: skip


@keywords(first=result_of("continuation", "parameter", "points", several=True))
def plot_branches(
    branches: Sequence[Any],
    *,
    coordinate: str | None = None,
    names: Sequence[str] = (),
    labels: Mapping[str, str] | None = None,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Branches over their parameter.

    branches    objects with parameter, points (each with value, coordinates, stable, special)
    coordinate  what is drawn; default the first that varies along the first branch, where one does
    names       one for each branch, for the legend
    labels      {"parameter": "gain P [N/m]", "coordinate": "stick position [m]"}; default: those of the
                system
    """
    filled = [branch for branch in branches if branch.points]
    if not filled:
        raise UsageError(
            "there is no branch with points to draw: run the continuation first, continuation(...).run()."
        )
    if names and len(names) != len(branches):
        raise UsageError(
            f"names has {len(names)} entries for {len(branches)} branches: give one for each, or none."
        )
    check_known("label", labels or {}, ("parameter", "coordinate"), UsageError)
    wanted = coordinate or _first(filled)
    own = getattr(filled[0], "labels", {})
    named_axes = {"parameter": filled[0].parameter, "coordinate": wanted}
    text = {place: own.get(name, name) for place, name in named_axes.items()} | dict(labels or {})
    seen: set[str] = set()
    named: list[tuple[float, float, str, str]] = []
    with style():
        drawn = figure if figure is not None else new_figure(6.4, 4.2)
        ax = drawn.subplots()
        for k, branch in enumerate(branches):
            if branch.points:
                _branch(ax, branch, wanted, SERIES[k % len(SERIES)], names[k] if names else "", seen, named)
        ax.set(xlabel=text["parameter"], ylabel=text["coordinate"])
        ax.margins(0.04)
        if title:
            ax.set_title(title, loc="left", fontsize=10.5)
        if ax.get_legend_handles_labels()[0]:
            ax.legend()
        for label in named:
            label_beside(ax, *label)
    return drawn


def draw_line(ax: Any, value: Any, height: Any, stable: Any, label: str | None, **look: Any) -> None:
    """A line that is solid where it is stable and dashed elsewhere."""
    for kind, line in ((True, "-"), (False, "--")):
        # What lies between two points is drawn as the first one is, so that no gap is left.
        part = np.where((stable == kind) | np.append(False, stable[:-1] == kind), height, np.nan)
        if np.any(np.isfinite(part)):
            ax.plot(value, part, line, label=label if kind == bool(stable[0]) else None, **look)


def _mark(special: str) -> tuple[str, str]:
    """Mark and colour of a special point."""
    if special in _MARKS or special == "grazing-sliding":
        return _MARKS.get(special, ("v", INK))
    return next((mark for part, mark in _MEETINGS if part in special), ("v", INK))


def _first(branches: Sequence[Any]) -> str:
    """The first coordinate that is not the same along the first branch, as a period that a force gives is."""
    points = branches[0].points
    for name in points[0].coordinates:
        values = [point.coordinates[name] for point in points if name in point.coordinates]
        if np.ptp(values) > SAME * np.max(np.abs(values)):
            return str(name)
    return str(next(iter(points[0].coordinates)))


def _branch(
    ax: Any, branch: Any, wanted: str, colour: str, name: str, seen: set[str],
    named: list[tuple[float, float, str, str]],
) -> None:  # fmt: skip
    """The line of one branch and the marks of its special points; `named` takes their labels."""
    points = [point for point in branch.points if wanted in point.coordinates]
    value = np.array([point.value for point in points])
    height = np.array([point.coordinates[wanted] for point in points])
    curve = str(getattr(branch, "kind", "")).endswith(" curve")
    # On a curve of special points stability is marginal; what is dashed there is no such point.
    stable = np.array([point.note != "neutral saddle" if curve else point.stable for point in points])
    draw_line(ax, value, height, stable, label=name or None, color=colour, linewidth=1.4)
    for point in points:
        if point.special:
            mark, shade = _mark(point.special)
            label = None if point.special in seen else point.special
            seen.add(point.special)
            ax.plot(
                point.value, point.coordinates[wanted], mark, color=shade, markersize=6, zorder=5,
                label=label, clip_on=False, linestyle="none",
            )  # fmt: skip
            text = point.special if curve else f"{round(point.value, 10) + 0.0:.6g}"
            if curve and (again := f"{text} at {round(point.value, 6) + 0.0:.4g}") in seen:
                # Two curves meet there, and both have the point.
                continue
            if curve:
                seen.add(again)
            named.append((point.value, point.coordinates[wanted], text, shade))
