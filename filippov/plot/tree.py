"""Figures of a tree of solutions: all of them over time, and the tree itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from filippov.base.errors import UsageError
from filippov.base.given import Amount
from filippov.base.keywords import keywords
from filippov.base.names import check_known
from filippov.base.status import Status
from filippov.plot.style import BLUE, GREY, INK, RED, SLIDING, axis_label, column, new_figure, style
from filippov.solving.solution_tree import SolutionTree, TreeBranch

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_LABELS = 40


@keywords()
def plot_branches(
    tree: SolutionTree,
    states: Sequence[str] | str | None = None,
    *,
    labels: Mapping[str, str] | None = None,
    points: Amount = 400,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """All solutions over time, one panel per state; sliding drawn thick, branching points marked.

    states  names of the states to show; default all
    labels  labels with units, by name: {"t": "time [s]", "x": "position [m]"}
    points  samples over the span of a branch

    Raises UsageError for unknown names, ImportError without matplotlib.
    """
    known = tree.system.states
    names = list(known) if states is None else [states] if isinstance(states, str) else list(states)
    check_known("state", names, known, UsageError)
    text = dict(labels or {})
    check_known("label", text, ("t", *known), UsageError)
    with style():
        drawn = figure if figure is not None else new_figure(7.0, 1.0 + 1.9 * len(names))
        axes = column(drawn, len(names))
        for name, ax in zip(names, axes, strict=True):
            i = known.index(name)
            for branch in tree.branches:
                _draw_branch(ax, branch, i, points)
            _mark_points(ax, tree, i)
            ax.set_ylabel(text.get(name, axis_label(tree.system, name)))
            ax.margins(y=0.08)
        axes[-1].set_xlabel(text.get("t", axis_label(tree.system, "t")))
        low, high = sorted(tree.problem.t_span)
        axes[-1].set_xlim(low, high)
        handles, words = axes[0].get_legend_handles_labels()
        unique = dict(zip(words, handles, strict=True))
        if title:
            axes[0].set_title(title, loc="left", pad=24, fontsize=10.5)
        axes[0].legend(
            unique.values(), unique.keys(), loc="lower left", bbox_to_anchor=(0, 1.0), ncols=4,
            borderpad=0.1, borderaxespad=0.3, handletextpad=0.4, columnspacing=1.2,
        )  # fmt: skip
    return drawn


def _draw_branch(ax: Any, branch: TreeBranch, i: int, points: int) -> None:
    solution = branch.solution
    for sliding, group in groupby(solution.segments, key=lambda segment: 0 in segment.mode):
        parts = list(group)
        t0, t1 = parts[0].t0, parts[-1].t1
        if t0 == t1:
            continue
        if solution.sol is None:
            inside = (solution.t - t0) * (solution.t - t1) <= 0
            t, x = solution.t[inside], solution.y[i, inside]
        else:
            t = np.linspace(t0, t1, max(points, 2))
            x = solution.sol(t)[i]
        ax.plot(
            t, x, color=SLIDING[0] if sliding else BLUE, linewidth=2.6 if sliding else 1.2,
            solid_capstyle="round", zorder=3 if sliding else 2, label="sliding" if sliding else "solution",
        )  # fmt: skip


def _mark_points(ax: Any, tree: SolutionTree, i: int) -> None:
    """Points where branches part, and ends that are none of the span."""
    parted = [branch.solution for branch in tree.branches if branch.children]
    early = [leaf.solution for leaf in tree.leaves() if not leaf.solution.success]
    for found, mark, colour, label in (
        (parted, "o", INK, "branching point"),
        (early, "X", RED, "ended early"),
    ):
        if found:
            t, x = [s.t_end for s in found], [s.x_end[i] for s in found]
            ax.plot(t, x, mark, color=colour, markersize=5, markeredgewidth=0, zorder=5, label=label)


@keywords()
def plot_tree(tree: SolutionTree, *, title: str = "", figure: Figure | None = None) -> Figure:
    """The tree itself: a line per branch over its time, its modes above it, joined where branches part.

    Raises ImportError without matplotlib.
    """
    heights = _heights(tree)
    leaves = len(tree.leaves())
    with style():
        drawn = figure if figure is not None else new_figure(7.0, 1.0 + 0.34 * max(leaves, 2))
        ax = drawn.subplots()
        for branch in tree.branches:
            y = heights[branch.number]
            for segment in branch.solution.segments:
                colour = SLIDING[0] if 0 in segment.mode else BLUE
                ax.plot(
                    [segment.t0, segment.t1], [y, y], color=colour, linewidth=2.2, solid_capstyle="butt",
                    zorder=3,
                )  # fmt: skip
            for child in tree.children(branch):
                ax.plot([branch.t1] * 2, [y, heights[child.number]], color=GREY, linewidth=0.8, zorder=2)
            if branch.children:
                ax.plot(branch.t1, y, "o", color=INK, markersize=4.5, markeredgewidth=0, zorder=5)
        if leaves <= MOST_LABELS:
            _write_modes(ax, tree, heights)
        low, high = sorted(tree.problem.t_span)
        ax.set(ylim=(-0.8, leaves - 0.2), xlabel=axis_label(tree.system, "t"), yticks=[])
        ends = [leaf.solution.status is Status.SUCCESS for leaf in tree.leaves()]
        ax.set_xlim(low - 0.02 * (high - low), high + (0.02 if all(ends) else 0.16) * (high - low))
        ax.spines["left"].set_visible(False)
        if title:
            ax.set_title(title, loc="left")
    return drawn


def _heights(tree: SolutionTree) -> dict[int, float]:
    """Leaves in rows, each branch in the middle of what goes on from it."""
    heights: dict[int, float] = {}
    row = len(tree.leaves()) - 1
    waiting = [tree.root]
    while waiting:  # leaves from the top downwards, in the order of the candidates
        branch = waiting.pop()
        if not branch.children:
            heights[branch.number] = float(row)
            row -= 1
        waiting += reversed(tree.children(branch))
    for branch in reversed(tree.branches):  # parents stand before their children
        if branch.children:
            rows = [heights[number] for number in branch.children]
            heights[branch.number] = 0.5 * (min(rows) + max(rows))
    return heights


def _write_modes(ax: Any, tree: SolutionTree, heights: Mapping[int, float]) -> None:
    direction = 1.0 if tree.problem.t_span[1] >= tree.problem.t_span[0] else -1.0
    for branch in tree.branches:
        y = heights[branch.number]
        if branch.t0 != branch.t1:
            ax.annotate(
                " ".join(branch.solution.modes[:4]), (branch.t0, y), xytext=(5 * direction, 2),
                textcoords="offset points", fontsize=8, color=INK, va="bottom",
                ha="left" if direction > 0 else "right",
            )  # fmt: skip
        status = branch.solution.status
        if not branch.children and status is not Status.SUCCESS:
            ax.annotate(
                f" {status.value.replace('_', ' ')}", (branch.t1, y), fontsize=8, color=RED, va="center"
            )
