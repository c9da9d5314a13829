"""The modes of the solution, placed by their signs, and its transitions with their counts."""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov import EventKind, Solution
from filippov.app.explorer.look import LOW, Figure, empty, figure, plain
from filippov.app.explorer.time_figure import mode_words
from filippov.plot.graph import places_of
from filippov.plot.style import BLUE, GREEN, GREY, INK, ORANGE, PURPLE, RED

COLOURS = {str(EventKind.CROSSING): BLUE, str(EventKind.ENTRY): RED, str(EventKind.EXIT): GREEN,
           str(EventKind.GRAZING): PURPLE}  # fmt: skip
MOST_MODES = 40
NODE = 34  # pixels across a mode
GAP = 0.26  # between a mode and the end of an arc, in the units of the picture


def graph_figure(solution: Solution) -> Figure:
    """Boxes are sliding modes; an arc is an event, thicker at its end, with its count beside it."""
    graph = solution.mode_graph()
    if not graph or len(graph) > MOST_MODES:
        what = "The system has no surfaces" if not graph else f"The solution goes through {len(graph)} modes"
        return empty(f"{what}: there is no graph to draw.")
    if not solution.system.surface_names:
        return empty("The system has no surfaces: it has one mode.")
    places = places_of(graph)
    data: list[dict[str, Any]] = []
    shown: set[str] = set()
    used: dict[tuple[str, str], int] = {}
    for a, b, values in graph.edges(data=True):
        repeat = used[a, b] = used.get((a, b), -1) + 1
        kind = str(values.get("kind", ""))
        bend = 0.22 + 0.18 * repeat
        if any(_between(places[a], places[b], places[mode]) for mode in graph):
            bend += 0.28  # around the mode between the two
        number = str(values.get("count", ""))
        data.append(_arc(places[a], places[b], bend, repeat, kind, number, kind not in shown))
        shown.add(kind)
    surfaces, signs = solution.system.surface_names, {"+": 1, "0": 0, "-": -1}
    for mode in graph:
        sliding = "0" in mode
        words = mode_words(surfaces, tuple(signs.get(c, 1) for c in mode))
        data.append({
            "type": "scatter", "mode": "markers+text", "x": [float(places[mode][0])],
            "y": [float(places[mode][1])], "text": [plain(mode)], "showlegend": False,
            "hovertext": [plain(words)], "hoverinfo": "text", "textfont": {"size": _fitting(mode)},
            "marker": {
                "symbol": "square" if sliding else "circle", "size": NODE,
                "color": "#fdebd0" if sliding else "white",
                "line": {"width": 2, "color": ORANGE if sliding else GREY}},
        })  # fmt: skip
    corners = np.array(list(places.values()))
    (x0, y0), (x1, y1) = corners.min(axis=0) - 0.9, corners.max(axis=0) + 0.9
    if any(a == b for a, b in graph.edges()):
        y1 += 0.5
    hidden = {"visible": False, "fixedrange": True}
    axes = {"x": {**hidden, "range": [x0, x1]}, "y": {**hidden, "range": [y0, y1], "scaleanchor": "x"}}
    return figure(data, axes, height=LOW, margin={"l": 4, "r": 4, "t": 8, "b": 4}, hovermode="closest")


def _between(start: Any, end: Any, place: Any) -> bool:
    """Whether a place lies on the straight line from start to end, or nearer to it than a mode is wide."""
    chord = end - start
    length = float(np.linalg.norm(chord))
    if length == 0.0:
        return False
    along = float((place - start) @ chord) / length
    across = abs(float(chord[0] * (place - start)[1] - chord[1] * (place - start)[0])) / length
    return GAP < along < length - GAP and across < GAP


def _fitting(mode: str) -> int:
    """The size of letters with which a mode fits into its mark."""
    return max(7, min(15, round(NODE / (0.68 * max(len(mode), 1)))))


def _arc(
    start: Any, end: Any, bend: float, repeat: int, kind: str, count: str, named: bool
) -> dict[str, Any]:  # fmt: skip
    """A curve that bends to the left of its direction, an arrow at its end, a number beside its middle."""
    s = np.linspace(0, 1, 25)[:, None]
    if np.array_equal(start, end):
        angle = np.pi / 2 + (2 * s - 1) * 2.4
        radius = 0.25 + 0.1 * repeat
        middle = start + np.array([0.0, GAP - 0.05 + radius])
        curve = middle + radius * np.hstack([np.cos(angle), np.sin(angle)])
    else:
        chord = end - start
        middle = (start + end) / 2 + np.array([-chord[1], chord[0]]) * bend
        curve = (1 - s) ** 2 * start + 2 * s * (1 - s) * middle + s**2 * end
        far = [np.linalg.norm(curve - point, axis=1) > GAP for point in (start, end)]
        curve = curve[far[0] & far[1]] if np.any(far[0] & far[1]) else curve
    n, colour = len(curve), COLOURS.get(kind, INK)
    beside = "bottom center" if middle[1] < min(start[1], end[1]) else "top center"  # away from the chord
    symbols, sizes, texts = ["circle"] * n, [0] * n, [""] * n
    symbols[-1], sizes[-1], texts[n // 2] = "arrow", 13, f"<b>{plain(count)}</b>"
    return {
        "type": "scatter", "mode": "lines+markers+text", "x": curve[:, 0].tolist(), "y": curve[:, 1].tolist(),
        "line": {"color": colour, "width": 1.6}, "text": texts, "textposition": beside,
        "textfont": {"color": colour, "size": 13}, "name": plain(kind), "showlegend": named,
        "hoverinfo": "name", "legendgroup": kind,
        "marker": {"symbol": symbols, "size": sizes, "angleref": "previous", "color": colour},
    }  # fmt: skip
