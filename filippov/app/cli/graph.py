"""filippov graph: the possible transitions of a model, or those that a solution made."""

from __future__ import annotations

import json
from typing import Any

from filippov.app.cli.configuration import COMMON, unused
from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.model import loaded_of
from filippov.app.cli.solved import exit_code, solved
from filippov.base.errors import ModelError
from filippov.graphs.graph import observed_graph, possible_graph, recurrent_part
from filippov.graphs.graph_io import json_text, save_graph

SUFFIXES = (".dot", ".graphml", ".json")


def run(settings: dict[str, Any], console: Console) -> int:
    """Make the graph and write it in every format."""
    loaded = loaded_of(settings)
    values = loaded.values(settings["parameters"])
    folder = Folder(settings["output"], console)
    code = 0
    if settings["kind"] == "observed":
        unused(settings, ("numbers", "limit"), "modes and formulas are listed with --kind possible")
        solution = solved(loaded.problem(settings), settings, console, dense=False)
        graph = observed_graph(solution)
        code = exit_code(solution)
        if code:
            console.warn(f"{solution.status.value}: {solution.message}")
    elif loaded.system.symbolic is None:
        raise ModelError(
            f"{loaded.name} is given by plain functions, so its possible transitions cannot be listed. "
            "Use --kind observed, which follows a solution."
        )
    else:
        own = {"kind", "recurrent", "numbers", "limit", "model", "parameters", "input"}
        others = [name for name in settings if name not in own | {option.name for option in COMMON}]
        unused(settings, others, "a solution is followed with --kind observed")
        chosen = {} if settings["limit"] is None else {"limit": settings["limit"]}
        with console.progress("modes") as progress:
            graph = possible_graph(
                loaded.system, parameters=values if settings["numbers"] else None, progress=progress, **chosen
            )
        if not graph.graph["complete"]:
            known = sum(bool(data.get("expanded")) for _, data in graph.nodes(data=True))
            console.warn(f"the ways out of {known} of {len(graph)} modes are listed; --limit N lists more")
    if settings["recurrent"]:
        graph = recurrent_part(graph)
    console.result(json.loads(json_text(graph)))
    for mode, data in graph.nodes(data=True):
        dwell = f"  {data['visits']} visits, mean {data['dwell_mean']:.6g}" if "visits" in data else ""
        console.say(f"{mode}{'  sliding on ' + data['sliding'] if data.get('sliding') else ''}{dwell}")
    for before, after, data in graph.edges(data=True):
        what = data.get("formula") or f"{data['count']} times"
        console.say(f"{before} -> {after}  {data['surface']}: {data['kind']}  {what}")
    for suffix in SUFFIXES:
        folder.file("graph" + suffix, lambda path: save_graph(graph, path))
    folder.picture("graph.png", lambda: _draw(graph, loaded.title))
    folder.report()
    return code


def _draw(graph: Any, title: str) -> Any:
    from filippov.plot.solution import plot_graph

    return plot_graph(graph, title=title)
