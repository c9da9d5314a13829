"""A mode graph as a figure: modes at the place of their signs, transitions as numbered arcs, guards beside
them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import networkx as nx
import numpy as np
import numpy.typing as npt

from filippov.base.arrays import Array
from filippov.base.errors import UsageError
from filippov.base.escape import figure_text
from filippov.base.keywords import keywords
from filippov.base.status import EventKind
from filippov.graphs.graph_io import node_label
from filippov.plot.graph_summary import summary
from filippov.plot.results import result_of
from filippov.plot.style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, RED, new_figure, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Point = npt.NDArray[np.float64]
_SIGNS = {"-": -1, "0": 0, "+": 1, ".": 0}
_CUBE = np.array([[2.2, 0.0, 0.8], [0.0, 2.2, 0.62]])
_COLOURS = {EventKind.CROSSING: BLUE, EventKind.ENTRY: RED, EventKind.EXIT: GREEN, EventKind.GRAZING: PURPLE}
MOST_GUARDS, MOST_MODES, MOST_ROWS = 24, 40, 28
MARGIN, LEAST_WIDTH = 0.95, 5.0


@keywords(first=result_of("possible_graph", "nodes", "adjacency", Solution="observed_graph(solution)"))
def plot_graph(
    graph: nx.MultiDiGraph,
    *,
    names: Mapping[str, str] | None = None,
    guards: bool = True,
    title: str = "",
    figure: Figure | None = None,
) -> Figure:
    """Draw a mode graph; sliding modes are boxes, arcs are coloured by kind and bend to the left of their
    direction.

    names   words shown for modes, by mode text
    guards  list the transitions beside the graph, with guards or counts (left out beyond 24)

    More than 40 modes are drawn in groups by the number of surfaces that slide, or, of an observed graph,
    those entered most often by themselves and the others together; for modes of your choice give
    graph.subgraph([...]).
    With one or two surfaces a mode is placed at its signs on the axes, otherwise networkx lays the graph out,
    without crossings if possible. Raises UsageError for an empty graph, ImportError without matplotlib.
    """
    if not graph:
        raise UsageError(
            "the graph has no modes to draw: give what possible_graph(system) or observed_graph(solution) "
            "returned."
        )
    many = len(graph) > MOST_MODES
    if many:
        graph, places, said = summary(graph)
        title, most = f"{title}: {said}" if title else said, 14.0
    labels = {mode: _label(mode, values, names or {}) for mode, values in graph.nodes(data=True)}
    if not many:
        places, most = places_of(graph), 8.0
        if _overlap(places, labels, _unit(places, most)):
            places, most = _columns(graph, labels), 14.0
    edges = list(graph.edges(data=True))
    table = guards and not many and 0 < len(edges) <= MOST_GUARDS
    with style():
        width, height = _extent(places, most)
        lines = len(edges) if table else 0
        beside = _text_inches(edges) if table else 0.0
        size = (max(width + beside, LEAST_WIDTH * many), max(height + 0.7, 0.26 * lines + 0.5))
        drawn = figure if figure is not None else new_figure(*size)
        if table:
            left, right = drawn.subplots(1, 2, width_ratios=(width, beside))
            _list(right, edges, size[1])
        else:
            left = drawn.subplots()
        _draw(left, graph, places, labels, table)
        _key(left, edges, _told(graph))
        if title:
            left.set_title(title, loc="left")
    return drawn


def _extent(places: Mapping[str, Point], most: float) -> tuple[float, float]:
    """Width and height of the graph in inches, at most `most` each."""
    span, unit = _span(places), _unit(places, most)
    return float(span[0]) * unit, float(span[1]) * unit


def _span(places: Mapping[str, Point]) -> Point:
    corners = np.array(list(places.values()))
    return np.asarray(corners.max(axis=0) - corners.min(axis=0) + 2 * MARGIN)


def _unit(places: Mapping[str, Point], most: float) -> float:
    """Inches for a step of 1."""
    return min(1.1, most / float(_span(places).max()))


def _label(mode: str, values: Mapping[str, Any], names: Mapping[str, str]) -> str:
    return node_label(f"{names[mode]} ({mode})" if mode in names else mode, values)


def _inches(label: str) -> Point:
    """Width and height of a mode with its frame."""
    lines = label.splitlines()
    return np.array([0.088 * max(map(len, lines)) + 0.2, 0.19 * len(lines) + 0.17])


def _overlap(places: Mapping[str, Point], labels: Mapping[str, str], unit: float) -> bool:
    """Whether a mode lies on another one."""
    at = unit * np.array(list(places.values()))
    half = np.array([_inches(labels[mode]) for mode in places]) / 2
    apart = np.abs(at[:, None] - at[None]) < half[:, None] + half[None]
    return int(np.count_nonzero(np.all(apart, axis=2))) > len(places)


def _columns(graph: nx.MultiDiGraph, labels: Mapping[str, str]) -> dict[str, Point]:
    """Modes below each other: on the left those that slide on no surface, then those on one, on two, ..."""
    widest, highest = np.max([_inches(label) for label in labels.values()], axis=0)
    out, right = {}, 0.0
    for count in sorted({mode.count("0") for mode in graph}):
        group = [mode for mode in graph if mode.count("0") == count]
        parts = -(-len(group) // MOST_ROWS)
        for k in range(parts):
            part = group[k::parts]
            for row, mode in enumerate(part):
                out[mode] = np.array([right, ((len(part) - 1) / 2 - row) * (highest + 0.06)])
            right += widest + 0.9
    return out


def _text_inches(edges: list[Any]) -> float:
    return min(9.5, 0.6 + 0.068 * max(len(_line(a, b, values)) for a, b, values in edges))


def places_of(graph: nx.MultiDiGraph) -> dict[str, Point]:
    """Where the modes stand: at their signs for one or two surfaces."""
    m = max(len(mode) for mode in graph)
    if m == 1:
        return {mode: np.array([1.6 * _SIGNS[mode], 0.0]) for mode in graph}
    if m == 2:
        return {mode: np.array([1.5 * _SIGNS[mode[0]], 1.5 * _SIGNS[mode[1]]]) for mode in graph}
    simple = nx.Graph((a, b) for a, b in graph.edges() if a != b)
    simple.add_nodes_from(graph)
    planar, _ = nx.check_planarity(simple)
    if m == 3 and not planar:  # the cube of the signs, seen from the side
        return {mode: _CUBE @ [_SIGNS[c] for c in mode] for mode in graph}
    layout = nx.planar_layout(simple) if planar else nx.kamada_kawai_layout(simple)
    scale = 0.9 * math.sqrt(len(layout))
    return {mode: scale * np.asarray(point, dtype=float) for mode, point in layout.items()}


@dataclass(frozen=True)
class Node:
    """A mode as drawn: its place, and half its width and height in points."""

    place: Point
    label: str

    def gap(self, direction: Point) -> float:
        """Distance from the middle to the frame, in points, with a little air."""
        lines = self.label.splitlines()
        width, height = 3.1 * max(map(len, lines)) + 8.0, 6.5 * len(lines) + 5.0
        unit = np.abs(direction) / np.linalg.norm(direction)
        return float(min(width / max(unit[0], 1e-9), height / max(unit[1], 1e-9))) + 1.0


def _draw(
    ax: Any, graph: nx.MultiDiGraph, places: Mapping[str, Point], labels: Mapping[str, str], table: bool
) -> None:
    nodes = {}
    for mode, values in graph.nodes(data=True):
        label = labels[mode]
        nodes[mode] = Node(places[mode], label)
        sliding = bool(values.get("sliding"))
        ax.text(
            *places[mode], label, ha="center", va="center", fontsize=10, color=INK, zorder=5,
            linespacing=1.25, bbox={
                "boxstyle": "square,pad=0.45" if sliding else "round,pad=0.45,rounding_size=0.9",
                "facecolor": "#fdebd0" if sliding else "white", "edgecolor": ORANGE if sliding else GREY,
                "linewidth": 2.0 if graph.graph.get("start") == mode else 1.1,
            },
        )  # fmt: skip
    used: dict[tuple[str, str], int] = {}
    corners = list(places.values())
    for number, (a, b, values) in enumerate(graph.edges(data=True), start=1):
        repeat = used[a, b] = used.get((a, b), -1) + 1
        text = str(number) if table else str(values.get("count", ""))
        corners.append(_arc(ax, nodes, a, b, _colour(values), repeat, text))
    (x0, y0), (x1, y1) = np.min(corners, axis=0) - MARGIN, np.max(corners, axis=0) + MARGIN
    ax.set(xlim=(x0, x1), ylim=(y0, y1), aspect="equal")
    ax.axis("off")


def _arc(ax: Any, nodes: Mapping[str, Node], a: str, b: str, colour: str, repeat: int, text: str) -> Array:
    """Draw an edge; returns where its middle is."""
    from matplotlib.patches import FancyArrowPatch

    start, end = nodes[a].place, nodes[b].place
    if a == b:
        middle = start + np.array([0.0, 0.62 + 0.3 * repeat])
        bend, gaps = 1.6 + 0.8 * repeat, (8.0, 8.0)
        ends = (start + np.array([-0.16, 0.1]), start + np.array([0.16, 0.1]))
    else:
        chord = end - start
        bend = 0.18 + 0.2 * repeat + (0.16 if _passes(nodes, a, b) else 0.0)
        left = np.array([-chord[1], chord[0]])
        middle = (start + end) / 2 + left * bend / 2
        ends = (start, end)
        gaps = (nodes[a].gap(chord + 2 * bend * left), nodes[b].gap(-chord + 2 * bend * left))
    ax.add_patch(
        FancyArrowPatch(
            *ends, arrowstyle="-|>", mutation_scale=11, shrinkA=gaps[0], shrinkB=gaps[1], color=colour,
            linewidth=1.3, zorder=2, connectionstyle=f"arc3,rad={-bend}",
        )
    )  # fmt: skip
    if text:
        ax.text(
            *middle, figure_text(text), ha="center", va="center", fontsize=8, color=colour, zorder=4,
            bbox={"boxstyle": "circle,pad=0.2", "facecolor": "white", "edgecolor": colour, "linewidth": 0.7},
        )  # fmt: skip
    return np.asarray(middle, dtype=float)


def _passes(nodes: Mapping[str, Node], a: str, b: str) -> bool:
    """Whether another mode stands on the straight line between two."""
    start, chord = nodes[a].place, nodes[b].place - nodes[a].place
    for mode, node in nodes.items():
        along = float((node.place - start) @ chord / (chord @ chord))
        if mode not in {a, b} and 0 < along < 1 and np.linalg.norm(node.place - start - along * chord) < 0.3:
            return True
    return False


def _colour(values: Mapping[str, Any]) -> str:
    return next((colour for kind, colour in _COLOURS.items() if values.get("kind") == str(kind)), INK)


def _line(a: str, b: str, values: Mapping[str, Any]) -> str:
    ends = f"{a} → {b}   "
    if "count" in values:
        return f"{ends}{values['surface']}: {values['kind']}, {values['count']} ×"
    return f"{ends}{values.get('formula') or values.get('kind', '')}"


def _list(ax: Any, edges: list[Any], height: float) -> None:
    """The transitions by number, one per line."""
    rows = max(len(edges), height / 0.26 - 2)
    top = (rows - len(edges)) / 2
    ax.set(xlim=(0, 1), ylim=(rows, 0))
    ax.axis("off")
    for number, (a, b, values) in enumerate(edges, start=1):
        y = top + number - 0.5
        ax.text(0.0, y, str(number), color=_colour(values), fontsize=8.5, ha="right", va="center")
        ax.text(0.02, y, figure_text(_line(a, b, values)), color=INK, fontsize=8.5, ha="left", va="center")


def _told(graph: nx.MultiDiGraph) -> str:
    """What the numbers in the modes of an observed graph are."""
    if not any("visits" in values for _, values in graph.nodes(data=True)):
        return ""
    unit = graph.graph.get("time_unit", "")
    return f"in a mode: times entered × mean duration{f' [{unit}]' if unit else ''}"


def _key(ax: Any, edges: list[Any], told: str) -> None:
    from matplotlib.lines import Line2D

    kinds = dict.fromkeys(str(values.get("kind", "")) for _, _, values in edges)
    handles = [Line2D([], [], color=_colour({"kind": kind}), label=kind) for kind in kinds if kind]
    if handles:
        ax.legend(
            handles=handles, loc="lower center", bbox_to_anchor=(0.5, -0.02), ncols=min(len(handles), 3),
            title=told, title_fontsize=8.5, alignment="center",
        )  # fmt: skip
