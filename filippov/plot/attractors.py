"""Figures of attractors and their basins over two states."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.base.keywords import keywords
from filippov.plot.results import result_of
from filippov.plot.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PALE,
    PURPLE,
    RED,
    SKY,
    axis_label,
    new_figure,
    style,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BASINS = (SKY, ORANGE, GREEN, PURPLE, BLUE, RED)
OTHERS = {
    -1: ("undecided", "#c9c9c9"), -2: ("escapes", "#efefef"), -3: ("failed", GREY),
    -4: ("on what does not attract", PALE), -5: ("not identified", "#a0a0a0"),
}  # fmt: skip


@keywords(first=result_of("attractors", "attractors", "states", "picture"))
def plot_attractors(result: Any, *, title: str = "", figure: Figure | None = None) -> Figure:
    """Colour of the attractor for every initial state of the plane, and the attractors in it.

    result  what `filippov.analysis.invariant_sets.attractors.attractors` returned, with a plane or without:
            then the drawn states are shown over the first two states
    """
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    with style():
        drawn = figure if figure is not None else new_figure(6.8, 4.4)
        ax = drawn.subplots()
        names = result.names or (*result.system.states, *result.system.states)[:2]
        i, j = (result.system.state_index(name) for name in names)
        labels = result.picture if result.names else result.label
        handles = []
        kinds = np.zeros(labels.shape, dtype=int)
        colors = []
        for number, label in enumerate(np.unique(labels).tolist()):
            name, color = OTHERS[label] if label < 0 else (_name(result, label), BASINS[label % len(BASINS)])
            kinds[labels == label] = number
            colors.append(color)
            handles.append(Patch(color=color, label=name))
        if result.names:
            ax.pcolormesh(
                result.x, result.y, kinds, cmap=ListedColormap(colors), vmin=-0.5, vmax=len(colors) - 0.5,
                shading="nearest", rasterized=True,
            )  # fmt: skip
        else:
            across, up = result.states[:, i], result.states[:, j]
            ax.scatter(across, up, c=[colors[k] for k in kinds], s=8, linewidths=0)
        for one in result.attractors:
            _attractor(ax, one, i, j)
        held = ", ".join(f"{name} = {value:g}" for name, value in result.at.items())
        ax.set(title=title or held)
        ax.set(xlabel=axis_label(result.system, names[0]), ylabel=axis_label(result.system, names[1]))
        if i != j:
            ax.set(xlim=result.box[names[0]], ylim=result.box[names[1]])
        drawn.legend(handles=handles, loc="outside right upper", title="goes to")
    return drawn


def _name(result: Any, label: int) -> str:
    one = result.attractors[label]
    share = result.shares[label][0]
    what = str(one.kind)
    if one.kind == "periodic":
        what = f"period {one.period}" if result.kind == "strobe" else f"cycle, T = {one.duration:.4g}"
    return f"{what} ({100 * share:.3g} %)" if len(result.label) else what


def _attractor(ax: Any, one: Any, i: int, j: int) -> None:
    if one.kind == "equilibrium set":
        order = np.lexsort((one.states[:, j], one.states[:, i]))
        ax.plot(one.states[order, i], one.states[order, j], color=INK, linewidth=2.0)
    elif one.orbit is not None and not one.orbit.forced:
        solution = one.orbit.solution()
        x = solution.sol(np.linspace(one.orbit.t0, solution.t_end, 800))
        ax.plot(x[i], x[j], color=INK, linewidth=1.0)
    else:
        size = 1.6 if one.kind in ("chaotic", "aperiodic") else 5.0
        edge = {} if size < 5 else {"markeredgecolor": "white", "markeredgewidth": 0.8}
        ax.plot(one.states[:, i], one.states[:, j], "o", color=INK, markersize=size, **edge)
