"""Mode graphs of more modes than a figure has room for: groups of them, or those entered most often."""

from __future__ import annotations

import math
from collections import Counter

import networkx as nx
import numpy as np
import numpy.typing as npt

Point = npt.NDArray[np.float64]
# Of an observed graph: so many modes by themselves, the others together.
MOST_ALONE = 10
# Steps between groups in a row, half axes of the ellipse of modes around the others.
STEP, WIDE, HIGH = 1.5, 4.2, 2.6


def summary(graph: nx.MultiDiGraph) -> tuple[nx.MultiDiGraph, dict[str, Point], str]:
    """(graph of the groups, their places, what it shows); arcs have the number of transitions as "count"."""
    observed = any("visits" in data for _, data in graph.nodes(data=True))
    return _frequented(graph) if observed else _by_sliding(graph)


def _by_sliding(graph: nx.MultiDiGraph) -> tuple[nx.MultiDiGraph, dict[str, Point], str]:
    """A group for each number of sliding surfaces, in a row; transitions between them by kind."""
    number = {mode: mode.count("0") for mode in graph}
    sizes = Counter(number.values())
    names = {k: f"{k} slide{'s' * (k == 1)}\n{_counted(sizes[k])}" for k in sorted(sizes)}
    group = {mode: names[number[mode]] for mode in graph}
    places = {name: np.array([STEP * place, 0.0]) for place, name in enumerate(names.values())}
    start = graph.graph.get("start")
    out = _merged(graph, group, list(names.values()), group.get(start, ""))
    for k, name in names.items():
        out.nodes[name]["sliding"] = "some" if k else ""
    surfaces = max(map(len, graph))
    text = f"{len(graph)} modes by how many of {surfaces}\nsurfaces slide, with the transitions counted"
    return out, places, text


def _frequented(graph: nx.MultiDiGraph) -> tuple[nx.MultiDiGraph, dict[str, Point], str]:
    """The modes that were entered most often, or held longest, around the others."""

    def rank(mode: str) -> tuple[float, float]:
        data = graph.nodes[mode]
        return -data["visits"], -data["visits"] * data["dwell_mean"]

    alone = set(sorted(graph, key=rank)[:MOST_ALONE])
    others = f"{len(graph) - len(alone)} other modes"
    group = {mode: mode if mode in alone else others for mode in graph}
    shown = [mode for mode in graph if mode in alone]
    out = _merged(graph, group, [*shown, others], graph.graph.get("start"), others)
    for mode in shown:
        out.nodes[mode].update(graph.nodes[mode])
    places = {others: np.zeros(2)}
    for k, mode in enumerate(shown):
        angle = math.pi / 2 - 2 * math.pi * k / len(shown)
        places[mode] = np.array([WIDE * math.cos(angle), HIGH * math.sin(angle)])
    return out, places, f"of {len(graph)} modes the {len(alone)} entered most often, or held longest"


def _merged(
    graph: nx.MultiDiGraph, group: dict[str, str], names: list[str], start: str | None, apart: str = ""
) -> nx.MultiDiGraph:
    """The graph of the groups: one arc for each kind between two, none within the group `apart`."""
    out = nx.MultiDiGraph(start=start, time_unit=graph.graph.get("time_unit", ""))
    out.add_nodes_from(names)
    counts: Counter[tuple[str, str, str]] = Counter()
    for a, b, data in graph.edges(data=True):
        counts[group[a], group[b], str(data.get("kind", ""))] += int(data.get("count", 1))
    for (a, b, kind), count in counts.items():
        if a != b or a != apart:
            out.add_edge(a, b, kind=kind, count=count, surface="")
    return out


def _counted(n: int) -> str:
    return f"{n} mode{'s' * (n != 1)}"
