"""filippov attractors and filippov manifold: where solutions go, and the curves that part them."""

from __future__ import annotations

from typing import Any

from filippov.app.cli.configuration import unused
from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.model import Loaded, load_model
from filippov.app.cli.sections.maps import CONDITION, PARTS, section_of
from filippov.base.errors import UsageError
from filippov.base.escape import printable
from filippov.plot.attractors import plot_attractors
from filippov.plot.manifold import plot_manifold

KEEP = (
    "period", "step", "samples", "seed", "resolution", "cells", "recurrences", "most", "reach", "escape",
    "rtol", "store",
)  # fmt: skip


def _section(loaded: Loaded, settings: dict[str, Any]) -> Any:
    """The section that the flags describe; None where no flag does."""
    named = any(settings.get(name) is not None for name in (*PARTS, CONDITION))
    return section_of(loaded, settings) if named else None


def run_attractors(settings: dict[str, Any], console: Console) -> int:
    """Write what was found and its picture; after Ctrl-C what is done."""
    loaded = load_model(settings["model"])
    values = loaded.values(settings["parameters"])
    if not settings["box"]:
        raise UsageError("in which box of states? give --box STATE=LOW:HIGH for every state.")
    plane = settings["plane"]
    if plane is not None and len(plane) != 2:
        raise UsageError(f"--plane has {len(plane)} names, expected two states with a comma.")
    if plane is None:
        unused(settings, ("at", "resolution"), "a picture of basins needs --plane")
    folder = Folder(settings["output"], console)
    from filippov.analysis.invariant_sets.attractors import attractors as find
    options = {name: settings[name] for name in KEEP if settings.get(name) is not None}
    with console.progress("attractors") as progress:
        found = find(
            loaded.system, settings["box"], parameters=values, section=_section(loaded, settings),
            plane=None if plane is None else tuple(plane), at=settings["at"] or None, progress=progress,
            **options,
        )  # fmt: skip
    for line in found.lines():
        console.say(line)
    if not found.complete and settings["store"] is not None:
        console.warn(f"interrupted; the same command goes on from {printable(settings['store'])}")
    console.result({"model": loaded.name} | found.to_dict())
    folder.file("attractors.json", found.save)
    columns = (*(f"x0.{name}" for name in loaded.system.states), "label")
    rows = [[*x, n] for x, n in zip(found.states.tolist(), found.label.tolist(), strict=True)]
    folder.csv("attractors.csv", columns, rows)
    folder.picture("attractors.png", lambda: plot_attractors(found, title=loaded.title))
    folder.report()
    return 0 if found.complete else 130


def run_manifold(settings: dict[str, Any], console: Console) -> int:
    """Write the manifold of a saddle near --x0, or of the orbit there, as points and as a picture; with
    --side both the two of them, in a list."""
    loaded = load_model(settings["model"])
    problem = loaded.problem({**settings, "t_span": (0.0, 1.0)})
    if settings["length"] is None:
        raise UsageError("how long? give --length ARCLENGTH.")
    if settings["orbit"]:
        unused(settings, ("mode",), "it is of a saddle, and --orbit follows an orbit")
    else:
        unused(settings, ("period",), "no orbit is looked for without --orbit")
    folder = Folder(settings["output"], console)
    from filippov.analysis.invariant_sets.manifold import manifold as draw

    section = _section(loaded, settings)
    at: Any = problem.x0
    given: dict[str, Any] = {"parameters": problem.parameters, "mode": settings["mode"]}
    if settings["orbit"]:
        from filippov.analysis.orbits.orbit_search import find_orbit as find

        at = find(problem.system, problem.x0, parameters=problem.parameters, period=settings["period"])
        given = {}
    options = {
        name: settings[name] for name in ("spacing", "offset", "rtol") if settings.get(name) is not None
    }
    sides = ("unstable", "stable") if settings["side"] == "both" else (settings["side"],)
    found = []
    with console.progress("manifold") as progress:
        for number, side in enumerate(sides):
            found.append(draw(
                problem.system, at, side, length=settings["length"], section=section, **given, **options,
            ))  # fmt: skip
            progress(number + 1, len(sides))
    for one in found:
        for line in one.lines():
            console.say(line)
    parts = [one.to_dict() for one in found]
    data = {"model": loaded.name} | (parts[0] if len(parts) == 1 else {"manifolds": parts})
    console.result(data)
    folder.json("manifold.json", data)
    rows = [
        [one.side, number, *x] for one in found for number, b in enumerate(one.branches, 1) for x in
        b.x.tolist()
    ]  # fmt: skip
    folder.csv("manifold.csv", ("side", "branch", *problem.system.states), rows)
    folder.picture("manifold.png", lambda: plot_manifold(found, names=settings["plane"], title=loaded.title))
    folder.report()
    return 0
