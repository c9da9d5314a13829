"""filippov continue: a branch of orbits, fixed points of an event map, or equilibria over a parameter."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

from filippov.commands.console import Console
from filippov.commands.folder import Folder
from filippov.commands.maps import section_of
from filippov.commands.model import Loaded, load_model
from filippov.errors import UsageError
from filippov.names import unknown

FILE = "branch.json"


def run(settings: dict[str, Any], console: Console) -> int:
    """Follow the branch; write branch.json, branch.csv and branch.png, also when interrupted."""
    loaded = load_model(settings["model"])
    parameter = settings["parameter"]
    if parameter is None:
        raise UsageError("which parameter? give --parameter NAME --from LO --to HI.")
    if parameter not in loaded.system.parameters:
        raise UsageError(unknown("parameter", parameter, loaded.system.parameters))
    if settings["from"] is None or settings["to"] is None:
        raise UsageError(f"over which values of {parameter}? give --from LO --to HI.")
    first, last = settings["from"], settings["to"]
    bounds = (min(first, last), max(first, last))
    folder = Folder(settings["output"], console)
    module = importlib.import_module("filippov.analysis.continuation")
    branches = importlib.import_module("filippov.analysis.branch")
    resume = branches.Branch.load(settings["resume"]) if settings["resume"] else None
    values = loaded.values(settings["parameters"]) | {parameter: first}
    names = ("step", "max_step", "max_points", "max_time")
    options = {name: settings[name] for name in names if settings[name] is not None}
    begin, extra = _start(loaded, settings, values, console)
    follow = module.continuation(
        loaded.system, begin, parameter=parameter, bounds=bounds, direction=1 if last >= first else -1,
        resume=resume, **extra, **options,
    )  # fmt: skip
    with console.progress("continuation") as progress:
        branch = follow.run(progress)
    _tell(branch, console)
    data = {"model": loaded.name, "parameter": parameter, "parameters": branch.parameters,
            "kind": branch.kind, "message": branch.message,
            "special": [_row(point, branch) for point in branch.special],
            "points": [_row(point, branch) for point in branch.points]}  # fmt: skip
    console.result(data)
    columns = ("special", "value", "stable", "word", "period", *_coordinates(branch))
    folder.csv("branch.csv", columns, ([_row(q, branch).get(c) for c in columns] for q in branch.points))
    folder.file(FILE, branch.save)
    folder.picture("branch.png", lambda: branch.plot(title=loaded.name))
    folder.report()
    if "interrupted" in branch.message:
        where = Path(settings["output"] or ".") / FILE
        console.say(f"go on with --resume {where}")
        return 130
    return 0


def _start(
    loaded: Loaded, settings: dict[str, Any], values: dict[str, float], console: Console
) -> tuple[Any, dict[str, Any]]:
    """What the continuation starts from: a fixed point at --start, an equilibrium of --mode, an orbit."""
    if settings["mode"] is not None:
        if settings["x0"] is None:
            raise UsageError("an equilibrium needs a state near it: --x0.")
        state = loaded.problem({"x0": settings["x0"], "t_span": (0.0, 1.0)}).x0
        return state, {"mode": settings["mode"], "parameters": values}
    if settings["start"] is not None:
        maps = importlib.import_module("filippov.analysis.event_map")
        section = section_of(loaded, settings)
        return (maps.EventMap(loaded.system, section, parameters=values, order=2), settings["start"]), {}
    find = importlib.import_module("filippov.analysis.orbit_search").find_orbit
    problem = loaded.problem({"x0": settings["x0"], "t_span": (0.0, 1.0), "parameters": values})
    with console.progress("orbit") as progress:
        orbit = find(problem.system, problem.x0, parameters=values, progress=progress)
    return orbit, {}


def _coordinates(branch: Any) -> list[str]:
    return list(branch.points[0].coordinates) if branch.points else []


def _row(point: Any, branch: Any) -> dict[str, Any]:
    """A point as a row of the table."""
    row = {
        "special": point.special, "value": point.value, "stable": point.stable, "word": point.word,
        "period": point.period, "note": point.note,
    }  # fmt: skip
    return row | {name: point.coordinates.get(name) for name in _coordinates(branch)}


def _tell(branch: Any, console: Console) -> None:
    console.say(f"{len(branch.points)} points; {branch.message}")
    for point in branch.special:
        console.say(str(point))
