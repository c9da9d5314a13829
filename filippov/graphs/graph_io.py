"""Mode graphs as files: DOT for Graphviz, GraphML and JSON for other programs.

JSON is networkx's node-link form: {"directed": true, "multigraph": true, "graph": {...}, "nodes": [{"id",
...}], "edges": [{"source", "target", "key", ...}]}; networkx.node_link_graph(data, edges="edges") reads it.
Attributes are those of `filippov.graphs.graph`; `conditions`, which are sympy objects, are left out (their
text is `formula`). GraphML knows only plain values: there lists are texts with blanks between the entries.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import networkx as nx

from filippov.base.errors import UsageError
from filippov.base.escape import printable
from filippov.base.json_text import json_text as as_json
from filippov.base.keywords import keywords
from filippov.base.names import unknown
from filippov.base.read_whole import read_json
from filippov.base.whole_file import write_whole

LARGEST_FILE = 64 << 20
_PLAIN = (str, int, float, bool)


@keywords()
def save_graph(graph: nx.MultiDiGraph, path: str | Path) -> Path:
    """Write a graph in the format of the suffix: .dot or .gv, .graphml, .json. Returns the path."""
    target = Path(path)
    writers = {".dot": dot_text, ".gv": dot_text, ".graphml": graphml_text, ".json": json_text}
    if target.suffix.lower() not in writers:
        raise UsageError(unknown("format of a graph", target.suffix, writers))
    return write_whole(target, writers[target.suffix.lower()](graph))


def json_text(graph: nx.MultiDiGraph) -> str:
    """The graph in node-link form."""
    data = {
        "directed": True,
        "multigraph": True,
        "graph": _plain(graph.graph),
        "nodes": [{"id": mode, **_plain(values)} for mode, values in graph.nodes(data=True)],
        "edges": [
            {"source": a, "target": b, "key": key, **_plain(values)}
            for a, b, key, values in graph.edges(keys=True, data=True)
        ],
    }
    return as_json(data)


@keywords()
def load_graph(path: str | Path) -> nx.MultiDiGraph:
    """Read a graph written as JSON. Raises UsageError for anything else."""
    try:
        data = read_json(path, LARGEST_FILE)
        graph = nx.MultiDiGraph(**data["graph"])
        for node in data["nodes"]:
            graph.add_node(node.pop("id"), **node)
        for edge in data["edges"]:
            graph.add_edge(edge.pop("source"), edge.pop("target"), key=edge.pop("key"), **edge)
    except OSError as error:
        raise UsageError(
            f"{str(path)!r} cannot be read ({error.strerror or error}), expected a graph as save_graph(graph,"
            " 'x.json') writes it."
        ) from None
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise UsageError(
            f"{str(path)!r} is not a graph in node-link JSON, as save_graph(graph, 'x.json') writes it "
            f"({error})."
        ) from None
    return graph


def graphml_text(graph: nx.MultiDiGraph) -> str:
    """The graph as GraphML, with edges numbered e0, e1, ..."""
    flat = nx.MultiDiGraph(**_flat(graph.graph))
    for mode, values in graph.nodes(data=True):
        flat.add_node(mode, **_flat(values))
    for number, (a, b, values) in enumerate(graph.edges(data=True)):
        flat.add_edge(a, b, key=f"e{number}", **_flat(values))
    return "\n".join(nx.generate_graphml(flat, named_key_ids=True)) + "\n"


def dot_text(graph: nx.MultiDiGraph) -> str:
    """The graph in Graphviz's language; sliding modes are filled boxes, the first mode has a bold border."""
    lines = ["digraph modes {", "  rankdir=LR;", '  node [shape=ellipse, fontname="Helvetica"];',
             '  edge [fontname="Helvetica", fontsize=10];']  # fmt: skip
    for mode, values in graph.nodes(data=True):
        shape = ', shape=box, style=filled, fillcolor="#fde3c8"' if values.get("sliding") else ""
        border = ", penwidth=2" if graph.graph.get("start") == mode else ""
        lines.append(f"  {quoted(mode)} [label={quoted(node_label(mode, values))}{shape}{border}];")
    for a, b, values in graph.edges(data=True):
        lines.append(f"  {quoted(a)} -> {quoted(b)} [label={quoted(edge_label(values))}];")
    return "\n".join([*lines, "}"]) + "\n"


def quoted(text: object) -> str:
    """A DOT string: backslashes and quotes escaped, line ends as backslash n."""
    escaped = printable(text, "\n").replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{escaped}"'


def node_label(mode: str, values: Mapping[str, Any]) -> str:
    """What stands in a node: the mode, and the visits and mean dwell time where they were observed."""
    if "visits" not in values:
        return mode
    return f"{mode}\n{values['visits']} × {values['dwell_mean']:.4g}"


def edge_label(values: Mapping[str, Any]) -> str:
    """What stands at an edge: surface and kind, with the count or the guard."""
    name = f"{values.get('surface', '')}: {values.get('kind', '')}"
    if "count" in values:
        return f"{name} ({values['count']})"
    return f"{name}\n{values['formula']}" if "formula" in values else name


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    return dict(_kept(values))


def _kept(values: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    for name, value in values.items():
        if isinstance(value, _PLAIN):
            yield name, value
        elif isinstance(value, list):
            yield name, [list(v) if isinstance(v, list) else v for v in value]


def _flat(values: Mapping[str, Any]) -> dict[str, Any]:
    # XML has no control characters, not even escaped.
    return {
        printable(name): printable(v) if isinstance(v, str) else _joined(v) if isinstance(v, list) else v
        for name, v in _kept(values)
    }


def _joined(value: list[Any]) -> str:
    return " ".join(_joined(v) if isinstance(v, list) else printable(v) for v in value)
