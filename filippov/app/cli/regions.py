"""filippov regions and filippov basin: what holds where, over two parameters or two initial states."""

from __future__ import annotations

from typing import Any

import numpy as np

from filippov.app.cli.configuration import ENGINE_NAMES, unused
from filippov.app.cli.console import Console
from filippov.app.cli.folder import Folder
from filippov.app.cli.model import Loaded, load_model, loaded_of
from filippov.app.cli.sections.along import OF_A_STROBE, follows_solution, number_of, section_along
from filippov.app.cli.sections.maps import CONDITION, PARTS, interval_of, section_of
from filippov.app.cli.sweep import engine
from filippov.base.errors import UsageError
from filippov.plot.regions import plot_basin, plot_periods, plot_regions

# Along each axis where nothing is said.
CELLS = 60


def _axes(settings: dict[str, Any], what: str) -> list[tuple[str, list[float]]]:
    """The two axes of --over, the horizontal one first. Raises UsageError."""
    over, axes = settings["over"], []
    if len(over) != 2:
        raise UsageError(
            f"which {what}? give --over NAME=LOW:HIGH for each of the two axes, the horizontal one first"
            + (f"; given {', '.join(over)}." if over else ".")
        )
    for name, (low, high, said) in over.items():
        if not low < high:
            raise UsageError(f"--over is {name}={low:g}:{high:g}, expected LOW < HIGH.")
        cells = number_of(said, settings["cells"], "cells") or CELLS
        # A sweep writes initial states as x0.NAME; the plane of a basin has no other ones.
        own = name.removeprefix("x0.") if what == "states" else name
        axes.append((own, np.linspace(low, high, cells).tolist()))
    return axes


def run_regions(settings: dict[str, Any], console: Console) -> int:
    """Write the cells as rows and as a picture; after Ctrl-C those that are done."""
    loaded = loaded_of(settings)
    values = loaded.values(settings["parameters"])
    x, y = _axes(settings, "parameters")
    if _follows(loaded, settings):
        return _run_periods(loaded, settings, console, x, y, values)
    unused(settings, ("transient", "keep"), "returns are dropped and kept along the solution from --x0")
    section, interval = section_of(loaded, settings, "positive"), interval_of(loaded, settings)
    folder = Folder(settings["output"], console)
    from filippov.analysis.diagrams import regions as module

    with console.progress("regions") as progress:
        result = module.regions(
            loaded.system, section, x, y, interval, order=settings["order"], points=settings["points"],
            rtol=settings["rtol"], parameters={k: v for k, v in values.items() if k not in (x[0], y[0])},
            engine=engine(settings, folder), progress=progress, borders=settings["borders"] or (),
        )  # fmt: skip
    data = {"model": loaded.name} | result.to_dict()
    console.result(data)
    console.say(str(result))
    folder.json("regions.json", data)
    columns = (x[0], y[0], "cycles", "stable", "undecided", "set_verdict", "amplitude", "lost")
    grid = np.meshgrid(result.x, result.y)
    cells = [a.ravel().tolist() for a in (
        *grid, result.cycles, result.stable, result.undecided, result.set_verdict, result.amplitude,
        result.lost,
    )]  # fmt: skip
    folder.csv("regions.csv", columns, zip(*cells, strict=True))
    folder.picture("regions.png", lambda: plot_regions(
        result, title=loaded.title,
    ))  # fmt: skip
    folder.report()
    return 0 if result.complete else 130


def _follows(loaded: Loaded, settings: dict[str, Any]) -> bool:
    """Whether solutions from one state are followed: a state or a strobe is given, or the model is forced."""
    parts = (*(name for name in PARTS if name != "coordinate"), CONDITION, "interval")
    named = any(settings.get(name) is not None for name in parts)
    own = getattr(loaded.model, "section", None)
    if named or own is not None or settings["x0"] is not None or loaded.x0 is None:
        asked = any(settings[name] is not None for name in ("x0", *OF_A_STROBE))
        return asked and follows_solution(loaded, settings)
    from filippov.analysis.steady.forcing import is_forced

    return is_forced(loaded.system)


def _run_periods(
    loaded: Loaded, settings: dict[str, Any], console: Console, x: Any, y: Any, values: dict[str, float]
) -> int:
    """Write the period in every cell as rows and as a picture."""
    if settings["borders"]:
        raise UsageError("--borders is for cycles of an event map; leave it out where --x0 is followed.")
    why = "the solution from a state is followed, in this process, and no cycles of a map are looked for"
    unused(settings, ("order", "points", *ENGINE_NAMES), why)
    section, x0 = section_along(loaded, settings, values, console, (x[0], x[1][0], x[1][-1]))
    folder = Folder(settings["output"], console)
    from filippov.analysis.diagrams.period_map import period_map

    with console.progress("regions") as progress:
        result = period_map(
            loaded.system, section, x, y, x0, transient=settings["transient"], keep=settings["keep"],
            rtol=settings["rtol"], progress=progress,
            parameters={k: v for k, v in values.items() if k not in (x[0], y[0])},
        )  # fmt: skip
    data = {"model": loaded.name} | result.to_dict()
    console.result(data)
    console.say(str(result))
    folder.json("regions.json", data)
    grid = np.meshgrid(result.x, result.y)
    cells = [a.ravel().tolist() for a in (*grid, result.period, result.d)]
    notes = [note for row in result.notes for note in row]
    folder.csv("regions.csv", (x[0], y[0], "period", "d", "note"), zip(*cells, notes, strict=True))
    folder.picture("regions.png", lambda: plot_periods(
        result, title=loaded.title,
    ))  # fmt: skip
    folder.report()
    return 0 if result.complete else 130


def run_basin(settings: dict[str, Any], console: Console) -> int:
    """Write the labels and their picture; after Ctrl-C those that are done."""
    loaded = load_model(settings["model"])
    values = loaded.values(settings["parameters"])
    x, y = _axes(settings, "states")
    section, (lo, hi) = section_of(loaded, settings), interval_of(loaded, settings)
    folder = Folder(settings["output"], console)
    from filippov.analysis.diagrams import basin as module

    interval = (min(lo, -hi), hi)
    with console.progress("basin") as progress:
        result = module.basin(
            loaded.system, section, x, y, interval, at=settings["at"], parameters=values,
            order=settings["order"], rtol=settings["rtol"], engine=engine(settings, folder),
            progress=progress,
        )  # fmt: skip
    data = {"model": loaded.name} | result.to_dict()
    console.result(data)
    console.say(str(result))
    folder.json("basin.json", data)
    arrays = {"x": result.x, "y": result.y, "label": result.label, "d": result.d}
    folder.content("basin.npz", lambda file: np.savez_compressed(file, allow_pickle=False, **arrays))
    folder.picture("basin.png", lambda: plot_basin(result))
    folder.report()
    return 0 if result.complete else 130
