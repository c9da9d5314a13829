"""Figures of stable and unstable manifolds over two states."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.base.errors import UsageError
from filippov.base.keywords import keywords
from filippov.base.names import unknown
from filippov.plot.results import result_of
from filippov.plot.style import BLUE, INK, RED, axis_label, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLORS = {"unstable": RED, "stable": BLUE}
_manifold = result_of("manifold", "system", "side", "branches", "x")


@keywords()
def plot_manifold(
    results: Any, *, names: Sequence[str] | None = None, title: str = "", figure: Figure | None = None
) -> Figure:
    """Manifolds over two states, unstable in red, stable in blue; a dot where a branch ends early.

    results  what `filippov.analysis.invariant_sets.manifold.manifold` returned, or several of one system
    names    the two states; default: the first two

    Raises UsageError.
    """
    several = list(results) if isinstance(results, list | tuple) else [results]
    for one in several:
        _manifold("plot_manifold", one)
    if not several:
        raise UsageError("there is no manifold to be drawn; give at least one.")
    system = several[0].system
    chosen = tuple(names) if names is not None else (*system.states, *system.states)[:2]
    if len(chosen) != 2:
        raise UsageError(f"names is {names!r}, expected two states.")
    for name in chosen:
        if name not in system.states:
            raise UsageError(unknown("state", name, system.states))
    i, j = (system.state_index(name) for name in chosen)
    with style():
        drawn = figure if figure is not None else new_figure(5.6, 4.0)
        ax = drawn.subplots()
        said: set[str] = set()
        for one in several:
            for branch in one.branches:
                label = None if one.side in said else one.side
                said.add(one.side)
                ax.plot(branch.x[:, i], branch.x[:, j], color=COLORS[one.side], linewidth=0.9, label=label)
                if branch.ended:
                    last = branch.x[np.all(np.isfinite(branch.x), axis=1)][-1]
                    ax.plot(last[i], last[j], ".", color=COLORS[one.side], markersize=5)
            ax.plot(one.x[i], one.x[j], "o", color=INK, markersize=4)
        ax.set(xlabel=axis_label(system, chosen[0]), ylabel=axis_label(system, chosen[1]), title=title)
        ax.legend(title="manifold")
    return drawn
